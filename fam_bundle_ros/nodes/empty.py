# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Nodes that send and receive the messages of the bundle's nodes without computing anything.

They show the limit of rclpy and the middleware: `fam_bundle bench` measures them beside the
bundle's own nodes in the same graph. Messages are made once; only their stamp is rewritten.
"""

from collections.abc import Callable
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface

#: Pressures that the empty rig shows and that the empty controller commands, Pa (gauge).
PRESSURE, SETPOINT = 100e3, 100.5e3
_AMBIENT = 101325.0


class Relay(Node):
    """
    A node that answers a set of messages with a set of messages.

    Once each topic of ``awaited`` has brought a message of the same stamp, ``outputs`` are sent
    with it; with a ``period`` (s) other than 0, on a timer instead. The topics of ``heard`` are
    received and ignored. ``qos`` is that of the subscriptions.
    """

    def __init__(self, name: str, awaited: dict[str, Any], heard: dict[str, Any],
                 outputs: dict[str, Any], qos: Any, period: float, context: Context,
                 namespace: str):
        super().__init__(name, context=context, namespace=namespace)
        self._qos = qos
        self._awaited = frozenset(awaited)
        self._missing = set(awaited)
        self._now = -1
        self._outputs = [(self.publisher(topic, type(message)), message)
                         for topic, message in outputs.items()]
        self._status = self.publisher(interface.DIAGNOSTICS, DiagnosticArray)
        for topic, kind in awaited.items():
            self.subscribe(topic, kind, self._taker(topic))
        for topic, kind in heard.items():
            self.subscribe(topic, kind, lambda message: None)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, lambda: self._status.publish(DiagnosticArray()), clock=steady)
        if period:
            self.create_timer(period, self.send, clock=steady)

    def publisher(self, topic: str, kind: Any) -> Any:
        """Return a publisher with the bundle's QoS."""
        return self.create_publisher(kind, topic, interface.PUBLISH)

    def subscribe(self, topic: str, kind: Any, callback: Callable[[Any], None]) -> Any:
        """Subscribe with the QoS of this node."""
        qos = interface.LATCHED if topic == interface.E_STOP else self._qos
        return self.create_subscription(kind, topic, callback, qos)

    def send(self, stamp: Any = None) -> None:
        """Send all outputs with ``stamp``, by default the present time."""
        if stamp is None:
            stamp = self.get_clock().now().to_msg()
        for publisher, message in self._outputs:
            message.header.stamp = stamp
            publisher.publish(message)

    def _taker(self, topic: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            stamp = message.header.stamp
            # The nanoseconds alone tell stamps apart: no period is a multiple of a second.
            if stamp.nanosec != self._now:
                self._now = stamp.nanosec
                self._missing.update(self._awaited)
            self._missing.discard(topic)
            if not self._missing:
                self.answer(stamp)
        return take

    def answer(self, stamp: Any) -> None:
        """Answer the messages of a stamp."""
        self.send(stamp)


class EmptyRig(Relay):
    """The sender of samples; in lock-step each set of valve commands brings the next one."""

    def __init__(self, units: int, rate: float, lock_step: bool, context: Context,
                 namespace: str):
        self._period = round(1e9 / rate)
        self._stamp = 0
        valves = {interface.valve_topic(k): JointState for k in _count(units)}
        outputs: dict[str, Any] = {
            interface.STRAIN: interface.strain_message(0, 0.1, 0.0, 0.127),
            **{interface.pressure_topic(k): interface.pressure_message(
                0, PRESSURE, _AMBIENT, f'mu{k}') for k in _count(units)},
            interface.FORCE: interface.force_message(0, 50.0),
            interface.SUPPLY: interface.pressure_message(0, 5e5, _AMBIENT)}
        super().__init__('empty_rig', valves if lock_step else {}, {} if lock_step else valves,
                         outputs, interface.stream_qos(lock_step),
                         0.0 if lock_step else 1.0 / rate, context, namespace)
        if lock_step:
            # Repeated until the first answer: subscribers may not have been discovered yet.
            self.create_timer(0.2, self._begin, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def answer(self, stamp: Any) -> None:
        """Send the next sample; late answers to one that was sent again are ignored."""
        if interface.stamp_ns(stamp) == self._stamp:
            self._stamp += self._period
            self.send(interface.to_stamp(self._stamp))

    def _begin(self) -> None:
        if self._stamp == 0:
            self.send(interface.to_stamp(0))


def _count(units: int) -> range:
    return range(1, units + 1)


def empty_node(role: str, units: int, lock_step: bool, context: Context,
               namespace: str) -> Relay:
    """
    Return the empty counterpart of a node.

    ``role`` is its name: ``recruitment_controller``, ``model_monitor``, ``reference_generator`` or
    ``pressure_pid_mu1``, ``pressure_pid_mu2``, ...
    """
    awaited: dict[str, Any] = {
        interface.FORCE: WrenchStamped, interface.STRAIN: JointState,
        **{interface.pressure_topic(k): FluidPressure for k in _count(units)}}
    heard: dict[str, Any] = {}
    #: Awaited in lock-step, else heard.
    others: dict[str, Any] = {}
    if role == 'recruitment_controller':
        heard = {interface.REFERENCE_STRAIN: JointState, interface.E_STOP: Bool}
        others = {interface.REFERENCE_FORCE: WrenchStamped}
        outputs: dict[str, Any] = {
            interface.setpoint_topic(k): interface.pressure_message(0, SETPOINT, _AMBIENT)
            for k in _count(units)}
        outputs[interface.RECRUITMENT] = interface.recruitment_writer(units)(
            0, [True] * units, [1.0 / units] * units)
    elif role == 'model_monitor':
        outputs = {interface.MODEL_FORCE: interface.force_message(0, 50.0),
                   interface.MODEL_RESIDUAL: interface.force_message(0, 0.0)}
    elif role == 'reference_generator':
        awaited, heard = {interface.FORCE: WrenchStamped}, {interface.STRAIN: JointState}
        outputs = {interface.REFERENCE_FORCE: interface.force_message(0, 50.0)}
    else:
        unit = int(role.removeprefix('pressure_pid_mu'))
        awaited, heard = {interface.pressure_topic(unit): FluidPressure}, {interface.E_STOP: Bool}
        others = {interface.setpoint_topic(unit): FluidPressure,
                  interface.STRAIN: JointState, interface.SUPPLY: FluidPressure}
        outputs = {interface.valve_topic(unit): interface.valve_message(0, unit, 0.1)}
    (awaited if lock_step else heard).update(others)
    return Relay(f'empty_{role}', awaited, heard, outputs, interface.stream_qos(lock_step), 0.0,
                 context, namespace)


def roles(units: int) -> list[str]:
    """Return the nodes of a bundle besides its rig, in the order in which they are started."""
    return [*(f'pressure_pid_mu{k}' for k in _count(units)), 'recruitment_controller',
            'model_monitor', 'reference_generator']


def main() -> None:
    """Run one empty node, ROLE UNITS LOCK_STEP NAMESPACE, until it is killed."""
    role, units, lock_step, namespace = sys.argv[1:]
    context = Context()
    rclpy.init(context=context)
    executor = EventsExecutor(context=context)
    executor.add_node(empty_node(role, int(units), lock_step == 'True', context, namespace))
    never: Future = Future(executor=executor)
    while context.ok():
        executor.spin_until_future_complete(never, timeout_sec=0.1)


if __name__ == '__main__':
    main()
