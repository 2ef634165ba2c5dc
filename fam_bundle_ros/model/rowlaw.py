# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One law over many rows, with derivatives by the chain rule.

Each law is compiled separately, once for all models that contain it, so that a search over sets
of laws compiles nothing again. Without numba a law runs on arrays; a law with memory runs along
time by its recurrences or, if it is not written with these, sample by sample.
"""

from collections.abc import Callable, Iterable
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.model.derivative import Partials, partials
from fam_bundle_ros.model.dual import Dual, scaled, Slopes, total
from fam_bundle_ros.model.laws.base import arguments, FELT, Law, Place, STEPPING, TABLES
from fam_bundle_ros.model.scan import affine_scan
from fam_bundle_ros.model.source import defined
from fam_bundle_ros.model.vocabulary import bound, runs_along_time

#: Arguments that have a value for each row.
_VARYING = {*FELT, *STEPPING} - {'unit'}
#: Arguments from the record, which do not depend on parameters.
_GIVEN = {'unit', 'strain_rate', 'time', *STEPPING, *TABLES}


#: Number of rows computed on arrays before a law is compiled, so that short work does not wait.
_COMPILE_AFTER = 200_000


@lru_cache(maxsize=1024)
def row_law(function: Callable, fields: tuple[str, ...]) -> 'RowLaw':
    """Return the `RowLaw` of a law's function; cached."""
    return RowLaw(function, fields)


def prepare(laws: Iterable[Law]) -> None:
    """Compile laws for rows in advance; does nothing without numba."""
    for law in laws if kernels.numba() is not None else ():
        for part in law.parts:
            fields = tuple(name for name in part.arguments if name in law.memory)
            if part.place not in (Place.SENSOR, Place.PNEUMATICS):
                row_law(part.function, fields).prepare()
                if part.equilibrium is not None:
                    row_law(part.equilibrium, ()).prepare()


class RowLaw:
    """
    A law's function for rows: as the function itself, with arrays instead of numbers.

    Parameters
    ----------
    function : callable
        For one sample.
    fields : tuple of str
        Memory fields among its arguments. As arguments they are the memory before the first row,
        as results that after the last row; both are numbers.
    """

    def __init__(self, function: Callable, fields: tuple[str, ...]):
        self._names = arguments(function)
        #: Indices of the arguments that always are arrays of rows, and of those that may be.
        self._varying = tuple(k for k, name in enumerate(self._names) if name in _VARYING)
        self._ranged = tuple(k for k, name in enumerate(self._names) if name not in TABLES)
        self._function = function
        self._fields = fields
        self._rows_done = 0
        self._compiles = True

    def __call__(self, *inputs: Any) -> Any:
        """
        Return the law's value over rows, and its memory after the last row if it has one.

        Parameters
        ----------
        *inputs : array (T,), float or Dual of these

        Raises
        ------
        NotImplementedError
            If an input has slopes and the law's source cannot be differentiated.
        """
        slopes = {name: item.slopes for name, item in zip(self._names, inputs, strict=True)
                  if isinstance(item, Dual)}
        values = [item.value if isinstance(item, Dual) else item for item in inputs]
        if not any(slopes.values()):
            rows, after = self._rows(self._function, 1, values)
            return (rows[0], *after) if self._fields else rows[0]
        made = self._partials
        rows, after = self._rows(made.function, 1 + len(made.entries), values)
        chain = _Chain(self._fields, slopes, dict(zip(made.entries, rows[1:], strict=True)))
        value = Dual(rows[0], chain.of_output(0))
        return (value, *map(Dual, after, chain.after)) if self._fields else value

    @cached_property
    def _partials(self) -> Partials:
        return partials(self._function, tuple(n for n in self._names if n not in _GIVEN))

    @cached_property
    def _runs_along_time(self) -> bool:
        return runs_along_time(self._function, self._fields)

    def prepare(self) -> None:
        """Compile the law and its partial derivatives now."""
        if not self._fields and not _VARYING & set(self._names):
            return  # the value does not depend on the row
        table = np.array([2.0, 2.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        exact: dict[str, Any] = {'unit': 0, 'tables': table, 'table': 0}
        inputs = [exact.get(name, _rows_of(name, 0.5, 2) if name in _VARYING else 0.5)
                  for name in self._names]
        self._compiled(self._function, 1, inputs, 2)
        self._compiled(self._partials.function, 1 + len(self._partials.entries), inputs, 2)

    # --- methods of computation ----------------------------------------------------------------

    def _rows(self, function, count, inputs):
        """Return the value, or the value and the partial derivatives, and the memory after."""
        size = max((len(inputs[k]) for k in self._ranged if isinstance(inputs[k], np.ndarray)),
                   default=1 if self._fields else 0)
        if not size:
            result = function(*inputs)
            return (result if isinstance(result, tuple) else (result,)), ()
        for k in self._varying:
            inputs[k] = _rows_of(self._names[k], inputs[k], size)
        self._rows_done += size
        if self._compiles and self._rows_done > _COMPILE_AFTER and kernels.numba() is not None:
            try:
                return self._compiled(function, count, inputs, size)
            except Exception:  # numba raises many types; happens only for a user's law
                self._compiles = False
        with np.errstate(all='ignore'):
            if self._fields and not self._runs_along_time:
                return self._sample_by_sample(function, count, inputs, size)
            if self._fields:
                return self._along_time(function, count, inputs, size)
            return _on_arrays(function, inputs, size), ()

    def _compiled(self, function, count, inputs, size):
        out = np.empty((count, size))
        with_rows = self._with_rows(inputs)
        loop = _loop(function, self._names, self._fields, count, with_rows, 'kernels')
        return out, loop(*inputs, out)

    def _along_time(self, function, count, inputs, size):
        """Run the recurrences along time, then the partial derivatives element by element."""
        value, *after = (np.broadcast_to(row, (size,))
                         for row in bound(self._function, 'scans')(*inputs))
        last = tuple(float(row[-1]) for row in after)
        if count == 1:
            return [value], last
        fields = iter(after)
        inputs = [np.concatenate([[item], next(fields)[:-1]]) if name in self._fields else item
                  for name, item in zip(self._names, inputs, strict=True)]
        return [value, *_on_arrays(function, inputs, size)[1 + len(after):]], last

    def _sample_by_sample(self, function, count, inputs, size):
        with_rows = self._with_rows(inputs)
        inputs = [np.asarray(item) for item in inputs]
        # floats raise an error where elements of arrays give nan or infinity
        for mode, number in (('floats', np.ndarray.tolist), ('arrays', lambda array: array[()])):
            loop = _loop(function, self._names, self._fields, count, with_rows, mode)
            given = [number(item) for item in inputs]
            out = [[0.0] * size for _ in range(count)]
            try:
                after = loop(*given, out)
            except (ArithmeticError, ValueError):
                if mode == 'arrays':
                    raise
            else:
                break
        return np.array(out), after

    def _with_rows(self, inputs):
        return tuple(self._names[k] for k in self._ranged if isinstance(inputs[k], np.ndarray))


def _on_arrays(function, inputs, size):
    result = bound(function, 'arrays')(*inputs)
    return [np.broadcast_to(row, (size,)) if np.ndim(row) == 0 else row
            for row in (result if isinstance(result, tuple) else (result,))]


def _rows_of(name, item, size):
    """Return an array (size,) from an array or one number."""
    if isinstance(item, np.ndarray):
        return np.ascontiguousarray(item)
    return np.full(size, item, bool if name in ('start', 'log_start') else float)


@lru_cache(maxsize=1024)
def _loop(function: Callable, names: tuple[str, ...], fields: tuple[str, ...], count: int,
          with_rows: tuple[str, ...], mode: str) -> Callable:
    """
    Return a loop over rows around a law's function, or around its partial derivatives.

    The loop takes the function's arguments and ``out`` (count, T); it returns the memory after
    the last row.

    Parameters
    ----------
    names, fields, with_rows : tuple of str
        All arguments, memory fields, and arguments that are arrays of rows.
    count : int
        Number of outputs.
    mode : str
        One of `fam_bundle_ros.model.vocabulary`.
    """
    inputs = ', '.join(f'{name}[row]' if name in with_rows else name for name in names)
    rows = [f'out_{number}' for number in range(count)]
    results = [f'{rows[0]}[row]', *fields, *(f'{row}[row]' for row in rows[1:])]
    text = '\n    '.join([
        f'def over_rows({", ".join(names)}, out):',
        f'"""Rows of {function.__name__}; return its memory after the last one."""',
        *(f'{row} = out[{number}]' for number, row in enumerate(rows)),
        f'for row in range(len({rows[0]})):',
        f'    {", ".join(results)} = law({inputs})',
        f'return ({", ".join(fields)}{"," if fields else ""})']) + '\n'
    compiled = mode == 'kernels'
    loop = defined(text, 'over_rows', {'law': bound(function, mode)}, compiled)
    return kernels.compiled(loop) if compiled else loop


class _Chain:
    """
    The chain rule for one law: from the slopes of its inputs to those of its outputs.

    Parameters
    ----------
    fields : tuple of str
        Memory fields of the law.
    slopes : dict of str to Slopes
        Slopes of the inputs; those of memory fields are before the first row.
    rows : dict of (int, str) to array (T,)
        Partial derivatives of outputs by inputs.
    """

    def __init__(self, fields, slopes, rows):
        self._rows = rows
        #: Slopes of the inputs; those of memory fields are before each row.
        self._slopes = {name: item for name, item in slopes.items() if name not in fields}
        after = {field: self._carried(1 + fields.index(field), field, slopes.get(field, {}))
                 for field in _in_order(fields, rows)}
        #: Slopes of each memory field after the last row.
        self.after: list[Slopes] = [after[field] for field in fields]

    def of_output(self, output: int) -> dict[int, Any]:
        """Return the slopes of an output, from all inputs whose slopes are known."""
        return total(scaled(self._slopes[name], row) for (number, name), row in self._rows.items()
                     if number == output and name in self._slopes)

    def _carried(self, output, field, first):
        """Compute the slopes of a memory field along time; return those after the last row."""
        added, kept = self.of_output(output), self._rows.get((output, field))
        size = max((len(row) for row in self._rows.values()), default=1)
        before, after = {}, {}
        for key in {**first, **added}:
            start = first.get(key, 0.0)
            path = _recurrence(kept, added.get(key, 0.0), start, size)
            before[key] = np.concatenate([[start], path[:-1]])
            after[key] = float(path[-1])
        self._slopes[field] = before
        return after


def _in_order(fields, rows):
    """Return memory fields, each after those on which its slopes depend."""
    waiting = {field: {name for number, name in rows
                       if number == 1 + index and name in fields and name != field}
               for index, field in enumerate(fields)}
    order = []
    while waiting:
        ready = [field for field, needs in waiting.items() if not needs & set(waiting)]
        if not ready:
            raise NotImplementedError(
                f'memory fields {", ".join(waiting)} depend on each other circularly')
        order += ready
        for field in ready:
            del waiting[field]
    return order


def _recurrence(gain, offset, start, size):
    """Return y with y[k] = gain[k] y[k-1] + offset[k], y[-1] = start; gain None is zero."""
    offset = np.broadcast_to(offset, (size,))
    if gain is None:
        return offset
    if kernels.numba() is None:
        return affine_scan(start, gain, offset)
    out = np.empty(size)
    kernels.compiled(affine_rows)(gain, np.ascontiguousarray(offset), start, out)
    return out


def affine_rows(gain, offset, value, out):
    """Write y[k] = gain[k] y[k-1] + offset[k]; a gain of zero resets y, even if it is nan."""
    for row in range(len(out)):
        value = offset[row] if gain[row] == 0.0 else gain[row] * value + offset[row]
        out[row] = value
