# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Strain rate for the model, estimated from strain readings, without noise at rest.

In a model with dry friction the sign of the rate changes the force. At rest the sign of a measured
rate is noise; at a reversal a delayed sign costs an error of twice the friction. So parabolas are
fitted to the readings over windows of several lengths. The longest window whose rate agrees with
those of all shorter ones within their noise is used (intersection of confidence intervals:
Goldenshluger and Nemirovski 1997, Math. Methods Stat. 6, 135); its curvature predicts the rate.
Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.observer import (
    learn_noise,
    low_pass,
    noise_in,
    noise_of,
    second_difference,
)

#: s: shortest window; number of windows, each twice as long as the one before; longest window, s.
_SHORTEST, WINDOWS = 0.01, 5
LONGEST = _SHORTEST * 2 ** (WINDOWS - 1)
#: Tolerance for the agreement of windows, in sd of their rates.
_AGREE = 2.0
#: Thresholds of the rate in sd: a motion begins above the first and ends below the second; after
#: a reversal, within a window, it begins above the third.
_BEGIN, _END, _BACK = 12.0, 1.25, 4.0
#: s: least duration of that window.
_TURN = 0.04
#: Windows up to this length (s) need confirmation by the quick rate, which does not overshoot at a
#: stop, by this many sd.
_SHORT, _SURE = 0.02, 2.0
#: Half width, in sd of the level, of the play of the strain at rest.
_REST = 3.0
#: Number of first readings without an estimate, as their noise is not known.
FIRST = 10
#: Least noise of a strain reading; change that may be noise, whatever the estimate.
_LEAST, USUAL_NOISE = 1e-7, 1e-4


@dataclass
class RateState:
    """
    Memory of `quiet_rate`.

    Attributes
    ----------
    reading : float
        Last strain.
    once, twice, thrice : list (5,)
        Strain after one, two and three lags of each window.
    rate, slope, window : float, 1/s, 1/s^2, s
        Estimated rate and acceleration, and the window used.
    level, held : float
        Strain fitted over that window; the same without the noise that it has at rest.
    quick : float, 1/s
        Rate in the shortest window, without its curvature.
    direction, ended : int
        Direction of the motion, 0 for none; of the last motion that ended.
    since, back : float, s
        Time since it ended; time for the threshold after a reversal.
    last, before, change : float
        Strain one and two ticks ago, mean size of second differences; ``seen``: number of samples.
    lately : float
        The same mean over the shortest window.
    sudden : bool
        The last reading departed from the one before: see `observer.may_be_spike`.
    """

    reading: float = 0.0
    once: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    twice: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    thrice: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    rate: float = 0.0
    slope: float = 0.0
    window: float = _SHORTEST
    level: float = 0.0
    held: float = 0.0
    quick: float = 0.0
    direction: int = 0
    ended: int = 0
    since: float = math.inf
    back: float = _TURN
    last: float = 0.0
    before: float = 0.0
    change: float = 0.0
    seen: int = 0
    lately: float = 0.0
    sudden: bool = False


def forget_rate(state: Any) -> None:
    """Reset."""
    state.rate = state.slope = state.quick = state.change = state.lately = 0.0
    state.direction, state.ended, state.since = 0, 0, math.inf
    state.seen = 0


def quiet_rate(state: Any, strain: float, dt: float) -> float:
    """
    Return the estimated strain rate, 1/s; 0 at rest and for the first ten readings.

    Parameters
    ----------
    state : RateState
    strain : float
    dt : float, s
        Time since the reading before.

    Examples
    --------
    >>> state = RateState()
    >>> rates = [quiet_rate(state, 0.1 + 5e-5 * (-1) ** k, 4e-3) for k in range(500)]
    >>> max(map(abs, rates))
    0.0
    >>> rates = [quiet_rate(state, 4e-4 * k + 5e-5 * (-1) ** k, 4e-3) for k in range(200)]
    >>> bool(0.099 < rates[-1] < 0.101)
    True
    """
    if state.seen == 0:
        state.reading = state.last = state.before = state.held = strain
        for k in range(WINDOWS):
            state.once[k] = state.twice[k] = state.thrice[k] = strain
    # Noise may start suddenly, as where a constant reading begins to toggle between two values.
    change = second_difference(state, strain)
    state.lately += low_pass(dt, _SHORTEST) * (change - state.lately)
    learn_noise(state, strain, USUAL_NOISE, dt)
    noise = max(noise_of(state), _LEAST)
    believe_window(state, strain, noise, dt)
    state.reading = strain
    if state.seen < FIRST:
        return 0.0
    find_direction(state, noise, max(noise, noise_in(state.lately)), dt)
    return state.rate if state.direction != 0 else 0.0


def rate_ahead(state: Any, time: float) -> float:
    """
    Return the rate predicted after a time (s), 1/s: with the curvature, but without reversal.

    Whether a decelerating motion will stop or reverse cannot be predicted.
    """
    if state.direction == 0:
        return 0.0
    rate = state.rate + state.slope * time
    return rate if rate * state.direction > 0.0 else 0.0


def believe_window(state: Any, strain: float, noise: float, dt: float) -> None:
    """
    Update the windows with one reading, and choose one.

    Triple exponential smoothing (Brown 1963, Smoothing, Forecasting and Prediction) by three lags
    in series, each exact for a strain that is linear between readings.
    """
    window, low, high, agree = _SHORTEST, -math.inf, math.inf, True
    for k in range(WINDOWS):
        kept = math.exp(-dt / window)
        mean = (1.0 - kept) * window / dt
        now, past = 1.0 - mean, mean - kept
        first, second = state.once[k], state.twice[k]
        state.once[k] = kept * first + now * strain + past * state.reading
        state.twice[k] = kept * second + now * state.once[k] + past * first
        state.thrice[k] = kept * state.thrice[k] + now * state.twice[k] + past * second
        first, second, third = state.once[k], state.twice[k], state.thrice[k]
        rate = (3.0 * first - 5.0 * second + 2.0 * third) / window
        if k == 0:
            state.quick = (first - second) / window
        doubt = _AGREE * noise * rate_doubt(window, dt)
        low, high = max(low, rate - doubt), min(high, rate + doubt)
        agree = agree and low <= high
        if agree:
            state.rate, state.window = rate, window
            state.slope = (first - 2.0 * second + third) / (window * window)
            state.level = 3.0 * (first - second) + third
        window *= 2.0


def quiet_strain(state: Any, dt: float) -> float:
    """
    Return the strain without noise: that fitted by `quiet_rate`, at rest behind a play.

    Dry friction that builds up over a strain of the size of the noise would follow the noise.
    """
    if state.direction != 0:
        state.held = state.level
    else:
        half = _REST * noise_of(state) * level_doubt(state.window, dt)
        state.held = min(max(state.held, state.level - half), state.level + half)
    return state.held


def line_of(state: Any, window: int) -> tuple[float, float]:
    """Return level, and slope (1/s), of the straight line fitted over a window (index)."""
    first, second = state.once[window], state.twice[window]
    return 2.0 * first - second, (first - second) / (_SHORTEST * 2.0 ** window)


def rate_doubt(window: float, dt: float) -> float:
    """
    Return the sd of a window's rate over that of the readings, 1/s.

    The rate is a sum of the readings with weights (3 - 5 u + u^2) exp(-u)/T^2, u = t/T.
    """
    return math.sqrt(1.75 * dt / window) / window


def level_doubt(window: float, dt: float) -> float:
    """
    Return the sd of a window's level over that of the readings.

    The level is a sum of the readings with weights (3 - 3 u + u^2/2) exp(-u)/T, u = t/T.
    """
    return math.sqrt(2.0625 * dt / window)


def find_direction(state: Any, noise: float, lately: float, dt: float) -> None:
    """
    Detect motion and its direction.

    ``noise`` is that of the readings; ``lately`` that of the last few where it is larger, which
    raises the thresholds for a new motion.
    """
    doubt = noise * rate_doubt(state.window, dt)
    state.since += dt
    if state.direction != 0 and state.rate * state.direction < _END * doubt:
        state.ended, state.direction, state.since = state.direction, 0, 0.0
        state.back = max(state.window, _TURN)
    if state.direction == 0:
        turned = state.since < state.back and state.rate * state.ended < 0.0
        way = 1 if state.rate > 0.0 else -1
        # Weights (1 - u) exp(-u)/T^2.
        sure = _SURE * lately * math.sqrt(0.25 * dt / _SHORTEST) / _SHORTEST
        if (abs(state.rate) > (_BACK if turned else _BEGIN) * lately * rate_doubt(state.window, dt)
                and (state.window > _SHORT or state.quick * way > sure)):
            state.direction = way
