# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""References between their messages: extrapolation, lasting misses."""

from collections.abc import Mapping
from dataclasses import replace

from fam_bundle_ros.control import Reference
from fam_bundle_ros.told import number

#: References with longer intervals than this are steps, s.
_PAUSE = 0.5
#: The messages have stopped when their age exceeds this multiple of their interval.
_LATE = 2.0
#: Longest extrapolation of a reference, in intervals.
_AHEAD = 1.4
#: Weight of a new interval in the running mean.
_SHARE = 0.25
#: Time for which errors last longer than they are absent, beyond that of a transient, s.
_PATIENCE = 2.0
_UNITS = {'force': ' N', 'strain': ''}
#: What the saturation of the command says about a reference that is missed.
_REACH = {'high': 'out of reach, by the model no pressures give more force',
          'low': 'out of reach, by the model no pressures give less force',
          'gap': 'not in reach of the present recruitment state',
          '': 'the pressures are not at their limits'}
_ENDS = 'high', 'low'


class MovingReference:
    """
    The last reference, extrapolated along its rate until the next one arrives.

    Controllers run at a higher rate than references arrive: a ramp that is held in between would
    become a staircase. The jitter of the messages is smoothed, or the ramp would jump with each.
    """

    def __init__(self) -> None:
        #: As received.
        self.last: Reference | None = None
        self._came = self._interval = 0.0
        #: Extrapolated minus new value at the arrival of the last reference.
        self._ahead = 0.0

    def take(self, reference: Reference, now: float) -> None:
        """Take a reference that arrived at ``now``, s."""
        interval, before = now - self._came, self.at(now)
        moves = abs(reference.rate or 0.0) * self._interval
        self._ahead = 0.0
        if (self.last and before and self._interval > 0.0 and before.kind == reference.kind
                and abs(before.value - reference.value) < moves):
            self._ahead = before.value - reference.value
        if not (self.last and 0.0 < interval <= _PAUSE):
            interval = 0.0
        elif self._interval > 0.0:
            interval = self._interval + _SHARE * (interval - self._interval)
        self._interval = interval
        self.last, self._came = reference, now

    def at(self, now: float) -> Reference | None:
        """Return the reference at ``now`` (s), extrapolated until the next one is overdue."""
        reference, age = self.last, max(now - self._came, 0.0)
        if reference is None or not reference.rate:
            return reference
        if age > _LATE * self._interval:
            return replace(reference, rate=0.0)
        ahead = reference.rate * min(age, _AHEAD * self._interval)
        if self._interval > 0.0:
            ahead += self._ahead * max(1.0 - age / self._interval, 0.0)
        return replace(reference, value=reference.value + ahead)


class OffTarget:
    """
    Notices a reference that is missed for longer than a transient takes.

    The time on target is subtracted: a reference that moves crosses a wrong reading again and
    again. ``limits`` are the largest errors of ``force`` (N) and ``strain`` at which the reference
    counts as reached.

    Examples
    --------
    >>> watch = OffTarget({'force': 5.0, 'strain': 0.02})
    >>> for now in (0.0, 3.0):
    ...     watch.update(now, Reference('force', 60.0), {'force': 23.0, 'strain': 0.1})
    >>> watch.text
    'force is 23 N, reference is 60 N, for 3.0 s: the pressures are not at their limits'
    >>> watch.update(3.0, Reference('force', 60.0), {'force': 2.0, 'strain': 0.28}, 'high')
    >>> print(watch.text.partition(': ')[2])
    out of reach, by the model no pressures give more force at a strain of 0.28
    """

    def __init__(self, limits: Mapping[str, float]):
        self._limits = limits
        self.reset()

    def reset(self) -> None:
        """Start again, without a reference."""
        self._seen: float | None = None
        self._missed = self._since = 0.0
        #: Which quantity is off its reference, as text; empty for none.
        self.text = ''

    def update(self, now: float, reference: Reference, measured: Mapping[str, float],
               saturated: str = '') -> None:
        """
        Compare a reference with its reading at a time, s.

        ``measured`` has ``force`` (N) and ``strain``, nan for a missing one; ``saturated`` is that
        of a `Command`.
        """
        kind = reference.kind
        if kind not in self._limits:
            # Pressure errors are watched by the pressure loops.
            self.reset()
            return
        value = measured[kind]
        # nan is not an error here: the sensor watch reports it.
        off = abs(value - reference.value) > self._limits[kind]
        passed = 0.0 if self._seen is None else max(now - self._seen, 0.0)
        self._seen = now
        if self._missed == 0.0:
            self._since = now - passed
        self._missed = min(max(self._missed + (passed if off else -passed), 0.0), _PATIENCE)
        unit = _UNITS[kind]
        # A strain sensor that is wrong has other forces out of reach than the muscles.
        where = f" at a strain of {number(measured['strain'])}" if saturated in _ENDS else ''
        self.text = (f'{kind} is {number(value)}{unit}, reference is '
                     f'{number(reference.value)}{unit}, for {now - self._since:.1f} s: '
                     f'{_REACH[saturated]}{where}'
                     ) if off and self._missed >= _PATIENCE else ''
