# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The model that a controller inverts, as its kernels take it."""

from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.model import Bundle


class Belief(NamedTuple):
    """
    A model behind the recruitment controller: see `fam_bundle_ros.model.seam.Model`.

    Attributes
    ----------
    force, shape, parameters, tables, memory, after
        As there; ``after`` is room for candidates here.
    next : (n, M)
        Memory after this tick.
    pressure : (n,), Pa (gauge)
        Room for candidates.
    rows : callable or None
        Forces (m, n) of the whole table at a `Moment` by one call on arrays; not compiled.
    """

    force: Any
    shape: Any
    parameters: Any
    tables: Any
    memory: Any
    after: Any
    next: Any
    pressure: Any
    rows: Any


def without_push_back(bundle: Bundle) -> Bundle:
    """Return a bundle without the laws that let vented muscles push back."""
    for effect in bundle.effects:
        if getattr(effect, 'pushes_back', effect.family == 'resistive'):
            bundle = bundle.without_effect(effect.name)
    return bundle


def belief_of(bundle: Bundle, grid: np.ndarray) -> Belief:
    """Interim: today's Bundle."""
    n = bundle.n

    def state_of(time, dt, start, memory):
        state = bundle.start_state()
        if not start:
            state = {**memory[0][0], 'time': time - dt, 'begun': True}
        return state

    def force(unit, strain, rate, pressure, time, dt, start, shape, parameters, tables, memory,
              after):
        if memory[0][0] == 'equilibrium':
            return float(bundle.unit_forces(strain, np.array(pressure, float), rate)[unit])
        forces, new = bundle.step(state_of(time, dt, start, memory), dt, strain,
                                  np.array(pressure, float), rate)
        after[0][0] = new
        return float(forces[unit])
    memory, after, next_ = [[0.0]], [[0.0]], [[0.0]]

    def rows(now):
        if memory[0][0] == 'equilibrium':
            return np.asarray(bundle.unit_forces(now.strain, grid.T, now.strain_rate))
        return bundle.step(state_of(now.time, now.dt, now.start, memory), now.dt, now.strain,
                           grid.T, now.strain_rate)[0]
    return Belief(force, [[0.0]] * n, [0.0], [0.0], memory, after, next_, [0.0] * n, rows)
