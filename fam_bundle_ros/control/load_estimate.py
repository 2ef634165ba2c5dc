# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Stiffness, damping and inertia of a load of which nothing was told, learnt as it moves.

A Kalman filter on how the measured force changes from place to place of the strain: by stiffness
times the way, damping times the change of the rate, inertia times that of the acceleration. The
three come from filters that force and strain pass alike (state variable filters: Young 2011,
Recursive Estimation and Time-Series Analysis, ch. 8). A change of the force beyond what the load's
laws may be counts as far as that only (Huber 1964, Ann. Math. Stat. 35, 73): a weight that is put
on. What changes while the strain stays is left out: a stop that is about to be left. At rest only
the force at zero strain follows. What the model of the muscles misses does not come in: it is the
load that is seen. Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.observer import low_pass

#: Strain from one place to the next: above the noise of filtered readings (1e-5 to 1e-4).
_STEP = 0.002
#: Filter times after which a place is left without having learnt anything.
_LONG = 10.0
#: Places after which an estimate counts: two of each of the three that are looked for.
_ENOUGH = 6
#: Filter times in which the force at zero strain follows. What the strain loop adds to it comes
#: back three filters later; an integrator behind a dead time has no overshoot from e of it on.
_OFFSET_LAGS = 3.0 * math.e
#: N: standard deviation of what else the force does from place to place: friction, noise.
_OTHER = 1.0
#: Strain over which a stiffness may become any other.
_REACH = 0.1
#: Range of inertias over the usual one: to that of a robot's arm.
_INERTIAS = 100.0
#: 1/s: damping of guides over the usual inertia.
_DRAG = 30.0
#: Places in which damping and inertia may change by themselves, squared.
_MEMORY = 1000.0
#: Standard deviations beyond which a change of the force is no law's.
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
        Force at zero strain, as the stiffness here lets believe.
    inertia : float, N s^2
        What of it is sure, to a standard deviation; at least the usual one: the gains for that
        suit a lighter load too.
    strains, forces : list (3,)
        Readings behind one, two and three filters.
    last : list (4,)
        Force, strain, rate and acceleration at the place before, ``age`` s ago.
    places : int
        So far.
    way, product : list (3,)
        Room to work in.
    started, known : bool
    """

    value: list = field(default_factory=lambda: [0.0] * 3)
    covariance: list = field(default_factory=lambda: [[0.0] * 3 for _ in range(3)])
    offset: float = 0.0
    inertia: float = 0.0
    strains: list = field(default_factory=lambda: [0.0] * 3)
    forces: list = field(default_factory=lambda: [0.0] * 3)
    last: list = field(default_factory=lambda: [0.0] * 4)
    age: float = 0.0
    places: int = 0
    way: list = field(default_factory=lambda: [0.0] * 3)
    product: list = field(default_factory=lambda: [0.0] * 3)
    started: bool = False
    known: bool = False


def forget_load(state: Any) -> None:
    """Begin anew."""
    state.started = state.known = False


def begin_load(state: Any, most: float, usual: float) -> None:
    """Begin with nothing known; arguments as for `learn_load`."""
    state.started, state.places = True, 0
    for i in range(3):
        state.value[i] = 0.0
        for j in range(3):
            state.covariance[i][j] = 0.0
    state.value[2] = state.inertia = usual
    state.covariance[0][0] = most ** 2
    state.covariance[1][1] = (_DRAG * usual) ** 2
    state.covariance[2][2] = (_INERTIAS * usual) ** 2


def take_up(state: Any, strain: float, force: float) -> None:
    """Take a reading as if it had lasted: the first one, or one after a gap."""
    for i in range(3):
        state.strains[i], state.forces[i] = strain, force
    leave_place(state, 0.0, 0.0)


def leave_place(state: Any, rate: float, bend: float) -> None:
    """Let the way to the next place begin here."""
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
        As measured.
    most : float, N
        Largest stiffness that a load may have.
    usual : float, N s^2
        Inertia before anything is known.
    time, dt : float, s
        Of each filter, and since the reading before.

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
    # What a filter is behind, times this, is how quickly it moved in the last sample.
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
    # Another estimate gives the same force here.
    now = load_law(state, strain, rate, bend)
    state.offset += before - now
    state.offset += low_pass(dt, _OFFSET_LAGS * time) * (force - now - state.offset)
    if not state.known:
        state.known, state.offset = state.places >= _ENOUGH, force - now


def learn_place(state: Any, rate: float, bend: float, most: float, usual: float) -> None:
    """Learn from the way from the place before, at a rate (1/s) and acceleration (1/s^2)."""
    value, p, way, product, last = (state.value, state.covariance, state.way, state.product,
                                    state.last)
    way[0], way[1], way[2] = state.strains[2] - last[1], rate - last[2], bend - last[3]
    p[0][0] += (most * way[0] / _REACH) ** 2
    p[1][1] += (_DRAG * usual) ** 2 / _MEMORY
    p[2][2] += max(value[2], usual) ** 2 / _MEMORY
    left, seen = state.forces[2] - last[0], _OTHER ** 2
    for i in range(3):
        left -= value[i] * way[i]
        product[i] = p[i][0] * way[0] + p[i][1] * way[1] + p[i][2] * way[2]
        seen += way[i] * product[i]
    seen = max(seen, (left / _CLIP) ** 2)
    for i in range(3):
        value[i] += product[i] / seen * left
        for j in range(3):
            p[i][j] -= product[i] * product[j] / seen
    value[0], value[1] = min(max(value[0], 0.0), most), max(value[1], 0.0)
    state.inertia = max(usual, value[2] - math.sqrt(p[2][2]))
    state.places += 1


def load_law(state: Any, strain: float, rate: float, bend: float) -> float:
    """Return the force of the load beyond that at zero strain (N), at rates 1/s and 1/s^2."""
    return state.value[0] * strain + state.value[1] * rate + state.inertia * bend
