# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the model monitor knows of a model's error; without ROS."""

import json
import math

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model, Motion, save_model
from fam_bundle_ros.nodes.diagnosing import candidate_on, look_closer
from fam_bundle_ros.nodes.hidden_effect import HiddenEffect, with_written_effect
from fam_bundle_ros.nodes.live_model import LiveModel, ModelWatch
from fam_bundle_ros.plant import Rig
from fam_bundle_ros.resources import config_path

NOISE = 0.5


@pytest.fixture
def model():
    """Return the model of the paper."""
    return load_model(config_path('models/spie2021.yaml'))


@pytest.fixture
def rubbed(model):
    """Return it with friction."""
    return model.with_effect('coulomb_friction', force=4.0).named('rubbed')


def run(watch, truth, begin, end):
    """Let a watch see a rig that is made like a model, with noise, sample by sample."""
    time = np.arange(begin, end, 0.005)
    strain = 0.1 + 0.05 * np.sin(math.pi * time)
    rate = 0.05 * math.pi * np.cos(math.pi * time)
    pressure = np.stack([2e5 + 1e5 * np.sin(time), 1e5 + 9e4 * np.sin(0.7 * time)], -1)
    force = truth.predict(Motion(strain, pressure, rate, time, time == begin))
    force = force + np.random.default_rng(int(begin)).normal(0.0, NOISE, len(time))
    live = LiveModel(watch.bundle)
    for k, t in enumerate(time):
        said = live.step(0.005 if k else 0.0, strain[k], pressure[k].tolist(), rate[k])
        watch.add(t, strain[k], pressure[k].tolist(), force[k], force[k] - said)


@pytest.fixture
def failed(model, rubbed):
    """Return a watch on the model: of 20 s, the rig has friction in the last 10."""
    watch = ModelWatch(model)
    run(watch, model, 0.0, 10.0)
    run(watch, rubbed, 10.0, 20.0)
    return watch


def test_a_model_that_is_right_has_the_error_of_the_noise(model):
    """It holds, and what goes out is JSON."""
    watch = ModelWatch(model)
    assert watch.words.startswith('WAITING')
    assert json.loads(json.dumps(watch.state()))['error_N'] is None
    run(watch, model, 0.0, 10.0)
    assert watch.error == pytest.approx(NOISE, rel=0.05)
    assert watch.noise == pytest.approx(NOISE, rel=0.1)
    assert watch.words.startswith('the model holds')
    assert watch.state()['since_s'] is None


def test_the_error_is_that_of_the_window_or_since_the_model_changed(model, rubbed):
    """What is older than the window has left the number; another model begins anew."""
    watch = ModelWatch(model, window=5.0)
    run(watch, rubbed, 0.0, 5.0)
    assert watch.error > 4.0
    run(watch, model, 5.0, 12.0)
    assert watch.error == pytest.approx(NOISE, rel=0.05)
    run(watch, rubbed, 12.0, 14.0)
    watch.change(rubbed)
    assert math.isnan(watch.error)
    run(watch, rubbed, 14.0, 18.0)
    # the test knows the rate: nothing is left but noise
    assert watch.error == pytest.approx(NOISE, rel=0.05)


def test_friction_is_said_with_when_and_where(failed):
    """Since about ten seconds, everywhere, with the sign of the motion."""
    state = failed.state()
    assert not state['holds']
    assert state['since_s'] == pytest.approx(10.0, abs=1.5)
    failed.where, candidate = look_closer(failed, '', None)
    assert candidate is None
    assert 'with the sign of the motion' in failed.words


def test_a_better_model_is_a_candidate_and_the_memory_of_another_rig_is_forgotten(
        failed, model, rubbed, tmp_path):
    """It is held against the present one on the rows since the rig changed."""
    file = str(tmp_path / 'rubbed.yaml')
    save_model(rubbed, file)
    _, candidate = look_closer(failed, file, None)
    assert candidate.refusal == ''
    assert candidate.present > 5.0
    assert candidate.error < 0.2 * candidate.present
    failed.change(candidate.bundle)
    assert failed.holding.holds
    assert failed.memory.oldest == pytest.approx(10.0, abs=1.5)
    back = tmp_path / 'back.yaml'
    save_model(model, back)
    _, candidate = look_closer(failed, str(back), None)
    assert 'predicts the memory no better' in candidate.refusal


def test_a_candidate_that_does_not_fit_says_why(failed, model, tmp_path):
    """Other motor units, and a file that is not there."""
    data = failed.memory.measurement()
    other = tmp_path / 'one.yaml'
    save_model(Bundle('one', model.motor_units[:1], model.effects), other)
    assert 'expected 1' in candidate_on(data, model, str(other)).refusal
    assert 'no such file' in candidate_on(data, model, str(tmp_path / 'no.yaml')).refusal


def test_an_effect_is_hidden_in_a_rig_and_taken_out_while_it_runs(model):
    """The force changes by the friction, pressures and strain go on; out again as before."""
    rig = Rig(model, seed=1)
    hidden = HiddenEffect(rig, '')
    for _ in range(100):
        rig.step([1.0, 0.5], 0.005)
    rig.impose_strain(0.15, 0.05)
    rig.step([0.0, 0.0], 0.1)
    before = rig.truth
    hidden.take('coulomb_friction: {force: 4 N}')
    assert rig.truth.force == pytest.approx(before.force - 8.0)
    assert rig.truth.pressure == pytest.approx(before.pressure)
    assert rig.truth.strain == before.strain
    hidden.take('')
    assert rig.truth.force == pytest.approx(before.force)
    with pytest.raises(InputError, match='1 motor units of 127 mm; the rig has 2 of 127 mm'):
        rig.change_bundle(Bundle('one', model.motor_units[:1], model.effects))


@pytest.mark.parametrize(('text', 'reason'), [
    ('nothing', "effect 'nothing' is not known"),
    ('coulomb_friction: {force: 4 kg}', "unit 'kg' does not fit"),
    ('{', 'expected an effect as a model file writes it'),
    ('mesh', 'has mesh already')])
def test_a_hidden_effect_that_is_none_fails(model, text, reason):
    """The reason names the parameter and no line of a file that nobody sees."""
    with pytest.raises(InputError, match=reason) as told:
        with_written_effect(model, text)
    assert str(told.value).startswith('hidden_effect')
    assert 'line' not in str(told.value)
