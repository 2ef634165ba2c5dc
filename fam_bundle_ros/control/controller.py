# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The recruitment controller: a force or strain reference in, one gauge pressure per motor unit out.

Each tick: reference and readings give a force demand (`outer`), the model's curves at this strain
are worked out (`allocation`), the state machine decides (`recruitment`), and the demand is spread
over the active units while a unit that is being crossed follows its own path.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math

import numpy as np

from fam_bundle_ros.control.allocation import Allocation, Allocator, Curves, Instant, SCHEMES
from fam_bundle_ros.control.crossing import Crossing, crossing_pace
from fam_bundle_ros.control.outer import LoadModel, OuterConfig, OuterLoop
from fam_bundle_ros.control.rate import QuietRate
from fam_bundle_ros.control.recruitment import (
    Demand,
    Heading,
    RecruitmentMachine,
    SwitchingConfig,
)
from fam_bundle_ros.control.signals import Command, Measurement, Reference
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

#: N: demands missed by less than this count as met.
_TOLERANCE = 0.1
#: N: a demand that changes by more than this from one tick to the next is a step, not a rate.
_STEP = 2.0
#: rad/s: bandwidths at which rates are worked out, of clean and of noisy signals.
_BRISK, _SLOW = 80.0, 12.0


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
        pressure; ``all_on``: all units always, at one pressure.
    order : sequence of int, optional
        Of recruitment, from 0; that of the model file by default.
    max_pressure : sequence of float, Pa (gauge), optional
        Limits below those of the model file.
    switching : SwitchingConfig
        Its policy is taken from ``policy``.
    outer : OuterConfig
        Force and strain loops.
    load : LoadModel
        What is known of the load, for strain references.
    still : float, Pa
        Pressures change only when they would by more than this: no air for sensor noise.
    hold_time : float, s
        Readings that are not finite hold the pressures so long, then everything is vented.
    """

    policy: str = 'reversal_aware'
    scheme: str = 'orderly'
    order: Sequence[int] | None = None
    max_pressure: Sequence[float] | None = None
    switching: SwitchingConfig = field(default_factory=SwitchingConfig)
    outer: OuterConfig = field(default_factory=OuterConfig)
    load: LoadModel = field(default_factory=LoadModel)
    still: float = 400.0
    hold_time: float = 0.2

    def __post_init__(self):
        """Refuse what cannot be meant."""
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
        self._order = self._allocator.order
        names = [bundle.motor_units[i].name.upper() for i in self._order]
        self._machine = RecruitmentMachine(bundle.n, config.switching, names)
        self.outer = OuterLoop(bundle, config.outer, config.load)
        self.reset()

    def reset(self) -> None:
        """Start afresh: RS0, nothing learnt."""
        self._machine.reset(bundle_state(self.config, self.bundle.n))
        self._memory = self.bundle.start_state()
        self._rate = QuietRate()
        self._asleep: np.ndarray | None = None
        self._crossings: dict[int, Crossing] = {}
        self._since_crossing = math.inf
        self._wanted, self._limits = Heading(np.zeros(1)), Heading(np.zeros(self.bundle.n + 1))
        self._kind = ''
        self._lost = 0.0
        self.outer.reset()
        self._command = self._vented('')

    @property
    def state(self) -> int:
        """Recruitment state, k of RSk."""
        return self._machine.state

    @property
    def order(self) -> tuple[int, ...]:
        """Units (from 0) in the order of recruitment."""
        return self._order

    def enable(self, measurement: Measurement) -> None:
        """
        Start from the pressures as they are, so that switching on makes no bump.

        The force that is there now is taken over and fades into the demand.
        """
        self.reset()
        if self.config.scheme != 'all_on':
            curves = self._allocator.curves(Instant(measurement.strain))
            # A unit on its falling branch is not on: it will be vented or crossed anew.
            state = 0
            for k, unit in enumerate(self._order):
                if measurement.pressure[unit] > max(0.9 * curves.bottom_pressure[unit], 2e3):
                    state = k + 1
            self._machine.reset(state)
        pressure = np.nan_to_num(np.asarray(measurement.pressure, float), nan=0.0)
        active = np.zeros(self.bundle.n, bool)
        active[list(self._order[:self._machine.state])] = True
        # Until the first tick, and in it, these are what was commanded.
        self._command = replace(self._command, state=self._machine.state, active=active,
                                pressure=np.clip(pressure, 0.0, self._allocator.max_pressure))
        self.outer.take_over(measurement)

    def update(self, dt: float, measurement: Measurement, reference: Reference) -> Command:
        """
        Return the command of this tick.

        Parameters
        ----------
        dt : float, s
            Since the update before; not positive (a clock that jumped) repeats the last command.
        measurement : Measurement
        reference : Reference

        Raises
        ------
        InputError
            For a reference of another kind than ``force`` and ``strain``, or the wrong number of
            pressures.
        """
        if reference.kind not in ('force', 'strain'):
            raise InputError(f"reference kind is '{reference.kind}'; expected force or strain")
        pressure = np.asarray(measurement.pressure, float)
        if pressure.shape != (self.bundle.n,):
            raise InputError(f'{pressure.size} pressures; expected {self.bundle.n}')
        if not dt > 0.0:
            return self._command
        if not self._readable(measurement, pressure, reference):
            return self._hold(dt)
        self._lost = 0.0

        before = self._memory
        # The strain loop damps with the rate as measured; the model has no use for its noise.
        rate = self._rate.update(dt, measurement.strain_rate)
        believed, self._memory = self._allocator.step(
            before, dt, measurement.strain, pressure, rate)
        settled = not self._crossings and self._since_crossing > 0.05
        target = self.outer.update(dt, measurement, believed, reference, settled,
                                   self._command.saturated)
        # A force reference says nothing of the strain: there it is the measured rate that counts.
        asked = reference.kind == 'strain' and self.config.outer.feed_forward
        # With the memory even where no effect has one: it holds the clock.
        instant = Instant(target.strain, target.strain_rate if asked else rate, before, dt)
        curves = self._allocator.curves(instant, self._asleep)
        self._asleep = ~curves.useful

        explanation = ''
        if self.config.scheme != 'all_on':
            demand = self._demand(dt, curves, target, reference)
            explanation = self._machine.update(dt, curves, demand)
            if explanation:
                self._begin_crossing(curves, abs(demand.rate))
        allocation = self._spread(dt, curves, target.force)
        self._command = self._make_command(curves, allocation, target.force, explanation)
        return self._command

    # --- decisions -----------------------------------------------------------------------------

    def _demand(self, dt, curves, target, reference):
        """Return what the state machine sees: demand, and how it moves against the limits."""
        wanted, limits = self._wanted, self._limits
        value = np.array([target.feed_forward])
        # A strain that is measured is noisy, one that is asked for is not.
        clean = reference.kind == 'strain' and self.config.outer.feed_forward
        jump = abs(value - wanted.value).max()
        if clean:
            jump = max(jump, abs(curves.top - limits.value).max())
        if self._kind != reference.kind or (not target.moving and jump > _STEP):
            self._kind = reference.kind
            wanted.reset(value)
            limits.reset(curves.top)
        else:
            wanted.update(value, dt, _BRISK)
            limits.update(curves.top, dt, _BRISK if clean else _SLOW)
        state = min(self._machine.state, self.bundle.n - 1)
        now = [w[0] for w in wanted.now(_BRISK)]
        top = [x[state] for x in (limits.now(_BRISK) if clean else
                                  (limits.rate, limits.acceleration, np.zeros_like(limits.rate)))]
        rate, acceleration, jerk = (float(w - x) for w, x in zip(now, top))
        return Demand(target.force, rate, acceleration, jerk, self.outer.uncertainty)

    def _begin_crossing(self, curves, rate):
        """Send the unit that was switched on its way, unless the policy knows no way."""
        state = self._machine.state
        up = self._machine.direction > 0
        # With nobody to compensate there is no better way than straight through.
        if self.config.policy != 'reversal_aware' or state == (1 if up else 0):
            return
        unit = self._order[state - 1 if up else state]
        pace = crossing_pace(curves, unit, rate, self.config.switching.crossing_rate)
        self._crossings[unit] = Crossing(unit, up, float(self._command.pressure[unit]), pace)

    def _spread(self, dt, curves: Curves, demand: float) -> Allocation:
        """Return pressures for the demand in the present state, crossings moved on."""
        active = self._order[:self._machine.state]
        if not self._crossings:
            self._since_crossing += dt
            return self._solve(curves, demand, active, {})
        self._since_crossing = 0.0
        final = self._solve(curves, demand, active, {})
        for unit, crossing in list(self._crossings.items()):
            others = [i for i in active if i not in self._crossings]
            fixed = {i: c.pressure for i, c in self._crossings.items()}
            now = self._solve(curves, demand, others, fixed)
            ratio = self._ratio(curves, crossing, others, now)
            arrived = crossing.advance(dt, float(final.pressure[unit]), ratio,
                                       short=crossing.up and now.missing > _TOLERANCE)
            if arrived:
                del self._crossings[unit]
        others = [i for i in active if i not in self._crossings]
        fixed = {i: c.pressure for i, c in self._crossings.items()}
        return self._solve(curves, demand, others, fixed)

    def _solve(self, curves, demand, units, fixed):
        spread = curves.fill if self.config.scheme == 'orderly' else curves.share
        return spread(demand, units, fixed)

    def _ratio(self, curves, crossing, others, allocation):
        """Return the pressure change the others need per change of the crossing unit."""
        steep = abs(curves.slope(crossing.unit, crossing.pressure))
        free = [i for i in others
                if allocation.pressure[i] < curves.pressure[-1, i] - 1.0] or others[-1:]
        if self.config.scheme == 'orderly':
            free = free[:1]
        help_of_others = sum(curves.slope(i, allocation.pressure[i]) for i in free)
        return steep / help_of_others if help_of_others > 0.0 else 1.0

    # --- output --------------------------------------------------------------------------------

    def _make_command(self, curves, allocation, demand, explanation):
        active = np.zeros(self.bundle.n, bool)
        active[list(self._order[:self._machine.state])] = True
        size = np.abs(allocation.force)
        total = float(size.sum())
        share = size / total if total > 0.0 else size
        return Command(self._quiet(allocation.pressure), self._machine.state, active, share,
                       self._saturation(curves, allocation.missing, demand), explanation,
                       self._machine.margins, demand)

    def _quiet(self, pressure):
        """Return the pressures with changes smaller than the quiet band left out (a play)."""
        still, last = self.config.still, self._command.pressure
        quiet = np.clip(last, pressure - still, pressure + still)
        # Empty is empty and full is full: a play would stop short of both.
        ends = (pressure <= 0.0) | (pressure >= self._allocator.max_pressure)
        return np.where(ends, pressure, np.maximum(quiet, 0.0))

    def _saturation(self, curves, missing, demand):
        """Say whether the demand is out of reach of every state, or of this one only."""
        if missing > _TOLERANCE:
            return 'high' if demand > curves.top.max() - _TOLERANCE else 'gap'
        if missing < -_TOLERANCE:
            return 'low' if demand < curves.floor.min() + _TOLERANCE else 'gap'
        return ''

    # --- readings that are lost ----------------------------------------------------------------

    @staticmethod
    def _readable(measurement, pressure, reference):
        # A sum is finite only when every term is.
        return math.isfinite(measurement.force + measurement.strain + measurement.strain_rate
                             + float(np.add.reduce(pressure)) + reference.value + reference.rate)

    def _hold(self, dt):
        """Keep the last pressures for a while, then vent."""
        self._lost += dt
        if self._lost <= self.config.hold_time:
            # A decision is told once, in the tick in which it was taken.
            self._command = replace(self._command, explanation='')
            return self._command
        if self._command.state or self._command.pressure.any():
            lost = self._lost
            self.reset()
            self._lost = lost
            self._command = self._vented(f'vent: no usable reading for {lost:.2f} s')
            return self._command
        self._command = self._vented('')
        return self._command

    def _vented(self, explanation):
        nothing = np.zeros(self.bundle.n)
        return Command(nothing, 0, nothing.astype(bool), nothing, explanation=explanation)


def bundle_state(config: ControllerConfig, units: int) -> int:
    """Return the recruitment state to start in: 0, or all units where all are always on."""
    return units if config.scheme == 'all_on' else 0

