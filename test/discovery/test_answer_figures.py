# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a diagnosis show what the result holds."""

from dataclasses import replace
import json
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.discovery import answer_figures, Choices, diagnose
from fam_bundle_ros.discovery.answer_figures import _beside
from fam_bundle_ros.discovery.held_out import Unseen
from fam_bundle_ros.discovery.options import Change
from fam_bundle_ros.discovery.posterior import LikelySet
from fam_bundle_ros.report.discovery_pages import diagnosis_page
from fam_bundle_ros.report.page import render


@pytest.fixture(scope='module')
def record(paper_muscle, make_sweeps):
    """Return a function that makes a third of the rows of a muscle with 4 N of friction."""
    def make(noise):
        data = make_sweeps(paper_muscle.with_effect('coulomb_friction', force=4.0), noise,
                           cycles=1)
        return data.select(np.arange(len(data)) % 3 == 0)
    return make


@pytest.fixture(scope='module')
def found(paper_muscle, record):
    """Return its diagnosis; the friction is hidden."""
    return diagnose(paper_muscle, record(0.6), choices=Choices(most=1))


def test_forces_not_seen_are_off_by_what_the_folds_say(found):
    """Point by point on every kind of folds, of the model, the discrepancy and the rival."""
    held = found.held_out
    assert set(held.unseen) == set(held.kinds) == {'trial', 'isobar', 'strain'}
    for kind, each in held.unseen.items():
        for predicted, error in zip((each.predicted['physics'], each.predicted['discrepancy']),
                                    held.kinds[kind]):
            assert np.sqrt(np.mean((each.measured - predicted) ** 2)) == pytest.approx(error)
    drawing = answer_figures.unseen(found)
    shown = [t for t in drawing.data if t.name == 'recommended model' and t.yaxis == 'y2']
    off = np.concatenate([trace.y for trace in shown])
    missed = np.concatenate([each.measured - each.predicted[found.recommended.kind]
                             for each in held.unseen.values()])
    np.testing.assert_allclose(off, missed, atol=1e-3)
    rival = np.concatenate([t.y for t in drawing.data
                            if t.name == 'six-parameter form' and t.yaxis == 'y2'])
    assert np.std(rival) > 3.0 * np.std(off)


def test_forces_not_seen_are_nearer_to_the_truth_than_the_measurement(found, record):
    """The noise of a row is not in a prediction that was made without it."""
    truth = dict(zip(record(0.6).force, record(0.0).force))
    each = found.held_out.unseen['isobar']
    true = np.array([truth[force] for force in each.measured])
    assert np.std(each.predicted['physics'] - true) < 0.6 * np.std(each.measured - true)


def test_the_friction_is_in_the_discrepancy_before_and_not_after(found):
    """The odd part while shortening is minus the friction; each scale reaches what is left."""
    before, after = found.leftover_before, found.leftover
    assert np.median(before.odd) == pytest.approx(-4.0, abs=0.6)
    assert max(np.abs(after.odd).max(), np.abs(before.even).max()) < 0.4
    drawing = answer_figures.discrepancy(found)
    titles = [note.text for note in drawing.layout.annotations]
    assert titles[-2:] == ['odd, before', 'odd, after: none']
    for axis, each in (('coloraxis', before), ('coloraxis2', after)):
        reach = max(np.abs(each.even).max(), np.abs(each.odd).max()) or 1.0
        assert drawing.layout[axis].cmax == -drawing.layout[axis].cmin == pytest.approx(reach)
    drawn = drawing.data[len(titles) // 2 - 1]  # the last one of those before
    np.testing.assert_allclose(drawn.z, before.odd[0].T, atol=1e-3)


def test_sets_have_their_probabilities_and_the_told_one_its_colour(found):
    """Likeliest on top; others are named by how they differ from the one that is told."""
    sets = found.likely
    assert sum(each.probability for each in sets) <= 1.0 + 1e-9
    assert [each.chosen for each in sets].count(True) == 1
    bars = answer_figures.sets(found).data[0]
    assert max(bars.x) == bars.x[-1] == pytest.approx(sets[0].probability)
    told = next(k for k, each in enumerate(sets) if each.chosen)
    colours = list(bars.marker.color)[::-1]
    assert colours.count(colours[told]) == 1
    labels = answer_figures.sets(found).layout.yaxis.ticktext[::-1]
    assert labels[told] == 'the reported set'
    shape, = (change.new for change in sets[told].changes)
    other, = sets[1 - told].changes
    assert labels[1 - told].replace('<br>', ' ') == f'{other.new} instead of {shape}'


def test_each_parameter_is_drawn_before_and_after_the_data(found):
    """In widths of its prior; what cannot be negative and is zero by default begins there."""
    drawing = answer_figures.priors(found)
    before, after = (np.array(trace.x, float).reshape(-1, 3)[::-1] for trace in drawing.data[:2])
    for each, prior, moved in zip(found.parameters, before, after):
        assert prior[:2] == pytest.approx(each.reach)
        assert moved[0] <= each.moved[0] <= moved[1]
        assert each.prior[1] <= each.prior[0] <= each.prior[2]
        # both are the same parameter: the value is where its interval is
        assert each.interval[0] <= each.value <= each.interval[1]
    assert all(np.ptp(moved[:2]) < 1.05 * 3.92 for moved in after)
    half, = (each for each in found.parameters if each.key.endswith('.per_pressure'))
    assert half.reach[0] == half.moved[1] == 0.0


def test_the_report_has_all_of_them_beside_the_empirical_form(found):
    """Four figures, and the held-out error of the six-parameter form on the ladder."""
    page = render(diagnosis_page(found))
    for key in ('sets', 'unseen', 'discrepancy', 'priors', 'ladder'):
        assert f'<figure id="{key}">' in page
    assert 'six-parameter empirical form' in page
    assert found.summary in page  # effects are named as a command takes them
    saved = json.loads(found.to_json())
    assert saved['sets'][0]['probability'] == pytest.approx(found.likely[0].probability)


def test_the_report_names_what_was_replaced_and_removed_beside_the_verdict(found):
    """Not only what was added: a model may need no more effects, but other ones."""
    other = replace(found, effects=('end_caps',), replaced={'bladder_elasticity': 'bladder_thick'},
                    removed=('tendon_slack',))
    assert diagnosis_page(other).headline[0].note == (
        'end_caps, bladder_thick in place of bladder_elasticity, without tendon_slack')


# --- made by hand ------------------------------------------------------------------------------

DRY, CAPS, NO_DRAG = Change('', 'coulomb_friction'), Change('', 'end_caps'), Change('drag', '')
ROUND = Change('', 'presliding_hysteresis')


def leftover(**parts):
    """Return what is left over of two motor units on a grid of 3 strains and 2 pressures."""
    zero = np.zeros((2, 3, 2))
    return SimpleNamespace(**{
        'strain': np.array([0.0, 0.1, 0.2]), 'pressure': np.array([[0.0, 1e5], [0.0, 3e5]]),
        'even': zero, 'odd': zero, 'filling': zero, 'sd': zero + 0.25, **parts})


def test_a_discrepancy_has_a_row_for_each_part_of_a_unit_that_is_not_zero():
    """Two columns with a scale each, to the largest value in it; the same twice is one column."""
    even, odd = np.zeros((2, 2, 3, 2))
    even[0, 1, 1], odd[1, 2, 0], odd[1, 0, 1] = 2.5, -4.0, 1.5
    before, after = leftover(even=even, odd=odd), leftover(odd=0.1 * odd)
    units = (SimpleNamespace(name='left'), SimpleNamespace(name='right'))
    result = SimpleNamespace(leftover_before=before, leftover=after,
                             best=SimpleNamespace(motor_units=units))
    drawing = answer_figures.discrepancy(result)
    assert [note.text for note in drawing.layout.annotations] == [
        'left, even, before', 'left, even, after', 'right, odd, before', 'right, odd, after']
    maps = {(trace.coloraxis, trace.yaxis): trace for trace in drawing.data}
    assert len(maps) == 4
    for axis, each, most in (('coloraxis', before, 4.0), ('coloraxis2', after, 0.4)):
        assert (drawing.layout[axis].cmin, drawing.layout[axis].cmax) == (-most, most)
        first, second = (trace for trace in drawing.data if trace.coloraxis == axis)
        np.testing.assert_allclose(first.z, each.even[0].T)
        np.testing.assert_allclose(second.z, each.odd[1].T)
        np.testing.assert_allclose(second.y, [0.0, 300.0])
        np.testing.assert_allclose(second.x, [0.0, 0.1, 0.2])
        np.testing.assert_allclose(second.customdata, 0.25)
    once = SimpleNamespace(leftover_before=before, leftover=leftover(even=even, odd=odd),
                           best=SimpleNamespace(motor_units=units[:1]))
    assert len(answer_figures.discrepancy(once).data) == 2
    flat = SimpleNamespace(leftover_before=leftover(), leftover=leftover(), best=once.best)
    assert answer_figures.discrepancy(flat) is None
    alone = SimpleNamespace(leftover_before=leftover(even=even), leftover=leftover(),
                            best=SimpleNamespace(motor_units=units[:1]))
    assert [note.text for note in answer_figures.discrepancy(alone).layout.annotations] == [
        'before', 'after: none']


@pytest.mark.parametrize(('other', 'chosen', 'words'), [
    ((ROUND,), (DRY,), 'presliding_hysteresis instead of coulomb_friction'),
    ((DRY, CAPS), (DRY,), 'with end_caps'), ((DRY,), (DRY, CAPS), 'without end_caps'),
    ((), (DRY,), 'nothing missing'), ((DRY, CAPS), (), 'coulomb_friction, end_caps'),
    ((CAPS,), (DRY, NO_DRAG), 'without coulomb_friction, without no drag, with end_caps')])
def test_a_set_is_named_by_how_it_differs_from_the_told_one(other, chosen, words):
    """One for one is instead of; the told one is called so."""
    told = LikelySet(chosen, 0.7, True)
    assert _beside(LikelySet(other, 0.3, False), told) == words
    assert _beside(told, told) == ('the reported set' if chosen else 'nothing missing')


def test_likely_sets_are_shown_down_to_one_in_two_thousand():
    """But for the told one, which is always there; a single set is no figure."""
    likely = [LikelySet((DRY,), 0.6, False), LikelySet((ROUND,), 0.3, False),
              LikelySet((CAPS,), 0.0997, False), LikelySet((DRY, CAPS), 3e-4, False),
              LikelySet((), 2e-4, True)]
    bar, = answer_figures.sets(SimpleNamespace(likely=likely)).data
    assert list(bar.x) == [2e-4, 0.0997, 0.3, 0.6]
    assert list(bar.text) == ['0.0002', '0.10', '0.30', '0.60']
    assert len(set(bar.marker.color)) == 2
    assert list(bar.marker.color).count(bar.marker.color[0]) == 1
    assert answer_figures.sets(SimpleNamespace(likely=likely[4:])) is None


def test_parameters_are_drawn_in_widths_of_their_priors_up_to_the_edge():
    """The value between its ends, the prior behind it; beyond six widths at the edge."""
    told = [SimpleNamespace(key='a.x', value=1.0, unit='N', interval=(0.5, 1.5),
                            prior=(0.8, 0.1, 2.0), moved=(0.5, -0.2, 1.2), reach=(-1.96, 1.96)),
            SimpleNamespace(key='b.y', value=9.0, unit='mm', interval=(8.0, 10.0),
                            prior=(1.0, 0.0, 2.0), moved=(8.0, 7.0, 9.0), reach=(0.0, 1.96))]
    before, after, value = answer_figures.priors(SimpleNamespace(parameters=told)).data
    assert list(before.x) == [0.0, 1.96, None, -1.96, 1.96, None]
    assert list(after.x) == [6.0, 6.0, None, -0.2, 1.2, None]
    assert list(before.y) == list(after.y) == [0, 0, None, 1, 1, None]
    assert list(value.x) == [6.0, 0.5]
    assert value.hovertext[1] == 'a.x 1 N (0.5 to 1.5); before 0.8 (0.1 to 2)'
    low, high = answer_figures.priors(SimpleNamespace(parameters=told)).layout.xaxis.range
    assert low == -high < -6.0
    assert answer_figures.priors(SimpleNamespace(parameters=[])) is None


def test_unseen_forces_are_held_against_the_measured_ones():
    """Predicted over measured, and what is missed below, of both models and each kind of folds."""
    rng = np.random.default_rng(0)
    kinds = {kind: Unseen(rng.normal(size=20).round(3), {
        name: rng.normal(size=20).round(3)
        for name in ('physics', 'discrepancy', 'empirical', 'empirical_surface')})
        for kind in ('trial', 'isobar')}
    result = SimpleNamespace(held_out=SimpleNamespace(unseen=kinds),
                             recommended=SimpleNamespace(kind='physics'))
    drawing = answer_figures.unseen(result)
    line, zero, *points = drawing.data
    every = np.concatenate([each.measured for each in kinds.values()])
    assert list(line.x) == list(line.y) == list(zero.x) == [every.min(), every.max()]
    assert list(zero.y) == [0.0, 0.0]
    expected = [(each.measured, predicted, name) for name, source in (
        ('six-parameter form', 'empirical'), ('recommended model', 'physics'))
        for each in kinds.values() for predicted in (each.predicted[source],)]
    for (measured, predicted, name), above, below in zip(expected, points[::2], points[1::2]):
        assert above.name == below.name == name
        np.testing.assert_allclose(above.x, measured)
        np.testing.assert_allclose(above.y, predicted)
        np.testing.assert_allclose(below.y, measured - predicted, atol=1e-9)
    assert [trace.name for trace in points if trace.showlegend] == [
        'six-parameter form', 'recommended model']
    assert (drawing.layout.yaxis.title.text, drawing.layout.yaxis2.title.text,
            drawing.layout.xaxis2.title.text) == ('predicted (N)', 'residual (N)', 'measured (N)')
    for kind in ('discrepancy', 'empirical_surface'):
        result.recommended.kind = kind
        np.testing.assert_allclose(answer_figures.unseen(result).data[6].y,
                                   kinds['trial'].predicted[kind])
    assert answer_figures.unseen(SimpleNamespace(held_out=SimpleNamespace(unseen={}))) is None
