# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units at the edges of the package: text with units in, SI floats out, and back."""

from functools import lru_cache
import math
import re
from typing import Any

from fam_bundle_ros.errors import InputError

#: Words that people write in lab notes and that pint does not take as units.
_SPELLINGS = {'%': 'percent', '': 'dimensionless', '1': 'dimensionless', '-': 'dimensionless',
              'lbf': 'pound_force', 'deg': 'degree'}
#: Units that models and laws are written in: SI factor, powers of m, kg and s. Products and
#: quotients of them need no pint, which takes 0.2 s to start.
_COMMON: dict[str, tuple[float, tuple[int, int, int]]] = {
    '': (1.0, (0, 0, 0)), '1': (1.0, (0, 0, 0)), '%': (0.01, (0, 0, 0)),
    'rad': (1.0, (0, 0, 0)), 'deg': (math.radians(1.0), (0, 0, 0)),
    'm': (1.0, (1, 0, 0)), 'mm': (1e-3, (1, 0, 0)),
    'kg': (1.0, (0, 1, 0)), 'g': (1e-3, (0, 1, 0)),
    's': (1.0, (0, 0, 1)), 'ms': (1e-3, (0, 0, 1)),
    'N': (1.0, (1, 1, -2)), 'J': (1.0, (2, 1, -2)),
    'Pa': (1.0, (-1, 1, -2)), 'kPa': (1e3, (-1, 1, -2)), 'MPa': (1e6, (-1, 1, -2)),
}
_ANGLES = ('rad', 'deg')


@lru_cache(maxsize=1)
def registry() -> Any:
    """Return the package's only pint registry (made on first use)."""
    import pint
    ureg: pint.UnitRegistry = pint.UnitRegistry()
    if 'percent' not in ureg:
        ureg.define('percent = 0.01 = %')
    return ureg


@lru_cache(maxsize=512)
def si_factor(unit: str, like: str) -> float:
    """
    Return how many SI units of the dimension of ``like`` one ``unit`` is.

    Raises
    ------
    InputError
        When ``unit`` is unknown or has another dimension than ``like``.

    Examples
    --------
    >>> si_factor('kPa', like='Pa')
    1000.0
    """
    known, wanted = _common(unit), _common(like)
    if known and wanted:
        if known[1] != wanted[1]:
            raise InputError(f"unit '{unit}' does not fit; expected a unit like {like}")
        return known[0]
    ureg = registry()
    try:
        quantity = ureg.Quantity(1.0, _SPELLINGS.get(unit.strip(), unit.strip()))
    except Exception as error:  # pint raises many kinds, also its tokenizer's own
        raise InputError(f"unit '{unit}' is not known") from error
    if not quantity._is_multiplicative:
        raise InputError(f"unit '{unit}' has an offset; expected a difference, in {like}")
    target = ureg.Quantity(1.0, _SPELLINGS.get(like.strip(), like.strip()))
    if quantity.dimensionality != target.dimensionality:
        raise InputError(f"unit '{unit}' does not fit; expected a unit like {like}")
    factor = float(quantity.to_base_units().magnitude)
    if quantity.units == ureg.degree:
        return math.radians(1.0)
    return factor


def _common(unit: str) -> tuple[float, tuple[int, ...]] | None:
    """Return SI factor and powers of m, kg and s of common units; None where pint must look."""
    factor = 1.0
    powers: tuple[int, ...] = (0, 0, 0)
    for sign, name in re.findall(r'(^|[*/])([^*/]*)', unit.strip()):
        if name not in _COMMON or (not name and unit.strip()):
            return None
        size, own = _COMMON[name]
        way = -1 if sign == '/' else 1
        factor *= size ** way
        powers = tuple(a + way * b for a, b in zip(powers, own))
    return factor, powers


def parse(value: str | int | float, like: str) -> float:
    """
    Return a quantity such as ``'6.35 mm'`` in SI units.

    Parameters
    ----------
    value : str or number
        A number with a unit; a bare number is taken only where ``like`` is dimensionless.
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


@lru_cache(maxsize=128)
def si_dimension(unit: str) -> str:
    """Return the dimension of a unit as text, empty for a pure number (an angle has one)."""
    known = _common(unit)
    if known:
        return str(known[1]) if any(known[1]) or unit.strip() in _ANGLES else ''
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
