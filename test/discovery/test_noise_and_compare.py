# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Noise floor three ways, errors by group, and regions in words."""

from dataclasses import replace
import json

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import compare, diagnose, noise_floor, read_measurement
from fam_bundle_ros.discovery.predict import motion
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.resources import config_path


def test_noise_floor_is_the_noise_whatever_the_model_lacks(sweeps, paper_muscle):
    """White noise of 0.6 N reads 0.6 N, though the model lacks the rubber."""
    data = sweeps(noise=0.6)
    lacking = paper_muscle.without_effect('bladder_elasticity')
    floor = compare(lacking, data).noise
    assert floor.value == pytest.approx(0.6, rel=0.12)
    assert floor.repeats == pytest.approx(0.6, rel=0.15)


def test_slow_noise_shows_as_repeats_that_differ_more_than_neighbours(sweeps, paper_muscle):
    """AR noise of 0.8 fools neighbours, not repeats, and the note says so."""
    data = sweeps(noise=0.0)
    rng = np.random.default_rng(0)
    slow, state = np.empty(len(data)), 0.0
    for k, kick in enumerate(rng.standard_normal(len(data))):
        state = 0.8 * state + 0.6 * kick
        slow[k] = state
    floor = noise_floor(data, slow)
    assert floor.repeats == pytest.approx(1.0, rel=0.2)
    assert floor.differences < 0.6 * floor.repeats
    assert 'history' in floor.note


def test_noise_with_a_memory_is_not_called_an_error(paper_muscle):
    """Of 0.6 N with a memory of 5 rows neighbours show 0.22 N; the floor is that of the fit."""
    rows, share, rng = 4800, np.exp(-0.2), np.random.default_rng(3)
    isobar = np.arange(rows) // 800
    strain = 0.24 * np.abs(np.arange(rows) / 400.0 % 2.0 - 1.0)
    pressure = 80e3 * isobar[:, None]
    noise = lfilter([0.6 * np.sqrt(1.0 - share ** 2)], [1.0, -share], rng.normal(size=rows))
    data = build('slow', strain, pressure, paper_muscle.force(strain, pressure) + noise, isobar,
                 0.025 * np.arange(rows) + isobar)
    floor = compare(paper_muscle, data).noise
    assert floor.differences < 0.3
    assert floor.value == pytest.approx(0.6, rel=0.3)
    assert 'by means of neighbours (second differences 0.2' in str(floor)
    result = diagnose(paper_muscle, data, choices=Choices(most=1))
    assert result.summary == 'the model explains the data down to their noise'
    assert result.to_dict()['noise_floor_N'] == pytest.approx(floor.value, rel=0.05)


def test_a_load_cell_at_its_lower_limit_does_not_hide_the_noise(sweeps, paper_muscle):
    """Two thirds of a log read zero, as the muscle is slack: the noise of the rest counts."""
    data = sweeps(noise=0.6)
    clipped = replace(data, force=np.maximum(data.force - np.percentile(data.force, 67), 0.0))
    slack = paper_muscle.with_effect('tendon_slack')
    assert compare(paper_muscle, clipped).noise.value == pytest.approx(0.6, rel=0.2)
    assert compare(slack, clipped).noise.value == pytest.approx(0.6, rel=0.2)


def test_rows_that_no_fit_uses_do_not_count_as_error(sweeps, paper_muscle):
    """Spikes, and rows at turning points: told apart, while the others are down to the noise."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction', force=12.0), noise=0.3)
    force = data.force.copy()
    force[50::200] += 30.0
    result = diagnose(paper_muscle, replace(data, force=force), choices=Choices(most=1))
    assert result.error_N['best'] > 5.0 * result.noise.value
    assert 'explains the error down to the noise' in result.summary
    assert 'spikes' in ' '.join(result.notes)


def test_ripple_that_comes_back_is_not_noise(sweeps):
    """A fine ripple of the truth raises neighbours, and repeats decide."""
    data = sweeps(noise=0.2)
    ripple = 3.0 * np.sin(2 * np.pi * data.strain / 0.012)
    noise = 0.2 * np.random.default_rng(0).standard_normal(len(data))
    floor = noise_floor(data, ripple + noise)
    assert floor.basis == 'repeats'
    assert floor.value == pytest.approx(0.2, rel=0.25)


def test_friction_is_odd_and_rubber_is_even(sweeps, paper_muscle):
    """The split of the residual by direction tells friction from rubber."""
    rubber = compare(paper_muscle.without_effect('bladder_elasticity'), sweeps())
    friction = compare(paper_muscle, sweeps(paper_muscle.with_effect('coulomb_friction')))
    assert rubber.even_N > 20 * rubber.odd_N
    assert friction.odd_N == pytest.approx(4.0, rel=0.1)
    assert friction.odd_N > 10 * friction.even_N


@pytest.mark.parametrize(('slip', 'words'), [
    (lambda data: {'force': -data.force}, 'sign of the force'),
    (lambda data: {'force': data.force / 4.448}, 'in lbf, not in N'),
    (lambda data: {'force': data.force * 9.807}, 'in N, not in kgf'),
    (lambda data: {'pressure': data.pressure + 101325.0}, 'absolute, not gauge'),
    (lambda data: {'pressure': data.pressure / 6.895}, 'in psi, not in kPa'),
    (lambda data: {'pressure': data.pressure / 100.0}, 'in bar, not in kPa')])
def test_a_slip_of_unit_or_sign_is_named_before_any_physics(sweeps, paper_muscle, slip, words):
    """Data that pass every range but were meant otherwise: said so, though friction is hidden."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction'))
    assert compare(paper_muscle, data).slips == ()
    result = compare(paper_muscle, replace(data, **slip(data)))
    assert words in result.slips[0]
    assert words in str(result)


def test_a_diagnosis_tells_the_slip_too(sweeps, paper_muscle):
    """Pressures in bar under a heading of kPa stand in the notes of the answer."""
    data = sweeps()
    result = diagnose(paper_muscle, replace(data, pressure=data.pressure / 100.0),
                      choices=Choices(most=1))
    assert 'in bar, not in kPa' in ' '.join(result.to_dict()['notes'])


def test_loops_in_a_map_without_time_are_no_noise(sweeps, paper_muscle):
    """Friction in rows without time: not adequate, and the time is asked for; noise is noise."""
    def timeless(model):
        data = sweeps(model)
        return build('map', data.strain, data.pressure, data.force)
    result = diagnose(paper_muscle, timeless(paper_muscle.with_effect('coulomb_friction',
                                                                      force=8.0)))
    assert result.verdict == 'unexplained'
    assert 'cannot be judged without time' in result.summary
    assert 'time of each row' in result.next_experiment
    assert diagnose(paper_muscle, timeless(paper_muscle)).verdict == 'adequate'


def test_a_stop_is_located_in_words(sweeps, paper_muscle):
    """An error past one strain at every pressure is said so, with all of the error in it."""
    data = sweeps(extra=lambda e, p, way, t: -400 * np.maximum(e - 0.17, 0))
    region = compare(paper_muscle, data).located[0]
    assert 'strain above 0.1' in region.where
    assert 'every pressure' in region.where
    assert region.share > 0.95


def test_noise_alone_is_located_nowhere(sweeps, paper_muscle):
    """On data that the model explains no region stands out."""
    for seed in range(5):
        assert compare(paper_muscle, sweeps(seed=seed)).located == ()


def test_the_measured_map_gives_150_newtons_to_the_ideal_braid(repository):
    """DMSP-20 against the ideal braid with data-sheet geometry: 151 N rms, as known."""
    folder = repository / 'config' / 'data'
    result = compare(load_model(folder / 'dmsp20_static_map.model.yaml'),
                     read_measurement(folder / 'dmsp20_static_map.csv'))
    assert result.error_N == pytest.approx(151.3, abs=0.5)
    assert len(result.tables['pressure']) == 21
    assert {row['label'] for row in result.tables['region']} <= {'tensile', 'past free strain'}
    assert json.loads(result.to_json())['noise_floor_N'] < 5.0


def test_a_log_is_smoothed_in_strain_and_in_each_pressure():
    """With a quarter less noise or more; the model is told of both, and of a map as it is."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 20.0, 0.02)
    strain, pressure = 0.1 + 0.05 * np.sin(time), 2e5 + 5e4 * np.cos(time)
    data = build('log', strain + 1e-3 * rng.standard_normal(1000),
                 (pressure + 1e3 * rng.standard_normal(1000))[:, None], 1e-4 * pressure, None,
                 time)
    told = motion(data)
    assert np.std(told.strain - strain) < 0.75e-3
    assert np.std(told.pressure[:, 0] - pressure) < 0.75e3
    still = motion(replace(data, time=None))
    assert np.array_equal(still.strain, data.strain)
    assert np.array_equal(still.pressure, data.pressure)


def test_other_motor_units_than_the_models_fail(practice, paper_muscle):
    """A log of two motor units against a model of one is refused by name."""
    with pytest.raises(InputError, match='2 pressure columns; expected 1'):
        compare(paper_muscle, read_measurement(practice('p10')[0]))


def test_pressure_columns_go_to_the_units_that_they_name():
    """Exchanged columns change nothing; a column of no unit is an error."""
    model = load_model(config_path('data/examples/bundle_push_back.model.yaml'))
    first, second = model.motor_units
    model = Bundle('unequal', [first, replace(second, muscles=2)], model.effects)
    data = read_measurement(config_path('data/examples/bundle_push_back.csv'))
    swapped = replace(data, pressure=data.pressure[:, ::-1], motor_units=('mu2', 'mu1'))
    assert compare(model, swapped).error_N == compare(model, data).error_N
    with pytest.raises(InputError, match='column pressure.left; model unequal has the motor unit'):
        compare(model, replace(data, motor_units=('left', 'mu2')))


def test_a_second_log_of_a_bladder_that_softens_is_read_with_the_first(paper_muscle, sweeps):
    """Alone it is taken for the log of a new bladder; both together are one history."""
    muscle = paper_muscle.with_effect('softening_lifetime', depth=0.5, travel=0.5)
    whole = sweeps(muscle, noise=0.01)
    later = whole.select(whole.time > whole.time.mean())
    alone = compare(muscle, later)
    assert alone.error_N > 10.0 * compare(muscle, whole).error_N
    said = ('softening_lifetime begins at the first row: if the muscle was used or warm before, '
            'compare the earlier files together with this one')
    assert said in str(alone)
    assert said in alone.to_dict()['notes']
    assert 'first row' not in str(compare(paper_muscle, later))
    in_no_time = build('map', later.strain, later.pressure, later.force)
    assert 'first row' not in str(compare(muscle, in_no_time))
