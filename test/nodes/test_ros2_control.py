# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The topics as ros2_control's topic-based hardware (JointStateTopicSystem) writes and reads them.

That plugin is C++ and not here: what is tested is our side, with messages, QoS and reading rules
as its source has them.
"""

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator

#: SensorDataQoS of rclcpp.
SENSOR_DATA = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LENGTH = 0.127


class JointStateTopicSystem:
    """One joint with a position command, as `joint_states_topic` and `joint_commands_topic`."""

    def __init__(self, graph, joint, commands):
        self.joint, self.probe = joint, graph.probe
        self.state = self.velocity = None
        self.command = 0.0
        self._publisher = self.probe.create_publisher(
            JointState, 'reference/strain', QoSProfile(depth=1))
        self._commands = commands
        self.probe.create_subscription(JointState, 'strain', self.read, SENSOR_DATA)

    def read(self, message):
        """Take the joint by its name: position, and velocity where the message has any."""
        i = list(message.name).index(self.joint)
        self.state = message.position[i]
        if message.velocity:
            self.velocity = message.velocity[i]
        self.write()

    def write(self):
        """Send what the controllers command; only interfaces of the joint are in it."""
        message = JointState(name=[self.joint, *self._commands], position=[self.command])
        message.header.stamp = self.probe.get_clock().now().to_msg()
        self._publisher.publish(message)


@pytest.fixture
def bundle(graph, quiet):
    """Return a rig with a mass, the controller, and a pacer for time."""
    nodes = make_nodes(graph.context, overrides={
        **quiet, 'lock_step': True, 'start_enabled': True, 'generate': False, 'monitor': False,
        'load.kind': 'mass_spring', 'load_model.force': 49.0, 'load_model.inertia': 0.635,
        'stuck_time': 0.0}, simulator={'script': graph.pacer})
    graph.add(*nodes)
    return next(node for node in nodes if isinstance(node, PlantSimulator))


@pytest.mark.parametrize(('joint', 'unit'), [('contraction', LENGTH), ('strain', 1.0)])
def test_a_position_command_moves_the_bundle(graph, bundle, joint, unit):
    """A prismatic joint `contraction` in m, or `strain`: command in, state out, the same unit."""
    hardware = JointStateTopicSystem(graph, joint, ())
    hardware.command = 0.08 * unit
    graph.advance(bundle, 2.0)
    assert hardware.state == pytest.approx(0.08 * unit, abs=0.004 * unit)
    assert hardware.velocity == pytest.approx(0.0, abs=0.1 * unit)


def test_state_only_joints_beside_the_command_are_refused(graph, bundle):
    """The plugin then sends two names and one position: which one it is, nobody can tell."""
    hardware = JointStateTopicSystem(graph, 'contraction', ('strain',))
    hardware.command = 0.01
    with pytest.raises(InputError, match='contraction, strain with 1 positions'):
        interface.read_strain(JointState(name=['contraction', 'strain'], position=[0.01]), LENGTH)
    graph.advance(bundle, 0.2)
    assert hardware.state is not None
    assert bundle.rig.truth.pressure.max() < 1e3


def test_valve_command_of_an_effort_joint_is_read():
    """Joint mu1_valve with an effort command is a valve command as it stands."""
    message = JointState(name=['mu1_valve'], effort=[0.25])
    assert interface.read_valve(message, 1) == 0.25
