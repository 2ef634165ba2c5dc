# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pneumatic circuit: regulator -> manifold -> n valves -> n chambers -> ambient.

One `Circuit.advance` per internal step of the rig. Inside, Runge-Kutta of fourth order with as
many sub-steps as the stiffest volume asks for: near equal pressures an open valve settles a
small chamber in less than a millisecond. Plain floats in lists: for the few motor units of a
bundle this is several times faster than arrays. Pressures are ABSOLUTE in here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from fam_bundle_ros.model.pneumatics import mass_flow, REFERENCE_DENSITY
from fam_bundle_ros.plant.pneumatics import ChamberConfig, RT, ValveConfig
from fam_bundle_ros.plant.supply import SupplyConfig

#: Largest product of sub-step and fastest rate. RK4 is stable to 2.8; below 0.7 its error is
#: far below that of the coupling to the load.
_STIFFNESS = 0.7
#: A spool further than this from its command is on the move and gets two sub-steps at least.
_SPOOL_MOVES = 0.05


@dataclass
class AirBalance:
    """Where the air went since the start, kg: drawn = delivered + what filled the manifold."""

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


class Circuit:
    """
    State and motion of the air in a rig.

    Parameters
    ----------
    units : int
    valve : ValveConfig
    chamber : ChamberConfig
    supply : SupplyConfig
    ambient : float, Pa (absolute)
    droop : float, Pa/(kg/s)
        Resistance in series with the regulator's own.
    """

    def __init__(self, units: int, valve: ValveConfig, chamber: ChamberConfig,
                 supply: SupplyConfig, ambient: float, droop: float = 0.0):
        self.units = units
        self.valve = valve
        self.chamber = chamber
        self.supply = supply
        self.ambient = ambient
        self._resistance = supply.resistance + droop
        self._stiffest = max(chamber.inflow_exponent, chamber.outflow_exponent)
        self._spool_steps: dict[float, tuple[float, float, float, float]] = {}
        self.reset()

    def reset(self) -> None:
        """Chambers at ambient, manifold at the regulator's set point, valves closed."""
        #: Pa (absolute), one per chamber.
        self.pressure = [self.ambient] * self.units
        #: Spool position and its speed, one per valve.
        self.spool = [0.0] * self.units
        self.spool_rate = [0.0] * self.units
        #: Pa (absolute).
        self.manifold = self.supply.pressure + self.ambient
        #: True while the supply is shut off and the manifold dumped (emergency stop).
        self.dumping = False
        self.balance = AirBalance()

    def advance(self, dt: float, commands: Sequence[float], volume: Sequence[float],
                volume_after: Sequence[float], leaks: Sequence[float]) -> None:
        """
        Advance by ``dt`` while the gas volumes go linearly to ``volume_after``.

        Parameters
        ----------
        dt : float, s
        commands : sequence of float, -1..1
            Valve commands, held.
        volume, volume_after : sequence of float, m^3
            Gas volumes with tubing.
        leaks : sequence of float, 1/s
            Rate at which each chamber's gauge pressure leaks away at constant volume.
        """
        units = range(self.units)
        slopes = [(volume_after[i] - volume[i]) / dt for i in units]
        smallest = [min(volume[i], volume_after[i]) for i in units]
        count = self._substeps(dt, commands, smallest, leaks)
        h = dt / count
        for k in range(count):
            openings = self._move_spools(h, commands)
            now = [volume[i] + k * h * slopes[i] for i in units]
            self._runge_kutta(h, openings, now, slopes, leaks)

    def _move_spools(self, dt: float, commands: Sequence[float]) -> list[float]:
        """Move the spools exactly and return the mean opening of each valve over the step."""
        half = self._spool_steps.get(dt)
        if half is None:
            half = self._spool_steps[dt] = self.valve.spool_step(0.5 * dt)
        a, b, c, d = half
        opening = self.valve.opening
        openings = []
        for i, target in enumerate(commands):
            error, rate = self.spool[i] - target, self.spool_rate[i]
            if error == 0.0 and rate == 0.0:
                openings.append(opening(target))
                self.spool[i], self.spool_rate[i] = target, 0.0
                continue
            middle, middle_rate = a * error + b * rate, c * error + d * rate
            after = a * middle + b * middle_rate
            # Simpson's rule: the opening bends where the dead band ends.
            openings.append((opening(target + error) + 4.0 * opening(target + middle)
                             + opening(target + after)) / 6.0)
            self.spool[i] = target + after
            self.spool_rate[i] = c * middle + d * middle_rate
        return openings

    def _substeps(self, dt: float, commands: Sequence[float], volume: Sequence[float],
                  leaks: Sequence[float]) -> int:
        """
        Return how many sub-steps keep spools and pressures well resolved.

        The flow is concave in the pressure ratio, so flow over pressure difference bounds the
        slope at the present pressure from above.
        """
        c, b, chamber = self.valve.conductance, self.valve.critical_ratio, self.chamber
        opening = self.valve.opening
        least, fastest = 1, 0.0
        manifold = 1.0 / self._resistance
        if self.dumping:
            manifold += _secant(self.supply.dump_conductance, b, self.manifold, self.ambient)
        for i, target in enumerate(commands):
            p, spool = self.pressure[i], self.spool[i]
            if abs(spool - target) > _SPOOL_MOVES:
                least = 2
            ends = (opening(spool), opening(target))
            slope = 0.0
            if max(ends) > 0.0:
                slope = max(ends) * _secant(c, b, self.manifold, p)
                manifold += slope
            if min(ends) < 0.0:
                slope = max(slope, -min(ends) * _secant(c, b, p, self.ambient))
            if p > self.ambient + chamber.relief_pressure - chamber.relief_band:
                # Opening the relief valve is steeper than the flow through it.
                slope += c * p * REFERENCE_DENSITY * (1.0 / chamber.relief_band + 1.0 / p)
            fastest = max(fastest, self._stiffest * RT * slope / volume[i] + leaks[i])
        fastest = max(fastest, RT * manifold / self.supply.volume)
        return max(least, math.ceil(dt * fastest / _STIFFNESS))

    def _flows(self, p: Sequence[float], manifold: float, volume: Sequence[float],
               slopes: Sequence[float], openings: Sequence[float], leaks: Sequence[float],
               ) -> tuple[list[float], float, float, float, float, float, float]:
        """Return dp/dt per chamber, dp/dt of the manifold, and the five flows of the balance."""
        c, b, ambient = self.valve.conductance, self.valve.critical_ratio, self.ambient
        chamber = self.chamber
        g_in, g_out, g_v = (chamber.inflow_exponent, chamber.outflow_exponent,
                            chamber.volume_exponent)
        relief = ambient + chamber.relief_pressure
        rates = []
        delivered = exhausted = leaked = 0.0
        for i, pi in enumerate(p):
            opening = openings[i]
            v = volume[i]
            into = out = leak = 0.0
            if opening > 0.0:
                flow = opening * mass_flow(c, b, manifold, pi)
                delivered += flow
                if flow >= 0.0:
                    into = flow
                else:
                    out = -flow
            elif opening < 0.0:
                flow = -opening * mass_flow(c, b, pi, ambient)
                exhausted += flow
                if flow >= 0.0:
                    out = flow
                else:
                    into = -flow
            if pi > relief:
                flow = min((pi - relief) / chamber.relief_band, 1.0) * mass_flow(c, b, pi, ambient)
                exhausted += flow
                out += flow
            if leaks[i]:
                # Written as the flow that makes the gauge pressure decay exponentially.
                leak = leaks[i] * (pi - ambient) * v / (g_out * RT)
                leaked += leak
            rates.append((RT * (g_in * into - g_out * (out + leak)) - g_v * pi * slopes[i]) / v)
        drawn = dumped = 0.0
        if self.dumping:
            dumped = mass_flow(self.supply.dump_conductance, b, manifold, ambient)
        else:
            lack = self.supply.pressure + ambient - manifold
            drawn = min(max(lack / self._resistance, 0.0), self.supply.flow_limit)
        rate = RT * (drawn - delivered - dumped) / self.supply.volume
        return rates, rate, drawn, delivered, exhausted, leaked, dumped

    def _runge_kutta(self, h: float, openings: Sequence[float], volume: Sequence[float],
                     slopes: Sequence[float], leaks: Sequence[float]) -> None:
        units = range(self.units)
        p, m = self.pressure, self.manifold
        half, sixth = 0.5 * h, h / 6.0
        middle = [volume[i] + half * slopes[i] for i in units]
        end = [volume[i] + h * slopes[i] for i in units]
        r1, *f1 = self._flows(p, m, volume, slopes, openings, leaks)
        r2, *f2 = self._flows([p[i] + half * r1[i] for i in units], m + half * f1[0],
                              middle, slopes, openings, leaks)
        r3, *f3 = self._flows([p[i] + half * r2[i] for i in units], m + half * f2[0],
                              middle, slopes, openings, leaks)
        r4, *f4 = self._flows([p[i] + h * r3[i] for i in units], m + h * f3[0],
                              end, slopes, openings, leaks)
        self.pressure = [p[i] + sixth * (r1[i] + 2.0 * (r2[i] + r3[i]) + r4[i]) for i in units]
        total = [sixth * (f1[j] + 2.0 * (f2[j] + f3[j]) + f4[j]) for j in range(6)]
        self.manifold = m + total[0]
        balance = self.balance
        balance.drawn += total[1]
        balance.delivered += total[2]
        balance.exhausted += total[3]
        balance.leaked += total[4]
        balance.dumped += total[5]


def _secant(conductance: float, b: float, upstream: float, downstream: float) -> float:
    """Return flow over pressure difference, kg/(s Pa); at equal pressures its limit."""
    difference = abs(upstream - downstream)
    if difference < 1.0:
        upstream, difference = downstream + 1.0, 1.0
    return abs(mass_flow(conductance, b, upstream, downstream)) / difference
