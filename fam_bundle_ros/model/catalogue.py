# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of laws that a model file can name, built-in and from other packages."""

from collections.abc import Iterator, Mapping
from functools import cache
import importlib
import importlib.util
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.effect import CLASSES_ARE_GONE
from fam_bundle_ros.model.laws.base import Law

#: Group of the entry points for laws of other packages.
ENTRY_POINT_GROUP = 'fam_bundle_ros.effects'

#: Files of `fam_bundle_ros.model.laws` in the order of the catalogue; others follow.
_ORDER = ('mesh', 'bladder', 'surface', 'resistive', 'slack', 'force_floor', 'dry_friction',
          'viscous', 'relaxation', 'sheath', 'end_caps', 'braid', 'threshold', 'line_lag',
          'gas_history', 'temperature', 'softening', 'discrepancy', 'force_sensor',
          'pressure_sensor', 'strain_sensor', 'mismatch', 'leak', 'supply')


@cache
def built_in() -> Mapping[str, Law]:
    """Return the laws of this package by name."""
    files = {path.stem for path in Path(__file__).with_name('laws').glob('[a-z]*.py')}
    laws: dict[str, Law] = {}
    for file in (*_ORDER, *sorted(files - {'base', *_ORDER})):
        for law in _laws_in(importlib.import_module(f'fam_bundle_ros.model.laws.{file}')):
            if law.name in laws:
                raise InputError(f'laws/{file}.py: another file has a law {law.name}; expected '
                                 'one file for each name')
            laws[law.name] = law
    return MappingProxyType(laws)


@cache
def available() -> Mapping[str, Law]:
    """Return every law by name: the built-ins, then those of entry points."""
    from importlib import metadata  # not at the top: the import takes 0.07 s
    laws = dict(built_in())
    for point in metadata.entry_points(group=ENTRY_POINT_GROUP):
        law = point.load()
        if not isinstance(law, Law):
            raise InputError(f'entry point {point.name}: {law!r} is not a law: {CLASSES_ARE_GONE}')
        _try(law, f'entry point {point.name}')
        laws.setdefault(law.name, law)
    check_variants(laws, laws)
    return MappingProxyType(laws)


def check_variants(laws: Mapping[str, Law], known: Mapping[str, Law]) -> None:
    """Raise InputError if a law is a variant of an unknown law, or of another variant."""
    for law in laws.values():
        first = known.get(law.variant_of)
        if law.variant_of and (first is None or first.variant_of):
            why = 'is not known' + _did_you_mean(law.variant_of, known) if first is None else (
                f"is itself a variant of '{first.variant_of}'")
            raise InputError(f"law {law.name}: variant_of '{law.variant_of}' {why}; expected the "
                             'name of a law that is not a variant (fam_bundle effects lists them)')


def names() -> list[str]:
    """Return the names of all laws."""
    return list(available())


def get(name: str) -> Law:
    """Return a law by name; InputError with similar names if there is none."""
    laws = built_in() if name in built_in() else available()
    if name not in laws:
        raise InputError(f"effect '{name}' is not known{_did_you_mean(name, laws)} (fam_bundle "
                         'effects lists them)')
    return laws[name]


def _did_you_mean(name: str, laws: Mapping[str, Law]) -> str:
    """Return '; did you mean ...?' with similar names; empty if there are none."""
    from difflib import SequenceMatcher

    def likeness(known: str) -> float:
        # also compared with each word of a name, so that 'colomb' finds coulomb_friction
        return max(SequenceMatcher(None, name, part).ratio()
                   for part in (known, *known.split('_')))
    near = [known for known in sorted(laws, key=likeness, reverse=True)[:2]
            if likeness(known) >= 0.7]
    return f'; did you mean {" or ".join(near)}?' if near else ''


def from_python_file(path: Path) -> Iterator[Law]:
    """
    Yield the laws that a user's Python file defines. This runs the file.

    Raises
    ------
    InputError
        If the file cannot be imported, defines no law, or one that does not run on arrays.
    """
    spec = importlib.util.spec_from_file_location(f'fam_bundle_user_{path.stem}', path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError(f'{path}: is not a Python file')
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the user's file may raise anything
        if str(getattr(error, 'name', '')).startswith('fam_bundle_ros.model.effects'):
            error = InputError(CLASSES_ARE_GONE)
        reason = str(error) if isinstance(error, InputError) else (
            f'cannot be imported ({type(error).__name__}: {error})')
        raise InputError(f'{path}: {reason}') from error
    found = _laws_in(module)
    if not found:
        raise InputError(f'{path}: defines no law: {CLASSES_ARE_GONE}')
    for law in found:
        _try(law, str(path))
        vars(law).update(python_file=str(path.resolve()),
                         remake=(_from_python_file_again, (str(path.resolve()), law.name)))
        yield law


def _try(law: Law, where: str) -> None:
    """Raise InputError where a law does not run on rows, or does not return its memory."""
    for part in law.parts if law.load is None else ():
        values: dict[str, Any] = {name: np.array([0.1, 0.2]) for name in part.arguments}
        for name in values:
            if name in law.names:
                parameter = law.parameter(law.names[name])
                values[name] = parameter.default * parameter.scale
            elif name in ('start', 'log_start'):
                values[name] = np.array([True, False])
        try:
            with np.errstate(all='ignore'):
                found = part.function(**values)
        except Exception as error:  # whatever the user's function raises
            raise InputError(
                f'{where}: law {law.name} does not run on arrays of rows ({type(error).__name__}: '
                f"{error}); for an if write NumPy's where, minimum or maximum") from error
        fields = [name for name in part.arguments if name in law.memory]
        if (len(found) if isinstance(found, tuple) else 1) != 1 + len(fields):
            raise InputError(f'{where}: law {law.name} returns {found!r}; expected its value'
                             + ''.join(f', then {name} after the sample' for name in fields))


def _from_python_file_again(path: str, name: str) -> Law:
    """Return a law of a user's file in a worker process."""
    return next(law for law in from_python_file(Path(path)) if law.name == name)


def _laws_in(module) -> list[Law]:
    return [item for item in vars(module).values()
            if isinstance(item, Law) and vars(item).get('__module__') == module.__name__]
