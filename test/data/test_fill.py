# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Levels in the first row of their block only."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError


def blanked(column):
    """Return a column with blanks where it repeats the cell above."""
    return np.where(np.r_[True, np.diff(column) != 0], column, np.nan)


def test_a_pressure_stands_for_the_rows_below(log):
    """Of merged cells the first is saved: all rows but three were left out."""
    time, strain, pressure, force = log
    data = read_measurement({'p [Pa]': blanked(pressure), 'time [s]': time, 'strain': strain,
                             'F [N]': force})
    assert np.allclose(data.pressure[:, 0], pressure)
    assert "'p [Pa]' stands in 3 of 240 rows: taken for the rows below each" in data.notes


def test_a_strain_of_an_isometric_map_stands_for_the_rows_below(muscle):
    """Fifteen strains, each with all pressures below it, without a clock."""
    strain, pressure = (each.ravel() for each in np.meshgrid(
        np.linspace(0.0, 0.14, 15), np.linspace(1e5, 4e5, 7), indexing='ij'))
    data = read_measurement({'strain': blanked(strain), 'p [Pa]': pressure,
                             'F [N]': muscle(strain, pressure)})
    assert np.allclose(data.strain, strain)


def test_a_slow_sensor_is_not_held(log):
    """Every tenth row of a pressure that changes: these rows are read, as before."""
    time, strain, _, force = log
    ramp = np.linspace(1e5, 4e5, len(time))
    ramp[np.arange(len(time)) % 10 != 0] = np.nan
    table = {'time [s]': time, 'strain': strain, 'p [Pa]': ramp, 'F [N]': force}
    assert len(read_measurement(table)) == 24
    table['p [Pa]'] = np.where(np.arange(len(time)) == 100, 1e5, np.nan)
    with pytest.raises(InputError, match=': 1 row with a number'):
        read_measurement(table)
