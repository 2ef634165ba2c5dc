# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Reasons for switching: codes in the kernels, sentences for the user."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
import math
from typing import Any

#: Codes of reasons: none; to recruit; to release; to vent.
NONE = 0
FROM_REST, BEYOND, AHEAD = 1, 2, 3
BELOW, UNREACHABLE, AT_REST, ABSENT, TURNED_BACK, CHEAP = 4, 5, 6, 7, 8, 9
LOST = 10
#: For orderly switching without a model.
FULL, EMPTY = 11, 12
#: To recruit for the stiffness at a strain reference.
SOFT = 13


@dataclass
class Reason:
    """
    Why the controller switched in this tick, with the numbers it is based on.

    Attributes
    ----------
    why : int
        Code, see above; `NONE` in ticks without a decision.
    state : int
        k of RSk before the switch.
    force, level, limit, crossing : float, N
        Demand; level it is compared with; largest force of the state; demand above which the
        push-back of the next unit could not be compensated.
    rate : float, N/s
    time : float, s
        Time at rest, below the level, or without a reading.
    pressure : float, Pa
        Bottom pressure of the unit.
    """

    why: int = 0
    state: int = 0
    force: float = math.nan
    level: float = math.nan
    limit: float = math.nan
    crossing: float = math.nan
    rate: float = math.nan
    time: float = math.nan
    pressure: float = math.nan


def sentence(reason: Any, names: Sequence[str]) -> str:
    """
    Return a reason in words, empty where there is none.

    Parameters
    ----------
    reason : Reason, or a record of one
    names : sequence of str
        Motor units in their order of recruitment.

    Examples
    --------
    >>> sentence(Reason(AT_REST, 2, force=20.0, level=31.5, time=0.8), ['MU1', 'MU2'])
    'release MU2: demand 20.0 N below 31.5 N and at rest for 0.8 s'
    """
    r, state, force = reason, int(reason.state), reason.force
    if r.why == NONE:
        return ''
    if r.why == LOST:
        return f'vent: no usable reading or reference for {r.time:.2f} s'
    if r.why == FULL:
        return f'recruit {names[state]}: ' + (
            f'{names[state - 1]} is full, demand is higher' if state else 'there is a demand')
    if r.why == EMPTY:
        return f'release {names[state - 1]}: it is empty, demand is lower'
    if r.why == SOFT:
        return (f'recruit {names[state]}: its push-back while it is empty makes RS{state} too '
                'soft at this strain')
    if r.why <= AHEAD:
        dip = r.limit - r.crossing
        pushed = (f'; above {r.crossing:.1f} N its push-back of {dip:.1f} N could not be '
                  'compensated') if dip > 0.05 else ''
        rising = f'by {r.rate:.1f} N/s' if r.rate > 0.0 else 'in steps'
        text = {
            FROM_REST: f'demand {force:.1f} N above {r.level:.1f} N; vented it gives '
                           f'{r.limit:.1f} N',
            BEYOND: f"demand {force:.1f} N above RS{state}'s {r.limit:.1f} N by more than "
                        f'{r.level - r.limit:.1f} N',
            AHEAD: f"demand {force:.1f} N rising {rising} towards RS{state}'s "
                       f'{r.limit:.1f} N{pushed}'}[int(r.why)]
        return f'recruit {names[state]}: {text}'
    below = f'demand {force:.1f} N below {r.level:.1f} N'
    text = {
        BELOW: below,
        UNREACHABLE: f'demand {force:.1f} N below {r.level:.1f} N, the least force of RS{state}',
        AT_REST: f'{below} and at rest for {r.time:.1f} s',
        ABSENT: f'{below} for {r.time:.1f} s',
        TURNED_BACK: f'{below} and turned back before it was needed',
        CHEAP: f'{below}, and only {r.pressure / 1e3:.0f} kPa to fill again from here',
    }[int(r.why)]
    return f'release {names[state - 1]}: {text}'


def row_of(reason: Any, row: Any) -> None:
    """Write a reason into a vector of numbers (a kernel), to be kept tick by tick."""
    row[0], row[1], row[2], row[3] = reason.why, reason.state, reason.force, reason.level
    row[4], row[5], row[6] = reason.limit, reason.crossing, reason.rate
    row[7], row[8] = reason.time, reason.pressure


def from_row(row: Sequence[float]) -> Reason:
    """Return the reason that `row_of` wrote."""
    why, state, *numbers = row
    return Reason(int(why), int(state), *map(float, numbers))


#: How long a row of `row_of` is.
ROW = len(fields(Reason))
