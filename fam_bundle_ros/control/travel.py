# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Check of a pressure reading that is exactly constant. Pressures are gauge."""

import math


class Travel:
    """
    Change of the true pressure since its reading last changed, by the model.

    A loop with a frozen reading hunts: its valve opens a little in both directions, within the
    bounds of `plausibility.InflowWatch`, while the true pressure goes up and down. The loop's
    models of valve and chamber tell by how much.

    Parameters
    ----------
    least : float, Pa
        Change of the pressure, up or down, that a working sensor must show.
    longest : float, s
        Longest interval between readings; a longer gap counts as this.

    Examples
    --------
    >>> travel = Travel(50e3, 0.01)
    >>> [travel.see(0.01 * k, 200e3, 2e6) for k in range(5)], travel.see(0.05, 201e3, 2e6)
    ([False, False, False, True, True], False)
    """

    def __init__(self, least: float, longest: float):
        self.least, self.longest = least, longest
        self.begin()

    def begin(self) -> None:
        """Reset."""
        self._shown = self._time = math.nan
        self._moved, self._far = 0.0, False

    def see(self, time: float, pressure: float, rate: float) -> bool:
        """
        Return whether the pressure must have moved since the reading last changed.

        Parameters
        ----------
        time : float, s
        pressure : float, Pa
            Reading.
        rate : float, Pa/s
            Mean since the reading before, by the loop's models of valve and chamber.
        """
        if pressure == self._shown:
            self._moved += rate * min(max(time - self._time, 0.0), self.longest)
            self._far = self._far or abs(self._moved) > self.least
        else:
            self._moved, self._far = 0.0, False
        self._shown, self._time = pressure, time
        return self._far
