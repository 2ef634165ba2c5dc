# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A table as a file holds it: columns of numbers or text under their headers."""

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
import re
from typing import Any

import numpy as np

from fam_bundle_ros.data.column_names import Match, recognise, unit_text_of
from fam_bundle_ros.data.unit_names import is_unit
from fam_bundle_ros.errors import in_short, InputError

#: Largest file that is read, bytes.
MAX_BYTES = 1 << 30


@dataclass(frozen=True)
class Table:
    """Columns of a file."""

    #: The file's name, for messages.
    name: str
    #: What it is, in words: 'CSV', 'Excel sheet Run 1', ...
    kind: str
    #: By header: floats (nan for blank cells), or text (objects); shape (T,).
    columns: Mapping[str, np.ndarray]
    #: Units that stand apart from the headers (a row of units, attributes).
    units: Mapping[str, str] = field(default_factory=dict)
    #: What to call each row in messages; shape (T,).
    rows: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    #: What was met on the way, such as sheets that were not read.
    notes: tuple[str, ...] = ()
    #: Lines above the data, which may tell settings.
    above: tuple[str, ...] = ()
    #: Comments between the rows, and in which line they stand.
    remarks: tuple[tuple[int, str], ...] = ()
    #: Returns what stands in a cell of floats that is nan, by header and what its row is
    #: called.
    blanks: Callable[[str, int], str] | None = None

    def __post_init__(self) -> None:
        if not len(self.rows) and self.columns:
            count = len(next(iter(self.columns.values())))
            object.__setattr__(self, 'rows', np.arange(1, count + 1))

    @property
    def lines(self) -> list[str]:
        """The lines above the data, and the comments between the rows."""
        return [*self.above, *(text for _, text in self.remarks)]

    def meaning(self, header: str) -> Match:
        """Return which quantity a column's header names, and its unit."""
        return recognise(header, self.units.get(header, ''))

    @property
    def quantities(self) -> dict[str, str]:
        """The quantity that each header names, '' for none."""
        return {header: self.meaning(header).quantity for header in self.columns}

    def unit_text(self, header: str) -> str | None:
        """Return the text of a column's unit, whether it is known or not; None for none."""
        return self.units.get(header) or unit_text_of(header)

    def text_of(self, header: str, row: int) -> str:
        """Return the text of a cell without a number, by header and row number; '' for none."""
        column = self.columns[header]
        if column.dtype.kind == 'O':
            cell = column[int(np.argmax(self.rows == row))]
            return cell.strip() if isinstance(cell, str) else ''
        return self.blanks(header, row).strip() if self.blanks is not None else ''

    def noted(self, *notes: str) -> 'Table':
        """Return the table with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def with_column(self, header: str, cells: np.ndarray, unit: str = '') -> 'Table':
        """Return the table with a further column, or another one under a header."""
        return replace(self, columns={**self.columns, header: cells},
                       units={**self.units, header: unit} if unit else self.units)

    def stacked(self, parts: Sequence[Mapping[str, str]],
                rows: Sequence[np.ndarray] = ()) -> 'Table':
        """
        Return parts that lie side by side one below the other; units are those of the first.

        ``parts`` tell from which column each new one is, ``rows`` which each has (all by default).
        """
        rows = rows or [np.arange(len(self.rows))] * len(parts)
        return replace(
            self, blanks=None, rows=np.concatenate([self.rows[own] for own in rows]),
            columns={name: joined([self.columns[part[name]][own]
                                   for part, own in zip(parts, rows)]) for name in parts[0]},
            units={name: self.units[header] for name, header in parts[0].items()
                   if header in self.units})


def joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return columns one below the other; text if one of them is."""
    kinds = {part.dtype.kind for part in parts}
    return np.concatenate([part if len(kinds) == 1 else part.astype(object) for part in parts])


def check_size(path: Path) -> None:
    """Raise InputError for an empty or an oversized file."""
    size = path.stat().st_size
    if size == 0:
        raise InputError(f'{path.name}: the file is empty; expected a header and rows')
    if size > MAX_BYTES:
        raise InputError(f'{path.name}: {size / 1e9:.1f} GB; expected at most '
                         f'{MAX_BYTES / 1e9:.1f} GB (decimate or split the log)')


@contextmanager
def reading_as(path: Path, kind: str, *errors: type[Exception]) -> Iterator[None]:
    """
    Raise InputError where the library for a format, ``kind`` in words, cannot read a file.

    It raises ``errors``, by default OSError and ValueError.
    """
    errors = errors or (OSError, ValueError)
    try:
        yield
    except errors as error:
        raise InputError(f'{path.name}: cannot be read as {kind} ({in_short(error)[:80]})'
                         ) from error


def unique(headers: Sequence[Any]) -> list[str]:
    """
    Return headers, blank ones by their number, double ones counted.

    Examples
    --------
    >>> unique(['F', '', 'F'])
    ['F', 'column 2', 'F (2)']
    """
    seen: dict[str, int] = {}
    names = []
    for at, header in enumerate(headers, 1):
        text = ' '.join(str(header).split()) or f'column {at}'
        seen[text] = seen.get(text, 0) + 1
        names.append(text if seen[text] == 1 else f'{text} ({seen[text]})')
    return names


def is_unnamed(header: str) -> bool:
    """Return whether a header is a number that `unique` made up."""
    return re.fullmatch(r'column \d+', header) is not None


def without_count(header: str) -> str:
    """Return a header without the count that `unique` adds to the second of a name."""
    return re.sub(r' \(\d+\)$', '', header)


def names_column(text: str, header: str) -> bool:
    """
    Return whether what a user tells names a column.

    Examples
    --------
    >>> [names_column(text, 'X') for text in ('X [%]', '-X * 2 mm', 'X2 [%]')]
    [True, True, False]
    """
    return re.search(rf'(?<!\w){re.escape(header)}(?!\w)', text) is not None


def _one_name_each(headers: Sequence[Any]) -> list[Any]:
    """
    Return headers of several levels as one name each, also as text, as .parquet keeps them.

    Examples
    --------
    >>> _one_name_each([('cell', 'force [N]'), "('length', 'mm')", '(F)'])
    ['force [N]', 'length [mm]', '(F)']
    >>> _one_name_each([('mu1', 'pressure'), ('mu2', 'pressure')])
    ['mu1 pressure', 'mu2 pressure']
    """
    levels = []
    for header in headers:
        if isinstance(header, str) and header.startswith("('") and header.endswith(')'):
            with suppress(SyntaxError, ValueError):
                header = ast.literal_eval(header)
        names = [name for level in header if (name := str(level).strip())] if isinstance(
            header, tuple) else [header]
        if len(names) > 1 and is_unit(names[-1]) and not (  # 'strain' is known as a unit
                len(names[-1]) > 2 and recognise(names[-1]).score > 2):
            names = [*names[:-2], f'{names[-2]} [{names[-1]}]']
        levels.append(names or [''])
    last = [names[-1] for names in levels]
    return last if len(set(last)) == len(last) else [
        names[0] if len(names) == 1 else ' '.join(names) for names in levels]


def plain_columns(frame: Any) -> dict[str, np.ndarray]:
    """Return a pandas frame's columns as floats, datetimes or text (objects), by header."""
    columns = {}
    for header, position in zip(unique(_one_name_each(frame.columns)), range(frame.shape[1])):
        series = frame.iloc[:, position]
        if series.dtype.kind in 'biuf':
            columns[header] = series.to_numpy(float)
        elif series.dtype.kind in 'mM':
            columns[header] = series.to_numpy()
        else:
            columns[header] = series.to_numpy(object)
    return columns
