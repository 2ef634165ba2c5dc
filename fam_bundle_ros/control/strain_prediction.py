# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Prediction of the strain at which the commanded pressures will act.

The inverse model compensates for the change of the muscles' force with the strain, one lag of the
commands later. On an elastic load this drives an oscillation whose half period is shorter than
that lag. So the prediction from the present rate competes with straight lines fitted over longer
windows (Brown 1963, Smoothing, Forecasting and Prediction), which ignore fast motion; that with
the least error on the recent past is used. Kernels.
"""

from dataclasses import dataclass, field
from typing import Any

from fam_bundle_ros.control.observer import beyond_noise, low_pass, noise_of, PATIENT_TIME
from fam_bundle_ros.control.rate import line_of, WINDOWS

#: Length of the ring buffers, in samples.
_PLACES = 64


def _rings():
    return [[0.0] * _PLACES for _ in range(WINDOWS)]


@dataclass
class PredictionState:
    """
    Memory of `strain_ahead`; row 0 for the prediction from the present rate.

    Attributes
    ----------
    level, slope : list (5, 64), and 1/s
        Ring buffers of the predicting lines.
    missed : list (5,)
        Mean squared error of each prediction.
    seen : int
        Number of samples.
    """

    level: list[list[float]] = field(default_factory=_rings)
    slope: list[list[float]] = field(default_factory=_rings)
    missed: list[float] = field(default_factory=lambda: [0.0] * WINDOWS)
    seen: int = 0


def forget_prediction(state: Any) -> None:
    """Reset."""
    state.seen = 0
    for k in range(WINDOWS):
        state.missed[k] = 0.0


def strain_ahead(state: Any, rate_state: Any, strain: float, rate: float, time: float, dt: float
                 ) -> float:
    """
    Return the strain predicted after a time.

    Predictions are scored at half of the time: at the whole time, a wrong one agrees with an
    oscillation of that period.

    Parameters
    ----------
    state : PredictionState
    rate_state : RateState
        After `rate.quiet_rate` with this reading.
    strain, rate : float, and 1/s
        Reading, and its estimated rate.
    time, dt : float, s
        Time ahead; time since the reading before.
    """
    back, here = min(max(int(0.5 * time / dt + 0.5), 1), _PLACES - 1), state.seen % _PLACES
    then = (state.seen - back + _PLACES) % _PLACES
    share = low_pass(dt, PATIENT_TIME) if state.seen >= back else 0.0
    noise, best = noise_of(rate_state), 0
    for k in range(WINDOWS):
        state.level[k][here], state.slope[k][here] = strain, rate
        if k > 0:
            state.level[k][here], state.slope[k][here] = line_of(rate_state, k)
        error = strain - state.level[k][then] - back * dt * state.slope[k][then]
        state.missed[k] += share * (error * error - state.missed[k])
        if state.missed[k] < state.missed[best]:
            best = k
    state.seen += 1
    # Lines over longer windows have less noise, which is no reason to use them.
    if beyond_noise(state.missed[0] - state.missed[best], noise * noise) == 0.0:
        best = 0
    return state.level[best][here] + time * state.slope[best][here]
