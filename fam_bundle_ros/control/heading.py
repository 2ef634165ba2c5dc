# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rate, acceleration and jerk of signals by a third-order filter."""

from dataclasses import dataclass
import math
from typing import Any


@dataclass
class HeadingState:
    """
    Filter state of several signals, a list each: last value and slope, and the derivatives.

    ``first``, ``second`` and ``third``: deviation of each of the three lags from its steady state
    on a ramp, as a slope.
    """

    value: list
    slope: list
    first: list
    second: list
    third: list
    rate: list
    acceleration: list
    jerk: list


def heading_of(count: int) -> HeadingState:
    """Return the record of ``count`` signals, at zero and at rest."""
    return HeadingState(*([0.0] * count for _ in range(8)))


def rest_at(heading: Any, k: int, value: float) -> None:
    """Reset signal k to a value at rest."""
    heading.value[k], heading.slope[k] = value, 0.0
    heading.first[k] = heading.second[k] = heading.third[k] = 0.0
    heading.rate[k] = heading.acceleration[k] = heading.jerk[k] = 0.0


def follow_heading(heading: Any, k: int, value: float, dt: float, bandwidth: float) -> None:
    """
    Advance signal k by one sample (``value``, after ``dt`` s); ``bandwidth`` in rad/s.

    Three first-order lags in series, x' = w (u - x), solved exactly for a signal that is linear
    between two samples (first-order hold: Franklin, Powell and Workman 1998, ch. 6): exact for
    long or uneven sample times, and a ramp gives a rate only. The jerk is the mean over the
    sample; at the samples themselves it would be off by w (w dt)^2 / 12 times the acceleration.
    """
    w, x = bandwidth, bandwidth * dt
    slope = (value - heading.value[k]) / dt
    bend = (slope - heading.slope[k]) / w
    first, second = heading.first[k] + bend, heading.second[k] + 2.0 * bend
    third, fade = heading.third[k] + 3.0 * bend, math.exp(-x)
    third = fade * (third + x * (second + 0.5 * x * first))
    second = fade * (second + x * first)
    first *= fade
    heading.first[k], heading.second[k], heading.third[k] = first, second, third
    heading.value[k], heading.slope[k] = value, slope
    heading.rate[k] = slope + w * (second - third)
    acceleration = w * w * (first - 2.0 * second + third)
    heading.jerk[k] = (acceleration - heading.acceleration[k]) / dt
    heading.acceleration[k] = acceleration


def heading_now(heading: Any, k: int, bandwidth: float) -> tuple[float, float, float]:
    """Return rate, acceleration and jerk, with the filter's delay of 3/w compensated."""
    lag = 3.0 / bandwidth
    acceleration, jerk = heading.acceleration[k], heading.jerk[k]
    return (heading.rate[k] + lag * (acceleration + 0.5 * lag * jerk), acceleration + lag * jerk,
            jerk)
