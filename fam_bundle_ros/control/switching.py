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
from fam_bundle_ros.control.curves import reach_below
from fam_bundle_ros.control.reasons import (
    ABSENT,
    AHEAD,
    AT_REST,
    BELOW,
    BEYOND,
    CHEAP,
    FROM_REST,
    NONE,
    TURNED_BACK,
    UNREACHABLE,
)

#: s: by so much a demand that rises may be ahead of its reference; it falls back when it stops.
_LEAD = 0.01
#: N: a unit that adds less force is no help; a demand so near to the limit needs the unit.
_LITTLE = 0.1
POLICIES = ('neglect', 'hysteresis', 'reversal_aware')
NEGLECT, HYSTERESIS, REVERSAL_AWARE = 0, 1, 2


@dataclass
class SwitchingSettings:
    """`SwitchingConfig` as kernels take it; ``margin`` and ``hysteresis`` nan: worked out."""

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
    What is asked of the bundle, as the state machine sees it.

    Attributes
    ----------
    force : float, N
    rate : float, N/s
        Of the demand against what the present state can give: it counts that the strain moves.
    acceleration, jerk : float, N/s^2 and N/s^3
    uncertainty : float, N
        Three standard deviations of the noise in the demand, plus the model's error.
    patience : float, s
        What a hand-over from unit to unit takes where there is time.
    doubt : float, N
        Of the demand while a unit is on its way: push-back that is crossed, and bias.
    feedback : float, N
        Part of the demand that feedback has added.
    smooth_rate : float, N/s
        The rate as the filter shows it, late by its delay: looking ahead over a hand-over would
        amplify the noise of one that makes up for it.
    """

    force: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    uncertainty: float = 0.0
    patience: float = 0.0
    doubt: float = 0.0
    feedback: float = 0.0
    smooth_rate: float = 0.0


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
        Of the overlap with the next state, which ends at ``limit``.
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
        Of each unit in order: the most of what it must hold at least since it was recruited.
    needed : list (n,) of int
        Of each unit in order: 1 when a demand has needed it since it was recruited.
    state : int
        k of RSk.
    direction : int
        Of the last switch: +1, -1, or 0 before the first.
    since, calm, absent : float, s
        Since the last switch; the demand has been at rest, or only below the release level.
    ahead : float, N
        How far below the release level the demand was when the last unit was recruited ahead of
        need: a demand that then stops, and never fell, releases nothing.
    feedback : float, N
        What feedback had added to the demand when a unit was recruited last.
    wary : bool
        A unit was recruited for a demand that then turned back: look ahead no more.
    """

    reserve: list
    needed: list
    state: int = 0
    direction: int = 0
    since: float = math.inf
    calm: float = 0.0
    absent: float = 0.0
    ahead: float = 0.0
    feedback: float = 0.0
    wary: bool = False
    margins: Margins = field(default_factory=Margins)


def start_machine(machine: Any, state: int) -> None:
    """Start in a state, free to switch at once."""
    for k in range(len(machine.needed)):
        machine.reserve[k], machine.needed[k] = 0.0, 1
    machine.state, machine.direction, machine.since = state, 0, math.inf
    machine.calm = machine.absent = machine.ahead = machine.feedback = 0.0
    machine.wary = False


def switch_step(settings: Any, machine: Any, table: Any, demand: Any, dt: float, reason: Any
                ) -> None:
    """
    Advance the state machine by one tick.

    Parameters
    ----------
    settings, machine : SwitchingSettings, MachineState
        ``machine.state`` is then the state to be in.
    table : CurveTable
        Of this tick.
    demand : Demand
    dt : float, s
    reason : Reason
        Why it switched; left as it is when it did not.
    """
    machine.since += dt
    state, neglect = machine.state, settings.policy == NEGLECT
    margin, band = widths(settings, demand)
    recruit, width = math.nan, math.nan
    if state < len(machine.needed):
        # Off is no state to be saturated in; beyond a working state the demand must be sure.
        recruit = table.top[state] + (margin if state > 0 else -margin)
        width = table.top[state] - table.crossing[state]
    release = release_level(settings, table, state, margin, band) - machine.ahead
    shown = machine.margins
    shown.recruit, shown.release, shown.limit = recruit, release, table.top[state]
    shown.width, shown.uncertainty = width, demand.uncertainty
    watch(settings, machine, table, demand, release, dt)
    free = neglect or machine.since >= settings.dwell
    # A reference that is beyond the limit is no noise, and does not wait.
    sure = (settings.policy == REVERSAL_AWARE
            and demand.force - demand.feedback > recruit)
    if state < len(machine.needed) and (free or sure or machine.direction == 1):
        why = why_recruit(settings, machine, table, demand, recruit)
        if why != NONE:
            explain(reason, machine, table, demand, why, recruit)
            least = demand.force - band - min(_LEAD * max(demand.rate, 0.0), width)
            machine.ahead = max(
                release_level(settings, table, state + 1, margin, band) - least, 0.0)
            machine.feedback = demand.feedback
            switch(machine, 1)
            return
    # Margins are for doubts of the model; a force that the state cannot give is beyond doubt.
    level = release if settings.policy == NEGLECT else max(release, table.floor[state])
    if state > 0 and demand.force < level and (free or machine.direction == -1):
        why = why_release(settings, machine, table, demand, release)
        if why != NONE:
            explain(reason, machine, table, demand, why, release)
            machine.ahead = 0.0
            switch(machine, -1)


def widths(settings: Any, demand: Any) -> tuple[float, float]:
    """Return margin and hysteresis band, N: by hand, or from uncertainty and overlap."""
    if settings.policy == NEGLECT:
        return 0.0, 0.0
    margin = demand.uncertainty if math.isnan(settings.margin) else settings.margin
    band = max(2.0 * margin, 0.5) if math.isnan(settings.hysteresis) else settings.hysteresis
    return margin, band


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


def watch(settings: Any, machine: Any, table: Any, demand: Any, release: float, dt: float
          ) -> None:
    """Count how long the demand has been below the release level, and at rest there."""
    below = machine.state > 0 and demand.force < release
    resting = abs(demand.rate) < settings.rest_rate * (table.top[-1] - table.top[0])
    for k in range(machine.state):
        machine.reserve[k] = max(machine.reserve[k], table.bottom_pressure[table.order[k]])
        if demand.force > table.top[k] - _LITTLE:
            machine.needed[k] = 1
    machine.absent = machine.absent + dt if below else 0.0
    machine.calm = machine.calm + dt if below and resting else 0.0


def why_recruit(settings: Any, machine: Any, table: Any, demand: Any, recruit: float) -> int:
    """Return the code of the reason to recruit the next unit, `NONE` for no."""
    state, force = machine.state, demand.force
    limit, crossing = table.top[state], table.crossing[state]
    # A unit that cannot add force at this strain is no help.
    added = table.top[state + 1] - limit
    if added < _LITTLE:
        return NONE
    if force > recruit:
        return FROM_REST if state == 0 else BEYOND
    # Ahead of need it must add more than is in doubt.
    if (settings.policy != REVERSAL_AWARE or state == 0 or demand.rate <= 0.0 or machine.wary
            or added < demand.uncertainty):
        return NONE
    rate = demand.smooth_rate
    ahead = force + rate * crossing_time(table, table.order[state], rate, settings.crossing_rate,
                                         demand.patience)
    if ahead < crossing - 0.1 * (limit - crossing):
        return NONE
    # One standard deviation, a third of the margin, is enough: to be wrong costs air, to be late a
    # dip that nothing can make up for any more. The more of it is there already, the surer it
    # must be that the unit is needed, and soon.
    late = min(max((force - crossing) / max(limit - crossing, _LITTLE), 0.0), 1.0)
    level = limit + (recruit - limit) * (1.0 + 2.0 * late) / 3.0
    within = settings.horizon * (1.0 - late)
    return NONE if force + rise_within(demand, within) <= level else AHEAD


def rise_within(demand: Any, horizon: float) -> float:
    """
    Return how much further the demand will rise within a horizon (s), N.

    A demand that slows down is followed to its turning point, one that does not along its slope:
    rate + slowing t + jerk t^2/2 = 0, solved in the form that also holds for no jerk at all.
    """
    slowing, jerk = min(demand.acceleration, 0.0), min(demand.jerk, 0.0)
    root = math.sqrt(slowing * slowing - 2.0 * jerk * demand.rate) - slowing
    turn = min(2.0 * demand.rate / root, horizon) if root > 0.0 else horizon
    return turn * (demand.rate + turn * (slowing / 2.0 + turn * jerk / 6.0))


def why_release(settings: Any, machine: Any, table: Any, demand: Any, release: float) -> int:
    """Return the code of the reason to release the last unit, `NONE` for no."""
    last = machine.state - 1
    if settings.policy != REVERSAL_AWARE:
        return BELOW if demand.force < release else UNREACHABLE
    if demand.rate > settings.rest_rate * (table.top[-1] - table.top[0]):
        return NONE
    # The unit itself is lowered first: `inverse.lower`.
    spare = max(demand.doubt, reach_below(table, table.order[last]))
    if demand.force < table.floor[machine.state] - spare:
        return UNREACHABLE
    # A lowered unit that is alone holds what force there is: it leaves when it is empty.
    alone = machine.state == 1 and table.lowered[table.order[last]] > 0
    if alone or not demand.force < release:
        return NONE
    if machine.calm >= settings.rest_time:
        return AT_REST
    if machine.absent >= settings.absence_time:
        return ABSENT
    # What feedback takes away since, as friction turns round, is no turn of what is asked.
    asked = demand.force - demand.feedback + machine.feedback
    if demand.rate < 0.0 and machine.needed[last] == 0 and asked < release:
        return TURNED_BACK
    held = table.bottom_pressure[table.order[last]]
    if demand.rate < 0.0 and held < settings.worth * machine.reserve[last]:
        return CHEAP
    return NONE


def explain(reason: Any, machine: Any, table: Any, demand: Any, why: int, level: float) -> None:
    """Write down a decision and the numbers that it rests on."""
    state = machine.state
    reason.why, reason.state, reason.force, reason.rate = why, state, demand.force, demand.rate
    reason.level = table.floor[state] if why == UNREACHABLE else level
    reason.limit = table.top[state]
    reason.time = machine.absent if why == ABSENT else machine.calm
    if state < len(machine.needed):
        reason.crossing = table.crossing[state]
    if state > 0:
        reason.pressure = table.bottom_pressure[table.order[state - 1]]


def switch(machine: Any, direction: int) -> None:
    """Recruit the next unit (+1) or release the last one (-1)."""
    # What was recruited in vain is not recruited ahead of need again; need clears this.
    machine.wary = direction < 0 and machine.needed[machine.state - 1] == 0
    if direction > 0:
        machine.needed[machine.state], machine.reserve[machine.state] = 0, 0.0
    machine.state += direction
    machine.since = machine.calm = machine.absent = 0.0
    machine.direction = direction
