# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a diagnosis show what the result holds."""

import json

import numpy as np
import pytest

from fam_bundle_ros.discovery import answer_figures, Choices, diagnose
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
        for predicted, error in zip((each.physics, each.discrepancy), held.kinds[kind]):
            assert np.sqrt(np.mean((each.measured - predicted) ** 2)) == pytest.approx(error)
    drawing = answer_figures.unseen(found)
    shown = [t for t in drawing.data if t.name == 'recommended model' and t.yaxis == 'y2']
    off = np.concatenate([trace.y for trace in shown])
    ours = 'discrepancy' if found.recommended.leftover else 'physics'
    missed = np.concatenate([each.measured - getattr(each, ours)
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
    assert np.std(each.physics - true) < 0.6 * np.std(each.measured - true)


def test_the_friction_is_in_the_discrepancy_before_and_not_after(found):
    """The odd part while shortening is minus the friction; each scale reaches what is left."""
    before, after = found.leftover_before, found.leftover
    assert np.median(before.odd) == pytest.approx(-4.0, abs=0.6)
    assert np.abs(after.odd).max() < 0.4
    drawing = answer_figures.discrepancy(found)
    titles = [note.text for note in drawing.layout.annotations]
    assert titles == ['odd, before', 'odd, after: none']
    for axis, each in (('coloraxis', before), ('coloraxis2', after)):
        reach = max(np.abs(each.even).max(), np.abs(each.odd).max()) or 1.0
        assert drawing.layout[axis].cmax == -drawing.layout[axis].cmin == pytest.approx(reach)
    np.testing.assert_allclose(drawing.data[0].z, before.odd[0].T, atol=1e-3)


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
    assert labels[told] == 'the set that is told'
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
