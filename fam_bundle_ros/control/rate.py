# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The strain rate that a model is asked about: as measured, without the noise that it has at rest.

Dry friction turns the sign of the rate into newtons. At rest the sign of a measured rate is noise.
"""

from collections import deque
import math

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


class QuietRate:
    """
    Strain rate with a band of noise left out; the band is learnt from the readings.

    A quick filter sees what is fast at once. What it cannot tell from noise is left to a patient
    one, whose band is narrower; where the quick one is nearer to zero by more than noise, the
    patient one follows, so that the end of a motion is seen soon. A rate without noise passes
    with the quick filter's lag.

    Examples
    --------
    >>> sense = QuietRate()
    >>> rates = [sense.update(4e-3, 2e-3 * (-1) ** k) for k in range(500)]
    >>> max(map(abs, rates[-250:]))
    0.0
    >>> rates = [sense.update(4e-3, 0.1 + 2e-3 * (-1) ** k) for k in range(100)]
    >>> bool(0.09 < rates[-1] < 0.11)
    True
    """

    def __init__(self):
        self._quick, self._patient = _Band(_QUICK), _Band(_PATIENT)
        self._mean = 0.0
        self._seen = 0
        self._past: deque[tuple[float, float]] = deque()
        self._time = 0.0

    @property
    def noise(self) -> float:
        """Return the standard deviation of the quickly filtered rate's noise, 1/s."""
        # Of a second difference of values that are not correlated, from its mean size.
        return self._mean * math.sqrt(0.5 * math.pi / 6.0)

    def update(self, dt: float, rate: float) -> float:
        """Return the rate to be believed, 1/s; 0 until the noise is known (0.04 s)."""
        quick, patient = self._quick, self._patient
        quick.filter(dt, rate)
        self._learn(dt, quick.smooth)
        width = _WIDTH * self.noise
        patient.filter(dt, rate)
        patient.shrink(quick.smooth - _NEAR * width, quick.smooth + _NEAR * width)
        # White noise is averaged out by the root of the time.
        slow = patient.beyond(width * math.sqrt(_QUICK / _PATIENT))
        return (quick.beyond(width) or slow) if self._seen else 0.0

    def _learn(self, dt, smooth):
        """Follow the mean size of second differences: steady motion has none."""
        self._time += dt
        past = self._past
        past.append((self._time, smooth))
        span = 4.0 * _QUICK - 1e-9
        if len(past) < 3 or self._time - past[0][0] < span:
            return
        while len(past) > 3 and self._time - past[1][0] >= span:
            past.popleft()
        middle = past[len(past) // 2][1]
        change = abs(smooth - 2.0 * middle + past[0][1])
        self._seen += 1
        gain = max(1.0 - math.exp(-dt / _LEARN_TIME), 1.0 / self._seen)
        # One that is far out of the ordinary is a motion that begins or ends.
        self._mean += gain * (min(change, 4.0 * self._mean + _USUAL) - self._mean)


class _Band:
    """
    A filtered rate and what of it is beyond noise.

    A play as wide as the noise drops what wavers and a dead zone of the same width drops what the
    play keeps of a motion that is over. So a rate counts from two widths on, and until it is back
    at zero: between them it does not chatter.
    """

    def __init__(self, filter_time):
        self._filter_time = filter_time
        self._started = False
        self.smooth = self._kept = 0.0

    def filter(self, dt, rate):
        """Take in a reading."""
        share = 1.0 - math.exp(-dt / self._filter_time) if self._started else 1.0
        self._started = True
        self.smooth += share * (rate - self.smooth)

    def shrink(self, low, high):
        """Bring what is filtered nearer to zero, to be within bounds."""
        if self.smooth > 0.0:
            self.smooth = max(min(self.smooth, high), 0.0)
        else:
            self.smooth = min(max(self.smooth, low), 0.0)

    def beyond(self, width):
        """Return the rate to be believed: 0 up to one width, all of it from two on."""
        self._kept = min(max(self._kept, self.smooth - width), self.smooth + width)
        size = abs(self._kept)
        return math.copysign(min(size, 2.0 * max(size - width, 0.0)), self._kept)
