# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The closed loop without ROS: rig, pressure loops and recruitment controller in one process.

The same step functions as in the nodes, in the same order per tick (`fam_bundle_ros.closed_loop`):
readings -> recruitment -> pressure loops -> valves. Compiled if numba is installed, else plain
Python with the same results. Deterministic for a seed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros import kernels
from fam_bundle_ros.closed_loop import (
    closed_loop,
    columns,
    EACH_UNIT,
    LoopConfig,
    LoopState,
    Plan,
    SINGLE,
)
from fam_bundle_ros.control.controller import ControllerConfig, RecruitmentController
from fam_bundle_ros.control.outer import LoadModel
from fam_bundle_ros.control.outer_loop import KINDS
from fam_bundle_ros.control.pid import pid_settings, PidConfig, PidGains
from fam_bundle_ros.control.pressure_loop import PidState
from fam_bundle_ros.control.reasons import from_row, ROW, sentence
from fam_bundle_ros.control.saturation import SATURATION
from fam_bundle_ros.control.signals import command_record, MeasurementRecord
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Dynamometer, Faults, Load, rig_for, RigConfig
from fam_bundle_ros.plant.faults import fault_record
from fam_bundle_ros.plant.rig import changed_load, Rig

#: Ticks between two calls of the progress function.
_CHUNK = 256


@dataclass(frozen=True)
class Trajectory:
    """
    A reference over time, and the load.

    Parameters
    ----------
    name : str
    kind : str
        ``force`` (N) or ``strain``.
    duration : float, s
    value, rate : callable
        Functions of the time in s; the rate is per second.
    load : Load
    imposed : callable, optional
        Strain over time that a dynamometer imposes.
    events : tuple of (time, dict)
        Changes of the load during the run, for example ``(2.0, {'mass': 8.0})``.
    prepare : float, s
        Time before 0 for a smooth transition to the start of the trajectory, not logged.
    faults : tuple of (time, Faults)
        Faults from a time on, which replace the ones before.
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
    faults: tuple[tuple[float, Faults], ...] = ()


@dataclass(frozen=True)
class Log:
    """
    Record of a run, one row per tick; SI units, pressures gauge.

    Attributes
    ----------
    time, reference, demand, strain, force, supply : ndarray (T,)
        Strain and force are true values, not readings.
    pressure, setpoint, command : ndarray (T, n)
    state : ndarray (T,) of int
    share : ndarray (T, n)
    saturated : ndarray (T,) of str
    overlap : ndarray (T, 2), N
        Overlap of the present state with the next one, by the controller's model: from the
        largest demand at which the next unit is recruited without a dip to the largest force.
    air, work : ndarray (T,), kg and J
        Air drawn from the supply and work done on the load since the start.
    decisions : list of (time, str)
    kind : str
        Kind of the reference.
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
        """Reference minus controlled variable, N or strain, shape (T,)."""
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
    """Return the controller's model of a load, with its initial parameters."""
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
    plant : Bundle or ForeignPlant
        Plant of the rig.
    model : Bundle, optional
        Model of the controller; the plant by default, which must then be a Bundle.
    controller : ControllerConfig
    rig : RigConfig, optional
        Its load is replaced by the trajectory's; `rig_for` the model by default.
    period : float, s
        Period of the recruitment controller.
    pid_period : float, s
        Period of the pressure loops; ``period`` is a multiple of it.
    gains : PidGains
    pid : PidConfig, optional
        From the rig's valve, supply and sensor noise by default.
    noise_factor : float
        Factor on the noise of every sensor.
    seed : int
    compiled : bool, optional
        By default if numba is installed and can compile plant and model; the first run with a
        number of motor units then takes some time.
    deviation : (float, float)
        Factor on the deviation of the controlled reading from the second number (N or strain),
        from the start of the log on: changes the loop gain.
    told_load : bool
        Whether the controller has a model of the load (`load_model_of`).

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

    def __init__(self, plant: Any, model: Bundle | None = None,
                 controller: ControllerConfig = ControllerConfig(),
                 rig: RigConfig | None = None, period: float = 4e-3, pid_period: float = 2e-3,
                 gains: PidGains = PidGains(), pid: PidConfig | None = None,
                 noise_factor: float = 1.0, seed: int = 0, compiled: bool | None = None,
                 deviation: tuple[float, float] = (1.0, 0.0), told_load: bool = True):
        self.plant, self.model = plant, model or plant
        if not isinstance(self.model, Bundle):
            raise InputError(f'{type(plant).__name__} is no model that a controller can invert; '
                             'expected model=, a Bundle')
        rig = rig or rig_for(self.model)
        self.controller_config, self.rig_config = controller, rig
        self.ticks = max(1, round(period / pid_period))
        self.pid_period = pid_period
        self.gains, self.noise_factor, self.seed = gains, noise_factor, seed
        self.pid_config = pid or pid_config(rig, pid_period, noise_factor)
        self.compiled, self.told_load = compiled, told_load
        self.deviation = float(deviation[0]), float(deviation[1])

    def run(self, trajectory: Trajectory,
            progress: Callable[[float], None] | None = None) -> Log:
        """
        Run a trajectory from a vented start.

        Parameters
        ----------
        trajectory : Trajectory
        progress : callable, optional
            Called regularly with the simulated time, s.

        Raises
        ------
        InputError
            When a load cannot change as in an event, or an imposed strain is out of range.
        """
        run = Run(self, trajectory)
        chunk = _CHUNK if progress else run.ticks
        while run.done < run.ticks:
            if progress:
                progress(run.done * run.period - trajectory.prepare)
            run.advance(min(run.done + chunk, run.ticks))
        return run.log()


class Run:
    """
    One run of a `ClosedLoop` that can be advanced in steps.

    Attributes
    ----------
    ticks, done : int
        Ticks of the controller: all, and those done.
    period : float, s
        Period of the controller.
    state : LoopState, or a record of one
    compiled : bool
    """

    def __init__(self, loop: ClosedLoop, trajectory: Trajectory):
        self.trajectory, self.done = trajectory, 0
        self.period = loop.ticks * loop.pid_period
        self.ticks = round((trajectory.prepare + trajectory.duration) / self.period)
        load = trajectory.load
        if isinstance(load, Dynamometer) and trajectory.imposed is not None:
            load = replace(load, strain=trajectory.imposed(0.0))
        rig = Rig(loop.plant, replace(loop.rig_config, load=load), loop.seed,
                  Faults(noise_factor=loop.noise_factor))
        told = load_model_of(load, rig.length) if loop.told_load else LoadModel()
        controller = RecruitmentController(loop.model, replace(loop.controller_config, load=told))
        self._names = [loop.model.names[i].upper() for i in controller.order]
        self._units = rig.bundle.n
        loads, which_load = self._changes(load, trajectory.events, changed_load)
        faults, which_fault = self._changes(
            rig.faults, trajectory.faults,
            lambda before, now: replace(now, noise_factor=now.noise_factor * loop.noise_factor))
        r = rig.readings
        self._config: Any = LoopConfig(rig.record, rig.sensors, controller.settings,
                                       pid_settings(loop.gains, loop.pid_config),
                                       float(loop.pid_period), loop.ticks, *loop.deviation)
        self.state: Any = LoopState(
            rig.state, rig.shown, controller.memory, command_record(self._units),
            MeasurementRecord(r.force, r.strain, r.strain_rate, r.pressure.tolist()),
            [0.0] * len(rig.shown.shown), [0.0] * self._units)
        self._pids: Any = [PidState() for _ in range(self._units)]
        self._loads: Any = [item.record for item in loads]
        self._faults: Any = [fault_record(item, rig.bundle.pneumatics.leak_rate,
                                          self._units) for item in faults]
        self._plan = self._planned(rig, which_load, which_fault, loop.ticks)
        self._log = np.zeros((self.ticks - self._plan.logged,
                              len(SINGLE) + len(EACH_UNIT) * self._units))
        self._reasons = np.zeros((self.ticks, ROW))
        self._models: Any = (rig.model, controller.model, loop.model.model(False))
        self._step: Any = closed_loop
        self.compiled = bool(loop.compiled) or (loop.compiled is None
                                                and kernels.numba() is not None)
        if self.compiled:
            self._compile(loop, controller, rig.model)
        if not self.compiled:
            self._plan = Plan(*(item.tolist() if isinstance(item, np.ndarray) else item
                                for item in self._plan))

    def _changes(self, first, events, change):
        """Return the successive values of an input, and the index of the valid one per tick."""
        found, which = [first], np.zeros(self.ticks, int)
        for time, new in sorted(events, key=lambda event: event[0]):
            found.append(change(found[-1], new))
            which[self._times() >= time] = len(found) - 1
        return found, which

    def _times(self):
        """Return the time of each tick, s."""
        return np.arange(self.ticks) * self.period - self.trajectory.prepare

    def _planned(self, rig, which_load, which_fault, ticks) -> Plan:
        """Return the plan of the run in arrays."""
        trajectory, times = self.trajectory, self._times().tolist()
        begin = rig.truth.force if trajectory.kind == 'force' else rig.truth.strain
        references = np.array([_reference(trajectory, t, begin) for t in times]).reshape(-1, 2)
        imposed = np.full(self.ticks, math.nan)
        if trajectory.imposed is not None:
            imposed[:] = [Dynamometer(trajectory.imposed(max(t + self.period, 0.0))).strain
                          for t in times]
        value, rate = references.T.copy()
        normal, chance = rig.draws.rows(self.ticks * ticks)
        return Plan(KINDS.index(trajectory.kind), value, rate, imposed, which_load, which_fault,
                    normal, chance, int(np.sum(self._times() < 0.0)))

    def _compile(self, loop, controller, begun) -> None:
        """Convert records and lists for compiled code, if everything can be compiled."""
        try:
            plant, belief, gas = (loop.plant.model(True), controller.belief(True),
                                  loop.model.model(True))
        except kernels.NotCompiled:
            if loop.compiled:
                raise
            self.compiled = False
            return
        plant.memory[:] = begun.memory
        self._models = plant, belief, gas
        self._config, self.state = kernels.pack(self._config), kernels.pack(self.state)
        self._pids, self._loads, self._faults = (
            kernels.pack_all(items) for items in (self._pids, self._loads, self._faults))
        self._step = kernels.compiled(closed_loop)

    def advance(self, tick: int) -> None:
        """Advance to a tick of the controller."""
        self._step(self._config, self.state, self._pids, *self._models, self._loads,
                   self._faults, self._plan, self._log, self._reasons, self.done, tick)
        self.done = tick

    def log(self) -> Log:
        """Return the log of the ticks done so far."""
        trajectory, start = self.trajectory, self._plan.logged
        rows = self._log[:max(self.done - start, 0)]
        begins = self._times()
        times = begins[start:self.done] + self.period
        found = columns(rows, self._units)
        overlap = np.stack([found.pop('overlap_low'), found.pop('overlap_high')], axis=-1)
        found['state'] = found['state'].astype(int)
        found['saturated'] = np.array(SATURATION)[found['saturated'].astype(int)]
        after = float(trajectory.value(self.done * self.period - trajectory.prepare))
        reference = np.append(self._plan.value[start + 1:self.done], after)[:len(times)]
        decided = np.flatnonzero(self._reasons[:self.done, 0])
        decisions = [(float(begins[k]), sentence(from_row(self._reasons[k]), self._names))
                     for k in decided]
        return Log(time=times, reference=reference, overlap=overlap,
                   decisions=decisions, kind=trajectory.kind, **found)


def pid_config(rig: RigConfig, period: float, noise_factor: float = 1.0) -> PidConfig:
    """Return the configuration of a pressure loop for the rig's valve, supply and sensor noise."""
    config = PidConfig(valve=rig.valve, supply=rig.supply.pressure,
                       ambient=rig.ambient_pressure, transport_delay=0.0)
    left = math.sqrt(period / (2.0 * config.filter_time))
    quiet = 3.0 * left * noise_factor * rig.sensors.pressure_noise
    return replace(config, quiet_error=min(max(quiet, 200.0), 3000.0))


def _reference(trajectory, t, begin):
    """Return value and rate of the reference; before 0 a smooth transition from ``begin``."""
    if t >= 0.0:
        return float(trajectory.value(t)), float(trajectory.rate(t))
    span = 0.7 * trajectory.prepare
    x = min((t + trajectory.prepare) / span, 1.0)
    change = trajectory.value(0.0) - begin
    return (float(begin + change * x ** 3 * (10.0 - 15.0 * x + 6.0 * x * x)),
            float(change / span * 30.0 * x * x * (1.0 - x) ** 2))
