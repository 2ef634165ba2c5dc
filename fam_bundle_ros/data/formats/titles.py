# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressures in titles above and between blocks of rows: 'Test 2: p = 3 bar'."""

from collections import Counter
from dataclasses import replace
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, numbers
from fam_bundle_ros.data.column_names import absolute_of, recognise, words_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import Unit, unit_of

_NUMBER = re.compile(r'(?<![\w.,])(-?\d+(?:[.,]\d+)?)\s*([^\W\d_]+(?:\s?(?:abs|rel)\b\.?)?)(?!\w)')
#: What stands between the ends of a range: '0-300 kPa', '1 to 3 bar'.
_RANGE = re.compile(r'\d(-+|\u2013|\s*(->|\u2192|\.{2,3}|\u2026|to|bis)\s*)$')
#: Words before a pressure that make it that of the rows below.
_AT = ('p', 'at', 'bei', 'druckstufe', 'stufe', 'level', 'isobar', 'isobare')
_SETPOINT = frozenset('set setpoint soll sollwert target nominal command cmd'.split())


class Title(NamedTuple):
    """A line with one pressure: its row, its text, the pressure (Pa), whether it is absolute."""

    row: int
    text: str
    pressure: float
    absolute: bool | None

    @property
    def kind(self) -> str:
        """The text without its numbers and signs: cells of a row are joined by blanks."""
        return ' '.join(re.findall(r'[^\W\d_]+', self.text))


def titled(table: Table) -> Table:
    """
    Return a table with the pressure that only titles tell; others as they are.

    Each block of rows needs one, the first too.
    """
    known = set(table.quantities.values())
    if 'pressure' in known or 'force' not in known:
        return table
    titles = titles_of(table)
    blocks = np.searchsorted(table.rows, [title.row for title in titles])
    lengths = np.diff(np.r_[blocks, len(table.rows)])
    if len(titles) < 2 or blocks[0] or lengths.min() < 1 or len(
            {title.absolute for title in titles}) > 1:
        return table
    readings, _ = _readings(table)
    begins = np.flatnonzero(readings)
    for end, begin in zip(begins[:-1] + 1, begins[1:]):
        if end < begin and not ((blocks >= end) & (blocks <= begin)).any() and not _all_blank(
                table, end, begin):
            return table  # a block in between has a head or a title without a pressure
    pressure = np.repeat([title.pressure for title in titles], lengths)
    rows = np.isin(table.rows, [title.row for title in titles]) & ~readings
    # titles are removed from the columns: they are neither readings nor headers
    whole = replace(table, columns={header: _without(column, rows)
                                    for header, column in table.columns.items()}).with_column(
        'pressure', np.where(readings, pressure, np.nan),
        'Pa abs' if titles[0].absolute else 'Pa')
    if 'trial' not in known:
        texts = np.repeat(np.array([title.text for title in titles], object), lengths)
        whole = whole.with_column('trial', np.where(readings, texts, ''))
    return whole.noted(
        f"pressure as the titles of {len(titles)} blocks tell, '{titles[0].text}' (row "
        f"{titles[0].row}) to '{titles[-1].text}' (row {titles[-1].row})")


def titles_of(table: Table) -> list[Title]:
    """
    Return the lines above and between the rows that tell one pressure, in the order of rows.

    They are of the most frequent kind; other lines with a pressure are settings.
    """
    lines = [*enumerate(table.above, 1), *table.remarks]
    texts = [column for column in table.columns.values() if is_text(column)]
    if texts:
        for at in np.flatnonzero(_readings(table)[1]).tolist():
            cells = filter(None, (cell_text(column[at]) for column in texts))
            lines.append((int(table.rows[at]), ' '.join(cells)))
    found = [title for row, line in sorted(lines) if (title := _title(row, line))]
    kinds = Counter(title.kind for title in found).most_common(1)
    return [title for title in found if title.kind == kinds[0][0]]


def title_of_name(name: str) -> Title | None:
    """Return the pressure that stands in the name of a file: 'run_3bar.csv'; None for none."""
    return _title(0, re.sub(r'[_-]', ' ', name.rpartition('.')[0]), sure=False)


def _title(row: int, line: str, sure: bool = True) -> Title | None:
    """Return a line with one pressure; None for others, such as that of a supply."""
    text = ' '.join(re.split(r'[;\s]+|(?<=\D),(?=\S)|,(?=[^\s\d])',
                             line.replace('"', ''))).strip('#*-=%!/<>;,"\' ')
    found: list[tuple[re.Match[str], Unit]] = [
        (match, unit) for match in _NUMBER.finditer(text) if (unit := unit_of(match[2], 'Pa'))]
    if len(found) != 1 or len(text) > 200:
        return None
    (match, unit), = found
    if _RANGE.search(text[:match.start()]):
        return None
    before = re.split(r'[,;\t]|\s-\s', text[:match.start()])[-1].strip(' :=')
    words, meant = [word for word in words_of(before) if not word.isdigit()], recognise(before)
    told = meant.quantity in ('pressure', 'trial') or bool(_SETPOINT & set(words))
    if sure and not told and ('no reading' in meant.why or words and words[-1] not in _AT
                     and not before.endswith('@')):
        return None  # of a supply, of a sensor
    absolute = absolute_of(text) if unit.absolute is None else unit.absolute
    return Title(row, text[:60], float(match[1].replace(',', '.')) * unit.factor, absolute)


def _without(column: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return a column of text with some cells blank; others as they are."""
    if is_text(column):
        column = column.astype(object)
        column[rows] = ''
    return column


def _all_blank(table: Table, begin: int, end: int) -> bool:
    """Return whether some rows hold no words."""
    return not any(cell_text(cell) for column in table.columns.values() if is_text(column)
                   for cell in column[begin:end])


def _readings(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of readings, and those of words, in which one number may stand."""
    count, words = np.zeros(len(table.rows), int), np.zeros(len(table.rows), bool)
    for column in table.columns.values():
        if column.dtype.kind not in 'mM':
            values, text = numbers(column)
            count += np.isfinite(values)
            words |= text
    titles = words & (count < 2)
    return (count > 0) & ~titles, titles
