# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""From named columns with units (`pressure.mu1 [kPa]`) to a `Measurement` in SI units."""

import re

import numpy as np

from fam_bundle_ros.data.measurement import build, Measurement
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.units import si_factor

_HEADER = re.compile(r'^\s*(?P<name>[^\[\(]+?)\s*(?:[\[\(]\s*(?P<unit>[^\]\)]*?)\s*[\]\)])?\s*$')
#: quantity: (unit it must be like, unit when the header gives none)
_QUANTITIES = {'time': ('s', 's'), 'strain': ('dimensionless', 'dimensionless'),
               'contraction': ('m', None), 'pressure': ('Pa', None), 'force': ('N', None),
               'strain_rate': ('1/s', '1/s')}
#: Column names that people use for the same thing.
_SYNONYMS = {'t': 'time', 'epsilon': 'strain', 'contraction ratio': 'strain', 'load': 'force',
             'displacement': 'contraction', 'p': 'pressure', 'f': 'force'}


def from_columns(values: dict[str, np.ndarray], name: str, *,
                 rest_length: float | None = None, ambient_pressure: float = 101325.0,
                 first_row: int = 1, allow_constant_pressure: bool = False) -> Measurement:
    """
    Return a measurement from columns whose names carry the quantity and its unit.

    Parameters
    ----------
    values : dict of str to ndarray, shape (T,)
        Such as ``{'strain [%]': ..., 'pressure [psi]': ..., 'force [lbf]': ...}``.

    Raises
    ------
    InputError
        For a missing column, an unknown unit or one that does not fit, and for bad values.
    """
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    trial = None
    for header, column in values.items():
        quantity, unit = _split(header)
        if quantity == 'trial':
            trial = column
            continue
        base = quantity.split('.')[0]
        if base not in _QUANTITIES:
            continue  # more columns than we need are no error
        like, default = _QUANTITIES[base]
        if not unit:
            if default is None:
                raise InputError(f"{name}: column '{header}' has no unit; expected for example "
                                 f"'{quantity} [{'kPa' if like == 'Pa' else like}]'")
            unit = default
        absolute = like == 'Pa' and (match := re.match(r'^(.*?)(?:\s*\(?abs\)?|(?<=psi)a|'
                                                       r'(?<=bar)a)$', unit))
        plain = match.group(1).strip() if absolute and match else unit
        plain = {'psig': 'psi', 'barg': 'bar'}.get(plain, plain)
        if base == 'strain' and plain in ('mm', 'm', 'cm', 'in', 'inch'):
            base, quantity, like = 'contraction', 'contraction', 'm'
        try:
            factor = si_factor(plain, like)
        except InputError as error:
            raise InputError(f"{name}: column '{header}': {error}") from error
        try:
            number = np.asarray(column, float)
        except (TypeError, ValueError) as error:
            raise InputError(f"{name}: column '{header}' holds text; expected numbers") from error
        columns[quantity] = number * factor - (ambient_pressure if absolute else 0.0)
        units[quantity] = '' if plain == 'dimensionless' else plain
    return _assemble(name, columns, units, trial, rest_length, first_row,
                     allow_constant_pressure)


def _split(header: str) -> tuple[str, str]:
    match = _HEADER.match(header)
    if not match:
        return header.strip().lower(), ''
    quantity = match.group('name').strip()
    base, dot, unit_name = quantity.partition('.')
    base = base.lower().strip()
    base = _SYNONYMS.get(base, base)
    return base + dot + unit_name, (match.group('unit') or '').strip()


def _assemble(name: str, columns: dict[str, np.ndarray], units: dict[str, str],
              trial: np.ndarray | None, rest_length: float | None, first_row: int,
              allow_constant_pressure: bool) -> Measurement:
    if 'strain' not in columns and 'contraction' in columns:
        if rest_length is None:
            raise InputError(f'{name}: contraction is given as a length; expected a strain, or '
                             'the rest length (option or model) to make one')
        columns['strain'] = columns['contraction'] / rest_length
        units['strain'] = ''
    pressures = [key for key in columns if key == 'pressure' or key.startswith('pressure.')]
    missing = [key for key in ('strain', 'force') if key not in columns]
    missing += [] if pressures else ['pressure']
    if missing:
        have = ', '.join(columns) or 'none that is known'
        raise InputError(f"{name}: column '{missing[0]}' is missing; expected strain, pressure "
                         f'and force with units in the header (found {have})')
    if len(pressures) > 1 and 'pressure' in pressures:
        raise InputError(f"{name}: 'pressure' beside '{pressures[-1]}'; expected one name per "
                         'motor unit')
    motor_units = [key.partition('.')[2] or 'mu1' for key in pressures]
    return build(name, columns['strain'], np.stack([columns[key] for key in pressures], -1),
                 columns['force'], trial, columns.get('time'), motor_units,
                 columns.get('strain_rate'), first_row=first_row, units=units,
                 allow_constant_pressure=allow_constant_pressure)
