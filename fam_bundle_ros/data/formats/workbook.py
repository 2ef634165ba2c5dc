# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Excel workbooks (.xlsx) by pandas and openpyxl."""

from dataclasses import replace
from functools import partial
from pathlib import Path
import re
from typing import Any
import zipfile

import numpy as np

from fam_bundle_ros.data.cells import in_groups, is_blank, is_number, number
from fam_bundle_ros.data.column_names import recognise, STRAINS, unit_text_of
from fam_bundle_ros.data.formats import arrays, layout
from fam_bundle_ros.data.formats.stacking import one_below_the_other, parts_of_one
from fam_bundle_ros.data.formats.table import MAX_BYTES, reading_as, Table, unique
from fam_bundle_ros.data.unit_names import is_unit
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

_SNIFFED = 400
#: Time, force, pressure and strain.
_ALL = 4


def read_zip(path: Path, sheet: str | None = None) -> Table:
    """Return the table of a file that is a zip inside: a workbook or an .npz."""
    try:
        with zipfile.ZipFile(path) as packed:
            names = packed.namelist()
            if sum(entry.file_size for entry in packed.infolist()) > MAX_BYTES:
                raise InputError(f'{path.name}: more than {MAX_BYTES / 1e9:.1f} GB when unpacked; '
                                 'expected less (decimate or split the log)')
    except zipfile.BadZipFile as error:
        raise InputError(f'{path.name}: damaged; expected a workbook (.xlsx)') from error
    if 'xl/workbook.xml' in names:
        return read_workbook(path, sheet)
    if any(name.endswith('.npy') for name in names):
        return arrays.read_npz(path)
    if 'content.xml' in names:
        raise InputError(f'{path.name}: an OpenDocument file; expected it saved as .xlsx or .csv')
    raise InputError(f'{path.name}: a compressed folder; expected it unpacked')


def read_workbook(path: Path, sheet: str | None = None) -> Table:
    """
    Return a sheet's table: the one that is named, else that of most known quantities and rows.

    Sheets of the same columns that are called as trials or as pressures are one table.

    Raises
    ------
    InputError
        For a damaged workbook, a sheet that is not there, and one without rows of numbers.
    """
    pandas = library('pandas', f'{path.name}: reading it')
    library('openpyxl', f'{path.name}: reading it')
    damaged = partial(reading_as, path, 'a workbook', Exception)  # openpyxl's own, of zip, of xml
    with damaged():
        file = pandas.ExcelFile(path, engine='openpyxl')
    with file:
        with damaged():
            sheets = pandas.read_excel(file, sheet_name=None, header=None, dtype=object,
                                       na_filter=False)
        if sheet is not None and sheet not in sheets:
            raise InputError(f"{path.name}: no sheet '{sheet}'; expected one of "
                             f"{', '.join(sheets)}")
        names = list(sheets) if sheet is None else [sheet]
        read = {name: _of_sheet(path.name, name, sheets[name], file.book[name]) for name in names}
    # a sheet without a table may tell settings of the others, such as the rest length
    told = tuple(';'.join(map(_text, row)) for name, own in read.items() if own is None
                 for row in sheets[name].to_numpy(object)[:_SNIFFED])
    found = {name: replace(own, above=own.above + told) for name, own in read.items()
             if own is not None}
    if not found:
        raise InputError(f'{path.name}: no rows of numbers in {", ".join(names)}; expected a '
                         'table (formulas need the values that Excel saves with them)')
    table = max(found.values(), key=lambda own: (_known(own), len(own.rows)))
    known = _known(table)
    whole = one_below_the_other({name: own for name, own in found.items() if _known(own) >= known})
    if whole is not None:
        return whole
    if sheet is None and known < _ALL:
        parts = parts_of_one([replace(own, name=own.kind) for own in found.values()])
        if parts is not None and _known(parts) == _ALL:
            return replace(parts, name=path.name, kind='sheets side by side')
    others = [other.kind for other in found.values() if other is not table]
    notes = (f'not read: {", ".join(others)} (tell the sheet)',) if others else ()
    return table.noted(*notes)


def _of_sheet(file: str, sheet: str, frame: Any, cells: Any) -> Table | None:
    """Return the table of a sheet, its ``cells`` those of openpyxl; None without any numbers."""
    values = frame.to_numpy(object)
    decimal = ',' if any(map(_has_decimal_comma, values[:_SNIFFED].T)) else '.'
    head = [[_text(cell, decimal) for cell in row] for row in values[:_SNIFFED]]
    # blank columns are left out
    used = [j for j in range(values.shape[1]) if any(_text(cell).strip() for cell in values[:, j])]
    head = [[row[j] for j in used] for row in head]
    filled = [i for i, row in enumerate(head) if any(cell.strip() for cell in row)]
    first, width = layout.find_data([head[i] for i in filled], decimal)
    if first < 0:
        return None
    names, units, last = layout.find_names([head[i] for i in filled[:first]], width)
    names = unique(names)
    empty = head[filled[last]][width:] if last >= 0 else []
    below = filled[last + 1:first] if last >= 0 else []
    bad = layout.with_bad_cells([head[i] for i in below], width, decimal)
    begin = min([filled[first], *below[len(below) - bad:]])
    columns = {name: _column(values[begin:, j], decimal) for name, j in zip(names, used)}
    words = {(name, begin + 1 + i): text for name, j in zip(names, used)
             if columns[name].dtype.kind == 'f' for i, cell in enumerate(values[begin:, j])
             if isinstance(cell, str) and is_blank(text := cell.strip()) and text}
    columns, units = _as_shown(columns, units, [formats[j] for j in used] if (
        formats := _formats(cells, begin + 1, values.shape[1])) else [])
    kept = np.array([any(_text(cell).strip() for cell in row) for row in values[begin:]], bool)
    columns = {name: column[kept] for name, column in columns.items()}
    lost = [f"not read: '{cell}' of sheet {sheet}, which has no values (formulas need those that "
            'Excel saves with them)' for cell in empty if recognise(cell).quantity]
    return Table(file, f'sheet {sheet}', columns, units, np.flatnonzero(kept) + begin + 1,
                 tuple(lost),
                 above=tuple(map(';'.join, head[:begin])), blanks=partial(_word, words))


def _formats(cells: Any, row: int, width: int) -> list[str]:
    """Return the number formats of a row, [] where the next row has others."""
    rows = [[cell.number_format or '' for cell in found] for found in cells.iter_rows(
        min_row=row, max_row=row + 1, max_col=width)]
    return rows[0] if rows and rows[0] == rows[-1] and len(rows[0]) == width else []


def _as_shown(columns: dict[str, np.ndarray], units: dict[str, str], formats: list[str],
              ) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """
    Return columns in the units that Excel shows, and these: '0.00" lbf"', percents of '0.0%'.

    Examples
    --------
    >>> columns = {'eps [%]': np.array([0.1, 0.2]), 'F': np.array([3.0, 4.0])}
    >>> _as_shown(columns, {}, ['0.0%', '0.00" lbf"'])
    ({'eps [%]': array([10., 20.]), 'F': array([3., 4.])}, {'F': 'lbf'})
    """
    columns, units = dict(columns), dict(units)
    for name, form in zip(list(columns), formats):
        column, quoted = columns[name], ''.join(re.findall(r'"([^"]*)"', form)).strip()
        unit = units.get(name) or unit_text_of(name)
        if unit is None and quoted and is_unit(quoted):
            units[name] = quoted
        shown = re.sub(r'"[^"]*"', '', form)
        if unit == '%' and '%' in shown and column.dtype.kind == 'f' and (
                np.nanmax(np.abs(column), initial=0.0) <= 1.0):
            columns[name] = 100.0 * column
    return columns, units


def _known(table: Table) -> int:
    """Return how many of time, force, pressure and strain a table has."""
    meant = set(table.quantities.values())
    return len(meant & {'time', 'force', 'pressure'}) + bool(meant & set(STRAINS))


def _has_decimal_comma(column: np.ndarray) -> bool:
    """Return whether cells are text with decimal commas: '1,5', not '1,013.5' nor '1,013'."""
    cells = [cell for cell in column if isinstance(cell, str)]
    found = [cell for cell in cells if ',' in cell and is_number(cell, ',')]
    return bool(found) and not in_groups(cells, ',') and not any(
        is_number(cell) and '.' in cell for cell in cells)


def _word(words: dict[tuple[str, int], str], header: str, row: int) -> str:
    """Return the word for no reading in a cell (a function, as tables are pickled)."""
    return words.get((header, row), '')


def _text(cell: Any, decimal: str = '.') -> str:
    if isinstance(cell, float) and cell == cell:
        return str(cell).replace('.', decimal)
    return '' if cell is None or cell != cell else str(cell)


def _column(cells: np.ndarray, decimal: str) -> np.ndarray:
    """Return a column's cells as floats, or as text where one is neither number nor blank."""
    values = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        if isinstance(cell, (int, float)) and not isinstance(cell, bool):
            values[i] = cell
        elif not is_blank(text := _text(cell)):
            if not is_number(text, decimal):
                return np.array([_text(cell) for cell in cells], object)
            values[i] = number(text, decimal)
    return values
