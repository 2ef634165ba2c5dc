# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a table whose columns have names and units to a `Measurement` in SI units.

Columns that the user names are taken as told; the others are recognised by their names
(`vocabulary`). Where two would do, or none, the message lists every column with what it was
taken for, and why not.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import re

import numpy as np

from fam_bundle_ros.data import checks
from fam_bundle_ros.data.cells import is_text, labels, looks_like_time, numbers, seconds
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.guesses import guess_unit, time_unit
from fam_bundle_ros.data.measurement import build, Measurement, Taken
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.data.vocabulary import (
    likes,
    Match,
    QUANTITIES,
    recognise,
    STRAINS,
    Unit,
    unit_of,
)
from fam_bundle_ros.errors import InputError

#: A name that stands among other words is taken only with a unit that fits.
_ENOUGH = 2
#: More trials than rows over this: the column counts rows.
_ROWS_PER_TRIAL = 2


@dataclass
class _Choice:
    """A column that is used: quantity to header (None for a constant), unit, sign."""

    header: str | None
    unit: Unit | None = None
    sign: int = 1
    value: float = 0.0
    absolute: bool | None = None
    why: str = ''


@dataclass
class _Reader:
    """One table on its way to a measurement."""

    table: Table
    recipe: Recipe
    chosen: dict[str, _Choice] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def measurement(self) -> Measurement:
        table, recipe = self.table, self.recipe
        self._told()
        self._recognised()
        strains = [key for key in STRAINS if key in self.chosen]
        pressures = [key for key in self.chosen if key.partition('.')[0] == 'pressure']
        for key, there in (('strain', strains), ('force', 'force' in self.chosen),
                           ('pressure', pressures)):
            if not there:
                raise InputError(self._missing(key))
        values = {key: self._number(key, choice) for key, choice in self.chosen.items()
                  if key not in ('trial', 'time')}
        time = self._time()
        self._no_words(list(values))
        given: dict[str, tuple[str, float]] = {}
        for key in ('force', *pressures, *strains, *(['strain_rate'] if 'strain_rate' in values
                                                     else [])):
            unit = self._unit(key, values[key])
            values[key] = values[key] * unit.factor * self.chosen[key].sign
            given[key] = (unit.text, unit.factor)
        pressure = np.stack([values[key] - self._ambient(key) for key in pressures], -1)
        strain = self._strain(strains[0], values, pressure)
        trial = self.chosen.get('trial')
        measured = build(
            table.name, strain, pressure, values['force'],
            labels(table.columns[trial.header]) if trial and trial.header else None, time,
            [key.partition('.')[2] or 'mu1' for key in pressures], values.get('strain_rate'),
            rows=table.rows, notes=[*table.notes, *self.notes], max_strain=recipe.max_strain,
            units={key: unit for key, unit in given.items() if key in ('force', *pressures) or (
                key == 'strain' and strains[0] == 'strain')}, max_pressure=recipe.max_pressure)
        lengths = self.chosen[strains[0]].unit
        return replace(measured, taken=self.taken(), rest_length=recipe.rest_length
                       if lengths is not None and lengths.like == 'm' else None)

    # -- which column is what ---------------------------------------------------------------

    def _told(self) -> None:
        for key, text in self.recipe.columns.items():
            self.chosen[key] = self._find(key, text.strip())

    def _find(self, key: str, text: str) -> _Choice:
        """Return the column that a user's words mean, or a constant."""
        base = key.partition('.')[0]
        for sign, words in ((1, text), (-1, text[1:].strip() if text.startswith('-') else '')):
            header, unit_text = self._header(words)
            if not header:
                continue
            match = recognise(header, self.table.units.get(header, ''))
            unit = match.unit
            if unit_text is None and (unit is None or unit.like not in likes(base)):
                unit_text = self.table.units.get(header) or _bracketed(header)
            if unit_text is not None and base != 'trial':
                unit = self._fitting(base, unit_text, header)
            if unit is not None and base != 'trial' and unit.like not in likes(base):
                unit = None
            absolute = match.absolute if unit is None or unit.absolute is None else unit.absolute
            return _Choice(header, unit, sign, absolute=absolute, why='as told')
        number = re.fullmatch(r'([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*)?', text)
        if number and base != 'trial' and (number[2] or base == 'strain'):
            like = '1/s' if base == 'time' and unit_of(number[2] or '', 's') is None else None
            if like and (number[2] or '').strip() in ('Hz', 'kHz', 'Sa/s', '1/s'):
                rate = float(number[1]) * (1e3 if number[2].strip() == 'kHz' else 1.0)
                if rate > 0:
                    return _Choice(None, Unit('s', 1.0, 's'), value=1.0 / rate, why='as told')
            unit = self._fitting(base, number[2] or '', text)
            return _Choice(None, unit, value=float(number[1]) * unit.factor, why='as told')
        have = ', '.join(f"'{header}'" for header in self.table.columns)
        raise InputError(f"{self.table.name}: no column '{text}' for {key}; expected one of "
                         f'{have}, or its number')

    def _fitting(self, base: str, text: str, header: str) -> Unit:
        for like in likes(base):
            unit = unit_of(text, like)
            if unit is not None:
                return unit
        raise InputError(f"{self.table.name}: column '{header}': unit '{text}' does not fit; "
                         f'expected a unit like {QUANTITIES[base]}')

    def _header(self, words: str) -> tuple[str, str | None]:
        """Return the header that words mean and the unit that they tell; '' for none."""
        headers = list(self.table.columns)
        if not words:
            return '', None
        same = ' '.join(words.split())
        if same in headers:
            return same, None
        match = re.fullmatch(r'(.*?)\s*\[([^\[\]]*)\]', same)
        name, unit = (match[1], match[2]) if match else (same, None)
        if name in headers:
            return name, unit
        for plain in (str.casefold, _without_brackets):
            alike = [header for header in headers if plain(header) == plain(same if plain is
                                                                          str.casefold else name)]
            if len(alike) == 1:
                return alike[0], unit if plain is _without_brackets else None
            if len(alike) > 1:
                raise InputError(f"{self.table.name}: '{words}' may be "
                                 f"{' or '.join(repr(header) for header in alike)}; expected the "
                                 'whole header')
        if name.isdigit() and 1 <= int(name) <= len(headers):
            return headers[int(name) - 1], unit
        return '', None

    def _recognised(self) -> None:
        used = {choice.header for choice in self.chosen.values()}
        families = {_family(key) for key in self.chosen}
        found: dict[str, list[tuple[str, Match]]] = {}
        for header, column in self.table.columns.items():
            if header in used:
                continue
            first = re.sub(r' \(\d+\)$', '', header)  # the second of two columns of one name
            match = recognise(first if first in self.table.columns else header,
                              self.table.units.get(header, ''))
            why = self._why_not(header, column, match, families)
            if why:
                self.refused[header] = why
                continue
            key = match.quantity
            if key == 'pressure' and match.part:
                key = f'pressure.{match.part}'
            found.setdefault(key, []).append((header, match))
        self._one_of_each(found)
        for header in list(self.refused):
            if 'time' not in self.chosen and re.fullmatch(r'column \d+', header) and (
                    looks_like_time(self.table.columns[header])):
                self.chosen['time'] = _Choice(header, why='dates without a name')
                del self.refused[header]

    def _why_not(self, header: str, column: np.ndarray, match: Match, families: set[str]) -> str:
        if not match.quantity or not match.score:
            return match.why if match.quantity else (
                'text' if is_text(column) and match.why == 'not known' else match.why)
        if match.score < _ENOUGH:
            return f'may be {match.quantity}, but for its other words'
        if _family(match.quantity) in families:
            return f'{_family(match.quantity)} was told'
        if match.quantity == 'trial':
            count = len(np.unique(labels(column)))
            return (f'{count} different values in {len(column)} rows: no trials'
                    if count * _ROWS_PER_TRIAL > len(column) else '')
        if match.quantity != 'time' and is_text(column):
            values, words = numbers(column)
            if not np.isfinite(values).any():
                return 'text' if words.any() else 'blank'
        elif not is_text(column) and column.dtype.kind == 'f' and np.isnan(column).all():
            return 'blank'
        return ''

    def _one_of_each(self, found: dict[str, list[tuple[str, Match]]]) -> None:
        pressures = [key for key in found if key.partition('.')[0] == 'pressure']
        if len(pressures) == 1 and not pressures[0].endswith('pressure'):
            header = found[pressures[0]][0][0]
            if not re.search(r'\bpressure\.', header):  # `p2` alone is the pressure
                found['pressure'] = found.pop(pressures[0])
        elif len(pressures) > 1 and 'pressure' in pressures:
            best = {key: max(match.score for _, match in found[key]) for key in pressures}
            clash = found['pressure'][0][0], next(found[key][0][0] for key in pressures
                                                  if key != 'pressure')
            if best['pressure'] >= max(best[key] for key in pressures if key != 'pressure'):
                raise InputError(f"{self.table.name}: '{clash[0]}' beside '{clash[1]}'; expected "
                                 'one name per motor unit')
            self._refuse(found.pop('pressure'), 'other columns name the motor units')
        strains = [key for key in STRAINS if key in found]
        for key in strains[1:]:
            self._refuse(found.pop(key), f'{strains[0]} is there')
        for key, entries in found.items():
            best_score = max(match.score for _, match in entries)
            best_ones = [entry for entry in entries if entry[1].score == best_score]
            if len(best_ones) > 1:
                names = ' and '.join(f"'{header}'" for header, _ in best_ones[:3])
                raise InputError(
                    f'{self.table.name}: {names} both may be {_shown(key)}; expected one, or to '
                    f'be told, for example --columns "{_shown(key)}={best_ones[0][0]}"')
            self._refuse([entry for entry in entries if entry is not best_ones[0]],
                         f"less like {_shown(key)} than '{best_ones[0][0]}'")
            header, match = best_ones[0]
            absolute = match.unit.absolute if match.unit else match.absolute
            self.chosen[key] = _Choice(header, match.unit, -1 if key == 'elongation' else 1,
                                       absolute=absolute)

    def _refuse(self, entries: list[tuple[str, Match]], why: str) -> None:
        self.refused.update({header: why for header, _ in entries})

    # -- values -------------------------------------------------------------------------------

    def _number(self, key: str, choice: _Choice) -> np.ndarray:
        if choice.header is None:
            choice.unit = Unit(choice.unit.text if choice.unit else '', 1.0,
                               choice.unit.like if choice.unit else QUANTITIES[key])
            return np.full(len(self.table.rows), choice.value)
        return numbers(self.table.columns[choice.header])[0]

    def _no_words(self, keys: list[str]) -> None:
        """Raise where a row of readings has a word among them; rows of words alone are blank."""
        used = [self.chosen[key].header for key in keys]
        columns = {header: numbers(self.table.columns[header]) for header in used if header}
        any_number = np.zeros(len(self.table.rows), bool)
        for values, _ in columns.values():
            any_number |= np.isfinite(values)
        for header, (_, words) in columns.items():
            bad = words & any_number
            if bad.any():
                at = int(np.argmax(bad))
                cell = str(self.table.columns[header][at])[:40]
                comma = ' with a point, not a comma' if re.fullmatch(r'[-+]?\d+,\d+',
                                                                     cell) else ''
                raise InputError(f"{self.table.name}, row {self.table.rows[at]}: {header} is "
                                 f"'{cell}'; expected a number{comma}")

    def _time(self) -> np.ndarray | None:
        choice = self.chosen.get('time')
        if choice is None:
            return None
        if choice.header is None:
            return choice.value * np.arange(len(self.table.rows))
        column = self.table.columns[choice.header]
        if column.dtype.kind in 'mM' or (is_text(column) and numbers(column)[1].any() and not
                                         np.isfinite(numbers(column)[0]).any()):
            choice.unit = None
            return choice.sign * seconds(self.table.name, choice.header, column, self.table.rows)
        values, words = numbers(column)
        if words.any():
            others = np.zeros(len(values), bool)
            for key, other in self.chosen.items():
                if key not in ('trial', 'time') and other.header:
                    others |= np.isfinite(numbers(self.table.columns[other.header])[0])
            if (words & others).any():
                at = int(np.argmax(words & others))
                raise InputError(f'{self.table.name}, row {self.table.rows[at]}: {choice.header} '
                                 f"is '{str(column[at])[:40]}'; expected a number")
        if choice.unit is None:
            choice.unit, choice.why = time_unit(values)
        origin = values[np.isfinite(values)][:1] if np.nanmax(np.abs(values), initial=0.0
                                                              ) > 1e8 else np.zeros(1)
        return (values - (origin[0] if len(origin) else 0.0)) * choice.unit.factor

    def _unit(self, key: str, values: np.ndarray) -> Unit:
        choice = self.chosen[key]
        if choice.unit is None:
            choice.unit, choice.why = guess_unit(self.table.name, choice.header or key,
                                                 key.partition('.')[0], values,
                                                 self.recipe.rest_length)
        return choice.unit

    def _ambient(self, key: str) -> float:
        choice, gauge = self.chosen[key], self.recipe.gauge
        absolute = choice.absolute if gauge is None else not gauge
        choice.absolute = bool(absolute)
        return self.recipe.ambient_pressure if absolute else 0.0

    def _strain(self, key: str, values: dict[str, np.ndarray], pressure: np.ndarray,
                ) -> np.ndarray:
        choice, rest = self.chosen[key], self.recipe.rest_length
        given, shown = values[key], choice.header or key
        in_lengths = choice.unit is not None and choice.unit.like == 'm'
        if in_lengths and rest is None:
            longest = (f'; the longest here is {1e3 * np.nanmax(given):.4g} mm'
                       if key == 'length' else '')
            raise InputError(
                f"{self.table.name}: '{shown}' is a length; expected a strain, or the rest length "
                f'to make one (--rest-length, rest_length, or a model){longest}')
        if key == 'length':
            assert rest is not None
            self._length_fits(given, rest)
            return 1.0 - given / rest
        ratio = given / rest if in_lengths and rest is not None else given
        if key == 'shift':
            ratio = ratio * self._sign_of_shift(ratio, pressure, values['force'])
        low = np.nanmin(ratio) if np.isfinite(ratio).any() else 0.0
        if in_lengths and low > 0.05 and low > 0.5 * (np.nanmax(ratio) - low):
            self.notes.append(f"'{shown}' never is near zero ({low:.3f} of the rest length at "
                              'least): expected zero at the rest length')
        if choice.unit is not None and choice.unit.factor == 0.01 and np.nanmax(
                np.abs(given)) < 0.006:
            self.notes.append(f"'{shown}' reaches only {100 * np.nanmax(np.abs(given)):.2g} %: is "
                              'it a ratio, not %?')
        return ratio

    def _length_fits(self, length: np.ndarray, rest: float) -> None:
        longest = float(np.nanmax(length)) if np.isfinite(length).any() else rest
        if not 0.5 < longest / rest < 1.2:
            raise InputError(
                f'{self.table.name}: lengths up to {1e3 * longest:.4g} mm beside a rest length of '
                f'{1e3 * rest:.4g} mm; expected the rest length of this muscle (--rest-length, '
                'rest_length, or its model)')
        if longest / rest < 0.9:
            self.notes.append(f'never longer than {longest / rest:.2f} of the rest length')

    def _sign_of_shift(self, ratio: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> int:
        """Return +1 where a displacement shortens the muscle: its force then falls."""
        choice = self.chosen['shift']
        if choice.why == 'as told':
            return 1
        rows = np.isfinite(ratio) & np.isfinite(force) & np.isfinite(pressure).all(axis=1)
        along, _ = checks.partial_correlations(ratio[rows], pressure[rows].sum(-1), force[rows])
        choice.sign = -1 if along > 0.2 else 1
        if abs(along) > 0.2:
            word = 'positive when longer' if along > 0 else 'positive when shorter'
            choice.why = f'{word}, as the force tells'
        else:
            choice.why = 'taken as positive when shorter'
            self.notes.append(f"'{choice.header}' is taken as positive when shorter; the force "
                              'does not tell')
        return choice.sign

    # -- words --------------------------------------------------------------------------------

    def taken(self) -> tuple[Taken, ...]:
        """Return what every column was taken for, in the order of the file."""
        of = {choice.header: (key, choice) for key, choice in self.chosen.items()}
        entries = []
        for header in self.table.columns:
            if header not in of:
                entries.append(Taken(header, '', '', 1, self.refused.get(header, 'not known')))
                continue
            key, choice = of[header]
            why = '' if choice.why == 'as told' else choice.why
            if choice.absolute:
                why = f'{why}, absolute'.lstrip(', ')
            entries.append(Taken(header, 'contraction' if key == 'shift' else key,
                                 choice.unit.text if choice.unit else '', choice.sign, why))
        return tuple(entries)

    def _missing(self, key: str) -> str:
        words = []
        for entry, (header, column) in zip(self.taken(), self.table.columns.items()):
            meant = _shown(entry.quantity) if entry.quantity else entry.why
            if not entry.quantity and not is_text(column) and column.dtype.kind == 'f' and (
                    np.isfinite(column).any()):
                meant += f' ({np.nanmin(column):.4g} to {np.nanmax(column):.4g})'
            words.append(f"'{header}' {meant}")
        free = [header for header, column in self.table.columns.items()
                if header in self.refused and not is_text(column)]
        example, unit = free[0] if free else '...', {'force': 'N', 'pressure': 'kPa',
                                                     'strain': '%'}[key]
        return (f"{self.table.name}: column '{key}' is missing; found {', '.join(words)}; tell "
                f'it, for example --columns "{key}={_name_of(example)} [{unit}]"')


def read_columns(table: Table, recipe: Recipe) -> Measurement:
    """
    Return the measurement that a table holds.

    Raises
    ------
    InputError
        Where a column is missing or doubtful (every column is listed with what it was taken
        for), a unit is unknown or does not fit, and for bad values.
    """
    if not table.columns:
        raise InputError(f'{table.name}: no columns; expected strain, pressure and force')
    return _Reader(table, recipe).measurement()


def described(table: Table, recipe: Recipe) -> tuple[tuple[Taken, ...], str, Measurement | None]:
    """Return what each column was taken for, the error that reading ends in, and the data."""
    reader = _Reader(table, recipe)
    try:
        measured = reader.measurement()
    except InputError as error:
        return reader.taken(), str(error), None
    return measured.taken, '', measured


def _family(key: str) -> str:
    base = key.partition('.')[0]
    return 'strain' if base in STRAINS else base


def _shown(key: str) -> str:
    return 'contraction' if key == 'shift' else key


def _bracketed(header: str) -> str | None:
    match = re.search(r'\[([^\[\]]*)\]\s*$', header)
    return match[1] if match else None


def _name_of(header: str) -> str:
    return re.sub(r'\s*[\[({<][^\[({<]*[\])}>]\s*$', '', header).strip()


def _without_brackets(header: str) -> str:
    return _name_of(header).casefold()
