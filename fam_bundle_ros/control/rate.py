# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The strain rate that a model is asked about: as measured, without the noise that it has at rest.

Dry friction turns the sign of the rate into newtons. At rest the sign of a measured rate is noise.
"""

from dataclasses import dataclass, field
import math
from typing import Any

#: s: filters, the quick one first. Second differences span twice two of the quick one.
_QUICK, _PATIENT = 0.01, 0.1
#: s: in which the noise is learnt.
_LEARN_TIME = 1.0
#: Half width of the play and of the dead zone, in sd: noise needs five of them to pass.
_WIDTH = 2.5
#: How far beyond the quick filter the patient one may be, in widths: not for long after a stop.
_NEAR = 0.7
#: 1/s: a change of this size is believed to be noise, whatever was seen before.
_USUAL = 1e-3
#: s: over which second differences reach; places in the ring of past values; least time between
#: two of them, so that the ring spans them at any sample time.
_SPAN, _PAST = 4.0 * _QUICK - 1e-9, 64
_APART = _SPAN / (_PAST - 4)


def _ring():
    return field(default_factory=lambda: [0.0] * _PAST)


@dataclass
class RateState:
    """
    Memory of `quiet_rate`.

    Attributes
    ----------
    quick, patient : float, 1/s
        The rate filtered.
    quick_kept, patient_kept : float, 1/s
        The same behind a play.
    past_time, past_rate : list (64,)
        Ring of what the quick filter showed; ``head`` is the oldest of ``size``.
    time : float, s
    mean : float, 1/s
        Of the size of second differences; ``seen`` of them so far.
    """

    quick: float = 0.0
    patient: float = 0.0
    quick_kept: float = 0.0
    patient_kept: float = 0.0
    past_time: list[float] = _ring()
    past_rate: list[float] = _ring()
    head: int = 0
    size: int = 0
    time: float = 0.0
    mean: float = 0.0
    seen: int = 0
    started: bool = False


def forget_rate(state: Any) -> None:
    """Begin anew."""
    state.quick_kept = state.patient_kept = state.time = state.mean = 0.0
    state.head, state.size, state.seen = 0, 0, 0
    state.started = False


def quiet_rate(state: Any, rate: float, dt: float) -> float:
    """
    Return the rate to be believed, 1/s; 0 until the noise is known (0.04 s).

    A quick filter sees what is fast at once. What it cannot tell from noise is left to a patient
    one, whose band is narrower; where the quick one is nearer to zero by more than noise, the
    patient one follows, so that the end of a motion is seen soon. A rate without noise passes
    with the quick filter's lag.

    Parameters
    ----------
    state : RateState
    rate : float, 1/s
    dt : float, s

    Examples
    --------
    >>> state = RateState()
    >>> rates = [quiet_rate(state, 2e-3 * (-1) ** k, 4e-3) for k in range(500)]
    >>> max(map(abs, rates[-250:]))
    0.0
    >>> rates = [quiet_rate(state, 0.1 + 2e-3 * (-1) ** k, 4e-3) for k in range(100)]
    >>> bool(0.09 < rates[-1] < 0.11)
    True
    """
    if not state.started:
        state.started = True
        state.quick = state.patient = rate
    state.quick += (1.0 - math.exp(-dt / _QUICK)) * (rate - state.quick)
    learn_noise(state, dt)
    width = _WIDTH * noise_of(state)
    patient = state.patient + (1.0 - math.exp(-dt / _PATIENT)) * (rate - state.patient)
    if patient > 0.0:
        patient = max(min(patient, state.quick + _NEAR * width), 0.0)
    else:
        patient = min(max(patient, state.quick - _NEAR * width), 0.0)
    state.patient = patient
    # White noise is averaged out by the root of the time.
    narrow = width * math.sqrt(_QUICK / _PATIENT)
    state.patient_kept = play(state.patient_kept, patient, narrow)
    if state.seen == 0:
        return 0.0
    state.quick_kept = play(state.quick_kept, state.quick, width)
    quick = beyond(state.quick_kept, width)
    return quick if quick != 0.0 else beyond(state.patient_kept, narrow)


def play(kept: float, value: float, width: float) -> float:
    """Return a value behind a play (backlash): what wavers by less than the width is dropped."""
    return min(max(kept, value - width), value + width)


def beyond(kept: float, width: float) -> float:
    """
    Return 0 up to one width and all of a value from two on.

    This dead zone drops what the play keeps of a motion that is over. So a rate counts from two
    widths on, and until it is back at zero: between them it does not chatter.
    """
    size = abs(kept)
    return math.copysign(min(size, 2.0 * max(size - width, 0.0)), kept)


def noise_of(state: Any) -> float:
    """Return the standard deviation of the quickly filtered rate's noise, 1/s."""
    # Of a second difference of values that are not correlated, from its mean size.
    return state.mean * math.sqrt(0.5 * math.pi / 6.0)


def learn_noise(state: Any, dt: float) -> None:
    """Follow the mean size of second differences: steady motion has none."""
    state.time += dt
    times, rates, head, size = state.past_time, state.past_rate, state.head, state.size
    if size > 0 and state.time - times[(head + size - 1) % _PAST] < _APART:
        return
    times[(head + size) % _PAST], rates[(head + size) % _PAST] = state.time, state.quick
    size += 1
    if size >= 3 and state.time - times[head] >= _SPAN:
        while size > 3 and state.time - times[(head + 1) % _PAST] >= _SPAN:
            head, size = (head + 1) % _PAST, size - 1
        middle = rates[(head + size // 2) % _PAST]
        change = abs(state.quick - 2.0 * middle + rates[head])
        state.seen += 1
        gain = max(1.0 - math.exp(-dt / _LEARN_TIME), 1.0 / state.seen)
        # One that is far out of the ordinary is a motion that begins or ends.
        state.mean += gain * (min(change, 4.0 * state.mean + _USUAL) - state.mean)
    state.head, state.size = head, size
