# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a physical effect is: a name, where it comes from, parameters, a place, and one method.

The engine (`fam_bundle_ros.model.muscle`) composes effects by place, in the order of `Place`.
Within a place contributions add (limits: the highest floor holds), so their order never matters
and no effect can overwrite what another one contributed.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
import math
from typing import Any, ClassVar

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.geometry import Geometry
from fam_bundle_ros.units import express, si_factor


class Place(Enum):
    """Where an effect acts, in the order in which the engine composes them."""

    SENSOR = 'sensor'
    PNEUMATICS = 'pneumatics'
    PRESSURE = 'pressure'
    GEOMETRY = 'geometry'
    FORCE = 'force'
    LIMIT = 'limit'
    LOSS = 'loss'


@dataclass(frozen=True)
class Parameter:
    """
    One number of an effect: default and bounds in ``unit``, handled as SI everywhere else.

    ``fitted`` is False for numbers that data can hardly tell (a smoothing width): discovery
    leaves them where they are.
    """

    name: str
    unit: str
    default: float
    lower: float
    upper: float
    description: str
    fitted: bool = True

    @property
    def scale(self) -> float:
        """SI value of one ``unit``."""
        return si_factor(self.unit, self.unit)

    def check(self, value: float) -> float:
        """Return an SI value when it is within the bounds, else raise InputError."""
        slack = 1e-9 * max(abs(self.lower), abs(self.upper), 1.0)
        if not (math.isfinite(value)
                and self.lower - slack <= value / self.scale <= self.upper + slack):
            raise InputError(
                f'{self.name} is {express(value, self.unit)}; expected between '
                f'{self.lower:g} and {self.upper:g} {self.unit}')
        return value


@dataclass(slots=True)
class Sample:
    """
    What an effect sees: arrays that broadcast to (time, ..., motor unit), SI units.

    ``dt`` is None in a static evaluation: effects with memory then give their contribution at
    equilibrium. Otherwise axis 0 is time, ``dt`` is the time since the sample before and
    ``start`` marks the first sample of a trial, where memory begins afresh.
    """

    strain: Any
    pressure: Any
    strain_rate: Any
    geometry: Geometry
    dt: Any = None
    start: Any = None
    time: Any = 0.0
    #: Square of the thread's stretch, 1 for a stiff thread.
    braid: Any = 1.0
    #: Force so far: all elastic forces for a limit, the limited force for a loss. N per muscle.
    force: Any = 0.0
    #: The part of the elastic force that the bladder family contributes, N per muscle.
    bladder: Any = 0.0


class Effect(ABC):
    """
    A physical effect with its parameter values.

    Parameters
    ----------
    **values : float
        SI values by parameter name; the others take their default.

    Raises
    ------
    InputError
        For an unknown parameter or a value outside its bounds.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    source: ClassVar[str]
    place: ClassVar[Place]
    #: Effects of one family are look-alikes: the same physics with another shape.
    family: ClassVar[str]
    #: For a second shape: the name of the effect whose physics it is. Empty for a first shape.
    variant_of: ClassVar[str] = ''
    #: What a residual looks like when this effect is missing, in plain words.
    signature: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    #: Parameter values (in their units) at which the effect contributes nothing.
    off: ClassVar[Mapping[str, float]] = {}
    #: True when the contribution depends on what was before.
    memory: ClassVar[bool] = False
    #: True when it goes by what happened in all trials of a log, not afresh in each.
    across_trials: ClassVar[bool] = False
    #: The user's file that defines it; empty for effects of this and of installed packages.
    python_file: ClassVar[str] = ''

    def __init__(self, **values: float):
        known = {p.name: p for p in self.parameters}
        for key in values:
            if key not in known:
                raise InputError(f"{self.name} has no parameter '{key}'; it has "
                                 f"{', '.join(known) or 'none'}")
        self.values: dict[str, float] = {
            name: p.check(float(values.get(name, p.default * p.scale)))
            for name, p in known.items()}
        #: Bounds that the model file narrows (SI), by parameter name.
        self.bounds: dict[str, tuple[float, float]] = {}
        #: 95 % intervals that a fit has left (SI), by parameter name.
        self.intervals: dict[str, tuple[float, float]] = {}

    def __getattr__(self, name: str) -> float:
        """Give a parameter's SI value as an attribute, so that formulas read as written."""
        try:
            return self.__dict__['values'][name]
        except KeyError:
            raise AttributeError(f'{type(self).__name__} has no attribute {name!r}') from None

    def parameter(self, name: str) -> Parameter:
        """Return a parameter's description; InputError when there is none of that name."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise InputError(f"{self.name} has no parameter '{name}'; it has "
                         f"{', '.join(p.name for p in self.parameters) or 'none'}")

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter, SI."""
        parameter = self.parameter(name)
        return self.bounds.get(name, (parameter.lower * parameter.scale,
                                      parameter.upper * parameter.scale))

    def replace(self, **values: float) -> 'Effect':
        """Return a copy with other SI values; bounds are the caller's business."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.values = {**self.values, **values}
        other.__dict__.update(other.prepare())
        return other

    def prepare(self) -> dict[str, Any]:
        """Return attributes that are worked out anew when values change (none by default)."""
        return {}

    @classmethod
    def active(cls, units: int) -> tuple[Parameter, ...]:
        """Return the parameters that matter for a bundle of so many motor units."""
        return cls.parameters

    def options(self) -> dict[str, Any]:
        """Return what else a model file must say to make this effect again (no numbers)."""
        return {}

    def __repr__(self):
        shown = ', '.join(f'{p.name}={express(self.values[p.name], p.unit)}'
                          for p in self.parameters)
        return f'{self.name}({shown})'

    @abstractmethod
    def contribution(self, x: Sample) -> Any:
        """
        Return what the effect adds at its place, at equilibrium where it has a memory.

        The result, by place: ``pressure`` a change of the felt gauge pressure in Pa;
        ``geometry`` a `GeometryChange`; ``force`` N per muscle; ``limit`` the lowest force that
        the muscle can hold, N; ``loss`` a force added after the limit, N; ``sensor`` a
        `SensorError`; ``pneumatics`` None (the plant reads the values).
        """

    def advance(self, x: Sample, state: Any | None) -> tuple[Any, Any]:
        """
        Return the contribution over time and the state after the last sample.

        ``state`` is None before the first sample. Effects with memory override this.
        """
        return self.contribution(x), None


@dataclass(frozen=True)
class GeometryChange:
    """What a geometry effect adds: to the strain, to the squared thread stretch, to the area."""

    strain: Any = 0.0
    braid: Any = 0.0
    #: Relative change of the cross-section, per motor unit.
    area: Any = 0.0


@dataclass(frozen=True)
class SensorError:
    """
    How readings differ from the truth: shown = true (1 + gain) + bias, for each channel.

    Biases in N, Pa and strain; gains dimensionless.
    """

    force_bias: Any = 0.0
    force_gain: Any = 0.0
    pressure_bias: Any = 0.0
    pressure_gain: Any = 0.0
    strain_bias: Any = 0.0

    def __add__(self, other: 'SensorError') -> 'SensorError':
        """Errors of several sensors add."""
        return SensorError(*(getattr(self, f.name) + getattr(other, f.name)
                             for f in fields(self)))
