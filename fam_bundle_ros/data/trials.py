# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Trials of a log, by a column or by its clock; time stamps that rows share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.rates import begins, PAUSE_STEPS, usual_step
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import counted, number

#: A comparison needs at least so many rows.
MIN_ROWS = 12
#: Rows closer in time than this share of the usual step came in one packet.
_PACKET = 0.1
#: s: a longer step is a pause of the log, if the usual step is far shorter; what the muscle did in
#: it is not known.
_PAUSE = 5.0
#: Times that go back by at most so many usual steps: the rows were written out of order.
_SWAPPED = 3.0


class Trials(NamedTuple):
    """Trials of a log."""

    #: Trial of each row, in the new order; shape (T,).
    of_row: np.ndarray
    names: tuple[str, ...]
    #: The rows in the order in which trials are contiguous and times rise; shape (T,).
    order: np.ndarray
    #: What was odd in the clock.
    notes: list[str]


def trials_of(name: str, trial: Sequence[Any] | np.ndarray | None, time: np.ndarray | None,
              rows: np.ndarray) -> Trials:
    """
    Return the trials; without a column for them a clock that restarts begins a new one.

    ``trial`` has the label of each row; ``rows`` (T,) is what messages call it. The time is in s.

    Raises
    ------
    InputError
        Where the time runs backwards within a trial.
    """
    if trial is None:
        return _of_clock(name, time, rows)
    names: dict[str, int] = {}
    index = np.array([names.setdefault(str(label), len(names)) for label in np.asarray(trial)])
    order = np.argsort(index, kind='stable')
    index = index[order]
    if time is not None:
        _refuse_disorder(name, time[order], index, tuple(names), rows[order])
    return Trials(index, tuple(names), order, [])


def recordings_of(time: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """
    Return the recording of each row, (T,) int: trials between which the clock runs on are one.

    It runs on where it does not go back, and pauses no longer than `_PAUSE`, or than between two
    rows of a trial: while the pressure is set between two sweeps the muscle remembers.

    Examples
    --------
    >>> time, trial = 0.1 * np.arange(6), np.repeat([0, 1, 2], 2)
    >>> recordings_of(time + np.repeat([0.0, 1.0, 99.0], 2), trial)
    array([0, 0, 0, 0, 1, 1])
    """
    step, change = np.diff(time), np.diff(trial) != 0
    most = max(_PAUSE, float(step[~change].max(initial=0.0))) * (1.0 + 1e-6)  # rounding of sums
    return np.append(0, np.cumsum(change & ((step < 0.0) | (step > most))))


def _of_clock(name: str, time: np.ndarray | None, rows: np.ndarray) -> Trials:
    one, few = np.zeros(len(rows), int), max(1, len(rows) // 50)
    if time is None:
        return Trials(one, ('0',), np.arange(len(rows)), [])
    step, usual = np.diff(time), usual_step(time, one)
    back = step < 0
    # a clock that goes back a few times: several trials; many times: rows out of order
    if back.sum() > few:
        _refuse_disorder(name, time, one, ('0',), rows)
    if back.any() and step.min() > -_SWAPPED * usual:
        return Trials(one, ('0',), np.argsort(time, kind='stable'),
                      ['rows out of order by their times: put in order'])
    paused = step > max(_PAUSE, PAUSE_STEPS * usual)
    index = np.append(0, np.cumsum(back | paused if paused.sum() <= few else back))
    return Trials(index, tuple(str(i) for i in range(index[-1] + 1)), np.arange(len(rows)),
                  _new_trials(index, time, rows))


def _new_trials(of_row: np.ndarray, time: np.ndarray, rows: np.ndarray) -> list[str]:
    """Return notes on trials that begin at a pause of the clock, or where it goes back oddly."""
    begin = np.flatnonzero(np.diff(of_row)) + 1
    steps = time[begin] - time[begin - 1]
    notes = [f'the clock pauses for {number(step)} s before row {rows[at]}: a new trial'
             for at, step in zip(begin, steps) if step > 0.0]
    if len(notes) > 3:
        notes = [f'{notes[0]}, as at {len(notes) - 1} further pauses']
    notes += [f'the clock goes back by {number(-step)} s at row {rows[at]}, not to where it '
              'began: read as a new trial' for first, at, step in zip([0, *begin], begin, steps)
              if step < 0.0 and time[at] - time[first] > 0.5 * (time[at - 1] - time[first])]
    counts = np.bincount(of_row)[1:].tolist()
    return notes + [f'the clock goes back at row {rows[at]} for {counted(count, "row")}: read as '
                    'a trial' for at, step, count in zip(begin, steps, counts)
                    if step < 0.0 and count < MIN_ROWS]


def _refuse_disorder(name: str, time: np.ndarray, index: np.ndarray, names: tuple[str, ...],
                     rows: np.ndarray) -> None:
    back = (np.diff(time) < 0) & (np.diff(index) == 0)
    if back.any():
        at = int(np.argmax(back)) + 1
        restart = ', or to restart with each trial (--columns "trial=none")'
        raise InputError(f'{name}, row {rows[at]}: time goes from {time[at - 1]:.6g} s to '
                         f'{time[at]:.6g} s within trial {names[index[at]]}; expected time to '
                         'increase' + (restart if len(names) == 1 and names != ('0',) else ''))


def fresh_stamps(time: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """
    Return which rows have a time stamp of their own, (T,) bool.

    Rows share one of a clock coarser than the sampling, such as ISO times in whole seconds. So do
    rows that a computer got in packets and stamped as it wrote them: most of them follow within a
    tenth of the usual distance. The times (s) do not decrease within a trial.
    """
    step, same = np.diff(time), np.diff(trial) == 0
    close = same & (step < _PACKET * usual_step(time, trial))
    packets = close.sum() > 0.5 * same.sum()
    return np.append(True, ~close if packets else ~same | (step > 0))


def spread_stamps(time: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """
    Return the time with shared stamps spread evenly up to the next stamp, (T,), s.

    Which rows share one is said by `fresh_stamps`. The first group of a trial may be cut by the
    start of the log, and the last by its end: their rows keep the usual distance.

    Examples
    --------
    >>> spread_stamps(np.array([0., 0., 1., 1., 1., 1., 2.]), np.zeros(7, int))
    array([0.5 , 0.75, 1.  , 1.25, 1.5 , 1.75, 2.  ])
    """
    fresh = fresh_stamps(time, trial)
    if fresh.all():
        return time
    begin = np.flatnonzero(fresh)
    count = np.diff(np.append(begin, len(time)))
    first = begins(trial[begin])
    last = np.append(first[1:], True)
    width = np.append(np.diff(time[begin]), 0.0)
    usual_width = np.median(width[~last]) if (~last).any() else 0.0
    width[last] = usual_width
    inner = ~first & ~last
    usual = max(float(np.median(count[inner])) if inner.any() else float(count.max()), 1.0)
    step = width / np.where(first | last, np.maximum(count, usual), count)
    shift = np.where(first & ~last, width - step * count, 0.0)
    group = np.cumsum(fresh) - 1
    return time[begin][group] + shift[group] + step[group] * (np.arange(len(time)) - begin[group])
