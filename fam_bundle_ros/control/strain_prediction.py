# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Prediction of the strain at which the commanded pressures will act.

The inverse model compensates for the change of the muscles' force with the strain, one lag of the
commands later. On an elastic load this drives an oscillation whose half period is shorter than
that lag. So the strain is predicted by a straight line over a long window (Brown 1963, Smoothing,
Forecasting and Prediction), which ignores fast motion, plus a share of the faster motion: the
least-squares coefficient of what came on what the present rate predicted. Kernels.
"""

from dataclasses import dataclass, field
from typing import Any

from fam_bundle_ros.control.observer import low_pass
from fam_bundle_ros.control.rate import line_of, LONGEST, WINDOWS

#: Length of the ring buffers, in samples.
_PLACES = 64
#: Times, as shares of the time ahead, at which predictions are compared with what came. At the
#: whole time alone, the reading itself agrees with an oscillation of that period.
_HORIZONS = (0.5, 1.0)


def _ring():
    return field(default_factory=lambda: [0.0] * _PLACES)


@dataclass
class PredictionState:
    """
    Memory of `strain_ahead`.

    Attributes
    ----------
    level, slope : list (64,), and 1/s
        Ring buffers of the line.
    above, faster : list (64,), and 1/s
        Ring buffers of reading and rate, less those of the line.
    common, power : list (2,)
        Per horizon: mean product of the faster motion that was predicted with that which came,
        and mean square of that which was predicted.
    seen : int
        Number of samples.
    """

    level: list[float] = _ring()
    slope: list[float] = _ring()
    above: list[float] = _ring()
    faster: list[float] = _ring()
    common: list[float] = field(default_factory=lambda: [0.0] * len(_HORIZONS))
    power: list[float] = field(default_factory=lambda: [0.0] * len(_HORIZONS))
    seen: int = 0


def forget_prediction(state: Any) -> None:
    """Reset."""
    state.seen = 0
    for k in range(len(_HORIZONS)):
        state.common[k] = state.power[k] = 0.0


def strain_ahead(state: Any, rate_state: Any, strain: float, rate: float, time: float, dt: float
                 ) -> float:
    """
    Return the strain predicted after a time.

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
    share, here = 1.0, state.seen % _PLACES
    for k in range(len(_HORIZONS)):
        back = min(max(int(_HORIZONS[k] * time / dt + 0.5), 1), _PLACES - 1)
        if state.seen < back:
            continue
        then, ago = (state.seen - back) % _PLACES, back * dt
        came = strain - state.level[then] - ago * state.slope[then]
        told = state.above[then] + ago * state.faster[then]
        new = low_pass(dt, LONGEST)
        state.common[k] += new * (told * came - state.common[k])
        state.power[k] += new * (told * told - state.power[k])
        if state.common[k] < share * state.power[k]:
            share = max(state.common[k] / state.power[k], 0.0)
    level, slope = line_of(rate_state, WINDOWS - 1)
    above, faster = strain - level, rate - slope
    state.level[here], state.slope[here] = level, slope
    state.above[here], state.faster[here] = above, faster
    state.seen += 1
    return level + share * above + time * (slope + share * faster)
