# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Cells, rows and heads in a log that are no readings: left out and counted, or refused."""

from pathlib import Path

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.data.cells import BLANKS
from fam_bundle_ros.errors import InputError

from .library_forms import frame
from .text_forms import cells, HEAD, REST, ROWS, same, text, the_log

pandas = pytest.importorskip('pandas')


@pytest.fixture(scope='module')
def log(muscle):
    """Return `the_log`."""
    return the_log(muscle)


@pytest.mark.parametrize(('spoil', 'dropped'), [
    (lambda rows: [*rows[:9], [rows[9][0], '', *rows[9][2:]], *rows[10:]],
     {'without a number in strain': 1}),
    (lambda rows: [*rows[:9], [rows[9][0], 'nan', *rows[9][2:]], *rows[10:]],
     {'without a number in strain': 1}),
    (lambda rows: [*rows[:9], [*rows[9][:2], '-', '#N/A'], *rows[10:]],
     {'without a number in force': 1}),
    (lambda rows: [*rows[:9], rows[9][:2], *rows[10:]], {'without a number in force': 1}),
    (lambda rows: [*rows[:9], ['--- pause ---'], *rows[9:]], {'without a number in strain': 1}),
    (lambda rows: [*rows[:9], [], *rows[9:]], {})])
def test_gaps_are_left_out_and_counted(log, tmp_path, spoil, dropped):
    """A blank cell, a word for one, a short row, a row of words; blank lines are no rows."""
    (tmp_path / 'a.csv').write_text(text([HEAD], spoil(cells(log))))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert sum(data.dropped.values()) == sum(dropped.values())
    assert data.dropped == dropped


@pytest.mark.parametrize(('row', 'told'), [
    (['E-stop'], "(row 11: 'E-stop')"), (['', '', '', 'E-stop'], "(row 11: 'E-stop')"),
    (['0.18', '', '100.0', '12.0'], '(row 11)')])
@pytest.mark.parametrize('kind', ['csv', 'xlsx'])
def test_a_remark_in_a_row_of_its_own_is_told_with_the_row(log, tmp_path, row, told, kind):
    """In whichever column it stands; numbers beside an empty cell are no remark."""
    rows, path = cells(log), tmp_path / f'a.{kind}'
    rows.insert(9, row)
    if kind == 'csv':
        path.write_text(text([HEAD], rows))
    else:
        import openpyxl
        book = openpyxl.Workbook()
        book.active.append(HEAD.split(','))
        for each in rows:
            book.active.append([float(cell) if cell[:1].isdigit() else cell or None
                                for cell in map(str, each)])
        book.save(path)
    told = f'without a number in strain {told}'
    data = read_measurement(path, rest_length=REST, drop_bad=True)
    assert told in data.dropped_words


@pytest.mark.parametrize(('bad', 'said'), [
    ('0.00,overflow,100.0,12.0', {'without a number in strain': 1}),
    ('0.00,NaN,NaN,NaN', {'without a number in strain': 1}),
    ('0.00,err,100.0,12.0', "row {row}: contraction is 'err'")])
@pytest.mark.parametrize('units', ['', 's,mm,kPa,N\n'])
@pytest.mark.parametrize('kind', ['csv', 'xlsx'])
def test_a_bad_cell_in_the_first_row_is_no_row_of_units(log, tmp_path, bad, said, units, kind):
    """The first reading is lost like any other: counted, or told with its row; never silently."""
    names = 'time,contraction,pressure,force' if units else HEAD.replace(' [mm]', '')
    body = f'{names}\n{units}{bad}\n' + text([], cells(log))
    path = tmp_path / f'a.{kind}'
    if kind == 'csv':
        path.write_text(body)
    else:
        import openpyxl
        book = openpyxl.Workbook()
        for line in body.splitlines():
            book.active.append([float(cell) if cell[0].isdigit() else cell
                                for cell in line.split(',')])
        book.save(path)
    if isinstance(said, str):
        with pytest.raises(InputError, match=said.format(row=3 if units else 2)):
            read_measurement(path, rest_length=REST)
        return
    assert read_measurement(path, rest_length=REST).dropped == said


def test_rows_with_words_are_left_out_where_that_is_told(log, tmp_path):
    """By default the first is an error with its row; told, they are dropped and counted."""
    rows = cells(log)
    rows[7][3], rows[9][0] = 'weak', 'lost'
    (tmp_path / 'a.csv').write_text(text([HEAD], rows))
    with pytest.raises(InputError, match=r"row 9: force \[N\] is 'weak'.*--drop-bad"):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST, drop_bad=True)
    assert data.dropped == {'without a number in force': 1, 'without a number in time': 1}


@pytest.mark.parametrize('kind', ['csv', 'xlsx'])
def test_a_footer_that_begins_with_a_word_is_left_out(log, tmp_path, kind):
    """Means below the data are no readings, and that is said; in the middle a word is an error."""
    data = frame(log).astype(object)
    data.loc[len(data)] = ['mean', 230.0, 2.5, 40.0]
    getattr(data, {'csv': 'to_csv', 'xlsx': 'to_excel'}[kind])(tmp_path / f'a.{kind}', index=False)
    again = read_measurement(tmp_path / f'a.{kind}', rest_length=REST)
    same(again, log)
    assert again.notes == (f"left out from row {ROWS + 2} on: it begins with 'mean'",)
    data.loc[len(data)] = [18.0, 230.0, 2.5, 40.0]
    getattr(data, {'csv': 'to_csv', 'xlsx': 'to_excel'}[kind])(tmp_path / f'b.{kind}', index=False)
    with pytest.raises(InputError, match=f"row {ROWS + 2}: .*is 'mean'"):
        read_measurement(tmp_path / f'b.{kind}', rest_length=REST)


@pytest.mark.parametrize(('head', 'units'), [
    ('time [s],contraction [mm],force [N],pressure [kPa]', ''),
    ('time [s],contraction [mm],pressure [bar],force [N]', ''),
    ('Time,Contraction,Pressure,Force', 's,mm,bar,N'),
    ('Time,Contraction,Pressure,Force', 's,mm,kPa,N')])
def test_a_header_further_down_must_be_the_same(log, tmp_path, head, units):
    """Columns or units that change halfway would be misread: an error with the row of it."""
    first = HEAD if not units else 'Time,Contraction,Pressure,Force\ns,mm,kPa,N'
    rows = cells(log)
    again = [line.split(',') for line in (head, units) if line]
    (tmp_path / 'a.csv').write_text(text([first], [*rows[:120], *again, *rows[120:]]))
    if units == 's,mm,kPa,N':
        same(read_measurement(tmp_path / 'a.csv', rest_length=REST), log)
        return
    with pytest.raises(InputError, match=r'row 12\d: another header') as caught:
        read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert (units or head).replace(',', ', ') in str(caught.value)


@pytest.mark.parametrize('speed', ['Speed,10,mm/min', 'Speed,10', 'Date,03.02.2025,10:00'])
def test_all_rows_above_the_header_again_are_its_head(log, tmp_path, speed):
    """Blocks of a testing machine tell their settings; a word in the last sample is still one."""
    rows = cells(log)
    head = [line.split(',') for line in ('Specimen 2', speed, HEAD)]
    (tmp_path / 'a.csv').write_text(text([HEAD], [*rows[:120], *head, *rows[120:]]))
    same(read_measurement(tmp_path / 'a.csv', rest_length=REST), log)
    rows[119][3] = 'err'
    (tmp_path / 'a.csv').write_text(text([HEAD], [*rows[:120], *head, *rows[120:]]))
    with pytest.raises(InputError, match="row 121: .* is 'err'"):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


@pytest.mark.parametrize('label', ['Run 2', HEAD])
def test_a_short_last_run_below_its_name_is_no_footer(log, tmp_path, label):
    """Runs with their name or header above each restart the clock: all of them are read."""
    rows = cells(log)
    runs = [row for begin in (0, 170, 340) for row in (
        label.split(','), *([f'{float(r[0]) - 0.05 * begin:.3f}', *r[1:]]
                            for r in rows[begin:begin + (170 if begin < 340 else 20)]))]
    (tmp_path / 'a.csv').write_text(text([HEAD], runs))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert np.bincount(data.trial).tolist() == [170, 170, 20]


def test_commas_for_decimals_between_commas_are_told_apart(log, tmp_path):
    """Twice as many cells as names: the message says what to change."""
    (tmp_path / 'a.csv').write_text(text([HEAD], cells(log, ',')))
    with pytest.raises(InputError, match='row 2: 8 cells under 4 names; expected points'):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


def test_a_first_row_with_more_cells_is_not_lost(log, tmp_path):
    """Remarks behind the first readings leave the readings."""
    rows = cells(log)
    rows[0] = [*rows[0], 'valve', 'on']
    (tmp_path / 'a.csv').write_text(text([HEAD], rows))
    same(read_measurement(tmp_path / 'a.csv', rest_length=REST), log)


@pytest.mark.parametrize(('column', 'code'), [(3, '-999'), (3, '9999.00'), (2, '-99.99'),
                                              (1, '-9999'), (3, '9.9E+37'), (3, '999.9999')])
def test_nines_for_no_reading_are_blank_cells(log, tmp_path, column, code):
    """-999 again and again, far from every reading, is what loggers write for none: counted."""
    rows = cells(log)
    for k in (40, 41, 200):
        rows[k][column] = code
    if code == '-99.99':  # bar
        rows = [[*r[:2], r[2] if r[2] == code else f'{float(r[2]) / 100:.4f}', r[3]] for r in rows]
    (tmp_path / 'a.csv').write_text(text(
        [HEAD.replace('kPa', 'bar' if code == '-99.99' else 'kPa')], rows))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert sum(data.dropped.values()) == 3
    assert any(f'hold {float(code):.9g}: taken as no reading' in note for note in data.notes)


def test_an_error_names_the_code_that_was_taken_as_no_reading(log):
    """It may have been a level."""
    pressure = np.where(np.arange(ROWS) < 60, 99.9, 0.1 + 0.1 * (np.arange(ROWS) % 2))
    with pytest.raises(InputError, match=r'only 0.2 kPa.* 60 cells of .* hold 99.9: taken'):
        read_measurement({'t [s]': log['time'], 'eps': log['strain'], 'p [kPa]': pressure,
                          'F [N]': log['force']})


def test_a_code_below_zero_is_found_among_forces_that_are_wide(log):
    """Forces of -60 to 1300 N reach farther than -999 is away, but never skip so far."""
    force = np.linspace(-60.0, 1300.0, ROWS)
    force[[20, 90]] = -999.0
    data = read_measurement({'t [s]': log['time'], 'eps': log['strain'],
                             'p [Pa]': log['pressure'], 'F [N]': force})
    assert len(data) == ROWS - 2


@pytest.mark.parametrize('reading', [-999.0, 99.9, 9.99])
def test_a_reading_of_nines_stays(log, reading):
    """A single 999, or one within the range of the readings, is a reading."""
    force = log['force'].copy()
    force[[20, 21] if reading > 0 else 20] = reading
    data = read_measurement({'t [s]': log['time'], 'eps': log['strain'],
                             'p [Pa]': log['pressure'], 'F [N]': force})
    assert len(data) == ROWS


def test_a_few_readings_out_of_range_are_told_with_their_row_and_no_other_unit(log):
    """The smallest number of 16 bits is no force in mN."""
    force = log['force'].copy()
    force[[31, 90]] = -32768.0
    with pytest.raises(InputError, match=rf'row 32: force is -32768 N; .*\(in 2 of {ROWS} rows:'):
        read_measurement({'t [s]': log['time'], 'eps': log['strain'], 'p [Pa]': log['pressure'],
                          'F [N]': force})


def test_a_length_of_another_muscle_is_told_with_its_row(log):
    """It may be one that was misread."""
    length = 250.0 * (1.0 - log['strain'])
    length[17] = 777.0
    with pytest.raises(InputError, match='row 18: lengths up to 777 mm'):
        read_measurement({'t [s]': log['time'], 'L [mm]': length, 'p [Pa]': log['pressure'],
                          'F [N]': log['force']}, rest_length=REST)


@pytest.mark.parametrize('line', ['1.200,3.1,2001.300,3.2,200,150', '9,"a,b",7,8,9'])
def test_a_row_of_more_cells_than_columns_is_refused_or_left_out(log, tmp_path, line):
    """Two lines that a serial port merged."""
    rows = cells(log)
    (tmp_path / 'a.csv').write_text(text([HEAD], [*rows[:30], [line], *rows[30:]]))
    with pytest.raises(InputError, match=r'a.csv, row 32: \d cells; expected 4 \(--drop-bad lea'):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST, drop_bad=True)
    same(data, log)
    assert '1 row of more cells than columns left out (first row 32)' in data.notes


def test_words_for_no_reading_are_blank_cells(log, tmp_path):
    """What C, Excel and instruments write for no number leaves its row out, in any case."""
    rows = cells(log)
    words = ['-nan(ind)', '1.#QNAN', '#DIV/0!', '#WERT!', 'OVERFLOW', 'OL', 'Over range', 'inf',
             '+OVER', 'O.F.']
    for k, word in enumerate(words):
        rows[10 * k][3] = word
    (tmp_path / 'a.csv').write_text(text([HEAD], rows))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert data.dropped == {'without a number in force': len(words)}


@pytest.mark.parametrize('kind', ['csv', 'txt', 'xlsx'])
@pytest.mark.parametrize(('bad', 'more', 'said'), [
    ('OVERFLOW', {}, "(row 21: 'OVERFLOW')"), ('-', {30: '--'}, "(first row 21: '-')"),
    ('', {30: 'ol'}, '(first row 21)')])
def test_the_first_row_that_is_left_out_is_told_with_what_stands_there(log, tmp_path, kind, bad,
                                                                       more, said):
    """The first such word is shown with its row, as it may be a typing error."""
    rows = cells(log)
    for k, word in {19: bad, **more}.items():
        rows[k][3] = word
    path = tmp_path / f'a.{kind}'
    if kind == 'xlsx':
        import openpyxl
        book = openpyxl.Workbook()
        book.active.append(HEAD.split(','))
        for row in rows:
            book.active.append([float(c) if c[-1:].isdigit() else c for c in row])
        book.save(path)
    else:
        separator = {'csv': ',', 'txt': '\t'}[kind]
        path.write_text(text([HEAD.replace(',', separator)], rows, separator))
    data = read_measurement(path, rest_length=REST)
    assert data.dropped_words == (f'{1 + len(more)} of {len(rows)} rows left out: '
                                  f'{1 + len(more)} without a number in force {said}')


def test_the_page_lists_the_words_for_no_reading(log, tmp_path):
    """The refusal of another word names the page."""
    page = Path(__file__).parents[2] / 'docs/how_to/data.md'
    told = page.read_text()
    assert [word for word in BLANKS if word and f'`{word}`' not in told] == []
    rows = cells(log)
    rows[19][3] = 'hello'
    (tmp_path / 'a.csv').write_text(text([HEAD], rows))
    with pytest.raises(InputError, match="is 'hello'; .*overflow, .*docs/how_to/data.md"):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


def test_a_column_of_an_unknown_name_is_taken_by_its_unit_only_where_it_is_alone(log):
    """One column in N is the force, and that is said; of two, or of a torque, none is."""
    data = {'t [s]': log['time'], 'eps': log['strain'], 'p [Pa]': log['pressure']}
    taken = read_measurement({**data, 'ai3 [N]': log['force']}).taken[-1]
    assert (taken.quantity, taken.why) == ('force', 'by its unit alone')
    for other in ({'ai3 [N]': log['force'], 'ai4 [N]': log['time']}, {'torque [N]': log['force']}):
        with pytest.raises(InputError, match="column 'force' is missing"):
            read_measurement({**data, **other})


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-16', 'latin-1'])
def test_errors_name_the_row_of_the_file_below_preamble_and_comments(log, tmp_path, encoding):
    """The row is that of an editor, whatever stands above or between."""
    rows = cells(log)
    rows[50][3] = 'high'
    lines = ['Versuch \u00dc 7', '', '# rig', HEAD]
    body = text(lines, [*rows[:20], ['# pause'], *rows[20:]])
    (tmp_path / 'a.csv').write_bytes(body.encode(encoding))
    wrong = 1 + body.splitlines().index(','.join(rows[50]))
    with pytest.raises(InputError, match=f"row {wrong}: force .* is 'high'"):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


def test_rows_that_remarks_call_statistics_are_no_samples(log, tmp_path):
    """In a last column, and in a first one without a header, of text and of a workbook."""
    lines = ['time [s],contraction [mm],pressure [kPa],force [N],Remark', *(
        ','.join(row) for row in cells(log))]
    lines += ['24.9,25.0,250.0,60.0,Mean', '49.9,50.0,400.0,160.0,Max']
    path = tmp_path / 'log.csv'
    path.write_text('\n'.join(lines) + '\n')
    same(read_measurement(path, rest_length=REST), log)
    pytest.importorskip('openpyxl')
    rows = [line.split(',') for line in lines]
    book = pandas.DataFrame([[row[4] if k > ROWS else '', *(
        row[:4] if k == 0 else map(float, row[:4]))] for k, row in enumerate(rows)])
    book.to_excel(tmp_path / 'log.xlsx', header=False, index=False)
    data = read_measurement(tmp_path / 'log.xlsx', rest_length=REST)
    same(data, log)
    assert any("begins with 'Mean'" in note for note in data.notes)


def test_a_clock_that_goes_back_for_a_few_rows_is_told(log, tmp_path):
    """Statistics without a label below a blank line: nothing says that they are none."""
    path = tmp_path / 'log.csv'
    path.write_text(text([HEAD], [*cells(log), ['9.0', '25.0', '250.0', '60.0']]))
    data = read_measurement(path, rest_length=REST)
    assert f'the clock goes back at row {ROWS + 2} for 1 row: read as a trial' in data.notes


def test_a_remark_far_down_is_no_cell_too_many(tmp_path):
    """The header names its column; no row of the first hundreds has one."""
    path = tmp_path / 'log.csv'
    path.write_text('time [s],strain,pressure [kPa],force [N],Remark\n' + ''.join(
        f'{0.1 * k:.1f},{0.0002 * k:.4f},200.0,{300 - 0.2 * k:.1f},'
        f'{"valve clicked" if k == 700 else ""}\n' for k in range(900)))
    data = read_measurement(path)
    assert len(data) == 900
    assert data.force[-1] == pytest.approx(120.2)
