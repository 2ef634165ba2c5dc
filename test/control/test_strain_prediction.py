# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Prediction of the strain, and a force reference on loads that the bundle can set in motion."""

import numpy as np
import pytest

from fam_bundle_ros.benchmarks.margins import CONTROLLERS, loop_of
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.control.rate import quiet_rate, RateState
from fam_bundle_ros.control.strain_prediction import PredictionState, strain_ahead
from fam_bundle_ros.plant import MassSpring
from fam_bundle_ros.simulation import Trajectory

DT, AHEAD = 4e-3, 0.02


def foreseen(strain, noise=2e-5, dt=DT, ahead=AHEAD, seed=3):
    """Return the predictions from some true strains that are read with noise."""
    random, rates, state, found = np.random.default_rng(seed), RateState(), PredictionState(), []
    for true in strain:
        reading = float(true + random.normal(0.0, noise))
        rate = quiet_rate(rates, reading, dt)
        found.append(strain_ahead(state, rates, reading, rate, ahead, dt))
    return np.array(found)


def missed(strain, found, dt=DT, ahead=AHEAD):
    """Return the rms error of predictions in the second half over the rms of the motion itself."""
    late = round(ahead / dt)
    wrong, motion = strain[late:] - found[:-late], strain - strain.mean()
    half = len(wrong) // 2
    return np.sqrt(np.mean(wrong[half:] ** 2) / np.mean(motion[half:] ** 2))


@pytest.mark.parametrize('dt', [1e-3, 4e-3, 10e-3])
def test_a_steady_motion_is_predicted_within_the_noise(dt):
    """At the sample times of 100 Hz to 1 kHz."""
    strain = 0.05 + 0.04 * np.arange(0.0, 2.0, dt)
    late = round(AHEAD / dt)
    wrong = (strain[late:] - foreseen(strain, dt=dt)[:-late])[len(strain) // 2:]
    assert np.abs(wrong).max() < 1.5e-4
    assert abs(wrong.mean()) < 2e-5


@pytest.mark.parametrize(('hertz', 'least'), [(0.5, 0.02), (1.0, 0.03), (2.0, 0.1)])
def test_a_slow_motion_is_predicted(hertz, least):
    """The muscles' force can be compensated for it."""
    strain = 0.09 + 0.03 * np.sin(2.0 * np.pi * hertz * np.arange(0.0, 4.0, DT))
    assert missed(strain, foreseen(strain)) < least


@pytest.mark.parametrize('turns', [0.35, 0.5, 0.7, 0.85, 1.0, 1.15])
def test_a_motion_that_turns_within_the_time_ahead_is_not_followed(turns):
    """At one turn the latest reading happens to be right; following it would drive the motion."""
    strain = 0.09 + 0.005 * np.sin(2.0 * np.pi * turns / AHEAD * np.arange(0.0, 4.0, DT / 4))
    found = foreseen(strain, dt=DT / 4)[2000:]
    assert np.std(found) < 0.25 * np.std(strain)


def test_a_motion_is_followed_from_its_first_moment_on():
    """Long windows, which rest prefers, are left at once."""
    time = np.arange(0.0, 2.0, DT)
    strain = 0.09 + 0.05 * np.maximum(time - 1.0, 0.0)
    wrong = foreseen(strain, noise=0.0)[:-5] - strain[5:]
    begun = time[:-5] > 1.0 + 2.5 * AHEAD
    assert np.abs(wrong[begun]).max() < 5e-4


def test_at_rest_the_prediction_has_less_noise_than_the_reading():
    """Rest shows no faster motion that could be followed."""
    strain = np.full(500, 0.09)
    assert np.std(foreseen(strain)[50:]) < 0.5 * 2e-5


def log_of(plant, units, trajectory):
    """Return the log of our controller; compilation for six units takes longer than a run."""
    loop = loop_of(plant, units, CONTROLLERS['reversal_aware'], BaselineConfig())
    loop.compiled = None if units == 2 else False
    return loop.run(trajectory)


@pytest.mark.parametrize(('plant', 'units', 'stiffness', 'force'), [
    ('delay_10', 6, 3e4, 200.0), ('delay_15', 2, 1e4, 60.0), ('delay_15', 2, 3e4, 80.0),
    ('delay_15', 6, 1e4, 100.0), ('delay_15', 6, 3e4, 200.0)])
def test_a_force_on_a_lightly_damped_spring_comes_to_rest(plant, units, stiffness, force):
    """One kilogram; these oscillated with 7 to 200 N while each motion was compensated for."""
    load = MassSpring(mass=1.0, stiffness_against=stiffness, damping=0.1 * stiffness ** 0.5)
    log = log_of(plant, units, Trajectory(
        'hold', 'force', 6.0, lambda t: force * min(0.3 + 0.35 * max(t, 0.0), 1.0),
        lambda t: 0.35 * force if 0.0 < t < 2.0 else 0.0, load, prepare=1.5))
    assert np.sqrt(np.mean(log.error[log.time > 4.0] ** 2)) < 0.5


@pytest.mark.parametrize(('plant', 'units', 'step'), [
    ('delay_10', 6, 50.0), ('delay_15', 2, 40.0)])
def test_the_oscillation_after_a_step_of_the_force_decays(plant, units, step):
    """One kilogram on 10 N/mm; followed as far as its start, it grew first (13 N, 2 N)."""
    low, load = 20.0 + 7.5 * (units - 2), MassSpring(1.0, stiffness_against=1e4, damping=10.0)
    log = log_of(plant, units, Trajectory(
        'step', 'force', 2.5, lambda t: low + (step if t > 1.0 else 0.0), lambda t: 0.0, load,
        prepare=1.5))
    assert np.sqrt(np.mean(log.error[log.time > 2.0] ** 2)) < 0.03 * step
