# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets of the force from trial to trial, as of a load cell that was not tared in between."""

from typing import NamedTuple

import numpy as np
from scipy.special import fdtri

from fam_bundle_ros.data.grouping import earlier, pressure_levels, pressure_speed, visit_cells
from fam_bundle_ros.data.measurement import Measurement, RESOLUTION
from fam_bundle_ros.data.rates import FALSE_ALARM
from fam_bundle_ros.told import number

#: Speeds that differ by less than this in the natural logarithm are one, as for the discrepancy.
_ONE_SPEED = 1.0
#: Largest lag of an autocorrelation, in samples.
_LONGEST = 400


class Offsets(NamedTuple):
    """The offset of each row's trial, (T,), and the standard deviation between trials, N."""

    rows: np.ndarray
    size: float

    def __str__(self) -> str:
        return (f'each trial has its own offset, {number(self.size, 2)} N rms: tare before each '
                'trial')


def trial_offsets(measurement: Measurement, values: np.ndarray) -> Offsets | None:
    """
    Return what trials differ by, or None where they do not differ by offsets.

    Trials are compared only where they met the same strain, pressure and direction at about the
    same speed, so that no error of a model can pass for an offset: a two-way analysis of variance
    with cells and trials, the noise counted by its independent samples. In a map without trials,
    where each repeat is a block of the file, blocks are the trials. Values are measured minus
    modelled forces, (T,), N.
    """
    if measurement.is_static:
        cell, trial = _cells_of_a_map(measurement), measurement.trial
        if len(measurement.trial_names) == 1:  # repeats, if they are whole blocks
            trial = earlier(cell)
            if (np.diff(trial) < 0).any():
                return None
    else:
        trial = measurement.trial
        cell = np.unique(np.stack([visit_cells(measurement)[0], _speeds(measurement)]), axis=1,
                         return_inverse=True)[1].ravel()
    if trial.max() < 1:
        return None
    count = np.bincount(cell)

    def within_cells(column: np.ndarray) -> np.ndarray:
        return column - (np.bincount(cell, column) / np.maximum(count, 1))[cell]

    y = within_cells(values)
    dummies = np.stack([within_cells((trial == k).astype(float))
                        for k in range(trial.max() + 1)], -1)
    offset, _, rank, _ = np.linalg.lstsq(dummies, y, rcond=1e-9)
    if not rank:
        return None
    left = y - dummies @ offset
    shared = np.abs(dummies).max(axis=1) > 1e-9
    # the rows of a cell that one trial has met are without their mean: they look less correlated
    tau = autocorrelation_time(left[shared], trial[shared])
    free = (shared.sum() - len(np.unique(cell[shared])) - rank) / tau
    if free < 2:
        return None
    between = float(y @ y - left @ left) / rank
    # a sum over correlated samples has tau times the variance
    noise = float(left[shared] @ left[shared]) / free
    if between < noise * fdtri(rank, free, 1.0 - FALSE_ALARM):
        return None
    size = float(np.sqrt(offset @ offset / rank))
    if size < RESOLUTION * np.abs(measurement.force).max():
        return None
    return Offsets(offset[trial], size)


def _speeds(measurement: Measurement) -> np.ndarray:
    """Return the class of the usual speed of each row's trial, (T,) int."""
    speed = (pressure_speed(measurement) if measurement.is_held
             else np.abs(measurement.strain_rate))
    moving = (measurement.direction != 0) & (speed > 0.0)
    trial = measurement.trial
    usual = np.array([np.log(np.median(speed[rows])) if rows.any() else -np.inf
                      for rows in (moving & (trial == k) for k in range(int(trial.max()) + 1))])
    levels = np.sort(usual[np.isfinite(usual)])
    edges = levels[1:][np.diff(levels) > _ONE_SPEED]
    return np.searchsorted(edges, usual, side='right')[trial]


def _cells_of_a_map(measurement: Measurement) -> np.ndarray:
    """Return the cell of each row: levels of strain and pressures, and the way in the file."""
    strain, _ = pressure_levels(measurement.strain, 60)
    levels = [pressure_levels(column)[0] for column in measurement.pressure.T]
    same = np.all([np.diff(level) == 0 for level in levels], axis=0)
    step = np.where(same, np.sign(np.diff(strain)), 0.0)
    # up and down differ by friction, which is not an offset: they are different cells
    way = np.where(np.append(step, 0.0) != 0.0, np.append(step, 0.0), np.append(0.0, step))
    return np.unique(np.stack([strain, *levels, way], -1), axis=0, return_inverse=True)[1].ravel()


def autocorrelation_time(residual: np.ndarray, trial: np.ndarray) -> float:
    """
    Return how many samples make one independent sample: 1 + 2 sum of autocorrelations.

    The sum stops at the first pair of lags that is not positive (Geyer). At least 1.
    """
    values = residual - residual.mean()
    parts = np.split(values, np.flatnonzero(np.diff(trial)) + 1)
    lags = min(_LONGEST, max(len(values) // 4, 2))
    total, weight = np.zeros(lags), np.zeros(lags)
    for part in parts:
        n = len(part)
        if n < 4:
            continue
        size = 1 << int(np.ceil(np.log2(2 * n)))
        spectrum = np.fft.rfft(part, size)
        auto = np.fft.irfft(spectrum * np.conj(spectrum), size)[:min(n, lags)]
        total[:len(auto)] += auto
        weight[:len(auto)] += n - np.arange(len(auto))
    if total[0] <= 0:
        return 1.0
    rho = (total / np.maximum(weight, 1)) / (total[0] / weight[0])
    tau = 1.0
    for k in range(1, lags - 1, 2):
        pair = rho[k] + rho[k + 1]
        if pair <= 0:
            break
        tau += 2.0 * pair
    return float(max(tau, 1.0))
