# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A log as the library of each format writes it: `LIBRARIES`, file name and writer by library."""

import csv
from datetime import timedelta
import json

import numpy as np
import pytest

from .text_forms import BEGIN, REST, ROWS

pandas = pytest.importorskip('pandas')


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


def by_savemat_trials(log, path):
    """Write a .mat of an array of structs, one for each trial, with vectors in each."""
    from scipy.io import savemat
    names, data = ('t_s', 'L_mm', 'p_bar', 'F_N'), frame(log).to_numpy()
    savemat(path, {'runs': np.array([dict(zip(names, data[k:k + 120].T))
                                     for k in (0, 120, 240)], object)})


def by_savemat_simulink(log, path):
    """Write a .mat as Simulink logs: a time, and signals with values in them."""
    from scipy.io import savemat
    savemat(path, {'tout': log['time'], 'p_kPa': log['pressure'] / 1e3, 'Force_N': log['force'],
                   'length': {'time': log['time'], 'signals': {
                       'values': 1e3 * REST * (1 - log['strain'][:, None]), 'label': 'length'}}})


def by_savemat_to_workspace(log, path):
    """Write a .mat as blocks To Workspace do: a structure with its time for each signal."""
    from scipy.io import savemat
    savemat(path, {name: {'time': log['time'], 'signals': {'values': values, 'label': label}}
                   for name, label, values in (
                       ('force', 'force [N]', log['force']),
                       ('p', 'p [bar]', log['pressure'] / 1e5),
                       ('x', 'length [mm]', 1e3 * REST * (1 - log['strain'])))})


def by_savemat_dspace(log, path):
    """Write a .mat as dSPACE does: X and Y of channels with a name, data and a unit."""
    from scipy.io import savemat
    data = frame(log)
    channels = [{'Name': name.split(' [')[0], 'Data': data[name].to_numpy(),
                 'Unit': name.split('[')[1][:-1], 'XIndex': 1} for name in data]
    savemat(path, {'rec1': {'X': channels[0], 'Y': channels[1:], 'Description': 'run 3'}})


def by_savemat_scope(log, path):
    """Write a .mat as a Simulink scope does: one time, signals with a label and values."""
    from scipy.io import savemat
    names = ('length [mm]', 'pressure [bar]', 'force [N]')
    savemat(path, {'ScopeData': {'time': log['time'], 'signals': [
        {'values': values, 'dimensions': 1, 'label': name}
        for name, values in zip(names, frame(log).to_numpy().T[1:])], 'blockName': 'rig/Scope'}})


def by_savemat_runs(log, path):
    """Write a .mat with a struct for each run."""
    from scipy.io import savemat
    names, data = ('t_s', 'L_mm', 'p_bar', 'F_N'), frame(log).to_numpy()
    savemat(path, {f'run{k}': dict(zip(names, data[120 * k:120 * k + 120].T)) for k in range(3)})


def by_nptdms_daq(log, path):
    """Write a .tdms as a DAQ task does: channels by their terminals, units as properties."""
    from nptdms import ChannelObject, TdmsWriter
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([
            ChannelObject('Untitled', f'cDAQ1Mod1/ai{k}', values,
                          {'wf_increment': 0.05, 'unit_string': unit, 'wf_samples': ROWS})
            for k, (values, unit) in enumerate(((1e3 * REST * log['strain'], 'mm'),
                                                (log['pressure'] / 6894.757, 'psi'),
                                                (log['force'] / 4.4482216, 'lbf')))])


def by_pandas_levels(log, path):
    """Write a CSV whose columns have two levels, name and unit, with times as index."""
    data = frame(log).drop(columns='time [s]')
    data.index = pandas.Timestamp(BEGIN) + pandas.to_timedelta(log['time'], unit='s')
    data.columns = pandas.MultiIndex.from_tuples([('length', 'mm'), ('pressure', 'bar'),
                                                  ('force', 'N')])
    data.to_csv(path)


def by_openpyxl_text(log, path):
    """Write a workbook whose numbers are texts with decimal commas."""
    data = frame(log).map(lambda value: f'{value:.6f}'.replace('.', ','))
    data.set_axis(['Zeit [s]', 'L\u00e4nge [mm]', 'Druck [bar]', 'Kraft [N]'], axis=1).to_excel(
        path, index=False)


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


def by_h5py_with_texts(log, path):
    """Write HDF5 whose units stand beside the numbers, as texts of their own."""
    import h5py
    with h5py.File(path, 'w') as file:
        file.update({**log, 'pressure': log['pressure'] / 6894.757})
        file.update({'pressure_unit': 'psi', 'force_unit': 'N'})


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
    'scipy.io.savemat of trials': ('a.mat', by_savemat_trials),
    'scipy.io.savemat of Simulink logs': ('a.mat', by_savemat_simulink),
    'scipy.io.savemat of To Workspace': ('a.mat', by_savemat_to_workspace),
    'scipy.io.savemat of dSPACE channels': ('a.mat', by_savemat_dspace),
    'scipy.io.savemat of a Simulink scope': ('a.mat', by_savemat_scope),
    'scipy.io.savemat of a struct for each run': ('a.mat', by_savemat_runs),
    'npTDMS of a DAQ task': ('a.tdms', by_nptdms_daq),
    'pandas.to_csv of two levels': ('a.csv', by_pandas_levels),
    'openpyxl, texts with decimal commas': ('a.xlsx', by_openpyxl_text),
    'scipy.io.savemat of a matrix': ('a.mat', by_savemat_matrix),
    'h5py': ('a.mat', by_h5py),
    'h5py with units': ('a.h5', by_h5py_with_units),
    'h5py with texts': ('a.h5', by_h5py_with_texts),
    'h5py records': ('a.h5', by_h5py_records),
    'pandas.to_parquet': ('a.parquet', lambda log, path: frame(log).to_parquet(path)),
    'pyarrow with units': ('a.parquet', by_pyarrow),
    'pandas.to_feather': ('a.feather', lambda log, path: frame(log).to_feather(path)),
    'numpy.savez': ('a.npz', lambda log, path: np.savez(path, **log, rate=20.0)),
    'pandas.to_json': ('a.json', lambda log, path: frame(log).to_json(path, orient='records')),
    'pandas.to_json by default': ('a.json', lambda log, path: frame(log).to_json(path)),
    'json module': ('a.json', lambda log, path: path.write_text(json.dumps(
        {'data': frame(log).to_dict('list'), 'operator': 'KM'}))),
    'rosbags': ('bag', by_rosbags),
}
