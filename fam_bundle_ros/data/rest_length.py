# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The rest length of the muscle as a file states it, by which lengths become strains."""

from __future__ import annotations

from decimal import Decimal
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import numbers
from fam_bundle_ros.data.column_names import names_rest_length, rest_length_of
from fam_bundle_ros.data.formats.table import Table

#: What else a rest length is called above a table.
_OF_MUSCLE = re.compile('(muscle|actuator|pam|active|gau?ge|specimen|sample)[ _]length|'
                        '(muskel|einspann|mess)l(\u00e4|ae)nge', re.IGNORECASE)
#: Rows that show with how many decimals a column is written.
_SOME = 1000


class RestLength(NamedTuple):
    """
    The rest length of a muscle, m, by source: the first that is known is used.

    Attributes
    ----------
    told : float or None
        By the user.
    stated : float or None
        By the file.
    model : float or None
        By the model.
    """

    told: float | None
    stated: float | None
    model: float | None

    @property
    def used(self) -> float | None:
        """The length by which lengths become strains."""
        return self.told or self.stated or self.model

    @property
    def note(self) -> str:
        """Where the next source states another length, as lengths are shown; else ''."""
        other = self.model if self.told is None else self.stated
        if not self.used or not other:
            return ''
        used, shown = f'{1e3 * self.used:.4g} mm', f'{1e3 * other:.4g} mm'
        if used == shown:
            return ''
        words = (f', as the file says; the model has {shown}' if self.told is None else
                 f'; the file says {shown}')
        return f'read with a rest length of {used}{words} (--rest-length)'


def stated_rest_length(table: Table) -> tuple[float | None, str]:
    """
    Return the rest length that a file states, m, and a note on it.

    It stands in a line above the rows or between them, in a column that is constant, or it is the
    sum of a length and a contraction. None where the file states none; the note is '' unless the
    lines state several.
    """
    said = list(dict.fromkeys(
        length for line in table.lines
        if (length := rest_length_of(_OF_MUSCLE.sub('rest length', line))) is not None))
    if said:
        shown = ', '.join(f'{1e3 * length:.4g} mm' for length in said)
        return said[0], '' if len(said) == 1 else (
            f'several rest lengths in the file: {shown}; the first is taken (--rest-length)')
    for header, column in table.columns.items():
        name = f"{header} {table.units.get(header, '')}".strip()
        if rest_length_of(f'{name}=1') is not None:
            readings = numbers(column)[0]
            told = np.unique(readings[np.isfinite(readings)])
            if len(told) == 1:
                return rest_length_of(f'{name}={told[0]}'), ''
    return _sum_of_lengths(table), ''


def without_unit(table: Table) -> list[str]:
    """Return notes on lines that state a rest length without its unit."""
    return [f"in the file stands '{line.strip()[:60]}', without a unit: not used (--rest-length)"
            for line in dict.fromkeys(table.lines) if names_rest_length(line)]


def _sum_of_lengths(table: Table) -> float | None:
    """
    Return the length, m, that a length and a contraction add up to in all rows, or None.

    The sum is constant to the last digits that both columns show, and to single precision.
    """
    parts = {}
    for header in table.columns:
        match = table.meaning(header)
        if match.quantity in ('length', 'contraction') and match.unit and match.unit.like == 'm':
            parts[match.quantity] = numbers(table.columns[header])[0], match.unit.factor
    if len(parts) < 2:
        return None
    total = np.sum([values * factor for values, factor in parts.values()], axis=0)
    known = np.isfinite(total)
    if not known.any():
        return None
    middle = float(np.median(total[known]))
    digits = sum(_last_digit(values[known]) * factor for values, factor in parts.values())
    rounding = digits + float(np.finfo(np.float32).eps) * abs(middle)
    return middle if np.abs(total[known] - middle).max() <= rounding else None


def _last_digit(values: np.ndarray) -> float:
    """
    Return the value of one unit of the last decimal that any of the first readings shows.

    Examples
    --------
    >>> _last_digit(np.array([1.5, 2.0, 2.25]))
    0.01
    """
    places = [Decimal(repr(value)).normalize().as_tuple().exponent
              for value in values[:_SOME].tolist()]
    return float(10.0 ** min(0, *(place for place in places if isinstance(place, int))))
