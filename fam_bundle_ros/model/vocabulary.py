# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The functions that laws may call, and their implementations for arrays, floats and numba.

A law calls NumPy's `maximum, minimum, where, sqrt, exp, log, expm1, tanh, sin, cos, abs, sign`
`pi` and `of_unit`, and for its memory the recurrences below. `bound` returns the same code object
with these functions replaced for one mode:

- ``'arrays'``: NumPy, element by element; recurrences are one step
- ``'scans'``: as arrays, but axis 0 is time and a recurrence runs along it in one call
- ``'floats'``: Python floats. Where arrays give nan or infinity, `math` raises: the caller then
  computes the value with arrays (`fam_bundle_ros.model.compose`)
- ``'kernels'``: floats, for compilation by `fam_bundle_ros.kernels`
"""

from collections.abc import Callable
from functools import cache
import math
import types
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.model.scan import affine_scan, before_scan, clamp_scan

# --- functions beyond NumPy's ------------------------------------------------------------------


def affine(memory, gain, offset):
    """Return gain * memory + offset; a gain of zero resets the memory, even if it is nan."""
    return np.where(gain == 0.0, 0.0, gain * memory) + offset


def clamp(memory, lower, upper):
    """Return memory limited to [lower, upper]; where these are equal it is set (a reset)."""
    return np.where(lower == upper, lower, np.minimum(np.maximum(memory, lower), upper))


def before(memory, signal):
    """Return the signal at the previous sample, which is the memory."""
    return memory


def cell(grid, first, count, value):
    """
    Return the index of the cell of a sorted grid in which a value lies, 0 to count - 2.

    The grid is ``grid[first:first + count]``; values outside it belong to the outer cells.
    """
    found = np.searchsorted(grid[first:first + count], value, side='right') - 1
    return np.minimum(np.maximum(found, 0), count - 2)


def play(centre, signal, half, start):
    """
    Return the output of a play operator (backlash).

    Parameters
    ----------
    centre : number or array
        Its output at the previous sample.
    signal, half : number or array
        Input, and half width of the play.
    start : bool
        Whether to reset the output to the input.
    """
    return clamp(centre, np.where(start, signal, signal - half),
                 np.where(start, signal, signal + half))


def dahl(centre, built_up, signal, dead, width, start):
    """
    Return the state z of a Dahl model, dz/du = (1 - z sgn(du))/w, and the output of its play.

    First order (Dahl 1968), z in [-1, 1]. The signal u first passes a play of half width
    ``dead``, so that noise at rest does not change z. ``centre`` (output of the play) and
    ``built_up`` (z) are the memory; at the start z is zero.
    """
    path = play(centre, signal, dead, start)
    moved = path - before(centre, path)
    kept = np.where(start, 0.0, np.exp(-np.abs(moved) / width))
    gained = np.where(start, 0.0, np.sign(moved) * (1.0 - kept))
    return affine(built_up, kept, gained), path


def lag(lagged, last, signal, time_constant, start, dt):
    """
    Return the output of a first-order lag, tau dy/dt = u - y, at rest at the start.

    Exact for a signal that is linear between samples (first-order hold), for any sampling.
    ``lagged`` and ``last`` are output and input at the previous sample. With a time constant of
    zero the output is the signal.
    """
    # time constant per sample time, so that the derivative at a time constant of zero is finite
    share = time_constant / np.maximum(dt, 1e-12)
    rate = 1.0 / np.maximum(share, 1e-3)
    decay = np.exp(-rate)
    mean = -share * np.expm1(-rate)
    ramp = (1.0 - mean) * signal + (mean - decay) * before(last, signal)
    return affine(lagged, np.where(start, 0.0, decay), np.where(start, signal, ramp))


def of_unit(unit, mu1, mu2, mu3, mu4, mu5, mu6):
    """Return the value of the motor unit with this index, 0 after the sixth."""
    later = np.where(unit == 4, mu5, np.where(unit == 5, mu6, 0.0))
    middle = np.where(unit == 2, mu3, np.where(unit == 3, mu4, later))
    return np.where(unit == 0, mu1, np.where(unit == 1, mu2, middle))


# --- the same functions for one sample as floats ----------------------------------------------

def _where(condition, one, other):
    return one if condition else other


def _maximum(one, other):
    return one if one >= other or one != one else other


def _minimum(one, other):
    return one if one <= other or one != one else other


def _sign(value):
    return 1.0 if value > 0.0 else -1.0 if value < 0.0 else 0.0 * value


def _cell_search(grid, first, count, value):
    low, high = first, first + count
    while low < high:
        middle = (low + high) // 2
        if value < grid[middle]:
            high = middle
        else:
            low = middle + 1
    return min(max(low - first - 1, 0), count - 2)


_WORDS = {'where': _where, 'maximum': _maximum, 'minimum': _minimum, 'sign': _sign,
          'sqrt': math.sqrt, 'exp': math.exp, 'log': math.log, 'expm1': math.expm1,
          'tanh': math.tanh, 'sin': math.sin, 'cos': math.cos, 'abs': abs, 'pi': math.pi}


class _CompiledWords:
    """Replaces NumPy in a kernel; numba's own scalar `where` is slow."""

    @staticmethod
    @cache
    def compiled_names(counted: bool = True) -> types.ModuleType:
        """Return a module of the functions, which numba compiles into the kernel."""
        module = types.ModuleType('words')
        for name, word in _WORDS.items():
            own = isinstance(word, types.FunctionType)
            setattr(module, name, kernels.compiled_inside(word, counted) if own else word)
        return module


_SWAPS: dict[str, dict[Any, Any]] = {
    'arrays': {},
    'scans': {affine: affine_scan, clamp: clamp_scan, before: before_scan},
    'floats': {np: types.SimpleNamespace(**_WORDS), cell: _cell_search},
    'kernels': {np: _CompiledWords(), cell: _cell_search},
}


@cache
def bound(function: Callable, mode: str) -> Callable:
    """
    Return a plain function for one mode: it and the functions that it calls use that mode's.

    Examples
    --------
    >>> def floor(strain):
    ...     return np.maximum(strain, 0.0)
    >>> bound(floor, 'floats')(-0.1)
    0.0
    """
    swaps = _SWAPS[mode]
    if function in swaps:  # also NumPy itself
        return swaps[function]
    if not swaps or not isinstance(function, types.FunctionType):
        return function
    names: dict[str, Any] = {'__name__': function.__module__,
                             '__builtins__': function.__globals__.get('__builtins__', {})}
    for name in function.__code__.co_names:
        if name in function.__globals__:
            value = function.__globals__[name]
            if value is np or isinstance(value, types.FunctionType):
                value = bound(value, mode)
            names[name] = value
    copy = types.FunctionType(function.__code__, names, function.__name__,
                              function.__defaults__, function.__closure__)
    copy.__module__ = function.__module__
    return copy


def runs_along_time(function: Callable, fields: tuple[str, ...]) -> bool:
    """
    Return whether ``'scans'`` can compute a law with these memory fields over a record.

    This requires that memory is used only by `affine`, `clamp` and `before`, as in all laws of
    this package. A user's law with memory is computed sample by sample.
    """
    return not fields or function.__module__.startswith(f'{kernels.PACKAGE}.')
