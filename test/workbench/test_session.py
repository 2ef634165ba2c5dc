# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A session knows the case, the ladder, the diagnosis and the selection, without a browser."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.grouping import reversals, rms
from fam_bundle_ros.discovery import compare
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench.case_view import CaseView
from fam_bundle_ros.workbench.cases import EXAMPLES, load_example
from fam_bundle_ros.workbench.session import Session, short


@pytest.mark.parametrize('key', [example.key for example in EXAMPLES])
def test_every_example_that_ships_opens(key):
    """Each example has data and a model that fit together, and says where it comes from."""
    made = Session()
    made.open(load_example(key))
    assert made.now.error_N > 0
    assert made.case.origin


def test_the_hidden_friction_starts_where_its_card_says(session):
    """The example is off by what `compare` and its card say, and its noise is 0.6 N."""
    told = compare(session.now.model, session.data).error_N
    assert session.now.error_N == pytest.approx(told, rel=1e-9)
    assert f'off by {short(told)} N' in EXAMPLES[0].question
    assert session.noise == pytest.approx(0.6, abs=0.05)
    assert '11 times the noise' in session.headline()


def test_adding_the_friction_puts_a_rung_on_the_ladder(with_friction):
    """With the friction the error is at the noise but where a trial is entered or turns."""
    assert [step.label for step in with_friction.steps] == ['start', '+ coulomb_friction']
    assert rms(with_friction.residual()[~reversals(with_friction.data)]) < 0.75
    assert with_friction.now.error_N < 0.2 * with_friction.before.error_N
    assert with_friction.before.error_N > 6.5
    assert with_friction.now.model.error == pytest.approx(with_friction.now.error_N)


def test_undo_brings_the_old_model_back(with_friction):
    """Undo takes one step back, and does nothing at the first."""
    with_friction.undo()
    assert with_friction.now.label == 'start'
    with_friction.undo()
    assert len(with_friction.steps) == 1


def test_undo_past_a_diagnosis_forgets_it(with_friction):
    """A diagnosis of a model that was taken back no longer stands."""
    with_friction.learn(object())
    with_friction.undo()
    assert with_friction.diagnosis is None


def test_every_row_counts(with_friction):
    """The error of a step is that of `compare`: over all rows, also where the motion turns."""
    turns = reversals(with_friction.data)
    assert turns.any()
    for step in with_friction.steps:
        residual = with_friction.residual(step)
        assert step.error_N == pytest.approx(np.sqrt(np.mean(residual ** 2)))
        assert step.error_N == compare(step.model, with_friction.data).error_N
        assert step.error_N != pytest.approx(rms(residual[~turns]), rel=1e-3)


def test_selections_cut_the_rows(session):
    """Isobar, direction and trial narrow what is shown, together."""
    everything = session.rows().sum()
    session.select(level=0)
    isobar = session.rows().sum()
    session.select(direction=1)
    assert 0 < session.rows().sum() < isobar < everything
    assert np.all(session.data.direction[session.rows()] == 1)


def test_a_region_selects_its_rows():
    """Zooming to a region of the bundle shows its samples and no others."""
    made = Session()
    made.open(load_example('bundle_push_back'))
    made.select(region=0)
    rows = made.rows()
    assert rows.sum() == made.regions[0].samples
    assert np.array_equal(rows, made.regions[0].rows)


def test_choices_put_what_was_found_first(session, friction_found):
    """The friction leads the list, comes with its fitted value, and is what is missing."""
    session.learn(friction_found)
    assert session.diagnosis.verdict == 'missing_effect'
    first = session.choices()[0]
    assert (first.effect, first.found, first.added) == ('coulomb_friction', True, False)
    assert [choice.effect for choice in session.missing()] == ['coulomb_friction']
    assert session.candidate_effect('coulomb_friction').force == pytest.approx(6.66, abs=0.1)
    with pytest.raises(InputError, match='not among the candidates'):
        session.candidate_effect('mesh')


def test_ties_name_their_rivals(session, friction_found):
    """Effects that data cannot tell apart name each other, beside what was found, and no more."""
    rivals = [entry.effect for entry in friction_found.ranking
              if entry.effect not in friction_found.effects and not entry.replaces][-2:]
    group = (friction_found.effects[0], *rivals)
    session.learn(replace(friction_found, tied=(group,)))
    told = {choice.candidate.effect: choice.rivals for choice in session.choices()}
    for name in group:
        assert set(told[name]) == set(group) - {name}
    assert all(not others for name, others in told.items() if name not in group)
    first = len(friction_found.effects)
    assert {row.candidate.effect for row in session.choices()[first:first + 2]} == set(rivals)


def test_what_replaces_or_removes_is_no_choice_to_add(session, friction_found):
    """A candidate that takes the place of an effect, or takes one away, cannot be added."""
    first, *others = friction_found.ranking
    changed = replace(first, effect='bladder_polynomial', shape='bladder_polynomial',
                      replaces='bladder_elasticity')
    gone = replace(first, effect='no mesh', shape='mesh', removes=True)
    session.learn(replace(friction_found, ranking=(first, changed, gone, *others)))
    assert not {'bladder_polynomial', 'mesh'} & {choice.effect for choice in session.choices()}


def test_nothing_open_is_said_plainly():
    """Asking an empty session for its model is an input error, not a crash."""
    with pytest.raises(InputError, match='nothing is open'):
        Session().now  # noqa: B018
    with pytest.raises(InputError, match='nothing is open'):
        Session().data  # noqa: B018


@pytest.mark.parametrize(('verdict', 'artefacts', 'summary', 'said'), [
    ('adequate', (), 'the model explains all systematic error; 2 N rms are left',
     'Nothing is missing: the model explains all systematic error; 2 N rms are left.'),
    ('unexplained', ('the error drifts by 2 N rms',), 'the error drifts by 2 N rms',
     'The error drifts by 2 N rms.'),
    ('unexplained', (), 'it looks like this: a bump',
     'Something is missing that the catalogue does not have.')])
def test_the_headline_of_a_diagnosis_is_no_more_than_it_says(verdict, artefacts, summary, said):
    """A drift of the load cell is nothing that the catalogue lacks."""
    found = SimpleNamespace(verdict=verdict, artefacts=artefacts, summary=summary, effects=(),
                            replaced={}, removed=())
    session = SimpleNamespace(diagnosis=found, steps=[None], diagnosed_at=1)
    assert CaseView._said(SimpleNamespace(session=session)) == said


def test_a_selection_without_samples_fails_and_changes_nothing(session):
    """What no sample has cannot be drawn: the selection before it stays."""
    session.select(level=2)
    with pytest.raises(InputError, match='no sample has'):
        session.select(level=7, direction=1)
    assert (session.selection.level, session.selection.direction) == (2, None)
