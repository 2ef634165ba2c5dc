# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Text tables: any separator, point or comma, preamble, comments, byte order mark, UTF-8/16, Latin-1.

The layout is found on the first lines, pandas reads the rest in pieces: a file that is no text,
or one endless line, is refused before it is in memory.
"""

from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
import io
from itertools import islice
from pathlib import Path
import re
import warnings

import numpy as np

from fam_bundle_ros.data.cells import BLANKS, is_number, number, numbers, with_unit
from fam_bundle_ros.data.column_names import QUANTITIES, recognise
from fam_bundle_ros.data.formats.dialect import (
    BLANK,
    Dialect,
    encoding_of,
    is_comment,
    sniff,
    split,
)
from fam_bundle_ros.data.formats.table import Table, unique
from fam_bundle_ros.data.measurement import MAX_ROWS
from fam_bundle_ros.data.unit_names import is_unit, unit_of
from fam_bundle_ros.errors import in_short, InputError
from fam_bundle_ros.extras import library
from fam_bundle_ros.told import counted

#: Characters of a line, and lines that the layout is found on.
_LONGEST, _SNIFFED = 1 << 16, 400
#: Between the digits of 1'234 and 1\u202f234.
_GROUPS = re.compile("(?<=\\d)['\u2019\u00a0\u2009\u202f](?=\\d{3}(?!\\d))")
#: The minus sign of typesetting, before a number.
_MINUS = re.compile('\u2212(?=[.,]?\\d)')
#: 1 234,5.
_SPACED = re.compile(r'[-+]?\d{1,3}( \d{3})+([.,]\d*)?')
#: 1,234: one group of three digits.
_THOUSANDS = re.compile(r'\s*[-+]?[1-9]\d{0,2},\d{3}\s*')
#: A quote that begins a cell and does not end on its line, and the most lines of such a header.
_OPEN, _TALLEST = re.compile(r'(?:^|[,;\t|])\s*"[^"]*$'), 16
#: What the serial monitor of the Arduino IDE writes before each line.
_MONITOR = re.compile(r'(\d{1,2}:\d\d:\d\d[.,]\d+) -> ')
#: What Python prints of a row.
_TUPLE = re.compile(r'[\[(]([-+\w., \t]+)[\])](?=\s*$)')
#: Comments between rows that are kept.
_REMARKS = 10_000
#: A name and its value, maybe with a unit: 'p: 1.5 bar', 'F=2'.
_PAIR = re.compile(r'([^\W\d][\w.]*(?: ?[\[(][^\])]*[\])])?)[\'"]?\s*[:=]\s*'
                   r'([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[Nn]a[Nn]|inf)'
                   r'(?:\s*([A-Za-z%\u00b0]+[/\w\u00b2^]*)(?![\w:=]|\s*[:=]))?')
#: A row of numbers without names.
_ROW = re.compile(r'\s*[-+]?[\d.,]+(?:[eE][-+]?\d+)?\s*[,;\t| ]\s*[-+.\d]')
#: What a terminal or Python's logging writes before each line.
_CLOCK = re.compile(r'\s*[\[(]?\s*((?:\d{4}-\d\d-\d\d[ T])?\d[\d.:]*(?:,\d{3})?)\s*[\])]?\s*'
                    r'(?:->|[-:,;>|])?\s*(?:[\[(]?(?:INFO|DEBUG)[\])]?[\s:-]*)?(?=[^\W\d])')


def read_text(path: Path, drop_bad: bool = False) -> Table:
    """
    Return the table that a text file holds; ``drop_bad`` leaves rows of too many cells out.

    Raises
    ------
    InputError
        For a binary file, and one without rows of numbers.
    """
    encoding = encoding_of(path)
    try:
        return _read(path, encoding, drop_bad)
    except UnicodeDecodeError:  # a Latin-1 letter behind the part that was sniffed
        return _read(path, 'cp1252', drop_bad)


def _read(path: Path, encoding: str, drop_bad: bool) -> Table:
    pandas = library('pandas', f'{path.name}: reading it')
    errors = 'replace' if encoding == 'cp1252' else 'strict'
    with open(path, encoding=encoding, errors=errors) as stream:
        lines = _lines(path.name, stream)
        head = list(islice(lines, _SNIFFED))
        if labelled(path.name, head) is not None and (table := labelled(
                path.name, [*head, *islice(lines, MAX_ROWS + 1)])) is not None:
            return table
    dialect, skipped = sniff(path.name, head)
    names = unique(dialect.names)
    with open(path, encoding=encoding, errors=errors) as stream:
        rows = _Rows(_lines(path.name, stream), skipped, dialect, drop_bad)
        decimal = '.' if dialect.decimal == dialect.separator else dialect.decimal
        try:
            pieces = []
            with warnings.catch_warnings(), pandas.read_csv(
                    rows, sep=dialect.separator, decimal=decimal, header=None,
                    names=range(dialect.width), index_col=False, skipinitialspace=True,
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
    parts = [[piece[i] for piece in pieces] for i in range(dialect.width)]
    commas = [_commas(part) for part in parts]
    asked = [] if ',' in commas else [name for name, sign in zip(names, commas) if sign == '?']
    for name, own, part, sign in zip(names, dialect.names, parts, commas):
        unit = dialect.units.get(own, '')
        columns[name], unit = _numbers_or_text(
            part, ',' if sign == '?' and ',' in commas else dialect.decimal, unit)
        if unit:
            units[name] = unit
    return Table(path.name, dialect.words, columns, units, at, above=tuple(head[:skipped]),
                 remarks=tuple(rows.remarks),
                 notes=tuple(filter(None, [dialect.note, rows.note, *(
                     f"the comma in all cells of '{name}' is taken to group thousands: is it that "
                     'of decimals?' for name in asked)])),
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


def _commas(parts: list) -> str:
    """Return ',' for a column with decimal commas, '?' if they may group thousands, else ''."""
    if all(part.dtype.kind in 'biuf' for part in parts):
        return ''
    cells = [cell for part in parts for cell in part.to_numpy(object) if cell == cell]
    texts = [cell for cell in cells if isinstance(cell, str)]
    if len(texts) < len(cells) or not all(is_number(text, ',') for text in texts):
        return ''
    if all(_THOUSANDS.fullmatch(text) for text in texts):
        return '?'
    return '' if all(is_number(text, '.') for text in texts) else ','


def _numbers_or_text(parts: list, decimal: str, unit: str) -> tuple[np.ndarray, str]:
    """Return a column as floats, or text where it holds words, and its unit."""
    if all(part.dtype.kind in 'biuf' for part in parts):
        return np.concatenate([part.to_numpy(float) for part in parts]), unit
    cells = np.concatenate([part.to_numpy(object) for part in parts])
    words = [at for at, cell in enumerate(cells) if isinstance(cell, str)]
    texts = [cells[at] for at in words]
    first = with_unit(texts[0], decimal) if texts else None
    if first and (readings := _in_unit(first[1], texts, decimal)) is not None:
        cells[words] = readings
        return numbers(cells)[0], first[1]
    if first and all(text.rstrip().endswith(first[1]) for text in texts):
        unit = first[1]  # each cell carries it: '12.5 mm'
        texts = [text.rstrip().removesuffix(unit).strip() for text in texts]
    texts = [text.replace(' ', '') if _SPACED.fullmatch(text) else text for text in texts]
    # not a date, '12.03.2024'
    signed = [text for text in texts if is_number(text, '.') or is_number(text, ',')]
    fits = {sign: all(is_number(text, sign) for text in signed) for sign in '.,'}
    # a column may have another decimal sign than the file: 12,5 beside 1.5
    if fits[','] and not (decimal == '.' and fits['.']):
        texts = [text.replace('.', '').replace(',', '.') if is_number(text, ',') else text
                 for text in texts]
    cells[words] = texts
    values, others = numbers(cells)
    return cells if others.any() else values, unit


def _in_unit(first: str, texts: list[str], decimal: str) -> np.ndarray | None:
    """Return readings of several units, '1.2 bar' and '980 mbar', in the first; else None."""
    pairs = [with_unit(text, decimal) for text in texts]
    units = {pair[1]: None for pair in pairs if pair}
    like = next((like for like in QUANTITIES.values() if unit_of(first, like)), '')
    known = {text: unit for text in units if (unit := unit_of(text, like))}
    if len(units) < 2 or not all(pairs) or known.keys() != units.keys() or len(
            {unit.absolute for unit in known.values()}) > 1:
        return None
    return np.array([number(pair[0], decimal) * known[pair[1]].factor / known[first].factor
                     for pair in pairs if pair])


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
            line = _MINUS.sub('-', _GROUPS.sub('', line))
            line = line.removeprefix('\ufeff')  # of files that were joined
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

    def __init__(self, lines: Iterator[str], first: int, dialect: Dialect, drop_bad: bool):
        self._drop_bad, self._dropped = drop_bad, array('q')
        self._lines, self._at, self._first, self._rest = lines, 0, first, ''
        self._dialect = dialect
        self._separator = ' ' if dialect.separator == BLANK else dialect.separator
        self._end = self._separator + ' \t\r\n'
        #: Line number of each row handed on.
        self.numbers = array('q')
        #: Line number and text of comments between them.
        self.remarks: list[tuple[int, str]] = []

    def read(self, size: int | None = None) -> str:
        """Return the next rows, at least one while there are any."""
        wanted = 1 << 30 if size is None else size
        parts, length = [], 0
        for line in self._lines:
            self._at += 1
            if self._at <= self._first or not line.strip(' \t\r\n;,'):
                continue
            if is_comment(line) or self._is_setting(line):
                if len(self.remarks) < _REMARKS:
                    self.remarks.append((self._at, line.strip()))
                continue
            row = self._narrow(line.rstrip(self._end))
            if self._drop_bad and self._too_wide(row):
                self._dropped.append(self._at)
                continue
            self.numbers.append(self._at)
            # blank cells at the end are left to pandas, which takes more cells for a mistake
            parts.append(row + '\n')
            length += len(parts[-1])
            if length >= wanted:
                break
        text = self._rest + ''.join(parts)
        self._rest = text[wanted:]
        return text[:wanted]

    @property
    def note(self) -> str:
        """The number of rows that were left out, '' for none."""
        return '' if not self._dropped else (
            f"{counted(len(self._dropped), 'row')} of more cells than columns left out (first row "
            f'{self._dropped[0]})')

    def _too_wide(self, line: str) -> bool:
        """Return whether a line has more cells than there are columns."""
        width = self._dialect.width
        return line.count(self._separator) >= width and len(
            split(line, self._dialect.separator)) > width

    def _is_setting(self, line: str) -> bool:
        """Return whether a line too wide for the table is one of settings: 'Data Header:', ..."""
        return self._too_wide(line.rstrip(self._end)) and split(
            line, self._dialect.separator)[0].endswith(':')

    def _narrow(self, line: str) -> str:
        """Cut a line of words, such as the head of a next test, to as many cells as columns."""
        if not self._too_wide(line):
            return line
        cells = split(line, self._dialect.separator)[:self._dialect.width]
        if any(is_number(cell, self._dialect.decimal) for cell in cells):
            return line
        return self._separator.join(cell.replace('"', '').replace(self._separator, ' ')
                                    for cell in cells)


def _bad_line(name: str, error: Exception, rows: _Rows) -> InputError:
    match = re.search(r'Expected (\d+) fields in line (\d+), saw (\d+)', str(error))
    if match:
        at = int(match[2]) - 1
        row = rows.numbers[at] if at < len(rows.numbers) else at + 1
        return InputError(f'{name}, row {row}: {match[3]} cells; expected {match[1]} (--drop-bad '
                          'leaves such rows out)')
    return InputError(f'{name}: cannot be read as a table ({in_short(error)})')


def labelled(name: str, lines: Sequence[str]) -> Table | None:
    """
    Return the table of lines that name their values, None where most lines are no such.

    Examples
    --------
    >>> table = labelled('log', ['p:1.5bar F:2', 'p:1.6bar F:3', 'p:1.7bar F:4'])
    >>> table.columns['F'], table.units
    (array([2., 3., 4.]), {'p': 'bar'})
    >>> list(labelled('log', ['[0.1] p=1 F=2', '[0.2] p=1 F=3', '[0.3] p=1 F=4']).columns['time'])
    ['0.1', '0.2', '0.3']
    """
    pairs = [_PAIR.findall(line) for line in lines]
    counts = Counter(tuple(key for key, _, _ in found) for found in pairs if len(found) > 1)
    if not counts:
        return None
    keys, often = counts.most_common(1)[0]
    rows = [k for k, found in enumerate(pairs) if tuple(key for key, _, _ in found) == keys]
    plain = sum(not found and _ROW.match(line) is not None
                for found, line in zip(pairs[rows[0]:], lines[rows[0]:]))
    if often < 3 or plain > often or len(set(keys)) < len(keys):  # titles of blocks of rows
        return None
    values = np.array([[float(value) for _, value, _ in pairs[k]] for k in rows])
    units = {key: unit for key, (_, _, unit) in zip(keys, pairs[rows[0]])
             if unit and is_unit(unit)}
    columns = dict(zip(keys, values.T))
    clock = [_CLOCK.match(lines[k]) for k in rows]
    if all(clock) and not any(recognise(key).quantity == 'time' for key in keys):
        columns = {'time': np.array([found[1] for found in clock if found], object), **columns}
    read = set(rows)
    lost = [k for k in range(rows[0], len(lines)) if k not in read and lines[k].strip()]
    notes = (f'{counted(len(lost), "line")} between the rows without a value for each of '
             f'{", ".join(keys)}, not read (the first is line {lost[0] + 1}: '
             f"'{lines[lost[0]].strip()[:40]}')",) if lost else ()
    return Table(name, 'text with a name beside each value', columns, units, np.array(rows) + 1,
                 notes=notes)
