# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Segments of an experiment are kept one by one, and become one recording."""

import os
import time

import numpy as np
import pytest

from fam_bundle_ros.data import join, read_measurement
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.protocol import Protocol, read_protocol, segments, Sweep
from fam_bundle_ros.data.segment_store import Row, SegmentStore
from fam_bundle_ros.errors import InputError

PROTOCOL = Protocol('two', 2, (Sweep((0.0, 0.1), 0.1, ((50e3, 0.0), (90e3, 0.0))),))


def rows(begin):
    """Return twenty samples of a sweep from a time on."""
    return [Row(begin + 0.1 * k, 0.01 * k, (50e3 + k, -3.0), 20.0 - k) for k in range(20)]


def store(tmp_path, protocol=PROTOCOL, **options):
    """Return the store of log.csv."""
    return SegmentStore(tmp_path / 'log.csv', protocol, ('mu1', 'mu2'), **options)


def test_segments_become_one_recording_with_a_trial_each(tmp_path):
    """Kept in any order, read as trials in theirs, in SI units; the protocol lies beside."""
    made = store(tmp_path)
    first, second = segments(PROTOCOL)
    made.keep(second, rows(10.0))
    made.keep(first, rows(1.0))
    made.finish()
    assert sorted(path.name for path in tmp_path.iterdir()) == ['log.csv', 'log.protocol.yaml']
    data = read_measurement(tmp_path / 'log.csv')
    assert data.trial_names == ('1', '2')
    assert data.motor_units == ('mu1', 'mu2')
    assert data.time[[0, 20]].tolist() == [1.0, 10.0]
    assert data.pressure[1] == pytest.approx([50001.0, -3.0])
    assert data.force[1] == 19.0
    assert read_protocol(tmp_path / 'log.protocol.yaml') == PROTOCOL


def test_what_was_kept_is_not_done_again_and_time_goes_on(tmp_path):
    """A second process knows the segments that are complete, and when the last of them was."""
    first = segments(PROTOCOL)[0]
    store(tmp_path).keep(first, rows(1.0))
    part = tmp_path / 'log.csv.parts' / '00001.csv'
    (tmp_path / 'log.csv.parts' / '.00002.csv.draft').write_text('half')
    os.utime(part, (time.time() - 600.0,) * 2)
    again = store(tmp_path, resume=True)
    assert again.done == {1}
    assert again.clock() == pytest.approx(602.9, abs=5.0)
    assert SegmentStore(tmp_path / 'new.csv', PROTOCOL, ('mu1', 'mu2')).clock() == 0.0


def test_nothing_is_written_over_and_no_two_experiments_are_mixed(tmp_path):
    """A recording, an experiment under way, another protocol: each is refused by its name."""
    store(tmp_path).keep(segments(PROTOCOL)[0], rows(1.0))
    with pytest.raises(InputError, match=r'log\.csv\.parts: .*expected --resume'):
        store(tmp_path)
    other = Protocol('other', 2, PROTOCOL.steps, seed=5)
    with pytest.raises(InputError, match='was begun with another protocol'):
        store(tmp_path, other, resume=True)
    store(tmp_path, resume=True).finish()
    with pytest.raises(InputError, match='is there already'):
        store(tmp_path, resume=True)
    with pytest.raises(InputError, match='expected the name of a new CSV'):
        SegmentStore(tmp_path / 'log.txt', PROTOCOL, ('mu1', 'mu2'))


def recording(name, force):
    """Return one trial of a muscle with time."""
    strain = np.linspace(0.0, 0.1, 30)
    return build(name, strain, np.full((30, 1), 5e4), np.full(30, force), None, np.arange(30.0))


def test_recordings_of_one_muscle_are_joined_as_trials():
    """One after the other on one clock; the same trial names stay apart."""
    both = join([recording('old', 5.0), recording('new', 7.0)])
    assert both.trial_names == ('old 0', 'new 0')
    assert both.trial.tolist() == [0] * 30 + [1] * 30
    assert both.force.tolist() == [5.0] * 30 + [7.0] * 30
    assert np.all(np.diff(both.time) > 0)
    assert both.start.sum() == 2


def test_recordings_that_do_not_go_together_are_refused():
    """Another number of motor units; a map beside a log."""
    one = recording('old', 5.0)
    strain = np.linspace(0.0, 0.1, 30)
    two = build('two', strain, np.full((30, 2), 5e4), np.full(30, 5.0), None, np.arange(30.0))
    still = build('map', strain, np.full((30, 1), 5e4), np.full(30, 5.0))
    with pytest.raises(InputError, match='two: 2 motor units; expected 1 as in old'):
        join([one, two])
    with pytest.raises(InputError, match='map and old: one has time'):
        join([one, still])
