# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a table whose columns have names and units to a `Measurement` in SI units.

`column_choice` decides which column is which quantity. Here cells become numbers, units become
SI units, absolute pressures become gauge pressures, and lengths become strains.
"""

from dataclasses import replace
from functools import cached_property
import re

import numpy as np

from fam_bundle_ros.data import clocks
from fam_bundle_ros.data.cells import (
    is_number,
    labels,
    looks_like_time,
    no_reading,
    numbers,
    seconds,
)
from fam_bundle_ros.data.checks import several_muscles
from fam_bundle_ros.data.column_choice import Choices
from fam_bundle_ros.data.column_names import absolute_of, words_of
from fam_bundle_ros.data.footers import footer, refuse_another_header, rows_of_words, settings
from fam_bundle_ros.data.formats.channels import clocks_in
from fam_bundle_ros.data.formats.heads import interval_of, scale_in
from fam_bundle_ros.data.formats.stacking import ONE_CLOCK
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.measurement import build, Measurement, Taken
from fam_bundle_ros.data.missing_units import guess_unit, stated_unit, time_unit
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.data.strains import (
    other_strains,
    RestLength,
    stated_rest_length,
    strain_of,
)
from fam_bundle_ros.data.told_columns import Choice, with_sums
from fam_bundle_ros.data.unit_names import Unit, unit_of
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.told import counted, number

#: A force without a unit may be in lbf beside one of these.
_INCHES = ('psi', 'psia', 'psig', 'in', 'inch', 'inches')
#: The lowest reading of a vented sensor that shows absolute pressures, Pa.
_ATMOSPHERE = 94e3, 104e3
#: Words for the atmosphere in the name of a pressure.
_AROUND = frozenset("""atm atmospheric atmosphere amb ambient baro barometric barometer
    umgebung""".split())
#: Pa: a pressure within this of the lowest is vented too.
_VENTED = 3e3


class _Reader:
    """Reads the columns of one table as a measurement."""

    def __init__(self, table: Table, recipe: Recipe):
        self.table, self.recipe = with_sums(table, recipe.columns), recipe
        self.choices = Choices(self.table)
        self.notes: list[str] = []
        #: Clocks of the columns on their right, [] where one clock is that of all.
        self.several = clocks_in(self.table)

    def _choose(self) -> None:
        """Choose the columns, and which of several clocks is the time."""
        told: dict[str, str] = {}
        zeros: list[str] = []
        if not self.several and 'time' not in self.recipe.columns:
            zeros = clocks.of_two_zeros(self.table)
        for first in (self.several or zeros)[:1]:
            unit_text = self.table.unit_text(first)
            told['time'] = f'{first} [{unit_text}]' if unit_text else first
        self.choices.make({**told, **self.recipe.columns})
        self.choices.refused.update(dict.fromkeys(zeros[1:], 'the same clock with another zero'))
        time = self.choices.chosen.get('time')
        if self.several and 'time' in self.recipe.columns and time and not time.offset:
            self.notes.append(f"{' and '.join(map(repr, self.several))} differ: the time is that "
                              'which is told, for all columns')
            self.several = []
        self.choices.refused.update(dict.fromkeys(self.several[1:],
                                                  'a clock of columns on its right'))
        self.choices.complete()

    def measurement(self) -> Measurement:
        """Return the measurement."""
        table, recipe, chosen = self.table, self.recipe, self.choices.chosen
        self._choose()
        strain_key, pressures = self.choices.strains[0], self.choices.pressures
        values = self._numbers()
        values, time, rows = self._together(values, self._time(values))
        given: dict[str, tuple[str, float]] = {}
        for key in ('force', *pressures, *self.choices.strains, 'strain_rate'):
            if key in values:
                unit, choice = self._unit(key, values[key]), chosen[key]
                values[key] = values[key] * unit.factor * choice.sign + choice.offset
                given[key] = unit.text, unit.factor
        pressure = np.stack([values[key] - self._ambient(key, values) for key in pressures], -1)
        strain, notes = strain_of(table, strain_key, chosen[strain_key], values, pressure,
                                  self._rest_length, table.rows[rows],
                                  told=strain_key in recipe.columns)
        if strain_key not in recipe.columns:
            notes += other_strains(table, [
                header for header, why in self.choices.refused.items()
                if why == f'{strain_key} is there'], strain, self._rest_length, rows)
        trial = chosen.get('trial')
        measured = build(
            table.name, strain, pressure, values['force'],
            labels(table.columns[trial.header])[rows] if trial and trial.header else None, time,
            [key.partition('.')[2] or 'mu1' for key in pressures], values.get('strain_rate'),
            rows=table.rows[rows], notes=[*self._of_table(), *self.notes, *notes],
            max_strain=recipe.max_strain, max_pressure=recipe.max_pressure,
            units={key: unit for key, unit in given.items()
                   if key in ('force', 'strain', *pressures)})
        return replace(
            measured, taken=self.choices.taken(),
            notes=(*measured.notes, *self._supplies(measured.pressure)),
            rest_length=self._rest_length.used if chosen[strain_key].in_lengths else None,
            first_dropped={reason: (row, self._text(reason.partition(' in ')[2], row))
                           for reason, (row, _) in measured.first_dropped.items()})

    def _of_table(self) -> list[str]:
        """Return notes on the table, without advice that was followed."""
        scale = scale_in(self.table.above)
        return [*(note for note in self.table.notes
                  if note != ONE_CLOCK or 'time' not in self.recipe.columns),
                *([f"above the rows stands '{scale[:60]}': the readings are taken as they are; if "
                   'these factors are to be applied, tell them, --columns "force=F * 0.1 N"']
                  if scale else []), *several_muscles(self.table)]

    def _supplies(self, pressure: np.ndarray) -> list[str]:
        """Return the question whether the highest pressure is a supply, if no name denies it."""
        low = pressure.min(axis=0)
        highest = int(np.argmax(low))
        header = self.choices.chosen[self.choices.pressures[highest]].header or ''
        # a motor unit that is on throughout
        of_muscle = re.search(r'mus[ck]|(?<![a-z])mu(?![a-z])', header.casefold())
        if len(low) == 1 or low[highest] < 0.8 * pressure.max() or of_muscle:
            return []
        return [f'pressure {highest + 1} of {len(low)} never is below {low[highest] / 1e3:.4g} '
                'kPa, where the others hardly get: is it a supply? Tell the others (--columns)']

    def _text(self, label: str, row: int) -> str:
        """
        Return the text in a row in place of the number of a quantity, '' for none.

        Where that cell is empty, the remark if the row has nothing else.
        """
        key = {'strain': self.choices.strains[0], 'pressure': self.choices.pressures[0]}.get(
            label, label)
        choice = self.choices.chosen.get(key)
        text = self.table.text_of(choice.header, row) if choice and choice.header else ''
        if not text:
            found = [*filter(None, (self.table.text_of(each, row) for each in self.table.columns))]
            text = found[0] if len(found) == 1 else ''
        return '' if is_number(text) else text[:40]

    @cached_property
    def _rest_length(self) -> RestLength:
        stated, note = stated_rest_length(self.table)
        self.notes += filter(None, [note])
        return RestLength(self.recipe.rest_length, stated, self.recipe.muscle_length)

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
                                  f'{code:.9g}: taken as no reading')
        told = settings(self.table, np.any([*words.values()], axis=0)) if words else False
        values = {key: np.where(told, np.nan, column) for key, column in values.items()}
        between = rows_of_words(self.table, self._with_readings(values))
        refuse_another_header(self.table, between)
        clock = self.choices.chosen.get('time')
        below, note = footer(self.table, between, clock.header if clock else None)
        self.notes += filter(None, [note])
        values = {key: np.where(below, np.nan, column) for key, column in values.items()}
        rows = self._with_readings(values)
        for header, bad in words.items():
            self._refuse_words(header, bad & rows)
        return values

    def _with_readings(self, values: dict[str, np.ndarray]) -> np.ndarray:
        """Return which rows have at least one number in a column that is used."""
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
        time = self._seconds(choice, choice.header, self._with_readings(values))
        interval, steps = interval_of(self.table.above), np.diff(time[np.isfinite(time)])
        step = float(np.median(steps)) if len(steps) else 0.0
        if interval and 0.0 < step < 0.5 * interval:
            self.notes.append(f"rows are {number(step)} s apart by '{choice.header}', and the "
                              f'sample interval above the table is {number(interval)} s: is the '
                              'unit of the time right?')
        return time

    def _seconds(self, choice: Choice, header: str, rows: np.ndarray) -> np.ndarray:
        """Return a clock, (T,), s: the chosen one, or another of the same name."""
        column, chosen = self.table.columns[header], self.table.columns[str(choice.header)]
        offset = choice.offset if header == choice.header else 0.0
        if looks_like_time(column):
            if header != choice.header and not np.array_equal(column, chosen):
                raise InputError(f"{self.table.name}: '{header}' shows other times than "
                                 f"'{choice.header}'; expected one clock, or clocks in seconds")
            choice.unit = None
            if chosen.dtype == object:
                chosen = np.where(rows, chosen, '')
            return offset + choice.sign * self._run_on(header, seconds(
                self.table.name, str(choice.header), chosen, self.table.rows))
        clock, words = numbers(column)
        self._refuse_words(header, words & rows)
        clock = self._run_on(header, clock)
        if choice.unit is None and (calendar := clocks.of_calendar(clock)) is not None:
            choice.why = 'digits of date and time'
            return calendar * choice.sign + offset
        if (choice.unit is None or choice.unit.factor == 1.0) and (
                day := clocks.of_day(clock)) is not None:
            choice.why = 'digits of the time of day, HHMMSS'
            return day * choice.sign + offset
        if choice.unit is None:
            choice.unit, choice.why = self._unit_stated(header, 'time')
        if choice.unit is None:
            choice.unit, choice.why = time_unit(self.table.name, header, clock)
        factor = choice.unit.factor
        if header != choice.header and header in self.several:
            unit = unit_of(self.table.unit_text(header) or '', 's')
            if unit is None and self.table.unit_text(str(choice.header)):
                unit, _ = time_unit(self.table.name, header, clock)
            factor = unit.factor if unit else factor
        # subtract the origin of a clock that counts since 1970 before digits are lost in scaling
        first = numbers(chosen)[0]
        known = first[np.isfinite(first)]
        origin = known[0] if len(known) and np.abs(known).max() > 1e8 else 0.0
        return (clock - origin * choice.unit.factor / factor) * factor * choice.sign + offset

    def _run_on(self, header: str, clock: np.ndarray) -> np.ndarray:
        clock, anew = clocks.run_on(clock)
        if anew:
            self.notes.append(f"the counter '{header}' began anew at {anew:.10g}: read on")
        return clock

    def _together(self, values: dict[str, np.ndarray], time: np.ndarray | None,
                  ) -> tuple[dict[str, np.ndarray], np.ndarray | None, np.ndarray]:
        """Return the readings of all quantities at common times, these times, and their rows."""
        choice, rows = self.choices.chosen.get('time'), np.arange(len(self.table.rows))
        if time is None or choice is None or choice.header is None:
            return values, time, rows
        known = self._with_readings(values)
        found = clocks.bring_together(
            self.table, choice.header, self.several,
            {key: each.header for key in values if (each := self.choices.chosen[key]).header},
            values, lambda header: time if header == choice.header else self._seconds(
                choice, header, known))
        if found is None:
            if 'time' not in self.recipe.columns:
                self.notes += filter(None, [clocks.other_times(self.table, choice.header, time)])
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
        if choice.unit is None:
            choice.unit, choice.why = self._unit_stated(choice.header or '', key.partition('.')[0])
        if choice.unit is None:
            inches = [each.unit.text for each in self.choices.chosen.values()
                      if each.unit and each.unit.text.casefold() in _INCHES]
            if key == 'force' and inches:
                raise InputError(f"{self.table.name}: column '{choice.header}' has no unit, and "
                                 f'another is in {inches[0]}; expected it told, for example '
                                 f'--columns "force={choice.header} [lbf]", or [N]')
            choice.unit, choice.why = guess_unit(self.table.name, choice.header or key,
                                                 key.partition('.')[0], values,
                                                 self._rest_length.used)
        return choice.unit

    def _unit_stated(self, header: str, quantity: str) -> tuple[Unit | None, str]:
        """Return the unit that lines beside the table state for a column, and the words for it."""
        unit = stated_unit(self.table.lines, list(self.table.columns), header, quantity
                           ) if header else None
        return unit, f'{unit.text} is stated beside the table' if unit else ''

    def _ambient(self, key: str, values: dict[str, np.ndarray]) -> float:
        choice, gauge = self.choices.chosen[key], self.recipe.gauge
        absolute = choice.absolute if gauge is None else not gauge
        choice.absolute = bool(absolute)
        if absolute is None and (why := self._may_be_absolute(values[key], values['force'])):
            self.notes.append(f"{why}: '{choice.header}' is taken as gauge; is it absolute "
                              '(--absolute)?')
        if absolute and choice.header:
            self.notes += self._barometers(choice.header)
        return self.recipe.ambient_pressure if absolute else 0.0

    def _barometers(self, absolute: str) -> list[str]:
        """Return a note on each column that reads the atmosphere around an absolute pressure."""
        return [f"{self.recipe.ambient_pressure / 1e3:.4g} kPa are taken off '{absolute}'; to "
                f"take off the atmosphere of '{header}', tell --columns "
                f'"pressure={absolute} - {header}"'
                for header in self.table.columns if _AROUND & set(words_of(header))
                and self.table.unit_text(header) == self.table.unit_text(absolute) is not None
                and header not in absolute]

    def _may_be_absolute(self, pressure: np.ndarray, force: np.ndarray) -> str:
        """Return why a pressure may be absolute (a remark, no force at 1 atm), else ''."""
        for line in self.table.lines:
            if absolute_of(line) and re.search('(?i)press|druck', line):
                return f"in the file stands '{line.strip()[:60]}'"
        rows = np.isfinite(pressure) & np.isfinite(force)
        lowest = pressure[rows].min(initial=np.inf)
        if not _ATMOSPHERE[0] < lowest < _ATMOSPHERE[1]:
            return ''
        # a vented muscle may push, but does not pull
        pull = force[rows] * np.sign(force[rows][np.argmax(np.abs(force[rows]))])
        low = pull[pressure[rows] < lowest + _VENTED]
        return (f'hardly a force at the lowest pressure, {lowest / 1e3:.4g} kPa'
                if low.max() < 0.1 * pull.max() else
                f'the lowest pressure under a weight is {lowest / 1e3:.4g} kPa'
                if np.ptp(np.abs(force[rows])) < 0.2 * pull.max() else '')


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
        return reader.choices.taken(), str(error), None
    return measured.taken, '', measured
