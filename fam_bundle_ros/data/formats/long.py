# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Tables with one reading per row, 'time, signal, value', as databases and controllers write them.

Each signal becomes a column. Readings of one time share a row; of several signals with times of
their own the others are blank there, and `data.clocks` brings them together.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, looks_like_time, numbers, seconds
from fam_bundle_ros.data.cells import labels as trial_labels
from fam_bundle_ros.data.column_names import recognise, STRAINS, words_of
from fam_bundle_ros.data.formats.quality import GOOD, of_bad_quality
from fam_bundle_ros.data.formats.table import is_unnamed, Table, unique
from fam_bundle_ros.data.formats.unit_columns import in_one_unit, NAMES
from fam_bundle_ros.data.grouping import earlier
from fam_bundle_ros.data.rates import begins
from fam_bundle_ros.data.unit_names import is_unit
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import counted

#: What columns of signal names, readings and units are called, their words joined.
_SIGNAL = frozenset("""signal signalname signalid tag tagname tagid variable variablename varname
    name channel channelname field parameter parametername series metric topic sensor sensorname
    measurement point pointname key kanal messgroesse messstelle groesse""".split())
_VALUE = frozenset("""value val varvalue reading tagvalue wert messwert istwert numericvalue
    floatvalue valor valeur""".split())
#: Most signals of a table; a column with more different words is text.
_MOST = 200
#: s of one unit of a clock; controllers of Siemens count millionths of a day.
_COUNTS = np.array([1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0, 0.0864])


def wide(table: Table) -> Table:
    """
    Return a table of one reading per row with a column for each signal; others as they are.

    Raises
    ------
    InputError
        Where times go back, and not for all signals alike, so that no trials are seen.
    """
    found = _columns(table)
    if found is None:
        return table
    signal, value, others = found
    # rows that repeat the header are not readings
    signals = np.array(list(map(cell_text, table.columns[signal])), object)
    named = signals != ''
    rows = named & (signals != signal)
    bad, qualities = of_bad_quality(table, others, rows, GOOD)
    rows &= ~bad
    labels, names = _counted(signals[rows])
    at, cells = table.rows[rows], table.columns[value][rows]
    clock = _clock(table, others, rows)
    trial = next((header for header in others if recognise(header).quantity == 'trial'), '')
    told = _counted(trial_labels(table.columns[trial][rows]) if trial else ['1'] * len(at))
    runs, run_names = _with_resets(table.name, at, names, labels, clock.times, *told)
    place, first = _places(labels, clock.times, runs)
    columns: dict[str, np.ndarray] = {}
    if trial or len(run_names) > 1:
        columns[trial or 'trial'] = np.array(run_names, object)[runs[first]]
    if clock.header:
        columns[clock.header] = clock.times[first]
    headers = unique([*columns, *names])[len(columns):]
    units = {header: unit for header, unit in table.units.items() if header in columns}
    units |= {clock.header: clock.unit} if clock.unit else {}
    unit_column = next((header for header in others if _key(header) in NAMES), None)
    for k, header in enumerate(headers):
        mine = labels == k
        values = cells[mine]
        texts = table.columns[unit_column][rows][mine] if unit_column is not None else values[:0]
        if any(map(is_unit, filter(None, map(cell_text, set(texts))))):
            values, units[header] = in_one_unit(table.name, header, values, texts, at[mine])
        columns[header] = _spread(values, place[mine], len(first))
    unread = ', '.join(repr(header) for header in others if not is_unnamed(header)
                       and header not in (*columns, *qualities, clock.source, unit_column))
    notes = [f"one reading per row: each of {len(names)} names in '{signal}' read as a column"
             + (f'; not used: {unread}' if unread else '')]
    if bad.any():
        notes.append(f"{counted(int(bad.sum()), 'reading')} of bad quality left out (first row "
                     f'{table.rows[np.argmax(bad)]})')
    if not named.all():
        notes.append(f"{counted(int((~named).sum()), 'row')} without a name in '{signal}' left "
                     'out')
    return replace(table, columns=columns, units=units, rows=at[first], blanks=None,
                   notes=(*table.notes, *notes))


def _columns(table: Table) -> tuple[str, str, list[str]] | None:
    """Return the headers of signal names, of readings, and of the rest; None for other tables."""
    known = set(table.quantities.values())
    if known & {'force', 'pressure'}:
        return None
    signals = {}
    for header, column in table.columns.items():
        if not is_text(column) or looks_like_time(column):
            continue
        names = set(filter(None, map(cell_text, column))) - {header}
        if 1 < len(names) <= _MOST:
            meant = {recognise(name).quantity for name in names}
            sure = 'force' in meant and bool(meant & {'pressure', *STRAINS})
            if sure or _key(header) in _SIGNAL:
                signals[header] = sure, len(names)
    values = [header for header in table.columns if _key(header) in _VALUE]
    if not values and any(sure for sure, _ in signals.values()):
        values = [header for header, column in table.columns.items() if column.dtype.kind == 'f'
                  and not recognise(header).quantity and np.isfinite(column).any()]
    if not signals or len(values) != 1:
        return None
    used = max(signals, key=lambda header: signals[header]), values[0]
    return *used, [header for header in table.columns if header not in used]


def _key(header: str) -> str:
    return ''.join(words_of(header))


def _counted(cells: Iterable[Any]) -> tuple[np.ndarray, list[str]]:
    """Return a code for each cell and the text of each code."""
    number: dict[str, int] = {}
    codes = np.array([number.setdefault(str(cell).strip(), len(number)) for cell in cells], int)
    return codes, list(number)


class _Clock(NamedTuple):
    """Header, times (R,) and unit of a clock, and the column that it is from; '' for none."""

    header: str
    times: np.ndarray
    unit: str
    source: str


def _clock(table: Table, others: Sequence[str], rows: np.ndarray) -> _Clock:
    """
    Return the clock with most different times in some rows.

    The unit of a clock that counts is found from dates in another column, if there are any.
    """
    clocks: dict[str, np.ndarray] = {}
    dates: dict[str, np.ndarray] = {}
    for header in others:
        column = table.columns[header][rows]
        if looks_like_time(column):
            dates[header] = seconds(table.name, header, column, table.rows[rows])
        elif table.meaning(header).quantity == 'time':
            clocks[header] = numbers(column)[0]
    best = max([*dates, *clocks], default='', key=lambda header: len(np.unique(
        (dates | clocks)[header])))
    if not best:
        return _Clock('', np.zeros(rows.sum()), '', '')
    if best in dates:
        named = best if recognise(best, 's').quantity == 'time' else 'time'
        return _Clock(named, dates[best], 's', best)
    times = clocks[best]
    span = float(np.nanmax(next(iter(dates.values())))) if dates else 0.0
    since = times - np.nanmin(times)
    if span > 0.0 and np.nanmax(since) > 0.0:
        ratios = span / np.nanmax(since) / _COUNTS
        since = since * _COUNTS[np.argmin(np.abs(np.log(ratios)))]
        return _Clock('time', since, 's', best)
    return _Clock(best, times, '', best)


def _with_resets(name: str, rows: np.ndarray, names: Sequence[str], labels: np.ndarray,
                 times: np.ndarray, runs: np.ndarray, run_names: list[str],
                 ) -> tuple[np.ndarray, list[str]]:
    """Return the trial of each row and their names, a new one where all signals' times go back."""
    resets = np.zeros(len(times), int)
    found = {}
    for k, signal in enumerate(names):
        mine = np.flatnonzero(labels == k)
        back = (np.diff(times[mine]) < 0) & (np.diff(runs[mine]) == 0)
        resets[mine[1:]] = np.cumsum(back)
        if len(mine) > 2:
            found[int(back.sum())] = signal, rows[mine[1:][back][:1]]
    if len(found) > 1:
        signal, at = found[max(found)]
        raise InputError(f"{name}, row {at[0]}: the time of '{signal}' goes back, and not that of "
                         'each signal; expected times in order, or a column for the trial')
    if not resets.any():
        return runs, run_names
    count = resets.max() + 1
    codes, runs = np.unique(runs * count + resets, return_inverse=True)
    of_run = codes // count
    number = earlier(of_run) + 1
    return runs.ravel(), [f'{run_names[run]} {k}' if len(run_names) > 1 else str(k)
                          for run, k in zip(of_run.tolist(), number.tolist())]


def _places(labels: np.ndarray, times: np.ndarray, runs: np.ndarray,
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return the new row of each reading, and the first reading of each new row."""
    moments = np.unique(times, return_inverse=True)[1].ravel() + runs * len(times)
    # two readings of one signal at one time take two rows
    turn = earlier(moments * (labels.max() + 1) + labels)
    order = np.lexsort((turn, moments))
    new = begins(moments[order], turn[order])
    place = np.empty(len(order), int)
    place[order] = np.cumsum(new) - 1
    return place, order[new]


def _spread(cells: np.ndarray, place: np.ndarray, count: int) -> np.ndarray:
    """Return a column with readings at their rows, blank elsewhere; text if it has words."""
    values, words = numbers(cells)
    column: np.ndarray[Any, Any] = np.full(count, np.nan)
    if words.any() and not words.all():
        column = np.full(count, None, object)
        values = cells
    column[place] = values
    return column
