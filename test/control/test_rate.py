# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The strain rate that the controller's model is asked about, and friction in that model."""

import math

import numpy as np
import pytest

from fam_bundle_ros.control import ControllerConfig, OuterConfig
from fam_bundle_ros.control.rate import noise_of, quiet_rate, RateState
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

DT = 4e-3


@pytest.mark.parametrize('noise', [1e-4, 6e-3, 3e-2])
def test_noise_at_rest_is_no_motion(noise):
    """Whatever the size of the noise, a standing muscle counts as standing."""
    readings = np.random.default_rng(1).normal(0.0, noise, 2500)
    state = RateState()
    believed = np.array([quiet_rate(state, float(r), DT) for r in readings])
    assert np.mean(believed[125:] != 0.0) < 0.01
    assert abs(believed).max() < noise


def test_sign_changes_once_per_reversal():
    """A noisy swing through zero is seen to turn once per half period, and soon."""
    random = np.random.default_rng(2)
    time = DT * np.arange(2500)
    true = 0.1 * np.cos(0.8 * np.pi * time)
    state = RateState()
    believed = np.array([quiet_rate(state, float(r), DT)
                         for r in true + random.normal(0.0, 6e-3, time.size)])
    signs = np.sign(believed)[125:]
    turned = np.flatnonzero(np.diff(signs[signs != 0.0]))
    assert len(turned) == len(np.flatnonzero(np.diff(np.sign(true[125:]))))
    assert np.mean(signs != np.sign(true[125:])) < 0.1
    fast = abs(true) > 0.05
    assert np.sqrt(np.mean((believed - true)[fast] ** 2)) < 0.012


def test_a_rate_without_noise_passes():
    """Clean readings pass with no more than the lag of the filter."""
    state = RateState()
    believed = [quiet_rate(state, 0.05 * math.sin(DT * k), DT) for k in range(1000)]
    assert believed[-1] == pytest.approx(0.05 * math.sin(DT * 999 - 0.01), abs=1e-3)


def believed(true, noise, dt=DT, seed=5):
    """Return what is believed of true rates with noise, and the memory."""
    random, state = np.random.default_rng(seed), RateState()
    return np.array([quiet_rate(state, float(rate + random.normal(0.0, noise)), dt)
                     for rate in true]), state


def test_slow_motion_is_found_by_the_patient_filter():
    """A rate that is not much above the noise, too small for the quick filter, is believed."""
    seen, state = believed(np.full(2500, 8e-3), 6e-3)
    assert 2.0 * 2.5 * noise_of(state) > 8e-3
    assert np.all(seen[250:] > 0.0)


def test_motions_that_begin_and_end_are_not_learnt_as_noise():
    """A start or a stop each second leaves the noise that is found within a factor of 1.5."""
    true = np.where(np.arange(5000) // 250 % 2, 0.4, 0.0)
    _, state = believed(true, 6e-3)
    _, calm = believed(np.zeros(5000), 6e-3)
    assert noise_of(state) < 1.5 * noise_of(calm)


def test_the_end_of_a_motion_is_seen_soon():
    """0.1 s after a stop next to nothing of the motion is believed any more."""
    seen, _ = believed(np.where(np.arange(3000) < 2500, 0.2, 0.0), 6e-3)
    assert abs(seen[2525:]).max() < 0.02 * 0.2


def test_nothing_is_believed_before_the_noise_is_known():
    """The first reading says nothing, however large."""
    assert believed([0.5], 0.0)[0][0] == 0.0


def test_fast_sampling_leaves_the_rate_as_it_is():
    """At 10 kHz a motion is believed as at 250 Hz."""
    seen, state = believed(np.full(10000, 0.1), 6e-3, dt=1e-4)
    assert np.mean(seen[-3000:]) == pytest.approx(0.1, abs=2e-3)
    assert noise_of(state) > 0.0


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


@pytest.mark.parametrize('speed', [0.002, 0.004, 0.01])
def test_friction_in_the_model_is_no_worse_however_slow(paper_bundle, speed):
    """Creeping to and fro, where the measured rate is mostly noise: within 5 % of without."""
    plant = paper_bundle.with_effect('coulomb_friction', force=6.0)

    def imposed(t):
        return 0.1 + speed * float(np.interp(max(t, 0.0) % 6.0, [0.0, 1.5, 4.5, 6.0],
                                             [0.0, 1.5, -1.5, 0.0]))
    creep = Trajectory('creep', 'force', 7.0, lambda t: 40.0, lambda t: 0.0, Dynamometer(0.1),
                       imposed=imposed)
    errors = []
    for model in (paper_bundle, plant):
        log = ClosedLoop(plant, model=model, seed=2).run(creep)
        errors.append(np.sqrt(np.mean(log.error[log.time > 1.0] ** 2)))
    assert errors[1] < 1.05 * errors[0]
    # Of 6 N that change sign, feedback leaves no more than a third either way.
    assert max(errors) < 2.0
