# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The rows of a log: spikes, steps, rows of unknown direction, and fewer rows by averaging.

A spike is a single row far from its neighbours in time, which no effect explains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.sparse import csr_array

from fam_bundle_ros.data.measurement import BY_STRAIN, Measurement
from fam_bundle_ros.data.rates import begins, sample_noise, signal_step, slope, turning

#: Neighbours of a row on each side, and the distance of a spike from their median in noise
#: standard deviations.
_NEAR, _FAR = 3, 5.0
#: Two readings at rest differ by more than this many standard deviations about once in 50 000.
STILL = 6.0
#: Change of strain or pressure, relative to its range, over which a mean has another force.
_BLUR = 0.05


def spikes(data: Measurement, residual: np.ndarray, noise: float) -> np.ndarray:
    """
    Return the rows that are far from the median of their neighbours in time, (T,) bool.

    Rows near a step of strain or pressure are never spikes: their residual may be the response of
    a missing effect to the step.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    noise : float, N
        Standard deviation of the white noise of a row.
    """
    rows = len(residual)
    if data.is_static or rows < 2 * _NEAR + 1:
        return np.zeros(rows, bool)
    offsets = np.arange(-_NEAR, _NEAR + 1)
    window = np.clip(np.arange(rows)[:, None] + offsets, 0, rows - 1)
    own = data.trial[window] == data.trial[:, None]
    own &= (np.arange(rows)[:, None] + offsets == window)
    own &= own[:, ::-1]  # symmetric, so that a slope does not make spikes at the ends of a trial

    def around(values: np.ndarray) -> np.ndarray:
        return np.where(own, values[window], values[:, None])

    stepped = np.zeros(rows, bool)
    for column in (data.strain, *data.pressure.T):
        gauge = max(sample_noise(column, data.trial), signal_step(column, data.trial))
        stepped |= np.abs(column - around(column).mean(axis=1)) > _FAR * gauge
    far = np.abs(residual - np.median(around(residual), axis=1)) > _FAR * noise
    return far & ~maximum_filter1d(stepped, 2 * _NEAR + 1)


def unknown_direction(data: Measurement, *, may_stick: bool = False) -> np.ndarray:
    """
    Return the rows of a log whose direction of motion is not known, (T,) bool.

    First, the first row of each trial: the motion before it, on which hysteresis depends, was not
    recorded. If trials start at turning points, the friction is wrong there in every trial at the
    same strain, which looks like an effect of the strain. Second, rows at turning points where
    the strain rate is within its noise: the error is up to twice the friction.

    Parameters
    ----------
    may_stick : bool
        The strain was not imposed: after each turn of the pressure dry friction may hold it, with
        any force up to its limit. Rows at rest while the pressure changes are left out too, and
        rows whose rate was smoothed across the end of such a rest.
    """
    if data.time is None:
        return np.zeros(len(data), bool)
    first = data.start & ~np.append(data.start[1:], True)  # a trial of one row stays
    moving = np.where(data.direction_basis == BY_STRAIN, data.direction, 0)
    window = slope(data.time, data.strain, data.trial).window
    unknown = first | turning(moving, data.trial, window)
    if may_stick:
        unknown |= (moving == 0) & (data.direction != 0)
        for row in np.flatnonzero(begins(moving, data.trial) & ~data.start):
            unknown[max(row - window[row] // 2, 0):row + window[row] // 2] = True
    return unknown


def jumped(data: Measurement) -> np.ndarray:
    """
    Return the first rows after a step of strain or pressure between two rows of a log, (T,) bool.

    Only there do the fastest lags show. Such a row is a visit of its own: in one mean with later
    rows, a lag that is wrong in the first by as much as a slow creep is in the others would look
    right. A step is more than the changes before and after it together.
    """
    if data.time is None:
        return np.zeros(len(data), bool)
    columns, least = _movements(data)
    change = np.abs(np.diff(columns, axis=0))
    change[data.start[1:]] = np.inf  # not known
    steps = (change[1:-1] > change[:-2] + change[2:]) & (change[1:-1] > least)
    steps &= np.isfinite(change[1:-1])
    return np.concatenate([[False, False], steps.any(axis=1), [False]])[:len(data)]


def averages(label: np.ndarray, count: int) -> Callable[[np.ndarray], np.ndarray]:
    """
    Return the function that averages values of rows, (T,) or (T, k), over cells, (n,) or (n, k).

    Parameters
    ----------
    label : ndarray of int, shape (T,)
        Cell of each row; rows of label -1 do not count.
    count : int
        Number of cells.
    """
    rows = np.flatnonzero(label >= 0)
    cell = label[rows]
    share = 1.0 / np.bincount(cell, minlength=count)
    return csr_array((share[cell], (cell, rows)), (count, len(label))).__matmul__


def thinned(data: Measurement, most: int) -> tuple[Measurement, np.ndarray]:
    """
    Return a log with neighbours averaged to about ``most`` rows, and the blurred: see `averaged`.

    If that would blur the motion, blocks are smaller and only stretches of the log are kept.
    """
    if data.is_static or len(data) <= most:
        return data, np.zeros(len(data), bool)
    block = min(int(np.ceil(len(data) / most)), _widest_block(data))
    return averaged(stretches(data, most * block), block)


def averaged(data: Measurement, block: int) -> tuple[Measurement, np.ndarray]:
    """
    Return the log with each ``block`` of neighbours in a trial averaged into one row.

    The first row of a trial stays as it is: the state at rest from which a memory begins.

    Also returned is in which rows, bool, strain or a pressure moved, or the motion turned round:
    the mean force is not the force at the mean state there.
    """
    position = np.arange(len(data)) - np.flatnonzero(data.start)[np.cumsum(data.start) - 1]
    first = (position == 0) | (position % block == 1 % block)
    label = np.cumsum(first) - 1
    mean = averages(label, int(label[-1]) + 1)
    columns, least = _movements(data)
    begin = np.flatnonzero(first)
    moves = (np.abs(columns - columns[begin][label]) > least).any(axis=1)
    moves |= data.direction != data.direction[begin][label]
    blurred = np.logical_or.reduceat(moves, begin)
    return replace(
        data.select(first), strain=mean(data.strain), force=mean(data.force),
        strain_rate=mean(data.strain_rate), pressure=mean(data.pressure),
        time=None if data.time is None else mean(data.time)), blurred


def _widest_block(data: Measurement, least: int = 8) -> int:
    """Return the largest block, rows, in nine tenths of which strain and pressures do not move."""
    columns, reach = _movements(data)
    width = least
    while width < 4096:
        steps = np.abs(columns[2 * width:] - columns[:-2 * width])
        steps = steps[data.trial[2 * width:] == data.trial[:-2 * width]]
        if not len(steps) or (np.percentile(steps, 90, axis=0) > reach).any():
            break
        width *= 2
    return width


def _movements(data: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Return strain and pressures, (T, 1 + n), and the least movement of each, (1 + n,)."""
    columns = np.column_stack([data.strain, data.pressure])
    noise = [sample_noise(column, data.trial) for column in columns.T]
    return columns, np.maximum(_BLUR * np.ptp(columns, axis=0), STILL * np.array(noise))


def stretches(data: Measurement, most: int, count: int = 12) -> Measurement:
    """Return ``count`` evenly spaced stretches of a log, each a trial, ``most`` rows in all."""
    if len(data) <= 1.25 * most:
        return data
    length = most // count
    firsts = np.linspace(0, len(data) - length, count).astype(int)
    rows = np.concatenate([np.arange(first, first + length) for first in firsts])
    piece = np.repeat(np.arange(count), length)
    picked = data.select(rows)
    trial, recording = (np.cumsum(begins(piece, each)) - 1
                        for each in (picked.trial, picked.recording))
    return replace(picked, trial=trial, recording=recording, trial_names=tuple(
        f'stretch {k + 1}' for k in range(int(trial.max()) + 1)))
