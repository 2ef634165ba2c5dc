# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs each node in a process of its own, kills or stops one, and judges the outcome.

On real ROS and in wall time, on the simulated rig at 6 bar and without a trip of its own. The
verdict uses what a rig sees: valve commands, `supply_enable`, pressures (of healthy sensors).
"""

from collections.abc import Callable, Sequence
from contextlib import closing, ExitStack
from dataclasses import dataclass
from functools import partial
from importlib import import_module
import math
import os
from pathlib import Path
import signal
import subprocess
import tempfile
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, COMMON
from fam_bundle_ros.nodes.process import node_command, ros_context, Spinner
from fam_bundle_ros.plant import ChamberConfig

UNITS = 2
#: Name in the table, module of the executable, its own parameters.
NODES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ('plant_simulator', 'plant_simulator', {
        'start_stopped': False, 'load.kind': 'dynamometer', 'load.strain': 0.1,
        'supply.pressure': 600e3, 'trip_pressure': 1.4e6, 'rate': 100.0}),
    ('pressure_pid_mu1', 'pressure_pid', {'motor_unit': 1, 'supply.pressure': 600e3}),
    ('pressure_pid_mu2', 'pressure_pid', {'motor_unit': 2, 'supply.pressure': 600e3}),
    ('recruitment_controller', 'recruitment_controller', {'rate': 100.0}),
    ('reference_generator', 'reference_generator', {'prepare': 0.0}),
)
#: Events: name, whether the process is killed (else stopped), and after how many seconds it is
#: started again (resumed); None for never.
EVENTS = (('killed', True, None), ('killed, started again', True, 3.0),
          ('stopped for 3 s', False, 3.0))
ALL_NODES = tuple(item[0] for item in NODES)
ALL_EVENTS = tuple(item[0] for item in EVENTS)
#: Time for which the force must be reached before the event, and time-out of a service, s.
_STEADY, _ANSWERED = 1.0, 2.0
#: Force (N), observation time after the last event (s), time-out of the start (s).
_FORCE, _WATCHED, _PATIENCE = 100.0, 3.0, 40.0
#: A valve that exhausts for less than this is regulating, s.
_LASTING = 0.05
#: Pressures below which a unit is vented, and above which it is filled again, Pa (gauge).
_VENTED, _BACK = 20e3, 40e3
#: Time-outs after which the rig itself vents a unit (commands) and shuts the supply
#: (`supply_enable`), s.
_COMMAND_TIMEOUT, _SUPPLY_TIMEOUT = 0.5, 2.0
#: Five processes on a desktop are delayed for longer than the watchdogs of a rig allow.
_DESKTOP = {'sensor_timeout': 0.5, 'setpoint_timeout': 0.5, 'command_timeout': _COMMAND_TIMEOUT,
            'supply_timeout': _SUPPLY_TIMEOUT, 'clocks_synchronised': False}
#: Opening pressure of a relief valve, Pa (gauge). The trip pressure of the controllers plus the
#: inflow of two periods (200 Hz, valve fully open) is higher.
_RELIEF = ChamberConfig().relief_pressure


@dataclass(frozen=True)
class _Row:
    """State at a time (s): pressures (Pa gauge), force (N), exhausting, supply shut."""

    time: float
    pressure: tuple[float, ...]
    force: float
    exhausting: tuple[bool, ...]
    shut: bool


class _Witness(BundleNode):
    """Records the commands that a rig receives and its readings."""

    def __init__(self, context: Context, namespace: str):
        super().__init__('witness', (), context=context, namespace=namespace)
        self.rows: list[_Row] = []
        self._pressure, self._force = [0.0] * UNITS, math.nan
        self._commands = [(-math.inf, -1.0)] * UNITS
        self._supply = (-math.inf, True)
        self.subscribe(interface.FORCE, WrenchStamped, self._on_force)
        self.subscribe(interface.SUPPLY_ENABLE, Bool, self._on_supply, interface.REPEATED)
        for i in range(UNITS):
            self.subscribe(interface.pressure_topic(i + 1), FluidPressure,
                           partial(self._on_pressure, i))
            self.subscribe(interface.valve_topic(i + 1), JointState,
                           partial(self._on_command, i))
        self.enable = self.create_client(SetBool, interface.ENABLE)
        self.every(0.01, self._note)

    def _on_force(self, message: WrenchStamped) -> None:
        self._force = interface.read_force(message)

    def _on_supply(self, message: Bool) -> None:
        self._supply = (time.monotonic(), bool(message.data))

    def _on_pressure(self, unit: int, message: FluidPressure) -> None:
        self._pressure[unit] = interface.read_pressure(message, self.ambient)

    def _on_command(self, unit: int, message: JointState) -> None:
        self._commands[unit] = (time.monotonic(), interface.read_valve(message, unit + 1))

    def _note(self) -> None:
        now = time.monotonic()
        heard, permitted = self._supply
        # Before the first message the supply is not shut.
        shut = math.isfinite(heard) and (not permitted or now - heard > _SUPPLY_TIMEOUT)
        self.rows.append(_Row(now, tuple(self._pressure), self._force, tuple(
            value < -0.5 or now - came > _COMMAND_TIMEOUT for came, value in self._commands),
            shut))


def _start(module: str, parameters: dict[str, Any], namespace: str, log: Path,
           domain: int | None) -> subprocess.Popen:
    """Start a node in a process of its own."""
    specs = import_module(f'fam_bundle_ros.nodes.{module}').SPECS
    known = {spec.name for spec in (*COMMON, *specs)}
    parameters = {**{name: value for name, value in _DESKTOP.items() if name in known},
                  **parameters}
    with log.open('ab') as output:
        return subprocess.Popen(
            node_command(module, parameters, namespace), stdout=output, stderr=output,
            env=os.environ | ({} if domain is None else {'ROS_DOMAIN_ID': str(domain)}))


def _kill(process: subprocess.Popen) -> None:
    process.kill()
    process.wait()


def run_processes(progress: Callable[[int, int, str], None] = lambda done, every, what: None,
                  nodes: Sequence[str] = ALL_NODES, events: Sequence[str] = ALL_EVENTS,
                  domain: int | None = None) -> list[dict[str, Any]]:
    """
    Return a row for each node and event, the worst first.

    Parameters
    ----------
    progress : callable
        Called with the number of cases done, the number of cases, and the next one.
    nodes, events : sequence of str
        Some of `NODES` and `EVENTS`.

    Returns
    -------
    list of dict
        ``node``, ``event``, ``verdict`` (unsafe, harmless, safe), ``time_to_detect`` and
        ``time_to_safe`` (s from the signal, None for never), ``pressure`` (Pa), ``force`` (N),
        ``came_back``, ``enable`` (what the service answered in the end).

    Raises
    ------
    InputError
        When the bundle does not reach its force before the event.
    """
    cases = [(node, event) for node in nodes for event in EVENTS if event[0] in events]
    rows = []
    for k, (node, (event, kill, again)) in enumerate(cases):
        progress(k, len(cases), f'{node} {event}')
        rows.append(_run(node, event, kill, again, f'/processes_{k}', domain))
    order = ('unsafe', 'harmless', 'safe')
    return sorted(rows, key=lambda row: (order.index(row['verdict']), -row['pressure']))


def _run(name: str, event: str, kill: bool, again: float | None, namespace: str,
         domain: int | None) -> dict[str, Any]:
    started: dict[str, subprocess.Popen] = {}
    with ExitStack() as ending:
        context = ending.enter_context(ros_context(domain))
        scratch = ending.enter_context(tempfile.TemporaryDirectory(prefix='fam_bundle_'))
        trajectory, log = Path(scratch, 'hold.yaml'), Path(scratch, 'log')
        trajectory.write_text('format: fam-bundle-trajectory/1\nquantity: force\n'
                              f'points: [[0 s, {_FORCE:g} N], [600 s, {_FORCE:g} N]]\n')

        def start(which: str) -> None:
            module, own = next(item[1:] for item in NODES if item[0] == which)
            more = {'trajectory': trajectory} if which == 'reference_generator' else {}
            started[which] = _start(module, {**own, **more}, namespace, log, domain)
            ending.callback(_kill, started[which])
        witness = _Witness(context, namespace)
        spinner = ending.enter_context(closing(Spinner(context, [witness])))
        for which, _, _ in NODES:
            start(which)
        _reach(spinner, witness, log)
        struck = time.monotonic()
        if kill:
            _kill(started[name])
        else:
            started[name].send_signal(signal.SIGSTOP)
        spinner.spin(again if again is not None else _WATCHED)
        if again is not None:
            if kill:
                start(name)
            else:
                started[name].send_signal(signal.SIGCONT)
            # A process takes some seconds to start and to be found.
            spinner.spin(_WATCHED + (2.0 if kill else 0.0))
        answer = _enable(spinner, witness, _ANSWERED)
    # Without rig or pressure loop `enable` must refuse.
    gone = again is None and name not in ('reference_generator', 'recruitment_controller')
    return {'node': name, 'event': event, **_judge(witness.rows, struck, gone, answer)}


def _reach(spinner: Spinner, witness: _Witness, log: Path) -> None:
    """Enable, and wait until the force has been held for a while."""
    end = time.monotonic() + _PATIENCE
    reached: float | None = None
    asked = 0.0
    while reached is None or time.monotonic() - reached < _STEADY:
        spinner.spin(0.05)
        now = time.monotonic()
        row = witness.rows[-1] if witness.rows else None
        if row is None or not abs(row.force - _FORCE) < 0.1 * _FORCE:
            reached = None
        elif reached is None:
            reached = now
        if reached is None and now - asked > 1.0:
            asked = now
            _enable(spinner, witness, 0.5)
        if now > end:
            raise InputError(f'the bundle does not reach {_FORCE:g} N in {_PATIENCE:g} s; its '
                             f'nodes said: {log.read_text(errors="replace")[-500:]}')
    witness.rows.clear()


def _enable(spinner: Spinner, witness: _Witness, patience: float) -> str:
    """Return the answer of `enable`, in a word."""
    if not witness.enable.service_is_ready():
        return 'not there'
    future = witness.enable.call_async(SetBool.Request(data=True))
    if not spinner.until(future.done, patience):
        return 'no answer'
    return 'accepted' if future.result().success else 'refused'


def _judge(rows: Sequence[_Row], struck: float, refuse: bool, answer: str) -> dict[str, Any]:
    """Return the outcome; ``refuse`` where `enable` has to refuse."""
    after = [row for row in rows if row.time >= struck]
    sign = _lasting(after, lambda row: row.shut or any(row.exhausting))
    safe = _lasting(after, lambda row: row.shut or all(row.exhausting))
    pressure = max(max(row.pressure) for row in after)
    back = False
    for unit in range(UNITS):
        vented = next((row.time for row in after if row.pressure[unit] < _VENTED), math.inf)
        back = back or any(row.time > vented and row.pressure[unit] > _BACK for row in after)
    wrong = back or pressure > _RELIEF or (refuse and answer == 'accepted')
    return {'time_to_detect': None if sign is None else sign - struck,
            'time_to_safe': None if safe is None else safe - struck, 'pressure': pressure,
            'force': max(row.force for row in after), 'came_back': back, 'enable': answer,
            'verdict': 'unsafe' if wrong else 'harmless' if safe is None else 'safe'}


def _lasting(rows: Sequence[_Row], holds: Callable[[_Row], bool]) -> float | None:
    """Return from when on a condition holds for `_LASTING` at least; None for never."""
    since: float | None = None
    for row in rows:
        since = (row.time if since is None else since) if holds(row) else None
        if since is not None and row.time - since >= _LASTING:
            return since
    return None
