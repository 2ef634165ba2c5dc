# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Lock-step: collects the messages of one stamp. No ROS.

Every node of the loop answers a stamp once it has all messages of that stamp, so that the run does
not depend on the order in which they arrive. A channel that is silent for too long is lost: nodes
do not wait for it until it returns, and treat its value as stale.
"""

from collections.abc import Iterable
import time
from typing import Any


class Gate:
    """
    Waits until all channels carry the same stamp.

    Examples
    --------
    >>> gate = Gate(['force', 'strain'])
    >>> gate.put('force', 5, 120.0)
    False
    >>> gate.put('strain', 5, 0.1)
    True
    >>> gate.stamp, gate.value('force')
    (5, 120.0)
    """

    def __init__(self, channels: Iterable[str]):
        self._latest: dict[str, tuple[int, Any]] = dict.fromkeys(channels, (-1, None))
        #: Channels that are not waited for.
        self.lost: set[str] = set()
        self._missing = set(self._latest)
        #: Newest stamp that any channel carries; -1 before the first.
        self.stamp = -1
        #: Steady time at which that stamp came, s.
        self._since = time.monotonic()
        #: Whether all channels have arrived together once.
        self.begun = False

    def put(self, channel: str, stamp: int, value: Any) -> bool:
        """
        Take a value and its stamp, ns; return whether all values of the newest stamp have arrived.

        A stamp before the newest restarts time (the simulator was reset) if its channel carried
        the newest stamp; otherwise the value is late, and only shows that the channel is back.
        """
        self.lost.discard(channel)
        before = self._latest[channel][0]
        self._latest[channel] = (stamp, value)
        if stamp > self.stamp or stamp < before == self.stamp:
            self.stamp, self._since = stamp, time.monotonic()
            self._missing = set(self._latest) - self.lost
        if stamp != self.stamp:
            self._missing.add(channel)
            return False
        self._missing.discard(channel)
        done = not self._missing
        self.begun = self.begun or done
        return done

    @property
    def missing(self) -> list[str]:
        """Channels that are waited for."""
        return [name for name in self._latest if name in self._missing]

    def overdue(self, patience: float) -> list[str]:
        """Give up channels that the newest stamp has waited for longer than ``patience`` (s)."""
        waited = time.monotonic() - self._since
        return self.give_up() if self.begun and waited > patience else []

    def give_up(self) -> list[str]:
        """Mark the channels that are waited for as lost and return them."""
        missing = self.missing
        self.lost.update(missing)
        self._missing.clear()
        return missing

    def value(self, channel: str, missing: Any = None) -> Any:
        """Return a channel's value of the newest stamp, or ``missing`` where it has none."""
        stamp, value = self._latest[channel]
        return value if stamp == self.stamp else missing
