# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The recruitment controller: a force or strain reference in, one gauge pressure per motor unit out.

Each tick: reference and readings give a force demand (`outer`), the model's curves at this strain
are computed (`allocation`), the state machine switches (`recruitment`), and the demand is
allocated to the active units, while a crossing unit follows its own trajectory.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np

from fam_bundle_ros.control.adaptation import (
    adaptation_settings,
    AdaptationConfig,
    forget_adaptation,
)
from fam_bundle_ros.control.allocation import Allocator
from fam_bundle_ros.control.baselines import baseline_settings, BaselineConfig
from fam_bundle_ros.control.belief import Belief, belief_of
from fam_bundle_ros.control.jump import STEP_SHARE
from fam_bundle_ros.control.outer import LoadModel, OuterConfig
from fam_bundle_ros.control.outer_loop import KINDS, outer_settings, OuterState
from fam_bundle_ros.control.reasons import sentence
from fam_bundle_ros.control.recruitment import switching_settings, SwitchingConfig
from fam_bundle_ros.control.recruitment_loop import (
    enable_step,
    recruitment_state,
    recruitment_step,
    RecruitmentSettings,
    start_recruitment,
)
from fam_bundle_ros.control.reference_rate import FULL_STRAIN, SampledReference
from fam_bundle_ros.control.safety import HOLD_TIME
from fam_bundle_ros.control.saturation import SATURATION
from fam_bundle_ros.control.signals import (
    Command,
    command_record,
    Measurement,
    MeasurementRecord,
    Reference,
)
from fam_bundle_ros.control.spread import SCHEMES
from fam_bundle_ros.control.switching import Margins
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle


@dataclass(frozen=True)
class ControllerConfig:
    """
    All settings of the recruitment controller.

    Parameters
    ----------
    policy : str
        ``neglect``, ``hysteresis`` or ``reversal_aware``: see `SwitchingConfig`.
    scheme : str
        ``orderly``: a unit to its limit before the next; ``batch``: all active units at one
        pressure; ``all_on``: all units always, at one pressure. Without a model, for comparison
        (see `fam_bundle_ros.control.baselines`): ``equal_pressure``, ``threshold``.
    order : sequence of int, optional
        Order of recruitment, units from 0; that of the model file by default.
    max_pressure : sequence of float, Pa (gauge), optional
        Limits below those of the model file.
    switching : SwitchingConfig
        Its policy is taken from ``policy``.
    outer : OuterConfig
        Force and strain loops.
    baseline : BaselineConfig
        Gains of ``equal_pressure`` and ``threshold``.
    load : LoadModel
        Model of the load, for strain references.
    adaptation : AdaptationConfig
        Online adaptation of the gains and the bias of the model.
    still : float, Pa
        Backlash of the pressures: a pressure is held while it would change by less than this, so
        that no air is used for sensor noise.
    hold_time : float, s
        Readings that are not finite hold the pressures for this time, then all units are vented.
    """

    policy: str = 'reversal_aware'
    scheme: str = 'orderly'
    order: Sequence[int] | None = None
    max_pressure: Sequence[float] | None = None
    switching: SwitchingConfig = field(default_factory=SwitchingConfig)
    outer: OuterConfig = field(default_factory=OuterConfig)
    load: LoadModel = field(default_factory=LoadModel)
    baseline: BaselineConfig = field(default_factory=BaselineConfig)
    adaptation: AdaptationConfig = field(default_factory=AdaptationConfig)
    still: float = 300.0
    hold_time: float = HOLD_TIME

    def __post_init__(self):
        """Check the ranges of the settings."""
        if self.scheme not in SCHEMES:
            raise InputError(f"scheme is '{self.scheme}'; expected one of {', '.join(SCHEMES)}")
        for name in ('hold_time', 'still'):
            if not getattr(self, name) >= 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected 0 or more')
        object.__setattr__(self, 'switching', replace(self.switching, policy=self.policy))


class RecruitmentController:
    """
    Recruitment control of a bundle.

    Parameters
    ----------
    bundle : Bundle
        The model that is inverted.
    config : ControllerConfig

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> bundle = load_model('config/models/spie2021.yaml')
    >>> controller = RecruitmentController(bundle)
    >>> vented = Measurement(force=0.0, strain=0.1, strain_rate=0.0, pressure=np.zeros(2))
    >>> command = controller.update(2e-3, vented, Reference('force', 40.0))
    >>> command.state
    1
    >>> bool(command.pressure[0] > 150e3 and command.pressure[1] == 0.0)
    True
    """

    def __init__(self, bundle: Bundle, config: ControllerConfig = ControllerConfig()):
        self.bundle = bundle
        self.config = config
        self._allocator = Allocator(bundle, neglect=config.policy == 'neglect',
                                    max_pressure=config.max_pressure, order=config.order)
        self._names = [bundle.motor_units[i].name.upper() for i in self.order]
        self.settings = controller_settings(bundle, config)
        self.reset()

    def reset(self) -> None:
        """Reset to RS0 and to the model without adaptation."""
        #: The records that `recruitment_step` takes.
        self.memory = recruitment_state(self.order, self._allocator.grid,
                                        self._allocator.pushes_back)
        forget_adaptation(self.settings.adaptation, self.memory.adaptation)
        self.model = self.belief()
        scale = {'force': self.bundle.largest_force, 'strain': FULL_STRAIN}
        self._sampled = {kind: SampledReference(STEP_SHARE * scale[kind]) for kind in KINDS}
        self._time = 0.0
        self._record = command_record(self.bundle.n)
        start_recruitment(self.settings, self.memory, self._record)
        self._command = self._told()

    def belief(self, compiled: bool = False) -> Belief:
        """
        Return the inverted model for `recruitment_step`, with initial memory.

        Raises
        ------
        fam_bundle_ros.kernels.NotCompiled
            If numba is not installed, or cannot compile a user's effect.
        """
        return belief_of(self._allocator.inverted, self._allocator.grid, compiled)

    @property
    def state(self) -> int:
        """Recruitment state, k of RSk."""
        return self.memory.machine.state

    @property
    def outer(self) -> OuterState:
        """Memory of the force and strain loops, for instance their ``bias``, N."""
        return self.memory.outer

    @property
    def order(self) -> tuple[int, ...]:
        """Units (from 0) in the order of recruitment."""
        return self._allocator.order

    def enable(self, measurement: Measurement) -> None:
        """
        Start from the present pressures and force (bumpless transfer).

        The difference of this force from the demand decays with `OuterConfig.fade_time`. Units
        that were not filled in turn return to that slowly.
        """
        enable_step(self.settings, self.model, self.memory, self._read(measurement), self._record)
        self._command = self._told()

    def keep_learnt(self, other: 'RecruitmentController') -> None:
        """Take over the adaptation of another controller of the same bundle."""
        if self.settings.adaptation == other.settings.adaptation:
            self.memory.adaptation = other.memory.adaptation
            self.memory.table.pull[:] = other.memory.table.pull
            self.memory.table.push[:] = other.memory.table.push

    def update(self, dt: float, measurement: Measurement, reference: Reference) -> Command:
        """
        Return the command of this tick.

        Parameters
        ----------
        dt : float, s
            Time since the last update; if not positive (clock reset), or infinite, the command is
            repeated.
        measurement : Measurement
        reference : Reference

        Raises
        ------
        InputError
            For a reference of another kind than ``force`` and ``strain``, or the wrong number of
            pressures.
        """
        if reference.kind not in KINDS:
            raise InputError(f"reference kind is '{reference.kind}'; expected force or strain")
        measured = self._read(measurement)
        if 0.0 < dt < math.inf:
            self._time += dt
            value, rate = reference.value, reference.rate
            if rate is None:
                value, rate = self._sampled[reference.kind].update(self._time, value)
            recruitment_step(self.settings, self.model, self.memory, measured,
                             KINDS.index(reference.kind), value, rate, dt, self._record)
            self._command = self._told()
        return self._command

    def _read(self, measurement):
        pressure = np.asarray(measurement.pressure, float)
        if pressure.shape != (self.bundle.n,):
            raise InputError(f'{pressure.size} pressures; expected {self.bundle.n}')
        return MeasurementRecord(float(measurement.force), float(measurement.strain),
                                 float(measurement.strain_rate), pressure.tolist())

    def _told(self):
        """Return the command with arrays and text."""
        record = self._record
        return Command(np.array(record.pressure), record.state, np.array(record.active, bool),
                       np.array(record.share), SATURATION[record.saturated],
                       sentence(record.reason, self._names), Margins(**vars(record.margins)),
                       record.demand)


def controller_settings(bundle: Bundle, config: ControllerConfig) -> RecruitmentSettings:
    """Return the record that `recruitment_step` takes."""
    limit = bundle.max_pressure if config.max_pressure is None else np.minimum(
        bundle.max_pressure, config.max_pressure)
    return RecruitmentSettings(
        SCHEMES.index(config.scheme), config.still, config.hold_time,
        STEP_SHARE * bundle.largest_force, limit.tolist(),
        switching_settings(config.switching), outer_settings(config.outer, config.load, bundle),
        baseline_settings(config.baseline, bundle, limit),
        adaptation_settings(config.adaptation, bundle, config.outer.feedback))
