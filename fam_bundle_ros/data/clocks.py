# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Clocks of a table: counters that wrap, and channels that were sampled at their own times."""

from collections.abc import Callable, Collection, Mapping, Sequence
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, is_time
from fam_bundle_ros.data.column_names import dimension_of
from fam_bundle_ros.data.formats.channels import may_be_clocks, nearest
from fam_bundle_ros.data.formats.heads import rate_in
from fam_bundle_ros.data.formats.table import Table, without_count
from fam_bundle_ros.data.missing_units import time_unit
from fam_bundle_ros.data.unit_names import unit_of
from fam_bundle_ros.errors import about, InputError

#: Share of the slowest channel's readings that are in rows with all channels, if of one clock.
_TOGETHER = 0.5
#: Largest difference between the steps of an even clock, as a share of a step.
_EVEN = 0.05
#: Tolerance of a quartz clock, as a share of the time.
_QUARTZ = 1e-4
#: Values at which counters wrap, and how far the step across the wrap may be from the usual
#: step, as a share of it.
_COUNTERS = 2.0 ** 16, *(2.0 ** 32 / count for count in (1, 1e3, 1e6)), 86400.0, 864e5
_ANEW = 0.3
#: Clocks of which only the seconds of the minute or of the hour are written, in s and ms.
_DIALS = 60.0, 3600.0, 60e3, 3600e3


def same_name(header: str, other: str) -> bool:
    """
    Return whether two headers differ in nothing but a count.

    Examples
    --------
    >>> same_name('Time (s)', 'Time (s).1'), same_name('Time', 'Time (2)'), same_name('t', 'time')
    (True, True, False)
    >>> same_name('Time 1 (s)', 'Time 2 (s)'), same_name('Time 1 (s)', 'Time 2 (ms)')
    (True, False)
    """
    count = r'[ ._]*(\(\d+\)|\d+)(?=$|\s*[\[(][^\d\])]+[\])]$)'  # at the end or before a unit
    first, second = (re.sub(count, '', name).casefold() for name in (header, other))
    return first == second


def run_on(clock: np.ndarray) -> tuple[np.ndarray, float]:
    """
    Return a clock without the wraps of its counter, and the value at which it wraps; 0 for none.

    Counters of 16 and 32 bits begin anew, also those of microseconds shown as ms or s, seconds of
    a day, and the seconds of a minute or of an hour. A clock that restarts with each trial
    restarts at the reading at which it first began: trials of just a minute are none of these.

    Examples
    --------
    >>> run_on(np.array([65500.0, 65520.0, 4.0, 24.0]))
    (array([65500., 65520., 65540., 65560.]), 65536.0)
    >>> run_on(np.array([58.0, 59.0, 0.0, 1.0]))
    (array([58., 59., 60., 61.]), 60.0)
    """
    known = np.flatnonzero(np.isfinite(clock))
    readings = clock[known]
    steps = np.diff(readings)
    if not (steps < 0.0).any() or not (steps > 0.0).any():
        return clock, 0.0
    usual = np.median(steps[steps > 0.0])
    for period in (*_COUNTERS, *_DIALS):
        anew = (steps < 0.0) & (np.abs(steps + period - usual) < _ANEW * usual)
        if period in _DIALS and not (0.0 <= readings.min() and readings.max() < period and (
                np.abs(readings[1:][anew] - readings[0]) > usual).all()):
            continue
        if anew.any():
            clock = clock.copy()
            clock[known[1:]] += period * np.cumsum(anew)
            return clock, period
    return clock, 0.0


def of_two_zeros(table: Table) -> list[str]:
    """
    Return columns of one clock with two zeros, that of the smallest readings first; [] for none.

    One counts since 1970, say, and one since the start: in all rows they differ by one constant,
    which is longer than the log. Of two that began apart within it each may be a device's own.

    Examples
    --------
    >>> time = 0.5 * np.arange(4)
    >>> of_two_zeros(Table('log', '', {'Timestamp': 1.7e12 + 1e3 * time, 'Time': time}))
    ['Time', 'Timestamp']
    >>> of_two_zeros(Table('log', '', {'Time A (s)': time, 'Time B (s)': time + 1.0}))
    []
    """
    score = {header: table.meaning(header).score for header in may_be_clocks(table)
             if table.meaning(header).quantity == 'time'}
    best = [header for header in score if score[header] == max(score.values())]
    try:
        times = {header: _in_seconds(table, header) for header in best}
    except InputError:  # of an unknown unit
        return []
    for header, time in times.items():
        apart = time - times[best[0]]
        steps = np.abs(np.diff(time))
        if header != best[0] and not (np.ptp(apart) <= np.median(steps) and np.abs(
                apart).min() > np.ptp(time)):
            return []
    return sorted(best, key=lambda header: np.abs(times[header]).max()) if len(best) > 1 else []


def _in_seconds(table: Table, header: str) -> np.ndarray:
    """Return the readings of a clock in s, its unit guessed where it has none."""
    column = table.columns[header]
    unit = unit_of(table.unit_text(header) or '', 's') or time_unit(table.name, header, column)[0]
    return column * unit.factor


def other_times(table: Table, clock: str, time: np.ndarray) -> str:
    """
    Return a note on a column whose times differ from those of the clock, '' for none.

    ``clock`` is the header of the time, ``time`` (T,), s, that of all columns.
    """
    for header in may_be_clocks(table):
        if header == clock:
            continue
        try:
            others, own = np.diff(_in_seconds(table, header)), np.diff(time)
        except InputError:  # of an unknown unit
            continue
        on = (others > 0.0) & (own > 0.0)  # one may run on where the other restarts
        if on.sum() > 2 and np.ptp(np.cumsum((others - own)[on])) > max(
                np.median(own[on]), _QUARTZ * own[on].sum()):
            return (f"'{clock}' and '{header}' show other times: '{clock}' is taken for all "
                    f'columns. If they are clocks of two devices, call them Time 1 and Time 2')
    return ''


def holds_times(column: np.ndarray) -> bool:
    """Return whether all cells are dates or times of day, and most of them different."""
    if not (is_text(column) or column.dtype.kind == 'M'):
        return False
    cells = [cell_text(cell) for cell in column]
    return 2 * len(set(cells)) > len(cells) and all(map(is_time, cells))


def of_calendar(numbers: np.ndarray) -> np.ndarray | None:
    """
    Return the seconds of times that are written as one number, None for other numbers.

    Examples
    --------
    >>> of_calendar(np.array([20261231235959.5, np.nan, 20270101000000.0])).tolist()
    [0.0, nan, 0.5]
    """
    known = np.isfinite(numbers)
    values = numbers[known]
    if not len(values) or values.min() < 1.9e13 or values.max() >= 2.2e13:
        return None
    whole = values.astype(np.int64)
    year, month, day, hour, minute, second = (
        whole // 10 ** (2 * at) % (100 if at < 5 else 10_000) for at in range(5, -1, -1))
    if (month < 1).any() or (month > 12).any() or (day < 1).any() or (day > 31).any() or (
            hour > 23).any() or (minute > 59).any() or (second > 59).any():
        return None
    days = ((12 * (year - 1970) + month - 1).astype('M8[M]').astype('M8[D]').astype(int) + day)
    clock = 86400 * days + 3600 * hour + 60 * minute + second + values % 1.0
    seconds = np.full(len(numbers), np.nan)
    seconds[known] = clock - clock[0]
    return seconds


def of_day(numbers: np.ndarray) -> np.ndarray | None:
    """
    Return the seconds of times of day written as one number, HHMMSS.f, None for other numbers.

    Seconds that all stop below 60 and go on at the next minute at the pace of the others are such.

    Examples
    --------
    >>> of_day(np.array([102057.0, 102058.0, 102059.0, 102100.0])).tolist()
    [37257.0, 37258.0, 37259.0, 37260.0]
    """
    known = np.isfinite(numbers)
    values = numbers[known]
    if len(values) < 3 or values.min() < 0.0 or values.max() >= 24e4 or (
            values % 100.0 >= 60.0).any() or (values // 100.0 % 100.0 >= 60.0).any():
        return None
    clock = 3600.0 * (values // 1e4) + 60.0 * (values // 100.0 % 100.0) + values % 100.0
    steps, raw = np.diff(clock), np.diff(values)
    over = np.diff(values // 100.0) > 0.0
    pace = float(np.median(steps))
    if not over.any() or pace <= 0.0 or (steps[over] > 1.5 * pace).any() or (
            raw[over] < 40.0).any():
        return None
    seconds = np.full(len(numbers), np.nan)
    seconds[known] = clock
    return seconds


def may_be_clock(table: Table, used: Collection[str | None]) -> str:
    """Return a note on an unused column that may be the clock of a table without one, or ''."""
    rate = rate_in(table.above)
    said = re.findall(r'([\d.]+)[\s;,]*(k?Hz)', rate, re.IGNORECASE)
    shown = ' '.join(said[0]) if len(said) == 1 else '100 Hz'
    as_said = f", as '{rate[:60]}' says" if len(said) == 1 else ''
    for header, column in table.columns.items():
        if header in used or column.dtype.kind != 'f' or len(column) < 3:
            continue
        steps = np.diff(column)
        if not (steps > 0.0).all():
            continue
        even = np.ptp(steps) <= _EVEN * np.median(steps)
        text = table.unit_text(header)  # not of time, or it would be the clock: '10 ms'
        unit = '[ms]' if np.median(steps) > 1.0 else '[s]'
        unit = f'* {text}' if text and text[0].isdigit() else unit
        tell = ('counts the rows: if they are evenly spaced in time, tell their rate, --columns '
                f'"time={shown}"{as_said}' if (steps == 1.0).all() else
                f'rises {"evenly" if even else "throughout"}: if it is the clock, tell it, '
                f'--columns "time={header} {unit}"')
        return f"no time, read as a static map; '{header}' {tell}"
    for header, column in table.columns.items():
        if header not in used and holds_times(column):
            return (f"no time, read as a static map; '{header}' has dates or times of day: if it "
                    f'is the clock, tell it, --columns "time={header}"')
    for header in table.columns:
        meant = dimension_of(header, table.units.get(header, ''))
        if header not in used and meant and meant.like == 's':
            return (f"no time, read as a static map; '{header}' in {meant.text} is no clock, it "
                    'does not rise: if rows are evenly spaced, tell their rate, --columns '
                    '"time=100 Hz"')
    return rate and (f"no time, read as a static map; above the table stands '{rate[:60]}': if "
                     f'that is the rate of the rows, tell it, --columns "time={shown}"')


def at_one_time(values: Mapping[str, np.ndarray], times: Mapping[str, np.ndarray],
                ) -> tuple[dict[str, np.ndarray], str] | None:
    """
    Return readings at the times of the slowest channel, and the name of this channel.

    Readings and times of each quantity are (T,), nan where there is none, in the result also
    beyond the times of another channel. Times that go back begin the next trial. None where the
    channels have the same times in each row.

    Raises
    ------
    InputError
        Where not all times go back as often, and where they have no time in common.

    Notes
    -----
    Between two readings a channel is taken as linear. The slowest, that with the fewest readings
    in the time that all have, is interpolated nowhere, so that no reading is made up where none
    was taken.
    """
    known = {key: np.isfinite(values[key]) & np.isfinite(times[key]) for key in values}
    first = next(iter(times.values()))
    together = np.all(list(known.values()), axis=0).sum()
    counts = [int(rows.sum()) for rows in known.values()]
    if all(_equal(first, time) for time in times.values()) and (
            together >= _TOGETHER * min(counts)) or min(counts) < 2:
        return None
    trials = {key: _trials(np.flatnonzero(known[key]), time) for key, time in times.items()}
    most = max(trials, key=lambda key: len(trials[key]))
    if len({len(parts) for parts in trials.values()}) > 1:
        raise InputError(f'the times of {most} go back, and are not those of the other '
                         'readings; expected one clock for all, or one trial per file')
    shared = dict.fromkeys(values, 0)
    for parts in zip(*trials.values()):
        clocks = [times[key][rows] for key, rows in zip(trials, parts)]
        begin, end = max(clock[0] for clock in clocks), min(clock[-1] for clock in clocks)
        for key, clock in zip(trials, clocks):
            shared[key] += int(((begin <= clock) & (clock <= end)).sum())
    if not all(shared.values()):
        spans = ', '.join(f'{key} {np.nanmin(time):.10g} to {np.nanmax(time):.10g} s'
                          for key, time in times.items())
        raise InputError(f'the channels have no time in common ({spans}); expected clocks of one '
                         'zero, or one of them told with the difference, --columns "time=NAME OF '
                         'THE CLOCK + 1.7 s"')
    slowest = min(shared, key=lambda key: shared[key])
    moved = {key: np.full(len(own), np.nan) for key, own in values.items()}
    for at, *parts in zip(trials[slowest], *trials.values()):
        for key, rows in zip(trials, parts):
            moved[key][at] = np.interp(times[slowest][at], times[key][rows], values[key][rows],
                                       left=np.nan, right=np.nan)
    return {**moved, slowest: values[slowest]}, slowest


def _trials(rows: np.ndarray, time: np.ndarray) -> list[np.ndarray]:
    """Return some rows, cut where the time goes back."""
    return np.split(rows, np.flatnonzero(np.diff(time[rows]) < 0.0) + 1)


def _equal(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two clocks are equal in all rows in which both have a reading."""
    both = np.isfinite(one) & np.isfinite(other)
    return bool(both.any()) and np.array_equal(one[both], other[both])


class Together(NamedTuple):
    """Readings at the times of one channel, its rows, and the clock of each quantity."""

    values: dict[str, np.ndarray]
    time: np.ndarray
    rows: np.ndarray
    clocks: dict[str, str]
    note: str


def bring_together(table: Table, clock: str, several: Sequence[str], headers: Mapping[str, str],
                   values: Mapping[str, np.ndarray], seconds: Callable[[str], np.ndarray],
                   ) -> Together | None:
    """
    Return readings of all quantities at common times.

    None where each row of the table already has them. The clock of a quantity is the next on its
    left.

    Parameters
    ----------
    clock : str
        Header of the time.
    several : sequence of str
        Clocks by `clocks_in`; where the time is none of them, all that are called as it.
    headers : dict of str to str
        Quantity to header, without the time.
    values : dict of str to ndarray, shape (T,)
        Readings of these.
    seconds : callable
        Returns a clock, (T,), s, by its header.
    """
    if clock not in several:
        several = [header for header in table.columns if header == clock or same_name(
            header, clock) and table.meaning(without_count(header)).quantity == 'time']
    left = nearest(list(table.columns), several)
    clocks = {key: left.get(header, clock) for key, header in headers.items()}
    times = {header: seconds(header) for header in dict.fromkeys(clocks.values())}
    with about(table.name):
        found = at_one_time({key: values[key] for key in headers},
                            {key: times[clocks[key]] for key in headers})
    if found is None:
        return None
    moved, slowest = found
    time, header = times[clocks[slowest]], headers[slowest]
    rows = np.isfinite(time) & np.isfinite(values[slowest])
    return Together(
        moved, time, rows, clocks,
        f"channels with times of their own: read at the {rows.sum()} of '{header}', the slowest, "
        'linear between')
