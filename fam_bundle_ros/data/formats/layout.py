# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Where a sheet's numbers begin, and which rows above them hold names and units.

Works on a grid of text cells, so that text files and spreadsheets share it. The data begin at the
first row from which nearly all rows have the usual number of cells and of numbers; the names are
the row above with most known quantities, the units another row above of which half the cells are
units.
"""

from collections.abc import Sequence
from itertools import takewhile
import re

import numpy as np

from fam_bundle_ros.data.cells import (
    is_blank,
    is_number,
    is_reading,
    is_statistic,
    is_time,
    with_unit,
)
from fam_bundle_ros.data.column_names import recognise, unit_text_of
from fam_bundle_ros.data.formats import heads
from fam_bundle_ros.data.formats.table import is_unnamed
from fam_bundle_ros.data.unit_names import ELECTRIC, is_unit, unbracketed

#: Units of other quantities that stand in a row of units.
_OTHER_UNITS = frozenset("""\u00b0C degC \u2103 K \u00b0F \u00b0 deg rad Nm W Hz kHz rpm 1/min
    l/min L/min m/s mm/s m/s2 m/s\u00b2 Ohm \u03a9 dB bit""".split())
#: What stands before a row of units.
_LABEL = re.compile(r'\s*(?:units?|einheit(?:en)?|unit(?:e|\u00e9)s?)(?!\w)\s*[:=]?',
                    re.IGNORECASE)
#: Rows looked at above the data, and for names.
_ABOVE, _HEAD = 8, 16


def trimmed(row: Sequence[str]) -> list[str]:
    """Return a row without the blank cells at its end."""
    cells = list(row)
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def find_data(grid: Sequence[Sequence[str]], decimal: str = '.') -> tuple[int, int]:
    """
    Return the index of the first row of data and the number of columns; (-1, 0) for no data.

    More cells than usual are columns only where a row above the data has as many, or where most
    rows have as many separators.
    """
    width = np.array([len(trimmed(row)) for row in grid])
    numbers = np.array([sum(is_reading(cell, decimal) for cell in row) for row in grid])
    cells = np.array([len(row) for row in grid])
    common = int(np.bincount(cells[len(grid) // 2:]).argmax()) if len(grid) else 0
    if ((width == common) & (numbers >= 2)).any():  # the columns on the right end earlier
        width = np.where((cells == common) & (numbers >= 1), common, width)
    blanks = np.array([sum(is_blank(cell) for cell in row[:count])
                       for row, count in zip(grid, width)])
    later = np.arange(len(grid)) >= len(grid) // 2
    # rows of one number count only if there are no rows of more
    full = later & (numbers >= 2) if (later & (numbers >= 2)).any() else numbers >= 2
    if not full.any():
        return -1, 0
    usual_width = int(np.bincount(width[full]).argmax())
    usual = int(np.median(numbers[full]))
    data = (np.abs(width - usual_width) <= 1) & (numbers >= 2) & (numbers + blanks >= usual)
    data |= (width <= usual_width) & (numbers >= 1) & (numbers + usual_width - width >= usual)
    share = np.cumsum(data[::-1])[::-1] / np.arange(len(data), 0, -1)
    # a line with one reading above the names may be the date of the test
    good = np.flatnonzero(data & (share >= 0.8) & (numbers >= min(usual, 2)))
    if not len(good):
        return -1, 0
    first = int(good[0])
    for at in range(first + 1, min(first + _ABOVE, len(grid))):
        # a row of numbers above the names is a preamble
        later_data = good[good > at]
        if not numbers[at] and len(later_data) and sum(
                recognise(cell).quantity != '' for cell in grid[at]) >= 2:
            first = int(later_data[0])
    first = _below_settings(grid, good[good >= first])
    most = int(width[first:][data[first:]].max())
    above = width[:first].max(initial=0)
    return first, usual_width if usual_width < most and usual_width <= above < most else most


def _below_settings(grid: Sequence[Sequence[str]], rows: np.ndarray) -> int:
    """
    Return the first of some rows of numbers that is no setting of the head.

    Settings are a value below 'dt:' and above 'data:', levels ('3 bar', '1 bar') over plain
    numbers, and rows that begin with a word where others do not, up to the last statistic:
    'Length', 'Maximum'. Below that the word may be for the data, or of an event.
    """
    while len(rows) > 1:
        first, then = grid[rows[0]], grid[rows[1]]
        over = [at for at, cell in enumerate(first) if with_unit(cell)]
        between = rows[0] > 0 and all(
            len(trimmed(row)) == 1 and row[0].endswith(':')
            for row in (grid[rows[0] - 1], grid[rows[0] + 1]))
        levels = len(over) > 1 and all(at < len(then) and is_number(then[at]) for at in over)
        if not between and not levels:
            break
        rows = rows[1:]
    labels = [grid[row][0] for row in rows]
    words = [not is_reading(label) and not is_blank(label) for label in labels]
    if np.mean(words) < 0.1:
        statistics = [at for at, label in enumerate(labels[:words.index(False)])
                      if is_statistic(label)]
        rows = rows[max(statistics, default=-1) + 1:]
    return int(rows[0])


def is_row(cells: Sequence[str], width: int, decimal: str = '.') -> bool:
    """
    Return whether a row below the names is one of data, though some of its cells are bad.

    A row that begins with a word (a label such as 'offset') belongs to the header.
    """
    used = trimmed(cells)
    return len(used) >= max(width - 1, 1) and (
        is_reading(used[0], decimal) or is_blank(used[0])) and any(
            is_reading(cell, decimal) for cell in used)


def with_bad_cells(rows: Sequence[Sequence[str]], width: int, decimal: str = '.') -> int:
    """Return the number of rows directly above the data that are data with bad cells."""
    return sum(1 for _ in takewhile(lambda row: is_row(row, width, decimal), reversed(rows)))


def may_name(cells: Sequence[str], width: int) -> bool:
    """Return whether a row has a word for each column, but for the first, and no readings."""
    used = trimmed(cells)
    return len(used) == width and not are_units(used) and not any(
        is_number(cell) or is_blank(cell) and at or is_time(cell)
        for at, cell in enumerate(used))


def find_names(rows: Sequence[Sequence[str]], width: int,
               ) -> tuple[list[str], dict[str, str], int]:
    """
    Return the names of so many columns, their units where a row of them was found, and a row.

    It is the last row that holds names or units, as an index of ``rows``, -1 for none; ``rows``
    are those above the data, the nearest last.
    """
    pairs = heads.of_pairs(rows, width)
    if pairs is not None:
        return *pairs, len(rows) - 1
    begin = max(len(rows) - _HEAD, 0)
    rows = [*rows[:begin], *(_without_label(row, width) for row in rows[begin:])]
    near = [(i, [*row, *[''] * width][:width]) for i, row in enumerate(rows[begin:], begin)
            if 2 <= len(trimmed(row)) and (len(trimmed(row)) <= width + 1 or _of_columns(
                row[:width]) or i + 1 < len(rows) and are_units(rows[i + 1][:width]))]
    near = heads.with_levels([(i, row) for i, row in near if not any(
        is_number(cell) or is_time(cell) for cell in row if len(cell) > 1)])
    if not near:
        return [f'column {i + 1}' for i in range(width)], {}, -1
    filled = [all(cell.strip() for cell in row) for _, row in near]
    known = [sum(recognise(cell).quantity != '' for cell in row if cell.strip())
             for _, row in near]
    unit_like = [are_units(row) for _, row in near]
    # 's' is a unit and the name of a displacement; a row of names has different cells
    candidates = [i for i, (_, row) in enumerate(near) if not unit_like[i] or (
        known[i] > 0.5 * len(row) < len(set(row)))]
    # a row with gaps and one known word is a setting
    at = max(candidates, default=-1, key=lambda i: (
        known[i] if known[i] > 1 or filled[i] else 0, filled[i], i))
    over = near[at - 1][1] if at > 0 else [''] * width
    names = [f'column {i + 1}' for i in range(width)] if at < 0 else [
        _with_name_above(cell.strip(), above.strip()) or f'column {i + 1}'
        for i, (cell, above) in enumerate(zip(near[at][1], over))]
    units_at = sorted((i for i in range(len(near)) if i != at and unit_like[i]), key=lambda i: (
        sum(recognise(*pair).score > 0 for pair in zip(names, near[i][1])), i))[-1:]
    units = {name: unit for i in units_at for name, cell in zip(names, near[i][1])
             if (unit := unbracketed(cell))}
    index = trimmed(rows[-1])
    if at >= 0 and len(index) == 1 < width and recognise(index[0]).quantity in ('time', 'trial'):
        names[0] = index[0]  # pandas writes the name of an index below those of the columns
    return names, units, max(near[i][0] for i in (at, *units_at) if i >= 0)


def _without_label(row: Sequence[str], width: int) -> Sequence[str]:
    """
    Return a row of units without the word for it: in its first cell, or in a cell more.

    Examples
    --------
    >>> _without_label(['units: s', 'N'], 2), _without_label(['Einheiten', 's', 'N'], 2)
    (['s', 'N'], ['s', 'N'])
    """
    match = _LABEL.match(row[0]) if row else None
    if match is None or not are_units(row[1:]):
        return row
    rest = row[0][match.end():].strip()
    return [rest, *row[1:]] if rest else row[1:] if len(trimmed(row)) > width else row


def moved_right(names: list[str], data: Sequence[Sequence[str]]) -> list[str]:
    """
    Return names moved one column to the right where the first is of row names, without a name.

    R and others write them so: one name less than columns, the first of which counts the rows, or
    is blank or text.

    Examples
    --------
    >>> moved_right(['p', 'F', 'column 3'], [['1', '5', '8'], ['2', '5', '9']])
    ['column 1', 'p', 'F']
    """
    last = f'column {len(names)}'
    if names[-1] != last or any(is_unnamed(name) for name in names[:-1]):
        return names
    rows = [row for row in data if len(row) == len(names)]
    first = [row[0] for row in rows]
    words = not any(map(is_reading, first))
    if len(rows) < 2 or not (words or counts_rows(rows)) or all(is_blank(row[-1]) for row in rows):
        return names
    return ['column 1', *names[:-1]]


def counts_rows(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether the first cells of rows count them: '1', '2', '3'."""
    first = [row[0] for row in rows]
    return all(re.fullmatch(r'\d+', cell) for cell in first) and {
        int(later) - int(cell) for cell, later in zip(first, first[1:])} == {1}


def _with_name_above(cell: str, above: str) -> str:
    """Return a name; a blank cell, or one with a unit alone, takes the name above it."""
    alone = not cell or cell[0] in '[(' and is_unit(cell)
    return f'{above} {cell}'.strip() if alone and recognise(above).quantity else cell


def _of_columns(row: Sequence[str]) -> bool:
    """Return whether a row that is too long names columns: others of its cells are settings."""
    known = [recognise(cell).score > 1 for cell in row]
    return sum(known) > 1 or sum(
        found or unit_text_of(cell) is not None for found, cell in zip(known, row)
        ) > 0.6 * len(row)


def are_units(row: Sequence[str]) -> bool:
    """Return whether most of a row's cells are units."""
    cells = [unbracketed(cell) for cell in row if cell.strip()]
    known = sum(is_unit(cell) or cell in ELECTRIC for cell in cells)
    return known > 0 and known + sum(cell in _OTHER_UNITS for cell in cells) > 0.5 * len(cells)
