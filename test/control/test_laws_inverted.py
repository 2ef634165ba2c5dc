# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Every effect that a diagnosis may add to a model can be inverted by the controller."""

import numpy as np
import pytest

from fam_bundle_ros.control import AdaptationConfig, ControllerConfig, RecruitmentController
from fam_bundle_ros.control.belief import delay_of, without_delays
from fam_bundle_ros.control.learnt import learnt_words
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
    assert without_delays(late).effects == paper_bundle.effects
    controller = RecruitmentController(late)
    words = learnt_words(controller.settings.adaptation, controller.memory.adaptation, ['A', 'B'])
    assert words == ['the force comes 150 ms after the pressures']
    task, _ = force_sine(late)
    fixed = ControllerConfig(adaptation=AdaptationConfig(enabled=False))
    informed, ignorant = (rms(ClosedLoop(late, model=model, controller=fixed).run(task).error)
                          for model in (late, paper_bundle))
    assert informed < 0.6 * ignorant


@pytest.mark.parametrize('kind', ['force', 'strain'])
def test_friction_over_a_strain_as_small_as_the_noise_is_compensated(paper_bundle, kind):
    """
    As `diagnose` finds it in muscles with elastic ends, in which it acts at constant strain too.

    The model with it tracks better than that without it, and uses no more air.
    """
    plant = paper_bundle.with_effect('series_compliance', compliance=6e-6).with_effect(
        'presliding_hysteresis', force=4.0, width=6e-4)
    if kind == 'force':
        task, _ = force_sine(plant, 0.12)
    else:
        task = Trajectory('strain', 'strain', 5.0, lambda t: 0.08 + 0.03 * np.sin(2.0 * t),
                          lambda t: 0.06 * np.cos(2.0 * t), MassSpring(mass=3.0, damping=40.0),
                          prepare=1.5)
    before, after = (ClosedLoop(plant, model=model).run(task) for model in (
        plant.without_effect('presliding_hysteresis'), plant))
    assert rms(after.error) < 0.8 * rms(before.error)
    assert np.ptp(after.air) < 1.05 * np.ptp(before.air)
