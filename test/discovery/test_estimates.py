# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Values, intervals and warnings of fitted parameters, from a posterior that is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.discovery.estimates import confounding, estimates, unit_of, with_intervals
from fam_bundle_ros.discovery.fitter import pinned
from fam_bundle_ros.discovery.posterior import Posterior
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.model import catalogue


@pytest.fixture
def fit(paper_muscle):
    """Return a fit with parameters of each kind and a covariance of u."""
    model = paper_muscle.with_effect('coulomb_friction', force=4.0).with_effect(
        'end_caps', dead_length=10e-3)
    priors = (Prior('geometry.radius', 2e-3, 20e-3, 6.35e-3, 0.25e-3, 'normal', True),
              Prior('coulomb_friction.force', 0.0, 200.0, 4.0, 1.2, 'log'),
              Prior('end_caps.dead_length', 0.0, 0.03, 0.0, 5e-3, 'half'))
    u, sd = np.array([0.8, -0.5, 1.5]), np.array([0.3, 0.1, 0.5])
    correlation = np.array([[1.0, 0.2, -0.6], [0.2, 1.0, 0.1], [-0.6, 0.1, 1.0]])
    return SimpleNamespace(model=model, priors=priors, u=u,
                           covariance=correlation * np.outer(sd, sd), at_bound=pinned(priors, u))


def test_values_and_intervals_are_those_of_the_posterior(fit):
    """95 % in the coordinate, told in the unit of the parameter and in SI."""
    radius, force, length = estimates(fit)
    assert [each.unit for each in (radius, force, length)] == ['mm', 'N', 'mm']
    assert radius.value == pytest.approx(6.35 + 0.8 * 0.25)
    assert radius.interval == pytest.approx((radius.value - 1.96 * 0.075,
                                             radius.value + 1.96 * 0.075), rel=1e-4)
    assert radius.si == pytest.approx(1e-3 * radius.value)
    assert radius.si_interval == pytest.approx(1e-3 * np.array(radius.interval))
    assert (radius.tolerances, force.tolerances) == (0.8, None)
    assert force.value == pytest.approx(4.0 * np.exp(-0.6))
    assert np.log(np.array(force.interval) / force.value) == pytest.approx(
        [-1.96 * 0.12, 1.96 * 0.12], rel=1e-3)
    assert force.moved == pytest.approx((-0.5, -0.696, -0.304), rel=1e-3)
    assert force.reach == pytest.approx((-1.96, 1.96), rel=1e-3)
    assert radius.prior == pytest.approx((6.35, 6.35 - 1.96 * 0.25, 6.35 + 1.96 * 0.25), rel=1e-4)
    assert force.prior == pytest.approx((4.0, 4.0 * np.exp(-2.352), 4.0 * np.exp(2.352)), rel=1e-3)
    assert length.prior == pytest.approx((0.0, 0.0, 1.96 * 5.0), rel=1e-3)
    assert length.moved == pytest.approx((1.5, 0.52, 2.48), rel=1e-3)
    assert length.reach == pytest.approx((0.0, 1.96), rel=1e-3)  # a size is not negative
    assert [each.flag for each in (radius, force, length)] == [''] * 3


def test_what_the_data_say_alone_gives_the_posterior_with_the_prior(fit):
    """Precisions add, and means by their precision."""
    for each, prior, u, variance in zip(estimates(fit), fit.priors, fit.u,
                                        np.diag(fit.covariance)):
        size = unit_of(fit.model, each.key)[1]
        centre, low, high = (
            np.log(size * value / prior.value) / prior.width if prior.kind == 'log'
            else (size * value - prior.value) / prior.width for value in each.data_alone)
        precision = (2.0 * 1.96 / (high - low)) ** 2
        if low > prior.limits[0]:
            assert 1.0 / variance == pytest.approx(1.0 + precision, rel=1e-3)
        assert u == pytest.approx(centre * (1.0 / variance - 1.0) * variance, rel=1e-3)


def test_what_is_not_to_be_trusted_is_said(fit):
    """Data that do not move it, a bound, another parameter that does as well."""
    fit.covariance[0, 0] = 0.99
    fit.u[2] = 0.0
    fit.at_bound = pinned(fit.priors, fit.u)
    radius, force, length = estimates(fit)
    assert radius.flag == 'dead: the data do not move it'
    assert radius.data_alone == ()
    assert force.flag == ''
    assert length.flag == 'at bound'
    assert length.interval[0] == 0.0
    fit.covariance[:] = np.diag([0.09, 0.01, 0.09])
    fit.covariance[0, 1] = fit.covariance[1, 0] = 0.0299
    fit.u[2] = 1.0
    fit.at_bound = pinned(fit.priors, fit.u)
    assert estimates(fit)[1].flag == 'traded off with geometry.radius'


def test_other_likely_sets_widen_an_interval_and_never_narrow_it(fit):
    """By the spread of what they say."""
    plain = estimates(fit)
    wide = estimates(fit, SimpleNamespace(spread=lambda key, u: 0.9))
    same = estimates(fit, SimpleNamespace(spread=lambda key, u: None))
    assert same == plain
    assert wide[0].moved == pytest.approx((0.8, 0.8 - 1.96 * 0.9, 0.8 + 1.96 * 0.9), rel=1e-3)
    assert wide[2].moved[1] == 0.0
    assert estimates(fit, SimpleNamespace(spread=lambda key, u: 1e-3)) == plain


def test_correlations_are_those_of_the_covariance(fit):
    """One for each with itself, whatever its size."""
    keys, matrix = confounding(fit)
    assert keys == [prior.key for prior in fit.priors]
    np.testing.assert_allclose(matrix, [[1.0, 0.2, -0.6], [0.2, 1.0, 0.1], [-0.6, 0.1, 1.0]])


def test_a_model_carries_the_intervals_of_its_effects(fit):
    """In SI; those that were known of other parameters stay, dimensions have none."""
    before = fit.model
    before.effect('bladder_elasticity').intervals['c10'] = (1.0, 2.0)
    model = with_intervals(before, estimates(fit), 0.7)
    assert model.error == 0.7
    for name in ('coulomb_friction.force', 'end_caps.dead_length'):
        owner, _, parameter = name.partition('.')
        told = next(each for each in estimates(fit) if each.key == name)
        assert model.effect(owner).intervals == {parameter: told.si_interval}
    assert model.effect('bladder_elasticity').intervals == {'c10': (1.0, 2.0)}
    assert before.effect('coulomb_friction').intervals == {}


def test_parameters_are_told_in_the_units_that_people_use(paper_muscle):
    """Dimensions in mm and degrees, others as their law says; a share has no unit."""
    assert unit_of(paper_muscle, 'geometry.braid_angle') == ('deg', pytest.approx(np.pi / 180.0))
    assert unit_of(paper_muscle, 'geometry.radius') == ('mm', pytest.approx(1e-3))
    relaxed = paper_muscle.with_effect('viscoelastic_relaxation')
    assert unit_of(relaxed, 'viscoelastic_relaxation.share') == ('', 1.0)
    for effect in (*relaxed.effects, catalogue.get('end_caps')()):
        for parameter in effect.parameters:
            model = relaxed.with_effect(effect)
            unit, size = unit_of(model, f'{effect.name}.{parameter.name}')
            assert (unit or '1', size) == (parameter.unit, parameter.scale)


def test_the_spread_of_a_parameter_is_that_of_all_sets_that_have_it():
    """The standard deviation about a value of what is drawn from them by their weights."""
    def fitted(key, u, sd):
        return SimpleNamespace(priors=(SimpleNamespace(key='other'), SimpleNamespace(key=key)),
                               u=np.array([9.0, u]), covariance=np.diag([9.0, sd ** 2]))
    sets = SimpleNamespace(fits=[fitted('a', 1.0, 0.2), fitted('b', 7.0, 5.0),
                                 fitted('a', 2.0, 0.5)], weights=[0.6, 0.1, 0.3])
    rng = np.random.default_rng(0)
    first = rng.uniform(size=100_000) < 0.6 / 0.9
    drawn = np.where(first, rng.normal(1.0, 0.2, 100_000), rng.normal(2.0, 0.5, 100_000))
    for about in (1.0, 1.5):
        assert Posterior.spread(sets, 'a', about) == pytest.approx(
            np.sqrt(np.mean((drawn - about) ** 2)), rel=0.01)
    assert Posterior.spread(sets, 'c', 0.0) is None
