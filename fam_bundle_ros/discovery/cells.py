# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reduce a measurement to averages over cells of strain, pressure, direction and visit.

A visit is an uninterrupted stay of the muscle in one cell. Models with memory are computed on the
rows and then averaged by the same operator, so averaging adds no error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csr_array

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.mean_noise import mean_noise, MeanNoise
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import CRAWL, sample_noise
from fam_bundle_ros.data.smoothing import Smooth, smooth
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.log_rows import (
    averages,
    jumped,
    spikes,
    STILL,
    thinned,
    unknown_direction,
)
from fam_bundle_ros.discovery.predict import (
    above_floor,
    is_one_force,
    matched,
    motion,
    noise_of,
    slope_in_strain,
    slopes_in_pressure,
    stiffness,
    strain_noise,
)
from fam_bundle_ros.model import Bundle, Motion

#: Numbers of bins over the range of strain and pressure to try, finest first.
_BINS = (60, 40, 30, 24, 20, 16, 12, 10)
#: Places over the range of strain and of each pressure, to which a motion returns.
_PLACES = 20
#: Blocks of rows per cell: for a parabola over the range, in cells of 1/10 of it, the error of a
#: cell's mean is 5e-5 of the change of the force.
_BLOCKS = 4


class Predicts(Protocol):
    """What predicts the force of a motion, (T,), N: a `Bundle`, or a form without physics."""

    def predict(self, motion: Motion) -> np.ndarray:
        """Return the force of each row, (T,), N."""


@dataclass(frozen=True)
class Cells:
    """
    Averages of a measurement over cells, and the averaging operator.

    Attributes
    ----------
    data : Measurement
        The rows for which models are computed: those measured, or averages of neighbours.
    motion : Motion
        The motion in these rows, input of a model.
    label : ndarray of int, shape (T,)
        Cell of each row, -1 for rows that are not used.
    unused : dict of str to int
        Number of rows that are not used, by the reason in words.
    count : ndarray, shape (n,)
        Rows of each cell.
    force, strain, direction, trial : ndarray, shape (n,)
    strain_coordinate : ndarray, shape (n,)
        Strain of which a discrepancy is a smooth function. Where the strain is the measured
        quantity it is the one that the model as given predicts: the noise of the strain is the
        error of the force there, and a smooth function of a strain that contains it.
    speed : ndarray, shape (n,)
        Natural logarithm of the absolute strain rate, 1/s, limited below to the rate of rest.
    pressure : ndarray, shape (n, m), Pa
    time : ndarray, shape (n,), s, or None
    noise : float, N
        Standard deviation of the noise of a row.
    variance : ndarray, shape (n,), N^2
        Of the noise of the mean force of each cell.
    stiffness : ndarray, shape (n,), N, or None
        -dF/de of the model if the force of each pass was constant and the strain was measured:
        residuals are then errors of the strain times this stiffness.
    one_force : bool
        Whether the force was the same in all of them.
    strain_noise : ndarray, shape (n,), N
        The part of `force` that is noise of the strain, see `predict.strain_noise`.
    rows : int
        Number of rows of the measurement, before neighbours were averaged.
    """

    data: Measurement
    motion: Motion
    label: np.ndarray
    unused: dict[str, int]
    count: np.ndarray
    force: np.ndarray
    strain: np.ndarray
    strain_coordinate: np.ndarray
    pressure: np.ndarray
    direction: np.ndarray
    speed: np.ndarray
    trial: np.ndarray
    time: np.ndarray | None
    noise: float
    variance: np.ndarray
    strain_range: float
    pressure_range: np.ndarray
    stiffness: np.ndarray | None = None
    one_force: bool = False
    strain_noise: np.ndarray | float = 0.0
    rows: int = 0

    def __len__(self) -> int:
        return len(self.count)

    @property
    def force_sd(self) -> float:
        """Standard deviation of the force, N; at one force, of strain times stiffness."""
        if self.one_force:
            assert self.stiffness is not None
            return rms(self.stiffness * (self.strain - self.strain.mean()))
        return max(float(np.std(self.force)), 1e-9)

    @property
    def largest_force(self) -> float:
        """Largest absolute force of a cell, N."""
        return float(np.abs(self.force).max())

    def residual_of_rows(self, model: Predicts) -> np.ndarray:
        """Return measured minus predicted force of the rows, (T,), N."""
        return self.data.force - model.predict(self.motion)

    def mean_square(self, residual: np.ndarray) -> float:
        """Return the mean over rows of the square of a residual of cells, (n,), N^2."""
        return float(np.average(residual ** 2, weights=self.count))

    @property
    def both_ways(self) -> bool:
        """Whether there are cells of both directions of motion."""
        return bool((self.direction > 0).any() and (self.direction < 0).any())

    @cached_property
    def place(self) -> np.ndarray:
        """The place among `_PLACES` of strain and of each pressure of every cell, (n,) int."""
        steps = np.column_stack([self.strain / self.strain_range,
                                 self.pressure / self.pressure_range])
        return np.unique(np.round(steps * _PLACES), axis=0, return_inverse=True)[1].ravel()

    @cached_property
    def mean(self) -> Callable[[np.ndarray], np.ndarray]:
        """Averages over cells, (n,) or (n, k), of values of rows, (T,) or (T, k)."""
        return averages(self.label, len(self.count))

    @cached_property
    def blocks(self) -> tuple[Motion, Callable[[np.ndarray], np.ndarray]]:
        """
        The motion in a few blocks of rows per cell, and its averages over cells, as `mean`.

        For models without memory, whose force is nearly linear in the motion of so few rows.
        """
        rows = np.flatnonzero(self.label >= 0)
        rows = rows[np.argsort(self.label[rows], kind='stable')]
        cell, size = self.label[rows], self.count.astype(int)
        place = np.arange(len(rows)) - (np.cumsum(size) - size)[cell]
        block = np.full(len(self.label), -1)
        block[rows] = _renumbered(cell * _BLOCKS + place * _BLOCKS // size[cell])
        count = np.bincount(block[rows])
        mean, motion = averages(block, len(count)), self.motion

        def few(values: np.ndarray) -> np.ndarray:
            # the clock begins at the first row of the record
            return np.concatenate([values[:1], mean(values)])

        owner = np.repeat(np.arange(len(size)), np.minimum(size, _BLOCKS))
        share = csr_array((count / self.count[owner], (owner, 1 + np.arange(len(count)))),
                          (len(size), 1 + len(count)))
        return (Motion(few(motion.strain), few(motion.pressure), few(motion.strain_rate),
                       None if motion.time is None else few(motion.time)), share.__matmul__)


def negligible(cells: Cells) -> float:
    """Return the size below which a discrepancy is negligible, N."""
    return max(cells.noise, settings.SMALL * cells.largest_force)


def reduce(model: Bundle, measurement: Measurement, most: int | None = None) -> Cells:
    """
    Return a measurement reduced to cells.

    Parameters
    ----------
    model : Bundle
        Its residual gives the noise and the spikes. Spikes are in no cell, nor are rows of a log
        where the direction of motion is not known (see `unknown_direction`).
    measurement : Measurement
    most : int, optional
        Most cells, by default `settings.CELLS`; of more visits, a sample is kept.

    Raises
    ------
    InputError
        If data and model have different motor units.
    """
    most = most or settings.CELLS
    data, blurred = thinned(matched(model, measurement), settings.ROWS)
    record, stiff = motion(data), stiffness(model, data)
    one_force, unsmoothed = is_one_force(data, stiff), strain_noise(data, stiff)
    signals = _signals(model, data, measured_strain=stiff is not None)
    if stiff is not None:
        data = replace(data, force=signals[0][1].value + unsmoothed)
    residual = data.force - model.predict(record)
    coordinate = data.strain if stiff is None else np.clip(
        data.strain - residual / stiff, data.strain.min(), data.strain.max())
    floor = noise_of(data, residual, stiff)
    least = settings.LEAST_NOISE * float(np.abs(data.force).max())
    known = [value for value in (floor.differences, floor.repeats) if value]
    noise = max(min(known, default=0.0), least)
    strain_range, pressure_range = extent(data)
    if len(data) <= most:
        label = np.arange(len(data))
    else:
        label = (_places if data.is_static else visits)(
            data, data.direction, strain_range, pressure_range, most)
    far = spikes(data, residual, max(noise, floor.differences or 0.0))
    turns = unknown_direction(data, may_stick=stiff is not None)
    used = ~(far | turns | blurred)
    visit, label = label, _at_most(most, np.where(used, label, -1))
    left = (label < 0) & ~far
    unused = {'spikes': far.sum(),
              'averages over a step of strain or pressure, or over a turn': (
                  left & blurred & ~turns).sum(),
              'the first of a trial or at a turning point, where the direction of motion is not '
              'known': (left & turns).sum(),
              f'from visits beyond a sample of {most}': (left & ~turns & ~blurred).sum()}
    count = np.bincount(label[label >= 0]).astype(float)
    mean = averages(label, len(count))
    seen = used & above_floor(data, stiff)
    found = mean_noise(residual[seen], visit[seen], floor) or MeanNoise(noise)
    moving, of_means = (mean(each) for each in _noise_of_signals(signals, count[label]))
    rate = np.abs(mean(data.strain_rate))
    return Cells(data, record, label, {words: int(rows) for words, rows in unused.items() if rows},
                 count, mean(data.force), mean(data.strain), mean(coordinate),
                 mean(data.pressure), np.sign(np.round(mean(data.direction.astype(float)))),
                 np.log(np.maximum(rate, max(CRAWL * np.percentile(rate, 90), 1e-9))),
                 np.round(mean(data.trial.astype(float))),
                 None if data.time is None else mean(data.time),
                 max(float(np.sqrt(found.sd ** 2 + np.average(moving, weights=count))), least),
                 np.maximum(found.variance(count), least ** 2 / count) + of_means, strain_range,
                 pressure_range, None if stiff is None else mean(stiff), one_force,
                 mean(unsmoothed), len(measurement))


def _signals(model: Bundle, data: Measurement, measured_strain: bool,
             ) -> list[tuple[np.ndarray | float, Smooth]]:
    """
    Return the smoothed signals that the model's force is computed for, and its slopes in them.

    Strain and pressures; the force and the pressures where the strain is the measured quantity, in
    whose error noise of the force must not be.
    """
    first: tuple[np.ndarray | float, Smooth] = slope_in_strain(model, data), data.signals[0]
    if measured_strain:
        first = 1.0, (Smooth(data.force, np.zeros(len(data)), 0.0) if data.time is None
                      else smooth(data.time, data.force, data.trial))
    return [first, *zip(slopes_in_pressure(model, data), data.signals[1:])]


def _noise_of_signals(signals: list[tuple[np.ndarray | float, Smooth]], count: np.ndarray,
                      ) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the variance of the error of the force due to noise of the signals, (T,), N^2.

    The first is that of a row, after smoothing. Neighbours share what smoothing leaves: of the
    mean of ``count`` (T,) rows, the second, it is as much, or that of so many samples as they were
    read. Differences of neighbours, which tell the noise of the load cell, show little of it.
    """
    rows, means = np.zeros(len(count)), np.zeros(len(count))
    for slope, signal in signals:
        rows += (slope * signal.left) ** 2
        means += slope ** 2 * np.minimum(signal.left ** 2, signal.noise ** 2 / count)
    return rows, means


def extent(data: Measurement) -> tuple[float, np.ndarray]:
    """Return the range of the strain and of each pressure, (n,), Pa, at least a small one."""
    return (max(float(np.ptp(data.strain)), 1e-6),
            np.maximum(np.ptp(data.pressure, axis=0), 1e3))


def places(cells: Cells, kept: np.ndarray, way: np.ndarray) -> np.ndarray:
    """
    Return the cell of strain, pressure and way of each row, (T,) int, over all visits; -1: none.

    Parameters
    ----------
    kept : ndarray of bool, shape (T,)
        Rows to use; the others get -1.
    way : ndarray of int, shape (T,)
        Class of each row, such as its direction of motion; a cell has rows of one class only.
    """
    most = settings.PLACES
    label = _places(cells.data, way, cells.strain_range, cells.pressure_range, most)
    return _at_most(most, np.where(kept, label, -1))


def _at_most(most: int, label: np.ndarray) -> np.ndarray:
    """
    Return labels without gaps (-1 stays); of more than ``most``, a systematic sample.

    A label's share of the sample is in proportion to its rows, at most one (Särndal et al., *Model
    Assisted Survey Sampling*, 1992, section 3.6): more of the rows are used than if each label had
    the same share.
    """
    label = _renumbered(label)
    if label.max() + 1 > most:
        rows = np.bincount(label[label >= 0])
        rate = brentq(lambda rate: np.minimum(rate * rows, 1.0).sum() - most, 0.0, 1.0)
        taken = np.floor(np.cumsum(np.minimum(rate * rows, 1.0)) + 0.5)
        kept = np.flatnonzero(np.diff(taken, prepend=0.0))
        label = _renumbered(np.where(np.isin(label, kept), label, -1))
    return label


def _renumbered(label: np.ndarray) -> np.ndarray:
    """Return labels without gaps; -1 stays."""
    _, new = np.unique(label, return_inverse=True)
    return new.ravel() - (1 if (label < 0).any() else 0)


def _places(data: Measurement, direction: np.ndarray, strain_range: float,
            pressure_range: np.ndarray, most: int) -> np.ndarray:
    """Return the cell of strain, pressure and direction of each row, over all visits, (T,) int."""
    label = np.zeros(len(data), int)
    for bins in _BINS:
        parts = [np.round(data.strain / strain_range * bins).astype(int), direction]
        parts += [np.round(column / size * bins).astype(int)
                  for column, size in zip(data.pressure.T, pressure_range)]
        label = np.zeros(len(data), int)
        for part in parts:  # np.unique of whole rows takes four times as long
            label = _renumbered(label * (np.ptp(part) + 1) + part - part.min())
        if label.max() < most:
            break
    return label


def visits(data: Measurement, direction: np.ndarray, strain_range: float,
            pressure_range: np.ndarray, most: int) -> np.ndarray:
    """
    Return the number of the visit that each row of a log belongs to, (T,) int.

    A new visit begins when strain or a pressure differs from the first row of the visit by more
    than a bin and by more than the noise: a muscle that is held makes one visit. The first row
    after a step is a visit too (see `jumped`).
    """
    jump = jumped(data)
    columns = np.column_stack([data.strain, data.pressure])
    size = np.append(strain_range, pressure_range)
    noise = np.array([sample_noise(column, data.trial) for column in columns.T])
    fresh = data.start | (np.diff(direction, prepend=direction[0]) != 0) | jump
    fresh[1:] |= jump[:-1]
    fresh = fresh.tolist()
    label = np.zeros(len(data), int)
    for bins in _BINS:
        scaled = (columns / np.maximum(size / bins, STILL * noise)).tolist()
        first, visit = scaled[0], -1
        for k, row in enumerate(scaled):
            if fresh[k] or any(abs(a - b) > 1.0 for a, b in zip(row, first)):
                first, visit = row, visit + 1
            label[k] = visit
        if visit < most:
            break
    return label
