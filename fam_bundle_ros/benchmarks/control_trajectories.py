# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The trajectories of the control benchmark, scaled to the range of both plant and model.

Force references run on a dynamometer at 16 % strain, strain references against a mass and a spring
or an arm. Dwells lie in the overlap of the first two recruitment states of the controller's model.
"""

from bisect import bisect_right
import math
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks.plants import sweep
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Arm, Dynamometer, MassSpring
from fam_bundle_ros.simulation import Trajectory

#: Names, in the order in which they are shown.
TRAJECTORIES = ('ramp_5', 'ramp_20', 'ramp_80', 'sine_0.1', 'sine_0.5', 'sine_1', 'sine_2',
                'multisine', 'steps', 'moved', 'dwell', 'dwell_edge', 'strain_sine',
                'strain_steps', 'load_step', 'arm')
#: Strain of the force trajectories; amplitude and frequency (Hz) of its motion at constant force.
STRAIN, MOVED, MOVED_HERTZ = 0.16, 0.035, 0.3
#: Range of the force references, as shares of the largest common force.
_LOW, _HIGH = 0.06, 0.88
#: Time for reaching the start of a trajectory before the evaluation, s.
_PREPARE = 1.5
#: Longest rise of a ramp, s; slow ramps are restricted to the overlap.
_RAMP = 10.0
#: Rest after a ramp, s: longer than the time after which a controller releases a unit.
_REST = 1.5
_GRAVITY = 9.80665


class _Path:
    """Values at times, joined by straight lines or by fifth-order (minimum jerk) pieces."""

    def __init__(self, times, values, smooth=True):
        times, values = [float(time) for time in times], [float(value) for value in values]
        self._times, self._smooth = times, smooth
        #: Start, span, first value and change of each piece; constant before and after all.
        self._pieces = [(times[0], 1.0, values[0], 0.0)]
        self._pieces += [(t, after - t, value, then - value) for t, after, value, then in zip(
            times, times[1:], values, values[1:])]
        self._pieces.append((times[-1], 1.0, values[-1], 0.0))

    def value(self, t):
        begin, span, start, change = self._pieces[bisect_right(self._times, t)]
        x = (t - begin) / span
        return start + change * (x ** 3 * (10.0 - 15.0 * x + 6.0 * x * x) if self._smooth else x)

    def rate(self, t):
        """Return the rate at a time; 0 where lines meet."""
        begin, span, _, change = self._pieces[bisect_right(self._times, t)]
        x = (t - begin) / span
        if not self._smooth:
            return change / span if x > 0.0 else 0.0
        return change / span * 30.0 * x * x * (1.0 - x) ** 2


class _Sines:
    """A sum of sines (amplitude, Hz) that starts at the lowest value of the first."""

    def __init__(self, middle, *parts):
        self._middle = middle
        self._parts = [(size, 2.0 * math.pi * hertz) for size, hertz in parts]

    def value(self, t):
        return self._middle - sum(size * math.cos(turn * t) for size, turn in self._parts)

    def rate(self, t):
        return sum(size * turn * math.sin(turn * t) for size, turn in self._parts)


class _Stairs:
    """Steps of one second each; the rate is 0."""

    def __init__(self, values):
        self._values = values

    def value(self, t):
        return self._values[min(int(max(t, 0.0)), len(self._values) - 1)]

    def rate(self, t):
        return 0.0


def top_force(strain: float, model: Bundle, plant: Any, units: int | None = None) -> float:
    """
    Return the largest force that both plant and model can give at a strain, N.

    ``units`` is the number of motor units at their largest pressure; all by default.
    """
    pressure = np.where(np.arange(model.n) < (units or model.n), model.max_pressure, 0.0)
    return min(float(model.force(strain, pressure)),
               float(sweep(plant, np.array([strain]), pressure[None])[0]))


def make_trajectory(name: str, model: Bundle, plant: Any = None, long: bool = False
                    ) -> Trajectory:
    """
    Return a trajectory of the benchmark, one of `TRAJECTORIES`.

    The overlap of the controller's model determines the dwells, of 60 s rather than 6 s if
    ``long``. The plant is the model by default.
    """
    if name not in TRAJECTORIES:
        raise InputError(f"trajectory is '{name}'; expected one of {', '.join(TRAJECTORIES)}")
    plant = plant or model
    if is_strain(name):
        return _strain_trajectory(name, model, plant)
    return _force_trajectory(name, model, plant, long)


def is_strain(name: str) -> bool:
    """Return whether a trajectory is one of strain, else of force."""
    return name.split('_')[0] in ('strain', 'load', 'arm')


def _force_trajectory(name, model, plant, long):
    """Return a force over time on a dynamometer."""
    kind = name.split('_')[0]
    overlap = model.overlap(STRAIN, 1)
    top = top_force(STRAIN, model, plant)
    low, high = _LOW * top, _HIGH * top
    middle, swing = 0.5 * (low + high), 0.5 * (high - low)
    imposed: Any = None
    path: Any
    if kind == 'ramp':
        rate = float(name.split('_')[1])
        if high - low > _RAMP * rate:
            low = max(low, min(overlap.high, high) - 0.5 * _RAMP * rate)
            high = min(high, low + _RAMP * rate)
        span = (high - low) / rate
        times = np.cumsum([0.5, span, 1.0, span, _REST])
        path, duration = _Path(times[:4], [low, high, high, low], smooth=False), float(times[-1])
    elif kind == 'sine':
        hertz = float(name.split('_')[1])
        path, duration = _Sines(middle, (swing, hertz)), max(1.0 / hertz, 5.0)
    elif kind == 'multisine':
        path = _Sines(middle, (0.45 * swing, 0.17), (0.32 * swing, 0.53), (0.2 * swing, 1.1))
        duration = 10.0
    elif kind == 'steps':
        shares = (0.1, 0.5, 0.85, 1.0, 0.7, 0.35, 0.93, 0.2)
        path, duration = _Stairs([share * high for share in shares]), float(len(shares))
    elif kind == 'moved':
        # A force that is possible at every strain of the motion.
        level = 0.5 * min(top_force(STRAIN - 0.03 + way, model, plant)
                          for way in (-MOVED, MOVED))
        path, duration = _Sines(level), 8.0
        turn = 2.0 * math.pi * MOVED_HERTZ

        def imposed(t):
            return STRAIN - 0.03 + MOVED * math.sin(turn * t)
    else:
        level = (0.5 * (overlap.low + overlap.high) if name == 'dwell' else overlap.high - 0.1)
        level = min(level, high)
        path = _Path([0.0, 1.5], [0.5 * level, level])
        duration = 60.0 if long else 6.0
    return Trajectory(name, 'force', duration, path.value, path.rate, Dynamometer(strain=STRAIN),
                      imposed, prepare=_PREPARE)


def _strain_trajectory(name, model, plant):
    """Return a strain over time with a load that both plant and model can move."""
    length = model.length

    def trajectory(path, duration, load, events=()):
        return Trajectory(name, 'strain', duration, path.value, path.rate, load, events=events,
                          prepare=_PREPARE)

    if name == 'strain_sine':
        load = mass_spring(0.6 * top_force(0.14, model, plant), 0.14, length)
        return trajectory(_Sines(0.08, (0.06, 0.5)), 6.0, load)
    if name == 'strain_steps':
        levels = [0.03, 0.07, 0.11, 0.14, 0.09, 0.03]
        times = [t for k in range(len(levels)) for t in (1.2 * k, 1.2 * k + 0.6)]
        load = mass_spring(0.7 * top_force(0.14, model, plant), 0.14, length)
        return trajectory(_Path(times, np.repeat(levels, 2)), times[-1] + 0.6, load)
    if name == 'arm':
        path = _Path([0.0, 1.2, 1.6, 2.8, 3.2, 4.4, 5.2, 6.2, 7.2],
                     [0.01, 0.10, 0.10, 0.145, 0.145, 0.05, 0.05, 0.11, 0.01])
        # The same motion for a bundle of any size, with an arm in proportion to its force.
        size = top_force(0.14, model, plant) / 57.0
        return trajectory(path, 8.0, Arm(mass=1.5 * size, moment_of_inertia=0.06 * size,
                                         damping=0.05 * size))
    path = _Path([0.0, 1.0, 6.0, 7.0, 8.0], [0.02, 0.12, 0.12, 0.02, 0.11])
    mass = 0.8 * top_force(0.12, model, plant, units=1) / _GRAVITY
    events = ((2.5, {'mass': 1.5 * mass}), (4.5, {'mass': mass}))
    return trajectory(path, 8.5, MassSpring(mass=mass, damping=40.0), events)


def mass_spring(force, strain, length):
    """Return a load that needs a force (N) at a strain: 45 % weight, 55 % spring."""
    return MassSpring(mass=0.45 * force / _GRAVITY,
                      stiffness_against=0.55 * force / (strain * length), damping=40.0)
