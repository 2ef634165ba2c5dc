# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The way of one motor unit through its falling branch, in step with those that compensate."""

import math

from fam_bundle_ros.control.allocation import Curves

#: Time over which a crossing gathers and loses speed, s: both units lag alike only when smooth.
_EASE = 0.01
#: How many times faster than `SwitchingConfig.crossing_rate` a crossing may be in a hurry.
_HURRY = 4.0


class Crossing:
    """
    The way of one unit through its falling branch.

    Parameters
    ----------
    unit : int
    up : bool
    pressure : float, Pa (gauge)
        Where it is.
    pace : float, Pa/s
        See `crossing_pace`.
    """

    def __init__(self, unit: int, up: bool, pressure: float, pace: float):
        self.unit, self.up, self.pressure = unit, up, pressure
        self._pace = pace
        self._speed = 0.0

    def advance(self, dt: float, target: float, ratio: float, short: bool) -> bool:
        """
        Move on by one tick.

        Parameters
        ----------
        dt : float, s
        target : float, Pa (gauge)
            Where it is to end.
        ratio : float
            Pressure change that the compensating unit needs per change of this one.
        short : bool
            The others cannot compensate: be through as fast as the valve goes.

        Returns
        -------
        bool
            True when it has arrived.
        """
        limit = self._pace / max(1.0, ratio)
        if short:
            limit = 20.0 * self._pace
        distance = abs(target - self.pressure)
        ease = self._pace / _EASE
        speed = min(self._speed + ease * dt, limit, math.sqrt(2.0 * ease * distance) + ease * dt)
        self._speed = limit if short else speed
        step = min(self._speed * dt, distance)
        self.pressure += math.copysign(step, target - self.pressure)
        return step >= distance


def crossing_pace(curves: Curves, unit: int, rate: float, usual: float) -> float:
    """
    Return the pressure rate at which to bring a unit through its falling branch, Pa/s.

    Smoothly where there is time; faster where the demand (rising by ``rate``, N/s) would
    meanwhile use up what the others can compensate.

    Parameters
    ----------
    curves : Curves
    unit : int
    rate : float, N/s
    usual : float, Pa/s
        `SwitchingConfig.crossing_rate`.
    """
    dip = max(float(curves.dip[unit]), 0.1)
    hurry = float(curves.bottom_pressure[unit]) * max(rate, 0.0) / dip
    return min(max(usual, hurry), _HURRY * usual)


def crossing_time(curves: Curves, unit: int, rate: float, usual: float) -> float:
    """Return about how long it takes to bring a unit to the bottom of its branch, s."""
    travel = float(curves.bottom_pressure[unit])
    others = [i for i in curves.order if i != unit]
    slope = max((curves.slope(i, curves.pressure[-1, i]) for i in others), default=0.0)
    compensation = float(curves.dip[unit]) / slope if slope > 0.0 else 0.0
    pace = crossing_pace(curves, unit, rate, usual)
    return 1.4 * max(travel, compensation) / pace + 2.0 * _EASE
