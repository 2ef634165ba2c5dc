# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""How specimens share parameters, against Bayes' theorem for normal likelihoods."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from fam_bundle_ros.discovery.material import (
    _bayes_factor,
    _log_evidence,
    _relation,
    _sharing,
    Constant,
    constants,
    Relation,
    sharings,
)
from fam_bundle_ros.discovery.priors import own_priors, Prior


def observed(count, size, seed=0):
    """Return what each specimen shows of some numbers, with covariances, and its posterior."""
    rng = np.random.default_rng(seed)
    seen, noise, mean, spread = [], [], [], []
    for _ in range(count):
        root = rng.normal(size=(size, size))
        error = 0.3 * root @ root.T + 0.05 * np.eye(size)
        y = rng.normal(size=size)
        posterior = np.linalg.inv(np.linalg.inv(error) + np.eye(size))
        seen.append(y)
        noise.append(error)
        mean.append(posterior @ np.linalg.solve(error, y))
        spread.append(posterior)
    return np.array(seen), np.array(noise), np.array(mean), np.array(spread)


def log_shared(seen, noise, shared):
    """Return the log density of what is seen where some numbers are one in all specimens."""
    count, size = seen.shape
    one = np.diag([1.0 if k in shared else 0.0 for k in range(size)])
    covariance = (block_diag(*noise) + np.kron(np.ones((count, count)), one)
                  + np.kron(np.eye(count), np.eye(size) - one))
    return multivariate_normal(cov=covariance).logpdf(seen.ravel())


@pytest.mark.parametrize('size', [1, 2, 3])
@pytest.mark.parametrize('count', [2, 5])
def test_the_factor_of_one_value_for_all_is_that_of_the_likelihoods(size, count):
    """From the posteriors alone; and the value is the mean of the posterior of all together."""
    seen, noise, mean, spread = observed(count, size)
    factor, one = _bayes_factor(mean, spread)
    assert factor == pytest.approx(log_shared(seen, noise, range(size))
                                   - log_shared(seen, noise, ()))
    whole = np.linalg.inv(np.sum([np.linalg.inv(c) for c in noise], axis=0) + np.eye(size))
    assert one == pytest.approx(whole @ np.sum(
        [np.linalg.solve(c, y) for c, y in zip(noise, seen)], axis=0))
    assert _bayes_factor(np.zeros((3, 0)), np.zeros((3, 0, 0)))[0] == 0.0


def test_the_evidence_of_a_quadratic_is_its_integral():
    """Under a standard normal, by sums over a fine grid."""
    z = np.linspace(-9.0, 9.0, 200_001)
    precision, pull = 2.5, 1.7
    density = np.exp(-0.5 * precision * z * z + pull * z - 0.5 * z * z) / np.sqrt(2.0 * np.pi)
    value, mean = _log_evidence(np.array([[precision]]), np.array([pull]))
    assert value == pytest.approx(np.log(density.sum() * (z[1] - z[0])))
    assert mean[0] == pytest.approx((z * density).sum() / density.sum())


def test_what_is_shared_is_averaged_over_all_sets():
    """Three parameters, one of them log-normal, in widths of their priors that differ a little."""
    seen, noise, mean, spread = observed(4, 3, seed=3)
    seen[:, 0] = 0.4 + 0.05 * seen[:, 0]  # nearly alike
    mean = np.array([s @ np.linalg.solve(c, y) for s, c, y in zip(spread, noise, seen)])
    kinds, values, width = ('log', 'normal', 'normal'), np.array([2.0, 0.0, 5.0]), 0.7
    fits = [SimpleNamespace(
        priors=[Prior(f'a.{name}', -99.0, 99.0, float(value), width, kind)
                for name, value, kind in zip('xyz', values, kinds)],
        u=u, covariance=each) for u, each in zip(mean, spread)]
    found = _sharing(fits, ('a.x', 'a.y', 'a.z'), list(range(4)))
    sets = [chosen for size in range(4) for chosen in combinations(range(3), size)]
    weight = np.array([_bayes_factor_of(mean, spread, chosen) for chosen in sets])
    assert found.log_factor == pytest.approx(np.log(np.mean(np.exp(weight))))
    share = np.exp(weight) / np.exp(weight).sum()
    for k in range(3):
        assert found.shared[k] == pytest.approx(sum(
            p for p, chosen in zip(share, sets) if k in chosen))
    assert found.x == pytest.approx((np.array([np.log(2.0), 0.0, 5.0]) + width * mean).T)
    assert found.sd == pytest.approx(width * np.sqrt(spread.diagonal(axis1=1, axis2=2)).T)
    for k in range(3):
        best = max((chosen for chosen in sets if k in chosen),
                   key=lambda chosen: weight[sets.index(chosen)])
        pick = np.ix_(range(4), best)
        one = _bayes_factor(mean[pick], np.array([s[np.ix_(best, best)] for s in spread]))[1]
        centre = np.log(2.0) if k == 0 else values[k]
        assert found.one[k] == pytest.approx(centre + width * one[best.index(k)])


def _bayes_factor_of(mean, spread, chosen):
    """Return the log factor of a set, from likelihoods that its posteriors stand for."""
    if not chosen:
        return 0.0
    pick = list(chosen)
    sub = [s[np.ix_(pick, pick)] for s in spread]
    noise = [np.linalg.inv(np.linalg.inv(s) - np.eye(len(pick))) for s in sub]
    seen = np.array([c @ np.linalg.solve(s, m[pick]) for c, s, m in zip(noise, sub, mean)])
    everything = range(len(pick))
    return log_shared(seen, noise, everything) - log_shared(seen, noise, ())


def test_an_effect_is_compared_in_the_specimens_that_have_it(paper_muscle):
    """And not at all if only one has it; errors of sensors never are."""
    priors = {name: Prior(f'{name}.force' if 'friction' in name else f'{name}.bias', 0.0, 9.0,
                          2.0, 0.7, 'log') for name in ('coulomb_friction', 'force_sensor_bias')}
    model = paper_muscle.with_effect('coulomb_friction').with_effect('force_sensor_bias')

    def fit(*names):
        return SimpleNamespace(names=names, model=model, u=np.zeros(len(names)),
                               priors=[priors[name] for name in names],
                               covariance=0.1 * np.eye(len(names)))
    both, none = fit('coulomb_friction', 'force_sensor_bias'), fit('force_sensor_bias')
    found = sharings([none, both, both])
    assert [(each.keys, each.places) for each in found] == [(('coulomb_friction.force',), [1, 2])]
    assert not sharings([none, both, none])


def test_values_of_specimens_are_those_of_their_fits(paper_muscle):
    """In kPa, whatever the kind of the prior: log-normal c10, and c01, which may be zero."""
    priors = own_priors(paper_muscle)[-2:]
    assert [prior.kind for prior in priors] == ['log', 'size']
    fits = [SimpleNamespace(names=('bladder_elasticity',), model=paper_muscle, priors=priors,
                            u=np.array(u), covariance=0.01 * np.eye(2))
            for u in ((0.5, -2.0), (1.5, 1.5), (-0.7, -0.6))]
    found = constants(fits, [{}] * 3, ['a', 'b', 'c'], 20.0)
    assert len(found) == 2
    for k, each in enumerate(found):
        assert each.values == pytest.approx([1e-3 * priors[k].theta(fit.u[k]) for fit in fits])
        assert each.sd == pytest.approx([1e-4 * priors[k].slope(fit.u[k]) for fit in fits])


@pytest.mark.parametrize('power', [-1.0, 0.5, 2.0])
def test_a_parameter_goes_with_the_fact_in_whose_power_it_goes(power):
    """
    Within its errors; a fact that is one number in all, or another law, is not named.

    A specimen without a length does not hide that of the others.
    """
    length = np.array([0.08, 0.127, 0.2, 0.31])
    value = 3.0 * (length / 0.1) ** power
    facts = [{'length': t, 'age': age, 'batch': 7.0}
             for t, age in zip(length, (1.0, 9.0, 2.0, 5.0))]
    x, s = value, 0.02 * value
    found = _relation(x, s, facts)
    assert (found.goes_with, found.power) == ('length', pytest.approx(power))
    low, high = found.interval
    # standard error of the slope of a line
    spread = 0.02 / np.sqrt(np.sum((np.log(length) - np.log(length).mean()) ** 2))
    assert high - low == pytest.approx(2 * 1.96 * spread)
    only = [{key: each[key] for key in ('age', 'batch')} for each in facts]
    assert _relation(x, s, only) == Relation()
    blank = [facts[0], *facts[2:], {'age': 4.0}]
    x, s = np.append(np.delete(x, 1), 99.0), np.append(np.delete(s, 1), 0.02)
    found = _relation(x, s, blank)
    assert (found.goes_with, found.power) == ('length', pytest.approx(power))


def test_a_line_through_two_values_is_no_power_law():
    """Nor is one whose power may be zero."""
    x = np.array([122.9, 63.05, 121.3])
    assert _relation(x, 0.1 * x, [{'length': t} for t in (127.0, 122.0, 127.0)]) == Relation()
    x = np.array([3.0, 3.2, 2.9, 3.3])
    found = _relation(x, 0.1 * x, [{'age': t} for t in (10.0, 100.0, 400.0, 900.0)])
    assert found == Relation()


def test_values_in_the_order_of_a_column_are_said_to_rise_or_fall_with_it():
    """Friction of 1 to 4.2 N after 10 to 900 days is no power law, but it rises with age."""
    x = np.array([1.0, 1.7, 3.0, 4.2])
    facts = [{'age': t, 'batch': b} for t, b in zip((10.0, 100.0, 400.0, 900.0), (3, 1, 2, 4))]
    rises = _relation(x, 0.02 * x, facts)
    assert (rises.ordered, rises.interval) == ({'age': 'rises'}, None)
    assert rises.chance == pytest.approx(2.0 / 24.0)
    assert _relation(1.0 / x, 0.02 / x, facts).ordered == {'age': 'falls'}


def test_a_constant_is_told_with_what_it_is():
    """One number in all, what it goes with, neither, or undecided by the odds of the user."""
    def told(**changes):
        return str(Constant(**{
            'key': 'a.b', 'unit': 'mm', 'specimens': ['x', 'y'], 'values': [1.0, 2.0],
            'sd': [0.1, 0.1], 'shared': 0.01, 'value': 1.5, 'odds': 20.0, **changes}))
    assert told(shared=0.97) == (
        'a.b is 1.5 mm in all (probability 0.97): a constant of the material')
    assert told(relation=Relation('length', 1.0, (0.8, 1.2))) == (
        'a.b goes with length (power 1, 0.8 to 1.2: 1, 2 mm): not a constant of the material')
    assert told(relation=Relation(ordered={'age': 'rises'}, chance=1 / 12)) == (
        'a.b rises with age, but not as a power law (1, 2 mm; 1 of 12 orders would)')
    assert told() == 'a.b differs (1, 2 mm) and depends on no column of the table'
    for shared in (0.55, 0.94, 0.06):
        assert told(shared=shared).startswith('a.b is undecided: one value in all has a')
    assert 'a constant of the material' in told(shared=0.6, odds=1.4)
