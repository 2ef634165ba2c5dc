# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is left, what is doubted and what earns a name, on fits that are made up."""

from dataclasses import replace
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.noise import noise_floor
from fam_bundle_ros.discovery import choice
from fam_bundle_ros.discovery import verdict as verdicts
from fam_bundle_ros.discovery.artefacts import Artefact
from fam_bundle_ros.discovery.cells import negligible, reduce
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.diagnose import Searched
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.held_out import folds, HeldOut
from fam_bundle_ros.discovery.options import Change, Options
from fam_bundle_ros.discovery.posterior import named, Posterior
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.settings import Choices, LEAST_LOSS
from fam_bundle_ros.discovery.verdict import (
    _effect_of_pressure,
    _explained,
    _refusals,
    _undetermined,
    _warnings,
    _worse_rows,
    implausible_constants,
    is_needed,
    judge,
    remaining_discrepancy,
)

GOOD = HeldOut(1.0, 1.0, {'mean': 9.0, 'plane': 5.0, 'empirical': 2.0}, {})


def test_what_is_not_predicted_is_not_determined(make_sweeps, paper_muscle):
    """Each kind of folds whose error is not negligible is a caution, the others are none."""
    cells = reduce(paper_muscle, make_sweeps(cycles=1))
    cells = replace(cells, variance=np.zeros(len(cells)))
    limit = negligible(cells)
    held = replace(GOOD, kinds={'isobar': (0.9 * limit, 0.1), 'strain': (1.1 * limit, 0.1)})
    words, = _undetermined(held, cells, leaving(0.0, cells))
    assert words.startswith('held-out inner strain levels are predicted with an error of ')


def test_an_error_that_is_mostly_noise_was_predicted(make_sweeps, paper_muscle):
    """Held-out rows have their noise: only the error beyond it says something on the effects."""
    noisy = replace(reduce(paper_muscle, make_sweeps(cycles=1)), noise=10.0)
    noisy = replace(noisy, variance=100.0 / noisy.count)
    scatter = np.sqrt(np.average(noisy.variance, weights=noisy.count))
    for beyond, told in ((0.8, 0), (1.2, 1)):
        error = np.hypot(scatter, beyond * negligible(noisy))
        held = replace(GOOD, kinds={'isobar': (error, 0.1)})
        assert len(_undetermined(held, noisy, leaving(0.0, noisy))) == told


def test_an_error_that_the_fit_leaves_too_is_not_one_of_the_folds(make_sweeps, paper_muscle):
    """Effects of a wrong shape have the same error on all data: more trials would not help."""
    cells = reduce(paper_muscle, make_sweeps(cycles=1))
    left = 5.0 * negligible(cells)
    held = replace(GOOD, kinds={'trial': (1.01 * left, 0.1)})
    assert _undetermined(held, cells, leaving(0.0, cells))
    assert not _undetermined(held, cells, leaving(left, cells))


def leaving(error, cells):
    """Return a fit that leaves the same error in each cell, N."""
    return SimpleNamespace(residual=np.full(len(cells), error))


@pytest.fixture(scope='module')
def search(make_sweeps, paper_muscle):
    """Return a search in which sets have the log posteriors that a test writes down."""
    cells = reduce(paper_muscle, make_sweeps(), most=60)
    fitter = Fitter(Covariance(cells, 0.01))
    options = Options.of(paper_muscle, cells, Choices())
    one = fitter.fit(options.own, paper_muscle, options.priors(options.own))

    def of(**posteriors):
        fits = {}
        for added, value in posteriors.items():
            names = tuple(sorted({*options.own, *added.split('__')} - {'nothing'}))
            fits[names] = replace(one, names=names, evidence=value, log_prior=0.0)
        null = fits[options.own]
        return SimpleNamespace(options=options, fits=fits, null=null, fitter=fitter,
                               fit=lambda names, *start: fits[names],
                               best=max(fits.values(), key=lambda fit: fit.posterior))
    return of


def test_what_effects_explain_alone_is_not_left_to_a_discrepancy(search):
    """However much of it the discrepancy takes where both are fitted together."""
    made = search(nothing=0.0)
    wave = 20.0 * np.sin(30.0 * made.fitter.cells.strain)
    joint = replace(made.null, hyper=Hyper(even=12, strain=3, pressure=1), residual=wave)
    alone = replace(made.null, residual=0.1 * wave)
    covariance = made.fitter.covariance
    assert remaining_discrepancy(covariance, joint, joint).total > 10.0
    assert remaining_discrepancy(covariance, joint, alone).total == pytest.approx(
        np.sqrt(np.mean(alone.residual ** 2)))
    # and as the mean over rows, to be printed beside errors of rows
    assert remaining_discrepancy(covariance, joint, alone).of_rows == pytest.approx(
        np.sqrt(np.average(alone.residual ** 2, weights=made.fitter.cells.count)))
    # what stood beside it is told all the same
    assert remaining_discrepancy(covariance, joint, alone).beside > 10.0
    # nothing is explained by a muscle of half the radius
    other = replace(alone, u=np.where([p.key == 'geometry.radius' for p in alone.priors], -12.0,
                                      alone.u))
    assert remaining_discrepancy(covariance, joint, other).total > 10.0


@pytest.mark.parametrize(('u', 'doubted'), [(0.0, False), (1.0, False), (4.0, True)])
def test_a_size_at_its_upper_bound_is_doubted_and_one_that_is_off_is_not(search, u, doubted):
    """Zero switches an effect off; the largest size that is possible is no measurement."""
    prior = Prior('pressure_creep.share', 0.0, 4.0, 0.0, 1.0, 'half')
    fit = replace(search(nothing=0.0).null, priors=(prior,), u=np.array([u]))
    assert any('bound' in words for words in _warnings(fit, GOOD)) == doubted


@pytest.mark.parametrize(('own', 'u', 'doubted'), [
    (True, 2.9, False), (True, -3.1, True), (False, 2.9, False), (False, 3.1, True)])
def test_a_constant_far_from_its_usual_value_is_a_caution(search, own, u, doubted):
    """Of the model's own effects, and of one that is added: rubber is not 100 K warmer."""
    prior = Prior('bladder_elasticity.c10', 1.0, 1e9, 1e5, 0.5, 'log', own)
    fit = replace(search(nothing=0.0).null, priors=(prior,), u=np.array([u]))
    assert any('widths' in words for words in _warnings(fit, GOOD)) == doubted


@pytest.mark.parametrize(('inclusion', 'ratio'), [(0.5, 1.0), (0.9, 9.0), (0.1, 1.0 / 9.0)])
def test_structure_needs_the_evidence_that_its_prior_odds_leave(inclusion, ratio):
    """At odds of nine to one it needs a ninth of the Bayes factor that it needs at even odds."""
    least = LEAST_LOSS - np.log(ratio)
    assert is_needed(least + 0.01, inclusion)
    assert not is_needed(least - 0.01, inclusion)


def test_a_set_keeps_only_what_earns_a_name(search):
    """Of three effects the one that brings one log unit goes, wherever the search found it."""
    made = search(nothing=0.0, end_caps=300.0, coulomb_friction=40.0,
                  coulomb_friction__end_caps=400.0,
                  coulomb_friction__end_caps__force_sensor_gain=401.0,
                  end_caps__force_sensor_gain=300.5, coulomb_friction__force_sensor_gain=41.0)
    fit, kept, worth = named(made, made.best)
    assert [str(change) for change in kept] == ['end_caps', 'coulomb_friction']
    assert worth == {'end_caps': 360.0, 'coulomb_friction': 100.0}


def test_folds_choose_among_ties_but_add_nothing_to_them(search, monkeypatch):
    """A set as probable as the best one whose last effect earns nothing is no better answer."""
    made = search(nothing=0.0, end_caps=300.0, end_caps__force_sensor_gain=298.5,
                  force_sensor_gain=1.0)
    chosen, found, worth = named(made, made.best)
    monkeypatch.setattr(choice, 'negligible', lambda cells: 0.0)
    monkeypatch.setattr(choice, 'squares_of_folds', lambda fitter, fit: np.array(
        [9.0, 9.1] if len(fit.names) < 4 else [1.0, 1.1]))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    best, _ = choice.best_of_ties(made, chosen, found, worth)
    assert best.names == chosen.names


@pytest.mark.parametrize(('structured', 'told'), [(True, 'coulomb_friction'),
                                                  (False, 'end_caps')])
def test_folds_choose_where_structure_shows_however_small_beside_the_force(
        search, monkeypatch, structured, told):
    """A bundle of 300 N whose push-back of 2 N has the wrong shape is not done to 1 %."""
    made = search(nothing=0.0, end_caps=300.0, coulomb_friction=299.5)
    monkeypatch.setattr(choice, 'negligible', lambda cells: 1e9)
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    monkeypatch.setattr(choice, 'squares_of_folds', lambda fitter, fit: np.array(
        [1.0, 1.1] if 'coulomb_friction' in fit.names else [9.0, 9.1]))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    best, _ = choice.best_of_ties(made, made.best, made.options.changes(made.best.names), {})
    assert told in best.names


def test_of_sets_as_good_as_each_other_the_one_of_likelier_effects_is_told(
        search, monkeypatch):
    """An effect of 0.4 was named that could not be told from one of 0.6, which has two shapes."""
    made = search(nothing=0.0, force_sensor_gain=300.0, end_caps=299.9, tondu_factor=299.8)
    monkeypatch.setattr(choice, 'folds_tell', lambda *given: True)
    monkeypatch.setattr(choice.Posterior, 'over_folds', lambda made, *given: Posterior.of(made))
    monkeypatch.setattr(choice, 'squares_of_folds', lambda *given: np.ones(4))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    best, _ = choice.best_of_ties(made, made.best, made.options.changes(made.best.names), {})
    assert 'end_caps' in best.names


def test_a_set_that_fails_on_one_fold_is_not_as_good_as_one_that_is_hardly_worse_on_all(
        search, monkeypatch):
    """Differences to the best set scatter most where one fold is far off: that excuses nothing."""
    squares = {'end_caps': [1.05, 2.05, 1.05, 2.05], 'coulomb_friction': [1.0, 2.0, 1.0, 8.0],
               'force_sensor_gain': [1.0, 2.0, 1.0, 2.0]}
    made = search(nothing=0.0, end_caps=300.0, coulomb_friction=299.5, force_sensor_gain=299.0)
    monkeypatch.setattr(choice, 'folds_tell', lambda *given: True)
    monkeypatch.setattr(choice, 'squares_of_folds', lambda fitter, fit: np.array(
        next(values for name, values in squares.items() if name in fit.names)))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    best, _ = choice.best_of_ties(made, made.best, made.options.changes(made.best.names), {})
    assert 'end_caps' in best.names


@pytest.mark.parametrize(('dead', 'worse', 'told'), [
    ({'stribeck_friction': 2, 'coulomb_friction': 0}, 0.0, 'coulomb_friction'),
    ({'stribeck_friction': 2, 'coulomb_friction': 0}, 0.6, 'stribeck_friction'),
    ({'stribeck_friction': 1, 'coulomb_friction': 1}, 0.0, 'stribeck_friction'),
    ({'stribeck_friction': 0, 'coulomb_friction': 0}, 0.0, 'stribeck_friction')])
def test_down_to_the_noise_the_plainest_of_equally_probable_shapes_is_told(
        search, monkeypatch, dead, worse, told):
    """With fewer dead parameters, and an error on folds that noise (1 N a row) could hide."""
    made = search(nothing=0.0, end_caps__stribeck_friction=30.0, coulomb_friction__end_caps=29.0)
    priors = {name: tuple(Prior(f'{name}.{k}', 0.0, 1.0, 0.5, 1.0, 'log') for k in range(count))
              for name, count in (('stribeck_friction', 4), ('coulomb_friction', 2))}
    shape = {names: name for names in made.fits for name in priors if name in names}
    for names, name in shape.items():
        made.fits[names] = replace(made.fits[names], priors=priors[name])
    made.best = made.fits[made.best.names]
    made.fitter = SimpleNamespace(cells=replace(made.fitter.cells, noise=1.0), covariance=None,
                                  without_discrepancy=lambda fit: fit)
    for name, value in (
            ('folds_tell', lambda *given: False),
            ('is_dead', lambda fit: np.arange(len(fit.priors)) < dead[shape[fit.names]]),
            ('held_out_physics', lambda fitter, fit: 1.0 + worse * (
                'coulomb_friction' in fit.names))):
        monkeypatch.setattr(choice, name, value)
    found = made.options.changes(made.best.names)[::-1]  # not in the order of the alphabet
    chosen, kept = choice.best_of_ties(made, made.best, found, {})
    assert [change.new for change in kept] == [told, 'end_caps']
    assert told in chosen.names


def test_a_shape_with_more_parameters_is_not_plainer(search, monkeypatch):
    """However well the data determine each of them."""
    made = search(nothing=0.0, stribeck_friction=29.0, coulomb_friction=30.0)
    more = next(fit for names, fit in made.fits.items() if 'stribeck_friction' in names)
    made.fits[more.names] = replace(more, priors=(*more.priors, more.priors[0]))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    monkeypatch.setattr(choice, '_dead', lambda fit, found: int('coulomb_friction' in fit.names))
    monkeypatch.setattr(choice, 'held_out_physics', lambda fitter, fit: 1.0)
    found = made.options.changes(made.best.names)
    assert choice.plainest(made, made.best, found) == (made.best, found)


def trades(made, odds):
    """Return the trades of the best set in words, and what is tied one for one."""
    posterior = Posterior.of(made)
    tied = posterior.ties(made.options.changes(made.best.names), made.best, odds)
    return [str(trade) for trade in posterior.trades(made.best, odds, tied)], tied


def test_two_effects_that_do_as_well_as_two_others_are_a_trade(search):
    """Neither is tied with one of the others: they go together, within the odds only."""
    made = search(nothing=0.0, end_caps__coulomb_friction=9.0,
                  threshold_pressure__viscous_damping=7.0)
    assert trades(made, 20.0) == (['coulomb_friction with end_caps and threshold_pressure with '
                                   'viscous_damping'], [])
    assert trades(made, 2.0) == ([], [])


def test_a_trade_leaves_out_what_ties_by_itself(search):
    """Friction of two kinds ties; what is left of the other set takes the place of the rest."""
    made = search(nothing=0.0, coulomb_friction__end_caps__force_sensor_gain=9.0,
                  end_caps__force_sensor_gain__viscous_damping=8.5,
                  threshold_pressure__viscous_damping=8.0)
    assert trades(made, 20.0) == (['end_caps with force_sensor_gain and threshold_pressure'],
                                  [('coulomb_friction', 'viscous_damping')])


def test_another_shape_may_need_a_further_effect(search):
    """The shape by itself is no trade, an effect more than the answer needs is none either."""
    made = search(nothing=0.0, end_caps=9.0, end_caps__threshold_pressure=8.0)
    assert trades(made, 20.0) == ([], [])
    made = search(nothing=0.0, end_caps=9.0, saturating_sheath__tondu_factor=8.0)
    assert trades(made, 20.0) == (['end_caps and saturating_sheath with tondu_factor'], [])
    made = search(nothing=0.0, end_caps=9.0, tondu_factor=8.5,
                  saturating_sheath__tondu_factor=8.0)
    assert trades(made, 20.0) == ([], [])


def test_what_wins_without_one_fold_is_tied_and_averaged(search, monkeypatch):
    """Kinds of folds weigh alike, however many there are of each; outside them nothing moves."""
    made = search(nothing=0.0, end_caps=30.0, strain_sensor_offset=20.0, threshold_pressure=18.0)
    every = list(folds(made.fitter.cells))
    count = {kind: sum(each == kind for each, *_ in every) for kind, *_ in every}
    gone = [test for kind, _, test in every if kind == 'strain'][0]
    assert len(count) > 1

    def evidence(fitter, fit):
        lost = np.array_equal(fitter.covariance._noise > 1e6, gone)
        return fit.evidence + 40.0 * (lost and 'strain_sensor_offset' in fit.names)

    monkeypatch.setattr(Fitter, 'evidence_of', evidence)
    posterior = Posterior.over_folds(made, made.best)
    weights = {set_[0].label if set_ else '': weight for set_, weight in zip(
        posterior._changes, posterior.weights)}
    share = 1.0 / count['strain'] / len(count)
    assert weights['strain_sensor_offset'] == pytest.approx(share, rel=1e-3)
    assert weights['end_caps'] == pytest.approx(1.0 - share, rel=1e-3)
    end_caps = [Change('', 'end_caps')]
    assert posterior.ties(end_caps, made.best, 2.0 / share) == [
        ('end_caps', 'strain_sensor_offset')]
    assert posterior.ties(end_caps, made.best, 0.5 / share) == []
    assert Posterior.of(made).ties(end_caps, made.best, 2.0 / share) == []


@pytest.mark.parametrize(('alone', 'tied'), [
    (29.0, []), (20.0, [('viscous_damping', 'tendon_slack')])])
def test_an_effect_ties_only_if_it_does_what_the_other_does(search, alone, tied):
    """A discrepancy does as well as damping; slack beside it adds nothing and is no rival."""
    made = search(nothing=0.0, end_caps=alone, end_caps__viscous_damping=30.0,
                  end_caps__tendon_slack=28.5)
    chosen, posterior = made.best, Posterior.of(made)
    ties = posterior.ties([Change('', 'viscous_damping')], chosen, 20.0)
    assert ties == tied
    assert posterior.trades(chosen, 20.0, ties) == []


@pytest.mark.parametrize(('blind', 'refused'), [(0.9, True), (1.2, False)])
def test_effects_that_predict_no_better_than_without_the_pressure_are_refused(search, blind,
                                                                              refused):
    """Where the pressure should matter: a force that does not depend on it is no muscle's."""
    made = search(nothing=0.0)
    worth = _effect_of_pressure(made.fitter, made.null)
    assert worth > 10.0
    said = _refusals(made.null, replace(GOOD, blind=blind), worth)
    assert any('pressure' in words for words in said) == refused
    assert not _refusals(made.null, replace(GOOD, blind=blind), 0.1)


@pytest.mark.parametrize(('structured', 'names'), [(True, ['coulomb_friction']), (False, [])])
def test_an_effect_likelier_than_not_is_named_where_something_must_be(search, monkeypatch,
                                                                      structured, names):
    """A smooth discrepancy that is nearly as probable is a reason for doubt, not for silence."""
    made = search(nothing=0.0, coulomb_friction=1.5, coulomb_friction__end_caps=0.5,
                  end_caps=-2.0)
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    assert [str(change) for change in choice.likelier_than_not(made, made.null, [])[1]] == names


@pytest.mark.parametrize(('structured', 'names'), [
    (True, ['end_caps', 'viscous_damping']), (False, ['end_caps'])])
def test_beside_what_has_evidence_an_effect_likelier_than_not_is_named_with_a_doubt(
        search, monkeypatch, structured, names):
    """As damping at three speeds, which a smooth function of the speed follows as well."""
    made = search(nothing=0.0, end_caps=30.0, end_caps__viscous_damping=31.5,
                  viscous_damping=1.0, coulomb_friction__end_caps=29.0)
    alone = next(fit for fit in made.fits.values() if fit.posterior == 30.0)
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    fit, found = choice.likelier_than_not(made, alone, [Change('', 'end_caps')])
    assert [str(change) for change in found] == names
    said = judge(made, made.null, fit, fit, found, GOOD, (), True).warnings
    doubt = 'a smooth discrepancy in place of viscous_damping is nearly as probable (odds of 4.5 '
    assert any(words.startswith(doubt) for words in said) == structured


@pytest.mark.parametrize(('structured', 'kept'), [(True, []), (False, ['coulomb_friction'])])
def test_where_structure_is_left_an_effect_must_predict_better(search, monkeypatch, structured,
                                                                kept):
    """Better by more than the folds scatter; down to the noise any gain there will do."""
    made = search(nothing=0.0, coulomb_friction=30.0)
    better = replace(made.best, residual=made.best.residual + 1.0)
    off = {made.null.names: [9.0, 4.0], better.names: [8.0, 4.1]}
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    monkeypatch.setattr(choice, 'held_out', lambda fitter, physics, joint: replace(
        GOOD, physics=sum(off[physics.names]), squares=np.array(off[physics.names])))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    found = [Change('', 'coulomb_friction')]
    assert [str(change) for change in choice.drop_unpredictive(
        made, better, found, better)[1]] == kept
    off[made.null.names] = [12.0, 8.0]
    assert choice.drop_unpredictive(made, better, found, better)[1] == found
    off[made.null.names] = [8.0, 4.0]  # as well without it: no name, the last one neither
    assert choice.drop_unpredictive(made, better, found, better)[1] == []
    sure = replace(better, white_evidence=made.null.white_posterior + 9.0)
    assert [str(change) for change in choice.drop_unpredictive(
        made, sure, found, sure)[1]] == kept
    # the discrepancy made the evidence: alone the effect changes the force by too little to see
    off[made.null.names] = [12.0, 8.0]
    for sd, seen in ((0.1, False), (1.0, True)):
        step = sd * np.sqrt(made.fitter.cells.variance)
        for gain, stays in ((-1.0, seen), (1.0, True)):
            small = replace(made.best, residual=made.null.residual + step)
            small = replace(small, white_evidence=small.white_evidence + gain
                            + made.null.white_posterior - small.white_posterior)
            assert choice.drop_unpredictive(made, small, found, small)[1] == found * stays


@pytest.mark.parametrize('structured', [True, False])
def test_effects_that_need_each_other_must_predict_better_than_none(search, monkeypatch,
                                                                    structured):
    """Each takes back what the other does: without either the error grows, without both less."""
    made = search(nothing=0.0, coulomb_friction=10.0, end_caps=9.0,
                  coulomb_friction__end_caps=30.0)
    off = {made.null.names: [5.0, 4.0], made.best.names: [8.0, 7.0]}
    monkeypatch.setattr(choice, '_is_seen', lambda *given: True)
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    monkeypatch.setattr(choice, 'held_out', lambda fitter, physics, joint: replace(
        GOOD, physics=sum(off.get(physics.names, [99.0])),
        squares=np.array(off.get(physics.names, [50.0, 49.0]))))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    found = made.options.changes(made.best.names)
    assert len(found) == 2
    kept = choice.drop_unpredictive(made, made.best, found, made.best)
    assert kept[1] == ([] if structured else found)
    assert kept[0].names == (made.null if structured else made.best).names


@pytest.mark.parametrize(('structured', 'angle', 'alone', 'kept'), [
    (True, 0.0, False, ['coulomb_friction']), (False, 0.0, False, None), (True, 4.0, False, None),
    (True, 0.0, True, None)], ids=['beside structure', 'no structure', 'no muscle', 'the last'])
def test_beside_a_bent_law_others_are_named(search, monkeypatch, structured, angle, alone, kept):
    """The law goes and the rest stays; where dimensions are off too the verdict refuses all."""
    both = 'end_caps' if alone else 'coulomb_friction__end_caps'
    made = search(nothing=0.0, coulomb_friction=10.0, **{'end_caps': 0.0, both: 30.0})
    fit = replace(made.best, u=np.array([4.0, angle]), priors=(
        Prior('end_caps.dead_length', 1e-3, 1e3, 1.0, 1.2, 'log'),
        Prior('geometry.braid_angle', 0.1, 1.0, 0.5, 0.02, 'normal')))
    monkeypatch.setattr(choice, '_is_seen', lambda *given: True)
    monkeypatch.setattr(choice, 'leaves_structure', lambda *given: structured)
    monkeypatch.setattr(choice, 'held_out', lambda fitter, _, other: replace(
        GOOD, physics=1.0 if other is fit else 9.0, squares=np.full(
            2, 1.0 if other is fit else 9.0 if other is not made.null else 30.0)))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda other: other)
    found = made.options.changes(made.best.names)[::-1]  # the bent one is worth more
    named_ = choice.drop_unpredictive(made, fit, found, fit)[1]
    assert [str(change) for change in named_] == (kept or [str(change) for change in found])


@pytest.mark.parametrize(('key', 'u', 'said'), [
    ('bladder_polynomial.k2', -3.5, True), ('bladder_polynomial.k2', 1.7, False),
    ('geometry.radius', 3.5, False)])
def test_a_law_bent_beyond_its_prior_to_what_it_is_not_is_refused(search, key, u, said):
    """A value that the prior all but excludes; dimensions are tolerances, which are told."""
    fit = replace(search(nothing=0.0).null, priors=(Prior(key, -1e3, 1e3, 0.0, 1.0, 'normal'),),
                  u=np.array([u]))
    assert bool(implausible_constants(fit)) == said
    off = Prior('end_caps.dead_length', 0.0, 1.0, 0.1, 0.2, 'log')
    assert not implausible_constants(replace(fit, priors=(off,), u=np.array([off.limits[0]])))


@pytest.mark.parametrize(('likely', 'open_'), [(True, True), (False, False)])
def test_evidence_for_what_predicts_nothing_is_no_clean_bill(search, likely, open_):
    """The effects are not named, nor is it said that none is missing."""
    made = search(nothing=0.0)
    null = replace(made.null, hyper=Hyper(white=1), residual=0.0 * made.null.residual)
    made.null = null
    finding = judge(made, null, null, null, [], GOOD, [], likely)
    assert (finding.verdict == 'unexplained') == open_


@pytest.mark.parametrize(('need', 'share', 'faint', 'verdict'), [
    (50.0, 0.4, True, 'adequate'), (50.0, 0.6, False, 'unexplained'),
    (2.0, 0.4, False, 'adequate')])
def test_a_shape_within_the_noise_of_a_row_is_told_and_no_more(search, monkeypatch, need, share,
                                                               faint, verdict):
    """Where the evidence is sure of it; a visible one is unexplained."""
    made = search(nothing=0.0)
    size = share * made.fitter.cells.noise
    monkeypatch.setattr(verdicts, 'evidence_of_structure', lambda fitter, fit: need)
    monkeypatch.setattr(verdicts, 'remaining_discrepancy',
                        lambda *given: verdicts.Left(size, 0.0, size))
    monkeypatch.setattr(verdicts, '_needs_recalibration', lambda *given: False)
    null = replace(made.null, hyper=Hyper(white=1), residual=0.0 * made.null.residual)
    made.null = null
    finding = judge(made, null, null, null, [], GOOD, [], False)
    assert (finding.verdict, finding.faint) == (verdict, size if faint else 0.0)


@pytest.mark.parametrize(('structured', 'verdict'), [(True, 'unexplained'), (False, 'partial')])
def test_a_bent_law_is_an_answer_only_down_to_the_noise(search, monkeypatch, structured, verdict):
    """What fits all there is may have an unusual value; with a drift beside it, it is partial."""
    made = search(nothing=0.0)
    prior = Prior('bladder_polynomial.k2', -1e3, 1e3, 0.0, 1.0, 'normal')
    fit = replace(made.null, hyper=Hyper(white=1), residual=0.0 * made.null.residual,
                  priors=(prior,), u=np.array([4.0]), slopes=made.null.slopes[:, :1])
    base = replace(made.null, residual=20.0 * np.sin(30.0 * made.fitter.cells.strain))
    monkeypatch.setattr(verdicts, 'is_needed', lambda *given: structured)
    monkeypatch.setattr(verdicts, '_is_visible', lambda *given: structured)
    made.null = base
    finding = judge(made, base, fit, fit, [Change('', 'bladder_polynomial')], GOOD,
                    [Artefact('the load cell drifts', 'vent and tare it')], likely=True)
    assert finding.verdict == verdict
    assert any('widths of its prior' in words for words in finding.refusals) == structured


@pytest.mark.parametrize(('drifts', 'share', 'verdict'), [
    (True, 0.9, 'unexplained'), (True, 0.5, 'partial'), (False, 0.9, 'missing_effect')])
def test_an_effect_smaller_than_the_drift_beside_it_explains_nothing(search, drifts, share,
                                                                     verdict):
    """Drift and vibration are no part of the discrepancy, but part of what is not explained."""
    made = search(nothing=0.0, end_caps=30.0)
    base = replace(made.null, residual=20.0 * np.sin(30.0 * made.fitter.cells.strain))
    fit = replace(made.best, hyper=Hyper(white=0), residual=share * base.residual)
    finding = judge(made, base, fit, fit, [Change('', 'end_caps')], GOOD,
                    [Artefact('the force swings', 'look for pumps')] * drifts, likely=True)
    assert finding.verdict == verdict


@pytest.mark.parametrize(('verdict', 'doubt', 'named', 'told'), [
    ('missing_effect', {}, True, 0.99), ('partial', {}, True, 0.9), ('partial', {}, False, 0.5),
    ('partial', {'warnings': ('a drift',)}, True, 0.9),
    ('partial', {'slips': ('absolute pressure',)}, True, 0.9), ('unexplained', {}, False, 0.5),
    ('partial', {'refusals': ('a plane is as good',)}, True, 0.5),
    ('partial', {'against': frozenset(['end_caps'])}, True, 0.5),
    ('partial', {'against': frozenset(['tendon_slack'])}, True, 0.9)])
def test_no_more_is_shown_than_the_doubts_allow(verdict, doubt, named, told):
    """Nor is an effect beside structure that the catalogue does not explain all but certain."""
    finding = verdicts.Finding(verdict, verdicts.Left(1.0, 0.0), **doubt)
    assert verdicts.shown_probability(finding, 'end_caps', 0.99, named) == told
    assert verdicts.shown_probability(finding, 'end_caps', 0.3, named) == 0.3


def test_effects_that_fit_some_cells_at_the_expense_of_most_rows_are_refused(search):
    """Whatever the cells say, in which few rows may count as much as many."""
    made = search(nothing=0.0)
    good = made.null
    bad = replace(good, model=good.model.with_parameters({'geometry.radius': 6.5e-3}),
                  residual=0.9 * good.residual)

    def refusals(base, physics):
        return judge(made, base, physics, physics, [Change('', 'coulomb_friction')], GOOD, [],
                     True).refusals
    words, = refusals(good, bad)
    assert words.startswith('the error of all rows grows from 0.57')
    assert refusals(bad, good) == ()
    # cells that say the same: the effect is likelier, not more exact
    assert refusals(good, replace(bad, residual=1.1 * good.residual)) == ()
    # rows that fits leave out do not count, nor does the force where the strain is predicted
    cells = made.fitter.cells
    off = [np.abs(cells.data.force - fit.model.predict(cells.motion)) for fit in (good, bad)]
    assert not _worse_rows(replace(cells, label=np.where(off[1] < off[0], 0, -1)), good, bad)
    assert not _worse_rows(replace(cells, stiffness=np.ones(len(cells))), good, bad)


@pytest.mark.parametrize(('wave', 'verdict'), [(0.0, 'recalibrate'), (20.0, 'unexplained')])
def test_effects_that_make_rows_worse_are_no_answer_to_a_model_that_leaves_noise(
        search, monkeypatch, wave, verdict):
    """Nor a doubt about it; where it leaves more, something is missing."""
    made = search(nothing=0.0, coulomb_friction=9.0)
    cells = made.fitter.cells
    made.null = made.fits[made.null.names] = replace(
        made.null, residual=made.null.residual + wave * np.sin(30.0 * cells.strain),
        hyper=Hyper(even=12, strain=3, pressure=1) if wave else made.null.hyper)
    worse = replace(made.best, model=made.null.model.with_parameters({'geometry.radius': 6.5e-3}),
                    residual=0.9 * made.null.residual)
    module = sys.modules[Searched.__module__]
    monkeypatch.setattr(module, 'drop_unpredictive', lambda search, chosen, found, physics: (
        chosen, found, worse, GOOD))
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit, raising=False)
    comparison = SimpleNamespace(noise=noise_floor(cells.data), slips=())
    judged = Searched(comparison, cells.data, None, made).alone()
    assert judged.finding.verdict == verdict
    assert bool(judged.found) == bool(wave)


@pytest.mark.parametrize(('left', 'nearest'), [(0.6, ['coulomb_friction']), (1.1, [])])
def test_of_what_is_refused_the_change_that_leaves_least_comes_nearest(search, left, nearest,
                                                                       monkeypatch):
    """Though a smooth discrepancy explains it better; it is told with the odds against it."""
    made = search(nothing=20.0, coulomb_friction=0.0, coulomb_friction__end_caps=8.0)
    wave = 20.0 * np.sin(30.0 * made.fitter.cells.strain)
    for names, fit in made.fits.items():
        share = left if 'coulomb_friction' in names else 1.0
        made.fits[names] = replace(fit, residual=share * wave, hyper=Hyper(
            even=12, strain=3, pressure=1))
    made.null = made.best = made.fits[made.null.names]
    monkeypatch.setattr(made.fitter, 'without_discrepancy', lambda fit: fit)
    monkeypatch.setattr(sys.modules[Searched.__module__], 'artefacts', lambda *given: [])
    comparison = SimpleNamespace(noise=noise_floor(made.fitter.cells.data), slips=())
    judged = Searched(comparison, made.fitter.cells.data, None, made).alone()
    assert judged.finding.verdict == 'unexplained'
    assert [change.label for change in judged.found] == nearest
    said = 'a smooth discrepancy is 4.9e+08 times as probable'
    assert (said in judged.finding.refusals) == bool(nearest)


def test_what_is_explained_is_a_share_of_the_mean_square_whatever_the_noise(search):
    """Nine tenths of it are gone; how small the noise is beside what is left does not matter."""
    null = search(nothing=0.0).null
    wave = 10.0 * np.sin(np.arange(len(null.residual)))
    base, physics = replace(null, residual=wave), replace(null, residual=np.sqrt(0.1) * wave)
    assert _explained(base, physics) == pytest.approx(0.9)
