# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Checks of the supply against its parameter, and of the force against model and pressures.

Independent of ROS. Pressures are gauge.
"""

from collections.abc import Callable
from typing import Any

from fam_bundle_ros.control.safety import kilopascals

#: Least and largest supply over its parameter: the least is still covered by `plausibility.LEAST`.
SUPPLY_LEAST, SUPPLY_MOST = 0.8, 1.25


class SupplyWatch:
    """
    Check of the supply's reading against its parameter.

    Parameters
    ----------
    expected : float, Pa (gauge)
    patience : float, s
        Time for which the reading may be outside.

    Examples
    --------
    >>> watch = SupplyWatch(600e3, 0.2)
    >>> watch.see(0.0, 590e3), watch.see(0.1, 300.0), watch.see(0.4, 300.0)
    (True, False, False)
    >>> watch.lasts, watch.text
    (True, 'the supply shows 0 kPa, the parameter supply.pressure says 600 kPa')
    """

    def __init__(self, expected: float, patience: float):
        self._expected = expected
        self._patience = patience
        self.begin()

    def begin(self) -> None:
        """Reset."""
        self._since: float | None = None
        #: Why the reading disagrees, as text; empty while it agrees.
        self.text = ''
        #: Whether it has disagreed for longer than ``patience``.
        self.lasts = False

    def see(self, now: float, supply: float, patience: float | None = None) -> bool:
        """Check a reading, Pa (gauge); return whether it agrees. nan (no reading) agrees."""
        if not (supply < SUPPLY_LEAST * self._expected or supply > SUPPLY_MOST * self._expected):
            self.begin()
            return True
        if self._since is None or now < self._since:
            self._since = now
        self.lasts = now - self._since >= (self._patience if patience is None else patience)
        self.text = (f'the supply shows {kilopascals(supply)}, the parameter supply.pressure '
                     f'says {kilopascals(self._expected)}')
        return False


class ForceWatch:
    """
    Check of the force against the range that the pressure readings allow.

    The force of each motor unit is evaluated at the ends of the range of its true pressure; a
    force above the sum comes from air that no sensor shows.

    Parameters
    ----------
    unit_force : callable
        Force (N) of a motor unit by index, strain and pressure (Pa gauge).
    tolerance : float, N
        Additional tolerance for model and load cell.
    patience : float, s
        Time for which a force may be too high; too low counts only with ``off_target``.

    Examples
    --------
    >>> watch = ForceWatch(lambda unit, strain, pressure: pressure / 4e3, 10.0, 0.02)
    >>> watch.see(0.0, 60.0, 0.1, [160e3]), watch.see(0.1, 60.0, 0.1, [160e3])
    ('', '')
    >>> watch.see(0.2, 80.0, 0.1, [90e3]), watch.see(0.3, 80.0, 0.1, [90e3])
    ('', 'force is 80 N; pressures shown give 33 N at most')
    """

    #: Relative error of a pressure reading: units differ by about 7 %, gauges by less.
    RATIO = 0.3
    #: Pa: offset of a pressure reading, as by drift.
    OFFSET = 15e3

    def __init__(self, unit_force: Callable[[int, float, float], float], tolerance: float,
                 patience: float):
        self._unit_force = unit_force
        self._tolerance = tolerance
        self._patience = patience
        self.begin()

    def begin(self) -> None:
        """Reset."""
        self._since: float | None = None

    def above(self, force: float, strain: float, pressure: Any, limit: Any) -> int | None:
        """
        Return the motor unit (from 0) whose pressure is above its limit by the force, else None.

        An estimate: the whole force that the pressure readings do not explain, if it is more than
        the tolerance, is attributed to the air of one unit.

        Parameters
        ----------
        force, strain : float, N and 1
        pressure, limit : sequence of float (n,), Pa (gauge)
            Readings, and the pressures above which operation must stop.

        Examples
        --------
        >>> watch = ForceWatch(lambda unit, strain, pressure: pressure / 4e3, 10.0, 0.02)
        >>> watch.above(95.0, 0.1, [340e3, 0.0], [396e3, 396e3])
        >>> watch.above(105.0, 0.1, [340e3, 0.0], [396e3, 396e3])
        0
        """
        # A motor unit with push-back may also be slack.
        shown, full = ([max(self._unit_force(unit, strain, max(value, 0.0)), 0.0)
                        for unit, value in enumerate(values)] for values in (pressure, limit))
        excess = force - sum(shown)
        if excess > self._tolerance:
            for unit, (now, most) in enumerate(zip(shown, full)):
                if excess > most - now:
                    return unit
        return None

    def see(self, now: float, force: float, strain: float, pressure: Any,
            off_target: bool = False) -> str:
        """
        Check one sample of the readings; return the fault as text, empty if there is none.

        Parameters
        ----------
        now : float, s
        force, strain : float, N and 1
        pressure : sequence of float (n,), Pa (gauge)
        off_target : bool
            Controlled variable misses its target: only then a force too low is a fault.
        """
        low = high = 0.0
        for unit, shown in enumerate(pressure):
            ends = [self._unit_force(unit, strain, max(end, 0.0)) for end in (
                shown * (1.0 - self.RATIO) - self.OFFSET, shown,
                shown * (1.0 + self.RATIO) + self.OFFSET)]
            low += min(ends)
            # Push-back is the least certain part of a model: the motor unit may also be slack.
            high += max(*ends, 0.0)
        above = force > high + self._tolerance
        below = off_target and force < low - self._tolerance
        if not (above or below):
            self.begin()
            return ''
        if self._since is None or now < self._since:
            self._since = now
        if now - self._since < self._patience:
            return ''
        least = '' if above else 'at least '
        return (f'force is {force:.3g} N; pressures shown give {least}'
                f'{high if above else low:.3g} N{" at most" if above else ""}')
