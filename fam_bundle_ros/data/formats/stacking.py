# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Tables in which several trials lie side by side, or on several sheets, as one below the other.

Four forms: the same columns again and again (Run 1 beside Run 2), one column of force per
pressure or strain ('1 bar', '2 bar', ... beside the strain) or for each way of a loop ('Force up',
'Force down'), and sheets of the same columns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text
from fam_bundle_ros.data.column_names import dimension_of, recognise, STRAINS
from fam_bundle_ros.data.formats.heads import cells_of
from fam_bundle_ros.data.formats.table import is_unnamed, joined, names_column, Table, unique
from fam_bundle_ros.data.formats.titles import titles_of
from fam_bundle_ros.data.missing_units import time_unit
from fam_bundle_ros.data.unit_names import unit_of

#: The name of a second column of one name.
_AGAIN = re.compile(r'.* \(\d+\)')
#: A trial in a name: 'Run 2: F [N]', 'F [N] Run #2'.
_TRIAL = re.compile(r'(?<!\w)([^\W\d_]+)[ _]?#?\d+(?!\w)\s*:?')
#: A reading in a name: '1.5 bar', 'F at 200 kPa [N]'.
_LEVEL = re.compile(
    r'(?<![^\W_])(?<![.,])(-?\d+(?:[.,]\d+)?)\s*([^\W\d_]+(?:\s?abs\b\.?)?|%)(?![^\W_])')
#: A strain in a name without a unit: 'eps = 0.05'.
_RATIO = re.compile(r'\s*(?:\u03b5|eps|epsilon|strain)\s*=\s*(\d+(?:[.,]\d+)?)\s*', re.IGNORECASE)
#: What stands between the name of a force and a level.
_AT = r'((^|[\s_])(at|bei|p))+$', r'((^|[\s_])(at|bei|l|x|[d\u03b4\u0394]l|contraction|length))+$'
#: What is assumed of parts of one recording until their clocks are told.
ONE_CLOCK = ('the times of these parts are taken as one clock; if the clocks began apart, tell '
             'the difference: for example, --columns "time=time 2 + 1.7 s" is for a second clock '
             'that began 1.7 s after the first')
#: Words for one way and for the way back.
_WAYS = (('up', 'down'), ('auf', 'ab'), ('aufw\u00e4rts', 'abw\u00e4rts'), ('hin', 'r\u00fcck'),
         ('loading', 'unloading'), ('belastung', 'entlastung'), ('inflation', 'deflation'),
         ('inflating', 'deflating'), ('ascending', 'descending'), ('increasing', 'decreasing'),
         ('forward', 'backward'), ('forward', 'reverse'), ('forth', 'back'))


class _Level(NamedTuple):
    """
    A level that stands in a name: which quantity, how much, and the rest of the name.

    What has no other name is a force.
    """

    quantity: str
    value: float
    unit: str
    rest: str


def unstacked(table: Table, told: Mapping[str, str] | None = None) -> Table:
    """
    Return a table with trials that lie side by side one below the other; others as they are.

    ``told`` is what the user tells of columns, by quantity.
    """
    return (_blocks(_without_runs(table), told or {}) or _levels(table) or _by_trials(table)
            or table)


def _without_runs(table: Table) -> Table:
    """Return a table whose headers all carry a trial, 'Run 2: F [N]', with 'F [N] (2)' instead."""
    found = {header: _TRIAL.search(header) for header in table.columns}
    kinds = {match[1].casefold() if match else '' for match in found.values()}
    if len(kinds) > 1 or not all(recognise(kind).quantity == 'trial' for kind in kinds):
        return table
    plain = unique([(header[:match.start()] + ' ' + header[match.end():]).strip()
                    for header, match in found.items() if match])
    return replace(table, columns=dict(zip(plain, table.columns.values())), units={
        name: table.units[header] for name, header in zip(plain, found) if header in table.units})


def one_below_the_other(tables: Mapping[str, Table]) -> Table | None:
    """
    Return tables of the same columns as one, by name; None where they are no trials of one kind.

    They are where their names are pressures ('1 bar'), or words for trials that differ in a number
    ('Run 1'). A pressure that only the names tell, or one title each, becomes a column.
    """
    first, *others = tables.values()
    kinds = {'level' if _level(name) else re.sub(r'[\d\s_.-]+', ' ', name).strip()
             for name in tables}
    if not others or len(kinds) > 1 or any(
            kind != 'level' and recognise(kind).quantity != 'trial' for kind in kinds) or any(
            list(other.columns) != list(first.columns) or other.units != first.units
            for other in others):
        return None
    lengths = [len(table.rows) for table in tables.values()]
    whole = _with_levels(replace(
        first, blanks=None, rows=np.concatenate([table.rows for table in tables.values()]),
        columns={header: joined([table.columns[header] for table in tables.values()])
                 for header in first.columns},
        above=tuple(dict.fromkeys(line for table in tables.values() for line in table.above)),
        ).noted(f'read one below the other: {", ".join(tables)}'), list(tables), lengths)
    titles = [titles_of(table) for table in tables.values()]
    if 'pressure' in whole.quantities.values() or any(len(each) != 1 for each in titles) or len(
            {(title.kind, title.absolute) for title, in titles}) > 1:
        return whole
    return whole.with_column(
        'pressure', np.repeat([title.pressure for title, in titles], lengths),
        'Pa abs' if titles[0][0].absolute else 'Pa')


def parts_of_one(tables: Sequence[Table]) -> Table | None:
    """
    Return tables that each hold a part of one recording, with a clock each, side by side.

    None where a quantity is in two, all have the same headers, or one has not one clock.

    Raises
    ------
    InputError
        Where the unit of a clock cannot be told.
    """
    known = [{header: table.meaning(header) for header in table.columns}
             for table in tables]
    clocks = [[header for header, match in each.items()
               if match.quantity == 'time' and match.score > 1] for each in known]
    families = [family for each in known for family in {
        'strain' if match.quantity in STRAINS else match.quantity
        for match in each.values() if match.score} & {'strain', 'force', 'pressure'}]
    if len(set(families)) < len(families) or any(len(found) != 1 for found in clocks) or len(
            {tuple(table.columns) for table in tables}) == 1:
        return None
    rows = max(len(table.rows) for table in tables)
    headers = [header for table in tables for header in table.columns]
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for at, (table, (clock,)) in enumerate(zip(tables, clocks), 1):
        for header, column in table.columns.items():
            name, unit = header, table.units.get(header, '')
            if header == clock:
                name = 'time' if at == 1 else f'time {at}'
                if column.dtype.kind == 'f':
                    own = known[at - 1][header].unit or time_unit(table.name, header, column)[0]
                    column, unit = column * own.factor, 's'
            elif headers.count(header) > 1 or is_unnamed(header):
                name = f'{table.name.rpartition(".")[0] or table.name} {header}'
            blank = np.full(rows - len(column), np.nan)
            columns[name] = joined([column, blank])
            units |= {name: unit} if unit else {}
    names = [table.name for table in tables]
    return Table(' + '.join(names), 'files side by side', columns, units, notes=(
        *(note for table in tables for note in table.notes),
        f'{", ".join(names)}: parts of one recording', ONE_CLOCK))


def _blocks(table: Table, told: Mapping[str, str]) -> Table | None:
    """
    Return groups of the same columns side by side as trials, None for other tables.

    Each has the pressure above it, '1 bar', '2 bar', if no column and no word of the user has it.
    """
    headers = [header for header, cells in table.columns.items()
               if not is_unnamed(header) or _filled(cells).any()]
    width = next((at for at, header in enumerate(headers) if _AGAIN.fullmatch(header)), 0)
    first = headers[:width]
    blocks = [headers[at:at + width] for at in range(0, len(headers), width)] if width else []
    if len(blocks) < 2 or any(block != [f'{header} ({count})' for header in first]
                              for count, block in enumerate(blocks[1:], 2)):
        return None
    known = {table.meaning(header).quantity for header in first} | {
        key.partition('.')[0] for key, text in told.items()
        if any(names_column(text, header) for header in first) or key.startswith('pressure')}
    if 'force' not in known or not known & set(STRAINS) or any(
            table.units.get(again, table.units.get(header)) != table.units.get(header)
            for block in blocks[1:] for header, again in zip(first, block)):
        return None
    parts = []
    for block in blocks:
        rows = np.flatnonzero(np.any([_filled(table.columns[header]) for header in block], axis=0))
        parts.append(rows[:0] if not len(rows) else np.arange(rows[0], rows[-1] + 1))
    lengths = list(map(len, parts))
    over = [] if 'pressure' in known else _pressures_over(table.above, len(blocks))
    whole = table.stacked([dict(zip(first, block)) for block in blocks], parts).noted(
        f'{len(blocks)} trials side by side: read one below the other'
        + ', each at the pressure above it' * bool(over))
    if over:
        return _with_levels(whole, over, lengths)
    return whole if 'trial' in known else whole.with_column(
        'trial', np.repeat(np.arange(1.0, len(blocks) + 1.0), lengths))


def _pressures_over(lines: Sequence[str], count: int) -> list[str]:
    """
    Return the cells of a line above a table that hold a pressure, if it has so many; else [].

    Programs that digitise figures write the name of each series above its columns.
    """
    for line in reversed(lines):
        cells = [cell for cell in cells_of(line) if cell]
        levels = [level for cell in cells if (level := _level(cell))]
        if len(cells) == len(levels) == count and {
                (level.quantity, level.unit) for level in levels} == {
                ('pressure', levels[0].unit)}:
            return cells
    return []


def _levels(table: Table) -> Table | None:
    """Return force columns at levels, '1 bar', '2 bar', as a force and a level column, or None."""
    levels, forces = {}, {}
    for header in table.columns:
        level = _level(header) or _strain_level(header)
        if level is None:
            continue
        force = recognise(level.rest, table.units.get(header, ''))
        if force.quantity == 'force' and force.score:
            levels[header], forces[header] = level, force
    kinds = {(level.quantity, level.unit) for level in levels.values()}
    if len(kinds) != 1 or len(levels) < 2:
        return None
    (quantity, unit), = kinds
    if quantity == 'length' and not min(level.value for level in levels.values()):
        quantity = 'contraction'
    rest = [header for header in table.columns if header not in levels]
    known = {header: _meant(table, header) for header in rest}
    beside = set(STRAINS) if quantity == 'pressure' else {'pressure'}
    if 'force' in known.values() or not beside & set(known.values()):
        return None
    # a level that was not measured in a row has a blank cell there
    rows = [np.flatnonzero(_filled(table.columns[header])) for header in levels]
    lengths = list(map(len, rows))
    whole = table.stacked([dict(zip(rest, rest))] * len(levels), rows).with_column(
        quantity, np.repeat([level.value for level in levels.values()], lengths), unit,
        ).with_column(
            'force', joined([table.columns[header][own] for header, own in zip(levels, rows)]),
            next((force.unit.text for force in forces.values() if force.unit), ''))
    if 'trial' not in known.values():
        whole = whole.with_column('trial', np.repeat(np.array(list(levels), object), lengths))
    return whole.noted(f'{len(levels)} columns are the force at a {quantity} each: read one '
                       'below the other')


def _by_trials(table: Table) -> Table | None:
    """Return a table with the pressure that only the names of its trials tell; None for others."""
    known = table.quantities
    trials = [header for header, quantity in known.items() if quantity == 'trial']
    if 'pressure' in known.values() or len(trials) != 1:
        return None
    cells, unit = table.columns[trials[0]], table.units.get(trials[0], '')
    if not (is_text(cells) or unit):
        return None
    # '3 bar' in each cell of a text file was read as a number with a unit
    names = [cell_text(cell) if is_text(cells) else f'{cell:g} {unit}' for cell in cells]
    levels = {name: _level(name) for name in set(names)}
    found = {name: level for name, level in levels.items() if level and (
        level.quantity == 'pressure')}
    if len(found) < len(levels) or len({level.unit for level in found.values()}) != 1:
        return None
    return table.with_column(
        'pressure', np.array([found[name].value for name in names]), found[names[0]].unit,
        ).noted(f"pressure as the names in '{trials[0]}' tell")


def _meant(table: Table, header: str) -> str:
    """Return the quantity of a column by its name, else by a unit of length ('dL / mm')."""
    unit = dimension_of(header, table.units.get(header, ''))
    return table.meaning(header).quantity or ('shift' if unit and unit.like == 'm' else '')


def _with_levels(table: Table, names: Sequence[str], lengths: Sequence[int]) -> Table:
    """Return a table with a trial for each name, and the pressure if only the names state it."""
    known = table.quantities.values()
    levels = [level for name in names if (level := _level(name)) and level.quantity == 'pressure']
    if 'pressure' not in known and len(levels) == len(names) and len(
            {level.unit for level in levels}) == 1:
        table = table.with_column(
            'pressure', np.repeat([level.value for level in levels], lengths), levels[0].unit)
    return table if 'trial' in known else table.with_column(
        'trial', np.repeat(np.array(names, object), lengths))


def _level(name: str) -> _Level | None:
    """Return the pressure or strain that stands in a name, None for none."""
    for match in _LEVEL.finditer(name):
        quantity = 'pressure' if unit_of(match[2], 'Pa') else 'strain' if match[2] == '%' else ''
        if quantity:
            return _of_match(quantity, match)
    return None


def _strain_level(name: str) -> _Level | None:
    """Return the length or the ratio that stands in the name of a column, None for none."""
    ratio = _RATIO.fullmatch(name)
    if ratio:
        return _Level('strain', float(ratio[1].replace(',', '.')), '', 'force')
    found = (match for match in _LEVEL.finditer(name) if unit_of(match[2], 'm'))
    return next((_of_match('length', match) for match in found), None)


def _of_match(quantity: str, match: re.Match[str]) -> _Level:
    """Return the level that was found in a name, without the words that lead to it."""
    name, at = match.string, _AT[quantity == 'length']
    before = re.sub(at, '', name[:match.start()].strip(' @=,:_'), flags=re.IGNORECASE)
    rest = before + ' ' + name[match.end():]
    named = re.sub(r'[\[(<][^\])>]*[\])>]', '', rest).strip()
    return _Level(quantity, float(match[1].replace(',', '.')), match[2],
                  rest.strip() if named else f'force {rest.strip()}'.strip())


def _filled(cells: np.ndarray) -> np.ndarray:
    """Return which cells hold something."""
    if cells.dtype.kind == 'f':
        return np.isfinite(cells)
    if cells.dtype.kind in 'mM':
        return ~np.isnat(cells)
    return np.array([cell is not None and cell == cell and str(cell).strip() != ''
                     for cell in cells], bool)


def one_way_below_the_other(table: Table) -> Table:
    """
    Return a table whose columns for the two ways of a loop are two trials; others as they are.

    Columns that are not of one way are those of both. A table with a clock holds no map.
    """
    for ways in _WAYS:
        there, back = ({name: header for header in table.columns
                        if (name := _without_way(header, way))} for way in ways)
        if not there or there.keys() != back.keys() or there.keys() & set(table.columns):
            continue
        if 'time' in table.quantities.values() or any(
                table.units.get(there[name]) != table.units.get(back[name]) for name in there):
            return table
        both = {header: header for header in table.columns
                if header not in (*there.values(), *back.values())}
        whole = table.stacked([{**both, **there}, {**both, **back}])
        if 'trial' not in table.quantities.values():
            whole = whole.with_column('trial', np.repeat(np.array(ways, object), len(table.rows)))
        return whole.noted(f"columns '{ways[0]}' and '{ways[1]}' are the two ways of a loop: read "
                           'one below the other')
    return table


def _without_way(header: str, word: str) -> str:
    """
    Return a header without a word, '' where it does not have it.

    Examples
    --------
    >>> _without_way('Force up [N]', 'up'), _without_way('Supply', 'up')
    ('Force [N]', '')
    """
    text, count = re.subn(rf'(?<![^\W_])[\s_]*{word}(?![^\W_])', ' ', header, flags=re.IGNORECASE)
    return ' '.join(text.split()).strip('_ ') if count == 1 else ''
