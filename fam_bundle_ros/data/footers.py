# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of a table that are no samples: another header further down, statistics at the end."""

from itertools import takewhile

import numpy as np

from fam_bundle_ros.data.cells import (
    begins_with_date,
    blank,
    cell_text,
    CLOCK,
    is_number,
    is_statistic,
    is_text,
    looks_like_time,
    numbers,
)
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.table import Table, without_count
from fam_bundle_ros.data.unit_names import is_unit, unbracketed
from fam_bundle_ros.errors import InputError

#: Largest share of the rows that may be left out as a footer.
_MOST = 0.1


def rows_of_words(table: Table, readings: np.ndarray) -> np.ndarray:
    """Return which rows hold words and no reading of a used column (``readings``), (T,) bool."""
    rows = np.flatnonzero(~readings)
    found = np.zeros(len(readings), bool)
    for column in filter(is_text, table.columns.values()):
        found[rows] |= np.array([not blank(cell) for cell in column[rows]], bool)
    return found


def settings(table: Table, words: np.ndarray) -> np.ndarray:
    """
    Return the rows above a next block that hold a setting, (T,) bool: 'Pressure', '3.0', 'bar'.

    Above the header again, these are all the rows that begin with a word. ``words``, (T,) bool,
    are the rows with a word in a column that is used.
    """
    found = np.zeros(len(words), bool)
    for at in np.flatnonzero(words).tolist():
        cells = [cell for cell in _cells(table, at) if cell]
        found[at] = _is_setting(cells)
        if len(cells) > 1 and not _other_words(table, at):
            above = takewhile(lambda row: _begins_with_word(table, row), range(at, -1, -1))
            found[list(above)] = True
    return found


def _begins_with_word(table: Table, at: int) -> bool:
    first = next(filter(None, _cells(table, at)), '')
    return not (is_number(first) or CLOCK.fullmatch(first) or begins_with_date(first))


def refuse_another_header(table: Table, words: np.ndarray) -> None:
    """
    Raise InputError where a header with other columns or units stands further down.

    The rows below it would be read as the columns of the first header. ``words`` are
    `rows_of_words`.
    """
    for at in np.flatnonzero(words).tolist():
        cells = [cell for cell in _cells(table, at) if cell]
        if not _is_setting(cells) and sum(map(_of_a_header, cells)) > 1 and any(
                map(_of_a_header, _other_words(table, at))):
            raise InputError(
                f"{table.name}, row {table.rows[at]}: another header, '{', '.join(cells)[:80]}'; "
                f"expected the columns and units of the first, '{', '.join(table.columns)[:80]}', "
                'or a file of its own')


def footer(table: Table, words: np.ndarray, clock: str | None) -> tuple[np.ndarray, str]:
    """
    Return the rows at the end that are no samples, (T,) bool, and a note on them ('' for none).

    A footer begins where the first column holds words down to the end, where a column of remarks
    names statistics down to the end, or at a row of words below which the clock starts again.
    ``words`` (T,) are those of `rows_of_words`, ``clock`` is the header of the time.
    """
    first = next(iter(table.columns.values()))
    _, bad = numbers(first)
    found = np.cumprod(bad[::-1])[::-1].astype(bool)
    if looks_like_time(first) or found.mean() > _MOST or bad[~found].mean() > 0.5:
        found[:] = False
    for remarks in filter(is_text, table.columns.values()):
        count = sum(1 for _ in takewhile(is_statistic, remarks[::-1]))
        found[len(found) - count:] = True
    if clock and not looks_like_time(table.columns[clock]):
        time, _ = numbers(table.columns[clock])
        known = np.flatnonzero(np.isfinite(time))
        for last in np.flatnonzero(np.diff(time[known]) < 0)[:1]:
            heads = [at for at in range(known[last] + 1, known[last + 1])
                     if words[at] and _other_words(table, at)]
            found[heads[0] if heads else len(time):] = True
    if found.mean() > _MOST or not found.any():
        return np.zeros(len(first), bool), ''
    at = int(np.argmax(found))
    begin = next(cell for cell in _cells(table, at) if cell)
    return found, f"left out from row {table.rows[at]} on: it begins with '{begin[:40]}'"


def _cells(table: Table, at: int) -> list[str]:
    """Return the cells of a row as text, '' for blanks."""
    return [cell_text(column[at]) for column in table.columns.values()]


def _other_words(table: Table, at: int) -> list[str]:
    """Return the cells of a row that are neither blank nor the header or its unit again."""
    return [cell for cell, header in zip(_cells(table, at), table.columns)
            if cell and ' '.join(cell.split()) not in (header, without_count(header))
            and unbracketed(cell) != table.units.get(header)]


def _is_setting(cells: list[str]) -> bool:
    """Return whether cells hold one number, and else a name and a unit at least."""
    return sum(map(is_number, cells)) == 1 and sum(map(_of_a_header, cells)) > 1


def _of_a_header(cell: str) -> bool:
    return recognise(cell).score > 1 or is_unit(cell)
