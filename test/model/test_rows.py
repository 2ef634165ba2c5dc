# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Long records, law by law, and their derivatives by parameters."""

from dataclasses import replace
import tracemalloc

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, Geometry, Motion, MotorUnit, rowlaw, rows
from fam_bundle_ros.model.dual import Dual
from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import affine

from .conftest import effect_from

LAWS = [name for name, each in catalogue.available().items()
        if each.load is None and each.place.value != 'pneumatics']
DIMENSIONS = ['geometry.radius', 'geometry.length', 'geometry.braid_angle',
              'geometry.wall_thickness']
FORMULA = effect_from(
    'wave: {expression: "k * sin(20 * strain) * sqrt(abs(pressure) / p0) + c * radius * length", '
    'place: force, parameters: {k: 3 N, p0: 100 kPa, c: 7 kPa}}')


@pytest.fixture(params=['compiled', 'arrays'])
def way(request, monkeypatch):
    """Run laws compiled from the first row on, then on arrays."""
    if request.param == 'compiled' and kernels.numba() is None:
        pytest.skip('numba is not installed')
    monkeypatch.setattr(rowlaw, '_COMPILE_AFTER', 0 if request.param == 'compiled' else 10 ** 12)
    return request.param


@law('loss', family='own', summary='drag', source='own', signature='own', memory=('before',),
     share=Parameter(0.3, '1', 0.0, 1.0, 'share'))
def delayed_drag(force, start, before, share):
    """Take a share of the force of the sample before; its memory is no recurrence."""
    return -share * np.where(start, 0.0, before), force


@law('loss', family='own', summary='drag', source='own', signature='own', memory=('before',),
     share=Parameter(0.3, '1', 0.0, 1.0, 'share'))
def divided(strain, start, before, share):
    """Divide by a memory that is zero at first."""
    return np.where(start, 0.0, share / before), strain


@law('loss', family='own', summary='sum', source='own', signature='own',
     memory=('one', 'other'), share=Parameter(0.3, '1', 0.0, 1.0, 'share'))
def crossed(force, start, one, other, share):
    """Two memory fields, each made of the other."""
    after = np.where(start, force, 0.5 * other + 0.1 * force)
    return share * after, after, np.where(start, 0.0, 0.5 * one)


def units(count):
    """Return motor units of different size."""
    return [MotorUnit(f'mu{k + 1}', k + 1, Geometry(
        6.35e-3 * (1.0 + 0.1 * k), 0.127 * (1.0 - 0.005 * k), np.radians(33.0 - k), 1.59e-3))
        for k in range(count)]


def bundle_with(*effects, count=2):
    """Return motor units with mesh, bladder and these effects."""
    base = [catalogue.get(name)() for name in ('mesh', 'bladder_elasticity')
            if name not in {e.name for e in effects}]
    return Bundle('test', units(count), [*base, *effects])


def random_effect(name, rng):
    """Return an effect with random values well inside its bounds."""
    each = catalogue.get(name)
    values = {}
    for p in each.parameters:
        middle = p.default or p.lower + 0.3 * (p.upper - p.lower)
        values[p.name] = p.scale * np.clip(middle * rng.uniform(0.5, 1.5), p.lower, p.upper)
    return each(**values)


def record(rng, count=2, samples=60, timed=True):
    """Return a motion with reversals, uneven sampling and two trials."""
    time = np.cumsum(rng.uniform(0.002, 0.05, samples))
    strain = 0.12 + 0.1 * np.sin(3.0 * time + rng.uniform(0.0, 6.0)) + 0.002 * rng.normal(
        size=samples)
    pressure = 1e5 * rng.uniform(0.1, 1.0, count) * (
        2.0 + np.sin(np.outer(time, rng.uniform(1.0, 9.0, count))))
    start = np.isin(np.arange(samples), [0, samples // 2])
    motion = Motion(strain, pressure, np.gradient(strain, time), time, start)
    return motion if timed else replace(motion, time=None, start=None)


def keys_of(bundle):
    """Return all keys of a bundle; those of motor units that it does not have change nothing."""
    return [f'{e.name}.{p.name}' for e in bundle.effects
            for p in e.law.active(bundle.n)] + DIMENSIONS


def assert_is_the_slope(bundle, motion, key, slope):
    """Compare a column with central differences, but for rows with a kink inside the step."""
    owner, _, name = key.partition('.')
    value = (getattr(bundle.motor_units[0].geometry, name) if owner == 'geometry'
             else bundle.effect(owner).values[name])
    step = 1e-6 * (abs(value) or bundle.effect(owner).limits(name)[1])
    below, here, above = (bundle.with_parameters({key: value + k * step}).predict(motion)
                          for k in (-1, 0, 1))
    differences = (above - below) / (2.0 * step)
    rounding = 1e-13 * np.max(np.abs(here)) / step
    size = np.max(np.abs(slope))
    bent = np.abs(above - 2.0 * here + below) / step
    smooth = bent <= 1e-3 * np.maximum(np.abs(slope), 1e-3 * size) + 100.0 * rounding
    assert np.mean(smooth) > 0.9
    assert_allclose(slope[smooth], differences[smooth], rtol=1e-5,
                    atol=1e-6 * size + 100.0 * rounding, err_msg=key)


@pytest.mark.parametrize('name', [*LAWS, 'wave'])
@pytest.mark.parametrize('timed', [True, False])
@given(seed=st.integers(0, 1000), count=st.integers(1, 3))
@settings(max_examples=3, deadline=None)
def test_jacobian_is_the_slope_of_the_prediction(name, timed, seed, count):
    """Every parameter and dimension, through every law, timed and static."""
    rng = np.random.default_rng(seed)
    effect = FORMULA if name == 'wave' else random_effect(name, rng)
    bundle, motion = bundle_with(effect, count=count), record(rng, count, timed=timed)
    prediction, jacobian = bundle.jacobian(motion, keys_of(bundle))
    assert_allclose(prediction, bundle.predict(motion), rtol=1e-12)
    for key, slope in zip(keys_of(bundle), jacobian.T, strict=True):
        assert_is_the_slope(bundle, motion, key, slope)


def whole_catalogue(rng, count=2):
    """Return a bundle with every law at once."""
    return Bundle('all', units(count), [
        FORMULA, *(random_effect(name, rng) for name in LAWS)])


@pytest.mark.parametrize('timed', [True, False])
def test_jacobian_of_all_laws_at_once(way, timed, monkeypatch):
    """Slopes pass gauges, pressure, geometry, force, limit and loss, and what remembers them."""
    monkeypatch.setattr('fam_bundle_ros.model.bundle.differences', None)  # exact, no differences
    rng = np.random.default_rng(3)
    bundle = whole_catalogue(rng)
    motion = record(rng, samples=200, timed=timed)
    _, jacobian = bundle.jacobian(motion, keys_of(bundle))
    for key, slope in zip(keys_of(bundle), jacobian.T, strict=True):
        assert_is_the_slope(bundle, motion, key, slope)


def test_record_equals_the_bundle_sample_by_sample(way):
    """All laws over a record with two trials give what a control loop gets tick by tick."""
    rng = np.random.default_rng(4)
    bundle, motion = whole_catalogue(rng), record(rng, samples=100)
    log_starts = replace(motion, start=None)
    state, forces = bundle.start_state(), []
    for k in range(100):
        dt = motion.time[k] - motion.time[k - 1] if k else 7.0  # not used
        force, state = bundle.step(state, dt, motion.strain[k], motion.pressure[k],
                                   motion.strain_rate[k])
        forces.append(force)
    assert_allclose(bundle.simulate(log_starts), forces, rtol=1e-9)


def test_static_record_equals_the_forces_at_rest(way):
    """Without time a record is a map: the composition on arrays gives the same."""
    rng = np.random.default_rng(5)
    bundle, motion = whole_catalogue(rng), record(rng, timed=False)
    at_rest = bundle.unit_forces(motion.strain, motion.pressure, motion.strain_rate)
    assert_allclose(bundle.simulate(motion), at_rest, rtol=1e-9)


def test_prediction_from_readings_is_the_reading_of_the_force(way):
    """What all gauges show of strain and pressure gives what the load cell shows of the force."""
    rng = np.random.default_rng(22)
    bundle, true = whole_catalogue(rng), record(rng)
    force, strain, pressure = bundle.readings(bundle.simulate(true).sum(axis=1), true.strain,
                                              true.pressure, true.time - true.time[0],
                                              true.strain_rate)
    shown = replace(true, strain=strain, pressure=pressure)
    assert_allclose(bundle.predict(shown), force, rtol=1e-9)


def test_a_new_trial_is_a_new_record(way):
    """Memory and its slopes begin afresh with each trial, but for laws that go by the log."""
    rng = np.random.default_rng(6)
    bundle = Bundle('all', units(2), [
        random_effect(name, rng) for name in LAWS
        if not catalogue.get(name).across_trials and name != 'temperature'])
    motion = record(rng, samples=80)
    second = Motion(motion.strain[40:], motion.pressure[40:], motion.strain_rate[40:],
                    motion.time[40:])
    whole, part = (bundle.jacobian(each, keys_of(bundle)) for each in (motion, second))
    assert_allclose(whole[0][40:], part[0], rtol=1e-12)
    assert_allclose(whole[1][40:], part[1], rtol=1e-9, atol=1e-9 * np.abs(part[1]).max())


def test_blocks_do_not_show(way, monkeypatch):
    """Memory and its slopes are carried from block to block."""
    rng = np.random.default_rng(7)
    bundle, motion = whole_catalogue(rng), record(rng, samples=90)
    force, jacobian = bundle.jacobian(motion, keys_of(bundle))
    monkeypatch.setattr(rows, 'BLOCK', 7)
    cut_force, cut_jacobian = bundle.jacobian(motion, keys_of(bundle))
    assert_allclose(cut_force, force, rtol=1e-12)
    assert_allclose(cut_jacobian, jacobian, rtol=1e-9, atol=1e-12 * np.abs(jacobian).max())


@pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
def test_compiled_laws_and_arrays_agree(monkeypatch):
    """Values and slopes of all laws are the same compiled and not."""
    rng = np.random.default_rng(8)
    bundle, motion = whole_catalogue(rng), record(rng, samples=300)
    found = []
    for worth in (0, 10 ** 12):
        monkeypatch.setattr(rowlaw, '_COMPILE_AFTER', worth)
        found.append(bundle.jacobian(motion, keys_of(bundle)))
    assert_allclose(found[0][0], found[1][0], rtol=1e-12)
    size = np.abs(found[1][1]).max(axis=0)
    assert np.all(np.abs(found[0][1] - found[1][1]) <= 1e-9 * size)


def test_slopes_go_through_a_measured_table(way, tmp_path):
    """The slope of a table is that of its cell: a strain offset moves the force along it."""
    table = tmp_path / 'table.csv'
    table.write_text('strain,pressure [kPa],force [N]\n' + '\n'.join(
        f'{e},{p},{p * (1.0 - 3.0 * e) - 40.0 * e * e}' for e in (0.0, 0.1, 0.2, 0.3)
        for p in (0, 100, 200, 300)))
    bundle = Bundle('table', units(2), [
        catalogue.get('measured_surface')(table=str(table)),
        catalogue.get('end_caps')(dead_length=0.01),
        catalogue.get('pressure_sensor_bias')(bias=2e3)])
    motion = record(np.random.default_rng(9))
    keys = ['end_caps.dead_length', 'pressure_sensor_bias.bias', 'geometry.length']
    _, jacobian = bundle.jacobian(motion, keys)
    for key, slope in zip(keys, jacobian.T, strict=True):
        assert_is_the_slope(bundle, motion, key, slope)


def test_a_lag_of_zero_has_the_slope_of_a_short_one():
    """A fit that begins at a time constant of zero is told which way to go."""
    rng = np.random.default_rng(10)
    motion = record(rng)
    slopes = [bundle_with(catalogue.get('pressure_line_lag')(time_constant=tau)).jacobian(
        motion, ['pressure_line_lag.time_constant'])[1] for tau in (0.0, 1e-7)]
    assert np.abs(slopes[0]).max() > 0.0
    assert_allclose(slopes[0], slopes[1], rtol=1e-6)


def test_memory_that_is_no_recurrence_runs_sample_by_sample(way):
    """A user's law may use its memory in any way: values and slopes are right, only slower."""
    bundle, motion = bundle_with(delayed_drag()), record(np.random.default_rng(11))
    elastic = bundle_with().simulate(motion)
    expected = np.where(motion.start[:, None], 0.0, -0.3 * np.roll(elastic, 1, axis=0))
    assert_allclose(bundle.simulate(motion), elastic + expected, rtol=1e-12)
    keys = ['delayed_drag.share', 'bladder_elasticity.c10', 'geometry.radius']
    for key, slope in zip(keys, bundle.jacobian(motion, keys)[1].T, strict=True):
        assert_is_the_slope(bundle, motion, key, slope)


def test_division_by_zero_in_a_memory_is_no_error(way):
    """Plain numbers raise where arrays give infinity: the row is computed with arrays then."""
    motion = record(np.random.default_rng(21))
    base, force = bundle_with().simulate(motion), bundle_with(divided()).simulate(motion)
    expected = np.where(motion.start, 0.0, 0.3 / np.roll(motion.strain, 1))
    muscles = [unit.muscles for unit in units(2)]
    assert_allclose(force - base, np.outer(expected, muscles), rtol=1e-9, atol=1e-12)


def test_law_that_cannot_be_differentiated_has_differences(way):
    """A user's law with memory in a circle still has a Jacobian."""
    effect = crossed()
    bundle, motion = bundle_with(effect), record(np.random.default_rng(12))
    keys = [f'{effect.name}.{effect.law.parameters[0].name}', 'bladder_elasticity.c10',
            'geometry.radius']
    prediction, jacobian = bundle.jacobian(motion, keys)
    assert_allclose(prediction, bundle.predict(motion))
    for key, slope in zip(keys, jacobian.T, strict=True):
        assert_is_the_slope(bundle, motion, key, slope)


@pytest.mark.parametrize('key', ['mesh.radius', 'viscous_damping.coefficient', 'geometry.colour',
                                 'radius', ''])
def test_unknown_key_is_refused(key):
    """The message names the key and what is expected."""
    with pytest.raises(InputError, match=f"parameter '{key}'; expected"):
        bundle_with().jacobian(record(np.random.default_rng(13)), [key])


def test_no_keys_give_an_empty_jacobian():
    """Nothing to differentiate by: the prediction alone."""
    motion = record(np.random.default_rng(14))
    prediction, jacobian = bundle_with().jacobian(motion, [])
    assert jacobian.shape == (60, 0)
    assert_allclose(prediction, bundle_with().predict(motion))


def test_a_law_that_a_parameter_does_not_reach_is_not_differentiated():
    """What has no slope is computed as a plain value: a loss costs nothing in the mesh."""
    mesh = rowlaw.row_law(catalogue.get('mesh').function, ())
    numbers = np.full(3, 1e5), np.ones(3), 1.0, 1e-4, 2.4, 0.3
    assert not isinstance(mesh(*numbers), Dual)
    assert set(mesh(Dual(numbers[0], {5: 1.0}), *numbers[1:]).slopes) == {5}


def test_effects_cost_no_space_per_row():
    """The peak of memory is that of the record, however many effects there are."""
    rng = np.random.default_rng(15)
    time = 0.004 * np.arange(60_000)
    motion = Motion(0.1 + 0.1 * np.sin(time), np.full((len(time), 2), 2e5), 0.1 * np.cos(time),
                    time)
    peaks = []
    for bundle in (bundle_with(), whole_catalogue(rng)):
        bundle.predict(motion)
        tracemalloc.start()
        bundle.predict(motion)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the space of a block of every effect is less than one column of the record for each
    assert peaks[1] - peaks[0] < len(time) * 8 * len(LAWS) / 2


@pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
def test_what_is_prepared_is_what_runs(monkeypatch):
    """Laws that were compiled at installation are not compiled again for a record."""
    bundle = bundle_with(*(random_effect(name, np.random.default_rng(16)) for name in (
        'presliding_dahl', 'softening', 'motor_unit_mismatch', 'braid_elasticity')))
    monkeypatch.setattr(rowlaw, '_COMPILE_AFTER', 0)
    for made in (rowlaw.row_law, rowlaw._loop):
        made.cache_clear()  # other tests compile loops for inputs of other kinds
    loops, make = [], rowlaw._loop
    monkeypatch.setattr(rowlaw, '_loop', lambda *a: loops.append(make(*a)) or loops[-1])
    rowlaw.prepare(effect.law for effect in bundle.effects)
    prepared = {id(loop) for loop in loops}
    loops.clear()
    for timed in (True, False):
        motion = record(np.random.default_rng(17), timed=timed)
        bundle.jacobian(motion, ['geometry.radius'])
        bundle.predict(motion)
    assert {id(loop) for loop in loops} <= prepared
    assert all(len(loop.signatures) == 1 for loop in loops)


def test_a_large_map_is_computed_in_blocks():
    """Forces of many points at rest, on a grid of any shape, are those of each point."""
    bundle = whole_catalogue(np.random.default_rng(18))
    strain, rate = np.linspace(0.0, 0.3, 180)[:, None], np.linspace(-0.3, 0.2, 60)
    pressure = np.random.default_rng(19).uniform(0.0, 3e5, (1, 60, 2))
    forces = bundle.unit_forces(strain, pressure, rate)
    assert forces.shape == (180, 60, 2)
    assert forces.size > 2 * rows.BLOCK
    for i, j in ((0, 0), (37, 41), (179, 59)):
        assert_allclose(forces[i, j], bundle.unit_forces(strain[i, 0], pressure[0, j], rate[j]),
                        rtol=1e-12)


@pytest.mark.parametrize('timed', [True, False])
def test_an_effect_alone_has_a_record(timed):
    """Effects that have nothing to act on give zero for every row, not an error."""
    for name in LAWS:
        alone = Bundle('alone', units(2), [catalogue.get(name)()])
        motion = record(np.random.default_rng(20), timed=timed)
        prediction, jacobian = alone.jacobian(motion, ['geometry.radius'])
        assert prediction.shape == (60,)
        assert np.all(np.isfinite(jacobian))


def test_what_was_used_on_arrays_is_compiled_when_it_pays(monkeypatch):
    """A law that has computed many rows is compiled; the numbers stay the same."""
    if kernels.numba() is None:
        pytest.skip('numba is not installed')
    monkeypatch.setattr(rowlaw, '_COMPILE_AFTER', 100)
    calls = []
    compiled = rowlaw.RowLaw._compiled
    monkeypatch.setattr(rowlaw.RowLaw, '_compiled', lambda *a: calls.append(1) or compiled(*a))
    def smooth(strain, rate):
        return rate * affine(0.0, strain, 1.0)
    each = rowlaw.RowLaw(smooth, ())
    before = each(np.linspace(0.0, 1.0, 80), 2.0)
    assert not calls
    assert_allclose(each(np.linspace(0.0, 1.0, 80), 2.0), before, rtol=1e-14)
    assert calls
