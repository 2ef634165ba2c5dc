# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units in a column of their own, as force gauges, balances and databases write them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.cells import blank, is_text, numbers
from fam_bundle_ros.data.column_names import QUANTITIES, unit_for, words_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.unit_names import ELECTRIC, is_unit, unit_of
from fam_bundle_ros.errors import InputError

#: What a column of units is called.
NAMES = frozenset('unit units einheit einheiten unite unidad'.split())


def with_unit_columns(table: Table) -> Table:
    """
    Return a table without the columns that hold the units of the column on their left.

    Such a column is called 'unit' and mostly holds units, or is right of a quantity without a
    unit and all its cells fit it. Readings of several units are converted to the first.

    Raises
    ------
    InputError
        For a reading without a unit, or with one of another quantity, with its row.
    """
    columns, units, notes = dict(table.columns), dict(table.units), list(table.notes)
    headers = list(columns)
    for header, beside in zip(headers, headers[1:]):
        quantity, called = table.meaning(header).quantity, bool(NAMES & set(words_of(beside)))
        if not is_text(columns[beside]) or table.unit_text(header) or (
                not np.isfinite(numbers(columns[header])[0]).any()):
            continue
        texts = Counter(str(cell).strip() for cell in columns[beside] if not blank(cell))
        fitting = [text for text in texts if called and (is_unit(text) or text in ELECTRIC)
                   or quantity not in ('', 'time') and unit_for(quantity, text)]
        count = sum(texts[text] for text in fitting)
        if not called and count < texts.total() or 2 * count <= texts.total():
            continue
        columns[header], units[header] = in_one_unit(table.name, header, columns[header],
                                                     columns[beside], table.rows)
        notes.append(f"'{header}' is in {', '.join(texts)}, as '{beside}' tells" + (
            f': read in {units[header]}' if len(texts) > 1 else ''))
        del columns[beside]
    return replace(table, columns=columns, units=units, notes=tuple(notes))


def in_one_unit(name: str, header: str, cells: np.ndarray, units: np.ndarray, rows: np.ndarray,
                ) -> tuple[np.ndarray, str]:
    """
    Return readings in the unit of the first, and this unit; words among them stay as they are.

    Parameters
    ----------
    name, header : str
        File and column, for messages.
    cells, units : ndarray, shape (T,)
        Readings, and the unit of each as text.
    rows : ndarray of int, shape (T,)

    Raises
    ------
    InputError
        For a reading without a unit, or with one of another quantity, with its row.
    """
    texts = np.array(['' if blank(cell) else str(cell).strip() for cell in units], object)
    first = next(filter(None, texts), '')
    if not (texts != first).any():
        return cells, first
    readings, words = numbers(cells)
    known = [unit_of(first, like) for like in QUANTITIES.values()]
    found = next(filter(None, known), None)
    factors = {}
    for text in dict.fromkeys(texts[np.isfinite(readings)]):
        unit = found and unit_of(text, found.like)
        if not text or found is None or unit is None or unit.absolute != found.absolute:
            row = rows[np.argmax((texts == text) & np.isfinite(readings))]
            raise InputError(f"{name}, row {row}: the unit of {header} is '{text}', and in other "
                             f"rows '{first}'; expected units of one quantity")
        factors[text] = unit.factor / found.factor
    scaled = readings * np.array([factors.get(text, 1.0) for text in texts])
    return np.where(words, cells, scaled) if words.any() else scaled, first
