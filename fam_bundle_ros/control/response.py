# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Test of a pressure reading that does not follow the air that is let in.

A plugged port, or a sensor at the end of its range, shows the same pressure within its noise
while the loop lets air in by small openings. A leak or a wide dead band explain the same. Before
that air may have raised the pressure above the trip, a little air is let out: the reading of a
working sensor falls, whatever became of the air before. Pressures are gauge; independent of ROS.
"""

from collections import deque
import math

#: Pulses without an effect that show a fault: a rig that reads commands by its own clock may miss
#: one.
_PULSES = 2


class ResponseWatch:
    """
    Bound of the true pressure while the reading stays the same, and the test that it responds.

    Parameters
    ----------
    noise : float, Pa
        Largest difference of two readings due to noise.
    trip : float, Pa (gauge)
        Pressure up to which air may be let in without a response.
    most : float
        Largest true rise over that of the model.
    lag, patience : float, s
        Longest time from a reading to the reading that shows the effect of its command; time for
        which the valve stays shut after a pulse. Air that is gone within less is not a leak.
    slow : float, s
        Shortest time over which air that the reading does not show is learnt as a leak.

    Attributes
    ----------
    pulse : bool
        Whether to let out air now, by which the reading of a working sensor falls by twice the
        noise or more.
    testing : bool
        The valve is shut but for the pulses.
    suspected : float, Pa
        The highest possible pressure that led to the last test.
    doubt : float
        Weight of air that the loop does not expect, as it may have learnt the valve from a reading
        that does not respond: 1 at first, half as much after every test that was passed.

    Examples
    --------
    >>> watch = ResponseWatch(3e3, 396e3, 1.5, 0.02, 0.1, 1.0)
    >>> shown = [watch.see(0.01 * k, 340e3, 5e3) or watch.testing for k in range(12)]
    >>> shown.index(True), print(f'{watch.highest / 1e3:.0f} kPa')
    408 kPa
    (10, None)
    """

    def __init__(self, noise: float, trip: float, most: float, lag: float, patience: float,
                 slow: float):
        self.noise, self.trip, self.most = noise, trip, most
        self.lag, self.patience, self.slow = lag, patience, slow
        self.begin()

    def begin(self) -> None:
        """Reset."""
        self._leak, self.doubt, self.suspected = 0.0, 1.0, 0.0
        self._follow(0.0, math.nan)

    def _follow(self, time: float, pressure: float) -> None:
        """Count from this reading on."""
        self.shown = pressure
        self._since = self._before = self._tested = time
        self._moved = 0.0
        #: Times and rises, of which the first is the last that the reading has to show.
        self._past: deque[tuple[float, float]] = deque()
        self._pulses, self.pulse, self.testing = 0, False, False

    @property
    def highest(self) -> float:
        """Return the highest pressure, Pa, that the air since the last response may give."""
        return self.shown + self.most * max(self._past[0][1] if self._past else 0.0, 0.0)

    def see(self, time: float, pressure: float, rise: float, held_up: bool = False) -> bool:
        """
        Return whether the reading has failed the test.

        Parameters
        ----------
        time : float, s
        pressure : float, Pa
        rise : float, Pa
            Since the reading before, by the model of valve and chamber.
        held_up : bool
            The rig may not have executed the last commands.
        """
        if not abs(pressure - self.shown) <= self.noise:
            # Less was let out than in: a reading at the end of its range would still be there.
            if self.testing and self._moved > 0.0:
                self.doubt *= 0.5
                if self._tested - self._since >= self.slow:
                    self._leak += self._moved / (self._tested - self._since)
            self._follow(time, pressure)
            return False
        dt, self._before = time - self._before, time
        self._moved = max(self._moved + rise, -pressure)
        # The known leak has taken its part.
        self._moved -= min(self._leak * dt, max(self._moved, 0.0))
        self._past.append((time, self._moved))
        while len(self._past) > 1 and self._past[1][0] <= time - self.lag:
            self._past.popleft()
        if not self.testing:
            if self.highest > self.trip:
                self.suspected = self.highest
                self.shown, self._tested, self._pulsed = pressure, time, time
                self._pulses, self.pulse, self.testing = 1, True, True
            return False
        self.pulse = False
        if held_up:
            self._pulsed, self._pulses = time, 0
        if time - self._pulsed < max(self.lag, self.patience):
            return False
        if self._pulses == _PULSES:
            return True
        self._pulses += 1
        self._pulsed, self.pulse = time, True
        return False
