# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Logs with one reading per row, as databases and controllers write them."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

TIME = 0.05 * np.arange(60)
NAMES = ('strain', 'p_kPa', 'F_N')


@pytest.fixture
def readings(muscle):
    """Return a function of a level (kPa) to the readings of one sweep, by signal."""
    def of(level, time=TIME):
        strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 3.0)
        return {'strain': strain, 'p_kPa': np.full(len(time), level),
                'F_N': muscle(strain, 1e3 * level)}
    return of


def long(*tables):
    """Return (times, readings, further columns) as one table, a signal after the other in each."""
    parts = {'time [s]': [], 'tag': [], 'value': []}
    for times, values, more in tables:
        for name, column in values.items():
            parts['time [s]'].append(times)
            parts['tag'].append(np.full(len(times), name, object))
            parts['value'].append(column)
            for key, value in more.items():
                parts.setdefault(key, []).append(np.full(len(times), value))
    return {name: np.concatenate(columns) for name, columns in parts.items()}


def test_signals_become_columns_and_what_is_not_read_is_said(readings):
    """Each reading comes back at its time; a column that is left out is named."""
    values = readings(200.0)
    data = read_measurement(long((TIME, values, {'node': 7.0})))
    assert np.allclose(data.time, TIME)
    assert np.allclose(data.strain, values['strain'])
    assert np.allclose(data.force, values['F_N'])
    assert any("each of 3 names in 'tag'" in note and "not used: 'node'" in note
               for note in data.notes)


def test_runs_of_a_column_are_trials(readings):
    """Two runs with the same times are not mixed."""
    table = long((TIME, readings(100.0), {'run': 1.0}), (TIME, readings(300.0), {'run': 2.0}))
    data = read_measurement(table)
    assert data.trial_names == ('1', '2')
    assert np.allclose(data.pressure[:, 0] / 1e3, np.repeat([100.0, 300.0], 60))


def test_times_of_all_signals_that_go_back_begin_a_trial(readings):
    """Without a column for it: the clock began anew, and rows of two runs are not interleaved."""
    data = read_measurement(long((TIME, readings(100.0), {}), (TIME, readings(300.0), {})))
    assert data.trial_names == ('1', '2')
    assert np.allclose(data.pressure[:, 0] / 1e3, np.repeat([100.0, 300.0], 60))
    assert np.allclose(data.force, np.concatenate([readings(level)['F_N']
                                                   for level in (100.0, 300.0)]))


def test_a_run_whose_times_go_back_is_several_trials_of_its_name(readings):
    """Runs are numbered within each trial of the column."""
    data = read_measurement(long(*((TIME, readings(level), {'run': run}) for level, run in (
        (100.0, 3.0), (200.0, 3.0), (300.0, 8.0)))))
    assert data.trial_names == ('3 1', '3 2', '8 1')
    assert np.allclose(data.pressure[:, 0] / 1e3, np.repeat([100.0, 200.0, 300.0], 60))


def test_times_of_one_signal_that_go_back_are_refused(readings):
    """The readings of one sample cannot be found: an error."""
    table = long((TIME, readings(100.0), {}))
    table['time [s]'][100:120] -= 3.0
    with pytest.raises(InputError, match=r"row 101: the time of 'p_kPa' goes back"):
        read_measurement(table)


def test_signals_with_rates_of_their_own_are_read_at_the_slowest(readings):
    """A load cell at half the rate, a position between its samples."""
    shifted, slow = TIME + 0.01, TIME[::2]
    table = long((shifted, {'strain': readings(200.0, shifted)['strain']}, {}),
                 (TIME, {'p_kPa': readings(200.0)['p_kPa']}, {}),
                 (slow, {'F_N': readings(200.0, slow)['F_N']}, {}))
    data = read_measurement(table)
    assert len(data) == 29
    assert np.allclose(data.strain, readings(200.0, data.time)['strain'], atol=1e-3)
    assert np.allclose(data.force, readings(200.0, data.time)['F_N'])


def test_several_readings_under_one_coarse_stamp_keep_their_order(readings):
    """Stamps of whole seconds: the third reading of each signal belongs to the third row."""
    values = readings(200.0)
    data = read_measurement(long((np.floor(TIME), values, {})))
    assert np.allclose(data.strain, values['strain'])
    assert np.allclose(data.force, values['F_N'])
    assert np.all(np.diff(data.time) > 0)


def test_a_word_among_the_readings_of_a_signal_is_an_error(readings):
    """As in a column; of a signal that is not used words do not matter."""
    table = long((TIME, readings(200.0), {}))
    table['value'] = table['value'].astype(object)
    table['value'][130] = 'bad'
    with pytest.raises(InputError, match="F_N is 'bad'"):
        read_measurement(table)
    table['tag'][130] = 'valve'
    assert len(read_measurement(table)) == 59


@pytest.mark.parametrize(('good', 'bad'), [('Good', 'Bad'), (192.0, 0.0), ('1', '0')])
def test_readings_of_bad_quality_are_left_out_and_counted(readings, good, bad):
    """A controller writes 0 where a sensor is not there, and that the reading is bad."""
    table = long((TIME, readings(200.0), {}))
    table['quality'] = np.array([good] * 180, float if isinstance(good, float) else object)
    table['value'][130:132], table['quality'][130:132] = 0.0, bad
    data = read_measurement(table)
    assert len(data) == 58
    assert data.force.min() > 0.0
    assert any('2 readings of bad quality left out (first row 131)' in note
               for note in data.notes)


def test_names_beside_a_force_are_remarks(readings):
    """A table with columns of its own is not turned round because one of them is called tag."""
    values = readings(200.0)
    data = read_measurement({'time': TIME, **values, 'tag': np.array(['up', 'down'] * 30, object),
                             'value': np.arange(60.0)})
    assert np.allclose(data.force, values['F_N'])
