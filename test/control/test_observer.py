# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The observer of the force that the model leaves out."""

import copy
import math
import random

import pytest

from fam_bundle_ros.control.observer import (
    begin_at,
    forget_observer,
    hand_over,
    observe,
    ObserverState,
    quick_of,
    shift,
    towards,
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
    assert towards(1.0, 1.3, 0.09) == 1.0 == towards(1.0, 1.0, 0.0)
    assert towards(1.0, 1.3001, 0.09) == pytest.approx(1.0, abs=1e-3)
    assert towards(1.0, -9.0, 0.09) == pytest.approx(-9.0, abs=0.01)


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
    share = hand_over(state, error, jump)
    assert state.bank == pytest.approx([left] * 4)
    assert share * jump == pytest.approx(corrected - left)
