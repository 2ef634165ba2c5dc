# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What one cell of text holds: nothing, a number, a number with its unit, a date or a time."""

from __future__ import annotations

from collections.abc import Sequence
import re

from fam_bundle_ros.data.unit_names import is_unit

#: Cells that stand for no reading, in any case: blanks, what is no number in C and in Excel, and
#: what instruments write beyond their range.
BLANKS = ('', '-', '--', '---', '----', '\u2013', '.', '..', '...', '?', '*', '**', '***', '****',
          '*****', 'nan', '-nan', '+nan', 'nan(ind)', '-nan(ind)', 'na', 'n/a', 'n.a.', 'null',
          'none', 'nil', 'inf', '+inf', '-inf', 'infinity', '-infinity', '1.#ind', '-1.#ind',
          '1.#qnan', '-1.#qnan', '1.#inf', '-1.#inf', '#n/a', '#nv', '#na', '#div/0!', '#value!',
          '#wert!', '#ref!', '#bezug!', '#num!', '#zahl!', '#name?', '#null!', 'ol', '+ol', '-ol',
          'o.l.', 'ovl', 'ovld', 'ovfl', 'over', 'overflow', 'overload', 'overrange', 'over range',
          'underflow', 'underrange', 'out of range', 'missing', 'invalid', 'no data', 'nodata')
_BLANKS = frozenset(BLANKS)
_NUMBER = {
    '.': re.compile(r'[-+]?(\d+(,\d{3})+(\.\d*)?|\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?'),
    ',': re.compile(r'[-+]?(\d+(\.\d{3})+(,\d*)?|\d+,?\d*|,\d+)([eEdD][-+]?\d+)?'),
}
_DATE = r'\d{1,4}[-./ ](?:\d{1,2}|[^\W\d_]{3,9})[-./ ]\d{1,4}'
#: A time of day or a duration; its groups are days, hours, minutes, seconds, and AM or PM.
CLOCK = re.compile(r'(?:(\d+) days?,?\s+)?(?:(\d+):)?(\d{1,3}):(\d{1,2}(?:[.,]\d+|:\d{3})?)\s*'
                   r'([AaPp][Mm])?')
_DATE_BEGINS = re.compile(_DATE + r'|\d{8}T\d{4}')
_TIME = re.compile(_DATE + r'([T ]\S+.*)?|\d{8}T\S+|' + CLOCK.pattern)
#: What calls a row a statistic of others.
_STATISTIC = re.compile(r'(mean|average|avg|max|min|std|st\.? ?dev|sd|sigma|median|sum|total|'
                        r'range|mittelwert|mittel|summe|standardabw|moyenne|media)', re.I)


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
    """Return whether a cell holds a number, a date or a time of day."""
    return is_number(cell, decimal) or is_time(cell) or with_unit(cell, decimal) is not None


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
