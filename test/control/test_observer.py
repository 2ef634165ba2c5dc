# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The observer of the force that the model leaves out."""

import random

import pytest

from fam_bundle_ros.control.observer import (
    begin_at,
    hand_over,
    observe,
    ObserverState,
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
    assert [state.quick, *state.between] == pytest.approx([left] * 4)
    assert share * jump == pytest.approx(corrected - left)
