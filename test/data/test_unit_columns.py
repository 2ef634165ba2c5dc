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
    assert any(note.endswith(f"'{header}' is in {unit}, as '{beside}' tells")
               for note in data.notes)


def ranged(log):
    """Return the log with a force in N up to 100 N and in kN beyond, and the unit beside it."""
    big = log[3] > BIG
    return {**table(log, force=('Force', np.where(big, log[3] / 1e3, log[3]))),
            'Unit': np.where(big, 'kN', 'N').astype(object)}


def test_readings_of_several_units_are_converted_to_the_first(log):
    """A gauge that changes its range; a word among the readings is still a word."""
    data = ranged(log)
    read = read_measurement(data)
    assert np.allclose(read.force, log[3])
    assert f"as 'Unit' tells: read in {data['Unit'][0]}" in ' '.join(read.notes)
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


@pytest.mark.parametrize(('key', 'header', 'size', 'name', 'cell'), [
    ('force', 'Force', 1.0, 'Status', 'g'), ('strain', 'length', 0.25, 'mode', 'm'),
    ('pressure', 'pressure', 1e-3, 'valve', 'at'), ('force', 'force', 1.0, 'Unit', 'A')])
def test_a_status_that_looks_like_a_unit_is_none(log, key, header, size, name, cell):
    """Only a column called unit, or without a name, holds units; 'A' may be a motor unit."""
    values = size * {'force': log[3], 'strain': 1.0 - log[1], 'pressure': log[2]}[key]
    data = {header: values, name: np.full(ROWS, cell, object), **table(log, **{key: None})}
    read = read_measurement(data, rest_length=0.25)
    assert np.allclose([read.strain, read.pressure[:, 0], read.force], log[1:])
    assert any("'Unit' is not used" in note for note in read.notes) == (name == 'Unit')


@pytest.mark.parametrize('name', ['comment', 'column 5'])
def test_a_comment_on_one_reading_is_no_unit(log, name):
    """A column without a name must have a unit for each reading."""
    comment = np.full(ROWS, '', object)
    comment[3] = 'bar'
    read = read_measurement({'p': log[2] / 1e3, name: comment, **table(log, pressure=None)})
    assert np.allclose(read.pressure[:, 0], log[2])


@pytest.mark.parametrize('first', [True, False])
def test_units_may_stand_on_the_left_of_the_readings(log, first):
    """Each is of the column on its right where more fit there: bar and kPa fit both."""
    columns = [('Unit', 'mm'), ('Length', 250.0 * (1.0 - log[1])), ('Unit (2)', 'bar'),
               ('pressure.mu1', log[2] / 1e5), ('Unit (3)', 'kPa'), ('pressure.mu2', log[2] / 1e3),
               ('Unit (4)', 'N'), ('Force', log[3])][0 if first else 2:]
    data = {'time [s]': log[0]} if first else table(log, pressure=None, force=None)
    data |= {name: np.full(ROWS, cells, object) if isinstance(cells, str) else cells
             for name, cells in columns}
    read = read_measurement(data, rest_length=0.25)
    assert np.allclose([read.strain, *read.pressure.T, read.force], [*log[1:3], *log[2:]])


@pytest.mark.parametrize('word', ['', 'n/a'])
def test_a_blank_unit_is_the_only_one(log, word):
    """Of several none is known, but what the user tells counts more."""
    unit = np.full(ROWS, 'kN', object)
    unit[[0, -1]] = word
    data = {**table(log, force=('Force', log[3] / 1e3)), 'Unit': unit}
    assert np.allclose(read_measurement(data).force, log[3])
    unit[5:8] = 'N'
    with pytest.raises(InputError, match="row 1: the unit of Force is ''"):
        read_measurement(data)
    told = read_measurement(data, columns={'force': 'Force [kN]'})
    assert np.allclose(told.force, log[3])


@pytest.mark.parametrize('sign', '.,')
def test_cells_with_units_of_their_own(tmp_path, log, sign):
    """An instrument that switches its range: 1.5 bar, then 980 mbar."""
    cells = [f'{p / 1e5:.5f} bar' if p > 2e5 else f'{p / 100:.3f} mbar' for p in log[2]]
    text = 't [s];strain;pressure;F [N]\n' + ''.join(
        f'{t:.3f};{e:.6f};{cell};{f:.5f}\n' for t, e, cell, f in zip(
            log[0], log[1], cells, log[3]))
    path = tmp_path / 'log.csv'
    path.write_text(text.replace('.', sign))
    assert np.allclose(read_measurement(path).pressure[:, 0], log[2])
    path.write_text(text.replace('.', sign).replace('mbar', 'mm'))  # of no pressure
    with pytest.raises(InputError, match="'pressure' text"):
        read_measurement(path)
