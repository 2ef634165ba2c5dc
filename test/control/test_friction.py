# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction, learnt from the model's error in motions either way."""

import numpy as np
import pytest

from fam_bundle_ros.control import (
    ControllerConfig,
    LoadModel,
    Measurement,
    OuterConfig,
    RecruitmentController,
    Reference,
)
from fam_bundle_ros.control.adaptation import AdaptationConfig
from fam_bundle_ros.control.friction import FrictionState, learn_friction, turn_round
from fam_bundle_ros.control.observer import low_pass
from fam_bundle_ros.control.outer_loop import (
    FORCE,
    forget_outer,
    outer_settings,
    outer_step,
    OuterState,
    STRAIN,
)
from fam_bundle_ros.control.saturation import FREE
from fam_bundle_ros.control.signals import MeasurementRecord

LAG, DT = 0.02, 4e-3


def seen(*motions, noise=0.0, duration=0.2):
    """Return what is learnt of errors (N) in motions (1, -1, or 0 at rest)."""
    state = FrictionState()
    for direction, error in motions:
        for _ in range(round(duration / DT)):
            learn_friction(state, direction, error, noise, False, LAG, DT)
    return state


def turned(state, rate, error, duration=DT):
    """Return the change of the model's error that a reference's rate lets expect, N."""
    return sum(turn_round(state, rate, error, LAG, DT) for _ in range(round(duration / DT)))


def test_a_turn_costs_what_the_turn_before_has_shown():
    """And what the model misses both ways, here 4 N of 10 N and then 6 N more, is no friction."""
    state = seen((1, 4.0 - 3.0), (-1, 4.0 + 3.0), (-1, 10.0 + 3.0), duration=0.5)
    turned(state, 0.0, 13.0, 0.5)
    assert turned(state, 0.1, 13.0) == pytest.approx(-6.0, abs=0.01)
    assert turned(state, 0.1, 7.0, 1.0) == 0.0
    assert turned(state, -0.1, 7.0) == pytest.approx(6.0, abs=0.01)


def test_one_way_says_nothing_of_the_other():
    """A model may be off by as much both ways."""
    assert turned(seen((1, -3.0)), -0.1, -3.0) == 0.0


def test_a_load_that_changes_and_moves_nothing_shows_friction():
    """Beyond three standard deviations of the noise."""
    state = seen((1, -3.0), (0, 2.0), noise=0.2)
    assert (state.low, state.high) == (-3.0, pytest.approx(2.0 - 0.6))
    assert seen((0, 2.0), (0, -2.0)).high == 0.0


@pytest.mark.parametrize('first', [1, -1])
@pytest.mark.parametrize(('noise', 'friction'), [(0.2, 0.0), (0.0, 0.3)])
def test_a_difference_within_the_noise_is_no_friction(first, noise, friction):
    """Else each reversal would add noise to the demand."""
    state = seen((first, -0.3 * first), (-first, 0.3 * first), noise=noise)
    turned(state, 0.0, 0.3 * first, 0.5)
    assert turned(state, 0.1 * first, 0.3 * first) == pytest.approx(-2.0 * friction * first)


def test_a_twitch_teaches_nothing():
    """Shorter than three lags, the error is still that of before."""
    state = seen((1, -3.0))
    for _ in range(round(2.9 * LAG / DT)):
        learn_friction(state, -1, 5.0, 0.0, False, LAG, DT)
    assert (state.low, state.high) == (-3.0, -3.0)


def test_a_crossing_unit_teaches_no_friction():
    """Its push-back errs by more than what rubs, until three lags after the crossing."""
    state = seen((1, -3.0), (-1, 3.0))
    for crossing, duration in ((True, 0.5), (False, 2.9 * LAG)):
        for _ in range(round(duration / DT)):
            learn_friction(state, 0, -40.0, 0.0, crossing, LAG, DT)
    assert (state.low, state.high) == (-3.0, 3.0)
    seen_at_rest = state.low
    for _ in range(round(LAG / DT)):
        learn_friction(state, 0, -40.0, 0.0, False, LAG, DT)
    assert state.low < seen_at_rest


def test_at_rest_friction_may_be_anything_between():
    """Then only the rest of the way is left to go."""
    state = seen((1, -3.0), (-1, 3.0))
    turned(state, 0.0, 1.0, 0.5)
    assert turned(state, -0.1, 1.0) == pytest.approx(2.0)
    turned(state, 0.0, 1.0, 0.5)
    assert turned(state, 0.1, 1.0) == pytest.approx(-4.0)


def test_friction_is_asked_for_at_turns_only():
    """What the error does in the motion is the integral's, and nothing beyond the friction."""
    state = seen((1, -3.0), (-1, 3.0))
    turned(state, 0.0, 10.0, 0.5)
    assert turned(state, 0.1, 10.0) == pytest.approx(-6.0)
    state.low -= 2.0
    assert turned(state, 0.1, 10.0, 1.0) == 0.0


def test_a_reversal_without_rest_takes_the_whole_band():
    """Also where the model has missed 10 N more, both ways, since the reversal before."""
    state = seen((1, -3.0), (-1, 3.0))
    turned(state, -0.1, 3.0)
    for _ in range(200):
        learn_friction(state, -1, 13.0, 0.0, False, LAG, DT)
    assert turned(state, 0.1, 13.0) == pytest.approx(-6.0, abs=0.05)


def test_friction_may_differ_between_the_ends_of_a_motion():
    """10 N at the upper end and 4 N at the lower: each reversal takes that of its own end."""
    state = seen((1, -3.0), (-1, 7.0), (-1, 1.0), (1, -3.0), duration=0.5)
    turned(state, 0.0, -3.0, 0.5)
    assert turned(state, -0.1, -3.0) == pytest.approx(10.0, abs=0.05)
    for _ in range(200):
        learn_friction(state, -1, 7.0, 0.0, False, LAG, DT)
    assert turned(state, 0.1, 7.0) == pytest.approx(-4.0, abs=0.05)


def test_a_tick_of_rest_between_motions_does_not_count():
    """A sampled sine has a rate of exactly zero at its peak."""
    state = seen((1, -3.0), (-1, 3.0))
    turned(state, -0.1, 3.0)
    for _ in range(200):
        learn_friction(state, -1, 13.0, 0.0, False, LAG, DT)
    assert turned(state, 0.0, 13.0) == 0.0
    assert turned(state, 0.1, 13.0) == pytest.approx(-6.0, abs=0.05)


def test_what_gives_energy_is_no_friction():
    """A model that misses more while the strain rises than while it falls lacks something else."""
    state = seen((1, 3.0), (-1, -3.0))
    turned(state, 0.0, -3.0, 0.5)
    assert turned(state, 0.1, -3.0) == 0.0


def test_a_reference_that_trembles_asks_for_friction_no_more_than_once():
    """
    Within a fifth.

    Where nothing moves the model's error follows what is asked for, with the loop's lag.
    """
    state, asked, error = seen((1, -3.0), (-1, 3.0)), [3.0], 3.0
    turned(state, 0.0, 3.0, 0.5)
    for k in range(60):
        asked.append(asked[-1] + turned(state, 0.1 * (-1) ** k * (k % 3 > 0), error))
        error += low_pass(DT, LAG) * (asked[-1] - error)
    assert min(asked) == pytest.approx(-3.0, abs=1.2)
    assert max(asked) == pytest.approx(3.0, abs=1.2)


@pytest.mark.parametrize(('integral', 'share'), [(None, 1.0), (0.0, 0.0)])
def test_the_demand_takes_friction_when_the_reference_turns(paper_bundle, integral, share):
    """All of it in one tick; not where a user asks for no integral."""
    settings = outer_settings(OuterConfig(strain_integral=integral), LoadModel(), paper_bundle)
    state, before = OuterState(), 0.0
    for k in range(300):
        rate = 0.0 if k < 299 else 0.1
        before = state.integral
        outer_step(settings, state, MeasurementRecord(13.0, 0.1, 0.0, [150e3, 0.0]), 10.0, 10.0,
                   4.0, STRAIN, 0.1, rate, FREE, 0.0, 0.0, 0.0, DT)
        state.friction.low, state.friction.high, state.friction.side = -3.0, 3.0, -1
    assert state.integral - before == pytest.approx(share * 6.0, abs=0.05)


def test_a_strain_loop_begins_with_the_friction_that_is_there(paper_bundle):
    """Switched on while its reference moves; and nothing is left when all is forgotten."""
    settings, state = outer_settings(OuterConfig(), LoadModel(5.0), paper_bundle), OuterState()
    for kind in (FORCE, STRAIN):
        for _ in range(300 if kind == FORCE else 1):
            state.friction.low, state.friction.high = -3.0, 3.0
            outer_step(settings, state, MeasurementRecord(13.0, 0.1, 0.1, [150e3, 0.0]), 10.0,
                       10.0, 4.0, kind, 10.0 if kind == FORCE else 0.1, 0.1 * kind, FREE, 0.0, 0.0,
                       0.0, DT)
    assert state.integral == pytest.approx(6.0, abs=0.05)
    forget_outer(state)
    assert state.friction == FrictionState()


def test_friction_is_learnt_from_the_strain_s_own_motion(paper_bundle):
    """Held at one pressure, up and down: twice what rubs is between."""
    config = ControllerConfig(adaptation=AdaptationConfig(enabled=False))
    controller, pressure = RecruitmentController(paper_bundle, config), np.array([150e3, 0.0])
    for k in range(500):
        way = min(k, 500 - k) - 125
        strain = 0.10 + 0.05 * DT * max(way, 0)
        rubs = 0.0 if way <= 0 else 2.5 if k < 250 else -2.5
        force = float(paper_bundle.force(strain, pressure)) - rubs
        controller.update(DT, Measurement(force, strain, 0.0, pressure), Reference('force', 30.0))
    friction = controller.outer.friction
    assert friction.high - friction.low == pytest.approx(5.0, rel=0.25)


def test_friction_is_no_error_of_the_gains(paper_bundle):
    """
    A correct model of muscles that rub, moved up and down for a minute, stays as it is.

    Friction errs with the direction, as pressures of a tracked strain do: it would pass for a
    lag, and for weaker tension and push-back.
    """
    controller = RecruitmentController(paper_bundle, ControllerConfig())
    for k in range(round(60.0 / DT)):
        turn = 2.0 * np.pi * 0.5 * k * DT
        strain, way = 0.10 - 0.05 * np.cos(turn), np.sin(turn)
        pressure = np.array([150e3 - 80e3 * np.cos(turn) + 60e3 * way, 0.0])
        force = float(paper_bundle.force(strain, pressure)) - 6.0 * np.tanh(20.0 * way)
        controller.update(DT, Measurement(force, strain, 0.0, pressure), Reference('force', 30.0))
    pull, _, push, *_ = controller.memory.adaptation.error
    assert abs(pull) < 0.04
    assert abs(push) < 0.15
