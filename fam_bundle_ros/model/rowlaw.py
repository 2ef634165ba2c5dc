# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
One law over many rows, with the slopes of what it gets carried through it.

Each law is compiled for itself, once for all models that it is part of: a search over sets of
laws compiles nothing anew. Without numba a law runs on arrays; one with memory runs along time
by its recurrences or, when it is written otherwise, sample by sample.
"""

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.model.derivative import Partials, partials
from fam_bundle_ros.model.dual import Dual, scaled, Slopes, slopes_of, total, value_of
from fam_bundle_ros.model.law import arguments, FELT, STEPPING, TABLES
from fam_bundle_ros.model.scan import affine_scan
from fam_bundle_ros.model.source import defined
from fam_bundle_ros.model.vocabulary import bound, runs_along_time

#: Arguments that have a value for each row.
_VARYING = {*FELT, *STEPPING} - {'unit'}
#: Arguments that no parameter changes: a record gives them.
_GIVEN = {'unit', 'strain_rate', 'time', *STEPPING, *TABLES}


@cache
def row_law(function: Callable, fields: tuple[str, ...]) -> 'RowLaw':
    """Return a law's function for rows, made once."""
    return RowLaw(function, fields)


class RowLaw:
    """
    A law's function for rows: takes and returns what the function does, arrays for numbers.

    Parameters
    ----------
    function : callable
        Of one sample.
    fields : tuple of str
        Memory fields among its arguments. They are numbers: the memory before the first row; what
        comes back is the memory after the last row.
    """

    def __init__(self, function: Callable, fields: tuple[str, ...]):
        self._names = arguments(function)
        self._function = function
        self._fields = fields
        self._runs_along_time = runs_along_time(function, fields)
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
            When an input has slopes and the law's source cannot be differentiated.
        """
        moving = [name for name, item in zip(self._names, inputs, strict=True)
                  if slopes_of(item)]
        if not moving:
            rows, after = self._rows(self._function, 1, inputs)
            return (rows[0], *after) if self._fields else rows[0]
        made = self._partials
        rows, after = self._rows(made.function, 1 + len(made.entries),
                                 [value_of(item) for item in inputs])
        slopes = _Chain(made, self._fields, dict(zip(self._names, inputs, strict=True)),
                        dict(zip(made.entries, rows[1:], strict=True)))
        value = Dual(rows[0], slopes.of_value())
        return (value, *map(Dual, after, slopes.after)) if self._fields else value

    @property
    def _partials(self) -> Partials:
        return partials(self._function, tuple(n for n in self._names if n not in _GIVEN))

    def _rows(self, function, count, inputs):
        """Return the value, or the value and the partial derivatives, and the memory after."""
        sizes = {len(item) for name, item in zip(self._names, inputs, strict=True)
                 if isinstance(item, np.ndarray) and name not in TABLES}
        if not sizes and not self._fields:
            result = function(*inputs)
            return (result if isinstance(result, tuple) else (result,)), ()
        size = max(sizes, default=1)
        inputs = [_rows_of(name, item, size) if name in _VARYING else item
                  for name, item in zip(self._names, inputs, strict=True)]
        if self._compiles and kernels.numba() is not None:
            try:
                return self._compiled(function, count, inputs, size)
            except Exception:  # numba raises many kinds; only a user's law comes here
                self._compiles = False
        with np.errstate(all='ignore'):
            if not self._fields:
                return self._on_arrays(function, inputs, size)
            if self._runs_along_time:
                return self._along_time(function, count, inputs, size)
            return self._sample_by_sample(function, count, inputs, size)

    def _compiled(self, function, count, inputs, size):
        out = np.empty((count, size))
        return out, _loop(function, self._names, self._fields, count,
                          self._with_rows(inputs), True)(*inputs, out)

    def _on_arrays(self, function, inputs, size):
        result = bound(function, 'arrays')(*inputs)
        return [np.broadcast_to(row, (size,)) if np.ndim(row) == 0 else row
                for row in (result if isinstance(result, tuple) else (result,))], ()

    def _along_time(self, function, count, inputs, size):
        """Run the recurrences along time, then the partial derivatives element by element."""
        value, *after = (np.broadcast_to(row, (size,))
                         for row in bound(self._function, 'scans')(*inputs))
        last = tuple(float(row[-1]) for row in after)
        if count == 1:
            return [value], last
        before = iter(after)
        inputs = [np.concatenate([[item], next(before)[:-1]]) if name in self._fields else item
                  for name, item in zip(self._names, inputs, strict=True)]
        rows, _ = self._on_arrays(function, inputs, size)
        return [value, *rows[1 + len(after):]], last

    def _sample_by_sample(self, function, count, inputs, size):
        loop = _loop(function, self._names, self._fields, count, self._with_rows(inputs), False)
        out = [[0.0] * size for _ in range(count)]
        after = loop(*(item.tolist() if isinstance(item, np.ndarray) and name not in TABLES
                       else item for name, item in zip(self._names, inputs, strict=True)), out)
        return np.array(out), after

    def _with_rows(self, inputs):
        return frozenset(name for name, item in zip(self._names, inputs, strict=True)
                         if isinstance(item, np.ndarray) and name not in TABLES)


def _rows_of(name, item, size):
    """Return an array (size,) of what may be one number."""
    if isinstance(item, np.ndarray):
        return np.ascontiguousarray(item)
    return np.full(size, item, bool if name in ('start', 'log_start') else float)


@lru_cache(maxsize=1024)
def _loop(function: Callable, names: Sequence[str], fields: tuple[str, ...], count: int,
          with_rows: frozenset[str], compiled: bool) -> Callable:
    """
    Return a loop over rows around a law's function, or around its partial derivatives.

    The loop takes the function's arguments, some of them with rows, and ``out`` (count, T); it
    returns the memory after the last row.
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
    if not compiled:
        return defined(text, 'over_rows', {'law': bound(function, 'floats')})
    return kernels.compiled(defined(text, 'over_rows', {'law': bound(function, 'kernels')}, True))


class _Chain:
    """The chain rule for one law: from slopes of its inputs to slopes of its outputs."""

    def __init__(self, made, fields, inputs, rows):
        self._rows = rows
        self._inputs = inputs
        self._fields = fields
        self._entries = made.entries
        #: Slopes of each memory field before each row, by key.
        self._before: dict[str, dict[int, Any]] = {}
        after = {field: self._carried(field) for field in self._in_order()}
        #: Slopes of each memory field after the last row, by key.
        self.after: list[Slopes] = [after[field] for field in fields]

    def of_value(self) -> dict[int, Any]:
        """Return the slopes of the law's value."""
        return self._through(0, self._before)

    def _through(self, output, before):
        """Return the slopes of an output by way of all inputs and some memory fields."""
        return total(
            scaled(before.get(name, {}) if name in self._fields
                   else slopes_of(self._inputs[name]), self._rows[output, name])
            for number, name in self._entries if number == output)

    def _in_order(self):
        """Return the memory fields, each after those that its slope is made of."""
        waiting = {field: {name for number, name in self._entries
                           if number == 1 + index and name in self._fields and name != field}
                   for index, field in enumerate(self._fields)}
        while waiting:
            ready = [field for field, needs in waiting.items() if not needs & set(waiting)]
            if not ready:
                raise NotImplementedError(
                    f'memory fields {", ".join(waiting)} depend on each other in a circle')
            for field in ready:
                del waiting[field]
            yield from ready

    def _carried(self, field):
        """Work out the slopes of a memory field before each row; return those after the last."""
        output = 1 + self._fields.index(field)
        added = self._through(output, self._before)
        kept = self._rows.get((output, field))
        first = slopes_of(self._inputs[field])
        before, after = {}, {}
        for key in {**first, **added}:
            start = first.get(key, 0.0)
            path = _recurrence(kept, added.get(key, 0.0), start, len(self._size))
            before[key] = np.concatenate([[start], path[:-1]])
            after[key] = float(path[-1])
        self._before[field] = before
        return after

    @property
    def _size(self):
        return next(iter(self._rows.values()))


def _recurrence(gain, offset, start, size):
    """Return y with y[k] = gain[k] y[k-1] + offset[k], y[-1] = start; no gain: the offset."""
    offset = np.broadcast_to(offset, (size,))
    if gain is None:
        return offset
    if kernels.numba() is None:
        return affine_scan(gain, offset, start)
    out = np.empty(size)
    kernels.compiled(affine_rows)(gain, np.ascontiguousarray(offset), start, out)
    return out


def affine_rows(gain, offset, value, out):
    """Write y[k] = gain[k] y[k-1] + offset[k]; a gain of zero forgets all, also nan."""
    for row in range(len(out)):
        value = offset[row] if gain[row] == 0.0 else gain[row] * value + offset[row]
        out[row] = value
