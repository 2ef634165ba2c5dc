# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The evidence of a linearised model, compared with the integral that it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.priors import Prior

FULL = Hyper(even=9, strain=1, pressure=1, odd=8, white=6, slow=7, tau=1)


def test_evidence_of_a_linear_model_is_its_marginal_likelihood(problem):
    """It is log N(y; 0, K + J J') of the model linearised at u, plus the amplitudes' prior."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((len(cells), 3))
    u = np.array([0.5, -1.0, 0.2])
    priors = [Prior(f'a.{k}', -1e3, 1e3, 0.0, 1.0, 'normal') for k in 'xyz']
    y = rng.standard_normal(len(cells))
    expected = multivariate_normal(cov=covariance.matrix(FULL) + slopes @ slopes.T).logpdf(y)
    found = log_evidence(fitter.covariance, FULL, Linear.of(priors, u, y - slopes @ u, slopes))
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
        return log_evidence(fitter.covariance, *given) - log_evidence(
            fitter.covariance, *given, reached=True)

    best, (least,), *_ = np.linalg.lstsq(stacked[:, :2], stacked[:, 2])
    away = best + [0.4, -0.2]
    misfit = np.sum((stacked[:, :2] @ away - stacked[:, 2]) ** 2)
    assert lacks(best) == pytest.approx(0.0, abs=1e-9)
    assert lacks(away) == pytest.approx(0.5 * (misfit - least))



def test_a_parameter_at_its_bound_counts_as_fixed(problem):
    """It widens nothing and pays for where it is."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(1)
    slopes = rng.standard_normal((len(cells), 2))
    priors = [Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal'),
              Prior('a.y', -1e3, 2.0, 0.0, 1.0, 'normal')]
    u, r = np.array([0.3, 2.0]), rng.standard_normal(len(cells))
    free, both = (log_evidence(fitter.covariance, FULL,
                               Linear.of(priors[:k], u[:k], r, slopes[:, :k])) for k in (1, 2))
    assert both == pytest.approx(free - 2.0)


@pytest.mark.parametrize(('u', 'paid'), [(0.0, np.log(2.0)), (2.0, 2.0)])
def test_a_size_at_its_upper_bound_is_there(problem, u, paid):
    """At zero it is absent, as in half of all muscles; at the bound it pays for where it is."""
    cells, _, fitter = problem
    rng = np.random.default_rng(3)
    slopes, r = rng.standard_normal((len(cells), 2)), rng.standard_normal(len(cells))
    priors = [Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal'),
              Prior('a.size', 0.0, 2.0, 0.0, 1.0, 'half')]
    without, with_it = (log_evidence(fitter.covariance, FULL, Linear.of(
        priors[:k], np.array([0.3, u])[:k], r, slopes[:, :k])) for k in (1, 2))
    assert with_it == pytest.approx(without - paid)


@pytest.mark.parametrize('size', [-0.02, 0.0, 0.01, 0.05, 1.0])
def test_a_size_is_positive_or_absent_with_equal_odds(problem, size):
    """The evidence is the marginal likelihood under that prior, by quadrature."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(2)
    slopes = 20.0 * rng.standard_normal((len(cells), 2))
    priors = [Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half'),
              Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal')]
    white = Hyper(white=4)
    noise = np.sqrt(cells.variance + covariance.variance(4))
    slopes *= np.median(noise) / np.linalg.norm(slopes[:, 0]) / 0.02
    force = slopes @ [size, 0.5] + noise * rng.standard_normal(len(cells))
    u = np.array([0.3, 0.2])
    told = log_evidence(fitter.covariance, white, Linear.of(priors, u, force - slopes @ u, slopes))

    def given(value):
        rest = Linear.of(priors[1:], u[1:], force - value * slopes[:, 0] - slopes[:, 1] * u[1],
                         slopes[:, 1:])
        return log_evidence(fitter.covariance, white, rest)
    values = np.linspace(0.0, 4.0, 4001)
    height = np.array([given(value) for value in values])
    top = height.max()
    above = np.trapezoid(np.exp(height - top - 0.5 * values ** 2), values) / np.sqrt(2.0 * np.pi)
    exact = top + np.log(0.5 * np.exp(given(0.0) - top) + above)
    assert told == pytest.approx(exact, abs=2e-3)
    at_zero = log_evidence(fitter.covariance, white, Linear.of(
        priors, np.array([0.0, 0.2]), force - 0.2 * slopes[:, 1], slopes))
    assert at_zero == pytest.approx(given(0.0) - np.log(2.0))


@pytest.mark.parametrize('size', [0.0, 0.3, 9.0])
def test_beside_a_part_that_is_there_the_other_is_absent_with_even_odds(problem, size):
    """Half the evidence of both parts, half that of the law without the one in the logarithm."""
    cells, covariance, fitter = problem
    rng = np.random.default_rng(4)
    white = Hyper(white=4)
    noise = np.sqrt(cells.variance + covariance.variance(4))
    ways = rng.standard_normal((len(cells), 3)) * 0.3 * np.median(noise)
    ways[:, 0] += 0.5 * ways[:, 1]
    other = Prior('a.constant', 0.0, 1e3, 2.0, 1.2, 'log', beside='a.size')
    priors = [other, Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half'),
              Prior('a.x', -1e3, 1e3, 0.0, 1.0, 'normal')]
    force = ways @ [0.0, size, 0.5] + noise * rng.standard_normal(len(cells))
    u = np.array([-1.5, size + 0.1, 0.4])
    theta, slopes = np.append(other.theta(u[0]), u[1:]), ways.copy()
    slopes[:, 0] *= other.slope(u[0])
    told, both = (log_evidence(fitter.covariance, white, Linear.of(
        [first, *priors[1:]], u, force - ways @ theta, slopes))
        for first in (other, replace(other, beside='')))
    def evidence(*kept):
        """Return the evidence of a law of these parts of which none is beside another."""
        kept = list(kept)
        own = [replace(priors[k], beside='') for k in kept]
        return log_evidence(fitter.covariance, white, Linear.of(
            own, u[kept], force - ways[:, kept] @ theta[kept], slopes[:, kept]))
    # each with a size is half of one that is absent and half of one that is there
    alone, (absent, nothing) = evidence(1, 2), (evidence(0, 2), evidence(2))
    there = 0.5 * (2.0 * np.exp(both - told) - np.exp(absent - told)
                   + 2.0 * np.exp(alone - told) - np.exp(nothing - told))
    assert 0.5 * np.exp(absent - told) + 0.5 * there == pytest.approx(1.0, abs=1e-6)
    assert alone > both + 1.0 or size < 9.0


def test_what_is_reached_at_a_size_of_nearly_zero_is_that_at_zero(problem):
    """A hair above its bound a size costs what it costs at the bound."""
    cells, _, fitter = problem
    rng = np.random.default_rng(3)
    slopes = 100.0 * rng.standard_normal((len(cells), 1))
    priors = [Prior('a.size', 0.0, 1e3, 0.0, 1.0, 'half')]
    force = rng.standard_normal(len(cells))
    values = [log_evidence(fitter.covariance, FULL, Linear.of(priors, np.array([size]),
                                                  force - size * slopes[:, 0], slopes), True)
              for size in (0.0, 1e-7)]
    assert values[1] == pytest.approx(values[0], abs=0.02)
