# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units that lines beside a table state for its columns: 'Force unit: lbf', 'units: s, psi, N'."""

from collections.abc import Iterator, Sequence
import re

from fam_bundle_ros.data.column_names import likes, recognise, STRAINS, unit_for
from fam_bundle_ros.data.unit_names import is_unit, Unit

#: Words for a unit in a line that states some.
_WORD = re.compile(r'\b(units?|einheit(en)?|unit(e|\u00e9)s?)\b( of\b)?', re.IGNORECASE)
#: What parts a name from its unit, and one statement from the next.
_BREAK = re.compile(r'[,;:=|\t()\[\]]|\s+in\s+')
#: A column without a unit, in a list of them.
_NO_UNIT = frozenset(('', '-', '1'))


def stated_unit(lines: Sequence[str], headers: Sequence[str], header: str, quantity: str,
                ) -> Unit | None:
    """
    Return the unit that lines beside a table state for a column; None for none, or for several.

    ``quantity`` is what the column was taken for; a list of units may have one for each of the
    ``headers``.

    Examples
    --------
    >>> columns = ['t', 'p', 'F']
    >>> for line in ('# units: s, psi, lbf', 'Channel 1: Force (lbf)', 'p in bar, force in lbf'):
    ...     print(stated_unit([line], columns, 'F', 'force').text)
    lbf
    lbf
    lbf
    >>> stated_unit(['Load cell: 500 lbf', 'force limit in lbf'], columns, 'F', 'force')
    """
    found = {unit for line in lines for text in _stated(line, headers, header, quantity)
             if (unit := unit_for(quantity, text))}
    return found.pop() if len(found) == 1 else None


def _stated(line: str, headers: Sequence[str], header: str, quantity: str) -> Iterator[str]:
    """Yield the texts of units in a line that are of a column."""
    lists = _WORD.search(line) is not None
    parts = _parts(_WORD.sub('', line))
    if list(filter(None, parts)) == [part for one in headers for part in _parts(one) if part]:
        return  # the row of names: a column 'g' is no unit of the column before it
    while parts and not parts[0]:
        del parts[0]
    if lists and len(parts) == 1:  # 'units s psi lbf'
        parts = parts[0].split()
    if lists and len(parts) == len(headers) and all(
            part in _NO_UNIT or is_unit(part) for part in parts):
        yield parts[headers.index(header)]
        return
    named, several = False, lists and not _named(parts) and sum(map(is_unit, parts)) > 1
    for part in parts:
        if not part:
            continue
        unit = unit_for(quantity, part) if (
            part not in _NO_UNIT and part.casefold() != header.casefold()) else None
        if unit and (named or several and unit.like == likes(quantity)[0]):
            yield part
        named = part.casefold() == header.casefold() or not is_unit(part) and (
            recognise(part).score > 1 and _same(recognise(part).quantity, quantity))


def _parts(line: str) -> list[str]:
    return [part.strip(' "#\r\n') for part in _BREAK.split(line)]


def _named(parts: Sequence[str]) -> bool:
    """Return whether one of some words names a quantity."""
    return any(not is_unit(part) and recognise(part).quantity for part in parts)


def _same(named: str, quantity: str) -> bool:
    """Return whether two quantities are one; each that tells the strain counts as the strain."""
    return named == quantity or {named, quantity} <= {*STRAINS}
