# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The least air that any allocation could use for given forces and strains: exhaustive search.

Every way of spreading the force over two motor units is a path through the pressures of the
second one; the first one follows from the force, on its rising or its falling branch. Dynamic
programming over a grid of those pressures finds the path that draws least from the supply. It
knows the future, costs nothing to switch, and has ideal valves: a bound, not a controller.
"""

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    GAS_CONSTANT,
    POLYTROPIC,
    REFERENCE_TEMPERATURE,
)

#: N: a force missed by less than this counts as given.
_TOLERANCE = 0.15


def least_air(bundle: Bundle, time: np.ndarray, force: np.ndarray, strain: np.ndarray,
              tube_volume: float = 5e-6, step: float = 0.05, points: int = 129) -> float:
    """
    Return the least air mass, kg, that gives these forces at these strains.

    Parameters
    ----------
    bundle : Bundle
        Of two motor units.
    time, force, strain : ndarray (T,), s, N, 1
    tube_volume : float, m^3
        Per motor unit.
    step : float, s
        Of the search; faster changes are averaged.
    points : int
        Pressures of the second motor unit.

    Raises
    ------
    InputError
        For a bundle that has not two motor units.
    """
    if bundle.n != 2:
        raise InputError(f'least_air searches bundles of 2 motor units; this one has {bundle.n}')
    edges = np.arange(time[0], time[-1] + step, step)
    forces = np.interp(edges, time, force)
    strains = np.interp(edges, time, strain)
    volumes = bundle.gas_volume(strains) + tube_volume
    start = np.zeros((1, 2))
    cost = np.zeros(1)
    for k in range(len(edges)):
        states = _states(bundle, forces[k], strains[k], points)
        before = volumes[max(k - 1, 0)]
        drawn = _drawn(start[:, None, :], states[None, :, :], before, volumes[k])
        total = cost[:, None] + drawn
        cost, start = total.min(axis=0), states
    return float(cost.min())


def _states(bundle, force, strain, points):
    """Return all pressures (m, 2) that give a force at a strain."""
    grids = [np.linspace(0.0, limit, points) for limit in bundle.max_pressure]
    curves = [np.asarray(bundle.unit_forces(strain, np.stack(
        [g if i == j else np.zeros(points) for j, g in enumerate(grids)], axis=-1)))[:, i]
        for i in range(2)]
    first, second = curves
    bottom = int(np.argmin(first))
    wanted = force - second
    found = []
    rising = np.maximum.accumulate(first[bottom:])
    on_rising = np.interp(wanted, rising, grids[0][bottom:])
    fits = (wanted >= rising[0] - _TOLERANCE) & (wanted <= rising[-1] + _TOLERANCE)
    found.append(np.stack([on_rising, grids[1]], axis=-1)[fits])
    if bottom > 0:
        falling = np.minimum.accumulate(first[:bottom + 1])[::-1]
        on_falling = np.interp(wanted, falling, grids[0][bottom::-1])
        fits = (wanted >= falling[0] - _TOLERANCE) & (wanted <= falling[-1] + _TOLERANCE)
        found.append(np.stack([on_falling, grids[1]], axis=-1)[fits])
    states = np.concatenate(found)
    if len(states) == 0:
        # Out of reach: the nearest that there is, as any controller would do.
        size = np.abs(first[:, None] + second[None, :] - force)
        i, j = np.unravel_index(int(np.argmin(size)), size.shape)
        states = np.array([[grids[0][i], grids[1][j]]])
    return states


def _drawn(before, after, volume_before, volume_after):
    """Return the air taken from the supply between states, summed over units, kg."""
    middle = 0.5 * (volume_before + volume_after)
    mean = 0.5 * (before + after) + ATMOSPHERE
    work = (after - before) * middle / POLYTROPIC + mean * (volume_after - volume_before)
    return np.maximum(work, 0.0).sum(axis=-1) / (GAS_CONSTANT * REFERENCE_TEMPERATURE)
