# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The last minutes of a running rig, thinned and balanced, in stretches of time.

    memory = Memory(('mu1', 'mu2'), (344.7e3, 344.7e3))
    memory.add(time, strain, (p1, p2), force)      # every sample, in order
    data = memory.measurement()

Neighbouring samples are averaged into rows, rows make stretches, and a stretch belongs to a cell
of strain, pressures and direction. When the memory is full the fullest cell gives up the stretch
whose neighbours in time are nearest: a rig that rests for minutes, or does the same for ever,
does not push out what it did once. Stretches that follow each other without a gap are one trial.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from fam_bundle_ros.data.measurement import build, Measurement
from fam_bundle_ros.errors import InputError

__all__ = ['Memory']

#: Width of a cell: of strain, and as a share of the largest pressure.
_STRAINS, _PRESSURES = 0.02, 0.2
#: Strain and share of the largest pressure by which a stretch must move to have a direction.
_STILL_STRAIN, _STILL_PRESSURE = 1e-3, 0.02
#: A silence of so many rows ends a stretch; of a slow log two steps more, each at most so long, s.
_GAP, _SLOW = 3.0, 1.0


@dataclass(frozen=True)
class Stretch:
    """Rows that follow each other."""

    #: Time (s), strain, force (N), pressures (Pa); shape (k, 3 + n).
    rows: np.ndarray
    #: One more than that of the stretch before it, two more after a gap.
    number: int
    #: Bins of strain and of each pressure, and the direction.
    cell: tuple[int, ...]

    @property
    def begin(self) -> float:
        """Time of the first row, s."""
        return float(self.rows[0, 0])

    @property
    def end(self) -> float:
        """Time of the last row, s."""
        return float(self.rows[-1, 0])


class Memory:
    """
    A bounded memory of what a rig did.

    Parameters
    ----------
    motor_units : sequence of str
        Their names.
    max_pressure : sequence of float, Pa (gauge)
        Of each motor unit: the scale of the cells.
    seconds : float, s
        Nothing older is kept.
    rate : float, Hz
        Rows per second; faster samples are averaged.
    stretch : float, s
        Length of a stretch: what a timed analysis gets in one piece at least.
    most : int
        Stretches that are kept.

    Examples
    --------
    >>> memory = Memory(('mu1',), (4e5,), seconds=60.0, most=10)
    >>> for k in range(20_000):
    ...     memory.add(0.005 * k, 0.1 + 0.05 * math.sin(0.01 * k), (1e5,), 20.0)
    >>> len(memory), bool(memory.oldest > 39.0)
    (10, True)
    """

    def __init__(self, motor_units: Sequence[str], max_pressure: Sequence[float],
                 seconds: float = 300.0, rate: float = 50.0, stretch: float = 0.5,
                 most: int = 240):
        if not (seconds > 0.0 and rate > 0.0 and stretch * rate >= 2.0 and most >= 1):
            raise InputError(f'a memory of {seconds:g} s, {rate:g} rows per second in {most} '
                             f'stretches of {stretch:g} s; expected positive numbers and at least '
                             'two rows in a stretch')
        self._names, self._scale = tuple(motor_units), np.asarray(max_pressure, float)
        self._seconds, self._stretch, self._most = seconds, stretch, most
        self._period = 1.0 / rate
        #: Time of the first sample of a row, and between the last two, s.
        self._first = self._step = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._kept: list[Stretch] = []
        self._number = 0
        self._last, self._before = -math.inf, 0.0
        self._break()

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def seconds(self) -> float:
        """Time that the stretches cover together, s."""
        return len(self._kept) * self._stretch

    @property
    def oldest(self) -> float:
        """Time of the oldest row, s; infinite where there is none."""
        return self._kept[0].begin if self._kept else math.inf

    def add(self, time: float, strain: float, pressure: Sequence[float], force: float) -> None:
        """
        Take a sample; one that is not finite ends the stretch, time that goes back all.

        Parameters
        ----------
        time : float, s
        pressure : sequence of float, Pa (gauge)
        force : float, N
        """
        if not math.isfinite(time + strain + force + sum(pressure)):
            self._break()
            return
        if time <= self._last:
            self.clear()
        elif time - self._last > _GAP * self._period + 2.0 * self._before:
            self._break()
        else:
            self._step = time - self._last
        self._before, self._last = min(time - self._last, _SLOW), time
        if self._count and time - self._first >= self._period - 0.5 * self._step:
            self._close_row()
        if not self._count:
            self._first = time
        self._count += 1
        sums = self._sums
        sums[0] += time
        sums[1] += strain
        sums[2] += force
        for k, value in enumerate(pressure, 3):
            sums[k] += value

    def forget(self, before: float) -> None:
        """Forget the stretches that ended before a time, s."""
        self._kept = [stretch for stretch in self._kept if stretch.end >= before]

    def measurement(self, since: float = -math.inf, name: str = 'memory') -> Measurement:
        """
        Return the rows from a time on (s) as a measurement; its time begins at zero.

        Another thread may call it while samples come.

        Raises
        ------
        InputError
            Where that is too little, or neither strain nor pressure changes.
        """
        parts, label = [], []
        trial, before = -1, -10
        for stretch in list(self._kept):
            rows = stretch.rows[stretch.rows[:, 0] >= since]
            if len(rows) < 2:
                continue
            trial += stretch.number != before + 1
            before = stretch.number
            parts.append(rows)
            label.append(np.full(len(rows), trial))
        rows = np.concatenate(parts) if parts else np.zeros((0, 3 + len(self._names)))
        begin = rows[0, 0] if len(rows) else 0.0
        data = build(name, rows[:, 1], rows[:, 3:], rows[:, 2],
                     np.concatenate(label) if parts else None, rows[:, 0] - begin, self._names)
        # in a gap the muscle moved as well, unlike in a pause of a log
        return replace(data, recording=data.trial)

    def _break(self) -> None:
        """Begin a new stretch that does not follow the one before."""
        self._rows: list[list[float]] = []
        self._sums = [0.0] * (3 + len(self._names))
        self._count, self._first, self._step = 0, 0.0, 0.0
        self._number += 1

    def _close_row(self) -> None:
        self._rows.append([value / self._count for value in self._sums])
        self._sums, self._count = [0.0] * len(self._sums), 0
        if self._rows[-1][0] - self._rows[0][0] >= self._stretch - 1.5 * self._period:
            rows = np.array(self._rows)
            self._rows = []
            self._number += 1
            self._keep(Stretch(rows, self._number, self._cell(rows)))

    def _cell(self, rows: np.ndarray) -> tuple[int, ...]:
        mean, moved = rows.mean(axis=0), rows[-1] - rows[0]
        share = moved[3:] / self._scale
        fills = float(share[np.argmax(np.abs(share))])
        direction = (int(np.sign(moved[1])) if abs(moved[1]) > _STILL_STRAIN
                     else 2 * int(np.sign(fills)) if abs(fills) > _STILL_PRESSURE else 0)
        bins = np.floor(mean[3:] / (_PRESSURES * self._scale)).astype(int)
        return (math.floor(mean[1] / _STRAINS), *bins.tolist(), direction)

    def _keep(self, stretch: Stretch) -> None:
        self._kept.append(stretch)
        while self._kept[0].end < stretch.end - self._seconds:
            del self._kept[0]
        if len(self._kept) > self._most:
            del self._kept[self._superfluous()]

    def _superfluous(self) -> int:
        """Return the stretch of the fullest cell whose neighbours there are nearest in time."""
        cell, _ = Counter(stretch.cell for stretch in self._kept).most_common(1)[0]
        places = [k for k, stretch in enumerate(self._kept) if stretch.cell == cell]
        if len(places) < 3:
            return places[0]
        begin = [self._kept[k].begin for k in places]
        gap = [after - before for before, after in zip(begin, begin[2:])]
        return places[1 + int(np.argmin(gap))]
