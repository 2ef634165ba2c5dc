# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A user's own measured force surface F(strain, pressure), in tension and compression."""

from pathlib import Path

import numpy as np

from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.model.forcetable import ForceTable, interpolated, read_columns
from fam_bundle_ros.model.laws.base import law

_COLUMNS = {'strain': '1', 'pressure': 'kPa', 'force': 'N'}
_REFINE = 8


class Table(ForceTable):
    """
    A force table F(e, P) from a CSV with columns strain, pressure [unit], force [unit].

    Every isobar needs at least two strains. The table is refined eightfold along strain and then
    along pressure by shape-preserving cubic (PCHIP) interpolation, which passes through the
    measured points without oscillation.
    """

    def __init__(self, path: Path):
        columns = read_columns(path, _COLUMNS)
        with about(str(path)):
            strain, pressure, force = _refine(*(columns[name] for name in _COLUMNS))
        super().__init__(path, strain, pressure, force[None])


@law('force', family='surface', candidate=False, load=Table, look=('indigo', 'dashdot'),
     summary="interpolates the user's own force table F(strain, pressure)",
     source='method of Kim, Mazzoleni and Bryant 2021; PCHIP by scipy',
     signature='a measured table replaces mesh and bladder')
def measured_surface(strain, pressure, tables, table):
    """F(e, P) of a `Table`: bilinear between its refined points, the nearest edge outside it."""
    return interpolated(tables, table, 0, strain, pressure)


def _refine(strain, pressure, force):
    """Return the table on a grid eight times as fine in both directions."""
    # not at the top: the import takes 0.4 s, for every node
    from scipy.interpolate import PchipInterpolator

    isobars = np.unique(pressure)
    if len(isobars) < 2:
        raise InputError('expected at least two pressures')
    strains = _subdivide(np.unique(strain))
    columns = []
    for isobar in isobars:
        rows = pressure == isobar
        at, first = np.unique(strain[rows], return_index=True)
        count = np.count_nonzero(rows)
        if len(at) < 2 or len(at) < count:
            raise InputError(f'{len(at)} strains in {count} rows at {isobar / 1e3:g} kPa; '
                             'expected two or more strains, each once')
        inside = np.clip(strains, at[0], at[-1])
        columns.append(PchipInterpolator(at, force[rows][first])(inside))
    fine = _subdivide(isobars)
    return strains, fine, PchipInterpolator(isobars, np.array(columns), axis=0)(fine).T


def _subdivide(grid):
    steps = np.linspace(0.0, 1.0, _REFINE, endpoint=False)
    inner = grid[:-1, None] + np.diff(grid)[:, None] * steps
    return np.append(inner.ravel(), grid[-1])
