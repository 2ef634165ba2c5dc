# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
An experiment sample by sample: the present strain and pressure references of the rig. No ROS.

For each segment: wait if there is a pause, move the dynamometer to the start, fill, wait until the
pressures are reached and have settled, then follow the course and record every sample.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
import math

from fam_bundle_ros.data.protocol import Protocol, Segment
from fam_bundle_ros.data.segment_store import Row
from fam_bundle_ros.data.steps import alike, Pressures

#: Averaging time of the pressures, and time-out until they are reached, s.
_MEAN, _FILLING = 0.3, 20.0
#: Tolerance of a reached pressure: share of the protocol's highest pressure, at least Pa.
_THERE_SHARE, _THERE = 0.01, 2e3
#: Tolerance of a reached strain, and additional time for reaching it, s.
_ARRIVED, _ARRIVING = 3e-3, 5.0
#: Tolerated difference of the controller's setpoints from the references, Pa, and for how long, s.
_OBEYS, _OBEYING = 5e3, 1.0
#: Successive samples beyond the force limit that stop the experiment; one may be a spike.
_SPIKE = 3
#: Time without a sample after which a segment is repeated, s, and largest number of its runs.
_GAP, _TRIES = 0.5, 3


class Stopped(Exception):
    """The experiment cannot continue, for the reason in the text; all units must be vented."""


class _Gap(Exception):
    """Samples are missing in a segment; the text gives the duration."""


@dataclass(frozen=True)
class Seen:
    """A sample of the rig, with the controller's pressure setpoints."""

    #: s.
    time: float
    #: N.
    force: float
    strain: float
    #: A setpoint is nan before the first is received, Pa (gauge).
    pressure: Pressures
    setpoint: Pressures

    @property
    def whole(self) -> bool:
        """Whether every reading is finite."""
        return math.isfinite(self.force + self.strain + sum(self.pressure))


@dataclass(frozen=True)
class Asked:
    """Strain and pressure references for the rig."""

    #: None without a reference for a dynamometer.
    strain: float | None
    #: 1/s.
    rate: float
    #: Pa (gauge).
    pressure: Pressures


class ProtocolRun:
    """
    A running experiment.

    ``todo`` are the segments still to be run, in order; ``keep`` is called with each complete
    segment and its rows.
    """

    def __init__(self, protocol: Protocol, todo: Sequence[Segment],
                 keep: Callable[[Segment, list[Row]], None]):
        self._protocol, self._todo, self._keep = protocol, list(todo), keep
        self._pressure = (0.0,) * protocol.motor_units
        self._place: float | None = None
        self._beyond = 0
        self._disobeyed: float | None = None
        self._passed = 0.0
        self._begun = 0.0
        self._script = self._run()
        self._seen: Seen
        self._asked: Asked | None = None
        self.done = False
        #: Present step, for messages.
        self.words = 'waiting for the rig'

    @property
    def left(self) -> float:
        """Estimated time left, s of the rig's time."""
        return max(sum(segment.duration for segment in self._todo) - self._passed, 0.0)

    def step(self, seen: Seen) -> Asked:
        """
        Take a sample; return the references to send now.

        Raises
        ------
        Stopped
            For a force beyond its limit, or if rig or controller do not follow.
        """
        if self._asked is not None and seen.time - self._seen.time > _GAP:
            # After a gap the controller may not have received the references yet.
            self._disobeyed = None
        self._seen = seen
        self._look(seen)
        self._passed = seen.time - self._begun
        asked = next(self._script, None)
        if asked is None:
            self.done, self.words = True, 'done'
            asked = Asked(None, 0.0, (0.0,) * self._protocol.motor_units)
        self._asked = asked
        return asked

    def _look(self, seen: Seen) -> None:
        limit = self._protocol.limits.force
        self._beyond = self._beyond + 1 if abs(seen.force) > limit else 0
        if self._beyond >= _SPIKE:
            raise Stopped(f'force is {seen.force:.4g} N, beyond the limit of {limit:g} N')
        asked = self._asked
        # A unit without a received setpoint (nan) counts as not following.
        if asked is None or all(abs(a - b) < _OBEYS for a, b in zip(asked.pressure,
                                                                    seen.setpoint)):
            self._disobeyed = None
        elif self._disobeyed is None:
            self._disobeyed = seen.time
        elif seen.time - self._disobeyed > _OBEYING:
            raise Stopped(f'the setpoint is {_kilopascals(seen.setpoint)} instead of '
                          f'{_kilopascals(asked.pressure)}')

    # --- the script: each yield is a sample -----------------------------------------------------

    def _run(self) -> Generator[Asked, None, None]:
        tries, again = 0, ''
        while self._todo:
            segment = self._todo[0]
            self._begun, where = self._seen.time, f'segment {segment.number}{again}'
            if segment.pause:
                self.words = f'{where}: pause of {segment.pause:g} s'
                self._pressure = (0.0,) * self._protocol.motor_units
                yield from self._wait(segment.pause)
            self.words = f'{where}: on the way'
            yield from self._travel(segment.course.start.strain)
            yield from self._fill(segment.course.start.pressure)
            yield from self._wait(self._protocol.settle)
            self.words = f'{where}: {segment.course.words}'
            try:
                rows = yield from self._record(segment)
            except _Gap as gap:
                tries += 1
                if tries == _TRIES:
                    raise Stopped(f'{where}: {gap}') from gap
                # A delay of the computer must not end an experiment of hours.
                again = f' again ({gap})'
                continue
            self._keep(segment, rows)
            self._todo.pop(0)
            tries, again = 0, ''
            self._begun, self._passed = self._seen.time, 0.0

    def _hold(self) -> Asked:
        return Asked(self._place, 0.0, self._pressure)

    def _wait(self, seconds: float) -> Generator[Asked, None, None]:
        begin = self._seen.time
        while self._seen.time - begin < seconds:
            yield self._hold()

    def _travel(self, strain: float | None) -> Generator[Asked, None, None]:
        """Move the dynamometer at its travelling rate, at constant pressures."""
        if strain is None:
            self._place = None
            return
        while not self._seen.whole:
            yield self._hold()
        # From the measured strain, as the dynamometer may have been moved in the meantime.
        origin, begin = self._seen.strain, self._seen.time
        if abs(strain - origin) > _ARRIVED:
            seconds = abs(strain - origin) / self._protocol.travel
            rate = (strain - origin) / seconds
            while (now := self._seen.time - begin) < seconds:
                yield Asked(origin + rate * now, rate, self._pressure)
        self._place = strain
        arrived = self._seen.time
        while not abs(self._seen.strain - strain) <= _ARRIVED:
            if self._seen.time - arrived > _ARRIVING:
                raise Stopped(f'strain is {self._seen.strain:.4g}, {strain:.4g} is the setpoint: '
                              'the dynamometer does not follow')
            yield self._hold()

    def _fill(self, pressure: Pressures) -> Generator[Asked, None, None]:
        """Send pressure references and wait until they are reached."""
        fresh = not alike(pressure, self._pressure)
        self._pressure, begin = pressure, self._seen.time
        near = max(_THERE, _THERE_SHARE * max(self._protocol.highest))
        last: list[Seen] = []
        while True:
            last = [*(each for each in last if self._seen.time - each.time < _MEAN),
                    *([self._seen] if self._seen.whole else [])]
            means = [sum(each.pressure[k] for each in last) / max(len(last), 1)
                     for k in range(len(pressure))]
            waited = self._seen.time - begin >= _MEAN or not fresh
            if last and waited and all(abs(a - b) < near for a, b in zip(means, pressure)):
                return
            if self._seen.time - begin > _FILLING:
                raise Stopped(f'pressure is {_kilopascals(tuple(means))}, '
                              f'{_kilopascals(pressure)} is the setpoint since {_FILLING:g} s')
            yield self._hold()

    def _record(self, segment: Segment) -> Generator[Asked, None, list[Row]]:
        course, begin = segment.course, self._seen.time
        rows: list[Row] = []
        heard, step = begin, 0.0
        while (now := self._seen.time - begin) <= course.seconds:
            seen = self._seen
            if seen.whole:
                rows.append(Row(seen.time, seen.strain, seen.pressure, seen.force))
                heard = seen.time
            elif seen.time - heard > _GAP:
                raise Stopped(f'segment {segment.number}: no whole sample for '
                              f'{seen.time - heard:.2f} s')
            self._place, rate, self._pressure = course.at(now)
            ahead, _, _ = course.at(now + step)
            if ahead is not None and self._place is not None and step > 0.0:
                # the mean rate until the next sample: the rate of the leg would overshoot its end
                rate = (ahead - self._place) / step
            yield Asked(self._place, rate, self._pressure)
            step = self._seen.time - seen.time
            if step > _GAP:
                raise _Gap(f'nothing came for {step:.2f} s')
        self._place, _, self._pressure = course.at(course.seconds)
        return rows


def _kilopascals(pressure: Pressures) -> str:
    return f'{", ".join(f"{value / 1e3:.1f}" for value in pressure)} kPa'
