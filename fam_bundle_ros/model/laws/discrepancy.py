# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy: a smooth surface of the remaining error, from `fam_bundle diagnose`."""

from pathlib import Path

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.forcetable import ForceTable, interpolated, read_columns
from fam_bundle_ros.model.laws.base import law
from fam_bundle_ros.model.vocabulary import dahl

#: Columns and their default units. `motor_unit` counts from 1.
_NEEDED = {'strain': '1', 'pressure': 'kPa', 'force': 'N', 'odd': 'N'}
_OPTIONAL = {'filling': 'N', 'motor_unit': '1'}
#: Strain rate at which the sign of the motion is rounded, 1/s, as in dry friction.
ROUNDING = 2e-3
#: Half width of the play (dead zone) of the pressure, as a share of the table's pressure step.
DEAD = 0.1


class Table(ForceTable):
    """
    A discrepancy over a grid of strain and pressure, one grid for each motor unit or for all.

    Parameters
    ----------
    path : Path
        CSV with columns strain, pressure, force (even in the direction of motion) and odd (while
        shortening; with opposite sign while lengthening). Optional columns are filling (at rest
        after the pressure has risen; with opposite sign after it has fallen) and, for several
        grids, motor_unit; others (``sd``) are ignored. The surfaces are in the order even, odd,
        filling.
    """

    def __init__(self, path: Path):
        columns = read_columns(path, _NEEDED, _OPTIONAL, units_told=False)
        rows = len(columns['strain'])
        unit = columns.pop('motor_unit', np.ones(rows))
        columns.setdefault('filling', np.zeros(rows))
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
        force = np.concatenate([columns[name][order].reshape(shape)
                                for name in ('force', 'odd', 'filling')])
        super().__init__(path, strain, pressure, force, len(units))


@law('residual', family='discrepancy', candidate=False, load=Table, look=('grey', 'dot'),
     memory=('centre', 'built_up'),
     summary='error that no law of the model explains: a smooth surface, not physics',
     source="derived: mean of a Gaussian process (Kennedy and O'Hagan 2001), by diagnose",
     signature='the remaining error, within the measured range')
def discrepancy_surface(unit, strain, strain_rate, pressure, start, centre, built_up, tables,
                        table):
    """
    F(e, P) of a `Table`: even part, odd part times the direction of motion, at rest filling part.

    Bilinear between points, constant outside them. The sign of the strain rate is smoothed; the
    direction of the pressure builds up over one step of the table (Dahl model).
    """
    grids = int(tables[table])
    grid = np.minimum(unit, grids - 1)
    first = table + 3 + int(tables[table + 1])
    step = tables[first + 1] - tables[first]
    way, path = dahl(centre, built_up, pressure, DEAD * step, step, start)
    moving = np.tanh(strain_rate / ROUNDING)
    force = (interpolated(tables, table, grid, strain, pressure)
             + moving * interpolated(tables, table, grids + grid, strain, pressure)
             + (1.0 - np.abs(moving)) * way
             * interpolated(tables, table, 2 * grids + grid, strain, pressure))
    return force, path, way
