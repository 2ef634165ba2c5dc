# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Blocks of rows whose pressure stands only in the titles between them."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

LEVELS = (3.0, 1.0, 2.0)
HEAD = 'time [s],strain,force [N]'


@pytest.fixture
def blocks(muscle):
    """Return the rows of each level, as text, and the forces."""
    time = 0.05 * np.arange(40)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 2.0)
    forces = [muscle(strain, 1e5 * level) for level in LEVELS]
    return [''.join(f'{t:.2f},{e:.6f},{f:.4f}\n' for t, e, f in zip(time, strain, force))
            for force in forces], forces


def read(tmp_path, text, name='log.csv'):
    """Return the measurement of a text file."""
    path = tmp_path / name
    path.write_text(text, encoding='utf-8')
    return read_measurement(path)


def same(data, forces, above=0.0):
    """Raise where a measurement is not these blocks."""
    assert np.allclose(data.pressure[:, 0], np.repeat(1e5 * np.array(LEVELS) - above, 40))
    assert np.allclose(data.force, np.concatenate(forces), atol=1e-3)
    assert len(data.trial_names) == 3


@pytest.mark.parametrize('title', [
    'Pressure: {} bar', 'Test {}: p = {} bar', 'Versuch bei {} bar', 'p_set = {} bar', '{} bar',
    '# {} bar', 'Isobar at {} bar', 'Druckstufe {} bar', 'Isobar {}: {} bar', 'Run {} - {} bar',
    'Block {}, p_soll = {} bar', '** 12.5 N @ {} bar **',
    'Specimen {}\nPressure,{},bar',
    'Probe {},,\nDate,3.5.2026,\nInnendruck: {} bar\nOperator,KM,'])
def test_each_block_has_the_pressure_of_its_title(title, blocks, tmp_path):
    """With a head below each title; which titles they were is said."""
    rows, forces = blocks
    titles = [title.format(*([level] if title.count('{') == 1 else [k, level]))
              for k, level in enumerate(LEVELS, 1)]
    data = read(tmp_path, '\n'.join(f'{title}\n{HEAD}\n{block}'
                                    for title, block in zip(titles, rows)))
    same(data, forces)
    assert any('the titles of 3 blocks tell' in note for note in data.notes)


@pytest.mark.parametrize('title', [['Versuch {0}', '{1:g} bar'], ['Druck', '{1}', 'bar']])
def test_titles_in_cells_of_a_sheet_count_too(title, blocks, tmp_path):
    """The number may stand in a cell of its own."""
    openpyxl = pytest.importorskip('openpyxl')
    rows, forces = blocks
    book = openpyxl.Workbook()
    for k, (level, block) in enumerate(zip(LEVELS, rows), 1):
        cells = [cell.format(k, level) for cell in title]
        book.active.append([float(cell) if '.' in cell else cell for cell in cells])
        book.active.append(HEAD.split(','))
        for line in block.split():
            book.active.append(list(map(float, line.split(','))))
        book.active.append([])
    book.save(tmp_path / 'log.xlsx')
    same(read_measurement(tmp_path / 'log.xlsx'), forces)


def test_settings_between_blocks_are_no_readings(blocks, tmp_path):
    """As testing machines write them; a date among decimal commas groups no thousands."""
    rows, forces = blocks
    (tmp_path / 'log.csv').write_text(''.join(
        f'Probe {k};;;\nDatum;12.03.2026;;\nDruck;{level};bar;\nZeit;Dehnung;Kraft;Druck\n'
        's;-;N;bar\n' + block.replace('\n', f',{level}\n').replace(',', ';')
        for k, (level, block) in enumerate(zip(LEVELS, rows), 1)).replace('.', ',').replace(
            '12,03,', '12.03.'))
    data = read_measurement(tmp_path / 'log.csv', columns={'strain': 'Dehnung'})
    same(data, forces)
    assert np.allclose(data.strain[:40], data.strain[40:80])
    assert data.strain.max() == pytest.approx(0.2, abs=1e-3)


def test_titles_below_one_head_count_too(blocks, tmp_path):
    """The names stand once, comments part the blocks."""
    rows, forces = blocks
    same(read(tmp_path, HEAD + '\n' + ''.join(
        f'# {level} bar\n{block}' for level, block in zip(LEVELS, rows))), forces)


def test_an_absolute_pressure_of_a_title_is_converted(blocks, tmp_path):
    """As a pressure in a column is."""
    rows, forces = blocks
    same(read(tmp_path, ''.join(f'Absolute pressure {level} bar\n{HEAD}\n{block}\n'
                                for level, block in zip(LEVELS, rows))), forces, 101325.0)


def test_a_block_without_a_title_is_refused_and_no_constant_is_offered(blocks, tmp_path):
    """One pressure for all rows would be wrong: the message names the titles."""
    rows, _ = blocks
    titles = [f'p = {level} bar' for level in LEVELS]
    for without in (0, 1):
        told = [title if k != without else 'Test 2' for k, title in enumerate(titles)]
        with pytest.raises(InputError, match='titles tell several') as error:
            read(tmp_path, ''.join(f'{title}\n{HEAD}\n{block}'
                                   for title, block in zip(told, rows)))
        assert "'p = 2.0 bar' (row 85)" in str(error.value)
        assert '300 kPa' not in str(error.value)


def test_the_one_pressure_above_a_table_is_offered_as_a_constant(blocks, tmp_path):
    """It is not taken unasked: it may be that of another experiment."""
    rows, _ = blocks
    with pytest.raises(InputError, match=r"'Pressure: 3.0 bar' \(row 1\).*\"pressure=300 kPa\""):
        read(tmp_path, f'Pressure: 3.0 bar\n{HEAD}\n{rows[0]}')


@pytest.mark.parametrize('title', [
    'Supply pressure: {} bar', 'Sensor range {} bar', 'At the valve {} bar'])
def test_a_pressure_of_something_else_is_not_that_of_the_muscle(title, blocks, tmp_path):
    """The pressure of a supply or the range of a sensor is not that of the rows."""
    rows, _ = blocks
    with pytest.raises(InputError, match="'pressure' is missing"):
        read(tmp_path, ''.join(f'{title.format(level)}\n{HEAD}\n{block}\n'
                               for level, block in zip(LEVELS, rows)))


def test_the_pressure_in_the_name_of_a_file_is_offered_too(blocks, tmp_path):
    """One file per pressure: what to write is the pressure of this one."""
    rows, _ = blocks
    with pytest.raises(InputError, match=r'in the name of the file says.*"pressure=250 kPa"'):
        read(tmp_path, f'{HEAD}\n{rows[0]}', 'muscle_2.5bar_run1.csv')


def test_a_pressure_that_is_told_counts_more_than_titles(blocks, tmp_path):
    """It is taken for all rows, and no note says that titles were read."""
    rows, _ = blocks
    path = tmp_path / 'log.csv'
    path.write_text(''.join(f'p = {level} bar\n{HEAD}\n{block}\n'
                            for level, block in zip(LEVELS, rows)))
    data = read_measurement(path, columns={'pressure': '250 kPa'})
    assert np.allclose(data.pressure, 250e3)
    assert not any('titles' in note for note in data.notes)


def test_a_pressure_above_a_table_may_be_quoted_cells(blocks, tmp_path):
    """As testing machines write settings: a name, a value and a unit, each in quotes."""
    with pytest.raises(InputError, match='"pressure=250 kPa"'):
        read(tmp_path, f'"Preload","5.0","N"\n"Pressure","2.5","bar"\n{HEAD}\n' + blocks[0][0])


@pytest.mark.parametrize('title', ['Test {}: pressure 0-{} bar', 'Run {}, p = 0.5 to {} bar'])
def test_a_range_is_no_pressure_of_a_block(title, blocks, tmp_path):
    """Of a sweep up to 3 bar all rows were read at 3 bar."""
    rows, _ = blocks
    with pytest.raises(InputError, match="column 'pressure' is missing"):
        read(tmp_path, '\n'.join(f'{title.format(k, level)}\n{HEAD}\n{block}' for k, (
            level, block) in enumerate(zip(LEVELS, rows), 1)))


def test_titles_with_two_values_are_no_rows(tmp_path, log):
    """Titles 'p = 100 kPa, L0 = 127 mm' were read as the rows of the file, all others left out."""
    time, strain, pressure, force = log
    text = ''
    for level in np.unique(pressure):
        rows = pressure == level
        text += f'Test: p = {level / 1e3:.0f} kPa, L0 = 127 mm\ntime [s],contraction [mm],F [N]\n'
        text += ''.join(f'{t:.3f},{127 * e:.5f},{f:.4f}\n' for t, e, f in zip(
            time[rows], strain[rows], force[rows])) + '\n'
    path = tmp_path / 'log.csv'
    path.write_text(text)
    data = read_measurement(path)
    assert len(data) == len(time)
    assert np.allclose(data.pressure[:, 0], pressure)
