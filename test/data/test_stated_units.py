# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units that stand beside a table, in a line of their own or with a label before them."""

import json

import numpy as np
import pandas as pd
import pytest
import scipy.io

from fam_bundle_ros.data import read_measurement

HEAD = 'time,strain,pressure,force\n'
LBF, PSI = 4.4482216, 6894.757


def rows(log):
    """Return the rows of a log in s, -, psi, lbf."""
    return ''.join(','.join(f'{cell:.6f}' for cell in row) + '\n' for row in zip(
        log[0], log[1], log[2] / PSI, log[3] / LBF))


@pytest.mark.parametrize('text', [
    '# pressure in psi, force in lbf\n' + HEAD + '{}',
    'Force unit: lbf\nPressure unit: psi\n\n' + HEAD + '{}',
    'Unit of force,lbf\nUnit of pressure,psi\n\n' + HEAD + '{}',
    'Unit system: US customary (psi, lbf)\n' + HEAD + '{}',
    '# units: s, -, psi, lbf\n' + HEAD + '{}',
    HEAD + '{}# units: s, -, psi, lbf\n',
    'Units,s,-,psi,lbf\n' + HEAD + '{}',
])
def test_units_are_those_that_a_line_states(tmp_path, log, text):
    """A force in lbf was read as one in N: the guess did not look at what the file says."""
    path = tmp_path / 'log.csv'
    path.write_text(text.format(rows(log)))
    data = read_measurement(path)
    assert data.time is not None
    assert np.abs(data.force - log[3]).max() < 1e-3
    assert np.abs(data.pressure[:, 0] - log[2]).max() < 1.0


@pytest.mark.parametrize('line', [
    'unit = kgf', 'Load cell: 500 lbf', 'force limit in lbf', '# force in lbf or force in kN',
    '# force in lbf, force in kN', 'supply in kgf'])
def test_other_lines_state_no_unit(tmp_path, log, line):
    """A range, a limit, two units: none is that of the readings."""
    path = tmp_path / 'log.csv'
    path.write_text(f'{line}\n{HEAD.replace("sure", "sure [kPa]")}{rows(log)}')
    data = read_measurement(path)
    assert np.abs(data.force - log[3] / LBF).max() < 1e-3
    assert any(each.why == 'N guessed, no unit given' for each in data.taken)


def test_a_column_beside_another_is_not_its_unit(tmp_path, log):
    """A column 'g' behind the force, in the row of names, is no unit of it."""
    path = tmp_path / 'log.csv'
    path.write_text('t [s],strain,p [kPa],F,g\n' + ''.join(
        f'{t:.3f},{e:.5f},{p / 1e3:.4f},{f:.4f},9.81\n' for t, e, p, f in zip(*log)))
    assert np.abs(read_measurement(path).force - log[3]).max() < 1e-3


def containers(log):
    """Yield names of files, and what is saved: values in psi and lbf, units beside them."""
    values = {'t': log[0], 'strain': log[1], 'pressure': log[2] / PSI, 'force': log[3] / LBF}
    units = {'t': 's', 'strain': '', 'pressure': 'psi', 'force': 'lbf'}
    yield 'structs.json', {name: {'unit': units[name], 'values': each.tolist()}
                           for name, each in values.items()}
    yield 'structs.mat', {name: {'data': each, 'unit': units[name]}
                          for name, each in values.items()}
    listed = np.array([*units.values()])
    yield 'list.mat', {**values, 'units': listed.astype(object)}
    yield 'matrix.mat', {'log': np.stack([*values.values()], axis=-1), 'units': listed.astype(
        object), 'names': np.array([*values], object)}
    yield 'list.npz', {**values, 'units': listed}
    frame = pd.DataFrame(values)
    frame.attrs['units'] = units
    yield 'attrs.parquet', frame
    yield 'attrs.frame', frame


def saved(path, values):
    """Return a file with values, or the frame itself."""
    if path.suffix == '.json':
        path.write_text(json.dumps(values))
    elif path.suffix == '.mat':
        scipy.io.savemat(path, values)
    elif path.suffix == '.npz':
        np.savez(path, **values)
    elif path.suffix == '.parquet':
        values.to_parquet(path)
    return values if path.suffix == '.frame' else path


@pytest.mark.parametrize('at', range(7))
def test_units_are_those_beside_the_arrays(tmp_path, log, at):
    """Units in a list, in the struct of each channel, in the attributes of a frame."""
    name, values = [*containers(log)][at]
    data = read_measurement(saved(tmp_path / name, values))
    assert np.abs(data.force - log[3]).max() < 1e-3
    assert np.abs(data.pressure[:, 0] - log[2]).max() < 1.0
    assert data.time is not None
    assert data.motor_units == ('mu1',)


@pytest.mark.parametrize('other', ['lbf', 'N'])
def test_units_of_groups(tmp_path, log, other):
    """Runs in groups of an HDF5 file, with units as attributes, which may differ."""
    h5py = pytest.importorskip('h5py')
    with h5py.File(tmp_path / 'log.h5', 'w') as file:
        for run, unit in enumerate(('lbf', other)):
            group = file.create_group(f'run{run + 1}')
            for name, each, own in (('force', log[3] / (LBF if unit == 'lbf' else 1), unit),
                                    ('pressure', log[2] / PSI, 'psi'), ('strain', log[1], ''),
                                    ('time', log[0], 's')):
                group.create_dataset(name, data=each).attrs['unit'] = own
    data = read_measurement(tmp_path / 'log.h5')
    assert np.abs(data.force - np.tile(log[3], 2)).max() < 1e-3
    assert np.abs(data.pressure[:, 0] - np.tile(log[2], 2)).max() < 1.0
    assert not [note for note in data.notes if 'not used' in note]


def test_units_of_a_whole_group(tmp_path, log):
    """Units as attributes of the file, not of its datasets."""
    h5py = pytest.importorskip('h5py')
    with h5py.File(tmp_path / 'log.h5', 'w') as file:
        file.attrs['force_unit'] = 'lbf'
        for name, each in (('force', log[3] / LBF), ('pressure [kPa]', log[2] / 1e3),
                           ('strain', log[1]), ('time', log[0])):
            file[name] = each
    assert np.abs(read_measurement(tmp_path / 'log.h5').force - log[3]).max() < 1e-3
