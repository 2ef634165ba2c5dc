# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is said of a measurement beside the answer."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.protocol import Protocol, Sweep
from fam_bundle_ros.discovery import words
from fam_bundle_ros.discovery.experiment import Experiment
from fam_bundle_ros.discovery.options import Change
from fam_bundle_ros.discovery.posterior import Trade
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.verdict import Finding, Left
from fam_bundle_ros.discovery.words import (
    ascends,
    next_experiment,
    notes_on,
    renamed,
    summarise,
    what,
)
from fam_bundle_ros.model import Bundle

TIME = np.arange(0.0, 20.0, 0.1)
STRAIN = 0.1 + 0.1 * np.sin(TIME)


def log(*isobars):
    """Return a log of some isobars, Pa, one after the other."""
    count = len(isobars)
    trial = np.repeat(np.arange(count), len(TIME))
    return build('log', np.tile(STRAIN, count), np.repeat(isobars, len(TIME))[:, None],
                 np.tile(50.0 - 100.0 * STRAIN, count), trial,
                 np.tile(TIME, count) + 30.0 * trial)


@pytest.mark.parametrize(('isobars', 'told'), [
    ((1e5, 2e5, 3e5, 4e5), True),
    ((1e5, 3e5, 2e5, 4e5), False),
    ((1e5, 2e5), False),
])
def test_isobars_that_only_rise_are_told_of(isobars, told):
    """Then pressure and time go together; two isobars are no order."""
    assert ascends(log(*isobars)) == told


def test_a_trial_that_was_taken_out_breaks_no_order():
    """Rows of one isobar left out, as a held-out test does: the others rise still."""
    data = log(1e5, 2e5, 3e5, 4e5)
    assert ascends(data.select(data.trial != 1))
    assert not ascends(data.select(data.trial < 2))


@pytest.mark.parametrize(('rough', 'noise', 'told'), [
    (0.1, 1.3, 'down to the noise'), (0.1, 0.0, 'down to 1.36 N rms, above the noise floor'),
    (1.3, 0.4, 'down to 1.36 N')])
def test_what_is_left_without_a_shape_is_not_called_noise(rough, noise, told):
    """Stick and slip, in cells or between them, though as good as none for a rig."""
    finding = Finding('missing_effect', Left(0.0, rough))
    friction = [Change('', 'coulomb_friction')]
    said = summarise(finding, friction, friction, (), (), None, (), {
        'recalibrated': 3.1, 'best': 1.36, 'used': 1.36, 'noise': noise})
    assert told in said
    assert ('1% of the largest' in said) == (rough > 1.0)


def test_the_next_experiment_asks_about_the_effect_that_is_least_sure(monkeypatch):
    """Not about one that all likely sets have."""
    asked, without = [], SimpleNamespace(names=('coulomb_friction',))
    monkeypatch.setattr(words, '_rival', lambda posterior, gone, came, chosen: asked.append(gone)
                        or without)
    monkeypatch.setattr(words, '_labels', lambda posterior, fit: ['coulomb_friction'])
    monkeypatch.setattr(words, 'best_experiment', lambda *fits: (None, []))
    posterior = SimpleNamespace(of_label={'end_caps': 0.7, 'coulomb_friction': 1.0}.get,
                                options=TIED)
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=False)))
    words.next_experiment(fitter, posterior, Finding('missing_effect', Left(0.0, 0.2)),
                          [Change('', 'end_caps'), Change('', 'coulomb_friction')], None, (), (),
                          (), BASE)
    assert asked == [('end_caps',)]


@pytest.mark.parametrize(('labels', 'other'), [
    (['end_caps', 'pressure_creep'], 'pressure_creep'), (['end_caps'], 'the model without it')])
def test_an_experiment_is_told_by_what_the_answer_has_not(monkeypatch, labels, other):
    """The rival set has end caps too: they are no alternative to the lag."""
    chosen, rival = (SimpleNamespace(names=names) for names in (
        ['pressure_line_lag', 'end_caps'], labels))
    monkeypatch.setattr(words, '_labels', lambda posterior, fit: fit.names)
    sweep = Sweep((0.05, 0.15), 0.1, ((100e3,),))
    best = Experiment(Protocol('sweep', 1, (sweep,)), 400.0)
    monkeypatch.setattr(words, 'best_experiment', lambda *fits: (best, [best]))
    posterior = SimpleNamespace(fits=(chosen, rival), of_label=lambda label: 0.9, options=TIED)
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=False)))
    told = next_experiment(fitter, posterior, Finding('missing_effect', Left(0.0, 0.2)),
                           [Change('', 'pressure_line_lag')], chosen, (), (), (), BASE)
    assert told.words == f'sweep: separates pressure_line_lag from {other} (by 20 noise sd)'


@pytest.mark.parametrize('found', [True, False])
def test_what_several_other_effects_may_replace_is_to_be_settled(monkeypatch, found):
    """However sure the named effect is: `summarise` says that the data cannot tell them apart."""
    chosen, rival = (SimpleNamespace(names=names) for names in (
        ['coulomb_friction'], ['relaxation_prony', 'temperature']))
    sweep = Experiment(Protocol('sweep', 1, (Sweep((0.05, 0.15), 0.1, ((100e3,),)),)), 400.0)
    monkeypatch.setattr(words, 'best_experiment', lambda *fits: (sweep if found else None, []))
    posterior = SimpleNamespace(fits=(chosen, rival), of_label=lambda label: 0.99, options=TIED)
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=False)))
    trade = Trade(frozenset([DRY]), frozenset(Change('', name) for name in rival.names))
    told = next_experiment(fitter, posterior, Finding('missing_effect', Left(0.0, 0.2)), [DRY],
                           chosen, (), (trade,), (), BASE)
    both = 'separates coulomb_friction from relaxation_prony and temperature'
    assert told.words.startswith(f'sweep: {both} (by' if found else
                                 f'no force test of the menu {both};')


@pytest.mark.parametrize(('verdict', 'is_static', 'told'), [
    ('missing_effect', False, 'none needed to name it: the odds are more than 20 to 1 against all '
                              'that was tried without; for narrower intervals, sweep in steps'),
    ('missing_effect', True, 'log a sweep up and down with time'),
    ('partial', False, 'measure where the error is largest again')])
def test_no_experiment_is_asked_for_to_name_what_is_certain(monkeypatch, verdict, is_static, told):
    """An experiment that separates it from an improbable set would tell nothing new."""
    def separate(*fits):
        raise AssertionError('an experiment was sought')
    monkeypatch.setattr(words, 'best_experiment', separate)
    monkeypatch.setattr(words, '_rival', lambda posterior, gone, came, chosen: object())
    for design in ('finer', 'plain'):
        monkeypatch.setattr(words, design, lambda cells, model: SimpleNamespace(
            name='sweep in steps'))
    posterior = SimpleNamespace(of_label=lambda label: 0.96, options=TIED)
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=is_static)))
    asked = next_experiment(fitter, posterior, Finding(verdict, Left(0.0, 0.2)), [DRY],
                            SimpleNamespace(model=None), (), (), (), BASE)
    assert asked.words.startswith(told)
    assert asked.protocol.name == 'sweep in steps'


def test_an_effect_that_is_likelier_than_not_but_not_named_is_told_of(monkeypatch):
    """Named effects are told as the answer, ties as ties; what is left is below one half."""
    shares = {'end_caps': 0.99, 'coulomb_friction': 0.6, 'tendon_slack': 0.7, 'temperature': 0.4,
              'softening': 0.97}
    posterior = SimpleNamespace(labels=lambda: list(shares), of_label=shares.get)
    monkeypatch.setattr(words, '_labels', lambda posterior, fit: ['end_caps'])
    weak, other = words.not_named(posterior, None, ['tendon_slack'])
    assert weak == ('coulomb_friction is likelier than not (0.60) but not named: the evidence for '
                    'it is weak')
    # odds above 20: it was taken out for another reason
    assert other.startswith('softening is likelier than not (0.97) but not named: it does not')


def test_what_is_down_to_the_noise_in_some_rows_only_says_so():
    """The table below shows 0.88 N over all rows, turning points among them."""
    error = {'recalibrated': 6.6, 'best': 0.88, 'used': 0.61, 'noise': 0.59}
    finding = Finding('missing_effect', Left(0.0, 0.0))
    told = summarise(finding, [DRY], [DRY], (), (), BASE, (), error)
    assert told == ('coulomb_friction explains the error down to the noise (0.61 N in the rows '
                    'that fits use)')


DRY, CAPS = Change('', 'coulomb_friction'), Change('', 'end_caps')
#: Odds of a tie.
TIED = SimpleNamespace(choices=Choices(odds=20.0),
                       changes=lambda names: [Change('', name) for name in names])
BASE = SimpleNamespace(u=np.array([0.1, -1.24, 4.0]), priors=[
    SimpleNamespace(key=key) for key in ('geometry.length', 'geometry.radius', 'mesh.factor')])


def said(verdict, answer=(), found=(), ties=(), trades=(), shapes=(), after=0.2, best=0.6, **more):
    """Return the sentence of a verdict; errors of 3.1 N before and 0.6 N after."""
    return summarise(Finding(verdict, Left(after, 0.0), **more), answer,
                     found, ties, trades, BASE, shapes,
                     {'recalibrated': 3.1, 'best': best, 'used': best, 'noise': 0.59})


def test_changes_and_models_are_named_by_what_was_changed():
    """Three changes are counted."""
    assert what(Change('drag', '')) == 'drag taken away'
    assert what(Change('drag', 'slip')) == 'slip in place of drag'
    assert what(DRY) == 'coulomb_friction'
    shape = Change('', 'presliding_hysteresis')
    assert what(shape) == (shape.label if shape.label == shape.new else
                           f'{shape.label} (shape: presliding_hysteresis)')
    assert renamed('m', ['a', 'b']) == 'm_a_b'
    assert renamed('m', ['a', 'b', 'c']) == 'm_3_changes'


def test_a_model_that_is_right_or_off_in_its_dimensions_lacks_nothing():
    """What moved by a fifth of its tolerance is told, with its sign."""
    assert said('adequate') == 'the model explains the data down to their noise'
    assert said('adequate', faint=0.21).endswith(
        'their noise; 0.21 N rms of a smooth shape are left, less than half the noise of a row: '
        'a smaller --unexplained searches for effects of this size')
    assert said('adequate', best=3.0) == (
        'the model explains the error down to 3 N rms, above the noise floor of 0.59 N, without '
        'a further shape that is known')
    assert said('recalibrate') == (
        "the model's own parameters explain the error (tolerances moved: radius -1.2, "
        'factor +4.0); no effect is missing')
    assert said('recalibrate', best=3.0).endswith(
        '; what is left is below 1% of the largest force, where no effect is looked for')


def test_what_nothing_explains_is_told_by_its_shape_and_what_came_near():
    """With why that is no answer; an artefact of the measurement comes first."""
    shape = SimpleNamespace(words='a bump about strain 0.1', explained=0.5)
    start = ('the error has a structure that no effect of the catalogue explains; it looks like '
             'this: ')
    assert said('unexplained') == f'{start}no plain shape'
    little = SimpleNamespace(words='a bump', explained=0.49)
    assert said('unexplained', shapes=(little, shape)) == f'{start}no plain shape'
    assert said('unexplained', found=(DRY, CAPS), shapes=(shape,)) == (
        f'{start}a bump about strain 0.1 (nearest: coulomb_friction and end_caps, but 0.2 N of '
        'structure would be left)')
    told = summarise(Finding('unexplained', Left(18.0, 0.0, 18.0, 7.0)), (),
                     (DRY,), (), (), BASE, (), {})
    assert told.endswith('but 7 N of structure would be left)')  # a mean over rows, as errors
    assert said('unexplained', found=(DRY,), refusals=('it is bent', 'it is odd')).endswith(
        '(nearest: coulomb_friction, but it is bent; it is odd)')
    artefact = SimpleNamespace(words='trial 3 is off', remedy='tare before each trial')
    assert said('unexplained', artefacts=(artefact, artefact)) == 'trial 3 is off; trial 3 is off'
    told = next_experiment(None, None, Finding('unexplained', Left(1, 1),
                                               artefacts=(artefact,)), (), None, (), (), (), BASE)
    assert told == ('tare before each trial', None)


def test_an_answer_says_how_much_it_explains_and_what_could_take_its_place():
    """Of all trades two are told; one effect explains, several explain."""
    assert said('missing_effect', (DRY,)) == (
        'coulomb_friction explains the error down to the noise')
    assert said('missing_effect', (DRY, CAPS)).startswith(
        'coulomb_friction and end_caps explain the error')
    assert said('partial', (CAPS,), after=0.25, warnings=('one speed',)) == (
        'end_caps takes the error from 3.1 to 0.6 N; a smooth discrepancy of 0.25 '
        'N is left; caution: one speed')
    # more than the error: the model is distorted
    assert said('partial', (CAPS,), after=13.0).endswith(
        ' a smooth discrepancy of 13 N is left if the dimensions stay near their usual values')
    tied = said('missing_effect', (DRY,), ties=(('a', 'b'),), trades=('c with d', 'e with f', 'g'))
    assert tied.endswith('; these data cannot tell apart a and b; c with d; e with f '
                         '(and 1 more)')


@pytest.mark.parametrize(('verdict', 'rubber', 'words'), [
    ('recalibrate', 0.3, 'measure radius and braid angle with a calliper'),
    ('recalibrate', -2.4, 'use the refitted constants of bladder_elasticity'),
    ('adequate', 0.0, 'none needed within this range')])
def test_where_nothing_is_missing_the_next_step_is_plain(verdict, rubber, words):
    """A calliper where dimensions moved most, but not for constants of rubber; another range."""
    fitter = SimpleNamespace(cells=SimpleNamespace(data=SimpleNamespace(is_static=False)))
    base = SimpleNamespace(u=np.array([-1.2, rubber]), priors=[
        SimpleNamespace(key=key) for key in ('geometry.radius', 'bladder_elasticity.c10')])
    told = next_experiment(fitter, None, Finding(verdict, Left(0, 0)), (), None,
                           (), (), (), base)
    assert told.words.startswith(words)
    assert told.protocol is None


def test_notes_say_what_was_left_out_and_what_moved_too_far():
    """Each once; nothing where nothing is odd."""
    data = log(1e5, 3e5, 2e5)
    model = SimpleNamespace(effects=[], motor_units=[], max_pressure=[])
    calm = SimpleNamespace(priors=BASE.priors, u=np.zeros(3), model=model)
    far = SimpleNamespace(priors=BASE.priors, u=np.array([0.0, -3.2, 9.0]), model=model)
    floor, kinds = SimpleNamespace(note=''), SimpleNamespace(kinds={'trial': (1.0, 1.0)})
    label = np.arange(len(data)) // 3
    cells = SimpleNamespace(data=data, label=label, unused={'spikes': 3, 'odd': 4}, motion=None,
                            one_force=False, rows=600,
                            residual_of_rows=lambda model: np.full(len(data), 0.5))
    assert notes_on(cells, floor, calm, calm, kinds) == ()
    label[:7] = -1
    ripple = SimpleNamespace(note='a fine ripple')
    found = notes_on(cells, ripple, calm, far, SimpleNamespace(kinds={}))
    assert found[0] == 'a fine ripple'
    assert found[1].startswith('7 of 600 rows are not used (3 spikes, 4 odd); on the others')
    assert found[1].endswith('the best error is 0.5 N')
    cells.rows = 3600
    assert '7 of 600 rows (averages of neighbours; the log has 3600) are not used' in notes_on(
        cells, ripple, calm, calm, kinds)[1]
    assert found[2].startswith('the data have no folds')
    assert found[3] == ('the refit moves the geometry beyond its tolerances: geometry.radius '
                        '-3.2 tolerances')
    assert len(found) == 4
    held = SimpleNamespace(data=data, label=label + 9, motion=None, one_force=True,
                           stiffness=np.array([100.0, 200.0, 400.0]))
    hung = notes_on(held, floor, calm, calm, kinds)
    assert hung[0].startswith(f'the force is constant ({data.force.mean():.3g} N)')
    assert '100 N are 0.5 of strain' in hung[0]
    assert 'not tried: tendon_slack, force_floor, force_sensor_bias, force_sensor_gain' in hung[1]
    assert len(hung) == 2


@pytest.mark.parametrize(('apart', 'effect', 'told'), [
    (120.0, 'viscoelastic_relaxation', 'starts anew at 2 trials: '),
    (21.0, 'viscoelastic_relaxation', ''),
    (120.0, 'coulomb_friction', '')])
def test_memory_that_starts_anew_is_told_of(paper_muscle, apart, effect, told):
    """Only where the model remembers, and the past of a trial is not known."""
    data = log(1e5, 3e5, 2e5)
    data = build('log', data.strain, data.pressure, data.force, data.trial,
                 np.tile(TIME, 3) + apart * data.trial)
    cells = SimpleNamespace(data=data, label=data.trial, unused={}, one_force=False)
    fit = SimpleNamespace(priors=(), u=(), model=paper_muscle.with_effect(effect))
    notes = notes_on(cells, SimpleNamespace(note=''), fit, fit,
                     SimpleNamespace(kinds={'trial': (1.0, 1.0)}))
    assert [told in note and effect in note for note in notes] == [True] * bool(told)
    notes = notes_on(cells, SimpleNamespace(note=''), fit, fit,
                     SimpleNamespace(kinds={'trial': (1.0, 1.0)}), afresh=True)
    assert all(note.endswith('remembers the trial before') for note in notes)


def test_pressures_above_the_models_limit_are_told_of(paper_muscle):
    """Those that are noise about the limit are not."""
    data = log(1e5, 3e5)
    cells = SimpleNamespace(data=data, label=data.trial, unused={}, stiffness=None,
                            one_force=False)
    kinds = SimpleNamespace(kinds={'trial': (1.0, 1.0)})

    def notes(limit):
        unit = replace(paper_muscle.motor_units[0], max_pressure=limit)
        model = Bundle('paper', [unit], paper_muscle.effects)
        fit = SimpleNamespace(priors=(), u=(), model=model)
        return notes_on(cells, SimpleNamespace(note=''), fit, fit, kinds)
    assert notes(295e3) == ()
    assert notes(250e3) == (
        'mu1: pressures up to 300 kPa are above the max_pressure of the model, 250 kPa',)


def test_a_rival_is_the_likeliest_set_without_the_effect():
    """With the other of a tie where there is one; the chosen set is none."""
    chosen, *others = fits = [SimpleNamespace(names=names) for names in (
        ['viscoelastic_relaxation'], ['end_caps'], ['relaxation_prony'], [])]
    posterior = SimpleNamespace(fits=fits, options=TIED)
    assert words._rival(posterior, ('viscoelastic_relaxation',), (), chosen) is others[0]
    assert words._rival(posterior, ('end_caps',), (), chosen) is others[1]
    # the label of both shapes is the same, the changes are not
    shapes = [(Change('', name),) for name in ('viscoelastic_relaxation', 'relaxation_prony')]
    assert words._rival(posterior, *shapes, chosen) is others[1]
    assert words._rival(posterior, ('end_caps',), ('temperature',), chosen) is None
