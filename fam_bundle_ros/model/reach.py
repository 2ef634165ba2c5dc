# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Limits of a bundle: free strain, the overlap of recruitment states, onset pressures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.parts import Overlap

if TYPE_CHECKING:
    from fam_bundle_ros.model.bundle import Bundle


def free_strain(bundle: Bundle, pressure: ArrayLike, highest: float = 0.45) -> np.ndarray:
    """
    Return the strain at which the bundle's force first falls to zero, shape (...).

    Parameters
    ----------
    bundle : Bundle
    pressure : array_like (..., n), Pa (gauge)
    highest : float
        Largest strain; the result is NaN if the force is still positive there.
    """
    def force_at(strain, pressure):
        # the search leaves the range of a table
        return bundle.unit_forces(strain, pressure, warn=False).sum(axis=-1)

    pressure = np.asarray(pressure, float)
    grid = np.linspace(-0.02, highest, 471)
    force = force_at(grid, pressure[..., None, :])
    fallen = force <= 1e-9
    index = np.argmax(fallen, axis=-1)
    low = grid[np.maximum(index - 1, 0)]
    high = grid[index]
    for _ in range(30):
        middle = 0.5 * (low + high)
        positive = force_at(middle, pressure) > 1e-9
        low, high = np.where(positive, middle, low), np.where(positive, high, middle)
    return np.where(fallen.any(axis=-1), 0.5 * (low + high), np.nan)


def state_pressures(bundle: Bundle, state: int, last: ArrayLike) -> np.ndarray:
    """
    Return pressures (..., n) of recruitment state RSk in orderly recruitment.

    Motor units before the k-th are at their maximum pressure, those after it at zero.

    Parameters
    ----------
    bundle : Bundle
    state : int
        k, from 1 to n.
    last : array_like (...), Pa (gauge)
        Pressure of motor unit k.
    """
    last = np.asarray(last, float)
    pressure = np.zeros(last.shape + (bundle.n,))
    pressure[..., :state - 1] = bundle.max_pressure[:state - 1]
    pressure[..., state - 1] = last
    return pressure


def overlap(bundle: Bundle, strain: float, state: int, points: int = 257) -> Overlap:
    """
    Return the range of forces that RSk and RSk+1 can both produce at a strain.

    Parameters
    ----------
    bundle : Bundle
    strain : float
    state : int
        k, from 1 to n - 1.
    points : int
        Number of pressures at which the force is computed.
    """
    if not 1 <= state < bundle.n:
        raise InputError(f'overlap needs a recruitment state from 1 to {bundle.n - 1}, '
                         f'not {state}')
    last = np.linspace(0.0, bundle.max_pressure[state], points)
    force = bundle.force(strain, state_pressures(bundle, state + 1, last))
    full, lowest = float(force[0]), int(np.argmin(force))
    lower_state = bundle.force(strain, state_pressures(
        bundle, state, np.linspace(0.0, bundle.max_pressure[state - 1], points)))
    return Overlap(low=max(float(force[lowest]), float(lower_state.min())), high=full,
                   dip=full - float(force[lowest]), dip_pressure=float(last[lowest]),
                   onset_pressure=onset_pressure(bundle, strain, state + 1))


def onset_pressure(bundle: Bundle, strain: float, unit: int, points: int = 257) -> float:
    """
    Return the pressure at which the force of a motor unit has recovered its value at zero, Pa.

    Above it the unit increases the force of the bundle; below it the unit's resistive force is
    larger than when it is vented. 0 if there is no such dip; NaN if the force does not recover
    within the maximum pressure.

    Parameters
    ----------
    bundle : Bundle
    strain : float
    unit : int
        Number of the motor unit, from 1.
    points : int
        Number of pressures at which the force is computed before the result is refined.
    """
    index = unit - 1

    def gain(pressure):
        pressures = np.zeros(np.shape(pressure) + (bundle.n,))
        pressures[..., index] = pressure
        forces = bundle.unit_forces(strain, pressures)[..., index]
        return forces - bundle.unit_forces(strain, np.zeros(bundle.n))[index]

    grid = np.linspace(0.0, bundle.max_pressure[index], points)
    below = np.flatnonzero(gain(grid[1:]) <= 1e-9)
    if len(below) == 0:
        return 0.0
    if below[-1] + 2 >= points:
        return float('nan')
    low, high = grid[below[-1] + 1], grid[below[-1] + 2]
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if gain(middle) > 0.0 else (middle, high)
    return float(0.5 * (low + high))
