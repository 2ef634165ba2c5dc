# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Checks of measured arrays: ranges that catch a wrong unit or sign, and what does not change.

A reading outside its range usually has a wrong unit in the header; the message names the unit
that was probably meant.
"""

from collections.abc import Mapping
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text
from fam_bundle_ros.data.column_names import unit_for, words_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import number

#: Highest gauge pressure of a pneumatic muscle, Pa, and highest strain, unless told otherwise.
MAX_PRESSURE = 1.2e6
MAX_STRAIN = 0.6
#: Smaller ranges are one strain, and one pressure (share of the largest).
_ONE_STRAIN, _ONE_PRESSURE = 1e-4, 0.01
#: A smaller share of the rows does not decide on a unit; as in `missing_units.guess_unit`.
_FEW = 0.01
#: Variance inflation beyond which a column follows another one (the usual rule is 5 to 10).
_INFLATION = 5.0
#: What a column is called that tells of which muscle a row is, its words joined.
_SPECIMEN = re.compile('(specimen|muscle|actuator|muskel|aktor|probe|pruefling|dut|mu|motor ?unit|'
                    'serial|fam|pam)( (id|no|nr|num|number|name|nummer))?')
#: Most muscles of one table, and fewest rows of each on average.
_MOST_SPECIMENS, _SPECIMEN_ROWS = 50, 12


class Range(NamedTuple):
    """Range of a quantity: lowest, highest (SI), SI unit, in words, option to widen it."""

    low: float
    high: float
    unit: str
    words: str
    option: str


#: Readings up to here may be right: hydraulic muscles (Pa), a muscle of length zero.
_HIGHEST = {'pressure': 1e8, 'strain': 1.0}
#: A unit is suggested only if the largest reading in it is at least this.
_SMALLEST = {'pressure': 20e3, 'strain': 0.02, 'force': 5.0}
#: Units that the header probably should have said.
_GUESSES = {'pressure': ('kPa', 'Pa', 'MPa', 'bar', 'psi'), 'strain': ('%', '1'),
            'force': ('N', 'lbf', 'mN', 'kN')}


def ranges(max_pressure: float | None = None, max_strain: float | None = None,
           ) -> dict[str, Range]:
    """
    Return the range of each quantity, by the highest gauge pressure (Pa) and strain of a muscle.

    At least `MAX_PRESSURE` and `MAX_STRAIN` are allowed.
    """
    pressure = max(1.2 * (max_pressure or 0.0), MAX_PRESSURE)
    strain = max(1.05 * (max_strain or 0.0), MAX_STRAIN)
    return {
        'pressure': Range(-60e3, pressure, 'Pa', 'gauge pressure between 0 and '
                          f'{max(1.0, (max_pressure or 0.0) / 1e6):.3g} MPa', '--max-pressure'),
        'strain': Range(-0.2, strain, '', 'a strain between 0 and '
                        f'{max(0.5, max_strain or 0.0):.3g}, positive when shorter',
                        '--max-strain'),
        'force': Range(-20e3, 20e3, 'N', 'a force within 20 kN, tension positive', '')}


def check_range(name: str, label: str, values: np.ndarray, rows: np.ndarray,
                given: tuple[str, float] | None, quantity: str, allowed: Range) -> None:
    """
    Raise `InputError` where readings are outside their range; guess what was meant.

    The values (T,) are SI, of a 'pressure', 'strain' or 'force'; ``given`` is the unit that they
    had and its factor to SI. File, column and ``rows`` (T,) of the file are for the message.
    """
    low, high, si, words, option = allowed
    outside = (values < low) | (values > high)
    unit, factor = given or (si, 1.0)
    shown = '' if unit in ('1', '-') else unit
    if outside.any():
        at = int(np.argmax(np.where(outside, np.abs(values), -1.0)))
        few = outside.mean() < _FEW
        guess = (f' (in {outside.sum()} of {len(values)} rows: blank the cells if they are no '
                 'readings)' if few else _guess(quantity, values / factor, unit, low, high))
        if not guess and quantity == 'strain' and np.median(values) < 0:
            guess = ' (is the sign turned round?)'
        elif high < values[at] < _HIGHEST.get(quantity, high):
            guess += f', or {option} for a muscle that goes further'
        raise InputError(f'{name}, row {rows[at]}: {label} is {values[at] / factor:.6g} {shown}'
                         f'; expected {words}{guess}'.replace(' ;', ';'))


def check_pressure_units(name: str, columns: Mapping[str, np.ndarray],
                         units: Mapping[str, tuple[str, float]], allowed: Range) -> None:
    """
    Raise `InputError` where all pressures are less than any muscle needs: a unit is too small.

    One column alone may be so small: a motor unit that stays vented, by a gauge with an offset.
    ``columns`` are in Pa, (T,); ``units`` have the unit that each was given in, and its factor to
    SI.
    """
    for values in columns.values():
        top = np.abs(values).max()
        # more than the noise of a vented gauge, and not negative as that is
        if not (1.0 < top < 1.5e3 and values.min() > -0.1 * top):
            return
    for label, values in columns.items():
        unit, factor = units.get(label, (allowed.unit, 1.0))
        guess = _guess('pressure', values / factor, unit, allowed.low, allowed.high)
        if guess:
            raise InputError(f'{name}: {label} reaches only {np.abs(values).max() / factor:.4g} '
                             f'{unit}; expected {allowed.words}{guess}')


def _guess(quantity: str, given: np.ndarray, unit: str, low: float, high: float) -> str:
    for other in filter(None, (unit_for(quantity, text) for text in _GUESSES[quantity])):
        tried = given * other.factor
        if other.text != unit and tried.min() >= low and tried.max() <= high and (
                np.abs(tried).max() > _SMALLEST[quantity]):
            return f' (did you mean {other.text}?)'
    return ''


def what_does_not_change(name: str, strain: np.ndarray, pressure: np.ndarray) -> list[str]:
    """
    Return notes on a strain (T,) or pressures (T, n), Pa, that are constant.

    Raises
    ------
    InputError
        Where neither strain nor pressure changes; it has the ``name`` of the file.
    """
    isometric = np.ptp(strain) < _ONE_STRAIN
    held = np.ptp(pressure, axis=0) < max(1e3, _ONE_PRESSURE * np.abs(pressure).max())
    isobaric = held.all()
    if isometric and isobaric:
        raise InputError(
            f'{name}: neither strain ({strain.mean():.4f}) nor pressure '
            f'({pressure.mean() / 1e3:.1f} kPa) changes; expected at least one of them to')
    if isometric:
        return [f'one strain only ({strain.mean():.4f}): effects of strain cannot be told apart']
    if isobaric:
        return [f'one pressure only ({pressure.mean() / 1e3:.1f} kPa): effects of pressure cannot '
                'be told apart']
    return [f'pressure {unit + 1} of {len(held)} is {pressure[:, unit].mean() / 1e3:.4g} kPa '
            'throughout: the effect of this pressure cannot be determined'
            for unit in np.flatnonzero(held)]


def odd_signs(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> list[str]:
    """
    Return notes on unusual signs and sizes: a muscle pulls, and pulls less when it is shorter.

    The signs are those of the partial correlations of the force (T,), N, with strain (T,) and
    pressures (T, n), Pa.
    """
    along_strain, along_pressure, _ = partial_correlations(strain, pressure.sum(-1), force)
    found = []
    if np.median(force) < 0.0 and (along_pressure < -0.5 or along_strain > 0.5 > along_pressure):
        found.append('the force is negative, and more so with pressure or when longer: expected '
                     'tension positive; is its sign turned round?')
    elif along_strain > 0.5 and along_pressure > -0.5:
        found.append('the force rises with the strain: expected strain positive when shorter; is '
                     'its sign turned round?')
    most = np.abs(force).max()
    if most < _SMALLEST['force'] and pressure.max() > _SMALLEST['pressure']:
        found.append(f'the force reaches only {number(most)} N: is it in another unit?')
    return found


class Correlations(NamedTuple):
    """
    Partial correlation of the force with strain (at equal pressure) and with pressure, -1 to 1.

    0 where a quantity does not vary. Where the strain follows the pressure (a load hangs on the
    muscle) the two cannot be separated: ``follows`` is then the correlation of strain and
    pressure, otherwise 0; ``along_strain`` is 0 and ``along_pressure`` the plain correlation.
    """

    along_strain: float
    along_pressure: float
    follows: float


def partial_correlations(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
                         ) -> Correlations:
    """Return the partial correlations of force, strain and pressure, (T,) each."""
    centred = []
    for values in (strain, pressure, force):
        gap = values - values.mean()
        size = np.sqrt(gap @ gap)
        still = size <= 1e-9 * np.sqrt(len(gap)) * max(1.0, np.abs(values).max())
        centred.append(np.zeros(len(gap)) if still else gap / size)
    e, p, f = centred
    ep, ef, pf = float(e @ p), float(e @ f), float(p @ f)

    def partial(xy: float, xz: float, yz: float) -> float:
        rest = (1.0 - xz ** 2) * (1.0 - yz ** 2)
        return float((xy - xz * yz) / np.sqrt(rest)) if rest > 1e-9 else 0.0

    if ep ** 2 > 1.0 - 1.0 / _INFLATION:
        return Correlations(0.0, pf, ep)
    return Correlations(partial(ef, ep, pf), partial(pf, ep, ef), 0.0)


def several_muscles(table: Table) -> list[str]:
    """Return a note on each column by which the rows are of several muscles."""
    notes = []
    for header, column in table.columns.items():
        if not _SPECIMEN.fullmatch(' '.join(words_of(header))):
            continue
        found = list(dict.fromkeys(filter(None, map(_shown, column))))
        if 1 < len(found) <= min(_MOST_SPECIMENS, len(column) // _SPECIMEN_ROWS):
            notes.append(
                f"'{header}' is {', '.join(found[:3])}{', ...' * (len(found) > 3)}: all rows are "
                'read as one muscle; expected a file for each specimen, or a column of pressure '
                'for each motor unit')
    return notes


def _shown(cell: object) -> str:
    """Return a cell as text: a number without decimals that are zero, '' for nan."""
    return ('' if cell != cell else f'{cell:g}') if isinstance(cell, float) else cell_text(cell)
