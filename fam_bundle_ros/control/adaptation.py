# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Online adaptation of the model.

A gain for each unit's tension, one for the push-back, a bias, and the lag of the force, by
recursive least squares on measured minus model force: a Kalman filter whose noise is estimated
from the residual (Mehra 1970, IEEE Trans. Autom. Control 15, 175), and whose covariance returns to
the prior within minutes. It learns only from errors beyond noise (dead zone: Peterson and Narendra
1982, IEEE Trans. Autom. Control 27, 1161): a correct model is not changed, and without excitation
neither estimate nor covariance drifts. Noise of the pressure readings is in the model's forces
too, which would bias the gains towards zero: its mean effect is removed (errors in variables, bias
compensation: Soderstrom 2007, Automatica 43, 939). Kernels.
"""

from dataclasses import dataclass
import math
from typing import Any

from fam_bundle_ros.control.belief import delay_of
from fam_bundle_ros.control.observer import mean_change, noise_in
from fam_bundle_ros.errors import InputError

#: Prior sd of the errors of an unverified model: tension, push-back, and bias as a share of the
#: largest force; the last is also used for the residual that gains cannot describe.
USUAL_PULL, USUAL_PUSH, USUAL_FORCE = 0.15, 0.5, 0.02
#: s: prior sd of the lag of the measured force behind the model force (air behind a tube, sensors
#: that differ), and of the additional lag behind a moving reference.
USUAL_LAG = 0.02
#: Assumed share of the load cell in the learnt lag. Air behind a tube, hysteresis and the pressure
#: gauge cause lags as well; measurements cannot tell them apart, so all four count alike.
GAUGE_SHARE = 0.25
#: s: low-pass filter of all signals before they are compared, since their slopes are needed.
_FILTER_TIME = 0.02
#: s: time constant with which the covariance returns to the prior.
_CHANGE_TIME = 60.0
#: Time constant of the learnt lead, in lags of the loop.
_SLOWER = 10.0
#: Share of `AdaptationConfig.rest_error` that remains with feedback.
_LEFT = 0.3
#: Least residual, as a share of `AdaptationConfig.rest_error`: accuracy of force measurements.
_LEAST_REST = 0.01
#: Operating points of tension and push-back: strain, and share of the largest pressure.
_PULLING, _PUSHING = (0.08, 0.7), (0.16, 0.2)
#: Least relative sd, however narrow a fit's intervals: muscles sold as equal differ by 5 %.
_LEAST = 0.05
#: Limit of the estimates, in prior sd. Gains are limited to the same factor in both directions:
#: with a push-back near zero a rising branch would be almost flat, and a muscle as steep as its
#: model that pulls from a lower pressure on would swing across it.
_BOUND = 2.7
#: N: a change of the model's force by this size may be noise, whatever the estimate.
_USUAL_CHANGE = 0.1


@dataclass(frozen=True)
class AdaptationConfig:
    """
    Online adaptation of the model's gains.

    Parameters
    ----------
    enabled : bool
    pull_error, push_error : float, optional
        sd of the relative error of tension and push-back; from the intervals in the model file
        by default, else 15 % and 50 %.
    offset_error : float, N, optional
        sd of a constant error; 2 % of the largest force by default.
    rest_error : float, N, optional
        Upper limit of the sd of the residual that gains and offset do not describe, and its
        initial value (with feedback a third of it); 2 % of the largest force by default.
    memory : float, s
        Correlation time of this residual.
    """

    enabled: bool = True
    pull_error: float | None = None
    push_error: float | None = None
    offset_error: float | None = None
    rest_error: float | None = None
    memory: float = 1.0

    def __post_init__(self):
        """Check the ranges of the settings."""
        for name in ('pull_error', 'push_error', 'offset_error', 'rest_error', 'memory'):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f'adaptation {name} is {value}; expected more than 0')


@dataclass
class AdaptationSettings:
    """`AdaptationConfig` as kernels take it; ``spread`` (n + 3,): sd of each estimate."""

    enabled: bool
    spread: list
    rest_error: float
    memory: float
    #: Initial residual as a share of `rest_error`.
    first_share: float
    #: s: lag of the force by the model.
    lag: float


@dataclass
class AdaptationState:
    """
    Estimates and their covariance.

    Attributes
    ----------
    error : list (n + 3,)
        Relative errors of each unit's tension and of the push-back; bias in N; lag in s.
    covariance : list (n + 3, n + 3)
    regressor, product, taken : list (n + 3,)
        Work space; mean effect of reading noise on each product of regressor and error.
    force, slow : list (n,), N
        Unadapted model force of each unit at the measured pressures; the same, filtered.
    last, before, change : list (n,), N
        ``force`` one and two ticks ago; mean size of its second differences; ``seen``: number of
        samples.
    measured : float, N
        Measured force, filtered like ``slow``.
    believed : float, N
        Force of the adapted model, with the learnt lag.
    lead : float, s
        Delay of the force behind the reference, beyond that lag.
    rest, missed : float, N^2
        Mean square of the residual, and of the tracking error.
    """

    error: list
    covariance: list
    regressor: list
    product: list
    taken: list
    force: list
    slow: list
    last: list
    before: list
    change: list
    measured: float = 0.0
    believed: float = math.nan
    lead: float = 0.0
    rest: float = 0.0
    missed: float = 0.0
    seen: int = 0
    started: bool = False


def adaptation_settings(config: AdaptationConfig, bundle: Any, feedback: bool = True
                        ) -> AdaptationSettings:
    """Return the record that `adaptation_step` takes; ``feedback``: used by the force loop."""
    usual = USUAL_FORCE * bundle.largest_force
    pull, push = config.pull_error, config.push_error
    if pull is None:
        pull = _known_error(bundle, _PULLING) or USUAL_PULL
    if push is None:
        push = _known_error(bundle, _PUSHING) or USUAL_PUSH
    offset = usual if config.offset_error is None else config.offset_error
    rest = usual if config.rest_error is None else config.rest_error
    return AdaptationSettings(config.enabled, [pull] * bundle.n + [push, offset, USUAL_LAG], rest,
                              config.memory, _LEFT if feedback else 1.0, delay_of(bundle))


def _known_error(bundle, where):
    """Return the relative sd of the force at (strain, share of pressure), from the intervals."""
    strain, share = where
    pressure = share * bundle.max_pressure
    force = float(bundle.force(strain, pressure))
    variance = 0.0
    for effect in bundle.effects:
        for name, interval in effect.intervals.items():
            low, high = (float(bundle.with_parameters({f'{effect.name}.{name}': value}).force(
                strain, pressure)) for value in interval)
            # The intervals are 95 % intervals.
            variance += ((high - low) / 3.92) ** 2
    if variance == 0.0 or force == 0.0:
        return 0.0
    return max(math.sqrt(variance) / abs(force), _LEAST)


def adaptation_state(n: int) -> AdaptationState:
    """Return an empty state, to be initialised by `forget_adaptation`."""
    def zeros(count=n + 3):
        return [0.0] * count
    return AdaptationState(zeros(), [zeros() for _ in range(n + 3)], zeros(), zeros(), zeros(),
                           zeros(n), zeros(n), zeros(n), zeros(n), zeros(n))


def bounds_of(settings: Any, k: int) -> tuple[float, float]:
    """Return the smallest and the largest value of the k-th estimate."""
    bound, gains = _BOUND * settings.spread[k], len(settings.spread) - 2
    if k < gains:
        return -bound / (1.0 + bound), bound
    return (-bound, bound) if k == gains else (0.0, bound + settings.lag)


def forget_adaptation(settings: Any, state: Any) -> None:
    """Reset to the model of the file."""
    state.lead, state.started, state.seen, state.believed = 0.0, False, 0, math.nan
    state.rest = (settings.first_share * settings.rest_error) ** 2
    state.missed = (_LEFT * settings.rest_error) ** 2
    for i in range(len(state.error)):
        state.error[i] = 0.0
        for j in range(len(state.error)):
            state.covariance[i][j] = settings.spread[i] * settings.spread[i] if i == j else 0.0
    state.error[len(state.force) + 2] = settings.lag


def lagged(state: Any, force: float, dt: float) -> float:
    """Return the force of the adapted model, N, delayed by the learnt lag."""
    lag = lag_of(state)
    if math.isnan(state.believed):
        state.believed = force
    share = 1.0 - math.exp(-dt / lag) if lag > 1e-6 else 1.0
    state.believed += share * (force - state.believed)
    return state.believed


def lag_of(state: Any) -> float:
    """Return the learnt lag of the measured force behind the model force, s."""
    return state.error[len(state.force) + 2]


def lag_doubt(state: Any) -> float:
    """Return the standard deviation of the lag, s."""
    k = len(state.force) + 2
    return math.sqrt(max(state.covariance[k][k], 0.0))


def learn_lead(settings: Any, state: Any, weight: float, error: float, rate: float, lag: float,
               dt: float) -> None:
    """
    Learn the time by which a moving reference must be advanced.

    A tracking error in proportion to the rate of the reference is a delay: least squares as in
    `adaptation_step`, slow compared with the loop.

    Parameters
    ----------
    settings, state : AdaptationSettings, AdaptationState
    weight : float
        0 to 1: share of the error beyond noise.
    error, rate : float, N and N/s
        Tracking error; rate of the reference.
    lag, dt : float, s
        Lag of the loop; sample time.
    """
    if not settings.enabled:
        return
    most = _LEFT * settings.rest_error
    follow = 1.0 - math.exp(-dt / settings.memory)
    state.missed = min(state.missed + follow * (error * error - state.missed), most * most)
    if rate == 0.0:
        return
    noise, seen = 2.0 * state.missed * settings.memory / dt, (USUAL_LAG * rate) ** 2
    step = weight * min(seen / (noise + seen), dt / (_SLOWER * lag)) * error / rate
    state.lead = min(max(state.lead + step, -USUAL_LAG), _BOUND * USUAL_LAG)


def adaptation_step(settings: Any, state: Any, measured: float, dt: float,
                    weight: float = 1.0) -> None:
    """
    Learn from one sample by recursive least squares.

    K = P f / (r + f' P f), with r = 2 sigma^2 T/dt for a residual of sd sigma and correlation time
    T: the weight of one independent sample per 2 T.

    Parameters
    ----------
    settings, state : AdaptationSettings, AdaptationState
        ``state.force`` holds the model forces of this tick.
    measured : float, N
    dt : float, s
    weight : float
        0 to 1: share of the error beyond noise.
    """
    count, n = len(state.error), len(state.force)
    f, product, covariance = state.regressor, state.product, state.covariance
    share = 1.0 - math.exp(-dt / _FILTER_TIME) if state.started else 1.0
    state.started = True
    state.measured += share * (measured - state.measured)
    left = state.measured
    f[n], f[n + 1], f[n + 2] = 0.0, 1.0, 0.0
    state.seen += 1
    for i in range(n):
        bend = abs(state.force[i] - 2.0 * state.last[i] + state.before[i])
        state.before[i], state.last[i] = state.last[i], state.force[i]
        state.change[i] = mean_change(state.change[i], bend, _USUAL_CHANGE, state.seen, dt)
        change = state.force[i] - state.slow[i]
        state.slow[i] += share * change
        f[n + 2] -= (1.0 - share) * change / _FILTER_TIME
        left -= state.slow[i]
        f[i] = max(state.slow[i], 0.0)
        f[n] += min(state.slow[i], 0.0)
    for i in range(count):
        left -= f[i] * state.error[i]
    # Estimate the residual: where gains describe the whole error, they converge at once.
    most = settings.rest_error * settings.rest_error
    state.rest += (1.0 - math.exp(-dt / settings.memory)) * (left * left - state.rest)
    state.rest = min(max(state.rest, _LEAST_REST * _LEAST_REST * most), most)
    older = 1.0 - math.exp(-dt / _CHANGE_TIME)
    for i in range(count):
        product[i] = 0.0
        for j in range(count):
            known = settings.spread[i] * settings.spread[i] if i == j else 0.0
            covariance[i][j] += older * (known - covariance[i][j])
            product[i] += covariance[i][j] * f[j]
    if not weight > 0.0:
        return
    seen, known = 2.0 * state.rest * settings.memory / (weight * dt), 0.0
    for i in range(count):
        known += f[i] * product[i]
    seen += known
    noise_bias(state, share, known / seen)
    for i in range(count):
        step = product[i] * left
        for j in range(count):
            step += covariance[i][j] * state.taken[j]
        low, high = bounds_of(settings, i)
        state.error[i] = min(max(state.error[i] + step / seen, low), high)
    for i in range(count):
        for j in range(count):
            covariance[i][j] -= product[i] * product[j] / seen


def noise_bias(state: Any, share: float, follows: float) -> None:
    """
    Compute the mean effect of reading noise on each product of regressor and error: ``taken``.

    Noise of a unit's force enters its regressor, that of the lag by -(1 - s)/T of its change, and
    the error with the estimates as factors. Behind the filter, whose gain is s (``share``), its
    variance is s/(2 - s) of the readings', and the change's 2/s of that. The estimates follow
    noise that lasts longer than a sample by the share ``follows`` of the error in each sample.
    """
    n = len(state.force)
    lag, slope = state.error[n + 2], (1.0 - share) / _FILTER_TIME
    both = share + (1.0 - share) * follows
    state.taken[n] = state.taken[n + 1] = state.taken[n + 2] = 0.0
    for i in range(n):
        state.taken[i] = 0.0
        noise = noise_in(state.change[i])
        variance = noise * noise * share / (2.0 - share)
        k = i if state.slow[i] > 0.0 else n
        gain = 1.0 + state.error[k]
        state.taken[k] += variance * (gain - slope * lag) * share / both
        state.taken[n + 2] += variance * slope * (
            2.0 / share * slope * lag - gain * (1.0 + follows / both))
