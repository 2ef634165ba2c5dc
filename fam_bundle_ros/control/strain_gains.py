# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gains of the strain loop, worked out from the load and from how late an answer comes."""

from dataclasses import dataclass
import math

import numpy as np

#: s: of the strain rate that rigs send (a low-pass of 20 Hz), besides the lag of the loop.
RATE_LAG = 0.008
#: Errors that the margin holds for: of the muscles' stiffness, and of the force's change.
STIFFNESSES, GAIN_ERRORS = (0.6, 1.0, 1.5), (-0.3, 0.0, 0.3)
#: Least distance of the loop from -1: its inverse bounds the sensitivity. 0.5 gives a gain
#: margin of 2 and a phase margin of 29 degrees at least (Astrom and Murray 2008, ch. 9.3).
_DISTANCE = 0.5
#: Damping that is added, of critical: at most so much, in steps of a fiftieth.
_DAMPING, _STEPS = 0.5, 25
#: Integral, as a share of stiffness times natural frequency times damping.
_INTEGRAL = 0.4
#: Frequencies at which the distance is worked out, over the natural frequency.
_FREQUENCIES = np.logspace(-2.0, 1.3, 800)


@dataclass(frozen=True)
class StrainGains:
    """Gains on strain error (N), its integral (N/s) and the error of its rate (N s)."""

    gain: float
    integral: float
    damping: float


def strain_gains(stiffness: float, inertia: float, damping: float, lag: float) -> StrainGains:
    """
    Return gains for a load on the muscles' stiffness, as large as the lag allows.

    Feedback that comes late by T turns by the angle w T at the natural frequency w: what was meant
    as damping pushes instead. So the gains are turned back by that angle: together they add a
    stiffness and a damping at w when they arrive. Of the damping as much is taken as keeps the
    loop at a distance from -1 over `STIFFNESSES` and `GAIN_ERRORS`.

    Parameters
    ----------
    stiffness : float, N
        Of muscles and load, per strain.
    inertia, damping : float, N s^2 and N s
        Of the load.
    lag : float, s
        Of the loop: dead time, pressures and sample.

    Examples
    --------
    >>> quick, late = (strain_gains(800.0, 0.6, 0.0, lag) for lag in (0.01, 0.02))
    >>> late.damping < quick.damping
    True
    """
    best = _turned(stiffness, inertia, lag, _DAMPING / _STEPS)
    for step in range(2, _STEPS + 1):
        gains = _turned(stiffness, inertia, lag, _DAMPING * step / _STEPS)
        if distance(gains, stiffness, inertia, damping, lag) < _DISTANCE:
            break
        best = gains
    return best


def _turned(stiffness, inertia, lag, ratio):
    """Return gains that add 2 ratio of critical damping, and ratio of stiffness, when they come.

    Solve Kp cos(wT) + D w sin(w(T+t)) = ratio k, D w cos(w(T+t)) - Kp sin(wT) = 2 ratio k.
    """
    natural = math.sqrt(stiffness / inertia)
    angle, rate_angle = natural * lag, natural * (lag + RATE_LAG)
    stiff, damp = ratio * stiffness, 2.0 * ratio * stiffness
    whole = math.cos(rate_angle - angle)
    return StrainGains(
        (stiff * math.cos(rate_angle) - damp * math.sin(rate_angle)) / whole,
        _INTEGRAL * ratio * stiffness * natural,
        (damp * math.cos(angle) + stiff * math.sin(angle)) / whole / natural)


def distance(gains: StrainGains, stiffness: float, inertia: float, damping: float, lag: float
             ) -> float:
    """Return the least distance of the loop's frequency response from -1."""
    natural = math.sqrt(stiffness / inertia)
    s = 1j * natural * _FREQUENCIES
    control = (gains.gain + gains.integral / s + gains.damping * s / (1.0 + RATE_LAG * s)
               ) * np.exp(-s * lag)
    return float(min(np.abs(1.0 + (1.0 + error) * control / (
        inertia * s * s + damping * s + share * stiffness)).min()
        for share in STIFFNESSES for error in GAIN_ERRORS))
