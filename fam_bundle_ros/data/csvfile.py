# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Read a CSV into named columns, in pieces, with memory bounded and errors that name the row."""

import io
from pathlib import Path
import re

import numpy as np

from fam_bundle_ros.data.measurement import MAX_ROWS
from fam_bundle_ros.errors import InputError

#: Larger files are refused unread.
MAX_BYTES = 1 << 30
_PIECE = 4 << 20
_HEADER = 1 << 16


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """
    Return the columns of a CSV file: floats, and text for `trial`.

    Raises
    ------
    InputError
        For an empty, binary or oversized file, a row of the wrong length, text in a number
        column.
    """
    size = path.stat().st_size
    if size == 0:
        raise InputError(f'{path.name}: the file is empty; expected a header and rows')
    if size > MAX_BYTES:
        raise InputError(f'{path.name}: {size / 1e9:.1f} GB; expected at most '
                         f'{MAX_BYTES / 1e9:.1f} GB (decimate or split the log)')
    with open(path, 'rb') as stream:
        names, delimiter, row = _header(path.name, stream)
        text = [name.split('[')[0].strip().lower() == 'trial' for name in names]
        pieces: list[list[np.ndarray]] = []
        total = 0
        for lines in _lines(path.name, stream):
            pieces.append(_parse(path.name, lines, names, text, delimiter, row))
            row += len(lines)
            total += len(pieces[-1][0])
            if total > MAX_ROWS:
                raise InputError(f'{path.name}: more than {MAX_ROWS} rows; decimate or split the '
                                 'log')
    if not total:
        raise InputError(f'{path.name}: a header but no rows; expected measurements below it')
    return {name: np.concatenate([piece[i] for piece in pieces])
            for i, name in enumerate(names)}


def _header(name: str, stream: io.BufferedReader) -> tuple[list[str], str, int]:
    row = 0
    while True:
        row += 1
        line = stream.readline(_HEADER)
        if b'\0' in line or (len(line) == _HEADER and not line.endswith(b'\n')):
            raise InputError(f'{name}: not a text file; expected a CSV with units in its header')
        try:
            text = line.decode('utf-8-sig')
        except UnicodeDecodeError as error:
            raise InputError(f'{name}: not a text file; expected a CSV with units in its '
                             'header') from error
        if not line:
            raise InputError(f'{name}: no header; expected names with units such as '
                             '"pressure [kPa]"')
        if text.strip() and not text.lstrip().startswith('#'):
            break
    delimiter = max(',;\t', key=text.count)
    names = [cell.strip().strip('"') for cell in text.strip('\r\n').split(delimiter)]
    twice = [cell for cell in names if names.count(cell) > 1]
    if twice:
        raise InputError(f"{name}: column '{twice[0]}' stands twice; expected each name once")
    return names, delimiter, row + 1


def _lines(name: str, stream: io.BufferedReader):
    rest = b''
    while True:
        piece = stream.read(_PIECE)
        if not piece:
            break
        if b'\0' in piece:
            raise InputError(f'{name}: not a text file; expected a CSV with units in its header')
        head, newline, tail = (rest + piece).rpartition(b'\n')
        if not newline:
            raise InputError(f'{name}: a line of more than {_PIECE >> 20} MB; expected one row '
                             'per line')
        rest = tail
        yield head.split(b'\n')
    if rest.strip():
        yield [rest]


def _parse(name: str, lines: list[bytes], names: list[str], text: list[bool], delimiter: str,
           row: int) -> list[np.ndarray]:
    numbers = [i for i, is_text in enumerate(text) if not is_text]
    filled = [line for line in lines if line.strip()]
    if not filled:
        return [np.zeros(0, dtype=object if is_text else float) for is_text in text]
    try:
        # the C parser takes neither rows of the wrong length nor words: the slow path explains
        if any(text):
            parts = np.loadtxt(filled, delimiter=delimiter, dtype=str, comments=None,
                               encoding='utf-8', ndmin=2)
            if parts.shape[1] != len(names):
                raise ValueError
            values = parts[:, numbers].astype(float)
            where = dict(zip(numbers, values.T))
            return [np.char.strip(parts[:, i]).astype(object) if is_text else where[i]
                    for i, is_text in enumerate(text)]
        table = np.loadtxt(filled, delimiter=delimiter, comments=None, encoding='utf-8', ndmin=2)
        if table.shape[1] != len(names):
            raise ValueError
        return list(table.T)
    except ValueError:
        return _parse_slowly(name, lines, names, text, delimiter, row)


def _parse_slowly(name: str, lines: list[bytes], names: list[str], text: list[bool],
                  delimiter: str, row: int) -> list[np.ndarray]:
    columns: list[list] = [[] for _ in names]
    for at, line in enumerate(lines):
        if not line.strip():
            continue
        try:
            cells = line.decode('utf-8').strip('\r').split(delimiter)
        except UnicodeDecodeError as error:
            raise InputError(f'{name}, row {row + at}: not text; expected numbers') from error
        if len(cells) != len(names):
            raise InputError(f'{name}, row {row + at}: {len(cells)} cells; expected '
                             f'{len(names)} ({", ".join(names)})')
        for i, cell in enumerate(cells):
            cell = cell.strip().strip('"')
            if text[i]:
                columns[i].append(cell)
                continue
            try:
                columns[i].append(float(cell) if cell else np.nan)
            except ValueError as error:
                comma = re.fullmatch(r'[-+]?\d+,\d*([eE][-+]?\d+)?', cell)
                raise InputError(f"{name}, row {row + at}: {names[i]} is '{cell[:40]}'; expected "
                                 f'a number{" with a point, not a comma" if comma else ""}',
                                 ) from error
    return [np.array(column, dtype=object if is_text else float)
            for column, is_text in zip(columns, text)]
