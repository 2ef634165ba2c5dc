# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the bundle is as stiff at a strain reference as the strain loop's gains require. Kernels.

Gains hold for the usual stiffness of the units that hold the load, and of the load, within a
factor `strain_gains.SPAN`. Where the push-back of an empty muscle collapses its force rises with
the strain: this negative stiffness makes the whole bundle softer, or unstable. A unit that is
filled to the start of its rising branch does not push back any more.
"""

import math
from typing import Any

from fam_bundle_ros.control.curves import unit_force
from fam_bundle_ros.control.strain_gains import APART, SPAN
from fam_bundle_ros.control.strain_loop import unit_stiffness_at

#: Steps of the strain on each side of the reference: a collapse may be narrower than `APART`.
_STEPS = 2


def set_softness(settings: Any, model: Any, state: Any, pressure: Any) -> None:
    """
    Tell the state machine if the present state, and the one below, are too soft.

    Parameters
    ----------
    settings, state : RecruitmentSettings, RecruitmentState
        The table is at the reference strain.
    model : Belief
    pressure : list (n,), Pa
        Commanded in the tick before.
    """
    demand, table, count = state.demand, state.table, state.machine.state
    learnt, load = state.outer.load, settings.outer.load_stiffness
    if learnt.known and not settings.outer.load_known:
        load += learnt.value[0]
    last = table.order[count - 1] if count > 0 else -1
    present, below, held = stiffnesses(table, model, pressure, last)
    usual = 0.0
    for unit in range(len(table.order)):
        if holds(table, unit, pressure[unit]):
            usual += unit_stiffness_at(settings.outer, unit, pressure[unit])
    # Muscles that soften as they shorten are no reason to fill others.
    least = (max(min(held, usual), 0.0) + load) / SPAN - load
    # Not before the last unit has crossed its falling branch. RS0 holds nothing.
    demand.soft = 1 if state.crossings.count == 0 and present < least else 0
    demand.soft_below = 1 if count > 1 and below < least else 0


def stiffnesses(table: Any, model: Any, pressure: Any, last: int) -> tuple[float, float, float]:
    """
    Return the least -dF/de of the muscles within `APART` of the table's strain, N.

    Second: the same with the unit ``last`` empty, -1 for none. Third: the mean there of the units
    that hold the load.
    """
    now, step = table.moment, APART / _STEPS
    strain, begun, now.start = now.strain, now.start, True  # at equilibrium: without friction
    least = least_below = math.inf
    before = before_below = first = holding = 0.0
    for k in range(2 * _STEPS + 1):
        now.strain = strain + (k - _STEPS) * step
        force = below = holding = 0.0
        for unit in range(len(table.order)):
            of_unit = unit_force(table, model, unit, pressure[unit])
            force += of_unit
            below += unit_force(table, model, unit, 0.0) if unit == last else of_unit
            if holds(table, unit, pressure[unit]):
                holding += of_unit
        if k > 0:
            least = min(least, (before - force) / step)
            least_below = min(least_below, (before_below - below) / step)
        else:
            first = holding
        before, before_below = force, below
    now.strain, now.start = strain, begun
    return least, least_below, (first - holding) / (2.0 * APART)


def holds(table: Any, unit: int, pressure: float) -> bool:
    """Return whether a pressure (Pa) is above the first cell of the branch, where a unit waits."""
    grid = table.grid[unit]
    return pressure > grid[min(table.bottom[unit] + 1, len(grid) - 1)]
