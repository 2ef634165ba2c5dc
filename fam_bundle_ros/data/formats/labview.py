# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""LabVIEW measurement files: .lvm (text) and .tdms (by npTDMS)."""

from collections.abc import Iterator
import io
import logging
from pathlib import Path
import re
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import is_blank, is_number, seconds
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.arrays import flattened, of_arrays
from fam_bundle_ros.data.formats.channels import filled_up, Series
from fam_bundle_ros.data.formats.dialect import encoding_of
from fam_bundle_ros.data.formats.layout import trimmed
from fam_bundle_ros.data.formats.table import plain_columns, reading_as, Table, unique
from fam_bundle_ros.errors import in_short, InputError
from fam_bundle_ros.extras import library

_END = '***End_of_Header***'
#: A waveform's start that was not set: LabVIEW counts from 1904.
_UNSET = np.datetime64('1904-01-01')


def read_lvm(path: Path) -> Table:
    """
    Return the table of a .lvm file; several segments are trials.

    The times of a channel are the column X_Value, or X0 and Delta_X where there is none, and count
    from the channel's own start.

    Raises
    ------
    InputError
        For a file without channels or without rows, and one with words between its numbers.
    """
    pandas = library('pandas', f'{path.name}: reading it')
    lines = path.read_text(encoding=encoding_of(path), errors='replace').splitlines()
    head = '\n'.join(lines[:40])
    separator = ',' if re.search(r'^Separator\s*[\t,]\s*Comma\b', head, re.M) else '\t'
    decimal = ',' if re.search(r'^Decimal_Separator *\t\s*,', head, re.M) else '.'
    frames, rows, units = [], [], {'X_Value': 's'}
    for block in _blocks(lines, separator, decimal):
        try:
            frame = pandas.read_csv(
                io.StringIO('\n'.join(block.lines)), sep=separator, decimal=decimal, header=None,
                index_col=False, names=block.names)
            frames.append(_with_clocks(path.name, frame.drop(columns='Comment', errors='ignore'),
                                       block.header))
        except InputError:
            raise
        except ValueError as error:
            raise _damage(path.name, block, separator, decimal, error) from error
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
    whole = plain_columns(pandas.concat(frames, ignore_index=True))
    columns = flattened({name: Series(whole[f'X_Value of {name}'], column)
                         for name, column in whole.items()
                         if not name.startswith('X_Value') and name != 'trial'}, 'X_Value')
    if len(frames) > 1:
        columns['trial'] = whole['trial']
    return Table(path.name, '.lvm', columns, {name: unit for name, unit in units.items()
                                              if name in columns}, np.concatenate(rows))


class _Block(NamedTuple):
    """Rows of numbers below one header, which holds a value for each channel by key."""

    header: dict[str, list[str]]
    names: list[str]  # of the columns
    trial: int  # how many rows of names stand between the first one and this block
    first: int  # number of the first line in the file
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


def _damage(name: str, block: _Block, separator: str, decimal: str, error: ValueError,
            ) -> InputError:
    """Return the error for a block that pandas cannot read: the first line that is no row."""
    for at, line in enumerate(block.lines, block.first):
        first = line.split(separator)[0].strip()
        if not (is_blank(first) or is_number(first, decimal)):
            return InputError(f"{name}, line {at}: '{line.strip()[:40]}'; expected numbers")
    return InputError(f'{name}: cannot be read as .lvm from line {block.first} on '
                      f'({in_short(error)[:80]})')


def _with_clocks(name: str, block: Any, header: dict[str, list[str]]) -> Any:
    """Return the columns of a block, and the times of each, s since its first channel began."""
    channels = [channel for channel in block.columns if not channel.startswith('X_Value')]
    starts = np.zeros(len(channels))
    stamps = [' '.join(stamp) for stamp in zip(*(_of_each(header, key, channels)
                                                 for key in ('Date', 'Time')))]
    if len(set(stamps)) > 1 and header.get('Time_Pref', [''])[0] != 'Absolute':
        starts = seconds(name, 'Date and Time', np.array(stamps, object), starts)
    clock: np.ndarray | None = None
    clocks: dict[str, np.ndarray] = {}
    for column in block.columns:
        if column not in channels:
            clock = block[column].to_numpy(float)
            continue
        at = len(clocks)
        if clock is None or np.isnan(clock).all():
            begin, step = (_number(_of_each(header, key, channels)[at], default)
                           for key, default in (('X0', 0.0), ('Delta_X', 1.0)))
            own = begin + step * np.arange(len(block))
        else:
            own = clock
        clocks[f'X_Value of {column}'] = own + starts[at]
    return block[channels].assign(**clocks)


def _of_each(header: dict[str, list[str]], key: str, channels: list[str]) -> list[str]:
    """Return the value of a key for each channel; the first where there is not one for each."""
    values = list(filter(None, header.get(key, [])))
    return values if len(values) == len(channels) else [*values, ''][:1] * len(channels)


def _number(text: str, default: float) -> float:
    try:
        return float(text.replace(',', '.'))
    except ValueError:
        return default


def read_tdms(path: Path, sheet: str | None = None) -> Table:
    """
    Return the table of a .tdms file; groups with the same channels are trials.

    Start and increment of a waveform give the times of its channel where no channel is the time.

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
        groups = {group.name: [channel for channel in group.channels() if len(channel)]
                  for group in file.groups()}
        found = {name: _of_group(channels) for name, channels in groups.items() if channels}
    if sheet is not None and sheet not in found:
        raise InputError(f"{path.name}: no group '{sheet}'; expected one of {', '.join(found)}")
    if not found:
        raise InputError(f'{path.name}: no channels with values in it; expected a log')
    if sheet is not None:
        found = {sheet: found[sheet]}
    best = max(found.values(), key=lambda group: sum(
        bool(recognise(name, channel.unit).quantity) for name, channel in group.items()))
    alike = {name: group for name, group in found.items() if list(group) == list(best)}
    whole: dict[str, Any] = {'time_unit': 's'}
    for name in best:
        clock, readings = (np.concatenate([group[name][k] for group in alike.values()])
                           for k in (0, 1))
        whole[name] = Series(clock, readings) if len(clock) else readings
        whole[f'{name}_unit'] = best[name].unit
    if len(alike) > 1:
        whole['trial'] = np.repeat(np.array(list(alike), object), [
            max(len(channel.readings) for channel in group.values()) for group in alike.values()])
    return of_arrays(path.name, '.tdms', flattened(whole)).noted(*(
        f'not read: group {name}' for name in found if name not in alike))


def _of_group(channels: list[Any]) -> dict[str, Series]:
    """Return a group's channels padded to the longest; as they are, and no times, without."""
    names = unique([channel.name for channel in channels])
    units = [str(channel.properties.get('unit_string') or channel.properties.get(
        'NI_UnitDescription') or '') for channel in channels]
    clocks = [np.zeros(0)] * len(channels)
    if not any(recognise(name, unit).quantity == 'time' for name, unit in zip(names, units)):
        clocks = _clocks(channels)
    # a channel without an increment is of the task of one with as many samples
    known = {len(channel): clock for channel, clock in zip(channels, clocks) if len(clock)}
    found = {}
    for name, unit, channel, clock in zip(names, units, channels, clocks):
        readings = np.asarray(channel[:])
        clock = clock if len(clock) else known.get(len(channel), clock)
        if len(clock) and readings.dtype.kind in 'biuf':
            found[name] = Series(clock, filled_up(readings, len(clock)), unit)
        else:
            found[name] = Series(np.zeros(0), readings, unit)
    return found


def _clocks(channels: list[Any]) -> list[np.ndarray]:
    """Return the times of waveforms, s since the first start, (0,) for channels without them."""
    starts = [channel.properties.get('wf_start_time', _UNSET) for channel in channels]
    begin = min((start for start in starts if start > _UNSET), default=_UNSET)
    count = np.arange(max(map(len, channels)))
    clocks = []
    for channel, start in zip(channels, starts):
        step = channel.properties.get('wf_increment')
        late = (max(start, begin) - begin) / np.timedelta64(1, 's')
        clocks.append(late + channel.properties.get('wf_start_offset', 0.0) + step * count
                      if step else np.zeros(0))
    return clocks
