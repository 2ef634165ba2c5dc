# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The closed loop without ROS: rig, pressure loops and recruitment controller in one process.

The same classes as behind the nodes, in the same order per tick: readings -> recruitment ->
pressure loops -> valves. Deterministic for a seed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros.control.controller import ControllerConfig, RecruitmentController
from fam_bundle_ros.control.outer import LoadModel
from fam_bundle_ros.control.pid import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.signals import Measurement, Reference
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Dynamometer, Load, Rig, RigConfig


@dataclass(frozen=True)
class Trajectory:
    """
    What is asked over time, and on what load.

    Parameters
    ----------
    name : str
    kind : str
        ``force`` (N) or ``strain``.
    duration : float, s
    value, rate : callable
        Of the time in s; per second for the rate.
    load : Load
    imposed : callable, optional
        Strain over time that a dynamometer imposes.
    events : tuple of (time, dict)
        Changes of the load in motion, say ``(2.0, {'mass': 8.0})``.
    prepare : float, s
        Time before 0 in which the start of the trajectory is taken up gently, not logged.
    """

    name: str
    kind: str
    duration: float
    value: Callable[[float], float]
    rate: Callable[[float], float]
    load: Load = field(default_factory=Dynamometer)
    imposed: Callable[[float], float] | None = None
    events: tuple[tuple[float, dict[str, float]], ...] = ()
    prepare: float = 0.0


@dataclass(frozen=True)
class Log:
    """
    What happened, one row per tick; SI units, pressures gauge.

    Attributes
    ----------
    time, reference, demand, strain, force, supply : ndarray (T,)
        Strain and force are true values, not readings.
    pressure, setpoint, command : ndarray (T, n)
    state : ndarray (T,) of int
    share : ndarray (T, n)
    saturated : ndarray (T,) of str
    overlap : ndarray (T, 2), N
        Of the present state with the next one, after the controller's model: from the demand
        up to which the next unit can be crossed without a dip to the largest force.
    air, work : ndarray (T,), kg and J
        Drawn from the supply and done on the load so far.
    decisions : list of (time, str)
    kind : str
        Of the reference.
    """

    time: np.ndarray
    reference: np.ndarray
    demand: np.ndarray
    strain: np.ndarray
    force: np.ndarray
    supply: np.ndarray
    pressure: np.ndarray
    setpoint: np.ndarray
    command: np.ndarray
    state: np.ndarray
    share: np.ndarray
    saturated: np.ndarray
    overlap: np.ndarray
    air: np.ndarray
    work: np.ndarray
    decisions: list[tuple[float, str]]
    kind: str

    @property
    def error(self) -> np.ndarray:
        """Reference minus what was controlled, N or strain, shape (T,)."""
        return self.reference - (self.force if self.kind == 'force' else self.strain)

    @property
    def switches(self) -> np.ndarray:
        """Indices of the ticks in which the recruitment state changed."""
        return np.flatnonzero(np.diff(self.state)) + 1

    def to_frame(self):
        """Return a pandas DataFrame, one column per channel and motor unit."""
        import pandas
        columns: dict[str, Any] = {}
        for name in ('time', 'reference', 'demand', 'strain', 'force', 'supply', 'state',
                     'saturated', 'air', 'work'):
            columns[name] = getattr(self, name)
        for name in ('pressure', 'setpoint', 'command', 'share'):
            for i, column in enumerate(getattr(self, name).T):
                columns[f'{name}.mu{i + 1}'] = column
        return pandas.DataFrame(columns)


def load_model_of(load: Load, length: float) -> LoadModel:
    """Return what a user would tell the controller of a load: its values at the start."""
    if isinstance(load, Dynamometer):
        return LoadModel()
    strains = np.linspace(0.0, 0.25, 11)
    table = tuple((float(e), load.holding_force(float(e), length)) for e in strains)
    return LoadModel(inertia=load.inertia(0.1, length), damping=load.drag(length), table=table)


class ClosedLoop:
    """
    A simulated rig under recruitment control.

    Parameters
    ----------
    plant : Bundle
        What the rig is made of.
    model : Bundle, optional
        What the controller believes; the plant's by default.
    controller : ControllerConfig
    rig : RigConfig
        Its load is taken from the trajectory.
    period : float, s
        Of the recruitment controller.
    pid_period : float, s
        Of the pressure loops; ``period`` is a multiple of it.
    gains : PidGains
    pid : PidConfig, optional
        From the rig's valve, supply and sensor noise by default.
    noise_factor : float
        On the noise of every sensor.
    seed : int

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> from fam_bundle_ros.plant import Dynamometer
    >>> loop = ClosedLoop(load_model('config/models/spie2021.yaml'), seed=1)
    >>> hold = Trajectory('hold', 'force', 1.0, lambda t: 30.0, lambda t: 0.0, Dynamometer(0.16))
    >>> log = loop.run(hold)
    >>> bool(abs(log.error[-100:].mean()) < 0.3)
    True
    """

    def __init__(self, plant: Bundle, model: Bundle | None = None,
                 controller: ControllerConfig = ControllerConfig(),
                 rig: RigConfig = RigConfig(), period: float = 4e-3, pid_period: float = 2e-3,
                 gains: PidGains = PidGains(), pid: PidConfig | None = None,
                 noise_factor: float = 1.0, seed: int = 0):
        self.plant, self.model = plant, model or plant
        self.controller_config, self.rig_config = controller, rig
        self.ticks = max(1, round(period / pid_period))
        self.pid_period = pid_period
        self.gains, self.noise_factor, self.seed = gains, noise_factor, seed
        self.pid_config = pid or pid_config(rig, pid_period, noise_factor)

    def run(self, trajectory: Trajectory,
            progress: Callable[[float], None] | None = None) -> Log:
        """
        Run a trajectory from a vented start.

        Parameters
        ----------
        trajectory : Trajectory
        progress : callable, optional
            Called now and then with the time done, in s.

        Returns
        -------
        Log
        """
        load = trajectory.load
        if isinstance(load, Dynamometer) and trajectory.imposed is not None:
            load = replace(load, strain=trajectory.imposed(0.0))
        rig = Rig(self.plant, replace(self.rig_config, load=load), seed=self.seed)
        rig.faults.noise_factor = self.noise_factor
        controller = RecruitmentController(
            self.model, replace(self.controller_config, load=load_model_of(load, rig.length)))
        pids = [PressurePid(self.gains, self.pid_config) for _ in range(self.plant.n)]
        events = sorted(trajectory.events, key=lambda event: event[0])
        tube = self.rig_config.chamber.tube_volume
        rows, decisions = [], []
        readings = rig.readings
        begin = rig.truth.force if trajectory.kind == 'force' else rig.truth.strain
        dt = self.ticks * self.pid_period
        for tick in range(round((trajectory.prepare + trajectory.duration) / dt)):
            t = tick * dt - trajectory.prepare
            while events and events[0][0] <= t:
                rig.change_load(**events.pop(0)[1])
            reference = _reference(trajectory, t, begin)
            command = controller.update(dt, _measurement(readings), reference)
            if command.explanation:
                decisions.append((t, command.explanation))
            if trajectory.imposed is not None:
                target = trajectory.imposed(max(t + dt, 0.0))
                rig.impose_strain(target, abs(target - rig.truth.strain) / dt)
            for _ in range(self.ticks):
                volume = self.model.gas_volume(readings.strain) + tube
                flow = self.model.gas_volume_slope(readings.strain) * readings.strain_rate
                valves = [pid.update(float(p), float(m), self.pid_period, readings.supply,
                                     float(v), float(q))
                          for pid, p, m, v, q in zip(pids, command.pressure, readings.pressure,
                                                     volume, flow)]
                readings = rig.step(valves, self.pid_period)
            if t >= 0.0:
                rows.append(self._row(t + dt, trajectory, command, rig, valves))
            if progress and tick % 256 == 0:
                progress(t)
        return _log(rows, decisions, trajectory.kind)

    @staticmethod
    def _row(t, trajectory, command, rig, valves):
        truth = rig.truth
        overlap = (command.margins.limit - command.margins.width, command.margins.limit)
        return (t, trajectory.value(t), command.demand, truth.strain, truth.force, truth.supply,
                truth.pressure, command.pressure, np.array(valves), command.state, command.share,
                command.saturated, overlap, rig.air_mass, rig.work)


def pid_config(rig: RigConfig, period: float, noise_factor: float = 1.0) -> PidConfig:
    """Return a pressure loop that knows the rig's valve, supply and sensor noise."""
    config = PidConfig(valve=rig.valve, supply=rig.supply.pressure,
                       ambient=rig.ambient_pressure, flow_lag=1e-3 + 0.5 * period)
    left = math.sqrt(period / (2.0 * config.filter_time))
    quiet = 3.0 * left * noise_factor * rig.sensors.pressure_noise
    return replace(config, quiet_error=min(max(quiet, 200.0), 3000.0))


def _reference(trajectory, t, begin):
    """Return the reference at a time; before 0 the way from ``begin`` to the start."""
    if t >= 0.0:
        return Reference(trajectory.kind, trajectory.value(t), trajectory.rate(t))
    span = 0.7 * trajectory.prepare
    x = min((t + trajectory.prepare) / span, 1.0)
    change = trajectory.value(0.0) - begin
    return Reference(trajectory.kind, begin + change * x ** 3 * (10.0 - 15.0 * x + 6.0 * x * x),
                     change / span * 30.0 * x * x * (1.0 - x) ** 2)


def _measurement(readings):
    return Measurement(readings.force, readings.strain, readings.strain_rate, readings.pressure)


def _log(rows, decisions, kind) -> Log:
    names = [f.name for f in fields(Log)][:-2]
    columns: dict[str, Any] = {
        name: np.array(column) for name, column in zip(names, zip(*rows))}
    return Log(**columns, decisions=decisions, kind=kind)
