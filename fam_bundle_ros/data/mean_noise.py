# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Noise of an average of neighbouring rows, whose noise may have a memory.

The noise of a row is white noise plus noise with an exponential memory. Their sizes are fitted to
the variances of second differences of the means of 1, 2, 4, ... rows (Guerrier et al. 2013,
*JASA* 108, 1021-1030, with these differences for their wavelets; blocks as in Flyvbjerg and
Petersen 1989, *J. Chem. Phys.* 91, 461-466). Second differences do not see slow motion.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.rates import begins, spread

#: Fewest second differences that give a variance.
_FEW = 6


@dataclass(frozen=True)
class MeanNoise:
    """White noise and noise with a memory."""

    #: Standard deviations of the two parts in a row, N.
    white: float
    slow: float = 0.0
    #: Rows in which the correlation of the second falls to 1/e.
    memory: float = 1.0

    @property
    def sd(self) -> float:
        """Standard deviation of a row, N."""
        return float(np.hypot(self.white, self.slow))

    @property
    def correlation(self) -> float:
        """Rows per independent row in a long mean, 1 for white noise."""
        r = np.exp(-1.0 / self.memory)
        share = self.slow ** 2 / max(self.sd ** 2, np.finfo(float).tiny)
        return float(1.0 + share * 2.0 * r / (1.0 - r))

    def variance(self, rows: np.ndarray) -> np.ndarray:
        """Return the variance of the mean of so many neighbours, N^2."""
        return self.white ** 2 / rows + self.slow ** 2 * _of_mean(rows, self.memory)


def mean_noise(values: np.ndarray, stay: np.ndarray, floor: NoiseFloor) -> MeanNoise | None:
    """
    Estimate the noise of a row and its memory, or return None if visits are too short for it.

    The noise of a row is at most that by repeats; where few repeats agree better than neighbours
    by chance, at most that by neighbours. ``values`` are measured minus modelled force, (T,), N;
    rows that follow each other with one number in ``stay`` (T,) are neighbours.
    """
    quantum = floor.quantum
    total = np.append(0.0, np.cumsum(values))
    run = np.cumsum(begins(stay))
    blocks, found, count = [], [], []
    for block in 2 ** np.arange(int(np.log2(len(stay)))):
        mean = (total[block:] - total[:-block]) / block
        gaps = mean[:-2 * block] - 2.0 * mean[block:-block] + mean[2 * block:]
        gaps = gaps[run[3 * block - 1:] == run[:len(gaps)]]
        if len(gaps) < _FEW * block:
            break
        blocks.append(block)
        found.append(max(spread(gaps, quantum / block) ** 2 / 6.0, quantum ** 2 / 12.0 / block))
        count.append(len(gaps) / block)
    if len(blocks) < 2 or not all(found):  # a single variance shows no memory
        return None
    size, variance = np.array(blocks, float), np.array(found)
    weight = np.sqrt(count) / variance  # relative errors are as of 2 / count
    fits = []
    # a memory beyond the longest mean is slow motion
    for memory in 2.0 ** np.arange(-0.5, np.log2(size[-1]) + 0.1, 0.25):
        columns = np.stack([1.0 / size, _of_differences(size, memory)], -1)
        parts, missed = nnls(columns * weight[:, None], variance * weight)
        fits.append((missed, float(memory), np.sqrt(parts)))
    _, memory, parts = min(fits, key=lambda fit: fit[0])
    most = floor.repeats or np.inf
    if floor.basis != 'repeats':
        most = max(most, floor.differences or 0.0)
    parts *= min(1.0, most / float(np.hypot(*parts)))
    return MeanNoise(float(parts[0]), float(parts[1]), memory)


def _of_mean(rows: np.ndarray, memory: float) -> np.ndarray:
    """Return the variance of the mean of rows with a memory, of unit variance each."""
    r = np.exp(-1.0 / memory)
    return (1.0 + r) / (1.0 - r) / rows - 2.0 * r * (1.0 - r ** rows) / (rows * (1.0 - r)) ** 2


def _of_differences(rows: np.ndarray, memory: float) -> np.ndarray:
    """Return the variance of (a - 2 b + c) / sqrt(6), of means of neighbouring blocks."""
    r = np.exp(-1.0 / memory)
    next_one = r * ((1.0 - r ** rows) / (rows * (1.0 - r))) ** 2
    return _of_mean(rows, memory) - next_one * (8.0 - 2.0 * r ** rows) / 6.0
