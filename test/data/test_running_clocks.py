# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""One clock that begins anew, pauses, is set back, or shows a part of the time only."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, taken_words
from fam_bundle_ros.errors import InputError

from .sampled import force, of_clock, pressure, strain, TIME


@pytest.mark.parametrize('whole', [True, False])
def test_milliseconds_beside_a_clock_are_added_where_it_has_none(muscle, whole):
    """A logger writes whole seconds and ms apart; beside a clock with decimals ms repeat them."""
    time = np.cumsum(0.02 + 0.06 * (np.arange(300) % 3 == 0)).round(3)  # no even rate
    shown = np.floor(time) if whole else time
    stamps = [str(np.datetime64('2024-03-11T10:15:00.000') + round(1e3 * t)) for t in shown]
    data = read_measurement({
        'Date&Time': np.array(stamps, object), 'ms': np.round(1e3 * (time - np.floor(time))),
        'strain': strain(time), 'p [kPa]': pressure(time), 'F [N]': force(time, muscle)})
    assert np.allclose(data.time - data.time[0], time - time[0], atol=1e-6)


@pytest.mark.parametrize(('header', 'bits', 'count'), [
    ('millis', 32, 1e3), ('t_us', 32, 1e6), ('time_ms', 16, 1e3)])
def test_a_counter_that_begins_anew_is_no_new_trial(header, bits, count, muscle):
    """millis() and micros() of a microcontroller; a clock that restarts elsewhere is one."""
    ticks = np.round(TIME * count)
    data = of_clock(header, (ticks + 2 ** bits - 3.3 * count) % 2 ** bits, muscle)
    assert len(data.trial_names) == 1
    assert np.allclose(np.diff(data.time), 0.05)
    assert any('began anew' in note for note in data.notes)
    back = of_clock(header, ticks % (6.0 * count), muscle)
    assert len(back.trial_names) == 4
    assert np.median(np.diff(back.time)) == pytest.approx(0.05)


@pytest.mark.parametrize(('header', 'scale', 'dial'), [
    ('time [s]', 1.0, 60.0), ('seconds', 1.0, 60.0), ('time [ms]', 1e3, 60e3),
    ('time [min]', 1.0 / 60.0, 60.0), ('time [s]', 1.0, 3600.0)])
def test_a_clock_that_shows_only_the_seconds_of_the_minute_runs_on(header, scale, dial, muscle):
    """Or the seconds of the hour: the recording is one trial."""
    data = of_clock(header, (scale * TIME + dial - 8.33 * scale) % dial, muscle)
    assert len(data.trial_names) == 1
    assert np.allclose(np.diff(data.time), 0.05)
    assert [note for note in data.notes if 'began anew' in note] == [
        f"the counter '{header}' began anew at {dial:.10g}: read on"]


def test_a_clock_of_minutes_and_seconds_runs_on_past_the_hour(muscle):
    """59:58.3 is followed by 00:01.2."""
    shown = [f'{int(t // 60):02d}:{t % 60:06.3f}' for t in (TIME + 3591.67) % 3600.0]
    data = of_clock('time', np.array(shown, object), muscle)
    assert len(data.trial_names) == 1
    assert np.allclose(np.diff(data.time), 0.05, atol=1e-6)


@pytest.mark.parametrize('first', [0.0, 7.5])
def test_trials_of_a_minute_remain_trials(first, muscle):
    """Their clock restarts at the reading at which it first began."""
    time = 0.6 * np.arange(100)
    clock = np.tile(first + time, 3)
    data = read_measurement({'time [s]': clock, 'strain': strain(clock),
                             'p [kPa]': pressure(clock), 'F [N]': force(clock, muscle)})
    assert len(data.trial_names) == 3
    assert not any('began anew' in note for note in data.notes)


@pytest.mark.parametrize(('unit', 'said'), [('ms', True), ('s', False)])
def test_rows_closer_than_the_sample_interval_have_another_unit(unit, said, muscle, tmp_path):
    """A head with ms over values in s: the sample interval above the table contradicts it."""
    rows = np.stack([TIME, strain(TIME), pressure(TIME), force(TIME, muscle)], -1)
    np.savetxt(tmp_path / 'log.csv', rows, '%.6f', ',', comments='', header=(
        f'Sample interval [s],0.05\n\ntime [{unit}],strain,pressure [kPa],force [N]'))
    notes = read_measurement(tmp_path / 'log.csv').notes
    assert any('is the unit of the time right?' in note for note in notes) == said


def test_a_clock_of_twelve_hours_runs_on_past_one(muscle):
    """12:59:59 without AM and PM is followed by 1:00:00."""
    at = [divmod(3590.0 + second, 3600.0) for second in TIME]
    clock = [f'{int(hour) or 12}:{int(rest // 60):02}:{rest % 60:05.2f}' for hour, rest in at]
    data = of_clock('Time', np.array(clock, object), muscle)
    assert len(data.trial_names) == 1
    assert np.allclose(np.diff(data.time), 0.05)


@pytest.mark.parametrize(('length', 'words'), [(60.0, '60 s'), (7.95, '8 s')])
def test_a_pause_of_the_log_begins_a_trial_and_is_said(muscle, length, words):
    """Runs in one file with one clock; a dropout of a second is no pause."""
    pause = np.where(TIME >= 10.0, length, 0.0)
    data = of_clock('time [s]', TIME + pause, muscle)
    assert np.bincount(data.trial).tolist() == [200, 200]
    assert any(f'pauses for {words} before row 201' in note for note in data.notes)
    assert len(of_clock('time [s]', TIME + pause / length, muscle).trial_names) == 1


def test_rows_that_were_written_in_another_order_are_put_in_order(muscle):
    """Rows that threads wrote in swapped order do not begin a trial."""
    order = np.arange(len(TIME))
    order[[100, 101, 250, 251]] = order[[101, 100, 251, 250]]
    data = read_measurement({'time [s]': TIME[order], 'strain': strain(TIME[order]), 'p [kPa]':
                             pressure(TIME[order]), 'F [N]': force(TIME[order], muscle)})
    assert len(data.trial_names) == 1
    assert np.array_equal(data.time, TIME)
    assert np.allclose(data.force, force(TIME, muscle))
    assert any('put in order' in note for note in data.notes)


def test_a_clock_that_is_set_back_is_told(muscle):
    """It goes back by half a second, not to the beginning: a note says so."""
    data = of_clock('time [s]', TIME - np.where(TIME >= 10.0, 0.5, 0.0), muscle)
    assert any('goes back by 0.45 s at row 201, not to where' in note for note in data.notes)
    assert not any('not to where' in note for note in of_clock(
        'time [s]', TIME % 10.0, muscle).notes)


def test_a_name_in_all_rows_beside_a_clock_that_restarts_is_answered(muscle):
    """The error tells what to write where the column names the specimen."""
    data = {'time [s]': TIME % 10.0, 'Test': np.full(len(TIME), 'PAM 3', object), 'strain': strain(
        TIME), 'p [kPa]': pressure(TIME), 'F [N]': force(TIME, muscle)}
    with pytest.raises(InputError, match='restart with each trial .--columns "trial=none"'):
        read_measurement(data)
    assert len(read_measurement(data, columns={'trial': 'none'}).trial_names) == 2


@pytest.mark.parametrize('clock', [TIME, [f'12:00:{second:05.2f}' for second in TIME]])
def test_an_offset_of_the_time_is_added(clock, muscle):
    """Also to times of day."""
    log = {'Time': np.array(clock), 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
           'F [N]': force(TIME, muscle)}
    plain, moved = (read_measurement(log, columns={'time': told})
                    for told in ('Time', 'Time + 1.7 s'))
    assert np.allclose(moved.time, plain.time + 1.7)


def test_cycles_of_a_clock_that_runs_on_are_one_trial(muscle):
    """Without a clock they are trials."""
    data = {'cycle': np.repeat(np.arange(4.0), 100), 'strain': strain(TIME), 'p [kPa]':
            pressure(TIME), 'F [N]': force(TIME, muscle)}
    assert len(read_measurement(data).trial_names) == 4
    assert len(read_measurement({**data, 'time [s]': TIME}).trial_names) == 1
    assert len(read_measurement({**data, 'time [s]': TIME % 5.0}).trial_names) == 4


@pytest.mark.parametrize('names', [('Timestamp', 'Time'), ('Time', 'Timestamp')])
def test_of_one_clock_with_two_zeros_one_is_taken(names, muscle):
    """Milliseconds since 1970 beside seconds since the start."""
    columns = {'Timestamp': np.round(1.7e12 + 1e3 * TIME), 'Time': TIME}
    log = {**{name: columns[name] for name in names}, 'strain': strain(TIME),
           'p [kPa]': pressure(TIME), 'F [N]': force(TIME, muscle)}
    data = read_measurement(log)
    assert np.allclose(data.time, TIME)
    assert "'Timestamp' (the same clock with another zero)" in taken_words(data)
    with pytest.raises(InputError, match='both may be time'):
        read_measurement({**log, 'Timestamp': 1.7e12 + 1010.0 * TIME})


@pytest.mark.parametrize('first', [2 ** 32 - 5e3, 4.1e9])
def test_a_counter_without_a_unit_is_not_seconds_since_1970(first, muscle):
    """Counted in ms since the start it may pass 2^32: those were seconds of the year 2106."""
    ticks = (np.round(1e3 * TIME) + first) % 2 ** 32
    with pytest.raises(InputError, match=r'"time=t \[ms\]"'):
        of_clock('t', ticks, muscle)
    assert np.allclose(np.diff(of_clock('t [ms]', ticks, muscle).time), 0.05)
