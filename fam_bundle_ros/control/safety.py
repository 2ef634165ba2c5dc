# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Safety of a node: checks of its input channels, and a state machine that holds, vents or latches.

Used by the recruitment controller and by the pressure loops alike. `plausibility` has the checks
of readings against each other. Pressure limits, lowest first: the controllers trip
at `trip_pressure` (``over_pressure_factor`` times a motor unit's largest pressure: 396 kPa for the
paper's bundle); the simulated rig trips at 450 kPa (`RigConfig.trip_pressure`), and its relief
valves begin to open at 500 kPa (`ChamberConfig.relief_pressure`) and are open at 520 kPa.

Independent of ROS. Times are in s, on one clock of the caller.
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
#: Readings are older than `max_latency` on arrival.
LATE = 'LATE'
#: A reading repeats exactly although it must move.
FROZEN = 'FROZEN'
#: No usable reading for longer than `resume_within`.
LOST = 'LOST'
#: A pressure loop is silent.
PID_LOST = 'PID_LOST'
#: Another controller acts on the same rig, or another rig sends on the same topics.
OTHER = 'OTHER'
#: The process itself was stalled.
STOPPED = 'STOPPED'

#: Default of ``over_pressure_factor``.
OVER_PRESSURE_FACTOR = 1.15
#: s: default of ``hold_time``. At 100 Hz and faster valves exhaust within 50 ms of the first bad
#: reading; after shorter losses the pressures are unchanged.
HOLD_TIME = 0.04
#: s: late stamps or a wrong supply for longer latch the node until `enable`; a computer that was
#: busy for less has only lost some readings.
LATCH_TIME = 0.2
#: Length of the history of state changes.
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
    """Return a pressure (Pa) as text in kPa, short for any size."""
    value = pressure / 1e3
    return f'{round(value)} kPa' if abs(value) < 1e5 else f'{value:.3g} kPa'


class State(Enum):
    """State of a node."""

    #: Vented: an input has not arrived yet.
    WAITING = 'WAITING'
    #: Ready to be enabled; vented or venting.
    READY = 'READY'
    ACTIVE = 'ACTIVE'
    #: A reading cannot be trusted: pressures kept for a moment.
    HOLD = 'HOLD'
    #: Vented; resumes by itself when the cause is gone.
    VENT = 'VENT'
    #: Vented until it is enabled again.
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

    Every change has a reason and a time. LATCHED is entered only by `latch` and left only by
    `release`.

    Parameters
    ----------
    announce : callable, optional
        Called with each `Change` of state or cause.

    Attributes
    ----------
    now : Change
        The present state.
    history : deque of Change
        The last changes, the newest at the end.

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
        """Whether the node stays vented until `release`."""
        return self.now.state is State.LATCHED

    @property
    def word(self) -> str:
        """Return the cause, or the state if there is no cause."""
        return self.now.cause or self.now.state.value

    def enter(self, now: float, state: State, cause: str = '', reason: str = '') -> None:
        """Go to a state that is not LATCHED; does nothing while latched."""
        if state is State.LATCHED:
            raise ValueError('LATCHED is entered by latch()')
        if not self.latched:
            self._go(now, state, cause, reason)

    def latch(self, now: float, cause: str, reason: str) -> bool:
        """Vent until `release`; return whether this is a new latch. The first cause is kept."""
        if self.latched:
            return False
        self._go(now, State.LATCHED, cause, reason)
        return True

    def release(self, now: float) -> None:
        """Leave LATCHED, by a decision of the user."""
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
    Total time for which an input is lost, reset when it has been back for long enough.

    So short recoveries of an intermittent input do not restart the time.

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
        """Reset."""
        self._seen: float | None = None
        self._lost = 0.0
        self._there: float | None = None
        self._was_lost = False

    def see(self, now: float, lost: bool, patience: float) -> bool:
        """
        Return whether the input is lost now and was lost for ``patience`` (s) in total.

        The total is reset after ``patience`` without a loss. ``now`` in s.
        """
        if self._seen is not None and now < self._seen:
            # The clock was set back.
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


#: Exact repeats of a moving reading that show a fault: with noise of a few digits one reading in
#: ten repeats by chance. A long gap before a repeat counts no more than a short one.
_REPEATS = 5


class Health(IntEnum):
    """Health of a channel, worst last."""

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
        A channel without a reading for longer is stale.
    hold_time : float, s
        A channel that is bad for longer is out (VENT).
    recovery_time : float, s
        A channel is back when it has been good again for this time.
    stuck_time : float, s
        A reading that repeats exactly for this time, while it should move, is stuck; 0 for never.
    max_latency : float, s
        A reading that is older on arrival, or further in the future, is late.
    below : str
        Probable cause of a reading below ``low``, for the message.
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
    Checks of one channel: timeout, latency, finite, within its range, not stuck.

    A reading that fails is ignored from its first sample on (hold); when that lasts, the channel
    is out (vent) until it has been good again for a while.

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
    (<Health.VENT: 3>, 'force is nan; no reading for 0.49 s')
    """

    def __init__(self, name: str, unit: str, config: WatchConfig):
        self.name = name
        self.unit = unit
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Reset to the state before the first reading."""
        self.health = Health.WAITING
        #: Why the health is not GOOD, as text.
        self.reason = f'no {self.name} yet'
        self._seen: float | None = None
        self._good: float | None = None
        self._good_since: float | None = None
        self._out = False
        self._value = math.nan
        self._moving = 0.0
        #: What is wrong with the last reading, and with the last time it was not good, as text.
        self._fault = self._lost = ''
        #: Since when every reading has been late; one after a stall does not show a clock error.
        self._late_since: float | None = None
        self._stuck = False

    @property
    def age(self) -> float | None:
        """Return when the last reading came, on the caller's clock; None before the first."""
        return self._seen

    @property
    def cause(self) -> str:
        """Cause for which a channel that is out must not recover by itself; empty if it may."""
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
        if value != self._value or math.isinf(value) or not (moving or stuck):
            self._moving = 0.0
        elif moving:
            # A stuck reading stays stuck while the valve is shut, where a repeat is expected.
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
        """Reset the count of exact repeats: the user has accepted this reading."""
        self._moving = 0.0

    def check(self, now: float, awaited: str = 'reading') -> Health:
        """Update and return the health; call it also while nothing ``awaited`` arrives."""
        self._notice_reset(now)
        config = self.config
        if self._seen is None:
            return self.health
        reason = self._fault
        silence = now - self._seen
        if silence > config.timeout:
            late = f'no {awaited} for {silence:.2f} s'
            reason = f'{reason}; {late}' if reason else f'{self.name}: {late}'
        if reason:
            self._lost = reason
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
                reason = f'{self._lost}; good again, but not yet for {config.recovery_time:g} s'
        self.reason = reason
        self.health = (Health.VENT if self._out else Health.HOLD) if reason else Health.GOOD
        return self.health

    def _notice_reset(self, now: float) -> None:
        if self._seen is not None and now < self._seen:
            # The clock was set back: earlier times are invalid.
            self.reset()


def _late_text(name: str, latency: float, most: float) -> str:
    if latency > 1e6:
        return f'{name} has no time stamp, or one of another clock than ROS time'
    if latency < -1e6:
        return (f'{name} is stamped {-latency:.3g} s in the future: is use_sim_time on, and '
                'nobody publishes /clock?')
    if latency < 0.0:
        return (f'{name} is stamped {-latency:.3g} s in the future: the clocks of rig and '
                'controller disagree')
    return (f'{name} is {latency:.3g} s old on arrival; at most {most:.3g} s is allowed '
            '(max_latency); if it stays so, do the clocks of rig and controller agree?')
