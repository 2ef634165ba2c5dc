# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Permission to open the supply: how it is sent and how it is received.

The recruitment controller says on ``supply_enable`` whether the supply may be open: at once when
that changes, and 10 times a second, so that silence withdraws it. What a driver does with
it: docs/how_to/driver.md.
"""

import time

from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode

#: s between two messages that say the same.
PERIOD = 0.1
#: s after which a driver takes silence for false.
TIMEOUT = 0.5


class SupplyEnable:
    """
    Publishes the permission of a node; false at first.

    Parameters
    ----------
    node : BundleNode
    """

    def __init__(self, node: BundleNode):
        self._send = node.sender(interface.SUPPLY_ENABLE, Bool, interface.bool_message)
        self._say(False)
        if not node.lock_step:
            node.every(PERIOD, self._beat)

    def set(self, value: bool) -> None:
        """Say at once whether the supply may be open, where that is new."""
        if value != self.value:
            self._say(value)

    def _beat(self) -> None:
        # A permission that has expired is not renewed here: its owner has to set it again.
        self._say(self.value and time.monotonic() - self._said <= TIMEOUT)

    def _say(self, value: bool) -> None:
        #: What was sent last.
        self.value = value
        self._said = time.monotonic()
        self._send(value)


class Permission:
    """
    Remembers what was heard on ``supply_enable``.

    Parameters
    ----------
    timeout : float, s
        A true counts for so long; infinite in lock-step, where time may stand still.
    """

    def __init__(self, timeout: float):
        self.timeout = timeout
        self._value: bool | None = None
        self._heard = 0.0

    @property
    def heard(self) -> bool:
        """Whether anything was ever heard."""
        return self._value is not None

    def take(self, value: bool) -> bool:
        """Take a message; return whether it says something new."""
        new = value != self._value
        self._value, self._heard = value, time.monotonic()
        return new

    @property
    def given(self) -> bool:
        """Whether the supply may be open now."""
        return bool(self._value) and time.monotonic() - self._heard <= self.timeout
