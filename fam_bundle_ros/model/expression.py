# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Laws that a user writes as a formula in the model file.

The text is parsed with Python's grammar; only arithmetic on known names and a few functions is
accepted. The tree is evaluated once with pint quantities, to check the unit of the result, and is
converted to the source of a plain function. That source is written from the checked tree, never
from the text, and has no names from the file: parameters are called p0, p1, ...
"""

import ast
from collections.abc import Callable, Mapping
from functools import lru_cache
import operator
import re
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.laws.base import Law, Parameter, Part, Place
from fam_bundle_ros.model.source import defined
from fam_bundle_ros.units import registry

_MAX_LENGTH = 500
_MAX_DEPTH = 60
_MAX_POWER = 12

#: Variables of a formula and their SI units.
VARIABLES = {
    'strain': '', 'strain_rate': '1/s', 'pressure': 'Pa', 'force': 'N', 'time': 's',
    'stretch': '', 'radius': 'm', 'length': 'm', 'area': 'm**2', 'pi': '',
}
#: Places where a formula may act, and the unit of its result.
RESULTS = {'force': 'N', 'loss': 'N', 'limit': 'N', 'pressure': 'Pa', 'geometry': ''}
#: Functions of a formula: NumPy's name, and the number of arguments.
FUNCTIONS = {'abs': ('abs', 1), 'sqrt': ('sqrt', 1), 'exp': ('exp', 1), 'log': ('log', 1),
             'tanh': ('tanh', 1), 'sin': ('sin', 1), 'cos': ('cos', 1), 'sign': ('sign', 1),
             'min': ('minimum', 2), 'max': ('maximum', 2)}

_BINARY: dict[Any, tuple[Callable, str]] = {
    ast.Add: (operator.add, '+'), ast.Sub: (operator.sub, '-'), ast.Mult: (operator.mul, '*'),
    ast.Div: (operator.truediv, '/'), ast.Pow: (operator.pow, '**')}
_UNARY: dict[Any, tuple[Callable, str]] = {ast.USub: (operator.neg, '-'),
                                           ast.UAdd: (operator.pos, '+')}


def usual_place(formula: str) -> str:
    """Return where a formula acts unless told: only there force and rate make sense."""
    return 'loss' if {'force', 'strain_rate'} & set(re.findall(r'\w+', formula)) else 'force'


@lru_cache(maxsize=256)
def expression_law(name: str, formula: str, place: str, parameters: tuple[Parameter, ...]) -> Law:
    """
    Return a law for a formula.

    Parameters
    ----------
    name : str
        Name of the law.
    formula : str
        Arithmetic (+ - * / **) on `VARIABLES`, the parameters and `FUNCTIONS`.
    place : str
        One of `RESULTS`; a limit is the lowest force, a geometry formula adds to the strain.
    parameters : tuple of Parameter
        Each with its name.

    Raises
    ------
    InputError
        If the formula has anything else in it, a parameter has the name of a variable or
        function, the formula divides by a constant zero, its unit does not fit the place, or it
        has a variable that is not known there.
    """
    if place not in RESULTS:
        raise InputError(f"{name}: place '{place}' is not one of {', '.join(RESULTS)}")
    for parameter in parameters:
        known = ('constant' if parameter.name == 'pi' else
                 'variable' if parameter.name in VARIABLES else
                 'function' if parameter.name in FUNCTIONS else '')
        if known:
            raise InputError(
                f"{name}: parameter '{parameter.name}' has the name of a {known} that every "
                f'expression knows; give it another name')
    own = {parameter.name: f'p{k}' for k, parameter in enumerate(parameters)}
    tree = _parse(name, formula, set(own))
    _check_units(name, tree, place, parameters)
    return Law(
        name=name, summary=formula, source='formula in the model file', family='user',
        signature=f'the error has the shape of {formula}', formula=formula,
        parts=(Part(Place(place), _function(tree, own),
                    'strain' if place == 'geometry' else ''),),
        parameters=parameters, names={short: key for key, short in own.items()},
        remake=(expression_law, (name, formula, place, parameters)))


def check_division(effect: Effect, strain: float, pressure: float, geometry: Any) -> None:
    """
    Raise InputError if the formula of an effect divides by zero in the range of a model.

    Parameters
    ----------
    effect : Effect
        Effects without a formula are not checked.
    strain, pressure : float, and Pa
        The range is from zero to these values; rate and force have both signs, time is positive.
    geometry : Geometry
        Of one muscle.

    Raises
    ------
    InputError
        Names the divisor and where it is zero.
    """
    if not effect.law.formula:
        return
    tree = ast.parse(effect.law.formula.strip(), mode='eval').body
    divisors = [node for node in map(_divisor, ast.walk(tree)) if node is not None]
    if not divisors:
        return
    names = ('strain', 'pressure', 'strain_rate', 'force', 'time')
    largest = geometry.area * pressure * 5.0
    grid = np.meshgrid(np.linspace(0.0, strain, 21), np.linspace(0.0, pressure, 11),
                       [-1.0, -1e-3, 0.0, 1e-3, 1.0], [-largest, 0.0, largest], [0.0, 1.0, 1e3],
                       indexing='ij')
    values: dict[str, Any] = {**dict(zip(names, grid)), **effect.values, 'pi': np.pi,
                              'stretch': 1.0 - grid[0], 'radius': geometry.radius,
                              'length': geometry.length, 'area': geometry.area}
    for node in divisors:
        with np.errstate(all='ignore'):
            divisor = np.broadcast_to(_walk(node, values), grid[0].shape)
        if np.isnan(divisor).all() or np.nanmin(divisor) > 0.0 or np.nanmax(divisor) < 0.0:
            continue
        used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        at = np.unravel_index(np.nanargmin(np.abs(divisor)), divisor.shape)
        where = ', '.join(f'{name} {grid[k][at]:.3g}' for k, name in enumerate(names)
                          if name in used or name == 'strain' and 'stretch' in used)
        raise InputError(f"{effect.name}: '{effect.law.formula}' divides by zero: "
                         f"'{ast.unparse(node)}' is zero {f'near {where}' if where else 'always'}"
                         ', within the range of the model')


def _divisor(node):
    """Return the divisor of a node of a tree; None if it is not a division."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        return node.right
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) \
            and isinstance(node.right, ast.UnaryOp) and isinstance(node.right.op, ast.USub):
        return node.left
    return None


def _parse(name, formula, parameters):
    if not isinstance(formula, str) or len(formula) > _MAX_LENGTH:
        raise InputError(f'{name}: expression must be a text of at most {_MAX_LENGTH} characters')
    try:
        tree = ast.parse(formula.strip(), mode='eval').body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"{name}: expression '{formula}' cannot be read") from error
    _check(name, tree, parameters | set(VARIABLES), _MAX_DEPTH)
    return tree


def _check(name, node, names, depth):
    """Raise InputError for any syntax that is not arithmetic."""
    if not depth:
        raise InputError(f'{name}: expression is nested more than {_MAX_DEPTH} deep')
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        if isinstance(node.op, ast.Pow):
            power: Any = node.right
            power = power.operand if isinstance(power, ast.UnaryOp) else power
            if not (_is_number(power) and abs(power.value) <= _MAX_POWER):
                raise InputError(f'{name}: a power must be a number of at most {_MAX_POWER}')
        _check(name, node.left, names, depth - 1)
        _check(name, node.right, names, depth - 1)
        divisor = _divisor(node)
        if divisor is not None and not any(isinstance(n, ast.Name) and n.id not in FUNCTIONS
                                           for n in ast.walk(divisor)):
            with np.errstate(all='ignore'):
                if _walk(divisor, {}) == 0.0:
                    raise InputError(f'{name}: the expression divides by zero: '
                                     f"'{ast.unparse(divisor)}' is always zero")
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        _check(name, node.operand, names, depth - 1)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id not in FUNCTIONS:
            raise InputError(f"{name}: function '{node.func.id}' is not one of "
                             f"{', '.join(FUNCTIONS)}")
        if len(node.args) != FUNCTIONS[node.func.id][1]:
            raise InputError(f"{name}: function '{node.func.id}' takes "
                             f'{FUNCTIONS[node.func.id][1]} argument(s)')
        for argument in node.args:
            _check(name, argument, names, depth - 1)
    elif isinstance(node, ast.Name):
        if node.id not in names:
            raise InputError(f"{name}: '{node.id}' is not known; an expression may use "
                             f"{', '.join(sorted(names))}")
    elif not _is_number(node):
        raise InputError(f'{name}: only arithmetic is allowed in an expression, not '
                         f'{type(node).__name__}')
    elif not abs(node.value) <= 1e300:
        raise InputError(f'{name}: a number in the expression is too large')


def _is_number(node):
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def _walk(node: Any, values: Mapping[str, Any]) -> Any:
    """Return the value of a tree that `_check` has passed."""
    if isinstance(node, ast.BinOp):
        return _BINARY[type(node.op)][0](_walk(node.left, values), _walk(node.right, values))
    if isinstance(node, ast.UnaryOp):
        return _UNARY[type(node.op)][0](_walk(node.operand, values))
    if isinstance(node, ast.Call):
        function: Any = node.func
        return getattr(np, FUNCTIONS[function.id][0])(*(_walk(a, values) for a in node.args))
    if isinstance(node, ast.Name):
        return values[node.id]
    return np.float64(node.value)


def _source(node: Any, own: Mapping[str, str]) -> str:
    """Return the source of a tree that `_check` has passed, with parameters renamed."""
    if isinstance(node, ast.BinOp):
        operator_text = _BINARY[type(node.op)][1]
        return f'({_source(node.left, own)} {operator_text} {_source(node.right, own)})'
    if isinstance(node, ast.UnaryOp):
        return f'({_UNARY[type(node.op)][1]}{_source(node.operand, own)})'
    if isinstance(node, ast.Call):
        function: Any = node.func
        arguments = ', '.join(_source(argument, own) for argument in node.args)
        return f'np.{FUNCTIONS[function.id][0]}({arguments})'
    if isinstance(node, ast.Name):
        return own.get(node.id) or ('np.pi' if node.id == 'pi' else node.id)
    return repr(float(node.value))


def _function(tree: ast.expr, own: Mapping[str, str]) -> Callable:
    """Return the plain function of a tree."""
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    arguments = [name for name in VARIABLES if name in used and name != 'pi'] + [*own.values()]
    text = f'def formula({", ".join(arguments)}):\n    return {_source(tree, own)}\n'
    return defined(text, 'formula', {'np': np})


def _check_units(name, tree, place, parameters):
    """Evaluate the tree with pint quantities; raise InputError if the units do not fit."""
    ureg = registry()
    half = np.float64(0.5)  # not a Python float, which raises ZeroDivisionError
    values: dict[str, Any] = {key: ureg.Quantity(half, unit or 'dimensionless')
                              for key, unit in VARIABLES.items()}
    for parameter in parameters:
        unit = parameter.unit if parameter.unit not in ('', '1') else 'dimensionless'
        values[parameter.name] = ureg.Quantity(half, unit).to_base_units()
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
