# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The memory of a running rig: bounded, balanced, in stretches that have rates."""

import math

import numpy as np
import pytest

from fam_bundle_ros.data.memory import Memory
from fam_bundle_ros.errors import InputError

LIMIT = 4e5


def swept(memory, begin, end, period=0.005, pressure=2e5):
    """Feed a strain that goes to and fro every two seconds, 5 to 15 %."""
    for k in range(round(begin / period), round(end / period)):
        t = k * period
        memory.add(t, 0.1 + 0.05 * math.sin(math.pi * t), (pressure,), 10.0 * t)


def rested(memory, begin, end, period=0.005):
    """Feed a rig at rest."""
    for k in range(round(begin / period), round(end / period)):
        memory.add(k * period, 0.1, (0.0,), 0.0)


@pytest.fixture
def memory():
    """Return a memory of one muscle that holds 60 stretches of half a second."""
    return Memory(('mu1',), (LIMIT,), seconds=3600.0, most=60)


def test_rest_for_minutes_does_not_push_out_what_moved(memory):
    """Half of the rows are still of 20 s of motion after five minutes at rest."""
    swept(memory, 0.0, 20.0)
    rested(memory, 20.0, 320.0)
    data = memory.measurement()
    assert len(memory) == 60
    assert np.mean(data.time < 20.0) > 0.5


def test_the_same_for_ever_is_kept_from_all_over_its_time(memory):
    """Of five minutes of one motion no half minute is missing."""
    swept(memory, 0.0, 300.0)
    assert np.histogram(memory.measurement().time, bins=10, range=(0.0, 300.0))[0].min() > 0


def test_every_pressure_and_direction_keeps_its_share(memory):
    """A minute at one pressure leaves ten seconds at another alone, both ways."""
    swept(memory, 0.0, 10.0, pressure=3.5e5)
    swept(memory, 10.0, 70.0)
    data = memory.measurement()
    high = data.pressure[:, 0] > 3e5
    assert high.mean() > 0.25
    assert set(np.unique(data.direction[high])) >= {-1, 1}


def test_filling_and_venting_of_a_held_muscle_keep_their_share(memory):
    """Nine seconds of filling, then a minute of venting between the same pressures."""
    for k in range(13_800):
        t = 0.005 * k
        way = 20e3 * (t % 3.0)
        memory.add(t, 0.1, (85e3 + way if t < 9.0 else 145e3 - way,), 10.0)
    assert np.mean(memory.measurement().time < 9.0) > 0.25


def test_one_sample_before_a_silence_is_not_bridged(memory):
    """Whatever the step before it may have been."""
    rested(memory, 0.0, 0.005)
    swept(memory, 5.0, 8.0)
    assert np.diff(memory.measurement().time) == pytest.approx(0.02)


@pytest.mark.parametrize('rate', [2, 5, 10, 16, 17, 30])
def test_a_rig_that_is_read_slower_than_the_rows_asked_for_is_remembered(memory, rate):
    """Each sample is a row then, and all of them are one trial."""
    swept(memory, 0.0, 20.0, 1.0 / rate)
    data = memory.measurement()
    assert len(data.trial_names) == 1
    assert np.ptp(data.time) > 18.0
    assert np.diff(data.time) == pytest.approx(1.0 / rate)


def test_one_lost_message_of_a_slow_log_is_no_gap(memory):
    """At 20 Hz, rows of 50 Hz: a step of 0.1 s is within two of its own, one of 0.5 s is not."""
    for k in range(400):
        if k % 37 and not 200 < k < 210:
            memory.add(0.05 * k, 0.1 + 0.05 * math.sin(0.05 * k), (2e5,), 10.0)
    data = memory.measurement()
    assert len(data.trial_names) == 2
    assert data.time[data.trial == 1][0] - data.time[data.trial == 0][-1] > 0.4


def test_nothing_older_than_the_limit_is_kept():
    """The memory of 30 s holds no row that is older."""
    memory = Memory(('mu1',), (LIMIT,), seconds=30.0)
    swept(memory, 0.0, 100.0)
    assert memory.oldest > 69.0


def test_stretches_without_a_gap_are_one_trial_with_the_rate_of_the_strain(memory):
    """Eight seconds are one trial; the rate is that of the sine, the rows are means."""
    swept(memory, 0.0, 8.0)
    data = memory.measurement()
    assert len(data.trial_names) == 1
    assert memory.seconds == pytest.approx(8.0, abs=0.6)
    # the time of a measurement begins at its first row, the mean of the samples 0 to 0.015 s
    rate = 0.05 * math.pi * np.cos(math.pi * (data.time + 0.0075))
    assert np.abs(data.strain_rate - rate)[5:-5].max() < 0.02
    assert np.diff(data.time) == pytest.approx(0.02)
    assert data.force == pytest.approx(10.0 * (data.time + 0.0075))


@pytest.mark.parametrize('between', ['silence', 'nan'])
def test_a_gap_begins_a_trial(memory, between):
    """Silence of half a second, or a reading that is none, is not bridged."""
    swept(memory, 0.0, 4.0)
    if between == 'nan':
        memory.add(4.0, math.nan, (0.0,), 0.0)
    swept(memory, 4.005 if between == 'nan' else 4.5, 8.0)
    data = memory.measurement()
    assert len(data.trial_names) == 2
    assert np.diff(data.time)[np.diff(data.trial) == 0].max() == pytest.approx(0.02)


def test_a_clock_that_was_set_back_clears_the_memory(memory):
    """Two samples of one time of such a clock cannot be distinguished."""
    swept(memory, 0.0, 8.0)
    swept(memory, 0.0, 2.0)
    assert memory.seconds <= 2.0
    memory.add(1.995, 0.1, (0.0,), 0.0)
    assert len(memory) == 0


def test_of_one_cell_that_stretch_goes_whose_neighbours_are_nearest():
    """The one at 30 s: without it 21 s are left between two, without the one at 31 s 70 s."""
    memory = Memory(('mu1',), (LIMIT,), seconds=3600.0, most=4)
    for begin in (0.0, 10.0, 30.0, 31.0, 101.0):
        rested(memory, begin, begin + 0.6)
    assert [round(stretch.begin) for stretch in memory._kept] == [0, 10, 31, 101]


def test_a_part_can_be_asked_for_and_forgotten(memory):
    """Rows from a time on; what was before it can be forgotten for good."""
    swept(memory, 0.0, 10.0)
    assert np.ptp(memory.measurement(since=6.0).time) == pytest.approx(4.0, abs=0.6)
    memory.forget(6.0)
    assert memory.oldest == pytest.approx(6.0, abs=0.5)


def test_what_moved_in_a_gap_is_no_known_past(memory):
    """Unlike in a pause of a log, which is as long."""
    swept(memory, 0.0, 4.0)
    swept(memory, 7.0, 10.0)
    data = memory.measurement()
    assert data.start.sum() == data.restart.sum() == 2


def test_too_little_fails(memory):
    """An empty memory says how many rows there are; one that makes no sense is refused."""
    with pytest.raises(InputError, match='memory: 0 rows with a number'):
        memory.measurement()
    with pytest.raises(InputError, match='two rows in a stretch'):
        Memory(('mu1',), (LIMIT,), rate=2.0, stretch=0.5)
