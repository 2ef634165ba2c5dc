# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""How an experiment goes on, against a rig of a few lines: no ROS."""

import math

import pytest

from fam_bundle_ros.data.protocol import (
    Limits,
    Pause,
    PressureSweep,
    Protocol,
    segments,
    Sweep,
)
from fam_bundle_ros.nodes.protocol_run import ProtocolRun, Seen, Stopped

DT = 0.01
ISOBARS = Sweep((0.0, 0.2), 0.1, ((50e3,), (90e3,)))


class Toy:
    """Pressures follow with a lag, strain at once; force is a tenth of the kPa."""

    def __init__(self, lag=0.1):
        self.lag = lag
        self.time, self.strain, self.pressure = 0.0, 0.1, 0.0
        self.asked = None
        self.log = []
        #: Called with the sample that the rig would show; returns the one that it shows.
        self.broken = lambda seen: seen

    def run(self, run, seconds=1000.0):
        """Let an experiment go on until it is over, so long at most."""
        end = self.time + seconds
        while not run.done and self.time < end:
            asked = self.asked
            if asked is not None:
                self.strain = self.strain if asked.strain is None else asked.strain
                self.pressure += min(DT / self.lag, 1.0) * (asked.pressure[0] - self.pressure)
            setpoint = (0.0,) if asked is None else asked.pressure
            seen = self.broken(Seen(self.time, self.pressure / 1e4, self.strain,
                                    (self.pressure,), setpoint))
            self.asked = run.step(seen)
            self.log.append((self.time, self.asked))
            self.time += DT


def experiment(*steps, kept=None, todo=None, **options):
    """Return an experiment on one unit, and the dict of what it keeps."""
    kept = {} if kept is None else kept
    protocol = Protocol('toy', 1, steps or (ISOBARS,), **options)
    planned = segments(protocol)
    return ProtocolRun(protocol, planned if todo is None else [planned[k] for k in todo],
                       lambda segment, rows: kept.update({segment.number: rows})), kept


def test_every_sample_of_a_course_is_kept_and_none_of_the_way_there():
    """Each isobar from end to end at its pressure, 4 s at 100 Hz, in order of time."""
    run, kept = experiment()
    Toy().run(run)
    assert list(kept) == [1, 2]
    for rows, pressure in zip(kept.values(), (50e3, 90e3)):
        assert len(rows) == pytest.approx(401, abs=2)
        strain = [row.strain for row in rows]
        assert (min(strain), max(strain)) == pytest.approx((0.0, 0.2), abs=2e-3)
        assert strain[0] == 0.0
        assert max(abs(row.pressure[0] - pressure) for row in rows) < 500.0
        assert rows[100].force == pytest.approx(pressure / 1e4, abs=0.05)
    assert kept[2][0].time > kept[1][-1].time
    assert run.left == 0.0


def test_dynamometer_travels_at_its_rate_and_sweeps_at_that_of_the_sweep():
    """From 0.1 to the start at 0.5 1/s, then at 0.1 1/s; never a jump."""
    run, kept = experiment(travel=0.5)
    toy = Toy()
    toy.run(run)
    strain = [asked.strain for _, asked in toy.log if asked.strain is not None]
    steps = [abs(b - a) / DT for a, b in zip(strain, strain[1:])]
    assert max(steps) == pytest.approx(0.5, rel=0.01)
    rates = [asked.rate for time, asked in toy.log if kept[1][0].time < time < kept[1][-1].time]
    assert {round(rate, 6) for rate in rates} == {0.1, -0.1}


def test_a_dynamometer_that_goes_on_at_the_asked_rate_stops_at_the_end_of_a_leg():
    """Its rate brings it to the next sample's place, at the tip of a sweep as well."""
    run, kept = experiment(Sweep((0.0, 0.2), 0.07, ((50e3,),)))
    toy = Toy()
    toy.run(run)
    course = [asked for time, asked in toy.log if kept[1][0].time < time < kept[1][-1].time]
    assert [now.strain + DT * now.rate for now in course[:-1]] == pytest.approx(
        [then.strain for then in course[1:]], abs=1e-9)


def test_recording_waits_until_slow_pressures_are_there_and_settled():
    """With a lag of 1 s, 50 kPa is there to 2 kPa after 3.2 s; then it settles for 2 s."""
    run, kept = experiment(settle=2.0)
    toy = Toy(lag=1.0)
    toy.run(run)
    filled = next(time for time, asked in toy.log if asked.pressure == (50e3,))
    assert kept[1][0].time - filled == pytest.approx(math.log(25.0) + 2.0, abs=0.4)


def test_a_pause_is_waited_vented():
    """An hour at no pressure between two isobars."""
    one = Sweep((0.0, 0.2), 0.1, ((50e3,),))
    run, kept = experiment(one, Pause(100.0), one)
    toy = Toy()
    toy.run(run)
    assert 100.0 < kept[2][0].time - kept[1][-1].time < 110.0
    middle = [asked.pressure for time, asked in toy.log
              if kept[1][-1].time + 1.0 < time < kept[2][0].time - 5.0]
    assert set(middle) == {(0.0,)}


def test_without_a_dynamometer_nothing_is_asked_of_one():
    """Pressures sweep and the strain is the load's own business."""
    run, kept = experiment(PressureSweep(((0.0,), (50e3,)), 25e3))
    toy = Toy()
    toy.run(run)
    assert all(asked.strain is None for _, asked in toy.log)
    assert max(row.pressure[0] for row in kept[1]) == pytest.approx(50e3, rel=0.06)


def test_segments_that_are_done_are_left_out():
    """Only the second is run, and the time that is left is its own."""
    run, kept = experiment(todo=[1])
    assert run.left < 8.0
    Toy().run(run)
    assert list(kept) == [2]


def stopped(words, broken, *steps, **options):
    """Hold that an experiment on a broken rig stops with these words; return what was kept."""
    run, kept = experiment(*steps, **options)
    toy = Toy()
    toy.broken = broken
    with pytest.raises(Stopped, match=words):
        toy.run(run)
    return kept


def change(seen, **fields):
    """Return a sample with other values."""
    return Seen(**{**vars(seen), **fields})


def test_a_force_beyond_the_limit_stops_and_a_spike_does_not():
    """8 N is passed in the second isobar: the first stays. One sample of 100 N is nothing."""
    kept = stopped('force is 8.* beyond the limit of 8 N', lambda seen: seen,
                   limits=Limits(force=8.0))
    assert list(kept) == [1]
    run, kept = experiment(limits=Limits(force=20.0))
    toy = Toy()
    toy.broken = lambda seen: (change(seen, force=-100.0) if round(seen.time / DT) % 7 == 0
                               else seen)
    toy.run(run)
    assert list(kept) == [1, 2]


def test_a_rig_or_a_controller_that_does_not_follow_stops_it():
    """A leak, a dynamometer that stands still, a controller that is off, readings lost."""
    assert stopped('pressure is .* is the setpoint since 20 s',
                   lambda seen: change(seen, pressure=(0.8 * seen.pressure[0],))) == {}
    assert stopped('the dynamometer does not follow', lambda seen: change(seen, strain=0.1)) == {}
    assert stopped('the setpoint is 0.0 kPa instead of 50.0 kPa',
                   lambda seen: change(seen, setpoint=(0.0,))) == {}
    lost = stopped('segment 2: no whole sample for', lambda seen: change(
        seen, force=math.nan) if seen.time > 9.0 else seen)
    assert list(lost) == [1]


def test_a_segment_with_a_gap_is_run_again_and_twice_more_at_most():
    """Being held up for 0.7 s does not end the experiment; being held up each time does."""
    run, kept = experiment()
    toy = Toy()
    steps = []

    def held_up(seen):
        steps.append(run.words)
        if 'segment 2: sweep' in run.words and seen.strain > 0.1:
            toy.time += 0.7
        return change(seen, time=toy.time)
    toy.broken = held_up
    toy.run(run)
    assert list(kept) == [1, 2]
    assert 'segment 2 again (nothing came for 0.71 s): sweep' in ' '.join(steps)
    times = [row.time for row in kept[2]]
    assert max(b - a for a, b in zip(times, times[1:])) < 2 * DT
    assert len(times) == pytest.approx(401, abs=2)

    def always(seen):
        toy.time += 0.7 if 'sweep' in run.words and seen.strain > 0.1 else 0.0
        return change(seen, time=toy.time)
    run, kept = experiment()
    toy = Toy()
    toy.broken = always
    with pytest.raises(Stopped, match='segment 1 again .*: nothing came for 0.71 s'):
        toy.run(run)
    assert kept == {}


def test_a_controller_that_was_held_up_has_its_time_to_follow():
    """1.2 s without a sample, as the second isobar is asked for, count for one sample."""
    run, kept = experiment()
    toy = Toy()
    late = [(0.0,)] * 3

    def held_up(seen):
        late.append(seen.setpoint)
        if late[-3:] == [(50e3,), (90e3,), (90e3,)]:
            toy.time += 1.2
        return change(seen, time=toy.time, setpoint=late[-4])
    toy.broken = held_up
    toy.run(run)
    assert list(kept) == [1, 2]


def test_readings_that_are_no_numbers_are_left_out():
    """A short drop-out costs its samples, and no more."""
    run, kept = experiment()
    toy = Toy()
    toy.broken = lambda seen: change(seen, force=math.nan) if 3.5 < seen.time < 3.8 else seen
    toy.run(run)
    assert len(kept[1]) == pytest.approx(401 - 30, abs=3)
    assert all(math.isfinite(row.force) for row in kept[1])
