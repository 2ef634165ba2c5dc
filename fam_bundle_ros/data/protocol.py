# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
An experiment as a file that a person writes and `fam_bundle measure` drives.

    protocol = read_protocol('spie2021')
    print(duration(protocol), len(segments(protocol)))

A protocol is a list of steps (`fam_bundle_ros.data.steps`) with limits; it comes to numbered
segments (`fam_bundle_ros.data.schedule`), each of which is one trial of the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
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
#: Units of the quantities in a file, and in which they are written.
_UNITS = {'time': 's', 'settle': 's', 'travel': '1/s', 'force': 'N'}


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
    content: dict[str, Any] = {'format': FORMAT}
    for entry in fields(Protocol):
        value = getattr(protocol, entry.name)
        if entry.name == 'limits':
            value = _written_limits(value)
        elif entry.name == 'steps':
            value = [{step.kind: _written(step)} for step in value]
        elif value == entry.default:
            continue
        if value != {}:
            content[entry.name] = _shown(entry.name, value)
    content['steps'] = content.pop('steps')
    return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=99,
                              default_flow_style=None))


def _protocol(content: Any) -> Protocol:
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"no protocol; expected a mapping with 'format: {FORMAT}'")
    known = {entry.name for entry in fields(Protocol)}
    given = {key: value for key, value in content.items() if key != 'format'}
    _only(given, known, '')
    for key in ('name', 'motor_units', 'steps'):
        if key not in given:
            raise InputError(f"has no key '{key}'")
    for key in ('motor_units', 'seed', 'repeats'):
        if key in given:
            given[key] = _count(given[key], key)
    for key in ('settle', 'travel'):
        if key in given:
            given[key] = _quantity(given[key], _UNITS[key], key)
    for key in ('name', 'order', 'notes'):
        given[key] = str(given.get(key, getattr(Protocol, key, '')))
    if not 0 < given['motor_units'] <= 64:
        raise InputError(f"motor_units is {given['motor_units']}; expected 1 to 64")
    given['limits'] = _limits(given.get('limits', {}))
    steps = given['steps']
    if not isinstance(steps, list):
        raise InputError(f'steps is {type(steps).__name__}; expected a list')
    given['steps'] = tuple(_step(entry, f'step {k}', given['motor_units'])
                           for k, entry in enumerate(steps, 1))
    return Protocol(**given)


def _step(entry: Any, where: str, units: int) -> Step:
    if not (isinstance(entry, dict) and len(entry) == 1 and set(entry) <= set(STEPS)):
        found = ', '.join(map(str, entry)) if isinstance(entry, dict) else repr(entry)
        raise InputError(f'{where} is {found}; expected one of {", ".join(STEPS)}')
    ((kind, values),) = entry.items()
    if kind == Pause.kind:
        return Pause(_quantity(values, 's', f'{where} (pause)'))
    where = f'{where} ({kind})'
    if not isinstance(values, dict):
        raise InputError(f'{where} is {values!r}; expected keys with values')
    made: Any = STEPS[kind]
    known = {item.name: item for item in fields(made)}
    _only(values, set(known), f'{where}: ')
    missing = [name for name, item in known.items()
               if name not in values and item.default is MISSING]
    if missing:
        raise InputError(f"{where} has no key '{missing[0]}'")
    likes = {'time': 's', 'strain': '1', 'rate': 'Pa/s' if made is PressureSweep else '1/s'}
    given: dict[str, Any] = {}
    for key, value in values.items():
        at = f'{where}: {key}'
        if key == 'pressure':
            given[key] = _pressures(value, units, at)
        elif key == 'cycles':
            given[key] = _count(value, at)
        elif key == 'strain' and made in (Sweep, Hold):
            listed = value if isinstance(value, list) else [value]
            given[key] = tuple(_quantity(each, '1', at) for each in listed)
        else:
            given[key] = _quantity(value, likes[key], at)
    try:
        return made(**given)
    except InputError as error:
        raise InputError(f'{where.partition(" (")[0]}, {error}') from None


def _pressures(value: Any, units: int, where: str) -> tuple[Pressures, ...]:
    """Return pressures of all motor units: of one quantity, a mapping by unit, or a list."""
    if isinstance(value, list):
        return tuple(each for item in value for each in _pressures(item, units, where))
    if not isinstance(value, dict):
        return ((_quantity(value, 'Pa', where),) * units,)
    names = [f'mu{k + 1}' for k in range(units)]
    _only(value, set(names), f'{where}: ')
    # A unit that is not named is vented. The last one changes fastest.
    choices = []
    for name in names:
        given = value.get(name, '0 Pa')
        choices.append([_quantity(each, 'Pa', f'{where}.{name}')
                        for each in (given if isinstance(given, list) else [given])])
    return tuple(product(*choices))


def _limits(value: Any) -> Limits:
    if not isinstance(value, dict):
        raise InputError(f'limits is {value!r}; expected pressure, strain, force')
    _only(value, {entry.name for entry in fields(Limits)}, 'limits: ')
    given: dict[str, Any] = {}
    for key, like in (('pressure', 'Pa'), ('force', 'N')):
        if key in value:
            given[key] = _quantity(value[key], like, f'limits: {key}')
    if 'strain' in value:
        strain = value['strain']
        if not (isinstance(strain, list) and len(strain) == 2):
            raise InputError(f'limits: strain is {strain!r}; expected [from, to]')
        given['strain'] = tuple(_quantity(each, '1', 'limits: strain') for each in strain)
    return Limits(**given)


def _written(step: Step) -> Any:
    """Return what stands in the file under the kind of a step."""
    if isinstance(step, Pause):
        return _shown('time', step.time)
    made: Any = step
    content = {}
    for entry in fields(made):
        value = getattr(step, entry.name)
        if value == entry.default:
            continue
        if entry.name == 'rate':
            value = express(value, 'kPa/s' if isinstance(step, PressureSweep) else '1/s', 9)
        content[entry.name] = _shown(entry.name, value)
    return content


def _written_limits(limits: Limits) -> dict[str, Any]:
    return {entry.name: _shown(entry.name, getattr(limits, entry.name))
            for entry in fields(Limits) if getattr(limits, entry.name) != entry.default}


def _shown(name: str, value: Any) -> Any:
    """Return a value as it is written: quantities with units."""
    if name == 'pressure' and isinstance(value, tuple):
        shown = [_shown_pressure(each) for each in value]
        return shown if len(shown) > 1 else shown[0]
    if name == 'pressure':
        return express(value, 'kPa', 9)
    if name in _UNITS:
        return express(value, _UNITS[name], 9)
    if isinstance(value, tuple):
        return [float(f'{each:.9g}') for each in value]
    return float(f'{value:.9g}') if isinstance(value, float) else value


def _shown_pressure(pressure: Pressures) -> Any:
    if alike(pressure, (pressure[0],) * len(pressure)):
        return express(pressure[0], 'kPa', 9)
    return {f'mu{k}': express(value, 'kPa', 9) for k, value in enumerate(pressure, 1)}


def _only(given: Mapping[Any, Any], known: set[str], where: str) -> None:
    for key in given:
        if key not in known:
            raise InputError(f"{where}key '{key}' is not known; expected some of "
                             f'{", ".join(sorted(known))}')


def _quantity(value: Any, like: str, where: str) -> float:
    with about(where):
        return parse(value, like)


def _count(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f'{where} is {value!r}; expected a whole number')
    return value
