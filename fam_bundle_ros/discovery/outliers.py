# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Detect spikes: single rows far from their neighbours in time, which no effect explains."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import sample_noise, signal_step


def spikes(data: Measurement, residual: np.ndarray, noise: float, half: int = 3,
           threshold: float = 5.0) -> np.ndarray:
    """
    Return the rows that are far from the median of their neighbours in time, (T,) bool.

    Rows within ``half`` rows of a step of strain or pressure are never spikes: their residual may
    be the response of a missing effect to the step.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    noise : float, N
        Standard deviation of the white noise of a row.
    half : int
        Number of neighbours on each side.
    threshold : float
        Distance of a spike from the median, in noise standard deviations.
    """
    rows = len(residual)
    if data.is_static or rows < 2 * half + 1:
        return np.zeros(rows, bool)
    offsets = np.arange(-half, half + 1)
    window = np.clip(np.arange(rows)[:, None] + offsets, 0, rows - 1)
    own = data.trial[window] == data.trial[:, None]
    own &= (np.arange(rows)[:, None] + offsets == window)
    own &= own[:, ::-1]  # symmetric, so that a slope does not make spikes at the ends of a trial

    def around(values: np.ndarray) -> np.ndarray:
        return np.where(own, values[window], values[:, None])

    stepped = np.zeros(rows, bool)
    for column in (data.strain, *data.pressure.T):
        gauge = max(sample_noise(column, data.trial), signal_step(column, data.trial))
        stepped |= np.abs(column - around(column).mean(axis=1)) > threshold * gauge
    far = np.abs(residual - np.median(around(residual), axis=1)) > threshold * noise
    return far & ~maximum_filter1d(stepped, 2 * half + 1)
