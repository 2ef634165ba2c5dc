# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The steps of an experiment, and the courses of strain and pressure that they come to.

A course begins at a strain and at pressures and goes on in legs; along a leg strain and pressures
change linearly. Nothing here knows of files, models or rigs.
"""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate
import math
from typing import get_args

from fam_bundle_ros.errors import InputError

#: Gauge pressures of all motor units, Pa.
Pressures = tuple[float, ...]
#: Lowest and highest strain that a step may ask for.
LEAST_STRAIN, MOST_STRAIN = -0.15, 0.5
#: Pa: pressures that differ by less are equal. s: shorter legs are left out.
_ALIKE, _SHORT = 1.0, 1e-9


@dataclass(frozen=True)
class Leg:
    """A piece of a course: how long it takes, and what holds at its end."""

    #: 0 for a step of the pressures, s.
    seconds: float
    #: None where the load is free to move: no dynamometer is asked for anything.
    strain: float | None
    #: Pa (gauge).
    pressure: Pressures


@dataclass(frozen=True)
class Course:
    """A start, and legs from there."""

    #: What is done, for people.
    words: str
    #: Where it begins; its duration is not used.
    start: Leg
    legs: tuple[Leg, ...]

    @property
    def seconds(self) -> float:
        """How long the legs take together, s."""
        return sum(leg.seconds for leg in self.legs)

    def at(self, time: float) -> tuple[float | None, float, Pressures]:
        """
        Return strain, strain rate (1/s) and pressures (Pa) at a time since the start, s.

        Examples
        --------
        >>> up = Course('up', Leg(0.0, 0.0, (0.0,)), (Leg(10.0, 0.2, (50e3,)),))
        >>> up.at(5.0)
        (0.1, 0.02, (25000.0,))
        >>> up.at(11.0)
        (0.2, 0.0, (50000.0,))
        """
        ends = list(accumulate(leg.seconds for leg in self.legs))
        k = bisect_right(ends, time)
        before = self.legs[k - 1] if k else self.start
        if k == len(self.legs):
            return before.strain, 0.0, before.pressure
        leg = self.legs[k]
        share = min(max(1.0 - (ends[k] - time) / leg.seconds, 0.0), 1.0)
        pressure = tuple(a + share * (b - a) for a, b in zip(before.pressure, leg.pressure))
        if before.strain is None or leg.strain is None:
            return None, 0.0, pressure
        change = leg.strain - before.strain
        return before.strain + share * change, change / leg.seconds, pressure


@dataclass(frozen=True)
class Sweep:
    """
    Isobars: the dynamometer moves the strain up and down while the pressures stay.

    A narrow range with several cycles makes minor loops.
    """

    #: From, and to.
    strain: tuple[float, float]
    #: 1/s.
    rate: float
    #: One course for each, Pa (gauge).
    pressure: tuple[Pressures, ...]
    #: Up and down so many times.
    cycles: int = 1
    kind = 'sweep'

    def __post_init__(self) -> None:
        _positive(self.kind, rate=self.rate, cycles=self.cycles)
        if len(self.strain) != 2 or self.strain[0] == self.strain[1]:
            listed = ', '.join(f'{value:g}' for value in self.strain)
            raise InputError(f'sweep: strain is [{listed}]; expected two strains, [from, to]')

    def courses(self) -> tuple[Course, ...]:
        """Return one course for each of the pressures."""
        low, high = self.strain
        seconds = abs(high - low) / self.rate
        return tuple(Course(
            f'sweep {low:g} to {high:g} and back at {pressure_words(pressure)}',
            Leg(0.0, low, pressure),
            (Leg(seconds, high, pressure), Leg(seconds, low, pressure)) * self.cycles)
            for pressure in self.pressure)


@dataclass(frozen=True)
class Hold:
    """The strain steps and is held after each step, while the pressures stay: relaxation."""

    #: One after the other.
    strain: tuple[float, ...]
    #: At each, s.
    time: float
    #: One course for each, Pa (gauge).
    pressure: tuple[Pressures, ...]
    #: At which the strain steps, 1/s.
    rate: float = 0.5
    kind = 'hold'

    def __post_init__(self) -> None:
        _positive(self.kind, time=self.time, rate=self.rate)

    def courses(self) -> tuple[Course, ...]:
        """Return one course for each of the pressures."""
        courses = []
        for pressure in self.pressure:
            legs, before = [], self.strain[0]
            for strain in self.strain:
                legs += [Leg(abs(strain - before) / self.rate, strain, pressure),
                         Leg(self.time, strain, pressure)]
                before = strain
            courses.append(Course(
                f'hold {", ".join(f"{strain:g}" for strain in self.strain)} for {self.time:g} s '
                f'each at {pressure_words(pressure)}', Leg(0.0, self.strain[0], pressure),
                _lasting(legs)))
        return tuple(courses)


@dataclass(frozen=True)
class PressureSteps:
    """The pressures step, and are held after each step."""

    #: One after the other, all in one course, Pa (gauge).
    pressure: tuple[Pressures, ...]
    #: At each, s.
    time: float
    #: That a dynamometer holds; without it the load is free to move.
    strain: float | None = None
    #: The whole row so many times.
    cycles: int = 1
    kind = 'pressure_steps'

    def __post_init__(self) -> None:
        _positive(self.kind, time=self.time, cycles=self.cycles)
        _several(self.kind, self.pressure)

    def courses(self) -> tuple[Course, ...]:
        """Return one course."""
        legs: list[Leg] = []
        for pressure in self.pressure * self.cycles:
            legs += [Leg(0.0, self.strain, pressure), Leg(self.time, self.strain, pressure)]
        return (Course(f'pressure steps, {self.time:g} s each, '
                       + _up_to(self.pressure, self.strain),
                       Leg(0.0, self.strain, self.pressure[0]), tuple(legs)),)


@dataclass(frozen=True)
class PressureSweep:
    """The pressures move to the next and back: how strain is swept without a dynamometer."""

    #: Two or more; all in one course, Pa (gauge).
    pressure: tuple[Pressures, ...]
    #: Of the motor unit whose pressure changes most, Pa/s.
    rate: float
    #: That a dynamometer holds; without it the load is free to move.
    strain: float | None = None
    #: There and back so many times.
    cycles: int = 1
    kind = 'pressure_sweep'

    def __post_init__(self) -> None:
        _positive(self.kind, rate=self.rate, cycles=self.cycles)
        _several(self.kind, self.pressure)

    def courses(self) -> tuple[Course, ...]:
        """Return one course."""
        legs, before = [], self.pressure[0]
        for pressure in (*self.pressure[1:], *self.pressure[-2::-1]) * self.cycles:
            way = max(abs(a - b) for a, b in zip(before, pressure))
            legs.append(Leg(way / self.rate, self.strain, pressure))
            before = pressure
        return (Course(f'pressure sweep {_up_to(self.pressure, self.strain)}',
                       Leg(0.0, self.strain, self.pressure[0]), _lasting(legs)),)


@dataclass(frozen=True)
class Pause:
    """A wait with the muscle vented; a random order exchanges no segments across it."""

    time: float
    kind = 'pause'

    def __post_init__(self) -> None:
        _positive(self.kind, time=self.time)

    def courses(self) -> tuple[Course, ...]:
        """Return no course: nothing is recorded."""
        return ()


#: A step of an experiment: one course, or one for each of several pressures.
Step = Sweep | Hold | PressureSteps | PressureSweep | Pause
#: By the name in a file.
STEPS: dict[str, type[Step]] = {step.kind: step for step in get_args(Step)}


def pressure_words(pressure: Pressures) -> str:
    """
    Return pressures in words.

    Examples
    --------
    >>> pressure_words((68947.6, 0.0))
    '68.9, 0 kPa'
    """
    return f'{", ".join(f"{value / 1e3:.3g}" for value in pressure)} kPa'


def alike(first: Pressures, second: Pressures) -> bool:
    """Return whether pressures are the same to 1 Pa."""
    return all(abs(a - b) < _ALIKE for a, b in zip(first, second))


def _up_to(pressures: tuple[Pressures, ...], strain: float | None) -> str:
    """Return the highest pressures, and the strain if it is imposed, in words."""
    highest = tuple(map(max, zip(*pressures)))
    return f'up to {pressure_words(highest)}' + (
        '' if strain is None else f' at strain {strain:.3g}')


def _lasting(legs: list[Leg]) -> tuple[Leg, ...]:
    return tuple(leg for leg in legs if leg.seconds > _SHORT)


def _positive(kind: str, **values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise InputError(f'{kind}: {name} is {value:g}; expected more than 0')


def _several(kind: str, pressure: tuple[Pressures, ...]) -> None:
    if len(pressure) < 2 or all(alike(pressure[0], each) for each in pressure):
        raise InputError(f'{kind}: pressure does not change; expected two or more')
