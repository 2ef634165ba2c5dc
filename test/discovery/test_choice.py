# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A thick muscle at two strains only: what is said of the strains between them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import add_effect, Choices, compare, diagnose
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.choice import (
    best_of_ties,
    likelier_than_not,
    mean_square_distance,
    plainest,
    within_standard_error,
)
from fam_bundle_ros.discovery.held_out import squares_of_folds
from fam_bundle_ros.discovery.options import Options, usual
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit


@pytest.fixture(scope='module')
def thick():
    """Return an ideal muscle of 20 mm."""
    geometry = Geometry(10e-3, 0.225, np.radians(28.5), 1.8e-3)
    return Bundle('thick', [MotorUnit('mu1', 1, geometry, 700e3)], [catalogue.get('mesh')()])


@pytest.fixture(scope='module')
def measured(thick):
    """Return a function that measures a sheathed one at some strains, 8 % off in a wave."""
    truth = thick.with_effect('saturating_sheath', size=200.0, width=0.03).with_effect(
        'threshold_pressure', pressure=60e3)

    def at(*strains):
        rng = np.random.default_rng(0)
        pressure = np.tile(np.linspace(20e3, 600e3, 60), len(strains))
        strain = np.repeat(strains, 60)
        force = truth.force(strain, pressure[:, None]) * (1.0 + 0.08 * np.sin(pressure / 120e3))
        noise = 1.5 * rng.standard_normal(len(force))
        return build('isobars', strain, pressure, np.maximum(force - 5.0 + noise, 0.0))
    return at


@pytest.fixture(scope='module')
def search(thick, measured):
    """Return the search for what the muscle lacks at two strains."""
    cells, choices = reduce(thick, measured(0.0, 0.07)), Choices()
    return Search(Options.of(thick, cells, choices)).run()


def test_between_two_strains_a_thick_muscle_is_as_a_usual_one(thick, measured):
    """Two strains fit any shape: a polynomial is off three times as far between them as ours."""
    between, train = measured(0.03), measured(0.0, 0.07)
    result = diagnose(thick, train)
    assert result.verdict in ('missing_effect', 'partial')
    strange = add_effect(thick, ['threshold_pressure', 'bladder_polynomial'], train).model
    for model in (result.best, result.recommended.model):
        assert 3.0 * compare(model, between).error_N < compare(strange, between).error_N


def test_usual_forces_go_with_the_section(thick, paper_muscle):
    """Materials are alike: newtons go with the radius squared, pressures and lengths do not."""
    for name in ('saturating_sheath', 'coulomb_friction', 'end_caps', 'bladder_elasticity'):
        law = catalogue.get(name)
        plain, same, other = law(), usual(law, paper_muscle), usual(law, thick)
        for parameter in law.parameters:
            value = plain.values[parameter.name]
            assert same.values[parameter.name] == pytest.approx(value)
            grown = (10.0 / 6.35) ** 2 if parameter.unit == 'N' else 1.0
            assert other.values[parameter.name] == pytest.approx(grown * value)
    huge = thick.with_parameters({'geometry.radius': 0.2})
    assert usual(catalogue.get('saturating_sheath'), huge).size == 2000.0


def test_of_models_that_disagree_the_middle_one_is_nearest_to_all(search, thick):
    """Alike at the strains of the cells: by weight the mean square to all is least in between."""
    soft, middle, hard = (thick.with_effect('saturating_sheath', size=size, width=0.03)
                          for size in (50.0, 100.0, 150.0))
    away = mean_square_distance(search.fitter.cells, [soft, middle, hard], np.full(3, 1 / 3))
    assert away[1] < away[0] == pytest.approx(away[2])
    assert away[0] == pytest.approx(2.5 * away[1])
    sure = mean_square_distance(search.fitter.cells, [soft, middle, hard], np.array([0, 0, 1.0]))
    assert sure[2] == 0.0
    assert sure[0] == pytest.approx(4.0 * sure[1])


def test_a_shape_that_is_far_from_all_others_between_the_strains_is_not_chosen(search):
    """On isobars a polynomial is as good as any; the others agree, and it is not with them."""
    fit = search.fit(('bladder_polynomial', 'mesh', 'tendon_slack', 'threshold_pressure'))
    found = search.options.changes(fit.names)
    chosen, kept = best_of_ties(search, fit, found, {})
    assert 'bladder_polynomial' not in chosen.names
    assert {change.name for change in kept} <= set(chosen.names)
    squares = [squares_of_folds(search.fitter, search.fitter.without_discrepancy(each))
               for each in (fit, chosen)]
    assert within_standard_error(squares[0], squares[1])


@pytest.mark.parametrize('unit', [1e-4, 1.0, 1e4])
def test_folds_are_as_good_within_a_standard_error_in_any_unit(unit):
    """On average no more behind than the mean of so many differences is in doubt."""
    rng = np.random.default_rng(0)
    best, spread = rng.uniform(1.0, 2.0, 8), rng.normal(size=8)
    spread = (spread - spread.mean()) / spread.std(ddof=1)
    for behind in (0.8, 1.2):
        worse = best + 0.1 * (spread + behind / np.sqrt(8))
        assert within_standard_error(unit * worse, unit * best) == (behind < 1.0)
    assert within_standard_error(unit * best, unit * best)
    assert not within_standard_error(unit * best[:1] + unit, unit * best[:1])


def test_smaller_sets_are_fitted_again_from_those_that_beat_them():
    """Each once, from the best that it is part of; none from a set that is not as good."""
    def fitted(names, posterior):
        return SimpleNamespace(names=names, posterior=posterior, start=names, hyper=None)
    fits = {names: fitted(names, posterior) for names, posterior in (
        ('ab', 10.0), ('a', 9.0), ('b', 11.0), ('bc', 8.0), ('', 0.0), ('cd', -20.0),
        ('c', -30.0))}
    again = []
    Search._settle(SimpleNamespace(
        fits=fits, best=fits['b'], again=lambda names, start, hyper: again.append((names, start)),
        options=SimpleNamespace(choices=Choices(odds=np.exp(5.0)),
                                back=lambda names: [names.replace(name, '') for name in names])))
    assert again == [('', 'b'), ('a', 'ab'), ('c', 'bc')]


def test_of_what_is_as_probable_as_nothing_the_effect_that_explains_all_alone_is_believed(
        paper_muscle, sweeps):
    """A small friction: none has half of the posterior, and warming up leaves all of it."""
    data = sweeps(paper_muscle.with_effect('coulomb_friction', force=3.0), cycles=1)
    cells, choices = reduce(paper_muscle, data), Choices()
    search = Search(Options.of(paper_muscle, cells, choices))
    own = search.options.own
    worth = {own: 0.0, tuple(sorted((*own, 'temperature'))): -0.4,
             tuple(sorted((*own, 'coulomb_friction'))): -0.5}
    for names, log in worth.items():
        fit = search.fit(names)
        search.fits[names] = replace(fit, evidence=log - fit.log_prior)
    fit, found = likelier_than_not(search, search.null, [])
    assert [change.label for change in found] == ['coulomb_friction']
    # as long as it is likelier than not that something is missing
    search.fits[own] = replace(search.fits[own], evidence=0.6 - search.fits[own].log_prior)
    assert likelier_than_not(search, search.fits[own], []) == (search.fits[own], [])
    del search.fits[fit.names]
    assert likelier_than_not(search, search.null, []) == (search.null, [])


@pytest.mark.parametrize(('rise', 'told'), [(0.0, 'coulomb_friction'), (2.0, 'stribeck_friction')])
def test_a_shape_is_told_for_what_the_data_say_of_its_parameters(paper_muscle, sweeps, rise, told):
    """
    Friction at one speed has no rise to tell, at two it has.

    The shape that has one is as probable there: a parameter that nothing moves costs nothing.
    """
    truth = paper_muscle.with_effect('stribeck_friction', force=3.0, rise=rise, speed=0.02)
    data = sweeps(truth, cycles=1, speed=0.1)
    if rise:
        slow = sweeps(truth, cycles=1, speed=0.01)
        data = build('both', *(np.concatenate([getattr(each, name) for each in (data, slow)])
                               for name in ('strain', 'pressure', 'force')),
                     np.concatenate([data.trial, 10 + slow.trial]),
                     np.concatenate([data.time, 1e3 + slow.time]))
    cells, choices = reduce(paper_muscle, data), Choices()
    search = Search(Options.of(paper_muscle, cells, choices))
    plain, more = (search.fit(tuple(sorted((*search.options.own, name))))
                   for name in ('coulomb_friction', 'stribeck_friction'))
    assert rise or abs(plain.posterior - more.posterior) < np.log(choices.odds)
    chosen, found = plainest(search, more, search.options.changes(more.names))
    assert [change.new for change in found] == [told]
    assert told in chosen.names
    assert plainest(search, plain, search.options.changes(plain.names))[0] is plain
