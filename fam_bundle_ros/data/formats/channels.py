# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels with times of their own as columns of a table: the times stand left of the readings."""

from collections.abc import Mapping, Sequence
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import unit_of


class Series(NamedTuple):
    """A channel with its times."""

    clock: np.ndarray
    readings: np.ndarray
    unit: str = ''
    label: str = ''


def clocks_in(table: Table) -> list[str]:
    """
    Return the columns that are clocks of the columns on their right, [] where there is one clock.

    They are `may_be_clocks`, are filled to different rows, and no column on their right is filled
    further. A difference of one row is that of a last line that was not written to its end.

    Examples
    --------
    >>> gap = [np.nan]
    >>> quick, slow, once = np.array([[0, 1, 2, 3, 4], [0, 2, 4] + 2 * gap, [9] + 4 * gap])
    >>> clocks_in(Table('log', '', {'row': quick, 'tp': quick, 'T': 0 * quick, 'strain': quick,
    ...                             'tF': slow, 'delay': once, 'F': 0 * slow}))
    ['tp', 'tF']
    >>> [clocks_in(Table('log', '', {f'1 {unit}': quick, 'p': quick, f'2 {other}': slow,
    ...                              'F': 0 * slow}))
    ...  for unit, other in (('[s]', '[s]'), ('[s]', '[ms]'), ('[V]', '[V]'))]
    [['1 [s]', '2 [s]'], ['1 [s]', '2 [ms]'], []]
    >>> clocks_in(Table('log', '', {'t [s]': quick, 'p': quick, 'valve open [s]': slow,
    ...                             'F': 0 * slow}))
    []
    """
    filled = {header: int(np.flatnonzero(known)[-1]) for header, column in table.columns.items()
              if column.dtype.kind == 'f' and (known := np.isfinite(column)).any()}
    order, headers = list(filled), may_be_clocks(table)
    clocks = [one for one, right in zip(order, order[1:])
              if one in headers and right not in headers]
    ends = [filled[clock] for clock in clocks]
    several = max(ends, default=0) - min(ends, default=0) > 1 and all(
        filled[header] <= filled[clock] for header, clock in nearest(order, clocks).items())
    return clocks if several else []


def may_be_clocks(table: Table) -> list[str]:
    """
    Return the columns of numbers that by their names are times, and rise but for restarts.

    [] where a column of text or of dates is the time: it is that of all columns.
    """
    found = []
    for header, column in table.columns.items():
        meant, unit = table.meaning(header), table.unit_text(header)
        if column.dtype.kind in 'OM' and meant.quantity == 'time':
            return []
        if column.dtype.kind == 'f' and 'no reading' not in meant.why and (
                not unit or unit_of(unit, 's')) and (
                    meant.quantity == 'time' or not meant.quantity and says_time(
                        header, unit or '')) and rises(column, restarts=True):
            found.append(header)
    return found


def says_time(header: str, unit: str = '') -> bool:
    """
    Return whether a header of an unknown name may be one of times.

    Examples
    --------
    >>> [says_time(header) for header in ('t_F', 'tF', 'Force time', 'T', 'row', 'Centimeter')]
    [True, True, True, False, False, False]
    >>> says_time('T (ms)', 'ms'), says_time('2 [s]', 's'), says_time('open total [s]', 's')
    (True, True, False)
    """
    name = re.sub(r'[\[(].*', '', header)
    name = name if not unit else re.sub(rf'(?<![a-zA-Z]){re.escape(unit)}\s*$', '', name)
    word = re.search(r'(?<![a-zA-Z])[tT][a-zA-Z]?(?![a-zA-Z])' if unit else
                     r'(?<![a-zA-Z])t[a-zA-Z]?(?![a-zA-Z])', name)
    return bool(word or re.search(r'(?i)time(?![a-z])|timestamp|zeit|clock|stamp', name)
                ) or bool(unit) and not re.search('[a-zA-Z]', name)


def nearest(order: Sequence[str], clocks: Sequence[str]) -> dict[str, str]:
    """Return for each header the next clock on its left; those left of all clocks have none."""
    found, clock = {}, ''
    for header in order:
        clock = header if header in clocks else clock
        if clock:
            found[header] = clock
    return found


def rises(column: np.ndarray, restarts: bool = False) -> bool:
    """
    Return whether each of three or more readings is above the one before.

    With ``restarts`` it may go back, to nearer the start of what it rose through than its end, as
    a clock does that restarts with each trial.

    Examples
    --------
    >>> [rises(np.array(clock), restarts=True) for clock in ([0, 1, 2, 0.1, 1], [0, 1, 2, 1.9, 3])]
    [True, False]
    """
    known = column[np.isfinite(column)]
    steps = np.diff(known)
    back = np.flatnonzero(steps < 0.0)
    starts = known[[0, *back + 1]] if len(known) else known
    anew = (starts[1:] - starts[:-1] < known[back] - starts[1:]).all()
    return len(steps) > 1 and bool((steps != 0.0).all() and (not len(back) or restarts and anew))


def filled_up(values: np.ndarray, rows: int) -> np.ndarray:
    """Return values with nan in the rows behind them."""
    return np.concatenate([values, np.full(rows - len(values), np.nan)])


def as_columns(vectors: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return vectors as columns, those of one length together, what may be a clock first."""
    lengths = [len(vector) for vector in vectors.values()]
    order = sorted(vectors, key=lambda name: (
        lengths.index(len(vectors[name])),
        recognise(name).quantity not in ('', 'time') or not rises(vectors[name])))
    return {name: filled_up(vectors[name], max(lengths)) for name in order}
