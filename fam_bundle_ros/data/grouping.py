# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Groups of samples: isobars, strain bins, reversals."""

from collections.abc import Sequence

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import begins, slope

#: Strains closer than this are one.
ONE_STRAIN = 2e-4


def pressure_levels(column: np.ndarray, most: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the levels of a record, such as isobars: that of each sample (T,) int, the means (k,).

    Levels are found as gaps in the sorted values; where there are none (a sweep) or too many
    the range is cut into eight equal bins.
    """
    ordered = np.sort(column)
    span = ordered[-1] - ordered[0]
    if span <= 0:
        return np.zeros(len(column), int), column[:1].copy()
    # a gap between isobars is far larger than the steps within one
    steps = np.diff(ordered)
    edges = ordered[:-1][steps > span / 60] + steps[steps > span / 60] / 2
    index = np.searchsorted(edges, column)
    spread = max(np.ptp(column[index == k]) for k in range(len(edges) + 1))
    if not len(edges) or len(edges) >= most or spread > span / 4:
        edges = np.linspace(ordered[0], ordered[-1], 9)[1:-1]
        index = np.searchsorted(edges, column)
    _, index = np.unique(index, return_inverse=True)
    count = np.bincount(index)
    return index, np.bincount(index, column) / count


def varying_unit(measurement: Measurement) -> int:
    """Return the motor unit whose pressure varies most: the one that isobars are named by."""
    return int(np.argmax(measurement.pressure.std(axis=0)))


def pressure_speed(measurement: Measurement) -> np.ndarray:
    """Return how fast the pressure of the `varying_unit` changes in a log, (T,), Pa/s."""
    column = measurement.pressure[:, varying_unit(measurement)]
    return np.abs(slope(measurement.clock, column, measurement.trial)[0])


def strain_bins(strain: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bin of each sample (T,) int and the edges (count + 1,), of equal width."""
    low, high = float(strain.min()), float(strain.max())
    edges = np.linspace(low, high, count + 1)
    levels = np.unique(np.round(strain, 4))
    if len(levels) <= count:  # a map at a few strains: bins between them
        middle = (levels[1:] + levels[:-1]) / 2
        edges = np.concatenate([[levels[0] - 1e-6], middle, [levels[-1] + 1e-6]])
    return np.clip(np.searchsorted(edges, strain, side='right') - 1, 0, len(edges) - 2), edges


def visit_cells(measurement: Measurement, strains: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """
    Return a cell label and a visit label for each row, (T,) int.

    A cell is a bin of strain, of each pressure, and the direction; a visit is an unbroken stay
    in one.
    """
    span = float(np.ptp(measurement.strain))
    # a strain that is held is one bin, whatever its rounding
    held = np.zeros(len(measurement), int)
    parts = [held if span < ONE_STRAIN else
             np.floor(measurement.strain / span * strains).astype(int)]
    for column in measurement.pressure.T:
        width = max(float(np.ptp(column)) / 40.0, 5e3)
        # isobars differ by their noise: bins are centred on the usual steps by rounding
        parts.append(np.round(column / width).astype(int))
    parts.append(measurement.direction)
    _, cell = np.unique(np.stack(parts, -1), axis=0, return_inverse=True)
    cell = cell.ravel()
    return cell, np.cumsum(begins(cell, measurement.trial)) - 1


def merge(labels: np.ndarray, most: int) -> np.ndarray:
    """Return labels 0, 1, ... of at most ``most`` blocks; neighbouring labels are merged."""
    _, index = np.unique(labels, return_inverse=True)
    count = int(index.max()) + 1
    return index if count <= most else index * most // count


def earlier(labels: np.ndarray) -> np.ndarray:
    """
    Return how many earlier rows have the same label, (T,) int.

    Examples
    --------
    >>> earlier(np.array([5, 7, 5, 5, 7]))
    array([0, 0, 1, 2, 1])
    """
    order = np.argsort(labels, kind='stable')
    first = np.flatnonzero(begins(labels[order]))
    count = np.empty(len(labels), int)
    count[order] = np.arange(len(labels)) - np.repeat(first, np.diff(first, append=len(labels)))
    return count


def rms(values: np.ndarray | Sequence[float]) -> float:
    """Return the root mean square."""
    values = np.asarray(values, float)
    return float(np.sqrt(np.mean(values * values))) if len(values) else float('nan')


def reversals(data: Measurement) -> np.ndarray:
    """
    Return the rows whose direction of motion cannot be known, (T,) bool.

    Between the last sample one way and the first one back the force of friction may be anything;
    nor is it known how a trial was entered. Rests in between are told apart from a reversal.
    """
    if data.is_static:
        return np.zeros(len(data), bool)
    start = data.start
    turn = ~start[1:] & (data.direction[1:] * data.direction[:-1] < 0)
    unsure = start.copy()
    unsure[1:] |= turn
    unsure[:-1] |= turn
    near = unsure.copy()
    near[1:] |= unsure[:-1] & ~start[1:] & ~start[:-1]
    near[:-1] |= unsure[1:] & ~start[1:]
    return near
