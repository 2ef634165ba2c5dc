# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Base class of the nodes: parameters, time, QoS, error lines, a safe stop."""

from collections.abc import Callable, Sequence
import inspect
import math
import re
import sys
import time
from typing import Any

from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import (
    PublisherEventCallbacks,
    QoSOfferedIncompatibleQoSInfo,
    QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import qos_policy_name_from_kind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.parameters import Parameters, Spec

#: Parameters of all nodes.
COMMON = (
    Spec('lock_step', False, 'step with the simulator: answer every stamp exactly once, with '
         'readings of that stamp only'),
    Spec('lock_step_timeout', 4.0, 'wall time after which a missing message of the loop counts '
         'as lost, s; pressure loops wait 1.5, the simulator 2.5 times as long', 0.1, 600.0),
    Spec('ambient_pressure', 101325.0, 'ambient pressure, Pa absolute', 30e3, 200e3),
)
#: Parameters of the nodes that listen to a rig.
LISTENER = (
    Spec('pressure_is_gauge', False, 'the rig sends gauge pressure, although FluidPressure is '
         'absolute by definition'),
    Spec('rate', 200.0, 'samples per second that the rig is expected to send', 1.0, 2000.0),
)
#: Hint for a pressure that, as an absolute one, would be far below a vacuum.
GAUGE = 'does the driver send gauge pressure (then pressure_is_gauge) or another unit than Pa?'
#: Parameters of the nodes that act on what a rig sends.
LATENCY = (
    Spec('clocks_synchronised', True, 'the clocks of rig and controllers agree: readings that are '
         'late by their stamps are refused'),
    Spec('max_latency', -1.0, 'largest age of a reading on arrival, s; -1: three sample periods '
         'of `rate`', -1.0, 60.0),
)
MODEL = Spec('model', 'models/spie2021.yaml', 'model file: a path, or the name of one that ships')

#: Period of repeated warnings in the log, s; diagnostics have them every second.
REMIND = 60.0
_NUMBER = re.compile(r'[-+]?(\d[\d.]*(e[-+]?\d+)?|inf|nan)')


class BundleNode(Node):
    """
    A node with a table of parameters.

    Parameters
    ----------
    specs : sequence of Spec
        Besides the common ones.
    namespace : str
        Overruled by ``__ns`` on the command line.
    overrides : dict, optional
        Parameter values that win over those of the command line.

    Raises
    ------
    InputError
        When a parameter is wrong.
    """

    def __init__(self, name: str, specs: Sequence[Spec], *, context: Context | None = None,
                 namespace: str = interface.NAMESPACE, overrides: dict[str, Any] | None = None):
        super().__init__(
            name, context=context, namespace=namespace,
            parameter_overrides=[Parameter(k, value=v) for k, v in (overrides or {}).items()])
        # For the first line of a log rclpy has `inspect` look through all modules, 30 to 100 ms:
        # now, so that the first fault does not wait for its line.
        inspect.getframeinfo(sys._getframe())
        self._said: dict[str, float] = {}
        #: For each topic, number of messages refused since the last report, and the last reason.
        self.refused: dict[str, tuple[int, str]] = {}
        self._streams: list[Publisher] = []
        try:
            self.p = Parameters(self, (*COMMON, *specs))
        except InputError:
            self.destroy_node()
            raise
        self.lock_step: bool = self.p['lock_step']
        self.ambient: float = self.p['ambient_pressure']
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        clock = self.get_clock()
        assert isinstance(clock, ROSClock)
        self._ros_clock = clock

    # --- for derived nodes ---------------------------------------------------------------------

    def stop(self) -> None:
        """Publish the safe state; called once, before the node is destroyed."""

    def flush(self, deadline: float) -> None:
        """Wait until all messages are acknowledged, to a steady time ``deadline`` (s) at most."""
        for publisher in self._streams:
            left = max(deadline - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(nanoseconds=int(left * 1e9)))

    def publisher(self, topic: str, kind: Any, qos: QoSProfile = interface.PUBLISH) -> Publisher:
        """Return a publisher; users may override its QoS, incompatible QoS is logged."""
        publisher = self.create_publisher(
            kind, topic, qos, qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=PublisherEventCallbacks(
                incompatible_qos=lambda event: self._misfit(topic, event)))
        if topic != interface.DIAGNOSTICS:
            self._streams.append(publisher)
        return publisher

    def withdraw(self, publisher: Publisher) -> None:
        """End a publisher, so that another node may be the only one of its topic."""
        self._streams.remove(publisher)
        self.destroy_publisher(publisher)

    def sender(self, topic: str, kind: Any, write: Callable[..., Any],
               qos: QoSProfile = interface.PUBLISH) -> Callable[..., None]:
        """Return a function that publishes the message that ``write`` makes of its arguments."""
        publish = self.publisher(topic, kind, qos).publish
        return lambda *values: publish(write(*values))

    def announcer(self, topic: str, kind: Any, write: Callable[[Any], Any]
                  ) -> Callable[[Any], None]:
        """Return a function that publishes a value, latched, if it is not the one before."""
        send, last = self.sender(topic, kind, write, interface.LATCHED), None

        def announce(value: Any) -> None:
            nonlocal last
            if value != last:
                last = value
                send(value)
        return announce

    def subscribe(self, topic: str, kind: Any, callback: Callable[[Any], Any],
                  qos: QoSProfile | None = None, each: bool = False) -> Subscription:
        """
        Return a subscription; a message that cannot be read is logged, reported and dropped.

        The default QoS is that for samples and commands. In a stream of them, errors that differ
        only in a number are logged as the same error; with ``each``, for messages that are sent
        by hand, every different one is logged.
        """
        def guarded(message: Any) -> None:
            try:
                callback(message)
            except InputError as error:
                same = str(error) if each else _NUMBER.sub('', str(error))
                self.say(f'bad {topic} {same}', f'{topic}: {error}')
                self.refused[topic] = self.refused.get(topic, (0, ''))[0] + 1, str(error)

        return self.create_subscription(
            kind, topic, guarded, qos or interface.stream_qos(self.lock_step),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=lambda event: self._misfit(topic, event)))

    def trigger(self, name: str, act: Callable[[], str]) -> None:
        """Offer a Trigger service: ``act`` returns the answer, or raises InputError on failure."""
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.success, response.message = True, act()
            except InputError as error:
                response.success, response.message = False, str(error)
            return response
        self.create_service(Trigger, name, answer)

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call back periodically on the steady clock, as simulated time may stand still."""
        return self.create_timer(period, callback, clock=self._steady)

    def publisher_count(self, topic: str) -> int:
        """Return the number of publishers of a topic, this node's own included."""
        return self.count_publishers(self.resolve_topic_name(topic))

    @property
    def max_latency(self) -> float:
        """Largest age of a reading on arrival, s; infinite where clocks may differ."""
        if self.lock_step or not self.p['clocks_synchronised']:
            return math.inf
        given: float = self.p['max_latency']
        return given if given >= 0.0 else 3.0 / self.p['rate']

    def latency(self, stamp: int) -> float:
        """Return the present age of a stamp (ns), s."""
        return (self.now_ns() - stamp) * 1e-9

    def now_ns(self) -> int:
        """Return the node's ROS time in ns."""
        # Without simulated time this is the system time, which rclpy reads ten times as slowly.
        clock = self._ros_clock
        return clock.now().nanoseconds if clock.ros_time_is_active else time.time_ns()

    def say(self, key: str, text: str, interval: float = 5.0) -> None:
        """Log a warning, at most once per interval for each key."""
        now = time.monotonic()
        if now - self._said.get(key, -interval) >= interval:
            self._said[key] = now
            self.get_logger().warning(text)

    def _misfit(self, topic: str, event: QoSOfferedIncompatibleQoSInfo
                | QoSRequestedIncompatibleQoSInfo) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self.say(f'qos {topic}', f'{topic}: {event.total_count} endpoint(s) offer or ask for an '
                 f'incompatible QoS ({policy}); no messages flow to or from them')
