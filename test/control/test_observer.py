# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The observer of the force that the model leaves out."""

import copy
import math
import random

import numpy as np
import pytest
from scipy.stats import norm

from fam_bundle_ros.control.observer import (
    average,
    begin_at,
    beyond_noise,
    forget_observer,
    learn_noise,
    low_pass,
    may_be_spike,
    noise_gain,
    noise_of,
    NoiseState,
    observe,
    ObserverState,
    quick_noise,
    quick_of,
    shift,
    shrink,
    take_out_late,
    update_bank,
    update_odds,
)

DT, LAG, NOISE = 4e-3, 0.025, 0.9


def observed(error, duration, noise=NOISE, seed=2):
    """Return the state after, and all biases of, an error over time in noisy readings (N)."""
    state, draw, found = ObserverState(), random.Random(seed), []
    for k in range(round(duration / DT)):
        observe(state, error(k * DT) + draw.gauss(0.0, noise), 0.0, 0.0, 1.0, LAG, DT)
        found.append(state.bias)
    return state, found


def test_noise_alone_is_no_error():
    """Of 0.9 N of noise a model that is right gets less than 0.05 N (rms) into its demand."""
    _, found = observed(lambda t: 0.0, 20.0)
    assert (sum(bias * bias for bias in found) / len(found)) ** 0.5 < 0.05


@pytest.mark.parametrize(('rate', 'after', 'low', 'high'), [
    (0.0, 6.0, 39.0, 41.0),   # a unit that stays where it is: the others have to replace it
    (20.0, 1.9, 0.0, 2.0),    # one that fills for two seconds: it will be there
])
def test_force_that_is_asked_for_and_does_not_come_is_asked_for_again(rate, after, low, high):
    """Of 60 N at the setpoints 20 N are there at the pressures, and the force agrees with that."""
    state = ObserverState()
    for k in range(round(after / DT)):
        believed = 20.0 + rate * k * DT
        observe(state, believed, believed, 60.0, 1.0, LAG, DT)
    assert low <= -state.bias <= high


def test_a_reading_far_from_the_one_before_counts_once_the_next_confirms_it():
    """Every second reading may be a spike; noise, small steps and the first readings are none."""
    state, draw, rest = NoiseState(), random.Random(2), 2.0
    for _ in range(500):
        learn_noise(state, draw.gauss(0.0, NOISE), 0.1, DT)
    state.last = 0.1
    assert [may_be_spike(state, value, rest) for value in (50.0, 0.2, 50.0, 49.0, 90.0)] == [
        True, False, True, False, False]
    assert not may_be_spike(state, 0.1 + 4.0 * NOISE, rest)
    assert not may_be_spike(NoiseState(), 50.0, rest)
    state.change = 0.0
    assert not may_be_spike(state, 2.0, rest)
    assert may_be_spike(state, 2.2, rest)


@pytest.mark.parametrize('rate', [1.0, 4.0, 16.0])
def test_an_error_that_moves_is_followed_as_quickly_as_it_moves(rate):
    """Slow ones, of less than the noise within half a second, lag by no more than quick ones."""
    _, found = observed(lambda t: 5.0 - rate * max(t - 6.0, 0.0), 7.5)
    left = [found[k] - (5.0 - rate * (k * DT - 6.0)) for k in range(round(6.5 / DT), len(found))]
    assert abs(sum(left) / len(left)) < max(0.35, 1.2 * rate * LAG)


@pytest.mark.parametrize('rate', [2.0, 4.0])
def test_a_drift_within_the_noise_is_followed_by_the_observer_that_predicts_it_best(rate):
    """Half a second after it began; the patient one is behind by rate times half a second."""
    left = []
    for seed in range(6):
        _, found = observed(lambda t: 5.0 - rate * max(t - 6.0, 0.0), 7.5, seed=seed)
        left += [found[k] - (5.0 - rate * (k * DT - 6.0))
                 for k in range(round(6.5 / DT), len(found))]
    assert abs(sum(left) / len(left)) < 0.3
    assert (sum(each * each for each in left) / len(left)) ** 0.5 < 0.4


def test_an_error_that_has_moved_and_rests_gets_as_little_noise_as_before():
    """What led while the error moved is forgotten, however long it moved."""
    _, found = observed(lambda t: 8.0 * math.sin(6.0 * t) if t < 10.0 else 0.0, 16.0)
    last = found[-round(3.0 / DT):]
    assert (sum(bias * bias for bias in last) / len(last)) ** 0.5 < 0.1


@pytest.mark.parametrize('still', [0.0, 2.0])
def test_noise_that_is_not_known_yet_is_no_error_for_long(still):
    """From the first reading on, or after a gauge that stood still for so many seconds."""
    squares = []
    for seed in range(6):
        _, found = observed(lambda t, draw=random.Random(seed): draw.gauss(
            0.0, NOISE) if t >= still else 0.0, still + 2.5, noise=0.0)
        squares += [bias * bias for bias in found[-round(1.0 / DT):]]
    assert (sum(squares) / len(squares)) ** 0.5 < 0.08


def test_an_error_far_beyond_the_noise_is_followed_by_the_quickest_alone():
    """Of 4 Hz and 20 N no slower one takes anything away."""
    state, draw = ObserverState(), random.Random(1)
    for k in range(round(2.0 / DT)):
        observe(state, 20.0 * math.sin(8.0 * math.pi * k * DT) + draw.gauss(0.0, NOISE), 0.0, 0.0,
                1.0, LAG, DT)
        if k > 250:
            assert state.bias == pytest.approx(quick_of(state), abs=0.25)


def test_beginning_anew_leaves_nothing():
    """Neither what the observers found nor which of them led."""
    state, _ = observed(lambda t: 8.0 * t, 3.0)
    fresh = ObserverState()
    begin_at(fresh, 4.0)
    begin_at(state, 4.0)
    assert state == fresh
    assert [state.bias, state.steady, *state.bank] == [4.0] * 6
    forget_observer(state)
    assert state == ObserverState()


def test_no_error_is_too_large_to_be_weighed():
    """A load cell in mN by mistake, from one tick to the next."""
    state, _ = observed(lambda t: 1e5 if t > 1.0 else 0.0, 2.0)
    assert state.bias == pytest.approx(1e5, abs=1.0)


def test_after_a_jump_the_steady_observer_leads_again_once_it_is_there():
    """Two seconds after 20 N none of the quicker ones is ahead of the odds against it."""
    state, found = observed(lambda t: 20.0 if t > 2.0 else 0.0, 4.5)
    assert max(state.lead) < math.log(4000.0)
    assert found[-1] == pytest.approx(20.0, abs=0.3)


def test_a_value_goes_towards_another_beyond_the_noise():
    """Not at all within it, nearly all the way far beyond it, and without a jump between."""
    assert shrink(1.0, 1.3, 0.09) == 1.0 == shrink(1.0, 1.0, 0.0)
    assert shrink(1.0, 1.3001, 0.09) == pytest.approx(1.0, abs=1e-3)
    assert shrink(1.0, -9.0, 0.09) == pytest.approx(-9.0, abs=0.01)


def test_a_model_that_says_less_of_the_same_shifts_the_error_without_a_bump():
    """Readings that go on as before find the bias changed by just that, from the next on."""
    state, _ = observed(lambda t: 3.0, 3.0, noise=0.0)
    before = state.bias
    shift(state, 2.0)
    for _ in range(200):
        observe(state, 3.0, -2.0, -2.0, 1.0, LAG, DT)
        assert state.bias == pytest.approx(before + 2.0, abs=1e-6)


def test_a_shift_leaves_what_follows_as_it_would_have_been():
    """On a moving error in noise, beside an observer whose model was not changed."""
    state, _ = observed(lambda t: 3.0, 3.0)
    other, draw = copy.deepcopy(state), random.Random(3)
    shift(other, 2.0)
    for k in range(200):
        force = 3.0 + 9.0 * k * DT + draw.gauss(0.0, NOISE)
        observe(state, force, 0.0, 0.0, 1.0, LAG, DT)
        observe(other, force, -2.0, -2.0, 1.0, LAG, DT)
        assert other.bias == pytest.approx(state.bias + 2.0, abs=0.02)
        assert other.lead == pytest.approx(state.lead, abs=0.3)


@pytest.mark.parametrize(('corrected', 'error', 'jump', 'left'), [
    (-9.0, 0.0, -9.0, 0.0),    # the model is late: all of it was corrected already
    (-4.0, 0.0, -9.0, 0.0),    # some of it was
    (0.0, 0.0, -9.0, 0.0),     # in time: there is nothing to hand over
    (0.0, 9.0, -9.0, 0.0),     # early: the force still has to jump
    (3.0, 3.0, -9.0, 3.0),     # what the model lacks besides stays
    (-6.0, 3.0, -9.0, 0.0),    # no more than was corrected
])
def test_what_the_model_explains_late_is_handed_over(corrected, error, jump, left):
    """Friction that feedback has made up for and that is believed at last is nowhere twice."""
    state = ObserverState()
    begin_at(state, corrected)
    share = take_out_late(state, error, jump)
    assert state.bank == pytest.approx([left] * 4)
    assert share * jump == pytest.approx(corrected - left)


@pytest.mark.parametrize('size', [0.01, 0.9])
def test_noise_is_known_from_second_differences(size):
    """Of white noise on a ramp; the first three readings say it at once, a step says nothing."""
    state, draw = NoiseState(), random.Random(4)
    for k in range(6000):
        learn_noise(state, 50.0 * k * DT + draw.gauss(0.0, size), 0.0, DT)
        if k == 1:
            assert noise_of(state) == 0.0
    assert noise_of(state) == pytest.approx(size, rel=0.12)
    before = noise_of(state)
    learn_noise(state, 1e6, 0.0, DT)
    assert noise_of(state) < 1.02 * before


def test_a_first_order_lag_leaves_its_share_of_white_noise():
    """And the quick observer as much of that which it has learnt."""
    draw, share, value, values = random.Random(5), low_pass(DT, LAG), 0.0, []
    assert (1.0 - share) ** round(LAG / DT * 100.0) == pytest.approx(math.exp(-100.0), rel=1e-9)
    for _ in range(40_000):
        value += share * (draw.gauss(0.0, 1.0) - value)
        values.append(value)
    assert noise_gain(share) == pytest.approx(np.std(values), rel=0.03)
    state, _ = observed(lambda t: 0.0, 10.0)
    assert quick_noise(state, LAG, DT) == pytest.approx(NOISE * np.std(values), rel=0.1)


def test_an_error_counts_as_far_as_its_power_is_beyond_the_noise_of_the_quick_observer():
    """One that moves by some of the noise, at a moment at which it is not at its largest."""
    state, draw, seen = ObserverState(), random.Random(7), []
    for k in range(round(6.0 / DT)):
        observe(state, 2.0 * math.sin(12.0 * k * DT) + draw.gauss(0.0, NOISE), 0.0, 0.0, 1.0, LAG,
                DT)
        if k * DT > 3.0 and abs(quick_of(state) - state.steady) < 0.1:
            seen.append(state.weight)
            assert state.weight == pytest.approx(beyond_noise(
                state.power, quick_noise(state, LAG, DT) ** 2))
    assert 0.1 < min(seen) < max(seen) < 0.9


def test_power_counts_as_far_as_it_is_four_times_that_of_noise():
    """Noise alone is nothing; what is far beyond is nearly all of it."""
    assert beyond_noise(0.0, 0.0) == beyond_noise(4.0, 1.0) == beyond_noise(1.0, 2.0) == 0.0
    assert beyond_noise(8.0, 1.0) == 0.5
    assert beyond_noise(3.0, 0.0) == 1.0


def test_leads_are_log_likelihoods_that_fade_and_means_are_weighted_by_them():
    """One step of each, by the normal density; odds of 1 to 4000 against each of the four."""
    state = ObserverState(steady=1.0, bank=[1.2, 1.5, 2.0, 3.0], lead=[0.5, -2.0, 1.0, 0.0])
    before = np.array(state.lead)
    update_odds(state, 1.8, 0.25, DT)
    gained = norm.logpdf(1.8, state.bank, 0.5) - norm.logpdf(1.8, 1.0, 0.5)
    assert state.lead == pytest.approx(before * math.exp(-DT / 0.25) + gained)
    state.lead = [7.0, 9.0, 2.0, 8.5]
    odds = np.exp(np.array(state.lead)) / 4000.0
    assert average(state) == pytest.approx((1.0 + odds @ state.bank) / (1.0 + odds.sum()))
    for _ in range(1000):
        update_odds(state, 2.0, 0.25, DT)
    assert max(state.lead) == pytest.approx(2.0 * math.log(4000.0))


def test_the_bank_goes_from_patient_to_quick_in_equal_ratios():
    """After a step of the error for as long as the last one's time each has its own share."""
    state, time, steps = ObserverState(), 0.0625 * 0.5, 100
    for _ in range(steps):
        update_bank(state, 1.0, time, time / steps)
    spans = 0.5 * 0.5 ** np.arange(1.0, 5.0)
    assert state.bank == pytest.approx(1.0 - np.exp(-time / spans))


@pytest.mark.parametrize(('missing', 'found'), [
    (0.8, -0.8), (-0.8, 0.8), (3.0, -3.0 * 60.0 * LAG / 2.5), (-3.0, 3.0 * 60.0 * LAG / 2.5)])
def test_what_pressures_do_not_give_is_asked_for_besides(missing, found):
    """A valve that sticks by less than the reach; more than that only within 2.5 s."""
    state = ObserverState()
    for _ in range(round(60.0 * LAG / DT)):
        observe(state, 50.0, 50.0, 50.0 + missing, 1.0, LAG, DT)
    assert state.bias == pytest.approx(found, abs=0.05)


def test_a_pressure_that_stays_away_from_its_command_is_asked_for_within_noise():
    """Its effect lasts, so that less than the noise of one reading can be seen in the mean."""
    rng, state, found = np.random.default_rng(3), ObserverState(), []
    for noise in rng.normal(0.0, 1.0, 4000):
        observe(state, 50.0, 50.0 + noise, 50.5, 3.0, LAG, DT)
        found.append(state.bias)
    assert np.mean(found[1000:]) == pytest.approx(-0.5, abs=0.2)


def test_what_pressures_give_later_is_not_missing():
    """Asked for by a ramp to and fro, and there a lag of the loop later."""
    state, given, found = ObserverState(), 0.0, []
    for k in range(3000):
        asked = 40.0 + 10.0 * abs((k * DT) % 2.0 - 1.0)
        given = asked if k == 0 else given + low_pass(DT, LAG) * (asked - given)
        observe(state, given, given, asked, 1.0, LAG, DT)
        found.append(state.bias)
    assert max(map(abs, found)) < 1e-6
