# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of text with units to SI floats, and back."""

from functools import lru_cache
import math
import re
from typing import TYPE_CHECKING

from fam_bundle_ros.errors import InputError

if TYPE_CHECKING:
    import pint

#: Largest strain rate, 1/s: full contraction in 0.03 s. No muscle is faster: a unit is wrong.
FASTEST = 10.0
#: Unit names that users write and that pint does not accept.
_SPELLINGS = {'%': 'percent', '': 'dimensionless', '1': 'dimensionless', '-': 'dimensionless',
              'lbf': 'pound_force', 'deg': 'degree'}

#: SI value and dimension of the units in the catalogue and in our own files; pint, which takes
#: 0.3 s to load, is used for all others.
_KNOWN = {
    '1': (1.0, ''), 'm': (1.0, 'length'), 'mm': (1e-3, 'length'), 'deg': (math.radians(1.0), 'a'),
    's': (1.0, 'time'), '1/s': (1.0, 'rate'), 'N': (1.0, 'force'), 'N*m': (1.0, 'moment'),
    'Pa': (1.0, 'pressure'), 'kPa': (1e3, 'pressure'), 'MPa': (1e6, 'pressure'),
    'bar': (1e5, 'pressure'), 'psi': (4.4482216152605 / 0.0254 ** 2, 'pressure'),
    '1/MPa': (1e-6, 'compliance'), '1/GPa': (1e-9, 'compliance'), 'N/kPa': (1e-3, 'area'),
    'N*s/m': (1.0, 'damping'), 'K': (1.0, 'temperature'), 'kPa*s/g': (1e6, 'resistance')}


@lru_cache(maxsize=1)
def registry() -> 'pint.UnitRegistry':
    """Return the package's only pint registry (made on first use: it takes 0.3 s)."""
    import pint
    ureg: pint.UnitRegistry = pint.UnitRegistry()
    if 'percent' not in ureg:
        ureg.define('percent = 0.01 = %')
    return ureg


@lru_cache(maxsize=512)
def si_factor(unit: str, like: str) -> float:
    """
    Return the value of one ``unit`` in the SI unit of the dimension of ``like``.

    Raises
    ------
    InputError
        When ``unit`` is unknown or its dimension is not that of ``like``.

    Examples
    --------
    >>> si_factor('kPa', like='Pa')
    1000.0
    """
    if unit in _KNOWN and like in _KNOWN and _KNOWN[unit][1] == _KNOWN[like][1]:
        return _KNOWN[unit][0]
    ureg = registry()
    try:
        quantity = ureg.Quantity(1.0, _SPELLINGS.get(unit.strip(), unit.strip()))
    except Exception as error:  # pint raises many kinds, also its tokenizer's own
        raise InputError(f"unit '{unit}' is not known; expected one like {like}") from error
    if not quantity._is_multiplicative:
        raise InputError(f"unit '{unit}' has an offset; expected a difference, in {like}")
    target = ureg.Quantity(1.0, _SPELLINGS.get(like.strip(), like.strip()))
    if quantity.dimensionality != target.dimensionality:
        raise InputError(f"unit '{unit}' does not fit; expected a unit like {like}")
    factor = float(quantity.to_base_units().magnitude)
    if quantity.units == ureg.degree:
        return math.radians(1.0)
    return factor


def parse(value: str | int | float, like: str) -> float:
    """
    Return a quantity such as ``'6.35 mm'`` in SI units.

    Parameters
    ----------
    value : str or number
        A number with a unit; without a unit only where ``like`` is dimensionless.
    like : str
        A unit of the expected dimension, for example ``'kPa'``.

    Raises
    ------
    InputError
        When there is no number, no unit, or the unit does not fit.

    Examples
    --------
    >>> parse('50 psi', like='Pa') // 1
    344737.0
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise InputError(f'{value!r} is not a quantity; expected for example "1 {like}"')
    number, _, unit = str(value).strip().partition(' ')
    try:
        magnitude = float(number)
    except ValueError as error:
        raise InputError(f"'{value}' is not a quantity; expected a number, a space and a unit "
                         f'like {like}') from error
    if not math.isfinite(magnitude):
        raise InputError(f"'{value}' is not finite")
    if not unit and si_dimension(like) != '':
        raise InputError(f"'{value}' has no unit; expected a unit like {like}")
    return magnitude * si_factor(unit, like)


def spaced(text: str) -> str:
    """
    Return a quantity as typed by a user in the form that `parse` accepts.

    Examples
    --------
    >>> spaced('5ms'), spaced(' 6,35 mm')
    ('5 ms', '6.35 mm')
    """
    plain = re.sub(r'^([-+]?\d+),(\d+)(?![\d.,])', r'\1.\2', text.strip())
    return re.sub(r'^([-+]?[\d.]+(?:e[-+]?\d+)?)(?=[^\d.\s])', r'\1 ', plain, flags=re.I)


@lru_cache(maxsize=128)
def si_dimension(unit: str) -> str:
    """Return the dimension of a unit as text, empty for a pure number (an angle has one)."""
    if unit in _KNOWN:
        return _KNOWN[unit][1]
    quantity = registry().Quantity(1.0, _SPELLINGS.get(unit.strip(), unit.strip()))
    if quantity.dimensionless and quantity.units not in (registry().degree, registry().radian):
        return ''
    return str(quantity.dimensionality) or 'angle'


def express(value: float, unit: str, digits: int = 6) -> str:
    """
    Return an SI value as text in ``unit``: the inverse of `parse`.

    Examples
    --------
    >>> express(0.00635, 'mm')
    '6.35 mm'
    """
    shown = f'{value / si_factor(unit, unit):.{digits}g}'
    return shown if si_dimension(unit) == '' and unit in ('', '1') else f'{shown} {unit}'
