# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A ROS graph in this process, with a probe that listens, speaks, calls and waits."""

import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy', reason='rclpy is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.process import Spinner
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.resources import config_path

from .board import Pty, Tcp
from .whole_bundle import hold

#: s. Nothing here takes longer on a machine that is busy with other things.
PATIENCE = 60.0


class Pacer:
    """Script of a simulated rig: runs until a condition holds, then halts time; logs all."""

    def __init__(self):
        self.condition = lambda: True
        self.time = 0.0
        self.log = []
        self.on_halt = lambda: None

    def before(self, rig, time, period):
        pass

    def after(self, rig, time, commands):
        self.time = time
        self.log.append((time, rig.truth, list(commands)))
        halt = bool(self.condition())
        if halt:
            self.on_halt()
        return halt


class Graph:
    """Nodes in one executor and a probe among them."""

    def __init__(self, context, namespace=interface.NAMESPACE):
        self.context = context
        self.probe = BundleNode('probe', (), context=context, namespace=namespace)
        self.spinner = None
        self.pacer = Pacer()
        self._nodes = []

    def add(self, *nodes):
        """Take nodes in; they run from the first wait on."""
        self._nodes += nodes
        return nodes[0] if len(nodes) == 1 else nodes

    def listen(self, topic, kind, qos=interface.LOCK_STEP):
        """Return the list into which the topic's messages go."""
        messages = []
        self.probe.create_subscription(kind, topic, messages.append, qos)
        return messages

    def diagnostics(self, node):
        """Return the list into which the states of a node on /diagnostics go."""
        states = []

        def take(message):
            states.extend(each for each in message.status if each.name == f'bundle/{node}')
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', take, interface.LOCK_STEP)
        return states

    def spin(self, seconds=0.02):
        if self.spinner is None:
            self.spinner = Spinner(self.context, [self.probe, *self._nodes])
        self.spinner.spin(seconds)

    def until(self, condition, what, seconds=PATIENCE):
        """Spin until something is so; fail when it takes too long."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                pytest.fail(f'waited {seconds:g} s for: {what}')
            self.spin()

    def advance(self, rig, until, what='the condition', limit=10.0):
        """
        Let a simulator in lock-step (with our pacer) run until a condition, and halt it.

        The condition is looked at after every step; a number is the time to run on. ``limit`` is
        in simulated seconds.
        """
        pacer = self.pacer
        end = pacer.time + (until if isinstance(until, float) else limit)
        condition = (lambda: False) if isinstance(until, float) else until
        pacer.condition = lambda: condition() or pacer.time >= end - 1e-9
        self.spin(0.0)
        pacer.on_halt = self.spinner.interrupt
        rig.halted = False
        rig._publish()
        self.until(lambda: rig.halted, what, 40.0)
        # What is still on its way belongs to the step.
        self.spin(0.02)
        if not isinstance(until, float) and not condition():
            pytest.fail(f'{limit:g} s of simulated time without: {what}')

    def call(self, kind, name, request=None):
        """Call a service and return the answer."""
        client = self.probe.create_client(kind, name)
        self.until(client.service_is_ready, f'the service {name}')
        future = client.call_async(request or kind.Request())
        self.until(future.done, f'the answer of {name}')
        self.probe.destroy_client(client)
        return future.result()

    def enable(self, on=True):
        """Call the service `enable` and return the answer."""
        return self.call(SetBool, 'enable', SetBool.Request(data=on))

    def set(self, node, **values):
        """Set parameters of a node by service; return the results."""
        parameters = [Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
                      for name, value in values.items()]
        return self.call(SetParameters, f'{node}/set_parameters',
                         SetParameters.Request(parameters=parameters)).results

    def enable_supply(self, node, value):
        """Say supply_enable in place of a recruitment controller, until a node has heard it."""
        if not hasattr(self, '_supply_enable'):
            self._supply_enable = self.probe.create_publisher(
                Bool, interface.SUPPLY_ENABLE, interface.RELIABLE)
        self._supply_enable.publish(interface.bool_message(value))
        self.until(lambda: (node._permission.heard and node._permission.given == value)
                   or self._supply_enable.publish(interface.bool_message(value)),
                   'supply_enable')

    def answer_pressures(self, units, setpoint):
        """In lock-step: answer every pressure with a setpoint (a function of unit and s)."""
        for unit in range(1, units + 1):
            publisher = self.probe.create_publisher(
                FluidPressure, interface.setpoint_topic(unit), interface.PUBLISH)

            def answer(message, unit=unit, publisher=publisher):
                stamp = interface.stamp_ns(message.header.stamp)
                value = setpoint(unit, stamp * 1e-9)
                if value is not None:
                    publisher.publish(interface.pressure_message(stamp, value, 101325.0))
            self.probe.create_subscription(
                FluidPressure, interface.pressure_topic(unit), answer, interface.LOCK_STEP)

    def close(self):
        if self.spinner is None:
            self.spin(0.0)
        self.spinner.close()


@pytest.fixture(scope='session')
def paper_bundle():
    """Return the bundle of the paper."""
    return load_model(config_path('models/spie2021.yaml'))


@pytest.fixture
def graph(ros_context):
    """Yield a graph in the namespace /bundle."""
    result = Graph(ros_context)
    yield result
    result.close()


@pytest.fixture
def make_graph(ros_context):
    """Return a function that makes graphs in other namespaces of the same domain."""
    graphs = []

    def make(namespace):
        graphs.append(Graph(ros_context, namespace))
        return graphs[-1]
    yield make
    for each in graphs:
        each.close()


@pytest.fixture
def start():
    """Return a function that starts an executable as its console script does."""
    def start(node, *arguments):
        return subprocess.Popen(
            [sys.executable, '-c', f'import sys; from fam_bundle_ros.nodes.{node} import main; '
             f'sys.argv[0] = "{node}"; sys.exit(main())', *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return start


@pytest.fixture
def quiet():
    """Return parameters of a rig without noise, running from the start."""
    return {'start_stopped': False, 'sensors.force_noise': 0.0, 'sensors.pressure_noise': 0.0,
            'sensors.strain_noise': 0.0, 'load.kind': 'dynamometer', 'load.strain': 0.1,
            # The simulator's clock is not that of the machine when that is busy.
            'clocks_synchronised': False}


@pytest.fixture
def bare(quiet):
    """Return the same for a rig whose supply waits for no permission."""
    return {**quiet, 'obey_supply_enable': False}


def with_noise(quiet, overrides, **values):
    """Return parameters of a whole bundle whose sensors have the noise of real ones."""
    return {**quiet, 'sensors.force_noise': 0.9, 'sensors.pressure_noise': 350.0,
            'sensors.strain_noise': 5e-5, 'monitor': False, 'start_enabled': True, **values,
            **{name.replace('__', '.'): value for name, value in overrides.items()}}


def added(graph, nodes):
    """Take a bundle's nodes in; return the rig and the controller."""
    graph.add(*nodes)
    return nodes[-1], next(node for node in nodes if isinstance(node, RecruitmentNode))


@pytest.fixture
def bundle(graph, quiet):
    """Return a function: a whole bundle in lock-step on a profile, with our pacer."""
    def start(profile=None, **overrides):
        values = with_noise(quiet, overrides, lock_step=True, wait_for_reference=True,
                            lock_step_timeout=0.5)
        return added(graph, make_nodes(graph.context, overrides=values,
                                       simulator={'script': graph.pacer},
                                       generator={'profile': profile or hold(40.0)}))
    return start


@pytest.fixture
def live(graph, quiet):
    """Return a function: a bundle in wall time, enabled, that the test gives references."""
    def start(**overrides):
        # Being held up by other tests is not what it is about.
        values = with_noise(quiet, overrides, generate=False, trip_pressure=1e6,
                            sensor_timeout=5.0, setpoint_timeout=5.0, command_timeout=5.0)
        return added(graph, make_nodes(graph.context, overrides=values))
    return start


@pytest.fixture(params=[Pty, Tcp], ids=['pty', 'tcp'])
def any_port(request, tmp_path):
    """Yield a serial port and then a TCP port."""
    port = request.param(tmp_path)
    yield port
    port.close()


@pytest.fixture
def port(tmp_path):
    """Yield a serial port."""
    port = Pty(tmp_path)
    yield port
    port.close()
