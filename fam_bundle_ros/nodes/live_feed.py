# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A running bundle as lines of JSON, for a program that has no ROS: the page "Live".

``python -m fam_bundle_ros.nodes.live_feed`` writes the values of the topics to standard output,
ten times a second, and reads orders from standard input, a line of JSON each::

    {"call": "diagnose"}
    {"set": "hidden_effect", "of": "plant_simulator", "value": "mesh"}

It ends when standard input does.

Lines have a key ``kind``: ``graph`` (which nodes run), ``sample`` (newest values, with sum of
squares and number of the tracking errors since the last line), ``state`` and ``diagnosis`` (the
messages of ``model/state`` and ``model/diagnosis``), ``answer`` (to an order).
"""

from collections.abc import Callable
from dataclasses import dataclass
import json
import math
import os
from queue import Empty, SimpleQueue
import re
import signal
import sys
from threading import Thread
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, String, UInt8
from std_srvs.srv import SetBool, Trigger

from fam_bundle_ros.jsonfile import plain
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.process import run
from fam_bundle_ros.processes import own_stdout

#: Periods of the samples, of reading orders, and of inspecting the graph, s.
_PERIOD, _POLL, _LOOK = 0.1, 0.05, 1.0
#: Time-out of a service, s.
_PATIENCE = 5.0
#: Services that an order may call, besides `enable`.
CALLS = (interface.DIAGNOSE, interface.APPLY_MODEL, interface.RESTORE_MODEL)
_PRESSURE = re.compile(r'mu(\d+)/pressure')


@dataclass
class PendingCall:
    """An order that waits for its answer until a steady time, s."""

    client: Client
    request: Any
    until: float
    called: bool = False


class LiveFeed(BundleNode):
    """Listens to a bundle, calls ``tell`` with each record; keywords as of `BundleNode`."""

    def __init__(self, tell: Callable[[dict[str, Any]], None], **keywords: Any):
        super().__init__('live_feed', (), **keywords)
        self._tell = tell
        self._newest: dict[str, Any] = {}
        self._pressure: dict[int, float] = {}
        self._setpoint: dict[int, float] = {}
        self._tracking = [0.0, 0]
        self._units: set[int] = set()
        self._pending: dict[str, PendingCall] = {}
        #: Orders from the thread that reads standard input; None at its end.
        self.orders: SimpleQueue[dict[str, Any] | None] = SimpleQueue()
        self.subscribe(interface.FORCE, WrenchStamped, self._on_force)
        self.subscribe(interface.STRAIN, JointState, self._on_strain)
        self.subscribe(interface.REFERENCE_FORCE, WrenchStamped, lambda message: self._refer(
            'force', interface.read_force(message)))
        self.subscribe(interface.REFERENCE_STRAIN, JointState, lambda message: self._refer(
            'strain', interface.read_strain(message, 1.0)[0]))
        # with pressure references there is no tracking error
        self.subscribe(interface.REFERENCE_PRESSURES, JointState, lambda message: self._refer(
            'pressure', math.nan))
        for topic, key in ((interface.MODEL_FORCE, 'model'), (interface.MODEL_RESIDUAL,
                                                              'residual')):
            self.subscribe(topic, WrenchStamped, self._keep(key))
        self.subscribe(interface.RECRUITMENT_STATE, UInt8, lambda message: self._newest.update(
            recruitment=message.data), interface.LATCHED)
        self.subscribe(interface.SUPPLY_ENABLE, Bool, lambda message: self._newest.update(
            supply=message.data), interface.REPEATED)
        for topic, kind in ((interface.MODEL_STATE, 'state'),
                            (interface.MODEL_DIAGNOSIS, 'diagnosis')):
            self.subscribe(topic, String, self._pass_on(kind), interface.LATCHED)
        self.every(_PERIOD, self._sample)
        self.every(_POLL, self._take_orders)
        self.every(_LOOK, self._look)

    # --- topics --------------------------------------------------------------------------------

    def _keep(self, key: str) -> Callable[[WrenchStamped], None]:
        return lambda message: self._newest.__setitem__(key, interface.read_force(message))

    def _pass_on(self, kind: str) -> Callable[[String], None]:
        return lambda message: self._tell({'kind': kind, **json.loads(message.data)})

    def _on_force(self, message: WrenchStamped) -> None:
        self._newest['time'] = interface.stamp_ns(message.header.stamp) * 1e-9
        self._track('force', interface.read_force(message))

    def _on_strain(self, message: JointState) -> None:
        # a rig that gives the contraction alone is shown in m: no rest length is known here
        self._track('strain', interface.read_strain(message, 1.0)[0])

    def _refer(self, kind: str, value: float) -> None:
        if self._newest.get('reference_kind') != kind:
            self._tracking = [0.0, 0]
        self._newest['reference_kind'], self._newest['reference'] = kind, value

    def _track(self, kind: str, value: float) -> None:
        """Take a reading, and its error where it has the reference."""
        self._newest[kind] = value
        if self._newest.get('reference_kind') == kind and math.isfinite(value):
            self._tracking[0] += (value - self._newest['reference']) ** 2
            self._tracking[1] += 1

    def _sample(self) -> None:
        if 'time' not in self._newest:
            return
        squares, count = self._tracking
        self._tracking = [0.0, 0]
        units = sorted(self._pressure)
        self._tell({'kind': 'sample', **self._newest, 'squares': squares, 'count': count,
                    'pressure': [self._pressure[k] for k in units],
                    'setpoint': [self._setpoint.get(k) for k in units]})
        del self._newest['time']

    def _look(self) -> None:
        """Report which nodes run, and subscribe to the pressures of new motor units."""
        space = self.get_namespace().rstrip('/')
        for name, _ in self.get_topic_names_and_types():
            found = _PRESSURE.fullmatch(name.removeprefix(f'{space}/'))
            if found and int(found[1]) not in self._units:
                unit = int(found[1])
                self._units.add(unit)
                for topic, kept in ((interface.pressure_topic(unit), self._pressure),
                                    (interface.setpoint_topic(unit), self._setpoint)):
                    self._listen(topic, unit, kept)
        nodes = {name for name, where in self.get_node_names_and_namespaces()
                 if where.rstrip('/') == space}
        self._tell({'kind': 'graph', 'rig': self.publisher_count(interface.FORCE) > 0,
                    'namespace': space or '/', 'nodes': sorted(nodes - {'live_feed'})})

    def _listen(self, topic: str, unit: int, kept: dict[int, float]) -> None:
        self.subscribe(topic, FluidPressure, lambda message: kept.__setitem__(
            unit, interface.read_pressure(message, self.ambient)))

    # --- orders --------------------------------------------------------------------------------

    def _take_orders(self) -> None:
        for name, order in list(self._pending.items()):
            if not order.called and order.client.service_is_ready():
                order.called = True
                order.client.call_async(order.request).add_done_callback(
                    lambda future, name=name: self._done(name, future.result()))
            elif time.monotonic() > order.until:
                del self._pending[name]
                self.destroy_client(order.client)
                self._answer(name, False, f'{name} did not answer within {_PATIENCE:g} s')
        while True:
            try:
                new = self.orders.get_nowait()
            except Empty:
                return
            if new is None:
                # end as after Ctrl-C, which `run` handles
                os.kill(os.getpid(), signal.SIGINT)
                return
            self._obey(new)

    def _obey(self, order: dict[str, Any]) -> None:
        name = str(order.get('call') or order.get('set'))
        if name in self._pending:
            self._answer(name, False, f'{name} was called already and has not answered yet')
            return
        request: Any
        if 'set' in order:
            client = self.create_client(SetParameters, f"{order['of']}/set_parameters")
            request = SetParameters.Request(parameters=[
                Parameter(name, value=order['value']).to_parameter_msg()])
        elif name == interface.ENABLE:
            client, request = self.create_client(SetBool, name), SetBool.Request(data=True)
        elif name in CALLS:
            client, request = self.create_client(Trigger, name), Trigger.Request()
        else:
            self._answer(name, False, f"'{name}' is not an order; expected one of "
                         f"{', '.join((interface.ENABLE, *CALLS))}")
            return
        self._pending[name] = PendingCall(client, request, time.monotonic() + _PATIENCE)

    def _done(self, name: str, result: Any) -> None:
        entry = self._pending.pop(name, None)
        if entry is None:
            return
        self.destroy_client(entry.client)
        if isinstance(result, (Trigger.Response, SetBool.Response)):
            self._answer(name, result.success, result.message)
        else:
            (one,) = result.results
            self._answer(name, one.successful, one.reason)

    def _answer(self, name: str, success: bool, message: str) -> None:
        self._tell({'kind': 'answer', 'name': name, 'success': success, 'message': message})


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status."""
    out = own_stdout()

    def tell(record: dict[str, Any]) -> None:
        try:
            out.write(json.dumps(plain(record)) + '\n')
        except BrokenPipeError:
            pass  # the reader has ended: standard input ends too

    def make(context: Context) -> list[BundleNode]:
        feed = LiveFeed(tell, context=context)

        def read() -> None:
            for line in sys.stdin:
                feed.orders.put(json.loads(line))
            feed.orders.put(None)

        Thread(target=read, daemon=True).start()
        return [feed]

    return run(make, str(__doc__), args)


if __name__ == '__main__':
    sys.exit(main())
