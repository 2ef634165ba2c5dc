# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels with times of their own as columns of a table: the times stand left of the readings."""

from __future__ import annotations

from collections.abc import Mapping
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

    They rise, have one unit or none, and are filled to different rows, and no column on their
    right is filled further.

    Examples
    --------
    >>> quick, slow, once = np.array([[0, 1, 2, 3], [0, 2, 4, np.nan], [9] + 3 * [np.nan]])
    >>> clocks_in(Table('log', '', {'row': quick, 'tp': quick, 'T': 0 * quick, 'strain': quick,
    ...                             'tF': slow, 'delay': once, 'F': 0 * slow}))
    ['tp', 'tF']
    >>> [clocks_in(Table('log', '', {f'1 {unit}': quick, 'p': quick, f'2 {other}': slow,
    ...                              'F': 0 * slow}))
    ...  for unit, other in (('[s]', '[s]'), ('[s]', '[ms]'), ('[V]', '[V]'))]
    [['1 [s]', '2 [s]'], [], []]
    """
    filled = {header: int(np.flatnonzero(known)[-1]) for header, column in table.columns.items()
              if column.dtype.kind == 'f' and (known := np.isfinite(column)).any()}
    alike: dict[str, list[str]] = {}
    for header in filled:
        unit, quantity = table.unit_text(header) or '', table.meaning(header).quantity
        if quantity in ('', 'time') and (not unit or unit_of(unit, 's')) and rises(
                table.columns[header]):
            alike.setdefault(unit or quantity, []).append(header)
    order = list(filled)
    for name, headers in alike.items():
        if not name and len(alike) > 1:  # a column without a name of time beside one with
            continue
        clocks = [one for one, right in zip(order, order[1:])
                  if one in headers and right not in headers]
        if len({filled[clock] for clock in clocks}) > 1 and all(
                filled[header] <= filled[clock]
                for header, clock in nearest(order, clocks).items()):
            return clocks
    return []


def nearest(order: list[str], clocks: list[str]) -> dict[str, str]:
    """Return for each header the next clock on its left; those left of all clocks have none."""
    found, clock = {}, ''
    for header in order:
        clock = header if header in clocks else clock
        if clock:
            found[header] = clock
    return found


def rises(column: np.ndarray) -> bool:
    """Return whether each of three or more readings is above the one before."""
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) > 1 and bool((steps > 0.0).all())


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
