# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Derivatives generated from the source of a law."""

import traceback
import types

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.model.derivative import partials
from fam_bundle_ros.model.laws.base import arguments
from fam_bundle_ros.model.vocabulary import bound

#: NumPy's vocabulary for a complex step: NumPy orders complex numbers by their real part first.
COMPLEX = types.SimpleNamespace(
    maximum=np.maximum, minimum=np.minimum, where=np.where, sqrt=np.sqrt, exp=np.exp, log=np.log,
    expm1=np.expm1, tanh=np.tanh, sin=np.sin, cos=np.cos, pi=np.pi,
    abs=lambda a: np.where(np.real(a) < 0.0, -a, a),
    inf=np.inf, sign=lambda a: np.sign(np.real(a)))


def complex_step(function, values, name, output=0):
    """Return an exact derivative of a function by a step of 1e-30 along the imaginary axis."""
    def rebound(each):
        names = {key: rebound(item) if isinstance(item, types.FunctionType) else item
                 for key, item in each.__globals__.items()
                 if key in each.__code__.co_names}
        return types.FunctionType(each.__code__, {**names, 'np': COMPLEX}, each.__name__,
                                  each.__defaults__)
    values = {key: np.float64(value) if isinstance(value, float) else value
              for key, value in values.items()}
    values[name] = values[name] + 1e-30j
    result = rebound(function)(**values)
    result = result[output] if isinstance(result, tuple) else result
    return np.imag(result) / 1e-30


def _square_of(x):
    return x * x


def _both(x, y):
    total = x + y
    return total, x - y


# formulas with every operation of the vocabulary, smooth and _kinked

def _rational(x, y):
    return (x - 2.0 * y) / (1.0 + x * x) - -x / (y + 3.0) + (x - y) * (y - x)


def _transcendental(x, y):
    return np.exp(-x) * np.sin(y) + np.log(x + 4.0) / np.cos(0.3 * y) - np.tanh(x * y)


def _powers(x, y):
    grouped = ((x + 5.0) ** 0.7) ** y + (x + 5.0) ** (y ** 2)
    return x ** 3 + 2.0 * x ** 2.0 - (x + 5.0) ** -1.5 + (y + 5.0) ** x + grouped


def _roots(x, y):
    size = np.sqrt(x * x + 1.0)
    return size * np.expm1(y / size)


def _kinked(x, y):
    lower = np.minimum(np.maximum(x, 0.2 * y), np.inf)
    return np.abs(lower) * np.minimum(lower, y) + np.sign(x) * y


def _branched(x, y):
    far = (x > 0.3) & (y < 1.0) | ~(x >= -1.0)
    return np.where(far, x * y, np.where(x == y, 1.0, x - y * y))


def _helped(x, y):
    s, d = _both(_square_of(x), y)
    s += d
    return s * _square_of(x=d)


FORMULAS = [_rational, _transcendental, _powers, _roots, _kinked, _branched, _helped]
NUMBERS = st.floats(-2.9, 2.9, allow_subnormal=False).filter(lambda x: abs(x) > 1e-3)


@pytest.mark.parametrize('formula', FORMULAS)
@given(x=NUMBERS, y=NUMBERS)
@settings(deadline=None)
def test_partials_are_those_of_a_complex_step(formula, x, y):
    """Every operation and function has its exact derivative, through helper functions too."""
    assume(x not in (y, 0.2 * y, 0.3, -1.0) and y != 1.0)  # kinks have tests of their own
    slopes = partials(formula, ('x', 'y'))
    result = slopes.function(np.float64(x), np.float64(y))
    for (_, name), slope in zip(slopes.entries, result[1:], strict=True):
        exact = complex_step(formula, {'x': x, 'y': y}, name)
        assert slope == pytest.approx(exact, rel=1e-12, abs=1e-12 * (1.0 + abs(result[0])))


def _of_laws():
    """Return every function of a law; a table has no meaning at a random place in it."""
    parts = [part for law in catalogue.available().values() for part in law.parts
             if law.load is None]
    return [function for part in parts for function in (part.function, part.equilibrium)
            if function is not None]


#: Values of each argument that are tried at once.
MANY = 100


def _likely(name, law, draw):
    """Return values within the bounds of a parameter, or such as a muscle may have, (MANY,)."""
    def between(low, high):
        return draw.uniform(low, high, MANY)

    if name in law.names:
        p = law.parameter(law.names[name])
        return between(p.lower, p.upper) * p.scale
    ranges = {'dt': (1e-3, 0.1), 'pressure': (-2e4, 6e5), 'strain': (-0.05, 0.4),
              'bladder': (-50.0, 0.0), 'time': (0.0, 100.0), 'lagged': (0.0, 6e5),
              'last': (0.0, 6e5), 'braid': (1.0, 1.1), 'length': (0.05, 0.5),
              'radius': (2e-3, 2e-2), 'area': (1e-5, 1e-3), 'stretch': (0.6, 1.05),
              'cos2': (0.6, 0.9), 'sin2': (0.1, 0.4), 'cot2': (1.5, 9.0),
              'wall_area': (1e-6, 1e-4)}
    others = {'unit': lambda: int(draw.integers(0, 4)), 'start': lambda: draw.random(MANY) < 0.2,
              'log_start': lambda: draw.random(MANY) < 0.1,
              'strain_rate': lambda: draw.normal(size=MANY),
              'force': lambda: 100.0 * draw.normal(size=MANY)}
    return others[name]() if name in others else between(*ranges.get(name, (0.0, 0.3)))


@pytest.mark.parametrize('function', _of_laws(), ids=lambda function: function.__name__)
@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=5)
def test_every_law_has_its_exact_partial_derivatives(function, seed):
    """Each derivative of each output of each law is that of a complex step."""
    law = next(law for law in catalogue.available().values() for part in law.parts
               if function in (part.function, part.equilibrium))
    draw = np.random.default_rng(seed)
    values = {name: _likely(name, law, draw) for name in arguments(function)}
    moving = tuple(name for name in values if name not in (
        'unit', 'start', 'log_start', 'dt', 'time', 'strain_rate'))
    slopes = partials(function, moving)
    result = slopes.function(**values)
    found = dict(zip(slopes.entries, result[slopes.outputs:], strict=True))
    for output in range(slopes.outputs):
        for name in moving:
            exact = complex_step(function, values, name, output)
            # terms that cancel leave their rounding
            rounding = 1e-8 / np.maximum(np.abs(values[name]), 1.0)
            off = np.abs(found.get((output, name), 0.0) - exact)
            assert np.all(off <= 1e-9 * np.abs(exact) + rounding), (output, name)


@pytest.mark.parametrize('formula', FORMULAS)
@given(x=NUMBERS, y=NUMBERS)
@settings(deadline=None)
def test_value_is_the_law_s_own_to_the_last_bit(formula, x, y):
    """Reading and writing a formula changes no rounding."""
    x, y = np.float64(x), np.float64(y)
    for by in (('x',), ()):
        assert partials(formula, by).function(x, y)[0] == formula(x, y)


@pytest.mark.parametrize('formula', FORMULAS)
def test_arrays_and_compiled_numbers_give_the_same(formula):
    """One text runs on arrays and, where numba is there, compiled."""
    slopes = partials(formula, ('x', 'y')).function
    x, y = np.random.default_rng(3).uniform(-2.0, 2.0, (2, 50))
    rows = np.array(np.broadcast_arrays(*slopes(x, y))).T
    plain = [slopes(np.float64(a), np.float64(b)) for a, b in zip(x, y, strict=True)]
    assert rows == pytest.approx(np.array(plain), rel=1e-14)
    if kernels.numba() is not None:
        fast = kernels.numba().njit(_over_rows(slopes))
        out = np.empty_like(rows)
        fast(x, y, out)
        assert out == pytest.approx(rows, rel=1e-13)


def _over_rows(slopes):
    inner = kernels.compiled_inside(bound(slopes, 'kernels'))

    def over_rows(x, y, out):
        for k in range(len(x)):
            for i, value in enumerate(inner(x[k], y[k])):
                out[k, i] = value
    return over_rows


def test_memory_fields_have_slopes_of_their_own():
    """A law with memory returns its memory after the tick: each output is differentiated."""
    slopes = partials(_both, ('x', 'y'))
    assert slopes.outputs == 2
    assert slopes.entries == ((0, 'x'), (0, 'y'), (1, 'x'), (1, 'y'))
    assert slopes.function(3.0, 4.0) == (7.0, -1.0, 1.0, 1.0, 1.0, -1.0)


def test_slopes_that_are_zero_everywhere_are_left_out():
    """What a law does not depend on costs nothing in the chain rule."""
    def sided(strain, pressure):
        return np.sign(strain) * pressure
    assert partials(sided, ('strain', 'pressure')).entries == ((0, 'pressure'),)
    assert partials(sided, ('strain',)).entries == ()


def test_common_subexpressions_are_worked_out_once():
    """An exponential that value and slopes share is taken once."""
    def decay(x, rate):
        return np.exp(-x * rate) + 2.0 * np.exp(-x * rate) * x
    assert partials(decay, ('x', 'rate')).source.count('np.exp') == 1


def _root_or_zero(x):
    return np.where(x > 0.0, np.sqrt(x) / x, 0.0) * 2.0


def _zero_or_root(x):
    return np.where(x <= 0.0, 0.0, np.sqrt(x) / x) * 2.0


@pytest.mark.parametrize('shifted_root', [_root_or_zero, _zero_or_root])
def test_branch_that_is_not_taken_has_no_say(shifted_root):
    """A root of a negative number in the other branch does not make the slope nan."""
    with np.errstate(all='ignore'):
        slope = partials(shifted_root, ('x',)).function(np.array([-1.0, 0.0, 4.0]))[1]
    assert list(slope) == [0.0, 0.0, pytest.approx(-0.125)]


def _power_of_speed(speed, size, exponent):
    return -size * np.sign(speed) * np.abs(speed) ** exponent


@pytest.mark.parametrize('exponent', [0.5, 1.0, 1.7])
def test_power_law_at_rest_has_finite_slopes(exponent):
    """At zero speed |v|**n has slope zero in n and in the size, and no nan in the speed."""
    result = partials(_power_of_speed, ('speed', 'size', 'exponent')).function(0.0, 3.0, exponent)
    assert np.all(np.isfinite(result))
    assert result[2:] == (0.0, 0.0)


def _compared(x, y):
    return np.where(x <= y, x, 0.0) + np.where(x >= y, 2.0 * x, 0.0) + np.where(
        x < y, 4.0, 0.0) + np.where(x > y, 8.0, 0.0) + np.where(x != y, 16.0, 0.0)


@pytest.mark.parametrize('x', [1.0, 2.0, 3.0])
def test_comparisons_are_read_as_they_stand(x):
    """At, below and above the point where a comparison changes."""
    assert partials(_compared, ('x',)).function(x, 2.0)[0] == _compared(x, 2.0)


def test_a_table_is_differentiated_within_its_cell():
    """The index into a table has no slope, the position in the cell has."""
    surface = catalogue.get('measured_surface').function
    assert partials(surface, ('strain', 'pressure')).entries == ((0, 'strain'), (0, 'pressure'))


def _highest(x, y):
    return np.maximum(x, y)


def _lowest(x, y):
    return np.minimum(x, y)


@pytest.mark.parametrize('formula', [_highest, _lowest])
def test_at_a_tie_the_first_argument_counts(formula):
    """Where both are equal the slope is that of the first one."""
    slopes = partials(formula, ('x', 'y'))
    assert dict(zip(slopes.entries, slopes.function(2.0, 2.0)[1:], strict=True)) == {
        (0, 'x'): 1.0, (0, 'y'): 0.0}


def test_traceback_shows_the_generated_line():
    """An error inside a generated function shows its text."""
    def quotient(x, y):
        return x / y
    try:
        partials(quotient, ('y',)).function(1.0, 0.0)
    except ZeroDivisionError as error:
        shown = ''.join(traceback.format_exception(error))
    assert 't1 = x / y' in shown or 'x / y' in shown


def _looped(x):
    while x > 1.0:
        x = x / 2.0
    return x


def _unknown_function(x):
    return np.arctan(x)


def _sliced(x):
    return x[0:1]


@pytest.mark.parametrize('function', [_looped, _unknown_function, _sliced])
def test_what_is_no_straight_line_arithmetic_is_refused(function):
    """The message names the function and the piece of source."""
    with pytest.raises(NotImplementedError, match=f'{function.__name__}.*line'):
        partials(function, ('x',))


def test_source_that_is_not_there_is_refused():
    """A function without source has no derivative here; the caller may take differences."""
    names: dict = {}
    exec('def typed(x):\n    return x', names)
    with pytest.raises(NotImplementedError, match='typed: its source'):
        partials(names['typed'], ('x',))
