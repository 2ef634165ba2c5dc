# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""One and the same log, saved in the ways in which labs save logs, gives the same numbers."""

import csv
from datetime import datetime, timedelta
import hashlib
import json

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

pandas = pytest.importorskip('pandas')

REST = 0.25
ROWS = 360


@pytest.fixture(scope='module')
def log(muscle):
    """Return the log: three sweeps at 100, 250 and 400 kPa, 20 Hz, as SI arrays."""
    time = 0.05 * np.arange(ROWS)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 6.0)
    pressure = np.repeat([100e3, 250e3, 400e3], ROWS // 3)
    force = muscle(strain, pressure) - 3.0 * np.sign(np.gradient(strain))
    return {'time': time, 'strain': strain, 'pressure': pressure, 'force': np.round(force, 3)}


def cells(log, point='.', time=lambda t: f'{t:.3f}', blank=()):
    """Return the rows as text: time, contraction in mm, pressure in kPa, force."""
    rows = []
    for k in range(ROWS):
        row = [time(log['time'][k]), f'{1e3 * REST * log["strain"][k]:.5f}',
               f'{log["pressure"][k] / 1e3:.2f}', f'{log["force"][k]:.3f}']
        rows.append([cell.replace('.', point) for cell in row])
    return rows


def text(head, rows, separator=',', end='\n'):
    """Return a text table."""
    lines = [*head, *(separator.join(row) for row in rows)]
    return end.join(lines) + end


HEAD = 'time [s],contraction [mm],pressure [kPa],force [N]'
BEGIN = datetime(2026, 5, 3, 23, 59, 52)


def iso(t):
    """Return a date and time a little before midnight."""
    return (BEGIN + timedelta(seconds=float(t))).isoformat(timespec='milliseconds')


def day_time(t):
    """Return a time of day that passes midnight."""
    return (BEGIN + timedelta(seconds=float(t))).strftime('%H:%M:%S.%f')[:-3]


def german(t):
    """Return a date as it is written in Germany."""
    return (BEGIN + timedelta(seconds=float(t))).strftime('%d.%m.%Y %H:%M:%S,%f')[:-3]


def with_column(rows, at, values):
    """Return rows with one more column."""
    return [[*row[:at], value, *row[at:]] for row, value in zip(rows, values)]


#: What was written by hand, as programs of labs write it: function of the log to text or bytes.
TEXTS = {
    'plain': lambda log: text([HEAD], cells(log)),
    'strain in percent': lambda log: text(
        ['time [s],strain [%],pressure [kPa],force [N]'],
        [[r[0], f'{float(r[1]) / 2.5:.6f}', *r[2:]] for r in cells(log)]),
    'length': lambda log: text(
        ['t [s];L [mm];p [kPa];F [N]'],
        [[r[0], f'{250.0 - float(r[1]):.5f}', *r[2:]] for r in cells(log)], ';'),
    'length in cm, force in kgf, pressure in psi, time in ms': lambda log: text(
        ['Time (ms)\tMuscle length (cm)\tPressure (psi)\tLoad (kg)'],
        [[f'{1e3 * t:.0f}', f'{25.0 * (1.0 - e):.6f}', f'{p / 6894.757:.6f}',
          f'{f / 9.80665:.6f}'] for t, e, p, f in zip(*log.values())], '\t'),
    'force in lbf, pressure in cmH2O': lambda log: text(
        ['time_s,contraction_mm,pressure_cmH2O,force_lbf'],
        [[*r[:2], f'{1e3 * float(r[2]) / 98.0665:.4f}', f'{float(r[3]) / 4.4482216:.6f}']
         for r in cells(log)]),
    'elongation in inches': lambda log: text(
        ['time [s],Extension [in],pressure [MPa],force [g]'],
        [[r[0], f'{-float(r[1]) / 25.4:.7f}', f'{float(r[2]) / 1e3:.6f}',
          f'{1e3 * float(r[3]) / 9.80665:.4f}'] for r in cells(log)]),
    'decimal comma': lambda log: text(
        ['Zeit [s];Verk\u00fcrzung [mm];Druck [kPa];Kraft [N]'], cells(log, ','), ';'),
    'decimal comma, tabs, Latin-1': lambda log: text(
        ['Zeit in s\tVerk\u00fcrzung in mm\tMuskeldruck in kPa\tZugkraft in N'],
        cells(log, ','), '\t', '\r\n').encode('latin-1'),
    'UTF-16': lambda log: text([HEAD], cells(log)).encode('utf-16'),
    'UTF-16 without mark': lambda log: text([HEAD], cells(log)).encode('utf-16-le'),
    'byte order mark': lambda log: text([HEAD], cells(log)).encode('utf-8-sig'),
    'row of units': lambda log: text(
        ['Time,Contraction,Pressure,Force', 's,mm,kPa,N'], cells(log)),
    'row of units in brackets, semicolons': lambda log: text(
        ['Zeit;Kontraktion;Druck;Kraft', '[s];[mm];[kPa];[N]', ''], cells(log, ','), ';'),
    'units in names': lambda log: text(['t_s,contraction_mm,p_kPa,F_N'], cells(log)),
    'units behind a stroke': lambda log: text(['t/s|contraction/mm|p/kPa|F/N'], cells(log), '|'),
    'preamble': lambda log: text(
        ['Test report', 'Operator: K. Meier, Lab 3', 'Date: 2026-05-03', 'Sample rate,20,Hz',
         '', HEAD], cells(log)),
    'preamble of numbers': lambda log: text(
        ['1.0,2.0,3.0,4.0', '0.1,0.1,0.1,0.1', HEAD], cells(log)),
    'long preamble with a row like data': lambda log: text(
        ['0,0,0,0', *(f'setting {k}: on' for k in range(150)), HEAD], cells(log)),
    'notes with numbers in them': lambda log: text(
        [HEAD + ',note'], [[*row, 'ok 1 2 3 4 5 6 7'] for row in cells(log)]),
    'a header for each run': lambda log: text(
        [HEAD], [*cells(log)[:120], HEAD.split(','), *cells(log)[120:]]),
    'comment lines': lambda log: text(
        ['# rig 3', f'# {HEAD}'], [*cells(log)[:100], ['# pause'], *cells(log)[100:]]),
    'blanks': lambda log: text(
        ['   time [s]   contraction [mm]   pressure [kPa]   force [N]'],
        [[f'{cell:>14}' for cell in row] for row in cells(log)], ' '),
    'ISO time': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')], cells(log, time=iso)),
    'ISO time with zone': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')], cells(log, time=lambda t: iso(t) + '+02:00')),
    'time of day': lambda log: text(
        [HEAD.replace('time [s]', 'Uhrzeit')], cells(log, time=day_time)),
    'date and time of day': lambda log: text(
        ['Datum;Uhrzeit;Kontraktion [mm];Druck [kPa];Kraft [N]'],
        [['03.05.2026', *row] for row in cells(log, ',', day_time)], ';'),
    'words between times of day': lambda log: text(
        [HEAD.replace('time [s]', 'Uhrzeit')],
        [*cells(log, time=day_time)[:99], ['-- pause --'], *cells(log, time=day_time)[99:]]),
    'German date': lambda log: text(
        ['Zeitstempel;Kontraktion [mm];Druck [kPa];Kraft [N]'],
        [[german(t), *row[1:]] for t, row in zip(log['time'], cells(log, ','))], ';'),
    'text and extra columns': lambda log: text(
        ['No,time [s],note,contraction [mm],pressure [kPa],pressure setpoint [kPa],force [N],'
         'Temp [\u00b0C]'],
        [[str(k), row[0], 'ok "go", on'.replace(',', ''), *row[1:3], row[2], row[3], '21.5']
         for k, row in enumerate(cells(log))]),
    'quoted': lambda log: text(
        [','.join(f'"{name}"' for name in HEAD.split(','))],
        [[f'"{cell}"' for cell in row] for row in cells(log)]),
    'no units': lambda log: text(['time,contraction,pressure,force'], cells(log)),
    'separators at the end of lines': lambda log: text(
        [HEAD + ',,'], [[*row, '', ''] for row in cells(log)]),
    'thousands and decimal comma': lambda log: text(
        ['Zeit [s];Kontraktion [mm];Druck [mbar];Kraft [N]'],
        [[*row[:2], f'{10 * float(row[2].replace(",", ".")):,.1f}'.translate(
            str.maketrans(',.', '.,')), row[3]] for row in cells(log, ',')], ';'),
    'old line ends': lambda log: text([HEAD], cells(log), end='\r'),
    'last row cut, and a footer': lambda log: text([HEAD], [*cells(log)]) + 'End of test\n',
    'absolute pressure': lambda log: text(
        [HEAD.replace('[kPa]', '[bar abs]')],
        [[*row[:2], f'{(1e3 * float(row[2]) + 101325) / 1e5:.7f}', row[3]] for row in
         cells(log)]),
    'minus sign of compression': lambda log: (text(
        [HEAD], [[*row[:3], f'{-float(row[3]):.3f}'] for row in cells(log)]),
        {'columns': {'force': '-force [N]'}}),
    'names of nobody': lambda log: (text(
        ['a,b,c,d'], cells(log)),
        {'columns': {'time': 'a', 'contraction': 'b [mm]', 'pressure': 'c [kPa]',
                     'force': 'd [N]'}}),
    'no header': lambda log: (text([], cells(log)),
                              {'columns': {'time': '1', 'contraction': '2 [mm]',
                                           'pressure': '3 [kPa]', 'force': '4 [N]'}}),
    'no time, its rate told': lambda log: (text(
        ['contraction [mm],pressure [kPa],force [N]'], [row[1:] for row in cells(log)]),
        {'columns': {'time': '20 Hz'}}),
    'first line of Excel that names the separator': lambda log: text(
        ['sep=;', 'Zeit [s];Weg [mm];Druck [kPa];Kraft [N]'], cells(log, ','), ';'),
    'three rows of names': lambda log: text(
        ['AI0,AI1,AI2,AI3', 'Time,Displacement,Pressure,Force', 's,mm,kPa,N'], cells(log)),
    'quoted names and units of a testing machine': lambda log: text(
        ['"Time","Extension","Air pressure","Load"', '"(s)","(mm)","(kPa)","(N)"'],
        [[f'"{r[0]}"', f'"-{r[1]}"', f'"{r[2]}"', f'"{r[3]}"'] for r in cells(log)]),
    'commas for decimals and between cells': lambda log: text(
        [','.join(f'"{name}"' for name in HEAD.split(','))],
        [[f'"{cell}"' for cell in row] for row in cells(log, ',')]),
    'exponents of Fortran': lambda log: text(
        ['t_s x_mm p_kPa F_N'],
        [[f'{float(cell):.9E}'.replace('E', 'D') for cell in row] for row in cells(log)], ' '),
    'time of day, AM and PM': lambda log: text(
        [HEAD.replace('time [s]', 'Time')],
        cells(log, time=lambda t: (BEGIN + timedelta(seconds=float(t))).strftime(
            '%I:%M:%S.%f %p'))),
    'milliseconds since 1970': lambda log: text(
        [HEAD.replace('time [s]', 'timestamp')],
        cells(log, time=lambda t: f'{1.777e12 + 1e3 * t:.0f}')),
    'a table of markdown': lambda log: text(
        ['| time [s] | contraction [mm] | pressure [kPa] | force [N] |', '|---|---|---|---|'],
        [['', *row, ''] for row in cells(log)], ' | '),
    'units in every cell': lambda log: text(
        ['Time,Contraction,Pressure,Force'],
        [[f'{cell} {unit}' for cell, unit in zip(row, ('s', 'mm', 'kPa', 'N'))]
         for row in cells(log)]),
    'lines of a microcontroller': lambda log: text(
        ['boot ok', 'free heap: 2000', 'time_ms,contraction_mm,press_kPa,force_N'],
        cells(log, time=lambda t: f'{1e3 * t:.0f}')),
    'JSON lines': lambda log: ''.join(json.dumps(
        dict(zip(HEAD.split(','), map(float, row)))) + '\n' for row in cells(log)),
    'LabVIEW .lvm': lambda log: lvm(log, 'One'),
    'LabVIEW .lvm with German numbers': lambda log: lvm(log, 'One', ','),
    'LabVIEW .lvm without times': lambda log: lvm(log, 'No'),
}


def lvm(log, clocks, decimal='.'):
    """Return a LabVIEW measurement file as National Instruments documents it."""
    rows = cells(log, decimal)
    names = ['X_Value', 'Contraction', 'Pressure', 'Force', 'Comment']
    head = ['LabVIEW Measurement\t', 'Writer_Version\t2', 'Reader_Version\t2', 'Separator\tTab',
            f'Decimal_Separator\t{decimal}', 'Multi_Headings\tNo', f'X_Columns\t{clocks}',
            'Time_Pref\tRelative', 'Operator\tlab', 'Date\t2026/05/03', 'Time\t12:00:00.0',
            '***End_of_Header***\t', '\t', 'Channels\t3\t\t\t\t', 'Samples\t360\t360\t360\t\t',
            'Date\t2026/05/03\t2026/05/03\t2026/05/03\t\t', 'Time\t12:00:00\t12:00:00\t12:00:00\t',
            'Y_Unit_Label\tmm\tkPa\tN\t', 'X_Dimension\tTime\tTime\tTime\t',
            'X0\t0.0\t0.0\t0.0\t'.replace('.', decimal),
            'Delta_X\t0.05\t0.05\t0.05\t'.replace('.', decimal), '***End_of_Header***\t\t\t\t',
            '\t'.join(names)]
    body = ['\t'.join(row if clocks == 'One' else ['', *row[1:]]) for row in rows]
    return '\r\n'.join([*head, *body]) + '\r\n'


def frame(log):
    """Return a pandas frame of the log."""
    return pandas.DataFrame({'time [s]': log['time'], 'L [mm]': 1e3 * REST * (1 - log['strain']),
                             'pressure [bar]': log['pressure'] / 1e5, 'force [N]': log['force']})


def by_csv_module(log, path):
    """Write as a German spreadsheet does: the csv module's excel dialect with semicolons."""
    class Excel(csv.excel):
        delimiter = ';'
    with open(path, 'w', newline='', encoding='cp1252') as stream:
        writer = csv.writer(stream, dialect=Excel)
        writer.writerow(['Zeit [s]', 'L\u00e4nge [mm]', 'Druck [bar]', 'Kraft [N]'])
        for row in frame(log).itertuples(index=False):
            writer.writerow([f'{value:.6f}'.replace('.', ',') for value in row])


def by_openpyxl(log, path):
    """Write a workbook with a title, a row of units, a margin, real times, and a second sheet."""
    import openpyxl
    book = openpyxl.Workbook()
    book.active.title = 'Setup'
    book.active.append(['muscle', 'DMSP', 10])
    sheet = book.create_sheet('Messung')
    sheet['B1'] = 'Versuch 12'
    sheet.merge_cells('B1:E1')
    for j, (name, unit) in enumerate([('Zeit', ''), ('L\u00e4nge', 'mm'), ('Druck', 'bar'),
                                      ('Kraft', 'N')], 2):
        sheet.cell(3, j, name)
        sheet.cell(4, j, unit)
    for i, row in enumerate(frame(log).itertuples(index=False), 5):
        sheet.cell(i, 2, BEGIN + timedelta(seconds=row[0]))
        for j, value in enumerate(row[1:], 3):
            sheet.cell(i, j, value)
    book.save(path)


def by_nptdms(log, path):
    """Write a .tdms of waveforms with units."""
    from nptdms import ChannelObject, TdmsWriter
    data = frame(log)
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([
            ChannelObject('Log', name, data[header].to_numpy(),
                          {'wf_increment': 0.05, 'wf_start_offset': 0.0, 'unit_string': unit})
            for name, header, unit in (('Length', 'L [mm]', 'mm'), ('Druck', 'pressure [bar]',
                                                                    'bar'),
                                       ('Force', 'force [N]', 'N'))])


def by_nptdms_with_times(log, path):
    """Write a .tdms whose first channel is the time."""
    from nptdms import ChannelObject, TdmsWriter
    with TdmsWriter(str(path)) as writer:
        for name, values in frame(log).items():
            writer.write_segment([ChannelObject('Log', name, values.to_numpy())])


def by_savemat(log, path, struct=False):
    """Write a .mat (version 5) of vectors, or of a struct with units."""
    from scipy.io import savemat
    vectors = {'t': log['time'][:, None], 'L_mm': 1e3 * REST * (1 - log['strain']),
               'p_bar': log['pressure'] / 1e5, 'F': log['force']}
    if struct:
        vectors = {'log': {'time': log['time'], 'length': 1e3 * REST * (1 - log['strain']),
                           'pressure': log['pressure'] / 1e5, 'force': log['force'],
                           'units': {'length': 'mm', 'pressure': 'bar', 'force': 'N'}},
                   'operator': 'KM'}
    savemat(path, vectors)


def by_savemat_structs(log, path):
    """Write a .mat of an array of structs, one for each sample."""
    from scipy.io import savemat
    names = ('t_s', 'L_mm', 'p_bar', 'F_N')
    savemat(path, {'S': [dict(zip(names, row)) for row in frame(log).to_numpy()]})


def by_nptdms_runs(log, path):
    """Write a .tdms of two groups with the same channels: two trials."""
    from nptdms import ChannelObject, TdmsWriter
    with TdmsWriter(str(path)) as writer:
        for run, rows in (('Run 1', slice(0, 200)), ('Run 2', slice(200, None))):
            writer.write_segment([ChannelObject(run, name, values.to_numpy()[rows])
                                  for name, values in frame(log).items()])


def by_openpyxl_times(log, path):
    """Write a workbook with times of day, a formula's error and words in a column of notes."""
    times = [(BEGIN + timedelta(seconds=float(t))).time() for t in log['time']]
    data = frame(log).drop(columns='time [s]').astype(object)
    data.insert(0, 'Uhrzeit', times)
    data['note'] = '#DIV/0!'
    data.to_excel(path, index=False)


def by_savemat_matrix(log, path):
    """Write a .mat of one matrix and the names of its columns."""
    from scipy.io import savemat
    data = frame(log)
    savemat(path, {'data': data.to_numpy(), 'names': np.array(list(data.columns), object)})


def by_h5py(log, path):
    """Write a .mat of version 7.3 as MATLAB does: HDF5, rows and columns exchanged."""
    import h5py
    with h5py.File(path, 'w', userblock_size=512) as file:
        group = file.create_group('log')
        for name, values in (('t_s', log['time']), ('L_mm', 1e3 * REST * (1 - log['strain'])),
                             ('p_bar', log['pressure'] / 1e5), ('F_N', log['force'])):
            dataset = group.create_dataset(name, data=values[None, :])
            dataset.attrs['MATLAB_class'] = np.bytes_('double')
    with open(path, 'r+b') as stream:
        stream.write(b'MATLAB 7.3 MAT-file, Platform: GLNXA64'.ljust(116))


def by_h5py_with_units(log, path):
    """Write HDF5 whose datasets carry their unit; the pressure alone could be bar or psi."""
    import h5py
    with h5py.File(path, 'w') as file:
        for name, values, unit in (('time', log['time'], 's'), ('force', log['force'], 'N'),
                                   ('length', 1e3 * REST * (1 - log['strain']), 'mm'),
                                   ('pressure', log['pressure'] / 6894.757, 'psi')):
            file[name] = values
            file[name].attrs['units'] = unit


def by_h5py_records(log, path):
    """Write HDF5 of one table of records."""
    import h5py
    with h5py.File(path, 'w') as file:
        file['log'] = np.rec.fromarrays(frame(log).to_numpy().T, names='t_s,L_mm,p_bar,F_N')


def by_pyarrow(log, path):
    """Write parquet with units in the fields' metadata."""
    import pyarrow
    import pyarrow.parquet
    data = frame(log).rename(columns={'pressure [bar]': 'pressure [psi]'})
    data['pressure [psi]'] = log['pressure'] / 6894.757
    fields = [pyarrow.field(name.partition(' ')[0], pyarrow.float64(),
                            metadata={'unit': name.partition('[')[2].rstrip(']')})
              for name in data]
    table = pyarrow.table([data[name].to_numpy() for name in data], pyarrow.schema(fields))
    pyarrow.parquet.write_table(table, path)


def by_rosbags(log, path):
    """Write a bag of the bundle's topics by rosbags."""
    from fam_bundle_ros.data import write_bag
    from fam_bundle_ros.data.measurement import build
    write_bag(build('log', log['strain'], log['pressure'], log['force'], None, log['time']), path)


#: What is written by the library of its format: file name, function of the log and the path.
LIBRARIES = {
    'pandas.to_csv': ('a.csv', lambda log, path: frame(log).to_csv(path)),
    'pandas.to_csv, German': ('a.csv', lambda log, path: frame(log).to_csv(
        path, sep=';', decimal=',', index=False, encoding='utf-16')),
    'pandas.to_csv with times as index': ('a.csv', lambda log, path: frame(log).set_index(
        pandas.Timestamp(BEGIN) + pandas.to_timedelta(log['time'], unit='s')).drop(
            columns='time [s]').to_csv(path, index_label='time')),
    'numpy.savetxt': ('a.txt', lambda log, path: np.savetxt(
        path, frame(log).to_numpy(), header='time [s] L [mm] pressure [bar] force [N]')),
    'numpy.savetxt with commas': ('a.csv', lambda log, path: np.savetxt(
        path, frame(log).to_numpy(), delimiter=',', header=','.join(frame(log)), comments='')),
    'csv module': ('a.csv', by_csv_module),
    'pandas.to_excel': ('a.xlsx', lambda log, path: frame(log).to_excel(path, index=False)),
    'openpyxl': ('a.xlsx', by_openpyxl),
    'npTDMS waveforms': ('a.tdms', by_nptdms),
    'npTDMS runs': ('a.tdms', by_nptdms_runs),
    'pandas.to_excel with times of day': ('a.xlsx', by_openpyxl_times),
    'pandas.to_excel with an index of times': ('a.xlsx', lambda log, path: frame(log).set_index(
        pandas.Timestamp(BEGIN) + pandas.to_timedelta(log['time'], unit='s')).drop(
            columns='time [s]').to_excel(path)),
    'npTDMS with times': ('a.tdms', by_nptdms_with_times),
    'scipy.io.savemat': ('a.mat', by_savemat),
    'scipy.io.savemat of a struct': ('a.mat', lambda log, path: by_savemat(log, path, True)),
    'scipy.io.savemat of an array of structs': ('a.mat', lambda log, path: by_savemat_structs(
        log, path)),
    'scipy.io.savemat of a matrix': ('a.mat', by_savemat_matrix),
    'h5py': ('a.mat', by_h5py),
    'h5py with units': ('a.h5', by_h5py_with_units),
    'h5py records': ('a.h5', by_h5py_records),
    'pandas.to_parquet': ('a.parquet', lambda log, path: frame(log).to_parquet(path)),
    'pyarrow with units': ('a.parquet', by_pyarrow),
    'pandas.to_feather': ('a.feather', lambda log, path: frame(log).to_feather(path)),
    'numpy.savez': ('a.npz', lambda log, path: np.savez(path, **log)),
    'pandas.to_json': ('a.json', lambda log, path: frame(log).to_json(path, orient='records')),
    'json module': ('a.json', lambda log, path: path.write_text(json.dumps(
        {'data': frame(log).to_dict('list'), 'operator': 'KM'}))),
    'rosbags': ('bag', by_rosbags),
}


def same(data, log):
    """Raise where a measurement is not the log."""
    assert len(data) == ROWS
    assert np.allclose(data.strain, log['strain'], atol=2e-6)
    assert np.allclose(data.pressure[:, 0], log['pressure'], rtol=1e-5, atol=1.0)
    assert np.allclose(data.force, log['force'], rtol=1e-5, atol=2e-3)
    assert np.allclose(np.diff(data.time), 0.05, atol=1e-6)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('form', TEXTS)
def test_a_log_written_as_labs_write_text_reads_the_same(form, log, tmp_path):
    """Separators, commas, preambles, units, encodings, clocks: the same numbers."""
    content = TEXTS[form](log)
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
    """They are no text, whatever their ending says."""
    (tmp_path / 'a.csv').write_bytes(HOSTILE[kind])
    with pytest.raises(InputError, match='not a text file'):
        read_measurement(tmp_path / 'a.csv')


def test_a_text_that_turns_binary_far_down_fails(log, tmp_path):
    """A log whose disk was full ends in zeros: not a text file, and not half a log."""
    rows = text([HEAD], cells(log) * 2).encode()
    (tmp_path / 'a.csv').write_bytes(rows + bytes(4096))
    with pytest.raises(InputError, match='not a text file'):
        read_measurement(tmp_path / 'a.csv', rest_length=REST)


def test_a_measurement_knows_the_digest_of_its_file(log, tmp_path):
    """What a report says was read can be checked."""
    (tmp_path / 'a.csv').write_text(text([HEAD], cells(log)))
    data = read_measurement(tmp_path / 'a.csv', rest_length=REST)
    assert data.sha256 == hashlib.sha256((tmp_path / 'a.csv').read_bytes()).hexdigest()


def test_json_that_nests_without_end_fails(tmp_path):
    """Brackets for ever are no table."""
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
    """The first sheet with most known columns; others are named; a wrong name lists them."""
    pytest.importorskip('openpyxl')
    path = tmp_path / 'runs.xlsx'
    with pandas.ExcelWriter(path) as writer:
        pandas.DataFrame({'gain': range(30), 'channel': range(30)}).to_excel(
            writer, sheet_name='Info')
        frame(log).to_excel(writer, sheet_name='Run 1')
        frame(log)[::2].to_excel(writer, sheet_name='Run 2')
    data = read_measurement(path, rest_length=REST)
    assert len(data) == ROWS
    assert any('Run 2' in note for note in data.notes)
    assert len(read_measurement(path, rest_length=REST, sheet='Run 2')) == ROWS // 2
    with pytest.raises(InputError, match='Info, Run 1, Run 2'):
        read_measurement(path, sheet='Run 3')


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


def test_groups_of_a_tdms_file_are_trials(log, tmp_path):
    """Runs that a program wrote as groups are told apart by their names."""
    pytest.importorskip('nptdms')
    by_nptdms_runs(log, tmp_path / 'a.tdms')
    data = read_measurement(tmp_path / 'a.tdms', rest_length=REST)
    assert data.trial_names == ('Run 1', 'Run 2')
    assert np.array_equal(np.bincount(data.trial), [200, 160])


def test_an_index_of_times_is_the_time_of_a_frame(log):
    """A pandas frame by its DatetimeIndex reads like one with a column."""
    data = frame(log).drop(columns='time [s]')
    data.index = pandas.Timestamp(BEGIN) + pandas.to_timedelta(log['time'], unit='s')
    same(read_measurement(data, rest_length=REST), log)


def test_a_slower_channel_is_brought_to_the_time_of_the_fastest(log, tmp_path):
    """A pressure logged at half the rate is interpolated."""
    nptdms = pytest.importorskip('nptdms')
    data = frame(log)
    with nptdms.TdmsWriter(str(tmp_path / 'a.tdms')) as writer:
        writer.write_segment([
            nptdms.ChannelObject('Log', name, data[name].to_numpy()[::every],
                                 {'wf_increment': 0.05 * every})
            for name, every in (('L [mm]', 1), ('pressure [bar]', 2), ('force [N]', 1))])
    again = read_measurement(tmp_path / 'a.tdms', rest_length=REST)
    assert len(again) == ROWS
    off = np.abs(again.pressure[:, 0] - log['pressure']) > 1.0
    assert off.sum() <= 2  # at the steps


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
