# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A reference over time: points joined by lines or smooth steps. No ROS.

Files look like this::

    format: fam-bundle-trajectory/1
    name: up and down
    quantity: force            # or strain
    interpolation: linear      # or smooth: comes to rest at every point
    points:                    # time, value
      - [0 s, 20 N]
      - [5 s, 80 N]
"""

from bisect import bisect_right
from dataclasses import dataclass, replace
import math
from typing import Any

import yaml

from fam_bundle_ros.errors import about, in_short, InputError
from fam_bundle_ros.resources import shipped_or_own
from fam_bundle_ros.units import parse

FORMAT = 'fam-bundle-trajectory/1'
_LIKE = {'force': 'N', 'strain': '1'}
#: Largest plausible references (N, 1); larger ones have a wrong unit.
_LIMITS = {'force': 1e4, 'strain': 0.5}
_KEYS = {'format', 'name', 'quantity', 'interpolation', 'points', 'notes'}


@dataclass(frozen=True)
class Points:
    """
    Points in time; the value is held before the first and after the last.

    Examples
    --------
    >>> up = Points('up', 'force', (0.0, 2.0), (10.0, 20.0))
    >>> up.value(1.0), up.rate(1.0), up.value(5.0), up.rate(5.0)
    (15.0, 5.0, 20.0, 0.0)
    """

    name: str
    #: ``force`` (N) or ``strain``.
    kind: str
    #: Rising, s.
    times: tuple[float, ...]
    values: tuple[float, ...]
    #: Derivatives at the points, for cubic Hermite interpolation; linear without.
    rates: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.kind not in _LIKE:
            raise InputError(f"{self.name}: quantity is '{self.kind}'; expected force or strain")
        if not self.times:
            raise InputError(f'{self.name}: has no points; expected one at least')
        if len(self.values) != len(self.times) or (
                self.rates is not None and len(self.rates) != len(self.times)):
            raise InputError(f'{self.name}: {len(self.times)} times and {len(self.values)} '
                             'values; expected as many')
        for k, (time, value) in enumerate(zip(self.times, self.values)):
            if not (math.isfinite(time) and time >= 0.0 and abs(value) <= _LIMITS[self.kind]):
                raise InputError(f'{self.name}: point {k + 1} is {value:g} at {time:g} s; '
                                 f'expected a time from 0 and {self._bound}')
            if k and not time > self.times[k - 1]:
                raise InputError(f'{self.name}: point {k + 1} is at {time:g} s, not after point '
                                 f'{k} at {self.times[k - 1]:g} s')
            if k and self.rates is not None:
                # Bound of the overshoot of a Hermite cubic: 4/27 of the interval for each rate.
                off = 4.0 / 27.0 * (time - self.times[k - 1]) * (
                    abs(self.rates[k - 1]) + abs(self.rates[k]))
                if not off <= _LIMITS[self.kind]:
                    raise InputError(f'{self.name}: rates of {self.rates[k - 1]:g} and '
                                     f'{self.rates[k]:g} per s lead off by up to {off:.3g} '
                                     f'between points {k} and {k + 1}; expected {self._bound}')

    @property
    def _bound(self) -> str:
        """What a value must be, in words."""
        return (f'a force up to {_LIMITS[self.kind]:g} N' if self.kind == 'force' else
                f'a strain (contraction over length) up to {_LIMITS[self.kind]:g}')

    @property
    def duration(self) -> float:
        """Time of the last point, s."""
        return self.times[-1]

    def value(self, time: float) -> float:
        """Return the reference at a time."""
        return self._at(time)[0]

    def rate(self, time: float) -> float:
        """Return the derivative of the reference at a time, 1/s."""
        return self._at(time)[1]

    def _at(self, time: float) -> tuple[float, float]:
        k = bisect_right(self.times, time)
        if k == 0:
            return self.values[0], 0.0
        if k == len(self.times):
            return self.values[-1], 0.0
        h = self.times[k] - self.times[k - 1]
        s = (time - self.times[k - 1]) / h
        a, b = self.values[k - 1], self.values[k]
        if self.rates is None:
            return a + s * (b - a), (b - a) / h
        # Cubic Hermite, as in joint_trajectory_controller for points with velocities.
        u, v = self.rates[k - 1] * h, self.rates[k] * h
        value = (a + s * (u + s * (3.0 * (b - a) - 2.0 * u - v
                                   + s * (2.0 * (a - b) + u + v))))
        rate = (u + s * (2.0 * (3.0 * (b - a) - 2.0 * u - v)
                         + 3.0 * s * (2.0 * (a - b) + u + v))) / h
        return value, rate


def load_profile(name: str) -> Points:
    """Return the trajectory of a file: a path, or the name of one that ships."""
    path = shipped_or_own(name, 'trajectories')
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f'{path.name}: is not YAML ({in_short(error)})') from None
    return profile_from(content, path.name)


def profile_from(content: Any, label: str) -> Points:
    """Return the trajectory that a file's content describes; ``label`` is for messages."""
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"{label}: expected a mapping with 'format: {FORMAT}'")
    unknown = sorted(set(map(str, content)) - _KEYS)
    if unknown:
        raise InputError(f"{label}: unknown key '{unknown[0]}'; expected "
                         f"{', '.join(sorted(_KEYS))}")
    kind = content.get('quantity')
    if kind not in _LIKE:
        raise InputError(f'{label}: quantity is {kind!r}; expected force or strain')
    smooth = content.get('interpolation', 'linear')
    if smooth not in ('linear', 'smooth'):
        raise InputError(f'{label}: interpolation is {smooth!r}; expected linear or smooth')
    points = content.get('points')
    if not isinstance(points, list):
        raise InputError(f'{label}: points is {type(points).__name__}; expected a list')
    times, values = [], []
    for k, point in enumerate(points):
        if not (isinstance(point, list) and len(point) == 2):
            raise InputError(f'{label}: point {k + 1} is {point!r}; '
                             f'expected [time, value], as [2 s, 40 {_LIKE[kind]}]')
        with about(f'{label}: point {k + 1}'):
            times.append(parse(point[0], 's'))
            values.append(parse(point[1], _LIKE[kind]))
    rates = tuple(0.0 for _ in times) if smooth == 'smooth' else None
    # With the file's name first, so that errors name the file.
    profile = Points(label, kind, tuple(times), tuple(values), rates)
    return replace(profile, name=str(content.get('name', label)))
