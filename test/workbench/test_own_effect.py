# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A user's own formula becomes an effect, with units, and shows at once what it does."""

import pytest

from fam_bundle_ros.data.grouping import reversals, rms
from fam_bundle_ros.discovery import Choices, compare
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench.cases import load_example
from fam_bundle_ros.workbench.own_effect import Draft, Field, from_template, preview
from fam_bundle_ros.workbench.session import Session


def draft(formula, place='loss', name='mine', **values):
    """Return a filled form."""
    made = Draft(name, formula, place)
    made.sync()
    for key, value in values.items():
        made.fields[key].value = value
    return made


def test_a_formula_asks_for_its_own_parameters():
    """Every name that is no variable and no function gets a field; typing on keeps its value."""
    made = draft('-k * tanh(strain_rate / v)')
    assert list(made.fields) == ['k', 'v']
    made.fields['k'].value = '5 N'
    made.formula = '-k * sign(strain_rate)'
    made.sync()
    assert {key: item.value for key, item in made.fields.items()} == {'k': '5 N'}


def test_friction_by_hand_takes_the_error_down(session):
    """Coulomb's law, typed, brings the error near the noise before any refit."""
    effect = draft('-k * tanh(strain_rate / v)', k='6.7 N', v='0.002 1/s').effect()
    seen = preview(session, effect)
    inside = ~reversals(session.data)
    assert rms((session.data.force - seen.prediction)[inside]) < 0.8
    assert seen.error_N == compare(session.now.model.with_effect(effect), session.data).error_N
    assert seen.error_N < 0.2 * session.now.error_N
    assert seen.change_N == pytest.approx(6.7, abs=0.2)


def test_values_take_any_unit_that_fits(session):
    """1 lbf is 4.45 N."""
    effect = draft('-k * tanh(strain_rate / v)', k='1 lbf', v='0.2 %/s').effect()
    assert effect.k == pytest.approx(4.448, abs=1e-3)
    assert effect.v == pytest.approx(0.002)


def test_bounds_are_ten_times_the_start_unless_given():
    """Without bounds a refit may go to ten times the start and to nothing."""
    made = draft('-k * strain_rate', k='5 N*s')
    assert made.effect().limits('k') == (0.0, 50.0)
    made.fields['k'] = Field('5 N*s', '1 N*s', '20 N*s')
    assert made.effect().limits('k') == (1.0, 20.0)


@pytest.mark.parametrize(('made', 'said'), [
    (draft('-k * strain_rate', k=''), 'parameter k'),
    (draft('-k * strain_rate', k='5'), 'must give N'),
    (draft('-k * strain_rate', k='five N'), 'parameter k'),
    (draft('-k * strain_rate', k='5 bananas'), 'parameter k'),
    (draft('-k * strain_rate', k='5 kg'), 'must give N'),
    (draft('-k * strain_rate', k='nan N*s'), 'parameter k'),
    (draft('-k * strain_rate', k='5 N*s', name='Bad Name!'), 'name'),
    (draft('__import__("os").system("ls")'), 'parameter'),
    (draft('().__class__'), 'only arithmetic'),
    (draft('strain ** 99999'), 'power'),
    (draft(''), 'cannot be read')])
def test_what_cannot_be_used_fails_with_a_sentence(made, said):
    """Bad names, numbers, units and anything that is no arithmetic: one sentence each."""
    with pytest.raises(InputError, match=said):
        made.effect()


def test_a_formula_without_finite_force_fails(session):
    """A formula that is nowhere a number is told, not drawn."""
    with pytest.raises(InputError, match='finite'):
        preview(session, draft('k * log(strain - 1)', 'force', k='1 N').effect())


@pytest.fixture(scope='module')
def stranger_found():
    """Return what discovery says about an effect that no catalogue has."""
    case = load_example('a_stranger')
    return diagnose(case.model, case.data, choices=Choices(most=2))


def test_a_stranger_stays_unexplained(stranger_found):
    """An end stop is in no catalogue: no set of effects is its name, and its shape is told."""
    assert stranger_found.verdict == 'unexplained'
    assert any('starts at strain 0.1' in str(shape) for shape in stranger_found.shapes_left)


def test_a_found_shape_fills_the_form(stranger_found):
    """What a diagnosis describes can be used as an effect as it stands."""
    made = Session()
    made.open(load_example('a_stranger'))
    template = next(t for t in stranger_found.shapes_left if t.expression)
    seen = preview(made, from_template(template).effect())
    assert seen.error_N < 0.2 * made.now.error_N
