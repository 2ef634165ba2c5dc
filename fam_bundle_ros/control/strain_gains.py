# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gains of the strain loop, computed from the load and the lag of the loop."""

from dataclasses import dataclass
from functools import lru_cache
import math
from typing import Any

import numpy as np

#: s: filter of the strain rate that rigs send (low-pass of 20 Hz), in addition to the loop's lag.
RATE_LAG = 0.008
#: Relative errors of the force's change for which the margin holds.
GAIN_ERRORS = (-0.3, 0.0, 0.3)
#: Factor by which the stiffness may differ from the one that gains are computed for.
SPAN = 1.5
#: Least distance of the loop from -1: its inverse bounds the sensitivity. 0.5 gives a gain
#: margin of 2 and a phase margin of 29 degrees at least (Astrom and Murray 2008, ch. 9.3).
_DISTANCE = 0.5
#: Least damping ratio of any muscle and load.
_LEAST_DAMPING = 0.01
#: Larger of the two damping ratios for which gains are computed where the damping is identified:
#: linear gains between the two keep the least distance.
DAMPED = 0.3
#: Limit of a negative gain, as a share of the least stiffness.
_SOFTENED = 0.3
#: Largest strain at which stiffnesses are taken, and half-width of the difference quotient.
_MIDDLING, APART = 0.1, 0.01
#: Strains of the search for a free strain.
_STRAINS = np.linspace(0.0, 2.0 * _MIDDLING, 41)
#: Least over largest stiffness that gains are computed for.
_LEAST_SHARE = 0.005
#: Candidate gains: on strain, over the stiffness; on its rate, over critical damping.
_GAINS = np.array([-1.0, -0.7, -0.5, -0.35, -0.25, -0.15, -0.07, 0.0, 0.1, 0.2, 0.35, 0.5, 0.7])
_DAMPINGS = np.array([0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5])
#: Candidate integral gains, over stiffness times natural frequency, or stiffness over lag if less.
_INTEGRALS = np.logspace(-2.0, 0.0, 13)
#: Frequencies at which loops are evaluated, over the natural frequency: evenly, and within the
#: narrowest resonances at the three stiffnesses.
_FREQUENCIES = np.sort(np.concatenate([np.logspace(-2.7, 1.3, 130), np.ravel(
    np.outer(SPAN ** np.array([-0.5, 0.0, 0.5]),
             1.0 + _LEAST_DAMPING * np.linspace(-4.0, 4.0, 17)))]))


@dataclass(frozen=True)
class StrainGains:
    """Gains on strain error (N), its integral (N/s) and the error of its rate (N s)."""

    gain: float
    integral: float
    damping: float


def strain_gains(stiffness: float, inertia: float, damping: float, lag: float) -> StrainGains:
    """
    Return the gains with the least error after a load step, for a given lag.

    The integral of the squared error (by Parseval, from the frequency response), the mean over
    stiffnesses within a factor `SPAN` and over `GAIN_ERRORS`, is minimised under a least distance
    of each loop from -1 (after Astrom and Hagglund 2006, Advanced PID Control, ch. 6). Feedback
    with a delay of a quarter of a natural oscillation damps by a negative gain on strain, not by
    a gain on its rate.

    Parameters
    ----------
    stiffness : float, N
        Stiffness of muscles and load, per strain.
    inertia, damping : float, N s^2 and N s
        Inertia and damping of the load.
    lag : float, s
        Lag of the loop: dead time, pressures and sample.

    Examples
    --------
    >>> quick, late = (strain_gains(800.0, 0.6, 0.0, lag) for lag in (0.01, 0.03))
    >>> late.integral < quick.integral
    True
    """
    # rounded, so that those computed for a bundle serve another with the same ratios
    per = _gains_per_inertia(float(f'{stiffness / inertia:.9g}'), damping / inertia, lag)
    return StrainGains(inertia * per.gain, inertia * per.integral, inertia * per.damping)


@lru_cache(maxsize=512)
def _gains_per_inertia(stiffness: float, damping: float, lag: float) -> StrainGains:
    """Return the gains for an inertia of 1 N s^2: gains are in proportion to all three."""
    stiffnesses = (stiffness / SPAN, stiffness, stiffness * SPAN)
    natural = math.sqrt(stiffness)
    integrals = _INTEGRALS * stiffness * min(natural, 1.0 / lag)
    s = 1j * natural * _FREQUENCIES
    plants = _plants(s, stiffnesses, damping)
    late = np.exp(-s * lag)
    best, least_cost = StrainGains(0.0, 0.0, 0.0), math.inf
    for share in _GAINS:
        for ratio in _DAMPINGS:
            gain = max(float(share) * stiffness, -_SOFTENED * stiffnesses[0])
            rate = 2.0 * float(ratio) * natural
            control = (gain + integrals[:, None] / s + rate * s / (1.0 + RATE_LAG * s)) * late
            costs = _costs(s, plants, control)
            k = int(np.argmin(costs))
            if costs[k] < least_cost:
                best, least_cost = StrainGains(gain, float(integrals[k]), rate), costs[k]
    return best


def _plants(s, stiffnesses, damping):
    """Return strain over force at each stiffness and error for an inertia of 1, (9, F)."""
    stiffness = np.repeat(stiffnesses, len(GAIN_ERRORS))[:, None]
    error = np.tile(GAIN_ERRORS, len(stiffnesses))[:, None]
    return (1.0 + error) / (s * s + drag_of(stiffness, 1.0, damping) * s + stiffness)


def _costs(s, plants, control):
    """Return the squared error after a load step of each controller (K, F); inf without margin."""
    around = 1.0 + control[:, None] * plants
    distance = around.real ** 2 + around.imag ** 2
    holds = distance.min(axis=(1, 2)) >= _DISTANCE ** 2
    costs = np.full(len(control), np.inf)
    if not holds.any():
        return costs
    # s (1 + L) has no zeros in the right half plane if its total phase change is +90 degrees
    # (argument principle; it starts real and positive).
    turned = np.unwrap(np.angle(s * around[holds]), axis=-1)
    stable = np.all((np.abs(turned[..., 0]) < 0.5 * math.pi)
                    & (np.abs(turned[..., -1] - 0.5 * math.pi) < 0.5 * math.pi), axis=-1)
    square = np.abs(plants / s) ** 2 / distance[holds]
    whole = 0.5 * (square[..., 1:] + square[..., :-1]) @ np.diff(s.imag)
    costs[holds] = np.where(stable, whole.mean(axis=-1), np.inf)
    return costs


def drag_of(stiffness, inertia, damping):
    """Return the damping used in the design, N s: at least 1 % of critical."""
    return np.maximum(damping, 2.0 * _LEAST_DAMPING * np.sqrt(stiffness * inertia))


def unit_stiffness(bundle: Any) -> tuple[np.ndarray, np.ndarray]:
    """
    Return -dF/de of each unit at a medium strain as slope p + bend p^2, with its pressure p.

    Two arrays (n,), N/Pa and N/Pa^2, fitted at 0, half and all of the largest pressure. A strain
    at which a unit is slack at half pressure would tell nothing of its stiffness there.
    """
    middle = middle_strain(bundle)

    def at(share: float) -> np.ndarray:
        pressure = np.tile(share * bundle.max_pressure, (len(middle), 1))
        rise = (bundle.unit_forces(middle - APART, pressure)
                - bundle.unit_forces(middle + APART, pressure)) / (2.0 * APART)
        return np.maximum(np.diag(rise), 0.0)
    half, whole = at(0.5), at(1.0)
    return ((4.0 * half - whole) / bundle.max_pressure,
            (2.0 * whole - 4.0 * half) / bundle.max_pressure ** 2)


def middle_strain(bundle: Any) -> np.ndarray:
    """Return 0.6 of each unit's free strain at half of its limit, at most 0.1, (n,)."""
    pressure = np.tile(0.5 * bundle.max_pressure, (len(_STRAINS), 1))
    pulls = np.cumprod(bundle.unit_forces(_STRAINS, pressure) > 0.0, axis=0).sum(axis=0)
    return np.clip(0.6 * _STRAINS[np.maximum(pulls, 1) - 1], APART, _MIDDLING)


def stiffness_grid(bundle: Any, load: float) -> list[float]:
    """
    Return stiffnesses of muscles and load for which gains are computed, N per strain.

    From the first unit at a tenth of its largest pressure to all units at theirs, in steps of at
    most `SPAN` squared, so that the ranges of neighbouring gains meet. ``load`` is the stiffness
    of the load alone.
    """
    slope, bend = unit_stiffness(bundle)
    each = slope * bundle.max_pressure + bend * bundle.max_pressure ** 2
    first = 0.1 * bundle.max_pressure[0]
    most = max(float(each.sum()), 1.0) + load
    least = min(max(float(slope[0] * first + bend[0] * first ** 2) + load,
                    _LEAST_SHARE * most), most)
    count = 1 + math.ceil(math.log(most / least) / (2.0 * math.log(SPAN)))
    return np.geomspace(least, most, max(count, 2)).tolist()


def stiffnesses_between(low: float, high: float, inertia: float) -> list[float]:
    """
    Return stiffnesses (N) between two, without these: ``inertia`` times powers of `SPAN` squared.

    Over the inertia they are the same for all bundles, so that their gains are computed once.

    Examples
    --------
    >>> stiffnesses_between(2.0, 20.0, 2.0)
    [4.5, 10.125]
    """
    first, last = (math.log(each / inertia) / (2.0 * math.log(SPAN)) for each in (low, high))
    return [inertia * SPAN ** (2 * k) for k in range(math.floor(first) + 1, math.ceil(last))]
