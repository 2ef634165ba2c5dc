# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outer loops: a force or strain reference and the readings -> the force that the model shall give.

Feed-forward says what the model knows, feedback corrects the rest; each works alone too. The bias
estimate is the slow mean of measured minus model force at the pressures that are there (a
disturbance observer: Ohnishi, Shibata and Murakami 1996): it needs no anti-windup, since a demand
out of reach does not change what it sees. Kernels; `outer` has the settings with their meaning.
"""

from dataclasses import dataclass, field
import math
from typing import Any

from fam_bundle_ros.control.outer import LoadModel, OuterConfig

#: Kinds of references.
KINDS = ('force', 'strain')
FORCE, STRAIN = 0, 1
#: What keeps integrals from going on; the names of the others are for people.
SATURATION = ('', 'high', 'low', 'gap')
FREE, HIGH, LOW, GAP = 0, 1, 2, 3
#: Damping that the strain loop adds, of critical.
_DAMPING_RATIO = 0.5
#: Inertia reckoned with where none is known, N s^2: about 2.5 kg on a muscle of 127 mm.
_USUAL_INERTIA = 0.3
#: s: filter of the acceleration of a reference; in which noise is learnt.
_BEND_TIME, _LEARN_TIME = 0.01, 1.0
_DOUBT_TIME = 5.0
#: Tables of loads are as long as a multiple of this, so that most have records of one kind.
_TABLE = 16


@dataclass
class OuterSettings:
    """`OuterConfig`, `LoadModel` and the error of the model's fit (N) as kernels take them."""

    feed_forward: bool
    feedback: bool
    bias_time: float
    delay: float
    x1: float
    x2: float
    x3: float
    x4: float
    x5: float
    x6: float
    x7: float
    force_gain: float
    force_integral: float
    strain_gain: float
    strain_integral: float
    strain_damping: float
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
    What is to be allocated.

    Attributes
    ----------
    force : float, N
        Reference, feedback and bias together.
    feed_forward : float, N
        The part that is free of noise.
    strain, strain_rate : float, and 1/s
        For which the pressures are to be worked out.
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
    bias : float, N
        Measured minus model force, slowly.
    integral, kept : float, N
        Of the error; correction of the strain loop behind its play.
    filtered : float, N
        Force reading.
    taken, fade : float, N
        Force that was there on enabling; what of it is left in the demand.
    demand : float, N
    mean, variance : float, N and N^2
        Of the correction, over about a second.
    wanted, jitter : float, N and N^2
        Correction of the strain loop in the tick before; variance of its changes.
    rate, bend : float
        Of a strain reference, 1/s and 1/s^2.
    kind : int
        Of the reference before, -1 for none.
    """

    bias: float = 0.0
    slow: float = 0.0
    quick: float = 0.0
    patient: float = 0.0
    slow_power: float = 0.0
    power: float = 0.0
    weight: float = 0.0
    doubt: float = 0.0
    before: float = 0.0
    before2: float = 0.0
    spread: float = 0.0
    noise: float = 0.0
    seen: int = 0
    held: float = 0.0
    late: float = 0.0
    lead: float = 0.0
    measured: float = 0.0
    integral: float = 0.0
    kept: float = 0.0
    filtered: float = 0.0
    taken: float = 0.0
    fade: float = 0.0
    demand: float = 0.0
    mean: float = 0.0
    variance: float = 0.0
    wanted: float = 0.0
    jitter: float = 0.0
    rate: float = 0.0
    bend: float = 0.0
    kind: int = -1
    started: bool = False
    taking_over: bool = False
    target: Target = field(default_factory=Target)


def outer_settings(config: OuterConfig, load: LoadModel, bundle: Any) -> OuterSettings:
    """Return the record that `outer_step` takes."""
    damping = config.strain_damping
    if damping is None:
        inertia = load.inertia or _USUAL_INERTIA
        damping = 2.0 * _DAMPING_RATIO * math.sqrt(_stiffness(bundle) * inertia)
    strains, forces = map(list, zip(*load.table)) if load.table else ([], [])
    spare = [0.0] * (-len(strains) % _TABLE if strains else _TABLE)
    return OuterSettings(**{
        **vars(config), 'bias_time': math.nan if config.bias_time is None else config.bias_time, 'strain_damping': damping, 'model_error': bundle.error,
        'load_known': load.known, 'load_force': load.force, 'load_stiffness': load.stiffness,
        'load_inertia': load.inertia, 'load_damping': load.damping, 'load_points': len(strains),
        'load_strains': strains + spare, 'load_forces': forces + spare})


def _stiffness(bundle):
    """Return -dF/de in N, all units at half of their largest pressure, at a middling strain."""
    half = 0.5 * bundle.max_pressure
    return max(float(bundle.force(0.09, half) - bundle.force(0.11, half)) / 0.02, 0.0)


def forget_outer(state: Any) -> None:
    """Forget what was learnt."""
    state.bias = state.integral = state.kept = state.filtered = 0.0
    state.taken = state.fade = state.demand = 0.0
    state.mean = state.variance = state.wanted = state.jitter = 0.0
    state.rate = state.bend = 0.0
    state.kind = -1
    state.started = state.taking_over = False


def uncertainty(settings: Any, state: Any) -> float:
    """
    Return how far off the demand may be, N: the margins of the state machine.

    Three standard deviations of the correction, the error of the model's fit, and a tenth of
    the bias: it was learnt at other pressures than those at which a unit is switched.
    """
    return 3.0 * math.sqrt(state.variance) + settings.model_error + 0.1 * abs(state.bias) + 0.1


def low_pass(dt: float, time: float) -> float:
    """Return the share of a step that a first-order lag takes up within dt."""
    return 1.0 - math.exp(-dt / time)


def outer_step(settings: Any, state: Any, measurement: Any, believed: float, kind: int,
               value: float, rate: float, settled: bool, saturated: int, lag: float,
               lag_doubt: float, dt: float) -> None:
    """
    Work out what is to be allocated in this tick: `OuterState.target`.

    Parameters
    ----------
    settings, state : OuterSettings, OuterState
    measurement : record with force (N), strain, strain_rate (1/s)
    believed : float, N
        Force of the model at the measured strain and pressures.
    kind, value, rate : int, float, float
        Reference: `FORCE` (N, N/s) or `STRAIN` (1, 1/s).
    settled : bool
        No unit is being crossed: the bias may learn.
    saturated : int
        Of the last command: integrals stop in that direction.
    dt : float, s
    """
    force = measurement.force
    share = low_pass(dt, settings.filter_time) if state.started else 1.0
    state.started = True
    state.filtered += share * (force - state.filtered)
    state.measured = force
    if settings.feedback and settled:
        observe(settings, state, force - believed, lag + lag_doubt, dt)
    switched = kind != state.kind
    if switched:
        state.kind, state.rate, state.bend, state.integral = kind, rate, 0.0, 0.0
    target = state.target
    target.strain = measurement.strain
    target.strain_rate = measurement.strain_rate
    if kind == FORCE:
        known, correction = force_loop(settings, state, value, rate, saturated, lag, lag_doubt, dt)
    else:
        known, correction = strain_loop(settings, state, measurement, value, rate, saturated, dt)
    held = state.demand
    if state.taking_over:
        state.taking_over = False
        if settings.feedback:
            state.bias = force - believed
            correction -= state.bias
        held = state.taken - state.bias
        state.fade = state.taken - known
    if switched and kind == STRAIN and settings.feedback and not settings.load_known:
        # Only the force that is there says what holds the load: the integral goes on from it.
        state.fade = 0.0
        state.integral += held - known - correction
        state.kept = correction = held - known
        state.mean = correction
    learn_correction(state, correction, dt)
    state.fade *= math.exp(-dt / settings.fade_time)
    target.feed_forward = known + state.fade
    target.force = state.demand = known + state.fade + correction


def observe(settings: Any, state: Any, error: float, lag: float, dt: float) -> None:
    time = settings.bias_time
    if math.isnan(time):
        time = settings.x2 * (settings.delay + settings.x1 + dt + lag)
    learn_noise(state, error, dt)
    gain, slow = low_pass(dt, time), low_pass(dt, settings.x4)
    if state.seen == 1:
        state.quick = state.patient = 0.0
    state.quick += gain * (error - state.quick)
    state.patient += slow * (error - state.patient)
    noise = state.noise * state.noise
    state.slow_power += low_pass(dt, 5.0 * settings.x4) * (state.patient * state.patient - state.slow_power)
    kept = weight(state.slow_power, settings.x5 * noise * slow / (2.0 - slow)) * state.patient
    rest = state.quick - kept
    state.power += low_pass(dt, _LEARN_TIME) * (rest * rest - state.power)
    state.weight = weight(state.power, settings.x5 * noise * gain / (2.0 - gain))
    state.bias = kept + state.weight * rest
    state.doubt += low_pass(dt, 5.0 * settings.x4) * (state.bias * state.bias - state.doubt)


def weight(power: float, noise: float) -> float:
    """Wiener."""
    return max(1.0 - noise / power, 0.0) if power > 0.0 else 0.0


def learn_noise(state: Any, error: float, dt: float) -> None:
    change = abs(error - 2.0 * state.before + state.before2)
    state.before2, state.before = state.before, error
    state.seen += 1
    if state.seen < 4:
        state.spread = 0.0 if state.seen < 3 else change
    else:
        state.spread += max(low_pass(dt, _LEARN_TIME), 1.0 / state.seen) * (
            min(change, 4.0 * state.spread + 0.1) - state.spread)
    state.noise = state.spread * math.sqrt(0.5 * math.pi / 6.0)


def observer_time(lag: float, error: float) -> float:
    """Tq for gain margin 2.5 with a loop error * exp(-s lag)/(1 + s Tq)."""
    x = math.sqrt((2.5 * error) ** 2 - 1.0)
    return x * lag / (math.pi - math.atan(x))


def force_loop(settings: Any, state: Any, value: float, rate: float, saturated: int, lag: float,
               lag_doubt: float, dt: float) -> tuple[float, float]:
    """Return feed-forward and correction of the force loop, N."""
    known = value + (settings.lead_time + lag + state.lead) * rate if settings.feed_forward else 0.0
    correction = 0.0
    if settings.feedback:
        if settings.feed_forward:
            due = value - settings.delay * rate
            share = low_pass(dt, settings.delay + settings.x1 + dt + lag + lag_doubt)
            state.late += share * (due - state.measured - state.late)
            correction = settings.force_gain * state.weight * state.late - state.bias
            if state.weight > 0.0 and saturated == FREE:
                noise = 2.0 * settings.x3 ** 2 * 1.0 / dt
                p = 4e-4
                state.lead += state.weight * p * rate / (noise + p * rate * rate) * (due - state.measured)
                state.lead = min(max(state.lead, -0.02), 0.05)
        else:
            error = value - state.filtered
            correction = settings.force_gain * error
            integrate_error(state, settings.force_integral * error * dt, saturated)
            known = state.integral
    return known, correction


def strain_loop(settings: Any, state: Any, measurement: Any, value: float, rate: float,
                saturated: int, dt: float) -> tuple[float, float]:
    """
    Return feed-forward and correction of the strain loop, N; say where to invert the model.

    The load's inverse dynamics plus PID on the strain (computed torque: Siciliano et al. 2009,
    Robotics, ch. 8); the correction changes only by more than its noise.
    """
    known, correction = 0.0, 0.0
    strain, target = measurement.strain, state.target
    if settings.feed_forward:
        ahead = value + settings.lead_time * rate
        state.bend += low_pass(dt, _BEND_TIME) * ((rate - state.rate) / dt - state.bend)
        state.rate = rate
        known = (holding_force(settings, ahead) + settings.load_damping * rate
                 + settings.load_inertia * state.bend)
        reach = settings.strain_reach
        target.strain = min(max(ahead, strain - reach), strain + reach)
        target.strain_rate = rate
    if settings.feedback:
        error = value - strain
        integrate_error(state, settings.strain_integral * error * dt, saturated)
        wanted = (state.integral + settings.strain_gain * error
                  + settings.strain_damping * (rate - measurement.strain_rate) - state.bias)
        still = quiet_band(settings, state, wanted, dt)
        state.kept = min(max(state.kept, wanted - still), wanted + still)
        correction = state.kept
    return known, correction


def holding_force(settings: Any, strain: float) -> float:
    """Return the force that holds the load at a strain, N; linear between points of its table."""
    strains, forces, last = settings.load_strains, settings.load_forces, settings.load_points - 1
    if last < 0:
        return settings.load_force + settings.load_stiffness * strain
    if strain <= strains[0]:
        return forces[0]
    for k in range(1, last + 1):
        if strain < strains[k]:
            slope = (forces[k] - forces[k - 1]) / (strains[k] - strains[k - 1])
            return slope * (strain - strains[k - 1]) + forces[k - 1]
    return forces[last]


def quiet_band(settings: Any, state: Any, wanted: float, dt: float) -> float:
    """Return two standard deviations of what changes from tick to tick, within limits, N."""
    change = wanted - state.wanted
    state.jitter += low_pass(dt, _LEARN_TIME) * (0.5 * change * change - state.jitter)
    state.wanted = wanted
    return min(max(2.0 * math.sqrt(state.jitter), settings.still), 3.0 * settings.still)


def integrate_error(state: Any, step: float, saturated: int) -> None:
    """Integrate unless that would push further into a limit (conditional integration)."""
    if not ((saturated == HIGH and step > 0.0) or (saturated == LOW and step < 0.0)):
        state.integral += step


def learn_correction(state: Any, correction: float, dt: float) -> None:
    """Follow mean and variance of the correction over about a second (exponential weights)."""
    gain = low_pass(dt, _LEARN_TIME)
    difference = correction - state.mean
    state.mean += gain * difference
    state.variance = (1.0 - gain) * (state.variance + gain * difference * difference)
