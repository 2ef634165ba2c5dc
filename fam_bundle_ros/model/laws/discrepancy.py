# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What physics leaves: a smooth surface, as `fam_bundle diagnose` writes it."""

import csv
from pathlib import Path
import warnings

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.laws.base import law
from fam_bundle_ros.model.vocabulary import cell
from fam_bundle_ros.units import si_factor

#: Column: unit by default. `sd` is for readers; `motor_unit` counts from 1.
_NEEDED = {'strain': '1', 'pressure': 'kPa', 'force': 'N', 'odd': 'N'}
#: 1/s: strain rate over which the sign of the motion is rounded, as in dry friction.
ROUNDING = 2e-3


class Table:
    """
    A discrepancy over a grid of strain and pressure, one grid for each motor unit or for all.

    Parameters
    ----------
    path : Path
        CSV with columns strain, pressure, force (even in the direction of motion), odd (while
        shortening; its opposite while lengthening), and, where there are several grids,
        motor_unit; other columns (``sd``) are for readers.

    Attributes
    ----------
    flat : array
        Grids, strains, pressures (numbers of), the strains, the pressures (Pa), the even and the
        odd forces (N) grid by grid, strain by strain.
    """

    def __init__(self, path: Path):
        self.path = path
        columns = _read(path)
        unit = columns.pop('motor_unit', np.ones(len(columns['strain'])))
        units = np.unique(unit)
        if not np.array_equal(units, np.arange(1, len(units) + 1)):
            raise InputError(f'{path}: motor_unit has {", ".join(f"{u:g}" for u in units)}; '
                             'expected 1, 2, ... without gaps')
        self._strain, self._pressure = (np.unique(columns[key]) for key in ('strain', 'pressure'))
        shape = (len(units), len(self._strain), len(self._pressure))
        if min(shape[1:]) < 2 or np.prod(shape) != len(unit):
            raise InputError(f'{path}: {len(unit)} rows; expected every pair of {shape[1]} '
                             f'strains and {shape[2]} pressures once, for each motor unit')
        order = np.lexsort((columns['pressure'], columns['strain'], unit))
        self.flat = np.concatenate([shape, self._strain, self._pressure, columns['force'][order],
                                    columns['odd'][order]])
        self._warned = False

    def warn_outside(self, strain, pressure) -> None:
        """Warn, once, where strain or pressure (Pa) leave the data that the table is from."""
        e, p = self._strain, self._pressure
        if not self._warned and (np.any(strain < e[0]) or np.any(strain > e[-1])
                                 or np.any(pressure < p[0]) or np.any(pressure > p[-1])):
            self._warned = True
            warnings.warn(
                f'{self.path.name}: asked outside strain {e[0]:g} to {e[-1]:g} and pressure '
                f'{p[0] / 1e3:g} to {p[-1] / 1e3:g} kPa, where nothing was measured; the nearest '
                'edge is used', stacklevel=4)


@law('residual', family='discrepancy', candidate=False, load=Table, look=('grey', 'dot'),
     summary='what no law of the model explains: a smooth surface, not physics',
     source="derived: mean of a Gaussian process (Kennedy and O'Hagan 2001), by diagnose",
     signature='whatever is left, inside the range that was measured')
def discrepancy_surface(unit, strain, strain_rate, pressure, tables, table):
    """
    F(e, P) of a `Table` and, by the smoothed sign of the rate, its odd part.

    Bilinear between points, the nearest edge outside them.
    """
    grids, rows = int(tables[table]), int(tables[table + 1])
    columns = int(tables[table + 2])
    strains = table + 3
    pressures = strains + rows
    i = cell(tables, strains, rows, strain)
    j = cell(tables, pressures, columns, pressure)
    low, left = strains + i, pressures + j
    u = (strain - tables[low]) / (tables[low + 1] - tables[low])
    v = (pressure - tables[left]) / (tables[left + 1] - tables[left])
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    v = np.minimum(np.maximum(v, 0.0), 1.0)
    grid = np.minimum(unit, grids - 1)
    at = pressures + columns + (grid * rows + i) * columns + j
    odd = at + grids * rows * columns
    even_force = ((1.0 - u) * ((1.0 - v) * tables[at] + v * tables[at + 1])
                  + u * ((1.0 - v) * tables[at + columns] + v * tables[at + columns + 1]))
    odd_force = ((1.0 - u) * ((1.0 - v) * tables[odd] + v * tables[odd + 1])
                 + u * ((1.0 - v) * tables[odd + columns] + v * tables[odd + columns + 1]))
    return even_force + np.tanh(strain_rate / ROUNDING) * odd_force


def _read(path):
    """Return the columns (SI) of a CSV with units in its header."""
    try:
        with open(path, newline='', encoding='utf-8') as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: cannot be read as a CSV ({error})') from error
    if len(rows) < 2:
        raise InputError(f'{path}: is empty; expected columns {", ".join(_NEEDED)}')
    found = {}
    for index, title in enumerate(rows[0]):
        name, _, unit = (part.strip(' ]') for part in title.partition('['))
        if name not in _NEEDED and name != 'motor_unit':
            continue
        factor = si_factor(unit or _NEEDED.get(name, '1'), _NEEDED.get(name, '1'))
        try:
            found[name] = factor * np.array([float(row[index]) for row in rows[1:]])
        except (ValueError, IndexError) as error:
            raise InputError(f'{path}: column {name} has an entry that is not a number') from error
        if not np.all(np.isfinite(found[name])):
            raise InputError(f'{path}: column {name} has values that are not finite')
    missing = set(_NEEDED) - set(found)
    if missing:
        raise InputError(f'{path}: has no column {", ".join(sorted(missing))}')
    return found
