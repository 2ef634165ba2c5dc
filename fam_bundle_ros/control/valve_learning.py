# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dead band and flow that a valve has, learnt from pressures that come late or early.

The inverse of the valve jumps over the dead band that the loop was told. Where the true one, with
the backlash of its spool, is wider, small openings let no air through at all. What is missing of
the pressure that was sent widens the band of that side, what is too much narrows it (adaptive
inverse of a dead zone: Tao and Kokotovic 1994, IEEE Trans. Autom. Control 39, 59). Wide openings
say little of the dead band, but how much air passes: fittings and tubes take their share, supplies
sag, and a valve may exhaust less than it fills. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

#: A dead band may be off by this share of itself and by this much more of the full command.
DOUBT_SHARE, DOUBT = 0.5, 0.02
#: A conductance may be off by this share of itself.
CONDUCTANCE_DOUBT = 0.3
#: What is learnt of it stays within so many of these.
_BOUND = 2.0
#: s: over which a side that is open learns; at first it takes the mean of all that it has seen.
_LEARN_TIME = 0.1
#: What is read is filtered over so many lags of the loop.
_FILTER_LAGS = 2.0
#: Share of a rate that a lag which is off by a tenth makes of it in this filter.
_LAG_SHARE = 0.1 / _FILTER_LAGS


@dataclass
class ValveLearningState:
    """
    What was learnt of a valve.

    Attributes
    ----------
    fill, vent : float
        By how much the dead band of each side is wider than told, in commands.
    reading, due : float, Pa
        In the tick before: reading, and the pressure that was to be there by what was sent.
    open, seen : float, s
        Time that openings to fill have lasted, each weighted by `worth`, less that of those to
        exhaust: so far, and as far as the reading before showed it.
    missing, came, share : float, Pa/s, Pa/s and 1
        Filtered: rate that is missing, that of the reading, and time with openings to fill less
        to exhaust.
    fill_time, vent_time : float, s
        For how long each side has learnt.
    wide : float
        Size of the opening, as far as the spool may still be on its way back from it.
    fill_flow, vent_flow : float
        What passes of the flow that the valve as told has.
    flow, flow_seen, flow_share : float, s, s and 1
        As ``open``, ``seen`` and ``share``, with the weight `flow_worth`.
    """

    fill: float = 0.0
    vent: float = 0.0
    reading: float = 0.0
    due: float = 0.0
    open: float = 0.0
    seen: float = 0.0
    missing: float = 0.0
    came: float = 0.0
    share: float = 0.0
    fill_time: float = 0.0
    vent_time: float = 0.0
    wide: float = 0.0
    fill_flow: float = 1.0
    vent_flow: float = 1.0
    flow: float = 0.0
    flow_seen: float = 0.0
    flow_share: float = 0.0


def dead_band_doubt(dead_band: float) -> float:
    """Return by how much the dead band of a valve may be off, in commands."""
    return DOUBT_SHARE * dead_band + DOUBT


def worth(wide: float, doubt: float) -> float:
    """
    Return how much of a rate that is missing is the dead band's, 0 to 1.

    Of errors that are independent each takes its variance's share: the doubt of the dead band, and
    that of the conductance times the opening ``wide``.

    Examples
    --------
    >>> worth(0.0, 0.04), round(worth(0.4, 0.04), 2)
    (1.0, 0.1)
    """
    other = CONDUCTANCE_DOUBT * wide / doubt
    return 1.0 / (1.0 + other * other)


def flow_worth(opening: float, wide: float, doubt: float) -> float:
    """
    Return how much of a rate that is missing is the flow's, over the opening.

    What `worth` leaves, where the opening is as ``wide`` as it was.

    Examples
    --------
    >>> round(worth(0.4, 0.04) + 0.4 * flow_worth(0.4, 0.4, 0.04), 3)
    1.0
    """
    other = CONDUCTANCE_DOUBT / doubt
    return other * other * opening * worth(wide, doubt)


def learn_dead_band(valve: Any, most: float, pressure: float, due: float, open_then: float,
                    slow: float, filling: float, venting: float, lag: float, dt: float) -> float:
    """
    Learn from one reading; return what the integral need not add any more, Pa/s.

    A band that is learnt gives from now on what is missing and what the integral has made up for.

    Parameters
    ----------
    valve : ValveLearningState
    most : float
        Largest error of the told dead band, in commands.
    pressure, due : float, Pa
        Reading, and the sum of all changes that it should show by what was sent.
    open_then : float, s
        `ValveLearningState.open` at the time of the last command that the reading can show.
    slow : float, Pa/s
        Rate that the loop's integral added besides.
    filling, venting : float, Pa/s
        What the valve does to the pressure fully open to either side, both above 0.
    lag : float, s
        From command to reading.
    dt : float, s
    """
    # Filtered alike: noise that opened the valve a little is gone from the next reading, as if
    # the air had answered.
    time = _FILTER_LAGS * lag
    kept = math.exp(-dt / time)
    missing = (due - valve.due - (pressure - valve.reading)) / dt + slow
    valve.missing = kept * valve.missing + (1.0 - kept) * missing
    valve.came = kept * valve.came + (1.0 - kept) * (pressure - valve.reading) / dt
    valve.share = kept * valve.share + (1.0 - kept) * (open_then - valve.seen) / dt
    valve.reading, valve.due, valve.seen = pressure, due, open_then
    fills = valve.share > 0.0
    learnt = (valve.fill_time if fills else valve.vent_time) + abs(valve.share) * dt
    # An integrator behind a dead time as long as its own time is stable (up to pi/2 of it).
    least = lag + time
    over = min(max(learnt, least), max(_LEARN_TIME, least))
    # A dead band that is wider by x takes the share x of the fully open valve's rate.
    # A wide opening may show earlier than reckoned: from then on it has its part.
    known = worth(valve.wide, most)
    step = dt / over * min(max(valve.share, -known), known) * valve.missing
    if fills and filling > 0.0:
        before, valve.fill_time = valve.fill, learnt
        valve.fill = min(max(before + step / filling, -most), most)
        return made_up(valve, slow) * (valve.fill - before) * filling
    if valve.share < 0.0 and venting > 0.0:
        before, valve.vent_time = valve.vent, learnt
        valve.vent = min(max(before + step / venting, -most), most)
        return made_up(valve, slow) * (before - valve.vent) * venting
    return 0.0


def learn_flow(valve: Any, flow_then: float, slow: float, filling: float, venting: float,
               lag: float, dt: float) -> float:
    """
    Learn the flow from the reading that `learn_dead_band` has had; return what that returns.

    Parameters
    ----------
    flow_then : float, s
        `ValveLearningState.flow` at the time of the last command that the reading can show.
    valve, slow, filling, venting, lag, dt
        As there; ``filling`` and ``venting`` with what was learnt.
    """
    time = _FILTER_LAGS * lag
    kept = math.exp(-dt / time)
    valve.flow_share = kept * valve.flow_share + (1.0 - kept) * (flow_then - valve.flow_seen) / dt
    valve.flow_seen = flow_then
    fills = valve.flow_share > 0.0
    full, share = (filling, valve.flow_share) if fills else (venting, valve.flow_share)
    # Rate that the opening was to give.
    meant = valve.missing + valve.came
    if full <= 0.0 or meant * share <= 0.0:
        return 0.0
    flow, most = valve.fill_flow if fills else valve.vent_flow, _BOUND * CONDUCTANCE_DOUBT
    # What no valve can be off by is a fault, or the lag.
    if abs(valve.came / meant * flow - 1.0) > most:
        return 0.0
    sure = max(abs(valve.missing) - _LAG_SHARE * abs(meant), 0.0)
    change = dt / max(_LEARN_TIME, lag + time) * abs(share) * math.copysign(sure, valve.missing)
    change *= flow / full
    new = min(max(flow - (change if fills else -change), 1.0 - most), 1.0 + most)
    if fills:
        valve.fill_flow = new
    else:
        valve.vent_flow = new
    return made_up(valve, slow) * (flow - new) / flow * meant


def made_up(valve: Any, slow: float) -> float:
    """
    Return the share of what is missing that the integral (Pa/s) has made up for, 0 to 1.

    A pressure that stands still may have met a fault: only what has come was made up for.
    """
    if valve.missing == 0.0:
        return 0.0
    return min(max(min(slow / valve.missing, valve.came / valve.missing), 0.0), 1.0)


def begin_readings(valve: Any, pressure: float) -> None:
    """Begin at a reading (Pa), with what was learnt before."""
    valve.reading, valve.due, valve.open, valve.seen = pressure, 0.0, 0.0, 0.0
    valve.missing = valve.came = valve.share = 0.0
    valve.flow = valve.flow_seen = valve.flow_share = 0.0


def command_of(valve: Any, dead_band: float, opening: float, most: float) -> float:
    """
    Return the valve command for an opening, with the dead band as it was learnt.

    Parameters
    ----------
    valve : ValveLearningState
    dead_band : float
        As told.
    opening : float
        -1 exhaust .. 0 closed .. 1 fill.
    most : float
        Largest command to fill.
    """
    if opening == 0.0:
        return 0.0
    width = max(dead_band + (valve.fill if opening > 0.0 else valve.vent), 0.0)
    size = width + min(abs(opening), 1.0) * (1.0 - width)
    return min(size, most) if opening > 0.0 else -size
