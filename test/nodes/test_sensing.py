# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Samples put together from their channels, beside a node's other timers."""

import time

from fam_bundle_ros.nodes import sensing
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
