# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Numbers as tables show them, on the page and in the terminal."""

from typing import Any

from fam_bundle_ros.told import number


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
