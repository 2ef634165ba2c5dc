# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node recruitment_controller, and the settings made from them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fam_bundle_ros.control import (
    AdaptationConfig,
    ControllerConfig,
    LoadModel,
    OuterConfig,
    SwitchingConfig,
)
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.control.recruitment import POLICIES
from fam_bundle_ros.control.safety import HOLD_TIME, OVER_PRESSURE_FACTOR
from fam_bundle_ros.control.spread import SCHEMES
from fam_bundle_ros.nodes.base import LATENCY, LISTENER, MODEL
from fam_bundle_ros.nodes.parameters import Spec

_SWITCHING, _OUTER, _BASELINE = SwitchingConfig(), OuterConfig(), BaselineConfig()
#: Usual limits of the force reading, N; those of a bundle with larger forces are larger.
_FORCES = -200.0, 5000.0
#: Fields of the schemes without a model that are parameters: name, meaning, largest value.
_BASELINE_FIELDS = (
    ('force_gain', 'gain on the force error, relative to the range of the force', 100.0),
    ('force_integral', 'gain on its integral, 1/s', 1e4),
    ('strain_gain', 'gain on the strain error, relative to a strain of 0.2', 100.0),
    ('strain_integral', 'gain on its integral, 1/s', 1e4),
    ('filter_time', 'low-pass filter of the reading, s', 10.0),
    ('dwell', 'shortest time between two switches of threshold, s', 60.0))
#: Fields of the outer loop that are parameters: name, meaning, largest value.
_OUTER_FIELDS = (
    ('delay', 'dead time from a change of force to the pressures that respond to it, s', 0.5),
    ('reading_share', 'share of outer.delay in the readings; the rest is in the commands', 1.0),
    ('bias_time', 'time constant of the fastest estimate of the force that the model omits, s',
     1e3),
    ('force_gain', 'gain on the force error, N/N', 10.0),
    ('force_integral', 'gain on the integral of the force error without feed-forward, 1/s', 1e3),
    ('strain_gain', 'gain on the strain error, N', 1e6),
    ('strain_integral', 'gain on the integral of the strain error, N/s', 1e7),
    ('strain_damping', 'gain on the error of the strain rate, N s', 1e5),
    ('still', 'smallest change of the correction of a strain error, N', 1e3),
    ('filter_time', 'low-pass filter of the force reading, s', 10.0),
    ('fade_time', 'decay time of the force at `enable`, for a start without a jump, s', 10.0))
#: Parameters of the load: name, meaning.
_LOAD_FIELDS = (('force', 'force at zero strain, N'), ('stiffness', 'stiffness, N per strain'),
                ('inertia', 'force per strain acceleration, N s^2'),
                ('damping', 'force per strain rate, N s'))


def _outer_spec(name: str, text: str, high: float) -> Spec:
    default = getattr(_OUTER, name)
    if default is None:
        return Spec(f'outer.{name}', -1.0, f'{text}; -1: computed', -1.0, high, dynamic=True)
    return Spec(f'outer.{name}', default, text,
                1e-4 if name.endswith('time') else 0.0, high, dynamic=True,
                # The gains of the strain loop follow from it.
                at_rest=name == 'delay')


SPECS = (
    replace(MODEL, text=f'{MODEL.text}; changes only while it is off', dynamic=True),
    *LISTENER, *LATENCY,
    Spec('start_enabled', False, 'start without a call of `enable`'),
    Spec('wait_for_reference', False, 'wait in lock-step for a reference of the same stamp: true '
         'if a reference_generator runs'),
    Spec('policy', 'reversal_aware', 'when to switch', choices=POLICIES, dynamic=True),
    Spec('scheme', 'orderly', 'how motor units share the force', choices=SCHEMES, dynamic=True),
    Spec('dwell', _SWITCHING.dwell, 'shortest time between opposite switches, s', 0.0, 60.0,
         dynamic=True),
    Spec('margin', -1.0, 'switching margin, N; -1: from model and noise', -1.0, 1e4,
         dynamic=True),
    Spec('hysteresis', -1.0, 'hysteresis, N; -1: from model and noise', -1.0, 1e4,
         dynamic=True),
    Spec('feed_forward', True, 'feed-forward of the reference by the model', dynamic=True),
    Spec('feedback', True, 'feedback of the measured error', dynamic=True),
    Spec('adaptation.enabled', True, 'adapt the model to its error during operation',
         dynamic=True),
    Spec('adaptation.memory', AdaptationConfig().memory, 'correlation time of model errors that '
         'no gain explains, s', 0.01, 1e3, dynamic=True),
    Spec('adaptation_file', '', 'model file that adaptation/save writes; by default the name of '
         'the model with _adapted, in the working directory'),
    *(_outer_spec(*entry) for entry in _OUTER_FIELDS),
    *(Spec(f'baseline.{name}', getattr(_BASELINE, name),
           f'schemes equal_pressure and threshold: {text}', 0.0, high, dynamic=True)
      for name, text, high in _BASELINE_FIELDS),
    *(Spec(f'load_model.{name}', 0.0, f'load of a strain reference: {text}; all load_model.* 0: '
           'identified as it moves', 0.0, 1e6,
           dynamic=True, at_rest=name != 'force') for name, text in _LOAD_FIELDS),
    Spec('reference_timeout', 0.0, 'vent and delete the reference when it is older, s; 0 for '
         'never', 0.0, 3600.0, dynamic=True, guards=True, zero_is_off=True),
    Spec('ramp_down_time', 0.5, 'duration of the pressure ramp when switching off, s', 0.0, 60.0,
         dynamic=True),
    Spec('e_stop_required', True, '`enable` refuses while no node publishes e_stop; false for a '
         'rig without an emergency stop'),
    Spec('over_pressure_factor', OVER_PRESSURE_FACTOR, 'vent and latch above the largest '
         'pressure times this', 1.0, 3.0, dynamic=True, guards=True),
    Spec('force_low', 0.0, 'smallest possible force reading, and reference, N; 0: -200, or minus '
         'half of the largest force of the model where that is lower', -1e5, 0.0),
    Spec('force_high', 0.0, 'largest possible force reading, and reference, N; 0: 5000, or twice '
         'the largest force of the model where that is more', 0.0, 1e5),
    Spec('strain_low', -0.2, 'smallest possible strain reading', -1.0, 0.0),
    Spec('strain_high', 0.6, 'largest possible strain reading', 0.0, 1.0),
    Spec('sensor_timeout', 0.1, 'a reading older than this is stale, s', 0.01, 10.0),
    Spec('hold_time', HOLD_TIME, 'time for which a bad reading holds the pressures before it '
         'vents, s', 0.0, 10.0),
    Spec('recovery_time', 0.2, 'time for which a reading must be good to be used again, s', 0.0,
         10.0),
    Spec('resume_within', 2.0, 'longest loss of sensors after which pressure returns without '
         '`enable`, s; 0: `enable` is always needed', 0.0, 3600.0, dynamic=True, guards=True),
    Spec('stuck_time', 0.5, 'a force that is exactly constant for this time while pressures '
         'change is stuck, s; 0 for a load cell without noise', 0.0, 60.0),
    Spec('strain_stuck_time', 0.0, 'the same for strain; 0, for never, as a load may hold it',
         0.0, 60.0),
)


def force_limits(largest: float, low: float = 0.0, high: float = 0.0) -> tuple[float, float]:
    """
    Return the smallest and largest possible force reading, N.

    ``low`` and ``high`` are ``force_low`` and ``force_high`` (N), 0 for a limit that follows from
    the ``largest`` force of the model (N).
    """
    return low or min(_FORCES[0], -0.5 * largest), high or max(_FORCES[1], 2.0 * largest)


def controller_config(values: Mapping[str, Any]) -> ControllerConfig:
    """Return the controller's settings; InputError if they are not consistent."""
    outer: dict[str, Any] = {
        name: _by_hand(values[f'outer.{name}']) for name, _, _ in _OUTER_FIELDS}
    return ControllerConfig(
        policy=values['policy'], scheme=values['scheme'], hold_time=values['hold_time'],
        switching=SwitchingConfig(
            dwell=values['dwell'], margin=_by_hand(values['margin']),
            hysteresis=_by_hand(values['hysteresis'])),
        outer=OuterConfig(
            feed_forward=values['feed_forward'], feedback=values['feedback'],
            **outer),
        baseline=BaselineConfig(**{name: values[f'baseline.{name}']
                                   for name, _, _ in _BASELINE_FIELDS}),
        adaptation=AdaptationConfig(enabled=values['adaptation.enabled'],
                                    memory=values['adaptation.memory']),
        load=LoadModel(**{name: values[f'load_model.{name}'] for name, _ in _LOAD_FIELDS}))


def _by_hand(value: float) -> float | None:
    """Return None for -1, by which ROS parameters ask for the computed value."""
    return None if value < 0.0 else value
