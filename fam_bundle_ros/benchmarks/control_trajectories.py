# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The trajectories of the control benchmark, laid out from the model's own overlap.

Forces are given on a dynamometer at 16 % strain, strains against a mass and a spring or an arm.
"""

from bisect import bisect_right
import math

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Arm, Dynamometer, MassSpring
from fam_bundle_ros.simulation import Trajectory

#: Names, in the order in which they are shown.
TRAJECTORIES = ('ramp', 'staircase', 'sine_0.1', 'sine_0.5', 'sine_1', 'crossing_sine', 'dwell',
                'dwell_edge', 'arm_spline', 'load_step')
#: Strain of the force trajectories and peak of the strain sines.
STRAIN = 0.16
#: Time in which the start of a trajectory is taken up before it counts, s.
_PREPARE = 1.5


class _Path:
    """Values at times, joined by straight lines or by fifth-order (minimum jerk) pieces."""

    def __init__(self, times, values, smooth=True):
        times, values = [float(time) for time in times], [float(value) for value in values]
        self._times, self._smooth = times, smooth
        #: Start, span, first value and change of each piece; before and after all it stands still.
        self._pieces = [(times[0], 1.0, values[0], 0.0)]
        self._pieces += [(t, after - t, value, then - value) for t, after, value, then in zip(
            times, times[1:], values, values[1:])]
        self._pieces.append((times[-1], 1.0, values[-1], 0.0))

    def value(self, t):
        """Return the value at a time."""
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


class _Sine:
    """From the low value up to the high one and back, starting at the low one."""

    def __init__(self, low, high, frequency):
        self._middle, self._size = 0.5 * (low + high), 0.5 * (high - low)
        self._turn = 2.0 * math.pi * frequency

    def value(self, t):
        """Return the value at a time."""
        return self._middle - self._size * math.cos(self._turn * t)

    def rate(self, t):
        """Return the rate at a time."""
        return self._size * self._turn * math.sin(self._turn * t)


def make_trajectory(name: str, bundle: Bundle, long: bool = False) -> Trajectory:
    """
    Return a trajectory of the benchmark.

    Parameters
    ----------
    name : str
        One of `TRAJECTORIES`.
    bundle : Bundle
        Whose overlap places the demands.
    long : bool
        Dwell for 60 s rather than 8 s.

    Raises
    ------
    InputError
        For another name.
    """
    length = float(bundle.motor_units[0].geometry.length)
    overlap = bundle.overlap(STRAIN, 1)
    middle, limit = 0.5 * (overlap.low + overlap.high), overlap.high
    dwell = 60.0 if long else 8.0

    def force(path, duration):
        return Trajectory(name, 'force', duration, path.value, path.rate,
                          Dynamometer(strain=STRAIN), prepare=_PREPARE)

    def strain(path, duration, load, events=()):
        return Trajectory(name, 'strain', duration, path.value, path.rate, load, events=events,
                          prepare=_PREPARE)

    if name == 'ramp':
        low, high = 0.25 * limit, 1.6 * limit
        return force(_Path([0.5, 4.5, 5.0, 9.0, 11.0], [low, high, high, low, low],
                           smooth=False), 11.0)
    if name == 'crossing_sine':
        return force(_Sine(0.5 * limit, 1.5 * limit, 0.5), 8.0)
    if name == 'dwell':
        return force(_Path([0.0, 2.0, 3.0], [0.5 * limit, middle, middle]), dwell)
    if name == 'dwell_edge':
        edge = limit - 0.1
        return force(_Path([0.0, 2.0, 3.0], [0.5 * limit, edge, edge]), dwell)
    if name == 'staircase':
        levels = [0.03, 0.07, 0.11, 0.15, 0.18, 0.15, 0.11, 0.07, 0.03, 0.08, 0.03]
        times = [t for k in range(len(levels)) for t in (1.0 * k, 1.0 * k + 0.6)]
        path = _Path(times, np.repeat(levels, 2))
        return strain(path, times[-1] + 0.4, _mass_spring(bundle, 0.15, 1.15, length))
    if name.startswith('sine_') and name in TRAJECTORIES:
        frequency = float(name.split('_')[1])
        duration = {0.1: 20.0, 0.5: 8.0, 1.0: 6.0}[frequency]
        load = _mass_spring(bundle, STRAIN, middle / limit, length)
        return strain(_Sine(0.02, STRAIN, frequency), duration, load)
    if name == 'arm_spline':
        path = _Path([0.0, 1.2, 1.6, 2.8, 3.2, 4.4, 5.2, 6.2, 7.2],
                     [0.01, 0.10, 0.10, 0.145, 0.145, 0.05, 0.05, 0.11, 0.01])
        return strain(path, 8.0, Arm())
    if name == 'load_step':
        path = _Path([0.0, 1.0, 6.0, 7.0, 8.0], [0.02, 0.12, 0.12, 0.02, 0.11])
        top = bundle.overlap(0.12, 1).high / 9.80665
        events = ((2.5, {'mass': 1.15 * top}), (4.5, {'mass': 0.7 * top}))
        return strain(path, 9.0, MassSpring(mass=0.7 * top, damping=40.0), events)
    raise InputError(f"trajectory is '{name}'; expected one of {', '.join(TRAJECTORIES)}")


def _mass_spring(bundle, strain, share, length):
    """Return a load that needs a share of RS1's largest force at a strain."""
    force = share * bundle.overlap(strain, 1).high
    mass = 0.45 * force / 9.80665
    return MassSpring(mass=mass, stiffness_against=0.55 * force / (strain * length),
                      damping=40.0)
