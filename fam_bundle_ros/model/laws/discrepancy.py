# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy: a smooth surface of the error left, as `fam_bundle diagnose` writes it."""

from pathlib import Path

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.forcetable import ForceTable, interpolated, read_columns
from fam_bundle_ros.model.laws.base import law

#: Column: unit by default. `sd` is for readers; `motor_unit` counts from 1.
_NEEDED = {'strain': '1', 'pressure': 'kPa', 'force': 'N', 'odd': 'N'}
#: 1/s: strain rate over which the sign of the motion is rounded, as in dry friction.
ROUNDING = 2e-3


class Table(ForceTable):
    """
    A discrepancy over a grid of strain and pressure, one grid for each motor unit or for all.

    Parameters
    ----------
    path : Path
        CSV with columns strain, pressure, force (even in the direction of motion), odd (while
        shortening; its opposite while lengthening), and, where there are several grids,
        motor_unit; other columns (``sd``) are for readers. The even surfaces come first.
    """

    def __init__(self, path: Path):
        columns = read_columns(path, _NEEDED, ('motor_unit',), units_told=False)
        unit = columns.pop('motor_unit', np.ones(len(columns['strain'])))
        units = np.unique(unit)
        if not np.array_equal(units, np.arange(1, len(units) + 1)):
            raise InputError(f'{path}: motor_unit has {", ".join(f"{u:g}" for u in units)}; '
                             'expected 1, 2, ... without gaps')
        strain, pressure = (np.unique(columns[key]) for key in ('strain', 'pressure'))
        shape = (len(units), len(strain), len(pressure))
        if min(shape[1:]) < 2 or np.prod(shape) != len(unit):
            raise InputError(f'{path}: {len(unit)} rows; expected every pair of {shape[1]} '
                             f'strains and {shape[2]} pressures once, for each motor unit')
        order = np.lexsort((columns['pressure'], columns['strain'], unit))
        force = np.concatenate([columns[name][order].reshape(shape) for name in ('force', 'odd')])
        super().__init__(path, strain, pressure, force, len(units))


@law('residual', family='discrepancy', candidate=False, load=Table, look=('grey', 'dot'),
     summary='what no law of the model explains: a smooth surface, not physics',
     source="derived: mean of a Gaussian process (Kennedy and O'Hagan 2001), by diagnose",
     signature='whatever is left, inside the range that was measured')
def discrepancy_surface(unit, strain, strain_rate, pressure, tables, table):
    """
    F(e, P) of a `Table` and, by the smoothed sign of the rate, its odd part.

    Bilinear between points, the nearest edge outside them.
    """
    grids = int(tables[table])
    grid = np.minimum(unit, grids - 1)
    odd = interpolated(tables, table, grids + grid, strain, pressure)
    return (interpolated(tables, table, grid, strain, pressure)
            + np.tanh(strain_rate / ROUNDING) * odd)
