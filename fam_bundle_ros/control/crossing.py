# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The way of motor units through their falling branch, in step with those that compensate."""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.curves import slope_at

#: Time over which a crossing gathers and loses speed, s: both units lag alike only when smooth.
_EASE = 0.01
#: How many times faster than `SwitchingConfig.crossing_rate` a crossing may be in a hurry, and
#: when the others cannot compensate.
_HURRY, _RUSH = 4.0, 20.0


@dataclass
class Crossings:
    """
    Units on their way through the falling branch.

    Attributes
    ----------
    unit : list (n,) of int
        The first ``count`` of them are on their way, in the order in which they began.
    up : list (n,) of int
        Of each unit: 1 when it is being filled.
    pressure, speed, pace : list (n,), Pa (gauge) and Pa/s
        Of each unit: where it is, how fast, and how fast it may be.
    """

    count: int
    unit: list
    up: list
    pressure: list
    speed: list
    pace: list


def no_crossings(n: int) -> Crossings:
    """Return the record of n units, none on its way."""
    return Crossings(0, [0] * n, [0] * n, [0.0] * n, [0.0] * n, [0.0] * n)


def is_crossing(crossings: Any, unit: int) -> bool:
    """Return whether a unit is on its way."""
    for k in range(crossings.count):
        if crossings.unit[k] == unit:
            return True
    return False


def begin_crossing(crossings: Any, unit: int, up: bool, pressure: float, pace: float) -> None:
    """Send a unit on its way from a pressure (Pa); ``pace`` from `crossing_pace`."""
    if not is_crossing(crossings, unit):
        crossings.unit[crossings.count] = unit
        crossings.count += 1
    crossings.up[unit] = 1 if up else 0
    crossings.pressure[unit], crossings.speed[unit], crossings.pace[unit] = pressure, 0.0, pace


def end_crossing(crossings: Any, k: int) -> None:
    """Take out the k-th of those on their way."""
    crossings.count -= 1
    for j in range(k, crossings.count):
        crossings.unit[j] = crossings.unit[j + 1]


def advance(crossings: Any, unit: int, dt: float, target: float, ratio: float, short: bool
            ) -> bool:
    """
    Move a unit on by one tick; return whether it has arrived.

    Trapezoidal speed: v' at most pace/`_EASE`, v at most sqrt(2 v' distance).

    Parameters
    ----------
    target : float, Pa (gauge)
        Where it is to end.
    ratio : float
        Pressure change that the compensating unit needs per change of this one.
    short : bool
        The others cannot compensate: be through as fast as the valve goes.
    """
    pace = crossings.pace[unit]
    limit = _RUSH * pace if short else pace / max(1.0, ratio)
    distance = abs(target - crossings.pressure[unit])
    ease = pace / _EASE
    speed = min(crossings.speed[unit] + ease * dt, limit,
                math.sqrt(2.0 * ease * distance) + ease * dt)
    crossings.speed[unit] = limit if short else speed
    step = min(crossings.speed[unit] * dt, distance)
    crossings.pressure[unit] += math.copysign(step, target - crossings.pressure[unit])
    return step >= distance


def crossing_pace(table: Any, unit: int, rate: float, spare: float, usual: float, patience: float
                  ) -> float:
    """
    Return the pressure rate at which to bring a unit through its falling branch, Pa/s.

    Slowly enough for the feedback where there is time; faster where the demand (rising by
    ``rate``, N/s) would meanwhile use up what the others have to ``spare`` (N). ``usual`` is
    `SwitchingConfig.crossing_rate`, ``patience`` (s) from `hand_over_time`.
    """
    bottom = table.bottom_pressure[unit]
    hurry = bottom * max(rate, 0.0) / max(spare, 0.1)
    # Never so slowly that it could not be through in time when the others are spent.
    slow = max(bottom / patience, usual / _RUSH) if patience > 0.0 else usual
    return min(max(min(usual, slow), hurry), _HURRY * usual)


def hand_over_time(doubt: float, noise: float, lag: float) -> float:
    """
    Return how long a hand-over must take for the feedback to keep up, s.

    An error that grows by ``doubt`` (N) in this time is behind a loop of ``lag`` (s) by no more
    than the ``noise`` (N) that the readings leave in its estimate: doubt / time * lag = noise.

    Examples
    --------
    >>> round(hand_over_time(3.0, 0.3, 0.02), 3)
    0.2
    """
    return doubt * lag / noise


def doubt_of(state: Any) -> float:
    """
    Return how far off the force may be while a unit is on its way, N.

    In doubt are the push-back that is crossed, by its standard deviation, and the bias: it was
    found with other units at work.
    """
    outer, learnt, dip = state.outer, state.adaptation, 0.0
    n = len(state.table.order)
    for unit in range(n):
        dip = max(dip, state.table.dip[unit])
    return math.sqrt(max(learnt.covariance[n][n], 0.0)) * dip + abs(outer.observer.bias)


def crossing_time(table: Any, unit: int, rate: float, usual: float, patience: float) -> float:
    """Return about how long it takes to bring a unit to the bottom of its branch, s."""
    slope = 0.0
    for other in range(len(table.order)):
        if other != unit:
            slope = max(slope, slope_at(table, other, table.grid[other][-1]))
    compensation = table.dip[unit] / slope if slope > 0.0 else 0.0
    pace = crossing_pace(table, unit, rate, table.dip[unit], usual, patience)
    return 1.4 * max(table.bottom_pressure[unit], compensation) / pace + 2.0 * _EASE
