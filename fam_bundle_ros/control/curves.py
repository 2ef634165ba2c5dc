# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Force over pressure of every motor unit at one instant, and its inverse, as kernels.

At one strain the force of a motor unit over its own pressure first falls (it pushes back more
and more) and then rises (Kim, Mazzoleni and Bryant 2021, SPIE 11586: free strain gradient
reversal). `tabulate` and `find_branches` make the curves of one tick, `fill` and `share` answer
with pressures on the rising branches only. `allocation` has the same as objects.
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from fam_bundle_ros.kernels import Alternative

#: A cell of the table is divided into so many parts, and the one found so again: a muscle that
#: leaves its free strain has a kink there of up to 20 N/kPa.
_PARTS, _ROUNDS = 8, 2
#: A unit that could only pull less than when vented comes back when it could pull more by this
#: share of its push-back, and by so many N: strain noise must not fill and empty it in turn.
_WAKE_SHARE, _WAKE_FORCE = 0.1, 0.5
#: N: forces that differ by less are one bottom: where a slack or threshold makes a curve flat.
_FLAT = 1e-9


@dataclass
class Moment:
    """
    What the model is asked about: strain (1), its rate (1/s), time and step (s).

    ``start`` is true where memory begins afresh.
    """

    strain: float = 0.0
    strain_rate: float = 0.0
    time: float = 0.0
    dt: float = 0.0
    start: bool = True


@dataclass
class CurveTable:
    """
    Curves of n units over m pressures each.

    Attributes
    ----------
    order : list (n,) of int
        Units in the order of recruitment: RSk has the first k of them.
    pushes_back : bool
        False for a controller that reckons without resistive forces: none below zero.
    moment : Moment
    grid, force : list (n, m), Pa (gauge) and N
        From 0 to each unit's limit.
    rest_force : list (n,), N
        At zero pressure.
    useful : list (n,) of int
        1 for units that can pull more than when vented: past the free strain none can, their
        curves only fall. The others have no branch to be on and stay empty.
    bottom : list (n,) of int
        Index of the beginning of the rising branch.
    bottom_force, bottom_pressure : list (n,), N and Pa
    top_force : list (n,), N
        At the limit.
    dip : list (n,), N
        How far the force falls while the unit fills.
    top, floor : list (n + 1,), N
        Largest and smallest force of RS0..RSn on rising branches.
    crossing : list (n,), N
        Largest demands at which RSk -> RSk+1 needs no dip: up to there the units before the next
        have the room to make up for its push-back.
    found : list (9,), N
        Room for forces within one cell.
    """

    order: list
    pushes_back: bool
    moment: Moment
    grid: list
    force: list
    rest_force: list
    useful: list
    bottom: list
    bottom_force: list
    bottom_pressure: list
    top_force: list
    dip: list
    top: list
    floor: list
    crossing: list
    found: list


@dataclass
class Shares:
    """Pressures (Pa, gauge) and forces (N) of n units, and demand minus force (N)."""

    pressure: list
    force: list
    missing: float = 0.0


def curve_table(order, grid: list, pushes_back: bool) -> CurveTable:
    """Return an empty table for pressures ``grid`` (n, m), Pa."""
    n = len(grid)

    def zeros(count):
        return [0.0] * count
    return CurveTable(list(order), pushes_back, Moment(), grid, [
        zeros(len(grid[0])) for _ in range(n)], zeros(n), [0] * n, [0] * n, zeros(n), zeros(n),
                      zeros(n), zeros(n), zeros(n + 1), zeros(n + 1), zeros(n), zeros(_PARTS + 1))


# --- the curves ----------------------------------------------------------------------------------

def unit_force(table: Any, model: Any, unit: int, pressure: float) -> float:
    """Return the force of one unit at a candidate pressure (Pa), at the table's moment, N."""
    now = table.moment
    model.pressure[unit] = pressure
    force = model.force(unit, now.strain, now.strain_rate, model.pressure, now.time, now.dt,
                        now.start, model.shape, model.parameters, model.tables, model.memory,
                        model.after)
    return force if table.pushes_back else max(force, 0.0)


def _by_unit(table: Any, model: Any) -> None:
    """Fill the table pressure by pressure, and find the last of the smallest forces."""
    for unit in range(len(table.order)):
        grid, curve = table.grid[unit], table.force[unit]
        least = math.inf
        for k in range(len(grid)):
            curve[k] = unit_force(table, model, unit, grid[k])
            least = min(least, curve[k])
        for k in range(len(grid)):
            if curve[k] <= least + _FLAT:
                table.bottom[unit] = k


def _by_rows(table: Any, model: Any) -> None:
    """Do the same by one call on arrays, where the model has one."""
    if model.rows is None:
        _by_unit(table, model)
        return
    force = model.rows(table.moment, model.memory)
    if not table.pushes_back:
        force = np.maximum(force, 0.0)
    tied = force <= force.min(axis=0) + _FLAT
    table.bottom[:] = (len(force) - 1 - tied[::-1].argmax(axis=0)).tolist()
    table.force[:] = force.T.tolist()


#: Fill the table at its moment, with the lowest point of each curve: (table, model).
tabulate = Alternative(_by_unit, _by_rows)


def find_branches(table: Any, asleep: Any) -> None:
    """
    Find the rising branches, and what RS0..RSn can give.

    Parameters
    ----------
    table : CurveTable
    asleep : list (n,) of int
        1 for units that were of no use in the tick before; brought up to date.
    """
    last, total = len(table.grid[0]) - 1, 0.0
    for unit in range(len(table.order)):
        curve = table.force[unit]
        rest, lowest = curve[0], curve[table.bottom[unit]]
        wake = max(_WAKE_SHARE * (rest - lowest), _WAKE_FORCE) if asleep[unit] > 0 else 0.0
        useful = curve[last] - rest > wake
        if not useful:
            table.bottom[unit] = 0
        bottom = table.bottom[unit]
        table.useful[unit], asleep[unit] = (1, 0) if useful else (0, 1)
        table.rest_force[unit] = rest
        table.bottom_force[unit], table.bottom_pressure[unit] = curve[bottom], \
            table.grid[unit][bottom]
        table.top_force[unit] = curve[last] if useful else rest
        table.dip[unit] = rest - curve[bottom]
        total += rest
    table.top[0] = table.floor[0] = total
    gain = dips = 0.0
    for k in range(len(table.order)):
        unit = table.order[k]
        gain += table.top_force[unit] - table.rest_force[unit]
        dips += table.dip[unit]
        table.top[k + 1], table.floor[k + 1] = total + gain, total - dips
        table.crossing[k] = table.top[k] - table.dip[unit]


def points_up_to(grid: Any, pressure: float) -> int:
    """Return how many pressures of a rising grid are at most this one, by bisection."""
    low, high = 0, len(grid)
    while low < high:
        middle = (low + high) // 2
        if grid[middle] <= pressure:
            low = middle + 1
        else:
            high = middle
    return low


def force_at(table: Any, unit: int, pressure: float) -> float:
    """Return the force of one unit at a pressure (Pa), N, from the table."""
    grid, curve = table.grid[unit], table.force[unit]
    k = points_up_to(grid, pressure)
    if k == 0 or k == len(grid):
        return curve[max(k - 1, 0)]
    slope = (curve[k] - curve[k - 1]) / (grid[k] - grid[k - 1])
    return slope * (pressure - grid[k - 1]) + curve[k - 1]


def slope_at(table: Any, unit: int, pressure: float) -> float:
    """Return dF/dP of one unit at a pressure (Pa), N/Pa, from the table."""
    grid, curve = table.grid[unit], table.force[unit]
    k = min(max(points_up_to(grid, pressure), 1), len(grid) - 1)
    step = grid[k] - grid[k - 1]
    return (curve[k] - curve[k - 1]) / step if step > 0.0 else 0.0


# --- the inverse ---------------------------------------------------------------------------------

def common_force(table: Any, model: Any, units: Any, first: int, last: int, pressure: float
                 ) -> float:
    """Return the force of units[first:last] at one pressure, each at most at its limit, N."""
    total = 0.0
    for k in range(first, last):
        total += unit_force(table, model, units[k], min(pressure, table.grid[units[k]][-1]))
    return total


def invert(table: Any, model: Any, units: Any, first: int, last: int, wanted: float,
           low: float, high: float, low_force: float, high_force: float, turns: bool) -> float:
    """
    Return the common pressure of units[first:last] at which they give a force, Pa.

    The cell of the table is cut in eight parts, and the part found again, by bisection; a cell
    that may hold the bottom of the branch (``turns``) is searched part by part. Linear within.

    Parameters
    ----------
    wanted : float, N
    low, high, low_force, high_force : float, Pa and N
        The cell and the forces at its ends.
    turns : bool
    """
    for _ in range(_ROUNDS):
        step, i, bottom = (high - low) / _PARTS, _PARTS, 0
        found = table.found
        found[0], found[_PARTS] = low_force, high_force
        if turns:
            for k in range(1, _PARTS):
                found[k] = common_force(table, model, units, first, last, low + k * step)
                if found[k] < found[bottom]:
                    bottom = k
            if high_force < found[bottom]:
                return high
            i = bottom + 1
            while i < _PARTS and found[i] < wanted:
                i += 1
        else:
            below = 0
            while i - below > 1:
                middle = (below + i) // 2
                found[middle] = common_force(table, model, units, first, last,
                                             low + middle * step)
                if found[middle] < wanted:
                    below = middle
                else:
                    i = middle
        turns = turns and i == bottom + 1
        low_force, high_force = found[i - 1], found[i]
        if i < _PARTS:
            high = low + i * step
        low += (i - 1) * step
    if wanted <= low_force:
        return low
    if wanted >= high_force:
        return high
    return low + (high - low) * (wanted - low_force) / (high_force - low_force)


def begin(table: Any, model: Any, fixed: Any, shares: Any) -> None:
    """Set the pressures that are given (not nan in ``fixed``), and all others at rest."""
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
        Of the whole bundle.
    units : list of int
        The first ``count`` of them are active, first to be filled first.
    fixed : list (n,), Pa
        Pressures of further units, say one that is just being filled; nan for the others.
    shares : Shares
        The answer.
    """
    begin(table, model, fixed, shares)
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
        grid, curve = table.grid[unit], table.force[unit]
        if missing >= room:
            if room > 0.0:
                pressure[unit], force[unit] = grid[-1], table.top_force[unit]
                missing -= room
            continue
        wanted = table.bottom_force[unit] + missing
        bottom = table.bottom[unit]
        i, below = len(grid) - 1, bottom
        while i - below > 1:
            middle = (below + i) // 2
            if curve[middle] < wanted:
                below = middle
            else:
                i = middle
        pressure[unit] = invert(table, model, units, k, k + 1, wanted, grid[i - 1], grid[i],
                                curve[i - 1], curve[i], i == bottom + 1)
        force[unit], missing = wanted, 0.0
    shares.missing = missing


def share(table: Any, model: Any, demand: float, units: Any, count: int, fixed: Any, shares: Any
          ) -> None:
    """
    Give the units of use one common pressure (at most their limit); else as `fill`.

    Batch recruitment (Jenkins, Chapman and Bryant 2016). ``units`` is put in another order.
    """
    begin(table, model, fixed, shares)
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
        if entry <= least + _FLAT:
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
        chosen = invert(table, model, units, 0, used, wanted, low, high, below, above,
                        i == bottom + 1)
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
