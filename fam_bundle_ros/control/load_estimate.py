# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Online identification of an unknown load: stiffness, damping and inertia.

A Kalman filter on the change of the measured force between strain steps: stiffness times the step,
plus damping times the change of the rate, plus inertia times that of the acceleration. All three
come from the same filters on force and strain (state variable filters: Young 2011, Recursive
Estimation and Time-Series Analysis, ch. 8). Changes of the force beyond these laws, such as an
added weight, are clipped (Huber 1964, Ann. Math. Stat. 35, 73). Changes at constant strain are
not used: the load may be leaving a stop. At rest only the force at zero strain is updated, by
changes beyond the load's dry friction: friction holds whatever force the loop itself applies, and
a loop that follows it would hunt. Errors of the muscle model have no effect, since only
measurements are used. Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.observer import low_pass

#: Strain step of one update: above the noise of filtered readings (1e-5 to 1e-4).
_STEP = 0.002
#: Longest duration of a step, in filter times; a longer one is discarded.
_LONG = 10.0
#: Steps after which the estimate is used: two for each of the three parameters.
_ENOUGH = 6
#: Time constant of the force at zero strain, in filter times. The strain loop's reaction returns
#: after three filters; an integrator with dead time does not overshoot from e dead times on.
_OFFSET_LAGS = 3.0 * math.e
#: Standard deviation of other changes of the force in a step (friction, noise), as a strain at the
#: largest stiffness.
_OTHER = 5e-4
#: Strain over which the stiffness may change completely.
_REACH = 0.1
#: Prior sd of the inertia over the usual one: up to a robot's arm.
INERTIAS = 100.0
#: Least inertia over the usual one: of the muscles themselves.
LEAST_INERTIA = 0.02
#: 1/s: damping of guides over the usual inertia.
_DRAG = 30.0
#: Steps in which the random walk of damping and inertia reaches their own size.
_MEMORY = 1000.0
#: Standard deviations by which a load must be lighter than is usual.
_SURELY = 2.0
#: Clipping threshold of a change of the force, in standard deviations.
_CLIP = 3.0


@dataclass
class LoadEstimate:
    """
    Memory of `learn_load`.

    Attributes
    ----------
    value : list (3,)
        Stiffness (N), damping (N s) and inertia (N s^2): force per strain and its derivatives.
    covariance : list (3, 3)
    offset : float, N
        Force at zero strain, extrapolated with the stiffness.
    inertia : float, N s^2
        The usual inertia, unless the load is heavier by more than one standard deviation of the
        estimate or lighter by more than two: gains for a load that is too light are slow.
    strains, forces : list (3,)
        Readings behind one, two and three filters.
    last : list (4,)
        Force, strain, rate and acceleration at the start of the step, ``age`` s ago.
    ends : list (2, 4)
        The same at the end of the last step downwards and upwards that was not clipped; nan before
        there was one.
    places : int
        Number of steps so far.
    way, product : list (3,)
        Work space.
    started, known : bool
    """

    value: list = field(default_factory=lambda: [0.0] * 3)
    covariance: list = field(default_factory=lambda: [[0.0] * 3 for _ in range(3)])
    offset: float = 0.0
    inertia: float = 0.0
    strains: list = field(default_factory=lambda: [0.0] * 3)
    forces: list = field(default_factory=lambda: [0.0] * 3)
    last: list = field(default_factory=lambda: [0.0] * 4)
    ends: list = field(default_factory=lambda: [[0.0] * 4 for _ in range(2)])
    age: float = 0.0
    places: int = 0
    way: list = field(default_factory=lambda: [0.0] * 3)
    product: list = field(default_factory=lambda: [0.0] * 3)
    started: bool = False
    known: bool = False


def forget_load(state: Any) -> None:
    """Reset."""
    state.started = state.known = False


def begin_load(state: Any, most: float, usual: float) -> None:
    """Start from the prior; arguments as for `learn_load`."""
    state.started, state.places = True, 0
    state.ends[0][0] = state.ends[1][0] = math.nan
    for i in range(3):
        state.value[i] = 0.0
        for j in range(3):
            state.covariance[i][j] = 0.0
    state.value[2] = state.inertia = usual
    state.covariance[0][0] = most ** 2
    state.covariance[1][1] = (_DRAG * usual) ** 2
    state.covariance[2][2] = (INERTIAS * usual) ** 2


def take_up(state: Any, strain: float, force: float) -> None:
    """Set all filters to a reading: the first one, or one after a gap."""
    for i in range(3):
        state.strains[i], state.forces[i] = strain, force
    leave_place(state, 0.0, 0.0)


def leave_place(state: Any, rate: float, bend: float) -> None:
    """Start a new strain step."""
    state.age, last = 0.0, state.last
    last[0], last[1], last[2], last[3] = state.forces[2], state.strains[2], rate, bend


def learn_load(state: Any, strain: float, force: float, most: float, usual: float, time: float,
               dt: float) -> None:
    """
    Learn from one reading.

    Parameters
    ----------
    state : LoadEstimate
    strain, force : float, and N
        Measured values.
    most : float, N
        Largest stiffness that a load may have.
    usual : float, N s^2
        Prior inertia.
    time, dt : float, s
        Time constant of each filter; time since the reading before.

    Examples
    --------
    >>> state = LoadEstimate()
    >>> for k in range(300):
    ...     learn_load(state, 4e-4 * k, 5.0 + 800.0 * 4e-4 * k, 2e3, 0.3, 0.02, 4e-3)
    >>> round(state.value[0]), round(state.offset)
    (800, 5)
    """
    if not state.started:
        begin_load(state, most, usual)
        take_up(state, strain, force)
    if dt > _LONG * time:
        take_up(state, strain, force)
        return
    share = low_pass(dt, time)
    for i in range(3):
        state.strains[i] += share * (strain - state.strains[i])
        state.forces[i] += share * (force - state.forces[i])
        strain, force = state.strains[i], state.forces[i]
    # Input minus output of a filter, times this, is the rate of its output in the last sample.
    quick = share / ((1.0 - share) * dt)
    rate = quick * (state.strains[1] - strain)
    bend = quick ** 2 * (state.strains[0] - 2.0 * state.strains[1] + strain)
    before = load_law(state, strain, rate, bend)
    moved = abs(strain - state.last[1]) >= _STEP
    if moved:
        learn_place(state, rate, bend, most, usual)
    state.age += dt
    if moved or state.age > _LONG * time:
        leave_place(state, rate, bend)
    # A new estimate must not change the force at the present strain.
    now = load_law(state, strain, rate, bend)
    state.offset += before - now
    left, dry = force - now - state.offset, dry_friction(state)
    state.offset += low_pass(dt, _OFFSET_LAGS * time) * (left - min(max(left, -dry), dry))
    if not state.known:
        state.known, state.offset = state.places >= _ENOUGH, force - now


def learn_place(state: Any, rate: float, bend: float, most: float, usual: float) -> None:
    """Update with the step that ends here, at a rate (1/s) and acceleration (1/s^2)."""
    value, p, way, product, last = (state.value, state.covariance, state.way, state.product,
                                    state.last)
    way[0], way[1], way[2] = state.strains[2] - last[1], rate - last[2], bend - last[3]
    p[0][0] += (most * way[0] / _REACH) ** 2
    p[1][1] += (_DRAG * usual) ** 2 / _MEMORY
    p[2][2] += max(value[2], usual) ** 2 / _MEMORY
    left, seen = state.forces[2] - last[0], (_OTHER * most) ** 2
    for i in range(3):
        left -= value[i] * way[i]
        product[i] = p[i][0] * way[0] + p[i][1] * way[1] + p[i][2] * way[2]
        seen += way[i] * product[i]
    if abs(left) < _CLIP * math.sqrt(seen):
        end = state.ends[1 if way[0] > 0.0 else 0]
        end[0], end[1], end[2], end[3] = state.forces[2], state.strains[2], rate, bend
    seen = max(seen, (left / _CLIP) ** 2)
    for i in range(3):
        value[i] += product[i] / seen * left
        for j in range(3):
            p[i][j] -= product[i] * product[j] / seen
    value[0], value[1] = min(max(value[0], 0.0), most), max(value[1], 0.0)
    sd = math.sqrt(p[2][2])
    lightest = max(value[2] + _SURELY * sd, LEAST_INERTIA * usual)
    state.inertia = min(max(usual, value[2] - sd), lightest)
    state.places += 1


def dry_friction(state: Any) -> float:
    """
    Return the dry friction of the load, N.

    Half of the difference of the forces of the last steps upwards and downwards, beyond what the
    other laws give there; 0 before there was one of each.
    """
    down, up = state.ends[0], state.ends[1]
    if math.isnan(down[0] + up[0]):
        return 0.0
    left = up[0] - down[0]
    for i in range(3):
        left -= state.value[i] * (up[i + 1] - down[i + 1])
    return max(0.5 * left, 0.0)


def load_law(state: Any, strain: float, rate: float, bend: float) -> float:
    """Return the force of the load beyond that at zero strain (N), at rates 1/s and 1/s^2."""
    return state.value[0] * strain + state.value[1] * rate + state.inertia * bend
