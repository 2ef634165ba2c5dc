# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A muscle that lifts weights: the force is given, and the strain is the measured quantity."""

import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy.optimize import brentq

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.fitter import Fitter, in_strain
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import slope_in_strain
from fam_bundle_ros.discovery.settings import Choices

#: Noise of the strain, and of the pressure, Pa.
STRAIN_NOISE, PRESSURE_NOISE = 2.5e-4, 200.0


def _off(strain, model, pressure, force):
    return model.force(strain, [pressure]) - force


@pytest.fixture(scope='module')
def lift(paper_muscle):
    """Return a function that makes a log of the paper's muscle under weights, two cycles each."""
    def make(*weights, friction=0.0, load_cell=0.0):
        rng = np.random.default_rng(0)
        once = np.concatenate([np.linspace(1.5e5, 4e5, 60), np.linspace(4e5, 1.5e5, 60)])
        pressure, force = np.tile(once, 2 * len(weights)), np.repeat(weights, 240)
        strain = []
        for k, (p, weight) in enumerate(zip(pressure, force)):
            least, most = (brentq(_off, -0.05, 0.5, (paper_muscle, p, weight + loss))
                           for loss in (friction, -friction))
            # between these strains dry friction holds it
            strain.append(least if k % 240 == 0 else np.clip(strain[-1], least, most))
        rows = len(strain)
        return build('weights', strain + STRAIN_NOISE * rng.standard_normal(rows),
                     pressure + PRESSURE_NOISE * rng.standard_normal(rows),
                     force + load_cell * rng.standard_normal(rows),
                     np.repeat(np.arange(len(weights)), 240), np.arange(1.0 * rows))
    return make


@pytest.mark.parametrize('weights', [(50.0,), (15.0, 30.0, 50.0)])
def test_noise_of_the_strain_is_noise_of_the_measurement(paper_muscle, lift, weights):
    """As a force; the constant readings of the force have none."""
    data = lift(*weights)
    expected = STRAIN_NOISE * np.sqrt(np.mean(slope_in_strain(paper_muscle, data) ** 2))
    assert compare(paper_muscle, data).noise.value == pytest.approx(expected, rel=0.25)
    assert reduce(paper_muscle, data).noise == pytest.approx(expected, rel=0.25)


def test_noise_of_the_load_cell_is_no_error_of_the_strain(paper_muscle, lift):
    """A stiffer model would otherwise seem to predict the strain better."""
    without, with_it = (reduce(paper_muscle, lift(50.0, load_cell=noise)) for noise in (0.0, 0.6))
    assert with_it.noise == pytest.approx(without.noise, rel=0.15)


def test_a_force_that_depends_on_nothing_explains_no_strain(paper_muscle, lift):
    """It is equal to the weight everywhere; its error is the range of the strain."""
    cells = reduce(paper_muscle, lift(50.0))
    none = np.zeros(len(cells))
    residual, *_ = in_strain(cells, cells.strain_noise + none, none)
    assert_allclose(residual - cells.strain_noise, cells.strain_range * cells.stiffness)


def test_an_error_of_strain_is_that_of_the_force_over_the_stiffness_of_the_fitted_model(
        paper_muscle, lift):
    """Of the model as given it is the error of the force."""
    cells = reduce(paper_muscle, lift(50.0))
    off = np.full(len(cells), 2.0)
    for share in (1.0, 2.0):
        residual, *_ = in_strain(cells, cells.strain_noise + off, share * cells.stiffness)
        assert_allclose(residual - cells.strain_noise, off / share)


def test_beyond_the_range_of_the_strain_the_error_grows_with_the_logarithm(paper_muscle, lift):
    """Continuously, and with its derivatives, whatever the signs of error and stiffness."""
    cells = reduce(paper_muscle, lift(50.0))
    off = cells.strain_range * cells.stiffness
    for sign in (1.0, -1.0):
        def error(factor, share, sign=sign):
            return sign * (in_strain(cells, cells.strain_noise + sign * factor * off,
                                     share * cells.stiffness)[0]
                           - cells.strain_noise) / off
        assert_allclose(error(1.0, 1.0), 1.0)
        assert_allclose(error(np.e, 1.0), 2.0)
        assert_allclose(error(1.0, 1.0 / np.e), 2.0)
        assert_allclose(error(1.0, -1.0), error(1.0, 0.0))
        assert (error(1.0, 0.0) > error(0.5, 0.1)).all()
    for factor, share in ((0.7, 1.2), (1.5, 0.9), (0.5, 0.3), (-2.0, 1.0)):
        at = cells.strain_noise + factor * off, share * cells.stiffness
        _, by_force, by_stiffness = in_strain(cells, *at)
        for found, move in ((by_force, (1e-4, 0.0)), (by_stiffness, (0.0, 1e-4))):
            below, above = (in_strain(cells, *(x + way * d for x, d in zip(at, move)))[0]
                            for way in (-1.0, 1.0))
            assert_allclose(found, (above - below) / 2e-4, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize('radius', [1.0, 1.3])
def test_slopes_are_derivatives_of_the_error_in_strain(paper_muscle, lift, radius):
    """In every parameter, friction and rubber among them; far off, too."""
    cells = reduce(paper_muscle, lift(50.0, friction=4.0))
    paper_muscle = paper_muscle.with_parameters({'geometry.radius': radius * 6.35e-3})
    fitter, options = Fitter(Covariance(cells, 0.01)), Options.of(paper_muscle, cells, Choices())
    names = (*options.own, 'coulomb_friction')
    model, priors, step = options.bundle(names), options.priors(names), 1e-5
    u = np.array([prior.start for prior in priors]) + 0.3
    _, slopes = fitter.linearised(model, priors, u)
    for j in range(len(u)):
        away = step * (np.arange(len(u)) == j)
        below, above = (fitter.residual(model, priors, u + sign * away) for sign in (-1, 1))
        assert_allclose(slopes[:, j], (below - above) / (2 * step), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(('weights', 'tried'), [((50.0,), False), ((15.0, 30.0, 50.0), True)])
def test_laws_of_the_force_alone_are_tried_with_several_weights(paper_muscle, lift, weights,
                                                                tried):
    """One force cannot tell a bias from a gain or another scale of the muscle."""
    found = Options.of(paper_muscle, reduce(paper_muscle, lift(*weights)), Choices()).effects
    for name in ('force_sensor_bias', 'force_sensor_gain', 'tendon_slack', 'force_floor'):
        assert (name in found) == tried
    assert {'force_sensor_drift', 'coulomb_friction', 'pressure_sensor_bias'} <= set(found)


def test_rows_in_which_friction_may_hold_the_muscle_are_not_used(paper_muscle, lift):
    """The force of friction is not known there; all others are averaged."""
    data = lift(50.0, friction=4.0)
    cells = reduce(paper_muscle, data)
    loss = np.array([paper_muscle.force(e, p) for e, p in zip(*data.smoothed)]) - data.force
    used = cells.label >= 0
    assert np.abs(np.abs(loss[used]) - 4.0).max() < 1.5
    assert used.mean() > 0.75


@pytest.mark.parametrize('load_cell', [0.0, 0.6])
def test_friction_is_found_under_a_single_weight(paper_muscle, lift, load_cell):
    """Or a tie that holds it."""
    found = diagnose(paper_muscle, lift(50.0, friction=4.0, load_cell=load_cell),
                     choices=Choices(most=1))
    assert found.verdict in ('missing_effect', 'partial')
    assert 'coulomb_friction' in {*found.effects, *(name for tie in found.tied for name in tie)}


def test_the_noise_of_the_strain_is_not_in_the_coordinate_of_a_discrepancy(paper_muscle, lift):
    """It is the error of the force there: with it in both, a smooth function explains it all."""
    cells = reduce(paper_muscle, lift(50.0))
    error = cells.mean(cells.residual_of_rows(paper_muscle))
    there = np.array([brentq(_off, -0.05, 0.5, (paper_muscle, pressure, 50.0))
                      for pressure in cells.pressure[:, 0]])
    assert np.corrcoef(error, cells.strain - there)[0, 1] > 0.8
    assert abs(np.corrcoef(error, cells.strain_coordinate - there)[0, 1]) < 0.2


def test_nothing_is_missing_under_a_single_weight(paper_muscle, lift):
    """A level of the force is no effect."""
    found = diagnose(paper_muscle, lift(50.0), choices=Choices(most=1))
    assert found.verdict in ('adequate', 'recalibrate')
