# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Options for reading the files of a lab, as an object and as a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.data.column_names import QUANTITIES, recognise
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import about, in_short, InputError
from fam_bundle_ros.units import express, parse

FORMAT = 'fam-bundle-recipe/1'
#: Keys with a unit: (unit like, unit to write).
_WITH_UNIT = {'rest_length': ('m', 'mm'), 'muscle_length': ('m', 'mm'),
              'ambient_pressure': ('Pa', 'kPa'), 'max_pressure': ('Pa', 'MPa')}

#: Keys without a unit: (types, what is expected in words).
_TYPES: dict[str, tuple[Any, str]] = {
    'columns': (dict, 'quantities with their columns'), 'gauge': (bool, 'true or false'),
    'drop_bad': (bool, 'true or false'), 'sheet': (str, 'a name'),
    'max_strain': ((int, float), 'a number')}


@dataclass(frozen=True)
class Recipe:
    """
    How to read a file: the options of `read_measurement`, in SI units, and one more.

    Attributes
    ----------
    columns : mapping of str to str
        Quantity to column, ``{'length': 'L [mm]', 'force': '-F [N]'}``. What is not named is
        recognised.
    rest_length : float, m, optional
        By which lengths become strains, whatever the file says.
    muscle_length : float, m, optional
        The same where the file says nothing: the length of the model.
    gauge, ambient_pressure, max_pressure, max_strain, sheet, drop_bad
        As for `read_measurement`.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    rest_length: float | None = None
    muscle_length: float | None = None
    gauge: bool | None = None
    ambient_pressure: float = 101325.0
    max_pressure: float | None = None
    max_strain: float | None = None
    sheet: str | None = None
    drop_bad: bool = False

    def __post_init__(self) -> None:
        for key in self.columns:
            if key.partition('.')[0] not in QUANTITIES or key == 'shift':
                known = ', '.join(name for name in QUANTITIES if name != 'shift')
                raise InputError(f"columns: '{key}' is not a quantity; expected one of {known}, "
                                 'pressure.<motor unit>')
        for key in (*_WITH_UNIT, 'max_strain'):
            value = getattr(self, key)
            if value is not None and not value > 0.0:
                raise InputError(f'{key} is {value:g}; expected more than 0')

    def merged(self, **options: Any) -> 'Recipe':
        """Return the recipe with other options; None changes nothing, columns are added."""
        given = {key: value for key, value in options.items() if value is not None}
        for key, (like, _) in _WITH_UNIT.items():
            if isinstance(given.get(key), str):
                given[key] = _quantity(given[key], like, key)
        if 'columns' in given:
            given['columns'] = {**self.columns, **_as_text(given['columns'])}
        return replace(self, **given)


def load_recipe(path: str | Path) -> Recipe:
    """
    Return the recipe of a file.

    Raises
    ------
    InputError
        For a file that is no recipe, an unknown key, or a value without its unit.
    """
    import yaml
    path = Path(path)
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror}); expected a recipe '
                         '(--save-recipe writes one)') from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f'{path.name}: not YAML ({in_short(error)}); expected a recipe '
                         f'(format: {FORMAT})') from error
    if not isinstance(content, dict) or content.pop('format', None) != FORMAT:
        raise InputError(f'{path.name}: no recipe; expected the key format: {FORMAT}')
    known = [entry.name for entry in fields(Recipe)]
    for key, value in content.items():
        if key not in known:
            raise InputError(f"{path.name}: key '{key}' is not known; expected some of "
                             f'{", ".join(known)}')
        if key in _WITH_UNIT:
            content[key] = _quantity(value, _WITH_UNIT[key][0], f'{path.name}: {key}')
        types, words = _TYPES.get(key, (object, ''))
        if not isinstance(value, types):
            raise InputError(f"{path.name}: {key} is '{value}'; expected {words}")
    content['columns'] = _as_text(content.get('columns', {}))
    with about(path.name):
        return Recipe(**content)


def save_recipe(recipe: Recipe, path: str | Path) -> None:
    """Write a recipe as YAML."""
    import yaml
    content: dict[str, Any] = {'format': FORMAT}
    for entry in fields(Recipe):
        value = getattr(recipe, entry.name)
        if value is None or value == {} or (entry.name == 'drop_bad' and not value):
            continue
        if entry.name in _WITH_UNIT:
            value = express(value, _WITH_UNIT[entry.name][1], digits=9)
        content[entry.name] = dict(value) if entry.name == 'columns' else value
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    write_whole(path, text)


def recipe_of(measurement: Measurement, recipe: Recipe) -> Recipe:
    """
    Return a recipe with all columns that were recognised or guessed in reading a file.

    Not its rest length: the next file may be of another muscle.
    """
    columns = dict(recipe.columns)
    for taken in measurement.taken:
        if not taken.quantity or taken.quantity in columns:
            continue
        own = recognise(taken.header).unit
        absolute = ' abs' * ('absolute' in taken.why)
        unit = f' [{taken.unit}{absolute}]' if taken.unit and own is None else ''
        columns[taken.quantity] = ('-' if taken.turned else '') + taken.header + unit
    return replace(recipe, columns=columns)


def _as_text(columns: Mapping[Any, Any]) -> dict[str, str]:
    return {str(key): str(value) for key, value in columns.items()}


def _quantity(value: Any, like: str, what: str) -> float:
    with about(what):
        return parse(value, like)
