# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Formulas as graphs, their derivatives, and their source text.

A node is a constant, an argument, or an operation on other nodes. Equal nodes are one object, so
that a common subexpression is computed once. Only simplifications that are exact in
floating-point arithmetic are made, so that the text gives the same value as the original formula.
"""

from collections.abc import Callable, Iterable, Sequence
import operator
from typing import Any

_ARITHMETIC: dict[str, Callable] = {
    '+': operator.add, '-': operator.sub, '*': operator.mul, '/': operator.truediv,
    '**': operator.pow}
#: Precedence of operators in Python, to omit unnecessary parentheses.
_BINDING = {'<': 1, '<=': 1, '>': 1, '>=': 1, '==': 1, '!=': 1, '|': 2, '&': 3,
            '+': 4, '-': 4, '*': 5, '/': 5, 'neg': 6, '~': 6, '**': 7}
_CALL = 9
#: Longest piece of a formula on one line of the text.
_WIDTH = 72
#: Infinite slopes (a root at zero) are replaced by large finite ones, as their factor may be zero.
#: The square and the inverse of this number are finite.
_TINY = 1e-150


class Node:
    """One value of a formula. Arithmetic on nodes gives nodes of the same graph."""

    __slots__ = ('graph', 'hint', 'inputs', 'number', 'operation')

    def __init__(self, graph: 'Graph', operation: str, inputs: tuple['Node', ...], number: int):
        self.graph = graph
        self.operation = operation
        self.inputs = inputs
        #: Position in the graph: the inputs of a node have smaller numbers.
        self.number = number
        #: Name of this value in a formula; empty if it has none.
        self.hint = ''

    def __add__(self, other):
        return self.graph.make('+', self, other)

    def __sub__(self, other):
        return self.graph.make('-', self, other)

    def __rsub__(self, other):
        return self.graph.make('-', other, self)

    def __mul__(self, other):
        return self.graph.make('*', self, other)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other):
        return self.graph.make('/', self, other)

    def __pow__(self, other):
        return self.graph.make('**', self, other)

    def __neg__(self):
        return self.graph.make('neg', self)


class Constant(Node):
    """A number in a formula."""

    __slots__ = ('value',)

    value: Any


class Graph:
    """The nodes of one or several formulas."""

    def __init__(self):
        self._nodes: dict[tuple, Node] = {}
        #: True while derivatives are made. A slope that a condition sets to zero then stays zero
        #: if its factor is not finite.
        self._slopes = False

    def argument(self, name: str) -> Node:
        """Return the node of an argument."""
        node = self._keep(('argument', name), Node, 'argument', ())
        node.hint = name
        return node

    def constant(self, value: Any) -> Constant:
        """Return the node of a number."""
        # 2 and 2.0 are different nodes, as their text differs
        node = self._keep(('constant', type(value), repr(value)), Constant, 'constant', ())
        node.value = value
        return node

    def make(self, operation: str, *inputs: Any) -> Node:
        """
        Return the node of an operation, simplified if that is exact.

        Parameters
        ----------
        operation : str
            An operator as Python writes it, 'neg', or the name of a function ('np.exp').
        *inputs : Node or number
        """
        nodes = tuple(i if isinstance(i, Node) else self.constant(i) for i in inputs)
        simple = self._simplified(operation, nodes)
        if simple is not None:
            return simple
        numbers = [node.number for node in nodes]
        if operation in ('+', '*'):
            numbers.sort()
        return self._keep((operation, *numbers), Node, operation, nodes)

    def _keep(self, key, kind, operation, inputs):
        if key not in self._nodes:
            self._nodes[key] = kind(self, operation, inputs, len(self._nodes))
        return self._nodes[key]

    def _simplified(self, operation, nodes) -> Node | None:
        """Return a simpler node of the same value, or None."""
        a = nodes[0]
        if operation in _ARITHMETIC:
            return (self._folded(operation, *nodes) or self._without_identity(operation, *nodes)
                    or self._sign_outside(operation, *nodes)
                    or (self._condition_outside(operation, *nodes) if self._slopes else None))
        if operation == 'neg':
            if a.operation == 'neg':
                return a.inputs[0]
            if isinstance(a, Constant):
                return self.constant(-a.value)
        if operation == 'np.where' and nodes[1] is nodes[2]:
            return nodes[1]
        return None

    def _folded(self, operation, a, b):
        if isinstance(a, Constant) and isinstance(b, Constant) and not (
                operation in ('/', '**') and not (b.value and a.value)):
            return self.constant(_ARITHMETIC[operation](a.value, b.value))
        return None

    def _without_identity(self, operation, a, b):
        """Remove 0 from sums and 1 from products; a product with 0 is 0."""
        if operation == '+':
            return b if _is(a, 0) else a if _is(b, 0) else None
        if operation == '-':
            return a if _is(b, 0) else -b if _is(a, 0) else None
        if operation == '*':
            if _is(a, 0) or _is(b, 0):
                return self.constant(0.0)
            for one, other in ((a, b), (b, a)):
                if _is(one, 1) or _is(one, -1):
                    return other if one.value > 0 else -other
            return None
        if operation == '/':
            return self.constant(0.0) if _is(a, 0) else a if _is(b, 1) else None
        return a if _is(b, 1) else None

    def _sign_outside(self, operation, a, b):
        """Turn a + -b into a - b, and -a b into -(a b)."""
        first, second = a.operation == 'neg', b.operation == 'neg'
        if operation == '+' and (first or second):
            return a - b.inputs[0] if second else b - a.inputs[0]
        if operation == '-' and second:
            return a + b.inputs[0]
        if operation in ('*', '/') and (first or second):
            plain = self.make(operation, a.inputs[0] if first else a,
                              b.inputs[0] if second else b)
            return plain if first and second else -plain
        return None

    def _condition_outside(self, operation, a, b):
        """Move an operation into the branches of a slope that is zero in one of them."""
        if operation in ('*', '/') and _is_masked(a):
            condition, yes, no = a.inputs
            return self.where(condition, self.make(operation, yes, b),
                              self.make(operation, no, b))
        if operation == '*' and _is_masked(b):
            return b * a
        if operation == '+' and _is_masked(a) and _is_masked(b) and a.inputs[0] is b.inputs[0]:
            condition = a.inputs[0]
            return self.where(condition, a.inputs[1] + b.inputs[1], a.inputs[2] + b.inputs[2])
        return None

    def where(self, condition: Node, yes: Any, no: Any) -> Node:
        """Return the node of a choice."""
        return self.make('np.where', condition, yes, no)

    def slopes(self, output: Node, arguments: Iterable[str]) -> dict[str, Node]:
        """
        Return the nonzero derivatives of a node with respect to arguments.

        Reverse accumulation: the cost is a few times that of the value, for any number of
        arguments. At a kink the derivative is one-sided: that of a for `maximum(a, b)` and
        `minimum(a, b)` at a = b, and zero for `abs` and `sign` at 0. The jump of a `where` is
        ignored.

        Raises
        ------
        NotImplementedError
            For a function whose derivative is not known.
        """
        wanted = {self.argument(name).number: name for name in arguments}
        order = reachable([output])
        varies = set(wanted)
        for node in order:
            if any(i.number in varies for i in node.inputs):
                varies.add(node.number)
        slope: dict[int, Node] = {output.number: self.constant(1.0)}
        self._slopes = True
        try:
            for node in reversed(order):
                d = slope.get(node.number)
                if d is None or node.number not in varies:
                    continue
                if node.hint and not d.hint and d.inputs:
                    d.hint = f'by_{node.hint}'
                for i, each in enumerate(node.inputs):
                    if each.number in varies:
                        part = _pulled_back(node, i, d)
                        before = slope.get(each.number)
                        slope[each.number] = part if before is None else before + part
        finally:
            self._slopes = False
        return {name: slope[number] for number, name in wanted.items()
                if number in slope and not _is(slope[number], 0)}


def reachable(roots: Iterable[Node]) -> list[Node]:
    """Return some nodes and all nodes on which they depend, inputs first."""
    found: dict[int, Node] = {}
    pending = list(roots)
    while pending:
        node = pending.pop()
        if node.number not in found:
            found[node.number] = node
            pending.extend(node.inputs)
    return [found[number] for number in sorted(found)]


def _is(node, value):
    return isinstance(node, Constant) and node.value == value


def _is_masked(node):
    return node.operation == 'np.where' and (_is(node.inputs[1], 0) or _is(node.inputs[2], 0))


# --- derivatives of single operations ----------------------------------------------------------

def _power_by_base(d, v, a, b):
    if isinstance(b, Constant) and b.value >= 1:
        return d * (b * a ** (b.value - 1))
    return d * (b * d.graph.make('np.maximum', a, _TINY) ** (b - 1.0))


def _power_by_exponent(d, v, a, b):
    # the limit of x**n log(x) at x = 0 is 0
    return d * (v * d.graph.make('np.log', d.graph.make('np.maximum', a, _TINY)))


def _root_slope(d, v, a):
    return d * 0.5 / d.graph.make('np.maximum', v, _TINY)


#: For each operation and each of its inputs: the derivative with respect to this input, from the
#: derivative d with respect to the operation's value v. None for an input without one (condition).
_PULL: dict[str, tuple[Callable | None, ...]] = {
    '+': (lambda d, v, a, b: d, lambda d, v, a, b: d),
    '-': (lambda d, v, a, b: d, lambda d, v, a, b: -d),
    '*': (lambda d, v, a, b: d * b, lambda d, v, a, b: d * a),
    '/': (lambda d, v, a, b: d / b, lambda d, v, a, b: -(d * v / b)),
    '**': (_power_by_base, _power_by_exponent),
    'neg': (lambda d, v, a: -d,),
    'np.abs': (lambda d, v, a: d * d.graph.make('np.sign', a),),
    'np.sign': (None,),
    'np.sqrt': (_root_slope,),
    'np.exp': (lambda d, v, a: d * v,),
    'np.expm1': (lambda d, v, a: d * (v + 1.0),),
    'np.log': (lambda d, v, a: d / a,),
    'np.tanh': (lambda d, v, a: d * (1.0 - v * v),),
    'np.sin': (lambda d, v, a: d * d.graph.make('np.cos', a),),
    'np.cos': (lambda d, v, a: -(d * d.graph.make('np.sin', a)),),
    'np.maximum': (lambda d, v, a, b: d.graph.where(d.graph.make('>=', a, b), d, 0.0),
                   lambda d, v, a, b: d.graph.where(d.graph.make('>=', a, b), 0.0, d)),
    'np.minimum': (lambda d, v, a, b: d.graph.where(d.graph.make('<=', a, b), d, 0.0),
                   lambda d, v, a, b: d.graph.where(d.graph.make('<=', a, b), 0.0, d)),
    'np.where': (None, lambda d, v, c, a, b: d.graph.where(c, d, 0.0),
                 lambda d, v, c, a, b: d.graph.where(c, 0.0, d)),
}

#: Piecewise constant operations: comparisons, indices of a table.
_STEPS = {'<', '<=', '>', '>=', '==', '!=', '&', '|', '~', 'item', 'int', 'cell'}
#: Functions of NumPy's vocabulary that a formula may call.
FUNCTIONS = frozenset(name[3:] for name in _PULL if name.startswith('np.'))


def _pulled_back(node, index, slope):
    if node.operation in _STEPS:
        return slope.graph.constant(0.0)
    rules = _PULL.get(node.operation)
    if rules is None:
        raise NotImplementedError(f'no derivative is known of {node.operation}')
    rule = rules[index]
    return slope.graph.constant(0.0) if rule is None else rule(slope, node, *node.inputs)


# --- text --------------------------------------------------------------------------------------

class Writer:
    """
    Writes nodes as assignments; each value that is used twice gets a name.

    Parameters
    ----------
    roots : sequence of Node
        Nodes that the text computes.
    taken : iterable of str
        Names that must not be assigned.
    """

    def __init__(self, roots: Sequence[Node], taken: Iterable[str]):
        self.lines: list[str] = []
        self._text: dict[int, tuple[str, int]] = {}
        self._names = set(taken)
        uses: dict[int, int] = {}
        order = reachable(roots)
        for node in order:
            for each in node.inputs:
                uses[each.number] = uses.get(each.number, 0) + 1
        for node in roots:
            uses[node.number] = uses.get(node.number, 0) + 1
        for node in order:
            self._write(node, node.inputs and (uses[node.number] > 1 or node.hint))

    def text(self, node: Node) -> str:
        """Return the name or the formula of a node."""
        return self._text[node.number][0]

    def _write(self, node, assign):
        text, binding = self._formula(node)
        if assign or (node.inputs and len(text) > _WIDTH):
            name = self._name(node.hint or 't')
            self.lines.append(f'{name} = {text}')
            text, binding = name, _CALL
        self._text[node.number] = text, binding

    def _formula(self, node):
        if isinstance(node, Constant):
            value = node.value
            return repr(value).replace('inf', '1e999'), _BINDING['neg'] if value < 0 else _CALL
        if node.operation == 'argument':
            return node.hint, _CALL
        if node.operation == 'item':
            table, index = node.inputs
            return f'{self._enclosed(table, _CALL)}[{self.text(index)}]', _CALL
        binding = _BINDING.get(node.operation)
        if binding is None:
            return f'{node.operation}({", ".join(map(self.text, node.inputs))})', _CALL
        if len(node.inputs) == 1:
            sign = {'neg': '-', '~': '~'}[node.operation]
            return sign + self._enclosed(node.inputs[0], binding), binding
        left, right = node.inputs
        # operators group from the left in Python, powers from the right
        inner = (binding + 1, _BINDING['neg']) if node.operation == '**' else (
            binding + (binding == 1), binding + 1)
        return (f'{self._enclosed(left, inner[0])} {node.operation} '
                f'{self._enclosed(right, inner[1])}'), binding

    def _enclosed(self, node, binding):
        text, own = self._text[node.number]
        return text if own >= binding else f'({text})'

    def _name(self, hint):
        number, name = 1, hint if hint != 't' else 't1'
        while name in self._names:
            number += 1
            name = f'{hint}{"" if hint == "t" else "_"}{number}'
        self._names.add(name)
        return name
