# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows that stand alone: far from their neighbours in time, as no missing effect is."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import sample_noise, signal_step


def spikes(data: Measurement, residual: np.ndarray, noise: float, half: int = 3,
           threshold: float = 5.0) -> np.ndarray:
    """
    Return which rows stand alone: far from the median of their neighbours in time, (T,) bool.

    None does within so many rows of where strain or a pressure steps: what is far there may be
    what a missing effect makes of the step.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    noise : float, N
        White noise of a row.
    half : int
        Neighbours on each side.
    threshold : float
        How many noise standard deviations are far.
    """
    rows = len(residual)
    if data.is_static or rows < 2 * half + 1:
        return np.zeros(rows, bool)
    offsets = np.arange(-half, half + 1)
    window = np.clip(np.arange(rows)[:, None] + offsets, 0, rows - 1)
    own = data.trial[window] == data.trial[:, None]
    own &= (np.arange(rows)[:, None] + offsets == window)
    own &= own[:, ::-1]  # a slope must not make the ends of a trial stand out

    def around(values: np.ndarray) -> np.ndarray:
        return np.where(own, values[window], values[:, None])

    stepped = np.zeros(rows, bool)
    for column in (data.strain, *data.pressure.T):
        gauge = max(sample_noise(column, data.trial), signal_step(column, data.trial))
        stepped |= np.abs(column - around(column).mean(axis=1)) > threshold * gauge
    far = np.abs(residual - np.median(around(residual), axis=1)) > threshold * noise
    return far & ~maximum_filter1d(stepped, 2 * half + 1)
