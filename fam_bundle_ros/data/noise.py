# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The noise floor of a force measurement, three ways, none of which trusts the model's shape.

- second differences: neighbours within one pass; sees white noise only
- repeats: the same strain, pressure and direction met again later; sees all that does not repeat
- visits: means of whole visits to a cell; against what white noise allows, it sees coloured noise

A load cell that is read in steps q has rounding noise of q / sqrt(12), which neighbours of equal
reading do not show: no estimate is below it.

The residual of a fair model takes the slope out of the differences; any smooth error that the
model has drops out again.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.special import betainc, erf

from fam_bundle_ros.data.grouping import ONE_STRAIN, varying_unit, visit_cells
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import begins, BY_CHANCE, ROBUST, spread
from fam_bundle_ros.data.trial_offsets import trial_offsets
from fam_bundle_ros.told import number

#: Differences of neighbours show 0.38 of noise with a memory of five rows (AR 0.8).
_LOOPS = 0.2
#: Two estimates differ where the noise of one is more than this many times the other's, and pairs
#: of one noise would look like it at most as often as `rates.BY_CHANCE`.
_MATTERS = 1.25


@dataclass(frozen=True)
class NoiseFloor:
    """
    How much of the force does not repeat.

    Attributes
    ----------
    value : float, N
        The floor that errors are held against (standard deviation).
    differences, repeats, visits : float or None, N
        The three estimates; None where the data cannot give one.
    correlation : float
        Samples per independent sample, 1 for white noise (from visits against differences).
    basis : str
        Which estimate ``value`` is.
    in_file_order, in_strain_order : float or None, N
        For a map without time, how far an isobar's rows are from smooth, as they follow in the
        file and sorted by strain; None with time, and where the file has no sweeps.
    quantum : float, N
        Step that the load cell is read in, 0 where none is seen.
    note : str
        What a disagreement between the estimates tells, empty when they agree.
    """

    value: float
    differences: float | None
    repeats: float | None
    visits: float | None
    correlation: float
    basis: str
    note: str = ''
    in_file_order: float | None = None
    in_strain_order: float | None = None
    quantum: float = 0.0

    @property
    def hides_loops(self) -> bool:
        """Whether a map without time counts loops (or drift) as noise."""
        return (self.in_file_order is not None and self.in_strain_order is not None
                and self.in_file_order < _LOOPS * self.in_strain_order)

    def __str__(self) -> str:
        def show(value: float | None) -> str:
            return '-' if value is None else f'{number(value)} N'
        found = {'second differences': self.differences, 'repeats': self.repeats,
                 'visits': self.visits}
        others = ', '.join(f'{name} {show(value)}' for name, value in found.items()
                           if name != self.basis)
        if self.quantum > 0.5 * self.value:
            others += f'; read in steps of {number(self.quantum)} N'
        text = f'noise floor {number(self.value)} N by {self.basis} ({others})'
        return text + (f'\n  {self.note}' if self.note else '')

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and text."""
        return asdict(self)


def noise_floor(measurement: Measurement, residual: np.ndarray | None = None) -> NoiseFloor:
    """
    Estimate the noise floor of the force.

    Parameters
    ----------
    measurement : Measurement
    residual : ndarray, shape (T,), N, optional
        Measured minus modelled force; by default the force itself (then slopes remain).
    """
    values = measurement.force if residual is None else residual
    if not measurement.is_static:
        return _floor(measurement, values)
    # neighbouring rows of a map are of different trials, whose offsets are not noise
    offsets = trial_offsets(measurement, values)
    if offsets is not None:
        values = values - offsets.rows
    floor = replace(_floor(measurement, values),
                    in_file_order=_smoothness(measurement, values, by_strain=False),
                    in_strain_order=_smoothness(measurement, values, by_strain=True))
    if floor.hides_loops:
        return replace(floor, note='rows that follow each other in the file agree to '
                       f'{number(floor.in_file_order or 0.0, 2)} N, rows of equal strain and '
                       f'pressure only to {number(floor.in_strain_order or 0.0, 2)} N: loops or '
                       'drift, which cannot be judged without time')
    return floor if offsets is None else replace(floor, note=str(offsets))


def force_step(force: np.ndarray) -> float:
    """
    Return the step that a load cell is read in, N, 0 where none is seen.

    All distances between readings are multiples of it.

    Examples
    --------
    >>> force_step(0.5 * np.round(np.linspace(0.0, 60.0, 300) / 0.5))
    0.5
    """
    levels = np.unique(force)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * max(float(np.ptp(force)), 1e-12)]
    if len(gaps) < 8:
        return 0.0
    share = gaps / gaps.min()
    return float(gaps.min()) if np.mean(np.abs(share - np.round(share)) < 0.05) > 0.99 else 0.0


def _floor(measurement: Measurement, values: np.ndarray) -> NoiseFloor:
    quantum = force_step(measurement.force)
    differences = second_differences(measurement, values)
    cell, visit = visit_cells(measurement)
    # a strain that is noisy at the edge of a cell comes back at once: no repeat
    passes = (visit if measurement.is_static else
              np.cumsum(begins(measurement.direction, measurement.trial)))
    repeats, visits, correlation, pairs = _from_visits(values, cell, visit, passes, quantum)
    return replace(_chosen(values, differences, repeats, visits, correlation, pairs),
                   quantum=quantum)


def _chosen(values: np.ndarray, differences: float | None, repeats: float | None,
            visits: float | None, correlation: float, pairs: int) -> NoiseFloor:
    """Return the noise floor by the most reliable estimate."""
    note = ''
    if differences is None and repeats is None:
        return NoiseFloor(max(spread(values), 1e-9), None, None, None, 1.0,
                          'spread of the residual',
                          'too few neighbours or repeats to tell noise from error')
    if repeats is None:
        return NoiseFloor(float(differences or 0.0), differences, None, None, 1.0,
                          'second differences', 'nothing was measured twice: slow noise and '
                          'drift cannot be told from a model error')
    if differences is None:
        return NoiseFloor(repeats, None, repeats, visits, correlation, 'repeats')
    ratio = repeats / max(differences, np.finfo(float).tiny)
    if _chance_of_less(ratio * _MATTERS, pairs) < BY_CHANCE:
        note = ('repeats agree better than neighbours do: the force has a fine ripple that comes '
                'back each time')
        return NoiseFloor(repeats, differences, repeats, visits, correlation, 'repeats', note)
    if 1.0 - _chance_of_less(ratio / _MATTERS, pairs) < BY_CHANCE:
        note = ('repeats differ more than neighbours do: slow noise, drift, or an effect of '
                'history or speed')
    return NoiseFloor(differences, differences, repeats, visits, correlation,
                      'second differences', note)


def _chance_of_less(ratio: float, pairs: int) -> float:
    """
    Return how often white noise of sd 1 gives a robust deviation of pairs of at most this.

    A median of n values is at most x where half of them are: a binomial tail, which is a
    regularised incomplete beta function (David & Nagaraja, Order Statistics, 3rd ed., 2.1.5).
    """
    half = 0.5 * (pairs + 1)
    return float(betainc(half, half, erf(ratio / ROBUST / np.sqrt(2.0))))


def second_differences(measurement: Measurement, values: np.ndarray) -> float | None:
    """
    Return the white-noise standard deviation from triples of neighbours, N, or None.

    In a static map neighbours are rows of equal strain in the order of one unit's pressure; the
    other units have equal pressures. If a bundle has few such rows (random pressures), they are
    neighbours in the order of the sum of all pressures; if one muscle has few (curves of a figure,
    each with strains of its own), rows of an isobar in the order of the strain too.
    """
    gap = _gaps(measurement, values, *_lines(measurement))
    few = len(gap) < len(values) // 4 and measurement.is_static
    if few and measurement.pressure.shape[1] == 1:
        isobar = np.round(measurement.pressure[:, 0] / _isobar_width(measurement)[0])
        gap = np.r_[gap, _gaps(measurement, values, measurement.strain, isobar)]
    elif few:
        total = measurement.pressure.sum(-1)
        gap = _gaps(measurement, values, total, _strain_levels(measurement))
    if len(gap) < 6:
        return None
    quantum = force_step(measurement.force)
    return max(spread(gap, quantum), quantum / np.sqrt(12.0))


def _gaps(measurement: Measurement, values: np.ndarray, x: np.ndarray, line: np.ndarray,
          ) -> np.ndarray:
    """Return the deviations of values from the lines through their neighbours, see `_lines`."""
    order = np.lexsort((x, line))
    x, v, g = x[order], values[order], line[order]
    same = (g[2:] == g[:-2]) & (x[2:] > x[:-2]) & (x[1:-1] > x[:-2])
    if measurement.is_static:
        # a slack stretch reads exactly zero: no noise is visible there
        f = measurement.force[order]
        same &= (f[:-2] != f[1:-1]) | (f[2:] != f[1:-1])
    return _off_the_line(x, v, same)


def _off_the_line(x: np.ndarray, v: np.ndarray, same: np.ndarray) -> np.ndarray:
    """Return the deviation of each middle of three from the line of the others, per sample."""
    span = x[2:] - x[:-2]
    use = same & (span != 0.0)
    left = np.where(use, (x[2:] - x[1:-1]) / np.where(use, span, 1.0), 0.5)
    gap = v[1:-1] - left * v[:-2] - (1.0 - left) * v[2:]
    return (gap / np.sqrt(1.0 + left ** 2 + (1.0 - left) ** 2))[same]


def _smoothness(measurement: Measurement, values: np.ndarray, *, by_strain: bool,
                ) -> float | None:
    """
    Return how far the rows of a map's isobars are from smooth, in the file or by strain, N.

    A sweep up and down is smooth as it follows in the file, and jumps to and fro between its two
    branches when sorted by strain.
    """
    pressure, width = measurement.pressure, _isobar_width(measurement)
    order = np.arange(len(pressure))
    if by_strain:
        order = np.lexsort((measurement.strain, *np.round(pressure / width).T))
    x = measurement.strain[order]
    near = np.all(np.abs(np.diff(pressure[order], axis=0)) < width, axis=1)
    step = np.diff(x)
    onward = x[2:] >= x[:-2] if by_strain else step[1:] * step[:-1] > 0
    gap = _off_the_line(x, values[order], onward & near[1:] & near[:-1])
    if len(gap) < max(6, len(x) // 4):
        return None
    return float(ROBUST * np.median(np.abs(gap)))


def _isobar_width(measurement: Measurement) -> np.ndarray:
    """Return the difference below which pressures of a map count as equal, (n,), Pa."""
    return np.maximum(0.02 * np.ptp(measurement.pressure, axis=0), 5e3)


def _lines(measurement: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """Return a coordinate and a line label, (T,): rows of a line are neighbours in its order."""
    if not measurement.is_static:
        return measurement.clock, measurement.trial
    unit = varying_unit(measurement)
    others = np.delete(measurement.pressure / _isobar_width(measurement), unit, axis=1)
    _, line = np.unique(np.column_stack([_strain_levels(measurement), np.round(others)]), axis=0,
                        return_inverse=True)
    return measurement.pressure[:, unit], line.ravel()


def _strain_levels(measurement: Measurement) -> np.ndarray:
    """Return the label of each row's strain, (T,): rows of equal strain have the same one."""
    return np.round(measurement.strain / max(np.ptp(measurement.strain) / 200.0, ONE_STRAIN))


def _from_visits(values: np.ndarray, cell: np.ndarray, visit: np.ndarray, passes: np.ndarray,
                 quantum: float) -> tuple[float | None, float | None, float, int]:
    """
    Return repeat noise, noise of visit means, the correlation they imply, pairs of visits.

    Visits are compared if they are of different passes.
    """
    count = np.bincount(visit)
    mean = np.bincount(visit, values) / count
    where = np.zeros(len(count), int)
    where[visit] = cell
    order = np.argsort(where, kind='stable')
    # the first samples of two visits are compared
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    again = np.flatnonzero((np.diff(where[order]) == 0)
                           & (np.diff(passes[first][order]) != 0))
    if len(again) < 12:
        return None, None, 1.0, len(again)
    a, b = order[again], order[again + 1]
    gap = values[first[a]] - values[first[b]]
    repeats = max(spread(gap, quantum) / np.sqrt(2.0), quantum / np.sqrt(12.0))
    scale = np.sqrt(1.0 / count[a] + 1.0 / count[b])
    of_means = float(ROBUST * np.median(np.abs((mean[a] - mean[b]) / scale)))
    correlation = max((of_means / repeats) ** 2, 1.0) if repeats > 0 else 1.0
    return repeats, of_means, float(min(correlation, 100.0)), len(again)
