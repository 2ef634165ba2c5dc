# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels of one table that were sampled at times of their own."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, taken_words
from fam_bundle_ros.data.clocks import of_calendar, of_day
from fam_bundle_ros.errors import InputError

from .sampled import force, padded, pressure, strain, TIME


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


@pytest.mark.parametrize(('rate', 'said'), [(0.7, True), (1.0, False), (1.0005, False)])
def test_times_of_a_column_that_differ_from_the_clock_are_told(rate, said, muscle):
    """It may be the clock of the force; a constant and a drift are no difference."""
    data = read_measurement({
        'time [s]': TIME, 'strain': strain(TIME), 'p [kPa]': pressure(TIME),
        'drive time [ms]': 1e5 + 1e3 * rate * TIME, 'F [N]': force(TIME, muscle)})
    assert np.allclose(data.time, TIME)
    assert ("'time [s]' and 'drive time [ms]' show other times" in ' '.join(data.notes)) == said


def test_a_clock_that_may_be_is_named_with_what_the_file_says(tmp_path, log):
    """A rate above the table is that of the advice; pauses do not hide a rising column."""
    _, strain, pressure, force = log
    rows = ''.join(f'{at},{strain[at]:.5f},{pressure[at]:.1f},{force[at]:.3f}\n'
                   for at in range(len(strain)))
    path = tmp_path / 'log.csv'
    path.write_text('Abtastrate;20;Hz\n\nsample,strain,p [Pa],F [N]\n' + rows)
    data = read_measurement(path)
    assert '--columns "time=20 Hz", as \'Abtastrate;20;Hz\' says' in data.notes[0]
    tick = np.arange(len(strain)) * 5.0 + np.where(np.arange(len(strain)) < 100, 0, 200)
    table = {'tick [10 ms]': tick, 'strain': strain, 'p [Pa]': pressure, 'F [N]': force}
    note, = read_measurement(table).notes
    assert 'rises throughout' in note
    assert '"time=tick [10 ms] * 10 ms"' in note
    told = read_measurement(table, columns={'time': 'tick [10 ms] * 10 ms'})
    assert told.time[99] == pytest.approx(4.95)
    days = {'datenum': 739000.4 + log[0] / 86400, 'strain': strain, 'p [Pa]': pressure,
            'F [N]': force}
    assert np.ptp(read_measurement(days).time) == pytest.approx(log[0][-1], abs=1e-4)


@pytest.mark.parametrize('end', ['', '.5'])
def test_digits_of_date_and_time_are_no_milliseconds(tmp_path, log, end):
    """'20261231235959' was a time of the year 2612 in ms, and the log a thousandth as long."""
    _, strain, pressure, force = log
    stamps = [f'20261231{23:02d}{58 + at // 60:02d}{at % 60:02d}{end}' if at < 120 else
              f'20270101{0:02d}{(at - 120) // 60:02d}{at % 60:02d}{end}'
              for at in range(len(strain))]
    path = tmp_path / 'log.csv'
    path.write_text('timestamp,strain,p [Pa],F [N]\n' + ''.join(
        f'{stamp},{e:.5f},{p:.1f},{f:.3f}\n'
        for stamp, e, p, f in zip(stamps, strain, pressure, force)))
    data = read_measurement(path)
    assert np.allclose(np.diff(data.time), 1.0)
    assert data.taken[0].why == 'digits of date and time'


@pytest.mark.parametrize('numbers', [
    [1.764e12, 1.764e12 + 50], [20261331000000.0, 20261331000001.0], [20261128102060.0] * 2])
def test_other_numbers_are_no_digits_of_a_date(numbers):
    """Milliseconds since 1970, month 13, second 60."""
    assert of_calendar(np.array(numbers)) is None


@pytest.mark.parametrize('name', ['Time', 'Time [s]'])
def test_digits_of_the_time_of_day_do_not_pause(log, name):
    """102059.9 and 102100.0 are 0.1 s apart: a pause of 40 s began a new trial each minute."""
    clock = 37200.0 + 0.5 * np.arange(len(log[0]))
    digits = 1e4 * (clock // 3600) + 100 * (clock // 60 % 60) + clock % 60
    table = {name: digits, 'strain': log[1], 'p [Pa]': log[2], 'F [N]': log[3]}
    data = read_measurement(table)
    assert np.allclose(np.diff(data.time), 0.5)
    assert data.taken[0].why == 'digits of the time of day, HHMMSS'
    assert np.allclose(np.diff(read_measurement(table, columns={'time': name}).time), 0.5)


@pytest.mark.parametrize('clock', [
    0.1 * np.arange(240), np.r_[np.arange(50.0, 60.0), np.arange(130.0, 150.0)],
    np.arange(55.0, 65.0)])
def test_seconds_are_no_digits_of_the_time_of_day(clock):
    """No minute is passed, a true pause is longer, seconds go beyond 60."""
    assert of_day(clock) is None
