# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
An experiment as a file that a person writes and `fam_bundle measure` drives.

    protocol = read_protocol('spie2021')
    print(duration(protocol), len(segments(protocol)))

A protocol is a list of steps (`fam_bundle_ros.data.steps`) with limits; it comes to numbered
segments (`fam_bundle_ros.data.schedule`), each of which is one trial of the recording.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields, MISSING
from itertools import product
from pathlib import Path
from typing import Any

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.data.schedule import duration, Limits, minutes, Protocol, Segment, segments
from fam_bundle_ros.data.steps import (
    alike,
    Hold,
    Pause,
    Pressures,
    PressureSteps,
    PressureSweep,
    Step,
    STEPS,
    Sweep,
)
from fam_bundle_ros.errors import about, in_short, InputError
from fam_bundle_ros.resources import protocol_path
from fam_bundle_ros.units import express, parse

__all__ = ['dumps_protocol', 'duration', 'Hold', 'Limits', 'minutes', 'Pause',
           'PressureSteps', 'PressureSweep', 'Protocol', 'read_protocol', 'save_protocol',
           'Segment', 'segments', 'Sweep']

FORMAT = 'fam-bundle-protocol/1'
#: Unit of a quantity, and the unit in which it is written. A strain is a plain number.
_UNITS = {'pressure': ('Pa', 'kPa'), 'pressure rate': ('Pa/s', 'kPa/s'), 'strain': ('1', ''),
          'rate': ('1/s', '1/s'), 'travel': ('1/s', '1/s'), 'time': ('s', 's'),
          'settle': ('s', 's'), 'force': ('N', 'N')}
_COUNTS = ('motor_units', 'seed', 'repeats', 'cycles')
_TEXTS = ('name', 'order', 'notes')


def read_protocol(name: str | Path) -> Protocol:
    """
    Return the protocol of a file: a path, or the name of one that ships.

    Raises
    ------
    InputError
        It names the file, the step, the key and what was expected.
    """
    import yaml
    path = protocol_path(name)
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f'{path.name}: cannot be read as YAML ({in_short(error)})') from None
    with about(path.name):
        return _protocol(content)


def save_protocol(protocol: Protocol, path: str | Path) -> None:
    """Write a protocol as YAML."""
    write_whole(path, dumps_protocol(protocol))


def dumps_protocol(protocol: Protocol) -> str:
    """Return a protocol as the text of its file."""
    import yaml
    content = {'format': FORMAT, **_written(protocol)}
    content['limits'] = _written(protocol.limits)
    if not content['limits']:
        del content['limits']
    del content['steps']
    content['steps'] = [{step.kind: _shown('time', step.time) if isinstance(step, Pause)
                         else _written(step)} for step in protocol.steps]
    return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=99,
                              default_flow_style=None))


def _protocol(content: Any) -> Protocol:
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"no protocol; expected a mapping with 'format: {FORMAT}'")
    given = {key: value for key, value in content.items() if key != 'format'}
    _check_keys(given, Protocol, '')
    for key, value in given.items():
        if key in _COUNTS:
            given[key] = _count(value, key)
        elif key in _TEXTS:
            given[key] = str(value)
        elif key in _UNITS:
            given[key] = _quantity(value, key, key)
    units, steps = given['motor_units'], given['steps']
    if not 0 < units <= 64:
        raise InputError(f'motor_units is {units}; expected 1 to 64')
    given['limits'] = _limits(given.get('limits', {}))
    if not isinstance(steps, list):
        raise InputError(f'steps is {type(steps).__name__}; expected a list')
    given['steps'] = tuple(_step(entry, f'step {k}', units) for k, entry in enumerate(steps, 1))
    return Protocol(**given)


def _step(entry: Any, where: str, units: int) -> Step:
    if not (isinstance(entry, dict) and len(entry) == 1 and set(entry) <= set(STEPS)):
        found = ', '.join(map(str, entry)) if isinstance(entry, dict) else repr(entry)
        raise InputError(f'{where} is {found}; expected one of {", ".join(STEPS)}')
    ((kind, values),) = entry.items()
    step, at = STEPS[kind], f'{where} ({kind})'
    if step is Pause:
        return Pause(_quantity(values, 'time', at))
    if not isinstance(values, dict):
        raise InputError(f'{at} is {values!r}; expected keys with values')
    _check_keys(values, step, at)
    given: dict[str, Any] = {}
    for key, value in values.items():
        here = f'{at}: {key}'
        if key == 'pressure':
            given[key] = _pressures(value, units, here)
        elif key in _COUNTS:
            given[key] = _count(value, here)
        elif key == 'strain' and step in (Sweep, Hold):
            listed = value if isinstance(value, list) else [value]
            given[key] = tuple(_quantity(each, key, here) for each in listed)
        else:
            given[key] = _quantity(
                value, 'pressure rate' if key == 'rate' and step is PressureSweep else key, here)
    try:
        return step(**given)
    except InputError as error:
        raise InputError(f'{where}, {error}') from None


def _pressures(value: Any, units: int, where: str) -> tuple[Pressures, ...]:
    """Return pressures of all motor units: of one quantity, a mapping by unit, or a list."""
    if isinstance(value, list):
        return tuple(each for item in value for each in _pressures(item, units, where))
    if not isinstance(value, dict):
        return ((_quantity(value, 'pressure', where),) * units,)
    names = [f'mu{k + 1}' for k in range(units)]
    _only(value, names, where)
    # A unit that is not named is vented. The last one changes fastest.
    choices = []
    for name in names:
        given = value.get(name, '0 Pa')
        choices.append([_quantity(each, 'pressure', f'{where}.{name}')
                        for each in (given if isinstance(given, list) else [given])])
    return tuple(product(*choices))


def _limits(value: Any) -> Limits:
    if not isinstance(value, dict):
        raise InputError(f'limits is {value!r}; expected pressure, strain, force')
    _check_keys(value, Limits, 'limits')
    given: dict[str, Any] = {key: _quantity(each, key, f'limits: {key}')
                             for key, each in value.items() if key != 'strain'}
    if 'strain' in value:
        strain = value['strain']
        if not (isinstance(strain, list) and len(strain) == 2):
            raise InputError(f'limits: strain is {strain!r}; expected [from, to]')
        given['strain'] = tuple(_quantity(each, 'strain', 'limits: strain') for each in strain)
    return Limits(**given)


def _written(given: Protocol | Limits | Step) -> dict[str, Any]:
    """Return the values that are not the default ones, as they stand in a file."""
    values = {entry.name: getattr(given, entry.name) for entry in fields(given)
              if getattr(given, entry.name) != entry.default}
    return {name: _shown('pressure rate' if name == 'rate' and isinstance(given, PressureSweep)
                         else name, value) for name, value in values.items()}


def _shown(name: str, value: Any) -> Any:
    """Return a value as it is written: quantities with units."""
    if name == 'pressure' and isinstance(value, tuple):
        shown = [_shown_pressure(each) for each in value]
        return shown if len(shown) > 1 else shown[0]
    if name == 'strain':
        return [_shown(name, each) for each in value] if isinstance(value, tuple) else float(
            f'{value:.9g}')
    return express(value, _UNITS[name][1], 9) if name in _UNITS else value


def _shown_pressure(pressure: Pressures) -> Any:
    if alike(pressure, (pressure[0],) * len(pressure)):
        return _shown('pressure', pressure[0])
    return {f'mu{k}': _shown('pressure', value) for k, value in enumerate(pressure, 1)}


def _check_keys(given: Mapping[Any, Any], made: type[Protocol | Limits | Step], where: str,
                ) -> None:
    """Raise InputError for a key that is not known, and for one that is missing."""
    known = {entry.name: entry for entry in fields(made)}
    _only(given, known, where)
    for name, entry in known.items():
        if name not in given and entry.default is entry.default_factory is MISSING:
            raise InputError(f"{where} has no key '{name}'".lstrip())


def _only(given: Mapping[Any, Any], known: Iterable[str], where: str) -> None:
    for key in given:
        if key not in known:
            raise InputError(f"{where}{': ' if where else ''}key '{key}' is not known; expected "
                             f'some of {", ".join(sorted(known))}')


def _quantity(value: Any, name: str, where: str) -> float:
    with about(where):
        return parse(value, _UNITS[name][0])


def _count(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f'{where} is {value!r}; expected a whole number')
    return value
