# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The strain rate that the controller's model is asked about, and friction in that model."""

import numpy as np
import pytest

from fam_bundle_ros.control import ControllerConfig, OuterConfig
from fam_bundle_ros.control.rate import (
    find_direction,
    line_of,
    quiet_rate,
    quiet_strain,
    rate_ahead,
    rate_doubt,
    RateState,
    WINDOWS,
)
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

DT = 4e-3
NOISE = 5e-5


def believed(strain, noise=NOISE, dt=DT, seed=5, ahead=0.0):
    """Return what is believed at each of some true strains that are read with noise, 1/s."""
    random, state, rates = np.random.default_rng(seed), RateState(), []
    for true in strain:
        now = quiet_rate(state, float(true + random.normal(0.0, noise)), dt)
        rates.append(rate_ahead(state, ahead) if ahead else now)
    return np.array(rates)


def swing(hertz, size=0.03, seconds=8.0, dt=DT):
    """Return time, and strain and its rate of a sine."""
    time, turn = np.arange(0.0, seconds, dt), 2.0 * np.pi * hertz
    return time, size * np.sin(turn * time), size * turn * np.cos(turn * time)


def wrong_sign(seen, true):
    """Return the share of the time in which the direction is not that of the motion."""
    start = len(true) // 8
    return np.mean(np.sign(seen[start:]) != np.sign(true[start:]))


@pytest.mark.parametrize('noise', [0.0, 1e-6, 5e-5, 1e-3])
def test_noise_at_rest_is_no_motion(noise):
    """Whatever the size of the noise, a standing muscle stands: for a minute no motion."""
    assert not np.any(believed(np.full(15000, 0.1), noise))


def quiet(strain, noise, dt=4e-3):
    """Return the strain without noise over readings with noise."""
    state, found = RateState(), []
    for reading in strain + noise * np.random.default_rng(3).standard_normal(len(strain)):
        quiet_rate(state, reading, dt)
        found.append(quiet_strain(state, dt))
    return np.array(found)


def test_the_quiet_strain_stands_at_rest_and_follows_a_motion():
    """At rest it hardly moves for a minute; a motion loses no more than noise of the readings."""
    noise = 5e-5
    rest = quiet(np.full(15000, 0.1), noise)[500:]
    assert np.abs(np.diff(rest)).sum() < 3.0 * noise
    assert abs(rest - 0.1).max() < noise
    swing = 0.1 + 0.03 * np.sin(np.arange(0.0, 12.0, 4e-3))
    moving = abs(np.cos(np.arange(0.0, 12.0, 4e-3))) > 0.2
    assert np.std((quiet(swing, noise) - swing)[moving][100:]) < noise


@pytest.mark.parametrize('noise', [2e-5, 1e-4, 4e-4])
def test_noise_that_sets_in_is_no_motion(noise):
    """A gauge that stood still to the last digit begins to waver; ten times in ten."""
    for seed in range(10):
        wavers = noise * np.random.default_rng(seed).standard_normal(500)
        assert not np.any(believed(0.1 + np.r_[np.zeros(250), wavers], 0.0))


def test_a_motion_that_sets_in_is_seen_within_two_of_the_shortest_windows():
    """The jump of its rate is in one second difference, and no noise for long."""
    for rate in (0.005, 0.05, 0.5):
        seen = believed(0.1 + rate * DT * np.r_[np.zeros(250), np.arange(50)], 0.0)
        assert np.flatnonzero(seen)[0] <= 250 + round(0.02 / DT)


def test_a_reading_that_jumps_by_its_last_digit_is_no_motion():
    """A resolution of 1e-4 without noise: each jump is over within 0.1 s, and slow."""
    strain = np.round((0.1 + 1e-4 * np.arange(5000) / 2000.0) / 1e-4) * 1e-4
    seen = believed(strain, 0.0)
    assert np.mean(seen != 0.0) < 0.05


@pytest.mark.parametrize(('hertz', 'noise', 'late'), [
    (0.1, NOISE, 0.02), (0.5, NOISE, 0.03), (2.0, NOISE, 0.12), (0.1, 4.0 * NOISE, 0.07),
    (0.5, 4.0 * NOISE, 0.07)])
def test_a_reversal_is_seen_soon_and_once(hertz, noise, late):
    """The direction of a noisy swing is wrong for a small part of the period, without chatter."""
    _, strain, true = swing(hertz, seconds=20.0)
    seen = believed(strain, noise)
    assert wrong_sign(seen, true) < late
    signs = np.sign(seen[50:])
    turned = np.count_nonzero(np.diff(signs[signs != 0.0]))
    assert turned == np.count_nonzero(np.diff(np.sign(true[50:])))


@pytest.mark.parametrize('ahead', [0.0, 0.01])
def test_the_rate_of_a_motion_has_no_lag(ahead):
    """Clean readings of a sine: within 2 % of the peak, now and 10 ms ahead, but for reversals."""
    time, strain, true = swing(0.5)
    then = 0.03 * np.pi * np.cos(np.pi * (time + ahead))
    moving = (time > 1.0) & (abs(then) > 0.2 * then.max()) & (abs(true) > 0.2 * then.max())
    assert abs(believed(strain, 0.0, ahead=ahead) - then)[moving].max() < 0.02 * then.max()


@pytest.mark.parametrize('window', range(WINDOWS))
def test_the_line_of_a_straight_motion_is_that_motion(window):
    """Level and slope have no lag in any window once the start is forgotten."""
    state = RateState()
    for k in range(1000):
        quiet_rate(state, 0.1 + 0.02 * DT * k, DT)
    assert line_of(state, window) == pytest.approx((0.1 + 0.02 * DT * 999, 0.02), rel=1e-6)


def test_what_slows_down_is_not_told_to_turn():
    """Ahead of a reversal the rate is 0 at most: it may be a stop."""
    _, strain, true = swing(0.5)
    ahead, now = believed(strain, ahead=0.05), believed(strain)
    assert np.all(ahead * now >= 0.0)
    assert np.mean((ahead == 0.0) & (now != 0.0)) > 0.02


@pytest.mark.parametrize('rate', [0.03, 0.2])
def test_the_end_of_a_motion_is_seen_soon(rate):
    """After a sudden stop it is rest for most of the first 0.2 s, and then for good."""
    time = DT * np.arange(3000)
    seen = np.array([believed(rate * np.minimum(time, 10.0), seed=seed) for seed in range(10)])
    assert np.mean(seen[:, 2500 + 50:] != 0.0) < 0.005
    assert np.mean(seen[:, 2500:2500 + 50] != 0.0) < 0.35


def test_slow_motion_is_found_by_the_long_window():
    """Creeping by 1e-3 1/s, a twelfth of the noise from tick to tick, is a motion."""
    seen = believed(0.1 + 1e-3 * DT * np.arange(2500))
    assert np.mean(seen[500:] > 0.0) > 0.98
    assert np.mean(seen[500:]) == pytest.approx(1e-3, rel=0.05)


def test_starts_and_stops_are_not_learnt_as_noise():
    """With a start or a stop each second a motion counts as soon as after a long rest."""
    time = DT * np.arange(5000)
    steps = np.interp(time, np.arange(21.0), np.repeat(0.4 * np.arange(11), 2)[1:22])
    often = believed(steps)[4750:] != 0.0
    once = believed(np.maximum(steps - steps[4750], 0.0))[4750:] != 0.0
    assert abs(np.argmax(often) - np.argmax(once)) <= 2


def test_nothing_is_believed_before_the_noise_is_known():
    """The first readings say nothing, however much they move."""
    assert not np.any(believed(0.1 * np.arange(9), 0.0))


@pytest.mark.parametrize('window', [0.02, 0.04, 0.16])
def test_a_motion_is_over_when_its_rate_is_within_its_own_noise_of_rest(window):
    """A standard deviation or so: that of the window which the rate is of."""
    for noise in (1e-6, 5e-5, 1e-3):
        for share, direction in ((0.2, 0), (2.0, 1)):
            state = RateState()
            state.direction, state.window = 1, window
            state.rate = share * noise * rate_doubt(window, DT)
            find_direction(state, noise, noise, DT)
            assert state.direction == direction


@pytest.mark.parametrize(('way', 'rest', 'moves'), [
    (-1, 0.03, True), (-1, 0.06, False), (1, 0.03, False)])
def test_a_motion_back_needs_less_evidence_for_40_ms(way, rest, moves):
    """8 sd of the shortest window, soon after a motion ended: it turned. Later it may rest."""
    state, doubt = RateState(direction=1, window=0.01), NOISE * rate_doubt(0.01, DT)
    find_direction(state, NOISE, NOISE, DT)
    assert state.direction == 0
    for _ in range(round(rest / DT)):
        find_direction(state, NOISE, NOISE, DT)
    state.rate, state.quick = 8.0 * way * doubt, 8.0 * way * doubt
    find_direction(state, NOISE, NOISE, DT)
    assert state.direction == (way if moves else 0)


def test_a_window_keeps_the_noise_that_it_says():
    """The rate's spread at rest is that of the formula, for the longest window."""
    random, state, rates = np.random.default_rng(3), RateState(), []
    for _ in range(20000):
        quiet_rate(state, float(random.normal(0.0, NOISE)), DT)
        if state.window == 0.16:
            rates.append(state.rate)
    assert len(rates) > 15000
    assert np.std(rates) == pytest.approx(NOISE * rate_doubt(0.16, DT), rel=0.15)


@pytest.mark.parametrize('dt', [1e-3, 0.02])
def test_other_sample_times_leave_the_rate_as_it_is(dt):
    """At 1 kHz and at 50 Hz a motion is believed as at 250 Hz."""
    seen = believed(0.1 * dt * np.arange(round(8.0 / dt)), dt=dt)
    assert np.mean(seen[len(seen) // 2:]) == pytest.approx(0.1, abs=1e-3)


def test_friction_in_the_model_costs_nothing_at_rest(paper_bundle):
    """A constant force at a constant strain is as quiet with Coulomb friction as without."""
    model = paper_bundle.with_effect('coulomb_friction', force=6.0)
    log = ClosedLoop(model).run(Trajectory('hold', 'force', 3.0, lambda t: 40.0, lambda t: 0.0,
                                           Dynamometer(0.12)))
    rest = log.time > 1.0
    assert abs(log.error[rest]).max() < 0.2
    assert log.setpoint[rest].std(axis=0).max() < 500.0
    assert log.air[-1] - log.air[rest][0] < 1e-6


def test_friction_in_the_model_still_helps_in_motion(paper_bundle):
    """While the strain swings, feed-forward with the rig's friction is far better than without."""
    plant = paper_bundle.with_effect('coulomb_friction', force=6.0)
    swing = Trajectory('swing', 'force', 5.0, lambda t: 70.0 + 40.0 * np.sin(np.pi * t / 4.0),
                       lambda t: 10.0 * np.pi * np.cos(np.pi * t / 4.0), Dynamometer(0.1),
                       imposed=lambda t: 0.1 + 0.04 * np.sin(0.8 * np.pi * max(t, 0.0)))
    errors, alone = [], ControllerConfig(outer=OuterConfig(feedback=False))
    for model in (paper_bundle, plant):
        log = ClosedLoop(plant, model=model, controller=alone).run(swing)
        errors.append(np.sqrt(np.mean(log.error[log.time > 1.0] ** 2)))
    assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize(('speed', 'worse', 'most'), [
    (0.002, 1.15, 2.0), (0.004, 1.0, 2.0), (0.02, 0.91, 1.37)])
def test_friction_in_the_model_pays_unless_creeping(paper_bundle, speed, worse, most):
    """
    To and fro with sudden reversals: better than without it, where the direction can be told.

    At 0.002 1/s the strain moves by the noise of a reading in 25 ms, and feedback is as quick.
    """
    plant = paper_bundle.with_effect('coulomb_friction', force=6.0)

    def imposed(t):
        return 0.1 + speed * float(np.interp(max(t, 0.0) % 6.0, [0.0, 1.5, 4.5, 6.0],
                                             [0.0, 1.5, -1.5, 0.0]))
    creep = Trajectory('creep', 'force', 7.0, lambda t: 40.0, lambda t: 0.0, Dynamometer(0.1),
                       imposed=imposed)
    errors = []
    for model in (paper_bundle, plant):
        logs = [ClosedLoop(plant, model=model, seed=seed).run(creep) for seed in (1, 2, 3)]
        errors.append(np.sqrt(np.mean([log.error[log.time > 1.0] ** 2 for log in logs])))
    assert errors[1] < min(worse * errors[0], most)
    # Of 6 N that change sign, feedback leaves no more than a third either way.
    assert max(errors) < 2.0


@pytest.mark.parametrize('hertz', [0.25, 0.5, 1.0])
def test_friction_in_the_model_halves_the_error_of_feedback(paper_bundle, hertz):
    """A level force while the strain swings: the friction is there when the direction turns."""
    plant = paper_bundle.with_effect('coulomb_friction', force=6.0)
    task = Trajectory('level', 'force', 5.0, lambda t: 40.0, lambda t: 0.0, Dynamometer(0.09),
                      imposed=lambda t: 0.09 + 0.03 * np.sin(2.0 * np.pi * hertz * t), prepare=1.0)
    errors = []
    for model in (paper_bundle, plant):
        log = ClosedLoop(plant, model=model).run(task)
        errors.append(np.sqrt(np.mean(log.error[log.time > 1.0] ** 2)))
    assert errors[1] < 0.65 * errors[0]
