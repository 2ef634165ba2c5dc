# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The closed loop as one kernel, run by `fam_bundle_ros.simulation`, plain or compiled.

Per tick of the controller: events -> recruitment -> for each tick of the pressure loops: pressure
loops -> rig -> instruments -> log. It is compiled once for each number of motor units; plant and
models are passed as function pointers; references, events and random numbers as arrays.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from fam_bundle_ros.control.pressure_loop import PidSettings, pressure_step
from fam_bundle_ros.control.reasons import NONE, row_of
from fam_bundle_ros.control.recruitment_loop import (
    recruitment_step,
    RecruitmentSettings,
    RecruitmentState,
)
from fam_bundle_ros.control.signals import CommandRecord, MeasurementRecord
from fam_bundle_ros.plant.loads import DYNAMOMETER
from fam_bundle_ros.plant.motion import rig_step, RigRecord, RigState, true_channels
from fam_bundle_ros.plant.sensors import (
    FORCE,
    PRESSURE,
    read_sensors,
    SensorRecord,
    SensorState,
    STRAIN,
    SUPPLY,
)

#: Scalar columns of the log, in their order; the columns of each motor unit follow.
SINGLE = ('demand', 'strain', 'force', 'supply', 'state', 'saturated', 'overlap_low',
          'overlap_high', 'air', 'work')
EACH_UNIT = ('pressure', 'setpoint', 'command', 'share')


@dataclass
class LoopConfig:
    """Constants of a run."""

    rig: RigRecord
    sensors: SensorRecord
    controller: RecruitmentSettings
    pid: PidSettings
    #: s, period of the pressure loops; the controller's period is ``ticks`` of them.
    pid_period: float
    ticks: int
    #: Factor on the deviation of the controlled reading from ``about`` (N or 1), from the start
    #: of the log on: changes the loop gain, to measure margins; 1 for no change.
    deviation: float
    about: float


@dataclass
class LoopState:
    """State of a run, without the memory of the models and of the pressure loops."""

    rig: RigState
    shown: SensorState
    controller: RecruitmentState
    command: CommandRecord
    measured: MeasurementRecord
    #: True values of the sensor channels.
    true: list[float]
    #: Commands of the valves.
    valves: list[float]


class Plan(NamedTuple):
    """
    Inputs of a run for each tick of the controller.

    ``kind`` of the reference; ``value`` and ``rate`` (T,); ``imposed`` (T,) strain of a
    dynamometer at the end of the tick, nan for none; ``load`` and ``fault`` (T,) of int, index of
    the load and of the fault record; ``normal`` and ``chance`` (T x ticks, channels),
    random numbers of the instruments; ``logged`` the first tick that is logged.
    """

    kind: Any
    value: Any
    rate: Any
    imposed: Any
    load: Any
    fault: Any
    normal: Any
    chance: Any
    logged: Any


def closed_loop(config: Any, state: Any, pids: Any, plant: Any, belief: Any, gas: Any,
                loads: Any, faults: Any, plan: Any, log: Any, reasons: Any, first: int,
                last: int) -> None:
    """
    Run ticks ``first`` to ``last`` (not included) of the controller.

    Parameters
    ----------
    config, state : LoopConfig, LoopState
    pids : sequence of PidState
        State of the pressure loop of each motor unit.
    plant : Model
        Plant of the rig.
    belief, gas : Belief, Model
        Model that the controller inverts; model of the gas volumes for the pressure loops.
    loads, faults : sequence of LoadRecord, of FaultRecord
    plan : Plan
    log : array (T, columns)
        See `columns`; filled from tick ``plan.logged`` on.
    reasons : array (T, ROW)
        Decisions of the controller, `control.reasons`.
    """
    dt = config.ticks * config.pid_period
    for tick in range(first, last):
        load, broken = loads[plan.load[tick]], faults[plan.fault[tick]]
        recruitment_step(config.controller, belief, state.controller, state.measured, plan.kind,
                         plan.value[tick], plan.rate[tick], dt, state.command)
        if state.command.reason.why != NONE:
            row_of(state.command.reason, reasons[tick])
        target = plan.imposed[tick]
        if load.kind == DYNAMOMETER and target == target:
            motion = state.rig.motion
            motion.target, motion.speed = target, abs(target - motion.strain) / dt
        for k in range(config.ticks):
            drive_valves(config, state, pids, gas)
            rig_step(config.rig, load, plant, state.rig, state.valves, broken,
                     config.pid_period)
            sample = tick * config.ticks + k
            measure(config, state, broken, plan.normal[sample], plan.chance[sample])
            if config.deviation != 1.0 and tick >= plan.logged:
                deviate(config, state.measured, plan.kind)
        if tick >= plan.logged:
            write_row(state, log[tick - plan.logged])


def drive_valves(config: Any, state: Any, pids: Any, gas: Any) -> None:
    """Compute the valve commands of the pressure loops, from readings, volume and its rate."""
    # A slice, since numba cannot pass an array field of a record to a function pointer.
    pressure, strain = state.measured.pressure[:], state.shown.shown[STRAIN]
    for i in range(len(pressure)):
        volume = config.rig.tube_volume + gas.volume(
            i, strain, pressure, state.rig.time, gas.shape, gas.parameters, gas.tables)
        slope = gas.volume_slope(
            i, strain, pressure, state.rig.time, gas.shape, gas.parameters, gas.tables)
        state.valves[i] = pressure_step(
            config.pid, pids[i], state.command.pressure[i], pressure[i], config.pid_period,
            state.shown.shown[SUPPLY], volume, slope * state.shown.strain_rate)


def measure(config: Any, state: Any, faults: Any, normal: Any, chance: Any) -> None:
    """Read the instruments, and pass the readings to the controller."""
    true_channels(config.rig, state.rig, state.true)
    read_sensors(config.sensors, state.shown, state.true, state.rig.time, faults, normal, chance)
    measured, shown = state.measured, state.shown
    measured.force, measured.strain = shown.shown[FORCE], shown.shown[STRAIN]
    measured.strain_rate = shown.strain_rate
    for i in range(len(measured.pressure)):
        measured.pressure[i] = shown.shown[PRESSURE + i]


def deviate(config: Any, measured: Any, kind: int) -> None:
    """Scale the deviation of the controlled reading: see `LoopConfig.deviation`."""
    k, about = config.deviation, config.about
    if kind == 0:
        measured.force = about + k * (measured.force - about)
    else:
        measured.strain = about + k * (measured.strain - about)
        measured.strain_rate *= k


def write_row(state: Any, row: Any) -> None:
    """Write a row at the end of a tick, in the order of `SINGLE` and `EACH_UNIT`."""
    command, rig = state.command, state.rig
    margins = command.margins
    row[0], row[1], row[2] = command.demand, state.true[STRAIN], state.true[FORCE]
    row[3], row[4], row[5] = state.true[SUPPLY], command.state, command.saturated
    row[6], row[7] = margins.limit - margins.width, margins.limit
    row[8], row[9] = rig.air.balance.delivered, rig.work
    n = len(command.pressure)
    for i in range(n):
        row[10 + i], row[10 + n + i] = state.true[PRESSURE + i], command.pressure[i]
        row[10 + 2 * n + i], row[10 + 3 * n + i] = state.valves[i], command.share[i]


def columns(log: Any, units: int) -> dict[str, Any]:
    """Return the columns of a log by name, (T,) or (T, units)."""
    found = {name: log[:, k] for k, name in enumerate(SINGLE)}
    for k, name in enumerate(EACH_UNIT):
        start = len(SINGLE) + k * units
        found[name] = log[:, start:start + units]
    return found
