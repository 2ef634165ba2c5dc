# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels of LabVIEW and MATLAB files have their own starts, rates and constants."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement

#: Names, units, samples of each channel.
CHANNELS = {'Strain': '%', 'Pressure': 'kPa', 'Force': 'N'}
COUNT = 200
#: s: when each channel began, and its step.
STARTS = [((0.0, 0.0, 1.7), (0.1, 0.1, 0.1)), ((1.7, 1.7, 0.0), (0.1, 0.1, 0.1)),
          ((0.0, 0.0, 0.0), (0.1, 0.1, 0.05)), ((0.0, 0.0, 0.5), (0.05, 0.05, 0.1))]


def readings(name, time, muscle):
    """Return the readings of a channel at some times, in its unit."""
    strain, pressure = 0.1 - 0.1 * np.cos(2 * np.pi * time / 10.0), 100.0 + 15.0 * time
    return {'Strain': 100.0 * strain, 'Pressure': pressure,
            'Force': muscle(strain, 1e3 * pressure)}[name]


def check(data, starts, steps, muscle):
    """Raise unless readings are those at their times, in all the time that channels share."""
    begin, end = max(starts), min(start + step * (COUNT - 1) for start, step in zip(starts, steps))
    time = data.time - data.time[0] + begin
    assert np.allclose(time, np.arange(begin, end + 1e-6, max(steps)))
    for name, values in zip(CHANNELS, (100.0 * data.strain, data.pressure[:, 0] / 1e3,
                                       data.force)):
        assert np.allclose(values, readings(name, time, muscle), atol=0.5), name
    assert any('channels with times of their own' in note for note in data.notes)


def tdms(path, groups, muscle):
    """Write groups of waveforms, of each the properties of each channel and its true times."""
    nptdms = pytest.importorskip('nptdms')
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([
            nptdms.ChannelObject(group, name, readings(name, start + step * np.arange(
                *count or (COUNT,)), muscle), {'unit_string': unit, **told})
            for group, channels in groups.items()
            for (name, unit), (told, start, step, *count) in zip(CHANNELS.items(), channels)])


def began(start):
    """Return a time of day so many seconds after noon."""
    return np.datetime64('2026-05-03T12:00:00') + np.timedelta64(round(1e6 * start), 'us')


@pytest.mark.parametrize(('starts', 'steps'), STARTS)
@pytest.mark.parametrize('told', [
    lambda start: {'wf_start_time': began(start), 'wf_start_offset': 0.0},
    lambda start: {'wf_start_time': began(0.0), 'wf_start_offset': start},
    lambda start: {'wf_start_time': began(start - 1.0), 'wf_start_offset': 1.0}])
def test_waveforms_have_their_own_starts_and_rates(told, starts, steps, muscle, tmp_path):
    """As many samples each; the start is a date, an offset, or both."""
    tdms(tmp_path / 'log.tdms', {'Log': [
        ({'wf_increment': step, **told(start)}, start, step)
        for start, step in zip(starts, steps)]}, muscle)
    check(read_measurement(tmp_path / 'log.tdms'), starts, steps, muscle)


def test_a_start_that_was_not_set_is_that_of_the_first(muscle, tmp_path):
    """LabVIEW writes its year 1904, or nothing."""
    tdms(tmp_path / 'log.tdms', {'Log': [
        ({'wf_increment': 2.0, **told}, 0.0, 0.1) for told in (
            {'wf_start_time': began(0.0)}, {'wf_start_time': np.datetime64('1904-01-01T00:00:00')},
            {})]}, muscle)
    data = read_measurement(tmp_path / 'log.tdms')
    assert len(data) == COUNT
    assert not any('times of their own' in note for note in data.notes)


def test_a_channel_without_an_increment_has_the_clock_of_one_with_as_many_samples(muscle,
                                                                                   tmp_path):
    """The force is of the task of the strain, though it stands right of a slower pressure."""
    nptdms = pytest.importorskip('nptdms')
    time = 0.05 * np.arange(COUNT)
    with nptdms.TdmsWriter(str(tmp_path / 'log.tdms')) as writer:
        writer.write_segment([
            nptdms.ChannelObject('Log', name, readings(name, time[::every], muscle), {
                'unit_string': CHANNELS[name], **({'wf_increment': step} if step else {})})
            for name, every, step in (('Strain', 1, 0.05), ('Pressure', 4, 0.2),
                                      ('Force', 1, None))])
    data = read_measurement(tmp_path / 'log.tdms')
    assert np.allclose(data.time, time[::4])
    assert np.allclose(data.force, readings('Force', data.time, muscle))


def test_a_channel_of_times_goes_before_the_increments(muscle, tmp_path):
    """A program that samples by itself writes its times, and increments of 1."""
    nptdms = pytest.importorskip('nptdms')
    time = 0.05 * np.arange(COUNT)
    with nptdms.TdmsWriter(str(tmp_path / 'log.tdms')) as writer:
        writer.write_segment([nptdms.ChannelObject('Log', 'Elapsed', time, {'unit_string': 's'})])
        writer.write_segment([
            nptdms.ChannelObject('Log', name, readings(name, time, muscle),
                                 {'unit_string': unit, 'wf_increment': 1.0})
            for name, unit in CHANNELS.items()])
    assert np.allclose(read_measurement(tmp_path / 'log.tdms').time, time)


def test_groups_whose_channels_begin_apart_remain_trials(muscle, tmp_path):
    """In one of the groups all channels begin together; in one the force stops first."""
    tdms(tmp_path / 'log.tdms', {run: [
        ({'wf_increment': 0.1, 'wf_start_time': began(start + late)}, late, 0.1, count)
        for late, count in ((0.0, COUNT), (0.0, COUNT), (delay, COUNT - lost))]
        for run, start, delay, lost in (
            ('Run 1', 0.0, 0.5, 0), ('Run 2', 60.0, 0.0, 7), ('Run 3', 120.0, 0.3, 0))}, muscle)
    data = read_measurement(tmp_path / 'log.tdms')
    assert data.trial_names == ('Run 1', 'Run 2', 'Run 3')
    assert np.bincount(data.trial).tolist() == [COUNT - 5, COUNT - 7, COUNT - 3]
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]), atol=0.5)


def lvm(path, clocks, starts, steps, muscle, segments=1, relative=True):
    """Write a .lvm file of channels with these starts and steps, s."""
    gap = '\t\t' if clocks == 'Multi' else '\t'
    lines = ['LabVIEW Measurement', 'Separator\tTab', 'Decimal_Separator\t.',
             f'X_Columns\t{clocks}', f"Time_Pref\t{'Relative' if relative else 'Absolute'}",
             'Date\t2026/05/03', 'Time\t12:00:00', '***End_of_Header***']
    stamps = [str(began(start))[11:].replace('.', ',') for start in starts]
    for _ in range(segments):
        lines += ['', 'Channels\t3', f'Time\t{gap.join(stamps)}',
                  f'Y_Unit_Label\t{gap.join(CHANNELS.values())}',
                  f"X0\t{gap.join(['0.0'] * 3)}", f'Delta_X\t{gap.join(map(str, steps))}',
                  '***End_of_Header***']
        lines += ['\t'.join(f'X_Value\t{name}' for name in CHANNELS) if clocks == 'Multi' else
                  '\t'.join(['X_Value', *CHANNELS])]
        for row in range(COUNT):
            times = [start + step * row for start, step in zip(starts, steps)]
            cells = [f'{readings(name, time, muscle):.4f}' for name, time in zip(CHANNELS, times)]
            shown = [f'{time - relative * start:.3f}' for time, start in zip(times, starts)]
            lines.append('\t'.join(f'{time}\t{cell}' for time, cell in zip(shown, cells))
                         if clocks == 'Multi' else '\t'.join(['', *cells]))
    path.write_text('\n'.join(lines))


@pytest.mark.parametrize(('starts', 'steps'), STARTS)
@pytest.mark.parametrize('clocks', ['Multi', 'No'])
def test_channels_of_an_lvm_file_have_their_own_starts_and_rates(clocks, starts, steps, muscle,
                                                                 tmp_path):
    """Times count from the channel's own Date and Time; X0 and Delta_X are the channel's."""
    lvm(tmp_path / 'log.lvm', clocks, starts, steps, muscle)
    check(read_measurement(tmp_path / 'log.lvm'), starts, steps, muscle)


def test_absolute_times_of_an_lvm_file_include_the_start(muscle, tmp_path):
    """By its header: Time_Pref Absolute."""
    lvm(tmp_path / 'log.lvm', 'Multi', *STARTS[0], muscle, relative=False)
    check(read_measurement(tmp_path / 'log.lvm'), *STARTS[0], muscle)


def test_segments_of_an_lvm_file_with_several_rates_are_trials(muscle, tmp_path):
    """Each channel of each segment begins anew."""
    lvm(tmp_path / 'log.lvm', 'Multi', *STARTS[3], muscle, segments=2)
    data = read_measurement(tmp_path / 'log.lvm')
    assert len(data.trial_names) == 2
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]), atol=0.5)
    assert np.allclose(data.force, np.tile(data.force[:len(data) // 2], 2))


def test_a_number_in_a_struct_of_a_trial_is_of_all_its_rows(muscle, tmp_path):
    """`trials(i).pressure_kPa = 100` beside the vectors of the trial."""
    savemat = pytest.importorskip('scipy.io').savemat
    trials = np.zeros(3, dtype=[(name, object) for name in (
        'name', 'pressure_kPa', 'time', 'strain', 'force_N')])
    for at, (pressure, rows) in enumerate(((100.0, 40), (300.0, 50), (200.0, 60))):
        time = 0.1 * np.arange(rows)
        strain = 0.1 - 0.1 * np.cos(time)
        trials[at] = f'trial {at}', pressure, time, strain, muscle(strain, 1e3 * pressure)
    savemat(tmp_path / 'log.mat', {'trials': trials})
    data = read_measurement(tmp_path / 'log.mat')
    assert np.bincount(data.trial).tolist() == [40, 50, 60]
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]))


@pytest.mark.parametrize('name', ['Fs', 'fs', 'f_s'])
def test_a_sample_rate_beside_a_matrix_is_noted(name, muscle, tmp_path):
    """A number of this name in the file may be the rate of the rows."""
    savemat = pytest.importorskip('scipy.io').savemat
    time = 0.1 * np.arange(COUNT)
    savemat(tmp_path / 'log.mat', {name: 10.0, 'data': np.stack(
        [readings(channel, time, muscle) for channel in CHANNELS], -1), 'names': np.array([
            f'{channel} [{unit}]' for channel, unit in CHANNELS.items()], object)})
    data = read_measurement(tmp_path / 'log.mat')
    assert any(f"'{name} = 10.0': if that is the rate" in note for note in data.notes)
    assert len(read_measurement(tmp_path / 'log.mat', columns={'time': '10 Hz'}).time) == COUNT
