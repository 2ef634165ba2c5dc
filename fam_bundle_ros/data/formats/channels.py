# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels with times of their own as columns of a table: the times stand left of the readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import Table, without_count
from fam_bundle_ros.data.unit_names import unit_of


class Series(NamedTuple):
    """A channel with its times, which are empty where they are not known."""

    clock: np.ndarray
    readings: np.ndarray
    unit: str = ''
    label: str = ''


def clocks_in(table: Table) -> list[str]:
    """
    Return the columns that are clocks of the columns on their right, [] where there is one clock.

    They rise, have one unit or none, and are filled to different rows; the next column is filled
    to the same row as its clock, and no column further.

    Examples
    --------
    >>> from fam_bundle_ros.data.formats.table import Table
    >>> quick, slow = np.arange(4.0), np.array([0.0, 2.0, 4.0, np.nan])
    >>> clocks_in(Table('log', '', {'tp': quick, 'p': 0 * quick, 'tF': slow, 'F': 0 * slow}))
    ['tp', 'tF']
    """
    filled = {header: int(np.flatnonzero(known)[-1]) for header, column in table.columns.items()
              if column.dtype.kind == 'f' and (known := np.isfinite(column)).any()}
    alike: dict[str, list[str]] = {}
    for header in filled:
        unit = clock_unit(table, header)
        quantity = recognise(without_count(header), unit).quantity
        if quantity in ('', 'time') and (not unit or unit_of(unit, 's')) and rises(
                table.columns[header]):
            alike.setdefault(unit or quantity, []).append(header)
    order = list(filled)
    for name, headers in alike.items():
        if not name and len(alike) > 1:  # a column without a name of time beside one with
            continue
        clocks = [one for one, right in zip(order, order[1:])
                  if one in headers and right not in headers and filled[one] == filled[right]]
        if len({filled[clock] for clock in clocks}) > 1 and all(
                filled[header] <= filled[clock]
                for header, clock in nearest(order, clocks).items()):
            return clocks
    return []


def clock_unit(table: Table, header: str) -> str:
    """Return the text of the unit of a clock, '' for none; 'Time (2)' has the unit of 'Time'."""
    return table.units.get(header) or table.unit_text(without_count(header)) or ''


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
