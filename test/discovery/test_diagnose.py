# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis on the practice cases, the measured map, and data made by the catalogue itself."""

import json

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import (
    add_effect,
    compare,
    diagnose,
    ladder,
    orders,
    read_measurement,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import catalogue, dumps_model, load_model, loads_model

NAMES = [f'p{k:02d}' for k in range(1, 11)]


@pytest.fixture(scope='module')
def answers(repository):
    """Return what is hidden in each practice case."""
    path = repository / 'test' / 'data' / 'practice' / 'answers.json'
    return json.loads(path.read_text())


@pytest.mark.parametrize('name', NAMES)
def test_practice_case_comes_out_as_its_answer(practice, answers, name):
    """Verdict and effect of a rig that shares no code with us."""
    data, model = practice(name)
    result = diagnose(load_model(model), read_measurement(data))
    answer = answers[name]
    assert result.verdict in (answer['verdict'], *answer['verdict_also'])
    if answer['verdict'] == 'missing_effect':
        assert len(result.effects) == 1
        assert result.effects[0] in (*answer['hidden'], *answer['also_right'])
        assert result.error_N['best'] < 1.15 * answer['noise_rms_N']
    else:
        assert result.effects == ()
    saved = json.loads(result.to_json())
    assert set(saved) >= {'verdict', 'noise_floor_N', 'error_N', 'effects', 'ranking', 'tied',
                          'located', 'next_experiment'}
    assert set(saved['error_N']) == {'model', 'recalibrated', 'best'}
    assert saved['next_experiment']


def test_the_measured_map_falls_from_150_to_below_8_newtons(repository):
    """DMSP-20: 151 N, recalibrated 103 N, then named effects to below 8 N on left-out isobars."""
    folder = repository / 'config' / 'data'
    model = load_model(folder / 'dmsp20_static_map.model.yaml')
    data = read_measurement(folder / 'dmsp20_static_map.csv')
    result = diagnose(model, data)
    assert result.error_N['model'] == pytest.approx(151.3, abs=0.5)
    assert result.error_N['recalibrated'] == pytest.approx(103.2, abs=0.5)
    assert {'bladder_elasticity', 'tendon_slack'} <= set(result.effects)
    steps = result.ladder
    assert steps[-1]['held_out_N'] < 8.0
    errors = [step['error_N'] for step in steps]
    assert errors == sorted(errors, reverse=True)
    better = add_effect(model, result.shapes, data)
    again = ladder(data, [model, loads_model(dumps_model(better.model))])
    assert again.steps[-1]['held_out_N'] < 8.0


@pytest.mark.parametrize(('name', 'values'), [
    ('end_caps', {'dead_length': 12e-3}),
    ('threshold_pressure', {'pressure': 40e3}),
    ('braid_elasticity', {'compliance': 9e-8}),
    ('viscoelastic_relaxation', {'share': 0.12, 'time_constant': 4.0}),
    ('presliding_hysteresis', {'force': 5.0, 'width': 0.02}),
    ('resistive_buckling', {}),
    ('tendon_slack', {}),
    ('softening', {'depth': 0.3, 'travel': 0.5}),
    ('force_sensor_bias', {'bias': 3.0}),
])
def test_an_effect_is_found_again_in_data_that_it_made(sweeps, paper_muscle, name, values):
    """Hidden in sweeps of 0.6 N noise it comes first or ties, with its parameters."""
    data = sweeps(paper_muscle.with_effect(name, **values))
    result = diagnose(paper_muscle, data)
    assert len(result.effects) == 1
    told = {result.effects[0], *(n for group in result.tied for n in group)}
    assert name in told
    assert result.error_N['best'] < 0.66
    if result.effects[0] == name == result.shapes[0]:
        for estimate in result.parameters:
            key = estimate.key.partition('.')[2]
            if estimate.key.startswith(name) and key in values and not estimate.flag:
                assert estimate.si == pytest.approx(values[key], rel=0.15)


def test_two_effects_are_both_found_and_nothing_else(sweeps, paper_muscle):
    """Friction and end caps in one log: both, whatever the order of adding."""
    truth = paper_muscle.with_effect('coulomb_friction', force=3.0).with_effect(
        'end_caps', dead_length=12e-3)
    data = sweeps(truth)
    result = diagnose(paper_muscle, data)
    assert set(result.effects) == {'coulomb_friction', 'end_caps'}
    paths = orders(paper_muscle, result.shapes, data)
    assert len(paths) == 2
    assert len({round(path[-1], 6) for path in paths.values()}) == 1


def test_noise_and_outliers_alone_name_nothing(sweeps, paper_muscle):
    """Without a missing effect the verdict is adequate, with 3 % outliers too."""
    rng = np.random.default_rng(0)
    for seed in range(4):
        data = sweeps(seed=seed)
        assert diagnose(paper_muscle, data).verdict == 'adequate'
        bad = rng.uniform(size=len(data)) < 0.03
        spiked = build('spiked', data.strain, data.pressure, data.force + bad * 8.0, data.trial,
                       data.time)
        result = diagnose(paper_muscle, spiked)
        assert result.verdict == 'adequate'
        assert result.rows_left_out >= 0.7 * bad.sum()


def test_one_isobar_that_is_off_at_every_visit_is_no_noise(sweeps, paper_muscle):
    """3 N at one isobar, the same each time: said where; slow noise as large stays adequate."""
    data = sweeps(extra=lambda e, p, way, t: 3.0 * (np.abs(p - 165e3) < 5e3))
    result = diagnose(paper_muscle, data)
    assert result.verdict == 'unexplained'
    assert 'at 165 kPa' in result.summary
    assert 'at 165 kPa' in result.located[0].where
    timeless = build('map', data.strain, data.pressure, data.force, data.trial // 6)
    assert 'at 165 kPa' in diagnose(paper_muscle, timeless).summary
    rng = np.random.default_rng(3)
    slow = np.zeros(len(data))
    for k in range(1, len(data)):
        slow[k] = 0.95 * slow[k - 1] + rng.standard_normal()
    clean = sweeps()
    noisy = build('slow', clean.strain, clean.pressure, clean.force + slow, clean.trial,
                  clean.time)
    assert diagnose(paper_muscle, noisy).verdict == 'adequate'


def test_an_offset_of_each_trial_is_neither_noise_nor_an_effect(sweeps, paper_muscle):
    """Repeats tared differently: said so, noise within trials, and end caps are found."""
    def repeats(model, trials):
        once = sweeps(model, cycles=1, noise=0.0)
        count = len(once)
        rng = np.random.default_rng(7)
        force = np.tile(once.force, 3) + np.repeat([0.0, 2.0, -2.0], count)
        return build('map', np.tile(once.strain, 3), np.tile(once.pressure[:, 0], 3),
                     force + 0.6 * rng.standard_normal(3 * count),
                     np.repeat([0, 1, 2], count) if trials else None)
    for trials in (True, False):
        result = diagnose(paper_muscle, repeats(paper_muscle, trials))
        assert result.verdict == 'unexplained'
        assert 'its own offset, 2 N rms: tare' in result.summary
        assert 'tare' in result.next_experiment
        assert result.noise.value == pytest.approx(0.6, rel=0.1)
        assert compare(paper_muscle, result.measurement).noise.value == result.noise.value
    hidden = diagnose(paper_muscle, repeats(paper_muscle.with_effect(
        'end_caps', dead_length=12e-3), True))
    assert hidden.verdict == 'partial'
    assert hidden.effects == ('end_caps',)
    assert 'down to the noise' not in hidden.summary


def test_sweeps_each_with_its_own_tare_name_no_effect(sweeps, paper_muscle):
    """It is no bias of the load cell, and the end that is reached is not called noise."""
    rng = np.random.default_rng(5)
    data = sweeps()
    tare = 1.5 * rng.standard_normal(len(data.trial_names))
    data = build('tare', data.strain, data.pressure, data.force + tare[data.trial], data.trial,
                 data.time)
    result = diagnose(paper_muscle, data)
    assert (result.verdict, result.effects) == ('unexplained', ())
    assert 'its own offset' in ' '.join((result.summary, *result.notes))


def test_another_shape_of_the_wall_is_no_end_cap(sweeps, paper_muscle):
    """A wall that is a spring besides: end caps fit, but a polynomial wall does so with less."""
    data = sweeps(extra=lambda e, p, way, t: -80 * e)
    result = diagnose(paper_muscle, data)
    assert result.verdict == 'unexplained'
    assert result.effects == ()
    assert "bladder_polynomial beside the model's bladder_elasticity" in result.summary
    assert 'write bladder_polynomial' in result.next_experiment
    better = add_effect(paper_muscle, 'bladder_polynomial', data)
    assert better.error_N < 0.62
    caps = diagnose(paper_muscle, sweeps(paper_muscle.with_effect('end_caps', dead_length=12e-3)))
    assert (caps.verdict, caps.effects, caps.tied) == ('missing_effect', ('end_caps',), ())


def test_what_no_effect_explains_is_described_and_can_be_added(sweeps, paper_muscle):
    """A stop at strain 0.17 is unexplained; its shape in words makes a model that fits."""
    data = sweeps(extra=lambda e, p, way, t: -400 * np.maximum(e - 0.17, 0))
    result = diagnose(paper_muscle, data)
    assert result.verdict == 'unexplained'
    assert result.effects == ()
    assert 'candidates' not in str(result)  # the nearest ones are shown, as no answer
    shape = result.shapes_left[0]
    assert 'starts at strain 0.1' in shape.words
    assert shape.coefficient == pytest.approx(-400, rel=0.1)
    stopped = paper_muscle.with_effect(shape.effect('stop'))
    better = diagnose(loads_model(dumps_model(stopped)), data)
    assert better.error_N['recalibrated'] < 0.75


def test_a_force_that_hardly_changes_accuses_no_load_cell(sweeps, paper_muscle):
    """Under a hanging weight a constant would pass for the whole model: said, not named."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction', force=1.0))
    near = np.abs(data.force - 60.0) < 6.0
    weight = build('weight', data.strain[near], data.pressure[near], data.force[near])
    result = diagnose(paper_muscle, weight)
    assert 'force_sensor_bias' not in {entry.effect for entry in result.ranking}
    assert 'the force hardly changes' in ' '.join(result.notes)


def test_effects_that_the_data_cannot_tell_apart_are_tied(sweeps, paper_muscle):
    """At one sweep speed dry and viscous friction tie, and another speed is proposed."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction', force=3.0))
    result = diagnose(paper_muscle, data)
    group = next(g for g in result.tied if 'coulomb_friction' in g)
    assert 'viscous_damping' in group
    assert 'ten times' in result.next_experiment


def test_candidates_are_held_against_the_same_rows_as_the_headline(sweeps, paper_muscle):
    """Rows are averaged for the search only; without a missing effect nothing is probable."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction', force=3.0), cycles=8)
    result = diagnose(paper_muscle, data)
    assert len(data) > 3000
    assert min(entry.error_N for entry in result.ranking) > 0.98 * result.error_N['best']
    clean = diagnose(paper_muscle, sweeps())
    assert clean.shortlist == ()
    assert clean.ranking


def test_no_other_speed_is_asked_for_where_speed_tells_nothing(sweeps, paper_muscle):
    """Offset of the strain sensor against bias of the gauge: neither knows of speed."""
    data = sweeps(paper_muscle.with_effect('strain_sensor_offset', offset=0.004))
    result = diagnose(paper_muscle, data)
    assert result.verdict == 'missing_effect'
    assert 'strain_sensor_offset' in result.next_experiment
    assert 'ten times' not in result.next_experiment


def test_a_force_that_follows_no_model_is_said_to(sweeps, paper_muscle):
    """White noise for a force is no matter of calibration; data without noise lack nothing."""
    data = sweeps()
    noise = 50.0 * np.random.default_rng(0).standard_normal(len(data))
    junk = build('junk', data.strain, data.pressure, noise, data.trial, data.time)
    result = diagnose(paper_muscle, junk)
    assert result.verdict == 'unexplained'
    assert 'does not follow the model at all' in result.summary
    assert 'columns' in result.next_experiment
    fine = sweeps(noise=0.0)
    ripple = 2e-3 * np.sin(2 * np.pi * fine.strain / 0.05)
    clean = build('clean', fine.strain, fine.pressure, fine.force + ripple, fine.trial, fine.time)
    assert diagnose(paper_muscle, clean).verdict == 'adequate'


def test_adding_an_effect_by_its_head_gives_the_shape_that_was_diagnosed(sweeps, paper_muscle):
    """Damping with the square of the speed: `add viscous_damping` leaves what diagnose showed."""
    data = sweeps()
    rate = np.where(data.trial % 2, 3.0, 1.0) * 0.024 * np.sign(data.direction)
    fast = build('fast', data.strain, data.pressure,
                 data.force - 9000.0 * rate * np.abs(rate), data.trial,
                 data.time / np.where(data.trial % 2, 3.0, 1.0) + 1e3 * data.trial)
    result = diagnose(paper_muscle, fast)
    assert result.effects == ('viscous_damping',)
    assert result.shapes == ('viscous_power',)
    assert 'viscous_damping as viscous_power' in str(result)
    added = add_effect(paper_muscle, 'viscous_damping', fast)
    assert added.effects == ('viscous_power',)
    assert added.error_N == pytest.approx(result.error_N['best'], rel=0.01)
    assert 'the shape of viscous_damping that fits best' in str(added)
    literal = add_effect(paper_muscle, catalogue.get('viscous_damping')(), fast)
    assert literal.effects == ('viscous_damping',)


def test_adding_fails_on_an_effect_that_is_there_or_unknown(sweeps, paper_muscle):
    """An effect twice, or a misspelt one, is refused in one line."""
    data = sweeps()
    with pytest.raises(InputError, match='has bladder_elasticity already'):
        add_effect(paper_muscle, 'bladder_elasticity', data)
    with pytest.raises(InputError, match='did you mean'):
        add_effect(paper_muscle, 'coulomb_fricton', data)


def test_friction_is_named_in_a_log_of_any_length(paper_muscle):
    """A search over a part of a long log finds what one over all of a short log does."""
    for count in (20_000, 200_000):
        rng = np.random.default_rng(0)
        t = np.arange(count) * 0.002
        strain = 0.1 + 0.05 * np.sin(2 * np.pi * 0.2 * t)
        pressure = 2e5 + 1.5e5 * np.sign(np.sin(2 * np.pi * 0.031 * t))
        force = paper_muscle.force(strain, pressure[:, None]) - 3.0 * np.sign(
            np.cos(2 * np.pi * 0.2 * t)) + 0.6 * rng.standard_normal(count)
        data = build('long', strain + 1e-4 * rng.standard_normal(count), pressure, force, None, t)
        result = diagnose(paper_muscle, data)
        assert 'coulomb_friction' in {*result.effects, *(n for g in result.tied for n in g)}
