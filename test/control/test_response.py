# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A pressure reading that stays the same within its noise, and sound ones that do so too."""

from dataclasses import replace
import math
import random

import pytest

from fam_bundle_ros.control import PidConfig
from fam_bundle_ros.control.plausibility import GENTLE, InflowConfig, InflowWatch
from fam_bundle_ros.control.response import ResponseWatch
from fam_bundle_ros.control.safety import FROZEN, NO_RESPONSE
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, flow_for, ValveFlow

PERIOD = 5e-3
LARGEST, TRIP, BURST = 344.7e3, 396e3, 500e3


class Run:
    """A chamber under its loop and its watch, of which the gauge shows ``shown(pressure)``."""

    def __init__(self, chamber, setpoint, shown, duration, *, conductance=1.0, **rig):
        unit = chamber(period=PERIOD, supply=600e3, config=PidConfig(), **rig)
        unit.valve = replace(unit.valve, conductance=conductance * unit.valve.conductance)
        watch = InflowWatch('mu1', InflowConfig(ValveFlow(), unit.supply, LARGEST, TRIP - LARGEST,
                                                0.022, PERIOD, 4.0 * unit.pid.config.quiet_error))
        self.cause = self.text = ''
        self.highest = 0.0
        #: Times at which air was let out for a test.
        self.pulses = []
        while unit.time < duration and not self.cause:
            reading = shown(unit.pressure)
            self.cause, self.text = watch.see(unit.time, reading, unit.volume)
            command, rate = watch.forced, 0.0
            if command is None:
                command = unit.pid.update(setpoint(unit.time), reading, PERIOD, unit.supply,
                                          unit.volume)
                rate = unit.pid.state.shown.expected_rate
            else:
                unit.pid.reset()
                self.pulses += [unit.time] if command < 0.0 else []
            if watch.gentle:
                command = max(command, -GENTLE)
            watch.commanded(command, rate)
            for _ in range(10):
                unit._advance(command, PERIOD / 10)
                self.highest = max(self.highest, unit.pressure)
        self.time = unit.time


def noisy(size, seed=1):
    """Return a gauge with white noise (Pa)."""
    chance = random.Random(seed)
    return lambda pressure: pressure + chance.gauss(0.0, size)


def at_the_largest(time):
    """Return the largest pressure as the setpoint."""
    return LARGEST


@pytest.mark.parametrize('end', [320e3, 335e3, 340e3, 343e3, 343.5e3])
@pytest.mark.parametrize('conductance', [0.7, 1.0, 1.3])
@pytest.mark.parametrize('dead_band', [0.04, 0.05])
def test_a_gauge_whose_range_ends_below_the_setpoint_is_found(chamber, end, conductance,
                                                              dead_band):
    """The noise of the amplifier goes on at the end of the range; the loop opens only little."""
    noise = noisy(250.0)
    run = Run(chamber, at_the_largest, lambda p: noise(min(p, end)), 20.0,
              conductance=conductance, dead_band=dead_band)
    assert run.cause == FROZEN
    assert run.highest < BURST


@pytest.mark.parametrize('setpoint', [
    lambda t: 200e3 + 20e3 * t, lambda t: 280e3 + 10e3 * math.sin(3.0 * t),
    lambda t: 300e3 + 2e3 * t], ids=['ramp', 'sine', 'slow ramp'])
def test_a_gauge_behind_a_plugged_port_is_found(chamber, setpoint):
    """It follows at first, then shows 300 kPa with its noise while the setpoint goes on."""
    noise, last = noisy(250.0), []

    def plugged(pressure):
        if not last and pressure > 280e3:
            last.append(pressure)
        return noise(last[0] if last else pressure)
    run = Run(chamber, setpoint, plugged, 60.0)
    assert run.cause
    assert run.highest < BURST


@pytest.mark.parametrize('shown', [noisy(0.0), noisy(350.0), noisy(700.0),
                                   lambda p: round(p / 5e3) * 5e3],
                         ids=['no noise', 'noise', 'twice the noise', 'steps of 5 kPa'])
@pytest.mark.parametrize('setpoint', [
    at_the_largest, lambda t: 300e3, lambda t: min(200e3 + 20e3 * t, LARGEST),
    lambda t: 250e3 + 94e3 * math.sin(3.0 * t), lambda t: LARGEST if t % 1.0 < 0.5 else 100e3],
    ids=['rest at the largest', 'rest', 'ramp', 'sine', 'steps'])
@pytest.mark.parametrize('rig', [
    {}, {'conductance': 0.7}, {'conductance': 1.3}, {'dead_band': 0.02}, {'dead_band': 0.08},
    {'dead_band': 0.08, 'conductance': 0.7}, {'leak': 0.01}, {'leak': 0.1}, {'leak': 0.3}],
    ids=str)
def test_a_sound_gauge_is_never_taken_for_one_that_does_not_respond(chamber, shown, setpoint,
                                                                    rig):
    """With leaks, wrong valve data, noise, steps of the converter; and seldom tested."""
    run = Run(chamber, setpoint, shown, 8.0, **rig)
    assert (run.cause, run.time > 7.9) == ('', True), run.text
    if rig.get('leak', 0.0) < 0.1 and rig.get('dead_band', 0.04) <= 0.04:
        assert len(run.pulses) <= 1
    assert run.highest < LARGEST + 25e3


@pytest.mark.parametrize('rig', [{'leak': 0.1}, {'dead_band': 0.06, 'leak': 0.01}], ids=str)
def test_a_leak_and_a_dead_band_are_learnt_by_few_tests(chamber, rig):
    """In the first seconds; then the pressure stays as it is."""
    run = Run(chamber, at_the_largest, noisy(350.0), 30.0, **rig)
    assert run.cause == ''
    assert all(time < 10.0 for time in run.pulses)


def test_lines_far_narrower_than_their_data_are_no_frozen_reading(chamber):
    """A third of the flow in both directions: each pulse lowers the pressure by less."""
    run = Run(chamber, at_the_largest, noisy(350.0), 8.0, conductance=0.33, leak=0.1)
    assert run.cause in ('', NO_RESPONSE)


def test_air_that_follows_the_motion_of_a_muscle_is_no_reason_for_a_test():
    """The pressure is the same while 40 % of the volume come and go within 4 s."""
    config = InflowConfig(ValveFlow(), 600e3, LARGEST, TRIP - LARGEST, 0.022, PERIOD, 3.2e3)
    watch, supply = InflowWatch('mu1', config), 600e3 + ATMOSPHERE
    for k in range(2000):
        turn = 0.5 * math.pi * PERIOD * k
        volume, rate = 19e-6 + 4e-6 * math.sin(turn), 2e-6 * math.pi * math.cos(turn)
        assert watch.see(k * PERIOD, 344e3, volume) == ('', '')
        assert watch.forced is None
        absolute = 344e3 + ATMOSPHERE
        flow = flow_for(absolute, volume, rate, 0.0)
        full = config.valve.flow(math.copysign(1.0, flow), absolute, supply)
        watch.commanded(config.valve.command(math.copysign(flow / full, flow)))


def watched(rises, reading=lambda k: 340e3, **changes):
    """Return a watch and the indices of pulses, for rises (Pa) from reading to reading."""
    watch = ResponseWatch(3e3, TRIP, 1.5, 0.02, 0.095, 1.0)
    pulses, failed = [], None
    for k, rise in enumerate(rises):
        if watch.see(0.01 * k, reading(k), rise, **changes):
            failed = k
            break
        pulses += [k] if watch.pulse else []
    return watch, pulses, failed


def test_air_is_let_out_when_it_may_have_raised_the_pressure_to_the_trip():
    """And not before: 5 kPa a reading, by half more than the model says, from 340 kPa."""
    _, pulses, _ = watched([5e3] * 11)
    # The rises of two readings, a lag, need not be shown yet.
    assert pulses == [10]


def test_a_reading_fails_after_two_pulses_without_an_effect():
    """The valve stays shut after each until a slow sensor has responded."""
    watch, pulses, failed = watched([5e3] * 11 + [0.0] * 100)
    assert pulses == [10, 20]
    assert failed == 30
    assert watch.highest > TRIP


def test_commands_that_a_rig_may_have_missed_are_no_test():
    """The test begins anew when readings come again, and lasts as long as they do not."""
    _, pulses, failed = watched([5e3] * 11 + [0.0] * 100, held_up=True)
    assert pulses == [10]
    assert failed is None


def test_a_reading_that_falls_passes_and_the_air_counts_anew():
    """The leak that explains air of several seconds is taken off from then on."""
    slow = 0.25e3
    readings = [340e3] * 154 + [330e3] * 1200
    watch, pulses, failed = watched([slow] * 1354, lambda k: readings[k])
    assert failed is None
    assert len(pulses) == 1
    assert watch.doubt == 0.5


def test_a_reading_that_falls_only_when_all_the_air_is_out_teaches_no_leak():
    """A gauge at the end of its range responds as well once the pressure is back within it."""
    rises = [0.25e3] * 155 + [-60e3] + [0.25e3] * 200
    readings = [340e3] * 162 + [330e3] * 10 + [340e3] * 1000
    watch, pulses, _ = watched(rises, lambda k: readings[k])
    assert watch.doubt == 1.0
    assert pulses[:2] == [152, 172 + 152]
