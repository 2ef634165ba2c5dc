# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""One and the same log, saved in the ways in which labs save logs, gives the same numbers."""

import hashlib
import json

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, Recipe, taken_words
from fam_bundle_ros.errors import InputError

from .instrument_forms import INSTRUMENTS
from .library_forms import (
    by_h5py,
    by_nptdms_runs,
    by_openpyxl,
    by_savemat_trials,
    frame,
    LIBRARIES,
)
from .text_forms import BEGIN, cells, HEAD, lvm, REST, ROWS, same, text, TEXTS, the_log

pandas = pytest.importorskip('pandas')


@pytest.fixture(scope='module')
def log(muscle):
    """Return `the_log`."""
    return the_log(muscle)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('form', TEXTS | INSTRUMENTS)
def test_a_log_written_as_labs_write_text_reads_the_same(form, log, tmp_path):
    """Separators, commas, preambles, units, encodings, clocks: the same numbers."""
    content = (TEXTS | INSTRUMENTS)[form](log)
    content, options = content if isinstance(content, tuple) else (content, {})
    path = tmp_path / ('log.lvm' if '.lvm' in form else 'log.jsonl' if 'JSON' in form else
                       'log.csv')
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    data = read_measurement(path, rest_length=REST, **options)
    same(data, log)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('library', LIBRARIES)
def test_a_log_written_by_a_formats_own_library_reads_the_same(library, log, tmp_path):
    """What pandas, openpyxl, npTDMS, scipy, h5py, pyarrow, NumPy and rosbags write is read."""
    pytest.importorskip({'openpyxl': 'openpyxl', 'pandas.to_excel': 'openpyxl', 'h5py': 'h5py',
                         'rosbags': 'rosbags'}.get(library, 'pandas'))
    if 'TDMS' in library:
        pytest.importorskip('nptdms')
    if any(word in library for word in ('arrow', 'parquet', 'feather')):
        pytest.importorskip('pyarrow')
    name, write = LIBRARIES[library]
    values = dict(log)
    write(values, tmp_path / name)
    options = {}
    if library == 'numpy.savez':
        options = {'columns': {'pressure': 'pressure [Pa]'}}
    if library == 'scipy.io.savemat':
        options = {'columns': {'force': 'F [N]'}}
    data = read_measurement(tmp_path / name, rest_length=REST, **options)
    same(data, log)


#: First bytes of what is no log, or a damaged one.
HOSTILE = {
    'empty': b'', 'zip': b'PK\x03\x04' + b'x' * 500, 'picture': b'\x89PNG\r\n\x1a\n' + bytes(50),
    'random': np.random.default_rng(0).bytes(5000), 'zeros': b'time [s],strain\n' + bytes(999),
    'every byte': bytes(range(1, 256)) * 20, 'tdms': b'TDSm' + b'x' * 200,
    'mat': b'MATLAB 5.0 MAT-file'.ljust(124) + b'\x00\x01IM' + b'x' * 300,
    'hdf': b'\x89HDF\r\n\x1a\n' + b'x' * 300, 'parquet': b'PAR1' + b'x' * 200,
    'npy': b'\x93NUMPY\x01\0' + b'x' * 50, 'xls': b'\xd0\xcf\x11\xe0' + bytes(100),
    'lvm': b'LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\n',
    'words': b'hello world\n' * 20, 'page': b'<html><table></table>', 'gzip': b'\x1f\x8b\x08\0',
    'pickle': b'\x80\x04\x95' + b'x' * 50, 'commas': b',,,,\n' * 50, 'blank': b'\r\n' * 500,
    'one column': b''.join(b'%d\n' % k for k in range(500)), 'one number': b'7',
    'header': HEAD.encode(), 'long line': b'1,2,3,4,' * 50_000, 'mark alone': b'\xff\xfe',
    'mark of UTF-16 before ASCII': b'\xff\xfe' + b'1,2\n' * 500,
    'bag': b'\x89MCAP0\r\n' + b'x' * 50,
}


@pytest.mark.parametrize('kind', HOSTILE)
def test_what_is_no_log_fails_in_one_line(kind, tmp_path, capfd):
    """Binary, damaged, empty, one column: a line that names the file, and nothing else printed."""
    path = tmp_path / 'thing.csv'
    path.write_bytes(HOSTILE[kind])
    with pytest.raises(InputError, match='thing.csv') as caught:
        read_measurement(path)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 250
    assert capfd.readouterr() == ('', '')


@pytest.mark.parametrize('kind', ['random', 'zeros', 'every byte', 'picture'])
def test_binary_files_are_called_so(kind, tmp_path):
    """Binary content is not read as text, whatever the suffix."""
    (tmp_path / 'a.csv').write_bytes(HOSTILE[kind])
    with pytest.raises(InputError, match='not a text file'):
        read_measurement(tmp_path / 'a.csv')


def test_a_text_that_turns_binary_far_down_fails(log, tmp_path):
    """A log whose disk was full ends in zeros: not a text file, and not half a log."""
    rows = text([HEAD], cells(log) * 2).encode()
    (tmp_path / 'a.csv').write_bytes(rows + bytes(4096))
    with pytest.raises(InputError, match=f'not a text file from row {rows.count(10) + 1} on'):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


def test_the_minus_sign_of_typesetting_is_a_minus(log, tmp_path):
    """As a spreadsheet or a text processor writes it, with a decimal comma too."""
    shifted = {**log, 'force': log['force'] - 20.0}
    rows = text([HEAD], cells(shifted)).replace('-', '\u2212')
    assert '\u2212' in rows
    (tmp_path / 'a.csv').write_text(rows, encoding='utf-8')
    same(read_measurement(tmp_path / 'a.csv', rest_length=REST), shifted)


@pytest.mark.parametrize('words', [
    'stopped by operator\t1\t2\t3\t4\t5\t6', 'Test ended', '1.2s\t3.0\t4.0\t5.0'])
def test_words_between_the_rows_of_an_lvm_file_are_told_with_their_line(words, log, tmp_path):
    """A footer of one run, or a damaged time: one sentence, not the traceback of a library."""
    lines = lvm(log, 'One').splitlines()
    lines.insert(60, words)
    (tmp_path / 'a.lvm').write_text('\n'.join(lines))
    with pytest.raises(InputError, match=f"a.lvm, line 61: '{words}'; expected numbers"):
        read_measurement(tmp_path / 'a.lvm', rest_length=REST)


def test_a_measurement_knows_the_digest_of_its_file(log, tmp_path):
    """What a report says was read can be checked."""
    (tmp_path / 'a.csv').write_text(text([HEAD], cells(log)))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert data.sha256 == hashlib.sha256((tmp_path / 'a.csv').read_bytes()).hexdigest()


@pytest.mark.parametrize('content', ['[]', '{}', '[{}]'])
def test_json_without_columns_fails(content, tmp_path):
    """The error is one sentence, not a traceback."""
    (tmp_path / 'a.json').write_text(content)
    with pytest.raises(InputError, match='a.json: no columns'):
        read_measurement(tmp_path / 'a.json')


def test_a_json_line_of_settings_tells_the_rest_length_and_is_no_sample(log, tmp_path):
    """Its fields are no columns, and rows count from it."""
    records = [{'rest_length_mm': 1e3 * REST}, *(
        {'t': t, 'L_mm': 1e3 * REST * (1 - e), 'p_kPa': p / 1e3, 'F_N': f}
        for t, e, p, f in zip(log['time'], log['strain'], log['pressure'], log['force']))]
    (tmp_path / 'a.jsonl').write_text('\n'.join(map(json.dumps, records)))
    data = read_measurement(tmp_path / 'a.jsonl')
    same(data, log)
    assert 'not used' not in taken_words(data)
    records[8]['F_N'] = 'jammed'
    (tmp_path / 'a.jsonl').write_text('\n'.join(map(json.dumps, records)))
    with pytest.raises(InputError, match="row 9: F_N is 'jammed'"):
        read_measurement(tmp_path / 'a.jsonl')


@pytest.mark.parametrize(('size', 'kind'), [(10, 'lists'), (40, 'lists'), (10, 'one time'),
                                            (10, 'records')])
def test_packets_of_several_samples_are_read_one_by_one(log, tmp_path, size, kind):
    """Lists of equal length in a record are no sensors whose forces add up."""
    names = {'time': 't', 'strain': 'strain', 'pressure': 'p_Pa', 'force': 'F_N'}
    lines = []
    for begin in range(0, ROWS, size):
        packet = {'id': begin, **{names[key]: log[key][begin:begin + size].tolist()
                                  for key in names}}
        if kind != 'lists':
            packet['t'] = packet['t'][0]
        if kind == 'records':
            lists = {key: packet.pop(key) for key in ('strain', 'p_Pa', 'F_N')}
            packet['samples'] = [dict(zip(lists, cells)) for cells in zip(*lists.values())]
        lines.append(json.dumps(packet))
    (tmp_path / 'a.jsonl').write_text('\n'.join(lines))
    read = read_measurement(tmp_path / 'a.jsonl')
    assert np.allclose([read.strain, read.pressure[:, 0], read.force],
                       [log['strain'], log['pressure'], log['force']])
    assert np.allclose(np.diff(read.time), np.diff(log['time']))


def test_lists_of_sensors_in_a_record_are_one_sample(log, tmp_path):
    """Two pressures and two load cells: the forces are asked for, or their sum."""
    lines = [json.dumps({'t': t, 'strain': e, 'pressure_Pa': [p, p / 2],
                         'force_N': [f / 2, f / 2], 'valves': [{'open': 1}, {'open': 0}]})
             for t, e, p, f in zip(*(log[key].tolist() for key in (
                 'time', 'strain', 'pressure', 'force')))]
    (tmp_path / 'a.jsonl').write_text('\n'.join(lines))
    with pytest.raises(InputError, match=r'their sum, "force=force_N.0 \+ force_N.1"'):
        read_measurement(tmp_path / 'a.jsonl')


def test_json_that_nests_without_end_fails(tmp_path):
    """Brackets nested 100000 deep are refused."""
    path = tmp_path / 'deep.json'
    path.write_text('[' * 100_000)
    with pytest.raises(InputError, match='deep.json'):
        read_measurement(path)


def test_a_workbook_that_unpacks_to_gigabytes_fails(tmp_path, monkeypatch):
    """The size is known before anything is unpacked."""
    from fam_bundle_ros.data.formats import workbook
    pytest.importorskip('openpyxl')
    path = tmp_path / 'bomb.xlsx'
    pandas.DataFrame({'a': range(100)}).to_excel(path)
    monkeypatch.setattr(workbook, 'MAX_BYTES', 100)
    with pytest.raises(InputError, match='when unpacked'):
        read_measurement(path)


def test_sheets_are_chosen_by_name_or_by_what_they_hold(log, tmp_path):
    """Those with most known columns; runs are trials; a wrong name lists what there is."""
    pytest.importorskip('openpyxl')
    path = tmp_path / 'runs.xlsx'
    with pandas.ExcelWriter(path) as writer:
        pandas.DataFrame({'gain': range(30), 'channel': range(30)}).to_excel(
            writer, sheet_name='Info')
        frame(log).to_excel(writer, sheet_name='Run 1')
        frame(log)[::2].to_excel(writer, sheet_name='Run 2')
    data = read_measurement(path, rest_length=REST)
    assert data.trial_names == ('Run 1', 'Run 2')
    assert np.bincount(data.trial).tolist() == [ROWS, ROWS // 2]
    assert any('Run 1, Run 2' in note for note in data.notes)
    assert len(read_measurement(path, rest_length=REST, sheet='Run 2')) == ROWS // 2
    with pytest.raises(InputError, match='Info, Run 1, Run 2'):
        read_measurement(path, sheet='Run 3')


def test_a_second_sheet_of_another_name_is_told_and_not_read(log, tmp_path):
    """'raw' and 'filtered' may be one log twice."""
    pytest.importorskip('openpyxl')
    path = tmp_path / 'twice.xlsx'
    with pandas.ExcelWriter(path) as writer:
        frame(log).to_excel(writer, sheet_name='raw')
        frame(log).to_excel(writer, sheet_name='filtered')
    data = read_measurement(path, rest_length=REST)
    assert len(data) == ROWS
    assert 'not read: sheet filtered (tell the sheet)' in data.notes


def test_rows_and_columns_of_a_sheet_are_those_that_excel_shows(log, tmp_path):
    """A margin is no column, and an error names the row beside which Excel writes it."""
    import openpyxl
    by_openpyxl(log, tmp_path / 'a.xlsx')
    data = read_measurement(tmp_path / 'a.xlsx', rest_length=REST)
    assert [taken.header for taken in data.taken] == ['Zeit', 'L\u00e4nge', 'Druck', 'Kraft']
    book = openpyxl.load_workbook(tmp_path / 'a.xlsx')
    book['Messung']['E50'] = 'high'
    book.save(tmp_path / 'b.xlsx')
    with pytest.raises(InputError, match="row 50: Kraft is 'high'"):
        read_measurement(tmp_path / 'b.xlsx', rest_length=REST)


def test_texts_with_three_decimals_are_no_thousands(log, tmp_path):
    """'0,050' beside numbers of Excel's own: a decimal comma."""
    table = frame(log)
    first = table.columns[0]
    table[first] = [f'{value:.3f}'.replace('.', ',') for value in log['time']]
    table.to_excel(tmp_path / 'a.xlsx', index=False)
    data = read_measurement(tmp_path / 'a.xlsx', rest_length=REST)
    np.testing.assert_allclose(data.time, log['time'], atol=5e-4)


def test_groups_of_a_tdms_file_are_trials(log, tmp_path):
    """Runs that a program wrote as groups are told apart by their names."""
    pytest.importorskip('nptdms')
    by_nptdms_runs(log, tmp_path / 'a.tdms')
    data = read_measurement(tmp_path / 'a.tdms', rest_length=REST)
    assert data.trial_names == ('Run 1', 'Run 2')
    assert np.array_equal(np.bincount(data.trial), [200, 160])


def test_structs_of_a_mat_file_with_vectors_are_trials(log, tmp_path):
    """Each struct of an array is a run of its own."""
    by_savemat_trials(log, tmp_path / 'a.mat')
    data = read_measurement(tmp_path / 'a.mat', rest_length=REST)
    assert data.trial_names == ('1', '2', '3')
    assert np.array_equal(np.bincount(data.trial), [120, 120, 120])


def test_an_lvm_file_is_read_at_the_clock_of_its_slowest_channel(log, tmp_path):
    """With a clock for each channel, of which the pressure is at half the rate."""
    plain = lvm(log, 'Multi').splitlines()
    head, rows = plain[:-ROWS], [line.split('\t') for line in plain[-ROWS:]]
    slow = [row[2:4] for row in rows[::2]] + [['', '']] * (ROWS // 2)
    body = ['\t'.join([*row[:2], *own, *row[4:]]) for row, own in zip(rows, slow)]
    (tmp_path / 'a.lvm').write_text('\r\n'.join([*head, *body]))
    data = read_measurement(tmp_path / 'a.lvm', rest_length=REST)
    assert np.allclose(data.time, log['time'][::2])
    assert np.allclose(data.pressure[:, 0], log['pressure'][::2])
    assert np.allclose(data.force, log['force'][::2])


def test_an_index_of_times_is_the_time_of_a_frame(log):
    """A pandas frame by its DatetimeIndex reads like one with a column."""
    data = frame(log).drop(columns='time [s]')
    data.index = pandas.Timestamp(BEGIN) + pandas.to_timedelta(log['time'], unit='s')
    same(read_measurement(data, rest_length=REST), log)


def test_a_tdms_file_is_read_at_the_clock_of_its_slowest_channel(log, tmp_path):
    """A pressure logged at half the rate."""
    nptdms = pytest.importorskip('nptdms')
    data = frame(log)
    with nptdms.TdmsWriter(str(tmp_path / 'a.tdms')) as writer:
        writer.write_segment([
            nptdms.ChannelObject('Log', name, data[name].to_numpy()[::every],
                                 {'wf_increment': 0.05 * every})
            for name, every in (('L [mm]', 1), ('pressure [bar]', 2), ('force [N]', 1))])
    again = read_measurement(tmp_path / 'a.tdms', rest_length=REST)
    assert np.allclose(again.time, log['time'][::2])
    assert np.allclose(again.pressure[:, 0], log['pressure'][::2])
    assert np.allclose(again.force, log['force'][::2])
    assert any("read at the 180 of 'pressure [bar]', the slowest" in note for note in again.notes)


@pytest.mark.parametrize('kind', ['csv', 'xlsx'])
@pytest.mark.parametrize('line', ['L0 [mm];250,0', 'L0;250;mm', 'Ruhel\u00e4nge: 25 cm',
                                  'Rest length = 250 mm', 'resting length of the muscle: 250 mm',
                                  'L\u00e4nge ungedehnt: 25,0 cm'])
def test_a_rest_length_above_the_table_is_heard(log, tmp_path, line, kind):
    """It is used if the user tells none; else that of the user is used and the other noted."""
    path = tmp_path / f'a.{kind}'
    body = text([line, HEAD.replace(',', ';')], cells(log, ','), ';')
    if kind == 'csv':
        path.write_text(body)
    else:
        import openpyxl
        book = openpyxl.Workbook()
        for row in body.splitlines():
            book.active.append(row.split(';'))
        book.save(path)
    same(read_measurement(path), log)
    read = read_measurement(path, recipe=Recipe(muscle_length=0.251))
    same(read, log)
    assert any('250 mm, as the file says; the model has 251 mm' in note for note in read.notes)
    told = read_measurement(path, rest_length='240 mm')
    assert np.allclose(told.strain, log['strain'] * 250 / 240, atol=1e-5)
    assert any('rest length of 240 mm; the file says 250 mm' in note for note in told.notes)


def test_a_missing_library_is_named_with_its_extra(log, tmp_path, monkeypatch):
    """Without h5py a .mat of version 7.3 cannot be read: the message says what to install."""
    import sys
    by_h5py(log, tmp_path / 'a.mat')
    monkeypatch.setitem(sys.modules, 'h5py', None)
    with pytest.raises(InputError, match='h5py; install the extra `files`'):
        read_measurement(tmp_path / 'a.mat', rest_length=REST)


def test_a_mat_file_without_vectors_fails(tmp_path):
    """Text alone is no log: the message says what was expected."""
    from scipy.io import savemat
    savemat(tmp_path / 'a.mat', {'operator': 'KM'})
    with pytest.raises(InputError, match='expected arrays of equal length'):
        read_measurement(tmp_path / 'a.mat')


def test_a_row_of_electrical_units_is_no_header(tmp_path, log):
    """'s,V,V,V' below the names, as cards for analog inputs write."""
    path = tmp_path / 'volts.csv'
    path.write_text('\n'.join(['Time,AI0,AI1,AI2', 's,V,V,V', *(
        f'{t:.3f},{p / 1e5:.6f},{f / 50:.6f},{e * 10:.7f}' for t, p, f, e in zip(
            log['time'], log['pressure'], log['force'], log['strain']))]))
    same(read_measurement(path, columns={'pressure': 'AI0 * 1 bar', 'force': 'AI1 * 50 N/V',
                                         'strain': 'AI2 * 10 %'}), log)


@pytest.mark.parametrize('names', [('Time', 'Data'), ('time', 'values'), ('t', 'y')])
def test_structs_of_times_and_readings_are_channels(names, tmp_path, log):
    """Simulink's timeseries, with or without units beside them, saved by MATLAB."""
    savemat = pytest.importorskip('scipy.io').savemat
    channels = {'contraction': (1e3 * 0.25 * log['strain'], 'mm'),
                'pressure': (log['pressure'] / 1e5, 'bar'), 'force': (log['force'], 'N')}
    structs = {key: {names[0]: log['time'], names[1]: values, 'DataInfo': {'Units': unit}}
               for key, (values, unit) in channels.items()}
    savemat(tmp_path / 'log.mat', structs)
    data = read_measurement(tmp_path / 'log.mat', rest_length='250 mm')
    same(data, log)
    assert 'guessed' not in taken_words(data)


def test_matrices_with_a_column_for_each_trial_are_trials(log, tmp_path):
    """One force has several columns: trials; the clock is one for all."""
    data = frame(log)
    runs = {name: data[header].to_numpy().reshape(3, ROWS // 3) for name, header in (
        ('L_mm', 'L [mm]'), ('p_bar', 'pressure [bar]'), ('F_N', 'force [N]'))}
    np.savez(tmp_path / 'a.npz', t_s=log['time'][:ROWS // 3], **runs)
    read = read_measurement(tmp_path / 'a.npz', rest_length=REST)
    assert np.bincount(read.trial).tolist() == [ROWS // 3] * 3
    assert np.allclose(read.force, log['force'])
    assert np.allclose(read.strain, log['strain'])


def test_a_rest_length_beside_the_arrays_is_the_file_s(log, tmp_path):
    """A field L0_mm: taken where none is told, and said where another is."""
    (tmp_path / 'a.json').write_text(json.dumps(
        {'L0_mm': 1e3 * REST, 'rig': 3, 'log': {'t_s': log['time'].tolist(), 'contraction_mm': (
            1e3 * REST * log['strain']).tolist(), 'p_kPa': (log['pressure'] / 1e3).tolist(),
            'F_N': log['force'].tolist()}}))
    same(read_measurement(tmp_path / 'a.json'), log)
    notes = read_measurement(tmp_path / 'a.json', rest_length=0.2).notes
    assert any('the file says 250 mm' in note for note in notes)


def test_a_sheet_for_each_sensor_is_a_part_of_one_recording(log, tmp_path):
    """Each with a clock; without one of them, the message names the sheets that were not read."""
    pytest.importorskip('openpyxl')
    path, clock, *sensors = tmp_path / 'a.xlsx', *frame(log).columns
    for count in (3, 2):
        with pandas.ExcelWriter(path) as book:
            for name in sensors[-count:]:
                frame(log)[[clock, name]].to_excel(book, sheet_name=name[0], index=False)
        if count == 3:
            same(read_measurement(path, rest_length=REST), log)
    with pytest.raises(InputError, match="'strain' is missing.*; not read: sheet .*; expect"):
        read_measurement(path)


def test_a_sheet_of_results_does_not_stand_for_the_log(log, tmp_path):
    """It has a column more, and fewer rows: the log is read and the other named."""
    pytest.importorskip('openpyxl')
    data = frame(log)
    with pandas.ExcelWriter(tmp_path / 'a.xlsx') as book:
        data[::20].assign(Test=range(len(data[::20]))).to_excel(book, sheet_name='Summary',
                                                                index=False)
        data.to_excel(book, sheet_name='Raw', index=False)
    read = read_measurement(tmp_path / 'a.xlsx', rest_length=REST)
    same(read, log)
    assert read.notes == ('not read: sheet Summary (tell the sheet)',)


def test_a_cover_sheet_and_a_head_of_merged_cells_are_heard(log, tmp_path):
    """The rest length on the cover; a name above its unit, beside names that have theirs."""
    import openpyxl
    book = openpyxl.Workbook()
    book.active.append(['Ruhel\u00e4nge', 250, 'mm'])
    sheet = book.create_sheet('Messdaten')
    for row in (['Zeit', 'Messwerte'], ['[s]', *HEAD.split(',')[1:]], *(
            [float(cell) for cell in row] for row in cells(log))):
        sheet.append(row)
    sheet.merge_cells('B1:D1')
    book.save(tmp_path / 'a.xlsx')
    data = read_measurement(tmp_path / 'a.xlsx')
    same(data, log)
    assert data.time is not None


@pytest.mark.parametrize(('separator', 'odd', 'decimal'), [(';', ',', '.'), (';', '.', ',')])
def test_a_column_may_have_another_sign_before_decimals_than_the_others(
        log, tmp_path, separator, odd, decimal):
    """Taken for a sign of groups, 12,5 N would be read as 125 N without a word."""
    rows = [[*(cell.replace('.', decimal) for cell in row[:3]),
             f'{float(row[3]):.2f}'.replace('.', odd)] for row in cells(log)]
    (tmp_path / 'a.csv').write_text(text([HEAD.replace(',', separator)], rows, separator))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert np.allclose(data.force, log['force'], atol=0.006)


def test_text_in_a_sheet_may_group_thousands_by_points(log, tmp_path):
    """Cells that a German program wrote as text: '1.013,25'."""
    import openpyxl
    book = openpyxl.Workbook()
    book.active.append(HEAD.replace('force [N]', 'force [mN]').split(','))
    for row in cells(log, ','):
        force = f'{1e3 * float(row[3].replace(",", ".")):,.1f}'
        book.active.append([*row[:3], force.translate(str.maketrans(',.', '.,'))])
    book.save(tmp_path / 'a.xlsx')
    same(read_measurement(tmp_path / 'a.xlsx', rest_length=REST), log)
