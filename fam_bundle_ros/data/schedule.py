# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What an experiment is and comes to: steps within limits, as numbered segments in their order.

`protocol` reads and writes it.
"""

from dataclasses import dataclass, field
import math
import random

from fam_bundle_ros.data.steps import (
    alike,
    Course,
    LEAST_STRAIN,
    MOST_STRAIN,
    Pause,
    pressure_words,
    Pressures,
    Step,
    STEPS,
)
from fam_bundle_ros.errors import InputError

#: s: time assumed for the pressures to reach their setpoints.
FILL = 1.0
#: Orders of the segments.
WRITTEN, RANDOM = 'as written', 'random'
#: Most segments of an experiment; more are probably a typing error.
_MOST = 10_000


@dataclass(frozen=True)
class Limits:
    """What the experiment must not exceed; the force is checked while it runs, commands before."""

    #: Pa (gauge).
    pressure: float = 1e6
    strain: tuple[float, float] = (LEAST_STRAIN, MOST_STRAIN)
    #: Tension or push; beyond it all is vented and the experiment ends, N.
    force: float = math.inf


@dataclass(frozen=True)
class Protocol:
    """
    An experiment.

    Parameters
    ----------
    name : str
        What it is, in a few words.
    motor_units : int
    steps : tuple of Step
    limits : Limits
    settle : float, s
        Waited at the start of each segment once the pressures are there.
    travel : float, 1/s
        Strain rate of the dynamometer between segments.
    order : str
        ``as written`` or ``random``; segments are not exchanged across a `Pause`.
    seed : int
        Of the random order.
    repeats : int
        All steps so many times, each time in another random order.
    notes : str

    Raises
    ------
    InputError
        Where a value makes no sense or a step goes beyond the limits; it names the step.
    """

    name: str
    motor_units: int
    steps: tuple[Step, ...]
    limits: Limits = field(default_factory=Limits)
    settle: float = 1.0
    travel: float = 0.1
    order: str = WRITTEN
    seed: int = 0
    repeats: int = 1
    notes: str = ''

    def __post_init__(self) -> None:
        for name in ('motor_units', 'repeats', 'travel'):
            if not getattr(self, name) > 0:
                raise InputError(f'{name} is {getattr(self, name)}; expected more than 0')
        if not 0.0 <= self.settle < math.inf:
            raise InputError(f'settle is {self.settle:g} s; expected 0 s or more')
        if self.order not in (WRITTEN, RANDOM):
            raise InputError(f"order is '{self.order}'; expected '{WRITTEN}' or '{RANDOM}'")
        low, high = self.limits.strain
        if not LEAST_STRAIN <= low < high <= MOST_STRAIN:
            raise InputError(f'limits: strain is [{low:g}, {high:g}]; expected two rising strains '
                             f'from {LEAST_STRAIN:g} to {MOST_STRAIN:g}')
        if not (self.limits.pressure > 0.0 and self.limits.force > 0.0):
            raise InputError('limits: pressure or force is not above 0')
        for k, step in enumerate(self.steps, 1):
            for course in step.courses():
                self._check(course, f'step {k} ({step.kind})')
        if not self.courses:
            raise InputError('steps: nothing to record; expected one of '
                             + ', '.join(name for name in STEPS if name != Pause.kind))

    def _check(self, course: Course, where: str) -> None:
        low, high = self.limits.strain
        for leg in (course.start, *course.legs):
            if len(leg.pressure) != self.motor_units:
                raise InputError(f'{where}: {len(leg.pressure)} pressures; expected one for each '
                                 f'of the {self.motor_units} motor units')
            if leg.strain is not None and not low <= leg.strain <= high:
                raise InputError(f'{where}: strain {leg.strain:g} is outside the limits '
                                 f'{low:g} to {high:g}')
            if not all(0.0 <= value <= self.limits.pressure + 1e-6 for value in leg.pressure):
                raise InputError(
                    f'{where}: pressure {pressure_words(leg.pressure)} is outside the limits 0 to '
                    f'{self.limits.pressure / 1e3:.4g} kPa')

    @property
    def courses(self) -> tuple[Course, ...]:
        """What is to be done, in the order in which it is written."""
        return tuple(course for step in self.steps for course in step.courses())

    @property
    def highest(self) -> Pressures:
        """The highest pressure of each motor unit, Pa (gauge)."""
        return tuple(map(max, zip(*(leg.pressure for course in self.courses
                                    for leg in (course.start, *course.legs)))))

    @property
    def imposes_strain(self) -> bool:
        """Whether a dynamometer is needed."""
        return any(course.start.strain is not None for course in self.courses)


@dataclass(frozen=True)
class Segment:
    """A course with its place in the experiment: one trial."""

    #: From 1, in the order in which they are run.
    number: int
    course: Course
    #: Waited before, vented, s.
    pause: float
    #: Reckoned to be needed to get to the start of the course: way, filling, settling, s.
    before: float

    @property
    def duration(self) -> float:
        """Duration with the pause and the approach before it, s."""
        return self.pause + self.before + self.course.seconds


def segments(protocol: Protocol) -> tuple[Segment, ...]:
    """Return the segments in the order in which they run; a protocol always gives the same."""
    chance = random.Random(protocol.seed)
    planned: list[tuple[float, Course]] = []
    pause = 0.0
    for _ in range(protocol.repeats):
        block: list[Course] = []
        for step in (*protocol.steps, None):
            if step is not None and not isinstance(step, Pause):
                block += step.courses()
                continue
            if protocol.order == RANDOM:
                chance.shuffle(block)
            for course in block:
                planned.append((pause, course))
                pause = 0.0
            block = []
            pause += step.time if isinstance(step, Pause) else 0.0
    if len(planned) > _MOST:
        raise InputError(f'{protocol.name}: {len(planned)} segments; expected at most {_MOST}')
    result, place, pressure = [], planned[0][1].start.strain, (0.0,) * protocol.motor_units
    for number, (waited, course) in enumerate(planned, 1):
        start = course.start
        way = 0.0 if place is None or start.strain is None else abs(start.strain - place)
        filled = 0.0 if alike(pressure, start.pressure) and not waited else FILL
        result.append(Segment(number, course, waited,
                              way / protocol.travel + filled + protocol.settle))
        last = course.legs[-1]
        place, pressure = last.strain if last.strain is not None else place, last.pressure
    return tuple(result)


def duration(protocol: Protocol) -> float:
    """Return the duration of an experiment, s, with `FILL` for each change of pressure."""
    return sum(segment.duration for segment in segments(protocol))


def minutes(seconds: float) -> str:
    """
    Return a time in words.

    Examples
    --------
    >>> minutes(42.0), minutes(381.0), minutes(7260.0)
    ('42 s', '6 min 21 s', '2 h 1 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f'{whole} s'
    if whole < 3600:
        return f'{whole // 60} min {whole % 60} s'
    return f'{whole // 3600} h {whole % 3600 // 60} min'
