# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Force over pressure of every motor unit at one instant, as kernels.

At one strain the force of a motor unit over its own pressure first falls (it pushes back more
and more) and then rises (Kim, Mazzoleni and Bryant 2021, SPIE 11586: free strain gradient
reversal). `tabulate` and `find_branches` make the curves of one tick; `inverse` computes
pressures on their rising branches. `allocation` has the same as objects.
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from fam_bundle_ros.kernels import Alternative

#: Hysteresis: a unit that was not useful becomes so when it adds more than this share of its
#: push-back, and more than this force (N), so that strain noise does not toggle it.
_WAKE_SHARE, _WAKE_FORCE = 0.1, 0.5
#: N: smaller differences of force count as equal where slack or a threshold makes a curve flat.
FLAT = 1e-9
#: A curve that rises by less than this share of its slope further up counts as flat: a muscle with
#: the slope further up there has a loop gain beyond any usual gain margin.
_STEEP_SHARE = 0.1


@dataclass
class Moment:
    """
    Operating point of the model: strain (1), its rate (1/s), time and step (s).

    ``start`` is true where the model's memory is reset.
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
        False for a controller that neglects resistive forces: no force is below zero.
    moment : Moment
    pull, push : list (n,)
        Factors on the model's tension and push-back of each unit.
    grid, force : list (n, m), Pa (gauge) and N
        From 0 to each unit's limit.
    rest_force : list (n,), N
        At zero pressure.
    useful : list (n,) of int
        1 for units that can pull more than when vented. The others (past the free strain, where
        curves only fall) have no rising branch and stay empty.
    bottom : list (n,) of int
        Index of the start of the rising branch.
    bottom_force, bottom_pressure : list (n,), N and Pa
    top_force : list (n,), N
        At the limit.
    dip : list (n,), N
        Drop of the force from zero pressure to the bottom; negative for a rise.
    top, floor : list (n + 1,), N
        Largest and smallest force of RS0..RSn on rising branches.
    rubs : bool
        Whether dry friction that builds up changes along the curves with the pressure; else it
        shifts them by ``friction`` (n,), N.
    lowered : list (n,) of int
        1 for units below their bottoms, on the line of their rising branch (`line_at`).
    crossing : list (n,), N
        Largest demands at which RSk -> RSk+1 causes no dip: up to there the active units have the
        reserve to compensate for the push-back of the next one.
    """

    order: list
    pushes_back: bool
    moment: Moment
    pull: list
    push: list
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
    friction: list
    lowered: list
    rubs: bool = True


def curve_table(order, grid: list, pushes_back: bool) -> CurveTable:
    """Return an empty table for pressures ``grid`` (n, m), Pa."""
    n = len(grid)

    def zeros(count):
        return [0.0] * count
    return CurveTable(list(order), pushes_back, Moment(), [1.0] * n, [1.0] * n, grid, [
        zeros(len(grid[0])) for _ in range(n)], zeros(n), [0] * n, [0] * n, zeros(n), zeros(n),
                      zeros(n), zeros(n), zeros(n + 1), zeros(n + 1), zeros(n), zeros(n), [0] * n)


# --- the curves ----------------------------------------------------------------------------------

def unit_force(table: Any, model: Any, unit: int, pressure: float) -> float:
    """Return the force of one unit at a candidate pressure (Pa), at the table's moment, N."""
    now = table.moment
    model.pressure[unit] = pressure
    parameters = model.parameters if table.rubs else model.frictionless
    force = model.force(unit, now.strain, now.strain_rate, model.pressure, now.time, now.dt,
                        now.start, model.shape, parameters, model.tables, model.memory,
                        model.after)
    return adapted(table, unit, force + table.friction[unit])


def fix_friction(table: Any, model: Any, pressure: Any) -> None:
    """
    Take the dry friction at the table's moment and pressures (n,), Pa, for that at any pressure.

    Along the reference of a strain it is known. In the slopes of the curves it would, after each
    reversal, make of noise in the demand a motion of the pressure by twice the friction.
    """
    now = table.moment
    table.rubs = len(model.path) == 0
    if table.rubs:
        return
    for unit in range(len(pressure)):
        model.pressure[unit] = pressure[unit]
    for unit in range(len(pressure)):
        table.friction[unit] = model.force(
            unit, now.strain, now.strain_rate, model.pressure, now.time, now.dt, now.start,
            model.shape, model.parameters, model.tables, model.memory, model.after)
        table.friction[unit] -= model.force(
            unit, now.strain, now.strain_rate, model.pressure, now.time, now.dt, now.start,
            model.shape, model.frictionless, model.tables, model.memory, model.after)


def free_friction(table: Any) -> None:
    """Let dry friction change with the pressure along the curves."""
    table.rubs = True
    for unit in range(len(table.friction)):
        table.friction[unit] = 0.0


def adapted(table: Any, unit: int, force: float) -> float:
    """Return the force of the adapted model for a force of the model, N."""
    if force > 0.0:
        return table.pull[unit] * force
    return table.push[unit] * force if table.pushes_back else 0.0


def unadapted(table: Any, unit: int, force: float) -> float:
    """Return the force of the model for one of the adapted model, N; 0 where none is left."""
    if force > 0.0:
        return force / table.pull[unit]
    return force / table.push[unit] if table.push[unit] > 0.0 else 0.0


def limit_without_adaptation(table: Any, state: int) -> float:
    """Return the largest force of RSk by the model without adaptation, N."""
    total = 0.0
    for k in range(len(table.order)):
        unit = table.order[k]
        total += unadapted(table, unit, table.top_force[unit] if k < state
                           else table.rest_force[unit])
    return total


def _by_unit(table: Any, model: Any) -> None:
    """Fill the table unit by unit, and find the last of the smallest forces."""
    now = table.moment
    parameters = model.parameters if table.rubs else model.frictionless
    for unit in range(len(table.order)):
        curve = table.force[unit]
        model.curve(unit, now.strain, now.strain_rate, table.grid[unit], now.time, now.dt,
                    now.start, model.shape, parameters, model.tables, model.memory,
                    model.after, curve)
        least = math.inf
        for k in range(len(curve)):
            curve[k] = adapted(table, unit, curve[k] + table.friction[unit])
            least = min(least, curve[k])
        for k in range(len(curve)):
            if curve[k] <= least + FLAT:
                table.bottom[unit] = k


def _by_rows(table: Any, model: Any) -> None:
    """Fill the table by one call on arrays, for plain Python."""
    force = model.rows(table.moment, model.memory, table.rubs) + np.array(table.friction)
    push = np.array(table.push) if table.pushes_back else 0.0
    force = np.where(force > 0.0, np.array(table.pull), push) * force
    tied = force <= force.min(axis=0) + FLAT
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
        1 for units that were not useful in the tick before; updated.
    """
    last, total = len(table.grid[0]) - 1, 0.0
    for unit in range(len(table.order)):
        curve = table.force[unit]
        rest, lowest = curve[0], curve[table.bottom[unit]]
        wake = max(_WAKE_SHARE * (rest - lowest), _WAKE_FORCE) if asleep[unit] > 0 else 0.0
        useful = curve[last] - rest > wake
        table.bottom[unit] = end_of_flat(table, unit) if useful else 0
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
        table.crossing[k] = table.top[k] - max(table.dip[unit], 0.0)


def end_of_flat(table: Any, unit: int) -> int:
    """
    Return the index at which a unit's curve begins to rise, from its lowest point on.

    A slack muscle's curve is almost flat up to its free strain. A demand within such a flat would
    move the pressure through all of it, and the muscle, which differs from its model, by far more
    than the demand: the loop would have many times its gain and oscillate. The curve is that of
    the model without adaptation, which must not move the end of a flat.
    """
    grid, curve, bottom = table.grid[unit], table.force[unit], table.bottom[unit]
    end, last = bottom, len(grid) - 1
    lowest = unadapted(table, unit, curve[bottom])
    highest = unadapted(table, unit, curve[last])
    # Mean slopes, as a flat may have bumps; multiplied out, as a grid may end in equal pressures.
    while end + 1 < last:
        force = unadapted(table, unit, curve[end + 1])
        if ((force - lowest) * (grid[last] - grid[end + 1])
                > _STEEP_SHARE * (highest - force) * (grid[end + 1] - grid[bottom])):
            break
        end += 1
    return end


def top_at(table: Any, model: Any, state: int, strain: float) -> float:
    """Return the largest force of a state RSk at another strain than the table's, N."""
    kept, total = table.moment.strain, 0.0
    table.moment.strain = strain
    for k in range(len(table.order)):
        unit = table.order[k]
        full = k < state and table.useful[unit] > 0
        total += unit_force(table, model, unit, table.grid[unit][-1] if full else 0.0)
    table.moment.strain = kept
    return total


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


def reach_below(table: Any, unit: int) -> float:
    """
    Return the drop of a unit's force from its bottom to zero pressure on a straight line, N.

    The line through both ends of the rising branch, extrapolated to zero pressure.
    """
    bottom, top = table.bottom_pressure[unit], table.grid[unit][-1]
    if table.useful[unit] == 0 or not bottom < top:
        return 0.0
    return (table.top_force[unit] - table.bottom_force[unit]) * bottom / (top - bottom)


def on_line(table: Any, unit: int, pressure: float) -> bool:
    """Return whether a lowered unit follows the line of `reach_below` at a measured pressure."""
    return table.lowered[unit] > 0 and max(pressure, 0.0) < table.bottom_pressure[unit]


def line_at(table: Any, unit: int, pressure: float) -> float:
    """Return the force of a unit on the line of `reach_below`, N, at a pressure (Pa)."""
    short = 1.0 - pressure / table.bottom_pressure[unit]
    return table.bottom_force[unit] - reach_below(table, unit) * short
