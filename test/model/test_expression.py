# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Formulas of a model file: what they may say, and what becomes of them."""

import inspect
import itertools
import operator
import re

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import loads_model, Parameter
from fam_bundle_ros.model.compose import composition
from fam_bundle_ros.model.expression import expression_law, FUNCTIONS, VARIABLES
from fam_bundle_ros.model.graph import Graph, Writer

from .conftest import HEAD

#: A model file with one effect, to which others are added.
MESH = f'{HEAD}  - mesh\n'


def newton(name):
    """Return a parameter in N."""
    return Parameter(2.0, 'N', -100.0, 100.0, 'd', name=name)


def model(formula, parameters='k: 5 N', place='force'):
    """Return a model with a formula from the lines of a file."""
    return loads_model(f'{MESH}  - own: {{expression: "{formula}", place: {place}, '
                       f'parameters: {{{parameters}}}}}\n')


@pytest.mark.parametrize('name', [*VARIABLES, *FUNCTIONS])
def test_a_parameter_may_not_have_the_name_of_something_known(name):
    """`radius: 5 N` would be checked as the one and computed as the other."""
    with pytest.raises(InputError, match=f"line 6: own: parameter '{name}' has the name of a "
                                         '(variable|constant|function)'):
        model('k * strain', f'k: 5 N, {name}: 5 N')


def test_a_formula_of_the_force_acts_where_the_force_is_known():
    """Gearing that loses a tenth; as an elastic force, beside the others, there is none yet."""
    own = '  - own: {expression: "-k * force", parameters: {k: 0.1}'
    whole, less = loads_model(MESH), loads_model(f'{MESH}{own}}}\n')
    assert_allclose(less.force(0.05, [2e5]), 0.9 * whole.force(0.05, [2e5]))
    with pytest.raises(InputError, match="line 6: law own: argument 'force' is not known at "
                                         'place force, only at limit, loss'):
        loads_model(f'{MESH}{own}, place: force}}\n')


@pytest.mark.parametrize(('formula', 'told'), [
    ('k / 0', "'0' is always zero"), ('k / (1 - 1)', "'1 - 1' is always zero"),
    ('k / strain', "'strain' is zero near strain 0"),
    ('k * strain ** -1', "'strain' is zero near strain 0"),
    ('k / (strain - 0.1234)', "'strain - 0.1234' is zero near strain 0.112"),
    ('k * 1e5 * area / area / (pressure / 1 - 0 * pressure) * pressure', 'is zero near'),
    ('k / sin(strain)', "'sin(strain)' is zero near strain 0"),
    ('k / (1 - tanh(strain) / tanh(0.2))', 'is zero near strain 0.202'),
])
def test_a_division_by_zero_where_the_model_works_is_refused(formula, told):
    """One sentence with file, line, effect, formula, divisor and where it is zero."""
    with pytest.raises(InputError, match='line 6: own: .*divides by zero') as caught:
        model(formula)
    assert told in str(caught.value)


@pytest.mark.parametrize('formula', [
    'k / (1 + strain)', 'k * strain / 0.3', 'k / stretch', 'k * (strain + 1) ** -2',
    'k / (strain - 0.5)', 'k / (0.6 + abs(strain))', 'k * strain / max(strain, 1e-6)'])
def test_a_divisor_that_is_never_zero_there_is_taken(formula):
    """0.5 is no strain of a muscle, though units are checked at that value."""
    assert np.isfinite(model(formula).force(np.linspace(0, 0.45, 9), np.full((9, 1), 1e5))).all()


@pytest.mark.parametrize('formula', ['-' * 200 + 'k', '+'.join(['k'] * 100), 'k * 1' + '0' * 320,
                                     'k * 1e999', '(' * 99 + 'k' + ')' * 99 + '**-1**-1'])
def test_a_formula_has_a_bounded_size(formula):
    """Depth and numbers are bounded before anything is generated."""
    with pytest.raises(InputError, match='own: '):
        expression_law('own', formula, 'force', (newton('k'),))


@given(st.text(alphabet='abk_ .()[]{}"\'\\\n;:=,+-*/0123456789@!lambdaimport', max_size=40))
def test_any_text_is_refused_or_only_calculates(text):
    """What is generated names nothing but NumPy's words, felt quantities and p0, p1, ..."""
    try:
        law = expression_law('own', text, 'force', (newton('k'), newton('ab')))
    except InputError:
        return
    code = law.function.__code__
    words = {numpy for numpy, _ in FUNCTIONS.values()}
    assert set(code.co_names) <= {'np', 'pi', *words}
    assert set(code.co_varnames) <= {'p0', 'p1', *VARIABLES}
    assert all(isinstance(value, float) or value is None for value in code.co_consts)


def test_no_name_of_the_file_reaches_generated_source():
    """A hostile effect name or parameter name is data, in the law and in the composition."""
    evil = '__import__("os").system("touch owned")'
    law = expression_law(evil, 'exec_ * strain', 'force', (newton('exec_'),))
    text = composition((law,)).text
    source = inspect.getsource(law.function)
    assert re.fullmatch(r'def formula\(strain, p0\):\n    return \(p0 \* strain\)\n', source)
    assert 'import' not in text
    assert 'exec_' not in text + source
    loaded = loads_model(MESH + "  - '" + evil.replace("'", "''") +
                         "': {expression: 'k * strain', parameters: {k: 5 N}}\n")
    plain = loaded.without_effect(evil)
    assert_allclose(loaded.force(0.1, [1e5]) - plain.force(0.1, [1e5]), 0.5)


@given(strain=st.floats(0.0, 0.4), pressure=st.floats(0.0, 4e5))
def test_a_formula_gives_what_it_says(strain, pressure):
    """Operators, order and functions as Python has them."""
    bundle = model('k * (1 - 2 * strain) ** 3 / (1 + strain) - k * max(strain, 0.1) * sqrt(abs('
                   '-strain)) + -pressure * area * exp(-strain)')
    plain = bundle.without_effect('own')
    area = np.pi * 6.35e-3 ** 2
    said = 5 * (1 - 2 * strain) ** 3 / (1 + strain) - 5 * max(strain, 0.1) * np.sqrt(strain) \
        - pressure * area * np.exp(-strain)
    assert_allclose(bundle.force(strain, [pressure]) - plain.force(strain, [pressure]), said,
                    rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('formula', [
    'k * (-0.5) ** 2', 'k * -0.5 ** 2', 'k * (0.2 - 0.7) ** 3', 'k - -0.5 * k', '-k - (k - 2 * k)',
    'k / (0.25 - 0.75)', 'k / (2 * n) / n', 'k / (2 * (n / 4))', 'k - (1 - n) * k', '-(-k) * -1',
    'k * n ** -1', 'k * (-0.1 * n) ** 2', 'k * (n ** 2) ** 3', 'k * -(n ** 2)', '0 - k * -1'])
def test_a_formula_is_worked_out_as_it_is_written(formula):
    """Signs, powers and brackets: as Python does, on arrays and tick by tick."""
    bundle = model(formula, 'k: 5 N, n: 2')
    plain = bundle.without_effect('own')
    expected = eval(formula, {'k': 5.0, 'n': 2.0})
    pressure = np.array([2e5])
    assert bundle.force(0.1, pressure) - plain.force(0.1, pressure) == pytest.approx(expected)
    one, other = (each.step(each.start_state(), 0.0, 0.1, pressure)[0][0]
                  for each in (bundle, plain))
    assert one - other == pytest.approx(expected)


OPERATIONS = {
    '+': operator.add, '-': operator.sub, '*': operator.mul, '/': operator.truediv,
    '**': operator.pow, '<': operator.lt, '<=': operator.le, '>': operator.gt, '>=': operator.ge,
    '==': operator.eq, '!=': operator.ne, '|': operator.or_, '&': operator.and_,
    'neg': operator.neg}


@pytest.mark.parametrize('name', ['+', '-', '*', '/', '**'])
def test_what_is_simplified_keeps_its_value(name):
    """Zeros, ones and signs may go where that is exact, on either side, and nothing else."""
    graph, values = Graph(), {'a': 3.0, 'b': 0.5}
    a, b = map(graph.argument, values)
    sides = [('a', a), ('-a', -a), ('a - b', a - b), ('-(a * b)', -(a * b)), *(
        (str(number), graph.constant(number)) for number in (-2.0, -1.0, 0.0, 1.0, 2.0))]
    for (first, left), (second, right) in itertools.product(sides, sides):
        meant = [eval(side, values) for side in (first, second)]
        if (name == '/' and not meant[1]) or (name == '**' and meant[0] <= 0.0):
            continue
        node = graph.make(name, left, right)
        writer, names = Writer([node], []), dict(values)
        exec('\n'.join(writer.lines), names)
        assert eval(writer.text(node), names) == pytest.approx(
            OPERATIONS[name](*meant), rel=1e-15), (first, second)


@pytest.mark.parametrize('outer', list(OPERATIONS)[:-1])
@pytest.mark.parametrize('inner', list(OPERATIONS)[:-1])
def test_parentheses_stand_where_the_value_needs_them(outer, inner):
    """An operation in another, on either side, negated or not: Python reads what was meant."""
    def nested(make, a, b, c):
        """Return each way to nest the two, where there is one."""
        for way in (lambda: make(outer, make(inner, a, b), c),
                    lambda: make(outer, a, make(inner, b, c)),
                    lambda: make(outer, make('neg', make(inner, a, b)), c),
                    lambda: make(outer, make('neg', a), make('neg', make(inner, b, c)))):
            try:
                yield way()
            except (TypeError, ZeroDivisionError):   # bits of a fraction, over a comparison
                yield None

    graph = Graph()
    formulas = [Writer([node], []).text(node) for node in nested(
        graph.make, *map(graph.argument, 'abc'))]
    for values in ((7, 2, 3), (2, 3, 2), (1, 1, 4)):
        meant = nested(lambda name, *of: OPERATIONS[name](*of), *values)
        for text, value in zip(formulas, meant, strict=True):
            assert value is None or eval(text, dict(zip('abc', values))) == value, text
