# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A user's own measured force surface F(strain, pressure), in tension and compression."""

import csv
from pathlib import Path
import warnings

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.laws.base import law
from fam_bundle_ros.model.vocabulary import cell
from fam_bundle_ros.units import si_factor

_COLUMNS = {'strain': '1', 'pressure': 'kPa', 'force': 'N'}
_REFINE = 8


class Table:
    """
    A force table F(e, P) from a CSV with columns strain, pressure [unit], force [unit].

    Every isobar needs at least two strains. The table is refined eightfold along strain and then
    along pressure by shape-preserving cubic (PCHIP) interpolation, so the measured points are
    met exactly and no oscillation is added.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    flat : array
        Number of strains, number of pressures, the strains, the pressures (Pa), the forces (N)
        strain by strain.
    """

    def __init__(self, path: Path):
        self.path = path
        self._strain, self._pressure, force = _refine(*_read(path))
        self.flat = np.concatenate([force.shape, self._strain, self._pressure, force.ravel()])
        self._warned = False

    def warn_outside(self, strain, pressure) -> None:
        """Warn, once, where strain or pressure (Pa) leave the table."""
        e, p = self._strain, self._pressure
        if not self._warned and (np.any(strain < e[0]) or np.any(strain > e[-1])
                                 or np.any(pressure < p[0]) or np.any(pressure > p[-1])):
            self._warned = True
            warnings.warn(
                f'{self.path.name}: asked outside strain {e[0]:g} to {e[-1]:g} and pressure '
                f'{p[0] / 1e3:g} to {p[-1] / 1e3:g} kPa; the nearest edge is used', stacklevel=4)


@law('force', family='surface', candidate=False, load=Table, look=('indigo', 'dashdot'),
     summary="interpolates the user's own force table F(strain, pressure)",
     source='the way Kim, Mazzoleni and Bryant 2021 simulate; PCHIP by scipy',
     signature='a measured table replaces mesh and bladder')
def measured_surface(strain, pressure, tables, table):
    """F(e, P) of a `Table`: bilinear between its refined points, the nearest edge outside it."""
    rows, columns = int(tables[table]), int(tables[table + 1])
    strains = table + 2
    pressures = strains + rows
    i = strains + cell(tables, strains, rows, strain)
    j = pressures + cell(tables, pressures, columns, pressure)
    u = (strain - tables[i]) / (tables[i + 1] - tables[i])
    v = (pressure - tables[j]) / (tables[j + 1] - tables[j])
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    v = np.minimum(np.maximum(v, 0.0), 1.0)
    at = pressures + columns + (i - strains) * columns + j - pressures
    return ((1.0 - u) * ((1.0 - v) * tables[at] + v * tables[at + 1])
            + u * ((1.0 - v) * tables[at + columns] + v * tables[at + columns + 1]))


def _refine(strain, pressure, force):
    """Return the table on a grid eight times as fine in both directions."""
    # here, not above: it takes 0.4 s, which every node would pay
    from scipy.interpolate import PchipInterpolator

    isobars = np.unique(pressure)
    if len(isobars) < 2:
        raise InputError('measured_surface: the table needs at least two pressures')
    strains = _subdivide(np.unique(strain))
    columns = []
    for isobar in isobars:
        rows = pressure == isobar
        at, first = np.unique(strain[rows], return_index=True)
        if len(at) < 2 or len(at) < np.count_nonzero(rows):
            raise InputError(f'measured_surface: the isobar {isobar / 1e3:g} kPa needs two or '
                             'more strains, each once')
        inside = np.clip(strains, at[0], at[-1])
        columns.append(PchipInterpolator(at, force[rows][first])(inside))
    fine = _subdivide(isobars)
    return strains, fine, PchipInterpolator(isobars, np.array(columns), axis=0)(fine).T


def _subdivide(grid):
    steps = np.linspace(0.0, 1.0, _REFINE, endpoint=False)
    inner = grid[:-1, None] + np.diff(grid)[:, None] * steps
    return np.append(inner.ravel(), grid[-1])


def _read(path):
    """Return strain, pressure and force (SI) from a CSV with units in its header."""
    try:
        with open(path, newline='', encoding='utf-8') as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: cannot be read as a CSV ({error})') from error
    if len(rows) < 2:
        raise InputError(f'{path}: is empty; expected columns {", ".join(_COLUMNS)}')
    found = {}
    for index, title in enumerate(rows[0]):
        quantity, _, unit = title.partition('[')
        if quantity.strip() in _COLUMNS:
            like = _COLUMNS[quantity.strip()]
            try:
                found[quantity.strip()] = (index, si_factor(unit.strip(' ]'), like))
            except InputError as error:
                raise InputError(f'{path}, header "{title}": {error}') from error
    missing = set(_COLUMNS) - set(found)
    if missing:
        raise InputError(f'{path}: has no column {", ".join(sorted(missing))}')
    values = {name: np.empty(len(rows) - 1) for name in _COLUMNS}
    for number, row in enumerate(rows[1:], start=2):
        for name, (index, factor) in found.items():
            try:
                values[name][number - 2] = float(row[index]) * factor
            except (ValueError, IndexError) as error:
                raise InputError(f'{path}, row {number}: {name} is not a number') from error
    if not all(np.all(np.isfinite(column)) for column in values.values()):
        raise InputError(f'{path}: has values that are not finite')
    return values['strain'], values['pressure'], values['force']
