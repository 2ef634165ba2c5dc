# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of force over strain and pressure, read from a CSV, for laws with a table."""

from collections.abc import Mapping
import csv
from pathlib import Path
import warnings

import numpy as np

from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.model.vocabulary import cell
from fam_bundle_ros.units import si_factor


class ForceTable:
    """
    One or more surfaces F(e, P) on one grid.

    Parameters
    ----------
    path : Path
        Source of the table, for messages.
    strain : array, shape (S,)
    pressure : array, shape (P,), Pa (gauge)
    force : array, shape (n, S, P), N
        The n surfaces.
    units : int
        Number of motor units with separate surfaces.

    Attributes
    ----------
    flat : array
        Numbers of units, strains and pressures; then the strains, the pressures (Pa), and the
        forces (N) surface by surface, strain by strain.
    """

    def __init__(self, path: Path, strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
                 units: int = 1):
        self.path, self._strain, self._pressure = path, strain, pressure
        self.flat = np.concatenate([[units], force.shape[1:], strain, pressure, force.ravel()])
        self._warned = False

    def warn_outside(self, strain, pressure) -> None:
        """Warn, once, if strain or pressure (Pa) are outside the grid by more than half a step."""
        e, p = self._strain, self._pressure
        if not self._warned and (_leave(strain, e) or _leave(pressure, p)):
            self._warned = True
            warnings.warn(
                f'{self.path.name}: asked outside strain {e[0]:g} to {e[-1]:g} and pressure '
                f'{p[0] / 1e3:g} to {p[-1] / 1e3:g} kPa, the measured range; the nearest edge is '
                'used', stacklevel=4)


def _leave(values, grid: np.ndarray) -> bool:
    """Return whether any value is outside the grid by more than half of its last step."""
    steps = np.diff(grid)
    first, last = (steps[0], steps[-1]) if len(steps) else (0.0, 0.0)
    return bool(np.any(values < grid[0] - 0.5 * first) or np.any(values > grid[-1] + 0.5 * last))


def interpolated(tables, table, surface, strain, pressure):
    """
    Return a surface of a `ForceTable`, N: bilinear between its points, constant outside.

    Parameters
    ----------
    tables : array
        All tables of a model.
    table : int
        Start index of this table in ``tables``.
    surface : int
        Index of the surface, from 0.
    strain, pressure : number or array, 1 and Pa (gauge)
    """
    rows, columns = int(tables[table + 1]), int(tables[table + 2])
    strains = table + 3
    pressures = strains + rows
    i = cell(tables, strains, rows, strain)
    j = cell(tables, pressures, columns, pressure)
    low, left = strains + i, pressures + j
    u = (strain - tables[low]) / (tables[low + 1] - tables[low])
    v = (pressure - tables[left]) / (tables[left + 1] - tables[left])
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    v = np.minimum(np.maximum(v, 0.0), 1.0)
    at = pressures + columns + (surface * rows + i) * columns + j
    return ((1.0 - u) * ((1.0 - v) * tables[at] + v * tables[at + 1])
            + u * ((1.0 - v) * tables[at + columns] + v * tables[at + columns + 1]))


def read_columns(path: Path, needed: Mapping[str, str], optional: Mapping[str, str] | None = None,
                 units_told: bool = True) -> dict[str, np.ndarray]:
    """
    Return columns of a CSV in SI units, arrays of shape (T,).

    Parameters
    ----------
    path : Path
    needed : mapping of str to str
        Required columns, each with a unit of its dimension. Other columns are ignored.
    optional : mapping of str to str
        Optional columns, likewise.
    units_told : bool
        If True the header must have units, ``pressure [kPa]``; else the units of ``needed`` and
        ``optional`` are the default.

    Raises
    ------
    InputError
        Names the row or column that is wrong or missing.
    """
    try:
        with open(path, newline='', encoding='utf-8') as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: cannot be read as a CSV ({error})') from error
    if len(rows) < 2:
        raise InputError(f'{path}: is empty; expected columns {", ".join(needed)}')
    found, wanted = {}, {**needed, **(optional or {})}
    for index, title in enumerate(rows[0]):
        name, _, unit = (part.strip(' ]') for part in title.partition('['))
        if name in wanted:
            like = wanted[name]
            with about(f'{path}, header "{title}"'):
                factor = si_factor(unit or ('' if units_told else like), like)
            found[name] = factor * _numbers(path, rows, index, name)
    missing = set(needed) - set(found)
    if missing:
        raise InputError(f'{path}: has no column {", ".join(sorted(missing))}')
    return found


def _numbers(path, rows, index, name):
    """Return a column as finite numbers, without the header."""
    values = np.empty(len(rows) - 1)
    for number, row in enumerate(rows[1:], start=2):
        try:
            values[number - 2] = float(row[index])
        except (ValueError, IndexError) as error:
            raise InputError(f'{path}, row {number}: {name} is not a number') from error
    if not np.all(np.isfinite(values)):
        raise InputError(f'{path}: column {name} has values that are not finite')
    return values
