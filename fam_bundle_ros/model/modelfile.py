# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read and write model files (YAML, with a unit in every value).

Errors name the file, the line and the key. Aliases are refused, as a few of them can expand to a
tree that fills the memory. Nothing in a file is executed: a Python file of effects that it names
is loaded only with ``allow_python=True``.
"""

import math
from pathlib import Path
from typing import Any

import yaml

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.errors import about, InputError
from fam_bundle_ros.model import catalogue
from fam_bundle_ros.model.bundle import Bundle
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.expression import check_division, expression_law, usual_place
from fam_bundle_ros.model.geometry import DIMENSIONS, Geometry, geometry_problem
from fam_bundle_ros.model.laws.base import Law, Parameter
from fam_bundle_ros.model.parts import MAX_PRESSURE, MOST_MUSCLES, MotorUnit
from fam_bundle_ros.resources import model_path
from fam_bundle_ros.units import express, parse, si_factor

FORMAT = 'fam-bundle-model/1'
_MAX_BYTES = 1_000_000
#: Largest strain of a muscle, for the check of formulas.
_LONGEST_STRAIN = 0.45


class _Map(dict):
    """A mapping with the line of each key."""

    lines: dict[str, int]
    line: int


class _Text(str):
    """A string with its line."""

    line: int


class _Reader:
    """Converts the tree of one file; every error names the file and the line."""

    def __init__(self, where: str):
        self.where = where

    def error(self, line, message):
        return InputError(f'{self.where}, line {line}: {message}')

    def tree(self, text: str) -> Any:
        try:
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                if isinstance(event, yaml.AliasEvent):
                    mark: Any = event.start_mark
                    raise self.error(mark.line + 1, 'aliases (*name) are not allowed')
            node = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            problem = getattr(error, 'problem', None) or 'it has characters that YAML forbids'
            raise self.error(mark.line + 1 if mark else 1, f'is not YAML: {problem}') from error
        except RecursionError as error:
            raise self.error(1, 'is nested too deeply') from error
        return self._plain(node)

    def _plain(self, node):
        if isinstance(node, yaml.MappingNode):
            result = _Map()
            result.lines, result.line = {}, node.start_mark.line + 1
            for key, value in node.value:
                line = key.start_mark.line + 1
                if not isinstance(key, yaml.ScalarNode):
                    raise self.error(line, 'a key must be a word')
                if key.value in result:
                    raise self.error(line, f"'{key.value}' is given twice")
                result[key.value] = self._plain(value)
                result.lines[key.value] = line
            return result
        if isinstance(node, yaml.SequenceNode):
            return [self._plain(item) for item in node.value]
        if node is None:
            return None
        text = _Text(node.value)
        text.line = node.start_mark.line + 1
        return text

    def known(self, mapping, allowed, what, line=1):
        """Return ``mapping``; raise InputError if it is not a mapping or has other keys."""
        if not isinstance(mapping, _Map):
            raise self.error(line, f'{what} must be a mapping of {", ".join(allowed)}')
        for key in mapping:
            if key not in allowed:
                raise self.error(mapping.lines[key], f"{what} has no key '{key}'; expected "
                                 f'{", ".join(allowed)}')
        return mapping

    def quantity(self, value, unit, key, line):
        try:
            return parse(value, unit)
        except InputError as error:
            raise self.error(line, f'{key}: {error}') from error

    # --- the parts of a model file -------------------------------------------------------------

    def bundle(self, tree, folder, allow_python):
        keys = ('format', 'name', 'description', 'motor_units', 'effects', 'error',
                'effect_files', 'notes')
        self.known(tree, keys, 'a model file')
        if tree.get('format') != FORMAT:
            raise self.error(tree.lines.get('format', 1),
                             f"format is {tree.get('format')!r}; expected '{FORMAT}'")
        for key in ('motor_units', 'effects'):
            if not isinstance(tree.get(key), list):
                raise self.error(tree.lines.get(key, 1), f'{key} must be a list')
        extra = self.python_effects(tree, folder, allow_python)
        units = [self.motor_unit(item, i + 1, tree.lines['motor_units'])
                 for i, item in enumerate(tree['motor_units'])]
        effects: list[Effect] = []
        for item in tree['effects']:
            effect = self.effect(item, tree.lines['effects'], folder, extra)
            line = getattr(item, 'line', tree.lines['effects'])
            for unit in units:
                try:
                    check_division(effect, _LONGEST_STRAIN, unit.max_pressure, unit.geometry)
                except InputError as problem:
                    raise self.error(line, str(problem)) from problem
            if any(effect.name == other.name for other in effects):
                raise self.error(line, f'effect {effect.name} is named twice')
            effects.append(effect)
        error = self.quantity(tree['error'], 'N', 'error', tree.lines['error']) \
            if 'error' in tree else 0.0
        notes = _undecorate(tree.get('notes') or {})
        if not isinstance(notes, dict):
            raise self.error(tree.lines['notes'], 'notes must be a mapping')
        if 'description' in tree:
            notes = {'description': str(tree['description']), **notes}
        with about(self.where):
            return Bundle(str(tree.get('name') or 'model'), units, effects, error, notes)

    def python_effects(self, tree, folder, allow_python):
        files = tree.get('effect_files') or []
        if not isinstance(files, list):
            raise self.error(tree.lines['effect_files'], 'effect_files must be a list')
        if files and not allow_python:
            raise self.error(tree.lines['effect_files'],
                             'names Python files, which would be run; allow it with '
                             '--allow-python if you trust them')
        laws = {law.name: law for file in files
                for law in catalogue.from_python_file(folder / file)}
        if any(law.variant_of for law in laws.values()):
            with about(', '.join(files)):
                catalogue.check_variants(laws, {**catalogue.available(), **laws})
        return laws

    def motor_unit(self, item, number, line):
        what = f'motor unit {number}'
        self.known(item, ('name', 'muscles', 'geometry', 'max_pressure'), what, line)
        if 'geometry' not in item:
            raise self.error(item.line, f'{what} has no geometry')
        shape = self.known(item['geometry'], tuple(DIMENSIONS), f'geometry of {what}', item.line)
        values = {}
        for key, unit in DIMENSIONS.items():
            if key not in shape:
                raise self.error(shape.line, f'geometry of {what} has no {key}')
            values[key] = self.quantity(shape[key], unit, key, shape.lines[key])
        problem = geometry_problem(**values)
        if problem:
            raise self.error(shape.lines[problem[0]], ' '.join(problem))
        pressure = self.quantity(item.get('max_pressure', '413.7 kPa'), 'kPa', 'max_pressure',
                                 item.lines.get('max_pressure', item.line))
        if not 0.0 < pressure <= MAX_PRESSURE:
            raise self.error(item.lines.get('max_pressure', item.line),
                             f'max_pressure must lie between 0 and {MAX_PRESSURE / 1e6:g} MPa')
        count = item.get('muscles', '1')
        if not (isinstance(count, str) and count.isdecimal() and 1 <= int(count) <= MOST_MUSCLES):
            raise self.error(item.lines.get('muscles', item.line),
                             f"muscles is '{count}'; expected a whole number from 1")
        return MotorUnit(str(item.get('name') or f'mu{number}'), int(count), Geometry(**values),
                         pressure)

    def effect(self, item, line, folder, extra) -> Effect:
        if isinstance(item, _Map):
            line = item.line
            if len(item) != 1:
                raise self.error(line, 'an effect must be one name with its parameters')
            (name, settings), = item.items()
            settings = settings if settings is not None else _empty(line)
        elif isinstance(item, _Text):
            line = item.line
            name, settings = item, _empty(line)
        else:
            raise self.error(line, 'an effect must be a name')
        if not isinstance(settings, _Map):
            raise self.error(line, f'{name}: parameters must be a mapping')
        try:
            if 'expression' in settings:
                law = self.expression(name, settings)
                settings = settings.get('parameters') or _empty(line)
            else:
                law = extra.get(name) or catalogue.get(name)
        except InputError as error:
            text = str(error)
            raise (error if text.startswith(self.where) else self.error(line, text)) from error
        options = {}
        if law.load is not None:
            if 'table' not in settings:
                raise self.error(line, f'{name}: needs a table (a CSV file)')
            options = {'table': str(settings['table']), 'folder': folder}
        return self.values(law, settings, line, options)

    def expression(self, name, settings):
        self.known(settings, ('expression', 'place', 'parameters'), name)
        listed = settings.get('parameters') or _empty(settings.line)
        if not isinstance(listed, _Map):
            raise self.error(settings.lines['parameters'],
                             f'parameters of {name} must be a mapping of name to value')
        formula = str(settings['expression'])
        place = str(settings.get('place') or usual_place(formula))
        return expression_law(str(name), formula, place, tuple(
            self.user_parameter(name, key, value, listed.lines[key])
            for key, value in listed.items()))

    def user_parameter(self, effect, key, setting, line):
        """Return a parameter of an expression, from its value and bounds in the file."""
        parts = setting if isinstance(setting, _Map) else {'value': setting}
        if not isinstance(parts.get('value'), str):
            raise self.error(line, f'{effect}.{key} needs a value with a unit')
        unit = parts['value'].strip().partition(' ')[2].strip() or '1'
        value = self.quantity(parts['value'], unit, f'{effect}.{key}', line)
        factor = si_factor(unit, unit)
        wide = 1e3 * max(abs(value), factor)
        bounds = [self.quantity(parts[end], unit, f'{effect}.{key}.{end}', line)
                  if end in parts else default
                  for end, default in (('lower', -wide), ('upper', wide))]
        return Parameter(value / factor, str(unit), bounds[0] / factor, bounds[1] / factor,
                         f'parameter of {effect}', name=str(key))

    def values(self, law: Law, settings, line, options) -> Effect:
        """Return an effect with the values, bounds and intervals of the file."""
        described = {p.name: p for p in law.parameters}
        values, bounds, intervals = {}, {}, {}
        for key, setting in settings.items():
            at = settings.lines[key]
            if key in options:
                continue
            if key not in described:
                raise self.error(at, f"{law.name} has no parameter '{key}'; it has "
                                 f"{', '.join(described) or 'none'}")
            parameter, label = described[key], f'{law.name}.{key}'
            if isinstance(setting, _Map):
                self.known(setting, ('value', 'lower', 'upper', 'interval'), label, at)
                bounds[key] = self.bounds(parameter, setting, label, at)
            else:
                setting = {'value': setting}
            if 'value' in setting:
                values[key] = self.quantity(setting['value'], parameter.unit, label, at)
            if 'interval' in setting:
                if not isinstance(setting['interval'], list) or len(setting['interval']) != 2:
                    raise self.error(at, f'{label}.interval must be a list of two values')
                intervals[key] = tuple(
                    self.quantity(v, parameter.unit, f'{label}.interval', at)
                    for v in setting['interval'])
        for key, value in values.items():
            try:
                low, high = bounds.get(key, (-math.inf, math.inf))
                if not low <= value <= high:
                    raise InputError(f'{key} is {express(value, described[key].unit)}; expected '
                                     f'between {express(low, described[key].unit)} and '
                                     f'{express(high, described[key].unit)}')
                described[key].check(value)
            except InputError as error:
                raise self.error(settings.lines[key], f'{law.name}: {error}') from error
        try:
            effect = law(**options, **values)
        except InputError as error:
            raise self.error(settings.lines.get('table', line), f'{law.name}: {error}') from error
        effect.bounds, effect.intervals = bounds, intervals
        return effect

    def bounds(self, parameter: Parameter, setting, label, line) -> tuple[float, float]:
        """Return the bounds of a parameter, SI, which a file may narrow."""
        low, high = (self.quantity(setting[end], parameter.unit, f'{label}.{end}', line)
                     if end in setting else default * parameter.scale
                     for end, default in (('lower', parameter.lower), ('upper', parameter.upper)))
        if low > high:
            raise self.error(line, f'{label}: lower is above upper')
        for end in (low, high):
            try:
                parameter.check(end)
            except InputError as error:
                raise self.error(line, f'{label}: a model file may narrow the bounds: {error}'
                                 ) from error
        return low, high


def load_model(path: str | Path, allow_python: bool = False) -> Bundle:
    """
    Read a model file.

    Parameters
    ----------
    path : str or Path
        Or the name of a model of this package: ``spie2021``.
    allow_python : bool
        Whether Python files that the model names under ``effect_files`` may be run.

    Raises
    ------
    InputError
        For a bad file, with file, line and key.
    """
    path = model_path(path)
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f'{path}: is larger than 1 MB; this is not a model file')
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = ('it is not UTF-8 text; expected a model file in YAML'
                  if isinstance(error, UnicodeDecodeError) else error.strerror)
        raise InputError(f'{path}: cannot be read ({reason})') from error
    return loads_model(text, str(path), path.parent, allow_python)


def loads_model(text: str, where: str = 'model', folder: Path = Path('.'),
                allow_python: bool = False) -> Bundle:
    """
    Read a model from text.

    Parameters
    ----------
    where : str
        Name of the source in error messages.
    folder : Path
        Folder of relative paths in the text.
    allow_python : bool
        See `load_model`.
    """
    reader = _Reader(where)
    return reader.bundle(reader.tree(text), Path(folder), allow_python)


def dumps_model(bundle: Bundle, folder: str | Path | None = None) -> str:
    """
    Return the text of a model file, from which `loads_model` makes an equal bundle.

    Paths of other files (tables, Python files) are absolute, or relative to ``folder`` if they
    are in it.
    """
    tree: dict[str, Any] = {'format': FORMAT, 'name': bundle.name}
    if bundle.error:
        tree['error'] = express(bundle.error, 'N')
    if bundle.notes:
        tree['notes'] = bundle.notes
    tree['motor_units'] = [
        {'name': unit.name, 'muscles': unit.muscles,
         'geometry': {key: express(float(getattr(unit.geometry, key)), shown, 9)
                      for key, shown in DIMENSIONS.items()},
         'max_pressure': express(unit.max_pressure, 'kPa', 9)} for unit in bundle.motor_units]
    files = dict.fromkeys(e.python_file for e in bundle.effects if e.python_file)
    if files:
        tree['effect_files'] = [_relative_to(folder, file) for file in files]
    tree['effects'] = [_effect_entry(effect, bundle.n, folder) for effect in bundle.effects]
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, width=99)


def save_model(bundle: Bundle, path: str | Path) -> None:
    """Write a model file, atomically; InputError if the folder cannot be written."""
    write_whole(path, dumps_model(bundle, Path(path).parent))


def _effect_entry(effect: Effect, units: int, folder: str | Path | None) -> Any:
    settings = {}
    for parameter in effect.law.active(units):
        key = parameter.name
        value = _written(effect.values[key], parameter.unit)
        if key not in effect.bounds and key not in effect.intervals and not effect.law.formula:
            settings[key] = value
            continue
        low, high = (_written(v, parameter.unit) for v in effect.limits(key))
        settings[key] = {'value': value, 'lower': low, 'upper': high}
        if key in effect.intervals:
            settings[key]['interval'] = [_written(v, parameter.unit)
                                         for v in effect.intervals[key]]
    options = effect.options()
    if 'table' in options:
        options['table'] = _relative_to(folder, options['table'])
    if effect.law.formula:
        return {effect.name: {**options, 'parameters': settings}}
    return {effect.name: {**options, **settings}} if options or settings else effect.name


def _relative_to(folder: str | Path | None, file: str) -> str:
    """Return a path relative to a folder if the file is in it, else unchanged."""
    if folder is not None and Path(file).is_relative_to(Path(folder).resolve()):
        return str(Path(file).relative_to(Path(folder).resolve()))
    return file


def _written(value: float, unit: str) -> Any:
    """Return a value as text with its unit, or as a number if it is dimensionless."""
    text = express(value, unit, 9)
    return float(text) if unit == '1' else text


def _empty(line: int) -> _Map:
    empty = _Map()
    empty.lines, empty.line = {}, line
    return empty


def _undecorate(value: Any) -> Any:
    """Return plain dicts, lists and strings, without line numbers."""
    if isinstance(value, dict):
        return {key: _undecorate(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_undecorate(item) for item in value]
    return str(value) if isinstance(value, str) else value
