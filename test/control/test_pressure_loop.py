# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The blocks of the pressure loop, each against what it says."""

import math
from random import Random

import numpy as np
import pytest

from fam_bundle_ros.control.pid import pid_settings, PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.pressure_loop import (
    error_beyond_noise,
    follow,
    forget,
    integrate,
    past_value,
    PidState,
    pressure_step,
    send,
    start,
    still_coming,
)
from fam_bundle_ros.control.valve_learning import band_weight, command_of, ValveLearningState
from fam_bundle_ros.model.pneumatics import pressure_rate, ValveFlow

V, SUPPLY, DT = 15e-6, 500e3, 2e-3
NOISELESS = {'quiet_error': 0.0, 'filter_time': 0.0}


def settings_of(p=20.0, i=100.0, d=0.0, **config):
    """Return settings of a loop."""
    return pid_settings(PidGains(p, i, d), PidConfig(**{'supply': SUPPLY, 'volume': V, **config}))


def at(pressure):
    """Return the state of a loop that was begun at a pressure."""
    state = PidState()
    start(settings_of(), state, pressure, SUPPLY + 101325.0, V, 0.0)
    return state


def rate_of(config, command, pressure, volume_rate=0.0):
    """Return the pressure rate that a command gives, Pa/s."""
    valve = config.valve
    flow = valve.flow(valve.opening(command), pressure + config.ambient,
                      SUPPLY + config.ambient, config.ambient)
    return pressure_rate(pressure + config.ambient, V, volume_rate, flow)


@pytest.mark.parametrize('jump', [-3e3, -500.0, 500.0, 3e3, 10e3])
@pytest.mark.parametrize('volume_rate', [-2e-5, 0.0, 2e-5])
def test_the_command_gives_the_rate_that_feedback_asks_for(jump, volume_rate):
    """By chamber and valve: p times the error that is left, and what the setpoint does."""
    config = PidConfig(supply=SUPPLY, volume=V, setpoint_bandwidth=50.0, **NOISELESS)
    pid = PressurePid(PidGains(20.0, 0.0, 0.0), config)
    pid.update(200e3, 200e3, DT, SUPPLY, V, volume_rate)
    pid.reset()
    command = pid.update(200e3 + jump, 200e3, DT, SUPPLY, V, volume_rate)
    rate = 50.0 * jump
    expected = rate + 20.0 * rate * DT
    assert pid.diagnostics.followed_setpoint == pytest.approx(200e3 + rate * DT)
    assert pid.diagnostics.wanted_rate == pytest.approx(expected)
    assert pid.diagnostics.error == pytest.approx(jump)
    assert rate_of(config, command, 200e3, volume_rate) == pytest.approx(expected, rel=1e-6)
    assert not pid.diagnostics.saturated


@pytest.mark.parametrize(('hertz', 'share'), [(0.0, 1.0), (2.0, 1.0), (25.0, 0.0), (50.0, 0.0),
                                              (70.0, 0.0)])
def test_a_motion_that_turns_within_the_lag_is_not_compensated(hertz, share):
    """With a lag of 20 ms, of which one is a sample: 50 Hz agrees with itself one lag before."""
    config = PidConfig(supply=SUPPLY, volume=V, flow_lag=18e-3, **NOISELESS)
    moved, resting = (PressurePid(PidGains(0.0, 0.0, 0.0), config) for _ in range(2))
    for k in range(1000):
        motion = 2e-5 * math.cos(2.0 * math.pi * hertz * k * DT)
        command = moved.update(200e3, 200e3, DT, SUPPLY, V, motion)
        still = resting.update(200e3, 200e3, DT, SUPPLY, V, 0.0)
        if k > 900 and abs(motion) > 1e-5:
            wanted = rate_of(config, command, 200e3, share * motion)
            assert wanted == pytest.approx(rate_of(config, still, 200e3), abs=100.0)


@pytest.mark.parametrize(('setpoint', 'sign'), [(450e3, 1.0), (20e3, -1.0)])
def test_more_than_the_valve_can_do_is_done_fully_open(setpoint, sign):
    """The setpoint is followed at 97 % of that; what is expected is what the valve gives."""
    config = PidConfig(supply=SUPPLY, volume=V, **NOISELESS)
    pid = PressurePid(PidGains(2000.0, 0.0, 0.0), config)
    assert pid.update(setpoint, 200e3, DT) == sign
    most = rate_of(config, sign, 200e3)
    assert pid.diagnostics.expected_rate == pytest.approx(most)
    assert abs(pid.diagnostics.wanted_rate) > abs(most)
    assert pid.diagnostics.saturated
    assert pid.diagnostics.followed_setpoint == pytest.approx(200e3 + 0.97 * most * DT)


@pytest.mark.parametrize('volume_rate', [-1e-5, 0.0, 1e-5, 1e-2])
def test_a_command_that_is_held_does_not_fill_above_the_ceiling(volume_rate):
    """
    For as long as it may be held, even if the muscle stops; without the dead band.

    A velocity in a wrong unit says that the muscle widens so fast that no air fills it.
    """
    config = PidConfig(supply=SUPPLY, volume=V, ceiling=220e3, reach=0.05, **NOISELESS)
    pid = PressurePid(PidGains(), config)
    command = pid.update(400e3, 200e3, DT, SUPPLY, V, volume_rate)
    assert 0.0 < command < 1.0
    assert rate_of(config, command, 200e3, min(volume_rate, 0.0)) == pytest.approx(
        20e3 / 0.05, rel=1e-6)
    above = PressurePid(PidGains(), config)
    assert above.update(400e3, 230e3, DT, SUPPLY, V, volume_rate) <= 0.0


@pytest.mark.parametrize(('distance', 'fastest', 'slowest', 'expected'), [
    (100.0, 1e6, -1e6, 100.0 * 200.0), (-100.0, 1e6, -1e6, -100.0 * 200.0),
    (50e3, 1e6, -1e6, 0.97e6), (-50e3, 1e6, -2e6, -1.94e6), (50e3, 9e6, -1e6, 3e6),
    (-50e3, 1e6, -9e6, -3e6), (50e3, -1e5, -1e6, 0.0), (-50e3, 1e6, 1e5, 0.0)])
def test_the_followed_setpoint_closes_in_within_what_the_valve_can_do(distance, fastest, slowest,
                                                                      expected):
    """At its bandwidth; no faster than 97 % of the valve, or than it may."""
    settings = settings_of(setpoint_bandwidth=200.0, setpoint_rate=3e6)
    state = at(100e3)
    rate = follow(settings, state, 100e3 + distance, 100e3, DT, fastest, slowest)
    assert rate == pytest.approx(expected)
    assert state.followed == pytest.approx(100e3 + expected * DT)


def test_a_followed_setpoint_above_all_air_comes_down_at_its_bandwidth():
    """To the reading or the setpoint, the higher; there is nothing that the valve must let out."""
    for setpoint, pressure in ((50e3, 90e3), (90e3, 50e3)):
        state = at(100e3)
        rate = follow(settings_of(setpoint_bandwidth=200.0), state, setpoint, pressure, DT, 1e6,
                      -1e3)
        assert rate == pytest.approx(-10e3 * 200.0)


def test_the_past_is_linear_between_samples_and_constant_outside():
    """Wherever in the ring it begins."""
    random = Random(1)
    for head in (0, 40, 63):
        state = PidState(head=head, size=10)
        times = np.cumsum([random.uniform(0.1, 0.3) for _ in range(10)])
        values = [random.uniform(-1.0, 1.0) for _ in range(10)]
        for k in range(10):
            state.past_time[(head + k) % 64] = times[k]
            state.past_sent[(head + k) % 64] = values[k]
        for time in (*np.linspace(times[0] - 0.5, times[-1] + 0.5, 41), *times):
            assert past_value(state, state.past_sent, time) == pytest.approx(
                np.interp(time, times, values))


@pytest.mark.parametrize(('lag', 'dt'), [(6.8e-3, 2e-3), (30e-3, 1e-3), (0.1, 5e-4)])
def test_what_is_coming_is_what_was_sent_within_the_lag(lag, dt):
    """Between limits: the lag is known to a tenth of itself and half a sample."""
    settings, state, random = settings_of(flow_lag=lag), at(100e3), Random(2)
    times, sent = [0.0], [0.0]
    for k in range(600):
        low, high = still_coming(settings, state, dt)
        now = k * dt
        whole, doubt = lag + dt, 0.1 * (lag + dt) + 0.5 * dt
        back = [sent[-1] - np.interp(now - whole + off, times, sent)
                for off in (0.0, -doubt, doubt)]
        # where samples are many not every one is kept
        close = {'abs': 1e-6} if lag / dt < 40 else {'abs': 400.0}
        assert state.coming == pytest.approx(back[0], **close)
        assert (low, high) == pytest.approx((min(back), max(back)), **close)
        assert low <= state.coming <= high
        change = 200.0 * random.uniform(-1.0, 1.0) + 100.0 * math.sin(k / 20.0)
        send(state, change, 0.5 * dt, -0.25 * dt)
        times.append(now + dt)
        sent.append(sent[-1] + change)
        assert state.size <= 64
    assert (state.learnt.open, state.learnt.flow) == pytest.approx((300.0 * dt, -150.0 * dt))


def test_an_error_within_the_quiet_band_or_on_its_way_is_none():
    """Beyond, it is what is left; with a sign like the error's."""
    settings = settings_of(quiet_error=500.0, filter_time=0.0, flow_lag=4e-3)
    for error, left in ((300.0, 0.0), (-499.0, 0.0), (800.0, 300.0), (-2000.0, -1500.0)):
        state = at(100e3)
        assert error_beyond_noise(settings, state, 100e3 - error, DT) == pytest.approx(left)
        assert state.measured_rate == pytest.approx(-error / DT)
        assert state.filtered == pytest.approx(100e3 - error)
    for error, left in ((5e3, 0.0), (5.4e3, 0.0), (7e3, 1.5e3), (3e3, -1.5e3), (-2e3, -6.5e3)):
        state = at(100e3)
        still_coming(settings, state, DT)
        send(state, 5e3, 0.0, 0.0)  # commanded, and not to be read yet
        found = error_beyond_noise(settings, state, 100e3 - error, DT)
        assert found == pytest.approx(left, abs=1e-6)


def test_small_errors_are_filtered_and_large_ones_are_not():
    """The filter is first order; four quiet bands are large."""
    settings, state = settings_of(quiet_error=100.0, filter_time=4e-3), at(100e3)
    share = 1.0 - math.exp(-DT / 4e-3)
    assert error_beyond_noise(settings, state, 100e3 - 390.0, DT) == pytest.approx(
        390.0 * share - 100.0)
    assert state.measured_rate == pytest.approx(-390.0 * share / DT)
    state = at(100e3)
    assert error_beyond_noise(settings, state, 100e3 - 410.0, DT) == pytest.approx(310.0)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(('mode', 'error', 'integral', 'excess', 'gained'), [
    ('none', 100.0, 9e9, 5.0, 20.0),
    ('back_calculation', 100.0, 300.0, 0.0, 20.0),
    ('back_calculation', 100.0, 300.0, -50.0, 20.0 - 5.0),
    ('back_calculation', 100.0, 4000.0, 0.0, 0.0),   # asks for more than a leak takes
    ('back_calculation', -100.0, 4000.0, 0.0, -20.0),
    ('conditional_integration', 100.0, 300.0, 50.0, 20.0),
    ('conditional_integration', 100.0, 300.0, -50.0, 0.0),
    ('conditional_integration', -100.0, 300.0, -50.0, -20.0)])
def test_the_integral_adds_what_anti_windup_lets_it(mode, sign, error, integral, excess, gained):
    """A gain of 100 over 2 ms; limits of 5 kPa/s either way; excess is what was not possible."""
    settings = settings_of(p=20.0, i=100.0, anti_windup=mode, tracking_time=0.02)
    state = at(100e3)
    state.integral = sign * integral
    integrate(settings, state, sign * error, 0.0, sign * excess, DT, False, -5e3, 5e3)
    assert state.integral == pytest.approx(sign * (integral + gained))


def test_the_integral_learns_nothing_in_a_step_and_forgets_at_rest():
    """Where the setpoint moves it stays; at rest it is gone by 1/e in 0.1 s; limits hold."""
    settings = settings_of(p=20.0, i=100.0, quiet_error=500.0)
    state = at(100e3)
    state.integral = 900.0
    integrate(settings, state, 1e3, 41e3, 0.0, DT, False, -5e3, 5e3)
    assert state.integral == 900.0
    integrate(settings, state, 30.0, 39e3, 0.0, DT, False, -5e3, 5e3)
    assert state.integral == pytest.approx(900.0 + 100.0 * 30.0 * DT)
    state.integral = 900.0
    for _ in range(50):
        integrate(settings, state, 0.0, 0.0, 0.0, DT, True, -5e3, 5e3)
    assert state.integral == pytest.approx(900.0 / math.e)
    integrate(settings, state, 30.0, 0.0, 0.0, DT, False, -200.0, 200.0)
    assert state.integral == 200.0


def test_after_forgetting_all_is_as_before_the_first_reading():
    """But for what was learnt of the dead band, and the command, which is a valve's."""
    settings, state = settings_of(), PidState()
    for k in range(30):
        pressure_step(settings, state, 300e3, 200e3 + 1e3 * k, DT, SUPPLY, V, 1e-6)
    band = state.learnt
    forget(state, 1.7)
    fresh = PidState(command=1.0, learnt=band)
    for name in ('command', 'integral', 'carried', 'followed', 'sent', 'coming', 'filtered',
                 'quiet', 'measured_rate', 'head', 'size', 'clock', 'started'):
        assert getattr(state, name) == getattr(fresh, name), name


@pytest.mark.parametrize('command', [0.4, -0.3])
def test_a_command_that_is_taken_over_is_the_rate_that_it_gives(command):
    """So that the first command of the loop is that one again; within the dead band it is none."""
    state = PidState(command=command)
    config = PidConfig(supply=SUPPLY, volume=V)
    start(settings_of(), state, 150e3, SUPPLY + config.ambient, V, 1e-5)
    assert state.carried == pytest.approx(rate_of(config, command, 150e3, 1e-5))
    assert (state.followed, state.filtered, state.size) == (150e3, 150e3, 1)
    still = PidState(command=0.03)
    start(settings_of(), still, 150e3, SUPPLY + config.ambient, V, 1e-5)
    assert still.carried == 0.0


@pytest.mark.parametrize('learnt', [-0.06, -0.02, 0.0, 0.03])
def test_a_command_jumps_over_the_dead_band_as_it_was_learnt(learnt):
    """Each side by its own; a valve with that dead band then opens by what was asked for."""
    for opening, side in ((0.2, 'fill'), (-0.7, 'vent'), (1.0, 'fill'), (-1.0, 'vent')):
        band = ValveLearningState(**{side: learnt})
        valve = ValveFlow(dead_band=max(0.04 + learnt, 0.0))
        command = command_of(band, 0.04, opening, 1.0)
        assert valve.opening(command) == pytest.approx(opening)
    assert command_of(ValveLearningState(fill=0.02), 0.04, 0.0, 1.0) == 0.0
    assert command_of(ValveLearningState(), 0.04, 0.9, 0.5) == 0.5
    assert command_of(ValveLearningState(), 0.04, -0.9, 0.5) < -0.9


def test_a_missing_rate_is_shared_by_variance():
    """Half the dead band's where the opening times 0.3 is as large as the dead band's doubt."""
    shares = [band_weight(wide, 0.04) for wide in np.linspace(0.0, 1.0, 50)]
    assert shares[0] == 1.0
    assert np.all(np.diff(shares) < 0.0)
    even = next(wide for wide in np.linspace(0.0, 1.0, 2001) if band_weight(wide, 0.04) < 0.5)
    assert band_weight(2.0 * even, 0.04) == pytest.approx(0.2, abs=0.01)
    assert band_weight(2.0 * even, 0.08) == pytest.approx(0.5, abs=0.01)


def test_a_valve_that_is_open_to_exhaust_for_good_teaches_nothing(chamber):
    """All air is out: what a reading then does is no answer to the valve."""
    made = chamber(noise=100.0)
    made.run(150e3, 0.2)
    learnt = [made.pid.state.learnt.vent for seconds in (0.2, 0.1, 0.2) if made.run(0.0, seconds)]
    assert learnt[1] == learnt[2] == pytest.approx(learnt[0], abs=1e-4)
