# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Cells, priors, covariance and evidence against what they are by definition."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

from fam_bundle_ros.data.measurement import build, Taken
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery.cells import reduce, unknown_direction
from fam_bundle_ros.discovery.covariance import Covariance, Hyper, matern_5_2
from fam_bundle_ros.discovery.evidence import Fitter, Linear
from fam_bundle_ros.discovery.options import head, Options, shapes_of
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.priors import effect_priors, own_priors, Prior
from fam_bundle_ros.discovery.search import _ranked, Screened, Search
from fam_bundle_ros.discovery.settings import (
    AMPLITUDES,
    Choices,
    PRESSURE_LENGTHS,
    STRAIN_LENGTHS,
    TIME_LENGTHS,
)
from fam_bundle_ros.model import Bundle, catalogue, load_model, MotorUnit

FULL = Hyper(even=9, strain=1, pressure=1, odd=8, white=6, slow=7, tau=1)




@pytest.fixture
def problem(sweeps, paper_muscle):
    """Return cells of sweeps with friction, a covariance over them, and a fitter."""
    cells = reduce(paper_muscle, sweeps(paper_muscle.with_effect('coulomb_friction')), most=120)
    covariance = Covariance(cells, 0.01)
    return cells, covariance, Fitter(cells, covariance)


# --- cells -------------------------------------------------------------------------------------

def test_every_row_is_in_one_cell_and_cells_are_means_of_their_rows(problem):
    """Counts sum to the rows, and each cell's force is the mean of its rows."""
    cells, _, _ = problem
    kept = cells.label >= 0
    assert cells.count.sum() == kept.sum()
    k = int(np.argmax(cells.count))
    rows = cells.label == k
    assert cells.force[k] == pytest.approx(cells.data.force[rows].mean())
    assert len(np.unique(cells.data.trial[rows])) == 1
    assert len(np.unique(cells.data.direction[rows])) == 1


def test_a_small_map_is_taken_row_by_row(paper_muscle):
    """With fewer rows than cells nothing is averaged, and nothing is left out."""
    strain = np.tile(np.linspace(0, 0.2, 8), 6)
    pressure = np.repeat(np.linspace(0, 400e3, 6), 8)
    force = paper_muscle.force(strain, pressure[:, None])
    cells = reduce(paper_muscle, build('map', strain, pressure, force))
    assert len(cells) == 48
    np.testing.assert_allclose(cells.force, force)
    assert cells.time is None
    assert not cells.both_ways


@pytest.mark.parametrize('gauge', [
    lambda held: held, lambda held: 5e-4 * np.round(held / 5e-4)], ids=['noise', 'steps'])
def test_no_row_is_lost_to_the_noise_of_a_gauge_that_stands_still(gauge, paper_muscle):
    """Held at one strain, 200 s of filling and venting: stays follow the pressure alone."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 200.0, 0.1)
    strain = gauge(0.1 + 2e-4 * rng.standard_normal(len(time)))
    pressure = 2e5 - 1.5e5 * np.cos(2.0 * np.pi * time / 40.0) + 500.0 * rng.standard_normal(
        len(time))
    data = build('log', strain, pressure[:, None], 1e-4 * pressure, None, time)
    cells = reduce(paper_muscle, data, most=150)
    np.testing.assert_array_equal(cells.label < 0, unknown_direction(data))
    assert np.median(cells.count) > 10
    widths = [np.ptp(data.pressure[cells.label == k]) for k in range(len(cells))]
    assert max(widths) < 0.1 * 3e5


def test_a_stay_ends_where_a_unit_of_a_bundle_moves_on():
    """One unit is held, the other goes up in ten levels: no stay has rows of two levels."""
    rng = np.random.default_rng(0)
    muscle = load_model('spie2021')
    level = np.repeat(np.arange(10), 50)
    pressure = np.column_stack([np.full(500, 3.4e5), 3e4 * level]) + 300.0 * rng.standard_normal(
        (500, 2))
    data = build('log', np.full(500, 0.1), pressure, 10.0 + 5.0 * level, None,
                 0.1 * np.arange(500.0))
    cells = reduce(muscle, data, most=100)
    assert (cells.label[1:] >= 0).all()
    assert all(len(np.unique(level[cells.label == k])) == 1 for k in range(len(cells)))
    assert len(cells) <= 30  # each level is reached and held


@pytest.mark.parametrize('hyper', [FULL, Hyper(white=6)])
def test_cells_of_no_bounded_noise_tell_no_more_than_cells_that_are_not_there(problem, hyper):
    """The evidence of one residual over another is that of the other cells alone."""
    cells, covariance, _ = problem
    gone = np.arange(len(cells)) % 3 == 0
    fitter = Fitter(cells, covariance.without(gone))
    rng = np.random.default_rng(2)
    one, other = rng.standard_normal((2, len(cells)))
    slopes, u = rng.standard_normal((len(cells), 2)), np.array([0.3, -0.5])
    priors = [Prior(f'a.{k}', -1e3, 1e3, 0.0, 1.0, 'normal') for k in 'xy']
    told = [fitter.log_evidence(hyper, Linear.of(priors, u, each, slopes))
            for each in (one, other)]
    covered = covariance.matrix(hyper)[np.ix_(~gone, ~gone)] + slopes[~gone] @ slopes[~gone].T
    true = [multivariate_normal(cov=covered).logpdf((each + slopes @ u)[~gone])
            for each in (one, other)]
    assert told[0] - told[1] == pytest.approx(true[0] - true[1], abs=1e-6)
    assert len(covariance._factors) == 0  # what all cells tell is another covariance


def test_the_row_with_which_a_trial_begins_is_in_no_cell(sweeps, paper_muscle):
    """How the muscle came there is in no row; a trial of one row has nothing else and stays."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction'))
    assert (reduce(paper_muscle, data).label[data.start] == -1).all()
    one = unknown_direction(data.select(np.r_[True, np.zeros(len(data) - 1, bool)]))
    assert one.tolist() == [False]
    assert unknown_direction(data).sum() == len(data.trial_names)


def test_rows_at_a_turning_point_are_in_no_cell_but_a_hold_is(paper_muscle):
    """Where the rate of a slow swing is within its noise; a rest of 2 s at the top is a rest."""
    time = np.arange(0.0, 12.0, 0.01)
    phase = np.interp(time, [0, 6, 8, 12], [0, 6.75, 6.75, 11.25])
    strain = 0.1 + 0.1 * np.sin(2.0 * np.pi * phase / 3.0)
    strain = strain + 5e-5 * np.random.default_rng(0).standard_normal(len(time))
    data = build('log', strain, np.full((len(time), 1), 2e5), 50.0 - 100.0 * strain, None, time)
    out = time[unknown_direction(data)][1:]
    turns = np.interp([0.75, 2.25, 3.75, 5.25, 8.25, 9.75], phase, time)
    near = np.abs(out[:, None] - turns)
    assert near.min(axis=1).max() < 0.1
    assert near.min(axis=0).max() < 0.1
    assert reduce(paper_muscle, data).label[(time > 6.2) & (time < 7.8)].min() >= 0


def test_averaging_takes_vectors_and_columns_alike(problem):
    """A matrix of columns is averaged column by column."""
    cells, _, _ = problem
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((len(cells.data), 3))
    together = cells.mean(columns)
    for k in range(3):
        np.testing.assert_allclose(together[:, k], cells.mean(columns[:, k]))


# --- priors ------------------------------------------------------------------------------------

@given(u=st.floats(-3, 3), kind=st.sampled_from(['log', 'normal']))
def test_coordinates_and_values_belong_together(u, kind):
    """From u to theta and back is the identity, and slope is the derivative."""
    prior = Prior('a.b', 1e-6 if kind == 'log' else -1e3, 1e3, 2.0, 0.7, kind)
    assert prior.u(prior.theta(u)) == pytest.approx(u, abs=1e-9)
    step = 1e-6
    assert prior.slope(u) == pytest.approx(
        (prior.theta(u + step) - prior.theta(u - step)) / (2 * step), rel=1e-5)


def test_values_stay_within_their_bounds():
    """Far coordinates give the bound, never more."""
    prior = Prior('a.b', 0.5, 3.0, 1.0, 1.2, 'log')
    assert prior.theta(50.0) == 3.0
    assert prior.theta(-50.0) == 0.5
    assert prior.limits == pytest.approx((np.log(0.5) / 1.2, np.log(3.0) / 1.2))


def test_geometry_is_held_by_its_tolerances(paper_muscle):
    """One width is 4 % of the radius and 1.5 deg of the braid angle."""
    radius, angle = own_priors(paper_muscle)[:2]
    assert radius.theta(1.0) / radius.theta(0.0) == pytest.approx(1.04)
    assert np.degrees(angle.theta(1.0) - angle.theta(0.0)) == pytest.approx(1.5)


def test_a_signed_parameter_may_change_the_force_by_a_part_of_its_spread():
    """Bounds of a polynomial say little about its size; the change of the force does."""
    effect = catalogue.get('bladder_polynomial')()
    free = {p.key: p for p in effect_priors(effect, 1)}
    held = {p.key: p for p in effect_priors(effect, 1, change=lambda key, step: abs(step) * 0.01,
                                            size=10.0)}
    assert held['bladder_polynomial.k2'].width == pytest.approx(1000.0)
    assert held['bladder_polynomial.k2'].width < free['bladder_polynomial.k2'].width
    assert held['bladder_polynomial.k1'].kind == 'log'


# --- covariance --------------------------------------------------------------------------------

@pytest.mark.parametrize('h', [FULL, Hyper(white=8), FULL._replace(odd=0), Hyper(slow=9)])
def test_whitening_makes_the_covariance_the_identity(problem, h):
    """L^-1 K L^-T = I, and the determinant is that of K."""
    cells, covariance, _ = problem
    k = covariance.matrix(h)
    half = covariance.whiten(h, covariance.whiten(h, k).T)
    np.testing.assert_allclose(half, np.eye(len(cells)), atol=1e-6)
    assert covariance.log_determinant(h) == pytest.approx(0.5 * np.linalg.slogdet(k)[1])


def test_the_odd_part_has_opposite_signs_in_opposite_directions(problem):
    """Cells of one place and two directions: the even part agrees, the odd part opposes."""
    cells, covariance, _ = problem
    even = covariance.structured(Hyper(even=9))
    odd = covariance.structured(Hyper(odd=9))
    np.testing.assert_allclose(odd, even * np.outer(cells.direction, cells.direction))


def test_slow_misfit_ends_with_its_trial(problem):
    """Cells of two trials share no drift."""
    cells, covariance, _ = problem
    slow = covariance.structured(Hyper(slow=9))
    assert np.all(slow[cells.trial[:, None] != cells.trial] == 0.0)
    assert np.diag(slow) == pytest.approx((AMPLITUDES[9] * cells.force_sd) ** 2)


def test_the_part_of_the_speed_is_odd_and_fades_with_the_ratio_of_speeds(sweeps, paper_muscle):
    """Strangers at speeds far apart, as the odd part at one speed; no such part without two."""
    slow, fast = sweeps(speed=0.003), sweeps(speed=0.1)
    both = build('both', np.append(slow.strain, fast.strain),
                 np.concatenate([slow.pressure, fast.pressure]), np.append(slow.force, fast.force),
                 np.append(slow.trial, fast.trial + 100),
                 np.append(slow.time, fast.time + slow.time[-1] + 9.0))
    assert 'speed' not in Covariance(reduce(paper_muscle, slow), 0.01).axes
    covariance = Covariance(reduce(paper_muscle, both, most=200), 0.01)
    assert 'speed' in covariance.axes
    odd, part = (covariance.structured(Hyper(**{axis: 9})) for axis in ('odd', 'speed'))
    quick = covariance.cells.speed > np.log(0.02)
    apart = np.ix_(quick, ~quick)
    assert np.abs(part[apart]).max() < 0.1 * np.abs(odd[apart]).max()
    np.testing.assert_allclose(np.diag(part), np.diag(odd))
    assert np.all(part * odd >= 0.0)
    assert np.all(np.abs(part) <= np.abs(odd) * (1.0 + 1e-9))


def test_matern_falls_from_one_and_stays_positive_definite():
    """1 at no distance; a matrix of it has no negative eigenvalue."""
    x = np.linspace(0, 3, 40)
    k = matern_5_2((x[:, None] - x) ** 2)
    assert k[0, 0] == 1.0
    assert np.all(np.diff(k[0]) < 0)
    assert np.linalg.eigvalsh(k).min() > -1e-10


def test_the_discrepancy_adds_over_motor_units(paper_muscle):
    """As forces do: what it is between cells is the mean over units of what each gives."""
    unit = paper_muscle.motor_units[0]
    bundle = Bundle('two', [MotorUnit(f'mu{k}', 1, unit.geometry) for k in (1, 2)],
                    paper_muscle.effects)
    rng = np.random.default_rng(0)
    strain, pressure = rng.uniform(0, 0.2, 60), rng.uniform(0, 4e5, (60, 2))
    data = build('two', strain, pressure, bundle.force(strain, pressure),
                 motor_units=('mu1', 'mu2'))
    covariance = Covariance(reduce(bundle, data), 0.01)
    h = Hyper(even=9)
    parts = [covariance.across(h, strain, pressure, k) for k in (0, 1)]
    np.testing.assert_allclose(parts[0] + parts[1], covariance.across(h, strain, pressure))
    assert np.allclose(np.diag(parts[0]), 0.5)


# --- evidence ----------------------------------------------------------------------------------

def test_evidence_of_a_linear_model_is_its_marginal_likelihood(problem):
    """It is log N(y; 0, K + J J') of the model linearised at u, plus the amplitudes' prior."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((len(cells), 3))
    u = np.array([0.5, -1.0, 0.2])
    priors = [Prior(f'a.{k}', -1e3, 1e3, 0.0, 1.0, 'normal') for k in 'xyz']
    y = rng.standard_normal(len(cells))
    expected = multivariate_normal(cov=covariance.matrix(FULL) + slopes @ slopes.T).logpdf(y)
    found = fitter.log_evidence(FULL, Linear.of(priors, u, y - slopes @ u, slopes))
    assert found == pytest.approx(expected + covariance.log_prior(FULL), abs=1e-6)


def test_what_is_reached_lacks_half_of_the_misfit_that_another_place_would_save(problem):
    """At the least misfit of a linear model nothing; elsewhere the misfit at that place counts."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(1)
    slopes, y = rng.standard_normal((len(cells), 2)), rng.standard_normal(len(cells))
    priors = [Prior(f'a.{k}', -1e3, 1e3, 0.0, 1.0, 'normal') for k in 'xy']
    white = covariance.whiten(FULL, np.column_stack([slopes, y]))
    stacked = np.vstack([white, np.eye(2, 3)])

    def lacks(u):
        given = FULL, Linear.of(priors, u, y - slopes @ u, slopes)
        return fitter.log_evidence(*given) - fitter.log_evidence(*given, reached=True)

    best, (least,), *_ = np.linalg.lstsq(stacked[:, :2], stacked[:, 2])
    away = best + [0.4, -0.2]
    misfit = np.sum((stacked[:, :2] @ away - stacked[:, 2]) ** 2)
    assert lacks(best) == pytest.approx(0.0, abs=1e-9)
    assert lacks(away) == pytest.approx(0.5 * (misfit - least))


def test_a_length_is_found_though_its_amplitude_has_to_follow(problem):
    """Data tell amplitude over length^(5/2) of a Matern 5/2; alone neither can be moved."""
    cells, _, fitter = problem
    wave = 10.0 * np.sin(6.0 * cells.strain / np.ptp(cells.strain) + cells.pressure[:, 0] / 1.4e5)
    given = Linear.of((), np.zeros(0), wave, np.zeros((len(cells), 0)))
    h, value = fitter.best_hyper(fitter.first_hyper(), given)
    better, high = fitter.along_ridge(h, given)
    assert high > value + 3.0
    assert high == fitter.log_evidence(better, given)
    shorter = better.strain - h.strain + better.pressure - h.pressure
    assert shorter * (better.even - h.even) < 0  # a place further on is a shorter length
    assert fitter.along_ridge(h, given, reach=0) == (h, value)


def test_a_fit_ends_where_no_other_length_is_better(sweeps, paper_muscle):
    """A wave over strain and pressure that no parameter of the muscle takes."""
    data = sweeps(noise=0.2, extra=lambda e, p, way, t: 10 * np.sin(25 * e + p / 1.4e5))
    cells = reduce(paper_muscle, data, most=120)
    fitter = Fitter(cells, Covariance(cells, 0.01))
    fit = fitter.fit(('mesh', 'bladder_elasticity'), paper_muscle, own_priors(paper_muscle))
    _, high = fitter.along_ridge(fit.hyper, fit.linear)
    assert high < fit.evidence + fit.promise + 0.3


def test_where_a_fit_ends_does_not_depend_on_where_it_begins(repository):
    """DMSP-20 without a strain level; at kinks of slack and thresholds linear models mislead."""
    folder = repository / 'config' / 'data'
    model = load_model(folder / 'dmsp20_static_map.model.yaml')
    data = read_measurement(folder / 'dmsp20_static_map.csv')
    cells = reduce(model, data.select(abs(data.strain - 0.199) > 2e-3))
    fitter = Fitter(cells, Covariance(cells, 0.01))
    options = Options.of(model, cells, Choices())
    names = tuple(sorted([*options.own, 'bladder_elasticity', 'strain_sensor_offset',
                          'tendon_slack', 'tondu_factor']))
    priors, rng = options.priors(names), np.random.default_rng(0)
    fits = [fitter.fit(names, options.bundle(names), priors)]
    for _ in range(3):
        start = {prior.key: float(np.clip(rng.normal(), *prior.limits)) for prior in priors}
        fits.append(fitter.fit(names, options.bundle(names), priors, start, Hyper()))
    assert np.ptp([fit.evidence for fit in fits]) < 1.0
    whole = fitter.covariance.matrix(fits[0].hyper)
    worst = -0.5 * fits[0].residual @ np.linalg.solve(whole, fits[0].residual)
    assert fits[0].evidence < worst - 0.5 * np.linalg.slogdet(2.0 * np.pi * whole)[1]


def test_a_parameter_at_its_bound_counts_as_fixed(problem):
    """It widens nothing and pays for where it is."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((len(cells), 2))
    priors = [Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal'),
              Prior('a.y', -1e3, 2.0, 0.0, 1.0, 'normal')]
    u, r = np.array([0.3, 2.0]), rng.standard_normal(len(cells))
    free, both = (fitter.log_evidence(FULL, Linear.of(priors[:k], u[:k], r, slopes[:, :k]))
                  for k in (1, 2))
    assert both == pytest.approx(free - 2.0)


@pytest.mark.parametrize('size', [-0.02, 0.0, 0.01, 0.05, 1.0])
def test_a_size_is_positive_or_absent_with_equal_odds(problem, size):
    """The evidence is the marginal likelihood under that prior, by quadrature."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(2)
    slopes = 20.0 * rng.standard_normal((len(cells), 2))
    priors = [Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half'),
              Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal')]
    white = Hyper(white=4)
    noise = np.sqrt(cells.noise ** 2 / cells.count + covariance.variance(4))
    slopes *= np.median(noise) / np.linalg.norm(slopes[:, 0]) / 0.02
    force = slopes @ [size, 0.5] + noise * rng.standard_normal(len(cells))
    u = np.array([0.3, 0.2])
    told = fitter.log_evidence(white, Linear.of(priors, u, force - slopes @ u, slopes))

    def given(value):
        rest = Linear.of(priors[1:], u[1:], force - value * slopes[:, 0] - slopes[:, 1] * u[1],
                         slopes[:, 1:])
        return fitter.log_evidence(white, rest)
    values = np.linspace(0.0, 4.0, 20001)
    height = np.array([given(value) for value in values])
    top = height.max()
    above = np.trapezoid(np.exp(height - top - 0.5 * values ** 2), values) / np.sqrt(2.0 * np.pi)
    exact = top + np.log(0.5 * np.exp(given(0.0) - top) + above)
    assert told == pytest.approx(exact, abs=2e-3)
    at_zero = fitter.log_evidence(white, Linear.of(
        priors, np.array([0.0, 0.2]), force - 0.2 * slopes[:, 1], slopes))
    assert at_zero == pytest.approx(given(0.0) - np.log(2.0))


def test_beside_a_part_that_is_there_the_other_is_absent_with_even_odds(problem):
    """Half the evidence of both parts, half that of the law without the one in the logarithm."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(4)
    white = Hyper(white=4)
    noise = np.sqrt(cells.noise ** 2 / cells.count + covariance.variance(4))
    ways = rng.standard_normal((len(cells), 3)) * 0.3 * np.median(noise)
    ways[:, 0] += 0.5 * ways[:, 1]
    other = Prior('a.constant', 0.0, 1e3, 2.0, 1.2, 'log', beside='a.size')
    priors = [other, Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half'),
              Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal')]
    force = ways @ [0.0, 9.0, 0.5] + noise * rng.standard_normal(len(cells))
    u = np.array([-1.5, 9.1, 0.4])
    theta, slopes = np.append(other.theta(u[0]), u[1:]), ways.copy()
    slopes[:, 0] *= other.slope(u[0])
    told, both = (fitter.log_evidence(white, Linear.of(
        [first, *priors[1:]], u, force - ways @ theta, slopes))
        for first in (other, replace(other, beside='')))
    alone = fitter.log_evidence(white, Linear.of(
        priors[1:], u[1:], force - ways[:, 1:] @ u[1:], ways[:, 1:]))
    assert told == pytest.approx(np.logaddexp(both, alone) - np.log(2.0), abs=1e-6)
    assert alone > both + 1.0


def test_friction_in_proportion_to_the_pressure_ties_with_damping_at_one_speed(paper_muscle):
    """A constant part that neither has is free: its usual size is no reason for either."""
    clock, leg = 0.02 * np.arange(1200.0), np.repeat(np.arange(4), 300)
    strain = 0.02 + 0.18 * (1.0 - np.abs(2.0 * (np.arange(1200) / 300 % 1.0) - 1.0))
    pressure = np.array([80e3, 170e3, 280e3, 400e3])[leg, None]
    log = build('one speed', strain, pressure, np.full(1200, 50.0), leg, clock)
    truth = paper_muscle.with_effect('coulomb_friction', force=0.0, per_pressure=2e-5)
    noise = np.random.default_rng(5).standard_normal(len(log))
    cells = reduce(paper_muscle, replace(log, force=predict(truth, log) + noise))
    fitter = Fitter(cells, Covariance(cells, 0.01))
    options = Options.of(paper_muscle, cells, Choices())
    rubbed, damped = (Search(options, fitter).fit(tuple(sorted([*options.own, name])))
                      for name in ('coulomb_friction', 'viscous_damping'))
    assert rubbed.posterior == pytest.approx(damped.posterior, abs=1.0)


def test_what_is_reached_at_a_size_of_nearly_zero_is_that_at_zero(problem):
    """A hair above its bound a size costs what it costs at the bound."""
    cells, _, fitter = problem
    rng = np.random.default_rng(3)
    slopes = 100.0 * rng.standard_normal((len(cells), 1))
    priors = [Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half')]
    force = rng.standard_normal(len(cells))
    values = [fitter.log_evidence(FULL, Linear.of(priors, np.array([size]),
                                                  force - size * slopes[:, 0], slopes), True)
              for size in (0.0, 1e-7)]
    assert values[1] == pytest.approx(values[0], abs=0.02)


def test_amplitudes_pay_by_what_is_normal(problem):
    """exp(-sum of amplitudes / unexplained): half of what is normal costs twice as much."""
    cells, _, _ = problem
    wide, narrow = Covariance(cells, 0.02), Covariance(cells, 0.01)
    assert narrow.log_prior(FULL) == pytest.approx(2 * wide.log_prior(FULL))
    assert narrow.log_prior(Hyper()) == 0.0


def test_the_fit_is_the_least_squares_solution_with_priors_as_rows(problem, paper_muscle):
    """The same as scipy's least_squares on whitened residuals and u."""
    cells, covariance, fitter = problem
    model = paper_muscle.with_effect('coulomb_friction').with_effect('end_caps')
    names = tuple(sorted(e.name for e in model.effects))
    options = Options.of(paper_muscle, cells, Choices())
    priors = options.priors(names)
    h = Hyper(white=6)
    start = np.array([p.start for p in priors])
    u, residual, slopes = fitter.most_probable(model, priors, start, fitter.whitener(h), 40, 1e-9)
    limits = np.array([p.limits for p in priors]).T

    def rows(x):
        return np.append(covariance.whiten(h, fitter.residual(model, priors, x)), x)

    best = least_squares(rows, np.clip(start, *(limits + [[1e-9], [-1e-9]])), bounds=limits,
                         xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert np.sum(rows(u) ** 2) == pytest.approx(2 * best.cost, rel=1e-4)
    np.testing.assert_allclose(residual, fitter.residual(model, priors, u))


def test_slopes_are_derivatives_of_the_prediction(problem, paper_muscle):
    """By the coordinates of the priors, as differences have them."""
    _, _, fitter = problem
    priors = own_priors(paper_muscle)
    u = np.array([0.4, -0.3, 0.5, -0.6])
    residual, slopes = fitter.linearised(paper_muscle, priors, u)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-4
        change = (fitter.residual(paper_muscle, priors, u - step)
                  - fitter.residual(paper_muscle, priors, u + step)) / 2e-4
        np.testing.assert_allclose(slopes[:, k], change, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(residual, fitter.residual(paper_muscle, priors, u))


# --- sets --------------------------------------------------------------------------------------

@pytest.mark.parametrize('rounding', [-1e-13, 1e-13])
def test_rounding_does_not_choose_between_sets_that_are_alike(rounding):
    """Compiled and plain laws differ in the last digit; what is better goes first all the same."""
    sets = [Screened((name,), value, {}, 0.0, {})
            for name, value in (('c', 3.0), ('b', 3.0 + rounding), ('d', 2.0), ('e', 4.0))]
    assert [each.names for each in _ranked(sets, lambda each: each.value)] == [
        ('e',), ('b',), ('c',), ('d',)]


def test_one_change_more_and_one_less_are_inverse(problem, paper_muscle):
    """Every set with one change more leads back to where it came from."""
    cells, _, _ = problem
    options = Options.of(paper_muscle, cells, Choices())
    further = options.further(options.own)
    assert all(options.own in options.back(names) for names in further)
    assert {options.changes(names) for names in further} == {1}
    assert all(len({head(n) for n in names}) == len(names) for names in further)


def test_the_models_own_effects_may_be_replaced_and_removed(problem, paper_muscle):
    """Another bladder and no bladder are among the sets; the mesh, without numbers, stays."""
    cells, _, _ = problem
    options = Options.of(paper_muscle, cells, Choices())
    further = options.further(options.own)
    assert ('bladder_polynomial', 'mesh') in further
    assert ('mesh',) in further
    assert all('mesh' in names for names in further)
    assert options.replaced(('bladder_polynomial', 'mesh')) == {
        'bladder_elasticity': 'bladder_polynomial'}
    assert options.removed(('mesh',)) == ['bladder_elasticity']


def test_shapes_of_one_effect_share_its_prior(problem, paper_muscle):
    """All shapes of a head together have the odds that are chosen."""
    cells, _, _ = problem
    options = Options.of(paper_muscle.without_effect('bladder_elasticity'), cells,
                         Choices(inclusion=0.2))
    shapes = [n for n in options.effects if head(n) == 'bladder_elasticity']
    assert len(shapes) >= 2
    odds = sum(np.exp(options.log_prior(('mesh', name))) for name in shapes)
    assert odds == pytest.approx(0.25)
    assert options.log_prior(options.own) == 0.0


def test_an_end_effect_that_goes_with_length_needs_two_lengths(problem, paper_muscle):
    """Muscles of one length cannot tell it from end caps: there it is not offered."""
    cells, _, _ = problem
    law = 'end_effect_of_length'
    assert law not in Options.of(paper_muscle, cells, Choices()).effects
    assert law not in {shape.name for shape in shapes_of('end_caps', paper_muscle)}
    several = Options.of(paper_muscle, cells, Choices(), lengths=2)
    assert tuple(sorted((law, 'bladder_elasticity', 'mesh'))) in several.further(several.own)


def test_a_wrong_rest_length_is_offered_where_lengths_were_read(problem, paper_muscle):
    """A strain that the file gives itself does not depend on the rest length of the model."""
    cells, _, _ = problem
    for quantity, offered in (('length', True), ('contraction', False), ('strain', False)):
        read = replace(cells, data=replace(cells.data, taken=(Taken('x', quantity),)))
        options = Options.of(paper_muscle, read, Choices())
        assert ('strain_rest_length' in options.effects) is offered


def test_the_covariance_is_the_sum_of_its_parts_by_their_definitions(problem):
    """Noise of cells, white misfit, even, odd and slow parts; with the prior of the amplitudes."""
    cells, covariance, _ = problem
    even, odd, white, slow = ((AMPLITUDES[k] * np.std(cells.force)) ** 2 for k in (9, 8, 6, 7))
    e = np.subtract.outer(cells.strain, cells.strain) / cells.strain_range / STRAIN_LENGTHS[1]
    p = np.subtract.outer(*[cells.pressure[:, 0]] * 2) / cells.pressure_range / PRESSURE_LENGTHS[1]
    smooth = matern_5_2(e ** 2 + p ** 2)
    apart = np.abs(np.subtract.outer(cells.time, cells.time)) / TIME_LENGTHS[1]
    fading = np.where(np.equal.outer(cells.trial, cells.trial), np.exp(-apart), 0.0)
    expected = (np.diag(cells.noise ** 2 / cells.count + white) + slow * fading
                + smooth * (even + odd * np.outer(cells.direction, cells.direction)))
    np.testing.assert_allclose(covariance.matrix(FULL), expected, rtol=1e-9, atol=1e-12)
    assert covariance.white_sd(FULL) == pytest.approx(np.sqrt(white))
    shares = AMPLITUDES[[9, 8, 6, 7]].sum()
    assert covariance.log_prior(FULL) - covariance.log_prior(Hyper()) == pytest.approx(
        -shares / 0.01)
    assert covariance.axes == ('even', 'white', 'strain', 'pressure', 'odd', 'slow', 'tau')
