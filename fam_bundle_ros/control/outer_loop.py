# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outer loops: from a force or strain reference and the readings to the force demand.

The model gives the feed-forward, feedback corrects the remaining error; each works alone too.
Force feedback subtracts the model error that `observer` estimates, and adds a gain on the error.
Kernels; `outer` has the settings with their meaning.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.adaptation import GAUGE_SHARE
from fam_bundle_ros.control.belief import delay_of
from fam_bundle_ros.control.friction import forget_friction, FrictionState
from fam_bundle_ros.control.load_estimate import (
    forget_load,
    INERTIAS,
    LEAST_INERTIA,
    LoadEstimate,
)
from fam_bundle_ros.control.observer import (
    begin_at,
    forget_observer,
    low_pass,
    noise_gain,
    noise_of,
    NoiseState,
    observe,
    ObserverState,
    quick_of,
)
from fam_bundle_ros.control.outer import command_lag, default_force_gain, LoadModel, OuterConfig
from fam_bundle_ros.control.saturation import integrate_error
from fam_bundle_ros.control.strain_gains import (
    DAMPED,
    stiffness_grid,
    stiffnesses_between,
    unit_stiffness,
)
from fam_bundle_ros.control.strain_loop import default_strain_gains, strain_loop, usual_inertia

#: Kinds of references.
KINDS = ('force', 'strain')
FORCE, STRAIN = 0, 1
#: Default backlash of the strain loop's correction, as a share of the largest force.
_STILL = 2e-4
#: Load tables are padded to a multiple of this length, and the stiffnesses to this number (there
#: are 19 at most), so that all bundles of as many units have one type of record.
_TABLE, _STIFFNESSES = 16, 20


@dataclass
class OuterSettings:
    """`OuterConfig`, `LoadModel` and the error of the model's fit (N) as kernels take them."""

    feed_forward: bool
    feedback: bool
    delay: float
    #: s: delay of the pressure in the model; none of it is the load cell's.
    line_lag: float
    reading_share: float
    bias_time: float
    force_gain: float
    gain_error: float
    force_integral: float
    #: Stiffnesses (m,), N per strain, and the gains of the strain loop there (2, m): for the least
    #: damping ratio, and for `strain_gains.DAMPED`.
    stiffnesses: list
    strain_gain: list
    strain_integral: list
    strain_damping: list
    #: N: largest stiffness of muscles and load; the load alone is assumed to have no more.
    most_stiffness: float
    #: N s^2: inertia of an unknown load, before it is learnt.
    usual_inertia: float
    #: True where none was set by the user: they may then depend on the learnt inertia.
    worked_out: bool
    #: Stiffness of each unit at its pressure p: slope p + bend p^2, (n,).
    stiffness_slope: list
    stiffness_bend: list
    still: float
    filter_time: float
    strain_reach: float
    lead_time: float
    fade_time: float
    model_error: float
    load_known: bool
    load_force: float
    load_stiffness: float
    load_inertia: float
    load_damping: float
    load_points: int
    load_strains: list
    load_forces: list


@dataclass
class Target:
    """
    Demand to be allocated to the units.

    Attributes
    ----------
    force : float, N
        Feed-forward and correction together.
    feed_forward : float, N
        Part that is free of sensor noise.
    strain, strain_rate : float, and 1/s
        Operating point of the inverse model.
    """

    force: float = 0.0
    feed_forward: float = 0.0
    strain: float = 0.0
    strain_rate: float = 0.0


@dataclass
class OuterState:
    """
    Memory of the outer loops.

    Attributes
    ----------
    observer : ObserverState
        Estimate of the model's force error.
    friction : FrictionState
        Part of this error that depends on the direction of motion.
    load : LoadEstimate
        Estimate of an unknown load.
    late : float, N
        Force error, filtered with the lag of the loop.
    integral, kept : float, N
        Integral of the error; correction of the strain loop after its backlash.
    filtered : float, N
        Force reading, filtered.
    taken, fade : float, N
        Force on enabling; its difference from the feed-forward, which decays.
    demand : float, N
        Last force demand.
    noise : float, N
        Standard deviation of the correction due to sensor noise (strain: before the backlash).
    wanted : NoiseState
        Noise of the strain loop's correction before its backlash.
    rate, bend : float
        First and second derivative of a strain reference, 1/s and 1/s^2.
    aim : float
        Strain for which pressures are computed with a strain reference: `strain_loop.next_aim`.
    kind : int
        Kind of the last reference, -1 for none.
    lag : float, s
        Lag of the loop with its uncertainty: no correction is faster.
    behind : float, s
        Assumed delay of the force reading.
    """

    integral: float = 0.0
    kept: float = 0.0
    late: float = 0.0
    filtered: float = 0.0
    taken: float = 0.0
    fade: float = 0.0
    demand: float = 0.0
    noise: float = 0.0
    rate: float = 0.0
    bend: float = 0.0
    aim: float = 0.0
    lag: float = 0.0
    behind: float = 0.0
    kind: int = -1
    started: bool = False
    taking_over: bool = False
    observer: ObserverState = field(default_factory=ObserverState)
    friction: FrictionState = field(default_factory=FrictionState)
    load: LoadEstimate = field(default_factory=LoadEstimate)
    target: Target = field(default_factory=Target)
    wanted: NoiseState = field(default_factory=NoiseState)

    @property
    def bias(self) -> float:
        """Estimated error of the model: measured minus model force beyond noise, N."""
        return self.observer.bias


def outer_settings(config: OuterConfig, load: LoadModel, bundle: Any) -> OuterSettings:
    """Return the record that `outer_step` takes."""
    slope, bend = unit_stiffness(bundle)
    own, usual = stiffness_grid(bundle, load.stiffness), usual_inertia(bundle)
    least, most = own[0], own[-1]
    # Gains depend on stiffness over inertia: an unknown load may be heavier or lighter than usual.
    stiffnesses = [*stiffnesses_between(least / INERTIAS, least, usual), *own,
                   *stiffnesses_between(most, most / LEAST_INERTIA, usual)]
    stiffnesses += [stiffnesses[-1]] * (_STIFFNESSES - len(stiffnesses))
    low, high = (least, most) if load.known else (0.0, math.inf)
    found = [[default_strain_gains(config, load, min(max(each, low), high), usual, ratio)
              for each in stiffnesses] for ratio in (0.0, 0.0 if load.known else DAMPED)]
    bias_time = math.nan if config.bias_time is None else config.bias_time
    gain = config.force_gain
    gain = default_force_gain(config.gain_error) if gain is None else gain
    strains, forces = map(list, zip(*load.table)) if load.table else ([], [])
    spare = [0.0] * (_TABLE - len(strains) % _TABLE)
    given = (config.strain_gain, config.strain_integral, config.strain_damping)
    return OuterSettings(**{
        **vars(config), 'worked_out': given == (None, None, None), 'bias_time': bias_time,
        'force_gain': gain, 'line_lag': delay_of(bundle),
        'still': _STILL * bundle.largest_force if config.still is None else config.still,
        'stiffnesses': stiffnesses, 'most_stiffness': most, 'usual_inertia': usual,
        'strain_gain': [[each.gain for each in row] for row in found],
        'strain_integral': [[each.integral for each in row] for row in found],
        'strain_damping': [[each.damping for each in row] for row in found],
        'stiffness_slope': slope.tolist(), 'stiffness_bend': bend.tolist(),
        'model_error': bundle.error,
        'load_known': load.known, 'load_force': load.force, 'load_stiffness': load.stiffness,
        'load_inertia': load.inertia, 'load_damping': load.damping, 'load_points': len(strains),
        'load_strains': strains + spare, 'load_forces': forces + spare})


def forget_outer(state: Any) -> None:
    """Reset estimates, integrals and filters."""
    forget_observer(state.observer)
    forget_friction(state.friction)
    forget_load(state.load)
    state.late = state.integral = state.kept = state.filtered = 0.0
    state.taken = state.fade = state.demand = 0.0
    state.noise = 0.0
    state.wanted.seen = 0
    state.rate = state.bend = state.lag = state.behind = 0.0
    state.kind = -1
    state.started = state.taking_over = False


def uncertainties(settings: Any, state: Any) -> tuple[float, float]:
    """
    Return the uncertainty of the demand, N, and how much larger it is in the state below.

    They set the margins of the state machine. Three standard deviations of the noise, a tenth of
    the bias, which was learnt at other pressures than those at which a unit is switched, and the
    error of the model's fit, which feedback corrects in the present state. A correction that
    changes adds no uncertainty: it follows an observed error.
    """
    seen = 3.0 * state.noise + 0.1 * abs(state.observer.bias) + 0.1
    if settings.feedback:
        return seen, settings.model_error
    return seen + settings.model_error, 0.0


def outer_step(settings: Any, state: Any, measurement: Any, believed: float, asked: float,
               reach: float, kind: int, value: float, rate: float, saturated: int, lag: float,
               lag_doubt: float, lead: float, dt: float) -> None:
    """
    Compute the demand of this tick: `OuterState.target`.

    Parameters
    ----------
    settings, state : OuterSettings, OuterState
    measurement : record with force (N), strain, strain_rate (1/s)
    believed, asked : float, N
        Model force at the measured strain, at the measured and at the last commanded pressures.
    reach : float, N
        Largest lasting difference of the two while valves and pressure loops work.
    kind, value, rate : int, float, float
        Reference: `FORCE` (N, N/s) or `STRAIN` (1, 1/s).
    saturated : int
        Saturation of the last command: integrals stop in that direction.
    lag, lag_doubt : float, s
        Learnt lag of the measured force behind the model force, and its standard deviation.
    lead : float, s
        Time beyond this lag by which a moving reference must be advanced.
    dt : float, s
    """
    force = measurement.force
    share = low_pass(dt, settings.filter_time) if state.started else 1.0
    state.started = True
    state.filtered += share * (force - state.filtered)
    # The observer must not be faster than the loop that it corrects. The lag and its uncertainty
    # add as independent errors.
    slowest = state.lag = math.hypot(command_lag(settings, dt) + dt + lag, lag_doubt)
    state.behind = settings.reading_share * settings.delay + GAUGE_SHARE * (
        lag + lead - settings.line_lag)
    taking_over, state.taking_over = state.taking_over, False
    if settings.feedback and taking_over:
        begin_at(state.observer, force - believed)
    elif settings.feedback:
        time = slowest if math.isnan(settings.bias_time) else settings.bias_time
        observe(state.observer, force, believed, asked, reach, time, dt)
    switched = kind != state.kind
    if switched:
        state.kind, state.rate, state.bend, state.integral = kind, rate, 0.0, 0.0
        if taking_over and kind == STRAIN:
            # The integral corrects the error of the model there, not the observer.
            state.integral = -state.observer.bias
        state.friction.heading, state.friction.reckoned = 0, quick_of(state.observer)
        state.aim = measurement.strain
        forget_load(state.load)
    target = state.target
    target.strain, target.strain_rate = measurement.strain, measurement.strain_rate
    if kind == FORCE:
        # Pressures always lag a moving reference: widen the allowed difference by that.
        coming = force_in_transit(asked - believed, reach + abs(rate) * slowest)
        before = command_lag(settings, dt) + lag + lead - state.behind
        known, correction = force_loop(settings, state, force, value, rate, saturated, before,
                                       slowest, coming, dt)
    else:
        known, correction = strain_loop(settings, state, measurement, value, rate, saturated,
                                        state.demand - asked, dt)
    held = state.demand
    if taking_over:
        held = state.taken - state.observer.bias
        state.fade = state.taken - known
    unknown = kind == STRAIN and settings.feedback and not settings.load_known
    if switched and unknown or taking_over and not settings.feed_forward:
        # The present force holds the load: the integral starts from it.
        state.fade = 0.0
        state.integral += held - known - correction
        state.kept = correction = held - known
    state.fade *= math.exp(-dt / settings.fade_time)
    target.feed_forward = known + state.fade
    target.force = state.demand = known + state.fade + correction


def force_in_transit(missing: float, reach: float) -> float:
    """Return the force (N) that pressures in transit will add: ``missing`` beyond ``reach``."""
    return math.copysign(max(abs(missing) - reach, 0.0), missing)


def force_loop(settings: Any, state: Any, force: float, value: float, rate: float, saturated: int,
               before: float, slowest: float, coming: float, dt: float) -> tuple[float, float]:
    """
    Return feed-forward and correction of the force loop, N.

    Parameters
    ----------
    force, value, rate : float, N, N and N/s
        Reading; reference and its rate.
    saturated : int
        Saturation of the last command.
    before, slowest : float, s
        Time by which the reference must be advanced; lag of the loop with its uncertainty.
    coming : float, N
        Force that pressures in transit will add, see `force_in_transit`.
    dt : float, s
    """
    known, correction = 0.0, 0.0
    if settings.feed_forward:
        known = value + before * rate
    if settings.feedback and settings.feed_forward:
        # Compare the delayed reading with the reference at its time.
        due = value - state.behind * rate
        share = low_pass(dt, slowest)
        # Do not correct what pressures in transit will add.
        error = due - force
        if error * coming > 0.0:
            error = math.copysign(max(abs(error) - abs(coming), 0.0), error)
        state.late += share * (error - state.late)
        correction = settings.force_gain * state.observer.weight * state.late
        correction -= state.observer.bias
        gain = (1.0 + settings.force_gain) * state.observer.weight
        noise = noise_of(state.observer) * noise_gain(share)
        # The bias beyond its steady part may be noise of the fastest observer.
        moving = abs(state.observer.bias - state.observer.steady)
        state.noise = max(gain * noise, min(moving / 3.0, noise))
    elif settings.feedback:
        error = value - state.filtered
        correction = settings.force_gain * error
        state.noise = settings.force_gain * noise_of(state.observer) * noise_gain(
            low_pass(dt, settings.filter_time))
        integrate_error(state, settings.force_integral * error * dt, saturated)
        known = state.integral
    return known, correction
