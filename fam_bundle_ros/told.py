# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Display of results in a shell, in a notebook and in tables, and words for them."""

from html import escape
from typing import Any


class Told:
    """Base of results: `repr` is the first line of the text, a notebook shows all of it."""

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {str(self).splitlines()[0]}>'

    def _repr_html_(self) -> str:
        return f'<pre>{escape(str(self))}</pre>'


def number(value: float, digits: int = 3, sign: bool = False) -> str:
    """
    Return a number for a sentence: some significant digits, all before the point below a million.

    Parameters
    ----------
    sign : bool
        Whether a positive number has a plus.

    Examples
    --------
    >>> number(0.01234), number(2.0), number(163.2, 2), number(1234.56), number(1.234e6)
    ('0.0123', '2', '163', '1235', '1.23e+06')
    >>> number(99.7, 2), number(1234.56, sign=True), number(2.0e-5)
    ('100', '+1235', '2e-05')
    """
    plus = '+' if sign else ''
    text = f'{value:{plus}.{digits}g}'
    return f'{value:{plus}.0f}' if 'e' in text and 1.0 <= abs(value) < 1e6 else text


def counted(number: int, noun: str) -> str:
    """Return a number and a noun: `1 trial`, `2 trials`."""
    return f'{number} {noun}{"s" * (number != 1)}'


def shown(value: Any) -> str:
    """
    Return the text of a table cell: three significant digits; a dash without a value.

    Examples
    --------
    >>> shown(1234.56), shown(0.01234), shown(2.0), shown(1.234e6)
    ('1235', '0.0123', '2', '1.23e+06')
    >>> shown(7), shown(True), shown(None), shown(float('nan'))
    ('7', 'yes', '–', '–')
    """
    if value is None or (isinstance(value, float) and value != value):
        return '–'
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if not isinstance(value, float):
        return str(value)
    return number(value)
