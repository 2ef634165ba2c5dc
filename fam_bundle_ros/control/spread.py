# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Allocation of a demand to the active units, while other units cross their falling branch."""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.crossing import (
    advance,
    end_crossing,
    hurry,
    is_crossing,
    slow_pace,
)
from fam_bundle_ros.control.curves import slope_at
from fam_bundle_ros.control.inverse import change_in_turn, change_together, fill, lower, share
from fam_bundle_ros.control.switching import REVERSAL_AWARE

#: Schemes: each unit to its limit before the next; active units at one pressure; all units always
#: on; and two without a model (`baselines`), for comparison.
SCHEMES = ('orderly', 'batch', 'all_on', 'equal_pressure', 'threshold')
ORDERLY, BATCH, ALL_ON, EQUAL_PRESSURE, THRESHOLD = range(5)
#: N: demands missed by less than this count as met.
TOLERANCE = 0.1


@dataclass
class Jump:
    """
    A step of the force reference: the active units change their pressures together.

    Attributes
    ----------
    base : list (n,), Pa
        Pressures from which they start, or which they have reached; later these return to those
        of the scheme.
    on : int
        1 until they have returned.
    moving : int
        1 until the pressures have been reached; then units change in turn from there.
    since : float, s
        Time since the last step.
    again : int
        1 when the last step came within `SwitchingConfig.absence_time` of the one before.
    kind, reference : int, float
        The last reference; ``kind`` is -1 for none.
    """

    base: list
    on: int = 0
    moving: int = 0
    since: float = math.inf
    again: int = 0
    kind: int = -1
    reference: float = 0.0


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
    if size <= reach and jump.on == 0:
        return
    jump.again = 1 if is_recent(settings, jump) else 0
    jump.on, jump.moving, jump.since = 1, 0 if size <= reach else 1, 0.0
    for unit in range(len(pressure)):
        jump.base[unit] = pressure[unit]


def end_jump(jump: Any, active: Any, wanted: Any, pressure: Any, tolerance: float) -> None:
    """
    Continue in turn from the commanded pressures once the measured ones have reached them.

    Parameters
    ----------
    jump : Jump
    active : vector (n,) of int
    wanted, pressure : vector (n,), Pa (gauge)
        Commanded in the tick before, and measured.
    tolerance : float, Pa
    """
    for unit in range(len(wanted)):
        if active[unit] > 0 and abs(wanted[unit] - pressure[unit]) > tolerance:
            return
    jump.moving = 0
    for unit in range(len(wanted)):
        jump.base[unit] = wanted[unit]


def is_recent(settings: Any, jump: Any) -> bool:
    """Return whether the demand has stepped within `SwitchingConfig.absence_time`."""
    return jump.on > 0 and jump.since < settings.switching.absence_time


def return_from_jump(settings: Any, model: Any, state: Any, demand: float, dt: float) -> None:
    """
    Move the base towards the pressures of the scheme once the demand has not stepped for long.

    Until then the next step finds units that can all move. Slowly, as this costs no force.
    """
    jump = state.jump
    jump.since += dt
    if is_recent(settings, jump):
        return
    jump.on = 0
    solve(settings, model, state, demand, False, state.final)
    step = slow_pace(settings.switching.crossing_rate) * dt
    for unit in range(len(jump.base)):
        change = state.final.pressure[unit] - jump.base[unit]
        if abs(change) > step:
            jump.on, change = 1, math.copysign(step, change)
        jump.base[unit] += change


def spread(settings: Any, model: Any, state: Any, demand: float, dt: float) -> None:
    """Advance the crossings by ``dt`` (s), and compute pressures for the demand (N)."""
    crossings = state.crossings
    if state.jump.on > 0:
        return_from_jump(settings, model, state, demand, dt)
    if crossings.count == 0:
        solve(settings, model, state, demand, False, state.shares)
        return
    solve(settings, model, state, demand, False, state.final)
    k = 0
    while k < crossings.count:
        unit = crossings.unit[k]
        count = solve(settings, model, state, demand, True, state.shares)
        ratio = compensation_ratio(settings, state, unit, count)
        up = crossings.up[unit] > 0
        if up:
            rate = max(state.demand.rate, 0.0)
            spare = (reserve(state, demand, unit) - state.demand.uncertainty
                     - rate * state.outer.lag)
            hurry(crossings, unit, state.final.pressure[unit], rate, spare,
                  settings.switching.crossing_rate)
        short = up and state.shares.missing > TOLERANCE
        if advance(crossings, unit, dt, state.final.pressure[unit], ratio, short):
            end_crossing(crossings, k)
        else:
            k += 1
    solve(settings, model, state, demand, True, state.shares)


def reserve(state: Any, demand: float, unit: int) -> float:
    """
    Return the force that is left for a demand (N) while units that are being filled push back, N.

    inf while none is being filled. Those before ``unit`` in the order of recruitment count as
    full.
    """
    table, left, filling, after = state.table, state.table.top[0] - demand, False, False
    for k in range(state.machine.state):
        other = table.order[k]
        after = after or other == unit
        crossing = after and is_crossing(state.crossings, other)
        filling = filling or crossing
        left += (table.bottom_force[other] if crossing else table.top_force[other]
                 ) - table.rest_force[other]
    return left if filling else math.inf


def solve(settings: Any, model: Any, state: Any, demand: float, crossing: bool, shares: Any
          ) -> int:
    """
    Allocate a demand (N) to the active units by the scheme; return the number of units used.

    With ``crossing``, units that are crossing keep their pressures; without, none is crossing.
    """
    count = 0
    for unit in range(len(state.fixed)):
        on_its_way = crossing and is_crossing(state.crossings, unit)
        state.fixed[unit] = state.crossings.pressure[unit] if on_its_way else math.nan
    for k in range(state.machine.state):
        unit = state.table.order[k]
        if math.isnan(state.fixed[unit]):
            state.units[count] = unit
            count += 1
    if settings.scheme == ORDERLY:
        if state.jump.on > 0 and state.jump.moving > 0:
            change_together(state.table, model, demand, state.units, count, state.fixed,
                            state.jump.base, shares)
        elif state.jump.on > 0:
            change_in_turn(state.table, model, demand, state.units, count, state.fixed,
                           state.jump.base, shares)
        else:
            fill(state.table, model, demand, state.units, count, state.fixed, shares)
        if settings.switching.policy == REVERSAL_AWARE:
            lower(state.table, state.units, count, shares)
    else:
        share(state.table, model, demand, state.units, count, state.fixed, shares)
    return count


def compensation_ratio(settings: Any, state: Any, unit: int, count: int) -> float:
    """Return the pressure change of the compensating units per change of the crossing unit."""
    table, helping, chosen = state.table, 0.0, 0
    for k in range(count):
        other = state.units[k]
        if state.shares.pressure[other] < table.grid[other][-1] - 1.0:
            if chosen == 0 or settings.scheme != ORDERLY:
                helping += slope_at(table, other, state.shares.pressure[other])
            chosen += 1
    if chosen == 0:
        for k in range(state.machine.state):
            other = table.order[k]
            if not is_crossing(state.crossings, other):
                helping = slope_at(table, other, state.shares.pressure[other])
    steep = abs(slope_at(table, unit, state.crossings.pressure[unit]))
    return steep / helping if helping > 0.0 else 1.0
