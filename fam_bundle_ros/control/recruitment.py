# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which motor units are on: the state machine over RS0..RSn.

Between RSk and RSk+1 lies an overlap: forces that both can give. The next unit is recruited at the
last moment at which its push-back can still be compensated, and only if the demand is predicted to
exceed the present state; it is released when the demand is at rest below the overlap. `switching`
has the logic; `crossing` then moves the unit's pressure.
"""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.reasons import Reason, sentence
from fam_bundle_ros.control.switching import (
    Demand,
    MachineState,
    Margins,
    POLICIES,
    start_machine,
    switch_step,
    SwitchingSettings,
)
from fam_bundle_ros.errors import InputError


@dataclass(frozen=True)
class SwitchingConfig:
    """
    When to recruit and to release.

    Parameters
    ----------
    policy : str
        ``neglect`` only compares the demand with the ideal model's limits; ``hysteresis`` includes
        the resistive forces and a hysteresis band; ``reversal_aware`` (default) also crosses the
        falling branch with compensation, and predicts the demand.
    dwell : float, s
        Least time between a switch and the opposite one; with ``reversal_aware`` not for a
        reference beyond the limit.
    margin, hysteresis : float, N, optional
        Switching margin and hysteresis; by default from noise and bias and, where nothing
        corrects it (to release, or without feedback), the model's error.
    rest_time : float, s
        Time at rest after which a unit is released that the demand does not need, now or, at
        its present rate, within ``horizon``.
    absence_time : float, s
        Time after which a unit that a moving demand has not needed is released too: refilling it
        in every cycle of a fast demand would cost more air than keeping it. A unit that is needed
        again within this time is released only then, also at rest.
    worth : float
        While the demand falls, a unit is released at once where its bottom pressure is below this
        share of the largest one since it was recruited: refilling it costs almost no air.
    rest_rate : float, 1/s
        Demands that change by less than this share of the bundle's range per second are at rest.
    horizon : float, s
        Look-ahead of a rising demand where the whole dip can still be compensated, at the last
        moment as long as the demand has been rising; it shrinks to 0 where none of it can.
    crossing_rate : float, Pa/s
        Usual pressure rate of a crossing, within reach of valve and supply; up to 4 times this
        where the demand leaves no time, 20 times where the other units cannot compensate.
    """

    policy: str = 'reversal_aware'
    dwell: float = 0.25
    margin: float | None = None
    hysteresis: float | None = None
    rest_time: float = 0.75
    absence_time: float = 10.0
    worth: float = 0.3
    rest_rate: float = 0.03
    horizon: float = 3.0
    crossing_rate: float = 2e6

    def __post_init__(self):
        """Check the ranges of the settings."""
        if self.policy not in POLICIES:
            raise InputError(f"policy is '{self.policy}'; expected one of {', '.join(POLICIES)}")
        for name in ('dwell', 'rest_time', 'absence_time', 'rest_rate', 'horizon'):
            if not getattr(self, name) >= 0.0:
                raise InputError(f'{name} is {getattr(self, name)}; expected 0 or more')
        for name in ('margin', 'hysteresis'):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise InputError(f'{name} is {value}; expected 0 or more, in N')
        if not self.crossing_rate > 0.0:
            raise InputError(f'crossing_rate is {self.crossing_rate}; expected more than 0')


def switching_settings(config: SwitchingConfig) -> SwitchingSettings:
    """Return the record that `switch_step` takes."""
    values: dict[str, Any] = {
        name: math.nan if value is None else value for name, value in vars(config).items()}
    return SwitchingSettings(**{**values, 'policy': POLICIES.index(config.policy)})


class RecruitmentMachine:
    """
    State machine over RS0..RSn.

    Parameters
    ----------
    units : int
    config : SwitchingConfig
    names : sequence of str, optional
        Motor units in their order of recruitment, for the explanations.
    """

    def __init__(self, units: int, config: SwitchingConfig = SwitchingConfig(), names=None):
        self.config = config
        self.units = units
        self.memory = MachineState([0.0] * units, [1] * units, [0] * units)
        self._settings = switching_settings(config)
        self._names = list(names or (f'MU{i + 1}' for i in range(units)))

    @property
    def state(self) -> int:
        """Return k of RSk."""
        return self.memory.state

    @property
    def margins(self) -> Margins:
        """Return the forces at which the machine would switch."""
        return self.memory.margins

    def reset(self, state: int = 0) -> None:
        """Reset to a state, without dwell time."""
        start_machine(self.memory, state)

    def update(self, dt: float, curves: Any, demand: Demand) -> str:
        """Advance one tick with the `Curves` of now; return why it switched, as text, or ''."""
        reason = Reason()
        switch_step(self._settings, self.memory, curves.table, demand, dt, reason)
        return sentence(reason, self._names)
