# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs the whole bundle in this process on real ROS, from start to end of a trajectory.

For ``fam_bundle run`` and ``demo``, tests and notebooks: the same nodes as the executables, one
executor, a record of every topic, and the run as a `Log` like that of
`fam_bundle_ros.simulation.ClosedLoop`, so that both can be compared.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, ExitStack
from dataclasses import fields, replace
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from fam_bundle_ros.bagwriter import BagWriter
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.models import bundle_from, model_in
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals
from fam_bundle_ros.nodes.profile import load_profile, Points
from fam_bundle_ros.nodes.recording import Recorder
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.reference_generator import ReferenceGenerator
from fam_bundle_ros.nodes.rig_parameters import load_model_parameters
from fam_bundle_ros.plant import Dynamometer, Load, Rig, rig_for, RigConfig
from fam_bundle_ros.simulation import Log, Trajectory

#: Observer of a run, called with trajectory time (s), simulator, all nodes and valve commands.
Watch = Callable[[float, PlantSimulator, Sequence[BundleNode], list[float]], None]

#: Wall time for the last messages to arrive, s.
_DRAIN = 0.3
#: On a desktop, processes are delayed for longer than a rig's watchdogs allow.
DESKTOP = {'sensor_timeout': 1.0, 'setpoint_timeout': 1.0, 'command_timeout': 1.0,
            'supply_timeout': 2.0, 'clocks_synchronised': False}


def run_trajectory(model: Bundle | str | Path, trajectory: Trajectory | Points | str | Path, *,
                   plant_model: Bundle | str | Path | None = None, load: Load | None = None,
                   rig: RigConfig | None = None, rate: float = 200.0, seed: int = 0,
                   lock_step: bool = True, overrides: Mapping[str, Any] | None = None,
                   bag: str | Path | None = None,
                   progress: Callable[[float], None] | None = None,
                   watch: Watch | None = None,
                   namespace: str = interface.NAMESPACE, domain: int | None = None,
                   log_level: str = 'info') -> Log:
    """
    Run a trajectory on a simulated rig over ROS.

    Parameters
    ----------
    model : Bundle or path
        Model of controller and monitor; a path may be the name of a shipped model.
    trajectory : Trajectory, Points or path
        A path may be the name of a shipped trajectory.
    plant_model : Bundle or path, optional
        Model of the rig; ``model`` by default.
    load : Load, optional
        Replaces the trajectory's load; a dynamometer at strain 0.1 if there is neither.
    rig : RigConfig, optional
        Its load is not used; `rig_for` the model by default.
    rate : float, Hz
        Of samples, controller and pressure loops.
    seed : int
    lock_step : bool
        Run as fast as the machine computes, with the same result each time; else in wall time.
    overrides : mapping, optional
        Parameters of nodes, say ``{'policy': 'neglect', 'faults.leak': 'mu1=2.0'}``.
    bag : path, optional
        New folder into which all topics are recorded (mcap).
    progress : callable, optional
        Called with the time of the trajectory, s.
    watch : callable, optional
        Called after each step of the rig with the time of the trajectory (s), the simulator, all
        nodes and the valve commands of the step.
    namespace : str
    domain : int, optional
        ROS domain in which the nodes are visible; by default they are visible nowhere.
    log_level : str
        Of all nodes: debug, info, warn, error, fatal.

    Returns
    -------
    Log
        True values of strain, force and pressure, as `ClosedLoop` gives them.

    Raises
    ------
    InputError
        For bad files or parameters, and where another rig publishes under the same names.
    KeyboardInterrupt
        After Ctrl-C, when everything is vented and the bag is closed.
    """
    plan = _plan(trajectory, load)
    with ExitStack() as ending:
        scratch = ending.enter_context(tempfile.TemporaryDirectory(prefix='fam_bundle_'))
        model_name = _as_file(model, scratch, 'model')
        plant = bundle_from(_as_file(plant_model, scratch, 'plant')
                            if plant_model is not None else model_name)
        config = rig or rig_for(bundle_from(model_name))
        hardware = Rig(plant, replace(config, load=plan.load), seed=seed)
        values = {**_parameters(config, hardware), 'model': model_name, 'rate': rate,
                  'lock_step': lock_step, 'wait_for_reference': lock_step,
                  'publish_clock': lock_step, 'start_enabled': True, 'start_stopped': False,
                  'prepare': plan.prepare, **DESKTOP, **(overrides or {})}
        # Before the first node, as a KeyboardInterrupt in a callback of rclpy would be lost.
        signals = ending.enter_context(StopSignals())
        context = ending.enter_context(ros_context(domain, log_level, alone=domain is None))
        recorders: list[BundleNode] = []
        if bag is not None:
            writer = ending.enter_context(closing(BagWriter(bag)))
            recorder = Recorder(writer, context=context, namespace=namespace)
            recorder.add(interface.topics(hardware.bundle.n))
            recorders.append(recorder)
        script = _Script(plan, watch)
        nodes = [*make_nodes(context, namespace, overrides=values,
                             simulator={'rig': hardware, 'script': script},
                             generator={'profile': plan}), *recorders]
        spinner = ending.enter_context(closing(Spinner(context, nodes)))
        script.controller = next(n for n in nodes if isinstance(n, RecruitmentNode))
        script.simulator = next(n for n in nodes if isinstance(n, PlantSimulator))
        script.nodes = nodes
        script.interrupt = spinner.interrupt
        if not values['lock_step']:
            script.generator = next(n for n in nodes if isinstance(n, ReferenceGenerator))
        while not script.ended and not signals.received:
            spinner.spin(0.2)
            if progress:
                progress(max(script.time, 0.0))
            _refuse_company(nodes[0])
        if signals.received:
            raise KeyboardInterrupt
        spinner.spin(_DRAIN)
        return script.log()


def _refuse_company(node: BundleNode) -> None:
    rigs = node.count_publishers(interface.FORCE)
    if rigs > 1:
        raise InputError(f'{rigs} rigs publish {node.resolve_topic_name(interface.FORCE)}: choose '
                         'another namespace or ROS_DOMAIN_ID')


class _Script:
    """Moves load and dynamometer along the plan, logs every step, and ends the run."""

    def __init__(self, plan: Trajectory, watch: Watch | None):
        self._plan, self._watch = plan, watch
        self._events = sorted(plan.events, key=lambda event: event[0])
        self._faults = sorted(plan.faults, key=lambda event: event[0])
        #: In the order of the columns of `Log`.
        self._rows: list[tuple[Any, ...]] = []
        self._decisions: list[tuple[float, str]] = []
        self._explained = ''
        self._period = 0.0
        #: Gives the time of the trajectory in wall time.
        self.generator: ReferenceGenerator | None = None
        #: Set before the first step.
        self.controller: RecruitmentNode
        self.simulator: PlantSimulator
        self.nodes: Sequence[BundleNode]
        self.interrupt: Callable[[], None]
        #: Time of the trajectory, s.
        self.time = -plan.prepare
        self.ended = False

    def before(self, rig: Rig, time: float, period: float) -> None:
        plan = self._plan
        # In wall time the trajectory begins when the reference generator does, not the rig.
        self.time = (time - plan.prepare if self.generator is None
                     else self.generator.run_time)
        while self._events and self._events[0][0] <= self.time + 1e-9:
            rig.change_load(**self._events.pop(0)[1])
        while self._faults and self._faults[0][0] <= self.time + 1e-9:
            self.simulator.faults = self._faults.pop(0)[1]
        self._period = period
        if plan.imposed is not None:
            target = plan.imposed(max(self.time + period, 0.0))
            rig.impose_strain(target, abs(target - rig.truth.strain) / period)

    def after(self, rig: Rig, time: float, commands: list[float]) -> bool:
        plan, t = self._plan, self.time
        command = self.controller.command
        explanation = command.explanation if command else ''
        if explanation and explanation != self._explained:
            self._decisions.append((t, explanation))
        self._explained = explanation
        self.time = t + self._period
        if self._watch:
            self._watch(self.time, self.simulator, self.nodes, commands)
        if t >= -1e-9:
            truth, n = rig.truth, rig.bundle.n
            margins = command.margins if command else None
            overlap = ((margins.limit - margins.width, margins.limit) if margins
                       else (np.nan, np.nan))
            self._rows.append((
                self.time, plan.value(self.time), command.demand if command else 0.0,
                truth.strain, truth.force, truth.supply, truth.pressure,
                np.array(self.controller.setpoints), np.array(commands),
                command.state if command else 0, command.share if command else np.zeros(n),
                command.saturated if command else '', overlap, rig.air_mass, rig.work))
        self.ended = self.time >= plan.duration - 1e-9
        if self.ended:
            self.interrupt()
        return self.ended

    def log(self) -> Log:
        names = (column.name for column in fields(Log))
        columns = dict(zip(names, map(np.array, zip(*self._rows))))
        return Log(**columns, decisions=self._decisions, kind=self._plan.kind)


def _plan(trajectory: Trajectory | Points | str | Path, load: Load | None) -> Trajectory:
    if isinstance(trajectory, (str, Path)):
        trajectory = load_profile(str(trajectory))
    if isinstance(trajectory, Points):
        return Trajectory(trajectory.name, trajectory.kind, trajectory.duration,
                          trajectory.value, trajectory.rate, load or Dynamometer(strain=0.1))
    load, imposed = load or trajectory.load, trajectory.imposed
    if not isinstance(load, Dynamometer):
        imposed = None
    elif imposed is not None:
        load = Dynamometer(strain=imposed(0.0), speed=load.speed)
    return replace(trajectory, load=load, imposed=imposed)


def _as_file(model: Bundle | str | Path, folder: str, name: str) -> str:
    """Return the path of a model, writing a `Bundle` to a file, as nodes take files."""
    return model_in(folder, name, model) if isinstance(model, Bundle) else str(model)


def _parameters(config: RigConfig, rig: Rig) -> dict[str, Any]:
    """Return the parameters of the rig that a user would set for the controller."""
    return {'ambient_pressure': config.ambient_pressure,
            'supply.pressure': config.supply.pressure,
            'valve.conductance': config.valve.conductance,
            'valve.dead_band': config.valve.dead_band,
            'tube_volume': config.chamber.tube_volume,
            **load_model_parameters(rig.load, rig.length)}
