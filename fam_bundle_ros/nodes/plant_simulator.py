# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node plant_simulator: a simulated rig with the topics, units and services of a real one.

In wall time it steps at its rate with the latest valve commands and vents motor units without
fresh commands. In lock-step it publishes a sample and ``/clock``, and steps when a valve command
with that sample's stamp has arrived for every motor unit. Its supply is open only while
``supply_enable`` is true; a dynamometer as load follows ``reference/dynamometer``.
"""

from functools import partial
import math
import time
from typing import Any, Protocol

from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, MODEL
from fam_bundle_ros.nodes.diagnostics import Diagnostics, ERROR, Meter, Report, WARN
from fam_bundle_ros.nodes.dynamometer import ImposedStrain
from fam_bundle_ros.nodes.fault_injection import FaultInjection, FAULTS
from fam_bundle_ros.nodes.gate import Gate
from fam_bundle_ros.nodes.hidden_effect import HIDDEN, HiddenEffect
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.profile import load_profile
from fam_bundle_ros.nodes.rig_parameters import LOAD, load_change, RIG, rig_config
from fam_bundle_ros.nodes.supply_enable import Permission, TIMEOUT
from fam_bundle_ros.plant import Dynamometer, Faults, Rig

SPECS = (
    MODEL,
    Spec('plant_model', '', 'model file of the rig if other than `model`, for a hidden effect'),
    HIDDEN,
    Spec('rate', 200.0, 'samples per second', 10.0, 2000.0),
    Spec('seed', 0, 'seed of the noise', 0, 2**31 - 1),
    Spec('start_stopped', True, 'start with the emergency stop on, as rigs do'),
    Spec('publish_clock', True, 'send /clock in lock-step; one simulator per ROS domain only'),
    Spec('command_timeout', 0.1, 'a motor unit without a fresh command is vented, s', 0.01, 10.0,
         dynamic=True),
    Spec('obey_supply_enable', True, 'open the supply only while supply_enable is true; false '
         'if no node publishes it'),
    Spec('supply_timeout', TIMEOUT, 'time for which a supply_enable is valid in wall time, s',
         0.01, 10.0, dynamic=True),
    Spec('patience', 0.05, 'longest wait in wall time for late answers to the last sample, s; 0 '
         'to step without them, as a real rig does', 0.0, 1.0, dynamic=True),
    *LOAD, *RIG, *FAULTS,
)
#: Wall time after which an unanswered sample is sent again, s.
_RETRY = 0.2
#: Change of the difference between clock and stamps in one step above which the clock was set, ns.
_SET = 10_000_000_000
#: Pa: below it a motor unit counts as vented.
_VENTED = 5e3
#: Delay behind the clock from which a warning is given, s.
_SLOW = 0.5


class Script(Protocol):
    """Hooks before and after each step of a simulated rig; decides when the run ends."""

    def before(self, rig: Rig, time: float, period: float) -> None:
        """Act on the rig before a step of ``period`` (s), at a time of the run, s."""

    def after(self, rig: Rig, time: float, commands: list[float]) -> bool:
        """
        Inspect the rig after a step; return whether time stands still from now on.

        The time of the run, s, is that at the end of the step, which had these valve commands,
        -1..1.
        """


class PlantSimulator(BundleNode):
    """
    The simulated rig; further keywords as of `BundleNode`.

    ``rig`` replaces the rig that the parameters describe, ``script`` has hooks of each step.

    Attributes
    ----------
    rig : Rig
    halted : bool
        Whether time stands still because the script has ended.
    """

    def __init__(self, *, rig: Rig | None = None, script: Script | None = None, **keywords: Any):
        super().__init__('plant_simulator', SPECS, **keywords)
        p = self.p
        self.rig = rig or Rig(bundle_from(p['plant_model'] or p['model']), rig_config(p),
                              seed=p['seed'])
        highest, trip = max(bundle_from(p['model']).max_pressure), self.rig.config.trip_pressure
        if highest >= trip:
            self.get_logger().warning(
                f'the model allows {highest / 1e3:.0f} kPa, and this rig stops above '
                f'{trip / 1e3:.0f} kPa: raise trip_pressure, chamber.relief_pressure and '
                'supply.pressure (of the pressure loops too)')
        self._hidden = HiddenEffect(self.rig, p[HIDDEN.name])
        self.units = self.rig.bundle.n
        self._channels = interface.unit_names(self.units)
        self._script = script
        self._profile = load_profile(p['load.profile']) if p['load.profile'] else None
        if self._profile and (self._profile.kind != 'strain' or not isinstance(
                self.rig.load, Dynamometer)):
            raise InputError('load.profile needs a trajectory of strain and load.kind dynamometer')
        self._period_ns = round(1e9 / p['rate'])
        self.halted = False
        self._sent = float('-inf')
        self._ticked = math.inf
        self._steps = 0
        self._behind = 0
        self._refused = 0
        self._meter = Meter()
        self._injection = FaultInjection(self, self.units, self._break)
        self._imposed = ImposedStrain(self, self.rig)
        self._permission = Permission(math.inf if self.lock_step else p['supply_timeout'])
        self._set_up_interface()
        if p['start_stopped']:
            self.rig.e_stop('stopped at start: call e_stop_reset')
        self._announce_stop()
        if self.lock_step:
            # Stamp 0 means "no stamp" to many tools, so time begins one period later.
            self._stamp = self._period_ns
            self._gate = Gate(self._channels)
            self.every(_RETRY, self._retry)
        else:
            self._stamp = self.now_ns()
            self._commands = [-1.0] * self.units
            self._command_stamps: list[int | None] = [None] * self.units
            self._received = [0.0] * self.units
            self.every(self._period_ns * 1e-9, self._tick)

    def _set_up_interface(self) -> None:
        supply, *pressures = (
            (topic, self.sender(topic, FluidPressure,
                                interface.pressure_writer(self.ambient, frame)))
            for topic, frame in interface.pressure_channels(self.units))
        #: Channel, as named by faults, and its send function; those for pressure loops first.
        self._outputs = [
            ('strain', self.sender(interface.STRAIN, JointState,
                                   interface.strain_writer(self.rig.length))),
            *pressures,
            ('force', self.sender(interface.FORCE, WrenchStamped, interface.force_writer())),
            ('supply', supply[1])]
        self._send_stop = self.sender(interface.E_STOP, Bool, interface.bool_message,
                                      interface.LATCHED)
        self._time_publisher = (self.publisher(interface.CLOCK, Clock)
                       if self.lock_step and self.p['publish_clock'] else None)
        for i in range(self.units):
            self.subscribe(interface.valve_topic(i + 1), JointState,
                           partial(self._take_command, i))
        if self.p['obey_supply_enable']:
            self.subscribe(interface.SUPPLY_ENABLE, Bool, lambda message: self._permission.take(
                message.data), interface.repeated_qos(self.lock_step))
        for name, answer in ((interface.E_STOP_TRIGGER, self._on_e_stop),
                             (interface.E_STOP_RESET, self._on_e_stop_reset),
                             (interface.RESET, self._on_reset), (interface.TARE, self._on_tare)):
            self.trigger(name, answer)
        self.p.on_change(self, self._check, self._change)
        self._diagnostics = Diagnostics(self, self._report, 'simulated')

    @property
    def faults(self) -> Faults:
        """The present faults, those of messages included."""
        return self._injection.faults

    @faults.setter
    def faults(self, faults: Faults) -> None:
        self._injection.set(faults)

    # --- lock-step -----------------------------------------------------------------------------

    def _take_command(self, unit: int, message: JointState) -> None:
        command = interface.read_valve(message, unit + 1)
        stamp = interface.stamp_ns(message.header.stamp)
        if self.lock_step:
            # What was sent on supply_enable before this node was discovered is lost, and the run
            # would begin with the supply shut. It comes again with the next answer.
            if self.p['obey_supply_enable'] and not self._permission.heard:
                return
            # Late answers to a sample that was sent twice are ignored.
            if stamp == self._stamp and self._gate.put(self._channels[unit], stamp, command):
                self._step(self._gate_commands())
                self._publish()
            return
        age = (self._stamp - stamp) * 1e-9
        if age > self.p['command_timeout']:
            self._refused += 1
            self.say(f'stale {unit}', f'valve command of mu{unit + 1} refused: stamped '
                     f'{age:.3f} s ago, received just now; at most '
                     f"{self.p['command_timeout']:g} s is taken")
            return
        # The age of a stamp in the future counts from the arrival of the command.
        self._commands[unit], self._command_stamps[unit] = command, min(stamp, self._stamp)
        self._received[unit] = time.monotonic()

    def _retry(self) -> None:
        """Send an unanswered sample again; a unit that does not answer counts as lost."""
        silence = time.monotonic() - self._sent
        if silence < _RETRY or self.halted:
            return
        if self._gate.begun and silence > 2.5 * self.p['lock_step_timeout']:
            lost = self._gate.give_up()
            if lost:
                self.say('lost', f"no valve commands for {', '.join(lost)}: venting", 0.0)
            if len(self._gate.lost) == self.units:
                # No controller answers any more: vent, at about the speed of wall time.
                for _ in range(round(_RETRY * self.p['rate'])):
                    self._step([-1.0] * self.units)
                self._publish(driven=False)
                return
            self._step(self._gate_commands())
        self._publish(driven=not self._gate.begun)

    def _gate_commands(self) -> list[float]:
        """Return the commands of this stamp; a lost motor unit is vented."""
        return [self._gate.value(channel, -1.0) for channel in self._channels]

    # --- wall time -----------------------------------------------------------------------------

    def _tick(self) -> None:
        if self.halted:
            return
        now = self.now_ns()
        if now == 0:
            self.say('no clock', 'use_sim_time is on and /clock has no publisher: time stands '
                     'still (lock_step makes this node the clock)')
            return
        before, self._ticked = self._ticked, time.monotonic()
        # Time in which this process was suspended does not count as silence of others.
        held_up = max(self._ticked - before - self._period_ns * 1e-9, 0.0)
        self._sent += held_up
        self._received = [received + held_up for received in self._received]
        if self._answers_due():
            return
        late = now - self._stamp - self._period_ns
        missed = late > self._period_ns and not any(self._command_stamps)
        if missed or abs(late - self._behind) > _SET:
            # Resynchronise. Not on a machine that falls behind gradually: a jump of the stamps
            # would make every received command stale, and vent.
            self._stamp += late
            late = 0
        self._behind = late
        self._step([self._fresh(i) for i in range(self.units)])
        self._publish()

    def _answers_due(self) -> bool:
        """
        Return whether to give the controllers more time.

        On a desktop, processes are delayed for longer than a valve may stay open. The rig then
        falls behind the clock, so that it stays under control; the wait per unit is limited.
        """
        now = time.monotonic()
        since = now - self._sent
        if since < 0.5e-9 * self._period_ns:
            return True
        return since < self.p['patience'] and any(
            stamp is not None and stamp < self._stamp
            and now - received < self.p['command_timeout']
            for stamp, received in zip(self._command_stamps, self._received))

    def _fresh(self, unit: int) -> float:
        """Return the command of a motor unit, or -1 (vent) without a fresh one."""
        stamp = self._command_stamps[unit]
        if stamp is None:
            return -1.0
        age = (self._stamp - stamp) * 1e-9
        # Negative after the clock was set back.
        if abs(age) <= self.p['command_timeout']:
            return self._commands[unit]
        self.say(f'silent {unit}', f'mu{unit + 1} is vented: its last valve command is stamped '
                 f'{age:.3f} s ago and came {time.monotonic() - self._received[unit]:.3f} s ago; '
                 f"at most {self.p['command_timeout']:g} s is taken")
        return -1.0

    # --- both ----------------------------------------------------------------------------------

    def _step(self, commands: list[float]) -> None:
        period = self._period_ns * 1e-9
        run_time = self._steps * period
        if self._script:
            self._script.before(self.rig, run_time, period)
        self._imposed.before(period)
        if self._profile and not self._imposed.obeyed:
            when = run_time + period
            target = self._profile.value(when % self._profile.duration
                                         if self.p['load.repeat'] else when)
            self._imposed.follow(target, period)
        stopped = self.rig.e_stopped
        if self.p['obey_supply_enable']:
            self.rig.open_supply(self._permission.given)
            if not self._permission.given:
                commands = [-1.0] * self.units
        self.rig.step(commands, period)
        self._steps += 1
        self._stamp += self._period_ns
        if self.rig.e_stopped != stopped:
            self._announce_stop()
        if self._script:
            self.halted = self._script.after(self.rig, run_time + period, commands)

    def _publish(self, driven: bool = True) -> None:
        """Publish the present sample; ``driven`` restarts the wait for its answers."""
        if self.halted:
            return
        if driven:
            self._sent = time.monotonic()
        self._meter.tick()
        stamp, readings = self._stamp, self.rig.readings
        if self._time_publisher:
            self._time_publisher.publish(Clock(clock=interface.to_stamp(stamp)))
        values = ((readings.strain, readings.strain_rate),
                  *((value,) for value in readings.pressure.tolist()),
                  (readings.force,), (readings.supply,))
        for (channel, send), value in zip(self._outputs, values):
            self._injection.send(channel, send, stamp, *value)

    def _announce_stop(self) -> None:
        if self.rig.e_stopped:
            self.get_logger().warning(f'stopped: {self.rig.e_stopped}')
        self._send_stop(bool(self.rig.e_stopped))

    # --- services and parameters ---------------------------------------------------------------

    def _on_e_stop(self) -> str:
        self.rig.e_stop('e_stop_trigger was called')
        self._announce_stop()
        return 'stopped; all motor units are vented'

    def _on_e_stop_reset(self) -> str:
        running = self.rig.e_stop_reset()
        self._announce_stop()
        if not running:
            raise InputError(f'still stopped: {self.rig.e_stopped}, and a motor unit is above '
                             f"{self.p['trip_pressure'] / 1e3:g} kPa")
        return 'running'

    def _on_reset(self) -> str:
        stopped = self.rig.e_stopped
        self.rig.reset()
        self._imposed.forget()
        if stopped:
            # Only e_stop_reset releases a stop.
            self.rig.e_stop(stopped)
        self._steps = 0
        self._announce_stop()
        return 'at rest, vented; faults and the emergency stop stay as they were'

    def _on_tare(self) -> str:
        self.rig.tare()
        said = 'force zeroed at the present load'
        filled = [f'mu{i + 1} is at {value / 1e3:.0f} kPa'
                  for i, value in enumerate(self.rig.truth.pressure) if value > _VENTED]
        if filled:
            said += f": {', '.join(filled)}, and what that pulls reads as 0 N now"
            self.get_logger().warning(f'tare: {said}')
        return said

    def _check(self, values: dict[str, Any]) -> None:
        self._injection.check(values)
        self._hidden.check(values)

    def _change(self, changes: dict[str, Any]) -> None:
        self._injection.take()
        self._hidden.take(self.p[HIDDEN.name])
        if not self.lock_step:
            self._permission.timeout = self.p['supply_timeout']
        fields = load_change(self.p['load.kind'], changes)
        if fields and isinstance(self.rig.load, Dynamometer):
            self.rig.impose_strain(self.p['load.strain'], self.p['load.speed'])
        elif fields:
            self.rig.change_load(**fields)

    def _break(self, faults: Faults) -> None:
        self.rig.faults = faults

    def _report(self, report: Report) -> None:
        self._meter.report(report, 'sample')
        report.value('rig', 'simulated')
        report.value('model', self.rig.bundle.name)
        report.value('hidden effect', self.p[HIDDEN.name] or 'none')
        report.value('run time, s', self._steps * self._period_ns * 1e-9, 6)
        report.value('e_stop', self.rig.e_stopped or 'off')
        if self.p['obey_supply_enable']:
            report.value('supply', 'open' if self._permission.given else 'shut by supply_enable'
                         if self._permission.heard else 'shut: nothing on supply_enable yet')
        report.value('air drawn, g', 1e3 * self.rig.air_mass)
        report.value('work, J', self.rig.work)
        behind = max(self._behind, 0) * 1e-9
        report.value('behind the clock, s', behind)
        if behind > _SLOW:
            slow = f'{behind:.1f} s behind the clock: the machine is or was too slow'
            report.add(WARN, slow)
            self.say('slow', slow, 60.0)
        report.value('commands refused', self._refused)
        if self.rig.e_stopped:
            report.add(ERROR, f'stopped: {self.rig.e_stopped}')
        if broken := self.faults.text:
            report.add(WARN, f'faults: {broken}')
        for i in range(self.units):
            if self.lock_step:
                lost = self._channels[i] in self._gate.lost
                waiting = not self._gate.begun
            else:
                stamp = self._command_stamps[i]
                waiting = stamp is None
                lost = stamp is not None and abs(
                    self._stamp - stamp) * 1e-9 > self.p['command_timeout']
            if waiting or lost:
                report.add(WARN, f"mu{i + 1}: {'WAITING for' if waiting else 'lost its'} "
                           'valve commands, vented')
        if self.count_publishers(interface.FORCE) > 1:
            report.add(ERROR, 'another rig publishes force under this namespace')


main = executable(PlantSimulator, __doc__, SPECS)
