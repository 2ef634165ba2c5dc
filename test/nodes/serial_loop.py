# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A serial_rig with its board and a controller that answers its pressures."""

import pytest

pytest.importorskip('serial', reason='pyserial is not installed')

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.serial_rig import SerialRig

from .whole_bundle import values_of

#: A machine that is busy with other tests is not what most of these are about.
PATIENT = {'board_timeout': 10.0, 'command_timeout': 5.0}


class Loop:
    """A rig, its board, and a controller that answers pressures with what a test says."""

    def __init__(self, graph, board, **overrides):
        self.graph, self.board = graph, board
        self.valves = dict.fromkeys(range(1, board.units + 1), 0.5)
        self.enable = True
        self.rig = graph.add(SerialRig(context=graph.context, overrides={
            'url': board.port.url, 'units': board.units, 'start_stopped': False,
            'reconnect_interval': 0.1, **PATIENT, **overrides}))
        self.states = graph.diagnostics('serial_rig')
        self.stops = graph.listen('e_stop', Bool, interface.LATCHED)
        self.pressure = {}
        for unit in self.valves:
            self._answer(unit)
        self._enable = graph.probe.create_publisher(Bool, 'supply_enable', 10)
        graph.probe.every(0.005, board.step)
        graph.probe.every(0.05, self._beat)

    def _answer(self, unit):
        probe = self.graph.probe
        publisher = probe.create_publisher(JointState, interface.valve_topic(unit), 10)
        heard = self.pressure[unit] = []

        def answer(message):
            heard.append(message)
            if self.valves[unit] is not None:
                stamp = interface.stamp_ns(message.header.stamp)
                publisher.publish(interface.valve_message(stamp, unit, self.valves[unit]))
        probe.create_subscription(FluidPressure, interface.pressure_topic(unit), answer, 10)

    def _beat(self):
        if self.enable is not None:
            self._enable.publish(Bool(data=self.enable))

    def until(self, condition, what, seconds=15.0):
        self.graph.until(condition, what, seconds)

    @property
    def stopped(self):
        """What e_stop said last; None before it said anything."""
        return self.stops[-1].data if self.stops else None

    def filled(self):
        """Both units are under pressure."""
        self.until(lambda: min(self.board.pressure) > 100.0, 'pressure')

    def vented(self):
        self.until(lambda: max(self.board.pressure) < 5.0 and not self.board.supply, 'vented')

    def reset(self):
        return self.graph.call(Trigger, 'e_stop_reset')

    def status(self, text=''):
        """Return diagnostics of now, once a message or value says a text."""
        self.states.clear()

        def says():
            self.rig._diagnostics.publish()
            self.graph.spin()
            return self.states and text in ' '.join((self.states[-1].message,
                                                     *values_of(self.states[-1]).values()))
        self.until(says, f'diagnostics: {text}')
        return self.states[-1], values_of(self.states[-1])
