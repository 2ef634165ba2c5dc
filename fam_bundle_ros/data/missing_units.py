# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Units of columns without one: stated beside the table, or the only one with sensible readings.

Lines beside a table state some: 'Force unit: lbf', 'units: s, psi, N'. Where several units give
sensible readings, the error names them and what to write. A guessed unit is always reported.
"""

from collections.abc import Iterator, Sequence
import re

import numpy as np

from fam_bundle_ros.data.column_names import likes, recognise, STRAINS, unit_for
from fam_bundle_ros.data.unit_names import is_unit, Unit, unit_of
from fam_bundle_ros.errors import InputError

#: Quantity: SI unit, units that are often left out, and the range of the largest reading (SI).
_USUAL = {
    'pressure': ('Pa', ('kPa', 'bar', 'MPa', 'psi', 'Pa', 'mbar'), 50e3, 1.2e6),
    'force': ('N', ('N',), 0.0, 20e3),
    'strain': ('1', ('1', '%'), 0.0, 0.6),
    'strain_rate': ('1/s', ('1/s',), 0.0, np.inf),
}
#: The range of lengths, as shares of the rest length: no braid shortens by more than 0.42.
_LENGTHS = {'length': (0.6, 1.15), 'contraction': (0.03, 0.45), 'elongation': (0.03, 0.45),
            'shift': (0.03, 0.45)}
#: A clock without a unit and with steps of at least this may count milliseconds.
_SLOWEST = 2.0
#: Steps of a clock in s are longer than the first; below the second it may count minutes.
_FASTEST, _QUICK = 2e-6, 2e-3
#: Words for a unit in a line that states some.
_WORD = re.compile(r'\b(units?|einheit(en)?|unit(e|\u00e9)s?)\b( of\b)?', re.IGNORECASE)
#: What parts a name from its unit, and one statement from the next.
_BREAK = re.compile(r'[,;:=|\t()\[\]]|\s+in\s+')
#: A column without a unit, in a list of them.
_NO_UNIT = frozenset(('', '-', '1'))


def example_unit(quantity: str) -> str:
    """Return the unit in which a message shows how a column is told."""
    return {'force': 'N', 'pressure': 'kPa', 'strain': '%'}.get(quantity, 'mm')


def guess_unit(name: str, header: str, quantity: str, values: np.ndarray,
               rest_length: float | None) -> tuple[Unit, str]:
    """
    Return the unit that a column without one must have, and the words that say so.

    The values (T,) are as they stand in the file; the rest length, m, tells the unit of lengths.

    Raises
    ------
    InputError
        Where several units would do, or none.
    """
    # a percentile, as a single outlier must not decide
    top = float(np.nanpercentile(np.abs(values), 99)) if np.isfinite(values).any() else 0.0
    fitting = _fitting(quantity, top, rest_length)
    if quantity == 'shift':  # a position may be a length
        fitting += [unit for unit in _fitting('length', top, rest_length) if unit.like == 'm']
    if header.startswith('/'):  # ROS topics are in SI units
        fitting = [unit for unit in fitting if unit.text == 'm'] or fitting
    if len(fitting) == 1:
        said = '' if fitting[0].text == '1' else f'{fitting[0].text} guessed, no unit given'
        return fitting[0], said
    texts = [unit.text.replace('1', 'ratio') for unit in fitting]
    example = fitting[0].text if fitting else example_unit(quantity)
    reason = f' (up to {top:.4g} could be {" or ".join(texts)})' if texts else (
        f' (up to {top:.4g})')
    raise InputError(f"{name}: column '{header}' has no unit{reason}; expected it told, for "
                     f'example --columns "{quantity.replace("shift", "contraction")}={header} '
                     f'[{example}]"')


def _fitting(quantity: str, top: float, rest_length: float | None) -> list[Unit]:
    """Return the units in which the largest reading is within the range of its quantity."""
    if quantity in _USUAL:
        like, texts, low, high = _USUAL[quantity]
        if quantity == 'strain' and top <= 1.0:
            texts = texts[:1]  # a range below 1 % is not of a muscle
        tries = [(text, like, 1.0) for text in texts]
    else:
        low, high = _LENGTHS[quantity]
        tries = [(text, 'm', rest_length) for text in ('mm', 'cm', 'm', 'in') if rest_length]
        tries += [(text, '1', 1.0) for text in (('1',) if quantity == 'length' else ('1', '%'))]
    units = [(unit_of(text, like), whole) for text, like, whole in tries]
    return [unit for unit, whole in units if unit and low <= top * unit.factor / whole <= high]


def time_unit(name: str, header: str, values: np.ndarray) -> tuple[Unit, str]:
    """
    Return the unit of a clock without one: s, or what Unix and spreadsheets count in.

    Raises
    ------
    InputError
        Where it may be s or ms.
    """
    finite = values[np.isfinite(values)]
    top = float(np.abs(finite).max()) if len(finite) else 0.0
    # seconds up to the year 2096: beyond is a counter of ms or us since the start
    for least, most, text in ((1e17, np.inf, 'ns'), (1e14, 1e17, 'us'), (1e11, 1e14, 'ms'),
                              (1e9, 4e9, 's')):
        unit = unit_of(text, 's')
        if least < top <= most and unit is not None:
            return unit, f'{text} since 1970, by its size'
    steps = np.abs(np.diff(finite))
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    if 2e4 < top < 1e6 and 0 < step < 2e-5:
        return Unit('d', 86400.0, 's'), 'days, as spreadsheets count'
    if step >= _SLOWEST:
        example = 'us' if step > 1e3 * _SLOWEST else 'ms'
        raise InputError(f"{name}: column '{header}' has no unit, and its steps of {step:.4g} may "
                         f'be s, ms or us; expected it told, for example --columns '
                         f'"time={header} [{example}]"')
    if 0.0 < step < _FASTEST:
        raise InputError(f"{name}: column '{header}' has no unit, and its steps of {step:.4g} are "
                         f'short for s; expected it told, for example --columns "time={header} '
                         '[d]"')
    # whole numbers may count milliseconds, quick ones minutes
    sure = len(steps) > 0 and step > _QUICK and bool((finite != np.round(finite)).any())
    return Unit('s', 1.0, 's'), '' if sure else 's guessed, no unit given'


def stated_unit(lines: Sequence[str], headers: Sequence[str], header: str, quantity: str,
                ) -> Unit | None:
    """
    Return the unit that lines beside a table state for a column; None for none, or for several.

    ``quantity`` is what the column was taken for; a list of units may have one for each of the
    ``headers``.

    Examples
    --------
    >>> columns = ['t', 'p', 'F']
    >>> for line in ('# units: s, psi, lbf', 'Channel 1: Force (lbf)', 'p in bar, force in lbf'):
    ...     print(stated_unit([line], columns, 'F', 'force').text)
    lbf
    lbf
    lbf
    >>> stated_unit(['Load cell: 500 lbf', 'force limit in lbf'], columns, 'F', 'force')
    """
    found = {unit for line in lines for text in _stated(line, headers, header, quantity)
             if (unit := unit_for(quantity, text))}
    return found.pop() if len(found) == 1 else None


def _stated(line: str, headers: Sequence[str], header: str, quantity: str) -> Iterator[str]:
    """Yield the texts of units in a line that are of a column."""
    lists = _WORD.search(line) is not None
    parts = _parts(_WORD.sub('', line))
    if list(filter(None, parts)) == [part for one in headers for part in _parts(one) if part]:
        return  # the row of names: a column 'g' is no unit of the column before it
    while parts and not parts[0]:
        del parts[0]
    if lists and len(parts) == 1:  # 'units s psi lbf'
        parts = parts[0].split()
    if lists and len(parts) == len(headers) and all(
            part in _NO_UNIT or is_unit(part) for part in parts):
        yield parts[headers.index(header)]
        return
    named, several = False, lists and not _named(parts) and sum(map(is_unit, parts)) > 1
    for part in parts:
        if not part:
            continue
        unit = unit_for(quantity, part) if (
            part not in _NO_UNIT and part.casefold() != header.casefold()) else None
        if unit and (named or several and unit.like == likes(quantity)[0]):
            yield part
        named = part.casefold() == header.casefold() or not is_unit(part) and (
            recognise(part).score > 1 and _same(recognise(part).quantity, quantity))


def _parts(line: str) -> list[str]:
    return [part.strip(' "#\r\n') for part in _BREAK.split(line)]


def _named(parts: Sequence[str]) -> bool:
    """Return whether one of some words names a quantity."""
    return any(not is_unit(part) and recognise(part).quantity for part in parts)


def _same(named: str, quantity: str) -> bool:
    """Return whether two quantities are one; each that tells the strain counts as the strain."""
    return named == quantity or {named, quantity} <= {*STRAINS}
