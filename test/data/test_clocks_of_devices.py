# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Structs, files and topics of several devices, each with a clock of its own."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, read_recordings, Recipe

from .sampled import force, pressure, strain, table, TIME


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
    (advice,) = (note for note in data.notes if 'time=time 2 + 1.7 s' in note)
    assert 'for example' in advice  # nothing in the data says 1.7 s
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
    assert not any('1.7 s' in note for note in data.notes)
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]), atol=0.5)


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


def test_times_below_a_key_are_the_clock(tmp_path, log):
    """A recorder writes 'TAG' before the names: its times made the log a static map."""
    path = tmp_path / 'log.csv'
    path.write_text('CH,CH1,CH2,CH3\nTAG,Force,Pressure,Contraction\nUNIT,N,Pa,%\n' + ''.join(
        f'10:20:{t:06.3f},{f:.4f},{p:.1f},{100 * e:.5f}\n' for t, e, p, f in zip(*log)))
    data = read_measurement(path)
    assert data.time is not None
    assert np.ptp(data.time) == pytest.approx(np.ptp(log[0]))
