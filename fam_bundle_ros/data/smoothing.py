# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Sampled strain and pressure without as much of their noise as possible."""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from fam_bundle_ros.data.rates import (
    FALSE_ALARM,
    locally,
    misses,
    noise_of,
    parts_of,
    WINDOWS,
    with_corners,
    with_neighbours,
)

#: Windows in rows; wider ones would flatten the bends of a moving signal.
_SMOOTHED = (5, 9, 17, 33)


class Smooth(NamedTuple):
    """A signal with less noise, all (T,), and standard deviations of noise."""

    value: np.ndarray
    #: Of what is left in each sample, and shared with its neighbours.
    left: np.ndarray
    #: Of a sample as it was read.
    noise: float


def smooth(time: np.ndarray, value: np.ndarray, trial: np.ndarray) -> Smooth:
    """
    Return a signal with less noise; bends, corners and steps are kept.

    Each sample takes the widest local quadratic that stays within the noise of the narrower ones
    (intersection of confidence intervals). Where the signal is held, in a trial or between two
    steps, it becomes its mean.
    Noise in strain and pressure would otherwise pass through the model and make lags, which
    smooth, or a hysteresis, which holds, look like a gain.
    """
    noise = noise_of(time, value, trial)
    if noise <= 0.0:
        return Smooth(value, np.zeros(len(value)), 0.0)
    parts, corners = parts_of(time, trial), None
    for window in (WINDOWS[-1], *_SMOOTHED[:0:-1]):  # corners by the widest that fits
        local, corners = with_corners(time, value, parts, window // 2, noise)
        if not misses(value, local.value, noise, window):
            break
    ends = np.zeros(len(value), bool)
    ends[[rows[0] for rows in parts]] = True
    ramp = np.zeros(len(value))
    if corners is not None:
        ramp, ends = corners.ramp, ends | (corners.bend != 0.0)
    best, half = value - ramp, np.zeros(len(value), int)
    spread, going = np.full(len(value), noise), np.ones(len(value), bool)
    for window in _SMOOTHED:
        fitted = locally(time, value - ramp, parts, window // 2).value
        going &= with_neighbours(np.abs(fitted - best) <= 2.5 * spread)
        best, half = np.where(going, fitted, best), np.where(going, window // 2, half)
        spread = np.where(going, noise * 1.5 / np.sqrt(window), spread)
    best, left = best + ramp, noise * _error_of_fit(half, ends)
    # larger changes than any of the noise
    step = np.sqrt(2.0) * noise * -ndtri(0.5 * FALSE_ALARM / len(value))
    for part in parts:
        for rows in np.split(part, np.flatnonzero(np.abs(np.diff(value[part])) > step) + 1):
            if _is_held(value[rows], noise):
                best[rows], left[rows] = value[rows].mean(), noise / np.sqrt(len(rows))
    return Smooth(best, left, noise)


def _error_of_fit(half: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """
    Return the standard deviation of local quadratics over that of the samples, (T,).

    The square root of the leverage of the sample, in even steps. ``ends`` (T,) are the rows with
    which the samples begin that a quadratic can use: what is at a corner is known from one side.
    """
    rows = np.arange(len(half))
    first = np.maximum.accumulate(np.where(ends, rows, 0))
    last = np.minimum.accumulate(np.where(np.append(ends[1:], True), rows, rows[-1])[::-1])[::-1]
    before, after = np.minimum(half, rows - first), np.minimum(half, last - rows)
    count, s1, s2, s3, s4 = (_power_sum(after, k) + (-1) ** k * _power_sum(before, k)
                             + (k == 0) for k in range(5))
    determinant = count * (s2 * s4 - s3 ** 2) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 ** 2)
    leverage = np.divide(s2 * s4 - s3 ** 2, determinant, out=np.ones(len(half)),
                         where=determinant > 0.0)
    return np.sqrt(np.minimum(leverage, 1.0))


def _power_sum(n: np.ndarray, power: int) -> np.ndarray:
    """Return 1 + 2^power + ... + n^power."""
    n = n.astype(float)
    return [n, n * (n + 1.0) / 2.0, n * (n + 1.0) * (2.0 * n + 1.0) / 6.0,
            (n * (n + 1.0) / 2.0) ** 2,
            n * (n + 1.0) * (2.0 * n + 1.0) * (3.0 * n ** 2 + 3.0 * n - 1.0) / 30.0][power]


def _is_held(value: np.ndarray, noise: float) -> bool:
    """
    Return whether a signal is constant but for white noise: samples, and means of stretches.

    Their scatter is within three standard deviations of what chi-squared allows.
    """
    count = len(value) // _SMOOTHED[-1]
    if count < 2:
        return False
    means = value[:count * _SMOOTHED[-1]].reshape(count, -1).mean(axis=1)
    # a noise from a median deviation is as uncertain as from a quarter of the rows
    swings = np.var(value) > noise ** 2 * (1.0 + 3.0 * np.sqrt(8.0 / len(value)))
    drifts = np.var(means, ddof=1) * _SMOOTHED[-1] > noise ** 2 * (
        1.0 + 3.0 * np.sqrt(2.0 / (count - 1)))
    return not (swings or drifts)
