# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node pressure_pid: holds the pressure of one motor unit at its setpoint, or vents it.

Every pressure reading is answered with a valve command that carries the reading's stamp. The
motor unit is vented when no setpoint arrives, `supply_enable` is false, the emergency stop is on,
or the process ends; a reading that cannot be trusted first shuts the valve, and vents if it lasts.
A pressure that is too high or does not match the inflow, a supply that contradicts its parameter,
and late readings vent and latch, until `supply_enable` goes from false to true (which `enable` of
the recruitment controller does). A setpoint of ambient pressure means exhaust.
"""

from dataclasses import replace
import math
import time
from typing import Any

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.control import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.plausibility import GENTLE
from fam_bundle_ros.control.safety import (
    Change,
    Guard,
    Health,
    kilopascals,
    NO_RESPONSE,
    OVER_PRESSURE,
    SensorWatch,
    State,
    trip_pressure,
    UNEXPLAINED_PRESSURE,
    WatchConfig,
)
from fam_bundle_ros.control.travel import Travel
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, GAUGE
from fam_bundle_ros.nodes.diagnostics import Diagnostics, ERROR, Meter, Report, WARN
from fam_bundle_ros.nodes.e_stop import EmergencyStop
from fam_bundle_ros.nodes.gate import Gate
from fam_bundle_ros.nodes.loops import LoopState, STOPPED
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.pid_parameters import settings, SPECS
from fam_bundle_ros.nodes.pid_readings import Air, LongestGap, SAMPLES, Stretch
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.supply_enable import Permission, TIMEOUT

#: A step of the stamp larger than this, forwards or backwards, is not a sample period, s.
_GAP = 0.5
#: Window in which gaps between readings are expected to recur, s.
_GAPS = 1.0
#: Time without a command after which a driver exhausts a unit, s (docs/how_to/driver.md).
_COMMAND_TIMEOUT = 0.1
#: Errors above this are reported; noise and drift of a reading are smaller, Pa.
_NOTABLE = 10e3
#: Longest settling time of a step; an error for longer is persistent, s.
_SETTLING = 0.5


class PressurePidNode(BundleNode):
    """
    The pressure loop of one motor unit; keywords as of `BundleNode`.

    ``unit`` replaces the parameter ``motor_unit`` and determines the node's name.
    """

    def __init__(self, unit: int | None = None, *, overrides: dict[str, Any] | None = None,
                 **keywords: Any):
        given = {} if unit is None else {'motor_unit': unit}
        super().__init__('pressure_pid' if unit is None else f'pressure_pid_mu{unit}', SPECS,
                         overrides={**(overrides or {}), **given}, **keywords)
        p = self.p
        self.unit: int = p['motor_unit']
        bundle = bundle_from(p['model'])
        if self.unit > bundle.n:
            raise InputError(f'motor_unit is {self.unit}; {bundle.name} has {bundle.n}')
        self._length = bundle.length
        self._max_pressure = float(bundle.max_pressure[self.unit - 1])
        self._gaps, self._longest_gap = LongestGap(_GAPS), 0.0
        #: Whether the setpoint is ambient pressure.
        self._empties = False
        self.pid = PressurePid(*self._settings())
        self._watch = SensorWatch(f'mu{self.unit} pressure', 'Pa', WatchConfig(
            low=-50e3, high=1.6e6, timeout=p['sensor_timeout'], hold_time=p['hold_time'],
            recovery_time=p['recovery_time'], stuck_time=p['stuck_time'],
            max_latency=self.max_latency, below=GAUGE))
        self._air = Air(self, bundle, self.unit, self.pid.config)
        inflow = self._air.inflow.config
        self._travel = Travel(inflow.margin, 2.0 / p['rate'])
        self._permission = Permission(math.inf if self.lock_step
                                      else max(TIMEOUT, p['sensor_timeout']))
        self._setpoint: tuple[int, float] | None = None
        self._setpoint_received = 0.0
        self._guard = Guard(self._on_state)
        #: Last pressure that was answered by the loop, Pa.
        self._pressure = 0.0
        self._off = Stretch()
        self._command = -1.0
        #: Pressure rate of that command by the loop's models, Pa/s; 0 for one that overrides it.
        self._rate = 0.0
        self._answered = -1
        #: In lock-step: whether an answer waits until the supply is cut.
        self._withheld = False
        #: Time between the arrivals of the last two readings, s; 0 in lock-step.
        self._gap = 0.0
        self._pressure_meter, self._setpoint_meter = Meter(), Meter()
        self._send = self.sender(interface.valve_topic(self.unit), JointState,
                                 interface.valve_writer(self.unit))
        self._loop_state = LoopState(self, self.unit)
        self._loop_state.say(self._guard.now)
        self._gate = Gate(('pressure', 'setpoint', 'strain', 'supply'))
        self.subscribe(interface.pressure_topic(self.unit), FluidPressure, self._on_pressure)
        self.subscribe(interface.setpoint_topic(self.unit), FluidPressure, self._on_setpoint)
        self.subscribe(interface.STRAIN, JointState, self._on_strain)
        self.subscribe(interface.SUPPLY, FluidPressure, self._on_supply)
        self.subscribe(interface.SUPPLY_ENABLE, Bool, self._on_leave,
                       interface.repeated_qos(self.lock_step))
        self._e_stop = EmergencyStop(self, self._on_e_stop)
        p.on_change(self, settings, self._change,
                    lambda: self._guard.now.state in (State.ACTIVE, State.HOLD))
        self._diagnostics = Diagnostics(self, self._report)
        self.every(0.02, self._check_time)

    def _settings(self) -> tuple[PidGains, PidConfig]:
        """Return gains and settings, with valve limits that are safe when this loop is delayed."""
        gains, config = settings(self.p)
        if self._empties:
            # Air is let out at the rate of the valve, whatever rate the user allows for motion.
            config = replace(config, setpoint_rate=max(config.setpoint_rate,
                                                       PidConfig.setpoint_rate))
        if self.lock_step:
            # In lock-step, time stands still while this loop is delayed.
            return gains, config
        late = self.max_latency if math.isfinite(self.max_latency) else SAMPLES / self.p['rate']
        return gains, replace(
            config, reach=late + max(2.0 / self.p['rate'], self._longest_gap),
            ceiling=trip_pressure(self._max_pressure, self.p['over_pressure_factor']))

    # --- messages ------------------------------------------------------------------------------

    def _on_pressure(self, message: FluidPressure) -> None:
        before = self._pressure_meter.last
        self._pressure_meter.tick()
        stamp = interface.stamp_ns(message.header.stamp)
        value = interface.read_pressure(message, self.ambient, self.p['pressure_is_gauge'])
        if self.lock_step:
            self._collect('pressure', stamp, value)
        else:
            self._gap = time.monotonic() - before if before is not None else 0.0
            self._expect_gaps()
            self._answer(stamp, value, self.latency(stamp))

    def _expect_gaps(self) -> None:
        """Limit the valve opening to what is safe until the next, possibly late, reading."""
        longest = min(self._gaps.see(time.monotonic(), self._gap), _COMMAND_TIMEOUT)
        if longest != self._longest_gap:
            self._longest_gap = longest
            self.pid.gains, self.pid.config = self._settings()

    def _on_setpoint(self, message: FluidPressure) -> None:
        self._setpoint_meter.tick()
        stamp = interface.stamp_ns(message.header.stamp)
        value = interface.read_pressure(message, self.ambient)
        if self.lock_step:
            self._collect('setpoint', stamp, value)
            return
        if not math.isfinite(value):
            raise InputError(f'setpoint is {value:g}; expected a number')
        # Stamp 0 is usual for messages sent by hand: the age counts from the arrival.
        self._setpoint = (stamp or max(self._answered, 0), value)
        self._setpoint_received = time.monotonic()

    def _on_strain(self, message: JointState) -> None:
        value = interface.read_strain(message, self._length)
        if self.lock_step:
            self._collect('strain', interface.stamp_ns(message.header.stamp), value)
        else:
            self._air.take_strain(*value)

    def _on_supply(self, message: FluidPressure) -> None:
        value = interface.read_pressure(message, self.ambient, self.p['pressure_is_gauge'])
        if self.lock_step:
            self._collect('supply', interface.stamp_ns(message.header.stamp), value)
        else:
            self._air.supply.take(value)

    def _on_e_stop(self) -> None:
        self._vent_now(STOPPED)

    def _on_leave(self, message: Bool) -> None:
        if not self._permission.take(message.data):
            return
        if message.data:
            now = self._now(max(self._answered, 0))
            self._guard.release(now)
            self._watch.forgive_repeats()
            self._travel.begin()
            self._air.begin(now)
            if not self.lock_step:
                # Full exhaust, harmless without supply, would fill through a reversed valve.
                self._command = max(self._command, -GENTLE)
                self._publish(self.now_ns(), self._command)
        else:
            self._vent_now('OFF')
            if self._withheld:
                self._withheld = False
                self._publish(self._answered, self._command)

    def _vent_now(self, cause: str) -> None:
        """Vent at once, without waiting for the next reading."""
        if not self.lock_step:
            self._command = self._vent(time.monotonic(), cause)
            self._publish(self.now_ns(), self._command)

    def _on_state(self, change: Change) -> None:
        if change.state is State.LATCHED:
            hint = ('; `fam_bundle check-rig --active` tests valves and sensors'
                    if change.cause in (NO_RESPONSE, UNEXPLAINED_PRESSURE) else '')
            self.get_logger().error(f'{change.cause}: {change.reason}; vented and latched until '
                                    f'enabled again{hint}')
        self._loop_state.say(change)

    # --- lock-step -----------------------------------------------------------------------------

    def _collect(self, channel: str, stamp: int, value: Any) -> None:
        if self._gate.put(channel, stamp, value):
            self._answer_gate()

    def _answer_gate(self) -> None:
        gate = self._gate
        setpoint = gate.value('setpoint')
        self._setpoint = None if setpoint is None else (gate.stamp, setpoint)
        self._air.take_strain(*gate.value('strain', (math.nan, math.nan)))
        self._air.supply.take(gate.value('supply', math.nan))
        self._answer(gate.stamp, gate.value('pressure', math.nan))

    # --- time ----------------------------------------------------------------------------------

    def _check_time(self) -> None:
        """Detect missing messages: nothing else runs while the rig is silent."""
        if self.lock_step:
            if lost := self._gate.overdue(1.5 * self.p['lock_step_timeout']):
                self.say('lost', f"mu{self.unit}: no {', '.join(lost)} any more", 0.0)
                self._answer_gate()
            return
        now, last = time.monotonic(), self._pressure_meter.last
        if last is not None and now - last > self.p['sensor_timeout']:
            self._publish(self.now_ns(), self._judge(now, None))

    def _now(self, stamp: int) -> float:
        """Return the time of the watches, s: stamps in lock-step, else the steady clock."""
        return stamp * 1e-9 if self.lock_step else time.monotonic()

    # --- control -------------------------------------------------------------------------------

    def _answer(self, stamp: int, pressure: float, latency: float = 0.0) -> None:
        """Answer a reading with a valve command of the same stamp."""
        first = self._answered < 0
        dt = 0.0 if first else (stamp - self._answered) * 1e-9
        if self.lock_step and dt == 0.0 and not first:
            # A repeated sample gets the same answer.
            self._publish(stamp, self._command)
            return
        # In wall time a reading whose stamp does not advance is not new, whatever its value.
        new = self.lock_step or first or dt > 0.0 or dt < -_GAP
        if not new:
            self.say('stamp', f'mu{self.unit}: the stamp of the pressure does not advance; the '
                     'reading counts as stale')
        elif dt < 0.0 or dt > _GAP:
            # The clock was set, or the rig was silent: the state of the filters is out of date.
            self.pid.reset()
        if new:
            self._answered = stamp
        latched = self._guard.latched
        forced = self._judge(self._now(stamp), pressure, new, latency)
        if forced is not None:
            self.pid.reset()
            self._off = Stretch()
            self._command, self._rate = forced, 0.0
        elif new:
            assert self._setpoint is not None
            setpoint = min(max(self._setpoint[1], 0.0), self._max_pressure)
            if self._empties is not (setpoint == 0.0):
                self._empties = not self._empties
                self.pid.gains, self.pid.config = self._settings()
            self._command = float(self.pid.update(setpoint, pressure, dt, *self._air.now()))
            self._rate = self.pid.state.shown.expected_rate
            if self._air.inflow.gentle:
                self._command = max(self._command, -GENTLE)
            self._pressure = pressure
            self._off.see(self._now(stamp), self.pid.state.shown.followed_setpoint - pressure,
                          _NOTABLE)
        if new:
            self._air.inflow.commanded(self._command, self._rate)
        # Messages take no time in lock-step: the supply is cut before the rig's next step. If no
        # node cuts it, the rig sends its sample again.
        self._withheld = (self.lock_step and self._guard.latched and not latched
                          and self._permission.given)
        if not self._withheld:
            self._publish(stamp, self._command)

    def _judge(self, now: float, pressure: float | None, new: bool = True,
               latency: float = 0.0) -> float | None:
        """
        Return the command that overrides the loop for safety, or None if the loop may act.

        A reading that is not new is used for the over-pressure check only.
        """
        guard, watch, setpoint = self._guard, self._watch, self._setpoint
        if pressure is None:
            health = watch.check(now)
        elif new:
            health = watch.see(now, pressure, self._must_move(now, pressure), latency)
        else:
            health = watch.check(now, 'new time stamp')
        self._look_for_latches(now, pressure)
        if pressure is not None and new and health == Health.GOOD:
            cause, reason = self._air.impossible(self._answered * 1e-9, pressure, self._gap)
            if cause:
                guard.latch(now, cause, reason)
        if self._e_stop.on:
            return self._vent(now, STOPPED)
        if guard.latched:
            return -1.0
        if self._permission.heard and not self._permission.given:
            return self._vent(now, 'OFF')
        if health == Health.VENT:
            return self._vent(now, 'SENSOR', f'{watch.reason}: venting')
        if setpoint is None:
            guard.enter(now, State.WAITING)
            return -1.0
        age = max((self._answered - setpoint[0]) * 1e-9, 0.0)
        received = 0.0 if self.lock_step else time.monotonic() - self._setpoint_received
        if max(age, received) > self.p['setpoint_timeout']:
            return self._vent(now, 'NO_SETPOINT', f'mu{self.unit} is vented: its setpoint is '
                              f'stamped {age:.3g} s before the pressure and came {received:.3g} s '
                              f"ago; at most {self.p['setpoint_timeout']:g} s is taken")
        if health == Health.HOLD:
            return self._hold(now, watch.reason)
        agrees, cause, reason = self._air.supply_agrees(now)
        if cause:
            guard.latch(now, cause, reason)
        if not agrees:
            return -1.0 if guard.latched else self._wait_for_supply(
                now, f'mu{self.unit} waits for the supply: {reason}')
        guard.enter(now, State.ACTIVE)
        return self._air.inflow.forced

    def _look_for_latches(self, now: float, pressure: float | None) -> None:
        """Latch for over-pressure, or for a cause of the sensor watch."""
        limit = trip_pressure(self._max_pressure, self.p['over_pressure_factor'])
        if pressure is not None and pressure > limit:
            self._guard.latch(now, OVER_PRESSURE, f'mu{self.unit} at {kilopascals(pressure)}, '
                              f'above {kilopascals(limit)}')
        if cause := self._watch.cause:
            self._guard.latch(now, cause, self._watch.reason)

    def _wait_for_supply(self, now: float, reason: str) -> float:
        if not self._air.starts(now):
            return self._hold(now, reason)
        # An exhaust would fill through a reversed valve once the supply is there.
        self._guard.enter(now, State.HOLD, 'HOLD', reason)
        self._air.inflow.be_gentle()
        return 0.0

    def _hold(self, now: float, reason: str) -> float:
        last = self._guard.now
        if last.state is State.VENT or (last.state is State.HOLD
                                        and now - last.time > self.p['hold_time']):
            return self._vent(now, 'NO_SUPPLY' if self._watch.health == Health.GOOD else 'SENSOR',
                              f'{reason}: venting')
        self._guard.enter(now, State.HOLD, 'HOLD', reason)
        self.say('HOLD', f'{reason}: valve shut')
        return 0.0

    def _vent(self, now: float, cause: str, reason: str = '') -> float:
        self._guard.enter(now, State.VENT, cause, reason)
        if reason:
            self.say(cause, reason)
        return -1.0

    def _must_move(self, now: float, pressure: float) -> bool:
        """Whether the last command, or all recent ones together, must change the pressure."""
        if self._travel.see(now, pressure, self._rate):
            return pressure > 10e3
        if abs(self._command) < self.p['valve.dead_band'] + 0.1:
            return False
        return pressure > 10e3 if self._command < 0.0 else pressure < 0.9 * self._max_pressure

    def _publish(self, stamp: int, command: float | None) -> None:
        if command is not None:
            self._send(stamp, command)

    def stop(self) -> None:
        """Vent."""
        self._publish(max(self._answered, 0) if self.lock_step else self.now_ns(), -1.0)

    # --- parameters and diagnostics ------------------------------------------------------------

    def _change(self, changes: dict[str, Any]) -> None:
        if set(changes) <= {'setpoint_timeout', 'auxiliary_timeout'}:
            return
        self.pid.gains, self.pid.config = self._settings()
        self._air.change(self.pid.config)

    def _report(self, report: Report) -> None:
        self._pressure_meter.report(report, 'pressure',
                                    0.0 if self.lock_step else self.p['rate'])
        self._setpoint_meter.report(report, 'setpoint')
        state = self.pid.diagnostics
        report.value('state', self._guard.word)
        report.value('command', self._command)
        report.value('error, Pa', state.error)
        report.value('integral, Pa/s', state.integral)
        report.value('anti_windup', self.p['anti_windup'])
        report.value('saturated', state.saturated)
        self._e_stop.report(report)
        now = self._guard.now
        if now.state is not State.ACTIVE:
            urgent = now.state is State.LATCHED or now.cause in ('SENSOR', 'NO_SETPOINT')
            report.add(ERROR if urgent else WARN, f'{self._guard.word} {now.reason}'.strip())
            return
        supply, most = self._air.report(report), self._max_pressure
        asked = self._setpoint[1] if self._setpoint else 0.0
        if asked > most + _NOTABLE:
            report.add(WARN, f'setpoint of {kilopascals(asked)} is above the largest pressure of '
                       f'mu{self.unit}, {kilopascals(most)}, which takes its place')
        if min(asked, most) > supply + _NOTABLE:
            report.add(WARN, f'supply at {kilopascals(supply)}, below the setpoint of '
                       f'{kilopascals(min(asked, most))}')
        elif self._off.lasted > _SETTLING:
            report.add(WARN, f'mu{self.unit} pressure {kilopascals(self._pressure)}, setpoint '
                       f'{kilopascals(self._pressure + state.error)}, valve at '
                       f'{self._command:.2f} for {self._off.lasted:.1f} s: supply, valve, tube or '
                       'sensor?')


main = executable(PressurePidNode, __doc__, SPECS)
