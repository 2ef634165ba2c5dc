# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Where names end and data begin in a grid of text, and what cells are."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.data.cells import (
    in_groups,
    is_blank,
    is_number,
    is_reading,
    is_statistic,
    with_unit,
)
from fam_bundle_ros.data.formats.layout import (
    are_units,
    counts_rows,
    find_data,
    find_names,
    is_row,
    may_name,
    moved_right,
    trimmed,
    with_bad_cells,
)

NAMES = ['time', 'strain', 'pressure', 'force']
UNITS = ['s', '%', 'kPa', 'N']


def data(count=12, width=4, gaps=()):
    """Return rows of numbers; cells in ``gaps`` (row, column) are blank."""
    return [['' if (k, c) in gaps else f'{0.1 * k + c:.2f}' for c in range(width)]
            for k in range(count)]


HEADS = {
    'nothing': [], 'names': [NAMES], 'names and units': [NAMES, UNITS],
    'words': [['Test of a muscle'], ['operator', 'M. Muster'], [], NAMES],
    'a date': [['Date', '2026-05-03 10:00:00'], NAMES],
    'a setting': [['rest length', '127'], ['gauge', '1200', '7'], NAMES, UNITS],
    'numbers above the names': [['1', '2', '3', '4'], NAMES],
    'numbers far above': [['1', '2', '3', '4'], [], ['channels'], NAMES, UNITS],
    'a value between': [['dt:'], ['0.01', '2'], ['data:']],
    'statistics': [NAMES, ['Mean', '1.0', '2.0', '3.0'], ['Max', '4.0', '5.0', '6.0']]}


@pytest.mark.parametrize('head', HEADS)
@pytest.mark.parametrize('gaps', [(), ((3, 1), (4, 1), (7, 3))])
def test_data_begin_below_the_head_whatever_it_says(head, gaps):
    """As many columns as the rows have, with blank cells among them or not."""
    grid = [*HEADS[head], *data(gaps=gaps)]
    assert find_data(grid) == (len(HEADS[head]), 4)


@pytest.mark.parametrize('first', [['0.01', '2'], ['0.01', '2', '3', '4']])
def test_what_stands_at_the_end_of_a_file_does_not_tell_what_its_first_row_is(first):
    """'end:' below the last row closes no setting above the first."""
    grid = [first, ['data:'], *data()]
    assert find_data([*grid, ['end:']]) == find_data(grid)


@pytest.mark.parametrize(('head', 'row', 'width'), [
    ([NAMES], ['9', '9', '9', '9', '9'], 4), ([[*NAMES, 'note']], ['9', '9', '9', '9', '9'], 5),
    ([NAMES], ['9', '9', '9'], 4)])
def test_a_longer_row_is_a_column_more_only_where_it_has_a_name(head, row, width):
    """One cell too many is a slip otherwise; one too few takes no column away."""
    rows = data()
    rows.insert(8, row)
    assert find_data([*head, *rows]) == (1, width)


def test_rows_of_one_number_are_data_where_there_are_no_others():
    """Not without any; decimals may be written with a comma."""
    assert find_data([['a', 'b'], ['x', 'y']]) == (-1, 0)
    assert find_data([NAMES, *([cell.replace('.', ',') for cell in row] for row in data())],
                     ',') == (1, 4)


def test_names_and_units_are_the_rows_that_fit_the_columns():
    """The last that is known, also where words or levels of a setting lie between."""
    for head, last in (([NAMES], 0), ([NAMES, UNITS], 1), ([['a test'], NAMES, UNITS], 2),
                       ([UNITS, NAMES], 1), ([NAMES, [f'[{unit}]' for unit in UNITS]], 1)):
        names, units, used = find_names(head, 4)
        assert names == NAMES
        assert units == (dict(zip(NAMES, UNITS)) if len(head) > 1 else {})
        assert used == last
    assert find_names([], 3) == (['column 1', 'column 2', 'column 3'], {}, -1)
    assert find_names([['10', '20', '30']], 3)[2] == -1
    assert find_names([['time', '', 'force']], 3)[0] == ['time', 'column 2', 'force']
    # pandas writes the name of an index below those of the columns
    assert find_names([['', 'strain', 'force'], ['time', '', '']], 3)[0] == [
        'time', 'strain', 'force']


@pytest.mark.parametrize(('cell', 'decimal', 'number'), [
    ('12', '.', True), ('-1.5e-3', '.', True), ('+.5', '.', True), ('1,234.5', '.', True),
    ('1.5D+02', '.', True), ('1,5', '.', False), ('1,5', ',', True), ('1.234,5', ',', True),
    ('1.5', ',', False), ('1 2', '.', False), ('', '.', False), ('e5', '.', False),
    ('12 N', '.', False), ('1,23.5', '.', False)])
def test_a_number_has_the_sign_of_its_decimals(cell, decimal, number):
    """The other sign separates thousands."""
    assert is_number(cell, decimal) == number
    assert is_number(f' {cell} ', decimal) == number


def test_cells_are_readings_blanks_statistics_or_have_a_unit():
    """Dates and times are readings too; what instruments write beyond their range is blank."""
    for cell in ('1.5', '2026-05-03', '3.5.2026 10:00', '10:15:42,123', '0 days 00:00:01',
                 '12.5 mm', '20260503T101542'):
        assert is_reading(cell), cell
    for cell in ('run 2', 'force', '', 'n/a', '12 apples'):
        assert not is_reading(cell), cell
    for cell in ('', ' - ', 'NaN', '#DIV/0!', 'OVLD', 'Out of Range'):
        assert is_blank(cell), cell
    assert not is_blank('0')
    assert [is_statistic(cell) for cell in ('Mean', 'Max.', 'Std Dev', 'Mittelwert', 'force')] == [
        True, True, True, True, False]
    assert with_unit('3 bar') == ('3', 'bar')
    assert with_unit('-1,5 mm', ',') == ('-1,5', 'mm')
    assert with_unit('5 %') == ('5', '%')
    for cell in ('run 2', '3', '3 apples', 'bar 3'):
        assert with_unit(cell) is None


def test_a_sign_groups_thousands_only_in_front_of_three_digits():
    """And where a number of three digits stands without it."""
    assert in_groups(['950', '1,013', '12,001,500'], ',')
    assert not in_groups(['1,013', '2,001'], ',')
    assert not in_groups(['950', '1,01'], ',')
    assert not in_groups(['950', '0,950'], ',')
    assert not in_groups(['950', '960'], ',')
    assert in_groups(['-950', '+1.013'], '.')


def test_rows_with_bad_cells_are_data_and_labels_are_not():
    """From the first sound row upwards, up to a row that begins with a word."""
    assert trimmed(['a', '', 'b', ' ', '']) == ['a', '', 'b']
    assert is_row(['1', 'bad', '3'], 3)
    assert is_row(['', '2', '3'], 3)
    assert is_row(['1', '2'], 3)
    assert not is_row(['1'], 3)
    assert not is_row(['offset', '2', '3'], 3)
    assert not is_row(['', 'x', 'y'], 3)
    rows = [['time', 'F', 'p'], ['1', 'x', '3'], ['offset', '1', '2'], ['2', 'x', '3'],
            ['3', 'y', '3']]
    assert with_bad_cells(rows, 3) == 2
    assert with_bad_cells(rows[:1], 3) == 0


def test_a_row_may_name_columns_or_be_their_units():
    """A word for each but the first; most of the cells of a row of units are units."""
    assert may_name(NAMES, 4)
    assert may_name(['', 'a', 'b', 'c'], 4)
    assert not may_name(['a', '', 'b', 'c'], 4)
    assert not may_name(NAMES, 5)
    assert not may_name(['a', '1', 'b', 'c'], 4)
    assert not may_name(UNITS, 4)
    assert are_units(UNITS)
    assert are_units(['[s]', '(mV)', '', 'rpm'])
    assert not are_units(NAMES)
    assert not are_units(['K', 'W'])
    assert not are_units(['s', 'wood', 'glue'])


def test_names_of_columns_after_one_of_row_names_are_moved_to_the_right():
    """Where the first counts the rows or is text, and the last has no name."""
    rows = [['1', '5', '8'], ['2', '5', '9']]
    assert moved_right(['p', 'F', 'column 3'], rows) == ['column 1', 'p', 'F']
    assert moved_right(['p', 'F', 'column 3'], [['a', '5', '8'], ['b', '5', '9']])[1:] == [
        'p', 'F']
    for names, others in ((['p', 'F', 'x'], rows), (['column 1', 'F', 'column 3'], rows),
                          (['p', 'F', 'column 3'], [['1', '5', '8'], ['3', '5', '9']]),
                          (['p', 'F', 'column 3'], [['1', '5', ''], ['2', '5', '']]),
                          (['p', 'F', 'column 3'], rows[:1])):
        assert moved_right(names, others) == names
    assert counts_rows([['4'], ['5'], ['6']])
    assert not counts_rows([['4'], ['6']])
    assert not counts_rows([['4'], ['x']])


def test_in_a_head_of_pairs_names_are_cells_that_differ_and_are_no_numbers():
    """Units repeat and sample times are numbers, though both stand above as names do."""
    head = [['Unit', 'N', 'Unit', 'N'], ['Name', 'Kanal 1', 'Name', 'Kanal 2'],
            ['SampleTime[ms]', '1', 'SampleTime[ms]', '2']]
    assert find_names(head, 4) == (['time', 'Kanal 1', 'time', 'Kanal 2'],
                                   {'Kanal 1': 'N', 'Kanal 2': 'N', 'time': 'ms'}, 2)


def test_a_row_of_factors_is_told(tmp_path, log):
    """It was passed over as a line of the head, and the force was a hundred times too large."""
    rows = ''.join(f'{t:.3f},{e:.5f},{p:.1f},{100 * f:.3f}\n' for t, e, p, f in zip(*log))
    path = tmp_path / 'log.csv'
    path.write_text('time [s],strain,p [Pa],F [N]\nscale,1,1,0.01\n' + rows)
    note, = read_measurement(path).notes
    assert note.startswith("above the rows stands 'scale,1,1,0.01': the readings are taken as")


@pytest.mark.parametrize('comma', [(0, 1), (1, 3), (0, 3)])
def test_columns_with_a_decimal_sign_of_their_own(tmp_path, log, comma):
    """'0,123' groups no thousands: a force of 14,647 N beside points was one of 14 kN."""
    rows = ''
    for row in zip(log[0], log[1], log[2] / 1e6, log[3] / 20):
        rows += ';'.join(f'{cell:.3f}'.replace('.', ',' if at in comma else '.')
                         for at, cell in enumerate(row)) + '\n'
    path = tmp_path / 'log.csv'
    path.write_text('t [s];strain;p [MPa];F [N]\n' + rows)
    data = read_measurement(path)
    assert len(data) == len(log[0])
    assert np.allclose(data.time, log[0], atol=1e-3)
    assert np.allclose(data.strain, log[1], atol=1e-3)
    assert np.allclose(data.force, log[3] / 20, atol=1e-3)


def test_commas_that_may_be_of_decimals_are_asked(tmp_path, log):
    """'3,556' in all rows of the only column with commas: a note says how it was read."""
    path = tmp_path / 'log.csv'
    for force, notes in ((log[3] / 20, 1), (log[3] / 300, 0)):
        path.write_text('t [s];strain;p [Pa];F [mN]\n' + ''.join(
            f'{t:.3f};{e:.3f};{p:.1f};' + f'{f:.3f}\n'.replace('.', ',')
            for t, e, p, f in zip(*log[:3], force)))
        data = read_measurement(path)
        assert sum("comma in all cells of 'F [mN]'" in note for note in data.notes) == notes


def test_joined_files_with_marks_of_their_own(tmp_path, log):
    """A byte order mark before the second header made it another header."""
    rows = 't [s],strain,p [Pa],F [N]\n' + ''.join(
        f'{t:.3f},{e:.5f},{p:.1f},{f:.4f}\n' for t, e, p, f in zip(*log))
    path = tmp_path / 'log.csv'
    path.write_text(f'\ufeff{rows}\ufeff{rows}', encoding='utf-8')
    data = read_measurement(path)
    assert len(data) == 2 * len(log[0])
    assert len(data.trial_names) == 2


def test_heads_of_blocks_that_are_wider_than_the_table(tmp_path, log):
    """A line of settings with a time in it stood for a row of too many cells."""
    text = 'MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nTest File Name:\tfam.000\n'
    for block in range(2):
        text += (f'Data Header:\tCycle {block + 1}\tTime:\t{6.0 * block:.4f}\tSec\t'
                 '11/28/2026 10:20:00 AM\nRunning Time\tStrain\tAxial Force\tMuscle Pressure\n'
                 'Sec\t%\tN\tPa\n')
        text += ''.join(f'{t:.3f}\t{100 * e:.4f}\t{f:.4f}\t{p:.1f}\n' for t, e, p, f in zip(
            *(each[120 * block:120 * (block + 1)] for each in log)))
    path = tmp_path / 'log.dat'
    path.write_text(text)
    data = read_measurement(path)
    assert len(data) == len(log[0])
    assert np.allclose(data.force, log[3], atol=1e-3)
