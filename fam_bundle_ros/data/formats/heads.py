# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Heads of tables that are more than a row of names: pairs of key and value, levels, settings."""

from collections.abc import Sequence
import re

from fam_bundle_ros.data.cells import is_number
from fam_bundle_ros.data.column_names import recognise, unit_text_of
from fam_bundle_ros.data.unit_names import unbracketed, unit_of

_UNIT_KEYS = ('unit', 'units', 'einheit')
#: What may be a level in a cell of its own: '3 bar', '20 %'.
_LEVEL = re.compile(r'-?\d+(?:[.,]\d+)?\s*(\S.*)')
#: 'Analog:0.02', '2.0E-02s'.
_VALUE = re.compile(r'(?:[^\W\d]+\s*:\s*)?([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*'
                    r'([^\W\d_]*)\.?')
#: What a sample interval is called, its unit and its value; a vague name needs a unit.
_INTERVAL = re.compile(
    r'(?:(?P<vague>increment|delta)|sampl(?:e|ing)[ _]?(?:interval|time|period)|t_?inc(?:rement)?|'
    r'd(?:elta)?[ _]?[tx]|h_?resolution|time[ _]?step|abtast(?:intervall|zeit|periode)|'
    r'messintervall)\s*(?:[\[(]\s*(?P<unit>[^\W\d_]+)\s*[\])])?\s*(?:[:=]\s*(?P<value>.*))?',
    re.IGNORECASE)
#: A sample rate.
_RATE = re.compile(r'(?:sampl\w*|scan|abtast\w*|mess)[ _-]?(?:rate|freq\w*|frequenz)\W.*\d|'
                   r'^\W*f_?s\s*[:=]\s*[\d.]+\s*(?:k?Hz)?$', re.I)


#: What a row of factors of the columns begins with.
_SCALE = re.compile(r'(?:scal(?:e|ing)(?:[ _]factors?)?|factors?|multipliers?|gains?|'
                    r'faktor(?:en)?|skalierung)\W*', re.IGNORECASE)


def of_pairs(rows: Sequence[Sequence[str]], width: int,
             ) -> tuple[list[str], dict[str, str]] | None:
    """
    Return names and units of a head of pairs, one for each column of times and its readings.

    None for other heads. TwinCAT Scope writes such heads.

    Examples
    --------
    >>> of_pairs([['Name', 'p', 'Name', 'F'], ['SampleTime[ms]', '1', 'SampleTime[ms]', '1'],
    ...           ['Unit', 'bar', 'Unit', 'N']], 4)
    (['time', 'p', 'time', 'F'], {'p': 'bar', 'F': 'N', 'time': 'ms'})
    """
    found = {row[0].strip(): [cell.strip() for cell in row[1:width:2]] for row in rows
             if len(row) >= width >= 4 and width % 2 == 0 and row[0].strip()
             and len({cell.strip() for cell in row[:width:2]}) == 1}
    names = {key: cells for key, cells in found.items()
             if len(set(cells)) == len(cells) and all(cells) and not any(
                 re.match(r'[-+]?\d', cell) for cell in cells)}
    if not names:
        return None
    best = max(names, key=lambda key: sum(recognise(cell).score for cell in names[key]))
    clock = next((key for key in found if recognise(key).quantity == 'time'
                  and unit_of(unit_text_of(key) or '', 's')), '')
    own = next((cells for key, cells in found.items() if key.casefold() in _UNIT_KEYS), None)
    if best == clock or not clock and own is None:  # 'Time, p, Time, F' are names themselves
        return None
    units = {name: text for name, cell in zip(names[best], own or [])
             if (text := unbracketed(cell))}
    if clock:
        units['time'] = unit_text_of(clock) or ''
    times = ['time' if clock else f'X {at}' for at in range(1, len(names[best]) + 1)]
    return [name for pair in zip(times, names[best]) for name in pair], units


def with_levels(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """
    Return rows with their numbers, one of levels joined to the merged names above it.

    Examples
    --------
    >>> with_levels([(0, ['strain', 'Force [N]', '']), (1, ['', '3 bar', '1 bar'])])
    [(1, ['strain', 'Force [N] 3 bar', 'Force [N] 1 bar'])]
    """
    for at, (number, row) in enumerate(rows):
        levels = [level is not None and (level[1] == '%' or unit_of(level[1], 'Pa') is not None)
                  for level in (_LEVEL.fullmatch(cell.strip()) for cell in row)]
        if at and sum(levels) > 1:
            above, group, joined = rows[at - 1][1], '', []
            for cell, own, level in zip(above, row, levels):
                group = cell.strip() or group
                joined.append(f'{group} {own.strip()}' if level else cell.strip() or own.strip())
            return [*rows[:at - 1], (number, joined), *rows[at + 1:]]
    return rows


def interval_of(lines: Sequence[str]) -> float | None:
    """
    Return the sample interval that lines above a table tell, s; None for none, and for several.

    Examples
    --------
    >>> interval_of(['# Delta : 0,02 sec']), interval_of(['Sample Interval,5e-2'])
    (0.02, 0.05)
    >>> interval_of(['X,CH1,Start,Increment', 'Sequence,Volt,-1.0,2e-3'])
    0.002
    >>> interval_of(['dt:', '1e-3;1e-2']), interval_of(['delta,5 mm'])
    (None, None)
    """
    told = set()
    grid = [cells_of(line) for line in lines]
    for row, below in zip(grid, [*grid[1:], []]):
        for at, cell in enumerate(row):
            key = _INTERVAL.fullmatch(cell)
            if not key:
                continue
            beside = [key['value']] if key['value'] else row[at + 1:]
            under = not any(map(_VALUE.fullmatch, beside[:1]))
            cells = beside if not under else below[at:] if len(row) == 1 else below[at:at + 1]
            for value in filter(None, map(_VALUE.fullmatch, cells)):
                text = key['unit'] or value[2] or ('' if key['vague'] and not under else 's')
                unit = unit_of(text, 's') if text else None
                told.add(float(value[1].replace(',', '.')) * unit.factor if unit else 0.0)
    return told.pop() if len(told) == 1 and min(told) > 0.0 else None


def scale_in(lines: Sequence[str]) -> str:
    """
    Return the line above a table that has a factor other than 1 for its columns, '' for none.

    Examples
    --------
    >>> scale_in(['scale,1,0.01']), scale_in(['Scale factor;1;1']), scale_in(['full scale,10,20'])
    ('scale,1,0.01', '', '')
    """
    for line in lines:
        cells = cells_of(line)
        factors = [float(cell.replace(',', '.')) for cell in cells[1:] if is_number(
            cell.replace(',', '.'))]
        if cells and _SCALE.fullmatch(cells[0]) and len(factors) > 1 and set(factors) != {1.0}:
            return line.strip()
    return ''


def rate_in(lines: Sequence[str]) -> str:
    """
    Return the line above a table that tells a sample rate, '' for none.

    Examples
    --------
    >>> rate_in(['Operator: lab', 'Sampling rate [Hz]: 50'])
    'Sampling rate [Hz]: 50'
    """
    return next((' '.join(line.split()) for line in lines if _RATE.search(line)), '')


def cells_of(line: str) -> list[str]:
    """Return the cells of a line above a table: a comma behind a colon is one of decimals."""
    separator = next((sign for sign in '\t;' if sign in line), ',')
    whole = separator == ',' and re.search(r'[:=]\s*\d+,\d', line)
    cells = [cell.strip(' "#%\r\n') for cell in ([line] if whole else line.split(separator))]
    return [cell for at, cell in enumerate(cells) if cell or any(cells[at:])]
