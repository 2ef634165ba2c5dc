# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dead time and first-order lag of signals: what lies between the plant and who reads or drives it.

Kernels (`fam_bundle_ros.kernels`). A delay line is a ring of fixed size, whatever the delay, so
that compiled loops are the same for all: of a long delay it keeps fewer samples per second, and
reads linearly between them.
"""

from dataclasses import dataclass
import math
from typing import Any

#: Places of a delay line.
PLACES = 48
#: s: times closer than this are one time.
_SAME = 1e-9


@dataclass
class DelayLine:
    """
    Samples of some signals on their way.

    Attributes
    ----------
    times : list (PLACES,), s
    values : list (PLACES, c)
    head, size : int
        Oldest sample, and how many there are.
    """

    times: list[float]
    values: list[list[float]]
    head: int = 0
    size: int = 0

    @classmethod
    def empty(cls, signals: int) -> 'DelayLine':
        """Return a line for so many signals with nothing in it."""
        return cls([0.0] * PLACES, [[0.0] * signals for _ in range(PLACES)])


def put(line: Any, time: float, values: Any, delay: float) -> None:
    """
    Let a sample of the signals, vector (c,), enter a delay line at ``time`` (s).

    Samples that came out long ago make room. Of those still inside at most `PLACES` - 4 are kept:
    one that comes too soon after the last one but one takes the place of the last.
    """
    oldest = time - delay
    while line.size > 1 and line.times[(line.head + 1) % PLACES] <= oldest + _SAME:
        line.head, line.size = (line.head + 1) % PLACES, line.size - 1
    last = (line.head + line.size - 1) % PLACES
    crowded = line.size >= 2 and (time - line.times[(last + PLACES - 1) % PLACES]
                                  < delay / (PLACES - 4))
    if not crowded and line.size < PLACES:
        line.size += 1
        last = (line.head + line.size - 1) % PLACES
    line.times[last] = time
    for i in range(len(values)):
        line.values[last][i] = values[i]


def find(line: Any, time: float) -> int:
    """Return the place of the newest sample that is not newer than a time; the oldest at least."""
    k, end = 0, line.size - 1
    while k < end and line.times[(line.head + k + 1) % PLACES] <= time + _SAME:
        k += 1
    return k


def read_between(line: Any, time: float, out: Any) -> None:
    """Put the signals at a time into ``out``, linear between samples, constant before them."""
    k = find(line, time)
    here = (line.head + k) % PLACES
    if k == line.size - 1 or time <= line.times[here]:
        for i in range(len(out)):
            out[i] = line.values[here][i]
        return
    there = (here + 1) % PLACES
    share = (time - line.times[here]) / (line.times[there] - line.times[here])
    for i in range(len(out)):
        low = line.values[here][i]
        out[i] = low + share * (line.values[there][i] - low)


def read_held(line: Any, time: float, out: Any) -> None:
    """Put the newest sample that is not newer than a time into ``out``; zeros before the first."""
    here = (line.head + find(line, time)) % PLACES
    there = line.times[here] <= time + _SAME
    for i in range(len(out)):
        out[i] = line.values[here][i] if there else 0.0


def lag(state: float, before: float, now: float, dt: float, time_constant: float) -> float:
    """
    Return the output of a first-order lag after ``dt``; its input goes from ``before`` to ``now``.

    Exact for an input that is linear between samples (first-order hold).
    """
    if time_constant <= 0.0:
        return now
    behind = time_constant * (now - before) / dt
    return now - behind + (state - before + behind) * math.exp(-dt / time_constant)
