# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Make a model file of a user's muscle, from a commercial part or from dimensions.

Values are texts with units, as a user types them; the file states the source of each value.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import textwrap
from types import MappingProxyType

import yaml

from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.model.bundle import Bundle
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.geometry import DIMENSIONS, Geometry, geometry_problem
from fam_bundle_ros.model.laws.base import Place
from fam_bundle_ros.model.modelfile import FORMAT
from fam_bundle_ros.model.parts import MAX_PRESSURE, MOST_MUSCLES, MotorUnit
from fam_bundle_ros.units import express, parse, spaced

#: Default effects of a new model: the ideal braid.
START_EFFECTS = ('mesh',)
_SHEET = 'Festo data sheet "Fluidic Muscle DMSP/MAS", quoted from memory: check it on your sheet'
_LIKE_20 = ('not in the data sheet: the value of the DMSP-20 is used as a start; measure it, or '
            'let diagnose refit it')


@dataclass(frozen=True)
class Entry:
    """
    One property of a muscle that the user enters.

    Attributes
    ----------
    key, label, unit : str
        Key of the model file, label, and suggested unit ('' for a count).
    meaning : str
    example : str
    """

    key: str
    label: str
    unit: str
    meaning: str
    example: str

    @property
    def option(self) -> str:
        """Name of the command line option."""
        return '--' + self.key.replace('_thickness', '').replace('_', '-')


ENTRIES = (
    Entry('radius', 'Radius', 'mm', 'initial outer radius: half the diameter at rest', '6.35 mm'),
    Entry('length', 'Length', 'mm', 'active length between the fittings, vented and not pulled: '
          'strain is zero there', '127 mm'),
    Entry('braid_angle', 'Braid angle', 'deg', 'of the threads from the axis, at that length',
          '33 deg'),
    Entry('wall_thickness', 'Wall', 'mm', 'wall of the bladder, at rest', '1.59 mm'),
    Entry('muscles', 'Muscles', '', 'equal muscles on one valve; one number for each motor unit, '
          'in the order of recruitment', '1, 2'),
    Entry('max_pressure', 'Highest pressure', 'kPa', 'gauge; the controller never asks for more',
          '400 kPa'),
)


@dataclass(frozen=True)
class Part:
    """
    A commercial muscle.

    Attributes
    ----------
    name, title : str
    values : mapping of str to str
        Values with units by key of `ENTRIES`, without the length.
    sources : mapping of str to str
        Source of each value.
    lengths : (float, float), m
        Shortest and longest length on sale.
    """

    name: str
    title: str
    values: Mapping[str, str]
    sources: Mapping[str, str]
    lengths: tuple[float, float]


def _festo(size: int, pressure: str, shortest: float, geometry: str) -> Part:
    return Part(
        f'dmsp-{size}', f'Festo DMSP-{size}',
        MappingProxyType({'radius': f'{size // 2} mm', 'braid_angle': '28.53 deg',
                          'wall_thickness': '1.8 mm', 'max_pressure': pressure}),
        MappingProxyType({
            'radius': f'half the inner diameter of {size} mm ({_SHEET}); the threads are in the '
            'wall, so the radius may be larger by up to one wall thickness',
            'braid_angle': geometry, 'wall_thickness': geometry,
            'max_pressure': f'highest operating pressure ({_SHEET})'}), (shortest, 9.0))


PARTS = (
    _festo(10, '800 kPa', 0.04, _LIKE_20),
    _festo(20, '600 kPa', 0.06, 'not in the data sheet: that of the model dmsp20_static_map that '
           'ships, which does not say how it was measured'),
    _festo(40, '600 kPa', 0.12, _LIKE_20),
)


def find_part(name: str, named: str = 'part') -> Part:
    """Return a part by name; the InputError for an unknown one starts with ``named``."""
    plain = name.casefold().replace('festo', '').strip(' -_').replace(' ', '-')
    for part in PARTS:
        if plain in (part.name, part.name.replace('-', '')):
            return part
    raise InputError(f"{named}: '{name}' is not in the catalogue; expected one of "
                     f'{", ".join(part.name for part in PARTS)}, or the dimensions')


def new_bundle(name: str, values: Mapping[str, str], effects: Sequence[str] = START_EFFECTS,
               named: Callable[[Entry], str] = lambda entry: entry.key) -> Bundle:
    """
    Return a bundle from values as a user types them.

    Parameters
    ----------
    name : str
    values : mapping of str to str
        Values with units by key of `ENTRIES`.
    effects : sequence of str
        Names in the catalogue; they have their default values.
    named : callable
        Returns the name of an entry in messages, for example its option.

    Raises
    ------
    InputError
        For a bad value; starts with the entry's name and says what is expected.
    """
    return fitted_bundle(name, values, [_effect(effect) for effect in effects], named=named)


def fitted_bundle(name: str, values: Mapping[str, str], effects: Sequence,
                  notes: Mapping | None = None,
                  named: Callable[[Entry], str] = lambda entry: entry.key) -> Bundle:
    """Return a bundle from values as a user types them and given effects; see `new_bundle`."""
    entries = {entry.key: entry for entry in ENTRIES}
    missing = [entry for entry in ENTRIES if not values.get(entry.key, '').strip()]
    if missing:
        words = ', '.join(f'{named(entry)} ({entry.meaning}; {entry.example})'
                          for entry in missing[:2])
        more = ', '.join(named(entry) for entry in missing[2:])
        raise InputError(f'a muscle needs {words}{" and also " + more if more else ""}')
    numbers = {}
    for entry in ENTRIES:
        if entry.unit:
            with about(named(entry)):
                numbers[entry.key] = parse(spaced(values[entry.key]), entry.unit)
    pressure = numbers.pop('max_pressure')
    problem = geometry_problem(**numbers)
    if problem:
        raise InputError(f'{named(entries[problem[0]])}: {problem[1]}; it is '
                         f"'{values[problem[0]].strip()}'")
    _check_pressure(pressure, named(entries['max_pressure']))
    counts = counted(values['muscles'], named(entries['muscles']))
    geometry = Geometry(**numbers)
    return Bundle(name, [MotorUnit(f'mu{k + 1}', count, geometry, pressure)
                         for k, count in enumerate(counts)], effects, notes=notes)


def _check_pressure(pressure: float, named: str) -> None:
    if not 0.0 < pressure <= MAX_PRESSURE:
        raise InputError(f'{named}: must lie between 0 and {MAX_PRESSURE / 1e6:g} MPa; it is '
                         f"'{express(pressure, 'kPa')}'")


def counted(text: str, named: str) -> tuple[int, ...]:
    """Return the number of muscles of each motor unit from a text such as '1, 2'."""
    words = [word.strip() for word in text.split(',')]
    for word in words:
        if not (word.isdecimal() and 1 <= int(word) <= MOST_MUSCLES):
            raise InputError(f"{named}: '{word}' is not a whole number from 1; expected one for "
                             "each motor unit, for example '1, 2'")
    return tuple(map(int, words))


def bundle_of(muscle: Bundle, name: str, counts: Sequence[int],
              max_pressure: float | None = None, tendons: bool = False) -> Bundle:
    """
    Return a bundle of equal muscles, with geometry and effects of the model of one muscle.

    Effects of the sensors, which belong to the rig of the measurement, are not taken over. A
    muscle that was only pulled appears slack where nothing was measured. Between rigid ends it
    pushes back there: slack is replaced by `unmeasured_push_back`.

    Parameters
    ----------
    muscle : Bundle
        With one motor unit, for example from `fam_bundle_ros.diagnose`.
    name : str
    counts : sequence of int
        Number of muscles of each motor unit, in the order of recruitment.
    max_pressure : float, Pa (gauge), optional
        That of ``muscle`` by default.
    tendons : bool
        The ends of the bundle transmit tension only: slack is kept.

    Raises
    ------
    InputError
        For a model of several motor units, or a pressure out of range.
    """
    if muscle.n != 1:
        raise InputError(f'{muscle.name}: has {muscle.n} motor units; expected the model of one '
                         'muscle')
    unit = muscle.motor_units[0]
    if max_pressure is not None:
        _check_pressure(max_pressure, 'max_pressure')
        unit = replace(unit, max_pressure=max_pressure)
    effects = [effect for effect in muscle.effects if effect.place is not Place.SENSOR]
    if not tendons and any(effect.law.family == 'slack' for effect in effects):
        effects = [effect for effect in effects if effect.law.family != 'slack']
        effects.append(unmeasured_push_back())
    return Bundle(name, [replace(unit, name=f'mu{k + 1}', muscles=count)
                         for k, count in enumerate(counts)], effects)


def _effect(name: str):
    law = catalogue.get(name)
    if law.load is not None:
        raise InputError(f'{name} needs a table (a CSV file); add it to the model file')
    return law()


def dimensions_of(bundle: Bundle) -> dict[str, str]:
    """
    Return the values of a bundle as a user types them, by key of `ENTRIES`.

    Dimensions are those of the first motor unit; `fitted_bundle` gives all units the same.
    """
    first = bundle.motor_units[0]
    values = {key: express(float(getattr(first.geometry, key)), unit)
              for key, unit in DIMENSIONS.items()}
    return {**values, 'muscles': ', '.join(str(unit.muscles) for unit in bundle.motor_units),
            'max_pressure': express(float(first.max_pressure), 'kPa')}


def muscle_words(bundle: Bundle) -> str:
    """
    Return a model's name and geometry in one line, the header of every result.

    Equal motor units are grouped.
    """
    groups: dict[str, list[str]] = {}
    for unit in bundle.motor_units:
        own = unit.geometry
        words = (f'radius {express(float(own.radius), "mm", 4)}, length '
                 f'{express(float(own.length), "mm", 4)}, braid angle '
                 f'{express(float(own.braid_angle), "deg", 4)}, wall '
                 f'{express(float(own.wall_thickness), "mm", 4)}, up to '
                 f'{express(float(unit.max_pressure), "kPa", 4)}')
        count = f'{unit.muscles} muscle{"s" * (unit.muscles != 1)}'
        groups.setdefault(f'{count}, {words}', []).append(unit.name)
    return f'{bundle.name}: ' + '; '.join(f'{", ".join(names)} of {words}'
                                          for words, names in groups.items())


def unmeasured_push_back() -> Effect:
    """
    Return the push-back of a muscle that was measured in tension only.

    The 95 % intervals of its parameters go from none to four times the default, a standard
    deviation of 100 %: a controller starts from them, and adapts.
    """
    effect = catalogue.get('resistive_plateau')()
    effect.intervals = {name: (0.0, 4.0 * value) for name, value in effect.values.items()}
    return effect


def model_text(bundle: Bundle, values: Mapping[str, str], sources: Mapping[str, str],
               origin: str = '') -> str:
    """
    Return the text of a model file with the meaning and source of each value as comments.

    Parameters
    ----------
    bundle : Bundle
        From `new_bundle`.
    values : mapping of str to str
        Values by key of `ENTRIES`, as typed.
    sources : mapping of str to str
        Sources of values; a value without one is the user's.
    origin : str
        Sentence for the first line.
    """
    def commented(key: str, indent: int, last: str = '') -> list[str]:
        entry = next(entry for entry in ENTRIES if entry.key == key)
        meaning = entry.meaning.partition(';')[0] if key == 'muscles' else entry.meaning
        comment = f'{meaning}. Source: {sources.get(key, "the user")}.'
        return [*_comment(comment, indent),
                f'{" " * indent}{key}: {last or " ".join(spaced(values[key]).split())}']

    lines = [*_comment(origin or 'A model of one muscle.'),
             *_comment('Every value has its unit. fam_bundle map, diagnose and run take this '
                       'file; fam_bundle effects lists the effects that can be added.'),
             f'format: {FORMAT}',
             yaml.safe_dump({'name': bundle.name}, allow_unicode=True, width=999).strip(),
             'motor_units:  # in the order of recruitment']
    for k, unit in enumerate(bundle.motor_units):
        block = [*commented('muscles', 4, str(unit.muscles)), '    geometry:']
        for key in DIMENSIONS:
            block += commented(key, 6)
        block += commented('max_pressure', 4)
        # comments only for the first unit
        lines += [f'  - name: {unit.name}', *(line for line in block
                                              if k == 0 or not line.lstrip().startswith('#'))]
    lines.append('effects:')
    for effect in bundle.effects:
        lines += [*_comment(f'{effect.summary}. Source: {effect.source}.', 2),
                  f'  - {effect.name}']
    return '\n'.join(lines) + '\n'


def _comment(comment: str, indent: int = 0) -> list[str]:
    lead = ' ' * indent + '# '
    return textwrap.wrap(comment, 99, initial_indent=lead, subsequent_indent=lead,
                         break_long_words=False)
