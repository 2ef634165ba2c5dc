# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Automatic differentiation of laws, by generation of source code.

A law is straight-line code with NumPy's functions. Its source is parsed to a graph, the graph is
differentiated, and the result is written as the source of a function that takes the same
arguments and returns the law's outputs followed by all partial derivatives that are not zero.
They are exact to rounding. The generated function runs like the law itself: on arrays, on Python
floats, or compiled. Tracebacks show its lines.

>>> def rope(strain, stiffness):
...     return -stiffness * np.maximum(strain, 0.0)
>>> slopes = partials(rope, ('strain', 'stiffness'))
>>> slopes.entries
((0, 'strain'), (0, 'stiffness'))
>>> [float(number) for number in slopes.function(0.1, 50.0)]
[-5.0, -50.0, -0.1]
"""

import ast
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
import inspect
import textwrap
import types

import numpy as np

from fam_bundle_ros.model.graph import FUNCTIONS, Graph, Node, Writer
from fam_bundle_ros.model.source import defined
from fam_bundle_ros.model.vocabulary import cell

_BINARY = {ast.Add: '+', ast.Sub: '-', ast.Mult: '*', ast.Div: '/', ast.Pow: '**',
           ast.BitAnd: '&', ast.BitOr: '|'}
_COMPARE = {ast.Lt: '<', ast.LtE: '<=', ast.Gt: '>', ast.GtE: '>=', ast.Eq: '==',
            ast.NotEq: '!='}
#: Functions that are nodes of the graph, not parsed.
_BUILT_IN = {abs: 'np.abs', max: 'np.maximum', min: 'np.minimum', int: 'int', cell: 'cell'}


@dataclass(frozen=True)
class Partials:
    """
    A law's outputs and their partial derivatives.

    Parameters
    ----------
    function : callable
        Takes the law's arguments, returns a tuple: the outputs, then the partial derivatives.
    outputs : int
        Number of outputs: 1, and one more for each memory field.
    entries : tuple of (int, str)
        Output and argument of each partial derivative; those that are zero everywhere are left
        out.
    source : str
        Text of the function.
    """

    function: Callable
    outputs: int
    entries: tuple[tuple[int, str], ...]
    source: str


@lru_cache(maxsize=1024)
def partials(function: Callable, arguments: tuple[str, ...]) -> Partials:
    """
    Return the function that computes a law's value and its partial derivatives.

    Parameters
    ----------
    function : callable
        Straight-line code: assignments and one return; + - * / **, comparisons, calls of
        NumPy's vocabulary (`FUNCTIONS`) and of other such functions by name, numbers.
    arguments : tuple of str
        Arguments of the function to differentiate by.

    Returns
    -------
    Partials
        Common subexpressions are computed once. For derivatives at kinks see `Graph.slopes`.

    Raises
    ------
    NotImplementedError
        If the source is not available or has other statements; names the line.
    """
    graph = Graph()
    names = list(inspect.signature(function).parameters)
    outputs = _Reader(graph).call(function, [graph.argument(name) for name in names])
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    entries, slopes = [], []
    for number, output in enumerate(outputs):
        for name, slope in graph.slopes(output, arguments).items():
            if not slope.hint and slope.inputs:
                slope.hint = f'by_{name}' if number == 0 else f'after{number}_by_{name}'
            entries.append((number, name))
            slopes.append(slope)
    results = [*outputs, *slopes]
    writer = Writer(results, [*names, 'np'])
    listed = ', '.join(f'{name} of output {number}' if len(outputs) > 1 else name
                       for number, name in entries)
    text = '\n    '.join([
        f'def {function.__name__}_partials({", ".join(names)}):',
        *textwrap.wrap(f'"""Outputs of {function.__name__}, then their slopes by {listed}."""',
                       90, subsequent_indent='    '),
        *writer.lines,
        *textwrap.wrap(f'return ({", ".join(map(writer.text, results))},)', 90,
                       subsequent_indent='        ')]) + '\n'
    return Partials(defined(text, f'{function.__name__}_partials', {'np': np, 'cell': cell}),
                    len(outputs), tuple(entries), text)


class _Reader:
    """Evaluates the source of a function with nodes instead of numbers."""

    def __init__(self, graph: Graph):
        self._graph = graph

    def call(self, function, inputs, keywords=None):
        """Return the result of a function for nodes: a node or a tuple of nodes."""
        bound = inspect.signature(function).bind(*inputs, **(keywords or {}))
        bound.apply_defaults()
        scope = dict(bound.arguments)
        for statement in _tree(function).body:
            if isinstance(statement, ast.Return) and statement.value is not None:
                return self._value(statement.value, scope, function)
            if isinstance(statement, ast.Assign):
                value = self._value(statement.value, scope, function)
                for target in statement.targets:
                    self._assign(target, value, scope, function)
            elif isinstance(statement, ast.AugAssign) and isinstance(statement.target, ast.Name):
                total = ast.BinOp(ast.Name(statement.target.id), statement.op, statement.value)
                self._assign(statement.target, self._value(total, scope, function), scope,
                             function)
            elif not (isinstance(statement, ast.Expr)
                      and isinstance(statement.value, ast.Constant)):
                raise _refused(statement, function)
        raise NotImplementedError(f'{function.__name__}: returns nothing')

    def _assign(self, target, value, scope, function):
        if isinstance(target, ast.Tuple):
            for each, part in zip(target.elts, value, strict=True):
                self._assign(each, part, scope, function)
        elif isinstance(target, ast.Name):
            scope[target.id] = value
            if isinstance(value, Node) and value.inputs and not value.hint:
                value.hint = target.id
        else:
            raise _refused(target, function)

    def _value(self, tree, scope, function):
        value = self._looked_up(tree, scope, function)
        if value is None or isinstance(value, (Node, tuple)):
            return value
        if isinstance(value, (int, float, np.floating, np.integer)):
            number = value if isinstance(value, int) else float(value)
            return self._graph.constant(number)
        raise _refused(tree, function)

    def _looked_up(self, tree, scope, function):
        """Return the value of an expression: nodes, or the object of a global name."""
        match tree:
            case ast.Constant(value=int() | float() as number):
                return number
            case ast.Name(id=name):
                return scope[name] if name in scope else _global(function, name, tree)
            case ast.Attribute(value=ast.Name(id=owner), attr=name) if owner not in scope:
                return getattr(_global(function, owner, tree), name, None)
            case ast.Tuple(elts=parts):
                return tuple(self._value(part, scope, function) for part in parts)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self._value(operand, scope, function)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._value(operand, scope, function)
            case ast.UnaryOp(op=ast.Invert(), operand=operand):
                return self._graph.make('~', self._value(operand, scope, function))
            case ast.BinOp(op=op, left=left, right=right) if type(op) in _BINARY:
                return self._graph.make(_BINARY[type(op)], self._value(left, scope, function),
                                        self._value(right, scope, function))
            case ast.Compare(ops=[op], left=left, comparators=[right]) if type(op) in _COMPARE:
                return self._graph.make(_COMPARE[type(op)], self._value(left, scope, function),
                                        self._value(right, scope, function))
            case ast.Subscript(value=table, slice=index) if not isinstance(index, ast.Slice):
                return self._graph.make('item', self._value(table, scope, function),
                                        self._value(index, scope, function))
            case ast.Call():
                return self._called(tree, scope, function)
        raise _refused(tree, function)

    def _called(self, tree, scope, function):
        inputs = [self._value(argument, scope, function) for argument in tree.args]
        keywords = {item.arg: self._value(item.value, scope, function)
                    for item in tree.keywords}
        if isinstance(tree.func, ast.Attribute):
            name = tree.func.attr
            if name not in FUNCTIONS or keywords:
                raise _refused(tree, function)
            return self._graph.make(f'np.{name}', *inputs)
        callee = self._looked_up(tree.func, scope, function)
        if callee in _BUILT_IN:
            return self._graph.make(_BUILT_IN[callee], *inputs)
        if not isinstance(callee, types.FunctionType):
            raise _refused(tree, function)
        return self.call(callee, inputs, keywords)


def _global(function, name, tree):
    """Return the object of a global name in a function."""
    for scope in (inspect.getclosurevars(function).nonlocals, function.__globals__,
                  function.__globals__.get('__builtins__', {})):
        scope = scope if isinstance(scope, dict) else vars(scope)
        if name in scope:
            return scope[name]
    raise _refused(tree, function)


@lru_cache(maxsize=1024)
def _tree(function) -> ast.FunctionDef:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError) as error:
        raise NotImplementedError(f'{function.__name__}: its source cannot be read') from error
    if not isinstance(tree, ast.FunctionDef):
        raise NotImplementedError(f'{function.__name__}: is not defined by def')
    return tree


def _refused(tree, function):
    return NotImplementedError(
        f'{function.__name__}, line {tree.lineno} of the function: {ast.unparse(tree)!r} has no '
        'derivative here; expected straight-line arithmetic on numbers')
