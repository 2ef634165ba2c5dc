# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Configuration of one proportional valve and one chamber, with results in closed form.

The flow law itself is `fam_bundle_ros.model.pneumatics`, shared with the controller. Pressures
of the public functions here are GAUGE, as everywhere in the package outside the flow law.
"""

from dataclasses import dataclass
import math

from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    LAMINAR_RATIO,
    mass_flow,
    POLYTROPIC,
    REFERENCE_DENSITY,
    RT,
    ValveFlow,
)
from fam_bundle_ros.plant.checks import require


@dataclass(frozen=True)
class ValveConfig(ValveFlow):
    """
    A 3-way proportional valve: its flow (`ValveFlow`) and the dynamics of its spool.

    Parameters
    ----------
    bandwidth : float, Hz
        Bandwidth of the spool at -3 dB.
    damping : float
        Damping ratio of the spool, below 1.
    hysteresis : float
        Backlash between command and spool: after a reversal the command must change by this much
        before the spool moves.
    delay : float, s
        Dead time of all commands: bus, driver, amplifier. They act at the rig's next own step.
    """

    bandwidth: float = 125.0
    damping: float = 0.7
    hysteresis: float = 0.0
    delay: float = 0.0

    def __post_init__(self):
        require(self, 'conductance', 'bandwidth', above=0.0)
        require(self, 'critical_ratio', 'dead_band', least=0.0, most=0.9)
        require(self, 'damping', least=0.1, most=0.99)
        require(self, 'hysteresis', least=0.0, most=0.5)
        require(self, 'delay', least=0.0)

    @property
    def natural_frequency(self) -> float:
        """Natural frequency of the spool, rad/s, that gives the -3 dB bandwidth."""
        z2 = self.damping ** 2
        return 2.0 * math.pi * self.bandwidth / math.sqrt(
            1.0 - 2.0 * z2 + math.sqrt(4.0 * z2 * z2 - 4.0 * z2 + 2.0))


#: The valve of the rig that the defaults describe.
DEFAULT_VALVE = ValveConfig()


@dataclass(frozen=True)
class ChamberConfig:
    """
    The chamber of one motor unit: dead volume, exponents, relief valve.

    dp/dt = (g_in R T m_in - g_out R T m_out - g_v p dV/dt)/V with p absolute.

    Parameters
    ----------
    tube_volume : float, m^3
        Tube and fittings between valve and muscles, per motor unit.
    inflow_exponent, outflow_exponent, volume_exponent : float
        g_in, g_out, g_v; 1 is isothermal, 1.4 adiabatic.
    relief_pressure : float, Pa (gauge)
        Pressure at which the mechanical relief valve begins to open.
    relief_band : float, Pa
        Further rise of pressure at which it is fully open, with the valve's conductance.
    line_volume : float, m^3
        Part of ``tube_volume`` between valve and a restriction, with the pressure sensor; 0 for
        a line without a pressure drop.
    line_conductance, line_ratio : float, m^3/(s Pa) and 1
        Sonic conductance and critical pressure ratio of that restriction after ISO 6358.
    """

    tube_volume: float = 5e-6
    inflow_exponent: float = POLYTROPIC
    outflow_exponent: float = POLYTROPIC
    volume_exponent: float = POLYTROPIC
    relief_pressure: float = 500e3
    relief_band: float = 20e3
    line_volume: float = 0.0
    line_conductance: float = 8e-9
    line_ratio: float = 0.3

    def __post_init__(self):
        require(self, 'tube_volume', 'relief_pressure', 'relief_band', 'line_conductance',
                above=0.0)
        require(self, 'line_volume', least=0.0, most=self.tube_volume)
        require(self, 'line_ratio', least=0.0, most=0.9)
        require(self, 'inflow_exponent', 'outflow_exponent', 'volume_exponent',
                least=1.0, most=1.4)


@dataclass(frozen=True)
class ChamberLinearisation:
    """
    Linear model of the chamber at an operating point.

    dp/dt = gain (opening) - p/time_constant: an integrator where the flow is choked (infinite
    time constant), a first-order lag where it is not. The spool comes before it.
    """

    #: Pa/s per unit of opening on the fill side and on the exhaust side.
    fill_gain: float
    exhaust_gain: float
    #: s, at the given opening.
    fill_time_constant: float
    exhaust_time_constant: float
    #: rad/s and 1 of the spool.
    spool_frequency: float
    spool_damping: float


def linearise(pressure: float, volume: float, supply: float,
              valve: ValveConfig = DEFAULT_VALVE, opening: float = 1.0,
              ambient: float = ATMOSPHERE,
              exponent: float = POLYTROPIC) -> ChamberLinearisation:
    """
    Linearise valve and chamber at an operating point.

    Parameters
    ----------
    pressure, supply : float, Pa (gauge)
    volume : float, m^3
        Gas volume with tubing, taken as constant.
    valve : ValveConfig
    opening : float
        Opening (beyond the dead band, 0..1) for the time constants, which are proportional to
        1/opening.
    ambient : float, Pa (absolute)

    Examples
    --------
    >>> point = linearise(200e3, 16e-6, 500e3)
    >>> print(f'{point.fill_gain / 1e6:.1f} MPa/s, {point.exhaust_gain / 1e6:.1f} MPa/s')
    16.9 MPa/s, 8.8 MPa/s
    """
    def rate(p: float, side: float) -> float:
        return exponent * RT / volume * valve.flow(side, p, supply + ambient, ambient)

    def time_constant(side: float) -> float:
        small = 1.0
        p = pressure + ambient
        slope = opening * (rate(p + small, side) - rate(p - small, side)) / (2.0 * small)
        return -1.0 / slope if slope < 0.0 else math.inf

    return ChamberLinearisation(
        rate(pressure + ambient, 1.0), -rate(pressure + ambient, -1.0),
        time_constant(1.0), time_constant(-1.0), valve.natural_frequency, valve.damping)


def fastest_rise(start: float, end: float, volume: float, supply: float,
                 valve: ValveFlow = DEFAULT_VALVE, ambient: float = ATMOSPHERE,
                 exponent: float = POLYTROPIC) -> float:
    """
    Return the least time, s, in which the open valve can fill a chamber of constant volume.

    Closed form: choked (constant rate), then the quarter ellipse of ISO 6358 (an arc sine),
    then the linear region (a logarithm). Without the spool's own delay.

    Parameters
    ----------
    start, end, supply : float, Pa (gauge)
    volume : float, m^3
        With tubing.

    Returns
    -------
    float
        0 when ``end`` is not above ``start``; infinite at or above the supply.

    Examples
    --------
    >>> print(f'{1e3 * fastest_rise(0.0, 300e3, 16e-6, 500e3):.1f} ms')
    17.6 ms
    """
    if end <= start:
        return 0.0
    if end >= supply:
        return math.inf
    b = valve.critical_ratio
    source = supply + ambient
    ratios = ((start + ambient) / source, (end + ambient) / source)
    rate = exponent * RT / volume * valve.conductance * REFERENCE_DENSITY
    # Flow factor where the linear region begins.
    edge = math.sqrt(1.0 - ((LAMINAR_RATIO - b) / (1.0 - b)) ** 2)

    def elapsed(r: float) -> float:
        choked = min(r, b)
        ellipse = (1.0 - b) * math.asin((min(max(r, b), LAMINAR_RATIO) - b) / (1.0 - b))
        linear = (1.0 - LAMINAR_RATIO) / edge * math.log(
            (1.0 - LAMINAR_RATIO) / (1.0 - max(r, LAMINAR_RATIO)))
        return (choked + ellipse + linear) / rate

    return elapsed(ratios[1]) - elapsed(ratios[0])


def fastest_fall(start: float, end: float, volume: float,
                 valve: ValveFlow = DEFAULT_VALVE, ambient: float = ATMOSPHERE,
                 exponent: float = POLYTROPIC) -> float:
    """
    Return the least time, s, in which the open valve can vent a chamber of constant volume.

    Parameters
    ----------
    start, end : float, Pa (gauge)
    volume : float, m^3
        With tubing.

    Returns
    -------
    float
        0 when ``end`` is not below ``start``; infinite at or below ambient.
    """
    if end >= start:
        return 0.0
    if end <= 0.0:
        return math.inf
    # In x = log(p - ambient) the integrand is finite down to ambient: trapezium rule.
    low, high = math.log(end), math.log(start)
    count = max(8, int(64 * (high - low)))
    width = (high - low) / count
    total = 0.0
    for i in range(count + 1):
        gauge = math.exp(low + i * width)
        flow = mass_flow(valve.conductance, valve.critical_ratio, gauge + ambient, ambient)
        total += (0.5 if i in (0, count) else 1.0) * gauge / flow
    return total * width * volume / (exponent * RT)
