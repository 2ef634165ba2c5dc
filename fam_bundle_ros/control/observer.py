# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Observer of the model's force error: measured minus model force.

A disturbance observer (Ohnishi, Shibata and Murakami 1996) on five time scales. The fastest is as
fast as the lag of the loop allows, the slow one averages over half a second. They are averaged by
how well each has predicted the error recently (dynamic model averaging: Raftery, Karny and Ettler
2010, Technometrics 52, 52), with a prior in favour of the slow one. This average is moved towards
the fastest observer by the part of their difference that exceeds noise (shrinkage: Gao 1998,
J. Comput. Graph. Stat. 7, 469); the noise threshold falls with the fastest observer's Wiener
weight (signal over signal and noise). So a model without error gets no noise into its pressures,
a constant error gets a constant correction, and a varying error is followed as fast as it varies.
The model force is that at the *measured* pressures, so that a demand out of reach does not wind up
the observer. Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

#: s: time constants of the slow observer, and of the estimates of noise and power.
PATIENT_TIME, _LEARN_TIME = 0.5, 1.0
#: Time constant of the integral of the missing pressure force, in lags of the loop.
_SHORT = 10.0
#: Averaging time of the slow observer's power, in its time constants.
_LONG = 5.0
#: Threshold of signal power over noise power: within a second, some 10 independent values, the
#: power of noise alone stays below.
_CLEAR = 4.0
#: Shrinkage threshold in variances of the faster observer, where the error has not been seen to
#: vary: three standard deviations.
_SURELY = 9.0
#: Share of the present square that counts as power: above the threshold from four standard
#: deviations on.
_AT_ONCE = _CLEAR / 16.0
#: Number of faster observers; their time constants are a geometric series to the fastest.
_BANK = 4
#: s: forgetting time of their log odds; longer errors are found by the slow observer as well.
_FADES = 0.5 * PATIENT_TIME
#: Prior log odds against each: one false lead in a thousand, shared by all of them.
_ODDS = math.log(1000.0 * _BANK)
#: N: a change of this size may be noise, whatever the estimate.
_USUAL = 0.1
#: Differences beyond this multiple of the mean size of the second differences are outliers: of
#: normal noise one second difference in 700, and one first difference in 30 million.
_OUTLIER = 4.0


@dataclass
class ObserverState:
    """
    Memory of `observe`.

    Attributes
    ----------
    bias : float, N
        Estimated model error, to be corrected.
    weight : float
        0 to 1: Wiener weight of the fastest observer's difference from ``steady``.
    sure : float
        0 to 1: Wiener weight of the slow observer.
    patient, steady : float, N
        Slow observer: filtered error; ``patient`` times ``sure``.
    asked, short : float, N
        Model force at the commanded pressures, with the lag of the loop; integral of the part that
        is missing at the measured pressures (a sticking valve).
    slow : float, N
        Model force at the measured pressures, filtered with the time constant of ``short``.
    short_power : float, N^2
        Mean square of ``short``.
    power, patient_power : float, N^2
        Mean square of the fastest observer's difference from ``steady``, and of ``patient``.
    last, before : float, N
        Error one and two ticks ago.
    change : float, N
        Mean size of the error's second differences; ``seen``: number of samples.
    bank : list (4,), N
        Faster observers, the fastest last.
    lead : list (4,)
        Log odds of each against ``steady``, from recent predictions.
    """

    bias: float = 0.0
    weight: float = 0.0
    sure: float = 0.0
    patient: float = 0.0
    steady: float = 0.0
    asked: float = 0.0
    slow: float = 0.0
    short: float = 0.0
    short_power: float = 0.0
    power: float = 0.0
    patient_power: float = 0.0
    last: float = 0.0
    before: float = 0.0
    change: float = 0.0
    seen: int = 0
    bank: list[float] = field(default_factory=lambda: [0.0] * _BANK)
    lead: list[float] = field(default_factory=lambda: [0.0] * _BANK)


@dataclass
class NoiseState:
    """
    Memory of `learn_noise` and `may_be_spike` for any signal; fields as in `ObserverState`.

    ``sudden``: the last reading departed from the one before.
    """

    last: float = 0.0
    before: float = 0.0
    change: float = 0.0
    seen: int = 0
    sudden: bool = False


def forget_observer(state: Any) -> None:
    """Reset."""
    state.bias = state.weight = state.sure = state.patient = state.steady = 0.0
    state.asked = state.short = state.short_power = 0.0
    state.power = state.patient_power = state.last = state.before = state.change = 0.0
    state.seen = 0
    for k in range(_BANK):
        state.bank[k] = state.lead[k] = 0.0


def begin_at(state: Any, error: float) -> None:
    """Start from an error (N) that is taken as certain, for bumpless transfer."""
    forget_observer(state)
    state.bias = state.patient = state.steady = error
    state.patient_power = error * error
    for k in range(_BANK):
        state.bank[k] = error


def may_be_spike(state: Any, value: float, least: float) -> bool:
    """
    Return whether a reading departs from the one before, and none before it did so.

    It departs by more than noise does, and by more than ``least``. If the next one departs as
    well, it is no spike but a change, which so acts one sample late.

    Parameters
    ----------
    state : RateState, NoiseState
        Memory of the noise: `learn_noise` is to be called next. ``sudden`` is written.
    value, least : float
        In the units of the signal.
    """
    before = state.sudden
    state.sudden = state.seen >= 3 and abs(value - state.last) > _OUTLIER * state.change + least
    return state.sudden and not before


def low_pass(dt: float, time: float) -> float:
    """Return the share of a step that a first-order low-pass filter follows within dt."""
    return 1.0 - math.exp(-dt / time)


def noise_gain(share: float) -> float:
    """Return output over input sd of white noise, for a low-pass filter with `low_pass` share."""
    return math.sqrt(share / (2.0 - share))


def observe(state: Any, measured: float, believed: float, asked: float, reach: float, time: float,
            dt: float) -> None:
    """
    Advance by one sample.

    Parameters
    ----------
    state : ObserverState
    measured, believed, asked : float, N
        Measured force; model force at the measured, and at the last commanded pressures.
    reach : float, N
        Largest difference of ``asked`` and ``believed`` in normal operation. More is a transient,
        integrated slowly (by this much in 2.5 s), or, if ``believed`` rests, a unit that does not
        respond.
    time : float, s
        Time constant of the fastest observer.
    dt : float, s
    """
    error = measured - believed
    learn_noise(state, error, _USUAL, dt)
    noise = noise_of(state)
    noise *= noise
    gain, slow = low_pass(dt, time), low_pass(dt, PATIENT_TIME)
    quick_noise_square = noise * gain / (2.0 - gain)
    update_odds(state, error, noise, dt)
    update_bank(state, error, time, dt)
    state.patient += slow * (error - state.patient)
    state.patient_power += low_pass(dt, _LONG * PATIENT_TIME) * (
        state.patient * state.patient - state.patient_power)
    state.sure = beyond_noise(state.patient_power, noise * slow / (2.0 - slow))
    state.steady = state.patient * state.sure
    left = quick_of(state) - state.steady
    state.power += low_pass(dt, _LEARN_TIME) * (left * left - state.power)
    # A value beyond four standard deviations of the noise counts at once.
    power = max(state.power, _AT_ONCE * left * left)
    state.weight = beyond_noise(power, quick_noise_square)
    if state.seen == 1:
        state.asked = state.slow = believed
    state.asked += gain * (asked - state.asked)
    # Subtract what the lag alone can explain.
    missing = state.asked - believed
    late = abs(asked - state.asked)
    missing = math.copysign(max(abs(missing) - late, 0.0), missing)
    share = low_pass(dt, _SHORT * time)
    state.slow += share * (believed - state.slow)
    change = share * (missing - state.short)
    if missing * change > 0.0 and abs(missing) > reach:
        # A transient, unless it lasts: a unit that is at the limit of its supply, leaks or sticks.
        patience = _LONG * PATIENT_TIME
        lasting = abs(missing) - abs(believed - state.slow) * patience / (_SHORT * time)
        most = low_pass(dt, patience) * max(lasting, reach)
        change = min(max(change, -most), most)
    state.short += change
    state.short_power += low_pass(dt, _LEARN_TIME) * (
        state.short * state.short - state.short_power)
    # Where the model error is known to vary, the shrinkage threshold is low.
    found = shrink(average(state), quick_of(state),
                   _SURELY * (1.0 - state.weight) * quick_noise_square)
    state.bias = found - state.short * beyond_noise(state.short_power,
                                                    noise * share / (2.0 - share))


def quick_of(state: Any) -> float:
    """Return the output of the fastest observer, N."""
    return state.bank[_BANK - 1]


def update_odds(state: Any, error: float, noise: float, dt: float) -> None:
    """
    Update the log odds of each faster observer against ``steady`` with an error (N).

    Gaussian log likelihoods; ``noise`` (N^2) is the variance of the readings.
    """
    kept, missed, best = 1.0 - low_pass(dt, _FADES), error - state.steady, 0.0
    twice = 2.0 * max(noise, _USUAL * _USUAL)
    for k in range(_BANK):
        way = error - state.bank[k]
        state.lead[k] = kept * state.lead[k] + (missed * missed - way * way) / twice
        best = max(best, state.lead[k])
    # Limit the posterior odds to the inverse of the prior: the noise is not known at once.
    for k in range(_BANK):
        state.lead[k] -= max(best - 2.0 * _ODDS, 0.0)


def update_bank(state: Any, error: float, time: float, dt: float) -> None:
    """Update the faster observers with an error (N); ``time`` (s): constant of the fastest."""
    ratio = (time / PATIENT_TIME) ** (1.0 / _BANK)
    span = PATIENT_TIME
    for k in range(_BANK):
        span *= ratio
        state.bank[k] += low_pass(dt, span) * (error - state.bank[k])


def average(state: Any) -> float:
    """Return the mean of all observers, N, weighted by their posterior odds."""
    total, mean = 1.0, state.steady
    for k in range(_BANK):
        weight = math.exp(state.lead[k] - _ODDS)
        total += weight
        mean += weight * state.bank[k]
    return mean / total


def shrink(value: float, other: float, noise: float) -> float:
    """
    Return a value (N) moved towards another by the part of their difference beyond noise.

    A difference w is shrunk by the factor max(1 - noise / w^2, 0), with ``noise`` in N^2: nothing
    moves within the noise, and the result is continuous (non-negative garrote).
    """
    way = other - value
    return value + way * max(1.0 - noise / (way * way), 0.0) if way != 0.0 else value


def take_out_late(state: Any, error: float, jump: float) -> float:
    """
    Remove from the observers what the model now explains; return that share of the jump.

    The model force jumps when a direction of motion is detected (friction). Observers that have
    already compensated for this force are reduced by that part.

    Parameters
    ----------
    state : ObserverState
    error, jump : float, N
        Measured minus model force after the jump; change of the model force.
    """
    if jump == 0.0:
        return 0.0
    share = min(max(min((quick_of(state) - error) / jump, state.bias / jump), 0.0), 1.0)
    for k in range(_BANK):
        state.bank[k] -= min(max((state.bank[k] - error) / jump, 0.0), share) * jump
    return share


def shift(state: Any, error: float) -> None:
    """Shift all errors by ``error`` (N), after the model force has been lowered by as much."""
    state.patient += error
    state.steady += error
    for k in range(_BANK):
        state.bank[k] += error
    state.bias += error
    state.asked -= error
    state.last += error
    state.before += error


def beyond_noise(power: float, noise: float) -> float:
    """Return the share of a power (N^2) beyond noise of a variance (N^2): Wiener weight."""
    return max(1.0 - _CLEAR * noise / power, 0.0) if power > 0.0 else 0.0


def second_difference(state: Any, value: float) -> float:
    """Return the size of the second difference that a signal's next value makes."""
    return abs(value - 2.0 * state.last + state.before)


def learn_noise(state: Any, value: float, usual: float, dt: float) -> None:
    """
    Update the mean size of a signal's second differences, 0 for a signal of constant rate.

    A change of the size ``usual`` may be noise, whatever the estimate.
    """
    change = second_difference(state, value)
    state.before, state.last = state.last, value
    state.seen += 1
    state.change = mean_change(state.change, change, usual, state.seen, dt)


def mean_change(mean: float, change: float, usual: float, seen: int, dt: float) -> float:
    """Return the mean size of second differences, updated with sample number ``seen``."""
    if seen < 3:
        return mean
    if seen == 3:
        return change
    gain = max(low_pass(dt, _LEARN_TIME), 1.0 / (seen - 2))
    # Clip outliers: they are steps, not noise.
    return mean + gain * (min(change, _OUTLIER * mean + usual) - mean)


def quick_noise(state: Any, time: float, dt: float) -> float:
    """Return the standard deviation of noise in the fastest observer, N; ``time`` (s): its own."""
    return noise_of(state) * noise_gain(low_pass(dt, time))


def noise_of(state: Any) -> float:
    """Return the standard deviation of white noise with these second differences."""
    return noise_in(state.change)


def noise_in(change: float) -> float:
    """Return the standard deviation of white noise with second differences of this mean size."""
    return change * math.sqrt(0.5 * math.pi / 6.0)
