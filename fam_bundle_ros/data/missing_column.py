# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The message for a quantity that no column was taken for: what was found, and what to tell."""

from collections.abc import Sequence
import re

import numpy as np

from fam_bundle_ros.data.cells import is_number, is_text, numbers
from fam_bundle_ros.data.checks import ranges
from fam_bundle_ros.data.column_names import factor_of, is_longer, recognise, STRAINS, unit_for
from fam_bundle_ros.data.formats.heads import cells_of
from fam_bundle_ros.data.formats.table import is_unnamed, Table
from fam_bundle_ros.data.formats.titles import title_of_name, titles_of
from fam_bundle_ros.data.measurement import Taken
from fam_bundle_ros.data.missing_units import example_unit
from fam_bundle_ros.data.told_columns import name_of
from fam_bundle_ros.data.unit_names import ELECTRIC

#: A strain in the name of a file: 'L285mm', 'eps_10%'.
_IN_NAME = re.compile(r'(?<![^\W\d_])([^\W\d_]*)[ _=-]*(\d+(?:[.,]\d+)?)[ _]?(mm|cm|%)'
                      r'(?![^\W\d_])')


def family(key: str) -> str:
    """Return the quantity that must be there: one of all that tell the strain is enough."""
    base = key.partition('.')[0]
    return 'strain' if base in STRAINS else base


def shown(key: str) -> str:
    """Return what a quantity is called in messages."""
    return 'contraction' if key == 'shift' else key


def mostly_text(column: np.ndarray) -> bool:
    """Return whether most cells are words: below readings may stand a footer."""
    return is_text(column) and np.isfinite(numbers(column)[0]).mean() < 0.5


def missing_column(table: Table, key: str, taken: Sequence[Taken]) -> str:
    """
    Return the message for a quantity ('strain', 'pressure', 'force') without a column.

    ``taken`` tells what each column was taken for.
    """
    unused = [entry.header for entry in taken if not entry.quantity]
    found = '; found ' + ', '.join(f"'{entry.header}' {_meaning(table, entry)}" for entry in taken)
    misfit = _misfit(table, key, unused)
    if misfit:
        return f'{table.name}: {misfit}{found}'
    above, examples = _numbers_above(table), _examples(table, key, unused)
    missing = f"{table.name}: column '{key}' is missing{found}{above}"
    if key == 'pressure' and not examples:  # it is a constant, or not in this file
        return missing if above else missing + _constant_pressure(table)
    if key == 'strain' and not examples and not unused:  # of an isometric test
        return missing + _constant_strain(table.name)
    example = f'--columns "{(examples or [_unknown(key)])[0]}"'
    if key == 'pressure' and len(examples) > 1:
        example += ', or of motor units ' + ' '.join(
            f'--columns "pressure.mu{i}={one.partition("=")[2]}"'
            for i, one in enumerate(examples[:2], 1))
    return f'{missing}; tell it, for example {example}'


def _meaning(table: Table, entry: Taken) -> str:
    """Return what a column was taken for, or why it is not used and its range."""
    if entry.quantity:
        return shown(entry.quantity)
    column = table.columns[entry.header]
    if column.dtype.kind != 'f' or not np.isfinite(column).any():
        return entry.why
    return f'{entry.why} ({np.nanmin(column):.4g} to {np.nanmax(column):.4g})'


def _numbers_above(table: Table) -> str:
    """Return what is wrong with a line of numbers in place of levels, '' for others."""
    unnamed = all(map(is_unnamed, table.columns))
    # of trials that lay side by side each has a number
    trials = len(set(table.columns['trial'].tolist())) if 'trial' in table.columns else 0
    for line in reversed(table.above):
        cells = [cell for cell in cells_of(line.strip()) if cell]
        if (unnamed and len(cells) > 2 or len(cells) == trials > 1) and all(
                map(is_number, cells[unnamed:])):
            return (f"; above them stands '{' '.join(cells)[:60]}': expected names, or levels "
                    f"with a unit, '{cells[1]} kPa' in place of '{cells[1]}'")
    return ''


def _constant_pressure(table: Table) -> str:
    """Return how to tell a pressure that is the same in all rows, as a title says it if any."""
    titles = titles_of(table)
    if len({title.pressure for title in titles}) > 1:
        said = ', '.join(f"'{title.text}' (row {title.row})" for title in titles[:3])
        return (f'; titles tell several: {said}; expected one above each block of rows, the first '
                'too, or a column')
    title = titles[0] if titles else title_of_name(table.name)
    value, said = '300 kPa', ''
    if title:
        where = f'(row {title.row})' if title.row else 'in the name of the file'
        value, said = f'{title.pressure / 1e3:g} kPa', f", as '{title.text}' {where} says"
    return (f'; tell it, a constant for all rows{said}, for example --columns "pressure={value}"')


def _constant_strain(name: str) -> str:
    """Return how to tell a strain, or one for all rows, as the name of a file says it if any."""
    found = _IN_NAME.search(name.rpartition('.')[0])
    quantity = found and ('strain' if found[3] == '%' else recognise(found[1]).quantity)
    value, said = 'length=285 mm', ''
    if found and quantity in STRAINS:
        value = f'{quantity}={found[2].replace(",", ".")} {found[3]}'
        said = f", as '{found[0].strip(' _-')}' in the name of the file says"
    return (f'; tell it, for example --columns "{_unknown("strain")}", or a constant for all rows'
            f'{said}, --columns "{value}"')


def _unknown(key: str) -> str:
    return f'{key}=... [{example_unit(key)}]'


def _misfit(table: Table, key: str, unused: Sequence[str]) -> str:
    """Return what to do about a column that has the name but not the unit; '' for none."""
    for header in unused:
        match, text = table.meaning(header), table.unit_text(header)
        if match.score or not text or family(match.quantity) != key:
            continue
        # of the force there is one, also where its channel has a number
        told = shown(match.quantity) + (
            f'.{match.part}' if match.part and key == 'pressure' else '')
        unit = example_unit(match.quantity)
        others = _examples(table, key, [other for other in unused if other != header])
        return (f"column '{header}': '{text}' is not a unit of {key}; if its numbers are in "
                f'another unit, tell it, for example --columns "{told}={name_of(header)} '
                f'[{unit}]", or what one {text} is worth, --columns "{told}={name_of(header)} '
                f'* 50 {unit} - 2 {unit}"; if another column has it, --columns '
                f'"{(others or [_unknown(key)])[0]}"')
    return ''


def _examples(table: Table, key: str, unused: Sequence[str]) -> list[str]:
    """
    Return how a user may tell the columns that are left.

    Those whose unit fits; where there are none those without a unit, else those in volts or
    counts. Of each those whose name fits come first.
    """
    fitting: list[str] = []
    without: list[str] = []
    electric: list[str] = []
    for header in unused:
        column = table.columns[header]
        if mostly_text(column):
            continue
        meant, text = table.meaning(header).quantity, table.unit_text(header)
        alike = family(meant) == key
        told = shown(meant) if alike else key
        values = numbers(column)[0]
        values = values[np.isfinite(values)]
        if key == 'strain' and meant not in ('contraction', 'length') and (
                is_longer(header) or len(values) and values.max() <= 0.0 > values.min()):
            told = 'elongation'
        if text is None:
            counts = not alike and (values % 1.0 == 0.0).all()
            told = told.replace('strain', 'contraction') if counts else told
            unit = example_unit(told)
            size = unit_for(key, example_unit(key))
            low, high, *_ = ranges()[key]
            if not alike and (meant or 'no reading' in table.meaning(header).why or size and not (
                    counts or low <= size.factor * values.min() <= size.factor * values.max()
                    <= high)):
                continue  # of another quantity
            example = f'{told}={name_of(header)} ' + (f'* 0.5 {unit}' if counts else f'[{unit}]')
            if meant == 'strain' and np.abs(values).max(initial=0.0) < 1.0:
                example = f'{told}={header}'  # a ratio
            without.insert(0 if alike else len(without), example)
        elif unit_for(key, text):
            scaled = f' * 0.1 {text}' if factor_of(header) else ''
            fitting.insert(0 if alike else len(fitting), f'{told}={header}{scaled}')
        elif text.strip() in ELECTRIC and (alike or not meant):
            told = told.replace('strain', 'contraction')  # a voltage is rarely of a ratio
            electric.append(f'{told}={name_of(header)} * 50 {example_unit(told)}')
    return fitting or without or electric
