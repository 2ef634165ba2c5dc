# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Inverse model: pressures for a force demand, on the rising branches of `curves`. Kernels."""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.curves import FLAT, force_at, reach_below, unit_force

#: Bisections within a cell of the table: at its free strain a muscle's curve has a kink of up to
#: 20 N/kPa.
_HALVINGS = 6
#: Bisections of a common change of pressure: of the whole range to 10 Pa.
_BISECTIONS = 16


@dataclass
class Shares:
    """Pressures (Pa, gauge) and forces (N) of n units, and demand minus force (N)."""

    pressure: list
    force: list
    missing: float = 0.0


def common_force(table: Any, model: Any, units: Any, first: int, last: int, pressure: float
                 ) -> float:
    """Return the force of units[first:last] at one pressure, each at most at its limit, N."""
    total = 0.0
    for k in range(first, last):
        total += unit_force(table, model, units[k], min(pressure, table.grid[units[k]][-1]))
    return total


def invert(table: Any, model: Any, units: Any, first: int, last: int, wanted: float,
           low: float, high: float, low_force: float, high_force: float) -> float:
    """
    Return the common pressure of units[first:last] at which they give a force, Pa.

    Bisection within a cell of the table, then linear.

    Parameters
    ----------
    wanted : float, N
    low, high, low_force, high_force : float, Pa and N
        The cell and the forces at its ends: below ``wanted``, and at least ``wanted``.
    """
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        force = common_force(table, model, units, first, last, middle)
        if force < wanted:
            low, low_force = middle, force
        else:
            high, high_force = middle, force
    return low + (high - low) * (wanted - low_force) / (high_force - low_force)


def place_bottoms(table: Any, model: Any) -> None:
    """
    Move the bottom of a slack unit from the point of the table to the end of its flat.

    Else the least demand above the bottom would move the pressure across the rest of that cell.
    """
    for k in range(len(table.order)):
        unit = table.order[k]
        if table.bottom[unit] > 0 and not falls(table, unit):
            move_bottom(table, model, k)


def hold_bottoms(table: Any, model: Any, shares: Any, pressure: Any, count: int, doubt: float
                 ) -> None:
    """
    Move the bottom of units that have risen to where the force is as at the point of the table.

    In between the falling branch ends: the least demand above the bottom moves the pressure across
    it. While the noise of the demand may do so again, a unit that has risen does not return.
    Otherwise it waits before that place, where its force hardly depends on its pressure.

    Parameters
    ----------
    table, model : CurveTable, Belief
    shares : Shares
        Of the tick before.
    pressure : list (n,), Pa
        Commanded in the tick before.
    count : int
        The first ``count`` units, in order, are active.
    doubt : float, N
        Noise of the demand.
    """
    spare = -shares.missing
    for k in range(count):
        unit = table.order[k]
        bottom = table.bottom[unit]
        if (bottom > 0 and falls(table, unit) and spare <= doubt
                and pressure[unit] > table.grid[unit][bottom]):
            move_bottom(table, model, k)
        spare = table.top_force[unit] - shares.force[unit]


def falls(table: Any, unit: int) -> bool:
    """Return whether a branch falls to the bottom of a unit, which is none of a slack one."""
    curve, bottom = table.force[unit], table.bottom[unit]
    return curve[bottom - 1] > curve[bottom] + FLAT


def move_bottom(table: Any, model: Any, k: int) -> None:
    """Move the bottom of the k-th unit in order to the end of what does not rise in its cell."""
    unit = table.order[k]
    grid, curve, bottom = table.grid[unit], table.force[unit], table.bottom[unit]
    if bottom + 1 < len(grid) and curve[bottom + 1] > curve[bottom] + FLAT:
        table.bottom_pressure[unit] = invert(
            table, model, table.order, k, k + 1, curve[bottom] + FLAT, grid[bottom],
            grid[bottom + 1], curve[bottom], curve[bottom + 1])


def set_fixed(table: Any, model: Any, fixed: Any, shares: Any) -> None:
    """Set the prescribed pressures (not nan in ``fixed``), and all others to zero."""
    for unit in range(len(table.order)):
        if math.isnan(fixed[unit]):
            shares.pressure[unit], shares.force[unit] = 0.0, table.rest_force[unit]
        else:
            shares.pressure[unit] = fixed[unit]
            shares.force[unit] = unit_force(table, model, unit, fixed[unit])


def total_of(values: Any) -> float:
    """Return the sum of a vector."""
    total = 0.0
    for k in range(len(values)):
        total += values[k]
    return total


def fill(table: Any, model: Any, demand: float, units: Any, count: int, fixed: Any, shares: Any
         ) -> None:
    """
    Fill units in turn: each to its limit before the next leaves the bottom of its branch.

    Orderly recruitment, after the size principle (Henneman 1957; Jenkins, Chapman and Bryant
    2016, Smart Mater. Struct. 25, 125016).

    Parameters
    ----------
    table, model : CurveTable, Belief
    demand : float, N
        Demand on the whole bundle.
    units : list of int
        The first ``count`` of them are active, first to be filled first.
    fixed : list (n,), Pa
        Prescribed pressures of further units, for instance crossing ones; nan for the others.
    shares : Shares
        Output.
    """
    set_fixed(table, model, fixed, shares)
    pressure, force = shares.pressure, shares.force
    for k in range(count):
        unit = units[k]
        pressure[unit], force[unit] = table.bottom_pressure[unit], table.bottom_force[unit]
    missing = demand - total_of(force)
    for k in range(count):
        unit = units[k]
        if missing <= 0.0:
            break
        room = table.top_force[unit] - table.bottom_force[unit]
        if missing >= room:
            if room > 0.0:
                pressure[unit], force[unit] = table.grid[unit][-1], table.top_force[unit]
                missing -= room
            continue
        wanted = table.bottom_force[unit] + missing
        pressure[unit] = pressure_for(table, model, units, k, wanted)
        force[unit], missing = wanted, 0.0
    shares.missing = missing


def pressure_for(table: Any, model: Any, units: Any, k: int, wanted: float) -> float:
    """Return the pressure of units[k] on its rising branch for a force (N) within it, Pa."""
    unit = units[k]
    grid, curve = table.grid[unit], table.force[unit]
    i, below = len(grid) - 1, table.bottom[unit]
    while i - below > 1:
        middle = (below + i) // 2
        if curve[middle] < wanted:
            below = middle
        else:
            i = middle
    return invert(table, model, units, k, k + 1, wanted, grid[i - 1], grid[i], curve[i - 1],
                  curve[i])


def change_in_turn(table: Any, model: Any, demand: float, units: Any, count: int, fixed: Any,
                   base: Any, shares: Any) -> None:
    """
    Change the pressures of the active units in turn, each to its limit.

    A rise begins at the first unit, a fall at the last one: where ``base`` is the result of
    `fill`, so is this. The arguments are those of `change_together`.
    """
    set_fixed(table, model, fixed, shares)
    move_together(table, model, units, count, base, 0.0, shares)
    missing = demand - total_of(shares.force)
    for j in range(count):
        k = j if missing > 0.0 else count - 1 - j
        unit = units[k]
        if missing == 0.0 or table.useful[unit] == 0:
            continue
        wanted, missing = shares.force[unit] + missing, 0.0
        if wanted <= table.bottom_force[unit]:
            missing = wanted - table.bottom_force[unit]
            shares.pressure[unit] = table.bottom_pressure[unit]
            shares.force[unit] = table.bottom_force[unit]
        elif wanted >= table.top_force[unit]:
            missing = wanted - table.top_force[unit]
            shares.pressure[unit] = table.grid[unit][-1]
            shares.force[unit] = table.top_force[unit]
        else:
            shares.pressure[unit] = pressure_for(table, model, units, k, wanted)
            shares.force[unit] = wanted
    shares.missing = missing


def change_together(table: Any, model: Any, demand: float, units: Any, count: int, fixed: Any,
                    base: Any, shares: Any) -> None:
    """
    Change the pressures of all active units by one amount, each within its rising branch.

    A step of the demand is reached sooner than by `fill`, as the flow of every valve is used. At
    rest both need nearly the same air: beyond its bottom a unit's force is linear in its pressure.

    Parameters
    ----------
    table, model, demand, units, count, fixed, shares
        As for `fill`.
    base : list (n,), Pa
        Pressures from which the units start.
    """
    set_fixed(table, model, fixed, shares)
    low = high = 0.0
    for k in range(count):
        unit = units[k]
        low = min(low, table.bottom_pressure[unit] - base[unit])
        high = max(high, table.grid[unit][-1] - base[unit])
    wanted = demand - total_of(shares.force)
    for k in range(count):
        wanted += shares.force[units[k]]
    low_force = move_together(table, model, units, count, base, low, shares)
    high_force = move_together(table, model, units, count, base, high, shares)
    shares.missing = wanted - min(max(wanted, low_force), high_force)
    change = low
    if wanted >= high_force:
        change = high
    elif wanted > low_force:
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            force = move_together(table, model, units, count, base, middle, shares)
            if force < wanted:
                low, low_force = middle, force
            else:
                high, high_force = middle, force
        change = low + (high - low) * (wanted - low_force) / (high_force - low_force)
    move_together(table, model, units, count, base, change, shares)


def move_together(table: Any, model: Any, units: Any, count: int, base: Any, change: float,
                  shares: Any) -> float:
    """Write the active units' pressures after a change (Pa), and forces; return their sum, N."""
    total = 0.0
    for k in range(count):
        unit = units[k]
        if table.useful[unit] > 0:
            pressure = max(base[unit] + change, table.bottom_pressure[unit])
            shares.pressure[unit] = min(pressure, table.grid[unit][-1])
            shares.force[unit] = unit_force(table, model, unit, shares.pressure[unit])
        else:
            shares.pressure[unit], shares.force[unit] = 0.0, table.rest_force[unit]
        total += shares.force[unit]
    return total


def lower(table: Any, units: Any, count: int, shares: Any) -> None:
    """
    Lower units below their bottoms for a demand that is less than they give there.

    The model gains nothing by this. But such a demand shows that the bundle pulls more than its
    model: by friction, or because the bottom lies lower. So the last of the first ``count`` units
    is lowered along the line of its rising branch until it is empty, then the one before. The
    model force follows the same line, so that feedback works as above the bottom.
    """
    for j in range(count):
        unit = units[count - 1 - j]
        reach = reach_below(table, unit)
        if shares.missing >= 0.0 or reach <= 0.0:
            continue
        part = min(-shares.missing / reach, 1.0)
        shares.missing += part * reach
        table.lowered[unit] = 1
        shares.pressure[unit] = (1.0 - part) * table.bottom_pressure[unit]
        shares.force[unit] -= part * reach


def share(table: Any, model: Any, demand: float, units: Any, count: int, fixed: Any, shares: Any
          ) -> None:
    """
    Give all useful units one common pressure (at most their limit); else as `fill`.

    Batch recruitment (Jenkins, Chapman and Bryant 2016). ``units`` is reordered.
    """
    set_fixed(table, model, fixed, shares)
    used = 0
    for k in range(count):
        if table.useful[units[k]] > 0:
            units[used], units[k] = units[k], units[used]
            used += 1
    shares.missing = demand - total_of(shares.force)
    if used == 0:
        return
    wanted = shares.missing
    for k in range(used):
        wanted += shares.force[units[k]]
    last = len(table.grid[0]) - 1
    bottom, least = 0, common_entry(table, units, used, 0)
    for j in range(1, last + 1):
        entry = common_entry(table, units, used, j)
        if entry <= least + FLAT:
            bottom = j
        least = min(least, entry)
    i = min(bottom + 1, last)
    below, above = common_entry(table, units, used, bottom), common_entry(table, units, used, i)
    lowest = below
    while i < last and above < wanted:
        i += 1
        below, above = above, common_entry(table, units, used, i)
    highest = max(above, wanted) if i < last else above
    low, chosen = common_pressure(table, units, used, max(i - 1, bottom)), 0.0
    high = common_pressure(table, units, used, i)
    if wanted <= lowest:
        chosen = common_pressure(table, units, used, bottom)
    elif wanted >= highest:
        chosen = high
    else:
        chosen = invert(table, model, units, 0, used, wanted, low, high, below, above)
    for k in range(used):
        unit = units[k]
        shares.pressure[unit] = min(chosen, table.grid[unit][-1])
        shares.force[unit] = force_at(table, unit, shares.pressure[unit])
    shares.missing = wanted - min(max(wanted, lowest), highest)


def common_pressure(table: Any, units: Any, used: int, j: int) -> float:
    """Return the common pressure of units[:used] at point j of the table, Pa."""
    pressure = 0.0
    for k in range(used):
        pressure = max(pressure, table.grid[units[k]][j])
    return pressure


def common_entry(table: Any, units: Any, used: int, j: int) -> float:
    """Return the force of units[:used] at point j of the table, N."""
    total = 0.0
    for k in range(used):
        total += table.force[units[k]][j]
    return total
