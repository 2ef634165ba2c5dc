# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels that were sampled at times of their own."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, read_recordings, Recipe, taken_words
from fam_bundle_ros.errors import InputError

TIME = 0.05 * np.arange(400)


def strain(time):
    """Return a sweep of the strain."""
    return 0.1 - 0.1 * np.cos(2 * np.pi * time / 10.0)


def pressure(time):
    """Return a pressure that rises, kPa."""
    return 100.0 + 15.0 * time


def force(time, muscle):
    """Return the force of the muscle at these times, N."""
    return muscle(strain(time), 1e3 * pressure(time))


def padded(values):
    """Return values with blanks to the length of the table."""
    return np.concatenate([values, np.full(len(TIME) - len(values), np.nan)])


@pytest.mark.parametrize('names', [('Time (s)', 'Time (s).1', 'Time (s).2'),
                                   ('t [s]', 't [s] (2)', 't [s] (3)'),
                                   ('time', 'time_1', 'time_2'),
                                   ('X_Value', 'X_Value (2)', 'X_Value (3)'),
                                   ('Time 1 (s)', 'Time 2 (s)', 'Time 3 (s)'),
                                   ('Strain time (s)', 'Pressure time (s)', 'Force time (s)'),
                                   ('te (s)', 'tp (s)', 'tF (s)'), ('te', 'tp', 'tF'),
                                   ('Time (s)', 'tp (s)', 'tF (s)')])
def test_a_slower_channel_is_read_at_its_own_times(names, muscle):
    """A load cell at half the rate, its rows at the top of the table, blanks below."""
    slow = padded(TIME[::2])
    data = read_measurement({
        names[0]: TIME, 'strain': strain(TIME), names[1]: TIME, 'p [kPa]': pressure(TIME),
        names[2]: slow, 'F [N]': force(slow, muscle)})
    assert len(data) == 200
    assert data.dropped_words == ''  # rows of the quicker channels are not lost
    assert '(but as the clock of ' in taken_words(data)
    assert np.allclose(data.time, TIME[::2])
    assert np.allclose(data.strain, strain(data.time), atol=1e-6)
    assert np.allclose(data.pressure[:, 0] / 1e3, pressure(data.time), atol=1e-6)
    assert np.allclose(data.force, force(data.time, muscle))
    assert any("read at the 200 of 'F [N]', the slowest" in note for note in data.notes)


def test_a_channel_that_began_later_is_shifted_back(muscle):
    """Times beyond those of another channel are left out, not made up."""
    later = TIME + 0.5
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
        'time [s] (2)': later, 'F [N]': force(later, muscle)})
    assert len(data) == 390
    assert data.time[0] == pytest.approx(0.5)
    assert np.allclose(data.force, force(data.time, muscle), atol=1.0)


@pytest.mark.parametrize('times', [('Time 1 (s)', 'Time 2 (s)'), ('X_Value', 'X_Value (2)')])
def test_a_clock_with_as_many_readings_is_one_of_its_own_by_its_name(times, muscle):
    """Two devices of one rate, of which the second began later."""
    later = TIME + 0.5
    data = read_measurement({
        times[0]: TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME), times[1]: later,
        'F [N]': force(later, muscle)})
    assert np.allclose(data.force, force(data.time, muscle), atol=1.0)


def test_channels_of_several_rates_are_brought_together_trial_by_trial(muscle):
    """All clocks restart with the second trial, which begins a little later."""
    quick, slow = TIME[:200], TIME[:200:2]
    both = np.concatenate([quick, quick + 0.05])
    few = np.concatenate([slow, padded(slow)[100:200], slow + 0.05, padded(slow)[100:200]])
    data = read_measurement({
        'time [s]': both, 'strain': strain(both), 'p [kPa]': pressure(both),
        'time [s] (2)': few, 'F [N]': force(few, muscle)})
    assert np.bincount(data.trial).tolist() == [100, 100]
    assert np.allclose(data.strain, strain(few[np.isfinite(few)]))
    assert np.allclose(data.force, force(few[np.isfinite(few)], muscle))


@pytest.mark.parametrize('names', [('time [s]', 'time 2 [s]'), ('t_e (s)', 't_p (s)')])
@pytest.mark.parametrize(('every', 'trials'), [(2, 1), (10, 1), (4, 4)])
def test_a_slower_channel_on_the_right_of_a_text_file(names, every, trials, muscle, tmp_path):
    """The rows below its last reading end with separators; its clock restarts with each trial."""
    head = ['trial', names[0], 'strain [%]', 'F [N]', names[1], 'p [kPa]']
    rows = [[trial, f'{time:.2f}', f'{100 * strain(time):.5f}', f'{force(time, muscle):.5f}', *(
        (f'{time * every:.2f}', f'{pressure(time * every):.4f}') if at * every < len(TIME) else
        ('', ''))] for trial in range(trials) for at, time in enumerate(TIME)]
    (tmp_path / 'log.csv').write_text('\n'.join(','.join(map(str, row)) for row in [head, *rows]))
    data = read_measurement(tmp_path / 'log.csv')
    assert np.bincount(data.trial).tolist() == [len(TIME) // every] * trials
    first = data.trial == 0
    assert np.allclose(data.time[first], TIME[::every])
    assert np.allclose(data.pressure[first, 0] / 1e3, pressure(TIME[::every]), atol=1e-3)
    assert np.allclose(data.force[first], force(TIME[::every], muscle), atol=1e-3)


@pytest.mark.parametrize('first', [0.0, -20.0])
def test_the_slowest_channel_is_that_in_the_time_of_all(first, muscle):
    """As many readings at half the rate are of twice the time."""
    twice = 2.0 * TIME + first
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'time [s] (2)': twice,
        'p [kPa]': pressure(twice), 'F [N]': force(twice, muscle)})
    assert np.allclose(data.time, TIME[::2])
    assert np.allclose(data.strain, strain(data.time))
    assert np.allclose(data.force, force(data.time, muscle))


@pytest.mark.parametrize(('stamps', 'said'), [
    (1.7e9 + TIME, '1700000000 to 1700000020'), (padded(np.array([-1.0, 60.0])), '-1 to 60')])
def test_times_without_a_common_part_are_refused(stamps, said, muscle):
    """One clock since the start, and one since 1970, or with no reading in between."""
    with pytest.raises(InputError, match=f'no time in common .*force {said} s'):
        read_measurement({
            'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
            'time [s] (2)': stamps, 'F [N]': force(TIME, muscle)})


def test_rows_of_one_channel_each_are_brought_together(muscle):
    """As PlotJuggler exports topics: no row has all readings."""
    stamps = np.sort(np.concatenate([TIME, TIME + 0.001, TIME + 0.002]))
    turn = np.arange(len(stamps)) % 3

    def only(k, values):
        return np.where(turn == k, values, np.nan)

    data = read_measurement({
        '__time': 1.71e9 + stamps, '/cell/wrench/force/z': only(0, force(stamps, muscle)),
        '/strain/data': only(1, strain(stamps)),
        '/mu1/pressure/fluid_pressure': only(2, 1e3 * pressure(stamps) + 101325.0)})
    assert len(data) >= 398
    at = data.time - data.time[0] + 0.05
    assert np.allclose(data.force, force(at, muscle), atol=0.5)
    assert np.allclose(data.pressure[:, 0] / 1e3, pressure(at), atol=0.1)


def test_structs_with_other_times_keep_them(muscle, tmp_path):
    """Simulink's timeseries of two devices, as many samples but begun apart."""
    savemat = pytest.importorskip('scipy.io').savemat
    later = TIME + 0.5
    savemat(tmp_path / 'log.mat', {
        'strain': {'Time': TIME, 'Data': strain(TIME)},
        'p_kPa': {'Time': TIME, 'Data': pressure(TIME)},
        'F_N': {'Time': later, 'Data': force(later, muscle)}})
    data = read_measurement(tmp_path / 'log.mat')
    assert np.allclose(data.force, force(data.time, muscle), atol=1.0)
    assert np.allclose(data.pressure[:, 0] / 1e3, pressure(data.time), atol=0.01)


def test_structs_in_structs_keep_their_times_too(muscle, tmp_path):
    """Each device in a struct of its own: the times of one are not those of the other."""
    savemat = pytest.importorskip('scipy.io').savemat
    later = TIME + 0.5
    savemat(tmp_path / 'log.mat', {
        'drive': {'strain': {'Time': TIME, 'Data': strain(TIME)},
                  'p_kPa': {'Time': TIME, 'Data': pressure(TIME)}},
        'cell': {'F_N': {'Time': later, 'Data': force(later, muscle)}}})
    data = read_measurement(tmp_path / 'log.mat', columns={'strain': 'drive.strain'})
    assert np.allclose(data.force, force(data.time, muscle), atol=1.0)
    assert len(data) == 390


def test_vectors_of_several_lengths_have_the_clock_of_their_length(muscle, tmp_path):
    """In the order of the alphabet, as MATLAB saves a workspace."""
    savemat = pytest.importorskip('scipy.io').savemat
    slow, slower = TIME[::2], TIME[::4]
    savemat(tmp_path / 'log.mat', {'F_N': force(slower, muscle), 'p_kPa': pressure(slow),
                                   'strain': strain(TIME), 't_F': slower, 't_e': TIME,
                                   't_p': slow})
    data = read_measurement(tmp_path / 'log.mat')
    assert np.allclose(data.time, slower)
    assert np.allclose(data.strain, strain(slower))
    assert np.allclose(data.pressure[:, 0] / 1e3, pressure(slower))
    assert np.allclose(data.force, force(slower, muscle))


def test_a_count_of_fewer_readings_is_no_clock_beside_one(muscle):
    """It rises like a clock, and is filled as far as the column on its right."""
    data = read_measurement({
        'time [s]': TIME, 'row': np.arange(400.0), 'strain': strain(TIME),
        'p [kPa]': pressure(TIME), 'count': padded(np.arange(200.0)),
        'F [N]': padded(force(TIME[:200], muscle))})
    assert np.allclose(data.time, TIME[:200])
    assert np.allclose(data.force, force(data.time, muscle))


def test_clocks_with_a_unit_of_time_need_no_name_of_one(muscle):
    """Where something else is missing the message says what they are."""
    slow = TIME[::2]
    log = {'te (ms)': 1e3 * TIME, 'strain': strain(TIME), 'tF (ms)': padded(1e3 * slow),
           'p [kPa]': padded(pressure(slow)), 'F [N]': padded(force(slow, muscle))}
    assert np.allclose(read_measurement(log).time, slow)
    del log['F [N]']
    with pytest.raises(InputError, match=r"'tF \(ms\)' a clock of columns on its right"):
        read_measurement(log)


def test_a_clock_that_is_told_is_that_of_all(muscle):
    """Though the columns have clocks of their own, it is the user who knows."""
    half = TIME[:200]
    data = read_measurement({
        'row': TIME, 'te (s)': TIME, 'strain': strain(half.repeat(2)), 'p [kPa]': pressure(TIME),
        'tF (s)': padded(2.0 * half), 'F [N]': padded(force(half, muscle))},
        columns={'time': 'row [s]'})
    assert np.allclose(data.time, half)


@pytest.mark.parametrize(('clock', 'beside'), [
    ('time [s]', 'valve open total [s]'), ('time [s]', 'Energy'), ('Step', 'Energy'),
    ('time [s]', 'tank'), ('date', 'Air mass'), ('date', 'tF (s)')])
def test_a_column_that_rises_is_no_clock_where_the_last_row_is_cut(clock, beside, muscle):
    """Its name says no time, or the table has dates; the row without a force is left out."""
    time = [f'2025-02-03 10:00:{second:06.3f}' for second in TIME] if clock == 'date' else TIME
    sums = 0.9 * TIME + 0.001 * np.sin(TIME)
    data = read_measurement({
        clock: np.array(time), 'No': np.arange(400.0), 'strain': strain(TIME),
        'p [kPa]': pressure(TIME), beside: padded(sums[:-1]),
        'F [N]': padded(force(TIME, muscle)[:-1])})
    assert len(data) == 399
    assert np.allclose(data.force, force(TIME[:-1], muscle))
    assert np.allclose(data.pressure[:, 0] / 1e3, pressure(TIME[:-1]))


@pytest.mark.parametrize(('name', 'cut', 'said'), [
    ('drive time [s]', 1, True), ('pump run time [s]', 1, False),
    ('pump run time [s]', 15, False)])
def test_another_time_in_a_table_that_is_cut_is_no_clock(name, cut, said, muscle):
    """A last row was not written to its end; the time of a pump is no clock in any case."""
    whole = TIME[:-cut]
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
        name: padded(0.7 * whole), 'F [N]': padded(force(whole, muscle))})
    assert len(data) == len(whole)
    assert np.allclose(data.force, force(whole, muscle))
    assert (f"'time [s]' and '{name}' show other times" in ' '.join(data.notes)) == said


def test_a_time_that_is_told_is_that_of_all_columns():
    """Also where it is one of the clocks that were found; the message names both."""
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
        'drive time [s]': padded(0.95 * TIME[:-2]), 'F [N]': padded(20.0 + TIME[:-2])},
        columns={'time': 'time [s]'})
    assert np.allclose(data.force, 20.0 + TIME[:-2])
    assert "'time [s]' and 'drive time [s]' differ" in ' '.join(data.notes)


@pytest.mark.parametrize('names', [
    ('time', 'time ms'), ('t_a [s]', 't_b [ms]'), ('Time 1 (s)', 'Time 2 (ms)'),
    ('time_cam [ms]', 'time_daq [s]'), ('time_cam [ms]', 'time')])
@pytest.mark.parametrize('start', [0.0, 1.7e9])
def test_clocks_in_seconds_and_milliseconds_are_two(names, start, muscle):
    """A slower channel whose times have another unit."""
    slow = TIME[::2]
    first, second = (1e3 if 'ms' in name else 1.0 for name in names)
    data = read_measurement({
        names[0]: first * (start + TIME), 'strain': strain(TIME),
        names[1]: padded(second * (start + slow)), 'p [kPa]': padded(pressure(slow)),
        'F [N]': padded(force(slow, muscle))})
    assert np.allclose(data.time - data.time[0], slow, atol=1e-5)
    assert np.allclose(data.strain, strain(slow), atol=1e-5)
    assert np.allclose(data.force, force(slow, muscle))


def test_times_that_a_column_on_their_right_exceeds_are_no_clocks(muscle):
    """A force that goes on below the last of these times has others."""
    with pytest.raises(InputError, match='both may be time'):
        read_measurement({
            'Strain time (s)': TIME, 'strain': strain(TIME),
            'Pressure time (s)': padded(TIME[::2]), 'p [kPa]': padded(pressure(TIME[::2])),
            'F [N]': force(TIME, muscle)})


@pytest.mark.parametrize('turned', [False, True])
def test_matrices_of_time_and_reading_are_channels(muscle, tmp_path, turned):
    """Simulink's To Workspace writes [t y] for each signal, at the rate of the signal."""
    savemat = pytest.importorskip('scipy.io').savemat
    slow = TIME[::2]
    pairs = {'strain': (TIME, strain(TIME)), 'p_kPa': (slow, pressure(slow)),
             'F_N': (TIME, force(TIME, muscle))}
    savemat(tmp_path / 'log.mat', {name: np.stack(pair, 0 if turned else 1)
                                   for name, pair in pairs.items()})
    data = read_measurement(tmp_path / 'log.mat')
    assert len(data) == 200
    assert np.allclose(data.strain, strain(data.time))
    assert np.allclose(data.force, force(data.time, muscle))


def test_equal_clocks_change_nothing(muscle):
    """Each channel has a clock, and all show the same time."""
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'time [s] (2)': TIME, 'p [kPa]': pressure(TIME),
        'F [N]': force(TIME, muscle)})
    assert len(data) == len(TIME)
    assert not any('times of their own' in note for note in data.notes)


def test_other_times_that_go_back_are_refused(muscle):
    """Runs of one channel cannot be told from those of another."""
    twice = np.concatenate([TIME[:200], TIME[:200]])
    with pytest.raises(InputError, match='the times of force go back'):
        read_measurement({'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
                          'time [s] (2)': twice, 'F [N]': force(twice, muscle)})


def test_channels_that_meet_in_a_few_rows_only_are_brought_together_too(muscle):
    """A log of events: now and then two readings have one stamp, and the other rows count too."""
    times = [TIME + np.where(np.arange(400) % 40, shift, 0.0) for shift in (0.0, 0.01, 0.02)]
    at = np.unique(np.round(np.concatenate(times), 6))
    columns = {'time [s]': at}
    for name, own, values in zip(('strain', 'p [kPa]', 'F [N]'), times, (
            strain, pressure, lambda t: force(t, muscle))):
        columns[name] = np.where(np.isin(at, np.round(own, 6)), values(at), np.nan)
    data = read_measurement(columns)
    assert len(data) > 390
    assert np.allclose(data.force, force(data.time, muscle), atol=1.0)


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


def of_clock(header, clock, muscle):
    """Return a log of one trial with this clock."""
    return read_measurement({header: clock, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
                             'F [N]': force(TIME, muscle)})


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


def test_a_pause_of_the_log_begins_a_trial_and_is_said(muscle):
    """Runs in one file with one clock; a dropout of a second is no pause."""
    pause = np.where(TIME >= 10.0, 60.0, 0.0)
    data = of_clock('time [s]', TIME + pause, muscle)
    assert np.bincount(data.trial).tolist() == [200, 200]
    assert any('pauses for 60 s before row 201' in note for note in data.notes)
    assert len(of_clock('time [s]', TIME + pause / 60.0, muscle).trial_names) == 1


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


def table(path, header, *columns):
    """Write a CSV file with these columns."""
    rows = [','.join(f'{cell:.4f}' if isinstance(cell, float) else str(cell) for cell in row)
            for row in zip(*columns)]
    path.write_text('\n'.join([*([header] if header else []), *rows]))
    return path


def test_a_file_for_each_sensor_is_one_recording(muscle, tmp_path):
    """Two loggers with the time since 1970 in s and in ms; runs stay runs."""
    force_file = table(tmp_path / 'daq.csv', 'Time (s),Force (N),strain', 1.7e9 + TIME,
                       force(TIME, muscle), strain(TIME))
    slow = TIME[4::4]
    pressure_file = table(tmp_path / 'plc.csv', 'stamp [ms],p [bar]', 1.7e12 + 1e3 * slow,
                          pressure(slow) / 100.0)
    (data,) = read_recordings([force_file, pressure_file])
    assert np.allclose(data.time - data.time[0], slow - slow[0], atol=1e-5)
    assert np.allclose(data.strain, strain(slow), atol=1e-4)
    assert np.allclose(data.force, force(slow, muscle), atol=0.5)
    assert any('daq.csv, plc.csv: parts of one recording' in note for note in data.notes)
    whole = table(tmp_path / 'run.csv', 'time [s],strain,p [kPa],F [N]', TIME, strain(TIME),
                  pressure(TIME), force(TIME, muscle))
    assert [len(run) for run in read_recordings([whole, whole])] == [len(TIME)] * 2


@pytest.mark.parametrize('told', ['time + 1.5 s', 'time 2 - 1.5 s'])
def test_files_that_began_apart_are_brought_together_by_the_difference(told, muscle, tmp_path):
    """Each began at 0 when its button was pressed; one clock is told with its delay."""
    later = TIME[30:]
    files = [table(tmp_path / 'daq.csv', 'Time (s),Force (N),p [kPa]', later - 1.5,
                   force(later, muscle), pressure(later)),
             table(tmp_path / 'mocap.csv', 'Time (s),strain', TIME, strain(TIME))]
    (data,) = read_recordings(files, recipe=Recipe(columns={'time': told}))
    assert len(data) == 370
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]), atol=0.5)


@pytest.mark.parametrize('clock', [TIME, [f'12:00:{second:05.2f}' for second in TIME]])
def test_an_offset_of_the_time_is_added(clock, muscle):
    """Also to times of day."""
    log = {'Time': np.array(clock), 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
           'F [N]': force(TIME, muscle)}
    plain, moved = (read_measurement(log, columns={'time': told})
                    for told in ('Time', 'Time + 1.7 s'))
    assert np.allclose(moved.time, plain.time + 1.7)


def test_files_of_topics_without_names_are_told_with_their_files_names(muscle, tmp_path):
    """`ros2 topic echo --csv` writes seconds, nanoseconds, a frame and the numbers."""
    whole, part = np.divmod(np.round(TIME * 1e9).astype(int), 10 ** 9)
    stamp = (whole + 1_700_000_000, part, ['cell'] * len(TIME))
    files = [table(tmp_path / f'{name}.csv', '', *stamp, values, *[np.zeros(len(TIME))] * more)
             for name, values, more in (('cell', force(TIME, muscle), 5), ('gauge', 1e3 * pressure(
                 TIME), 1), ('pot', strain(TIME), 0))]
    told = {'force': 'cell column 4 [N]', 'pressure': 'gauge column 4 [Pa]',
            'strain': 'pot column 4'}
    (data,) = read_recordings(files, recipe=Recipe(columns=told))
    assert np.allclose(data.time - data.time[0], TIME, atol=1e-5)
    assert np.allclose(data.force, force(TIME, muscle), atol=1e-3)


def test_cycles_of_a_clock_that_runs_on_are_one_trial(muscle):
    """Without a clock they are trials."""
    data = {'cycle': np.repeat(np.arange(4.0), 100), 'strain': strain(TIME), 'p [kPa]':
            pressure(TIME), 'F [N]': force(TIME, muscle)}
    assert len(read_measurement(data).trial_names) == 4
    assert len(read_measurement({**data, 'time [s]': TIME}).trial_names) == 1
    assert len(read_measurement({**data, 'time [s]': TIME % 5.0}).trial_names) == 4


@pytest.mark.parametrize(('first', 'delay'), [(5.0, 0.0), (1.7e9, 0.4), (1.7e9 - 12.0, 0.0)])
def test_topics_with_and_without_stamps_are_read_when_they_were_received(first, delay, muscle,
                                                                         tmp_path):
    """Stamps since boot, of a clock that is off, or older than the time of receipt."""
    pytest.importorskip('rosbags')
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS2_JAZZY)
    time, header, vector, wrench, force_of, number = (store.types[name] for name in (
        'builtin_interfaces/msg/Time', 'std_msgs/msg/Header', 'geometry_msgs/msg/Vector3',
        'geometry_msgs/msg/Wrench', 'geometry_msgs/msg/WrenchStamped', 'std_msgs/msg/Float64'))
    zero = vector(0.0, 0.0, 0.0)
    with Writer(tmp_path / 'run', version=9) as bag:
        topics = {topic: bag.add_connection(topic, kind.__msgtype__, typestore=store)
                  for topic, kind in (('/cell/wrench', force_of), ('/pam/pressure_kPa', number),
                                      ('/pam/contraction', number))}
        for now, pull in zip(TIME, force(TIME, muscle)):
            head = header(time(*divmod(int(1e9 * (first + now)), 10 ** 9)), '')
            for topic, message in (
                    ('/cell/wrench', force_of(head, wrench(vector(pull, 0.0, 0.0), zero))),
                    ('/pam/pressure_kPa', number(pressure(now))),
                    ('/pam/contraction', number(strain(now)))):
                bag.write(topics[topic], int(1e9 * (1.7e9 + now + delay)),
                          store.serialize_cdr(message, message.__msgtype__))
    data = read_measurement(tmp_path / 'run')
    assert len(data) == len(TIME)
    assert np.allclose(data.force, force(TIME, muscle))
    assert np.allclose(data.strain, strain(TIME))
    assert "'/cell/wrench' has stamps and '/pam/pressure_kPa' has none" in ' '.join(data.notes)


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


@pytest.mark.parametrize(('rate', 'said'), [(0.7, True), (1.0, False), (1.0005, False)])
def test_times_of_a_column_that_differ_from_the_clock_are_told(rate, said, muscle):
    """It may be the clock of the force; a constant and a drift are no difference."""
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
        'drive time [ms]': 1e5 + 1e3 * rate * TIME, 'F [N]': force(TIME, muscle)})
    assert np.allclose(data.time, TIME)
    assert ("'time [s]' and 'drive time [ms]' show other times" in ' '.join(data.notes)) == said
