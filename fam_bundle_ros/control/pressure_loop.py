# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pressure loop of one motor unit as step functions on records.

Blocks: followed setpoint -> error beyond noise (dead zone) -> PID and feed-forward -> inverse of
chamber and valve -> anti-windup. Kernels (`fam_bundle_ros.kernels`): plain Python or compiled.
`pid` has the settings with their meaning, and the loop as an object.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.valve_learning import (
    band_weight,
    begin_readings,
    command_of,
    dead_band_doubt,
    flow_weight,
    learn_dead_band,
    learn_flow,
    ValveLearningState,
)
from fam_bundle_ros.model.pneumatics import (
    flow_for,
    pressure_rate,
    valve_command,
    valve_flow,
    valve_opening,
    ValveFlow,
)

#: Named as control_toolbox names them.
ANTI_WINDUP = ('none', 'back_calculation', 'conditional_integration')
_NONE, _BACK_CALCULATION = 0, 1
#: s: decay time of the command that is taken over on start (bumpless transfer).
_CARRY_TIME = 0.01
#: Pa: with a setpoint of 0, a followed setpoint below this counts as 0.
_EMPTY = 1e3
#: Uncertainty of the lag from command to reading: share of it, and share of a sample.
_LAG_DOUBT, _SAMPLE_DOUBT = 0.1, 0.5
#: Length of the ring buffers over the lag from command to reading.
_PLACES = 64
#: s: averaging time for the persistence of the muscle's motion.
_MOTION_TIME = 0.5
#: Decay time of the effect of a wide opening, in lags from command to reading.
_GONE = 3.0
#: Limit of the integral, for leaks and slow errors, as a share of the valve's rate. An error that
#: needs more is a fault, which the integral must not compensate.
_SLOW_SHARE = 0.05


@dataclass
class PidDiagnostics:
    """
    Diagnostics of the last update: Pa, Pa/s, -1..1.

    ``expected_rate`` is the pressure rate by the models of valve and chamber.
    """

    error: float = 0.0
    followed_setpoint: float = 0.0
    wanted_rate: float = 0.0
    expected_rate: float = 0.0
    integral: float = 0.0
    command: float = 0.0
    saturated: bool = False
    at_rest: bool = True


@dataclass
class PidSettings:
    """Gains and settings of a pressure loop as its kernels take them: see `PidConfig`."""

    p: float
    i: float
    d: float
    valve: ValveFlow
    anti_windup: int
    tracking_time: float
    volume: float
    supply: float
    ambient: float
    setpoint_rate: float
    setpoint_bandwidth: float
    flow_lag: float
    quiet_error: float
    filter_time: float
    feed_forward: bool
    dead_band_compensation: bool
    ceiling: float
    reach: float


@dataclass
class PidState:
    """
    Memory of a pressure loop.

    Attributes
    ----------
    command : float
        Last valve command.
    integral, carried : float, Pa/s
        ``carried`` is the pressure rate of a command that was taken over; it decays.
    followed : float, Pa
        Setpoint, limited to what the valve can follow.
    sent : float, Pa
        Integral of the commanded pressure rates.
    past_time, past_sent, past_open, past_flow, past_motion : list (64,), s, Pa, s, s and m^3/s
        Ring buffers of time, ``sent``, `ValveLearningState.open` and ``flow``, and volume rate
        over the lag from command to reading; ``head`` is the oldest of ``size`` entries.
    moved, alike : float, m^6/s^2
        Mean square of the volume rate; its mean product with that of half a lag before.
    coming : float, Pa
        Pressure change that was commanded and that the reading does not show yet.
    clock : float, s
    filtered, quiet : float, Pa
        Reading and error, filtered.
    measured_rate : float, Pa/s
    started : bool
        False before the first reading.
    shown : PidDiagnostics
    """

    command: float = 0.0
    integral: float = 0.0
    carried: float = 0.0
    followed: float = 0.0
    sent: float = 0.0
    coming: float = 0.0
    filtered: float = 0.0
    quiet: float = 0.0
    measured_rate: float = 0.0
    past_time: list[float] = field(default_factory=lambda: [0.0] * _PLACES)
    past_sent: list[float] = field(default_factory=lambda: [0.0] * _PLACES)
    past_open: list[float] = field(default_factory=lambda: [0.0] * _PLACES)
    past_flow: list[float] = field(default_factory=lambda: [0.0] * _PLACES)
    past_motion: list[float] = field(default_factory=lambda: [0.0] * _PLACES)
    moved: float = 0.0
    alike: float = 0.0
    head: int = 0
    size: int = 0
    clock: float = 0.0
    started: bool = False
    learnt: ValveLearningState = field(default_factory=ValveLearningState)
    shown: PidDiagnostics = field(default_factory=PidDiagnostics)


def pressure_step(settings: Any, state: Any, setpoint: float, pressure: float, dt: float,
                  supply: float, volume: float, volume_rate: float) -> float:
    """
    Return the valve command, -1 exhaust .. 0 closed .. 1 fill; see `PressurePid.update`.

    The wanted pressure rate is that of the followed setpoint plus PID on the error;
    inverting chamber and valve makes it a command (feedback linearisation: Slotine and Li,
    Applied Nonlinear Control, 1991, ch. 6).

    Parameters
    ----------
    settings, state : PidSettings, PidState
    setpoint, pressure, supply : float, Pa (gauge)
    dt : float, s
    volume, volume_rate : float, m^3 and m^3/s
    """
    # A sum is finite only when every term is.
    if not (math.isfinite(setpoint + pressure + supply + volume + volume_rate) and volume > 0.0):
        forget(state, 0.0)
        show(state, 0.0, 0.0, 0.0, False, True)
        return 0.0
    if not 0.0 < dt < math.inf:
        return state.command
    source = supply + settings.ambient
    # Predicted pressure: the reading does not show the last commands yet.
    absolute = max(pressure + (state.coming if state.started else 0.0), 0.0) + settings.ambient
    learnt = state.learnt
    ambient = settings.ambient
    filling = learnt.fill_flow * valve_flow(settings.valve, 1.0, absolute, source, ambient)
    venting = learnt.vent_flow * valve_flow(settings.valve, -1.0, absolute, source, ambient)
    # Pressure rate due to the muscle's motion, with the valve shut.
    drift = pressure_rate(absolute, volume, volume_rate, 0.0)
    fastest = pressure_rate(absolute, volume, volume_rate, filling)
    slowest = pressure_rate(absolute, volume, volume_rate, venting)
    full, widest = fastest - drift, 1.0
    if settings.reach > 0.0:
        # A command that is held for too long must not fill above the ceiling, not even where the
        # muscle stops, or its velocity is wrong: no fall of the pressure is counted on.
        rise = max(drift, 0.0)
        allowed = max((settings.ceiling + settings.ambient - absolute) / settings.reach, rise)
        # The same for a flow that was learnt below its nominal value and may recover.
        surely = full / min(learnt.fill_flow, 1.0)
        if rise + surely > allowed:
            widest = (allowed - rise) / surely
            fastest = drift + widest * full
    if not state.started:
        start(settings, state, pressure, source, volume, volume_rate)
    rate = follow(settings, state, setpoint, pressure, dt, fastest, slowest)
    lag = settings.flow_lag + dt
    open_then = past_value(state, state.past_open, state.clock - lag)
    flow_then = past_value(state, state.past_flow, state.clock - lag)
    error = error_beyond_noise(settings, state, pressure, dt)
    lasts = motion_lasts(state, volume_rate, lag, dt)
    doubt = dead_band_doubt(settings.valve.dead_band)
    compensated = learn_dead_band(learnt, doubt, pressure, state.sent - state.coming, open_then,
                                  state.integral, full, drift - slowest, lag, dt)
    compensated += learn_flow(learnt, flow_then, state.integral, full, drift - slowest, lag, dt)
    if compensated * state.integral > 0.0:
        state.integral -= math.copysign(min(abs(compensated), abs(state.integral)), compensated)
    if setpoint <= 0.0 and state.followed <= _EMPTY:
        # Keep the exhaust open: a wrong reading must not trap the air.
        state.integral = state.carried = 0.0
        state.command = -1.0
        send(state, max(slowest * dt, -max(pressure + state.coming, 0.0)), 0.0, 0.0)
        show(state, setpoint - pressure, slowest, slowest, False, False)
        return -1.0
    wanted = (settings.p * error - settings.d * state.measured_rate + state.integral
              + state.carried)
    if settings.feed_forward:
        wanted += settings.d * rate
        wanted += rate
    state.carried *= math.exp(-dt / _CARRY_TIME)
    at_rest = (error == 0.0 and abs(rate - drift) + abs(state.carried)
               < 0.2 * settings.p * settings.quiet_error)
    opening, possible = 0.0, 0.0
    if not at_rest:
        motion = volume_rate if settings.feed_forward and lasts else 0.0
        flow = flow_for(absolute, volume, motion, wanted)
        limit = filling if flow >= 0.0 else -venting
        opening = min(max(flow / max(limit, 1e-12), -1.0), widest)
        possible = min(max(wanted, slowest), fastest)
    # The integral compensates for errors of the rate model: it adds no pressure change.
    # The spool follows late: after a wide opening the reading says little about the dead band.
    learnt.wide = max(abs(opening), learnt.wide * math.exp(-dt / (_GONE * lag)))
    shown = math.copysign(dt * band_weight(learnt.wide, doubt), opening) if opening != 0.0 else 0.0
    send(state, (0.0 if at_rest else possible - state.integral) * dt, shown,
         dt * flow_weight(opening, learnt.wide, doubt))
    integrate(settings, state, error, rate, possible - wanted, dt, at_rest,
              _SLOW_SHARE * min(slowest, 0.0), _SLOW_SHARE * max(fastest, 0.0))
    state.command = opening
    if settings.dead_band_compensation:
        state.command = command_of(state.learnt, settings.valve.dead_band, opening,
                                   valve_command(settings.valve, widest))
    show(state, setpoint - pressure, wanted, possible,
         not at_rest and abs(wanted - possible) > 1e-6 * abs(wanted), at_rest)
    return state.command


def forget(state: Any, command: float) -> None:
    """Reset, and continue from a valve command (bumpless transfer)."""
    state.command = min(max(command, -1.0), 1.0)
    state.integral = state.carried = 0.0
    state.followed = state.filtered = state.quiet = 0.0
    state.measured_rate = state.clock = state.sent = state.coming = 0.0
    state.moved = state.alike = 0.0
    state.head = state.size = 0
    state.started = False


def start(settings: Any, state: Any, pressure: float, source: float, volume: float,
          volume_rate: float) -> None:
    """
    Start from the present pressure, with the rate that continues the last command.

    Parameters
    ----------
    settings, state : PidSettings, PidState
    pressure, source : float, Pa (gauge) and Pa (absolute)
        Reading, and supply.
    volume, volume_rate : float, m^3 and m^3/s
    """
    state.started = True
    state.followed = state.filtered = pressure
    state.past_time[0] = state.past_sent[0] = state.past_open[0] = state.past_flow[0] = 0.0
    state.past_motion[0] = volume_rate
    state.size = 1
    begin_readings(state.learnt, pressure)
    opening = valve_opening(settings.valve, state.command)
    if opening != 0.0:
        absolute = pressure + settings.ambient
        flow = valve_flow(settings.valve, opening, absolute, source, settings.ambient)
        state.carried = pressure_rate(absolute, volume, volume_rate, flow)


def follow(settings: Any, state: Any, setpoint: float, pressure: float, dt: float, fastest: float,
           slowest: float) -> float:
    """
    Move the followed setpoint within valve and rate limits; return its rate, Pa/s.

    First-order, x' = w (setpoint - x), limited: a reference governor for the feed-forward.

    Parameters
    ----------
    settings, state : PidSettings, PidState
    setpoint, pressure : float, Pa (gauge)
    dt : float, s
    fastest, slowest : float, Pa/s
        Pressure rates with the valve fully open to fill and to exhaust.
    """
    # At most half of the distance per sample: the filter must not ring at low rates.
    bandwidth = min(settings.setpoint_bandwidth, 0.7 / dt)
    upper = min(0.97 * max(fastest, 0.0), settings.setpoint_rate)
    lower = max(0.97 * min(slowest, 0.0), -settings.setpoint_rate)
    # Above both setpoint and reading it may fall at once: no air has to be vented for it.
    lower = min(lower, (max(setpoint, pressure) - state.followed) * bandwidth)
    rate = min(max((setpoint - state.followed) * bandwidth, lower), upper)
    state.followed += rate * dt
    return rate


def send(state: Any, change: float, shown: float, passed: float) -> None:
    """
    Record the pressure change that the command of this tick will cause.

    Parameters
    ----------
    state : PidState
    change : float, Pa
    shown, passed : float, s
        Opening times, negative to exhaust, weighted by how well the reading will show the dead
        band and the flow.
    """
    state.sent += change
    state.learnt.open += shown
    state.learnt.flow += passed
    last = (state.head + state.size - 1) % _PLACES
    state.past_time[last], state.past_sent[last] = state.clock, state.sent
    state.past_open[last], state.past_flow[last] = state.learnt.open, state.learnt.flow


def still_coming(settings: Any, state: Any, dt: float) -> tuple[float, float]:
    """
    Return lower and upper limit of the pressure change that is commanded and not yet read, Pa.

    Smith predictor of an integrator with dead time (Smith 1959, ISA J. 6, 28), with limits, since
    the dead time is only known to a tenth and half a sample.
    """
    lag = settings.flow_lag + dt
    doubt = _LAG_DOUBT * lag + _SAMPLE_DOUBT * dt
    times, head, size = state.past_time, state.head, state.size
    while size > 1 and times[(head + 1) % _PLACES] <= state.clock - lag - doubt:
        head, size = (head + 1) % _PLACES, size - 1
    state.head, state.size = head, size
    sent = state.past_sent
    state.coming = state.sent - past_value(state, sent, state.clock - lag)
    first = state.sent - past_value(state, sent, state.clock - lag - doubt)
    last = state.sent - past_value(state, sent, state.clock - lag + doubt)
    # Add an entry for this tick; at short sample times several ticks share one.
    end = head + size - 1
    near = size >= 2 and state.clock - times[(end - 1) % _PLACES] < lag / (_PLACES - 16)
    state.clock += dt
    if not near:
        new = (end + 1) % _PLACES
        times[new], state.past_sent[new] = state.clock, state.sent
        state.past_open[new], state.past_flow[new] = state.learnt.open, state.learnt.flow
        state.size += 1
    return min(first, last, state.coming), max(first, last, state.coming)


def motion_lasts(state: Any, volume_rate: float, lag: float, dt: float) -> bool:
    """
    Return whether the volume rate (m^3/s) changes so slowly that feed-forward of it helps.

    Feed-forward acts a lag (s) late. In an oscillation whose half period is shorter it would add
    energy: it is left out from a third of the period on, where the mean product of the rate with
    that of half a lag before is below half of the mean square.
    """
    state.past_motion[(state.head + state.size - 1) % _PLACES] = volume_rate
    then = past_value(state, state.past_motion, state.clock - 0.5 * lag)
    share = 1.0 - math.exp(-dt / _MOTION_TIME)
    state.alike += share * (volume_rate * then - state.alike)
    state.moved += share * (volume_rate * volume_rate - state.moved)
    return state.alike >= 0.5 * state.moved


def past_value(state: Any, values: Any, time: float) -> float:
    """Return the value of a ring buffer at a time (s), linear between samples."""
    times = state.past_time
    k, end = state.head, state.head + state.size - 1
    while k < end and times[(k + 1) % _PLACES] <= time:
        k += 1
    here, there = k % _PLACES, (k + 1) % _PLACES
    if k == end or time <= times[here]:
        return values[here]
    share = (time - times[here]) / (times[there] - times[here])
    return values[here] + share * (values[there] - values[here])


def error_beyond_noise(settings: Any, state: Any, pressure: float, dt: float) -> float:
    """Filter the reading and the error; return the error beyond the quiet band, Pa."""
    share = 1.0
    if settings.filter_time > 0.0:
        share = 1.0 - math.exp(-dt / settings.filter_time)
    change = (pressure - state.filtered) * share
    state.filtered += change
    state.measured_rate = change / dt
    low, high = still_coming(settings, state, dt)
    error = state.followed - pressure
    error = error - high if error > high else min(error - low, 0.0)
    state.quiet += (error - state.quiet) * share
    # Large errors unfiltered (no lag in the loop), small ones filtered (no noise).
    if max(abs(error), abs(state.quiet)) < 4.0 * settings.quiet_error:
        error = state.quiet
    return math.copysign(max(abs(error) - settings.quiet_error, 0.0), error)


def integrate(settings: Any, state: Any, error: float, rate: float, excess: float, dt: float,
              at_rest: bool, low: float, high: float) -> None:
    """
    Advance the integral with the anti-windup that was chosen (Astrom and Hagglund 1995, 3.5).

    Parameters
    ----------
    error, rate, excess : float, Pa and Pa/s
        Error beyond the quiet band; rate of the followed setpoint; possible minus wanted rate.
    low, high : float, Pa/s
        Limits of the integral: leaks and slow errors.
    """
    if at_rest:
        # No error at rest: discharge the integral, which would let the pressure creep.
        state.integral *= math.exp(-dt / 0.1)
        return
    if abs(rate) > 4.0 * settings.p * settings.quiet_error:
        # The integral compensates leaks and slow errors, not errors of the flow model in a step.
        return
    step = settings.i * error * dt
    if settings.anti_windup == _NONE:
        state.integral += step
        return
    feedback = settings.p * error + state.integral
    if feedback * error > 0.0 and not low <= feedback <= high:
        step = 0.0
    if settings.anti_windup == _BACK_CALCULATION:
        step += excess * dt / settings.tracking_time
    elif excess * error < 0.0:
        step = 0.0
    state.integral = min(max(state.integral + step, low), high)


def show(state: Any, error: float, wanted: float, possible: float, saturated: bool,
         at_rest: bool) -> None:
    """Write the diagnostics."""
    shown = state.shown
    shown.error, shown.followed_setpoint = error, state.followed
    shown.wanted_rate, shown.expected_rate = wanted, possible
    shown.integral, shown.command = state.integral, state.command
    shown.saturated, shown.at_rest = saturated, at_rest
