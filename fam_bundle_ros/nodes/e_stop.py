# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The emergency stop as a node receives it: a True of any publisher stops.

The interface has one publisher of ``e_stop``, which knows about all buttons. Messages do not tell
who sent them: where there are more publishers, a False may come from one that does not know of
another's stop, and is ignored.
"""

from collections.abc import Callable

from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import ERROR, Report


class EmergencyStop:
    """
    Subscribes a node to the emergency stop.

    Parameters
    ----------
    node : BundleNode
    on_stop : callable
        Called when it goes on.

    Attributes
    ----------
    on : bool
    doubt : str
        Why it is still on although a False came; else empty.
    """

    def __init__(self, node: BundleNode, on_stop: Callable[[], None]):
        self._node = node
        self._on_stop = on_stop
        self.on = False
        self.doubt = ''
        node.subscribe(interface.E_STOP, Bool, self.take, interface.LATCHED)

    def take(self, message: Bool) -> None:
        """Take a message."""
        node = self._node
        publishers = node.publisher_count(interface.E_STOP)
        if message.data:
            self.doubt = ''
            if not self.on:
                self.on = True
                self._on_stop()
        elif self.on and publishers > 1:
            self.doubt = (f'{publishers} publishers on e_stop: a stop is taken back only while '
                          'there is one; end the others and reset again')
            node.get_logger().error(self.doubt)
        else:
            self.on, self.doubt = False, ''

    def report(self, report: Report) -> None:
        """Add whether it is on, and what keeps it so."""
        report.value('e_stop', self.on)
        if self.doubt:
            report.add(ERROR, self.doubt)
