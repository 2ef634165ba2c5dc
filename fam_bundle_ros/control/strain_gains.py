# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gains of the strain loop, worked out from the load and from how late an answer comes."""

from dataclasses import dataclass
from functools import lru_cache
import math

import numpy as np

#: s: of the strain rate that rigs send (a low-pass of 20 Hz), besides the lag of the loop.
RATE_LAG = 0.008
#: Errors of the force's change that the margin holds for.
GAIN_ERRORS = (-0.3, 0.0, 0.3)
#: Least distance of the loop from -1: its inverse bounds the sensitivity. 0.5 gives a gain
#: margin of 2 and a phase margin of 29 degrees at least (Astrom and Murray 2008, ch. 9.3).
_DISTANCE = 0.5
#: Least damping that any muscle and load have, of critical.
_LEAST_DAMPING = 0.01
#: So much of the least stiffness may a gain below 0 take.
_SOFTENED = 0.3
#: Gains that are tried: on strain, over the stiffness; on its rate, over critical damping.
_GAINS = np.array([-1.0, -0.7, -0.5, -0.35, -0.25, -0.15, -0.07, 0.0, 0.1, 0.2, 0.35, 0.5, 0.7])
_DAMPINGS = np.array([0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5])
#: Halvings to find the integral; its largest, over stiffness times natural frequency.
_HALVINGS, _INTEGRAL = 7, 1.0
#: Frequencies at which the distance is worked out, over the natural frequency.
_FREQUENCIES = np.logspace(-2.7, 1.3, 1500)


@dataclass(frozen=True)
class StrainGains:
    """Gains on strain error (N), its integral (N/s) and the error of its rate (N s)."""

    gain: float
    integral: float
    damping: float


@lru_cache(maxsize=256)
def strain_gains(stiffnesses: tuple[float, float, float], inertia: float, damping: float,
                 lag: float) -> StrainGains:
    """
    Return the gains that make the most of the lag: the largest integral with margins.

    The integral gain is the inverse of what a load step costs (integrated error); it is made as
    large as a distance of the loop from -1 allows (Astrom, Panagopoulos and Hagglund 1998,
    Automatica 34, 585), over all stiffnesses and `GAIN_ERRORS`. Feedback that is late by a quarter
    of a natural oscillation damps with a gain on strain below 0, not with one on its rate.

    Parameters
    ----------
    stiffnesses : tuple of 3 float, N
        Of muscles and load, per strain: the least, a middling one and the largest.
    inertia, damping : float, N s^2 and N s
        Of the load.
    lag : float, s
        Of the loop: dead time, pressures and sample.

    Examples
    --------
    >>> quick, late = (strain_gains((400.0, 800.0, 1400.0), 0.6, 0.0, lag) for lag in (0.01, 0.03))
    >>> late.integral < quick.integral
    True
    """
    least, middling, _ = stiffnesses
    natural = math.sqrt(middling / inertia)
    best = StrainGains(0.0, 0.0, 0.0)
    for gain in _GAINS:
        for ratio in _DAMPINGS:
            low, high = best.integral, _INTEGRAL * middling * natural
            tried = StrainGains(max(float(gain) * middling, -_SOFTENED * least), low,
                                2.0 * float(ratio) * math.sqrt(middling * inertia))
            # No better than the best so far: not worth the halvings.
            if not _holds(tried, 1.05 * low + 1e-3 * high, stiffnesses, inertia, damping, lag):
                continue
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                if _holds(tried, middle, stiffnesses, inertia, damping, lag):
                    low = middle
                else:
                    high = middle
            best = StrainGains(tried.gain, low, tried.damping)
    return best


def _holds(gains, integral, stiffnesses, inertia, damping, lag):
    """Return whether the loop is stable, and at a distance from -1, with an integral."""
    s, loops = _loops(StrainGains(gains.gain, integral, gains.damping), stiffnesses, inertia,
                      damping, lag)
    around = 1.0 + loops
    if np.abs(around).min() < _DISTANCE:
        return False
    # s (1 + L) has no zeros in the right half plane when it turns by +90 degrees in all
    # (argument principle; it begins real, and above 0).
    turned = np.unwrap(np.angle(s * around), axis=-1)
    return bool(np.all(np.abs(turned[:, 0]) < 0.5 * math.pi) and np.all(
        np.abs(turned[:, -1] - 0.5 * math.pi) < 0.5 * math.pi))


def _loops(gains, stiffnesses, inertia, damping, lag):
    """Return frequencies s (F,), and the loop at each stiffness and error, (9, F)."""
    s = 1j * math.sqrt(stiffnesses[1] / inertia) * _FREQUENCIES
    control = (gains.gain + gains.integral / s + gains.damping * s / (1.0 + RATE_LAG * s)
               ) * np.exp(-s * lag)
    stiffness = np.repeat(stiffnesses, len(GAIN_ERRORS))[:, None]
    drag = drag_of(stiffness, inertia, damping)
    error = np.tile(GAIN_ERRORS, len(stiffnesses))[:, None]
    return s, (1.0 + error) * control / (inertia * s * s + drag * s + stiffness)


def drag_of(stiffness, inertia, damping):
    """Return the damping that is reckoned with, N s: at least 1 % of critical."""
    return np.maximum(damping, 2.0 * _LEAST_DAMPING * np.sqrt(stiffness * inertia))
