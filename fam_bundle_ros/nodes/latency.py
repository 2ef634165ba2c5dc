# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Measures a graph of nodes: time from a sample to the last valve command that answers it.

The same stopwatch measures at the rig of the bundle's own graph and at that of the empty graph
(`fam_bundle_ros.nodes.empty`). One call of `measure` runs one graph; `fam_bundle bench` calls it
in a process of its own.
"""

from collections.abc import Callable
import cProfile
from dataclasses import replace
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.empty import empty_node, EmptyRig, roles
from fam_bundle_ros.nodes.models import model_in
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.process import node_command, ros_context
from fam_bundle_ros.nodes.session import DESKTOP
from fam_bundle_ros.resources import config_path

#: Answers before the measurement begins: nodes are discovered, caches fill.
_WARM_UP = 100
#: Time-out of the first answer, s.
_PATIENCE = 20.0


class Stopwatch:
    """Times samples of a rig from the first message to the last valve command of each."""

    def __init__(self, units: int):
        self._units = units
        self._open: dict[int, tuple[float, int]] = {}
        self._last = -1
        self.future: Future | None = None
        self.begin(float('inf'), _WARM_UP)

    def begin(self, seconds: float, answers: float = float('inf')) -> None:
        """Restart the measurement; it ends after a time or a number of answers."""
        self.start, self._seconds, self._answers = time.perf_counter(), seconds, answers
        self.sent = 0
        #: Time from sample to last answer for each answered sample, s.
        self.latencies: list[float] = []

    @property
    def elapsed(self) -> float:
        """Time since `begin`, s."""
        return time.perf_counter() - self.start

    def sample(self, stamp: int) -> None:
        """Note that a message of a sample is about to be sent: the first one counts."""
        if stamp == self._last:
            return
        self._last = stamp
        self.sent += 1
        self._open[stamp] = (time.perf_counter(), self._units)
        if self.future is not None and (self.elapsed > self._seconds
                                        or len(self.latencies) >= self._answers):
            self.future.set_result(None)

    def answer(self, stamp: int) -> None:
        """Note that a valve command has come."""
        if stamp in self._open:
            begin, left = self._open[stamp]
            self._open[stamp] = (begin, left - 1)
            if left == 1:
                del self._open[stamp]
                self.latencies.append(time.perf_counter() - begin)


class _Timed:
    """Adds a stopwatch to a rig: times the samples it publishes and the valve commands it gets."""

    def __init__(self, watch: Stopwatch, *arguments: Any, **keywords: Any):
        self._watch = watch
        super().__init__(*arguments, **keywords)

    def publisher(self, topic: str, kind: Any, *qos: Any) -> Any:
        publisher = super().publisher(topic, kind, *qos)  # type: ignore[misc]
        if topic in (interface.FORCE, interface.STRAIN, interface.pressure_topic(1)):
            publish = publisher.publish

            def timed(message: Any) -> None:
                self._watch.sample(interface.stamp_ns(message.header.stamp))
                publish(message)
            publisher.publish = timed
        return publisher

    def subscribe(self, topic: str, kind: Any, callback: Callable[[Any], None],
                  *qos: Any) -> Any:
        def timed(message: Any) -> None:
            self._watch.answer(interface.stamp_ns(message.header.stamp))
            callback(message)
        valve = topic.endswith(interface.valve_topic(1).partition('/')[2])
        return super().subscribe(topic, kind, timed if valve else callback,  # type: ignore[misc]
                                 *qos)


class TimedSimulator(_Timed, PlantSimulator):
    """The bundle's simulated rig with a stopwatch."""


class TimedEmptyRig(_Timed, EmptyRig):
    """The empty rig with a stopwatch."""


def measure(graph: str, rate: float = 200.0, units: int = 2, seconds: float = 4.0,
            lock_step: bool = False, processes: bool = False,
            profile: str = '') -> dict[str, Any]:
    """
    Run a graph for some time and return the statistics of its latency.

    Parameters
    ----------
    graph : str
        ``bundle`` (its nodes), ``empty`` (empty nodes), ``pids`` (its pressure loops among them).
    rate : float, Hz
        Of the samples.
    units : int
    seconds : float
    lock_step : bool
    processes : bool
        Every node in a process of its own.
    profile : str
        File for the profile of this process (CPU time); none when empty.

    Returns
    -------
    dict
        ``median``, ``p99``, ``max`` (s), ``answered`` and ``sent`` (1/s), ``cpu`` (of a core,
        this process).
    """
    namespace = f'bench_{os.getpid()}'
    watch = Stopwatch(units)
    children: list[subprocess.Popen] = []
    with (ros_context(log_level='error') as context,
          tempfile.TemporaryDirectory(prefix='fam_bundle_') as scratch):
        values = {'model': model_in(scratch, 'model', _bundle(units)), 'rate': rate,
                  'lock_step': lock_step, 'wait_for_reference': lock_step,
                  'publish_clock': False, 'start_stopped': False, 'start_enabled': True,
                  'trajectory': 'trajectories/force_ramp.yaml', 'repeat': True,
                  'load.kind': 'dynamometer', 'load.strain': 0.1, **DESKTOP,
                  # An empty rig's readings do not follow the valve.
                  'stuck_time': 0.0, 'strain_stuck_time': 0.0}
        nodes = _others(graph, units, values, context, namespace, processes, children)
        where: dict[str, Any] = {'context': context, 'namespace': namespace}
        nodes.append(
            TimedSimulator(watch, overrides=values, **where) if graph == 'bundle'
            else TimedEmptyRig(watch, units, rate, lock_step, **where))
        executor = EventsExecutor(context=context)
        for node in nodes:
            executor.add_node(node)
        try:
            _until(executor, watch, _PATIENCE)
            if not watch.latencies:
                raise RuntimeError(f'{graph}: no sample was answered in {_PATIENCE:g} s')
            return _timed(executor, watch, seconds, profile)
        finally:
            for child in children:
                child.kill()
            for child in children:
                child.wait()
            executor.shutdown()
            for node in nodes:
                node.destroy_node()


def _timed(executor: Executor, watch: Stopwatch, seconds: float,
           profile: str) -> dict[str, Any]:
    profiler = cProfile.Profile(time.thread_time)
    watch.begin(seconds)
    cpu = time.process_time()
    if profile:
        profiler.enable()
    _until(executor, watch, seconds + 1.0)
    profiler.disable()
    cpu, elapsed = time.process_time() - cpu, watch.elapsed
    if profile:
        profiler.dump_stats(profile)
    found = sorted(watch.latencies)
    if not found:
        raise RuntimeError(f'no sample was answered in {seconds:g} s')
    return {'median': found[len(found) // 2], 'p99': found[int(0.99 * len(found))],
            'max': found[-1], 'answered': len(found) / elapsed, 'sent': watch.sent / elapsed,
            'cpu': cpu / elapsed}


def _until(executor: Executor, watch: Stopwatch, limit: float) -> None:
    """Run until the measurement has ended, for ``limit`` (s) at most."""
    watch.future = Future(executor=executor)
    executor.spin_until_future_complete(watch.future, timeout_sec=limit)


def _others(graph: str, units: int, values: dict[str, Any], context: Context, namespace: str,
            processes: bool, children: list[subprocess.Popen]) -> list[Node]:
    """Return all nodes but the rig that run in this process; start the others."""
    lock_step = values['lock_step']
    if processes:
        for role in roles(units):
            children.append(subprocess.Popen(
                _own(role, values, namespace) if graph == 'bundle' else
                [sys.executable, '-m', 'fam_bundle_ros.nodes.empty', role, str(units),
                 str(lock_step), namespace]))
        return []
    if graph == 'bundle':
        return list(make_nodes(context, namespace, overrides={**values, 'simulate': False}))
    nodes: list[Node] = []
    for role in roles(units):
        if graph == 'pids' and role.startswith('pressure_pid'):
            nodes.append(PressurePidNode(int(role.rpartition('mu')[2]), context=context,
                                         namespace=namespace, overrides=values))
        else:
            nodes.append(empty_node(role, units, lock_step, context, namespace))
    return nodes


def _own(role: str, values: dict[str, Any], namespace: str) -> list[str]:
    """Return the command that starts one of the bundle's nodes."""
    module, _, unit = role.partition('_mu')
    given = {**values, **({'motor_unit': int(unit)} if unit else {})}
    return [*node_command(module, given, f'/{namespace}'), '-r', f'__node:={role}',
            '--log-level', 'error']


def _bundle(units: int) -> Bundle:
    """Return the bundle of the paper, or for other numbers of units copies of its first unit."""
    paper = load_model(config_path('models/spie2021.yaml'))
    first = paper.motor_units[0]
    return paper if units == 2 else Bundle(
        f'units{units}', [replace(first, name=name) for name in interface.unit_names(units)],
        paper.effects)
