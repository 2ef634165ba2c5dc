# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels with times of their own as columns of a table: the times stand left of the readings."""

from __future__ import annotations

from collections.abc import Mapping
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import unit_of

#: Largest share of the steps of a clock that go back, where it restarts with each trial.
_ANEW = 0.05

#: Share of the rows that a cut table may lack, and half that by which its times differ.
_FEW = 0.05


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
    further.

    Examples
    --------
    >>> quick, slow, once = np.array([[0, 1, 2, 3], [0, 2, 4, np.nan], [9] + 3 * [np.nan]])
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
    several = len({filled[clock] for clock in clocks}) > 1 and all(
        filled[header] <= filled[clock] for header, clock in nearest(order, clocks).items())
    return clocks if several and not _cut(table, clocks) else []


def _cut(table: Table, clocks: list[str]) -> bool:
    """
    Return whether a table of one clock is cut: its last rows lack the columns on the right.

    Two devices that record as many rows but for a few do so for as long; a column of the time
    that a pump has run, say, covers less than the clock.
    """
    known = [column[np.isfinite(column)] for column in (table.columns[each] for each in clocks)]
    counts = np.array([len(times) for times in known])
    units = [unit_of(table.unit_text(header) or '', 's') for header in clocks]
    spans = np.array([np.ptp(times) * (unit.factor if unit else 1.0)
                      for times, unit in zip(known, units)])
    return bool(np.ptp(counts) <= _FEW * counts.max() and np.ptp(spans) > 2 * _FEW * spans.max()
                ) and any(table.meaning(header).quantity == 'time' for header in clocks)


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
                        header, unit or '')) and rises(column, _ANEW):
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


def nearest(order: list[str], clocks: list[str]) -> dict[str, str]:
    """Return for each header the next clock on its left; those left of all clocks have none."""
    found, clock = {}, ''
    for header in order:
        clock = header if header in clocks else clock
        if clock:
            found[header] = clock
    return found


def rises(column: np.ndarray, anew: float = 0.0) -> bool:
    """
    Return whether each of three or more readings is above the one before.

    Parameters
    ----------
    column : ndarray, shape (T,)
    anew : float
        Share of the steps that may go back, as a clock does that restarts with each trial.
    """
    steps = np.diff(column[np.isfinite(column)])
    back = steps < 0.0
    return len(steps) > 1 and bool((steps[~back] > 0.0).all()) and back.mean() <= anew


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
