# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a strain, a contraction, an elongation, a displacement or a length to the strain.

Lengths become strains by the rest length of the muscle, which the user, the file or the model
tells.
"""

from collections.abc import Iterable
from decimal import Decimal
import re
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, numbers
from fam_bundle_ros.data.checks import partial_correlations
from fam_bundle_ros.data.column_names import is_longer, names_rest_length, rest_length_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.told_columns import Choice
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import number

#: What else a rest length is called above a table.
_OF_MUSCLE = re.compile('(muscle|actuator|pam|active|gau?ge|specimen|sample)[ _]length|'
                        '(muskel|einspann|mess)l(\u00e4|ae)nge', re.IGNORECASE)
#: Rows that show with how many decimals a column is written.
_SOME = 1000
#: Partial correlation of force and displacement beyond which the force tells the sign.
_TELLS = 0.2
#: A position is a length if its largest is the rest length within this share: no muscle shortens
#: by its length.
_AT_REST = 0.02
#: Strains: a muscle is stretched by more than the first, and shortens at least by the second.
_STRETCHED, _SHORTER = 0.05, 0.02
#: Strains of two columns that differ by more are not of one muscle with one zero.
_APART = 0.01


class RestLength(NamedTuple):
    """The rest length of a muscle, m, by source: the first that is known is used."""

    #: By the user.
    told: float | None
    #: By the file.
    stated: float | None
    #: By the model.
    model: float | None

    @property
    def used(self) -> float | None:
        """The length by which lengths become strains."""
        return self.told or self.stated or self.model

    @property
    def note(self) -> str:
        """Where the next source states another length, as lengths are shown; else ''."""
        other = self.model if self.told is None else self.stated
        if not self.used or not other:
            return ''
        used, shown = f'{1e3 * self.used:.4g} mm', f'{1e3 * other:.4g} mm'
        if used == shown:
            return ''
        words = (f', as the file says; the model has {shown}' if self.told is None else
                 f'; the file says {shown}')
        return f'read with a rest length of {used}{words} (--rest-length)'


def stated_rest_length(table: Table) -> tuple[float | None, str]:
    """
    Return the rest length that a file states, m, and a note on it.

    It stands in a line above the rows or between them, in a column that is constant, or it is the
    sum of a length and a contraction. None where the file states none; the note is '' unless the
    lines state several.
    """
    said = _said(table.lines)
    if said:
        return said[0], '' if len(said) == 1 else (
            f'several rest lengths in the file: {_shown(said)}; the first is taken '
            '(--rest-length)')
    for header, column in table.columns.items():
        if told := _of_column(table, header, column):
            return told[0] if len(told) == 1 else None, ''
    return _sum_of_lengths(table), ''


def refuse_several(table: Table) -> None:
    """Raise InputError where titles of blocks of rows, or a column, tell several rest lengths."""
    texts: list[str] = []
    for column in filter(is_text, table.columns.values()):
        texts += dict.fromkeys(cell for cell in column if isinstance(cell, str))
    if table.columns and is_text(first := next(iter(table.columns.values()))):
        texts += [' '.join(cell_text(column[at]) for column in table.columns.values())
                  for at in np.flatnonzero(numbers(first)[1])[:_SOME]]
    found = [_said([*table.lines, *texts]) if _said(texts) else [], *(
        _of_column(table, header, column) for header, column in table.columns.items())]
    several = max(found, key=len)
    if several and max(several) > (1.0 + _APART) * min(several):
        raise InputError(f'{table.name}: rest lengths of {_shown(several)} in one table; expected '
                         'one muscle: a file for each, or --rest-length for all rows')


def _said(lines: Iterable[str]) -> list[float]:
    """Return the rest lengths that lines state, m, each once."""
    return list(dict.fromkeys(
        length for line in lines
        if (length := rest_length_of(_OF_MUSCLE.sub('rest length', line))) is not None))


def _of_column(table: Table, header: str, column: np.ndarray) -> list[float]:
    """Return the rest lengths that a column holds, m, each once; [] where it holds none."""
    name = f"{header} {table.units.get(header, '')}".strip()
    if rest_length_of(f'{name}=1') is None:
        return []
    readings = numbers(column)[0]
    return [length for told in np.unique(readings[np.isfinite(readings)])
            if (length := rest_length_of(f'{name}={told}')) is not None]


def _shown(lengths: list[float]) -> str:
    return ', '.join(f'{1e3 * length:.4g} mm' for length in lengths[:4])


def _without_unit(table: Table) -> list[str]:
    """Return notes on lines that state a rest length without its unit."""
    return [f"in the file stands '{line.strip()[:60]}', without a unit: not used (--rest-length)"
            for line in dict.fromkeys(table.lines) if names_rest_length(line)]


def _sum_of_lengths(table: Table) -> float | None:
    """
    Return the length, m, that a length and a contraction add up to in all rows, or None.

    The sum is constant to the last digits that both columns show, and to single precision.
    """
    parts = {}
    for header in table.columns:
        match = table.meaning(header)
        if match.quantity in ('length', 'contraction') and match.unit and match.unit.like == 'm':
            parts[match.quantity] = numbers(table.columns[header])[0], match.unit.factor
    if len(parts) < 2:
        return None
    total = np.sum([values * factor for values, factor in parts.values()], axis=0)
    known = np.isfinite(total)
    if not known.any():
        return None
    middle = float(np.median(total[known]))
    digits = sum(_last_digit(values[known]) * factor for values, factor in parts.values())
    rounding = digits + float(np.finfo(np.float32).eps) * abs(middle)
    return middle if np.abs(total[known] - middle).max() <= rounding else None


def _last_digit(values: np.ndarray) -> float:
    """
    Return the value of one unit of the last decimal that any of the first readings shows.

    Examples
    --------
    >>> _last_digit(np.array([1.5, 2.0, 2.25]))
    0.01
    """
    places = [Decimal(repr(value)).normalize().as_tuple().exponent
              for value in values[:_SOME].tolist()]
    return float(10.0 ** min(0, *(place for place in places if isinstance(place, int))))


def strain_of(table: Table, key: str, choice: Choice, values: dict[str, np.ndarray],
              pressure: np.ndarray, rest: RestLength, rows: np.ndarray, told: bool,
              ) -> tuple[np.ndarray, list[str]]:
    """
    Return the strain, (T,), and notes on it.

    Parameters
    ----------
    key : str
        One of `column_names.STRAINS`.
    choice : Choice
        Its column; the sign of a displacement is set here.
    values : dict of str to ndarray, shape (T,)
        Readings of ``key`` and of the force, SI, with the sign of their columns.
    pressure : ndarray, shape (T, n), Pa
    rows : ndarray of int, shape (T,)
    told : bool
        Whether the user tells the column, and with it what is positive and where zero is.

    Raises
    ------
    InputError
        For a length without a rest length, one that does not fit it, and a strain that is not
        told and never is positive.
    """
    given, shown = values[key], choice.header or key
    notes: list[str] = []
    ratio = given
    if choice.in_lengths:
        if rest.told is None:
            refuse_several(table)
        if rest.told is None and rest.stated is None:
            notes += _without_unit(table)
        if rest.used is None:
            longest = (f'; the longest here is {1e3 * np.nanmax(given):.4g} mm'
                       if key == 'length' else '')
            raise InputError(
                f"{table.name}: '{shown}' is a length; expected a strain, or the rest length to "
                f'make one (--rest-length, rest_length, or a model){longest}')
        notes += filter(None, [rest.note])
        ratio = given / rest.used
    if key == 'shift' and choice.in_lengths and (
            abs(np.nanmax(ratio, initial=0.0) - 1.0) < _AT_REST):
        key, choice.why = 'length', 'a length: its largest is the rest length'
    if key == 'length':
        return 1.0 - ratio, notes + _length_notes(table.name, choice, ratio, rest, rows)
    if key == 'shift':
        notes += _set_sign(choice, ratio, pressure, values['force'])
        ratio = ratio * choice.sign
    if not told:
        _refuse_longer(table, choice, ratio, rest)
    return ratio, [*notes, *_range_notes(shown, ratio, choice.in_lengths, key == 'shift'),
                   *_percent_notes(shown, choice, given)]


def other_strains(table: Table, headers: Iterable[str], strain: np.ndarray, rest: RestLength,
                  rows: np.ndarray) -> list[str]:
    """
    Return notes on columns that tell another strain than that which was read.

    ``headers`` are columns that tell the strain too, and are not used; ``rows`` (T,) is the index
    of each reading in the columns.
    """
    notes = []
    for header in headers:
        match = table.meaning(header)
        whole = 1.0 if match.unit is None or match.unit.like == '1' else rest.used
        # the sign and the zero of a displacement are not known
        if match.unit is None or whole is None or match.quantity not in (
                'strain', 'contraction', 'length'):
            continue
        ratio = numbers(table.columns[header])[0][rows] * match.unit.factor / whole
        other = 1.0 - ratio if match.quantity == 'length' else ratio
        known = np.isfinite(other) & np.isfinite(strain)
        apart = float(np.abs(other - strain)[known].max(initial=0.0))
        if apart > _APART and not (match.quantity == 'strain' and is_longer(header)):
            notes.append(f"'{header}' tells another strain, by up to {apart:.2g}: which one is "
                         'right? Tell it (--columns)')
    return notes


def _refuse_longer(table: Table, choice: Choice, strain: np.ndarray, rest: RestLength) -> None:
    """Raise InputError where the muscle is stretched, by more than 5 %, and never shorter."""
    known = strain[np.isfinite(strain)]
    if not len(known) or known.min() > -_STRETCHED or known.max() > _SHORTER:
        return
    names = ['contraction', 'elongation'][::choice.sign]
    size = _size(-known.min(), choice, rest)
    header = choice.header or ''
    column = header if table.unit_text(header) or choice.unit is None else (
        f'{header} [{choice.unit.text}]')
    raise InputError(
        f"{table.name}: by '{choice.header}' the muscle never is shorter than at rest; expected "
        f'zero at the rest length, and the direction: --columns "{names[1]}={column}" '
        f'turns it round, --columns "{names[0]}={column} {"-+"[choice.sign > 0]} {size}" '
        f'moves its zero, --columns "{names[0]}={column}" takes it as it is')


def _length_notes(name: str, choice: Choice, share: np.ndarray, rest: RestLength,
                  rows: np.ndarray) -> list[str]:
    """Return notes on lengths as shares of the rest length; refuse those of another muscle."""
    longest = float(np.nanmax(share)) if np.isfinite(share).any() else 1.0
    if not 0.5 < longest < 1.2:
        says = f'; the file says {1e3 * rest.stated:.4g} mm' if rest.stated else ''
        size = 1e3 * (rest.used or 1.0)
        if choice.why.startswith('by its unit'):
            says += (f'; if it is a position, tell its zero, for example --columns "contraction='
                     f'{choice.header} - {size * np.nanmin(share):.4g} mm"')
        raise InputError(
            f'{name}, row {rows[np.nanargmax(share)]}: lengths up to {size * longest:.4g} mm '
            f'beside a rest length of {size:.4g} mm; expected the rest length of this muscle '
            f'(--rest-length, rest_length, or its model){says}')
    if longest < 0.9:
        return [f'never longer than {longest:.2f} of the rest length']
    if longest > 1.0 + _STRETCHED:
        off = _size(longest - 1.0, choice, rest)
        return [f"by '{choice.header}' the muscle is stretched, up to {longest:.2f} of the rest "
                'length: expected the length without fittings; --columns '
                f'"length={choice.header} - {off}" takes them off']
    return []


def _size(share: float, choice: Choice, rest: RestLength) -> str:
    """Return a share of the rest length as it is told, in mm where the column has lengths."""
    if rest.used and choice.in_lengths:
        return f'{1e3 * rest.used * share:.4g} mm'
    return f'{share:.4g}'


def _range_notes(shown: str, ratio: np.ndarray, in_lengths: bool, is_shift: bool) -> list[str]:
    """Return notes on a contraction whose zero is not at the rest length."""
    notes = []
    known = ratio[np.isfinite(ratio)] if np.isfinite(ratio).any() else np.zeros(1)
    low, high = known.min(), known.max()
    # the zero of a position is anywhere; a contraction may begin within its range
    if in_lengths and low > 0.05 and (is_shift or low > 0.5 * (high - low)):
        notes.append(f"'{shown}' never is near zero ({low:.3f} of the rest length at least): "
                     'expected zero at the rest length')
    if low < -_STRETCHED:
        notes.append(f"by '{shown}' the muscle is stretched by {-100.0 * low:.0f} %: expected "
                     'zero at the rest length')
    return notes


def _percent_notes(shown: str, choice: Choice, given: np.ndarray) -> list[str]:
    """Return a note on percents that are as small as ratios."""
    if choice.unit is None or choice.unit.factor != 0.01:
        return []
    largest = np.nanmax(np.abs(given))
    return [f"'{shown}' reaches only {number(100 * largest, 2)} %: is it a ratio, not %?"
            ] if largest < 0.006 else []


def _set_sign(choice: Choice, ratio: np.ndarray, pressure: np.ndarray, force: np.ndarray,
              ) -> list[str]:
    """
    Set the sign with which a displacement is positive when the muscle is shorter.

    The force falls when a muscle shortens. Under a load that hangs on the muscle the displacement
    follows the pressure, which shortens it. Returns a note where neither is seen.
    """
    rows = np.isfinite(ratio) & np.isfinite(force) & np.isfinite(pressure).all(axis=1)
    along, _, follows = partial_correlations(ratio[rows], pressure[rows].sum(-1), force[rows])
    longer = along > _TELLS or follows < 0.0
    choice.sign, notes = -1 if longer else 1, []
    if abs(along) > _TELLS or follows:
        word = 'positive when longer' if longer else 'positive when shorter'
        said = f'{word}, as the {"pressure" if follows else "force"} tells'
    else:
        said = 'taken as positive when shorter'
        notes.append(f"'{choice.header}' is taken as positive when shorter; the force does not "
                     'tell')
    choice.why = f'{choice.why}, {said}'.removeprefix(', ')
    return notes
