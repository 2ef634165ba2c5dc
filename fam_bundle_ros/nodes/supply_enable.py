# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Permission to open the supply: how it is sent and how it is received.

The recruitment controller publishes on ``supply_enable`` whether the supply may be open: at every
change, and 10 times a second (in lock-step with each answer), so that silence withdraws the
permission. For the driver's side see docs/how_to/driver.md.
"""

from collections.abc import Callable
import math
import time

from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode

#: Period of the messages while the value does not change, s.
PERIOD = 0.1
#: Silence after which a driver assumes false, s.
TIMEOUT = 0.5


class SupplyEnable:
    """
    Publishes the permission of a node; false at first.

    Parameters
    ----------
    on_lapse : callable
        Called with the silence (s) after which a true has expired in drivers and pressure loops.
        A new true would release latched pressure loops, as `enable` does, so false is sent first.
    timeout : float, s
        Silence after which a true expires.
    on_contradiction : callable
        Called when another node sends false while this node sends true.
    """

    def __init__(self, node: BundleNode, on_lapse: Callable[[float], None],
                 timeout: float = TIMEOUT, on_contradiction: Callable[[], None] = lambda: None):
        self._send = node.sender(interface.SUPPLY_ENABLE, Bool, interface.bool_message)
        self._on_lapse, self._on_contradiction = on_lapse, on_contradiction
        #: Whether a true was received since this node sends true.
        self._confirmed = False
        # In lock-step time may stand still.
        self._timeout, self._period = (math.inf, 0.0) if node.lock_step else (timeout, PERIOD)
        #: What was sent last.
        self.value = False
        self._said = time.monotonic()
        # In lock-step the first message goes with the first answer. After a false, which only
        # nodes discovered already receive, the run would depend on whether a pressure loop
        # receives the true or its setpoint first.
        if not node.lock_step:
            self._say(False)
            node.every(PERIOD, self.repeat)
            node.subscribe(interface.SUPPLY_ENABLE, Bool, self._hear, interface.REPEATED)

    def _hear(self, message: Bool) -> None:
        # This node's own messages arrive too, in order: its last false before its next true.
        if message.data:
            self._confirmed = self.value
        elif self._confirmed:
            self._on_contradiction()

    def set(self, value: bool) -> None:
        """
        Publish whether the supply may be open: at once if that has changed, else when it is due.

        After the executor was held up, its timer is silent for as long.
        """
        if value == self.value:
            self.repeat()
        elif not self._lapsed():
            self._say(value)

    def repeat(self) -> None:
        """Publish the value again; in lock-step with each answer, in wall time when it is due."""
        if not self._lapsed() and time.monotonic() - self._said >= self._period:
            self._say(self.value)

    def _lapsed(self) -> bool:
        """Detect a true that has expired; publish false then."""
        silence = time.monotonic() - self._said
        if not self.value or silence <= self._timeout:
            return False
        self._say(False)
        self._on_lapse(silence)
        return True

    def _say(self, value: bool) -> None:
        self.value, self._said = value, time.monotonic()
        self._confirmed = self._confirmed and value
        self._send(value)


class Permission:
    """
    Keeps the last message of ``supply_enable``.

    A true is valid for ``timeout`` (s); infinite in lock-step, where time may stand still.
    """

    def __init__(self, timeout: float):
        self.timeout = timeout
        self._value: bool | None = None
        self._heard = 0.0

    @property
    def heard(self) -> bool:
        """Whether a message was ever received."""
        return self._value is not None

    def take(self, value: bool) -> bool:
        """Take a message; return whether the value has changed."""
        new = value != self._value
        self._value, self._heard = value, time.monotonic()
        return new

    @property
    def given(self) -> bool:
        """Whether the supply may be open now."""
        return bool(self._value) and time.monotonic() - self._heard <= self.timeout
