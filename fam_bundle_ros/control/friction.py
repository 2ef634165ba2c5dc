# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What dry friction will take when a strain turns round, learnt from what was seen before.

The model's error (measured less believed force) jumps by twice the friction where a motion turns
round, and at rest it lies between. How wide that band is shows at turns, and at rest when the load
changes and nothing moves. When the reference begins to move, the demand takes the error that the
motion will have, and not when the strain has been left behind (friction compensation:
Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30, 1083). Other errors of the model
are alike before and after a turn, and cancel. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.observer import low_pass

#: An error has settled after so many lags of the observer: all but 5 % of what was before.
_SETTLED = 3.0
#: Errors that differ by less than so many standard deviations are noise.
_SURELY = 3.0


@dataclass
class FrictionState:
    """
    Memory of `learn_friction` and `turn_round`.

    Attributes
    ----------
    low, high : float, N
        Error of the model while the strain rises, and while it falls.
    reckoned : float, N
        Error that the demand reckons with.
    side : int
        Direction of the last motion, 0 before the first.
    moving, heading : int
        Directions of strain and reference now, 0 at rest.
    since : float, s
        Since ``moving`` changed.
    """

    low: float = 0.0
    high: float = 0.0
    reckoned: float = 0.0
    side: int = 0
    moving: int = 0
    heading: int = 0
    since: float = 0.0


def forget_friction(state: Any) -> None:
    """Begin anew."""
    state.low = state.high = state.reckoned = state.since = 0.0
    state.side = state.moving = state.heading = 0


def learn_friction(state: Any, direction: int, error: float, noise: float, lag: float, dt: float
                   ) -> None:
    """
    Learn from the model's error now.

    Parameters
    ----------
    state : FrictionState
    direction : int
        Of the strain's motion: 1, -1, or 0 at rest.
    error, noise : float, N
        Measured less believed force, seen with a ``lag`` (s); its standard deviation.
    dt : float, s

    Examples
    --------
    >>> state = FrictionState()
    >>> for direction, error in ((1, -3.0), (-1, 2.0), (-1, 2.5)):
    ...     for _ in range(100):
    ...         learn_friction(state, direction, error, 0.0, 0.02, 4e-3)
    >>> round(state.low, 1), round(state.high, 1)
    (-2.5, 2.5)
    """
    state.since = state.since + dt if direction == state.moving else 0.0
    state.moving = direction
    if state.since < _SETTLED * lag:
        return
    if direction == 0:
        if state.side != 0:
            state.low = min(state.low, error + _SURELY * noise)
            state.high = max(state.high, error - _SURELY * noise)
        return
    if direction == state.side:
        # What the model misses besides is alike both ways. It changes slowly: that a motion has
        # turned round is seen late.
        change = low_pass(dt, _SETTLED * lag) * (
            error - (state.low if direction > 0 else state.high))
        state.low, state.high = state.low + change, state.high + change
    elif state.side == 0:
        state.low = state.high = error
    elif direction > 0:
        state.low, state.high = error, max(state.high, error)
    else:
        state.low, state.high = min(state.low, error), error
    state.side = direction


def turn_round(state: Any, rate: float, error: float, lag: float, dt: float) -> float:
    """
    Return by how much the model's error will change now that a reference moves, N.

    Parameters
    ----------
    state : FrictionState
    rate : float, 1/s
        Of the reference.
    error, lag, dt : float, N, s and s
        As for `learn_friction`.

    Examples
    --------
    >>> state = FrictionState(low=-3.0, high=2.0, reckoned=-3.0)
    >>> [turn_round(state, rate, -3.0, 0.02, 4e-3) for rate in (-0.1, -0.1)]
    [5.0, 0.0]
    """
    if rate == 0.0:
        # At rest friction may be anything between: it shows.
        state.heading = 0
        state.reckoned += low_pass(dt, lag) * (error - state.reckoned)
        return 0.0
    heading = 1 if rate > 0.0 else -1
    if heading == state.heading:
        return 0.0
    state.heading = heading
    # Friction takes energy: what pulls is less while the strain rises.
    level = min(state.reckoned, state.low) if heading > 0 else max(state.reckoned, state.high)
    way = level - state.reckoned
    change = math.copysign(min(abs(way), state.high - state.low), way)
    state.reckoned += change
    return change
