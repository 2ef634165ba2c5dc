# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The least air that any allocation could use for given forces and strains: exhaustive search.

Every way of spreading the force over two motor units is a path through the pressures of the
second one; the first one follows from the force, on its rising or its falling branch. Dynamic
programming over a grid of those pressures finds the path that draws least from the supply, first
in coarse steps over all pressures, then in fine ones around the path found. It knows the future,
costs nothing to switch, and has ideal valves: a bound, not a controller.
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
#: Pressures per unit over their whole range; each refinement halves their distance, and looks at
#: so many on either side of the path found before.
_POINTS, _REFINEMENTS, _AROUND = 129, 5, 16
#: Steps of the first search, in those of the refinements.
_COARSE = 5


def least_air(bundle: Bundle, time: np.ndarray, force: np.ndarray, strain: np.ndarray,
              tube_volume: float = 5e-6, step: float = 0.01) -> float:
    """
    Return the least air mass, kg, that gives these forces at these strains from vented units.

    What filling the first pressures takes is counted as `filling_air` counts it.

    Parameters
    ----------
    bundle : Bundle
        Of two motor units.
    time, force, strain : ndarray (T,), s, N, 1
    tube_volume : float, m^3
        Per motor unit.
    step : float, s
        Of the search. A load on muscles swings at about 6 Hz: steps of 50 ms would not see the
        air that this takes, whoever allocates.

    Raises
    ------
    InputError
        For a bundle that has not two motor units.
    """
    if bundle.n != 2:
        raise InputError(f'least_air searches bundles of 2 motor units; this one has {bundle.n}')
    whole = np.linspace(0.0, bundle.max_pressure[1], _POINTS)
    coarse = _Search(bundle, time, force, strain, tube_volume, _COARSE * step)
    _, path = coarse.best([whole] * len(coarse.time))
    search = _Search(bundle, time, force, strain, tube_volume, step)
    path = np.interp(search.time, coarse.time, path)
    spacing = whole[1]
    least = np.inf
    for _ in range(_REFINEMENTS):
        spacing /= 2.0
        around = path[:, None] + spacing * np.arange(-_AROUND, _AROUND + 1)
        cost, path = search.best(np.clip(around, 0.0, whole[-1]))
        least = min(least, cost)
    return least


class _Search:
    """The forces and strains at the steps of a search, and what each pressure gives there."""

    def __init__(self, bundle, time, force, strain, tube_volume, step):
        self.time = np.arange(time[0], time[-1] + step, step)
        self._force = np.interp(self.time, time, force)
        strains = np.interp(self.time, time, strain)
        self._volume = bundle.gas_volume(strains) + tube_volume
        self._grid = np.linspace(np.zeros(2), bundle.max_pressure, _POINTS)
        self._curves = [np.asarray(bundle.unit_forces(e, self._grid)) for e in strains]

    def best(self, second):
        """Return the least air, kg, and the second unit's pressures (K,) on the way, of (K, m)."""
        start, cost, before = np.zeros((1, 2)), np.zeros(1), self._volume[0]
        states, cheapest = [], []
        for k, volume in enumerate(self._volume):
            states.append(self._states(k, second[k]))
            drawn = _drawn(start[:, None, :], states[k][None, :, :], before, volume)
            total = cost[:, None] + drawn
            cheapest.append(total.argmin(axis=0))
            cost, start, before = total.min(axis=0), states[k], volume
        last = int(cost.argmin())
        least, path = float(cost[last]), np.empty(len(states))
        for k in range(len(states) - 1, -1, -1):
            path[k] = states[k][last, 1]
            last = cheapest[k][last]
        return least, path

    def _states(self, k, second):
        """Return the pressures (m, 2) that give the force at step ``k``."""
        grid, (first, other) = self._grid, self._curves[k].T
        bottom = int(np.argmin(first))
        wanted = self._force[k] - np.interp(second, grid[:, 1], other)
        branches = [(np.maximum.accumulate(first[bottom:]), grid[bottom:, 0])]
        if bottom > 0:
            branches.append((np.minimum.accumulate(first[:bottom + 1])[::-1], grid[bottom::-1, 0]))
        found = []
        for forces, pressures in branches:
            fits = (wanted >= forces[0] - _TOLERANCE) & (wanted <= forces[-1] + _TOLERANCE)
            found.append(np.stack([np.interp(wanted, forces, pressures), second], axis=-1)[fits])
        states = np.concatenate(found)
        if len(states) == 0:
            # Out of reach: the nearest that there is, as any controller would do.
            miss = np.abs(first[:, None] - wanted)
            i, j = np.unravel_index(int(np.argmin(miss)), miss.shape)
            states = np.array([[grid[i, 0], second[j]]])
        return states


def filling_air(bundle: Bundle, pressure: np.ndarray, strain: float,
                tube_volume: float = 5e-6) -> float:
    """Return the air, kg, that brings vented units (n,) to pressures (n,), Pa, at a strain."""
    volume = bundle.gas_volume(strain) + tube_volume
    return float(_drawn(np.zeros(bundle.n), np.asarray(pressure, float), volume, volume))


def _drawn(before, after, volume_before, volume_after):
    """Return the air taken from the supply between states, summed over units, kg."""
    middle = 0.5 * (volume_before + volume_after)
    mean = 0.5 * (before + after) + ATMOSPHERE
    work = (after - before) * middle / POLYTROPIC + mean * (volume_after - volume_before)
    # A unit that stays vented breathes through its open exhaust.
    work = np.where((before <= 0.0) & (after <= 0.0), 0.0, work)
    return np.maximum(work, 0.0).sum(axis=-1) / (GAS_CONSTANT * REFERENCE_TEMPERATURE)
