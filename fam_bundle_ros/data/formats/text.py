# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Text tables: any separator, point or comma, preamble, comments, byte order mark, UTF-8/16, Latin-1.

The layout is found on the first lines, pandas reads the rest in pieces: a file that is no text,
or one endless line, is refused before it is in memory.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
import csv
from functools import partial
import io
from itertools import islice
from pathlib import Path
import re
from typing import NamedTuple
import warnings

import numpy as np

from fam_bundle_ros.data.cell_text import BLANKS, in_groups, is_number, is_reading, with_unit
from fam_bundle_ros.data.cells import numbers
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats import layout
from fam_bundle_ros.data.formats.encodings import encoding_of
from fam_bundle_ros.data.formats.labelled import labelled
from fam_bundle_ros.data.formats.table import check_size, Table, unique
from fam_bundle_ros.data.measurement import MAX_ROWS
from fam_bundle_ros.errors import in_short, InputError
from fam_bundle_ros.extras import library

#: Characters of a line, and lines that the layout is found on.
_LONGEST, _SNIFFED = 1 << 16, 400
_BLANK = r'\s+'
_SEPARATORS = (',', ';', '\t', '|', _BLANK)
#: Between the digits of 1'234 and 1\u202f234.
_GROUPS = re.compile("(?<=\\d)['\u2019\u00a0\u2009\u202f](?=\\d{3}(?!\\d))")
_SPACED = re.compile(r'[-+]?\d{1,3}( \d{3})+([.,]\d*)?')
#: A quote that begins a cell and does not end on its line, and the most lines of such a header.
_OPEN, _TALLEST = re.compile(r'(?:^|[,;\t|])\s*"[^"]*$'), 16
#: What the serial monitor of the Arduino IDE writes before each line.
_MONITOR = re.compile(r'(\d{1,2}:\d\d:\d\d[.,]\d+) -> ')
#: What Python prints of a row.
_TUPLE = re.compile(r'[\[(]([-+\w., \t]+)[\])](?=\s*$)')
_COMMENTS = ('#', '%', '//', '!')
#: Comments between rows that are kept.
_REMARKS = 10_000


class Dialect(NamedTuple):
    """How a text table is written."""

    separator: str
    decimal: str
    layout: layout.Layout


def read_text(path: Path) -> Table:
    """
    Return the table that a text file holds.

    Raises
    ------
    InputError
        For an empty, binary or oversized file, and one without rows of numbers.
    """
    check_size(path)
    encoding = encoding_of(path)
    try:
        return _read(path, encoding)
    except UnicodeDecodeError:  # a Latin-1 letter behind the part that was sniffed
        return _read(path, 'cp1252')


def _read(path: Path, encoding: str) -> Table:
    pandas = library('pandas', f'{path.name}: reading it')
    errors = 'replace' if encoding == 'cp1252' else 'strict'
    with open(path, encoding=encoding, errors=errors) as stream:
        lines = _lines(path.name, stream)
        head = list(islice(lines, _SNIFFED))
        if labelled(path.name, head) is not None:
            table = labelled(path.name, [*head, *islice(lines, MAX_ROWS + 1)])
            if table is not None:
                return table
    dialect, skipped = sniff(path.name, head)
    names = unique(dialect.layout.names)
    with open(path, encoding=encoding, errors=errors) as stream:
        rows = _Rows(_lines(path.name, stream), skipped, dialect)
        decimal = '.' if dialect.decimal == dialect.separator else dialect.decimal
        try:
            pieces = []
            with warnings.catch_warnings(), pandas.read_csv(
                    rows, sep=dialect.separator, decimal=decimal, header=None,
                    names=range(dialect.layout.width), index_col=False, skipinitialspace=True,
                    na_values=list(BLANKS), skip_blank_lines=False, quotechar='"',
                    chunksize=200_000, low_memory=False,
                    on_bad_lines='error') as reader:
                # remarks behind the first readings are not read
                warnings.simplefilter('ignore', pandas.errors.ParserWarning)
                total = 0
                for piece in reader:
                    total += len(piece)
                    if total > MAX_ROWS:
                        raise InputError(f'{path.name}: more than {MAX_ROWS} rows; decimate or '
                                         'split the log')
                    pieces.append(piece)
        except (pandas.errors.ParserError, pandas.errors.EmptyDataError) as error:
            raise _bad_line(path.name, error, rows) from error
    columns, at = {}, np.frombuffer(rows.numbers, np.int64)[:total]
    units = {}
    for i, (name, own) in enumerate(zip(names, dialect.layout.names)):
        unit = dialect.layout.units.get(own, '')
        columns[name], unit = _numbers_or_text([piece[i] for piece in pieces], dialect.decimal,
                                               unit)
        if unit:
            units[name] = unit
    return Table(path.name, _kind(dialect), columns, units, at, above=tuple(head[:skipped]),
                 remarks=tuple(rows.remarks), notes=tuple(filter(None, [dialect.layout.note])),
                 blanks=partial(_cell, path, encoding, dialect.separator, names))


def _cell(path: Path, encoding: str, separator: str, names: list[str], header: str, row: int,
          ) -> str:
    """Return the text of a cell from the file: pandas drops words for no reading."""
    try:
        with open(path, encoding=encoding, errors='replace') as stream:
            line = next(islice(_lines(path.name, stream), row - 1, None), '')
    except OSError:  # an uploaded file may be deleted by now
        return ''
    return dict(zip(names, split(line, separator))).get(header, '')


def _numbers_or_text(parts: list, decimal: str, unit: str) -> tuple[np.ndarray, str]:
    """Return a column as floats, or text where it holds words, and its unit."""
    if all(part.dtype.kind in 'biuf' for part in parts):
        return np.concatenate([part.to_numpy(float) for part in parts]), unit
    text = np.concatenate([part.to_numpy(object) for part in parts])
    first = with_unit(next((cell for cell in text if isinstance(cell, str)), ''), decimal)
    if first and all(cell.rstrip().endswith(first[1]) for cell in text if isinstance(cell, str)):
        unit = first[1]  # each cell carries it: '12.5 mm'
        text = np.array([cell.rstrip()[:-len(unit)].strip() if isinstance(cell, str) else cell
                         for cell in text], object)
    spaced = [isinstance(cell, str) and _SPACED.fullmatch(cell) is not None for cell in text]
    text = np.array([cell.replace(' ', '') if fits else cell for cell, fits in zip(text, spaced)],
                    object)  # 1 234,5
    signed = [cell for cell in text if isinstance(cell, str)
              and re.fullmatch(r'[-+\d.,eE]+', cell)]
    fits = {sign: all(is_number(cell, sign) for cell in signed) for sign in '.,'}
    # a column may have another decimal sign than the file: 12,5 beside 1.5
    if fits[','] and not (decimal == '.' and fits['.']):
        text = np.array([cell.replace('.', '').replace(',', '.') if isinstance(cell, str)
                         and is_number(cell, ',') else cell for cell in text], object)
    if not (found := numbers(text))[1].any():
        return found[0], unit
    return text, unit


def _kind(dialect: Dialect) -> str:
    word = {',': 'commas', ';': 'semicolons', '\t': 'tabs', '|': 'bars', _BLANK: 'blanks'}
    comma = ', decimal comma' if dialect.decimal == ',' else ''
    return f'text separated by {word[dialect.separator]}{comma}'


def _lines(name: str, stream: io.TextIOBase) -> Iterator[str]:
    """Yield lines; a cell of several lines becomes one line and blank ones, to keep the count."""
    lines = _checked_lines(name, stream)
    for line in lines:
        found = [line]
        if line.count('"') % 2 and _OPEN.search(line):
            for part in islice(lines, _TALLEST):
                found.append(part)
                if sum(one.count('"') for one in found) % 2 == 0:
                    found = [' '.join(one.strip('\r\n') for one in found) + '\n',
                             *['\n'] * (len(found) - 1)]
                    break
        yield from found


def _checked_lines(name: str, stream: io.TextIOBase) -> Iterator[str]:
    """Yield lines; refuse binary files before much of them is in memory."""
    number = 0
    while line := stream.readline(_LONGEST):
        number += 1
        if "'" in line or not line.isascii():
            line = _GROUPS.sub('', line)
        if line[:1] in '[(':
            line = _TUPLE.sub(r'\1', line)
        if ' -> ' in line:
            line = _MONITOR.sub(_clock_cell, line, count=1)
        if '\0' in line:
            raise InputError(f'{name}: not a text file' + (
                '; expected a table with a header' if number < 3 else
                f' from row {number} on, where zero bytes stand; expected them cut off'))
        if len(line) >= _LONGEST and not line.endswith('\n'):
            raise InputError(f'{name}: a line of more than {_LONGEST} characters; expected one '
                             'row per line')
        yield line


def _clock_cell(clock: re.Match[str]) -> str:
    """Return the clock of a serial monitor as the first cell, blank in the line of names."""
    rest = clock.string[clock.end():]
    separator = next((sign for sign in '\t;,' if sign in rest), ' ')
    names = rest[:1].isalpha() and not any(sign in rest for sign in ':=')
    return ('' if names else clock[1]) + separator


class _Rows(io.TextIOBase):
    """The rows of data of a text file, for pandas: without head, comments and blank lines."""

    def __init__(self, lines: Iterator[str], first: int, dialect: Dialect):
        self._lines, self._at, self._first, self._rest = lines, 0, first, ''
        self._dialect = dialect
        self._separator = ' ' if dialect.separator == _BLANK else dialect.separator
        self._end = self._separator + ' \t\r\n'
        #: Line number of each row handed on.
        self.numbers = array('q')
        #: Line number and text of comments between them.
        self.remarks: list[tuple[int, str]] = []

    def readable(self) -> bool:
        return True

    def read(self, size: int | None = -1) -> str:
        """Return the next rows, at least one while there are any."""
        wanted = 1 << 30 if size is None or size < 0 else size
        parts, length = [], 0
        for line in self._lines:
            self._at += 1
            if self._at <= self._first or not line.strip(' \t\r\n;,'):
                continue
            if _is_comment(line):
                if len(self.remarks) < _REMARKS:
                    self.remarks.append((self._at, line.strip()))
                continue
            self.numbers.append(self._at)
            # blank cells at the end are left to pandas, which takes more cells for a mistake
            parts.append(self._narrow(line.rstrip(self._end)) + '\n')
            length += len(parts[-1])
            if length >= wanted:
                break
        text = self._rest + ''.join(parts)
        self._rest = text[wanted:]
        return text[:wanted]

    def _narrow(self, line: str) -> str:
        """Cut a line of words, such as the head of a next test, to as many cells as columns."""
        width = self._dialect.layout.width
        if line.count(self._separator) < width:
            return line
        cells = split(line, self._dialect.separator)
        if len(cells) <= width or any(is_number(cell, self._dialect.decimal)
                                      for cell in cells[:width]):
            return line
        return self._separator.join(cell.replace('"', '').replace(self._separator, ' ')
                                    for cell in cells[:width])


def _is_comment(line: str) -> bool:
    begin = line.lstrip()[:2]
    # '%,s,bar' is a row of units
    return begin.startswith(_COMMENTS) and not re.fullmatch(r'%[,;\t|]', begin)


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
    dialect, line_at = _separated(name, head)
    separator = dialect.separator
    width = max([dialect.layout.width, *_named_columns(head[:line_at], separator)])
    rows = [split(line, separator) for line in head[line_at:] if line.strip()]
    if {len(row) for row in rows} == {width + 1} and layout.counts_rows(rows) and any(
            row[-1] for row in rows):
        width += 1  # row names without a name, and remarks that are mostly blank
    above, cells = _lines_of_names(head[:line_at], dialect, width)
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
             if head[i].strip() and not _is_comment(head[i])]
    bad = layout.with_bad_cells([split(head[i], separator) for i in below], width,
                                dialect.decimal)
    found = layout.Layout(names, units, dialect.layout.first, width, note)
    return dialect._replace(layout=found), min([line_at, *below[len(below) - bad:]])


def _separated(name: str, head: list[str]) -> tuple[Dialect, int]:
    """Return separator and decimal sign with which most cells are readings, and the first row."""
    plain = [(i, line) for i, line in enumerate(head) if line.strip() and not _is_comment(line)]
    quoted = any('"' in line for _, line in plain)
    highest, best = 0.0, None
    for separator in _SEPARATORS:
        if separator == _BLANK and highest >= 3.0:
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
                best = Dialect(separator, decimal, layout.Layout([], {}, first, width)), (
                    plain[first][0])
    if best is not None:
        return best
    if len(plain) == 1 and any(ch.isalpha() for ch in plain[0][1]):
        raise InputError(f'{name}: a header but no rows; expected measurements below it')
    one = sum(is_number(line) or is_number(line, ',') for _, line in plain)
    raise InputError(f'{name}: ' + ('one column of numbers' if one > 0.5 * len(plain) else
                                    'no rows of numbers were found')
                     + '; expected a table with columns for strain (or length), pressure and '
                     'force')


def _lines_of_names(above: list[str], dialect: Dialect, width: int,
                    ) -> tuple[list[int], list[list[str]]]:
    """Return which of the lines above the data may hold names or units, and their cells."""
    filled = [i for i, line in enumerate(above) if line.strip()]
    cells = {i: _header_cells(above[i], dialect, width) for i in filled}
    own = {i: len(split(above[i], dialect.separator)) for i in filled}
    if any(own[i] == width and layout.may_name(cells[i], width) for i in filled
           if not _is_comment(above[i])):
        # beside a row of names a title, or a comment that is no row of units, is a note about them
        filled = [i for i in filled if own[i] > 1 and not _is_comment(above[i])
                  or own[i] == width and layout.are_units(cells[i])]
    return filled, [cells[i] for i in filled]


def _named_columns(above: list[str], separator: str) -> Iterator[int]:
    """Yield how many columns a header names: remarks may be blank in all rows looked at."""
    for line in above if separator != _BLANK else ():
        names = layout.trimmed(split(line, separator))
        if not _is_comment(line) and layout.may_name(names, len(names)) and sum(
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
    if separator == _BLANK:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator,
                                                         skipinitialspace=True), [])]
    except csv.Error:
        return [cell.strip().strip('"') for cell in line.split(separator)]


def _header_cells(line: str, dialect: Dialect, width: int) -> list[str]:
    """Return the cells of a line above the data, also of a comment or with another separator."""
    text = line.strip('\r\n')
    for sign in _COMMENTS if _is_comment(text) else ():
        if text.lstrip().startswith(sign):
            text = text.lstrip().lstrip(sign)
            break
    separators = [dialect.separator] if dialect.separator != _BLANK else []
    tries = [split(text, separator) for separator in separators]
    tries += [split(text, separator) for separator in (',', ';', '\t', '|')
              if separator not in separators]
    # blanks: two or more part the names, or one where brackets keep a unit with its name
    tries.append(list(re.split(r'\s{2,}|\t', text.strip())))
    tries.append(re.findall(r'[^\s\[({]+(?:\s*[\[({][^\])}]*[\])}])?|[\[({][^\])}]*[\])}]',
                            text))
    if dialect.separator == _BLANK:
        tries.append([cell.strip('"') for cell in text.split()])
    # a column of row names may have no name: then there is one name less
    fitting = [cells for cells in tries[:1] if len(layout.trimmed(cells)) == width - 1 > 1]
    fitting += [cells for count in (width, width - 1) for cells in tries
                if len(layout.trimmed(cells)) == count > 1]
    return fitting[0] if fitting else tries[0]


def _bad_line(name: str, error: Exception, rows: _Rows) -> InputError:
    match = re.search(r'Expected (\d+) fields in line (\d+), saw (\d+)', str(error))
    if match:
        at = int(match[2]) - 1
        row = rows.numbers[at] if at < len(rows.numbers) else at + 1
        return InputError(f'{name}, row {row}: {match[3]} cells; expected {match[1]}')
    return InputError(f'{name}: cannot be read as a table ({in_short(error)})')
