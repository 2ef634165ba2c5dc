# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of an error are what their words say, and are scored as least squares scores them."""

import re

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices, SMALL, VISIBLE
from fam_bundle_ros.discovery.templates import _families, _lagged, _signed, bank, describe
from fam_bundle_ros.model import Bundle, MotorUnit


@pytest.fixture(scope='module')
def two_speeds(make_sweeps, paper_muscle):
    """Return cells of sweeps at two speeds with noise, and columns of shapes by their words."""
    slow, fast = make_sweeps(speed=0.012), make_sweeps(speed=0.06, seed=1)
    data = build('both', np.append(slow.strain, fast.strain),
                 np.concatenate([slow.pressure, fast.pressure]), np.append(slow.force, fast.force),
                 np.append(slow.trial, fast.trial + 12),
                 np.append(slow.time, fast.time + slow.time[-1] + 9.0))
    cells = reduce(paper_muscle, data)
    return cells, shapes_of(cells, paper_muscle)


def shapes_of(cells, model):
    """Return the columns of each shape by its words."""
    return {shape.words: shape.columns for shape in bank(cells, model)}


def powers(cells):
    """Return what the words for a power of the pressure stand for."""
    p = cells.motion.pressure.mean(axis=1)
    return {'': 1.0, ' times pressure': p, ' times pressure squared': p ** 2}


NUMBER = r'(\d+\.\d+)'


@pytest.mark.parametrize(('pattern', 'formula', 'count'), [
    ('constant', lambda e: np.ones_like(e), 1),
    ('in proportion to strain', lambda e: e, 1),
    ('with the square of strain', lambda e: e * e, 1),
    ('with the cube of strain', lambda e: e * e * e, 1),
    (f'starts at strain {NUMBER} and grows', lambda e, x: np.where(e > x, e - x, 0.0), 25),
    (f'starts at strain {NUMBER} and grows with its square',
     lambda e, x: np.where(e > x, (e - x) ** 2, 0.0), 25),
    (f'only below strain {NUMBER}', lambda e, x: np.where(e < x, x - e, 0.0), 25),
    (f'a bump about strain {NUMBER}', lambda e, x: np.exp(-((e - x) / 0.024) ** 2), 25)])
def test_a_shape_over_the_strain_is_what_its_words_say(two_speeds, pattern, formula, count):
    """Alone, times the pressure and times its square; onsets lie within the strains."""
    cells, shapes = two_speeds
    strain = cells.motion.strain
    for words, power in powers(cells).items():
        found = [(re.fullmatch(pattern + words, name), column) for name, column in shapes.items()]
        found = [(list(map(float, match.groups())), column) for match, column in found if match]
        assert len(found) == count
        for values, column in found:
            expected = formula(strain, *values) * power
            # the words round the strain to three places
            assert_allclose(column[:, 0], expected, atol=0.03 * np.abs(expected).max())
            assert all(0.0 < value < 0.24 for value in values)
        places = sorted(values[0] for values, _ in found if values)
        assert_allclose(np.diff(places), 0.8 * 0.24 / 24.0, atol=1.1e-3)


def test_waves_in_strain_are_sine_and_cosine_of_the_period_that_is_told(two_speeds):
    """From two thirds of the range down, none shorter than three samples."""
    cells, shapes = two_speeds
    periods = []
    for name, columns in shapes.items():
        match = re.fullmatch(f'periodic in strain, every {NUMBER}', name)
        if match:
            periods.append(float(match[1]))
            assert_allclose(np.hypot(*columns.T), 1.0)
            turns = np.unwrap(np.arctan2(*columns[:40].T)) / (2.0 * np.pi)
            assert abs(turns[-1] - turns[0]) == pytest.approx(0.24 / periods[-1], rel=5e-3)
    assert_allclose(0.24 / np.array(periods), np.arange(1.5, 1.5 + 0.5 * len(periods), 0.5),
                    rtol=5e-3)
    steps = np.abs(np.diff(cells.motion.strain))[np.diff(cells.data.trial) == 0]
    assert 3.0 * np.median(steps) <= min(periods) < 3.3 * np.median(steps)


def test_shapes_of_pressure_and_force_are_what_their_words_say(two_speeds, paper_muscle):
    """Above a pressure, on one isobar, over a force, past the free strain."""
    cells, shapes = two_speeds
    p, force = cells.motion.pressure[:, 0], paper_muscle.predict(cells.motion)
    above = {float(m[1]): columns for name, columns in shapes.items()
             if (m := re.fullmatch(r'only above (\d+) kPa, constant', name))}
    assert list(above) == pytest.approx(np.linspace(0.0, 413.7, 9)[1:-1], abs=0.6)
    for kPa, columns in above.items():
        assert_allclose(columns[:, 0], np.where(p > 1e3 * kPa, p - 1e3 * kPa, 0.0), atol=600.0)
        more = shapes[f'only above {kPa:.0f} kPa, in proportion to strain']
        assert_allclose(more[:, 0], columns[:, 0] * cells.motion.strain)
    isobars = {float(m[1]): columns[:, 0] for name, columns in shapes.items()
               if (m := re.fullmatch(r'at (\d+) kPa and not at other pressures', name))}
    assert list(isobars) == pytest.approx(np.linspace(0.0, 413.7, 6), abs=0.6)
    for kPa, column in isobars.items():
        on = np.abs(p / 1e3 - kPa) < 1.0
        assert column[on] == pytest.approx(1.0, abs=1e-3)
        beside = np.abs(np.abs(p / 1e3 - kPa) - 82.74) < 1.0
        assert column[beside] == pytest.approx(np.exp(-4.0), rel=1e-2)
        assert column[~on & ~beside].max() < 1e-6
    for name, columns in shapes.items():
        if match := re.fullmatch(r'only above (\d+) N of force', name):
            assert_allclose(columns[:, 0], np.maximum(force - float(match[1]), 0.0), atol=0.6)
    assert_allclose(shapes['in proportion to the force'][:, 0], force)
    assert_allclose(shapes['with the square of the force'][:, 0], force ** 2)
    past = force < 0.0
    assert_allclose(shapes['past free strain, with the resistive force'][:, 0], force * past)
    assert_allclose(shapes['past free strain, constant'][:, 0], past)
    assert_allclose(shapes['past free strain, with pressure'][:, 0], past * p)


def test_shapes_of_the_motion_are_what_their_words_say(two_speeds, paper_muscle):
    """Friction is against the way, drag against the rate; how fast a pressure changes."""
    cells, shapes = two_speeds
    force, rate = paper_muscle.predict(cells.motion), cells.data.strain_rate
    p, e = cells.motion.pressure[:, 0], cells.motion.strain
    way = np.sign(cells.data.direction)
    for words, size in (('constant', 1.0), ('with pressure', p), ('with the force', abs(force)),
                        ('with strain', e), ('with strain and pressure', e * p)):
        assert_allclose(shapes[f'against the motion, {words}'][:, 0], -way * size)
    for words, size in (('with speed', 1.0), ('with speed squared', abs(rate)),
                        ('with speed and pressure', p)):
        assert_allclose(shapes[f'against the motion, {words}'][:, 0], -rate * size)
    assert_allclose(shapes['with speed, equal in both directions'][:, 0], abs(rate))


def test_the_formula_of_a_shape_makes_that_shape(two_speeds, paper_muscle):
    """What the workbench offers as an effect of one's own: once k, with the sign it has."""
    cells, _ = two_speeds
    names = {'strain': cells.motion.strain, 'pressure': cells.motion.pressure[:, 0],
             'strain_rate': cells.data.strain_rate, 'force': paper_muscle.predict(cells.motion),
             'k': 1.0, 'max': np.maximum, 'abs': np.abs, 'exp': np.exp, 'tanh': np.tanh}
    offered = [shape for shape in bank(cells, paper_muscle) if shape.expression]
    for shape in offered:
        constants = {name: value for name, value, _ in shape.constants}
        made = eval(shape.expression, {**names, **constants}) * np.ones(len(cells.motion.strain))
        column = shape.columns[:, 0]
        # numbers are rounded, and at a turn the sign of the rate is
        assert made @ column == pytest.approx(column @ column, rel=0.02), shape.words
        assert made @ made == pytest.approx(column @ column, rel=0.02), shape.words
    assert {'friction', 'friction_strain', 'speed', 'smooth0', 'smooth1', 'onset0', 'bump2',
            'above_pressure'} <= {shape.kind for shape in offered}


def test_shapes_of_time_grow_from_zero_to_one_over_the_log(two_speeds, paper_muscle):
    """Over the whole log, over each trial, and as a square; a decay follows what changes."""
    (cells, shapes), data = two_speeds, two_speeds[0].data
    force = paper_muscle.predict(cells.motion)
    t = (data.time - data.time[0]) / np.ptp(data.time)
    assert_allclose(shapes['grows with the time of the log'][:, 0], t)
    assert_allclose(shapes['grows with the time of the log, with the force'][:, 0], t * force)
    assert_allclose(shapes['grows with the square of the time of the log'][:, 0], t ** 2)
    own = np.concatenate([data.time[data.trial == k] - data.time[data.trial == k][0]
                          for k in range(24)])
    assert_allclose(shapes['grows with the time of each trial'][:, 0], own / own.max())
    for k, name in enumerate(data.trial_names):
        assert_allclose(shapes[f'trial {name} alone'][:, 0], data.trial == k)
    decays = [name for name in shapes if name.startswith('decays over')]
    assert len(decays) == 15
    seconds = [float(re.search(r'over (\S+) s after strain', name)[1])
               for name in decays if 'after strain' in name]
    usual = np.median(np.diff(data.time)[~data.start[1:]])
    assert seconds == pytest.approx(usual * np.array([4, 16, 64, 256, 1024]), rel=0.06)


@pytest.mark.parametrize('steps', [4, 64])
def test_what_lags_follows_a_step_with_its_time_constant(steps):
    """Backward Euler of a first-order lag; a constant stays one to the last bit."""
    signal = np.concatenate([np.full(10, 3.0), np.full(290, 5.0), np.full(40, 2.48e5 / 3.0)])
    passed = np.where(np.isin(np.arange(340), (0, 300)), np.inf, 0.2)
    found = _lagged(signal, passed, 0.2 * steps)
    assert (found[:10] == 3.0).all()
    assert (found[300:] == 2.48e5 / 3.0).all()
    left = (1.0 + 1.0 / steps) ** -np.arange(1.0, 291.0)
    assert_allclose(found[10:300], 5.0 - 2.0 * left)


def test_what_lags_has_settled_after_a_pause():
    """The row after it is a thousand time constants later, not the usual step."""
    signal = np.append(np.full(10, 3.0), np.full(5, 5.0))
    passed = np.where(np.arange(15) == 10, 1e4, 0.2)
    passed[0] = np.inf
    assert_allclose(_lagged(signal, passed, 10.0), signal, atol=3e-3)


def test_how_fast_a_pressure_changes_is_its_difference_over_the_time(paper_muscle):
    """In each trial from its second row on; the mean over the motor units."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.05, 0.15, 200))
    pressure = np.cumsum(rng.normal(size=(200, 2)), axis=0) * 1e3 + 2e5
    strain = 0.1 + 0.05 * np.sin(time)
    data = build('two', strain, pressure, bundle.force(strain, pressure),
                 np.repeat([0, 1], 100), time)
    cells = reduce(bundle, data)
    found = shapes_of(cells, bundle)['with the rate of the pressure'][:, 0]
    expected = np.diff(cells.motion.pressure.mean(1)) / np.diff(time)
    expected[99] = 0.0
    assert_allclose(found, np.append(0.0, expected))


def test_a_shape_within_the_noise_is_none(sweeps, paper_muscle):
    """However large its share of the little that is left; ten times the noise is one."""
    def found(extra):
        cells = reduce(paper_muscle, sweeps(extra=extra))
        search = Search(Options(paper_muscle, cells, Choices()))
        return cells, describe(cells, search.fitter.without_discrepancy(
            search.fit(search.options.own)))
    assert found(None)[1] == ()
    cells, shapes = found(lambda e, p, way, t: -6.0 * way)
    assert shapes
    assert min(shape.size_N for shape in shapes) >= VISIBLE * cells.noise


@pytest.mark.parametrize(('extra', 'words', 'coefficient'), [
    (lambda e, p, way, t: 40.0 * np.maximum(e - 0.1216, 0), 'starts at strain', 40.0),
    (lambda e, p, way, t: -3.0 * way, 'against the motion, constant', 3.0),
    (lambda e, p, way, t: -1e-5 * way * p, 'against the motion, with pressure', 1e-5),
    (lambda e, p, way, t: 3.0 * way, 'with the motion, constant', 3.0),
    (lambda e, p, way, t: 4.0 * (np.abs(p - 248e3) < 2e4), 'at 248 kPa', 4.0),
    (lambda e, p, way, t: 3.0 * np.sin(2.0 * np.pi * e / 0.06), 'periodic in strain, every 0.0600',
     3.0)])
def test_shapes_are_scored_as_least_squares_scores_them(sweeps, paper_muscle, extra, words,
                                                        coefficient):
    """The gain is the fall of chi2 beside the model's parameters, the share that of the error."""
    cells = reduce(paper_muscle, sweeps(extra=extra))
    search = Search(Options(paper_muscle, cells, Choices()))
    fitter, joint = search.fitter, search.fit(search.options.own)
    fit = fitter.without_discrepancy(joint)
    found = describe(cells, fit, most=4)
    assert found[0].words.startswith(words)
    assert abs(found[0].coefficient) == pytest.approx(coefficient, rel=0.3)
    assert found[0].explained > 0.5
    assert len(found) == len({shape.kind for shape in found}) == 4
    assert np.all(np.diff([shape.gain for shape in found]) <= 0.0)
    sd = np.sqrt(cells.variance + (SMALL * cells.largest_force) ** 2)
    own = np.vstack([fit.slopes / sd[:, None], np.eye(len(fit.u))])
    target = np.append(fit.residual / sd, -fit.u)
    shapes = bank(cells, fit.model)
    columns = {_signed(s.words, sign): s.columns for s in shapes for sign in (1.0, -1.0)}
    # a force with the motion is of no friction
    losses = {s.words: _families(s.kind) for s in shapes}
    assert all(shape.families == losses.get(shape.words, ()) for shape in found)
    _, before, *_ = np.linalg.lstsq(own, target)
    for shape in found:
        column = cells.mean(columns[shape.words])
        both = np.hstack([own, np.vstack([column / sd[:, None],
                                          np.zeros((len(fit.u), column.shape[1]))])])
        best, after, *_ = np.linalg.lstsq(both, target)
        weight = best[len(fit.u):]
        assert shape.gain == pytest.approx(before[0] - after[0], rel=1e-5)
        assert abs(shape.coefficient) == pytest.approx(np.linalg.norm(weight), rel=1e-5)
        left = fit.residual - fit.slopes @ best[:len(fit.u)] - column @ weight
        assert shape.explained == pytest.approx(
            1.0 - cells.mean_square(left) / cells.mean_square(fit.residual), rel=1e-5)
        absorbed = np.linalg.lstsq(own, both[:, len(fit.u):])[0]
        taken = (column - fit.slopes @ absorbed) @ weight
        assert shape.size_N == pytest.approx(np.sqrt(np.mean(taken ** 2)), rel=1e-5)


def test_friction_that_grows_with_strain_is_friction_too():
    """And what no law leaves has no family."""
    assert 'dry_friction' in _families('friction') == _families('friction_strain')
    assert _families('one_trial') == ()


@pytest.mark.parametrize(('words', 'turned'), [
    ('against the motion, with speed', 'with the motion, with speed'),
    ('lower while filling than while venting, constant',
     'higher while filling than while venting, constant'), ('constant', 'constant')])
def test_a_negative_coefficient_turns_the_words(words, turned):
    """A force with the motion is play or a delay, and no friction."""
    assert (_signed(words, 2.0), _signed(words, -2.0)) == (words, turned)
