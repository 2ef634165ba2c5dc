# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Memory of a model along the reference of a strain, as kernels.

The demand for a reference is the force of a muscle that follows it. Dry friction that builds up
within a small motion depends on the path: with the memory of the measured strain it would turn
each tracking error into a force, a gain many times the stiffness of the muscle. All other memory
(relaxation, creep, softening) is that of the measured motion.
"""

from typing import Any


def follow_reference(table: Any, model: Any, pressure: Any) -> None:
    """
    Put friction's memory along the reference into the model.

    Where the table's moment is at rest, it begins anew without force: a step prescribes no motion.
    """
    if table.moment.strain_rate == 0.0:
        begun, table.moment.start = table.moment.start, True
        _advance(table, model, pressure, model.followed)
        table.moment.start = begun
    _exchange(model)


def leave_reference(table: Any, model: Any, pressure: Any) -> None:
    """Advance friction's memory along the reference by one tick, and put the measured one back."""
    _advance(table, model, pressure, model.memory)
    _exchange(model)


def keep_memory(model: Any, follows: bool) -> None:
    """Advance the memory by one tick; without a reference to follow, both memories are equal."""
    for unit in range(len(model.memory)):
        for k in range(len(model.memory[unit])):
            model.memory[unit][k] = model.next[unit][k]
            if not follows:
                model.followed[unit][k] = model.next[unit][k]


def _advance(table: Any, model: Any, pressure: Any, memory: Any) -> None:
    """Advance friction's ``memory`` (n, M) to the table's moment, at pressures (n,), Pa."""
    if len(model.path) == 0:
        return
    now = table.moment
    for unit in range(len(pressure)):
        model.pressure[unit] = pressure[unit]
    for unit in range(len(pressure)):
        model.force(unit, now.strain, now.strain_rate, model.pressure, now.time, now.dt, now.start,
                    model.shape, model.parameters, model.tables, memory, model.after)
        for k in model.path:
            memory[unit][k] = model.after[unit][k]


def _exchange(model: Any) -> None:
    for unit in range(len(model.memory)):
        for k in model.path:
            kept = model.memory[unit][k]
            model.memory[unit][k] = model.followed[unit][k]
            model.followed[unit][k] = kept
