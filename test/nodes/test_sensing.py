# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Samples put together from their channels, beside a node's other timers."""

from collections import deque
import math
import time

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface, sensing
from fam_bundle_ros.nodes.base import BundleNode, LISTENER
from fam_bundle_ros.nodes.diagnostics import Report
from fam_bundle_ros.nodes.model_monitor import ModelMonitor
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.units import FASTEST


def test_samples_that_waited_call_no_timer_more_often_than_its_period(graph):
    """A process that was held up: calls ahead of time would be missing for a second after it."""
    node, samples, calls = BundleNode('rig', LISTENER, context=graph.context), [], []
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


@pytest.mark.parametrize('velocity', [[], [math.nan], [math.inf], [-math.inf], [100.0], [-1.1]])
def test_a_velocity_that_no_muscle_has_is_as_good_as_none(graph, velocity):
    """The strain is differentiated then, and the log says why: mm/s for a position in m?"""
    node = graph.add(BundleNode('rig', LISTENER, context=graph.context))
    heard = sensing.Sensing(node, 1, 0.1, lambda sample: None)
    for k in range(20):
        message = JointState(name=['contraction'], position=[1e-3 * k], velocity=velocity)
        message.header.stamp = interface.to_stamp(k * 10**7)
        strain, rate = heard._read_strain(message)
    assert strain == pytest.approx(0.19)
    assert rate == pytest.approx(1.0, rel=1e-6)
    assert ('velocity' in node._said) == (velocity != [] and not math.isnan(velocity[0]))


@pytest.mark.parametrize('rate', [0.0, 0.5])
def test_a_spike_leaves_no_trace_in_the_rate_of_a_strain(rate):
    """At rest and in motion: two spikes in a second, and a jump that stays, a sample late."""
    differentiated = sensing.StrainRate()

    def rates(begin, spikes, jump=0.0):
        return [differentiated.update(k * 5_000_000, rate * k * 5e-3 + jump + spikes.get(k, 0.0))
                for k in range(begin, begin + 200)]
    assert rates(0, {50: 0.04, 120: -0.2})[40:] == pytest.approx([rate] * 160, abs=1e-3)
    jumped = rates(200, {}, 0.02)
    assert jumped[0] == pytest.approx(rate)
    assert jumped[1] > rate + 1.0
    assert jumped[-1] == pytest.approx(rate)


@pytest.mark.parametrize('velocity', [[], [100.0]])
def test_a_strain_that_moves_faster_than_any_muscle_is_no_reading(graph, velocity):
    """Percent for a ratio: near zero each reading is one that a muscle may have."""
    node = graph.add(BundleNode('rig', LISTENER, context=graph.context))
    heard = sensing.Sensing(node, 1, 0.1, lambda sample: None)

    def strains(step):
        for k in range(20):
            message = JointState(name=['contraction'], position=[0.1 * step * k],
                                 velocity=velocity)
            message.header.stamp = interface.to_stamp(k * 10**7)
            yield heard._read_strain(message)[0]
    assert all(math.isfinite(strain) for strain in strains(0.9 * FASTEST * 0.01))
    assert 'fast' not in node._said
    assert math.isnan(list(strains(3.0 * FASTEST * 0.01))[-1])
    assert 'fast' in node._said


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


def test_diagnostics_of_each_node_say_why_it_refuses_a_reading(graph):
    """The driver's author sees which joint is missing, until the readings are right."""
    graph.add(PressurePidNode(1, context=graph.context), RecruitmentNode(context=graph.context),
              ModelMonitor(context=graph.context))
    states = [graph.diagnostics(name) for name in
              ('pressure_pid_mu1', 'recruitment_controller', 'model_monitor')]
    strain = graph.probe.create_publisher(JointState, 'strain', 10)

    def told(joint):
        strain.publish(JointState(name=[joint], position=[0.1]))
        return [bool(state) and state[-1].level > b'\x00' and
                "refused: a strain message names the joints foo; expected 'strain' or "
                "'contraction'" in state[-1].message for state in states]
    graph.until(lambda: all(told('foo')), 'the reason')
    graph.until(lambda: not any(told('strain')), 'diagnostics without it')


@pytest.mark.parametrize(('rate', 'told'), [(200.0, True), (15.0, False), (1.0, True)])
def test_a_driver_that_is_far_off_its_parameter_is_told(graph, rate, told):
    """At 20 readings a second at most, which every second interval of `rate` would miss."""
    node = graph.add(BundleNode('rig', LISTENER, context=graph.context,
                                overrides={'rate': rate}))
    heard, report = sensing.Sensing(node, 1, 0.1, lambda sample: None), Report()
    for _ in range(8):
        heard.meters['force'].tick()
        graph.spin(0.05)
    heard.report(report)
    assert ('the parameter rate says' in ' '.join(report.messages)) == told
    assert ('force rate' in node._said) == told
    # a channel that was never there is told by the watches
    assert 'strain comes' not in ' '.join(report.messages)
