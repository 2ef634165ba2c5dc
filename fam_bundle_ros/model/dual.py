# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dual numbers: values over many rows with their derivatives, for the operations between laws.

A derivative is stored only for those keys (parameters, dimensions) on which a value depends, so
that a parameter of a loss law costs nothing where the mesh is computed.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from fam_bundle_ros.model.derivative import partials
from fam_bundle_ros.model.laws.base import arguments

#: Derivatives by key, of arrays (T,) or numbers.
Slopes = Mapping[int, Any]


class Dual:
    """
    A value and its derivatives.

    Parameters
    ----------
    value : array (T,) or float
    slopes : mapping of int to array (T,) or float
        Derivative by key; zero for keys that are not in it.
    """

    __slots__ = ('slopes', 'value')
    __array_ufunc__ = None  # so that array + Dual calls Dual.__radd__

    def __init__(self, value: Any, slopes: Slopes):
        self.value = value
        self.slopes = slopes

    def __add__(self, other):
        return Dual(self.value + value_of(other), total([self.slopes, slopes_of(other)]))

    def __sub__(self, other):
        return self + -other

    def __rsub__(self, other):
        return -self + other

    def __neg__(self):
        return Dual(-self.value, scaled(self.slopes, -1.0))

    def __mul__(self, other):
        return Dual(self.value * value_of(other), total(
            [scaled(self.slopes, value_of(other)), scaled(slopes_of(other), self.value)]))

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other):
        value = self.value / value_of(other)
        return Dual(value, total([scaled(self.slopes, 1.0 / value_of(other)),
                                  scaled(slopes_of(other), -value / value_of(other))]))

    def __rtruediv__(self, other):
        return Dual(other, {}) / self


class DualWords:
    """NumPy's functions that the text of a composition uses between laws, on dual numbers."""

    @staticmethod
    def maximum(one: Any, other: Any) -> Any:
        """Return the larger of two numbers; if they are equal, with the slopes of the first."""
        if not (isinstance(one, Dual) or isinstance(other, Dual)):
            return np.maximum(one, other)
        first = value_of(one) >= value_of(other)
        slopes = {key: np.where(first, slope, 0.0) for key, slope in slopes_of(one).items()}
        for key, slope in slopes_of(other).items():
            slopes[key] = np.where(first, slopes.get(key, 0.0), slope)
        return Dual(np.maximum(value_of(one), value_of(other)), slopes)

    @staticmethod
    def sqrt(number: Any) -> Any:
        """Return the square root."""
        root = np.sqrt(value_of(number))
        return Dual(root, scaled(number.slopes, 0.5 / root)) if isinstance(number, Dual) else root


def value_of(number: Any) -> Any:
    """Return the value of a dual number; other numbers are returned unchanged."""
    return number.value if isinstance(number, Dual) else number


def slopes_of(number: Any) -> Slopes:
    """Return the derivatives of a dual number; empty for other numbers."""
    return number.slopes if isinstance(number, Dual) else {}


def scaled(slopes: Slopes, factor: Any) -> dict[int, Any]:
    """Return slopes times a factor."""
    # a parameter's derivative with respect to itself is 1: saves an array
    return {key: factor if isinstance(slope, float) and slope == 1.0 else slope * factor
            for key, slope in slopes.items()}


def total(parts: Iterable[Slopes]) -> dict[int, Any]:
    """Return the sum of slopes by key."""
    result: dict[int, Any] = {}
    for part in parts:
        for key, slope in part.items():
            result[key] = result[key] + slope if key in result else slope
    return result


def applied(function: Callable, *inputs: Any) -> tuple[Any, ...]:
    """
    Return the outputs of a plain function for dual numbers; outputs without slopes are plain.

    Parameters
    ----------
    function : callable
        One that `fam_bundle_ros.model.derivative.partials` can differentiate.
    *inputs : Dual, array or float
    """
    names = arguments(function)
    made = partials(function, names)
    results = made.function(*map(value_of, inputs))
    slopes: list[list[Slopes]] = [[] for _ in range(made.outputs)]
    for (output, name), partial in zip(made.entries, results[made.outputs:], strict=True):
        slopes[output].append(scaled(slopes_of(inputs[names.index(name)]), partial))
    return tuple(Dual(value, total(parts)) if any(parts) else value
                 for value, parts in zip(results, slopes, strict=False))
