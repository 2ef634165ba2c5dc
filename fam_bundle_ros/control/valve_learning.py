# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Adaptation of a valve's dead band and flow, from the error of the pressure response.

The inverse of the valve jumps over the nominal dead band. Where the true one, with the backlash of
its spool, is wider, small openings let no air through at all. A pressure response that is too
small widens the band of that side, one that is too large narrows it (adaptive inverse of a dead
zone: Tao and Kokotovic 1994, IEEE Trans. Autom. Control 39, 59). Wide openings say little about
the dead band, but much about the flow: fittings and tubes reduce it, supplies sag, and a valve may
exhaust less than it fills. Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

#: Uncertainty of a dead band: share of itself, plus share of the full command.
DOUBT_SHARE, DOUBT = 0.5, 0.02
#: Relative uncertainty of a conductance.
CONDUCTANCE_DOUBT = 0.3
#: Limit of the learnt flow's error, in `CONDUCTANCE_DOUBT`.
_BOUND = 2.0
#: s: time constant of the adaptation, in opening time of a side; at first the mean is taken.
_LEARN_TIME = 0.1
#: Filter time of the signals, in lags of the loop.
_FILTER_LAGS = 2.0
#: Error of a rate behind this filter due to a lag error of a tenth, relative.
_LAG_SHARE = 0.1 / _FILTER_LAGS


@dataclass
class ValveLearningState:
    """
    Learnt deviations of a valve from its nominal data.

    Attributes
    ----------
    fill, vent : float
        Excess of the dead band of each side over the nominal one, in commands.
    reading, due : float, Pa
        In the tick before: reading, and the reading expected from the commands.
    open, seen : float, s
        Duration of openings to fill minus to exhaust, weighted by `band_weight`: up to now, and
        up to the last command that the reading before showed.
    missing, came, share : float, Pa/s, Pa/s and 1
        Filtered: missing rate, rate of the reading, and share of time with openings to fill minus
        to exhaust.
    fill_time, vent_time : float, s
        Time for which each side has learnt.
    wide : float
        Largest recent opening, decaying with the lag of the spool.
    fill_flow, vent_flow : float
        Flow over the nominal flow.
    flow, flow_seen, flow_share : float, s, s and 1
        As ``open``, ``seen`` and ``share``, with the weight `flow_weight`.
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
    """Return the uncertainty of a valve's dead band, in commands."""
    return DOUBT_SHARE * dead_band + DOUBT


def band_weight(wide: float, doubt: float) -> float:
    """
    Return the share of a missing rate that is attributed to the dead band, 0 to 1.

    Independent errors share by their variances: the uncertainty ``doubt`` of the dead band, and
    that of the conductance times the opening ``wide``.

    Examples
    --------
    >>> band_weight(0.0, 0.04), round(band_weight(0.4, 0.04), 2)
    (1.0, 0.1)
    """
    other = CONDUCTANCE_DOUBT * wide / doubt
    return 1.0 / (1.0 + other * other)


def flow_weight(opening: float, wide: float, doubt: float) -> float:
    """
    Return the share of a missing rate that is attributed to the flow, per opening.

    The remainder of `band_weight`, where ``opening`` equals ``wide``.

    Examples
    --------
    >>> round(band_weight(0.4, 0.04) + 0.4 * flow_weight(0.4, 0.4, 0.04), 3)
    1.0
    """
    other = CONDUCTANCE_DOUBT / doubt
    return other * other * opening * band_weight(wide, doubt)


def learn_dead_band(valve: Any, most: float, pressure: float, due: float, open_then: float,
                    slow: float, filling: float, venting: float, lag: float, dt: float) -> float:
    """
    Learn from one reading; return the part of the integral that is no longer needed, Pa/s.

    A corrected dead band supplies the missing rate that the integral has compensated until now.

    Parameters
    ----------
    valve : ValveLearningState
    most : float
        Largest error of the nominal dead band, in commands.
    pressure, due : float, Pa
        Reading, and the sum of all changes that it should show by the commands.
    open_then : float, s
        `ValveLearningState.open` at the time of the last command that the reading can show.
    slow : float, Pa/s
        Rate that the loop's integral adds.
    filling, venting : float, Pa/s
        Pressure rates with the valve fully open to either side, both above 0.
    lag : float, s
        From command to reading.
    dt : float, s
    """
    # All with the same filter: noise that opens the valve a little has gone by the next reading,
    # which looks like a response of the pressure.
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
    # A wide opening may show earlier than expected: limit the weight from then on.
    known = band_weight(valve.wide, most)
    step = dt / over * min(max(valve.share, -known), known) * valve.missing
    if fills and filling > 0.0:
        before, valve.fill_time = valve.fill, learnt
        valve.fill = min(max(before + step / filling, -most), most)
        return compensated_share(valve, slow) * (valve.fill - before) * filling
    if valve.share < 0.0 and venting > 0.0:
        before, valve.vent_time = valve.vent, learnt
        valve.vent = min(max(before + step / venting, -most), most)
        return compensated_share(valve, slow) * (before - valve.vent) * venting
    return 0.0


def learn_flow(valve: Any, flow_then: float, slow: float, filling: float, venting: float,
               lag: float, dt: float) -> float:
    """
    Learn the flow from the reading that `learn_dead_band` has processed; return the same.

    Parameters
    ----------
    flow_then : float, s
        `ValveLearningState.flow` at the time of the last command that the reading can show.
    valve, slow, filling, venting, lag, dt
        As there; ``filling`` and ``venting`` with the learnt flow.
    """
    time = _FILTER_LAGS * lag
    kept = math.exp(-dt / time)
    valve.flow_share = kept * valve.flow_share + (1.0 - kept) * (flow_then - valve.flow_seen) / dt
    valve.flow_seen = flow_then
    fills = valve.flow_share > 0.0
    full, share = (filling, valve.flow_share) if fills else (venting, valve.flow_share)
    # Rate expected from the opening.
    meant = valve.missing + valve.came
    if full <= 0.0 or meant * share <= 0.0:
        return 0.0
    flow, most = valve.fill_flow if fills else valve.vent_flow, _BOUND * CONDUCTANCE_DOUBT
    # An error beyond the uncertainty of any valve is a fault, or due to the lag.
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
    return compensated_share(valve, slow) * (flow - new) / flow * meant


def compensated_share(valve: Any, slow: float) -> float:
    """
    Return the share of the missing rate that the integral (Pa/s) has compensated, 0 to 1.

    At most the rate of the reading: a pressure that does not respond may be a fault.
    """
    if valve.missing == 0.0:
        return 0.0
    return min(max(min(slow / valve.missing, valve.came / valve.missing), 0.0), 1.0)


def begin_readings(valve: Any, pressure: float) -> None:
    """Start from a reading (Pa), and keep what was learnt before."""
    valve.reading, valve.due, valve.open, valve.seen = pressure, 0.0, 0.0, 0.0
    valve.missing = valve.came = valve.share = 0.0
    valve.flow = valve.flow_seen = valve.flow_share = 0.0


def command_of(valve: Any, dead_band: float, opening: float, most: float) -> float:
    """
    Return the valve command for an opening, with the learnt dead band.

    Parameters
    ----------
    valve : ValveLearningState
    dead_band : float
        Nominal dead band, in commands.
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
