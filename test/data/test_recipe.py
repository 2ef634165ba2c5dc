# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A recipe read once serves for a hundred files."""

import numpy as np
import pytest

from fam_bundle_ros.data import load_recipe, read_measurement, Recipe, recipe_of, save_recipe
from fam_bundle_ros.errors import InputError


@pytest.fixture
def log(muscle):
    """Return a log with names of a lab of its own; the displacement's sign must be told."""
    time = 0.05 * np.arange(200)
    strain = 0.1 - 0.1 * np.cos(time)
    pressure = 1e5 + 3e4 * time
    return {'t': time, 'Weg': -250.0 * strain, 'p': pressure / 1e3,
            'Kanal 3': -muscle(strain, pressure), 'Temp': time}


def test_what_was_recognised_and_told_is_kept(log, tmp_path):
    """A saved recipe reads the same file to the same numbers, without a guess."""
    told = Recipe(columns={'force': '-Kanal 3 [N]'}, rest_length=0.25, gauge=True)
    first = read_measurement(log, recipe=told)
    full = recipe_of(first, told)
    assert full.columns == {'force': '-Kanal 3 [N]', 'time': 't [s]', 'contraction': '-Weg [mm]',
                            'pressure': 'p [kPa]'}
    save_recipe(full, tmp_path / 'lab.yaml')
    again = load_recipe(tmp_path / 'lab.yaml')
    assert again == full
    second = read_measurement(log, recipe=tmp_path / 'lab.yaml')
    for name in ('strain', 'force', 'pressure', 'time'):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    # in a file in which pressures are so low that nothing could be guessed
    low = read_measurement({**log, 'p': 0.2 * log['p']}, recipe=again)
    assert low.pressure.max() == pytest.approx(0.2 * first.pressure.max())


@pytest.mark.parametrize('sign', [1, -1])
def test_a_recipe_keeps_the_sign_of_an_elongation(log, sign):
    """Recognised or told with a minus, it is read again as it was."""
    lengths = {**log, 'Extension [mm]': sign * log['Weg']}
    del lengths['Weg']
    told = Recipe(columns={'force': '-Kanal 3 [N]', **(
        {} if sign > 0 else {'elongation': '-Extension [mm]'})}, rest_length=0.25)
    first = read_measurement(lengths, recipe=told)
    assert first.strain.min() > -1e-9
    again = read_measurement(lengths, recipe=recipe_of(first, told))
    assert np.array_equal(first.strain, again.strain)


def test_options_count_more_than_the_recipe(log, tmp_path):
    """What is given beside a recipe replaces that part of it."""
    recipe = Recipe(columns={'force': '-Kanal 3 [N]'}, rest_length=0.25)
    save_recipe(recipe, tmp_path / 'lab.yaml')
    data = read_measurement(log, recipe=tmp_path / 'lab.yaml', rest_length='300 mm')
    assert data.strain.max() == pytest.approx(0.2 * 250 / 300, rel=1e-3)
    more = read_measurement(log, recipe=recipe, columns={'pressure': 'p [bar]'}, max_pressure=1e8)
    assert np.array_equal(more.force, data.force)
    small = read_measurement(log, recipe=recipe, columns={'force': '-Kanal 3 [mN]'})
    assert small.force.max() == pytest.approx(1e-3 * data.force.max())


@pytest.mark.parametrize(('text', 'words'), [
    ('columns: {force: F}', 'expected the key format'),
    ('format: fam-bundle-recipe/1\nrest_lenth: 1 m', "'rest_lenth' is not known"),
    ('format: fam-bundle-recipe/1\nrest_length: 250', 'has no unit'),
    ('format: fam-bundle-recipe/1\nrest_length: -1 mm', 'expected more than 0'),
    ('format: fam-bundle-recipe/1\ngauge: perhaps', 'true or false'),
    ('format: fam-bundle-recipe/1\ncolumns: {forse: F}', "'forse' is not a quantity"),
    ('format: [', 'not YAML (line 1:'), ('\x00', 'not YAML')])
def test_a_bad_recipe_fails_and_names_file_and_key(tmp_path, text, words):
    """One sentence for each mistake."""
    path = tmp_path / 'lab.yaml'
    path.write_text(text)
    with pytest.raises(InputError, match='lab.yaml') as caught:
        load_recipe(path)
    assert words in str(caught.value)


def test_a_recipe_that_is_not_there_fails(tmp_path):
    """The message says how one is made."""
    with pytest.raises(InputError, match='--save-recipe'):
        load_recipe(tmp_path / 'none.yaml')


@pytest.mark.parametrize('told', [
    Recipe(gauge=False), Recipe(drop_bad=True), Recipe(max_strain=0.6, max_pressure=2e6),
    Recipe(sheet='Run 2', rest_length=0.254123457), Recipe()])
def test_a_recipe_is_read_as_it_was_written(told, tmp_path):
    """All options survive, also that pressures are absolute."""
    save_recipe(told, tmp_path / 'lab.yaml')
    assert load_recipe(tmp_path / 'lab.yaml') == told


def forms(muscle):
    """Yield texts of files whose columns are made in reading, or told by more than their names."""
    time = 0.05 * np.arange(80)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 2.0)
    rows = {level: list(zip(time, strain, muscle(strain, 1e5 * level))) for level in (1, 3, 2)}
    yield 'titles', ''.join(f'p = {level} bar\ntime [s],strain,F [N]\n' + ''.join(
        f'{t:.2f},{e:.5f},{f:.4f}\n' for t, e, f in each) for level, each in rows.items())
    yield 'absolute', 'time,strain,p,F\ns,-,bar abs,N\n' + ''.join(
        f'{t:.2f},{e:.5f},{2.0 + t / 9:.4f},{f:.4f}\n' for t, e, f in rows[1])
    yield 'clock', 't [min:s],strain,p [kPa],F [N]\n' + ''.join(
        f'0:{t:05.2f},{e:.5f},{100 + t:.4f},{f:.4f}\n' for t, e, f in rows[1])
    legend = '# col 1: time [s]\n# col 2: strain\n# col 3: p [kPa]\n# col 4: force [N]\n'
    yield 'legend', legend + ''.join(
        f'{t:.2f} {e:.5f} {100 + t:.4f} {f:.4f}\n' for t, e, f in rows[1])
    yield 'ways', 'strain,1 bar up [N],1 bar down [N],3 bar up [N],3 bar down [N]\n' + ''.join(
        f'{e:.5f},{f:.4f},{f + 2:.4f},{3 * f:.4f},{3 * f + 2:.4f}\n' for _, e, f in rows[1][:40])


@pytest.mark.parametrize('at', range(5))
def test_a_recipe_reads_its_own_file_alike(tmp_path, muscle, at):
    """Of titles it was refused, and of an absolute pressure in a row of units read as gauge."""
    path = tmp_path / 'log.csv'
    path.write_text([*forms(muscle)][at][1])
    first = read_measurement(path)
    again = read_measurement(path, recipe=recipe_of(first, Recipe()))
    for name in ('strain', 'force', 'pressure', 'trial'):
        assert np.array_equal(getattr(first, name), getattr(again, name))
    assert (first.time is None) == (again.time is None)
