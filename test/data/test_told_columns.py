# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a user tells of a column: its name, unit, sign and calibration."""

import numpy as np
import pytest

from fam_bundle_ros.data import preview, read_measurement, taken_words
from fam_bundle_ros.data.recipe import load_recipe, Recipe, recipe_of, save_recipe
from fam_bundle_ros.errors import InputError

from .test_columns import table

CALIBRATION = {'pressure': 'AI0 [V] * 200 kPa', 'force': 'AI1 * 50 N - 5 N',
               'contraction': 'AI2 * 0.025 mm - 10 mm'}


@pytest.fixture
def volts(log):
    """Return the log as an analog card reads it: 200 kPa/V, 50 N/V of a cell at 0.1 V, 25 mm/V."""
    time, strain, pressure, force = log
    return {'time [s]': time, 'AI0 [V]': pressure / 200e3, 'AI1 [V]': force / 50.0 + 0.1,
            'AI2 [mV]': 1e3 * (0.25 * strain + 0.01) / 25e-3}


@pytest.mark.parametrize(('columns', 'right'), [
    ({'force': 'Kanal 3 [N]'}, 1.0), ({'force': 'kanal 3 [mN]'}, 1e-3),
    ({'force': '-Kanal 3'}, -1.0), ({'force': '4'}, 1.0)])
def test_columns_can_be_told(log, columns, right):
    """By header, with a unit, with the sign turned, or by number."""
    data = read_measurement(table(log, force=('Kanal 3', log[3])), columns=columns)
    assert np.allclose(data.force, right * log[3])


@pytest.mark.parametrize(('header', 'why'), [
    ('Kanal 2 (bar)', ''), ('Kanal 2 (Ventil)', 'bar guessed, no unit given')])
def test_a_unit_in_round_brackets_is_one_if_it_fits(log, header, why):
    """Otherwise it is a remark."""
    data = read_measurement(table(log, pressure=(header, log[2] / 1e5)),
                            columns={'pressure': header})
    assert np.allclose(data.pressure[:, 0], log[2])
    assert why == next(taken.why for taken in data.taken if taken.header == header)


def test_a_told_column_without_a_unit_has_the_only_one_that_fits(log):
    """A strain up to 20 is in percent, which no header says."""
    data = read_measurement(table(log, strain=('Kanal 1', 100.0 * log[1])),
                            columns={'strain': 'Kanal 1'})
    assert np.allclose(data.strain, log[1])


def test_what_is_told_counts_more_than_what_would_be_recognised(log):
    """A told column is used though another has the plainer name."""
    more = {**table(log), 'Kanal 3': 2.0 * log[3], 'L [mm]': log[1]}
    data = read_measurement(more, columns={'force': 'Kanal 3 [N]', 'strain': 'strain'})
    assert np.allclose(data.force, 2.0 * log[3])
    assert "'force [N]' (force was told)" in taken_words(data)


def test_volts_are_read_with_the_calibration_of_each_sensor(log, volts):
    """Scale and zero stand behind the column, and are told of in the first line."""
    data = read_measurement(volts, columns=CALIBRATION, rest_length='250 mm')
    assert np.allclose(data.strain, log[1])
    assert np.allclose(data.pressure[:, 0], log[2])
    assert np.allclose(data.force, log[3])
    assert "force 'AI1 [V]' (as told: * 50 N - 5 N)" in taken_words(data)


@pytest.mark.parametrize('told', ['AI1 * 50 N/V - 5 N', 'AI1 * 0.05 N/mV - 5 N'])
def test_a_calibration_may_name_the_unit_that_it_takes_away(log, volts, told):
    """50 N/V of a column in V is 50 N, and so is 0.05 N/mV."""
    data = read_measurement(volts, columns={**CALIBRATION, 'force': told}, rest_length='250 mm')
    assert np.allclose(data.force, log[3])


def test_a_calibration_per_volt_fits_a_column_in_millivolts(log, volts):
    """An oscilloscope writes mV where a channel is small; per mA it is refused."""
    volts['AI1 [mV]'] = 1e3 * volts.pop('AI1 [V]')
    data = read_measurement(volts, columns={**CALIBRATION, 'force': 'AI1 * 50 N/V - 5 N'},
                            rest_length='250 mm')
    assert np.allclose(data.force, log[3])
    with pytest.raises(InputError, match=r"unit 'N/mA' does not fit; expected a unit like N"):
        read_measurement(volts, columns={**CALIBRATION, 'force': 'AI1 * 50 N/mA'},
                         rest_length='250 mm')


@pytest.mark.parametrize('told', [
    {'contraction': 'position [mm] - 12 mm'}, {'contraction': '-back [mm] + 88 mm'},
    {'elongation': 'longer [mm] + 2 cm'}, {'length': 'calliper [mm] + 30 mm'}])
def test_a_position_may_count_from_anywhere(log, told):
    """Its offset is subtracted or added, also with a reversed sign."""
    position = 250.0 * log[1]
    columns = {**table(log, strain=None), 'position [mm]': position + 12.0,
               'back [mm]': 88.0 - position, 'longer [mm]': -position - 20.0,
               'calliper [mm]': 220.0 - position}
    assert np.allclose(read_measurement(columns, columns=told, rest_length=0.25).strain, log[1])


def test_a_zero_in_another_unit_than_its_column_is_refused(log):
    """An offset in mm on a strain in percent is refused."""
    columns = {**table(log), 'epsilon [%]': 100 * log[1]}
    with pytest.raises(InputError, match="'epsilon .%.' is in %, and mm is added; expected units"):
        read_measurement(columns, columns={'strain': 'epsilon [%] - 3 mm'}, rest_length=0.25)
    with pytest.raises(InputError, match="unit 'kPa' does not fit; expected a unit like N"):
        read_measurement(columns, columns={'force': 'force - 3 kPa'})


def test_a_calibration_goes_into_a_recipe_and_comes_back(volts, tmp_path):
    """The recipe saves the user's words."""
    told = Recipe(CALIBRATION, rest_length=0.25)
    data = read_measurement(volts, recipe=told)
    save_recipe(recipe_of(data, told), tmp_path / 'lab.yaml')
    again = read_measurement(volts, recipe=load_recipe(tmp_path / 'lab.yaml'))
    assert np.array_equal(again.force, data.force)
    assert np.array_equal(again.strain, data.strain)


def test_a_column_in_volts_asks_for_its_calibration(volts):
    """The message shows how one is told, and of which column."""
    problem = preview({**volts, 'load cell [V]': volts['AI1 [V]']}, rest_length=0.25).problem
    example = problem.partition('for example')[2]
    assert 'contraction=AI0 * 50 mm' in example
    assert 'load cell' not in example
    assert "'AI0 [V]' in V: tell what one V is worth" in problem


def test_a_header_that_looks_like_a_calibration_is_a_header(log):
    """A column 'F - 2 N' is found by its name before anything is taken off."""
    columns = {**table(log, force=('F - 2 N', log[3])), 'F': 7.0 + log[3]}
    assert np.allclose(read_measurement(columns, columns={'force': 'F - 2 N'}).force, log[3])
