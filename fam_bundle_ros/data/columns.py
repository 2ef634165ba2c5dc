# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a table whose columns have names and units to a `Measurement` in SI units.

`column_choice` decides which column is which quantity. Here cells become numbers, units become
SI units, absolute pressures become gauge pressures, and lengths become strains.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
import re

import numpy as np

from fam_bundle_ros.data import checks, clocks
from fam_bundle_ros.data.cell_text import is_number, is_statistic
from fam_bundle_ros.data.cells import (
    blank,
    is_text,
    labels,
    looks_like_time,
    no_reading,
    numbers,
    seconds,
)
from fam_bundle_ros.data.column_choice import Choices
from fam_bundle_ros.data.column_names import (
    absolute_of,
    likes,
    names_rest_length,
    recognise,
    rest_length_of,
)
from fam_bundle_ros.data.formats.heads import interval_of
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.measurement import build, counted, Measurement, Taken
from fam_bundle_ros.data.missing_units import guess_unit, time_unit
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.data.told_columns import Choice, with_sums
from fam_bundle_ros.data.unit_names import is_unit, Unit, unit_of
from fam_bundle_ros.errors import InputError

#: What else a rest length is called above a table.
_OF_MUSCLE = re.compile('(muscle|actuator|pam|active|gau?ge|specimen|sample)[ _]length|'
                        '(muskel|einspann|mess)l(\u00e4|ae)nge', re.IGNORECASE)
#: Rest lengths that differ by less are one: no sensor tells such a shift of the strain.
_SAME_LENGTH = 5e-4
#: How closely a length and a contraction add up to the rest length.
_SUM = 0.01
#: Beside these a force may be in lbf.
_INCHES = ('psi', 'psia', 'psig', 'in', 'inch', 'inches')
#: The lowest reading of a vented sensor that shows absolute pressures, Pa.
_ATMOSPHERE = 94e3, 104e3
#: Pressures that differ by less are one, Pa.
_VENTED = 3e3


@dataclass
class _Reader:
    """One table on its way to a measurement."""

    table: Table
    recipe: Recipe
    choices: Choices
    notes: list[str] = field(default_factory=list)

    def measurement(self) -> Measurement:
        """Return the measurement."""
        table, recipe = self.table, self.recipe
        self.choices.make(recipe.columns)
        self.choices.complete()
        strains, pressures = self.choices.strains, self.choices.pressures
        values = self._numbers()
        values, time, rows = self._together(values, self._time(values))
        given: dict[str, tuple[str, float]] = {}
        for key in ('force', *pressures, *strains, *(['strain_rate'] if 'strain_rate' in values
                                                     else [])):
            unit = self._unit(key, values[key])
            choice = self.choices.chosen[key]
            values[key] = values[key] * unit.factor * choice.sign + choice.offset
            given[key] = (unit.text, unit.factor)
        pressure = np.stack([values[key] - self._ambient(key, values) for key in pressures], -1)
        strain = self._strain(strains[0], values, pressure)
        trial = self.choices.chosen.get('trial')
        measured = build(
            table.name, strain, pressure, values['force'],
            labels(table.columns[trial.header])[rows] if trial and trial.header else None, time,
            [key.partition('.')[2] or 'mu1' for key in pressures], values.get('strain_rate'),
            rows=table.rows[rows], notes=list(dict.fromkeys((*table.notes, *self.notes))),
            max_strain=recipe.max_strain, max_pressure=recipe.max_pressure,
            units={key: unit for key, unit in given.items() if key in ('force', *pressures) or (
                key == 'strain' and strains[0] == 'strain')})
        lengths = self.choices.chosen[strains[0]].unit
        return replace(measured, taken=self.choices.taken(), rest_length=self.rest_length
                       if lengths is not None and lengths.like == 'm' else None,
                       first_dropped={reason: (row, self._text(reason.partition(' in ')[2], row))
                                      for reason, (row, _) in measured.first_dropped.items()})

    def _text(self, label: str, row: int) -> str:
        """Return what stands in a row in place of the number of a quantity, '' for nothing."""
        key = {'strain': self.choices.strains[0]}.get(label, label)
        if key == 'pressure':
            key = self.choices.pressures[0]
        choice = self.choices.chosen.get(key)
        text = self.table.text_of(choice.header, row) if choice and choice.header else ''
        return '' if is_number(text) else text[:40]

    @property
    def _remarks(self) -> list[str]:
        """The lines above the data and the comments between."""
        return [*self.table.above, *(text for _, text in self.table.remarks)]

    @property
    def rest_length(self) -> float | None:
        """The rest length, m: as told, else as the file says, else the muscle's."""
        return self.recipe.rest_length or self._told_length or self.recipe.muscle_length

    @cached_property
    def _told_length(self) -> float | None:
        """What the file says of the rest length, in its remarks or in a column that stays."""
        said = [length for line in self._remarks
                if (length := rest_length_of(_OF_MUSCLE.sub('rest length', line))) is not None]
        if said:
            if len(set(said)) > 1:
                self.notes.append('several rest lengths in the file: ' + ', '.join(
                    f'{1e3 * length:.4g} mm' for length in dict.fromkeys(said))
                    + '; the first is taken (--rest-length)')
            return said[0]
        for header, column in self.table.columns.items():
            name = f"{header} {self.table.units.get(header, '')}".strip()
            if rest_length_of(f'{name}=1') is not None:
                readings = numbers(column)[0]
                told = np.unique(readings[np.isfinite(readings)])
                if len(told) == 1:
                    return rest_length_of(f'{name}={told[0]}')
        return self._length_of_sum()

    def _length_of_sum(self) -> float | None:
        """Return the length that a length and a contraction beside it add up to."""
        parts = {}
        for header, column in self.table.columns.items():
            match = self.table.meaning(header)
            unit = match.unit
            if match.quantity in ('length', 'contraction') and unit and unit.like == 'm':
                parts[match.quantity] = numbers(column)[0] * unit.factor
        total = sum(parts.values()) if len(parts) > 1 else np.zeros(1)
        middle = float(np.nanmedian(total))
        return middle if np.nanmax(np.abs(total - middle)) < _SUM * middle else None

    def _numbers(self) -> dict[str, np.ndarray]:
        """Return the readings of each quantity as floats; a word among readings is an error."""
        values: dict[str, np.ndarray] = {}
        words: dict[str, np.ndarray] = {}
        for key, choice in self.choices.chosen.items():
            if key in ('trial', 'time'):
                continue
            if choice.header is None:
                values[key] = np.full(len(self.table.rows), choice.value)
                if choice.unit is not None:  # a constant is in SI units
                    choice.unit = choice.unit._replace(factor=1.0)
                continue
            values[key], words[choice.header] = numbers(self.table.columns[choice.header])
            code = no_reading(values[key])
            if code is not None:
                coded = values[key] == code
                values[key] = np.where(coded, np.nan, values[key])
                self.notes.append(f"{counted(int(coded.sum()), 'cell')} of '{choice.header}' hold "
                                  f'{code:g}: taken as no reading')
        between = self._between(values)
        self._refuse_another_header(between)
        footer = self._footer(between)
        for key in values:
            values[key] = np.where(footer, np.nan, values[key])
        rows = self._with_readings(values)
        for header, bad in words.items():
            self._refuse_words(header, bad & rows)
        return values

    def _between(self, values: dict[str, np.ndarray]) -> np.ndarray:
        """Return the rows of words between the data: no reading, but something."""
        between = ~self._with_readings(values)
        rows = np.flatnonzero(between)
        texts = [column[rows] for column in self.table.columns.values() if is_text(column)]
        between[rows] = [any(not blank(cell) for cell in cells) for cells in zip(*texts)] or False
        return between

    def _cells(self, at: int) -> list[str]:
        """Return the cells of a row as text, '' for blanks."""
        return ['' if blank(column[at]) else str(column[at]).strip()
                for column in self.table.columns.values()]

    def _other_words(self, at: int) -> list[str]:
        """Return the cells of a row that are neither blank nor the header or its unit again."""
        units = self.table.units
        return [cell for cell, header in zip(self._cells(at), self.table.columns)
                if cell and ' '.join(cell.split()) not in (header, _plain(header))
                and cell.strip('[](){}<>') != units.get(header)]

    def _refuse_another_header(self, between: np.ndarray) -> None:
        """Refuse a header with other columns or units further down: rows below are misread."""
        for at in np.flatnonzero(between).tolist():
            cells = [cell for cell in self._cells(at) if cell]
            other = self._other_words(at)
            if sum(map(_of_a_header, cells)) > 1 and any(map(_of_a_header, other)):
                raise InputError(
                    f"{self.table.name}, row {self.table.rows[at]}: another header, "
                    f"'{', '.join(cells)[:80]}'; expected the columns and units of the first, "
                    f"'{', '.join(self.table.columns)[:80]}', or a file of its own")

    def _footer(self, between: np.ndarray) -> np.ndarray:
        """
        Return the rows at the end that are no samples: statistics, or another small table.

        They begin with a word, below rows that do not, or a column of remarks calls them
        statistics, or the clock first goes back below a row of words.
        """
        column = next(iter(self.table.columns.values()))
        _, words = numbers(column)
        footer = np.cumprod(words[::-1])[::-1].astype(bool)
        if looks_like_time(column) or footer.mean() > 0.1 or words[~footer].mean() > 0.5:
            footer[:] = False
        for remarks in filter(is_text, self.table.columns.values()):
            count = sum(1 for _ in takewhile(is_statistic, remarks[::-1]))
            footer[len(footer) - count:] = True
        clock = self.choices.chosen.get('time')
        if clock is not None and clock.header and not looks_like_time(
                self.table.columns[clock.header]):
            time, _ = numbers(self.table.columns[clock.header])
            known = np.flatnonzero(np.isfinite(time))
            for last in np.flatnonzero(np.diff(time[known]) < 0)[:1]:
                heads = [at for at in range(known[last] + 1, known[last + 1])
                         if between[at] and self._other_words(at)]
                footer[heads[0] if heads else len(time):] = True
        if footer.mean() > 0.1 or not footer.any():
            return np.zeros(len(column), bool)
        at = int(np.argmax(footer))
        begin = next(cell for cell in self._cells(at) if cell)
        self.notes.append(f"left out from row {self.table.rows[at]} on: it begins with "
                          f"'{begin[:40]}'")
        return footer

    def _with_readings(self, values: dict[str, np.ndarray]) -> np.ndarray:
        """Return the rows with at least one number: others are words between the data."""
        rows = np.zeros(len(self.table.rows), bool)
        for key, column in values.items():
            if self.choices.chosen[key].header is not None:
                rows |= np.isfinite(column)
        return rows

    def _refuse_words(self, header: str, bad: np.ndarray) -> None:
        if not bad.any() or self.recipe.drop_bad:
            return
        at = int(np.argmax(bad))
        cell = str(self.table.columns[header][at])[:40]
        comma = re.fullmatch(r'[-+]?\d+,\d+', cell)
        raise InputError(f"{self.table.name}, row {self.table.rows[at]}: {header} is '{cell}'; "
                         f'expected a number{" with a point, not a comma" if comma else ""}, or '
                         'a blank or a word for one (nan, n/a, overflow, ...: '
                         'docs/how_to/data.md lists them), which leaves the row out '
                         '(--drop-bad: so do words)')

    def _time(self, values: dict[str, np.ndarray]) -> np.ndarray | None:
        choice = self.choices.chosen.get('time')
        if choice is None:
            if 'time' in self.choices.without:
                return None
            interval = interval_of(self.table.above)
            self.notes += filter(None, [
                f'time from the sample interval above the table, {interval:.6g} s' if interval else
                clocks.may_be_clock(self.table, {
                    each.header for each in self.choices.chosen.values()})])
            return interval * np.arange(len(self.table.rows)) if interval else None
        if choice.header is None:
            return choice.value * np.arange(len(self.table.rows))
        return self._seconds(choice, choice.header, self._with_readings(values))

    def _seconds(self, choice: Choice, header: str, rows: np.ndarray) -> np.ndarray:
        """Return a clock, (T,), s: the one that was chosen, or one that is called as it is."""
        column, chosen = self.table.columns[header], self.table.columns[str(choice.header)]
        if looks_like_time(column):
            if header != choice.header and not np.array_equal(column, chosen):
                raise InputError(f"{self.table.name}: '{header}' shows other times than "
                                 f"'{choice.header}'; expected one clock, or clocks in seconds")
            choice.unit = None
            if chosen.dtype == object:
                chosen = np.where(rows, chosen, '')
            return choice.sign * seconds(self.table.name, str(choice.header), chosen,
                                         self.table.rows)
        clock, words = numbers(column)
        self._refuse_words(header, words & rows)
        clock, anew = clocks.run_on(clock)
        if anew and header == choice.header:
            self.notes.append(f"the counter '{header}' began anew at {anew:.10g}: read on")
        choice.unit = choice.unit or self._unit_above(header, 'time')
        if choice.unit is None:
            choice.unit, choice.why = time_unit(self.table.name, header, clock)
        # digits of a clock that counts since 1970 are worth more than its origin
        first = numbers(chosen)[0]
        known = first[np.isfinite(first)]
        origin = known[0] if len(known) and np.abs(known).max() > 1e8 else 0.0
        return (clock - origin) * choice.unit.factor * choice.sign

    def _together(self, values: dict[str, np.ndarray], time: np.ndarray | None,
                  ) -> tuple[dict[str, np.ndarray], np.ndarray | None, np.ndarray]:
        """Return readings and times in which all quantities stand together, and of which rows."""
        choice, rows = self.choices.chosen.get('time'), np.arange(len(self.table.rows))
        if time is None or choice is None or choice.header is None:
            return values, time, rows
        known = self._with_readings(values)
        found = clocks.bring_together(
            self.table, choice.header,
            {key: each.header for key in values if (each := self.choices.chosen[key]).header},
            values, lambda header: self._seconds(choice, header, known))
        if found is None:
            return values, time, rows
        self.notes.append(found.note)
        for key, clock in found.clocks.items():
            if clock != choice.header:
                self.choices.refused[clock] = f'but as the clock of {key}'
        rows = np.flatnonzero(found.rows)
        return {key: each[rows] for key, each in {**values, **found.values}.items()}, \
            found.time[rows], rows

    def _unit(self, key: str, values: np.ndarray) -> Unit:
        choice = self.choices.chosen[key]
        choice.unit = choice.unit or self._unit_above(choice.header or '', key.partition('.')[0])
        if choice.unit is None:
            inches = [each.unit.text for each in self.choices.chosen.values()
                      if each.unit and each.unit.text.casefold() in _INCHES]
            if key == 'force' and inches:
                raise InputError(f"{self.table.name}: column '{choice.header}' has no unit, and "
                                 f'another is in {inches[0]}; expected it told, for example '
                                 f'--columns "force={choice.header} [lbf]", or [N]')
            choice.unit, choice.why = guess_unit(self.table.name, choice.header or key,
                                                 key.partition('.')[0], values,
                                                 self.rest_length)
        return choice.unit

    def _unit_above(self, header: str, quantity: str) -> Unit | None:
        """Return the unit that lines above the table give a name: 'Channel 1: Force (lbf)'."""
        found = {unit for line in self.table.above for text in re.findall(
            rf'(?:^|[:;,=|\t])\s*{re.escape(header)}\s*[\[(]([^\])]+)[\])]', line, re.IGNORECASE)
            for like in likes(quantity) if (unit := unit_of(text, like))}
        return found.pop() if header and len(found) == 1 else None

    def _ambient(self, key: str, values: dict[str, np.ndarray]) -> float:
        choice, gauge = self.choices.chosen[key], self.recipe.gauge
        absolute = choice.absolute if gauge is None else not gauge
        choice.absolute = bool(absolute)
        if absolute is None and (why := self._may_be_absolute(values[key], values['force'])):
            self.notes.append(f"{why}: '{choice.header}' is taken as gauge; is it absolute "
                              '(--absolute)?')
        return self.recipe.ambient_pressure if absolute else 0.0

    def _may_be_absolute(self, pressure: np.ndarray, force: np.ndarray) -> str:
        """Return what tells that: a remark, or hardly a force at that of the atmosphere; or ''."""
        for line in self._remarks:
            if absolute_of(line) and re.search('(?i)press|druck', line):
                return f"in the file stands '{line.strip()[:60]}'"
        rows = np.isfinite(pressure) & np.isfinite(force)
        lowest = pressure[rows].min(initial=np.inf)
        if not _ATMOSPHERE[0] < lowest < _ATMOSPHERE[1]:
            return ''
        low, size = np.abs(force[rows & (pressure < lowest + _VENTED)]), np.abs(force[rows])
        return (f'hardly a force at the lowest pressure, {lowest / 1e3:.4g} kPa'
                if np.median(low) < 0.1 * size.max() else
                f'the lowest pressure under a weight is {lowest / 1e3:.4g} kPa'
                if np.ptp(size) < 0.2 * size.max() else '')

    def _strain(self, key: str, values: dict[str, np.ndarray], pressure: np.ndarray,
                ) -> np.ndarray:
        choice, rest = self.choices.chosen[key], self.rest_length
        given, shown = values[key], choice.header or key
        in_lengths = choice.unit is not None and choice.unit.like == 'm'
        if in_lengths and self._told_length is None and self.recipe.rest_length is None:
            self.notes += [f"in the file stands '{line.strip()[:60]}', without a unit: not used "
                           '(--rest-length)' for line in self._remarks
                           if names_rest_length(line)]
        if in_lengths and rest is None:
            longest = (f'; the longest here is {1e3 * np.nanmax(given):.4g} mm'
                       if key == 'length' else '')
            raise InputError(
                f"{self.table.name}: '{shown}' is a length; expected a strain, or the rest length "
                f'to make one (--rest-length, rest_length, or a model){longest}')
        told, by_file = self._told_length, self.recipe.rest_length is None
        other = self.recipe.muscle_length if by_file else told
        if in_lengths and rest and other and abs(other / rest - 1.0) > _SAME_LENGTH:
            self.notes.append(
                f'read with a rest length of {1e3 * rest:.4g} mm' + (
                    f', as the file says; the model has {1e3 * other:.4g} mm' if by_file else
                    f'; the file says {1e3 * other:.4g} mm') + ' (--rest-length)')
        if key == 'length':
            share = given / rest if in_lengths and rest is not None else given
            self._length_fits(share, rest or 1.0)
            return 1.0 - share
        ratio = given / rest if in_lengths and rest is not None else given
        if key == 'shift':
            ratio = ratio * self._sign_of_shift(ratio, pressure, values['force'])
        low, high = ((np.nanmin(ratio), np.nanmax(ratio)) if np.isfinite(ratio).any()
                     else (0.0, 0.0))
        # the zero of a position is anywhere; a contraction may begin within its range
        if in_lengths and low > 0.05 and (key == 'shift' or low > 0.5 * (high - low)):
            self.notes.append(f"'{shown}' never is near zero ({low:.3f} of the rest length at "
                              'least): expected zero at the rest length')
        if low < -0.05:
            self.notes.append(f"by '{shown}' the muscle " + (
                'never is shorter than at rest: expected positive when shorter, ' if high < 0.02
                else f'is stretched by {-100.0 * low:.0f} %: expected ')
                + 'zero at the rest length')
        if choice.unit is not None and choice.unit.factor == 0.01 and np.nanmax(
                np.abs(given)) < 0.006:
            self.notes.append(f"'{shown}' reaches only {100 * np.nanmax(np.abs(given)):.2g} %: is "
                              'it a ratio, not %?')
        return ratio

    def _length_fits(self, share: np.ndarray, rest: float) -> None:
        longest = float(np.nanmax(share)) if np.isfinite(share).any() else 1.0
        if not 0.5 < longest < 1.2:
            told = self._told_length
            says = f'; the file says {1e3 * told:.4g} mm' if told else ''
            raise InputError(
                f'{self.table.name}: lengths up to {1e3 * rest * longest:.4g} mm beside a rest '
                f'length of {1e3 * rest:.4g} mm; expected the rest length of this muscle '
                f'(--rest-length, rest_length, or its model){says}')
        if longest < 0.9:
            self.notes.append(f'never longer than {longest:.2f} of the rest length')
        if longest > 1.1:
            self.notes.append(f'up to {longest:.2f} of the rest length: expected the length '
                              'without fittings')

    def _sign_of_shift(self, ratio: np.ndarray, pressure: np.ndarray, force: np.ndarray) -> int:
        """
        Return +1 where a displacement shortens the muscle: its force then falls.

        Under a load that hangs on the muscle it follows the pressure, which shortens.
        """
        choice = self.choices.chosen['shift']
        rows = np.isfinite(ratio) & np.isfinite(force) & np.isfinite(pressure).all(axis=1)
        along, _, follows = checks.partial_correlations(
            ratio[rows], pressure[rows].sum(-1), force[rows])
        longer = along > 0.2 or follows < 0.0
        choice.sign = -1 if longer else 1
        if abs(along) > 0.2 or follows:
            word = 'positive when longer' if longer else 'positive when shorter'
            said = f'{word}, as the {"pressure" if follows else "force"} tells'
        else:
            said = 'taken as positive when shorter'
            self.notes.append(f"'{choice.header}' is taken as positive when shorter; the force "
                              'does not tell')
        choice.why = f'{choice.why}, {said}'.removeprefix(', ')
        return choice.sign


def _plain(header: str) -> str:
    """Return a header without the count of one that is there twice."""
    return re.sub(r' \(\d+\)$', '', header)


def _of_a_header(cell: str) -> bool:
    return recognise(cell).score > 1 or is_unit(cell)


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
    table = with_sums(table, recipe.columns)
    return _Reader(table, recipe, Choices(table)).measurement()


def described(table: Table, recipe: Recipe) -> tuple[tuple[Taken, ...], str, Measurement | None]:
    """Return what each column was taken for, the error that reading ends in, and the data."""
    table = with_sums(table, recipe.columns)
    reader = _Reader(table, recipe, Choices(table))
    try:
        measured = reader.measurement()
    except InputError as error:
        return reader.choices.taken(), str(error), None
    return measured.taken, '', measured
