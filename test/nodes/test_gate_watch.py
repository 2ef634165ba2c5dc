# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lock-step gate and sensor watch, without ROS."""

import math

import pytest

from fam_bundle_ros.nodes.gate import Gate
from fam_bundle_ros.nodes.watch import Health, SensorWatch, WatchConfig


def test_gate_opens_only_when_all_stamps_agree():
    """An old value never answers a new stamp."""
    gate = Gate('ab')
    assert not gate.put('a', 1, 'x')
    assert gate.put('b', 1, 'y')
    assert not gate.put('b', 2, 'y')
    assert gate.missing == ['a']
    assert gate.value('a') is None


def test_gate_opens_again_for_a_repeated_stamp():
    """Who asks again is answered again: a lost answer must not stop the loop."""
    gate = Gate('ab')
    gate.put('a', 1, 'x')
    gate.put('b', 1, 'y')
    assert gate.put('a', 1, 'x')


def test_lost_channel_is_not_waited_for_until_it_returns():
    """After giving up, the rest goes on alone; a message brings the channel back."""
    gate = Gate('ab')
    gate.put('a', 1, 'x')
    gate.put('b', 1, 'y')
    gate.put('a', 2, 'x')
    assert gate.give_up() == ['b']
    assert gate.put('a', 3, 'x')
    assert not gate.put('b', 1, 'late')
    assert not gate.put('a', 4, 'x')
    assert gate.put('b', 4, 'y')


def test_gate_begins_anew_when_time_goes_back():
    """A simulator that was started again sends small stamps."""
    gate = Gate('ab')
    gate.put('a', 90, 'x')
    gate.put('b', 90, 'y')
    assert not gate.put('a', 1, 'x')
    assert gate.put('b', 1, 'y')
    assert gate.stamp == 1


@pytest.fixture
def watch():
    """Return a watch over a force."""
    return SensorWatch('force', 'N', WatchConfig(
        low=-50.0, high=500.0, timeout=0.1, hold_time=0.2, recovery_time=0.2, stuck_time=0.5))


def feed(watch, start, stop, value, moving=False):
    """Feed readings at 100 Hz; return the healths seen."""
    count = round((stop - start) * 100)
    return [watch.see(start + k * 0.01, value(k), moving) for k in range(count)]


@pytest.mark.parametrize(('bad', 'text'), [
    (math.nan, 'force is nan'), (math.inf, 'force is inf'),
    (900.0, 'force is 900 N, outside -50 to 500')])
def test_bad_reading_holds_then_vents(watch, bad, text):
    """The first bad reading is not used; after hold_time the channel is out."""
    feed(watch, 0.0, 0.1, lambda k: 10.0 + k)
    healths = feed(watch, 0.1, 0.5, lambda k: bad)
    assert watch.reason == text
    assert healths[0] == Health.HOLD
    first = healths.index(Health.VENT)
    assert 19 <= first <= 21
    assert set(healths[first:]) == {Health.VENT}


def test_silence_holds_then_vents(watch):
    """Nothing for timeout: hold; for hold_time more: vent."""
    assert watch.check(100.0) == Health.WAITING
    feed(watch, 0.0, 0.1, lambda k: 10.0 + k)
    assert watch.check(0.15) == Health.GOOD
    assert watch.check(0.25) == Health.HOLD
    assert watch.check(0.6) == Health.VENT
    assert watch.reason == 'force: nothing for 0.51 s'


def test_reading_is_good_again_only_after_a_while(watch):
    """One good reading among bad ones does not switch anything on."""
    feed(watch, 0.0, 0.1, lambda k: 10.0 + k)
    feed(watch, 0.1, 0.5, lambda k: math.nan)
    healths = feed(watch, 0.5, 1.0, lambda k: 10.0 + k)
    assert healths[0] == Health.VENT
    assert 19 <= healths.index(Health.GOOD) <= 21


def test_single_dropouts_do_not_vent(watch):
    """A nan now and then is bridged."""
    healths = feed(watch, 0.0, 2.0, lambda k: math.nan if k % 5 == 4 else float(k))
    assert Health.VENT not in healths


def test_clock_that_was_set_back_begins_anew(watch):
    """A reading that is bad from a jump back on is held and vented as ever, not held for ever."""
    feed(watch, 100.0, 100.5, lambda k: 10.0 + k)
    healths = feed(watch, 0.0, 0.5, lambda k: math.nan)
    assert (healths[0], healths[-1]) == (Health.HOLD, Health.VENT)
    assert watch.check(-1.0) == Health.WAITING


def test_exact_repeats_are_stuck_only_while_it_must_move(watch):
    """A quantised reading at rest is not stuck; one that stands still under load is."""
    assert set(feed(watch, 0.0, 2.0, lambda k: 7.0)) == {Health.GOOD}
    healths = feed(watch, 2.0, 3.0, lambda k: 7.0, moving=True)
    assert healths[-1] == Health.VENT
    assert 'has shown exactly 7 N' in watch.reason


def test_stuck_reading_stays_stuck_while_nothing_moves(watch):
    """The valve that was shut because of it must not make the reading good again."""
    feed(watch, 0.0, 0.7, lambda k: 7.0, moving=True)
    assert feed(watch, 0.7, 1.5, lambda k: 7.0)[-1] == Health.VENT
    assert feed(watch, 1.5, 2.0, lambda k: 8.0 + k)[-1] == Health.GOOD
