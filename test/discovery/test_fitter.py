# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Fits of a set of effects: their optimum, slopes and hyperparameters."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.priors import own_priors
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import (
    Choices,
)
from fam_bundle_ros.model import load_model

FULL = Hyper(even=9, strain=1, pressure=1, odd=8, white=6, slow=7, tau=1)



def test_where_a_fit_ends_does_not_depend_on_where_it_begins(repository):
    """DMSP-20 without a strain level; at kinks of slack and thresholds linear models mislead."""
    folder = repository / 'config' / 'data'
    model = load_model(folder / 'dmsp20_static_map.model.yaml')
    data = read_measurement(folder / 'dmsp20_static_map.csv')
    cells = reduce(model, data.select(abs(data.strain - 0.199) > 2e-3))
    fitter = Fitter(Covariance(cells, 0.01))
    options = Options.of(model, cells, Choices())
    names = tuple(sorted([*options.own, 'bladder_elasticity', 'strain_sensor_offset',
                          'tendon_slack', 'tondu_factor']))
    priors, rng = options.priors(names), np.random.default_rng(0)
    fits = [fitter.fit(names, options.bundle(names), priors)]
    for _ in range(3):
        start = {prior.key: float(np.clip(rng.normal(), *prior.limits)) for prior in priors}
        fits.append(fitter.from_similar(fits[0], start, Hyper()))
    assert np.ptp([fit.evidence for fit in fits]) < 1.0
    whole = fitter.covariance.matrix(fits[0].hyper)
    worst = -0.5 * fits[0].residual @ np.linalg.solve(whole, fits[0].residual)
    assert fits[0].evidence < worst - 0.5 * np.linalg.slogdet(2.0 * np.pi * whole)[1]


def test_a_set_gets_at_least_as_good_as_the_similar_set_it_starts_at(repository):
    """DMSP-20: end caps hide the slack of the tendon from a fit that starts at the priors."""
    folder = repository / 'config' / 'data'
    model = load_model(folder / 'dmsp20_static_map.model.yaml')
    cells = reduce(model, read_measurement(folder / 'dmsp20_static_map.csv'))
    fitter = Fitter(Covariance(cells, 0.01))
    options = Options.of(model, cells, Choices())
    fewer, more = (fitter.fit(names, options.bundle(names), options.priors(names))
                   for names in (('mesh', 'saturating_sheath', 'tendon_slack'),
                                 ('end_caps', 'mesh', 'saturating_sheath', 'tendon_slack')))
    assert more.evidence < fewer.evidence
    better = fitter.from_similar(more, fewer.start, fewer.hyper)
    assert better.evidence > fewer.evidence
    assert better.white_evidence == more.white_evidence
    worse = fitter.from_similar(better, {}, Hyper(white=12))
    assert worse is better


def test_friction_in_proportion_to_the_pressure_ties_with_damping_at_one_speed(paper_muscle):
    """A constant part that neither has is free: its usual size is no reason for either."""
    clock, leg = 0.02 * np.arange(1200.0), np.repeat(np.arange(4), 300)
    strain = 0.02 + 0.18 * (1.0 - np.abs(2.0 * (np.arange(1200) / 300 % 1.0) - 1.0))
    pressure = np.array([80e3, 170e3, 280e3, 400e3])[leg, None]
    log = build('one speed', strain, pressure, np.full(1200, 50.0), leg, clock)
    truth = paper_muscle.with_effect('coulomb_friction', force=0.0, per_pressure=2e-5)
    noise = np.random.default_rng(5).standard_normal(len(log))
    cells = reduce(paper_muscle, replace(log, force=predict(truth, log) + noise))
    search = Search(Options.of(paper_muscle, cells, Choices()))
    rubbed, damped = (search.fit(tuple(sorted([*search.options.own, name])))
                      for name in ('coulomb_friction', 'viscous_damping'))
    assert rubbed.posterior == pytest.approx(damped.posterior, abs=1.0)


def test_the_fit_is_the_least_squares_solution_with_priors_as_rows(problem, paper_muscle):
    """The same as scipy's least_squares on whitened residuals and u."""
    cells, covariance, fitter = problem
    model = paper_muscle.with_effect('coulomb_friction').with_effect('end_caps')
    names = tuple(sorted(e.name for e in model.effects))
    options = Options.of(paper_muscle, cells, Choices())
    priors = options.priors(names)
    h = Hyper(white=6)
    start = np.array([p.start for p in priors])
    at = start, *fitter.linearised(model, priors, start)
    u, residual, slopes = fitter.most_probable(model, priors, at, fitter.whitener(h), 40, 1e-9)
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
