# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Online identification of an unknown load: stiffness, damping and inertia.

A Kalman filter on the change of the measured force between strain steps: stiffness times the step,
plus damping times the change of the rate, plus inertia times that of the acceleration. All three
come from the same filters on force and strain (state variable filters: Young 2011, Recursive
Estimation and Time-Series Analysis, ch. 8). Changes of the force beyond these laws, such as an
added weight, are clipped (Huber 1964, Ann. Math. Stat. 35, 73). Changes at constant strain are
not used: a stop may hold the load. When a motion begins the filters restart, and the part of the
force that ended with the rest (of a stop, or a weight that was added) is a fourth parameter, which
decays with the filters. At rest only the force at zero strain is updated, by changes beyond the
load's dry friction: friction holds whatever force the loop itself applies, and a loop that follows
it would hunt. Errors of the muscle model have no effect, since only measurements are used.
Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.observer import learn_noise, low_pass, noise_of, NoiseState
from fam_bundle_ros.control.rate import USUAL_NOISE

#: Strain step of one update: above the noise of filtered readings (1e-5 to 1e-4).
STEP = 0.002
#: A motion begins with a change of the strain above `USUAL_NOISE`, and above this many standard
#: deviations of its noise.
_SURE = 4.0
#: Longest duration of a step, in filter times; a longer one is discarded.
_LONG = 10.0
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
    value : list (4,)
        Stiffness (N), damping (N s) and inertia (N s^2): force per strain and its derivatives; and
        the force (N) that ended with the last rest.
    covariance : list (4, 4)
    offset : float, N
        Force at zero strain, extrapolated with the stiffness.
    inertia : float, N s^2
        The usual inertia, unless the load is heavier by more than one standard deviation of the
        estimate or lighter by more than two: gains for a load that is too light are slow.
    strains, forces : list (3,)
        Readings behind one, two and three filters.
    left : list (3,)
        The same of a signal that was 1 until the filters were set, and 0 since.
    rate, bend : float, 1/s and 1/s^2
        Rate and acceleration of the last of ``strains``.
    last : list (5,)
        Force, strain, rate, acceleration, and what is left, at the start of the step, ``age`` s
        ago.
    ends : list (2, 4)
        The same at the end of the last step downwards and upwards that was not clipped; nan before
        there was one.
    places : int
        Number of steps so far.
    way, product : list (4,)
        Work space.
    rest : float
        Strain at which the load has rested since ``resting``.
    noise : NoiseState
        Noise of the strain.
    started, known, resting : bool
    """

    value: list = field(default_factory=lambda: [0.0] * 4)
    covariance: list = field(default_factory=lambda: [[0.0] * 4 for _ in range(4)])
    offset: float = 0.0
    inertia: float = 0.0
    strains: list = field(default_factory=lambda: [0.0] * 3)
    forces: list = field(default_factory=lambda: [0.0] * 3)
    left: list = field(default_factory=lambda: [0.0] * 3)
    last: list = field(default_factory=lambda: [0.0] * 5)
    ends: list = field(default_factory=lambda: [[0.0] * 4 for _ in range(2)])
    age: float = 0.0
    places: int = 0
    way: list = field(default_factory=lambda: [0.0] * 4)
    product: list = field(default_factory=lambda: [0.0] * 4)
    started: bool = False
    known: bool = False
    resting: bool = True
    rest: float = 0.0
    rate: float = 0.0
    bend: float = 0.0
    noise: NoiseState = field(default_factory=NoiseState)


def forget_load(state: Any) -> None:
    """Reset."""
    state.started = state.known = False


def begin_load(state: Any, strain: float, most: float, usual: float) -> None:
    """Start from the prior; arguments as for `learn_load`."""
    state.started, state.places = True, 0
    state.resting, state.rest, state.noise.seen = True, strain, 0
    state.ends[0][0] = state.ends[1][0] = math.nan
    for i in range(4):
        state.value[i] = 0.0
        for j in range(4):
            state.covariance[i][j] = 0.0
    state.value[2] = state.inertia = usual
    state.covariance[0][0] = most ** 2
    state.covariance[1][1] = (_DRAG * usual) ** 2
    state.covariance[2][2] = (INERTIAS * usual) ** 2


def take_up(state: Any, strain: float, force: float) -> None:
    """Set all filters to a reading at rest: the first one, one after a gap or before a motion."""
    state.value[3] = 0.0
    for i in range(3):
        state.strains[i], state.forces[i], state.left[i] = strain, force, 1.0
    leave_place(state, 0.0, 0.0)


def leave_place(state: Any, rate: float, bend: float) -> None:
    """Start a new strain step."""
    state.age, last = 0.0, state.last
    last[0], last[1], last[2], last[3] = state.forces[2], state.strains[2], rate, bend
    last[4] = state.left[2]


def begin_motion(state: Any, force: float) -> None:
    """Restart the filters from rest at a force, any part of which (N) may end with the rest."""
    state.resting = False
    for i in range(4):
        state.covariance[i][3] = state.covariance[3][i] = 0.0
    state.covariance[3][3] = force ** 2
    take_up(state, state.rest, force)


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
        begin_load(state, strain, most, usual)
        take_up(state, strain, force)
    if dt > _LONG * time:
        state.resting, state.rest = True, strain
        take_up(state, strain, force)
        return
    learn_noise(state.noise, strain, USUAL_NOISE, dt)
    least = max(_SURE * noise_of(state.noise), USUAL_NOISE)
    if state.resting and abs(strain - state.rest) >= least:
        begin_motion(state, force)
    share, left = low_pass(dt, time), 0.0
    for i in range(3):
        state.left[i] += share * (left - state.left[i])
        left = state.left[i]
        state.strains[i] += share * (strain - state.strains[i])
        state.forces[i] += share * (force - state.forces[i])
        strain, force = state.strains[i], state.forces[i]
    # Input minus output of a filter, times this, is the rate of its output in the last sample.
    quick = share / ((1.0 - share) * dt)
    rate = quick * (state.strains[1] - strain)
    bend = quick ** 2 * (state.strains[0] - 2.0 * state.strains[1] + strain)
    before = load_law(state, strain, rate, bend)
    moved = abs(strain - state.last[1]) >= STEP
    if moved:
        learn_place(state, rate, bend, most, usual)
    state.age += dt
    if moved or state.age > _LONG * time:
        if abs(strain - state.last[1]) < least:
            state.resting, state.rest = True, strain
        leave_place(state, rate, bend)
    # A new estimate must not change the force at the present strain.
    now = load_law(state, strain, rate, bend)
    state.offset += before - now
    force -= state.value[3] * state.left[2]  # what ended with the rest
    left, dry = force - now - state.offset, dry_friction(state)
    state.offset += low_pass(dt, _OFFSET_LAGS * time) * (left - min(max(left, -dry), dry))
    if not state.known:
        state.offset = force - now
    state.rate, state.bend = rate, bend


def learn_place(state: Any, rate: float, bend: float, most: float, usual: float) -> None:
    """Update with the step that ends here, at a rate (1/s) and acceleration (1/s^2)."""
    value, p, way, product, last = (state.value, state.covariance, state.way, state.product,
                                    state.last)
    way[0], way[1], way[2] = state.strains[2] - last[1], rate - last[2], bend - last[3]
    way[3] = state.left[2] - last[4]
    p[0][0] += (most * way[0] / _REACH) ** 2
    p[1][1] += (_DRAG * usual) ** 2 / _MEMORY
    p[2][2] += max(value[2], usual) ** 2 / _MEMORY
    left, seen = state.forces[2] - last[0], (_OTHER * most) ** 2
    for i in range(4):
        left -= value[i] * way[i]
        product[i] = 0.0
        for j in range(4):
            product[i] += p[i][j] * way[j]
        seen += way[i] * product[i]
    if abs(left) < _CLIP * math.sqrt(seen):
        end = state.ends[1 if way[0] > 0.0 else 0]
        end[0], end[1], end[2], end[3] = state.forces[2], state.strains[2], rate, bend
    seen = max(seen, (left / _CLIP) ** 2)
    for i in range(4):
        value[i] += product[i] / seen * left
        for j in range(4):
            p[i][j] -= product[i] * product[j] / seen
    bound_value(state, 2, math.inf)
    bound_value(state, 1, math.inf)
    bound_value(state, 0, most)
    sd = math.sqrt(p[2][2])
    lightest = max(value[2] + _SURELY * sd, LEAST_INERTIA * usual)
    state.inertia = min(max(usual, value[2] - sd), lightest)
    state.places += 1


def bound_value(state: Any, i: int, most: float) -> None:
    """Move a parameter between 0 and ``most``, and the others to what they then probably are."""
    value, p = state.value, state.covariance
    beyond = value[i] - min(max(value[i], 0.0), most)
    if beyond == 0.0:
        return
    for j in range(4):
        if j != i:
            value[j] -= beyond * p[j][i] / p[i][i]
    value[i] -= beyond


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


def law_doubt(state: Any, strain: float, rate: float, bend: float) -> float:
    """Return the sd of the change of the load's force from its present motion to another, N."""
    way, total = state.way, 0.0
    way[0], way[1], way[2] = strain - state.strains[2], rate - state.rate, bend - state.bend
    for i in range(3):
        for j in range(3):
            total += way[i] * way[j] * state.covariance[i][j]
    return math.sqrt(max(total, 0.0))
