# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dead time and first-order lag of signals between the plant and its users.

Kernels (`fam_bundle_ros.kernels`). A delay line is a ring buffer of fixed size for any delay, so
that compiled loops have one type: for a long delay it stores fewer samples per second, and
interpolates linearly.
"""

from dataclasses import dataclass
import math
from typing import Any

#: Length of a delay line.
PLACES = 48
#: s: times closer than this count as equal.
_SAME = 1e-9


@dataclass
class DelayLine:
    """Ring buffer of samples of some signals."""

    #: Shape (PLACES,), s, and (PLACES, c).
    times: list[float]
    values: list[list[float]]
    #: Oldest sample, and number of samples.
    head: int = 0
    size: int = 0

    @classmethod
    def empty(cls, signals: int) -> 'DelayLine':
        """Return an empty line for a number of signals."""
        return cls([0.0] * PLACES, [[0.0] * signals for _ in range(PLACES)])


def put(line: Any, time: float, values: Any, delay: float) -> None:
    """
    Put a sample of the signals (c,) into a delay line of a delay, s.

    Samples older than the delay are removed. At most `PLACES` - 4 newer ones are kept: a sample
    that follows the last but one too closely replaces the last.
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
    """Return the place of the newest sample not newer than a time (s); else of the oldest."""
    k, end = 0, line.size - 1
    while k < end and line.times[(line.head + k + 1) % PLACES] <= time + _SAME:
        k += 1
    return k


def read_between(line: Any, time: float, out: Any) -> None:
    """Write the signals at a time (s) to ``out``, linear between samples, constant before them."""
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
    """Write the newest sample not newer than a time (s) to ``out``; zeros before the first."""
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
