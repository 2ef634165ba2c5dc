# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Observer of the force that the model leaves out: measured minus believed force.

A disturbance observer (Ohnishi, Shibata and Murakami 1996) on five time scales. The quickest is as
fast as the lag of the loop allows, the patient one averages over half a second. Each predicts the
next error, and they are averaged by how well they did of late (dynamic model averaging: Raftery,
Karny and Ettler 2010, Technometrics 52, 52), with odds against all but the patient one. What is
found goes on to the quickest as far as that differs by more than its noise (shrinkage: Gao 1998,
J. Comput. Graph. Stat. 7, 469), the more freely the more the quickest has shown beyond noise
(Wiener's weight, signal over signal and noise): a model without error gets no noise into its
pressures, one with a steady error a steady correction, and an error that moves is followed as
quickly as it moves. The believed force is that at the *measured* pressures, so that a demand out
of reach does not wind it up. Kernels.
"""

from dataclasses import dataclass, field
import math
from typing import Any

#: s: of the patient observer; in which noise and the quick observer's power are learnt.
PATIENT_TIME, _LEARN_TIME = 0.5, 1.0
#: The integral of what pressures do not give takes so many lags of the loop.
_SHORT = 10.0
#: The power of a patient observer is averaged over so many of its times.
_LONG = 5.0
#: Power must be so many times that of the noise before it counts: within a second the power of
#: noise alone, of some 10 independent values, stays below.
_CLEAR = 4.0
#: Squared differences of observers by less than so many variances of the quicker one are noise
#: where nothing has been seen to move: three standard deviations.
_SURELY = 9.0
#: Share of the present square that counts as power: above 0 from four standard deviations on.
_AT_ONCE = _CLEAR / 16.0
#: Observers quicker than the patient one, their times a geometric series to that of the quick one.
_BANK = 4
#: s: evidence for one of them fades so fast; what lasts longer the patient one finds as well.
_FADES = 0.5 * PATIENT_TIME
#: Log odds against each: one wrong lead in a thousand, shared by all of them.
_ODDS = math.log(1000.0 * _BANK)
#: N: a change of this size may be noise, whatever was seen before.
_USUAL = 0.1


@dataclass
class ObserverState:
    """
    Memory of `observe`.

    Attributes
    ----------
    bias : float, N
        What is to be corrected: patient and quick part, weighted.
    weight : float
        0 to 1: how much of the quick part is more than noise.
    sure : float
        0 to 1: how much of the patient part is more than noise.
    patient, steady : float, N
        Measured minus believed force, filtered; as far as that is more than noise.
    asked, short : float, N
        Force that was asked of the model, with the lag of the loop; what is still missing of it
        at the pressures that are there, integrated: a valve that sticks.
    short_power : float, N^2
        Mean square of it.
    power, patient_power : float, N^2
        Mean square of the quick part that the patient one leaves, and of the patient one.
    last, before : float, N
        Error in the tick before and in that before it.
    change : float, N
        Mean size of second differences of it; ``seen`` of them so far.
    bank : list (4,), N
        As ``patient``, more and more quickly from the first to the last.
    lead : list (4,)
        Log odds for each against the steady one, by what they predicted of late.
    """

    bias: float = 0.0
    weight: float = 0.0
    sure: float = 0.0
    patient: float = 0.0
    steady: float = 0.0
    asked: float = 0.0
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
    """Memory of `learn_noise`, of any signal; see `ObserverState` for what they are."""

    last: float = 0.0
    before: float = 0.0
    change: float = 0.0
    seen: int = 0


def forget_observer(state: Any) -> None:
    """Begin anew."""
    state.bias = state.weight = state.sure = state.patient = state.steady = 0.0
    state.asked = state.short = state.short_power = 0.0
    state.power = state.patient_power = state.last = state.before = state.change = 0.0
    state.seen = 0
    for k in range(_BANK):
        state.bank[k] = state.lead[k] = 0.0


def begin_at(state: Any, error: float) -> None:
    """Begin at an error (N), all of it believed: for a start without a bump."""
    forget_observer(state)
    state.bias = state.patient = state.steady = error
    state.patient_power = error * error
    for k in range(_BANK):
        state.bank[k] = error


def low_pass(dt: float, time: float) -> float:
    """Return the share of a step that a first-order lag takes up within dt."""
    return 1.0 - math.exp(-dt / time)


def behind_lag(share: float) -> float:
    """Return the sd of white noise behind a lag that takes up a share of a step, over its own."""
    return math.sqrt(share / (2.0 - share))


def observe(state: Any, measured: float, believed: float, asked: float, reach: float, time: float,
            dt: float) -> None:
    """
    Advance by one sample.

    Parameters
    ----------
    state : ObserverState
    measured, believed, asked : float, N
        Measured force; that of the model at the measured pressures, and at those last commanded.
    reach : float, N
        What pressures may be missing where all is well. More than that is on its way, or does not
        answer at all: it is not integrated, and what was is forgotten.
    time : float, s
        Of the quick observer.
    dt : float, s
    """
    error = measured - believed
    learn_noise(state, error, _USUAL, dt)
    noise = noise_of(state)
    noise *= noise
    gain, slow = low_pass(dt, time), low_pass(dt, PATIENT_TIME)
    quick = noise * gain / (2.0 - gain)  # what of it is left behind the quick observer's lag
    compare(state, error, noise, dt)
    follow(state, error, time, dt)
    state.patient += slow * (error - state.patient)
    state.patient_power += low_pass(dt, _LONG * PATIENT_TIME) * (
        state.patient * state.patient - state.patient_power)
    state.sure = beyond_noise(state.patient_power, noise * slow / (2.0 - slow))
    state.steady = state.patient * state.sure
    left = quick_of(state) - state.steady
    state.power += low_pass(dt, _LEARN_TIME) * (left * left - state.power)
    # What four standard deviations of noise cannot be counts at once.
    power = max(state.power, _AT_ONCE * left * left)
    state.weight = beyond_noise(power, quick)
    if state.seen == 1:
        state.asked = believed
    state.asked += gain * (asked - state.asked)
    # What the lag alone may explain is not missing.
    missing = state.asked - believed
    late = abs(asked - state.asked)
    missing = math.copysign(max(abs(missing) - late, 0.0), missing)
    if abs(missing) > reach:
        missing = 0.0
    state.short += low_pass(dt, _SHORT * time) * (missing - state.short)
    state.short_power += low_pass(dt, _LEARN_TIME) * (
        state.short * state.short - state.short_power)
    # As far as the model is known to be off, what moves needs no proof.
    found = towards(average(state), quick_of(state), _SURELY * (1.0 - state.weight) * quick)
    state.bias = found - state.short * beyond_noise(state.short_power, quick)


def quick_of(state: Any) -> float:
    """Return what the quickest of the bank finds, N."""
    return state.bank[_BANK - 1]


def compare(state: Any, error: float, noise: float, dt: float) -> None:
    """
    Count how much better each of the bank predicted an error (N) than the steady one did.

    Gaussian log likelihoods; ``noise`` (N^2) is the variance of the readings.
    """
    kept, missed, best = 1.0 - low_pass(dt, _FADES), error - state.steady, 0.0
    twice = 2.0 * max(noise, _USUAL * _USUAL)
    for k in range(_BANK):
        way = error - state.bank[k]
        state.lead[k] = kept * state.lead[k] + (missed * missed - way * way) / twice
        best = max(best, state.lead[k])
    # None becomes surer than the steady one is to begin with: noise is not known at once.
    for k in range(_BANK):
        state.lead[k] -= max(best - 2.0 * _ODDS, 0.0)


def follow(state: Any, error: float, time: float, dt: float) -> None:
    """Move all of the bank on, each in its own time; ``time`` (s) is that of the last."""
    ratio = (time / PATIENT_TIME) ** (1.0 / _BANK)
    span = PATIENT_TIME
    for k in range(_BANK):
        span *= ratio
        state.bank[k] += low_pass(dt, span) * (error - state.bank[k])


def average(state: Any) -> float:
    """Return the mean of all, N, each weighted by its lead less the odds against it."""
    total, mean = 1.0, state.steady
    for k in range(_BANK):
        weight = math.exp(state.lead[k] - _ODDS)
        total += weight
        mean += weight * state.bank[k]
    return mean / total


def towards(value: float, other: float, noise: float) -> float:
    """
    Return a value (N) moved towards another as far as their difference is more than noise (N^2).

    The part of the way w that is left is noise / w^2: nothing moves within the noise (N^2), and
    nothing jumps at its edge.
    """
    way = other - value
    return value + way * max(1.0 - noise / (way * way), 0.0) if way != 0.0 else value


def take_out_late(state: Any, error: float, jump: float) -> float:
    """
    Take out what the model explains late; return the share of the jump that it was late.

    The believed force has jumped since a direction of motion was seen. As far as the quick part
    had made up for that already, it need not any more.

    Parameters
    ----------
    state : ObserverState
    error, jump : float, N
        Measured minus believed force after the jump; change of the believed force.
    """
    if jump == 0.0:
        return 0.0
    share = min(max(min((quick_of(state) - error) / jump, state.bias / jump), 0.0), 1.0)
    for k in range(_BANK):
        state.bank[k] -= min(max((state.bank[k] - error) / jump, 0.0), share) * jump
    return share


def shift(state: Any, error: float) -> None:
    """Go on with errors larger by so much (N), as the model says less of the same from now on."""
    state.patient += error
    state.steady += error
    for k in range(_BANK):
        state.bank[k] += error
    state.bias += error
    state.asked -= error
    state.last += error
    state.before += error


def beyond_noise(power: float, noise: float) -> float:
    """Return the share of a power (N^2) that is more than noise of a variance (N^2) makes."""
    return max(1.0 - _CLEAR * noise / power, 0.0) if power > 0.0 else 0.0


def second_difference(state: Any, value: float) -> float:
    """Return the size of the second difference that a signal's next value makes."""
    return abs(value - 2.0 * state.last + state.before)


def learn_noise(state: Any, value: float, usual: float, dt: float) -> None:
    """
    Follow the mean size of a signal's second differences: what moves steadily has none.

    A change of the size ``usual`` may be noise, whatever was seen before.
    """
    change = second_difference(state, value)
    state.before, state.last = state.last, value
    state.seen += 1
    state.change = mean_change(state.change, change, usual, state.seen, dt)


def mean_change(mean: float, change: float, usual: float, seen: int, dt: float) -> float:
    """Return the mean size of second differences after the one that came as the ``seen``-th."""
    if seen < 3:
        return mean
    if seen == 3:
        return change
    gain = max(low_pass(dt, _LEARN_TIME), 1.0 / (seen - 2))
    # One that is far out of the ordinary is a step, not noise.
    return mean + gain * (min(change, 4.0 * mean + usual) - mean)


def quick_noise(state: Any, time: float, dt: float) -> float:
    """Return the standard deviation of what noise leaves in the quick observer's error, N."""
    return noise_of(state) * behind_lag(low_pass(dt, time))


def noise_of(state: Any) -> float:
    """Return the standard deviation of white noise with these second differences."""
    return noise_in(state.change)


def noise_in(change: float) -> float:
    """Return the standard deviation of white noise with second differences of this mean size."""
    return change * math.sqrt(0.5 * math.pi / 6.0)
