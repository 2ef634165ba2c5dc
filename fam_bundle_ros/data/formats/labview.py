# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""LabVIEW measurement files: .lvm (text) and .tdms (by npTDMS)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import io
import logging
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.cell_text import is_number
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.encodings import encoding_of
from fam_bundle_ros.data.formats.layout import trimmed
from fam_bundle_ros.data.formats.table import plain_columns, reading_as, Table, unique
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

_END = '***End_of_Header***'


def read_lvm(path: Path, sheet: str | None = None) -> Table:
    """
    Return the table of a .lvm file; several segments are trials.

    The time is the column X_Value, or the segment's X0 and Delta_X where there is none.

    Raises
    ------
    InputError
        For a file without channels or without rows.
    """
    pandas = library('pandas', f'{path.name}: reading it')
    lines = path.read_text(encoding=encoding_of(path), errors='replace').splitlines()
    general = dict(_header_line(line) for line in lines[:40] if line.strip())
    separator = {'Comma': ',', 'Tab': '\t'}.get(general.get('Separator', 'Tab'), '\t')
    decimal = general.get('Decimal_Separator', '.').strip() or '.'
    frames, rows, units = [], [], {'X_Value': 's'}
    for block in _blocks(lines, separator, decimal):
        frame = pandas.read_csv(io.StringIO('\n'.join(block.lines)), sep=separator,
                                decimal=decimal, header=None, index_col=False, names=block.names)
        frames.append(_with_time(frame.drop(columns='Comment', errors='ignore'), block.header))
        frames[-1]['trial'] = block.trial
        rows.append(block.first + np.arange(len(block.lines)))
        labels = block.header.get('Y_Unit_Label', [])
        if 'X_Value (2)' in block.names:  # a blank label for each clock
            labels = list(filter(None, labels))
        channels = [name for name in block.names if not name.startswith('X_Value')]
        units |= {name: unit for name, unit in zip(channels, labels) if unit}
    if not frames:
        raise InputError(f'{path.name}: no channels in it; expected those of a LabVIEW '
                         'measurement file')
    whole = pandas.concat(frames, ignore_index=True)
    columns = plain_columns(whole if len(frames) > 1 else whole.drop(columns='trial'))
    return Table(path.name, '.lvm', columns, {name: unit for name, unit in units.items()
                                              if name in columns}, np.concatenate(rows))


class _Block(NamedTuple):
    """
    Rows of numbers below one header.

    Attributes
    ----------
    header : dict of str to list of str
        Values of each key, one for each channel.
    names : list of str
        Of the columns.
    trial : int
        How many rows of names stand between the first one and this block.
    first : int
        Number of the first line in the file.
    lines : list of str
    """

    header: dict[str, list[str]]
    names: list[str]
    trial: int
    first: int
    lines: list[str]


def _blocks(lines: list[str], separator: str, decimal: str) -> Iterator[_Block]:
    """Yield the blocks of rows of a .lvm file; a segment's header adds to those before it."""
    header: dict[str, list[str]] = {}
    names: list[str] = []
    rows: list[str] = []
    trial, inside = -1, False
    for at, line in enumerate([*lines, '']):
        cells = [cell.strip() for cell in line.split(separator)]
        if rows and (not line.strip() or line.startswith(('Channels', _END))):
            yield _Block(header, names, max(trial, 0), at - len(rows) + 1, rows)
            rows = []
        if cells[0] == _END:
            inside = True
        elif cells[0] == 'Channels' or not inside:
            inside = False
            header[cells[0]] = cells[1:]
        elif not rows and cells[0] and not is_number(cells[0], decimal):
            names, trial = unique(trimmed(cells)), trial + 1
        elif rows or any(cells):
            rows.append(line)


def _header_line(line: str) -> tuple[str, str]:
    for separator in ('\t', ','):
        key, found, value = line.partition(separator)
        if found:
            return key.strip(), value.strip(separator + ' ')
    return line.strip(), ''


def _with_time(block: Any, header: dict[str, list[str]]) -> Any:
    """Return the columns of a block with one time, the first column."""
    clocks = [name for name in block.columns if str(name).startswith('X_Value')]
    if len(clocks) > 1:  # Multi: a clock in front of each channel
        clock, own = block[clocks[0]].to_numpy(float), None
        for name in list(block.columns):
            if name in clocks:
                own = block[name].to_numpy(float)
            elif own is not None and not np.array_equal(own, clock, equal_nan=True):
                known = np.isfinite(own)
                block[name] = np.interp(clock, own[known], block[name].to_numpy(float)[known],
                                        right=np.nan)
        block, clocks = block.drop(columns=clocks[1:]), clocks[:1]
    if clocks and block[clocks[0]].isna().all():
        block, clocks = block.drop(columns=clocks), []
    if not clocks:
        begin, step = _number_of(header, 'X0', 0.0), _number_of(header, 'Delta_X', 1.0)
        block.insert(0, 'X_Value', begin + step * np.arange(len(block)))
    return block


def _number_of(header: dict[str, list[str]], key: str, default: float) -> float:
    """Return the first value of a key of a header."""
    try:
        return float(header.get(key, [''])[0].replace(',', '.'))
    except (ValueError, IndexError):
        return default


def read_tdms(path: Path, sheet: str | None = None) -> Table:
    """
    Return the table of a .tdms file; groups with the same channels are trials.

    Channels that carry a waveform's increment give the time where no channel does; those of
    another rate are brought to the time of the fastest.

    Raises
    ------
    InputError
        Where npTDMS is missing, the file is damaged, or no group has channels of one length.
    """
    nptdms = library('nptdms', f'{path.name}: reading it')
    for logger in logging.root.manager.loggerDict:
        if logger.startswith('nptdms'):  # what is wrong is said below
            logging.getLogger(logger).setLevel(logging.CRITICAL)
    with reading_as(path, '.tdms', Exception):  # npTDMS's own and struct's on damaged files
        file = nptdms.TdmsFile.read(path)
        groups = {group.name: group.channels() for group in file.groups()}
        found = {name: _of_group(channels) for name, channels in groups.items()
                 if any(len(channel) for channel in channels)}
    if sheet is not None and sheet not in found:
        raise InputError(f"{path.name}: no group '{sheet}'; expected one of {', '.join(found)}")
    if not found:
        raise InputError(f'{path.name}: no channels with values in it; expected a log')
    if sheet is not None:
        found = {sheet: found[sheet]}
    tables = {name: Table(path.name, '.tdms', *group) for name, group in found.items()}
    best = max(tables.values(), key=lambda table: sum(map(bool, table.quantities.values())))
    alike = {name: table for name, table in tables.items()
             if list(table.columns) == list(best.columns)}
    notes = tuple(f'not read: group {name}' for name in tables if name not in alike)
    if len(alike) == 1:
        return replace(best, notes=notes)
    columns = {channel: np.concatenate([table.columns[channel] for table in alike.values()])
               for channel in best.columns}
    columns['trial'] = np.repeat(np.array(list(alike), object),
                                 [len(table.rows) for table in alike.values()])
    return Table(path.name, '.tdms', columns, best.units, notes=notes)


def _clock(channel: Any) -> np.ndarray | None:
    """Return the times of a waveform's samples, s; None for a channel that is none."""
    step = channel.properties.get('wf_increment')
    if not step:
        return None
    return channel.properties.get('wf_start_offset', 0.0) + step * np.arange(len(channel))


def _of_group(channels: list[Any]) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return a group's columns and their units."""
    channels = [channel for channel in channels if len(channel)]
    names = unique([channel.name for channel in channels])
    longest = max(channels, key=len)
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    clock = _clock(longest)
    for name, channel in zip(names, channels):
        values = np.asarray(channel[:])
        unit = channel.properties.get('unit_string') or channel.properties.get(
            'NI_UnitDescription')
        if unit:
            units[name] = str(unit)
        if len(values) != len(longest):
            own = _clock(channel)
            if clock is None or own is None:
                continue
            values = np.interp(clock, own, values.astype(float))
        if values.dtype.kind in 'biuf':
            columns[name] = values.astype(float)
        else:
            columns[name] = values if values.dtype.kind in 'mM' else values.astype(object)
    if clock is not None and not any(recognise(name, units.get(name, '')).quantity == 'time'
                                     for name in columns):
        columns = {'time': clock, **columns}
        units['time'] = 's'
    return columns, units
