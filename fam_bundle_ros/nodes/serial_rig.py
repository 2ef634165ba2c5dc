# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node serial_rig: the driver of a rig whose valves and sensors are connected to a microcontroller.

It uses the line protocol of docs/how_to/serial_rig.md over a serial port or TCP, and satisfies
docs/how_to/driver.md: readings have the time at which they were taken, valves exhaust without
commands, and the supply is open only while `supply_enable` is true. A board that is lost,
restarts, or trips stops the rig until `e_stop_reset`.
"""

from collections import deque
from functools import partial
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.air import Air
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.board import Board
from fam_bundle_ros.nodes.diagnostics import Diagnostics, ERROR, Meter, Report, WARN
from fam_bundle_ros.nodes.parameters import Parameters
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.serial_link import Event, SerialLink
from fam_bundle_ros.nodes.serial_parameters import scale_specs, Scales, SPECS, UNITS
from fam_bundle_ros.nodes.serial_protocol import (
    AIR,
    BoardSample,
    command_line,
    hello_line,
    OVER_PRESSURE,
)

#: Longest time without a command to the board, s: a tenth of the board's time-out.
_HEARTBEAT = 0.02
#: Shortest time between two commands to the board, s.
_CLOSEST = 0.4e-3
#: Longest time between two clock readings that are used as simultaneous, s.
_HELD_UP = 50e-6


class SerialRig(BundleNode):
    """The driver, as `BundleNode`; InputError if a parameter is wrong or pyserial is missing."""

    def __init__(self, *, context: Context | None = None,
                 namespace: str = interface.NAMESPACE, overrides: dict[str, Any] | None = None):
        self.units = _units(context, namespace, overrides)
        super().__init__('serial_rig', (*SPECS, *scale_specs(self.units)), context=context,
                         namespace=namespace, overrides=overrides)
        p = self.p
        try:
            if self.lock_step or self.get_parameter('use_sim_time').value:
                raise InputError('serial_rig: lock_step and use_sim_time must be false: a real '
                                 'rig keeps real time')
            self._scales = Scales(p, self.units)
            self._link = SerialLink(p['url'], p['baud'], self._happened, p['reconnect_interval'])
        except InputError:
            self.destroy_node()
            raise
        self._board = Board(self.units, p['board_timeout'], self._stop_for)
        self._air = Air(self.units, p['command_timeout'], p['supply_timeout'])
        #: Why the rig is stopped until e_stop_reset; empty when it is not.
        self._stop = 'stopped at start: call e_stop_reset' if p['start_stopped'] else ''
        self._readings: BoardSample | None = None
        self._events: deque[Event] = deque()
        self._woken = False
        #: Motor units that were commanded since the last line to the board.
        self._commanded: set[int] = set()
        self._number = self._dropped = self._refused = 0
        self._last_sent = 0.0
        #: Why the air is shut, by this node and by the board; reason of the last cut.
        self._why, self._board_air, self._last_cut = 'nothing sent yet', '', ''
        self._sample_meter, self._command_meter = Meter(), Meter()
        self._set_up_interface()
        self._announce()
        self.every(_HEARTBEAT, self._tick)
        self._link.start()

    def _set_up_interface(self) -> None:
        self._send_force = self.sender(interface.FORCE, WrenchStamped, interface.force_writer())
        # The contraction alone, as this node does not know the rest length.
        self._send_contraction = self.sender(interface.STRAIN, JointState,
                                             interface.contraction_writer())
        self._send_supply, *self._send_pressure = (
            self.sender(topic, FluidPressure, interface.pressure_writer(self.ambient, frame))
            for topic, frame in interface.pressure_channels(self.units))
        self._announce_stop = self.announcer(interface.E_STOP, Bool, interface.bool_message)
        for i in range(self.units):
            self.subscribe(interface.valve_topic(i + 1), JointState, partial(self._take_valve, i))
        self.subscribe(interface.SUPPLY_ENABLE, Bool, self._take_enable, interface.REPEATED)
        self.trigger(interface.E_STOP_TRIGGER, self._on_e_stop)
        self.trigger(interface.E_STOP_RESET, self._on_e_stop_reset)
        self._diagnostics = Diagnostics(self, self._report, 'rig')

    def stop(self) -> None:
        """Stop the rig: the last line to the board vents all units and shuts the supply."""
        self._stop_for('serial_rig has ended')
        self._announce()
        self._link.close(self._line(time.monotonic()) if self._board.running else b'')

    # --- the port ------------------------------------------------------------------------------

    def _happened(self, event: Event) -> None:
        """Queue an event of the link for the executor; called in the link's thread."""
        self._events.append(event)
        executor = self.executor
        if executor is not None and not self._woken:
            self._woken = True
            executor.create_task(self._drain)

    def _drain(self) -> None:
        """Handle the events of the link; an error in it stops the rig."""
        try:
            self._work_off()
        except Exception as error:
            # An exception of a task would end the process without the last line, which vents.
            self._stop_for(f'{type(error).__name__}: {error}')
            self._announce()

    def _work_off(self) -> None:
        self._woken = False
        while self._events:
            event = self._events.popleft()
            if event.kind == 'data':
                for sample, taken in self._board.feed(event.data, event.time):
                    self._readings = self._scales.in_si(sample)
                    self._publish(self._readings, taken)
                    self._judge(sample)
            elif event.kind == 'open':
                self._board.opened()
                self.get_logger().info(f"{self.p['url']} is open")
            else:
                self._board.closed(event.reason)
                self.say('closed', f"{self.p['url']}: {event.reason}")
        self._greet()
        self._announce()

    def _greet(self) -> None:
        if self._board.greeting_due(time.monotonic()):
            self._link.write(hello_line())

    def _publish(self, readings: BoardSample, taken: float) -> None:
        self._sample_meter.tick()
        stamp = self._ros_time(taken)
        self._send_force(stamp, readings.force)
        self._send_contraction(stamp, readings.contraction)
        if readings.supply is not None:
            self._send_supply(stamp, readings.supply)
        for send, value in zip(self._send_pressure, readings.pressure):
            send(stamp, value)

    def _ros_time(self, steady: float) -> int:
        """Return a steady time (s) as ROS time, ns."""
        for _ in range(3):
            before, now, after = time.monotonic(), self.now_ns(), time.monotonic()
            if after - before < _HELD_UP:
                break
        return now - round(1e9 * (0.5 * (before + after) - steady))

    def _judge(self, sample: BoardSample) -> None:
        """Stop the rig if a sample requires it; log when the board cuts the air itself."""
        if danger := self._danger(sample):
            self._stop_for(danger)
        air = sample.air
        text = '' if air in (0, 1) else AIR.get(air, f'its reason {air}')
        if text and text != self._board_air and self._number > 0:
            self._cut(f'by the board: {text}')
        self._board_air = text

    # --- topics and services -------------------------------------------------------------------

    def _take_valve(self, unit: int, message: JointState) -> None:
        command = interface.read_valve(message, unit + 1)
        self._command_meter.tick()
        now = time.monotonic()
        age = (self._ros_time(now) - interface.stamp_ns(message.header.stamp)) * 1e-9
        if not self._air.command(unit, command, now - age, now):
            self._refused += 1
            self.say(f'stale {unit}', f'valve command of mu{unit + 1} refused: stamped {age:.3f} '
                     f"s ago, received just now; at most {self.p['command_timeout']:g} s is "
                     'taken')
            return
        self._commanded.add(unit)
        # One line for all motor units; a late command is sent with the next heartbeat.
        if len(self._commanded) == self.units and now - self._last_sent >= _CLOSEST:
            self._send(now)

    def _take_enable(self, message: Bool) -> None:
        now = time.monotonic()
        before = self._air.order(now).supply
        self._air.enable(message.data, now, self.publisher_count(interface.SUPPLY_ENABLE))
        if self._air.order(now).supply != before:
            self._send(now)

    def _on_e_stop(self) -> str:
        self._stop_for('e_stop_trigger was called')
        self._announce()
        return 'stopped; all motor units are vented'

    def _on_e_stop_reset(self) -> str:
        blocked = self._blocked()
        if not blocked:
            self._stop = ''
        self._announce()
        if blocked:
            raise InputError(f'still stopped: {blocked}')
        return 'running'

    # --- stop and air --------------------------------------------------------------------------

    def _stop_for(self, reason: str) -> None:
        """Stop until e_stop_reset; the first reason is kept."""
        if not self._stop:
            self._stop = reason
            self.get_logger().error(f'stopped: {reason}')
            self._send(time.monotonic())

    def _blocked(self) -> str:
        """Return why the rig cannot run now; empty when it can."""
        board = self._board
        sample = board.newest
        if not board.running or sample is None:
            return board.reason or 'the board has sent no sample yet'
        return self._danger(sample)

    def _danger(self, sample: BoardSample) -> str:
        """Return why a sample, or a pressure of the last readings, forbids to run; or empty."""
        if sample.stop:
            return 'the stop button is pressed'
        if sample.air == OVER_PRESSURE:
            return f'the board has cut the air: {AIR[OVER_PRESSURE]}'
        limit = self.p['trip_pressure']
        high = [f'mu{i + 1} is at {value / 1e3:.0f} kPa' for i, value in enumerate(
            self._readings.pressure if self._readings else ()) if value > limit]
        return f"{', '.join(high)}, above {limit / 1e3:g} kPa" if high else ''

    def _announce(self) -> None:
        self._announce_stop(bool(self._stop or self._blocked()))

    def _tick(self) -> None:
        self._drain()
        now = time.monotonic()
        self._board.check(now)
        self._announce()
        if now - self._last_sent >= 0.9 * _HEARTBEAT:
            self._send(now)

    def _send(self, now: float) -> None:
        if not self._board.running or self._board.newest is None:
            return
        self._commanded.clear()
        self._last_sent = now
        if self._link.write(self._line(now)):
            self._board.sent(self._number, now)
        else:
            self._dropped += 1

    def _line(self, now: float) -> bytes:
        """Return the next command."""
        stopped = self._stop or self._blocked()
        order = self._air.order(now, stopped or self._board.deaf)
        if order.why and not self._why:
            self._cut(f'by serial_rig: {order.why}')
        self._why = order.why
        self._number += 1
        # Without a valve command in use, the stamp of the newest sample.
        answers = self._board.taken if order.answers is None else order.answers
        return command_line(self._number, self._board.ticks(answers), order.supply,
                            bool(stopped), order.valves)

    def _cut(self, text: str) -> None:
        self._last_cut = text
        self.get_logger().warning(f'air cut {text}')

    # --- diagnostics ---------------------------------------------------------------------------

    def _report(self, report: Report) -> None:
        board, stopped = self._board, self._stop or self._blocked()
        self._sample_meter.report(report, 'sample')
        self._command_meter.report(report, 'valve command')
        report.value('rig', 'serial')
        report.value('url', self.p['url'])
        report.value('board', board.name or board.reason)
        report.value('e_stop', stopped or 'off')
        report.value('air', f'shut by serial_rig: {self._why}' if self._why else
                     f'shut by the board: {self._board_air}' if self._board_air else
                     'open' if board.running else f'unknown: {board.reason}')
        report.value('last air cut', self._last_cut or 'none')
        report.value('lines lost', board.lost)
        report.value('lines garbled', board.garbled)
        report.value('last garbled line', board.last_garbled or 'none')
        report.value('samples skipped', board.skipped)
        report.value('reconnects', board.reconnects)
        report.value('board restarts', board.restarts)
        report.value('round trip, s', board.round_trip)
        report.value('commands dropped', self._dropped)
        report.value('commands refused', self._refused)
        if not board.running:
            report.add(ERROR, f"{self.p['url']}: {board.reason}")
        if stopped:
            report.add(ERROR, f'stopped: {stopped}')
        if board.deaf:
            report.add(ERROR, board.deaf)
        if self._board_air:
            report.add(WARN, f'the board keeps the air shut: {self._board_air}')
        now = time.monotonic()
        for i in self._air.stale(now):
            waiting = self._air.age(i, now) is None
            report.add(WARN, f"mu{i + 1}: {'WAITING for' if waiting else 'lost its'} valve "
                       'commands, vented')
        if self.publisher_count(interface.FORCE) > 1:
            report.add(ERROR, 'another rig publishes force under this namespace')
        if self.publisher_count(interface.E_STOP) > 1:
            report.add(ERROR, 'another node publishes e_stop')


def _units(context: Context | None, namespace: str, overrides: dict[str, Any] | None) -> int:
    """Return the parameter `units`, which determines the other parameters."""
    node = Node('serial_rig', context=context, namespace=namespace, enable_rosout=False,
                start_parameter_services=False,
                parameter_overrides=[Parameter(UNITS.name, value=overrides[UNITS.name])]
                if overrides and UNITS.name in overrides else [])
    try:
        return int(Parameters(node, (UNITS,))[UNITS.name])
    finally:
        node.destroy_node()


main = executable(SerialRig, __doc__, (*SPECS, *scale_specs(2)))
