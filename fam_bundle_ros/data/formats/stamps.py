# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Clocks in two columns, whole seconds and their fraction, as of ROS messages and of loggers."""

from __future__ import annotations

from dataclasses import replace
import re

import numpy as np

from fam_bundle_ros.data.cells import looks_like_time, seconds
from fam_bundle_ros.data.formats.table import Table, unique
from fam_bundle_ros.data.vocabulary import recognise

_SECONDS = re.compile(r'(.*?)[._/ ]?(?:tv_)?(?:sec|secs|seconds)', re.IGNORECASE)
_FRACTIONS = (('(?:nano|n)sec(?:s|onds)?', 1e-9), ('(?:micro|u)sec(?:s|onds)?', 1e-6))
_MILLI = re.compile(r'ms|msec|milli(?:tm|s|sec|seconds)?', re.IGNORECASE)


def with_stamps(table: Table) -> Table:
    """
    Return a table in which seconds with a fraction beside them are one clock; others as they are.

    Columns without names are taken for such where they can be nothing else: seconds since 1970,
    and whole numbers below a thousand million.
    """
    headers = list(table.columns)
    for date, part in zip(headers, headers[1:]):
        if _MILLI.fullmatch(part) and _are_fractions(table.columns[part]) and looks_like_time(
                table.columns[date]):
            whole = seconds(table.name, date, table.columns[date], table.rows)
            return replace(table, units={**table.units, date: 's'}, columns={
                **table.columns, date: whole + 1e-3 * table.columns[part]})
    clocks = {header: clock for header, beside in zip(headers, headers[1:])
              if (clock := _stamp(table, header, beside)) is not None}
    if not clocks:
        return table
    names: list[str] = []
    for at, header in enumerate(headers):
        prefix = match[1] if (match := _SECONDS.fullmatch(header)) else ''
        names.append((prefix if recognise(prefix, 's').quantity == 'time' else 'time')
                     if header in clocks else f'(fraction of {names[-1]})'
                     if at and headers[at - 1] in clocks else header)
    names = unique(names)
    units = {header: unit for header, unit in table.units.items() if header not in clocks}
    units |= {name: 's' for name, header in zip(names, headers) if header in clocks}
    return replace(table, units=units, columns={
        name: clocks.get(header, table.columns[header]) for name, header in zip(names, headers)})


def _are_fractions(column: np.ndarray) -> bool:
    """Return whether a column holds whole numbers below a thousand."""
    return column.dtype.kind == 'f' and bool(((column >= 0) & (column < 1000)
                                              & (column == np.round(column))).all())


def _stamp(table: Table, header: str, beside: str) -> np.ndarray | None:
    """Return the clock of two columns, from its first reading on, s; None where they are none."""
    whole, part = table.columns[header], table.columns[beside]
    if whole.dtype.kind != 'f' or part.dtype.kind != 'f' or not np.isfinite(whole).any():
        return None
    first = float(whole[np.isfinite(whole)][0])
    match = _SECONDS.fullmatch(header)
    if match:
        worth = next((worth for word, worth in _FRACTIONS if re.fullmatch(
            rf'{re.escape(match[1])}[._/ ]?(?:tv_)?{word}', beside, re.IGNORECASE)), 0.0)
    else:
        unnamed = re.fullmatch(r'column \d+', header) and re.fullmatch(r'column \d+', beside)
        worth = 1e-9 if unnamed and 1e9 < np.nanmin(whole) and np.nanmax(whole) < 4e9 and (
            np.nanmin(part) >= 0.0 and 1e6 < np.nanmax(part) < 1e9) and all(
                np.array_equal(column, np.round(column), equal_nan=True)
                for column in (whole, part)) else 0.0
    return whole - first + worth * part if worth else None
