# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Air flow through a valve into a chamber: equations for plant and controller.

Kernels on floats (`fam_bundle_ros.kernels`), which run many times per control tick, plain or
compiled. A `valve` is a `ValveFlow`, a dataclass derived from it, or a record of either.
Pressures here are ABSOLUTE, in Pa, as the flow through an orifice requires.
"""

from dataclasses import dataclass
import math
from typing import Any

#: Reference conditions of ISO 6358: density in kg/m^3, temperature in K.
REFERENCE_DENSITY = 1.185
REFERENCE_TEMPERATURE = 293.15
#: Gas constant of dry air, J/(kg K).
GAS_CONSTANT = 287.05
#: R T of the air at the reference temperature, J/kg.
RT = GAS_CONSTANT * REFERENCE_TEMPERATURE
#: Standard atmosphere, Pa.
ATMOSPHERE = 101325.0
#: One exponent for filling, venting and compression: between isothermal (1) and adiabatic (1.4).
POLYTROPIC = 1.2
#: Above this pressure ratio the flow decreases linearly to zero (in ISO 6358 its slope there is
#: infinite).
LAMINAR_RATIO = 0.999


def mass_flow(conductance: float, critical_ratio: float, upstream: float, downstream: float,
              temperature: float = REFERENCE_TEMPERATURE,
              laminar_ratio: float = LAMINAR_RATIO) -> float:
    """
    Return the mass flow through an orifice in kg/s, after ISO 6358; negative for reverse flow.

    r = p2/p1 <= b: C p1 rho0 sqrt(T0/T1); above, times sqrt(1 - ((r - b)/(1 - b))^2), and
    linear in r from ``laminar_ratio`` to 1.

    Parameters
    ----------
    conductance : float, m^3/(s Pa)
    critical_ratio : float
    upstream, downstream : float, Pa (absolute)
    temperature : float, K

    Examples
    --------
    >>> print(f'{mass_flow(3.93e-9, 0.3, 701325.0, 101325.0):.3e} kg/s')
    3.266e-03 kg/s
    """
    high, low = upstream, downstream
    if low > high:
        high, low = low, high
    flow = conductance * high * REFERENCE_DENSITY
    if temperature != REFERENCE_TEMPERATURE:
        flow *= math.sqrt(REFERENCE_TEMPERATURE / temperature)
    ratio = low / high
    if ratio > laminar_ratio:
        edge = (laminar_ratio - critical_ratio) / (1.0 - critical_ratio)
        flow *= math.sqrt(1.0 - edge * edge) * (1.0 - ratio) / (1.0 - laminar_ratio)
    elif ratio > critical_ratio:
        beyond = (ratio - critical_ratio) / (1.0 - critical_ratio)
        flow *= math.sqrt(1.0 - beyond * beyond)
    return flow if upstream >= downstream else -flow


def valve_opening(valve: Any, command: float) -> float:
    """Return the opening, -1 exhaust .. 1 fill, for a command or a spool position."""
    dead = valve.dead_band
    if command > dead:
        opening = (command - dead) / (1.0 - dead)
        return 1.0 if opening > 1.0 else opening
    if command < -dead:
        opening = (command + dead) / (1.0 - dead)
        return -1.0 if opening < -1.0 else opening
    return 0.0


def valve_command(valve: Any, opening: float) -> float:
    """Return the command for an opening: the inverse of `valve_opening`, 0 for closed."""
    if opening == 0.0:
        return 0.0
    size = min(abs(opening), 1.0)
    return math.copysign(valve.dead_band + size * (1.0 - valve.dead_band), opening)


def valve_flow(valve: Any, opening: float, pressure: float, supply: float,
               ambient: float) -> float:
    """
    Return the mass flow into the chamber, kg/s, negative when it vents.

    Parameters
    ----------
    valve : ValveFlow
    opening : float, -1..1
    pressure, supply, ambient : float, Pa (absolute)
    """
    if opening >= 0.0:
        return opening * mass_flow(valve.conductance, valve.critical_ratio, supply, pressure)
    return opening * mass_flow(valve.conductance, valve.critical_ratio, pressure, ambient)


@dataclass(frozen=True)
class ValveFlow:
    """
    Flow properties of a 3-way proportional valve: conductance, critical ratio, dead band.

    The defaults are those of the Festo MPYE-5-M5-010-B (from memory of its data sheet: 100 l/min
    nominal, 0-10 V with 5 V closed, dead band 0.1-0.3 V).

    Parameters
    ----------
    conductance : float, m^3/(s Pa)
        Sonic conductance C fully open.
    critical_ratio : float
        b: below this ratio of absolute pressures the flow is choked.
    dead_band : float
        Absolute value of the command, 0 to 1, at which the valve begins to open.
    """

    conductance: float = 3.93e-9
    critical_ratio: float = 0.3
    dead_band: float = 0.04

    def opening(self, command: float) -> float:
        """Return `valve_opening` of this valve."""
        return valve_opening(self, command)

    def command(self, opening: float) -> float:
        """Return `valve_command` of this valve."""
        return valve_command(self, opening)

    def flow(self, opening: float, pressure: float, supply: float,
             ambient: float = ATMOSPHERE) -> float:
        """Return `valve_flow` of this valve, kg/s; pressures absolute."""
        return valve_flow(self, opening, pressure, supply, ambient)


def pressure_rate(pressure: float, volume: float, volume_rate: float, flow: float) -> float:
    """
    Return dp/dt of a chamber in Pa/s: `POLYTROPIC` (R T flow - p dV/dt)/V.

    Parameters
    ----------
    pressure : float, Pa (absolute)
    volume : float, m^3
        Gas volume with tubing.
    volume_rate : float, m^3/s
    flow : float, kg/s
        Into the chamber.
    """
    return POLYTROPIC * (RT * flow - pressure * volume_rate) / volume


def flow_for(pressure: float, volume: float, volume_rate: float, wanted_rate: float) -> float:
    """Return the mass flow that gives a wanted dp/dt: the inverse of `pressure_rate`, kg/s."""
    return (wanted_rate * volume / POLYTROPIC + pressure * volume_rate) / RT
