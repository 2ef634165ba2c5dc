# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""From the cells of a column to numbers, to seconds (dates, times of day), or to labels."""

from __future__ import annotations

import re
from typing import Any
import warnings

import numpy as np

from fam_bundle_ros.data.cell_text import begins_with_date, CLOCK, is_blank, is_number, number
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

_DAY = 86400.0


def is_text(column: np.ndarray) -> bool:
    """Return whether a column holds text (objects)."""
    return column.dtype.kind in 'OUS'


def blank(cell: Any) -> bool:
    """Return whether a cell is empty or holds a word for no reading, such as nan."""
    return cell is None or cell != cell or (isinstance(cell, str) and is_blank(cell))


def numbers(column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return a column as floats, nan for blanks, and where it holds words, (T,) each.

    Examples
    --------
    >>> numbers(np.array(['1.5', '', 'high'], object))
    (array([1.5, nan, nan]), array([False, False,  True]))
    """
    if not is_text(column):
        return column.astype(float), np.zeros(len(column), bool)
    values, words = np.full(len(column), np.nan), np.zeros(len(column), bool)
    for i, cell in enumerate(column):
        if blank(cell):
            continue
        try:
            values[i] = float(cell)
        except (TypeError, ValueError):
            if isinstance(cell, str) and is_number(cell):  # 1,234.5 or 1.5D+02
                values[i] = number(cell)
            else:
                words[i] = True
    return values, words


#: Overflow and "not a number" of SCPI (IEEE 488.2 instruments).
_SCPI = (9.9e37, 9.91e37)


def no_reading(values: np.ndarray) -> float | None:
    """
    Return the number that a logger wrote for no reading, None where there is none: -999, 9999.

    Such a code consists of nines. It is farther from every reading than the readings are from each
    other (for a negative code: than neighbouring readings are). A code that occurs once must be
    ten times as far. A positive number in half of the rows or more is a level, and no code.

    Examples
    --------
    Instruments that speak SCPI write 9.9e37 for an overflow and 9.91e37 for none.

    >>> no_reading(np.array([-999.0, 20.0, 35.0, -999.0])), no_reading(np.array([99.9, 50.0]))
    (-999.0, None)
    """
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    for code in (float(finite.min()), float(finite.max())):
        if abs(code) in _SCPI:
            return code
        others = np.sort(finite[finite != code])
        if len(others) < 2 or not re.fullmatch('-?999+', f'{code:.9g}'.replace('.', '')):
            continue
        apart = np.diff(others).max() if code < 0.0 else np.ptp(others)
        count = len(finite) - len(others)
        if code > 0.0 and count >= len(others):
            continue
        if count == 1:
            apart = 10.0 * np.ptp(others)
        if 0.0 < apart < np.abs(others - code).min():
            return code
    return None


def looks_like_time(column: np.ndarray) -> bool:
    """Return whether a column's first filled cell is a date or a time of day."""
    if column.dtype.kind in 'mM':
        return True
    first = next((str(cell).strip() for cell in column if not blank(cell)), '')
    return is_text(column) and bool(CLOCK.fullmatch(first) or begins_with_date(first))


def seconds(name: str, header: str, column: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """
    Return dates or times of day as seconds, (T,), nan for blanks; midnight is passed over.

    Parameters
    ----------
    name, header : str
        File and column, for messages.
    column : ndarray, shape (T,)
        Text such as '2026-05-03T12:00:00.25', '3.5.2026 12:00:00,25', '12:00:00 PM',
        '0 days 00:00:01.5', or NumPy datetimes.
    rows : ndarray of int, shape (T,)

    Raises
    ------
    InputError
        For a cell that is no time, with its row.
    """
    if column.dtype.kind == 'm':
        return column / np.timedelta64(1, 's')
    if column.dtype.kind == 'M':
        known = column[~np.isnat(column)]
        origin = known[0] if len(known) else np.datetime64(0, 's')
        return (column - origin) / np.timedelta64(1, 's')
    text = ['' if blank(cell) else str(cell).strip() for cell in column]
    filled = [i for i, cell in enumerate(text) if cell]
    values = np.full(len(text), np.nan)
    matches = [CLOCK.fullmatch(text[i]) for i in filled]
    if filled and all(matches):
        values[filled] = [_of_clock(match) for match in matches if match]
        clock = values[filled]
        # a clock restarts at midnight, a 12-hour clock without AM and PM at one o'clock
        back = np.diff(clock, prepend=clock[:1])
        twelve = (clock < 13.0 / 24.0 * _DAY).all() and (clock >= _DAY / 24.0).all()
        anew = back < (-0.45 if twelve else -0.5) * _DAY
        values[filled] = clock + (0.5 if twelve else 1.0) * _DAY * np.cumsum(anew)
        return values
    pandas = library('pandas', f'{name}: reading it')
    # 10:15:42,123 and 10:15:42:123
    cells = [re.sub(r'(?<=\d),(?=\d)|(?<=:\d\d):(?=\d{3}$)', '.', text[i]) for i in filled]
    for how in ({'format': 'ISO8601'}, {'dayfirst': _day_first(cells)},
                {'format': 'mixed', 'dayfirst': _day_first(cells)}):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('error')  # a format that pandas cannot infer
                stamps = pandas.Series(pandas.to_datetime(cells, utc=True, **how))
        except (ValueError, TypeError, OverflowError, UserWarning):
            continue
        values[filled] = (stamps - stamps.iloc[0]).dt.total_seconds()
        return values
    at = next((i for i in filled if not (CLOCK.fullmatch(text[i]) or begins_with_date(text[i]))),
              filled[0] if filled else 0)
    raise InputError(f"{name}, row {rows[at]}: {header} is '{text[at][:40]}'; expected a number, "
                     'a date or a time of day')


def _day_first(cells: list[str]) -> bool:
    """
    Return whether the day stands before the month.

    So it does in 3.5.2026, where a first number is above 12, and where it is the one that changes.
    """
    matches = [re.match(r'(\d{1,2})([-./])(\d{1,2})', day) for day in {cell[:5] for cell in cells}]
    found = [match.groups() for match in matches if match]
    first, second = {int(group[0]) for group in found}, {int(group[2]) for group in found}
    return any(group[1] == '.' for group in found) or max(first, default=0) > 12 or (
        max(second, default=0) <= 12 and len(first) > len(second))


def _of_clock(match: re.Match) -> float:
    days, hours, minutes, rest, half = match.groups()
    total = _DAY * int(days or 0) + 3600.0 * int(hours or 0) + 60.0 * int(minutes) + float(
        re.sub('[,:]', '.', rest))
    if half and hours:
        total += 43200.0 * ((half.lower() == 'pm') - (int(hours) == 12))
    return total


def labels(column: np.ndarray) -> np.ndarray:
    """
    Return the labels of trials as text, (T,); a blank cell is of the trial above it.

    Examples
    --------
    >>> labels(np.array([1.0, np.nan, 2.5]))
    array(['1', '1', '2.5'], dtype=object)
    """
    if column.dtype.kind in 'mM':
        column = column.astype(str).astype(object)
    found, last = [], ''
    for cell in column:
        if not (cell is None or cell != cell or (isinstance(cell, str) and not cell.strip())):
            last = f'{cell:g}' if isinstance(cell, float) else str(cell).strip()
        found.append(last)
    return np.array(found, object)
