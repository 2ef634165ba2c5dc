# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The emergency stop as a node receives it: True from any publisher stops.

There should be one publisher of ``e_stop``, which knows about all buttons. Messages do not name
their sender: with several publishers, a False may come from one that does not know about
another's stop, so it is ignored.
"""

from collections.abc import Callable
import math
import time

from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import ERROR, Report

#: What is wrong with a publisher of which nothing arrives.
UNHEARD = ('e_stop has a publisher, but nothing was received: it must be reliable and transient '
           'local, and publish once at start')


class EmergencyStop:
    """Subscribes a node to the emergency stop; ``on_stop`` is called when it is activated."""

    def __init__(self, node: BundleNode, on_stop: Callable[[], None]):
        self._node = node
        self._on_stop = on_stop
        self.on = False
        #: Why the stop is still on after a False; else empty.
        self.doubt = ''
        self._heard = False
        #: Publishers when the stop was activated; time since which it is off, s.
        self._publishers, self._off_since = 0, -math.inf
        node.subscribe(interface.E_STOP, Bool, self.take, interface.E_STOP_HEARD)

    def take(self, message: Bool) -> None:
        """Take a message."""
        self._heard = True
        node = self._node
        publishers = node.publisher_count(interface.E_STOP)
        if message.data:
            self.doubt = ''
            if not self.on:
                self.on, self._publishers = True, publishers
                self._on_stop()
        elif self.on and publishers > 1:
            self.doubt = (f'it was reset while e_stop had {publishers} publishers, and is taken '
                          'back only from one; when the others have ended (a killed one after '
                          '20 s), stop and reset once more')
            node.get_logger().error(self.doubt)
        elif self.on:
            self.on, self.doubt, self._off_since = False, '', time.monotonic()

    @property
    def why(self) -> str:
        """Why the stop is on, and what helps if it cannot be taken back; empty while it is off."""
        if not self.on:
            return ''
        gone = self._node.publisher_count(interface.E_STOP) < self._publishers
        return ': '.join(filter(None, (
            'the emergency stop is on', self.doubt or (
                'a node that published e_stop has ended; stop and reset once more' if gone else '')
        )))

    def is_off_for(self, seconds: float) -> bool:
        """Return whether the stop has been off for a time, s; true if it never was on."""
        return not self.on and time.monotonic() - self._off_since > seconds

    def unheard(self) -> str:
        """Return why a stop would not be noticed; empty while the publisher is heard."""
        if not self._node.publisher_count(interface.E_STOP):
            # The next publisher has to say its state, too.
            self._heard = False
            return 'e_stop has no publisher'
        return '' if self._heard else UNHEARD

    def report(self, report: Report) -> None:
        """Add whether the stop is on, and what prevents its release."""
        report.value('e_stop', self.on)
        if self.doubt:
            report.add(ERROR, self.doubt)
