# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Watches one sensor: is its reading fresh, a number, possible, alive? No ROS.

A reading that fails is worth nothing from its first sample on (hold); when that lasts, the
channel is out (vent) until it has been good again for a while.
"""

from dataclasses import dataclass
from enum import IntEnum
import math


class Health(IntEnum):
    """What a channel is good for, worst last."""

    GOOD = 0
    WAITING = 1
    HOLD = 2
    VENT = 3


@dataclass(frozen=True)
class WatchConfig:
    """
    When a reading counts as bad.

    Parameters
    ----------
    low, high : float
        Possible readings, in the unit of the channel.
    timeout : float, s
        A channel is stale when nothing has come for so long.
    hold_time : float, s
        Bad for so long: out.
    recovery_time : float, s
        Good again for so long: back.
    stuck_time : float, s
        A reading that repeats exactly for so long, while it should move, is stuck; 0 for never.
    """

    low: float
    high: float
    timeout: float = 0.1
    hold_time: float = 0.2
    recovery_time: float = 0.2
    stuck_time: float = 0.5


class SensorWatch:
    """
    The watch over one channel.

    Parameters
    ----------
    name, unit : str
        For the messages.
    config : WatchConfig

    Examples
    --------
    >>> watch = SensorWatch('force', 'N', WatchConfig(low=-100.0, high=2000.0))
    >>> watch.see(0.00, 12.0), watch.see(0.01, math.nan), watch.reason
    (<Health.GOOD: 0>, <Health.HOLD: 2>, 'force is nan')
    >>> watch.check(0.5), watch.reason
    (<Health.VENT: 3>, 'force is nan; nothing for 0.49 s')
    """

    def __init__(self, name: str, unit: str, config: WatchConfig):
        self.name = name
        self.unit = unit
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget everything: nothing has been seen yet."""
        self.health = Health.WAITING
        #: Why the health is not GOOD, in words.
        self.reason = f'no {self.name} yet'
        self._seen: float | None = None
        self._good: float | None = None
        self._good_since: float | None = None
        self._out = False
        self._value = math.nan
        self._moving = 0.0
        self._fault = ''

    @property
    def age(self) -> float | None:
        """Return when the last reading came, on the caller's clock; None before the first."""
        return self._seen

    def see(self, now: float, value: float, moving: bool = False) -> Health:
        """
        Take a reading.

        Parameters
        ----------
        now : float, s
        value : float
        moving : bool
            Whether the quantity must be changing now, so that an exact repeat is suspicious.
        """
        self._notice_reset(now)
        config = self.config
        since = now - self._seen if self._seen is not None else 0.0
        stuck = 0.0 < config.stuck_time <= self._moving
        if value != self._value or not (moving or stuck):
            self._moving = 0.0
        elif moving:
            # Once stuck it stays so while nothing moves: a shut valve proves nothing.
            self._moving += max(since, 0.0)
        self._seen, self._value = now, value
        if not math.isfinite(value):
            self._fault = f'{self.name} is {value}'
        elif not config.low <= value <= config.high:
            self._fault = (f'{self.name} is {value:.6g} {self.unit}, outside '
                           f'{config.low:g} to {config.high:g}'.replace('  ', ' '))
        elif 0.0 < config.stuck_time <= self._moving:
            self._fault = (f'{self.name} has shown exactly {value:.6g} {self.unit} for '
                           f'{self._moving:.2f} s although it must move')
        else:
            self._fault = ''
        return self.check(now)

    def forgive_repeats(self) -> None:
        """Count exact repeats anew: somebody has decided to go on with this reading."""
        self._moving = 0.0

    def check(self, now: float) -> Health:
        """Return the health now; call it too while nothing comes."""
        self._notice_reset(now)
        config = self.config
        if self._seen is None:
            return self.health
        reason = self._fault
        silence = now - self._seen
        if silence > config.timeout:
            late = f'nothing for {silence:.2f} s'
            reason = f'{reason}; {late}' if reason else f'{self.name}: {late}'
        if reason:
            self._good_since = None
            start = self._good if self._good is not None else self._seen
            self._good = start
            self._out = self._out or now - start > config.hold_time + (
                config.timeout if not self._fault else 0.0)
        else:
            self._good = now
            if self._good_since is None:
                self._good_since = now
            if self._out and now - self._good_since >= config.recovery_time:
                self._out = False
            if self._out:
                reason = f'{self.name} is back, but not yet for {config.recovery_time:g} s'
        self.reason = reason
        self.health = (Health.VENT if self._out else Health.HOLD) if reason else Health.GOOD
        return self.health

    def _notice_reset(self, now: float) -> None:
        if self._seen is not None and now < self._seen:
            # The clock was set: what was seen belongs to another time.
            self.reset()
