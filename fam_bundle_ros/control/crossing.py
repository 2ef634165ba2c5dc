# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Crossings: units pass their falling branch while the other units compensate the force dip."""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.curves import slope_at

#: s: acceleration time of a crossing; units lag by equal amounts only at smooth rates.
_EASE = 0.01
#: Largest rate over `SwitchingConfig.crossing_rate` when the demand is urgent, and when the other
#: units cannot compensate.
_HURRY, _RUSH = 4.0, 20.0


@dataclass
class Crossings:
    """
    Units that are crossing their falling branch.

    Attributes
    ----------
    unit : list (n,) of int
        The first ``count`` are crossing, in the order in which they began.
    up, rush : list (n,) of int
        1 for each unit that is being filled; 1 for each that may be as fast as its valve.
    pressure, speed, pace : list (n,), Pa (gauge) and Pa/s
        Pressure, present rate and normal rate of each unit.
    """

    count: int
    unit: list
    up: list
    rush: list
    pressure: list
    speed: list
    pace: list


def no_crossings(n: int) -> Crossings:
    """Return an empty record for n units."""
    return Crossings(0, [0] * n, [0] * n, [0] * n, [0.0] * n, [0.0] * n, [0.0] * n)


def is_crossing(crossings: Any, unit: int) -> bool:
    """Return whether a unit is crossing."""
    for k in range(crossings.count):
        if crossings.unit[k] == unit:
            return True
    return False


def begin_crossing(crossings: Any, unit: int, up: bool, pressure: float, pace: float,
                   rush: bool = True) -> None:
    """Start a crossing at a pressure (Pa); ``pace`` (Pa/s) from `crossing_pace`."""
    if not is_crossing(crossings, unit):
        crossings.unit[crossings.count] = unit
        crossings.count += 1
    crossings.up[unit], crossings.rush[unit] = 1 if up else 0, 1 if rush else 0
    crossings.pressure[unit], crossings.speed[unit], crossings.pace[unit] = pressure, 0.0, pace


def end_crossing(crossings: Any, k: int) -> None:
    """Remove the k-th crossing."""
    crossings.count -= 1
    for j in range(k, crossings.count):
        crossings.unit[j] = crossings.unit[j + 1]


def advance(crossings: Any, unit: int, dt: float, target: float, ratio: float, short: bool,
            usual: float) -> bool:
    """
    Move a crossing unit by one tick; return whether it has arrived.

    Trapezoidal speed: v' at most pace/`_EASE`, v at most sqrt(2 v' distance).

    Parameters
    ----------
    target : float, Pa (gauge)
        Final pressure of the crossing.
    ratio : float
        Pressure change that the compensating unit needs per change of this one.
    short : bool
        The others cannot compensate: cross as fast as the valve allows.
    usual : float, Pa/s
        `SwitchingConfig.crossing_rate`.
    """
    pace = crossings.pace[unit]
    limit = _RUSH * usual if short else pace / max(1.0, ratio)
    distance = abs(target - crossings.pressure[unit])
    ease = pace / _EASE
    speed = min(crossings.speed[unit] + ease * dt, limit,
                math.sqrt(2.0 * ease * distance) + ease * dt)
    crossings.speed[unit] = limit if short else speed
    step = min(crossings.speed[unit] * dt, distance)
    crossings.pressure[unit] += math.copysign(step, target - crossings.pressure[unit])
    return step >= distance


def crossing_pace(distance: float, usual: float, patience: float) -> float:
    """
    Return the pressure rate of a unit's crossing, Pa/s, slow enough for the feedback.

    Parameters
    ----------
    distance : float, Pa
        To its bottom pressure, or to 0.
    usual : float, Pa/s
        `SwitchingConfig.crossing_rate`.
    patience : float, s
        From `hand_over_time`; 0: as fast as usual.
    """
    return min(usual, distance / patience) if distance > 0.0 and patience > 0.0 else usual


def slow_pace(usual: float) -> float:
    """Return the slowest pressure rate for which units start ahead of need, Pa/s."""
    return usual / _RUSH


def hurry(crossings: Any, unit: int, target: float, rate: float, spare: float, doubt: float,
          usual: float) -> None:
    """
    Let a unit cross as fast as it must before the demand uses up the reserve of the others.

    It may arrive later if that is the smaller error: beyond the reserve the demand is missed by
    its rate times the delay, and in a crossing of duration t feedback is behind the error of the
    push-back by ``doubt`` / t. Both are equal at t^2 = doubt / rate.

    Parameters
    ----------
    crossings : Crossings
    unit : int
    target : float, Pa (gauge)
        Final pressure of the crossing.
    rate, spare : float, N/s and N
        Rate of the demand, at least 0; what is left of the other units' reserve.
    doubt : float, N s
        Error that may show during the crossing, times the lag of the feedback.
    usual : float, Pa/s
        `SwitchingConfig.crossing_rate`.
    """
    if rate > 0.0:
        distance = abs(target - crossings.pressure[unit])
        time = max(spare / rate, math.sqrt(doubt / rate), _EASE)
        crossings.pace[unit] = max(crossings.pace[unit], min(distance / time, _HURRY * usual))


def hand_over_time(doubt: float, noise: float, lag: float) -> float:
    """
    Return the duration of a crossing that the feedback can follow, s.

    Where an error grows by ``doubt`` (N) in this time, a loop with ``lag`` (s) is behind it by no
    more than the ``noise`` (N) of its estimate: doubt / time * lag = noise.

    Examples
    --------
    >>> round(hand_over_time(3.0, 0.3, 0.02), 3)
    0.2
    """
    return doubt * lag / noise


def doubt_of(state: Any) -> float:
    """
    Return the uncertainty of the force while a unit is crossing, N.

    That of the push-back, and the bias, which was found with other units active.
    """
    return doubt_of_push(state) + abs(state.outer.observer.bias)


def doubt_of_push(state: Any) -> float:
    """Return the standard deviation of the largest push-back of a unit, N."""
    n, dip = len(state.table.order), 0.0
    for unit in range(n):
        dip = max(dip, state.table.dip[unit])
    return math.sqrt(max(state.adaptation.covariance[n][n], 0.0)) * dip


def crossing_time(table: Any, unit: int, usual: float, patience: float) -> float:
    """
    Return how long before its need a unit starts to cross, s: the time to its bottom, about.

    A patient crossing may be slower: the demand can hurry it (`hurry`), or turn back.
    """
    slope = 0.0
    for other in range(len(table.order)):
        if other != unit:
            slope = max(slope, slope_at(table, other, table.grid[other][-1]))
    compensation = table.dip[unit] / slope if slope > 0.0 else 0.0
    pace = max(crossing_pace(table.bottom_pressure[unit], usual, patience), slow_pace(usual))
    return 1.4 * max(table.bottom_pressure[unit], compensation) / pace + 2.0 * _EASE
