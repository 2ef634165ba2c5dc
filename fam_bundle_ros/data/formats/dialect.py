# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""How a text table is written: encoding, separator, decimal sign, and where its names stand."""

import codecs
from collections.abc import Iterator
import csv
from pathlib import Path
import re
from typing import NamedTuple

from fam_bundle_ros.data.cells import in_groups, is_number, is_reading
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats import layout
from fam_bundle_ros.errors import InputError

#: Separator of tables whose columns are separated by blanks.
BLANK = r'\s+'
_SIGNS = ',', ';', '\t', '|'
_COMMENTS = ('#', '%', '//', '!')
_BOMS = ((codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF32_LE, 'utf-32'),
         (codecs.BOM_UTF32_BE, 'utf-32'), (codecs.BOM_UTF16_LE, 'utf-16'),
         (codecs.BOM_UTF16_BE, 'utf-16'))


class Dialect(NamedTuple):
    """How a text table is written: signs, number of columns, their names and units, a note."""

    separator: str
    decimal: str
    width: int
    names: list[str]
    units: dict[str, str]
    note: str

    @property
    def words(self) -> str:
        """How the table is written, in words."""
        word = {',': 'commas', ';': 'semicolons', '\t': 'tabs', '|': 'bars', BLANK: 'blanks'}
        comma = ', decimal comma' if self.decimal == ',' else ''
        return f'text separated by {word[self.separator]}{comma}'


def sniff(name: str, head: list[str]) -> tuple[Dialect, int]:
    """
    Return how a table is written, by its first lines, and how many lines are above the data.

    Raises
    ------
    InputError
        Where there are no rows of at least two numbers.
    """
    odd = sum(not (ch.isprintable() or ch.isspace()) for line in head for ch in line)
    if odd > 0.02 * sum(map(len, head)):
        raise InputError(f'{name}: not a text file; expected a table with a header')
    separator, decimal, width, line_at = _separated(name, head)
    width = max([width, *_named_columns(head[:line_at], separator)])
    rows = [split(line, separator) for line in head[line_at:] if line.strip()]
    if {len(row) for row in rows} == {width + 1} and layout.counts_rows(rows) and any(
            row[-1] for row in rows):
        width += 1  # row names without a name, and remarks that are mostly blank
    above, cells = _lines_of_names(head[:line_at], separator, width)
    names, units, last = layout.find_names(cells, width)
    named, note = sum(not cell.startswith('column ') for cell in names), ''
    if named == width - 1 and names[-1] == f'column {width}':
        moved = layout.moved_right(names, rows)
        which = 'first' if moved != names else 'last'
        note, names = f'{width} columns below {named} names: the {which} has none', moved
    if separator == ',' and width == len(rows[0]) == 2 * named and all(
            re.fullmatch(r'-?\d+', cell) for cell in rows[0]):
        raise InputError(f'{name}, row {line_at + 1}: {width} cells under {named} names; expected '
                         'points for decimals, or quotes about each cell, where commas part cells')
    below = [i for i in range(above[last] + 1 if last >= 0 else line_at, line_at)
             if head[i].strip() and not is_comment(head[i])]
    bad = layout.with_bad_cells([split(head[i], separator) for i in below], width, decimal)
    return (Dialect(separator, decimal, width, names, units, note),
            min([line_at, *below[len(below) - bad:]]))


def _separated(name: str, head: list[str]) -> tuple[str, str, int, int]:
    """
    Return separator and decimal sign with which most cells are readings.

    And the number of columns, and the index of the first line of data.
    """
    plain = [(i, line) for i, line in enumerate(head) if line.strip() and not is_comment(line)]
    quoted = any('"' in line for _, line in plain)
    highest, best = 0.0, None
    for separator in (*_SIGNS, BLANK):
        if separator == BLANK and highest >= 3.0:
            break  # blanks also separate the words of a note
        grid = [split(line, separator) for _, line in plain]
        for decimal in '.,':
            if decimal == separator and not quoted:
                continue
            first, width = layout.find_data(grid, decimal)
            if first < 0 or width < 2:
                continue
            rows = grid[first:]
            readings = sum(is_reading(cell, decimal) for row in rows for cell in row)
            # a footer of whole numbers alone is no table; of equals the one whose sign is met
            score = readings / max(len(rows), len(grid) // 2) + 0.5 * _decimals(rows, decimal)
            if score > highest:
                highest = score
                best = separator, decimal, width, plain[first][0]
    if best is not None:
        return best
    if len(plain) == 1 and any(ch.isalpha() for ch in plain[0][1]):
        raise InputError(f'{name}: a header but no rows; expected measurements below it')
    one = sum(is_number(line) or is_number(line, ',') for _, line in plain)
    raise InputError(f'{name}: ' + ('one column of numbers' if one > 0.5 * len(plain) else
                                    'no rows of numbers were found')
                     + '; expected a table with columns for strain (or length), pressure and '
                     'force')


def _lines_of_names(above: list[str], separator: str, width: int,
                    ) -> tuple[list[int], list[list[str]]]:
    """Return which of the lines above the data may hold names or units, and their cells."""
    filled = [i for i, line in enumerate(above) if line.strip()]
    cells = {i: _header_cells(above[i], separator, width) for i in filled}
    own = {i: len(split(above[i], separator)) for i in filled}
    if any(own[i] == width and layout.may_name(cells[i], width) for i in filled
           if not is_comment(above[i])):
        # beside a row of names a title, or a comment that is no row of units, is a note about them
        filled = [i for i in filled if own[i] > 1 and not is_comment(above[i])
                  or own[i] == width and layout.are_units(cells[i])]
    return filled, [cells[i] for i in filled]


def _named_columns(above: list[str], separator: str) -> Iterator[int]:
    """Yield how many columns a header names: remarks may be blank in all rows looked at."""
    for line in above if separator != BLANK else ():
        names = layout.trimmed(split(line, separator))
        if not is_comment(line) and layout.may_name(names, len(names)) and sum(
                recognise(cell).score > 1 for cell in names) > 2:
            yield len(names)


def _decimals(rows: list[list[str]], decimal: str) -> float:
    """Return the share of cells with this decimal sign, negative if it separates thousands."""
    cells = [cell for row in rows for cell in row if cell.strip()]
    share = sum(decimal in cell and is_number(cell, decimal) for cell in cells) / max(
        len(cells), 1)
    return -share if any(in_groups(column, decimal) for column in zip(*rows)) else share


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without quotes."""
    line = line.strip('\r\n')
    if separator == BLANK:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator,
                                                         skipinitialspace=True), [])]
    except csv.Error:
        return [cell.strip().strip('"') for cell in line.split(separator)]


def _header_cells(line: str, separator: str, width: int) -> list[str]:
    """Return the cells of a line above the data, also of a comment or with another separator."""
    text = line.strip('\r\n')
    if is_comment(text):
        text = text.lstrip()
        text = text.lstrip(next(sign for sign in _COMMENTS if text.startswith(sign)))
    signs = sorted(_SIGNS, key=lambda sign: sign != separator)
    tries = [split(text, sign) for sign in signs]
    # blanks: two or more part the names, or one where brackets keep a unit with its name
    tries.append(list(re.split(r'\s{2,}|\t', text.strip())))
    tries.append(re.findall(r'[^\s\[({]+(?:\s*[\[({][^\])}]*[\])}])?|[\[({][^\])}]*[\])}]',
                            text))
    if separator == BLANK:
        tries.append([cell.strip('"') for cell in text.split()])
    # a column of row names may have no name: then there is one name less
    fitting = [cells for cells in tries[:1] if len(layout.trimmed(cells)) == width - 1 > 1]
    fitting += [cells for count in (width, width - 1) for cells in tries
                if len(layout.trimmed(cells)) == count > 1]
    return fitting[0] if fitting else tries[0]


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    begin = line.lstrip()[:2]
    # '%,s,bar' is a row of units
    return begin.startswith(_COMMENTS) and not re.fullmatch(r'%[,;\t|]', begin)


def encoding_of(path: Path) -> str:
    """Return the encoding by the byte order mark, else by what the first MB can be."""
    with open(path, 'rb') as stream:
        head = stream.read(1 << 20)
    for mark, name in _BOMS:
        if head.startswith(mark):
            return name
    for offset, name in ((1, 'utf-16-le'), (0, 'utf-16-be')):
        if len(head) > 8 and head[offset:4096:2].count(0) > 0.4 * len(head[offset:4096:2]):
            return name
    return 'utf-8' if _decodes(head, 'utf-8') else _of_bytes(head)


def _decodes(head: bytes, name: str) -> bool:
    """Return whether bytes are text of an encoding; the last letter may be cut."""
    try:
        codecs.getincrementaldecoder(name)().decode(head)
    except UnicodeDecodeError:
        return False
    return True


def _of_bytes(head: bytes) -> str:
    """
    Return the encoding of text that is not UTF-8: of Japanese or Chinese, else Latin-1.

    In European text bytes above ASCII stand alone between letters, and hardly one is of 0x80 to
    0x9f; in Japanese and Chinese they stand side by side.
    """
    runs = re.findall(rb'[\x80-\xff]+', head)
    above, low = sum(map(len, runs)), len(re.findall(rb'[\x80-\x9f]', head))
    pairs = all(len(run) % 2 == 0 for run in runs)
    name = 'cp932' if low > 0.2 * above else 'gb18030' if pairs else ''
    side_by_side = above > 2 * len(runs)
    return name if name and side_by_side and _decodes(head, name) else 'cp1252'
