# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node pressure_pid: holds the pressure of one motor unit at its setpoint, or vents it.

Every pressure reading is answered with a valve command that carries the reading's stamp. The
motor unit is vented when the setpoint stays away, the pressure is too high or stands still though
the valve is open (both latched until the setpoint is back at ambient), the emergency stop is on,
or the process ends; a reading that cannot be trusted shuts the valve at first and vents when it
lasts. A setpoint of ambient means exhaust.
"""

import math
import time
from typing import Any

import numpy as np
from rclpy.context import Context
from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.control import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.pid import ANTI_WINDUP
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ValveFlow
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, LISTENER, MODEL
from fam_bundle_ros.nodes.diagnostics import Diagnostics, ERROR, Meter, Report, WARN
from fam_bundle_ros.nodes.e_stop import EmergencyStop
from fam_bundle_ros.nodes.gate import Gate
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec, table
from fam_bundle_ros.nodes.process import run
from fam_bundle_ros.nodes.watch import Health, SensorWatch, WatchConfig

_GAINS, _CONFIG = PidGains(), PidConfig()

SPECS = (
    Spec('motor_unit', 1, 'which motor unit, from 1', 1, 64),
    Spec(MODEL[0].name, MODEL[0].default, MODEL[0].text + ': for gas volume and largest pressure'),
    *LISTENER,
    Spec('gains.p', _GAINS.p, 'pressure rate per error, 1/s', 0.0, 1e3, dynamic=True),
    Spec('gains.i', _GAINS.i, 'pressure rate per integrated error, 1/s^2', 0.0, 1e5, dynamic=True),
    Spec('gains.d', _GAINS.d, 'on the measured pressure rate, dimensionless', 0.0, 1.0,
         dynamic=True),
    Spec('anti_windup', _CONFIG.anti_windup, 'what the integral does at the valve limits',
         choices=ANTI_WINDUP, dynamic=True),
    Spec('feed_forward', _CONFIG.feed_forward,
         'meet moving setpoints and muscles by the chamber model', dynamic=True),
    Spec('dead_band_compensation', _CONFIG.dead_band_compensation,
         'jump over the dead band of the valve', dynamic=True),
    Spec('quiet_error', _CONFIG.quiet_error, 'errors below it are left alone, Pa', 0.0, 1e5,
         dynamic=True),
    Spec('setpoint_rate', _CONFIG.setpoint_rate, 'largest rate of the setpoint, Pa/s', 1e3, 1e9,
         dynamic=True),
    Spec('transport_delay', _CONFIG.transport_delay, 'dead time from a reading through the valve '
         'to the next reading, s', 0.0, 0.5, dynamic=True),
    Spec('valve.conductance', _CONFIG.valve.conductance, 'sonic conductance, m^3/(s Pa)',
         1e-12, 1e-5),
    Spec('valve.dead_band', _CONFIG.valve.dead_band, 'command that does not open the valve',
         0.0, 0.9),
    Spec('supply.pressure', _CONFIG.supply, 'supply where nothing is measured, Pa gauge', 1e3,
         1.5e6),
    Spec('volume', _CONFIG.volume, 'gas volume with tubes where no strain is measured, m^3',
         1e-7, 1e-1),
    Spec('tube_volume', 5e-6, 'tube and fittings between valve and muscles, m^3', 0.0, 1e-2),
    Spec('over_pressure_factor', 1.15, 'vent and latch above the largest pressure times this',
         1.0, 3.0, dynamic=True),
    Spec('setpoint_timeout', 0.2, 'vent when the setpoint is older than this, s', 0.01, 10.0,
         dynamic=True),
    Spec('sensor_timeout', 0.1, 'a pressure older than this is stale, s', 0.01, 10.0),
    Spec('auxiliary_timeout', 0.5, 'a strain or supply older than this is not used; volume and '
         'supply.pressure take their place, s', 0.01, 60.0, dynamic=True),
    Spec('hold_time', 0.2, 'a bad reading shuts the valve so long, then vents, s', 0.0, 10.0),
    Spec('recovery_time', 0.2, 'a reading must be good so long to count again, s', 0.0, 10.0),
    Spec('stuck_time', 0.5, 'a reading that repeats exactly so long while the valve is open is '
         'stuck, s; 0 for never', 0.0, 60.0),
    Spec('response_time', 1.0, 'vent and latch when the pressure stands still so long though the '
         'valve lets through what would fill the unit three times, s; 0 for never', 0.0, 60.0),
)
#: A gap between readings longer than this, to either side, is no sample period, s.
_GAP = 0.5
#: Setpoints below it ask for no pressure, Pa.
_AMBIENT = 1e3
#: Pa: noise and drift of a reading stay below; errors above are worth a word.
_NOTABLE = 10e3
#: An error lasts when it is there for longer than any step takes to settle, s.
_SETTLING = 0.5


class PressurePidNode(BundleNode):
    """
    The pressure loop of one motor unit.

    Parameters
    ----------
    unit : int, optional
        In place of the parameter ``motor_unit``; it makes the node's name.
    context : Context, optional
    **keywords
        Of `BundleNode`.
    """

    def __init__(self, unit: int | None = None, *, context: Context | None = None,
                 overrides: dict[str, Any] | None = None, **keywords: Any):
        given = {} if unit is None else {'motor_unit': unit}
        super().__init__('pressure_pid' if unit is None else f'pressure_pid_mu{unit}', SPECS,
                         context=context, overrides={**(overrides or {}), **given}, **keywords)
        p = self.p
        self.unit: int = p['motor_unit']
        bundle = bundle_from(p['model'])
        if self.unit > bundle.n:
            raise InputError(f'{self.get_name()}: motor_unit is {self.unit}; {bundle.name} has '
                             f'{bundle.n}')
        self._length = float(bundle.motor_units[0].geometry.length)
        self._max_pressure = float(bundle.max_pressure[self.unit - 1])
        self._volumes = _Volume(bundle, self.unit - 1, p['tube_volume'])
        self.pid = PressurePid(*_settings(p))
        self._watch = SensorWatch(f'mu{self.unit} pressure', 'Pa', WatchConfig(
            low=-50e3, high=1.6e6, timeout=p['sensor_timeout'], hold_time=p['hold_time'],
            recovery_time=p['recovery_time'], stuck_time=p['stuck_time']))
        self._setpoint: tuple[int, float] | None = None
        self._setpoint_received = 0.0
        self._strain, self._supply = _Latest('strain'), _Latest('supply')
        #: State and reason.
        self._latched: tuple[str, str] | None = None
        self._state = 'WAITING'
        #: Pa, that was last answered by the loop.
        self._pressure = 0.0
        self._off, self._still = _Stretch(), _Stretch()
        self._command = -1.0
        self._answered = -1
        self._pressure_meter, self._setpoint_meter = Meter(), Meter()
        self._send = self.sender(interface.valve_topic(self.unit), JointState,
                                 interface.valve_writer(self.unit))
        self._gate = Gate(('pressure', 'setpoint', 'strain', 'supply'))
        self._gate_since = time.monotonic()
        self.subscribe(interface.pressure_topic(self.unit), FluidPressure, self._on_pressure)
        self.subscribe(interface.setpoint_topic(self.unit), FluidPressure, self._on_setpoint)
        self.subscribe(interface.STRAIN, JointState, self._on_strain)
        self.subscribe(interface.SUPPLY, FluidPressure, self._on_supply)
        self._e_stop = EmergencyStop(self, self._on_e_stop)
        p.on_change(self, _settings, self._change)
        self._diagnostics = Diagnostics(self, self._report)
        self.every(0.02, self._check_time)

    # --- messages ------------------------------------------------------------------------------

    def _on_pressure(self, message: FluidPressure) -> None:
        self._pressure_meter.tick()
        stamp = interface.stamp_ns(message.header.stamp)
        value = interface.read_pressure(message, self.ambient, self.p['pressure_is_gauge'])
        if self.lock_step:
            self._collect('pressure', stamp, value)
        else:
            self._answer(stamp, value)

    def _on_setpoint(self, message: FluidPressure) -> None:
        self._setpoint_meter.tick()
        stamp = interface.stamp_ns(message.header.stamp)
        value = interface.read_pressure(message, self.ambient)
        if self.lock_step:
            self._collect('setpoint', stamp, value)
            return
        if not math.isfinite(value):
            raise InputError(f'setpoint is {value}; expected a number')
        # Stamp 0 is what people send by hand: it counts from when it came.
        self._setpoint = (stamp or max(self._answered, 0), value)
        self._setpoint_received = time.monotonic()

    def _on_strain(self, message: JointState) -> None:
        value = interface.read_strain(message, self._length)
        if self.lock_step:
            self._collect('strain', interface.stamp_ns(message.header.stamp), value)
        else:
            self._strain.take(*value)

    def _on_supply(self, message: FluidPressure) -> None:
        value = interface.read_pressure(message, self.ambient, self.p['pressure_is_gauge'])
        if self.lock_step:
            self._collect('supply', interface.stamp_ns(message.header.stamp), value)
        else:
            self._supply.take(value)

    def _on_e_stop(self) -> None:
        if not self.lock_step:
            # At once, whether or not a reading comes to be answered.
            self._command = self._vent('E_STOP', '')
            self._publish(self.now_ns(), self._command)

    # --- lock-step -----------------------------------------------------------------------------

    def _collect(self, channel: str, stamp: int, value: Any) -> None:
        if stamp > self._gate.stamp:
            self._gate_since = time.monotonic()
        if self._gate.put(channel, stamp, value):
            self._answer_gate()

    def _answer_gate(self) -> None:
        gate = self._gate
        setpoint = gate.value('setpoint')
        self._setpoint = None if setpoint is None else (gate.stamp, setpoint)
        self._strain.take(*gate.value('strain', (math.nan, math.nan)))
        self._supply.take(gate.value('supply', math.nan))
        self._answer(gate.stamp, gate.value('pressure', math.nan))

    # --- time ----------------------------------------------------------------------------------

    def _check_time(self) -> None:
        """Look after what does not come: nothing else runs while the rig is silent."""
        now = time.monotonic()
        if self.lock_step:
            if (self._gate.begun and self._gate.missing
                    and now - self._gate_since > 1.5 * self.p['lock_step_timeout']):
                lost = self._gate.give_up()
                self.say('lost', f"mu{self.unit}: no {', '.join(lost)} any more", 0.0)
                self._answer_gate()
            return
        if self._pressure_meter.last is None:
            return
        if now - self._pressure_meter.last > self.p['sensor_timeout']:
            self._publish(self.now_ns(), self._judge(now, None))

    def _now(self, stamp: int) -> float:
        """Return the time that watches run on: stamps in lock-step, else the steady clock."""
        return stamp * 1e-9 if self.lock_step else time.monotonic()

    # --- control -------------------------------------------------------------------------------

    def _answer(self, stamp: int, pressure: float) -> None:
        """Answer a reading with a valve command of the same stamp."""
        first = self._answered < 0
        dt = 0.0 if first else (stamp - self._answered) * 1e-9
        if self.lock_step and dt == 0.0 and not first:
            # Time stands still: who asks again gets the same answer.
            self._publish(stamp, self._command)
            return
        # In wall time a stamp that stands still says nothing new, whatever the reading shows.
        new = self.lock_step or first or dt > 0.0 or dt < -_GAP
        if not new:
            self.say('stamp', f'mu{self.unit}: the stamp of the pressure does not advance; the '
                     'reading counts as stale')
        elif dt < 0.0 or dt > _GAP:
            # The clock was set, or the rig was away: filters know nothing any more.
            self.pid.reset()
        if new:
            self._answered = stamp
        forced = self._judge(self._now(stamp), pressure, new)
        if forced is not None:
            self.pid.reset()
            self._off, self._still = _Stretch(), _Stretch()
            self._command = forced
        elif new:
            assert self._setpoint is not None
            self._command = self._regulate(self._setpoint[1], pressure, dt)
            self._observe(self._now(stamp), pressure)
        self._publish(stamp, self._command)

    @property
    def _patience(self) -> float:
        """Largest age of strain and supply, s; in lock-step they come with the pressure."""
        return math.inf if self.lock_step else self.p['auxiliary_timeout']

    def _regulate(self, setpoint: float, pressure: float, dt: float) -> float:
        strain, rate = self._strain.value(self._patience)
        volume, slope = self._volumes.at(strain)
        supply = self._supply.value(self._patience)[0]
        return float(self.pid.update(
            min(max(setpoint, 0.0), self._max_pressure), pressure, dt,
            supply if math.isfinite(supply) else None, volume,
            slope * rate if math.isfinite(rate) else 0.0))

    def _observe(self, now: float, pressure: float) -> None:
        """Note how long the pressure has been off, or has stood still under a flow of air."""
        state = self.pid.state.shown
        self._pressure = pressure
        self._off.see(now, state.followed_setpoint - pressure, _NOTABLE)
        # An empty unit is open to exhaust all the time: nothing has to move.
        flow = state.expected_rate if pressure + state.error >= _AMBIENT else 0.0
        fast = 3.0 * self._max_pressure / (self.p['response_time'] or math.inf)
        self._still.see(now, flow, fast, pressure)

    @property
    def _seen(self) -> str:
        setpoint = self._pressure + self.pid.state.shown.error
        return (f'mu{self.unit} pressure {round(self._pressure / 1e3)} kPa, setpoint '
                f'{round(setpoint / 1e3)} kPa, valve at {self._command:.2f}')

    def _judge(self, now: float, pressure: float | None, new: bool = True) -> float | None:
        """
        Return a command that safety asks for, or None where the loop may act.

        A reading that is not new counts for over-pressure only.
        """
        health = (self._watch.check(now) if pressure is None or not new
                  else self._watch.see(now, pressure, self._must_move(pressure)))
        if self._e_stop.on:
            self._latched = None
            return self._vent('E_STOP', '')
        limit = self._max_pressure * self.p['over_pressure_factor']
        setpoint = self._setpoint
        if pressure is not None and pressure > limit and not self._latched:
            self._latch('OVER_PRESSURE', f'mu{self.unit} at {pressure / 1e3:.0f} kPa, above '
                        f'{limit / 1e3:.0f} kPa')
        elif setpoint and setpoint[1] < _AMBIENT:
            if self._latched and pressure is not None and pressure < 0.5 * limit:
                self._latched = None
        elif self._still.lasted >= self.p['response_time'] > 0.0 and not self._latched:
            self._latch('NO_RESPONSE', f'{self._seen} and unmoved for '
                        f'{self._still.lasted:.1f} s: supply, valve, tube or sensor?')
        if self._latched:
            return self._vent(self._latched[0], '')
        if health == Health.VENT:
            return self._vent('SENSOR', f'{self._watch.reason}: venting')
        if setpoint is None:
            return self._vent('WAITING', '')
        age = max((self._answered - setpoint[0]) * 1e-9, 0.0)
        received = 0.0 if self.lock_step else time.monotonic() - self._setpoint_received
        if max(age, received) > self.p['setpoint_timeout']:
            return self._vent('NO_SETPOINT', f'mu{self.unit} is vented: its setpoint is stamped '
                              f'{age:.3f} s before the pressure and came {received:.3f} s ago; at '
                              f"most {self.p['setpoint_timeout']:g} s is taken")
        if health == Health.HOLD:
            self._state = 'HOLD'
            self.say('HOLD', f'{self._watch.reason}: valve shut')
            return 0.0
        self._state = 'ACTIVE'
        return None

    def _latch(self, state: str, reason: str) -> None:
        self._latched = state, f'{reason}; vented and latched'
        self.get_logger().error(self._latched[1])

    def _vent(self, state: str, text: str) -> float:
        self._state = state
        if text:
            self.say(state, text)
        return -1.0

    def _must_move(self, pressure: float) -> bool:
        """Whether the last command must be changing the pressure."""
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
        if set(changes) <= {'over_pressure_factor', 'setpoint_timeout', 'auxiliary_timeout'}:
            return
        gains, config = _settings(self.p)
        self.pid.gains, self.pid.config = gains, config

    def _report(self, report: Report) -> None:
        self._pressure_meter.report(report, 'pressure')
        self._setpoint_meter.report(report, 'setpoint')
        state = self.pid.diagnostics
        report.value('state', self._state)
        report.value('command', self._command)
        report.value('error, Pa', state.error)
        report.value('integral, Pa/s', state.integral)
        report.value('anti_windup', self.p['anti_windup'])
        report.value('saturated', state.saturated)
        self._e_stop.report(report)
        if self._state != 'ACTIVE':
            urgent = self._state in ('OVER_PRESSURE', 'NO_RESPONSE', 'SENSOR', 'NO_SETPOINT')
            latched, reason = self._latched or ('', '')
            why = {latched: reason, 'SENSOR': self._watch.reason,
                   'HOLD': self._watch.reason}.get(self._state, '')
            report.add(ERROR if urgent else WARN, f'{self._state} {why}'.strip())
            return
        supply = self._supply.value(self._patience)[0]
        report.value('supply, Pa', supply if math.isfinite(supply) else 'not measured')
        report.value('volume', 'of the measured strain' if math.isfinite(
            self._strain.value(self._patience)[0]) else 'not measured')
        for reading, name in ((self._strain, 'volume'), (self._supply, 'supply.pressure')):
            if reading.lost(self._patience):
                report.add(WARN, f'no {reading.name} any more: the parameter {name}, '
                           f'{self.p[name]:g}, takes its place')
        supply = supply if math.isfinite(supply) else self.p['supply.pressure']
        if self._setpoint and self._setpoint[1] > supply:
            report.add(WARN, f'supply at {supply / 1e3:.0f} kPa, below the setpoint of '
                       f'{self._setpoint[1] / 1e3:.0f} kPa')
        elif self._off.lasted > _SETTLING:
            report.add(WARN, f'{self._seen} for {self._off.lasted:.1f} s: supply, valve, tube or '
                       'sensor?')


class _Latest:
    """The last reading (value, rate) of what the loop can do without, until it is too old."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._value, self._received = (math.nan, math.nan), -math.inf
        self._seen = False

    def take(self, value: float, rate: float = math.nan) -> None:
        self._value, self._received = (value, rate), time.monotonic()
        self._seen = self._seen or math.isfinite(value)

    def value(self, patience: float) -> tuple[float, float]:
        """Return value and rate, nan where they are older than ``patience`` (s)."""
        fresh = time.monotonic() - self._received <= patience
        return self._value if fresh else (math.nan, math.nan)

    def lost(self, patience: float) -> bool:
        """Whether it was there once and is no more."""
        return self._seen and not math.isfinite(self.value(patience)[0])


class _Stretch:
    """How long a value has been far to one side, and a pressure (if told) still meanwhile."""

    def __init__(self) -> None:
        self.lasted = 0.0
        self._side, self._since, self._from = 0, 0.0, 0.0

    def see(self, now: float, value: float, far: float, pressure: float = 0.0) -> None:
        side = (value > far) - (value < -far)
        if (side != self._side or now < self._since
                or abs(pressure - self._from) > _NOTABLE):
            self._side, self._since, self._from = side, now, pressure
        self.lasted = now - self._since if side else 0.0


class _Volume:
    """Gas volume and its slope over strain, tabulated: the model itself is too slow per tick."""

    def __init__(self, bundle: Any, index: int, tube: float):
        self._grid = np.linspace(-0.15, 0.5, 651)
        volume = np.maximum(bundle.gas_volume(self._grid)[:, index], 0.0) + max(tube, 1e-7)
        self._volume = volume.tolist()
        self._slope = np.gradient(volume, self._grid).tolist()

    def at(self, strain: float) -> tuple[float | None, float]:
        """Return volume (m^3) and dV/dstrain; (None, 0) where the strain is not known."""
        if not -0.15 <= strain <= 0.5:
            return None, 0.0
        k = round((strain + 0.15) * 1000.0)
        return self._volume[k], self._slope[k]


def _settings(values: dict[str, Any]) -> tuple[PidGains, PidConfig]:
    """Return gains and settings; InputError where they do not fit together."""
    gains = PidGains(values['gains.p'], values['gains.i'], values['gains.d'])
    config = PidConfig(
        valve=ValveFlow(conductance=values['valve.conductance'],
                        dead_band=values['valve.dead_band']),
        anti_windup=values['anti_windup'], volume=values['volume'],
        supply=values['supply.pressure'],
        ambient=values['ambient_pressure'], setpoint_rate=values['setpoint_rate'],
        transport_delay=values['transport_delay'], quiet_error=values['quiet_error'],
        feed_forward=values['feed_forward'],
        dead_band_compensation=values['dead_band_compensation'])
    return gains, config


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit status."""
    return run(lambda context: [PressurePidNode(context=context)],
               f'{__doc__}\nParameters:\n{table(SPECS)}', args)
