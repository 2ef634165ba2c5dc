# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""References that are given by their values alone, without a rate."""

import math

#: Full contraction of a muscle, the scale of steps of the strain.
FULL_STRAIN = 0.3
#: Longest interval between values for an estimate of the rate, s.
_APART = 0.1
#: Largest number of values in a line fit.
_LINE = 8
#: Standard deviation of the times' jitter, as a share of their interval; slopes agree within
#: this number of standard deviations.
_JITTER, _AGREE = 0.2, 2.0
#: A value is held for up to this multiple of the time between the last changes.
_HELD = 1.5


class ReferenceRate:
    """
    Estimates the rate of a reference from its values.

    Fits lines to the last values and uses the longest whose slope agrees with the slopes of all
    shorter ones within the jitter of the times. So jitter does not change the rate of a ramp, and
    the end of a ramp is detected at the next value.

    Parameters
    ----------
    step : float
        A value that differs by more than this from the extrapolated one is a step, without a
        rate; if the next one continues it in a line, it was the start of a fast motion.

    Examples
    --------
    >>> reader = ReferenceRate(5.0)
    >>> [round(reader.update(0.02 * k, value), 6) for k, value in enumerate([0, 1, 2, 3, 3, 30])]
    [0.0, 50.0, 50.0, 50.0, 0.0, 0.0]
    """

    def __init__(self, step: float):
        self._step = step
        self._values: list[tuple[float, float]] = []
        self._rate = 0.0

    def update(self, time: float, value: float) -> float:
        """Return the rate, per second, of a value at ``time`` (s); 0 after a step or a pause."""
        if self._values and time == self._values[-1][0]:
            self._values[-1] = time, value
            return self._rate
        stepped = False
        if not (self._values and 0.0 < time - self._values[-1][0] <= _APART):
            self._values = []
        elif self._departs(time, value, self._rate):
            stepped = len(self._values) < 2 or self._departs(
                time, value, _slope(self._values[-2], self._values[-1]))
        self._values = [*self._values[1 - _LINE:], (time, value)]
        self._rate = 0.0 if stepped else self._longest()
        return self._rate

    def _departs(self, time: float, value: float, rate: float) -> bool:
        """Return whether a value is not the last one extrapolated at a rate."""
        last, before = self._values[-1]
        return abs(value - before - rate * (time - last)) > self._step

    def _longest(self) -> float:
        """Return the slope of the longest consistent line, per second."""
        last, value = self._values[-1]
        consistent, low, high = 0.0, -math.inf, math.inf
        jitter = _JITTER * (last - self._values[0][0]) / max(len(self._values) - 1, 1)
        time_sum = change_sum = squares = products = 0.0
        for count, (then, each) in enumerate(reversed(self._values), 1):
            time, change = then - last, each - value
            time_sum += time
            change_sum += change
            squares += time * time
            products += time * change
            if count == 1:
                continue
            spread = squares - time_sum * time_sum / count
            slope = (products - time_sum * change_sum / count) / spread
            doubt = _AGREE * jitter * abs(slope) / math.sqrt(spread)
            low, high = max(low, slope - doubt), min(high, slope + doubt)
            if low > high:
                break
            consistent = slope
        return consistent


def _slope(first: tuple[float, float], second: tuple[float, float]) -> float:
    return (second[1] - first[1]) / (second[0] - first[0])


class SampledReference:
    """
    A reference of which one value is given per tick, the same one while there is no new one.

    Values may be new at each tick, or at each few, as from a slower program: then the reference
    is extrapolated in between, or a ramp would become a staircase. A single change is a step; a
    motion has a rate from its second change on.

    Parameters
    ----------
    step : float
        As of `ReferenceRate`.

    Examples
    --------
    >>> stairs = SampledReference(5.0)
    >>> told = [stairs.update(5e-3 * tick, float(tick // 3)) for tick in range(12)]
    >>> [round(value, 1) for value, rate in told]
    [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.4, 2.7, 3.0, 3.4, 3.7]
    """

    def __init__(self, step: float):
        self._rate_of = ReferenceRate(step)
        self._value = math.nan
        self._rate = 0.0
        self._changed = -math.inf
        self._moved = False
        #: Ticks since the last change, and between the changes before.
        self._age, self._between = 0, (1, 1)

    def update(self, time: float, value: float) -> tuple[float, float]:
        """Return value and rate at ``time`` (s) for a given value; nan is passed on."""
        if math.isnan(value):
            return value, 0.0
        self._age += 1
        moved = value != self._value
        if not moved and self._age <= _HELD * max(self._between) - 1.0:
            return value + self._rate * (time - self._changed), self._rate
        rate = self._rate_of.update(time, value)
        self._rate = rate if moved and self._moved else 0.0
        self._moved = moved
        if moved:
            if time - self._changed <= _APART:
                self._between = self._between[1], self._age
            self._value, self._changed, self._age = value, time, 0
        return value, self._rate
