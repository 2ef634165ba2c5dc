# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The rig's plant as a user would write it: an ODE for `solve_ivp` and for python-control.

Written from the equations, not from `fam_bundle_ros.plant`: force and gas volume come from the
bundle, constants from the rig's configuration. So it also shows the accuracy of the rig's own
integrator. It has no leaks, relief valves or end stops in motion, which the case does not reach.
"""

from dataclasses import dataclass
import math

import numpy as np
from scipy.integrate import solve_ivp

from fam_bundle_ros.benchmarks.speed import Skipped
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import (
    GAS_CONSTANT,
    LAMINAR_RATIO,
    POLYTROPIC,
    REFERENCE_DENSITY,
    REFERENCE_TEMPERATURE,
)
from fam_bundle_ros.plant import MassSpring, RigConfig

#: Scales of the absolute tolerance: strain, strain rate, pressure, spool position, spool speed.
_SCALE = (1e-2, 1e-1, 1e5, 1.0, 1e3)


@dataclass(frozen=True)
class Errors:
    """Largest errors against the fine reference: strain and pressure (Pa)."""

    strain: float
    pressure: float

    def __str__(self) -> str:
        return f'{self.strain:.0e} in strain, {self.pressure:.0f} Pa'


class Plant:
    """
    A bundle without memory on a mass and spring, with valves and supply, as an ODE.

    State: strain, strain rate, manifold pressure, chamber pressures (n), spool positions (n) and
    speeds (n); pressures absolute. Input: valve commands (n). The load of the rig is a
    `MassSpring`.
    """

    def __init__(self, bundle: Bundle, rig: RigConfig):
        assert isinstance(rig.load, MassSpring)
        self.bundle, self.rig, self.load = bundle, rig, rig.load
        self.length = bundle.length

    @property
    def start(self) -> np.ndarray:
        """The state at rest on the lower end stop, vented, with a full manifold."""
        n, ambient = self.bundle.n, self.rig.ambient_pressure
        return np.array([self.load.stops[0], 0.0, self.rig.supply.pressure + ambient,
                         *[ambient] * n, *[0.0] * (2 * n)])

    @property
    def tolerance(self) -> np.ndarray:
        """Factors from the relative tolerance to absolute tolerances of the state."""
        n = self.bundle.n
        strain, rate, pressure, spool, speed = _SCALE
        return np.array([strain, rate, pressure, *[pressure] * n, *[spool] * n, *[speed] * n])

    def rates(self, time: float, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """
        Return d(state)/dt.

        m x'' = F - m g - k (x - x0) - d x'; p' = g (R T m' - p V')/V; spool: second order.
        """
        n, rig, load = self.bundle.n, self.rig, self.load
        strain, rate, manifold = state[:3].tolist()
        pressure, spool, speed = state[3:3 + n], state[3 + n:3 + 2 * n], state[3 + 2 * n:]
        ambient = rig.ambient_pressure
        force = float(self.bundle.force(strain, np.maximum(pressure - ambient, 0.0), rate))
        contraction = strain * self.length
        held = (load.mass * load.gravity
                + load.stiffness_against * (contraction - load.spring_rest))
        acceleration = (force - held - load.damping * rate * self.length) / (
            load.mass * self.length)
        if strain <= load.stops[0] and rate <= 0.0:
            rate, acceleration = 0.0, max(acceleration, 0.0)
        volume = (np.asarray(self.bundle.gas_volume(strain)) + rig.chamber.tube_volume).tolist()
        slope = np.asarray(self.bundle.gas_volume_slope(strain)).tolist()
        taken, risen = 0.0, []
        for i, p in enumerate(pressure.tolist()):
            flow = self._flow(spool[i], p, manifold)
            if spool[i] > 0.0:
                taken += flow
            risen.append(POLYTROPIC * (GAS_CONSTANT * REFERENCE_TEMPERATURE * flow
                                       - p * slope[i] * rate) / volume[i])
        supply = rig.supply
        drawn = min(max((supply.pressure + ambient - manifold) / supply.resistance, 0.0),
                    supply.flow_limit)
        filled = GAS_CONSTANT * REFERENCE_TEMPERATURE * (drawn - taken) / supply.volume
        w, z = rig.valve.natural_frequency, rig.valve.damping
        pushed = w * w * (np.clip(command, -1.0, 1.0) - spool) - 2.0 * z * w * speed
        return np.concatenate([[rate, acceleration, filled], risen, speed, pushed])

    def _flow(self, spool: float, pressure: float, manifold: float) -> float:
        """Return the mass flow into a chamber, kg/s (ISO 6358)."""
        valve = self.rig.valve
        opening = (abs(spool) - valve.dead_band) / (1.0 - valve.dead_band)
        if opening <= 0.0:
            return 0.0
        high, low = (manifold, pressure) if spool > 0.0 else (pressure, self.rig.ambient_pressure)
        sign = 1.0 if spool > 0.0 else -1.0
        if low > high:
            high, low, sign = low, high, -sign
        ratio, b = low / high, valve.critical_ratio
        flow = min(opening, 1.0) * valve.conductance * high * REFERENCE_DENSITY
        if ratio > LAMINAR_RATIO:
            flow *= (1.0 - ratio) / (1.0 - LAMINAR_RATIO)
            ratio = LAMINAR_RATIO
        if ratio > b:
            flow *= math.sqrt(1.0 - ((ratio - b) / (1.0 - b)) ** 2)
        return sign * flow

    def seen(self, state: np.ndarray) -> np.ndarray:
        """Return strain and gauge pressures of a state."""
        n = self.bundle.n
        return np.concatenate([state[:1], state[3:3 + n] - self.rig.ambient_pressure])


def replay(plant: Plant, commands: np.ndarray, dt: float, tolerance: float) -> np.ndarray:
    """
    Return strain and pressures (T, 1 + n) after each command, with `solve_ivp` (LSODA).

    The solver is restarted at each command, as in a loop with a digital controller.
    """
    state, rows = plant.start, []
    for command in commands:
        found = solve_ivp(plant.rates, (0.0, dt), state, method='LSODA', args=(command,),
                          rtol=tolerance, atol=tolerance * plant.tolerance)
        state = found.y[:, -1]
        rows.append(plant.seen(state))
    return np.array(rows)


def respond(plant: Plant, commands: np.ndarray, dt: float, tolerance: float) -> np.ndarray:
    """
    Return the result of `replay`, but with python-control's `input_output_response`.

    It interpolates inputs linearly: each command has two points, so that it is held.

    Raises
    ------
    Skipped
        Without python-control.
    """
    try:
        import control
    except ImportError as error:
        raise Skipped('python-control is not installed') from error
    n = plant.bundle.n
    system = control.nlsys(
        lambda t, x, u, params: plant.rates(t, x, np.atleast_1d(u)),
        lambda t, x, u, params: plant.seen(x), inputs=n, outputs=n + 1, states=3 + 3 * n)
    count = len(commands)
    steps = dt * np.arange(count)
    times = np.stack([steps, steps + dt * (1.0 - 1e-6)], axis=1).ravel()
    found = control.input_output_response(
        system, np.append(times, count * dt), np.append(np.repeat(commands, 2, axis=0),
                                                        commands[-1:], axis=0).T,
        plant.start, solve_ivp_method='LSODA',
        solve_ivp_kwargs={'rtol': tolerance, 'atol': tolerance * plant.tolerance})
    return found.outputs.T[2::2]


def errors(found: np.ndarray, reference: np.ndarray) -> Errors:
    """Return the largest differences of strain and pressures (T, 1 + n)."""
    gap = np.abs(found - reference[:len(found)]).max(axis=0)
    return Errors(float(gap[0]), float(gap[1:].max()))
