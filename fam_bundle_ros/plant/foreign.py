# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plants from a user's two functions, or from measured tables, instead of a bundle of laws.

A foreign plant runs in the same loops as a `Bundle`, compiled where numba can compile its
functions, else in plain Python.
"""

from collections.abc import Callable, Sequence
from functools import cache
import inspect
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.parts import Pneumatics
from fam_bundle_ros.model.seam import Model, pointers

_VOLUME = ('unit', 'strain', 'pressure', 'time', 'shape', 'parameters', 'tables')
_FORCE = ('unit', 'strain', 'strain_rate', 'pressure', 'time', 'dt', 'start', 'shape',
          'parameters', 'tables', 'memory', 'after')
#: Of these a user's function gets only the row of its motor unit.
_ROWS = ('shape', 'memory', 'after')
#: Half-width of the difference quotient of a volume, in strain.
_SMALL_STRAIN = 1e-6


class ForeignPlant:
    """
    A plant made from two functions of the user.

    Parameters
    ----------
    force : callable
        Returns the tension of one motor unit in N. Its arguments are any of:
        ``unit`` (from 0), ``strain``, ``strain_rate`` (1/s), ``pressure`` (gauge Pa of all
        units; its own is ``pressure[unit]``), ``time`` and ``dt`` (s), ``parameters``,
        ``tables``, ``shape``; with memory ``start`` (True at the first sample), ``memory``
        (read) and ``after`` (written): the memory before and after this sample.
    volume : callable
        Returns the gas volume of one motor unit without tubes in m^3, from ``unit``,
        ``strain``, ``pressure``, ``time``, ``parameters``, ``tables``, ``shape``.
    length : float, m
        Rest length.
    max_pressure : sequence of float, Pa (gauge)
        One for each motor unit.
    names : sequence of str, optional
        ``mu1``, ``mu2``, ... by default.
    memory : int
        Length of the memory of each motor unit.
    parameters, tables : sequence of float
    shape : sequence of sequence of float, optional
        Numbers of each motor unit.
    leak_rate, supply_resistance : float, 1/s and Pa/(kg/s)

    Raises
    ------
    InputError
        When a function has an unknown argument, or a length is not positive.

    Examples
    --------
    >>> def force(strain, pressure, unit):
    ...     return 2e-4 * pressure[unit] * (1.0 - strain / 0.25)
    >>> def volume(strain):
    ...     return 9e-6 + 20e-6 * strain
    >>> plant = ForeignPlant(force, volume, length=0.127, max_pressure=[300e3, 300e3])
    >>> from fam_bundle_ros.plant import Rig
    >>> bool(Rig(plant, seed=1).step([0.5, 0.0], 0.02).force > 10.0)
    True
    """

    def __init__(self, force: Callable, volume: Callable, length: float,
                 max_pressure: Sequence[float], names: Sequence[str] = (), memory: int = 0,
                 parameters: Sequence[float] = (), tables: Sequence[float] = (),
                 shape: Sequence[Sequence[float]] = (), leak_rate: float = 0.0,
                 supply_resistance: float = 0.0):
        self.max_pressure = np.array(max_pressure, float)
        self.n = len(self.max_pressure)
        self.length = float(length)
        self.names = tuple(names) or tuple(f'mu{i + 1}' for i in range(self.n))
        self.name = getattr(force, '__name__', 'foreign plant')
        self.pneumatics = Pneumatics(float(leak_rate), float(supply_resistance))
        if not self.length > 0.0 or not self.n or len(self.names) != self.n:
            raise InputError(f'foreign plant of length {length!r} m with {self.n} maximum '
                             f'pressures and {len(self.names)} names; expected a positive '
                             'length, and a name for each of one or more motor units')
        self._functions = (_adapted(force, _FORCE), _adapted(volume, _VOLUME),
                           _adapted(volume, _VOLUME, slope=True))
        self._memory = max(int(memory), 1)
        self._parameters, self._tables = list(map(float, parameters)), list(map(float, tables))
        self._shape = [list(map(float, row)) for row in shape] or [[0.0]] * self.n

    def readings(self, force: Any, strain: Any, pressure: Any, time: Any = 0.0,
                 ) -> tuple[Any, Any, Any]:
        """Return the readings of ideal gauges: the true values."""
        return force, strain, pressure

    def model(self, compiled: bool) -> Model:
        """
        Return the functions and numbers that a loop takes, with initial memory.

        Raises
        ------
        NotCompiled
            When numba is not installed or cannot compile a function; use the plain model then.
        """
        memory = [[0.0] * self._memory for _ in range(self.n)]
        numbers = (self._shape, self._parameters or [0.0], self._tables or [0.0], memory,
                   [row[:] for row in memory])
        if not compiled:
            return Model(*self._functions, *numbers)
        return Model(*_compiled(self._functions), *(np.array(item, float) for item in numbers))

    @classmethod
    def from_tables(cls, strain: Sequence[float], pressure: Sequence[float], force: Any,
                    volume: Any, length: float, **more: Any) -> 'ForeignPlant':
        """
        Return a plant that interpolates measured surfaces (bilinear; constant beyond the ends).

        Parameters
        ----------
        strain : sequence of float, shape (S,)
        pressure : sequence of float, shape (P,), Pa (gauge)
        force, volume : array_like, shape (n, S, P), N and m^3
        length : float, m
        **more
            As for the class; ``max_pressure`` is the end of ``pressure`` by default.

        Raises
        ------
        InputError
            When a grid is not increasing or a surface has another shape.
        """
        grids = [np.asarray(grid, float) for grid in (strain, pressure)]
        surfaces = [np.asarray(surface, float) for surface in (force, volume)]
        for name, grid in zip(('strain', 'pressure'), grids):
            if grid.ndim != 1 or len(grid) < 2 or not np.all(np.diff(grid) > 0.0):
                raise InputError(f'{name} of the table is {grid}; expected two or more numbers '
                                 'that rise')
        n = len(surfaces[0])
        for name, surface in zip(('force', 'volume'), surfaces):
            expected = (n, *(len(grid) for grid in grids))
            if surface.shape != expected or not np.all(np.isfinite(surface)):
                raise InputError(f'{name} of the table has the shape {surface.shape}; expected '
                                 f'finite numbers of shape {expected} (unit, strain, pressure)')
        more.setdefault('max_pressure', [float(grids[1][-1])] * n)
        tables = np.concatenate([[n], *([len(grid)] for grid in grids), *grids,
                                 *(surface.ravel() for surface in surfaces)])
        return cls(_table_force, _table_volume, length, tables=tables.tolist(), **more)


@cache
def _compiled(functions: tuple[Callable, ...]) -> tuple[Any, Any, Any]:
    """Return the pointers of a plant's functions (cached)."""
    return pointers(*functions)


def _adapted(function, arguments, slope=False):
    """Return a function of the seam's arguments that passes the user's function those it names."""
    wanted = tuple(inspect.signature(function).parameters)
    for name in wanted:
        if name not in arguments:
            raise InputError(f"{getattr(function, '__name__', 'a function')} of a foreign plant "
                             f"wants '{name}'; expected some of {', '.join(arguments)}")

    def call(change):
        given = (f'{name}[unit]' if name in _ROWS else
                 f'strain{change}' if name == 'strain' else name for name in wanted)
        return f'function({", ".join(given)})'
    if slope:
        value = (f'({call(" + " + str(_SMALL_STRAIN))} - {call(" - " + str(_SMALL_STRAIN))})'
                 f' / {2.0 * _SMALL_STRAIN}')
    else:
        value = call('')
    names: dict[str, Any] = {'function': function, '__name__': __name__}
    exec(f'def adapted({", ".join(arguments)}):\n    return {value}\n', names)
    return names['adapted']


def _table_force(unit, strain, pressure, tables):
    """Return the tension by the force surface of a table."""
    return _interpolated(tables, 0, unit, strain, pressure[unit])


def _table_volume(unit, strain, pressure, tables):
    """Return the gas volume by the volume surface of a table."""
    return _interpolated(tables, 1, unit, strain, pressure[unit])


def _interpolated(tables, surface, unit, strain, pressure):
    """Return a surface of a table at a strain and a pressure, bilinear."""
    units, rows, columns = int(tables[0]), int(tables[1]), int(tables[2])
    i, x = _place(tables, 3, rows, strain)
    j, y = _place(tables, 3 + rows, columns, pressure)
    at = 3 + rows + columns + ((surface * units + unit) * rows + i) * columns + j
    low = tables[at] + y * (tables[at + 1] - tables[at])
    at += columns
    return low + x * (tables[at] + y * (tables[at + 1] - tables[at]) - low)


def _place(tables, start, count, value):
    """Return the interval of a grid that contains a value, and its position in it, 0..1."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if tables[start + middle] <= value:
            low = middle
        else:
            high = middle
    width = tables[start + low + 1] - tables[start + low]
    return low, min(max((value - tables[start + low]) / width, 0.0), 1.0)
