# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Online adaptation: what it learns, what it leaves alone, and what it says."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.control import (
    AdaptationConfig,
    ControllerConfig,
    Measurement,
    RecruitmentController,
    Reference,
)
from fam_bundle_ros.control.adaptation import (
    adaptation_settings,
    adaptation_state,
    adaptation_step,
    bounds_of,
    forget_adaptation,
    lag_doubt,
    lag_of,
    lagged,
    learn_lead,
    noise_bias,
    USUAL_LAG,
)
from fam_bundle_ros.control.learnt import adapted_bundle, learnt_words, wrong_model
from fam_bundle_ros.errors import InputError

DT = 4e-3


class Learner:
    """Adaptation apart from the controller, told model forces and what is measured."""

    def __init__(self, bundle, **config):
        self.settings = adaptation_settings(AdaptationConfig(**config), bundle)
        self.state = adaptation_state(bundle.n)
        forget_adaptation(self.settings, self.state)

    def run(self, forces, measured, weight=1.0):
        for force, seen in zip(forces, measured):
            self.state.force[:] = [float(each) for each in force]
            adaptation_step(self.settings, self.state, float(seen), DT, weight)
        return np.array(self.state.error)


def exercise(seconds, speed=1.0):
    """Return forces of two units that move apart: the second pushes back at times."""
    t = speed * np.arange(round(seconds / DT)) * DT
    return np.stack([25.0 + 20.0 * np.sin(2.0 * t), 8.0 + 16.0 * np.sin(1.3 * t)], axis=1)


def test_gains_of_each_unit_and_of_the_push_back_are_found(paper_bundle):
    """Units that pull 8 % less and 6 % more, and push back a third more, are told apart."""
    forces, noise = exercise(120.0), np.random.default_rng(2)
    true = 0.92 * forces[:, 0] + np.where(forces[:, 1] > 0.0, 1.06, 1.33) * forces[:, 1] + 1.0
    found = Learner(paper_bundle).run(forces, true + 0.5 * noise.standard_normal(len(true)))
    assert found[:2] == pytest.approx([-0.08, 0.06], abs=0.02)
    assert found[2] == pytest.approx(0.33, abs=0.06)
    assert found[3] == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize(('seconds', 'left'), [(3.0, 0.035), (10.0, 0.01)])
def test_gains_that_describe_all_of_the_error_are_found_within_seconds(
        paper_bundle, seconds, left):
    """Of 10 % error of one unit two thirds in 3 s, nine tenths in 10 s, with nothing else."""
    forces, noise = exercise(seconds), np.random.default_rng(2)
    true = 0.9 * forces[:, 0] + forces[:, 1]
    found = Learner(paper_bundle).run(forces, true + 0.5 * noise.standard_normal(len(true)))
    assert found[0] == pytest.approx(-0.10, abs=left)
    assert abs(found[1]) < 0.02


def test_an_error_that_is_not_more_than_noise_teaches_nothing(paper_bundle):
    """Without evidence that the model is wrong it stays as it is, and as much in doubt."""
    forces = exercise(10.0)
    learner = Learner(paper_bundle)
    before = np.array(learner.state.covariance)
    assert np.all(learner.run(forces, 0.9 * forces.sum(axis=1), weight=0.0) == 0.0)
    assert np.array(learner.state.covariance) == pytest.approx(before)


def test_what_was_learnt_is_in_doubt_again_after_minutes(paper_bundle):
    """A minute takes up two thirds of the way back to the doubt of the beginning."""
    learner = Learner(paper_bundle)
    forces = exercise(20.0)
    learner.run(forces, forces.sum(axis=1))
    before = learner.settings.spread[1] ** 2
    learnt = learner.state.covariance[1][1]
    assert learnt < 0.1 * before
    learner.run(np.tile([30.0, 0.0], (15000, 1)), np.full(15000, 30.0))
    assert learner.state.covariance[1][1] == pytest.approx(
        before + (learnt - before) * np.exp(-1.0), rel=0.05)


def test_a_force_that_comes_late_is_a_lag(paper_bundle):
    """Air behind a tube of 15 ms is learnt as such, and no gain is blamed."""
    forces = exercise(120.0, speed=4.0)
    late = np.zeros(len(forces))
    total, state = forces.sum(axis=1), forces[0].sum()
    for k in range(len(late)):
        state += (1.0 - np.exp(-DT / 0.015)) * (total[k] - state)
        late[k] = state
    found = Learner(paper_bundle).run(forces, late)
    assert found[-1] == pytest.approx(0.015, abs=4e-3)
    assert abs(found[:2]).max() < 0.02


@pytest.mark.parametrize('rate', [20.0, 2000.0])
def test_a_reference_that_is_met_late_is_asked_for_earlier(paper_bundle, rate):
    """By an error that goes with the rate, however fast; slower than the loop of 20 ms."""
    learner, leads = Learner(paper_bundle), []
    for _ in range(5000):
        left = (0.01 - learner.state.lead) * rate
        learn_lead(learner.settings, learner.state, 1.0, left, rate, 0.02, DT)
        leads.append(learner.state.lead)
    assert leads[-1] == pytest.approx(0.01, abs=1e-3)
    assert max(leads) <= 0.01 + 1e-9 < USUAL_LAG
    assert leads[round(0.1 / DT)] < 0.007


def test_a_jump_of_the_reference_counts_as_far_as_an_error_at_rest_is_expected(paper_bundle):
    """What 200 N teach to distrust is four times as much where twice the error is usual."""
    missed = []
    for rest_error in (1.5, 3.0):
        learner = Learner(paper_bundle, rest_error=rest_error)
        for _ in range(1000):
            learn_lead(learner.settings, learner.state, 1.0, 200.0, 0.0, 0.02, DT)
        missed.append(learner.state.missed)
    assert missed[1] == pytest.approx(4.0 * missed[0])
    assert missed[0] < 1.5 ** 2


def test_an_hour_of_noise_without_excitation_moves_nothing(paper_bundle):
    """Constant pressures and half a newton of noise: less than 1 % in an hour."""
    learner, noise = Learner(paper_bundle), np.random.default_rng(3)
    learner.state.force[:] = [30.0, -4.0]
    worst = 0.0
    for seen in 26.0 + 0.5 * noise.standard_normal(180000):
        adaptation_step(learner.settings, learner.state, float(seen), 5.0 * DT)
        worst = max(worst, *map(abs, learner.state.error[:3]))
    assert worst < 0.01


@pytest.mark.parametrize('noise', [0.03, 0.1])
def test_noise_of_the_pressures_at_rest_is_no_weaker_muscle(paper_bundle, noise):
    """What was learnt on the move is kept over five minutes of rest, to 3 %."""
    random = np.random.default_rng(5)
    forces = np.concatenate([exercise(20.0), np.tile([50.0, 10.0], (75000, 1))])
    measured = forces @ [0.95, 1.1] - 1.0 + 0.15 * random.standard_normal(len(forces))
    forces += noise * random.standard_normal(forces.shape)
    learner = Learner(paper_bundle)
    learnt = learner.run(forces[:5000], measured[:5000])
    assert learner.run(forces[5000:], measured[5000:])[:2] == pytest.approx(learnt[:2], abs=0.03)


def test_the_covariance_neither_winds_up_nor_dies(paper_bundle):
    """After long rest a unit that was not used is as open to learning as at first."""
    learner = Learner(paper_bundle)
    learner.run(np.tile([30.0, 0.0], (50000, 1)), np.full(50000, 30.0))
    assert learner.state.covariance[1][1] == pytest.approx(learner.settings.spread[1] ** 2)
    assert np.all(np.linalg.eigvalsh(np.array(learner.state.covariance)) > 0.0)


def test_estimates_stay_within_bounds_and_say_so(paper_bundle):
    """A bundle that pulls nothing like its model: bounded, and `diagnose` is named."""
    forces = exercise(60.0)
    learner = Learner(paper_bundle)
    assert wrong_model(learner.settings, learner.state) == ''
    found = learner.run(forces, 3.0 * forces.sum(axis=1))
    assert found[0] == bounds_of(learner.settings, 0)[1]
    assert 'diagnose' in wrong_model(learner.settings, learner.state)


def test_a_push_back_is_learnt_by_the_same_factor_in_both_directions(paper_bundle):
    """Muscles that do not push back at all: never less than what they may push back more."""
    forces = exercise(60.0)
    learner = Learner(paper_bundle)
    low, high = bounds_of(learner.settings, 2)
    assert (1.0 + low) * (1.0 + high) == pytest.approx(1.0)
    found = learner.run(forces, np.maximum(forces, 0.0).sum(axis=1))
    assert found[2] == low > -0.6
    assert 'diagnose' in wrong_model(learner.settings, learner.state)


def test_what_was_learnt_is_said_in_plain_words(paper_bundle):
    """"MU1 pulls 7 % less than the model"."""
    learner = Learner(paper_bundle)
    words = (learner.settings, learner.state, ['MU1', 'MU2'])
    assert learnt_words(*words) == ['the model fits']
    learner.state.error[:] = [-0.07, 0.0, 0.3, 0.0, 0.012]
    assert learnt_words(*words) == [
        'MU1 pulls 7 % less than the model',
        'compressed muscles push back 30 % more than the model',
        'the force comes 12 ms after the pressures']
    off = adaptation_settings(AdaptationConfig(enabled=False), paper_bundle)
    assert learnt_words(off, *words[1:]) == ['adaptation is off']


def test_the_adapted_model_pulls_and_pushes_as_learnt(paper_bundle):
    """The model that is saved gives the forces that the controller reckons with."""
    state = adaptation_state(2)
    state.error[:] = [-0.07, 0.05, 0.3, 0.0, 0.0]
    adapted = adapted_bundle(paper_bundle, state)
    before, now = (b.unit_forces(0.1, [250e3, 250e3]) for b in (paper_bundle, adapted))
    assert now / before == pytest.approx([0.93, 1.05], abs=0.015)
    before, now = (b.unit_forces(0.2, [60e3, 60e3]) for b in (paper_bundle, adapted))
    assert np.all(before < 0.0)
    assert now / before == pytest.approx([1.3, 1.3], abs=0.1)


@pytest.mark.parametrize(('factor', 'learns'), [(1.0, False), (0.9, True)])
def test_a_controller_whose_model_is_right_learns_nothing_from_noise(
        paper_bundle, factor, learns):
    """The force of the model with the noise of a load cell, on the move; not 10 % less of it."""
    controller, noise = RecruitmentController(paper_bundle), np.random.default_rng(4)
    pressure = np.zeros(2)
    for k in range(500):
        force = factor * float(paper_bundle.force(0.12, pressure)) + 0.9 * noise.standard_normal()
        seen = Measurement(force, 0.12, 0.0, pressure)
        pressure = controller.update(DT, seen, Reference('force', 15.0 + 0.04 * k, 10.0)).pressure
    found = np.abs(controller.memory.adaptation.error)
    assert (found[0] > 0.02) == learns
    # The first samples, whose noise is not known yet, teach nothing either.
    assert (found[3] > 0.0) == learns


def test_adaptation_is_used_in_the_inverse_and_may_be_off(paper_bundle):
    """Weak muscles get more pressure for the same force; off, feed-forward stays as it was."""
    given = {}
    for enabled in (True, False):
        controller = RecruitmentController(paper_bundle, ControllerConfig(
            adaptation=AdaptationConfig(enabled=enabled)))
        controller.memory.adaptation.error[0] = -0.1
        for _ in range(3):
            command = controller.update(DT, Measurement(30.0, 0.1, 0.0, np.array([170e3, 0.0])),
                                        Reference('force', 30.0))
        given[enabled] = controller.memory.table.pull[0]
        assert command.pressure[0] > 0.0
    assert given[True] == pytest.approx(0.9, abs=0.02)
    assert given[False] == 1.0


def test_the_intervals_of_a_model_file_bound_what_is_learnt(paper_bundle):
    """A fitted model is believed more than one with numbers from a book."""
    book = adaptation_settings(AdaptationConfig(), paper_bundle).spread
    effect = paper_bundle.effect('resistive_buckling')
    value = effect.values['pressure_share']
    fitted = effect.replace()
    fitted.intervals = {'pressure_share': (0.95 * value, 1.05 * value)}
    known = adaptation_settings(AdaptationConfig(), paper_bundle.with_effect(fitted)).spread
    assert known[2] < 0.3 * book[2]
    assert known[2] >= 0.05


def test_bad_settings_fails():
    """An error or memory of 0 leaves nothing to weigh."""
    for name in ('memory', 'pull_error', 'rest_error'):
        with pytest.raises(InputError, match=name):
            AdaptationConfig(**{name: 0.0})


@pytest.mark.parametrize('forces', [[30.0, 12.0], [40.0, -6.0], [-3.0, -5.0], [0.0, 25.0]])
@pytest.mark.parametrize('weight', [1.0, 0.3])
def test_one_sample_is_weighed_as_bayes_weighs_it(paper_bundle, forces, weight):
    """The posterior of a linear model: tensions, push-back and bias, one sample per 2 T."""
    learner = Learner(paper_bundle, pull_error=0.1, push_error=0.4, offset_error=2.0,
                      rest_error=1.5, memory=0.8)
    settings, state = learner.settings, learner.state
    assert settings.spread == [0.1, 0.1, 0.4, 2.0, USUAL_LAG]
    assert state.rest == pytest.approx((0.3 * 1.5) ** 2)
    off = 0.4
    learner.run([forces], [sum(forces) + off], weight)
    regressor = np.array([*(max(force, 0.0) for force in forces),
                          sum(min(force, 0.0) for force in forces), 1.0, 0.0])
    rest = 0.45 ** 2 + (1.0 - np.exp(-DT / 0.8)) * (off ** 2 - 0.45 ** 2)
    assert state.rest == pytest.approx(rest)
    variance = 2.0 * rest * 0.8 / (weight * DT)
    known = np.diag(1.0 / np.array(settings.spread) ** 2)
    after = np.linalg.inv(known + np.outer(regressor, regressor) / variance)
    np.testing.assert_allclose(state.covariance, after, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.error, after @ regressor * off / variance, rtol=0.02,
                               atol=1e-9)
    assert lag_doubt(state) == pytest.approx(USUAL_LAG)


@pytest.mark.parametrize('forces', [[30.0, -5.0], [0.4, -0.3]])
def test_what_noise_takes_from_the_products_is_what_a_filter_makes_of_it(paper_bundle, forces):
    """White noise in a unit that pulls and in one that pushes, be it weakly, beside a lag."""
    learner, draw = Learner(paper_bundle), np.random.default_rng(6)
    state, share = learner.state, 1.0 - np.exp(-DT / 0.02)
    state.error[:] = [0.1, -0.05, 0.3, 0.0, 0.012]
    noise = np.array([0.5, 0.2])
    state.change[:] = (noise * np.sqrt(6.0 * 2.0 / np.pi)).tolist()
    state.slow[:] = forces
    noise_bias(state, share, 0.0)
    force = draw.normal(size=(200_000, 2)) * noise
    slow = lfilter([share], [1.0, share - 1.0], force, axis=0)
    slope = -(1.0 - share) / 0.02 * (force - np.vstack([[0.0, 0.0], slow[:-1]]))
    left = -(slow @ [1.1, 1.3]) - 0.012 * slope.sum(axis=1)
    expected = [np.mean(slow[:, 0] * left), 0.0, np.mean(slow[:, 1] * left), 0.0,
                np.mean(slope.sum(axis=1) * left)]
    np.testing.assert_allclose(-np.array(state.taken), expected, rtol=0.05, atol=1e-6)


def test_the_force_that_is_believed_is_late_by_the_lag_that_was_learnt(paper_bundle):
    """First order; before anything is known it is the model's at once."""
    state = Learner(paper_bundle).state
    assert lagged(state, 20.0, DT) == 20.0
    state.started, state.error[4] = True, 0.03
    assert lag_of(state) == 0.03
    for _ in range(10):
        found = lagged(state, 50.0, DT)
    assert found == pytest.approx(50.0 - 30.0 * np.exp(-10.0 * DT / 0.03))


def test_intervals_of_a_file_give_the_spread_of_the_force(paper_bundle):
    """They hold 95 %; two effects add by their squares, and 5 % is the least."""
    resistive = paper_bundle.effect('resistive_buckling')
    bladder = paper_bundle.effect('bladder_elasticity')

    def spread(**width):
        effects = []
        for effect in paper_bundle.effects:
            own = effect.replace()
            if effect.name in width:
                name = effect.parameters[0].name
                value, share = effect.values[name], width[effect.name]
                own.intervals = {name: (value * (1.0 - share), value * (1.0 + share))}
            effects.append(own)
        bundle = paper_bundle
        for effect in effects:
            bundle = bundle.with_effect(effect)
        return np.array(adaptation_settings(AdaptationConfig(), bundle).spread)
    assert spread()[:3].tolist() == [0.15, 0.15, 0.5]
    pressure = 0.2 * paper_bundle.max_pressure
    force = float(paper_bundle.force(0.16, pressure))
    sd = []
    for effect in (resistive, bladder):
        key, value = f'{effect.name}.{effect.parameters[0].name}', effect.values[
            effect.parameters[0].name]
        ends = [float(paper_bundle.with_parameters({key: share * value}).force(0.16, pressure))
                for share in (0.6, 1.4)]
        sd.append(abs(ends[1] - ends[0]) / 2.0 / 1.96 / abs(force))
    both = spread(resistive_buckling=0.4, bladder_elasticity=0.4)
    assert both[2] == pytest.approx(np.hypot(*sd), rel=1e-3)
    assert spread(resistive_buckling=1e-4)[2] == 0.05
