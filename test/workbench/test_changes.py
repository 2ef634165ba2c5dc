# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict says can be done with one button: add, replace, leave out; and as a command."""

from dataclasses import replace
import shlex

import pytest

from fam_bundle_ros.cli.app import app
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.workbench import changes, worker
from fam_bundle_ros.workbench.changes import Change

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
        added, replaced, removed = told_to_swap.with_change(change)
        refit = worker.refit_job(lambda share, words: None, told_to_swap.steps[0].model,
                                 told_to_swap.data, added, replaced, removed)
        told_to_swap.advance(change.label, refit, added, change.effect, replaced, removed)
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
    assert context.params['data'].endswith('hidden_friction.csv')


def test_an_effect_that_was_added_is_replaced_where_it_is(with_friction):
    """Of the first model nothing is replaced; the added one goes and the other comes."""
    swap = Change('presliding_hysteresis', 'coulomb_friction')
    added, replaced, removed = changes.after(with_friction.now, swap)
    assert ([effect.name for effect in added], replaced, removed) == (
        ['presliding_hysteresis'], {}, ())
    assert changes.after(with_friction.now, Change('coulomb_friction', removes=True)) == ((), {},
                                                                                          ())


def test_what_was_replaced_is_known_by_its_first_name(session):
    """A second replacement and a removal speak of what the first model had."""
    step = replace(session.now, replaced={'bladder_elasticity': 'bladder_polynomial'})
    assert changes.after(step, Change('bladder_ogden', 'bladder_polynomial'))[1] == {
        'bladder_elasticity': 'bladder_ogden'}
    assert changes.after(step, Change('bladder_polynomial', removes=True)) == (
        (), {}, ('bladder_elasticity',))


def test_a_formula_of_ones_own_has_no_command(session):
    """The catalogue of the command line does not know it: nothing is printed."""
    from fam_bundle_ros.workbench.own_effect import Draft
    draft = Draft(name='mine', formula='-k * strain', place='force')
    draft.sync()
    draft.fields['k'].value = '5 N'
    step = replace(session.now, added=(draft.effect(),))
    assert changes.command(session.case, step, [Change('coulomb_friction')]) == ''
    assert catalogue.get('coulomb_friction').name in changes.command(
        session.case, session.now, [Change('coulomb_friction')])
