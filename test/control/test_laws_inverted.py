# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Every effect that a diagnosis may add to a model can be inverted by the controller."""

import numpy as np
import pytest

from fam_bundle_ros.control import AdaptationConfig, ControllerConfig, RecruitmentController
from fam_bundle_ros.control.adaptation import lag_of
from fam_bundle_ros.control.belief import delay_of, invertible
from fam_bundle_ros.control.learnt import learnt_words
from fam_bundle_ros.control.signals import Measurement, Reference
from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.plant import Dynamometer, MassSpring
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

LAWS = [law.name for law in catalogue.built_in().values() if law.load is None
        and law.name not in ('mesh', 'bladder_elasticity')]


def force_sine(bundle, strain=0.05):
    """Return a slow sine within what the bundle can give, and its amplitude, N."""
    top = float(bundle.force(strain, bundle.max_pressure))
    size = 0.2 * top
    return Trajectory('sine', 'force', 4.0, lambda t: 0.45 * top - size * np.cos(2.0 * t),
                      lambda t: 2.0 * size * np.sin(2.0 * t), Dynamometer(strain),
                      prepare=1.0), size


@pytest.mark.parametrize('name', LAWS)
def test_a_force_is_followed_with_any_law_in_muscle_and_model(paper_bundle, name):
    """With its usual values: a sine over several seconds to a few percent of its amplitude."""
    bundle = paper_bundle.with_effect(name)
    task, size = force_sine(bundle)
    log = ClosedLoop(bundle).run(task)
    assert rms(log.error) < 0.03 * size


@pytest.mark.parametrize('name', ['pressure_line_lag', 'pressure_line_double'])
def test_a_delay_of_the_model_is_the_lag_with_which_the_loop_begins(paper_bundle, name):
    """It is no part of the inverse, which one sample could not move; adaptation starts from it."""
    late = paper_bundle.with_effect(name, time_constant=0.15)
    assert delay_of(late) == 0.15
    assert invertible(late).effects == paper_bundle.effects
    controller = RecruitmentController(late)
    words = learnt_words(controller.settings.adaptation, controller.memory.adaptation, ['A', 'B'])
    assert words == ['the force comes 150 ms after the pressures']
    for _ in range(100):
        controller.update(4e-3, Measurement(30.0, 0.05, 0.0, np.array([150e3, 0.0])),
                          Reference('force', 30.0))
    assert lag_of(controller.memory.adaptation) == pytest.approx(0.15, rel=0.05)
    task, _ = force_sine(late)
    fixed = ControllerConfig(adaptation=AdaptationConfig(enabled=False))
    informed, ignorant = (rms(ClosedLoop(late, model=model, controller=fixed).run(task).error)
                          for model in (late, paper_bundle))
    assert informed < 0.6 * ignorant


@pytest.mark.parametrize('name', ['pressure_hysteresis', 'pressure_dahl', 'pressure_friction'])
def test_a_hysteresis_of_the_pressure_is_not_inverted(paper_bundle, name):
    """Its inverse would cross it with each change of sign of the noise: air at rest."""
    plant = paper_bundle.with_effect(name)
    assert invertible(plant).effects == paper_bundle.effects
    hold = Trajectory('hold', 'force', 3.0, lambda t: 40.0, lambda t: 0.0, Dynamometer(0.12),
                      prepare=1.0)
    log = ClosedLoop(plant).run(hold)
    assert log.setpoint[log.time > 1.0].std(axis=0).max() < 1e3


@pytest.mark.parametrize(('force', 'compliance', 'inverted'), [
    (3.0, 6e-6, True), (8.0, 6e-6, False), (8.0, 1e-6, True), (50.0, 0.0, True)])
def test_friction_that_the_pressure_reverses_is_inverted_if_an_inverse_exists(
        paper_bundle, force, compliance, inverted):
    """If fittings yield, 8 N over 0.05 % change sign over fewer kPa than the muscle gains 16 N."""
    model = paper_bundle.with_effect('series_compliance', compliance=compliance).with_effect(
        'presliding_hysteresis', force=force, width=5e-4)
    names = [effect.name for effect in invertible(model).effects]
    assert ('presliding_hysteresis' in names) == inverted
    assert 'series_compliance' in names


def test_a_model_with_friction_that_the_pressure_reverses_uses_no_air_for_it(paper_bundle):
    """As `diagnose` made of a record of the plant `measured`, which used four times the air."""
    plant = paper_bundle.with_effect('series_compliance', compliance=6e-6)
    model = plant.with_effect('presliding_hysteresis', force=8.0, width=5e-4)
    task = Trajectory('ramp', 'force', 8.0, lambda t: 30.0 + 4.0 * max(t, 0.0),
                      lambda t: 4.0 * (t > 0.0), Dynamometer(0.12), prepare=1.0)
    with_it, without = (ClosedLoop(plant, model=each, seed=1).run(task) for each in (model, plant))
    assert np.ptp(with_it.air) < 1.1 * np.ptp(without.air)
    assert rms(with_it.error) < 1.1 * rms(without.error)


def up_and_down(t):
    """Return a force that rises and falls by 5 N/s for 6 s each, and its rate."""
    t = max(t, 0.0)
    return 30.0 + 5.0 * min(t, 12.0 - t), 5.0 if t < 6.0 else -5.0


def stairs(t):
    """Return a strain that moves and rests in turn, 0.6 s each, and its rate."""
    levels = [0.03, 0.07, 0.11, 0.09, 0.05, 0.05]
    k = min(int(max(t, 0.0) / 1.2), 4)
    x = min(max((t - 1.2 * k) / 0.6, 0.0), 1.0)
    step = levels[k + 1] - levels[k]
    return (levels[k] + step * x ** 3 * (10.0 - 15.0 * x + 6.0 * x * x),
            step * 30.0 * x * x * (1.0 - x) ** 2 / 0.6)


@pytest.mark.parametrize(('kind', 'motion', 'load', 'better', 'air'), [
    ('force', up_and_down, Dynamometer(0.12), 0.85, 1.0),
    ('strain', stairs, MassSpring(mass=3.0, damping=40.0), 0.95, 1.5)])
def test_friction_over_a_strain_as_small_as_the_noise_is_compensated(
        paper_bundle, kind, motion, load, better, air):
    """
    As `diagnose` finds it in muscles with elastic ends, in which it acts at constant strain too.

    A friction that followed the noise of the strain, or was part of the slopes along a reference
    of the strain, used up to 13 times the air.
    """
    plant = paper_bundle.with_effect('series_compliance', compliance=6e-6).with_effect(
        'presliding_hysteresis', force=3.0, width=5e-4)
    task = Trajectory(kind, kind, 12.0 if kind == 'force' else 6.0, lambda t: motion(t)[0],
                      lambda t: motion(t)[1], load, prepare=1.5)
    without, with_it = ([ClosedLoop(plant, model=model, seed=seed).run(task) for seed in (1, 2)]
                        for model in (plant.without_effect('presliding_hysteresis'), plant))
    assert rms(np.array([log.error for log in with_it])) < better * rms(
        np.array([log.error for log in without]))
    assert sum(np.ptp(log.air) for log in with_it) < air * sum(
        np.ptp(log.air) for log in without)


def test_a_force_after_a_strain_is_allocated_on_curves_with_friction(paper_bundle):
    """Friction that shifted the curves along the strain's reference is not left there."""
    model = paper_bundle.with_effect('presliding_hysteresis', force=4.0)
    controller = RecruitmentController(model)
    table = controller.memory.table
    for kind, value, rubs in (('strain', 0.1, False), ('force', 40.0, True)):
        for k in range(20):
            reading = Measurement(30.0, 0.08 + 1e-3 * k, 0.25, np.array([150e3, 0.0]))
            controller.update(4e-3, reading, Reference(kind, value))
        assert table.rubs == rubs
    assert table.friction == [0.0, 0.0]
