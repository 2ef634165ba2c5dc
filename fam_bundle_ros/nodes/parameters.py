# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
ROS parameters from a table: descriptors, ranges, a one-line error for a bad override.

A node lists its parameters as `Spec`s. `Parameters` declares them to ROS and holds their values;
`Parameters.on_change` validates changes as a set before any of them is applied.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from fam_bundle_ros.errors import about, InputError

Value = bool | int | float | str


@dataclass(frozen=True)
class Spec:
    """
    One parameter of a node.

    Parameters
    ----------
    name : str
    default : bool, int, float or str
        Its type is the parameter's type.
    text : str
        What it means, with the unit.
    low, high : float
        Range of a number, inclusive.
    choices : tuple of str
        What a string may be; empty for any.
    dynamic : bool
        Whether it may change while the node runs.
    guards : bool
        Whether it is a safety limit: while the node acts it may only be lowered.
    at_rest : bool
        Whether it changes only while the node does not act: to apply it takes too long.
    zero_is_off : bool
        0 switches such a limit off, and counts as the largest value.
    """

    name: str
    default: Value
    text: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    dynamic: bool = False
    guards: bool = False
    at_rest: bool = False
    zero_is_off: bool = False

    @property
    def expected(self) -> str:
        """What a value must be, in words."""
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        if isinstance(self.default, bool):
            return 'true or false'
        if isinstance(self.default, str):
            return 'a text'
        bounds = f' from {self.low:g} to {self.high:g}'
        if isinstance(self.default, int):
            return f'a whole number{bounds}'
        return f'a number with a decimal point (3.0, not 3){bounds}'

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor that tools such as rqt show."""
        result = ParameterDescriptor(name=self.name, description=self.text,
                                     read_only=not self.dynamic)
        if self.choices:
            result.additional_constraints = self.expected
        if isinstance(self.default, (bool, str)):
            return result
        # With a step other than 0, rclpy refuses the values between the steps.
        if isinstance(self.default, int):
            result.integer_range = [IntegerRange(from_value=int(self.low),
                                                 to_value=int(self.high), step=0)]
        else:
            result.floating_point_range = [FloatingPointRange(
                from_value=float(self.low), to_value=float(self.high), step=0.0)]
        return result

    def check(self, value: Any) -> None:
        """Check that a text is one of the choices; ROS itself has checked type and range."""
        if self.choices and value not in self.choices:
            raise InputError(f'parameter {self.name} is {value!r}; expected {self.expected}')

    def loosens(self, before: Any, after: Any) -> bool:
        """Return whether a change loosens a safety limit."""
        if not self.guards:
            return False
        old, new = (math.inf if self.zero_is_off and value == 0 else value
                    for value in (before, after))
        return bool(new > old)


class Parameters(dict[str, Any]):
    """The values of a node's parameters, kept up to date; InputError for a wrong override."""

    def __init__(self, node: Node, specs: Sequence[Spec]):
        super().__init__()
        self.specs = {spec.name: spec for spec in specs}
        for spec in specs:
            try:
                value = node.declare_parameter(spec.name, spec.default, spec.descriptor()).value
            except ParameterException:
                # The exceptions of rclpy name neither the node nor the expected value.
                given = node._parameter_overrides[spec.name].value
                raise InputError(f'{node.get_name()}: parameter {spec.name} is {given!r}; '
                                 f'expected {spec.expected}') from None
            with about(node.get_name()):
                spec.check(value)
            self[spec.name] = value

    def on_change(self, node: Node, check: Callable[[dict[str, Any]], Any] = lambda values: None,
                  apply: Callable[[dict[str, Any]], None] = lambda changes: None,
                  acting: Callable[[], bool] = lambda: False) -> None:
        """
        Validate and apply changes while the node runs.

        ``check`` gets all values as they would be, and raises InputError where they do not fit
        together; ``apply`` gets the values that changed, after `self` holds them. While the node
        acts, as ``acting`` tells, no limit may be loosened.
        """
        def validate(changes: list[Parameter]) -> SetParametersResult:
            new = {p.name: p.value for p in changes if p.name in self.specs}
            try:
                for name, value in new.items():
                    self.specs[name].check(value)
                    if acting() and self.specs[name].loosens(self[name], value):
                        raise InputError(f'parameter {name} is a limit: while the node acts it '
                                         f'may be lowered from {self[name]:g} and not set to '
                                         f'{value:g}; switch off first')
                    if acting() and self.specs[name].at_rest and value != self[name]:
                        raise InputError(f'parameter {name} changes only while the node does not '
                                         'act, as that takes half a second; switch off first')
                check({**self, **new})
            except InputError as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        def take(changes: list[Parameter]) -> None:
            new = {p.name: p.value for p in changes if p.name in self.specs}
            self.update(new)
            if new:
                apply(new)

        node.add_on_set_parameters_callback(validate)
        node.add_post_set_parameters_callback(take)


def table(specs: Sequence[Spec]) -> str:
    """Return the parameters as lines of text, for ``--help``."""
    lines = []
    for spec in specs:
        default = repr(spec.default)
        if isinstance(spec.default, bool):
            default = default.lower()
        bounds = '' if isinstance(spec.default, (bool, str)) else f' [{spec.low:g}..{spec.high:g}]'
        kind = ('changes while off' if spec.at_rest else
                'changes while running' if spec.dynamic else 'at start')
        lines.append(f'  {spec.name} = {default}{bounds} ({kind})')
        lines.append(f"      {spec.text}{': ' + ', '.join(spec.choices) if spec.choices else ''}")
    return '\n'.join(lines)
