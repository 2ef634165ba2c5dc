# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Node recruitment_controller: a force, strain or pressure reference in, pressure setpoints out.

Each complete sample of the rig is answered with setpoints that carry its stamp. The last
reference received, ``reference/force``, ``reference/strain`` or ``reference/pressures``, sets the
control mode; switching off deletes it. Readings that cannot be trusted hold the pressures at
first, and vent if this lasts. A longer loss, late readings, over-pressure, a force that no
pressure explains, a pressure loop that latches or falls silent, and a process that stood still
vent the whole bundle and cut the supply (``supply_enable``) until ``enable`` is called again; so
does the emergency stop.
"""

from collections.abc import Mapping
import time
from typing import Any

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import UInt8
from std_srvs.srv import SetBool

from fam_bundle_ros.control import Command, Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.direct import DirectPressures
from fam_bundle_ros.control.safety import Guard, Health, State
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.adaptation import Adaptation
from fam_bundle_ros.nodes.base import BundleNode, REMIND
from fam_bundle_ros.nodes.diagnostics import Diagnostics, ERROR, Report, WARN
from fam_bundle_ros.nodes.loops import STOPPED
from fam_bundle_ros.nodes.model_swap import ModelSwap
from fam_bundle_ros.nodes.models import bundle_from
from fam_bundle_ros.nodes.oversight import crowded, Oversight
from fam_bundle_ros.nodes.process import executable
from fam_bundle_ros.nodes.recruitment_parameters import controller_config, SPECS
from fam_bundle_ros.nodes.reference_intake import ReferenceIntake
from fam_bundle_ros.nodes.references import MovingReference, OffTarget
from fam_bundle_ros.nodes.sensing import Sample, Sensing
from fam_bundle_ros.nodes.supply_enable import SupplyEnable, TIMEOUT

#: Longest time step of the integrators after a gap between samples, s.
_LONGEST = 0.1
#: A stamp that goes back by more than this means that the clock was set; by less, that the clocks
#: of two channels differ, s.
_CLOCK_SET = 0.5
#: Pa: below it a motor unit counts as vented.
_VENTED = 5e3
#: Errors of force (share of the blocked force) and strain up to which a reference is reached.
_REACHED_FORCE, _REACHED_STRAIN = 0.05, 0.02


class RecruitmentNode(BundleNode):
    """The recruitment controller; keywords as of `BundleNode`."""

    def __init__(self, **keywords: Any):
        super().__init__('recruitment_controller', SPECS, **keywords)
        p = self.p
        self.bundle = bundle_from(p['model'])
        self._loaded = p['model']
        self.controller = RecruitmentController(self.bundle, controller_config(p))
        self._direct = DirectPressures(self.bundle, hold_time=p['hold_time'])
        #: Whether the reference of the last tick was one of pressures.
        self._was_direct = False
        n = self.bundle.n
        self._limit = self.bundle.max_pressure.tolist()
        #: Whether to enable as soon as there is no reason against it; in lock-step at once.
        self._automatic: bool = p['start_enabled'] and not self.lock_step
        self._enabled: bool = p['start_enabled'] and self.lock_step
        #: Whether to start from the measured pressures; None before the first sample.
        self._take_over: bool | None = None
        self._reference = MovingReference()
        #: State while there is no reference.
        self._without_reference = 'WAITING'
        #: Why it is off, where that was not asked for; until it is enabled again.
        self._why_off = ''
        self._off_target = OffTarget({
            'force': _REACHED_FORCE * self.bundle.largest_force,
            'strain': _REACHED_STRAIN})
        self._answered = -1
        self._decided = time.monotonic()
        self._shut_since: float | None = None
        #: Last setpoints, Pa (gauge), and last command, None while the controller is off.
        self.setpoints = [0.0] * n
        self.command: Command | None = None
        self._set_up_interface()

    def _set_up_interface(self) -> None:
        n = self.bundle.n
        self._send_setpoint = [
            self.sender(interface.setpoint_topic(i + 1), FluidPressure,
                        interface.pressure_writer(self.ambient)) for i in range(n)]
        self._announce_state = self.announcer(interface.RECRUITMENT_STATE, UInt8,
                                              interface.state_message)
        self._send_recruitment = self.sender(interface.RECRUITMENT, JointState,
                                             interface.recruitment_writer(n))
        self._announce_state(0)
        self._oversight = Oversight(self, self.bundle, self._now, self._on_latch, self._on_e_stop)
        self._supply = SupplyEnable(self, self._oversight.stood_still,
                                    max(TIMEOUT, self.p['sensor_timeout']),
                                    self._oversight.contradicted)
        self._sensing = Sensing(self, n, self.bundle.length, self._on_sample,
                                self.p['wait_for_reference'], self._oversight.look_at_pressure)
        self._references = ReferenceIntake(self, self.bundle, self._take_reference)
        self.create_service(SetBool, interface.ENABLE, self._on_enable)
        self._adaptation = Adaptation(self, lambda: self.controller)
        self._swap = ModelSwap(self, lambda: self.bundle, lambda: controller_config(self.p))
        if self.bundle.unusual_order:
            self.get_logger().warning(self.bundle.unusual_order)
        self.p.on_change(self, self._check, self._change,
                         lambda: self._guard.now.state in (State.ACTIVE, State.HOLD))
        self._diagnostics = Diagnostics(self, self._report)
        self.every(max(1.0 / self.p['rate'], 2e-3), self._check_time)

    @property
    def _guard(self) -> Guard:
        return self._oversight.guard

    @property
    def _exhausted(self) -> float:
        """Time since the supply was shut with all valves exhausting, s."""
        return 0.0 if self._shut_since is None else self._now() - self._shut_since

    def _take_reference(self, stamp: int, reference: Reference) -> None:
        if self.lock_step and self.p['wait_for_reference']:
            self._sensing.put('reference', stamp, reference)
        else:
            self._reference.take(reference, self._now())

    # --- the tick ------------------------------------------------------------------------------

    def _on_sample(self, sample: Sample) -> None:
        self._oversight.notice_stop()
        dt = (sample.stamp - self._answered) * 1e-9 if self._answered >= 0 else 0.0
        now = time.monotonic()
        if not self.lock_step and -_CLOCK_SET < dt <= 0.0:
            # Stamps do not advance but time does: watches and ramps must continue.
            dt = now - self._decided
        self._decided = now
        if not self.lock_step or sample.stamp != self._answered:
            self._answered = sample.stamp
            # Without a reference (lost message) the last one is kept.
            if sample.reference is not None:
                self._reference.take(sample.reference, self._now())
            self._decide(sample, dt)
        else:
            self._supply.repeat()
        self._publish(sample.stamp)

    def _decide(self, sample: Sample, dt: float) -> None:
        """Compute setpoints and state for a sample."""
        oversight = self._oversight
        measurement = oversight.trusted(sample, self._sensing)
        oversight.look(sample, self._enabled, bool(self._off_target.text))
        if self._automatic and not oversight.refusal(self._exhausted):
            self._enable()
        self._control(sample, measurement, dt)
        # While pressures ramp down after switching off, the valves still need the supply.
        self._supply.set(not (oversight.e_stop.on or oversight.guard.latched)
                         and (self._enabled or any(self.setpoints)))
        if self._supply.value or self._shut_since is None:
            self._shut_since = self._now()

    def _control(self, sample: Sample, measurement: Measurement, dt: float) -> None:
        off = self._reason_to_be_off()
        if off:
            state, cause = off
            self._guard.enter(self._now(), state, cause)
            if state is not State.WAITING:
                self._take_over = True
            self.command = None
            self._off_target.reset()
            self._ramp_down(dt, at_once=self._guard.latched or self._oversight.e_stop.on)
            return
        reference = self._reference.at(self._now())
        assert reference is not None
        readable = self._oversight.readable
        if dt < 0.0:
            # The clock was set: the state of filters and memory is out of date.
            self._take_over = True
        direct = reference.kind == 'pressure'
        at_work = self._direct if direct else self.controller
        if direct is not self._was_direct and self._take_over is not None:
            self._take_over = True
        self._was_direct = direct
        if self._take_over is None:
            # A vented bundle needs no start from the measured pressures.
            self._take_over = not max(sample.pressure) < _VENTED
        if self._take_over and readable:
            at_work.enable(measurement)
            if not direct:
                self._swap.go_on(self.controller)
            self._take_over = False
        elif self._take_over:
            self._guard.enter(self._now(), State.VENT, 'SENSOR', self._oversight.unreadable)
            self._ramp_down(dt, at_once=True)
            return
        command = at_work.update(min(dt, _LONGEST), measurement, reference)
        self.command = command
        asked = command.pressure.tolist()
        self.setpoints = asked if direct else self._swap.faded(asked, dt)
        if command.explanation:
            self.get_logger().info(command.explanation)
        self._off_target.update(self._now(), reference,
                                {'force': measurement.force, 'strain': measurement.strain},
                                command.saturated)
        if readable:
            self._guard.enter(self._now(), State.ACTIVE)
            return
        # Once vented, the next start must use the measured pressures.
        self._take_over = not any(self.setpoints)
        self._guard.enter(self._now(), *((State.VENT, 'SENSOR') if self._take_over else
                                         (State.HOLD, 'HOLD')), self._oversight.unreadable)
        bad = [watch.name for watch in self._oversight.watches if watch.health != Health.GOOD]
        self.say(f'{bad} {self._guard.word}', f'{self._oversight.unreadable}: '
                 + ('vented' if self._take_over else 'pressures held'))

    def _now(self) -> float:
        """Return the time of the watches, s: stamps in lock-step, else the steady clock."""
        return self._answered * 1e-9 if self.lock_step else time.monotonic()

    def _reason_to_be_off(self) -> tuple[State, str] | None:
        if self._oversight.e_stop.on:
            return State.VENT, STOPPED
        if self._guard.latched:
            return State.VENT, ''
        if not self._enabled:
            return State.READY, 'OFF'
        if self._reference.last is None:
            waiting = self._without_reference == 'WAITING'
            return (State.WAITING, '') if waiting else (State.READY, self._without_reference)
        limit = self.p['reference_timeout']
        last = self._references.meter.last
        if not self.lock_step and limit > 0.0 and last is not None:
            age = time.monotonic() - last
            if age > limit:
                self.say('reference', f'the reference came {age:.2f} s ago; at most {limit:g} s '
                         'is taken: pressures ramp down')
                self._forget_reference('NO_REFERENCE')
                return State.READY, 'NO_REFERENCE'
        return None

    def _check_time(self) -> None:
        self._oversight.notice_stop()
        self._sensing.check_time()

    def _on_latch(self) -> None:
        """Vent all, cut the supply, and stay off until `enable`."""
        self._enabled = self._automatic = False
        self._forget_reference()
        self.command = None
        self.setpoints = [0.0] * self.bundle.n
        self._supply.set(False)

    def _enable(self) -> None:
        self._automatic, self._enabled, self._why_off = False, True, ''
        self._oversight.release()

    def _forget_reference(self, state: str = 'WAITING') -> None:
        """Wait for a new reference: the old one may be out of date when control resumes."""
        self._reference = MovingReference()
        self._without_reference = state
        self._take_over = True

    def _ramp_down(self, dt: float, at_once: bool) -> None:
        """Ramp the setpoints to 0, or set them to 0 at once."""
        ramp = self.p['ramp_down_time']
        if at_once or ramp <= 0.0:
            self.setpoints = [0.0] * self.bundle.n
        else:
            self.setpoints = [max(value - limit * max(dt, 0.0) / ramp, 0.0)
                               for value, limit in zip(self.setpoints, self._limit)]

    # --- output --------------------------------------------------------------------------------

    def _publish(self, stamp: int) -> None:
        for send, setpoint in zip(self._send_setpoint, self.setpoints):
            send(stamp, setpoint)
        command = self.command
        n = self.bundle.n
        self._announce_state(command.state if command else 0)
        active = command.active if command else [False] * n
        share = command.share.tolist() if command else [0.0] * n
        self._send_recruitment(stamp, active, share)

    def stop(self) -> None:
        """Publish setpoints of ambient pressure."""
        self._supply.set(False)
        self.setpoints = [0.0] * self.bundle.n
        self.command = None
        self._publish(max(self._answered, 0))

    # --- services, parameters, diagnostics -----------------------------------------------------

    def _on_e_stop(self) -> None:
        if self._enabled and self._answered >= 0:
            # Control does not resume by itself after an emergency stop.
            self._enabled = False
            self._why_off = 'since an emergency stop, until enabled again'
            self.get_logger().error('emergency stop: vented; off until enabled again')
            self._forget_reference()
        # A stop that is released before the next sample must not end in a ramp, which fills.
        self.setpoints = [0.0] * self.bundle.n
        self._automatic = False
        self._supply.set(False)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response
                   ) -> SetBool.Response:
        if not request.data:
            if self._enabled:
                self._forget_reference()
            self._enabled = self._automatic = False
            response.success, response.message = True, 'off; pressures ramp down'
        elif why := self._oversight.refusal(self._exhausted):
            message = f'on already, although {why}' if self._enabled else why
            response.success, response.message = False, message
            self.say('not enabled', message if self._enabled else f'not enabled: {why}', 1.0)
        elif self._enabled:
            # A repeated call must not reset the watches.
            response.success, response.message = True, f'on already: {self._guard.word}'
        else:
            self._enable()
            response.success, response.message = True, 'on, from the pressures as they are'
        return response

    def _check(self, values: Mapping[str, Any]) -> None:
        config = controller_config(values)
        model = values['model']
        bundle = self._bundle_for(model)
        RecruitmentController(bundle, config)
        if model != self._loaded and self._enabled and self._swap.bundle(model) is None:
            raise InputError('the model changes only while the controller is off, or by '
                             'apply_model; the pressure loops keep theirs until all nodes are '
                             'restarted')
        # The pressure loops and the readings of this node depend on these.
        for what, new, old in (('motor units', bundle.n, self.bundle.n),
                               ('largest pressures', bundle.max_pressure.tolist(), self._limit),
                               ('the length', bundle.length, self.bundle.length)):
            if new != old:
                raise InputError(f'{model}: {what} {new}, here {old}: restart all nodes with it')

    def _bundle_for(self, model: str) -> Bundle:
        if model == self._loaded:
            return self.bundle
        return self._swap.bundle(model) or bundle_from(model)

    def _change(self, changes: dict[str, Any]) -> None:
        if set(changes) <= {'reference_timeout', 'resume_within', 'ramp_down_time',
                            'over_pressure_factor'}:
            return
        self.bundle = self._bundle_for(self.p['model'])
        self._loaded = self.p['model']
        self._oversight.set_model(self.bundle)
        before = self.controller
        self.controller = RecruitmentController(self.bundle, controller_config(self.p))
        if before.bundle is self.bundle:
            self.controller.keep_learnt(before)
        self._take_over = True
        self.get_logger().info(f"taken over: {', '.join(sorted(changes))}")

    def _report(self, report: Report) -> None:
        self._sensing.report(report)
        report.value('state', self._guard.word)
        report.value('enabled', self._enabled)
        now = self._guard.now
        if now.state is not State.ACTIVE:
            urgent = now.state is State.LATCHED or now.cause in (STOPPED, 'SENSOR')
            off = self._why_off if now.cause == 'OFF' else ''
            text = f'{now.reason}: off until enabled again' if self._guard.latched else (
                '; '.join(filter(None, (off, self._oversight.unreadable))))
            report.add(ERROR if urgent else WARN, f'{self._guard.word} {text}'.strip())
        for text in self._oversight.still_full(self._exhausted):
            report.add(ERROR, text)
            self.say('still full', text)
        self._oversight.e_stop.report(report)
        report.value('model', self.bundle.name)
        report.value('policy', self.p['policy'])
        report.value('scheme', self.p['scheme'])
        command = self.command
        if command:
            report.value('recruitment', f'RS{command.state}')
            report.value('demand, N', command.demand)
            report.value('saturation', command.saturated or 'none')
            report.value('recruit above, N', command.margins.recruit)
            report.value('release below, N', command.margins.release)
            report.value('overlap, N', command.margins.width)
            report.value('uncertainty, N', command.margins.uncertainty)
            report.value('bias, N', self.controller.outer.bias)
            self._adaptation.report(report)
            if command.saturated in ('high', 'low'):
                report.add(WARN, f'demand {command.demand:.1f} N is out of reach '
                           f'({command.saturated})')
        if self._off_target.text:
            self._warn(report, 'off target', self._off_target.text)
        for text in self._oversight.force_contradiction():
            # A gauge that drifts slowly, or the model: no reason to stop, but to look.
            self._warn(report, 'force', text)
        self._references.report(report)
        for text in crowded(self, (*self._oversight.topics, interface.REFERENCE_FORCE,
                                   interface.REFERENCE_STRAIN, interface.REFERENCE_PRESSURES)):
            self._warn(report, text, text)

    def _warn(self, report: Report, key: str, text: str) -> None:
        report.add(WARN, text)
        self.say(key, text, REMIND)


main = executable(RecruitmentNode, __doc__, SPECS)
