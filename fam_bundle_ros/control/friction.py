# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compensation of dry friction at reversals of the strain, learnt from previous reversals.

The model's error (measured minus model force) jumps by twice the friction where a motion reverses,
and lies in between at rest. The width of that band shows at reversals, and at rest when the load
changes and nothing moves. When the reference begins to move, the demand is corrected at once by
the error that the motion will have, before the strain lags behind (friction compensation:
Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30, 1083). Other errors of the model
are equal before and after a reversal, and cancel. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.observer import low_pass, shrink

#: Settling time of an error to 5 %, in lags of the observer.
_SETTLED = 3.0
#: Significance threshold of a difference of errors, in standard deviations.
_SURELY = 3.0


@dataclass
class FrictionState:
    """
    Memory of `learn_friction` and `turn_round`.

    Attributes
    ----------
    low, high : float, N
        Error of the model while the strain rises, and while it falls.
    rise, drop : float, N
        Difference of the two at the last reversal downwards, and upwards: friction may differ
        between the ends of a motion.
    reckoned : float, N
        Error for which the demand is corrected.
    side : int
        Direction of the last motion, 0 before the first.
    moving, heading : int
        Directions of strain and reference now, 0 at rest.
    since : float, s
        Time since ``moving`` changed, and since the last crossing.
    """

    low: float = 0.0
    high: float = 0.0
    reckoned: float = 0.0
    rise: float = 0.0
    drop: float = 0.0
    side: int = 0
    moving: int = 0
    heading: int = 0
    since: float = 0.0


def forget_friction(state: Any) -> None:
    """Reset."""
    state.low = state.high = state.reckoned = state.since = 0.0
    state.rise = state.drop = 0.0
    state.side = state.moving = state.heading = 0


def learn_friction(state: Any, direction: int, error: float, noise: float, crossing: bool,
                   lag: float, dt: float) -> None:
    """
    Update with the present error of the model.

    Parameters
    ----------
    state : FrictionState
    direction : int
        Direction of the strain: 1, -1, or 0 at rest.
    error, noise : float, N
        Measured minus model force, observed with a ``lag`` (s); its standard deviation.
    crossing : bool
        Whether a unit is being recruited or released: errors of the push-back are no friction.
    dt : float, s

    Examples
    --------
    >>> state = FrictionState()
    >>> for direction, error in ((1, -3.0), (-1, 2.0), (-1, 2.5)):
    ...     for _ in range(100):
    ...         learn_friction(state, direction, error, 0.0, False, 0.02, 4e-3)
    >>> round(state.low, 1), round(state.high, 1)
    (-2.5, 2.5)
    """
    state.since = state.since + dt if direction == state.moving and not crossing else 0.0
    state.moving = direction
    if state.since < _SETTLED * lag:
        return
    # Variance of a difference of two errors, at the significance threshold.
    doubt = 2.0 * (_SURELY * noise) ** 2
    if direction == 0:
        if state.side != 0:
            state.low = min(state.low, error + _SURELY * noise)
            state.high = max(state.high, error - _SURELY * noise)
        return
    if direction == state.side:
        # Other errors of the model are equal in both directions. They are followed slowly, since a
        # reversal is detected late.
        change = low_pass(dt, _SETTLED * lag) * (
            error - (state.low if direction > 0 else state.high))
        state.low, state.high = state.low + change, state.high + change
    elif state.side == 0:
        state.low = state.high = error
    elif direction > 0:
        state.drop = shrink(0.0, max(state.high - error, 0.0), doubt)
        state.low, state.high = error, error + (state.rise if state.rise > 0.0 else state.drop)
    else:
        state.rise = shrink(0.0, max(error - state.low, 0.0), doubt)
        state.low, state.high = error - (state.drop if state.drop > 0.0 else state.rise), error
    state.side = direction


def half_band(state: Any) -> float:
    """Return half of the difference between the errors in the two directions, N."""
    return 0.5 * (state.high - state.low)


def is_settled(state: Any, lag: float) -> bool:
    """Return whether a motion has lasted so long that friction opposes it in full."""
    return state.moving != 0 and state.since >= _SETTLED * lag


def turn_round(state: Any, rate: float, error: float, lag: float, dt: float) -> float:
    """
    Return the change of the model's error to be expected as a reference starts or reverses, N.

    Parameters
    ----------
    state : FrictionState
    rate : float, 1/s
        Rate of the reference.
    error, lag, dt : float, N, s and s
        As for `learn_friction`.

    Examples
    --------
    >>> state = FrictionState(low=-3.0, high=2.0, reckoned=-3.0)
    >>> [turn_round(state, rate, -3.0, 0.02, 4e-3) for rate in (-0.1, -0.1)]
    [5.0, 0.0]
    """
    heading = 0 if rate == 0.0 else 1 if rate > 0.0 else -1
    if heading == state.heading != 0:
        return 0.0
    if state.heading == state.side != 0:
        # The motion followed the reference until now: the demand contains its error.
        state.reckoned = state.low if state.side > 0 else state.high
    state.heading = heading
    if heading == 0:
        # At rest friction may take any value in the band: follow the observed error.
        state.reckoned += low_pass(dt, lag) * (error - state.reckoned)
        return 0.0
    # Friction dissipates: the pull is smaller while the strain rises.
    level = min(state.reckoned, state.low) if heading > 0 else max(state.reckoned, state.high)
    way = level - state.reckoned
    change = math.copysign(min(abs(way), state.high - state.low), way)
    state.reckoned += change
    return change
