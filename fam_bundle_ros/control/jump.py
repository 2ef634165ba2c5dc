# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Steps of the force reference: all active units move, as one or two valves would take longer.

`spread.follow_jump` moves the pressures. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.curves import slope_at
from fam_bundle_ros.control.outer_loop import FORCE

#: Share of the largest force: a demand that changes by more than this from one tick to the next is
#: a step, not a rate (of the whole range in 0.7 s, at ticks of 4 ms).
STEP_SHARE = 0.006
#: N: smaller differences of a demand do not count: steps, what is missing, distances to a limit.
TOLERANCE = 0.1


@dataclass
class Jump:
    """
    The last step of the force reference, for which the active units moved together.

    Attributes
    ----------
    base : list (n,), Pa
        Pressures that they moved to, or those at `enable`, from which they change in turn; later
        these return to those of `fill`.
    on : int
        1 until they have returned.
    fresh : int
        1 for a step of this tick that needs all units.
    since : float, s
        Time since the last step, also one that a unit makes alone; inf before the first.
    again : int
        1 when it came within `SwitchingConfig.absence_time` of the one before.
    kind, reference, rate : int, float, float
        The last reference and its rate; ``kind`` is -1 for none.
    rise, climb : float, N
        The last step, however small, negative for one down; and how far the reference has risen
        since the first step of those that followed each other up within the absence time. 0 if it
        moves otherwise.
    still : float, s
        Time since that step.
    """

    base: list
    on: int = 0
    fresh: int = 0
    since: float = math.inf
    again: int = 0
    kind: int = -1
    reference: float = 0.0
    rate: float = 0.0
    rise: float = 0.0
    climb: float = 0.0
    still: float = math.inf


def begin_jump(settings: Any, state: Any, size: float) -> None:
    """
    Start from the commanded pressures at a step of the reference by ``size`` (N, above 0).

    A step that the last active unit can make within the lag of the loop is left to it: each
    further unit whose pressure reverses adds its hysteresis to the error.
    """
    jump, table, pressure = state.jump, state.table, state.shares.pressure
    reach = 0.0
    if state.machine.state > 0:
        unit = table.order[state.machine.state - 1]
        reach = (slope_at(table, unit, pressure[unit]) * settings.switching.crossing_rate
                 * state.outer.lag)
    if size <= reach:
        return
    jump.on = jump.fresh = 1
    for unit in range(len(pressure)):
        jump.base[unit] = pressure[unit]


def is_recent(settings: Any, jump: Any) -> bool:
    """Return whether the reference has stepped within `SwitchingConfig.absence_time`."""
    return jump.since < settings.switching.absence_time


def is_climbing(settings: Any, jump: Any) -> bool:
    """Return whether the reference rises in steps."""
    return jump.climb > 0.0 and jump.still < settings.switching.absence_time


def step_of(settings: Any, jump: Any, kind: int, value: float, rate: float, dt: float) -> float:
    """Remember the reference; return the size of its step since the tick before, N; 0 for none."""
    jump.since += dt
    jump.still += dt
    change = value - jump.reference if kind == FORCE and jump.kind == FORCE else 0.0
    moved = rate != 0.0 or jump.rate != 0.0
    jump.kind, jump.reference, jump.rate = kind, value, rate
    if moved or kind != FORCE:
        # the last part of a motion is no step
        jump.rise = jump.climb = 0.0
    elif abs(change) > TOLERANCE:
        again = change > 0.0 and jump.rise > 0.0 and jump.still < settings.switching.absence_time
        jump.climb = jump.climb + change if again else 0.0
        jump.rise, jump.still = change, 0.0
    if rate != 0.0 or abs(change) <= settings.step:
        return 0.0
    jump.again = 1 if is_recent(settings, jump) else 0
    jump.since = 0.0
    return abs(change)
