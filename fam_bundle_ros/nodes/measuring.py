# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Drives an experiment over ROS and records it: what ``fam_bundle measure`` does.

On a simulated rig that it starts itself, in lock-step and so as fast as the machine computes, or
on a running bundle. Pressures go to the recruitment controller (``reference/pressures``), whose
limits, watches and latches apply; strain goes to the dynamometer (``reference/dynamometer``).
"""

from collections.abc import Callable, Sequence
from contextlib import closing, ExitStack
from dataclasses import replace
from functools import partial
import math
from pathlib import Path
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from fam_bundle_ros.control.direct import ROUNDING
from fam_bundle_ros.data.protocol import minutes, Protocol, read_protocol, segments
from fam_bundle_ros.data.segment_store import SegmentStore
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, LISTENER
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.diagnostics import ERROR
from fam_bundle_ros.nodes.models import model_in
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals
from fam_bundle_ros.nodes.protocol_run import Asked, ProtocolRun, Seen, Stopped
from fam_bundle_ros.nodes.rig_parameters import pressure_parameters
from fam_bundle_ros.nodes.sensing import Sample, Sensing
from fam_bundle_ros.resources import config_names
from fam_bundle_ros.told import counted

#: Time-outs of the first sample, of a service, and of the reason for a stop, s.
_PATIENCE, _ANSWER, _REASON = 10.0, 5.0, 2.5
#: Time without another node's reference after which no other node sends one, s.
_QUIET = 0.5
#: Time without a sample after which the rig counts as silent, s.
_SILENT = 2.0
#: Period of the progress reports, s.
_SLICE = 0.2
_CUT = 'the controller has cut the supply'
#: Parameters of a simulated rig: it runs at once and as fast as possible.
_SIMULATED = {'lock_step': True, 'wait_for_reference': True, 'publish_clock': True,
              'start_enabled': True, 'start_stopped': False, 'generate': False, 'monitor': False}


class Measuring(BundleNode):
    """
    Sends the references of a `ProtocolRun`, sample by sample.

    Parameters
    ----------
    bundle : Bundle
        For the number of motor units and the rest length.
    clock : float, s
        Time in the experiment at the first sample.
    **keywords
        Of `BundleNode`.
    """

    def __init__(self, bundle: Bundle, run: ProtocolRun, clock: float, **keywords: Any):
        super().__init__('measuring', LISTENER, **keywords)
        self._run, self._zero = run, clock
        self._first: int | None = None
        self._last = -1
        self._setpoint = [math.nan] * bundle.n
        self._open = False
        self._asked: Asked | None = None
        #: Why the recruitment controller is off, by its diagnostics, and why the experiment cannot
        #: go on; empty while they can.
        self.reason = self.stopped = ''
        #: Steady time of the last sample, s; 0 before the first.
        self.heard = 0.0
        #: Topic and steady time (s) of the last reference from another node.
        self.other = '', -math.inf
        #: Until then the references are zero pressure.
        self.started = False
        self._ask_pressures = self.sender(interface.REFERENCE_PRESSURES, JointState,
                                          interface.reference_pressures_writer(bundle.n))
        self._ask_strain = self.sender(interface.REFERENCE_DYNAMOMETER, JointState,
                                       interface.reference_strain_writer())
        for k in range(bundle.n):
            def setpoint(message: FluidPressure, k: int = k) -> None:
                self._setpoint[k] = interface.read_pressure(message, self.ambient)
            self.subscribe(interface.setpoint_topic(k + 1), FluidPressure, setpoint)
        self.subscribe(interface.SUPPLY_ENABLE, Bool, self._on_supply,
                       interface.repeated_qos(self.lock_step))
        self.subscribe(interface.DIAGNOSTICS, DiagnosticArray, self._on_diagnostics,
                       interface.RELIABLE)
        for topic, kind in ((interface.REFERENCE_FORCE, WrenchStamped),
                            (interface.REFERENCE_STRAIN, JointState)):
            def other(message: Any, topic: str = topic) -> None:
                self.other = topic, time.monotonic()
                self._stop(f'another node sends {topic}')
            self.subscribe(topic, kind, other)
        self.enable_client = self.create_client(SetBool, interface.ENABLE)
        self.parameter_client = self.create_client(
            GetParameters, 'recruitment_controller/get_parameters')
        self._sensing = Sensing(self, bundle.n, bundle.length, self._on_sample)
        self.every(max(1.0 / self.p['rate'], 2e-3), self._check_time)

    def _on_sample(self, sample: Sample) -> None:
        if sample.silent:
            return
        self.heard = time.monotonic()
        if self._first is None:
            self._first = sample.stamp
        # In lock-step a sample that was not answered is sent again.
        if sample.stamp > self._last and not self.stopped and self.started:
            seen = Seen(self._zero + (sample.stamp - self._first) * 1e-9, sample.force,
                        sample.strain, tuple(sample.pressure), tuple(self._setpoint))
            try:
                self._asked = self._run.step(seen)
            except Stopped as stopped:
                self._stop(str(stopped))
        self._last = max(sample.stamp, self._last)
        self._send(sample.stamp)

    def _send(self, stamp: int) -> None:
        asked = None if self.stopped else self._asked
        if asked is not None and asked.strain is not None:
            # Strain first: in lock-step the rig makes its step once the pressures are answered.
            self._ask_strain(stamp, asked.strain, asked.rate)
        self._ask_pressures(stamp, asked.pressure if asked else [0.0] * len(self._setpoint))

    def _on_supply(self, message: Bool) -> None:
        if self.started and self._open and not message.data and not self._run.done:
            self._stop(_CUT)
        self._open = message.data

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f'{self.get_namespace()}/recruitment_controller'.lstrip('/'):
                self.reason = status.message if status.level[0] == ERROR else ''

    def _check_time(self) -> None:
        self._sensing.check_time()
        if self.started and time.monotonic() - self.heard > _SILENT and not self.lock_step:
            self._stop(f'the rig was silent for {_SILENT:g} s')

    def _stop(self, why: str) -> None:
        # Events before the experiment has begun or after it is over do not matter.
        if self.started and not self.stopped and not self._run.done:
            self.stopped = why

    def stop(self) -> None:
        """Set the pressure references to zero."""
        self._ask_pressures(max(self._last, 0), [0.0] * len(self._setpoint))


def measure(protocol: Protocol, out: str | Path, model: Bundle, *,
            plant_model: Bundle | None = None, rig: bool = False, resume: bool = False,
            namespace: str = interface.NAMESPACE, domain: int | None = None, rate: float = 200.0,
            seed: int = 0, overrides: dict[str, Any] | None = None,
            progress: Callable[[float, str], None] | None = None) -> Path:
    """
    Drive an experiment and record it.

    Parameters
    ----------
    protocol : Protocol
    out : path
        New CSV: time, trial (the number of the segment), strain, pressures, force.
    model : Bundle
        The controller's model: pressure limits and rest length.
    plant_model : Bundle, optional
        Model of the simulated rig; ``model`` by default.
    rig : bool
        Use a bundle that runs already (a rig and its controller) instead of a simulated one.
    resume : bool
        Continue an unfinished experiment; complete segments are kept.
    namespace : str
    domain : int, optional
        ROS domain; that of the environment by default, in which a simulated rig stays invisible.
    rate : float, Hz
        Samples of the simulated rig.
    seed : int
        Of its noise.
    overrides : dict, optional
        Parameters of the simulated rig's nodes, say ``{'faults.leak': 'mu1=2.0'}``.
    progress : callable, optional
        Called with the share that is done, and a text with the present step and the time left.

    Returns
    -------
    Path
        Of the CSV.

    Raises
    ------
    InputError
        When protocol and bundle do not match, or no rig or controller is found.
    Stopped
        When the experiment had to end: everything is vented, complete segments are kept.
    KeyboardInterrupt
        After Ctrl-C.
    """
    fits(protocol, model)
    store = SegmentStore(out, protocol, model.names, resume)
    done = store.done
    todo = [segment for segment in segments(protocol) if segment.number not in done]
    if todo:
        run = ProtocolRun(protocol, todo, store.keep)
        with ExitStack() as ending:
            # Before the first node, as a KeyboardInterrupt in a callback would be lost.
            signals = ending.enter_context(StopSignals())
            context = ending.enter_context(
                ros_context(domain, 'warn', alone=domain is None and not rig))
            node = {'context': context, 'namespace': namespace}
            if rig:
                nodes: list[BundleNode] = []
                measuring = Measuring(model, run, store.clock(), **node)
            else:
                scratch = ending.enter_context(tempfile.TemporaryDirectory(prefix='fam_bundle_'))
                values = {**_SIMULATED, 'rate': rate, 'seed': seed, **_load(protocol),
                          **pressure_parameters(model),
                          'model': model_in(scratch, 'model', model),
                          'plant_model': model_in(scratch, 'plant', plant_model or model),
                          **(overrides or {})}
                nodes = make_nodes(context, namespace, overrides=values)
                measuring = Measuring(model, run, store.clock(), **node, overrides={
                    'lock_step': True, 'rate': rate})
            # The subscriber first, so that in lock-step no sample is repeated.
            spinner = ending.enter_context(closing(Spinner(context, [measuring, *nodes])))
            _drive(spinner, measuring, run, lambda: signals.received, rig, protocol,
                   progress)
    store.finish()
    return store.out


def fits(protocol: Protocol, model: Bundle) -> None:
    """Check that a bundle can run a protocol; InputError says why not."""
    if protocol.motor_units != model.n:
        shipped = [name.removesuffix('.yaml') for name in config_names('protocols')]
        fitting = [name for name in shipped if read_protocol(name).motor_units == model.n]
        words = f"; protocols for {model.n} that ship: {', '.join(fitting)}" if fitting else ''
        raise InputError(f'{protocol.name}: is for {counted(protocol.motor_units, "motor unit")}; '
                         f'{model.name} has {model.n}{words}')
    for k, (value, limit) in enumerate(zip(protocol.highest, model.max_pressure), 1):
        if value > limit * (1.0 + ROUNDING):
            raise InputError(f'{protocol.name}: mu{k} goes up to {value / 1e3:.1f} kPa; '
                             f'{model.name} allows {limit / 1e3:.1f} kPa (max_pressure)')


def with_room(protocol: Protocol, model: Bundle) -> Bundle:
    """Return a model that allows the pressures of a protocol: for a simulated rig only."""
    if protocol.motor_units != model.n:
        return model
    units = [unit if value <= unit.max_pressure * (1.0 + ROUNDING)
             else replace(unit, max_pressure=value)
             for unit, value in zip(model.motor_units, protocol.highest)]
    return Bundle(model.name, units, model.effects, model.error, model.notes)


def _load(protocol: Protocol) -> dict[str, Any]:
    """Return the load of a simulated rig: a dynamometer where one is needed, else a mass."""
    if not protocol.imposes_strain:
        return {'load.kind': 'mass_spring'}
    first = next(each.course.start.strain for each in segments(protocol)
                 if each.course.start.strain is not None)
    return {'load.kind': 'dynamometer', 'load.strain': first}


def _drive(spinner: Spinner, node: Measuring, run: ProtocolRun, ended: Callable[[], bool],
           rig: bool, protocol: Protocol, progress: Callable[[float, str], None] | None) -> None:
    """Spin until the experiment is over; vent the bundle in any case."""
    total, until = run.left, partial(spinner.until, ended=ended)
    if rig:
        _meet(node, until, protocol)
    node.started = True
    begun = time.monotonic()
    try:
        if rig:
            _enable(node, until)
        while not (run.done or node.stopped or ended()):
            spinner.spin(_SLICE)
            if progress:
                share = 1.0 - run.left / total
                took = time.monotonic() - begun
                # A rig runs in real time; for a simulation, extrapolate the time so far.
                left = run.left if rig or share <= 0.0 else took * (1.0 - share) / share
                progress(share, f'{run.words}; {minutes(left)} left')
        if node.stopped:
            if node.stopped == _CUT:
                until(lambda: bool(node.reason), _REASON)
            raise Stopped(': '.join(part for part in (node.stopped, node.reason) if part))
    finally:
        if rig:
            future = node.enable_client.call_async(SetBool.Request(data=False))
            spinner.until(future.done, _ANSWER)
    if not run.done:
        raise KeyboardInterrupt


def _meet(node: Measuring, until: Callable[[Callable[[], bool], float], bool],
          protocol: Protocol) -> None:
    """Wait until rig and controller are found."""
    pressures, strain = (node.resolve_topic_name(name) for name in (
        interface.REFERENCE_PRESSURES, interface.REFERENCE_DYNAMOMETER))
    missing: Sequence[tuple[str, Callable[[], bool]]] = (
        ('no samples of a bundle', lambda: node.heard > 0.0),
        (f'{pressures} has no subscriber: no recruitment controller',
         lambda: node.count_subscribers(pressures) > 0 and node.enable_client.service_is_ready()),
        (f'{strain} has no subscriber, and the protocol needs a dynamometer',
         lambda: not protocol.imposes_strain or node.count_subscribers(strain) > 0))
    for what, there in missing:
        if not until(there, _PATIENCE):
            raise InputError(f'{what} under {node.get_namespace()}; is the rig running, in this '
                             'ROS domain?')
    # A generator with give_way stops at the first pressure reference that it receives.
    met = time.monotonic()
    # Another publisher may not be discovered yet.
    if not until(lambda: time.monotonic() - max(node.other[1], met) > _QUIET, 4 * _QUIET):
        raise InputError(f'another node sends {node.resolve_topic_name(node.other[0])}; end it, '
                         'or set give_way of reference_generator to true')
    asked = GetParameters.Request(names=['reference_timeout'])
    future = node.parameter_client.call_async(asked)
    until(lambda: bool(future.done()), _ANSWER)
    if future.done() and not future.result().values[0].double_value > 0.0:
        raise InputError('reference_timeout of the recruitment controller is 0; expected more, '
                         'say 1 s: were this process killed, the muscles would stay filled')


def _enable(node: Measuring, until: Callable[[Callable[[], bool], float], bool]) -> None:
    future = node.enable_client.call_async(SetBool.Request(data=True))
    until(lambda: bool(future.done()), _ANSWER)
    answer = future.result() if future.done() else None
    if answer is None or not answer.success:
        node.stopped = node.stopped or 'not enabled: ' + (
            answer.message if answer else f'no answer within {_ANSWER:g} s')
