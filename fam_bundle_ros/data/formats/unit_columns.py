# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units in a column of their own, as force gauges, balances and databases write them."""

from collections.abc import Collection, Mapping
from dataclasses import replace
import re

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, numbers
from fam_bundle_ros.data.column_names import QUANTITIES, unit_for, words_of
from fam_bundle_ros.data.formats.table import is_unnamed, Table
from fam_bundle_ros.data.told_columns import name_of
from fam_bundle_ros.data.unit_names import ELECTRIC, is_unit, unit_of
from fam_bundle_ros.errors import InputError

#: What a column of units is called.
NAMES = frozenset('unit units einheit einheiten unite unidad'.split())


#: A current in A is no reading, and a likely name of a motor unit.
_READ = ELECTRIC - {'A'}


def with_unit_columns(table: Table, told: Collection[str] = ()) -> Table:
    """
    Return a table without the columns that hold the units of the column beside them.

    Such a column is called 'unit' and mostly holds units that fit the quantity beside it, or it
    has no name, is right of a quantity, and has a fitting unit for each reading. Units are of the
    column on their left, or all of that on their right where more fit. Readings of several units
    are converted to the first. A unit that the user tells (in one of ``told``) counts more.

    Raises
    ------
    InputError
        For a reading without a unit, or with one of another quantity, with its row.
    """
    columns, units, notes = dict(table.columns), dict(table.units), list(table.notes)
    headers = list(columns)
    left: dict[str, str] = {}
    right: dict[str, str] = {}
    for at, beside in enumerate(headers):
        if not is_text(columns[beside]) or not (_called(beside) or is_unnamed(beside)):
            continue
        if at and _fits(table, headers[at - 1], beside):
            left[beside] = headers[at - 1]
        if at + 1 < len(headers) and _called(beside) and _fits(table, headers[at + 1], beside):
            right[beside] = headers[at + 1]
    for beside, header in _pairs(table, left, right).items():
        if any(re.search(rf'(?<!\w){re.escape(header)}\s*\[', text) for text in told):
            continue
        texts = dict.fromkeys(filter(None, map(cell_text, columns[beside])))
        columns[header], units[header] = in_one_unit(table.name, header, columns[header],
                                                     columns[beside], table.rows)
        notes.append(f"'{header}' is in {', '.join(texts)}, as '{beside}' tells" + (
            f': read in {units[header]}' if len(texts) > 1 else ''))
        del columns[beside]
    for header, beside in zip(headers, headers[1:]):
        if _called(beside) and is_text(columns.get(beside, np.zeros(0))) and (
                beside not in {**left, **right} and table.meaning(header).quantity
                and not table.unit_text(header)):
            notes.append(f"'{beside}' is not used: it holds no unit of '{header}'")
    return replace(table, columns=columns, units=units, notes=tuple(notes))


def _called(header: str) -> bool:
    return bool(NAMES & set(words_of(header)))


def _pairs(table: Table, left: Mapping[str, str], right: Mapping[str, str]) -> dict[str, str]:
    """Return the columns of units and that of the readings of each: left, or right of all."""
    def count(pairs: Mapping[str, str]) -> float:
        return sum(1.0 if table.meaning(header).quantity else 0.5 for header in pairs.values())

    both = list({**left, **right})
    both.sort(key=list(table.columns).index)
    swapped = count(right) > count(left) or count(right) == count(left) and bool(both) and (
        both[0] not in left and both[-1] in right)
    pairs = dict(right if swapped else left)
    for beside in both:  # 'Force unit'
        name = [word for word in words_of(beside) if word not in NAMES and not word.isdigit()]
        for header in filter(None, (right.get(beside), left.get(beside))):
            if name and name == words_of(name_of(header)):
                pairs[beside] = header
    return pairs


def _fits(table: Table, header: str, beside: str) -> bool:
    """Return whether the cells of a column are units of the readings of another."""
    quantity, readings = table.meaning(header).quantity, numbers(table.columns[header])[0]
    known = np.isfinite(readings)
    if table.unit_text(header) or not known.any() or quantity == 'trial':
        return False
    cells = np.array(list(map(cell_text, table.columns[beside])))
    units = {text for text in set(cells.tolist()) if text and (
        text in _READ or (unit_for(quantity, text) is not None if quantity else is_unit(text)))}
    fitting = np.isin(cells, list(units))
    if _called(beside):
        return bool(2 * fitting.sum() > (cells != '').sum())
    return quantity not in ('', 'time') and bool(fitting[known | (cells != '')].all())


def in_one_unit(name: str, header: str, cells: np.ndarray, units: np.ndarray, rows: np.ndarray,
                ) -> tuple[np.ndarray, str]:
    """
    Return readings in the unit of the first, and this unit; words among them stay as they are.

    ``units`` has the unit of each reading as text; a blank one is the only one that there is.

    Raises
    ------
    InputError
        For a reading without a unit, or with one of another quantity, with its row.
    """
    texts = np.array(list(map(cell_text, units)), object)
    first = next(filter(None, texts), '')
    if not set(texts.tolist()) - {first, ''}:
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
