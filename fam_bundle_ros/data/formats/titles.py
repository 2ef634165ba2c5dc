# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What lines above and between the rows tell: pressures, names of columns; levels of blocks."""

from collections import Counter
from collections.abc import Collection
from dataclasses import replace
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, numbers
from fam_bundle_ros.data.column_names import (
    absolute_of,
    recognise,
    STRAINS,
    unit_text_of,
    words_of,
)
from fam_bundle_ros.data.formats.table import names_column, Table, unique
from fam_bundle_ros.data.unit_names import Unit, unit_of

_NUMBER = re.compile(r'(?<![\w.,])(-?\d+(?:[.,]\d+)?)\s*([^\W\d_]+(?:\s?(?:abs|rel)\b\.?)?)(?!\w)')
#: What stands between the ends of a range: '0-300 kPa', '1 to 3 bar'.
_RANGE = re.compile(r'\d(-+|\u2013|\s*(->|\u2192|\.{2,3}|\u2026|to|bis)\s*)$')
#: Words before a pressure that make it that of the rows below.
_AT = ('p', 'at', 'bei', 'druckstufe', 'stufe', 'level', 'isobar', 'isobare')
_SETPOINT = frozenset('set setpoint soll sollwert target nominal command cmd'.split())
#: Fewer readings than this are no channel of a slow sensor; larger shares are gaps.
_FEWEST, _SHARE = 12, 0.34
#: 'CH1 = load cell [N]', 'column 3: pressure (kPa)', 'AI0 -> F [N]'.
_ENTRY = re.compile(r'[#%!/;*"\s]*(?P<key>[^\W\d_]+[\s_.]?\d+|\d+)\s*(?:=|:|->|\)|\s-\s)\s*'
                    r'(?P<name>\S.*?)["\s,;]*')
#: What a column is called in a list of all, by its place.
_PLACE = re.compile(r'(?:col(?:umn)?|spalte|field|#)?\s*(\d+)', re.IGNORECASE)


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


def filled_down(table: Table) -> Table:
    """
    Return a table with the level of each block in all of its rows; others as they are.

    It is a pressure, or a strain, that has a number in the first row of readings and in few
    others, with blanks below each: in less than 12, or in a map without a clock.
    """
    meant = table.quantities
    force = next((column for header, column in table.columns.items()
                  if meant[header] == 'force' and column.dtype.kind == 'f'), None)
    if force is None or len(force) < _FEWEST:
        return table
    rows = np.isfinite(force)
    whole = table
    for header, column in table.columns.items():
        if meant[header] not in ('pressure', *STRAINS) or column.dtype.kind != 'f':
            continue
        known = np.flatnonzero(np.isfinite(column))
        few = 1 < len(known) <= _SHARE * rows.sum()
        if few and known[0] <= np.argmax(rows) and np.diff(known).min() > 1 and (
                len(known) < _FEWEST or 'time' not in meant.values()):
            last = np.searchsorted(known, np.arange(len(column)), 'right') - 1
            whole = whole.with_column(
                header, np.where(rows & (last >= 0), column[known[last]], column)).noted(
                    f"'{header}' stands in {len(known)} of {rows.sum()} rows: taken for the rows "
                    'below each')
    return whole


def with_legend(table: Table, told: Collection[str] = ()) -> Table:
    """
    Return a table with the names that lines above it give to its columns; others as they are.

    A legend names each column by its place, or some by headers that say nothing ('CH1'). Headers
    that the user names (in one of ``told``) stay.
    """
    entries = {match['key']: match['name'] for line in table.above
               if (match := _ENTRY.fullmatch(line.strip()))}
    places = {int(match[1]): name for key, name in entries.items()
              if (match := _PLACE.fullmatch(key))}
    headers = list(table.columns)
    known = [header for header in headers if table.meaning(header).quantity]
    first = min(places, default=1)
    if first in (0, 1) and list(places) == list(range(first, first + len(headers))) and (
            sum(recognise(name).quantity != '' for name in places.values()) > len(known)):
        names = dict(zip(headers, places.values()))
    else:
        keys = {_key(key): name for key, name in entries.items() if recognise(name).quantity}
        names = {header: keys[_key(header)] for header in headers
                 if header not in known and _key(header) in keys}
    others = [text for text in told
              if not any(names_column(text, name) for name in names.values())]
    names = {header: name for header, name in names.items()
             if not any(names_column(text, header) for text in others)}
    if not names:
        return table
    new = unique([names.get(header, header) for header in headers])
    return replace(
        table, columns=dict(zip(new, table.columns.values())), blanks=None,
        units={name: table.units[header] for name, header in zip(new, headers)
               if header in table.units and unit_text_of(name) is None},
        notes=(*table.notes, 'names as lines above the table tell: ' + ', '.join(
            f"'{header}' is '{name}'" for header, name in names.items())))


def _key(key: str) -> str:
    return re.sub(r'[\W_]', '', key).casefold()
