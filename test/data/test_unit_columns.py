# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units in a column of their own, one for each reading."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

from .test_columns import ROWS, table

#: Force of which a gauge shows readings in kN.
BIG = 100.0


@pytest.mark.parametrize(('header', 'beside', 'unit', 'factor'), [
    ('Force', 'Force unit', 'lbf', 4.4482216), ('Reading', 'Units', 'kgf', 9.80665),
    ('Kraft', 'Einheit', 'kN', 1e3), ('Force', 'column 5', 'lbf', 4.4482216)])
def test_a_column_of_units_tells_that_of_the_column_on_its_left(log, header, beside, unit, factor):
    """As force gauges write; the name of either may be unknown."""
    data = read_measurement({**table(log, force=(header, log[3] / factor)),
                             beside: np.full(ROWS, unit, object)})
    assert np.allclose(data.force, log[3], rtol=1e-6)
    assert any(f"'{header}' is in {unit}, as '{beside}' tells" in note for note in data.notes)


def ranged(log):
    """Return the log with a force in N up to 100 N and in kN beyond, and the unit beside it."""
    big = log[3] > BIG
    return {**table(log, force=('Force', np.where(big, log[3] / 1e3, log[3]))),
            'Unit': np.where(big, 'kN', 'N').astype(object)}


def test_readings_of_several_units_are_converted_to_the_first(log):
    """A gauge that changes its range; a word among the readings is still a word."""
    data = ranged(log)
    assert np.allclose(read_measurement(data).force, log[3])
    data['Force'] = data['Force'].astype(object)
    data['Force'][7] = 'jammed'
    with pytest.raises(InputError, match="row 8: Force is 'jammed'"):
        read_measurement(data)


@pytest.mark.parametrize(('text', 'words'), [('mm', "row 6: the unit of Force is 'mm'"),
                                         ('', "row 6: the unit of Force is ''")])
def test_a_reading_without_a_unit_like_the_others_is_refused(log, text, words):
    """It cannot be converted."""
    data = ranged(log)
    data['Unit'][5] = text
    with pytest.raises(InputError, match=words):
        read_measurement(data)


def test_an_absolute_pressure_among_gauge_pressures_is_refused(log):
    """A factor does not convert it."""
    unit = np.full(ROWS, 'psig', object)
    unit[9] = 'psia'
    with pytest.raises(InputError, match="row 10: the unit of p is 'psia'"):
        read_measurement({'p': log[2] / 6894.757, 'Unit': unit, **table(log, pressure=None)})


def test_a_column_of_other_words_is_no_column_of_units(log):
    """'in' may be a direction: all cells must be units unless the column is called so."""
    way = np.array(['in', 'out'], object)[(np.arange(ROWS) > 200).astype(int)]
    data = {'length': 1.0 - log[1], 'way': way, **table(log, strain=None)}
    assert np.allclose(read_measurement(data).strain, log[1])


def test_readings_of_one_per_row_have_a_unit_each(log):
    """The signals of a database: the pressure in mbar below 2 bar, in bar above."""
    time, strain, pressure, force = log
    small = pressure < 2e5
    data = {'time [s]': np.repeat(time, 3), 'name': np.tile(['strain', 'p', 'F'], ROWS),
            'value': np.stack([strain, np.where(small, pressure / 100, pressure / 1e5), force],
                              -1).ravel(),
            'unit': np.stack([np.full(ROWS, '-'), np.where(small, 'mbar', 'bar'),
                              np.full(ROWS, 'N')], -1).ravel().astype(object)}
    assert np.allclose(read_measurement(data).pressure[:, 0], pressure)
    data['unit'][3 * 5 + 1] = 'psia'
    with pytest.raises(InputError, match="row 17: the unit of p is 'psia', and in other rows"):
        read_measurement(data)
