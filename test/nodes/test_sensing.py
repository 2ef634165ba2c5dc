# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Samples put together from their channels, beside a node's other timers."""

from collections import deque
import time

from std_msgs.msg import Bool

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface, sensing
from fam_bundle_ros.nodes.base import BundleNode


def test_samples_that_waited_call_no_timer_more_often_than_its_period(graph):
    """A process that was held up: calls ahead of time would be missing for a second after it."""
    node, samples, calls = BundleNode('rig', sensing.SPECS, context=graph.context), [], []
    graph.add(node)
    heard = sensing.Sensing(node, 1, 0.1, samples.append)
    node.every(0.1, lambda: calls.append(time.monotonic()))
    graph.until(lambda: calls, 'the timer')
    begin = time.monotonic()
    time.sleep(0.25)
    for stamp in range(1, 11):
        for channel, value in (('force', 1.0), ('strain', (0.1, 0.0)), ('mu1', 1e5)):
            heard.put(channel, stamp, value)
    graph.until(lambda: samples, 'a sample')
    graph.spin(0.05)
    assert sum(call > begin for call in calls) <= (time.monotonic() - begin) / 0.1 + 1


def test_each_mistake_in_a_topic_has_its_line_whatever_the_numbers(graph):
    """A second mistake is not hidden by the first; the same one with other numbers is."""
    mistakes = deque(['point 2 is 5 at 1e-3 s', 'point 3 is nan at 2 s', 'has no points'])

    def refuse(message):
        raise InputError(mistakes.popleft())
    graph.probe.subscribe('orders', Bool, refuse, interface.RELIABLE)
    orders = graph.probe.create_publisher(Bool, 'orders', interface.RELIABLE)
    graph.until(lambda: orders.get_subscription_count(), 'the subscription')
    for _ in range(3):
        orders.publish(Bool(data=True))
    graph.until(lambda: not mistakes, 'all')
    assert len([key for key in graph.probe._said if 'orders' in key]) == 2
