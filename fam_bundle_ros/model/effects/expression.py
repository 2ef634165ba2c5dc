# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Effects that a user writes in the model file as a formula, checked for units and never `eval`ed.

The text is parsed by Python's grammar into a tree of which only arithmetic on known names and a
few functions is accepted; the tree is walked with NumPy arrays, or with pint quantities once, to
see that the result has the unit of the place where the effect acts.
"""

import ast
from collections.abc import Callable, Mapping
import operator
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.effects.base import Effect, GeometryChange, Parameter, Place
from fam_bundle_ros.units import registry

_MAX_LENGTH = 500
_MAX_POWER = 12

#: What a formula may name, and the SI unit of each.
VARIABLES = {
    'strain': '', 'strain_rate': '1/s', 'pressure': 'Pa', 'force': 'N', 'time': 's',
    'stretch': '', 'radius': 'm', 'length': 'm', 'area': 'm**2', 'pi': '',
}
#: Places where a formula may act, and the unit that its result must have.
RESULTS = {'force': 'N', 'loss': 'N', 'limit': 'N', 'pressure': 'Pa', 'geometry': ''}

_BINARY: dict[Any, Callable] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: operator.pow}
_UNARY: dict[Any, Callable] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
#: What a formula may call: the function and its number of arguments.
FUNCTIONS: dict[str, tuple[Callable, int]] = {
    'abs': (np.abs, 1), 'sqrt': (np.sqrt, 1), 'exp': (np.exp, 1), 'log': (np.log, 1),
    'tanh': (np.tanh, 1), 'sin': (np.sin, 1), 'cos': (np.cos, 1), 'sign': (np.sign, 1),
    'min': (np.minimum, 2), 'max': (np.maximum, 2),
}


class Expression(Effect):
    """
    An effect given by a formula such as ``-k * strain_rate``.

    Made by `expression_class`, which puts the formula and its parameters on a subclass.
    """

    family = 'user'
    source = 'formula in the model file'
    formula: str
    _tree: ast.expr

    def contribution(self, x):
        values = dict(self.values)
        g = x.geometry
        values.update(strain=x.strain, strain_rate=x.strain_rate, pressure=x.pressure,
                      force=x.force, time=x.time, stretch=1.0 - x.strain, radius=g.radius,
                      length=g.length, area=g.area, pi=np.pi)
        with np.errstate(all='ignore'):
            result = _walk(self._tree, values)
        return GeometryChange(strain=result) if self.place is Place.GEOMETRY else result

    def options(self):
        return {'expression': self.formula, 'place': self.place.value}

    def __reduce__(self):
        """Let worker processes have it: the class is made at run time and cannot be imported."""
        return _remake, (self.name, self.formula, self.place.value, self.parameters,
                         self.values, self.bounds, self.intervals)


def expression_class(name: str, formula: str, place: str, parameters: tuple[Parameter, ...]):
    """
    Return an Effect class for a formula.

    Parameters
    ----------
    name : str
        Name of the effect.
    formula : str
        Arithmetic (+ - * / **) on `VARIABLES`, the parameters and the functions abs, sqrt, exp,
        log, tanh, sin, cos, sign, min, max.
    place : str
        One of `RESULTS`; a limit is a floor of the force, a geometry formula adds to the strain.
    parameters : tuple of Parameter

    Raises
    ------
    InputError
        When the formula has anything else in it, or its unit does not fit the place.
    """
    if place not in RESULTS:
        raise InputError(f"{name}: place '{place}' is not one of {', '.join(RESULTS)}")
    tree = _parse(name, formula, {p.name for p in parameters})
    _check_units(name, tree, place, parameters)
    return type('Expression_' + name, (Expression,), {
        'name': name, 'summary': formula, 'place': Place(place), 'parameters': parameters,
        'formula': formula, '_tree': tree, 'signature': f'the error has the shape of {formula}',
        '__doc__': f'F = {formula}.'})


def _remake(name, formula, place, parameters, values, bounds, intervals):
    effect = expression_class(name, formula, place, parameters)().replace(**values)
    effect.bounds, effect.intervals = bounds, intervals
    return effect


def _parse(name, formula, parameters):
    if not isinstance(formula, str) or len(formula) > _MAX_LENGTH:
        raise InputError(f'{name}: expression must be a text of at most {_MAX_LENGTH} characters')
    try:
        tree = ast.parse(formula.strip(), mode='eval').body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"{name}: expression '{formula}' cannot be read") from error
    _check(name, tree, parameters | set(VARIABLES))
    return tree


def _check(name, node, names):
    """Refuse every piece of syntax that is not arithmetic."""
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        if isinstance(node.op, ast.Pow):
            power = node.right.operand if isinstance(node.right, ast.UnaryOp) else node.right
            if not (isinstance(power, ast.Constant) and isinstance(power.value, (int, float))
                    and abs(power.value) <= _MAX_POWER):
                raise InputError(f'{name}: a power must be a number of at most {_MAX_POWER}')
        _check(name, node.left, names)
        _check(name, node.right, names)
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        _check(name, node.operand, names)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id not in FUNCTIONS:
            raise InputError(f"{name}: function '{node.func.id}' is not one of "
                             f"{', '.join(FUNCTIONS)}")
        if len(node.args) != FUNCTIONS[node.func.id][1]:
            raise InputError(f"{name}: function '{node.func.id}' takes "
                             f'{FUNCTIONS[node.func.id][1]} argument(s)')
        for argument in node.args:
            _check(name, argument, names)
    elif isinstance(node, ast.Name):
        if node.id not in names:
            raise InputError(f"{name}: '{node.id}' is not known; an expression may use "
                             f"{', '.join(sorted(names))}")
    elif not (isinstance(node, ast.Constant) and isinstance(node.value, (int, float))
              and not isinstance(node.value, bool)):
        raise InputError(f'{name}: only arithmetic is allowed in an expression, not '
                         f'{type(node).__name__}')


def _walk(node: Any, values: Mapping[str, Any]) -> Any:
    """Return the value of a tree that `_check` has passed."""
    if isinstance(node, ast.BinOp):
        return _BINARY[type(node.op)](_walk(node.left, values), _walk(node.right, values))
    if isinstance(node, ast.UnaryOp):
        return _UNARY[type(node.op)](_walk(node.operand, values))
    if isinstance(node, ast.Call):
        function: Any = node.func
        return FUNCTIONS[function.id][0](*(_walk(a, values) for a in node.args))
    if isinstance(node, ast.Name):
        return values[node.id]
    return float(node.value)


def _check_units(name, tree, place, parameters):
    """Walk the tree once with pint quantities: the dimensions must come out right."""
    ureg = registry()
    values: dict[str, Any] = {key: ureg.Quantity(0.5, unit or 'dimensionless')
                              for key, unit in VARIABLES.items()}
    for parameter in parameters:
        unit = parameter.unit if parameter.unit not in ('', '1') else 'dimensionless'
        values[parameter.name] = ureg.Quantity(0.5, unit).to_base_units()
    wanted = ureg.Quantity(1.0, RESULTS[place] or 'dimensionless')
    try:
        with np.errstate(all='ignore'):
            result = _walk(tree, values)
        result = ureg.Quantity(result)
    except Exception as error:  # pint raises DimensionalityError and several others
        raise InputError(f'{name}: units do not fit in the expression ({error})') from error
    if result.dimensionality != wanted.dimensionality:
        raise InputError(f"{name}: the expression gives {result.units:~} but a {place} effect "
                         f"must give {RESULTS[place] or 'a pure number'}")
