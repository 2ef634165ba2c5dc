# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressures and a dynamometer that are asked for by themselves, as experiments do."""

from geometry_msgs.msg import WrenchStamped
import pytest
from sensor_msgs.msg import JointState

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator


class Experimenter:
    """Answers every sample in lock-step with a reference: a force, or pressures."""

    def __init__(self, graph, ask):
        self.ask = ask
        self.force = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
        self.pressures = graph.probe.create_publisher(JointState, 'reference/pressures', 10)
        self.write = interface.reference_pressures_writer(2)
        graph.probe.create_subscription(WrenchStamped, 'force', self.answer, interface.LOCK_STEP)

    def answer(self, message):
        stamp, asked = interface.stamp_ns(message.header.stamp), self.ask
        if isinstance(asked, tuple):
            self.pressures.publish(self.write(stamp, asked))
        else:
            self.force.publish(interface.force_message(stamp, asked))


def test_pressures_pass_the_same_door_without_a_bump_and_within_limits(graph, bundle):
    """Force to pressures and back without a jump; beyond a limit, refused."""
    rig, node = bundle(generate=False)
    asking = Experimenter(graph, 60.0)
    graph.advance(rig, 1.0)
    before = rig.rig.truth.pressure
    asking.ask = (200e3, 120e3)
    graph.advance(rig, 0.02)
    assert node.setpoints == pytest.approx(before.tolist(), abs=0.15 * 200e3)
    graph.advance(rig, 0.6)
    assert node.setpoints == [200e3, 120e3]
    assert rig.rig.truth.pressure == pytest.approx([200e3, 120e3], abs=2e3)
    assert node.command.state == 2
    # refused: the last reference goes on once nobody waits for another
    asking.ask = (400e3, 0.0)
    graph.advance(rig, 0.01)
    assert node.setpoints == [200e3, 120e3]
    asking.ask = (200e3, 120e3)
    graph.advance(rig, 0.5)
    pulled = rig.rig.truth.force
    asking.ask = float(pulled)
    graph.advance(rig, 0.05)
    assert rig.rig.truth.force == pytest.approx(pulled, abs=6.0)
    asking.ask = (100e3, 0.0)
    graph.advance(rig, 0.5)
    graph.set('plant_simulator', faults__nan='force')
    graph.advance(rig, 0.02)
    assert (node._guard.word, node.setpoints) == ('HOLD', [100e3, 0.0])
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')


def test_dynamometer_of_the_simulator_goes_where_it_is_told(graph, bundle):
    """A ramp by messages is a ramp of the rig: strain within a step of it, and its rate."""
    rig, _ = bundle(generate=False)
    asking = Experimenter(graph, (50e3, 0.0))
    publisher = graph.probe.create_publisher(JointState, 'reference/dynamometer', 10)
    begun = []

    def move(message):
        stamp = interface.stamp_ns(message.header.stamp)
        begun.append(stamp)
        time = (stamp - begun[0]) * 1e-9
        publisher.publish(interface.reference_strain_writer()(stamp, 0.1 + 0.05 * time, 0.05))
    graph.probe.create_subscription(WrenchStamped, 'force', move, interface.LOCK_STEP)
    graph.advance(rig, 1.0)
    assert asking.ask[0] == 50e3
    moved = [truth for time, truth, _ in graph.pacer.log if time > 0.2]
    rates = [(b.strain - a.strain) / 5e-3 for a, b in zip(moved, moved[1:])]
    assert rates == pytest.approx([0.05] * len(rates), rel=0.02)
    # a step later than the message, and moving on evenly, not in jumps with rests
    assert rig.rig.truth.strain == pytest.approx(
        0.1 + 0.05 * ((begun[-1] - begun[0]) * 1e-9 + 5e-3), abs=5e-5)
    assert {round(truth.strain_rate, 3) for truth in moved} == {0.05}


def test_a_profile_stands_back_while_messages_move_the_dynamometer(graph, bare):
    """It is back a second after the last message, no faster than the dynamometer goes."""
    node = graph.add(PlantSimulator(context=graph.context, overrides={
        **bare, 'lock_step': True, 'load.strain': 0.04, 'load.repeat': True, 'load.speed': 0.2,
        'load.profile': 'trajectories/live_strain.yaml'}))
    for k in range(200):
        node._imposed._take(interface.reference_strain_writer()(k, 0.02, 0.0))
        node._step([-1.0, -1.0])
    assert node.rig.truth.strain == pytest.approx(0.02)
    strain = []
    for _ in range(800):
        node._step([-1.0, -1.0])
        strain.append(node.rig.truth.strain)
    assert strain[:190] == pytest.approx([0.02] * 190)
    assert max(abs(b - a) for a, b in zip(strain, strain[1:])) <= 0.2 * 5e-3 * 1.001
    # the profile is as if nothing had been: at 5 s of its 2 s it is in its middle
    assert strain[-1] == pytest.approx(0.15, abs=1e-3)
