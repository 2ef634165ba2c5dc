# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The recruitment controller as one step function on records.

One tick: filtered strain rate -> model force at the measured pressures -> outer loop -> force
curves at this strain -> rate of the demand -> state machine -> crossings and allocation ->
command. Without usable readings the command is held, then all units are vented. Kernels
(`fam_bundle_ros.kernels`): plain Python or compiled; `controller` has the settings with their
meaning, and the loop as an object.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.adaptation import (
    adaptation_state,
    adaptation_step,
    AdaptationSettings,
    AdaptationState,
    lag_doubt,
    lag_of,
    lagged,
    learn_lead,
)
from fam_bundle_ros.control.baselines import (
    baseline_step,
    BaselineSettings,
    BaselineState,
    begin_baseline,
    forget_baseline,
    play,
)
from fam_bundle_ros.control.crossing import Crossings, doubt_of_push, no_crossings
from fam_bundle_ros.control.curves import (
    adapted,
    curve_table,
    CurveTable,
    find_branches,
    fix_friction,
    free_friction,
    line_at,
    on_line,
    slope_at,
    tabulate,
    unit_force,
)
from fam_bundle_ros.control.demand import set_demand
from fam_bundle_ros.control.friction import half_band, is_settled, learn_friction
from fam_bundle_ros.control.heading import heading_of, HeadingState
from fam_bundle_ros.control.inverse import hold_bottoms, place_bottoms, Shares, total_of
from fam_bundle_ros.control.jump import begin_jump, Jump, step_of, TOLERANCE
from fam_bundle_ros.control.observer import may_be_spike, quick_noise, quick_of, take_out_late
from fam_bundle_ros.control.outer import command_lag
from fam_bundle_ros.control.outer_loop import (
    FORCE,
    forget_outer,
    outer_step,
    OuterSettings,
    OuterState,
    STRAIN,
)
from fam_bundle_ros.control.rate import (
    FIRST,
    forget_rate,
    quiet_rate,
    quiet_strain,
    rate_ahead,
    RateState,
)
from fam_bundle_ros.control.reasons import LOST, NONE
from fam_bundle_ros.control.reference_memory import (
    follow_reference,
    keep_memory,
    leave_reference,
)
from fam_bundle_ros.control.saturation import FREE, GAP, HIGH, LOW
from fam_bundle_ros.control.signals import MeasurementRecord
from fam_bundle_ros.control.softness import set_softness
from fam_bundle_ros.control.spread import ALL_ON, EQUAL_PRESSURE, spread
from fam_bundle_ros.control.strain_prediction import (
    forget_prediction,
    PredictionState,
    strain_ahead,
)
from fam_bundle_ros.control.switching import (
    Demand,
    MachineState,
    start_machine,
    SwitchingSettings,
)
from fam_bundle_ros.control.transition import switch_units

#: Pa: largest lasting error of a healthy pressure loop; more is a transient or a fault.
_LOOSE = 5e3
#: N, Pa, 1/s: far beyond any muscle, sensor and motion. A reading or reference beyond these, or a
#: strain beyond 1, counts as missing: in the filters it would outlast its one sample by seconds.
_MOST_FORCE, _MOST_PRESSURE, _MOST_RATE = 1e6, 1e9, 1e3


@dataclass
class RecruitmentSettings:
    """`ControllerConfig` as kernels take it; ``step``: least size of a step of the force, N."""

    scheme: int
    still: float
    hold_time: float
    step: float
    max_pressure: list
    switching: SwitchingSettings
    outer: OuterSettings
    baseline: BaselineSettings
    adaptation: AdaptationSettings


@dataclass
class RecruitmentState:
    """
    Memory and work space of the controller.

    Attributes
    ----------
    table : CurveTable
        Curves of the tick before; its constants are the grid and the order of recruitment.
    asleep : list (n,) of int
        1 for units that could not add force in the tick before.
    wanted, limits : HeadingState
        Rate filters of the demand, and of the largest forces of RS0..RSn.
    heading_kind : int
        Kind of the last reference, -1 for none.
    clock : float, s
        Time of the model; ``begun`` is false before the first tick.
    lost : float, s
        Time without a usable reading.
    units, fixed : list (n,)
        Active units in the order of filling; prescribed pressures, nan for the other units.
    final, shares : Shares
        Allocation after all crossings, and now.
    jump : Jump
        The last step of a force reference.
    reading : MeasurementRecord
        Readings of this tick; strain and rate of the one before where they may be a spike.
    """

    table: CurveTable
    asleep: list
    wanted: HeadingState
    limits: HeadingState
    machine: MachineState
    crossings: Crossings
    units: list
    fixed: list
    final: Shares
    shares: Shares
    jump: Jump
    adaptation: AdaptationState
    reading: MeasurementRecord
    rate: RateState = field(default_factory=RateState)
    prediction: PredictionState = field(default_factory=PredictionState)
    outer: OuterState = field(default_factory=OuterState)
    baseline: BaselineState = field(default_factory=BaselineState)
    demand: Demand = field(default_factory=Demand)
    heading_kind: int = -1
    clock: float = 0.0
    begun: bool = False
    lost: float = 0.0


def recruitment_state(order: Any, grid: Any, pushes_back: bool) -> RecruitmentState:
    """Return a fresh state; ``grid`` (n, m) holds the pressures of the table, Pa."""
    n = len(grid)

    def shares():
        return Shares([0.0] * n, [0.0] * n)
    return RecruitmentState(
        curve_table(order, grid, pushes_back), [0] * n, heading_of(1), heading_of(n + 1),
        MachineState([0.0] * n, [1] * n, [0] * n), no_crossings(n), [0] * n, [math.nan] * n,
        shares(), shares(), Jump([0.0] * n), adaptation_state(n),
        MeasurementRecord(0.0, 0.0, 0.0, [0.0] * n))


def start_recruitment(settings: Any, state: Any, command: Any) -> None:
    """Vent, and reset state machine (RS0, or all units on), observers and filters."""
    n = len(command.pressure)
    start_machine(state.machine, n if settings.scheme == ALL_ON else 0)
    forget_outer(state.outer)
    forget_baseline(state.baseline)
    forget_rate(state.rate)
    forget_prediction(state.prediction)
    for unit in range(n):
        state.asleep[unit] = state.table.lowered[unit] = 0
    free_friction(state.table)
    state.crossings.count = state.jump.on = state.jump.fresh = 0
    state.jump.kind, state.jump.since, state.jump.still = -1, math.inf, math.inf
    state.heading_kind, state.clock, state.begun, state.lost = -1, 0.0, False, 0.0
    vent(command)


def enable_step(settings: Any, model: Any, state: Any, measurement: Any, command: Any) -> None:
    """
    Start from the present pressures (bumpless transfer): see `RecruitmentController.enable`.

    The arguments are those of `recruitment_step`.
    """
    start_recruitment(settings, state, command)
    table = state.table
    if settings.scheme != ALL_ON:
        set_moment(table, measurement.strain, 0.0, 0.0, 0.0, True)
        tabulate(table, model)
        find_branches(table, state.asleep)
        place_bottoms(table, model)
        # A unit on its falling branch counts as off: it will be vented or crossed again.
        on = 0
        for k in range(len(table.order)):
            unit = table.order[k]
            if measurement.pressure[unit] > max(0.9 * table.bottom_pressure[unit], 2e3):
                on = k + 1
        start_machine(state.machine, on)
    for unit in range(len(table.order)):
        state.asleep[unit] = 0
        pressure = measurement.pressure[unit]
        # Up to and including the first tick these count as the commanded pressures.
        command.pressure[unit] = 0.0 if math.isnan(pressure) else min(
            max(pressure, 0.0), settings.max_pressure[unit])
        state.jump.base[unit] = command.pressure[unit]
    state.jump.on = 1
    if settings.scheme >= EQUAL_PRESSURE:
        begin_baseline(settings.baseline, state.baseline, settings.scheme == EQUAL_PRESSURE,
                       table.order, settings.max_pressure, command.pressure)
    show_state(state, command)
    state.outer.taking_over, state.outer.taken = True, measurement.force


def recruitment_step(settings: Any, model: Any, state: Any, measurement: Any, kind: int,
                     value: float, rate: float, dt: float, command: Any) -> None:
    """
    Advance the controller by one tick.

    Parameters
    ----------
    settings, state : RecruitmentSettings, RecruitmentState
    model : Belief
        Its memory is updated.
    measurement : MeasurementRecord, or any record with its fields
    kind, value, rate : int, float, float
        Reference: `outer_loop.FORCE` (N, N/s) or `STRAIN` (1, 1/s).
    dt : float, s
        Time since the tick before; if not positive (clock reset), or infinite, it is ignored.
    command : CommandRecord
        Input: the command of the tick before. Output: the new command.
    """
    if not 0.0 < dt < math.inf:
        return
    command.reason.why = NONE
    if not is_usable(measurement, kind, value, rate):
        hold(settings, state, dt, command)
        return
    since, state.lost = dt + state.lost, 0.0
    if settings.scheme >= EQUAL_PRESSURE:
        baseline_step(settings.baseline, state.baseline, settings.scheme == EQUAL_PRESSURE,
                      state.table.order, settings.max_pressure, settings.still, measurement, kind,
                      value, dt, command)
        return
    table, outer, reading = state.table, state.outer, state.reading
    take_reading(settings, state, measurement)
    # The strain loop damps with the measured rate; the model takes a filtered one.
    direction = state.rate.direction
    before = state.rate.rate if direction != 0 else 0.0
    strain_rate = quiet_rate(state.rate, reading.strain, since)
    strain = reading.strain
    if len(model.path) > 0:
        strain = quiet_strain(state.rate, since)
    state.clock = state.clock + dt if state.begun else 0.0
    start = not state.begun
    state.begun = True
    turned = state.rate.direction != direction
    known = 0.0
    if turned:
        set_moment(table, strain, before, state.clock, dt, start)
        known = believed_force(table, model, reading.pressure, state.adaptation.force)
    set_moment(table, strain, strain_rate, state.clock, dt, start)
    force = believed_force(table, model, reading.pressure, state.adaptation.force)
    if turned:
        jump = force - known
        state.adaptation.believed += jump * take_out_late(
            outer.observer, reading.force - force, jump)
    learnt = state.adaptation
    believed = lagged(learnt, force, dt)
    adapt(settings, state, reading.force, dt)
    stepped = step_of(settings, state.jump, kind, value, rate, dt)
    if stepped > 0.0:
        # The offset from the force at `enable` belongs to the reference before.
        outer.fade = 0.0
    outer_step(settings.outer, outer, reading, believed,
               outer.demand - state.shares.missing, loop_error(table, command.pressure), kind,
               value, rate, command.saturated, lag_of(learnt), lag_doubt(learnt), learnt.lead, dt)
    crossing = state.crossings.count > 0
    learn_friction(outer.friction, state.rate.direction, quick_of(outer.observer),
                   quick_noise(outer.observer, outer.lag, dt), crossing, outer.lag, dt)
    # The tracking error during a crossing is not due to the lag.
    if kind == FORCE and command.saturated == FREE and not crossing:
        learn_lead(settings.adaptation, learnt, outer.observer.weight,
                   value - outer.behind * rate - reading.force, rate, outer.lag, dt)
    # Predicted strain when the commanded pressures are reached.
    ahead = command_lag(settings.outer, dt)
    coming = strain_ahead(state.prediction, state.rate, reading.strain, strain_rate, ahead, dt)
    if len(model.path) > 0 and state.rate.direction == 0:
        coming = strain
    follows = kind == STRAIN and settings.outer.feed_forward
    # A force reference does not prescribe a strain: use the measured rate.
    if follows:
        strain_rate = outer.target.strain_rate
    elif kind != STRAIN:
        outer.target.strain = coming
        strain_rate = rate_ahead(state.rate, ahead)
    set_moment(table, outer.target.strain, strain_rate, state.clock, dt, start)
    if follows:
        follow_reference(table, model, command.pressure)
        fix_friction(table, model, command.pressure)
        outer.target.force -= destabilising_force(table, model, command.pressure, coming)
    else:
        free_friction(table)
    tabulate(table, model)
    find_branches(table, state.asleep)
    place_bottoms(table, model)
    if stepped > 0.0:
        begin_jump(settings, state, stepped)
    if settings.scheme != ALL_ON:
        set_demand(settings, model, state, kind, rate, dt)
        state.demand.soft = state.demand.soft_below = 0
        if follows:
            set_softness(settings, model, state, command.pressure)
        switch_units(settings, state, dt, command)
        if kind == FORCE:  # the strain loop's correction is held against noise: `still`
            hold_bottoms(table, model, state.shares, command.pressure, state.machine.state,
                         state.demand.uncertainty + doubt_of_push(state))
    spread(settings, model, state, outer.target.force, dt)
    write_command(settings, state, outer.target.force, command)
    if follows:
        leave_reference(table, model, command.pressure)
    keep_memory(model, follows)


def is_usable(measurement: Any, kind: int, value: float, rate: float) -> bool:
    """Return whether readings and reference are numbers that a muscle may have."""
    most = _MOST_FORCE if kind == FORCE else 1.0
    return (abs(measurement.force) <= _MOST_FORCE and abs(measurement.strain) <= 1.0
            and abs(measurement.strain_rate) <= _MOST_RATE
            and abs(total_of(measurement.pressure)) <= _MOST_PRESSURE
            and abs(value) <= most and abs(rate) <= _MOST_RATE * most)


def take_reading(settings: Any, state: Any, measurement: Any) -> None:
    """Write the readings of this tick; a spike of the strain is left out."""
    reading = state.reading
    reading.force = measurement.force
    if not may_be_spike(state.rate, measurement.strain, settings.outer.strain_reach):
        reading.strain, reading.strain_rate = measurement.strain, measurement.strain_rate
    for unit in range(len(reading.pressure)):
        reading.pressure[unit] = measurement.pressure[unit]


def loop_error(table: Any, pressure: Any) -> float:
    """Return the force error (N) due to usual pressure-loop errors at ``pressure`` (n,), Pa."""
    force = 0.0
    for unit in range(len(table.order)):
        force += abs(slope_at(table, unit, pressure[unit])) * _LOOSE
    return force


def destabilising_force(table: Any, model: Any, pressure: Any, strain: float) -> float:
    """
    Return the destabilising change of force from the table's strain to ``strain``, N.

    At constant pressures (Pa) a muscle is usually a stable spring: nothing to compensate, 0. Where
    the push-back collapses the force rises with the strain (negative stiffness), which drives the
    strain further from its target: the demand is reduced by this force.
    """
    wanted, begun, push = table.moment.strain, table.moment.start, 0.0
    table.moment.start = True  # at equilibrium: without friction
    for unit in range(len(table.order)):
        push -= unit_force(table, model, unit, pressure[unit])
    table.moment.strain = strain
    for unit in range(len(table.order)):
        push += unit_force(table, model, unit, pressure[unit])
    table.moment.strain, table.moment.start = wanted, begun
    return push if push * (strain - wanted) > 0.0 else 0.0


def set_moment(table: Any, strain: float, strain_rate: float, time: float, dt: float, start: bool
        ) -> None:
    """Set the operating point (1, 1/s, s, s) at which the model is evaluated."""
    now = table.moment
    now.strain, now.strain_rate, now.time, now.dt, now.start = strain, strain_rate, time, dt, start


def believed_force(table: Any, model: Any, pressure: Any, forces: Any) -> float:
    """
    Return the adapted model's force at the measured pressures, N; write its next memory.

    ``forces`` (n,) receives the unadapted model's force of each unit.
    """
    now, total = table.moment, 0.0
    for unit in range(len(table.order)):
        model.pressure[unit] = pressure[unit]
    for unit in range(len(table.order)):
        forces[unit] = model.force(unit, now.strain, now.strain_rate, model.pressure, now.time,
                                   now.dt, now.start, model.shape, model.parameters,
                                   model.tables, model.memory, model.next)
        if on_line(table, unit, pressure[unit]):
            total += line_at(table, unit, pressure[unit])
        else:
            table.lowered[unit] = 0
            total += adapted(table, unit, forces[unit])
    return total


def adapt(settings: Any, state: Any, measured: float, dt: float) -> None:
    """
    Update the adaptation with the measured force (N), and apply its gains to the curves.

    The force that the model gains at the measured pressures was corrected by the integral until
    now, where that corrects the model: the integral is changed by it, so that no pressure moves.
    """
    if not settings.adaptation.enabled:
        return
    learnt, table, outer = state.adaptation, state.table, state.outer
    weight = 1.0
    if settings.outer.feedback:
        weight = outer.observer.sure if outer.observer.seen >= FIRST else 0.0
    # Friction is no error of the gains. At rest it may take any value in its band.
    half = half_band(outer.friction)
    if is_settled(outer.friction, outer.lag):
        measured += half * outer.friction.moving
    elif half > 0.0:
        weight *= learnt.rest / (learnt.rest + half * half)
    adaptation_step(settings.adaptation, learnt, measured, dt, weight)
    n, gained = len(table.pull), 0.0
    for unit in range(n):
        gained -= adapted(table, unit, learnt.force[unit])
        table.pull[unit], table.push[unit] = 1.0 + learnt.error[unit], 1.0 + learnt.error[n]
        gained += adapted(table, unit, learnt.force[unit])
    if outer.kind == STRAIN or not settings.outer.feed_forward:
        outer.integral += gained
        outer.kept += gained


# --- output --------------------------------------------------------------------------------------

def write_command(settings: Any, state: Any, demand: float, command: Any) -> None:
    """Write pressures, with a backlash of ``still`` (Pa) against chatter, and shares."""
    shares, total = state.shares, 0.0
    for unit in range(len(command.pressure)):
        total += abs(shares.force[unit])
    for unit in range(len(command.pressure)):
        play(command, unit, shares.pressure[unit], settings.max_pressure[unit], settings.still)
        size = abs(shares.force[unit])
        command.share[unit] = size / total if total > 0.0 else size
    show_state(state, command)
    command.saturated = saturation(state.table, shares.missing, demand)
    command.demand = demand
    shown, margins = command.margins, state.machine.margins
    shown.recruit, shown.release, shown.limit = margins.recruit, margins.release, margins.limit
    shown.width, shown.uncertainty = margins.width, margins.uncertainty


def show_state(state: Any, command: Any) -> None:
    """Write the recruitment state, and which units are on."""
    command.state = state.machine.state
    for k in range(len(command.active)):
        command.active[state.table.order[k]] = 1 if k < command.state else 0


def saturation(table: Any, missing: float, demand: float) -> int:
    """Return whether the demand is out of reach of all states, or only of the present one."""
    highest, lowest = table.top[0], table.floor[0]
    for k in range(len(table.top)):
        highest, lowest = max(highest, table.top[k]), min(lowest, table.floor[k])
    if missing > TOLERANCE:
        return HIGH if demand > highest - TOLERANCE else GAP
    if missing < -TOLERANCE:
        return LOW if demand < lowest + TOLERANCE else GAP
    return FREE


def hold(settings: Any, state: Any, dt: float, command: Any) -> None:
    """Keep the last pressures for a while without usable readings, then vent."""
    state.lost += dt
    if state.lost <= settings.hold_time:
        return
    lost, pressed = state.lost, command.state > 0
    for unit in range(len(command.pressure)):
        pressed = pressed or command.pressure[unit] != 0.0
    if pressed:
        start_recruitment(settings, state, command)
        state.lost = lost
        command.reason.why, command.reason.time = LOST, lost
    else:
        vent(command)


def vent(command: Any) -> None:
    """Command zero pressure in all units."""
    command.state, command.saturated, command.demand = 0, FREE, 0.0
    for unit in range(len(command.pressure)):
        command.pressure[unit] = command.share[unit] = 0.0
        command.active[unit] = 0
    margins = command.margins
    margins.recruit = margins.release = margins.limit = margins.width = math.nan
    margins.uncertainty, command.reason.why = 0.0, NONE
