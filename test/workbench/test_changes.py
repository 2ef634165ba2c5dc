# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict says can be done with one button: add, replace, leave out; and as a command."""

from dataclasses import replace
import shlex

import pytest

from fam_bundle_ros.cli.app import app
from fam_bundle_ros.workbench import changes, worker
from fam_bundle_ros.workbench.changes import Change, Since

RUBBER = Change('bladder_polynomial', 'bladder_elasticity')


@pytest.fixture
def told_to_swap(session, friction_found):
    """Return the session after a diagnosis that wants another bladder and no mesh besides."""
    session.learn(replace(friction_found, replaced={'bladder_elasticity': 'bladder_polynomial'}))
    return session


def test_the_button_does_all_that_the_verdict_says(told_to_swap):
    """The other bladder and the friction are asked for; once done nothing is left to do."""
    assert told_to_swap.asked() == [RUBBER, Change('coulomb_friction')]
    for change in told_to_swap.asked():
        since = told_to_swap.with_change(change)
        refitted = worker.refit_job(lambda share, words: None, told_to_swap.steps[0].model,
                                    told_to_swap.data, since)
        told_to_swap.advance(change.label, *refitted, since, change.effect)
    names = [effect.name for effect in told_to_swap.now.model.effects]
    assert names == ['mesh', 'bladder_polynomial', 'coulomb_friction']
    assert told_to_swap.asked() == []
    assert [step.label for step in told_to_swap.steps] == [
        'start', 'bladder_polynomial for bladder_elasticity', '+ coulomb_friction']
    assert told_to_swap.command().startswith(
        'fam_bundle add coulomb_friction --replace bladder_elasticity=bladder_polynomial --data')
    assert told_to_swap.now.error_N < 0.2 * told_to_swap.steps[0].error_N


def test_the_printed_command_is_one_that_the_command_line_takes(told_to_swap):
    """It names effects, data and model; its options are those of `fam_bundle add`."""
    from typer.main import get_command
    words = shlex.split(told_to_swap.command())
    assert words[:2] == ['fam_bundle', 'add']
    context = get_command(app).commands['add'].make_context('add', words[2:])
    assert context.params['effects'] == ['coulomb_friction']
    assert context.params['replacing'] == ['bladder_elasticity=bladder_polynomial']
    [data] = context.params['data']
    assert data.endswith('hidden_friction.csv')


def test_an_effect_that_was_added_is_replaced_where_it_is(with_friction):
    """Of the first model nothing is replaced; the added one goes and the other comes."""
    since = with_friction.now.since
    swapped = since.then(Change('presliding_hysteresis', 'coulomb_friction'))
    assert ([effect.name for effect in swapped.added], swapped.replaced, swapped.removed) == (
        ['presliding_hysteresis'], {}, ())
    assert since.then(Change('coulomb_friction', removes=True)) == Since()


def test_what_was_replaced_is_known_by_its_first_name():
    """A second replacement and a removal speak of what the first model had."""
    since = Since(replaced={'bladder_elasticity': 'bladder_polynomial'})
    assert since.then(Change('bladder_ogden', 'bladder_polynomial')).replaced == {
        'bladder_elasticity': 'bladder_ogden'}
    assert since.then(Change('bladder_polynomial', removes=True)) == Since(
        removed=('bladder_elasticity',))


def test_a_formula_of_ones_own_has_no_command(session):
    """The catalogue of the command line does not know it: nothing is printed."""
    from fam_bundle_ros.workbench.own_effect import Draft
    draft = Draft(name='mine', formula='-k * strain', place='force')
    draft.sync()
    draft.fields['k'].value = '5 N'
    friction = [Change('coulomb_friction')]
    assert changes.command(session.case, Since((draft.effect(),)), friction) == ''
    assert 'coulomb_friction' in changes.command(session.case, Since(), friction)
