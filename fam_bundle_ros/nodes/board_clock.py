# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
When a reading was taken: converts the clock of a board to the clock of this machine. No ROS.

A line arrives after its sample was taken, and some lines arrive with hardly any delay. So the
smallest difference between the two clocks is their offset, and a delayed line still gets the
right time.
"""

#: Largest relative drift between the clocks: 0.5 % for each, as of ceramic resonators.
DRIFT = 0.01
_WRAP = 2**32


class BoardClock:
    """
    Follows a board's clock of 32 bit microseconds.

    The estimate is late by the shortest delay of the line, and by up to 1 % of the time since a
    line last came with that delay.

    Examples
    --------
    >>> clock = BoardClock()
    >>> clock.time(1_000_000, 50.0)
    50.0
    >>> round(clock.time(1_010_000, 50.04), 3)   # 30 ms late
    50.01
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start again, after a restart of the board."""
        self._ticks: int | None = None
        self._elapsed = self._offset = 0.0

    def time(self, ticks: int, received: float) -> float:
        """
        Return when a sample was taken, s on the clock of ``received``.

        Parameters
        ----------
        ticks : int, us
            The board's clock, modulo 2^32.
        received : float, s
            When the line came; the result is never later.
        """
        if self._ticks is None:
            self._ticks, self._offset = ticks, received
            return received
        passed = (ticks - self._ticks) % _WRAP * 1e-6
        self._ticks = ticks
        self._elapsed += passed
        self._offset = min(received - self._elapsed, self._offset + DRIFT * passed)
        return self._elapsed + self._offset
