# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""State machine, latches and watches of single readings, without ROS."""

import math

import pytest

from fam_bundle_ros.control import PidConfig, PressurePid
from fam_bundle_ros.control.safety import (
    FROZEN,
    Guard,
    Health,
    kilopascals,
    LATE,
    LOST,
    LostTime,
    OVER_PRESSURE,
    SensorWatch,
    State,
    trip_pressure,
    WatchConfig,
)
from fam_bundle_ros.model.pneumatics import pressure_rate, valve_flow, valve_opening
from fam_bundle_ros.plant import RigConfig

PERIOD = 5e-3
SUPPLY = 600e3


# --- state machine ----------------------------------------------------------------------------

def test_only_release_leads_out_of_a_latch():
    """Whatever else happens, the first cause stays, with its reason and time."""
    guard = Guard()
    assert guard.latch(1.0, OVER_PRESSURE, 'mu1 at 410 kPa')
    assert not guard.latch(2.0, LOST, 'no force')
    for state in State:
        if state is not State.LATCHED:
            guard.enter(3.0, state)
    assert (guard.latched, guard.word) == (True, OVER_PRESSURE)
    assert (guard.now.time, guard.now.reason) == (1.0, 'mu1 at 410 kPa')
    guard.release(4.0)
    assert (guard.now.state, guard.now.time) == (State.READY, 4.0)


def test_there_is_one_door_into_a_latch():
    """`enter` cannot latch by mistake."""
    with pytest.raises(ValueError, match='latch'):
        Guard().enter(0.0, State.LATCHED)


def test_release_of_what_is_not_latched_changes_nothing():
    """Enabling twice is no change of state."""
    guard = Guard()
    guard.enter(0.0, State.ACTIVE)
    guard.release(1.0)
    assert guard.now.state is State.ACTIVE


def test_every_change_is_announced_once_with_its_reason():
    """What stays as it is says nothing; what changes says why and when."""
    seen = []
    guard = Guard(seen.append)
    for time in (0.0, 1.0, 2.0):
        guard.enter(time, State.HOLD, 'HOLD', f'force is nan at {time:g}')
    guard.enter(3.0, State.ACTIVE)
    assert [(c.time, c.state, c.reason) for c in seen] == [
        (0.0, State.HOLD, 'force is nan at 0'), (3.0, State.ACTIVE, '')]
    assert list(guard.history)[1:] == seen


def test_the_controllers_trip_below_the_rig_and_its_relief_valve():
    """The pressures that stop things lie one above the other."""
    config = RigConfig()
    trip = trip_pressure(344.7e3)
    assert trip == pytest.approx(396.4e3, abs=0.1e3)
    assert trip < config.trip_pressure < config.chamber.relief_pressure


@pytest.mark.parametrize('value', [1e308, -1e308, math.inf, math.nan, 123456789e3])
def test_a_pressure_in_words_is_short_whatever_its_size(value):
    """A message with a number of 300 digits is no message."""
    assert len(kilopascals(value)) < 16


# --- watches ----------------------------------------------------------------------------------

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


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_missing_and_not_stuck(watch, bad):
    """It vents without a latch, however long it repeats while the reading must move."""
    feed(watch, 0.0, 2.0, lambda k: bad, moving=True)
    assert (watch.health, watch.cause) == (Health.VENT, '')
    assert feed(watch, 2.0, 2.5, lambda k: 10.0 + k)[-1] == Health.GOOD


def test_silence_holds_then_vents(watch):
    """Nothing for timeout: hold; for hold_time more: vent."""
    assert watch.check(100.0) == Health.WAITING
    feed(watch, 0.0, 0.1, lambda k: 10.0 + k)
    assert watch.check(0.15) == Health.GOOD
    assert watch.check(0.25) == Health.HOLD
    assert watch.check(0.6) == Health.VENT
    assert watch.reason == 'force: no reading for 0.51 s'


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


def test_what_is_good_again_but_not_yet_for_long_says_what_was_wrong(watch):
    """A reading that comes and goes, until the bundle latches: the log must name the fault."""
    feed(watch, 0.0, 0.5, lambda k: 5.0 + k)
    feed(watch, 0.5, 1.0, lambda k: -90.0)
    feed(watch, 1.0, 1.05, lambda k: 5.0 + k)
    assert watch.health == Health.VENT
    assert watch.reason.startswith('force is -90 N, outside -50 to 500; good again')


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


@pytest.mark.parametrize(('latency', 'text'), [
    (0.3, 'force is 0.3 s old on arrival; at most 0.015 s is allowed (max_latency); '
          'if it stays so, do the clocks of rig and controller agree?'),
    (-2.0, 'force is stamped 2 s in the future: the clocks of rig and controller disagree'),
    (-1.8e9, 'force is stamped 1.8e+09 s in the future: is use_sim_time on, and nobody publishes '
     '/clock?'),
    (1.8e9, 'force has no time stamp, or one of another clock than ROS time')])
def test_late_readings_hold_then_latch(latency, text):
    """A late reading is not used, and readings that stay late are a fault that does not heal."""
    watch = SensorWatch('force', 'N', WatchConfig(-50.0, 500.0, max_latency=0.015))
    assert watch.see(0.0, 10.0, latency=0.004) == Health.GOOD
    assert watch.see(0.01, 11.0, latency=latency) == Health.HOLD
    assert watch.reason == text
    for k in range(2, 40):
        watch.see(k * 0.01, 10.0 + k, latency=latency)
    assert (watch.health, watch.cause) == (Health.VENT, LATE)


def test_late_readings_that_are_impossible_are_no_fault_of_the_clock():
    """The cause and the reason name the same thing."""
    watch = SensorWatch('mu1 pressure', 'Pa', WatchConfig(
        -50e3, 1.6e6, max_latency=0.015, below='is it gauge?'))
    for k in range(60):
        watch.see(k * 0.01, -101e3, latency=0.1)
    assert (watch.health, watch.cause) == (Health.VENT, '')
    assert watch.reason == 'mu1 pressure is -101000 Pa, outside -50000 to 1.6e+06 (is it gauge?)'


def test_one_late_reading_after_a_stall_latches_nothing():
    """Silence of a second and an old reading at its end: out, and back by itself."""
    watch = SensorWatch('force', 'N', WatchConfig(-50.0, 500.0, max_latency=0.015))
    watch.see(0.0, 10.0)
    watch.see(1.0, 11.0, latency=1.0)
    assert (watch.health, watch.cause) == (Health.VENT, '')
    for k in range(30):
        watch.see(1.01 + k * 0.01, 12.0 + k)
    assert watch.health == Health.GOOD


@pytest.mark.parametrize(('late', 'cause'), [(0.1, ''), (0.3, LATE)])
def test_late_readings_of_a_tenth_of_a_second_are_a_busy_computer(late, cause):
    """They put the channel out; a clock that is wrong for longer is a fault."""
    watch = SensorWatch('force', 'N', WatchConfig(-50.0, 500.0, max_latency=0.015))
    watch.see(0.0, 10.0)
    for k in range(round(late / 0.01) + 1):
        watch.see(1.0 + k * 0.01, 11.0 + k, latency=0.5)
    assert (watch.health, watch.cause) == (Health.VENT, cause)


def test_an_input_that_is_back_for_moments_only_is_lost():
    """Lost for half a second of every two: that adds up; back for as long as the patience, not."""
    for back, lost in ((3, True), (9, False)):
        watch = LostTime()
        assert any(watch.see(0.5 * k, k % (back + 2) < 2, 4.0) for k in range(100)) == lost


def test_a_frozen_reading_does_not_heal():
    """A channel that was out because it stood still is a fault, not a loss."""
    watch = SensorWatch('force', 'N', WatchConfig(-50.0, 500.0, stuck_time=0.3))
    for k in range(80):
        watch.see(k * 0.01, 7.0, True)
    assert watch.cause == FROZEN


# --- a loop that is held up -------------------------------------------------------------------

@pytest.mark.parametrize('start', [0.0, 100e3, 200e3, 300e3, 380e3])
def test_a_command_that_is_held_stays_below_the_ceiling(start):
    """A loop that is held up for `reach` with its valve open fills to the trip at most."""
    reach, trip, volume = 0.025, 396e3, 19e-6
    pid = PressurePid(config=PidConfig(reach=reach, ceiling=trip))
    command = pid.update(344e3, start, PERIOD, SUPPLY, volume)
    pressure = start + 101325.0
    for _ in range(250):
        pressure += reach / 250 * pressure_rate(pressure, volume, 0.0, valve_flow(
            pid.config.valve, valve_opening(pid.config.valve, command), pressure,
            SUPPLY + 101325.0, 101325.0))
    assert pressure - 101325.0 <= trip
    assert command > 0.0 or start > 344e3


def test_one_repeat_after_a_long_silence_is_no_stuck_sensor():
    """A computer was held up, and the rounded reading is by chance what it was before."""
    watch = SensorWatch('force', 'N', WatchConfig(low=-100.0, high=2000.0, timeout=2.0))
    watch.see(0.0, 344.25, True)
    assert watch.see(0.8, 344.25, True) == Health.GOOD
    assert not watch.cause
