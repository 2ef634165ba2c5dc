# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compare a model with a measurement: size of the error, its regions, and the noise floor.

    result = compare(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import (
    pressure_levels,
    pressure_speed,
    reversals,
    rms,
    strain_bins,
    varying_unit,
    visit_cells,
)
from fam_bundle_ros.data.mean_noise import mean_noise
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.unit_slips import slips
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import extent, visits
from fam_bundle_ros.discovery.locate import locate, Region
from fam_bundle_ros.discovery.log_rows import spikes, stretches, unknown_direction
from fam_bundle_ros.discovery.predict import (
    above_floor,
    free_mask,
    likelier_past,
    matched,
    noise_of,
    predict,
    stiffness,
)
from fam_bundle_ros.discovery.reading import measurement_of
from fam_bundle_ros.jsonfile import Answer
from fam_bundle_ros.model import Bundle

#: Share of the highest pressure by which the pressure of a motor unit varies, beyond its noise.
_VARIES = 0.05
#: Share of the highest pressure within which isobars of several motor units are one.
_SAME = 0.03
#: Largest number of isobars of all motor units together.
_MOST_ISOBARS = 24


@dataclass(frozen=True, repr=False)
class Comparison(Answer):
    """
    Error of a model on a measurement.

    Attributes
    ----------
    model, data : str
        Names.
    error_N, bias_N, largest_N : float, N
        Root mean square, mean and largest absolute error (measured minus model).
    relative_error : float
        ``error_N`` over the rms of the measured force.
    noise : NoiseFloor
    lack_of_fit : float
        Mean square of the error averaged over cells of strain, pressure and direction, relative
        to its expected value for noise alone; about 1 for a correct model.
    even_N, odd_N : float, N
        Rms of the parts of the error that are even and odd in the direction of motion.
    tables : dict of str to list of dict
        ``pressure``, ``strain``, ``direction``, ``rate``, ``region``, ``motor_unit``, ``trial``:
        rows with ``label``, ``samples``, ``error_N``, ``bias_N``, ``beyond_noise``.
    located : tuple of Region
    prediction, residual : ndarray, shape (T,), N
    strain_error : float or None
        Root mean square error in strain, for data at a constant force.
    slips : tuple of str
        Mistakes of unit or sign that would explain the error; check these first.
    history : str
        What of the model depends on the time before the log; empty if nothing does.
    """

    model: str
    data: str
    error_N: float
    bias_N: float
    largest_N: float
    relative_error: float
    noise: NoiseFloor
    lack_of_fit: float
    even_N: float
    odd_N: float
    tables: dict[str, list[dict[str, Any]]]
    located: tuple[Region, ...]
    measurement: Measurement
    prediction: np.ndarray
    residual: np.ndarray
    strain_error: float | None = None
    slips: tuple[str, ...] = ()
    history: str = ''

    def __str__(self) -> str:
        lines = [f'{self.model} against {self.data}: error {self.error_N:.3g} N rms '
                 f'({100 * self.relative_error:.3g} % of the force), mean {self.bias_N:+.3g} N, '
                 f'largest {self.largest_N:.3g} N',
                 *([] if self.strain_error is None else [
                     f'the force is constant: in strain the error is {self.strain_error:.3g} rms'
                 ]),
                 *(f'check first: {slip}' for slip in self.slips),
                 *([self.history] if self.history else []), str(self.noise)]
        for title in ('pressure', 'strain'):
            lines.append(f'by {title}')
            for row in self.tables[title]:
                mark = '' if row['beyond_noise'] else '  (noise)'
                lines.append(f"  {row['label']:>22}  {row['error_N']:9.3g} N  mean "
                             f"{row['bias_N']:+9.3g} N{mark}")
        if self.located:
            lines.append('where it fails')
            lines += [f'  {region}' for region in self.located]
        else:
            lines.append('no region stands out of the noise')
        return '\n'.join(lines)

    def maps(self, strains: int = 24) -> dict[str, np.ndarray]:
        """
        Return the even and odd parts of the error over strain and isobar, for figures.

        Returns
        -------
        dict
            ``strain`` (s,), ``pressure`` (p,) Pa, ``even`` and ``odd`` (p, s) N (nan where not
            measured in both directions), ``mean`` (p, s) over all directions.
        """
        return residual_maps(self.measurement, self.residual, strains)

    def to_frame(self) -> Any:
        """Return measurement, model force and residual as a pandas DataFrame."""
        frame = self.measurement.to_frame()
        frame['model force [N]'] = self.prediction
        frame['residual [N]'] = self.residual
        return frame

    def to_dict(self) -> dict[str, Any]:
        """Return all but the arrays as plain numbers, lists and text."""
        return {'model': self.model, 'data': self.data, 'samples': len(self.measurement),
                'error_N': self.error_N, 'bias_N': self.bias_N, 'largest_N': self.largest_N,
                'relative_error': self.relative_error, 'strain_error': self.strain_error,
                'noise_floor_N': self.noise.value,
                'noise': self.noise.to_dict(), 'lack_of_fit': self.lack_of_fit,
                'even_N': self.even_N, 'odd_N': self.odd_N, 'tables': self.tables,
                'located': [region.to_dict() for region in self.located],
                'notes': [*self.slips, *filter(None, [self.history]), *self.measurement.notes],
                'data_sha256': self.measurement.sha256}

    def figure(self) -> Any:
        """Return the plotly figure of the comparison (extra `tools`)."""
        from fam_bundle_ros.discovery import figures
        return figures.comparison(self)


def compare(model: Bundle, measurement: Measurement | Any, *, choose_past: bool = True,
            ) -> Comparison:
    """
    Compare a model with a measurement.

    Parameters
    ----------
    model : Bundle
    measurement : Measurement, path, or DataFrame
    choose_past : bool
        Whether the memory may start anew with each trial, see `likelier_past`.

    Raises
    ------
    InputError
        If data and model have different motor units.
    """
    data = given = matched(model, measurement_of(model, measurement))
    if choose_past:
        data = likelier_past(model, given)
    prediction = predict(model, data)
    residual = data.force - prediction
    slope = stiffness(model, data)
    floor = floor_of(data, residual, slope)
    past_free = free_mask(model, data)
    maps = residual_maps(data, residual)
    lack = lack_of_fit(data, residual, floor)
    return Comparison(
        model.name, data.name, rms(residual), float(residual.mean()),
        float(np.abs(residual).max()), rms(residual) / max(rms(data.force), 1e-12), floor, lack,
        _part(maps['even']), _part(maps['odd']), _tables(data, residual, floor, past_free),
        locate(data, residual, floor.value, past_free), data, prediction, residual,
        None if slope is None else rms(residual / np.maximum(slope, 1e-3 * slope.max())),
        slips(partial(predict, model), data, residual), _history(model, data, data is not given))


def _history(model: Bundle, data: Measurement, afresh: bool) -> str:
    """Return in words what a log does not say of the muscle before it, and before its trials."""
    if afresh:
        return ('the memory of the model starts anew with each trial: the error is smaller than '
                'if the muscle remembers the trial before')
    found = [effect.name for effect in model.effects if effect.law.across_trials]
    return '' if data.is_static or not found else (
        f'{" and ".join(found)} begin{"s" if len(found) == 1 else ""} at the first row: if the '
        'muscle was used or warm before, compare the earlier files together with this one')


def floor_of(data: Measurement, residual: np.ndarray, stiff: np.ndarray | None) -> NoiseFloor:
    """
    Return the noise floor of a measurement; of a log, with the noise that has a memory.

    Second differences of rows do not see such noise. As in the fits (`cells.reduce`), its size is
    estimated from means of neighbours within the visits; in a long log, from a part of the rows.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    stiff : ndarray, shape (T,), N, or None
        `predict.stiffness` of the model.
    """
    floor = noise_of(data, residual, stiff)
    if data.is_static or floor.differences is None or floor.basis == 'repeats':
        return floor
    few = stretches(replace(data, force=residual).select(above_floor(data, stiff)), settings.ROWS)
    if len(few) <= settings.CELLS:
        return floor
    stay = visits(few, few.direction, *extent(few), settings.CELLS)
    used = ~(spikes(few, few.force, floor.value) | unknown_direction(few))
    found = mean_noise(few.force[used], stay[used], floor)
    if found is None:
        return floor
    memory = found.correlation if floor.visits is None else floor.correlation
    return replace(floor, value=found.sd, basis='means of neighbours', correlation=memory)


def residual_maps(data: Measurement, residual: np.ndarray, strains: int = 24,
                  ) -> dict[str, np.ndarray]:
    """Return even and odd residual maps over isobars and strain; see `Comparison.maps`."""
    level, means = pressure_levels(data.pressure[:, varying_unit(data)])
    index, edges = strain_bins(data.strain, strains)
    shape = (len(means), len(edges) - 1)
    cell = np.ravel_multi_index((level, index), shape)

    def mean_over(rows: np.ndarray) -> np.ndarray:
        count = np.bincount(cell[rows], minlength=shape[0] * shape[1])
        total = np.bincount(cell[rows], residual[rows], shape[0] * shape[1])
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)

    clear = ~reversals(data)
    up = mean_over((data.direction > 0) & clear)
    down = mean_over((data.direction < 0) & clear)
    every = mean_over(np.ones(len(residual), bool))
    return {'strain': (edges[1:] + edges[:-1]) / 2, 'pressure': means, 'mean': every,
            'even': every if data.is_static else (up + down) / 2, 'odd': (up - down) / 2}


def lack_of_fit(data: Measurement, residual: np.ndarray, floor: NoiseFloor) -> float:
    """Return the mean square of cell means relative to its expected value for noise alone."""
    cell, _ = visit_cells(data, 24)
    count = np.bincount(cell)
    mean = np.bincount(cell, residual) / count
    expected = floor.value ** 2 * floor.correlation
    return float(np.mean(mean ** 2 * count) / max(expected, 1e-30))


def _part(grid: np.ndarray) -> float:
    known = grid[np.isfinite(grid)]
    return rms(known) if len(known) else 0.0


def _isobars(data: Measurement) -> tuple[np.ndarray, list[str]]:
    """
    Return the isobar of each row, (T,) int, and the labels: pressures of all units that vary.

    Of the `varying_unit` alone where all together make too many, as in sweeps of the pressure.
    """
    spread = np.ptp(data.pressure, axis=0)
    varying = [varying_unit(data)]
    several = np.flatnonzero(spread > _VARIES * data.pressure.max()).tolist()
    level, labels = _combined(data, several or varying)
    return (level, labels) if len(labels) <= _MOST_ISOBARS else _combined(data, varying)


def _combined(data: Measurement, units: list[int]) -> tuple[np.ndarray, list[str]]:
    pressure = data.pressure[:, units]
    levels = np.stack([pressure_levels(column)[0] for column in pressure.T], -1)
    level = np.unique(levels, axis=0, return_inverse=True)[1].ravel()
    if len(units) > 1:
        # an edge between two levels of one unit may cut an isobar of noise in two
        first: list[int] = []
        centres = _centres(pressure, level)
        for k, centre in enumerate(centres):
            near = np.abs(centres[:k] - centre).max(axis=1) <= _SAME * pressure.max()
            first.append(first[int(np.argmax(near))] if near.any() else k)
        level = np.unique(np.array(first)[level], return_inverse=True)[1]
    named = data.pressure.shape[1] > 1
    names = [f'{data.motor_units[unit]} ' if named else '' for unit in units]
    return level, [', '.join(f'{name}{round(mean / 1e3) + 0:d}'
                             for name, mean in zip(names, centre)) + ' kPa'
                   for centre in _centres(pressure, level)]


def _centres(pressure: np.ndarray, level: np.ndarray) -> np.ndarray:
    return np.stack([pressure[level == k].mean(axis=0) for k in range(level.max() + 1)])


def _tables(data: Measurement, residual: np.ndarray, floor: NoiseFloor, past_free: np.ndarray,
            ) -> dict[str, list[dict[str, Any]]]:
    def table(label_rows: list[tuple[str, np.ndarray]]) -> list[dict[str, Any]]:
        rows = []
        for label, mask in label_rows:
            inside = residual[mask]
            if not len(inside):
                continue
            error = rms(inside)
            # Three standard deviations of the mean, and of the rms, of correlated noise.
            spread = 3.0 * np.sqrt(floor.correlation / len(inside))
            bias = float(inside.mean())
            beyond = (error > floor.value * (1.0 + spread / np.sqrt(2.0))
                      or abs(bias) > floor.value * spread)
            rows.append({'label': label, 'samples': len(inside), 'error_N': error,
                         'bias_N': bias, 'beyond_noise': bool(beyond)})
        return rows

    level, labels = _isobars(data)
    index, edges = strain_bins(data.strain, 8)
    tables = {
        'pressure': table([(label, level == k) for k, label in enumerate(labels)]),
        'strain': table([(f'{low:.3f} to {high:.3f}', index == k)
                         for k, (low, high) in enumerate(pairwise(edges.round(3) + 0.0))]),
        'region': table([('tensile', ~past_free), ('past free strain', past_free)]),
    }
    if not data.is_static:
        there, back = data.ways
        tables['direction'] = table([(there, data.direction > 0), ('at rest', data.direction == 0),
                                     (back, data.direction < 0)])
        speed, of = ((pressure_speed(data) / 1e3, 'kPa/s') if data.is_held else
                     (np.abs(data.strain_rate), '1/s'))
        cuts = np.unique(np.quantile(speed, [0.0, 0.25, 0.5, 0.75, 1.0]))
        tables['rate'] = table([
            (f'{low:.3g} to {high:.3g} {of}', (speed >= low) & (speed <= high))
            for low, high in zip(cuts[:-1], cuts[1:])])
    if data.pressure.shape[1] > 1:
        on = data.pressure > 0.1 * data.pressure.max()
        states = sorted({tuple(bool(v) for v in row) for row in on})
        tables['motor_unit'] = table([
            (' + '.join(m for m, v in zip(data.motor_units, state) if v) or 'none',
             (on == np.array(state)).all(axis=1)) for state in states])
    if len(data.trial_names) > 1:
        tables['trial'] = table([(name, data.trial == k)
                                 for k, name in enumerate(data.trial_names)])
    return tables
