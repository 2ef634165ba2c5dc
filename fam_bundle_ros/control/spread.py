# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Allocation of a demand to the active units, while other units cross their falling branch."""

import math
from typing import Any

from fam_bundle_ros.control.crossing import (
    advance,
    doubt_of,
    end_crossing,
    hurry,
    is_crossing,
    slow_pace,
)
from fam_bundle_ros.control.curves import reach_below, slope_at
from fam_bundle_ros.control.inverse import change_in_turn, change_together, fill, lower, share
from fam_bundle_ros.control.jump import is_recent, TOLERANCE
from fam_bundle_ros.control.switching import REVERSAL_AWARE

#: Schemes: each unit to its limit before the next; active units at one pressure; all units always
#: on; and two without a model (`baselines`), for comparison.
SCHEMES = ('orderly', 'batch', 'all_on', 'equal_pressure', 'threshold')
ORDERLY, BATCH, ALL_ON, EQUAL_PRESSURE, THRESHOLD = range(5)


def follow_jump(settings: Any, model: Any, state: Any, demand: float, dt: float) -> None:
    """
    Move the base: at a step to where all units meet the demand (N), long after it back to `fill`.

    Until then the next step finds units that can all move. Back slowly, as this adds no force.
    """
    jump, final = state.jump, state.final
    if jump.fresh > 0:
        solve(settings, model, state, demand, False, final)
        jump.fresh = 0
        for unit in range(len(jump.base)):
            jump.base[unit] = final.pressure[unit]
    for k in range(state.machine.state, len(jump.base)):
        jump.base[state.table.order[k]] = 0.0
    if is_recent(settings, jump):
        return
    jump.on = 0
    solve(settings, model, state, demand, False, final)
    step = slow_pace(settings.switching.crossing_rate) * dt
    for unit in range(len(jump.base)):
        change = final.pressure[unit] - jump.base[unit]
        if abs(change) > step:
            jump.on, change = 1, math.copysign(step, change)
        jump.base[unit] += change


def spread(settings: Any, model: Any, state: Any, demand: float, dt: float) -> None:
    """Advance the crossings by ``dt`` (s), and compute pressures for the demand (N)."""
    crossings = state.crossings
    if state.jump.on > 0:
        follow_jump(settings, model, state, demand, dt)
    if crossings.count == 0:
        solve(settings, model, state, demand, False, state.shares)
        return
    solve(settings, model, state, demand, False, state.final)
    k = 0
    while k < crossings.count:
        unit = crossings.unit[k]
        count = solve(settings, model, state, demand, True, state.shares)
        ratio = compensation_ratio(settings, state, unit, count)
        up, usual = crossings.up[unit] > 0, settings.switching.crossing_rate
        rate = max(state.demand.rate if up else -state.demand.rate, 0.0)
        left = reserve(state, demand, unit) if up else room(state, demand)
        # The others are empty: what this unit pulls is too much.
        if not up and state.shares.missing < -TOLERANCE:
            crossings.pace[unit] = max(crossings.pace[unit], usual)
        spare = left - state.demand.uncertainty - rate * state.outer.lag
        hurry(crossings, unit, state.final.pressure[unit], rate, spare,
              doubt_of(state) * state.outer.lag if settings.outer.feedback else 0.0, usual)
        short = up and crossings.rush[unit] > 0 and state.shares.missing > TOLERANCE
        if advance(crossings, unit, dt, state.final.pressure[unit], ratio, short, usual):
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


def room(state: Any, demand: float) -> float:
    """Return by how much a demand (N) may fall until the active units are empty, N."""
    table, left = state.table, demand - state.table.floor[state.machine.state]
    for k in range(state.machine.state):
        left += reach_below(table, table.order[k])
    return left


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
        if state.jump.fresh > 0:
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
