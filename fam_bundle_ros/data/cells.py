# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a cell holds, and columns as numbers, as seconds (dates, times of day), or as labels.

A cell of text holds nothing, a number, a number with its unit, a date or a time.
"""

from collections.abc import Sequence
import re
from typing import Any
import warnings

import numpy as np

from fam_bundle_ros.data.unit_names import is_unit
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

#: Cells that stand for no reading, in any case: blanks, what is no number in C and in Excel, and
#: what instruments write beyond their range.
BLANKS = ('', '-', '--', '---', '----', '\u2013', '.', '..', '...', '?', '*', '**', '***', '****',
          '*****', 'nan', '-nan', '+nan', 'nan(ind)', '-nan(ind)', 'na', 'n/a', 'n.a.', 'null',
          'none', 'nil', 'inf', '+inf', '-inf', 'infinity', '-infinity', '1.#ind', '-1.#ind',
          '1.#qnan', '-1.#qnan', '1.#inf', '-1.#inf', '#n/a', '#nv', '#na', '#div/0!', '#value!',
          '#wert!', '#ref!', '#bezug!', '#num!', '#zahl!', '#name?', '#null!', 'ol', '+ol', '-ol',
          'o.l.', 'o.f.', 'ovl', 'ovld', 'ovfl', 'over', '+over', '-over', 'overflow', 'overload',
          'overrange', 'over range', 'underflow', 'underrange', 'out of range', 'missing',
          'invalid', 'no data', 'nodata')
_BLANKS = frozenset(BLANKS)
_NUMBER = {
    '.': re.compile(r'[-+]?([1-9]\d{0,2}(,\d{3})+(\.\d*)?|\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?'),
    ',': re.compile(r'[-+]?([1-9]\d{0,2}(\.\d{3})+(,\d*)?|\d+,?\d*|,\d+)([eEdD][-+]?\d+)?'),
}
#: No group of thousands, whichever sign the decimals of the file have.
_FRACTION = re.compile(r'[-+]?0[.,]\d+')
_DATE = r'\d{1,4}[-./ ](?:\d{1,2}|[^\W\d_]{3,9})[-./ ]\d{1,4}'
#: A time of day or a duration; its groups are days, hours, minutes, seconds, and AM or PM.
CLOCK = re.compile(r'(?:(\d+) days?,?\s+)?(?:(\d+):)?(\d{1,3}):(\d{1,2}(?:[.,]\d+|:\d{3})?)\s*'
                   r'([AaPp][Mm])?')
_DATE_BEGINS = re.compile(_DATE + r'|\d{8}T\d{4}')
_TIME = re.compile(_DATE + r'([T ]\S+.*)?|\d{8}T\S+|' + CLOCK.pattern)
#: What calls a row a statistic of others.
_STATISTIC = re.compile(r'(mean|average|avg|max|min|std|st\.? ?dev|sd|sigma|median|sum|total|'
                        r'range|mittelwert|mittel|summe|standardabw|moyenne|media)', re.I)
#: Overflow and "not a number" of SCPI (IEEE 488.2 instruments).
_SCPI = (9.9e37, 9.91e37)
#: s.
_DAY = 86400.0


def is_blank(cell: str) -> bool:
    """Return whether a cell holds no reading."""
    return cell.strip().casefold() in _BLANKS


def is_number(cell: str, decimal: str = '.') -> bool:
    """Return whether a cell holds a number, with this sign before its decimals."""
    return _NUMBER[decimal].fullmatch(cell.strip()) is not None


def number(cell: str, decimal: str = '.') -> float:
    """
    Return the number that a cell holds (see `is_number`).

    Examples
    --------
    >>> number('1,234.5'), number('1,5D+02', ',')
    (1234.5, 150.0)
    """
    groups = ',' if decimal == '.' else '.'
    return float(cell.replace(groups, '').replace(',', '.').lower().replace('d', 'e'))


def begins_with_date(cell: str) -> bool:
    """Return whether a cell begins with a date."""
    return _DATE_BEGINS.match(cell) is not None


def is_time(cell: str) -> bool:
    """Return whether a cell holds a date, a time of day or a duration such as '0 days 00:01'."""
    return _TIME.fullmatch(cell.strip()) is not None


def is_statistic(cell: object) -> bool:
    """Return whether a cell calls its row a statistic of others: 'Mean', 'Max.', 'Maximum'."""
    return _STATISTIC.match(str(cell).strip()) is not None


def in_groups(cells: Sequence[str], sign: str) -> bool:
    """
    Return whether a sign in a column groups thousands: '950' beside '1,013', never '1,5'.

    Examples
    --------
    >>> in_groups(['950', '1,013'], ','), in_groups(['0,950', '1'], ',')
    (True, False)
    """
    found = [cell.strip().lstrip('+-') for cell in cells if sign in cell]
    return bool(found) and all(
        re.fullmatch(rf'[1-9]\d{{0,2}}({re.escape(sign)}\d{{3}})+', cell) for cell in found
        ) and any(re.fullmatch(r'[-+]?[1-9]\d{2}', cell.strip()) for cell in cells)


def is_reading(cell: str, decimal: str = '.') -> bool:
    """Return whether a cell holds a number, a date or a time of day; '0,5' is one in any file."""
    return (is_number(cell, decimal) or is_time(cell) or with_unit(cell, decimal) is not None
            or _FRACTION.fullmatch(cell.strip()) is not None)


def with_unit(cell: str, decimal: str = '.') -> tuple[str, str] | None:
    """
    Return number and unit of a cell that holds both, None for others.

    Examples
    --------
    >>> with_unit('12.5 mm'), with_unit('run 2')
    (('12.5', 'mm'), None)
    """
    match = re.fullmatch(r'([-+]?[\d.,]*\d)\s*([^\W\d_%][\w%/\u00b2^]*|%)', cell.strip())
    if match and is_number(match[1], decimal) and is_unit(match[2]):
        return match[1], match[2]
    return None


def is_text(column: np.ndarray) -> bool:
    """Return whether a column holds text (objects)."""
    return column.dtype.kind in 'OUS'


def blank(cell: Any) -> bool:
    """Return whether a cell is empty or holds a word for no reading, such as nan."""
    return cell is None or cell != cell or (isinstance(cell, str) and is_blank(cell))


def cell_text(cell: Any) -> str:
    """Return the text of a cell, '' for a blank one."""
    return '' if blank(cell) else str(cell).strip()


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
    if not is_text(column):
        return column.dtype.kind in 'mM'
    first = next(filter(None, map(cell_text, column)), '')
    return CLOCK.fullmatch(first) is not None or begins_with_date(first)


def seconds(name: str, header: str, column: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """
    Return dates or times of day as seconds, (T,), nan for blanks; midnight is passed over.

    The column (T,) has text such as '2026-05-03T12:00:00.25', '3.5.2026 12:00:00,25', '12:00:00
    PM', '0 days 00:00:01.5', or NumPy datetimes.

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
    text = list(map(cell_text, column))
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
