# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether the rows of a log follow the motion, or are points far apart."""

import numpy as np

from fam_bundle_ros.data.smoothing import smooth

#: Rows that are judged; any stretch of a log tells it.
_JUDGED = 2000
#: Accuracy of the gauges of a rig, as a share of the largest force.
ACCURACY = 0.01


def follow_the_motion(time: np.ndarray, strain: np.ndarray, pressure: np.ndarray,
                      force: np.ndarray, trial: np.ndarray) -> bool:
    """
    Return whether smoothing strain and pressure takes noise from them, not the motion.

    In a quasi-static map in random order each row is far from the one before. Smoothing takes
    such steps for noise, but the force follows them: a static form of force, P (a0 + a1 e +
    a2 e^2) + b0 + b1 e + b2 e^2, fits the readings, and not the smoothed values. The rows follow
    the motion if less than half of the squared error with smoothed values is due to the
    smoothing, or if this error is within the accuracy of the gauges.

    Parameters
    ----------
    time, strain, force : ndarray (T,)
        s, 1, N.
    pressure : ndarray (T, n), Pa
    trial : ndarray (T,) of int
    """
    some = slice(_JUDGED)
    time, strain, pressure, force, trial = (
        each[some] for each in (time, strain, pressure, force, trial))
    smoothed = [smooth(time, column, trial).value for column in (strain, *pressure.T)]
    left = _left(smoothed[0], np.stack(smoothed[1:], -1), force)
    return bool(left <= max(np.sqrt(2.0) * _left(strain, pressure, force),
                            ACCURACY * np.abs(force).max()))


def _left(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> float:
    """Return the rms error of the static form fitted to a force, N."""
    ranges = np.ptp(strain) or 1.0, np.abs(pressure).max() or 1.0
    powers = (strain[:, None] / ranges[0]) ** np.arange(3)
    columns = np.concatenate([powers, *(
        powers * column[:, None] for column in pressure.T / ranges[1])], axis=1)
    found = np.linalg.lstsq(columns, force, rcond=None)[0]
    return float(np.linalg.norm(force - columns @ found) / np.sqrt(len(force)))
