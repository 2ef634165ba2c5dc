# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pneumatic circuit: regulator -> manifold -> n valves -> n chambers -> ambient.

Kernels (`fam_bundle_ros.kernels`), one for each block; `circuit_step` advances the whole circuit.
Runge-Kutta of fourth order; the number of sub-steps follows from the stiffest volume: near equal
pressures an open valve settles a small chamber in less than a millisecond. Pressures in this
module are ABSOLUTE.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.model.pneumatics import (
    LAMINAR_RATIO,
    mass_flow,
    REFERENCE_DENSITY,
    REFERENCE_TEMPERATURE,
    RT,
    valve_opening,
    ValveFlow,
)
from fam_bundle_ros.plant.pneumatics import ChamberConfig, ValveConfig
from fam_bundle_ros.plant.supply import SupplyConfig

#: Largest product of sub-step and fastest rate. RK4 is stable to 2.8; below 0.7 its error is
#: far below that of the coupling to the load.
_STIFFNESS = 0.7
#: Above this pressure ratio the flow through a narrow line is laminar.
LINE_LAMINAR_RATIO = 0.98


@dataclass
class AirBalance:
    """Air balance since the start, kg: drawn = delivered + dumped + change in the manifold."""

    #: Through the regulator.
    drawn: float = 0.0
    #: From the manifold into the chambers, net.
    delivered: float = 0.0
    #: From the chambers to ambient through valves and relief valves.
    exhausted: float = 0.0
    #: From the chambers through leaks.
    leaked: float = 0.0
    #: From the manifold at emergency stops.
    dumped: float = 0.0


@dataclass(frozen=True)
class AirConfig:
    """Constants of the circuit."""

    valve: ValveFlow
    chamber: ChamberConfig
    supply: SupplyConfig
    #: Pa (absolute).
    ambient: float
    #: Pa/(kg/s), droop of regulator and line together.
    resistance: float
    #: rad/s, natural frequency of the spools; their damping ratio.
    spool_frequency: float
    spool_damping: float
    #: Backlash of the spools; s, dead time of their commands.
    hysteresis: float
    delay: float

    @classmethod
    def of(cls, valve: ValveConfig, chamber: ChamberConfig, supply: SupplyConfig,
           ambient: float, droop: float = 0.0) -> 'AirConfig':
        """Return the constants; ``droop``, Pa/(kg/s), adds to the regulator's resistance."""
        flow = ValveFlow(valve.conductance, valve.critical_ratio, valve.dead_band)
        return cls(flow, chamber, supply, float(ambient), supply.resistance + droop,
                   valve.natural_frequency, valve.damping, float(valve.hysteresis),
                   float(valve.delay))


@dataclass
class AirScratch:
    """Work space of one step of the circuit; no state is kept in it."""

    #: Mean opening of each valve over a sub-step.
    opening: list[float]
    #: m^3/s, rate of each gas volume.
    slope: list[float]
    #: Pa and Pa/s, pressure and its rate at a Runge-Kutta stage; Pa, change over the sub-step.
    stage: list[float]
    rate: list[float]
    change: list[float]
    #: The same for separate lines at the valves.
    line_stage: list[float]
    line_rate: list[float]
    line_change: list[float]


@dataclass
class Air:
    """State of the air in a rig, one value for each chamber or valve in the lists."""

    #: Pa (absolute), in the muscles; in separate lines at the valves (``line_volume`` > 0).
    pressure: list[float]
    line: list[float]
    #: m^3 with tubing, without separate lines.
    volume: list[float]
    #: m^3/Pa, at constant strain; 0 where the volume does not depend on the pressure.
    compliance: list[float]
    #: Command of each spool after its backlash, -1..1.
    driven: list[float]
    #: Spool position, -1..1, and its speed, 1/s.
    spool: list[float]
    spool_rate: list[float]
    #: Fault: opening of each valve through which supply air leaks into its chamber.
    seep: list[float]
    #: Pa (absolute).
    manifold: float
    balance: AirBalance
    scratch: AirScratch = field(repr=False)
    #: True while the supply is shut off and the manifold dumped (emergency stop).
    dumping: bool = False
    #: Fault: regulator pressure over its set point.
    supply_share: float = 1.0

    @classmethod
    def at_rest(cls, config: AirConfig, volume: list[float]) -> 'Air':
        """Return chambers at ambient, the manifold at the regulator's set point, valves shut."""
        n = len(volume)
        return cls([config.ambient] * n, [config.ambient] * n, list(volume), compliance=[0.0] * n,
                   driven=[0.0] * n, spool=[0.0] * n, spool_rate=[0.0] * n, seep=[0.0] * n,
                   manifold=config.supply.pressure + config.ambient, balance=AirBalance(),
                   scratch=AirScratch(*([0.0] * n for _ in range(8))))


def circuit_step(config: Any, air: Any, commands: Any, volume: Any, leaks: Any,
                 dt: float) -> None:
    """
    Advance the air by ``dt`` while the gas volumes change linearly to ``volume``.

    Parameters
    ----------
    air : Air
        Advanced in place. Its volumes end at ``volume`` + compliance x change of pressure.
    commands : vector (n,), -1..1
        Valve commands, held.
    volume : vector (n,), m^3
        Gas volumes with tubing (without separate lines) at the end, at the initial pressure.
    leaks : vector (n,), 1/s
        Rate at which each chamber's gauge pressure decays by leaks at constant volume.
    dt : float, s
    """
    slope = air.scratch.slope
    for i in range(len(commands)):
        slope[i] = (volume[i] - air.volume[i]) / dt
    count = substeps(config, air, commands, volume, leaks, dt)
    h = dt / count
    for _ in range(count):
        move_spools(config, air, commands, h)
        runge_kutta(config, air, leaks, h)


def substeps(config: Any, air: Any, commands: Any, volume: Any, leaks: Any, dt: float) -> int:
    """
    Return the number of sub-steps for `_STIFFNESS`.

    The flow is concave in the pressure ratio, so flow over pressure difference is an upper bound
    of the slope at the present pressure.
    """
    valve, chamber, supply = config.valve, config.chamber, config.supply
    c, b, ambient, manifold = (valve.conductance, valve.critical_ratio, config.ambient,
                               air.manifold)
    exponent = RT * max(chamber.inflow_exponent, chamber.outflow_exponent)
    relief = ambient + chamber.relief_pressure - chamber.relief_band
    apart = chamber.line_volume > 0.0
    fastest = 0.0
    through = 1.0 / config.resistance
    if air.dumping or air.supply_share == 0.0:
        through += secant(supply.dump_conductance, b, manifold, ambient)
    for i in range(len(commands)):
        p, smallest = air.pressure[i], min(air.volume[i], volume[i])
        if apart:
            inside = secant(chamber.line_conductance, chamber.line_ratio, air.line[i], p,
                            LINE_LAMINAR_RATIO)
            fastest = max(fastest, exponent * inside * (1.0 / chamber.line_volume
                                                        + 1.0 / smallest))
            p, smallest = air.line[i], chamber.line_volume
        here, there = valve_opening(valve, air.spool[i]), valve_opening(valve, commands[i])
        most, lowest = max(here, there), min(here, there)
        slope = 0.0
        if most > 0.0:
            slope = most * secant(c, b, manifold, p)
            through += slope
        if lowest < 0.0:
            slope = max(slope, -lowest * secant(c, b, p, ambient))
        if air.seep[i] > 0.0:
            seeping = air.seep[i] * secant(c, b, manifold, p)
            through += seeping
            slope += seeping
        if apart and slope > 0.0:
            # The rates of line and restriction add.
            fastest += exponent * slope / smallest
        if air.pressure[i] > relief:
            p, smallest = air.pressure[i], min(air.volume[i], volume[i])
            # The opening of the relief valve adds to the slope of the flow through it.
            slope += c * p * REFERENCE_DENSITY * (1.0 / chamber.relief_band + 1.0 / p)
        if slope > 0.0 or leaks[i] > 0.0:
            fastest = max(fastest, exponent * slope / smallest + leaks[i])
    fastest = max(fastest, RT * through / supply.volume)
    return max(1, math.ceil(dt * fastest / _STIFFNESS))


def secant(conductance: float, b: float, upstream: float, downstream: float,
           laminar_ratio: float = LAMINAR_RATIO) -> float:
    """Return flow over pressure difference (Pa), kg/(s Pa); its limit at equal pressures."""
    difference = abs(upstream - downstream)
    if difference < 1.0:
        upstream, difference = downstream + 1.0, 1.0
    return abs(mass_flow(conductance, b, upstream, downstream, REFERENCE_TEMPERATURE,
                         laminar_ratio)) / difference


def move_spools(config: Any, air: Any, commands: Any, dt: float) -> None:
    """
    Move the spools by ``dt`` and write the mean opening of each valve to the scratch.

    A spool is a second-order lag, x'' = w^2 (u - x) - 2 z w x', solved exactly for the held
    command u.
    """
    a, b, c, d = spool_step(config.spool_frequency, config.spool_damping, 0.5 * dt)
    for i in range(len(commands)):
        target = commands[i]
        error, rate = air.spool[i] - target, air.spool_rate[i]
        opening = valve_opening(config.valve, target)
        if error != 0.0 or rate != 0.0:
            middle, middle_rate = a * error + b * rate, c * error + d * rate
            after = a * middle + b * middle_rate
            # Simpson's rule: the opening has a kink at the end of the dead band.
            opening = (valve_opening(config.valve, target + error)
                       + 4.0 * valve_opening(config.valve, target + middle)
                       + valve_opening(config.valve, target + after)) / 6.0
            air.spool[i] = target + after
            air.spool_rate[i] = c * middle + d * middle_rate
        air.scratch.opening[i] = opening


def spool_step(frequency: float, damping: float, dt: float) -> tuple[float, float, float, float]:
    """
    Return (a, b, c, d) of the spool's exact step over ``dt`` at a constant command u.

    With the error e = position - u: e' = a e + b rate, rate' = c e + d rate.
    """
    decay = damping * frequency
    damped = frequency * math.sqrt(1.0 - damping * damping)
    envelope = math.exp(-decay * dt)
    sine = envelope * math.sin(damped * dt)
    cosine = envelope * math.cos(damped * dt)
    return (cosine + decay / damped * sine, sine / damped,
            -frequency * frequency / damped * sine, cosine - decay / damped * sine)


def runge_kutta(config: Any, air: Any, leaks: Any, dt: float) -> None:
    """Advance chambers, manifold and balance by ``dt`` (s) with the classical four stages."""
    work, start = air.scratch, air.manifold
    n = len(air.pressure)
    for i in range(n):
        work.stage[i], work.line_stage[i] = air.pressure[i], air.line[i]
        work.change[i] = work.line_change[i] = 0.0
    manifold, change, at = start, 0.0, 0.0
    for stage in range(4):
        weight = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
        rate = chamber_flows(config, air, leaks, manifold, at, weight)
        at = dt if stage == 2 else 0.5 * dt
        manifold = start + at * rate
        change += weight * rate
        for i in range(n):
            work.change[i] += weight * work.rate[i]
            work.stage[i] = air.pressure[i] + at * work.rate[i]
        if config.chamber.line_volume > 0.0:
            for i in range(n):
                work.line_change[i] += weight * work.line_rate[i]
                work.line_stage[i] = air.line[i] + at * work.line_rate[i]
    air.manifold = start + change
    for i in range(n):
        air.pressure[i] += work.change[i]
        air.line[i] += work.line_change[i]
        air.volume[i] += dt * work.slope[i] + air.compliance[i] * work.change[i]


def chamber_flows(config: Any, air: Any, leaks: Any, manifold: float, time: float,
                  weight: float) -> float:
    """
    Write dp/dt of each chamber to the scratch; return that of the manifold, Pa/s.

    dp/dt = (R T (g_in m_in - g_out m_out) - g_v p V')/(V + g_v p C), V' the rate of the volume at
    constant pressure, C its compliance: conservation of mass for a polytropic gas. The flows times
    ``weight`` are added to the balance. The manifold's pressure, Pa (absolute), is that at this
    Runge-Kutta stage, ``time`` (s) after the start of the sub-step.
    """
    valve, chamber, work, balance = config.valve, config.chamber, air.scratch, air.balance
    c, b, ambient = valve.conductance, valve.critical_ratio, config.ambient
    relief, apart = ambient + chamber.relief_pressure, chamber.line_volume > 0.0
    delivered = exhausted = leaked = 0.0
    for i in range(len(air.pressure)):
        p, opening = work.stage[i], work.opening[i]
        compliance = air.compliance[i]
        volume = (air.volume[i] + time * work.slope[i]
                  + compliance * (p - air.pressure[i]))
        flow = out = 0.0
        at_valve = work.line_stage[i] if apart else p
        if opening > 0.0:
            flow = opening * mass_flow(c, b, manifold, at_valve)
            delivered += flow
        elif opening < 0.0:
            flow = opening * mass_flow(c, b, at_valve, ambient)
            exhausted -= flow
        if air.seep[i] > 0.0:
            seeping = air.seep[i] * mass_flow(c, b, manifold, at_valve)
            delivered += seeping
            flow += seeping
        if apart:
            inside = mass_flow(chamber.line_conductance, chamber.line_ratio, at_valve, p,
                               REFERENCE_TEMPERATURE, LINE_LAMINAR_RATIO)
            work.line_rate[i] = line_rate(chamber, flow, inside)
            flow = inside
        if p > relief:
            out = (min((p - relief) / chamber.relief_band, 1.0)
                   * mass_flow(c, b, p, ambient))
            exhausted += out
        if leaks[i] > 0.0:
            # The flow for which the gauge pressure decays exponentially.
            leak = leaks[i] * (p - ambient) * volume / (chamber.outflow_exponent * RT)
            leaked += leak
            out += leak
        exponent = chamber.inflow_exponent if flow > 0.0 else chamber.outflow_exponent
        squeeze = chamber.volume_exponent * p
        work.rate[i] = ((RT * (exponent * flow - chamber.outflow_exponent * out)
                         - squeeze * work.slope[i]) / (volume + squeeze * compliance))
    balance.delivered += weight * delivered
    balance.exhausted += weight * exhausted
    balance.leaked += weight * leaked
    return supply_flows(config, air, manifold, delivered, weight)


def line_rate(chamber: Any, flow: float, inside: float) -> float:
    """
    Return dp/dt of a line at a valve, Pa/s.

    ``flow`` (kg/s) is from the valve into the line, ``inside`` from the line through the
    restriction to the muscles.
    """
    into = chamber.inflow_exponent if flow > 0.0 else chamber.outflow_exponent
    onward = chamber.outflow_exponent if inside > 0.0 else chamber.inflow_exponent
    return RT * (into * flow - onward * inside) / chamber.line_volume


def supply_flows(config: Any, air: Any, manifold: float, delivered: float,
                 weight: float) -> float:
    """
    Return dp/dt of the manifold, Pa/s, isothermal: R T (drawn - delivered - dumped)/V.

    The regulator gives (set point - manifold)/resistance within its flow limit, or is shut off
    while the dump valve empties the manifold.
    """
    supply, drawn, dumped = config.supply, 0.0, 0.0
    if air.dumping or air.supply_share == 0.0:
        # A detached hose is modelled by the dump valve.
        dumped = mass_flow(supply.dump_conductance, config.valve.critical_ratio, manifold,
                           config.ambient)
    else:
        lack = air.supply_share * supply.pressure + config.ambient - manifold
        drawn = min(max(lack / config.resistance, 0.0), supply.flow_limit)
    air.balance.drawn += weight * drawn
    air.balance.dumped += weight * dumped
    return RT * (drawn - delivered - dumped) / supply.volume
