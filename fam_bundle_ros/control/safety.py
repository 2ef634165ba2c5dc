# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What makes a node stop: watches over its channels, one state machine, one door for latches.

Used by the recruitment controller and by the pressure loops alike. `plausibility` has the checks
of readings against each other. The pressures that stop things, lowest first: the controllers trip
at `trip_pressure` (``over_pressure_factor`` times a motor unit's largest pressure: 396 kPa for the
paper's bundle); the simulated rig trips at 450 kPa (`RigConfig.trip_pressure`), and its relief
valves begin to open at 480 kPa and are open at 500 kPa (`ChamberConfig.relief_pressure`).

Knows nothing of ROS. Times are of one clock of the caller, s.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum
import math

#: Causes of latches.
OVER_PRESSURE = 'OVER_PRESSURE'
#: The pressure shown does not rise with the air that is let in.
NO_RESPONSE = 'NO_RESPONSE'
#: The pressure shown is higher than the air that is let in allows.
UNEXPLAINED_PRESSURE = 'UNEXPLAINED_PRESSURE'
#: The supply contradicts its parameter.
SUPPLY = 'SUPPLY'
#: The force contradicts the pressures.
FORCE = 'FORCE'
#: Readings are older than `max_latency` when they come.
LATE = 'LATE'
#: A reading repeats exactly although it must move.
FROZEN = 'FROZEN'
#: No usable reading for longer than `resume_within`.
LOST = 'LOST'
#: A pressure loop is silent.
PID_LOST = 'PID_LOST'
#: Another controller acts on the same rig.
OTHER = 'OTHER'
#: The process itself stood still.
STOPPED = 'STOPPED'

#: Default of ``over_pressure_factor``.
OVER_PRESSURE_FACTOR = 1.15
#: s: default of ``hold_time``. At 100 Hz and faster valves exhaust within 50 ms of the first bad
#: reading; shorter losses cost no pressure.
HOLD_TIME = 0.04
#: s that late stamps or a wrong supply have to last before only `enable` leads on: a machine that
#: was busy for less has lost nothing but some readings.
LATCH_TIME = 0.2
#: How many changes of state are remembered.
_HISTORY = 64


def trip_pressure(max_pressure: float, factor: float = OVER_PRESSURE_FACTOR) -> float:
    """
    Return the gauge pressure above which a motor unit is vented and latched, Pa.

    Examples
    --------
    >>> print(f'{trip_pressure(344.7e3) / 1e3:.0f} kPa')
    396 kPa
    """
    return factor * max_pressure


def kilopascals(pressure: float) -> str:
    """Return a pressure in words, short whatever its size."""
    value = pressure / 1e3
    return f'{value:.0f} kPa' if abs(value) < 1e5 else f'{value:.3g} kPa'


class State(Enum):
    """What a node does about its part of the bundle."""

    #: Something is missing that has never been there; vented.
    WAITING = 'WAITING'
    #: Could act and is not asked to; vented or on the way.
    READY = 'READY'
    ACTIVE = 'ACTIVE'
    #: A reading cannot be trusted: pressures kept for a moment.
    HOLD = 'HOLD'
    #: Vented; goes on by itself when the reason is gone.
    VENT = 'VENT'
    #: Vented until somebody enables again.
    LATCHED = 'LATCHED'


@dataclass(frozen=True)
class Change:
    """A change of state: when (s), to what, for which cause (one word) and reason (a sentence)."""

    time: float
    state: State
    cause: str
    reason: str


class Guard:
    """
    The state machine of a node.

    Every change has a reason and a time. `latch` is the one door into LATCHED, `release` the one
    way out.

    Parameters
    ----------
    announce : callable, optional
        Gets each `Change` of state or cause.

    Attributes
    ----------
    now : Change
        The present state.
    history : deque of Change
        The last ones, the newest at the end.

    Examples
    --------
    >>> guard = Guard()
    >>> guard.enter(0.0, State.ACTIVE)
    >>> guard.latch(1.0, OVER_PRESSURE, 'mu1 at 410 kPa, above 396 kPa')
    True
    >>> guard.enter(2.0, State.ACTIVE)
    >>> guard.word, guard.now.time
    ('OVER_PRESSURE', 1.0)
    >>> guard.release(3.0)
    >>> guard.word
    'READY'
    """

    def __init__(self, announce: Callable[[Change], None] = lambda change: None):
        self._announce = announce
        self.now = Change(0.0, State.WAITING, '', '')
        self.history: deque[Change] = deque([self.now], maxlen=_HISTORY)

    @property
    def latched(self) -> bool:
        """Whether only `release` leads on."""
        return self.now.state is State.LATCHED

    @property
    def word(self) -> str:
        """Return the cause, or where there is none the state."""
        return self.now.cause or self.now.state.value

    def enter(self, now: float, state: State, cause: str = '', reason: str = '') -> None:
        """Go to a state that is not LATCHED; does nothing while latched."""
        if state is State.LATCHED:
            raise ValueError('LATCHED is entered by latch()')
        if not self.latched:
            self._go(now, state, cause, reason)

    def latch(self, now: float, cause: str, reason: str) -> bool:
        """Vent until `release`; return whether this is new. The first cause stays."""
        if self.latched:
            return False
        self._go(now, State.LATCHED, cause, reason)
        return True

    def release(self, now: float) -> None:
        """Leave LATCHED: somebody has decided to go on."""
        if self.latched:
            self._go(now, State.READY, '', 'enabled again')

    def _go(self, time: float, state: State, cause: str, reason: str) -> None:
        changed = (state, cause) != (self.now.state, self.now.cause)
        if not changed:
            return
        self.now = Change(time, state, cause, reason)
        self.history.append(self.now)
        self._announce(self.now)


class LostTime:
    """
    Adds up the time for which something is lost, until it has stayed for long enough.

    So what comes and goes is not taken for new each time.

    Examples
    --------
    >>> lost = LostTime()
    >>> [lost.see(0.5 * k, k % 3 > 0, 2.0) for k in range(12)]  # lost two times of three
    [False, False, False, False, False, False, False, False, False, False, False, True]
    >>> lost.see(6.0, False, 2.0), lost.see(8.0, False, 2.0), lost.see(8.5, True, 2.0)
    (False, False, False)
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all."""
        self._seen: float | None = None
        self._lost = 0.0
        self._there: float | None = None
        self._was_lost = False

    def see(self, now: float, lost: bool, patience: float) -> bool:
        """
        Take whether it is lost; return whether it was so for ``patience`` (s) in all, and is.

        It is there again after as long a time without a loss.
        """
        if self._seen is not None and now < self._seen:
            # The clock was set.
            self.reset()
        if lost and self._was_lost and self._seen is not None:
            self._lost += now - self._seen
        self._seen, self._was_lost = now, lost
        if lost:
            self._there = None
        elif self._there is None:
            self._there = now
        elif now - self._there >= patience:
            self._lost = 0.0
        return lost and self._lost >= patience


#: Exact repeats of a moving reading that are no coincidence: one in ten repeats where the noise is
#: a few digits. A long silence before a repeat proves no more than a short one.
_REPEATS = 5


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
    max_latency : float, s
        A reading that is older when it comes, or further in the future, is late.
    below : str
        What a reading below ``low`` suggests, for the message.
    """

    low: float
    high: float
    timeout: float = 0.1
    hold_time: float = HOLD_TIME
    recovery_time: float = 0.2
    stuck_time: float = 0.5
    max_latency: float = math.inf
    below: str = ''


class SensorWatch:
    """
    Watches one channel: whether its reading is fresh, in time, a number, possible, alive.

    A reading that fails is worth nothing from its first sample on (hold); when that lasts, the
    channel is out (vent) until it has been good again for a while.

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
        #: Since when every reading has been late; one after a stall is no fault of the clock.
        self._late_since: float | None = None
        self._stuck = False

    @property
    def age(self) -> float | None:
        """Return when the last reading came, on the caller's clock; None before the first."""
        return self._seen

    @property
    def cause(self) -> str:
        """Why a channel that is out must not come back by itself; empty where it may."""
        if self.health != Health.VENT:
            return ''
        if self._late_since is not None and self._seen is not None and (
                self._seen - self._late_since > LATCH_TIME):
            return LATE
        return FROZEN if self._stuck else ''

    def see(self, now: float, value: float, moving: bool = False, latency: float = 0.0) -> Health:
        """
        Take a reading.

        Parameters
        ----------
        now : float, s
        value : float
        moving : bool
            Whether the quantity must be changing now, so that an exact repeat is suspicious.
        latency : float, s
            Age of the reading when it came; below zero when its stamp is in the future.
        """
        self._notice_reset(now)
        config = self.config
        since = now - self._seen if self._seen is not None else 0.0
        stuck = 0.0 < config.stuck_time <= self._moving
        if value != self._value or not (moving or stuck):
            self._moving = 0.0
        elif moving:
            # Once stuck it stays so while nothing moves: a shut valve proves nothing.
            self._moving += min(max(since, 0.0), config.stuck_time / _REPEATS)
        self._seen, self._value = now, value
        possible = config.low <= value <= config.high
        late = possible and not abs(latency) <= config.max_latency
        if not late:
            self._late_since = None
        elif self._late_since is None:
            self._late_since = now
        self._stuck = 0.0 < config.stuck_time <= self._moving
        if not math.isfinite(value):
            self._fault = f'{self.name} is {value}'
        elif not possible:
            shown = f'{value:.6g} {self.unit}'.rstrip()
            hint = f' ({config.below})' if config.below and value < config.low else ''
            self._fault = (f'{self.name} is {shown}, outside {config.low:g} to '
                           f'{config.high:g}{hint}')
        elif late:
            self._fault = _late_text(self.name, latency, config.max_latency)
        elif self._stuck:
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


def _late_text(name: str, latency: float, most: float) -> str:
    if latency > 1e6:
        return f'{name} carries no time stamp'
    if latency < -1e6:
        return (f'{name} is stamped {-latency:.3g} s in the future: is use_sim_time on, and '
                'nobody publishes /clock?')
    if latency < 0.0:
        return (f'{name} is stamped {-latency:.3g} s in the future: the clocks of rig and '
                'controller disagree')
    return (f'{name} is {latency:.3g} s old when it comes; at most {most:.3g} s is taken '
            '(max_latency)')
