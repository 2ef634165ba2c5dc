# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Definition of a law: one plain function, its parameters, the place where it acts, and facts on it.

The names of the function's arguments define its inputs (`FELT`, `SHAPE`, its parameters, and for
a law with memory `STEPPING` and its memory fields). `fam_bundle_ros.model.compose` combines the
laws of a model by place. Within a place contributions are added (of limits the largest is taken),
so their order does not matter and no law can overwrite the contribution of another.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from functools import cache
import inspect
import math
from pathlib import Path
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.geometry import DERIVED, DIMENSIONS
from fam_bundle_ros.units import express, si_factor


class Place(Enum):
    """Where a law acts, in the order in which they are composed."""

    SENSOR = 'sensor'
    PNEUMATICS = 'pneumatics'
    PRESSURE = 'pressure'
    GEOMETRY = 'geometry'
    FORCE = 'force'
    LIMIT = 'limit'
    LOSS = 'loss'
    #: Added last; its inputs are strain and pressure before other laws change them.
    RESIDUAL = 'residual'


#: Inputs of a law, SI. ``strain``, ``pressure`` (gauge, of its own unit) and ``stretch``
#: (1 - strain) as changed by the laws of earlier places; ``braid`` is the square of the threads'
#: stretch; ``force`` is the sum of earlier places, ``bladder`` that of the bladder family (N per
#: muscle); ``unit`` is the index of the motor unit.
FELT = ('unit', 'strain', 'stretch', 'strain_rate', 'pressure', 'time', 'force', 'bladder',
        'braid')
#: Where those of them are known that are worked out on the way.
_KNOWN_AT = {'braid': (Place.FORCE, Place.LIMIT, Place.LOSS),
             'bladder': (Place.FORCE, Place.LIMIT, Place.LOSS),
             'force': (Place.LIMIT, Place.LOSS)}
#: Geometry of the muscle: fields of `fam_bundle_ros.model.geometry.Geometry`.
SHAPE = (*DIMENSIONS, *DERIVED)
#: For memory: first sample of a trial, first sample of the whole log, s since the last sample.
STEPPING = ('start', 'log_start', 'dt')
#: For a measured table: one array with all tables of the model, and the start of the law's own.
TABLES = ('tables', 'table')
#: Quantities that a law may change, at places with more than one.
CHANGES = {Place.GEOMETRY: ('strain', 'braid', 'area'),
           Place.SENSOR: ('force', 'pressure', 'strain'),
           Place.PNEUMATICS: ('leak_rate', 'supply_resistance')}
#: Kinds of shape for ``leaves``, as in `fam_bundle_ros.discovery.templates`. ``smooth0`` is a
#: smooth function of strain, ``smooth1`` and ``smooth2`` the same times pressure and its square.
KINDS = ('smooth0', 'smooth1', 'smooth2', 'past_free', 'force', 'friction', 'speed', 'drift',
         'drift_trial', 'pressure_rate', 'decay')


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a law: default and bounds in ``unit``; all other values are SI.

    Discovery does not fit a parameter with ``fitted`` False. ``name`` is by default that of the
    function's argument.
    """

    default: float
    unit: str
    lower: float
    upper: float
    description: str
    fitted: bool = True
    name: str = ''

    @property
    def scale(self) -> float:
        """SI value of one ``unit``."""
        return si_factor(self.unit, self.unit)

    def check(self, value: float) -> float:
        """Return an SI value if it is within the bounds, else raise InputError."""
        slack = 1e-9 * max(abs(self.lower), abs(self.upper), 1.0)
        if not (math.isfinite(value)
                and self.lower - slack <= value / self.scale <= self.upper + slack):
            raise InputError(
                f'{self.name} is {express(value, self.unit)}; expected between '
                f'{self.lower:g} and {self.upper:g} {self.unit}')
        return value


@dataclass(frozen=True)
class Part:
    """
    A law at one place.

    Parameters
    ----------
    place : Place
    function : callable
        Returns the contribution at its place: Pa (pressure), N per muscle (force, loss), a lower
        limit of the force (limit), or a change of the quantity ``changes``. With memory fields
        among its arguments it returns a tuple (value, *these fields after the sample).
    changes : str
        One of `CHANGES`; empty at other places.
    equilibrium : callable, optional
        The static value of a law with memory. By default its value at a first sample.
    """

    place: Place
    function: Callable
    changes: str = ''
    equilibrium: Callable | None = None

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the function's arguments."""
        return arguments(self.function)

    @property
    def given(self) -> tuple[str, ...]:
        """What the function may ask for at this place, besides parameters, memory and tables."""
        if self.place is Place.PNEUMATICS:
            return ()
        if self.place is Place.SENSOR:
            return (self.changes, 'time', 'strain_rate',
                    *(('unit',) if self.changes == 'pressure' else ()))
        return (*(name for name in FELT if self.place in _KNOWN_AT.get(name, Place)), *SHAPE,
                *STEPPING)


@cache
def arguments(function: Callable) -> tuple[str, ...]:
    """Return the names of a plain function's arguments."""
    return tuple(inspect.signature(function).parameters)


#: Values of `Law.per_unit` and `Law.needs`.
PER_UNIT = ('', 'later', 'each')
NEEDS = ('', 'several lengths', 'length readings', 'three strains')


@dataclass(frozen=True, eq=False, repr=False)
class Law:
    """
    A physical effect without values; calling it with SI values gives an `Effect`.

    Parameters
    ----------
    name, summary, source : str
        ``source`` is the paper that the formula is from, or 'derived'.
    family : str
        Laws of one family describe the same physics in different shapes.
    signature : str
        Description of the residual when this effect is missing.
    parts : tuple of Part
        Most laws have one.
    parameters : tuple of Parameter
    names : mapping
        Argument of the function -> name of the parameter.
    off : mapping
        Parameter values (in their units) at which the effect contributes nothing.
    memory : tuple of str
        Names of the memory fields; empty when the law has none. They are zero before the first
        sample.
    variant_of : str
        For a second shape: the name of the law with the first shape, itself not a variant.
    across_trials : bool
        True if its state carries over from trial to trial of a log.
    per_unit : one of `PER_UNIT`
        Whether it has a parameter for each motor unit after the first one, or for each unit of a
        bundle; then it has none for a single muscle.
    pushes_back : bool
        True if it describes how a muscle resists compression.
    delay : str
        Parameter, s, if the law only delays the pressure: a controller then inverts the model
        without the law, and takes the parameter for the lag of the force.
    candidate : bool
        False if a diagnosis may not add it to a model.
    needs : one of `NEEDS`
        What data must have before a diagnosis may add it: muscles of several lengths, strains
        that were calculated from readings of the muscle's length, or three levels of the strain
        (from two, a small change of the strain gives nearly any force between them).
    leaves : tuple of str
        Kinds of shape (`KINDS`) in the residual of a model without the law.
    remedy : str
        Measurement to make if no force test separates it from another effect.
    look : tuple of str
        Hue (`fam_bundle_ros.palette`) and dash of its line in figures.
    load : callable, optional
        Reads the table that the law needs from a path.
    formula : str
        Text of a user's formula; empty for other laws.
    python_file : str
        The user's file that defines it; empty for laws of this and of installed packages.
    remake : tuple, optional
        (function, arguments) that makes the law again in another process.
    """

    name: str
    summary: str
    source: str
    family: str
    signature: str
    parts: tuple[Part, ...]
    parameters: tuple[Parameter, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    off: Mapping[str, float] = field(default_factory=dict)
    memory: tuple[str, ...] = ()
    variant_of: str = ''
    across_trials: bool = False
    per_unit: str = ''
    pushes_back: bool = False
    delay: str = ''
    candidate: bool = True
    needs: str = ''
    leaves: tuple[str, ...] = ()
    remedy: str = ''
    look: tuple[str, str] = ('', 'solid')
    load: Callable[[Path], Any] | None = None
    formula: str = ''
    python_file: str = ''
    remake: tuple[Callable, tuple] | None = None

    def __post_init__(self):
        """Check the arguments of every part, the names in ``off``, and the kinds of shape."""
        for part in self.parts:
            self._check(part)
        for name in self.off.keys() - {parameter.name for parameter in self.parameters}:
            raise InputError(f"law {self.name}: off '{name}'; expected one of its parameters: "
                             f"{', '.join(p.name for p in self.parameters) or 'it has none'}")
        if self.delay and self.delay not in {p.name for p in self.parameters if p.unit == 's'}:
            raise InputError(f"law {self.name}: delay '{self.delay}'; expected one of its "
                             'parameters in s')
        leaves: Any = self.leaves  # may be a str by mistake
        for kind in (leaves,) if isinstance(leaves, str) else leaves:
            if kind not in KINDS or kind == leaves:
                raise InputError(f"law {self.name}: leaves '{kind}'; expected a tuple of one or "
                                 f"more of {', '.join(KINDS)}")
        memory: Any = self.memory
        if isinstance(memory, str):
            raise InputError(f"law {self.name}: memory '{memory}'; expected a tuple of names")
        for key, one_of in (('per_unit', PER_UNIT), ('needs', NEEDS)):
            if getattr(self, key) not in one_of:
                raise InputError(f"law {self.name}: {key} '{getattr(self, key)}'; expected one of "
                                 + ', '.join(f"'{each}'" for each in one_of))
        for each in self.parameters:
            if not each.lower <= each.default <= each.upper:
                raise InputError(f'law {self.name}: default of {each.name} is {each.default:g} '
                                 f'{each.unit}; expected between {each.lower:g} and '
                                 f'{each.upper:g}')

    def __call__(self, **settings: Any) -> Effect:
        """
        Return the effect with these SI values; other parameters have their default.

        A law that reads a table also takes ``table`` (its path, as in a model file) and
        ``folder`` (the folder of a relative path).

        Raises
        ------
        InputError
            For an unknown parameter, a value outside its bounds, or a missing table.
        """
        return Effect(self, **settings)

    def __repr__(self):
        return f'Law({self.name})'

    def __reduce__(self) -> Any:
        return self.remake if self.remake is not None else self.name

    @property
    def place(self) -> Place:
        """The place where the first part of the law acts."""
        return self.parts[0].place

    @property
    def function(self) -> Callable:
        """The plain function of the first part."""
        return self.parts[0].function

    @property
    def needs_time(self) -> bool:
        """Whether the law has no effect on a static map, which has no time."""
        return bool(self.memory) or any('time' in part.arguments for part in self.parts)

    @property
    def remembers_path(self) -> bool:
        """Whether it is a loss with a memory of the path alone, not of time: dry friction."""
        return bool(self.memory) and all(
            part.place is Place.LOSS and 'dt' not in part.arguments for part in self.parts)

    @property
    def remembers_pressure(self) -> bool:
        """Whether it changes the pressure by a memory of its path alone: hysteresis."""
        return bool(self.memory) and all(
            part.place is Place.PRESSURE and 'dt' not in part.arguments for part in self.parts)

    @property
    def is_of_force_alone(self) -> bool:
        """Whether the reading with the law is a function of the force without it alone."""
        return all((part.place is Place.LIMIT or part.changes == 'force')
                   and {'force', *self.names}.issuperset(part.arguments) for part in self.parts)

    def parameter(self, name: str) -> Parameter:
        """Return a parameter by name; InputError if there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise InputError(f"{self.name} has no parameter '{name}'; it has "
                         f"{', '.join(p.name for p in self.parameters) or 'none'}")

    def active(self, units: int) -> tuple[Parameter, ...]:
        """Return the parameters used in a bundle with ``units`` motor units."""
        count = {'': len(self.parameters), 'later': max(units - 1, 0),
                 'each': units if units > 1 else 0}
        return self.parameters[:count[self.per_unit]]

    def also(self, place: str, changes: str = '', equilibrium: Callable | None = None
             ) -> Callable[[Callable], Callable]:
        """
        Return a decorator for a function that is another part of this law, at another place.

        It shares the law's parameters and memory fields (a field is changed by one part only).
        """
        def add(function: Callable) -> Callable:
            part = Part(_place(place), function, changes, equilibrium)
            self._check(part)
            object.__setattr__(self, 'parts', (*self.parts, part))
            return function
        return add

    def _check(self, part):
        expected = CHANGES.get(part.place, ('',))
        if part.changes not in expected:
            raise InputError(f"law {self.name}: changes '{part.changes}'; expected one of "
                             f"{', '.join(map(repr, expected))} for place {part.place.value}")
        given = part.given
        known = {*given, *TABLES, *self.names, *self.memory}
        for function in (part.function, part.equilibrium):
            for argument in arguments(function) if function else ():
                if argument not in known:
                    places = [place.value for place in _KNOWN_AT.get(argument, ())]
                    raise InputError(f"law {self.name}: argument '{argument}' is " + (
                        f"not known at place {part.place.value}, only at {', '.join(places)}"
                        if places else 'neither a parameter nor a memory field nor one of '
                        f"{', '.join(given) or 'those'} (place {part.place.value})"))
        shadowed = (set(self.names) | set(self.memory)) & {*FELT, *SHAPE, *STEPPING, *TABLES}
        if shadowed:
            raise InputError(
                f"law {self.name}: parameter or memory field {', '.join(sorted(shadowed))} has "
                "the name of an input of a law; rename the argument and give the parameter's "
                "own name as Parameter(..., name='...')")


def _place(name):
    """Return the place of a name; InputError with the places where there is none."""
    try:
        return Place(name)
    except ValueError:
        raise InputError(f"place '{name}' is not known; expected one of "
                         f"{', '.join(place.value for place in Place)}") from None


#: Fields of a law that are not arguments of `law`.
_MADE = ('name', 'parts', 'parameters', 'names', 'formula', 'python_file', 'remake')
_GIVEN = tuple(each.name for each in fields(Law) if each.name not in _MADE)


def law(place: str, *, changes: str = '', equilibrium: Callable | None = None,
        **settings: Any) -> Callable[[Callable], Law]:
    """
    Return a decorator that makes a plain function a `Law`.

    Parameters
    ----------
    place : str
        A value of `Place`.
    changes, equilibrium
        See `Part`.
    **settings
        Parameters of the law (`Parameter` by the name of the function's argument) and fields of
        `Law`: at least summary, source, family and signature.

    Examples
    --------
    >>> @law('loss', family='own', summary='drag', source='own', signature='odd in the rate',
    ...      c=Parameter(5.0, 'N*s', 0.0, 100.0, 'drag per strain rate'))
    ... def drag(strain_rate, c):
    ...     return -c * strain_rate
    >>> drag(c=3.0)
    drag(c=3 N*s)
    """
    given = {key: item for key, item in settings.items() if isinstance(item, Parameter)}
    facts = {key: item for key, item in settings.items() if key not in given}
    parameters = {key: replace(item, name=item.name or key) for key, item in given.items()}

    def define(function: Callable) -> Law:
        name = function.__name__
        for key, item in facts.items():
            if key not in _GIVEN:
                raise InputError(f"law {name}: '{key}' is {item!r}; expected a Parameter, or a "
                                 f"field of a law: {', '.join(_GIVEN)}")
        for key in ('family', 'summary', 'source', 'signature'):
            if not facts.get(key):
                raise InputError(f'law {name}: needs {key}=...')
        made = Law(name=name, parts=(
            Part(_place(place), function, changes, equilibrium),),
            parameters=tuple(parameters.values()),
            names={key: item.name for key, item in parameters.items()}, **facts)
        vars(made).update(__doc__=function.__doc__, __module__=function.__module__)
        return made
    return define
