# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The state machine over RS0..RSn as kernels: when to recruit a unit, when to release it.

`recruitment` has the settings with their meaning, and the machine as an object.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.crossing import crossing_time
from fam_bundle_ros.control.curves import limit_without_adaptation, reach_below
from fam_bundle_ros.control.jump import TOLERANCE
from fam_bundle_ros.control.reasons import (
    ABSENT,
    AHEAD,
    AT_REST,
    BELOW,
    BEYOND,
    CHEAP,
    FROM_REST,
    NONE,
    SOFT,
    TURNED_BACK,
    UNREACHABLE,
)

#: s: lead of a rising demand over its reference, which ends when the demand stops rising.
_LEAD = 0.01
POLICIES = ('neglect', 'hysteresis', 'reversal_aware')
NEGLECT, HYSTERESIS, REVERSAL_AWARE = 0, 1, 2


@dataclass
class SwitchingSettings:
    """`SwitchingConfig` as kernels take it; ``margin`` and ``hysteresis`` nan: computed."""

    policy: int
    dwell: float
    margin: float
    hysteresis: float
    rest_time: float
    absence_time: float
    worth: float
    rest_rate: float
    horizon: float
    crossing_rate: float


@dataclass
class Demand:
    """
    Force demand, the input of the state machine.

    Attributes
    ----------
    force : float, N
    rate : float, N/s
        Rate of the demand minus that of the present state's limit, which changes with strain.
    acceleration, jerk : float, N/s^2 and N/s^3
    uncertainty, more_below : float, N
        Uncertainty, and how much larger it is in the state below: `outer_loop.uncertainties`.
    patience : float, s
        Duration of a crossing when there is time.
    doubt : float, N
        Uncertainty of the demand during a crossing: push-back and bias.
    feedback : float, N
        Part of the demand that feedback has added.
    smooth_rate : float, N/s
        The rate with the delay of its filter. ``rate`` compensates for this delay, and would
        amplify noise when it is extrapolated over a crossing.
    own_rate : float, N/s
        The same without the change of the force limits with the strain.
    spare : float, N
        What is left for the demand while units that are being filled push back; inf while none is.
    stepping : int
        1 for a demand that steps repeatedly: between two steps it is not at rest.
    step, climb : float, N
        For a demand that rises in steps: the last one, and the rise since the first one.
    soft, soft_below : int
        1 if the push-back of empty units makes the bundle too soft for the strain loop, in the
        present state and in the one below: `softness.set_softness`.
    """

    force: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    uncertainty: float = 0.0
    more_below: float = 0.0
    patience: float = 0.0
    doubt: float = 0.0
    feedback: float = 0.0
    smooth_rate: float = 0.0
    own_rate: float = 0.0
    spare: float = math.inf
    stepping: int = 0
    step: float = 0.0
    climb: float = 0.0
    soft: int = 0
    soft_below: int = 0


@dataclass
class Margins:
    """
    Forces at which the machine would switch now, N; nan where there is no such state.

    Attributes
    ----------
    recruit, release : float
    limit : float
        Largest force of the present state.
    width : float
        Width of the overlap with the next state, which ends at ``limit``.
    uncertainty : float
    """

    recruit: float = math.nan
    release: float = math.nan
    limit: float = math.nan
    width: float = math.nan
    uncertainty: float = 0.0


@dataclass
class MachineState:
    """
    Memory of the state machine.

    Attributes
    ----------
    reserve : list (n,), Pa
        Largest bottom pressure of each unit, in order, since it was recruited.
    needed : list (n,) of int
        1 for each unit, in order, that the demand has needed since it was recruited; the last one
        also if it was needed with the feedback of the state below.
    stiffens : list (n,) of int
        1 for each unit, in order, that was recruited for the stiffness only. It is kept for the
        absence time after it has last been needed for that: the strain may return.
    state : int
        k of RSk.
    direction : int
        Direction of the last switch: +1, -1, or 0 before the first.
    since, calm, absent, rising, nearing : float, s
        Time since the last switch; at rest below the release level; below the release level;
        since the demand last did not rise; since it last did not rise relative to the limit.
    ahead : float, N
        By how much the release level is lowered: the distance of the demand below it at the last
        recruitment ahead of need. A demand that then stops rising must not release the unit. 0
        once the demand has needed the unit.
    feedback : float, N
        Feedback part of the demand at the last switch.
    released : float, N
        Demand without feedback at the last switch, if a unit was released; else -inf.
    excess : float, N
        `excess_over` the state below when the last unit was recruited since that state was at its
        limit; inf where it was recruited ahead of need. At this demand the state below does not
        have the force, whatever the model says.
    back : bool
        The last unit was recruited although the demand had not risen since it was released: it
        pulls more than its model. As much as feedback has made up for is taken off ``excess``, as
        the unit may not have been empty.
    wary : bool
        The last unit was recruited ahead of need in vain: no patience.
    returned : bool
        The last unit was recruited within the absence time after it was released: the demand moves
        to and fro across the limit, and each crossing costs more than keeping the unit.
    """

    reserve: list
    needed: list
    stiffens: list
    state: int = 0
    direction: int = 0
    since: float = math.inf
    calm: float = 0.0
    absent: float = 0.0
    rising: float = 0.0
    nearing: float = 0.0
    ahead: float = 0.0
    feedback: float = 0.0
    released: float = -math.inf
    excess: float = math.inf
    back: bool = False
    wary: bool = False
    returned: bool = False
    margins: Margins = field(default_factory=Margins)


def start_machine(machine: Any, state: int) -> None:
    """Reset to a state, without dwell time."""
    for k in range(len(machine.needed)):
        machine.reserve[k], machine.needed[k], machine.stiffens[k] = 0.0, 1, 0
    machine.state, machine.direction, machine.since = state, 0, math.inf
    machine.calm = machine.absent = machine.rising = machine.nearing = 0.0
    machine.ahead = machine.feedback = 0.0
    machine.released, machine.excess = -math.inf, math.inf
    machine.back = machine.wary = machine.returned = False


def switch_step(settings: Any, machine: Any, table: Any, demand: Any, dt: float, reason: Any
                ) -> None:
    """
    Advance the state machine by one tick.

    Parameters
    ----------
    settings, machine : SwitchingSettings, MachineState
        Output: ``machine.state``.
    table : CurveTable
        Curves of this tick.
    demand : Demand
    dt : float, s
    reason : Reason
        Output: why it switched; unchanged if it did not.
    """
    machine.since += dt
    state, neglect = machine.state, settings.policy == NEGLECT
    margin, below, band = widths(settings, demand)
    recruit, width = math.nan, math.nan
    if state < len(machine.needed):
        # A state is left where the demand exceeds its uncertainty. RS0 is left early, but after
        # a release only if the demand rises: the vented force may be what it was released for.
        early = state == 0 and (machine.direction == 0
                                or demand.smooth_rate > at_rest(settings, table))
        recruit = table.top[state] + (-margin if early else margin)
        width = table.top[state] - table.crossing[state]
    release = release_level(settings, table, state, below, band) - machine.ahead
    shown = machine.margins
    shown.recruit, shown.release, shown.limit = recruit, release, table.top[state]
    shown.width, shown.uncertainty = width, demand.uncertainty
    update_times(settings, machine, table, demand, release, dt)
    free = neglect or machine.since >= settings.dwell
    # A reference beyond the limit is free of noise: no dwell time.
    sure = (settings.policy == REVERSAL_AWARE
            and demand.force - demand.feedback > recruit)
    if state < len(machine.needed) and (free or sure or machine.direction == 1):
        why = why_recruit(settings, machine, table, demand, recruit)
        if why != NONE:
            explain(reason, machine, table, demand, why, recruit)
            least = demand.force - band - min(_LEAD * max(demand.rate, 0.0), width)
            machine.ahead = 0.0 if why == SOFT else max(
                release_level(settings, table, state + 1, below, band) - least, 0.0)
            machine.excess = excess_over(table, demand, state) if why == BEYOND else math.inf
            machine.back = demand.force - demand.feedback <= machine.released
            if machine.back:
                machine.excess -= max(demand.feedback - machine.feedback, 0.0)
            machine.stiffens[state] = 1 if why == SOFT else 0
            switch(settings, machine, demand, 1)
            return
    # Margins cover model errors; below its floor the state cannot give the force in any case.
    level = release if settings.policy == NEGLECT else max(release, table.floor[state])
    if state > 0 and demand.force < level and (free or machine.direction == -1):
        why = why_release(settings, machine, table, demand, release, band)
        if why != NONE:
            explain(reason, machine, table, demand, why, release)
            machine.ahead, machine.excess = 0.0, math.inf
            switch(settings, machine, demand, -1)


def widths(settings: Any, demand: Any) -> tuple[float, float, float]:
    """Return the margins to recruit and to release, and the hysteresis band, N."""
    if settings.policy == NEGLECT:
        return 0.0, 0.0, 0.0
    margin = below = settings.margin
    if math.isnan(margin):
        margin, below = demand.uncertainty, demand.uncertainty + demand.more_below
    band = max(2.0 * below, 0.5) if math.isnan(settings.hysteresis) else settings.hysteresis
    return margin, below, band


def release_level(settings: Any, table: Any, state: int, margin: float, band: float) -> float:
    """Return the demand below which the last unit may be released, N."""
    if state == 0:
        return math.nan
    if settings.policy == NEGLECT:
        return table.top[state - 1]
    if settings.policy == HYSTERESIS:
        dip = max(table.dip[table.order[state - 1]], 0.0)
        return table.top[state - 1] - margin - max(band, dip)
    return table.crossing[state - 1] - margin - band


def excess_over(table: Any, demand: Any, state: int) -> float:
    """Return the demand without feedback minus the limit of a state without adaptation, N."""
    return demand.force - demand.feedback - limit_without_adaptation(table, state)


def asked(machine: Any, demand: Any) -> float:
    """Return the demand without changes of the feedback since the last switch, N."""
    return demand.force - demand.feedback + machine.feedback


def at_rest(settings: Any, table: Any) -> float:
    """Return the rate up to which a demand is at rest, N/s."""
    return settings.rest_rate * (table.top[-1] - table.top[0])


def update_times(settings: Any, machine: Any, table: Any, demand: Any, release: float, dt: float
          ) -> None:
    """Update the times of the demand: rising, below the release level, and at rest there."""
    below = machine.state > 0 and demand.force < release and demand.soft_below == 0
    resting = demand.stepping == 0 and abs(demand.rate) < at_rest(settings, table)
    for k in range(machine.state):
        machine.reserve[k] = max(machine.reserve[k], table.bottom_pressure[table.order[k]])
        last = k == machine.state - 1
        force = max(demand.force, asked(machine, demand)) if last else demand.force
        if force > table.top[k] - TOLERANCE:
            machine.needed[k], machine.stiffens[k] = 1, 0
            if last:
                machine.ahead = 0.0
    machine.rising = machine.rising + dt if demand.own_rate > 0.0 else 0.0
    nears = demand.rate * settings.absence_time > TOLERANCE
    machine.nearing = machine.nearing + dt if nears else 0.0
    machine.absent = machine.absent + dt if below else 0.0
    machine.calm = machine.calm + dt if below and resting else 0.0


def why_recruit(settings: Any, machine: Any, table: Any, demand: Any, recruit: float) -> int:
    """Return the code of the reason to recruit the next unit, `NONE` for no."""
    state, force = machine.state, demand.force
    limit, crossing = table.top[state], table.crossing[state]
    # A unit that cannot add force at this strain or limit is of no use, unless others follow.
    added = table.top[state + 1] - limit
    if table.top[-1] - limit < TOLERANCE:
        return NONE
    if force > recruit:
        return FROM_REST if state == 0 else BEYOND
    if settings.policy == REVERSAL_AWARE and state > 0 and demand.soft > 0:
        return SOFT
    # Look-ahead requires that the unit adds more than the uncertainty, and that its push-back can
    # be compensated beside that of the units that are still being filled.
    if (settings.policy != REVERSAL_AWARE or state == 0
            or (demand.rate <= 0.0 and demand.climb <= 0.0)
            or added < demand.uncertainty or demand.spare < table.dip[table.order[state]]):
        return NONE
    # A demand that has turned back before, and the motion of the strain, are predicted no further
    # than a crossing at the usual rate takes; a rise no longer than it has lasted.
    usual = crossing_time(table, table.order[state], settings.crossing_rate, 0.0)
    time = usual if machine.wary else max(usual, min(machine.rising, crossing_time(
        table, table.order[state], settings.crossing_rate, demand.patience)))
    soon = demand.smooth_rate * usual
    ahead = force + max(demand.step, soon + demand.own_rate * (time - usual))
    if ahead < crossing - 0.1 * (limit - crossing):
        return NONE
    # One standard deviation, a third of the margin, is enough at first: a needless recruitment
    # costs air, a late one a force dip that cannot be compensated. Inside the overlap part of the
    # dip is already certain, so the level rises and the horizon shrinks.
    late = min(max((force - crossing) / max(limit - crossing, TOLERANCE), 0.0), 1.0)
    level = limit + (recruit - limit) * (1.0 + 2.0 * late) / 3.0
    horizon, climb = settings.horizon, 0.0
    if force + max(demand.step, soon) > crossing and not machine.wary:
        # The last moment: a slow rise is expected to last, and stairs to rise, as much again.
        horizon, climb = max(horizon, machine.nearing), demand.climb
    rise = max(rise_within(demand, horizon * (1.0 - late)), climb * (1.0 - late))
    return NONE if force + rise <= level else AHEAD


def rise_within(demand: Any, horizon: float) -> float:
    """
    Return the predicted rise of the demand within a horizon (s), N; 0 unless it is rising.

    Extrapolated to the turning point of a demand that decelerates, else to the horizon:
    rate + slowing t + jerk t^2/2 = 0, solved in the form that also holds for zero jerk.
    """
    if demand.rate <= 0.0:
        return 0.0
    slowing, jerk = min(demand.acceleration, 0.0), min(demand.jerk, 0.0)
    root = math.sqrt(slowing * slowing - 2.0 * jerk * demand.rate) - slowing
    turn = min(2.0 * demand.rate / root, horizon) if root > 0.0 else horizon
    return turn * (demand.rate + turn * (slowing / 2.0 + turn * jerk / 6.0))


def why_release(settings: Any, machine: Any, table: Any, demand: Any, release: float,
                band: float) -> int:
    """Return the code of the reason to release the last unit, `NONE` for no."""
    last = machine.state - 1
    if settings.policy != REVERSAL_AWARE:
        return BELOW if demand.force < release else UNREACHABLE
    if demand.rate > at_rest(settings, table):
        return NONE
    # Pressures below the bottom are used first: `inverse.lower`.
    spare = max(demand.doubt, reach_below(table, table.order[last]))
    if demand.force < table.floor[machine.state] - spare:
        return UNREACHABLE
    if demand.soft_below > 0:
        return NONE
    if machine.stiffens[last] > 0:
        return ABSENT if machine.absent >= settings.absence_time else NONE
    if excess_over(table, demand, last) > machine.excess - band:
        return NONE
    # A single lowered unit carries the whole force: released only when empty.
    alone = machine.state == 1 and table.lowered[table.order[last]] > 0
    if alone or not demand.force < release:
        return NONE
    if machine.absent >= settings.absence_time:
        return ABSENT
    if machine.returned:
        return NONE
    if (machine.calm >= settings.rest_time
            and demand.force + demand.smooth_rate * settings.horizon < release):
        return AT_REST
    if demand.rate < 0.0 and machine.needed[last] == 0 and asked(machine, demand) < release:
        return TURNED_BACK
    held = table.bottom_pressure[table.order[last]]
    if demand.rate < 0.0 and held < settings.worth * machine.reserve[last]:
        return CHEAP
    return NONE


def explain(reason: Any, machine: Any, table: Any, demand: Any, why: int, level: float) -> None:
    """Record a decision and the numbers that it is based on."""
    state = machine.state
    reason.why, reason.state, reason.force, reason.rate = why, state, demand.force, demand.rate
    reason.level = table.floor[state] if why == UNREACHABLE else level
    reason.limit = table.top[state]
    reason.time = machine.absent if why == ABSENT else machine.calm
    if state < len(machine.needed):
        reason.crossing = table.crossing[state]
    if state > 0:
        reason.pressure = table.bottom_pressure[table.order[state - 1]]


def switch(settings: Any, machine: Any, demand: Any, direction: int) -> None:
    """Recruit the next unit (+1) or release the last one (-1)."""
    # No patience after a unit was recruited in vain, until one has been needed.
    machine.wary = direction < 0 and machine.needed[machine.state - 1] == 0
    if direction > 0:
        machine.needed[machine.state], machine.reserve[machine.state] = 0, 0.0
    machine.returned = (direction > 0 and machine.direction < 0
                        and machine.since < settings.absence_time)
    machine.feedback = demand.feedback
    machine.released = demand.force - demand.feedback if direction < 0 else -math.inf
    machine.state += direction
    machine.since = machine.calm = machine.absent = 0.0
    machine.direction = direction
