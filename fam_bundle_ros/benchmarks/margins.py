# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Gain margin of any controller on any plant, and gains of the baselines at a given margin.

The margin is measured in the closed loop, in the same way for all: the deviation of the controlled
quantity from its operating point is multiplied by k (the loop gain times k); the margin is the
smallest k from 1 on at which the response to a small step no longer settles, without noise, at the
worst operating point. A baseline is scaled to the required margin, or to a share of the gains at
that margin, with several filters and ratios of gain to integral; the one with the smallest product
of squared error and air on steps and a sine is used.
"""

from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
import math

import numpy as np

from fam_bundle_ros.benchmarks.control_trajectories import (
    make_trajectory,
    mass_spring,
    STRAIN,
    top_force,
)
from fam_bundle_ros.benchmarks.plants import model_of, plant_of, PLANTS
from fam_bundle_ros.control import ControllerConfig, OuterConfig, PidConfig, PidGains, tune
from fam_bundle_ros.control.adaptation import AdaptationConfig
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Dynamometer, RigConfig
from fam_bundle_ros.simulation import ClosedLoop, pid_config, Trajectory

#: Sample periods of the pressure loops and of the controller, s.
PID_PERIOD, PERIOD = 2e-3, 4e-3
#: Largest gain margin required of a baseline (6 dB), even if ours is larger.
USUAL_MARGIN = 2.0
#: Smallest gain margin required of a baseline.
_LEAST_MARGIN = 1.25
#: Gain factors that are tried, 3 dB apart, upwards and downwards; resolution of the limit.
_UP, _DOWN, _EXACT = np.geomspace(1.0, 64.0, 13), np.geomspace(1.0, 0.1, 8), 1.12
#: Time before the step, and of each of two intervals after it, s; the response must have settled
#: in the second one.
_BEFORE, _AFTER = 0.2, 0.9
#: Operating points: shares of the largest force, and strain; steps: share of force, and strain.
_LEVELS, _PLACE, _STEP_SHARE, _STEP_STRAIN = (0.25, 0.75), 0.09, 0.06, 6e-3
#: Oscillations below this multiple of the step are hunting, not instability.
_HUNTING = 1.25
#: Ratios of gain to integral (s) and filter times (s) of the baselines that are tried.
RATIOS, FILTERS = (0.0, 0.012, 0.03, 0.08), (5e-3, 20e-3)
#: Shares of the gains at our margin that are tried; smaller ones give less noise and air.
SHARES = (1.0, 0.5, 0.25)
#: Trajectories for choosing the gains.
_JUDGES = {'force': ('steps', 'sine_0.5'), 'strain': ('strain_steps', 'strain_sine')}


@dataclass(frozen=True)
class Controller:
    """A controller of the benchmark: policy and scheme, feedback, knowledge of the load."""

    policy: str = 'reversal_aware'
    scheme: str = 'orderly'
    feedback: bool = True
    told_load: bool = True

    @property
    def baseline(self) -> bool:
        """Whether it has no model."""
        return self.scheme in ('equal_pressure', 'threshold')


#: Name -> controller; the first is ours, the second its reference.
CONTROLLERS = {
    'reversal_aware': Controller(), 'equal_pressure': Controller(scheme='equal_pressure'),
    'threshold': Controller(scheme='threshold'), 'hysteresis': Controller('hysteresis'),
    'neglect': Controller('neglect'), 'batch': Controller(scheme='batch'),
    'all_on': Controller(scheme='all_on'),
    'untold_load': Controller(told_load=False), 'no_feedback': Controller(feedback=False),
    'diagnosed': Controller(),
}


@cache
def pressure_gains(delay: float) -> PidGains:
    """Return the gains of `tune` for a dead time, the same for all controllers."""
    return tune(sample_period=PID_PERIOD, transport_delay=delay).gains


def pid_settings(rig: RigConfig, delay: float, noise_factor: float) -> PidConfig:
    """Return the settings of pressure loops for a plant: nominal valve, true dead time."""
    nominal = replace(RigConfig().valve, conductance=rig.valve.conductance)
    config = pid_config(replace(rig, valve=nominal), PID_PERIOD, noise_factor)
    return replace(config, transport_delay=delay)


def loop_of(plant: str, units: int, controller: Controller, baseline: BaselineConfig,
            seed: int = 1, noise: float = 1.0, deviation: tuple[float, float] = (1.0, 0.0),
            model: Bundle | None = None) -> ClosedLoop:
    """
    Return the closed loop of a case.

    ``baseline`` has the gains for the schemes without a model; ``noise`` is a factor on the noise
    of the plant's sensors, ``deviation`` that of `ClosedLoop`, ``model`` that of the controller.
    """
    kind = PLANTS[plant]
    config = ControllerConfig(policy=controller.policy, scheme=controller.scheme,
                              baseline=baseline,
                              outer=OuterConfig(feedback=controller.feedback, delay=kind.delay),
                              adaptation=AdaptationConfig(enabled=controller.feedback))
    return ClosedLoop(plant_of(plant, units), model or model_of(plant, units), config, kind.rig,
                      PERIOD, PID_PERIOD, pressure_gains(kind.delay),
                      pid_settings(kind.rig, kind.delay, kind.noise_factor),
                      kind.noise_factor * noise, seed, deviation=deviation,
                      told_load=controller.told_load)


def settles(plant: str, units: int, controller: Controller, baseline: BaselineConfig, kind: str,
            k: float) -> bool:
    """
    Return whether the response to a small step settles with the loop gain times ``k``.

    Hunting of about the size of the step, which backlash and friction cause at any gain, does not
    count as instability. The step is of a ``kind``, 'force' or 'strain'.
    """
    model, true = model_of(plant, units), plant_of(plant, units)
    if kind == 'force':
        top = top_force(STRAIN, model, true)
        points = [(share * top, _STEP_SHARE * top, Dynamometer(strain=STRAIN))
                  for share in _LEVELS]
    else:
        load = mass_spring(0.6 * top_force(0.14, model, true), 0.14, model.length)
        points = [(_PLACE, _STEP_STRAIN, load)]
    for level, step, load in points:
        trajectory = Trajectory(
            'step', kind, _BEFORE + 2.0 * _AFTER,
            partial(_step, level, step), lambda t: 0.0, load, prepare=1.2)
        log = loop_of(plant, units, controller, baseline, noise=0.0,
                      deviation=(k, level)).run(trajectory)
        first, last = (_oscillation(log.error, (log.time > begin) & (log.time <= begin + _AFTER))
                       for begin in (_BEFORE, _BEFORE + _AFTER))
        if last > max(0.5 * first, _HUNTING * step):
            return False
    return True


def _step(level: float, step: float, t: float) -> float:
    return level + (step if t > _BEFORE else 0.0)


def _oscillation(signal: np.ndarray, inside: np.ndarray) -> float:
    """Return the peak-to-peak deviation of part of a signal from its drift, a parabola."""
    x = np.linspace(-1.0, 1.0, int(inside.sum()))
    return float(np.ptp(signal[inside] - np.polyval(np.polyfit(x, signal[inside], 2), x)))


def gain_margin(plant: str, units: int, controller: Controller, baseline: BaselineConfig,
                kind: str) -> float:
    """
    Return the gain margin of a controller on a plant with a ``kind`` of reference, a factor.

    At most 64; for the definition see the module. Gains are tried from 1 upwards, as at a much
    larger gain a loop may come to rest again at a limit of its pressures. Below 1 if the loop does
    not settle with its own gain.
    """
    holds = partial(settles, plant, units, controller, baseline, kind)
    low = high = 1.0
    if holds(1.0):
        for high in _UP[1:].tolist():
            if not holds(high):
                break
            low = high
    else:
        for low in _DOWN[1:].tolist():
            if holds(low):
                break
            high = low
    while high / low > _EXACT:
        middle = math.sqrt(low * high)
        if holds(middle):
            low = middle
        else:
            high = middle
    return low


@cache
def our_margin(plant: str, units: int, kind: str) -> float:
    """Return the gain margin of `reversal_aware`."""
    return gain_margin(plant, units, CONTROLLERS['reversal_aware'], BaselineConfig(), kind)


def asked_margin(ours: float) -> float:
    """Return the margin required of a baseline: ours, but not above 6 dB."""
    return min(max(ours, _LEAST_MARGIN), USUAL_MARGIN)


@cache
def shape_of(plant: str, name: str, kind: str) -> tuple[float, float, float]:
    """Return ratio, filter time and share of the best baseline for two units."""
    units, margin = 2, asked_margin(our_margin(plant, 2, kind))

    def cost(shape):
        baseline = _scaled_to(plant, units, name, kind, shape, margin)
        return math.prod(_cost(plant, units, CONTROLLERS[name], baseline, judge)
                         for judge in _JUDGES[kind])
    return min(product(RATIOS, FILTERS, SHARES), key=cost)


@cache
def baseline_gains(plant: str, units: int, name: str, kind: str) -> BaselineConfig:
    """
    Return the gains of a baseline on a plant: those of `shape_of`, scaled to our margin.

    ``name`` is ``equal_pressure`` or ``threshold``, ``kind`` ``force`` or ``strain``.
    """
    margin = asked_margin(our_margin(plant, units, kind))
    return _scaled_to(plant, units, name, kind, shape_of(plant, name, kind), margin)


@cache
def _scaled_to(plant, units, name, kind, shape, margin) -> BaselineConfig:
    found = _critical(plant, units, name, kind, shape[:2])
    return _gains(kind, shape, found * shape[2] / margin)


@cache
def _critical(plant, units, name, kind, shape) -> float:
    """Return the factor on the default integral at which a baseline no longer settles."""
    return gain_margin(plant, units, CONTROLLERS[name], _gains(kind, shape, 1.0), kind)


def _gains(kind, shape, factor) -> BaselineConfig:
    """Return gains with an integral of ``factor`` times the default, 10 1/s or 2 1/s."""
    integral = factor * (10.0 if kind == 'force' else 2.0)
    values = {f'{kind}_integral': integral, f'{kind}_gain': shape[0] * integral,
              'filter_time': shape[1]}
    return BaselineConfig(**values)


def _cost(plant, units, controller, baseline, judge) -> float:
    """Return squared error times air of a run."""
    log = loop_of(plant, units, controller, baseline).run(
        make_trajectory(judge, model_of(plant, units), plant_of(plant, units)))
    return float(np.mean(log.error ** 2) * (log.air[-1] - log.air[0]))
