# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The least air that any allocation could use for given forces and strains: exhaustive search.

Every allocation of the force to two motor units is a path of the second unit's pressure; the first
unit's pressure follows from the force, on its rising or falling branch. Dynamic programming over a
grid of these pressures finds the path with the least air from the supply, first in coarse steps
over all pressures, then in fine steps around this path. It knows the future, switches without
cost, and has ideal valves: it is a lower bound, not a controller.
"""

import numpy as np

from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    GAS_CONSTANT,
    POLYTROPIC,
    REFERENCE_TEMPERATURE,
)

#: Accepted force error, N.
_TOLERANCE = 0.15
#: Number of pressures per unit over the whole range; number of refinements, each of which halves
#: their spacing; number of pressures searched on either side of the previous path.
_POINTS, _REFINEMENTS, _AROUND = 129, 5, 16
#: Time step of the first search, in steps of the refinements.
_COARSE = 5


def least_air(bundle: Bundle, time: np.ndarray, force: np.ndarray, strain: np.ndarray,
              tube_volume: float = 5e-6, step: float = 0.01) -> float:
    """
    Return the least air mass, kg, for these forces at these strains.

    It includes filling the vented units to the first pressures.

    Parameters
    ----------
    bundle : Bundle
        With two motor units.
    time, force, strain : ndarray (T,), s, N, 1
    tube_volume : float, m^3
        Per motor unit.
    step : float, s
        Time step of the search. A load on muscles oscillates at about 6 Hz: steps of 50 ms would
        miss the air of these oscillations, which every allocation needs.
    """
    whole = np.linspace(0.0, bundle.max_pressure[1], _POINTS)
    coarse = _Search(bundle, time, force, strain, tube_volume, _COARSE * step)
    _, path = coarse.best(np.tile(whole, (len(coarse.time), 1)))
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
    """Forces and gas volumes at the steps of a search, and the units' forces on a grid."""

    def __init__(self, bundle, time, force, strain, tube_volume, step):
        self.time = np.arange(time[0], time[-1] + step, step)
        self._force = np.interp(self.time, time, force)
        strains = np.interp(self.time, time, strain)
        self._volume = bundle.gas_volume(strains) + tube_volume
        grid = np.linspace(np.zeros(2), bundle.max_pressure, _POINTS)
        self._spacing = grid[1]
        forces = np.asarray(bundle.unit_forces(strains[:, None], grid))
        self._first, self._other = forces[..., 0], forces[..., 1]

    def best(self, second):
        """Return the least air, kg, and its path (K,) through the pressures ``second`` (K, m)."""
        states, counts = self._states(second)
        after, before = self._costs(states, counts)
        ends = np.cumsum(counts)
        # The path begins vented at the first volume: only the pressures of step 0 use air.
        cost = np.maximum(after[:counts[0]], 0.0).sum(axis=-1)
        cheapest, last = [], slice(0, counts[0])
        for k in range(1, len(counts)):
            here = slice(ends[k - 1], ends[k])
            total = np.maximum(after[here, 0, None] - before[last, 0], 0.0)
            other = np.maximum(after[here, 1, None] - before[last, 1], 0.0)
            for unit, drawn in enumerate((total, other)):
                if self._volume[k, unit] > self._volume[k - 1, unit]:
                    vented = states[here, unit] <= 0.0
                    if vented.any():
                        drawn[np.ix_(vented, states[last, unit] <= 0.0)] = 0.0
            total += other
            total += cost
            choice = total.argmin(axis=1)
            cheapest.append(choice)
            cost, last = total[np.arange(len(choice)), choice], here
        place = int(cost.argmin())
        least, path = float(cost[place]), np.empty(len(counts))
        for k in range(len(counts) - 1, -1, -1):
            path[k] = states[ends[k] - counts[k] + place, 1]
            place = cheapest[k - 1][place] if k else 0
        return least, path

    def _costs(self, states, counts):
        """
        Return the air of each state (S, 2), as the later and as the earlier state of a step.

        A unit draws max(later - earlier, 0): V dp / n + p dV over R T is linear in the pressures
        of both states. A unit that stays vented takes ambient air through its open exhaust.
        """
        before = np.concatenate([self._volume[:1], self._volume])
        middle, change = 0.5 * (before[1:] + before[:-1]), np.diff(before, axis=0)
        per_later = middle / POLYTROPIC + 0.5 * change
        per_earlier = np.concatenate([(middle / POLYTROPIC - 0.5 * change)[1:], per_later[-1:]])
        each = np.repeat(np.arange(len(counts)), counts)
        unit = GAS_CONSTANT * REFERENCE_TEMPERATURE
        later = (states * per_later[each] + (ATMOSPHERE * change)[each]) / unit
        return later, states * per_earlier[each] / unit

    def _states(self, second):
        """Return the pressures (S, 2) that give the force, and their number at each step (K,)."""
        first, steps = self._first, np.arange(len(self.time))[:, None]
        place = second / self._spacing[1]
        low = np.clip(place.astype(int), 0, _POINTS - 2)
        left, right = self._other[steps, low], self._other[steps, low + 1]
        wanted = self._force[:, None] - left - (place - low) * (right - left)
        bottom = first.argmin(axis=1)[:, None]
        least = first[steps, bottom]
        # Beyond its branch, each curve stays at its least force.
        rising = np.maximum.accumulate(
            np.where(np.arange(_POINTS) < bottom, least, first), axis=1)
        falling = np.minimum.accumulate(first, axis=1)
        found, fits = [], []
        for curve, top, side in ((rising, rising[:, -1:], 1), (falling, falling[:, :1], -1)):
            found.append(self._invert(curve, wanted, bottom, side))
            fits.append((wanted >= least - _TOLERANCE) & (wanted <= top + _TOLERANCE))
        states = np.stack([np.concatenate(found, axis=1), np.tile(second, 2)], axis=-1)
        good = np.concatenate(fits, axis=1)
        # If the force is out of range, use the nearest force.
        for k in np.flatnonzero(~good.any(axis=1)):
            miss = np.abs(first[k][:, None] - wanted[k])
            i, j = np.unravel_index(int(np.argmin(miss)), miss.shape)
            states[k, 0], good[k, 0] = (i * self._spacing[0], second[k, j]), True
        return states[good], good.sum(axis=1)

    def _invert(self, curve, wanted, bottom, side):
        """Return the first unit's pressures (K, m) at which a branch gives the wanted forces."""
        steps = np.arange(len(curve))[:, None]
        above = np.stack([np.searchsorted(row[::side], force, side='right')
                          for row, force in zip(curve, wanted)])
        # The last grid point, seen from the bottom, whose force is not above the wanted one.
        low = np.maximum(above - 1, bottom) if side > 0 else np.minimum(_POINTS - above, bottom)
        high = np.clip(low + side, 0, _POINTS - 1)
        rise = curve[steps, high] - curve[steps, low]
        share = (wanted - curve[steps, low]) / np.where(rise > 0.0, rise, np.inf)
        return (low + side * np.clip(share, 0.0, 1.0)) * self._spacing[0]
