# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Numbers as tables show them, on the page and in the terminal."""

from typing import Any


def number(value: float) -> str:
    """
    Return three significant digits, without an exponent if possible.

    Examples
    --------
    >>> number(1234.56), number(0.01234), number(2.0)
    ('1235', '0.0123', '2')
    """
    if value and (abs(value) >= 1e6 or abs(value) < 1e-4):
        return f'{value:.3g}'
    return f'{value:.0f}' if abs(value) >= 1000.0 else f'{value:.3g}'


def shown(value: Any) -> str:
    """
    Return the text of a table cell; a dash without a value.

    Examples
    --------
    >>> shown(0.5), shown(7), shown(True), shown(None), shown(float('nan'))
    ('0.5', '7', 'yes', '–', '–')
    """
    if value is None or (isinstance(value, float) and value != value):
        return '–'
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return number(value) if isinstance(value, float) else str(value)
