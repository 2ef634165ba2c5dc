# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""How references move: between messages, and where the message has no room to say it."""

from dataclasses import replace

from fam_bundle_ros.control import Reference

#: References that come less often than this, s, are steps.
_PAUSE = 0.5
#: Messages late by more than this share of their interval have stopped.
_LATE = 1.5


class ReferenceRate:
    """Works out how fast a force reference moves: a wrench has no room to say it."""

    def __init__(self, step: float):
        self._step = step
        self._last: tuple[int, float] | None = None
        self._rate = 0.0

    def update(self, stamp: int, value: float) -> float:
        """Return the rate, N/s; 0 after a step or a pause."""
        last, self._last = self._last, (stamp, value)
        if last is None or not 0 < stamp - last[0] <= 100_000_000:
            if last is None or stamp != last[0]:
                self._rate = 0.0
            return self._rate
        dt = (stamp - last[0]) * 1e-9
        change = value - last[1]
        self._rate = change / dt if abs(change - self._rate * dt) <= self._step else 0.0
        return self._rate


class MovingReference:
    """
    The last reference, moved on while the next one is under way.

    Controllers tick more often than references come: held, a ramp would be stairs.

    Attributes
    ----------
    last : Reference or None
        As it came.
    """

    def __init__(self) -> None:
        self.last: Reference | None = None
        self._came = self._interval = 0.0

    def take(self, reference: Reference, now: float) -> None:
        """Take a reference that came ``now``, s."""
        interval = now - self._came
        self._interval = interval if self.last and 0.0 < interval <= _PAUSE else 0.0
        self.last, self._came = reference, now

    def at(self, now: float) -> Reference | None:
        """Return the reference of this moment: on along its rate until the next is overdue."""
        reference, age = self.last, max(now - self._came, 0.0)
        if reference is None or reference.rate == 0.0:
            return reference
        if age > _LATE * self._interval:
            return replace(reference, rate=0.0)
        ahead = reference.rate * min(age, self._interval)
        return replace(reference, value=reference.value + ahead)
