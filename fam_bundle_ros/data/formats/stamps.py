# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Clocks in two columns, seconds and their fraction; tables with the newest row first."""

from dataclasses import replace
import re

import numpy as np

from fam_bundle_ros.data.cells import looks_like_time, numbers, seconds
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import is_unnamed, Table, unique
from fam_bundle_ros.errors import InputError

_SECONDS = re.compile(r'(.*?)[._/ ]?(?:tv_)?(?:sec|secs|seconds)', re.IGNORECASE)
_FRACTIONS = (('(?:nano|n)sec(?:s|onds)?', 1e-9), ('(?:micro|u)sec(?:s|onds)?', 1e-6))
_MILLI = re.compile(r'ms|msec|milli(?:tm|s|sec|seconds)?', re.IGNORECASE)
#: Number of rows at which the direction of a clock is checked.
_SOME = 50


def with_stamps(table: Table) -> Table:
    """
    Return a table in which seconds with a fraction beside them are one clock; others as they are.

    Columns without names are taken for such where they can be nothing else: seconds since 1970,
    and whole numbers below a thousand million.
    """
    headers = list(table.columns)
    clocks = {header: clock for header, beside in zip(headers, headers[1:])
              if (clock := _stamp(table, header, beside)) is not None}
    if not clocks:
        return table
    names: list[str] = []
    for at, header in enumerate(headers):
        prefix = match[1] if (match := _SECONDS.fullmatch(header)) else header
        names.append((prefix if recognise(prefix, 's').quantity == 'time' else 'time')
                     if header in clocks else f'(fraction of {names[-1]})'
                     if at and headers[at - 1] in clocks else header)
    names = unique(names)
    units = {header: unit for header, unit in table.units.items() if header not in clocks}
    units |= {name: 's' for name, header in zip(names, headers) if header in clocks}
    return replace(table, units=units, columns={
        name: clocks.get(header, table.columns[header]) for name, header in zip(names, headers)})


def oldest_first(table: Table) -> Table:
    """Return a table with the newest row first in reverse order; others as they are."""
    some = np.unique(np.linspace(0, len(table.rows) - 1, _SOME).astype(int))
    for header, column in table.columns.items():
        if table.meaning(header).quantity != 'time' or len(some) < _SOME:
            continue
        try:
            clock = (seconds(table.name, header, column[some], table.rows[some])
                     if looks_like_time(column) else numbers(column[some])[0])
        except InputError:
            continue
        steps = np.diff(clock)
        if (steps <= 0.0).all() and steps.any():
            return replace(table, rows=table.rows[::-1], columns={
                name: each[::-1] for name, each in table.columns.items()}).noted(
                    f"the newest row is the first, by '{header}': read from the last row up")
    return table


def _stamp(table: Table, header: str, beside: str) -> np.ndarray | None:
    """Return the clock of two columns, from its first reading on, s; None where they are none."""
    whole, part = table.columns[header], table.columns[beside]
    if _MILLI.fullmatch(beside) and _are_whole(part) and np.nanmax(part) < 1e3 and (
            looks_like_time(whole)):
        clock = seconds(table.name, header, whole, table.rows)
        return clock + 1e-3 * part if _are_whole(clock) else None
    if whole.dtype.kind != 'f' or part.dtype.kind != 'f' or not np.isfinite(whole).any():
        return None
    match = _SECONDS.fullmatch(header)
    if match:
        worth = next((worth for word, worth in _FRACTIONS if re.fullmatch(
            rf'{re.escape(match[1])}[._/ ]?(?:tv_)?{word}', beside, re.IGNORECASE)), 0.0)
    else:
        unnamed = is_unnamed(header) and is_unnamed(beside)
        worth = 1e-9 if unnamed and 1e9 < np.nanmin(whole) and np.nanmax(whole) < 4e9 and (
            1e6 < np.nanmax(part) < 1e9) and _are_whole(whole) and _are_whole(part) else 0.0
    return whole + worth * part if worth else None


def _are_whole(column: np.ndarray) -> bool:
    """Return whether a column holds whole numbers from zero on."""
    known = column[np.isfinite(column)] if column.dtype.kind == 'f' else np.zeros(0)
    return len(known) > 0 and bool(((known >= 0.0) & (known == np.round(known))).all())
