# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Equations of motion of the rig: circuit, bundle and load together, and the trip.

Half drift, kick, half drift (Strang splitting; position Verlet without air): for half a step the
load moves at its present speed while the air follows (`drift_with_air`), then the force acts for
the whole step (`kick_step`), then the second half drift. The scheme is symmetric, hence of second
order; without dissipation it conserves energy. Kernels (`fam_bundle_ros.kernels`); a `model` is a
`fam_bundle_ros.model.seam.Model`, so that any plant with a force and a volume can be used.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.plant.circuit import Air, AirConfig, circuit_step
from fam_bundle_ros.plant.lines import DelayLine, put, read_held
from fam_bundle_ros.plant.loads import damping_rate, drift, DYNAMOMETER, kick, LoadState
from fam_bundle_ros.plant.sensors import FORCE, PRESSURE, STRAIN, SUPPLY

#: Why a rig is stopped.
RUNNING, OVER_PRESSURE, E_STOP = range(3)
#: 1/s: tolerance of the strain rate where the force depends on it.
_RATE_TOLERANCE = 1e-9
_MOST_TRIALS = 40
#: Relative tolerance of the gas content where a volume depends on the pressure.
_CONTENT_TOLERANCE = 1e-13
#: Pa, step of the difference quotient for the compliance of a volume.
_SMALL_PRESSURE = 100.0


@dataclass(frozen=True)
class RigRecord:
    """Constants of a rig for kernels."""

    air: AirConfig
    #: s, longest internal step.
    step: float
    #: m, rest length of the bundle.
    length: float
    #: m^3, tubing of one motor unit; its part without a restriction to the muscles.
    tube_volume: float
    near_volume: float
    #: Pa (gauge).
    trip_pressure: float
    #: Whether the force depends on the strain rate, the volume on the pressure.
    rate_matters: bool
    swells: bool


@dataclass
class RigState:
    """State of a rig."""

    air: Air
    motion: LoadState
    #: Delay line of the valve commands.
    line: DelayLine
    #: Work space: gauge pressures in the muscles, commands of the valves, commands of the rig,
    #: volumes.
    gauge: list[float] = field(repr=False)
    commands: list[float] = field(repr=False)
    wired: list[float] = field(repr=False)
    volume: list[float] = field(repr=False)
    #: s since the start; the same at the last update of the effects' memory.
    time: float = 0.0
    memory_time: float = 0.0
    #: N, force of the bundle; J, work done on the load.
    force: float = 0.0
    work: float = 0.0
    #: RUNNING, OVER_PRESSURE or E_STOP; the motor unit that tripped and its pressure, Pa (gauge).
    reason: int = RUNNING
    tripped_unit: int = 0
    tripped_pressure: float = 0.0
    #: Slope of the residual in `solve_rate`, and whether backward Euler was used last.
    gap_slope: float = -1.0
    steep: bool = False

    @classmethod
    def at_rest(cls, air: Air, motion: LoadState) -> 'RigState':
        """Return the initial state of a rig."""
        n = len(air.pressure)
        return cls(air, motion, DelayLine.empty(n), gauge=[0.0] * n, commands=[0.0] * n,
                   wired=[0.0] * n, volume=[0.0] * n)


def begin(rig: Any, model: Any, state: Any) -> None:
    """Compute gas volumes and force of a rig at rest; reset the memory of the effects."""
    feel(rig, state)
    gas_volumes(rig, model, state, state.air.volume)
    state.force = bundle_force(model, state, state.motion.strain_rate, True)
    remember(model, state)


def rig_step(rig: Any, load: Any, model: Any, state: Any, commands: Any, faults: Any,
             duration: float) -> None:
    """
    Advance a rig by ``duration`` (s) in equal steps of at most ``rig.step``, commands held.

    The memory of the model is advanced in place. Valve commands (n,) are -1..1; a stopped rig
    exhausts instead.
    """
    count = max(1, math.ceil(duration / rig.step - 1e-9))
    if rig.air.delay > 0.0:
        put(state.line, state.time, commands, rig.air.delay)
    if load.kind == DYNAMOMETER:
        imposed_steps(rig, load, model, state, commands, faults, duration, count)
    else:
        moving_steps(rig, load, model, state, commands, faults, duration, count)


def set_valves(rig: Any, state: Any, commands: Any, faults: Any, time: float) -> None:
    """
    Set the valve commands at ``time`` (s), after dead time and backlash.

    A stopped rig exhausts; stuck valves do not move.
    """
    if rig.air.delay > 0.0:
        read_held(state.line, time - rig.air.delay, state.commands)
    else:
        for i in range(len(commands)):
            state.commands[i] = commands[i]
    wired = state.wired
    for i in range(len(commands)):
        wired[i] = -1.0 if state.reason != RUNNING else min(max(state.commands[i], -1.0), 1.0)
    for i in range(len(commands)):
        command = faults.command_sign[i] * wired[faults.command_of[i]]
        if math.isinf(faults.stuck[i]):
            faults.stuck[i] = state.air.spool[i]
        if not math.isnan(faults.stuck[i]):
            command = faults.stuck[i]
        elif rig.air.hysteresis > 0.0:
            half = 0.5 * rig.air.hysteresis
            command = min(max(state.air.driven[i], command - half), command + half)
            state.air.driven[i] = command
        state.commands[i] = command


def imposed_steps(rig: Any, load: Any, model: Any, state: Any, commands: Any, faults: Any,
                  duration: float, count: int) -> None:
    """Advance with a strain imposed by a test machine; work by the trapezium rule."""
    dt, start = duration / count, state.time
    for k in range(count):
        strain, force = state.motion.strain, state.force
        state.time = start + (k + 1) * dt
        drift_with_air(rig, load, model, state, commands, faults, dt, 0.0)
        state.force = bundle_force(model, state, state.motion.strain_rate, False)
        remember(model, state)
        state.work += 0.5 * (force + state.force) * (state.motion.strain - strain) * rig.length


def moving_steps(rig: Any, load: Any, model: Any, state: Any, commands: Any, faults: Any,
                 duration: float, count: int) -> None:
    """
    Advance by steps of half drift, kick, half drift; the halves between two kicks are one drift.

    The work is a kick's force times the distance of its two halves: with the midpoint rule in
    the kick it equals the energy gained by the load, up to rounding.
    """
    dt, start, force = duration / count, state.time, 0.0
    for k in range(count + 1):
        past = 0.5 * dt if k > 0 else 0.0
        part = past + (0.5 * dt if k < count else 0.0)
        strain = state.motion.strain
        state.time = start + min((k + 0.5) * dt, duration)
        drift_with_air(rig, load, model, state, commands, faults, part, past)
        way = (state.motion.strain - strain) * rig.length
        state.work += force * way * past / part
        if k < count:
            force = kick_step(rig, load, model, state, dt)
            state.work += force * way * (1.0 - past / part)
    # The last kick was half a step ago: compute the present force, without a memory update.
    state.force = bundle_force(model, state, state.motion.strain_rate, False)


def drift_with_air(rig: Any, load: Any, model: Any, state: Any, commands: Any, faults: Any,
                   dt: float, past: float) -> None:
    """Move the load by ``dt`` (s) at its speed, and advance the air with the gas volumes."""
    set_valves(rig, state, commands, faults, state.time - dt)
    drift(load, state.motion, dt, past)
    if rig.swells:
        gas_compliances(model, state)
    gas_volumes(rig, model, state, state.volume)
    for i in range(len(state.commands)):
        state.air.seep[i] = faults.seep[i]
    state.air.supply_share = faults.supply
    circuit_step(rig.air, state.air, state.commands, state.volume, faults.leak, dt)
    feel(rig, state)
    if rig.swells:
        settle_volumes(rig, model, state)
    guard(rig, state)


def feel(rig: Any, state: Any) -> None:
    """Compute the gauge pressures in the muscles, at least 0."""
    for i in range(len(state.gauge)):
        state.gauge[i] = max(state.air.pressure[i] - rig.air.ambient, 0.0)


def guard(rig: Any, state: Any) -> None:
    """Stop the rig when a chamber is above the trip pressure: vent all, dump the supply."""
    if state.reason == RUNNING:
        for i in range(len(state.gauge)):
            if state.gauge[i] > rig.trip_pressure and (
                    state.reason == RUNNING or state.gauge[i] > state.tripped_pressure):
                state.reason, state.air.dumping = OVER_PRESSURE, True
                state.tripped_unit, state.tripped_pressure = i, state.gauge[i]


# --- gas volumes -------------------------------------------------------------------------------

def gas_volume(near_volume: float, model: Any, state: Any, unit: int) -> float:
    """Return the gas volume of a motor unit with tubing at the present strain, m^3."""
    # A slice, since numba cannot pass an array field of a record to a function pointer.
    return near_volume + max(0.0, model.volume(
        unit, state.motion.strain, state.gauge[:], state.time, model.shape, model.parameters,
        model.tables))


def gas_volumes(rig: Any, model: Any, state: Any, out: Any) -> None:
    """Write the gas volumes at the present strain and pressures to ``out``, m^3."""
    for i in range(len(out)):
        out[i] = gas_volume(rig.near_volume, model, state, i)


def gas_compliances(model: Any, state: Any) -> None:
    """Compute dV/dp of each gas volume at the present strain, m^3/Pa."""
    for i in range(len(state.gauge)):
        pressure = state.gauge[i]
        here = gas_volume(0.0, model, state, i)
        state.gauge[i] = pressure + _SMALL_PRESSURE
        state.air.compliance[i] = (gas_volume(0.0, model, state, i) - here) / _SMALL_PRESSURE
        state.gauge[i] = pressure


def settle_volumes(rig: Any, model: Any, state: Any) -> None:
    """
    Make volume and pressure consistent at constant p V^g, where the volume depends on pressure.

    The circuit assumed volumes linear in the pressure. Newton's method in ln p.
    """
    air, exponent = state.air, rig.air.chamber.volume_exponent
    for i in range(len(state.gauge)):
        pressure, volume = air.pressure[i], air.volume[i]
        for _ in range(10):
            air.volume[i] = gas_volume(rig.near_volume, model, state, i)
            excess = (math.log(air.pressure[i] / pressure)
                      + exponent * math.log(air.volume[i] / volume))
            if abs(excess) < _CONTENT_TOLERANCE:
                break
            stiffness = 1.0 + exponent * air.compliance[i] * air.pressure[i] / air.volume[i]
            air.pressure[i] *= math.exp(-excess / stiffness)
            state.gauge[i] = max(air.pressure[i] - rig.air.ambient, 0.0)


# --- forces ------------------------------------------------------------------------------------

def bundle_force(model: Any, state: Any, strain_rate: float, start: bool) -> float:
    """Return the present tension of all motor units, N, at a ``strain_rate`` (1/s)."""
    total, pressure = 0.0, state.gauge[:]
    shape, parameters, tables, memory, after = (
        model.shape, model.parameters, model.tables, model.memory, model.after)
    strain, time, dt = state.motion.strain, state.time, state.time - state.memory_time
    for i in range(len(pressure)):
        total += model.force(i, strain, strain_rate, pressure, time, dt, start, shape,
                             parameters, tables, memory, after)
    return total


def remember(model: Any, state: Any) -> None:
    """Store the memory of the last `bundle_force`."""
    state.memory_time = state.time
    for i in range(len(model.memory)):
        for j in range(len(model.memory[i])):
            model.memory[i][j] = model.after[i][j]


def kick_step(rig: Any, load: Any, model: Any, state: Any, dt: float) -> float:
    """
    Accelerate the load for ``dt`` (s); return the bundle's force, N.

    Implicit midpoint rule in the speeds; backward Euler where that would overshoot: where the
    force falls so steeply with the rate that dt times the decay rate is above 2 (stiction), and
    where the rate changes sign, where friction is steepest.
    """
    motion = state.motion
    share, rate, place_rate, force = 0.5, 0.0, 0.0, 0.0
    for trial in range(3):
        share = 1.0 if state.steep else 0.5
        own = share * dt * damping_rate(load, rig.length)
        force, slope = solve_rate(rig, load, model, state, share * dt)
        rate, place_rate = kick(load, motion, share * dt, force, rig.length)
        rate = motion.strain_rate + (rate - motion.strain_rate) / share
        # The residual of `solve_rate` has the slope -1 - (decay of the bundle's force)/(1 + own).
        steep = (own - (slope + 1.0) * (1.0 + own) > 2.0 * share
                 or (rig.rate_matters and rate * motion.strain_rate < 0.0))
        if steep == state.steep or (state.steep and trial > 0):
            break
        state.steep = steep
    motion.acceleration = (rate - motion.strain_rate) / dt
    motion.place_acceleration = (place_rate - motion.place_rate) / (share * dt)
    motion.strain_rate = rate
    motion.place_rate += dt * motion.place_acceleration
    remember(model, state)
    return force


def solve_rate(rig: Any, load: Any, model: Any, state: Any, dt: float) -> tuple[float, float]:
    """
    Solve rate = kick(force(rate)) over ``dt``; return the bundle's force and the residual's slope.

    One evaluation where the force does not depend on the rate; else the secant method on the
    residual, which falls with the rate for any dissipative force; with a bracketed root the
    Illinois rule. The first step uses the slope of the time step before.
    """
    motion, length = state.motion, rig.length
    begun = low = motion.strain_rate
    force = bundle_force(model, state, low, False)
    if not rig.rate_matters:
        return force, -1.0
    rate, _ = kick(load, motion, dt, force, length)
    gap_low = gap_begun = rate - low
    if abs(gap_low) <= _RATE_TOLERANCE:
        return force, state.gap_slope
    high = low - gap_low / state.gap_slope
    force = bundle_force(model, state, high, False)
    rate, _ = kick(load, motion, dt, force, length)
    gap_high = rate - high
    for _ in range(_MOST_TRIALS):
        if abs(gap_high) <= _RATE_TOLERANCE:
            break
        slope = min((gap_high - gap_low) / (high - low), -1.0)
        trial = high - gap_high / slope
        force = bundle_force(model, state, trial, False)
        rate, _ = kick(load, motion, dt, force, length)
        gap = rate - trial
        if gap * gap_high < 0.0:
            low, gap_low = high, gap_high
        elif gap_low * gap_high < 0.0:
            gap_low *= 0.5
        else:
            low, gap_low = high, gap_high
        high, gap_high = trial, gap
    state.gap_slope = min((gap_high - gap_begun) / (high - begun), -1.0)
    return force, state.gap_slope


# --- channels ----------------------------------------------------------------------------------

def true_channels(rig: Any, state: Any, out: Any) -> None:
    """Write the true value of every sensor channel to ``out``; pressures gauge, at the valves."""
    out[FORCE], out[STRAIN] = state.force, state.motion.strain
    out[SUPPLY] = state.air.manifold - rig.air.ambient
    apart = rig.air.chamber.line_volume > 0.0
    for i in range(len(state.gauge)):
        pressure = state.air.line[i] if apart else state.air.pressure[i]
        out[PRESSURE + i] = pressure - rig.air.ambient
