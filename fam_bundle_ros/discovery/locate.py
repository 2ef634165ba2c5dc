# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Find the regions where a model's error exceeds the noise, largest first, and describe them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import pressure_levels, rms, strain_bins, varying_unit
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.discovery import settings

_DIRECTIONS = {-1: 'while lengthening', 0: 'at rest', 1: 'while shortening'}


@dataclass(frozen=True)
class Region:
    """
    A region where the model's error exceeds the noise.

    Attributes
    ----------
    where : str
        The region in words.
    error_N : float
        Rms error in the region.
    bias_N : float
        Mean of measured minus modelled force in the region.
    share : float
        Share of the error beyond noise (sum of squares) in the region.
    samples : int
    rows : ndarray of bool, shape (T,)
        The samples of the region.
    """

    where: str
    error_N: float
    bias_N: float
    share: float
    samples: int
    rows: np.ndarray

    def __str__(self) -> str:
        return (f'{self.where}: {self.error_N:.3g} N rms, mean {self.bias_N:+.3g} N, '
                f'{100 * self.share:.0f} % of the error')

    def to_dict(self) -> dict[str, Any]:
        """Return the region without its rows."""
        return {key: value for key, value in asdict(self).items() if key != 'rows'}


def locate(measurement: Measurement, residual: np.ndarray, noise: float,
           past_free: np.ndarray | None = None, most: int = 4,
           bins: int = 12) -> tuple[Region, ...]:
    """
    Return the regions of strain, pressure, direction and time where the error exceeds the noise.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    noise : float, N
        Standard deviation of the noise.
    past_free : ndarray of bool, shape (T,), optional
        Samples past the free strain.
    most : int
        Largest number of regions.
    bins : int
        Largest number of bins of strain and of pressure; the work grows with its fourth power.
    """
    grid = _Grid(measurement, residual, noise, past_free, bins)
    total = max(float(np.sum(residual ** 2) - len(residual) * noise ** 2), 0.0)
    regions: list[Region] = []
    left = np.ones(len(residual), bool)
    lone = _lone_trial(measurement, residual, noise)
    if lone is not None:
        regions.append(_region(lone[0], lone[1], residual, noise, total))
        left &= ~lone[1]
    while len(regions) < most and grid.beyond(left) > 0:
        found = grid.best(left)
        if found is None:
            break
        words, rows = found
        if _splits(measurement.direction, residual, rows & left, noise):
            words += (', with the sign of the '
                      + ('pressure change' if measurement.is_held else 'motion'))
        region = _region(words, rows & left, residual, noise, total)
        if region.share < 0.03 or rms(residual[rows & left]) < 1.1 * noise:
            break
        regions.append(region)
        left &= ~rows
    return tuple(sorted(regions, key=lambda region: -region.share))


def _region(words: str, rows: np.ndarray, residual: np.ndarray, noise: float,
            total: float) -> Region:
    inside = residual[rows]
    excess = float(np.sum(inside ** 2) - len(inside) * noise ** 2)
    return Region(words, rms(inside), float(inside.mean()),
                  float(np.clip(excess / total, 0, 1)) if total > 0 else 0.0, len(inside), rows)


def _lone_trial(measurement: Measurement, residual: np.ndarray, noise: float,
                ) -> tuple[str, np.ndarray] | None:
    """Return the trial with most of the error if the other trials are within noise, else None."""
    count = len(measurement.trial_names)
    if count < 4:
        return None
    excess = np.bincount(measurement.trial, residual ** 2 - noise ** 2, count)
    worst = int(np.argmax(excess))
    rest = np.delete(excess / np.maximum(np.bincount(measurement.trial, minlength=count), 1),
                     worst)
    sure = 6.0 * np.sqrt(2.0 * np.sum(measurement.trial == worst)) * noise ** 2
    if excess[worst] > max(0.6 * excess.sum(), sure) and rest.max() < 0.25 * noise ** 2:
        rows = measurement.trial == worst
        return f'trial {measurement.trial_names[worst]} alone', rows
    return None


def _splits(direction: np.ndarray, residual: np.ndarray, rows: np.ndarray, noise: float) -> bool:
    """Return whether the mean error turns round with the motion and is most of the error."""
    up, down = residual[rows & (direction > 0)], residual[rows & (direction < 0)]
    if len(up) < 5 or len(down) < 5:
        return False
    odd = 0.5 * (up.mean() - down.mean())
    beyond = float(np.mean(residual[rows] ** 2)) - noise ** 2
    return bool(up.mean() * down.mean() < 0 and odd ** 2 > settings.MOST_OF_IT * beyond
                and min(abs(up.mean()), abs(down.mean())) > 0.5 * noise)


class _Grid:
    """Cells of strain, pressure and direction, and boxes of cells."""

    def __init__(self, measurement: Measurement, residual: np.ndarray, noise: float,
                 past_free: np.ndarray | None, bins: int):
        self.noise = noise
        unit = varying_unit(measurement)
        self.unit = '' if measurement.pressure.shape[1] == 1 else (
            f'{measurement.motor_units[unit]} ')
        self.strain, self.edges = strain_bins(measurement.strain, bins)
        self.level, self.means = pressure_levels(measurement.pressure[:, unit], bins)
        self.direction = measurement.direction
        self.directions = [int(d) for d in np.unique(measurement.direction)]
        self.past_free = past_free
        self.residual = residual
        self.shape = (len(self.edges) - 1, len(self.means), len(self.directions))
        slot = np.searchsorted(self.directions, self.direction)
        self.cell = np.ravel_multi_index((self.strain, self.level, slot), self.shape)

    def beyond(self, left: np.ndarray) -> float:
        """Return the sum of squares beyond noise in cells whose mean is beyond noise."""
        return float(self._excess(left)[0].sum())

    def _excess(self, left: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        size = int(np.prod(self.shape))
        count = np.bincount(self.cell[left], minlength=size)
        total = np.bincount(self.cell[left], self.residual[left], size)
        mean = total / np.maximum(count, 1)
        sure = np.abs(mean) > self.noise * np.maximum(3.0 / np.sqrt(np.maximum(count, 1)), 0.5)
        squares = np.where(sure & (count > 0), count * mean ** 2, 0.0)
        return (squares.reshape(self.shape), np.where(sure, count, 0).reshape(self.shape),
                count.reshape(self.shape))

    def best(self, left: np.ndarray) -> tuple[str, np.ndarray] | None:
        """
        Return the box of cells with the best score, in words and as rows, (T,) bool.

        The score is the F1 score of recall (share of the error inside) and purity (share of its
        rows with error), times a factor for each limit that the box needs.
        """
        squares, sure, count = self._excess(left)
        total = squares.sum()
        if total <= 0:
            return None
        picks: list[tuple[int | None, int]] = [(None, 0)]
        if len(self.directions) > 1:
            picks += [(slot, 1) for slot in range(len(self.directions))]
        best, choice = 0.0, None
        for slot, terms in picks:
            take = slice(None) if slot is None else slice(slot, slot + 1)
            tables = [_corner_sums(t[:, :, take].sum(-1)) for t in (squares, sure, count)]
            for (a, b), (c, d) in _boxes(self.shape[0], self.shape[1]):
                held, good, all_ = (t[b + 1, d + 1] - t[a, d + 1] - t[b + 1, c] + t[a, c]
                                    for t in tables)
                if all_ == 0 or held <= 0:
                    continue
                cost = terms + (a > 0) + (b < self.shape[0] - 1) + (c > 0) + (
                    d < self.shape[1] - 1)
                recall, purity = held / total, good / all_
                score = 2 * recall * purity / (recall + purity) * 0.97 ** cost
                if score > best:
                    best, choice = score, (a, b, c, d, slot)
        if choice is None:
            return None
        a, b, c, d, slot = choice
        rows = (self.strain >= a) & (self.strain <= b) & (self.level >= c) & (self.level <= d)
        if slot is not None:
            rows &= self.direction == self.directions[slot]
        return self._words(a, b, c, d, slot, rows), rows

    def _words(self, a: int, b: int, c: int, d: int, slot: int | None,
               rows: np.ndarray) -> str:
        strains, levels = self.shape[:2]
        way = '' if slot is None else f' {_DIRECTIONS[self.directions[slot]]}'
        if self.past_free is not None and rows.any():
            inside = self.past_free[rows].mean()
            covered = rows[self.past_free].mean() if self.past_free.any() else 0.0
            if inside > 0.9 and covered > 0.8:
                return 'past free strain' + way
        if (a, b, c, d) == (0, strains - 1, 0, levels - 1):
            return 'everywhere' + way
        if a == 0 and b == strains - 1:
            strain = 'every strain'
        elif a == 0:
            strain = f'strain below {self.edges[b + 1]:.3g}'
        elif b == strains - 1:
            strain = f'strain above {self.edges[a]:.3g}'
        else:
            strain = f'strain {self.edges[a]:.3g} to {self.edges[b + 1]:.3g}'
        # + 0.0 turns -0 into 0
        low, high = np.round(self.means[[c, d]] / 1e3) + 0.0
        if c == 0 and d == levels - 1:
            pressure = f'every {self.unit}pressure'
        elif c == d:
            pressure = f'{self.unit}{low:.0f} kPa'
        elif c == 0:
            pressure = f'{self.unit}{high:.0f} kPa and below'
        elif d == levels - 1:
            pressure = f'{self.unit}{low:.0f} kPa and above'
        else:
            pressure = f'{self.unit}{low:.0f} to {high:.0f} kPa'
        return f'{strain} at {pressure}{way}'


def _corner_sums(table: np.ndarray) -> np.ndarray:
    return np.pad(table.cumsum(0).cumsum(1), ((1, 0), (1, 0)))


def _boxes(rows: int, columns: int):
    across = list(combinations_with_replacement(range(columns), 2))
    for span in combinations_with_replacement(range(rows), 2):
        for other in across:
            yield span, other
