# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which column of a table is which quantity: as the user tells, else by its name and unit.

Where several columns may be one quantity, or none, the error lists what every column was taken
for, or why it is not used.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
import re

import numpy as np

from fam_bundle_ros.data.cells import cell_text, is_text, looks_like_time, numbers
from fam_bundle_ros.data.clocks import holds_times, same_name
from fam_bundle_ros.data.column_names import (
    absolute_of,
    dimension_of,
    is_longer,
    Match,
    recognise,
    STRAINS,
)
from fam_bundle_ros.data.formats.table import is_unnamed, Table, without_count
from fam_bundle_ros.data.measurement import Taken
from fam_bundle_ros.data.missing_column import family, missing_column, mostly_text, shown
from fam_bundle_ros.data.told_columns import Choice, told_column
from fam_bundle_ros.data.unit_names import ELECTRIC, Unit
from fam_bundle_ros.errors import InputError

#: A name that stands among other words is taken only with a unit that fits.
_ENOUGH = 2
#: Told in place of a column: the file has no column for this quantity.
NONE = 'none'
#: Names of a date, which is the clock where it tells the time of day too.
_DATE = re.compile('date|datum', re.IGNORECASE)
#: What a recorder writes before the row of names, above the times: 'TAG', 'CH'.
_KEY = re.compile('tag|tag name|ch|channel|name|signal|kanal', re.IGNORECASE)
#: Names of counters that go on while the clock runs on.
_CYCLE = re.compile('cycle|zyklus', re.IGNORECASE)
#: Fewest rows per trial, on average: a column with more values counts rows.
_ROWS_PER_TRIAL = 2
#: A strain in a smaller unit, \u00b5\u03b5, is of a strain gauge.
_MICRO = 1e-5
#: Rounding of readings that are logged in two units, as a share of the largest.
_ROUNDED = 2e-3


@dataclass
class Choices:
    """Which columns of a table are used, by quantity, and why the others are not."""

    table: Table
    chosen: dict[str, Choice] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    without: set[str] = field(default_factory=set)

    def make(self, told: Mapping[str, str]) -> None:
        """Choose the columns, first those that the user names."""
        self.without = {family(key) for key, text in told.items() if text.strip() == NONE}
        for key, text in told.items():
            if text.strip() != NONE:
                choice = told_column(self.table, key, text.strip())
                twice = [other for other, made in self.chosen.items()
                         if made.header is not None and made.header == choice.header]
                if twice:
                    raise InputError(f"{self.table.name}: column '{choice.header}' is told for "
                                     f'{twice[0]} and for {key}; expected it for one')
                self.chosen[key] = choice
        self._recognised()
        self._by_unit()

    @property
    def strains(self) -> list[str]:
        """Quantities that tell the strain, the plainest first."""
        return [key for key in STRAINS if key in self.chosen]

    @property
    def pressures(self) -> list[str]:
        """Pressures: those of mu1, mu2, ... by their number, others in the order of the file."""
        keys = [key for key in self.chosen if key.partition('.')[0] == 'pressure']
        numbers = [re.fullmatch(r'pressure(?:\.mu(\d+))?', key) for key in keys]
        if all(numbers):
            return sorted(keys, key=lambda key: int(key.partition('.mu')[2] or 1))
        headers = list(self.table.columns)
        return sorted(keys, key=lambda key: headers.index(self.chosen[key].header or headers[-1]))

    def complete(self) -> None:
        """Raise InputError where strain, pressure or force is missing."""
        for key, there in (('strain', self.strains), ('force', 'force' in self.chosen),
                           ('pressure', self.pressures)):
            if not there:
                parts = [missing_column(self.table, key, self.taken()), *(
                    note for note in self.table.notes if note.startswith('not read: '))]
                if len(parts) > 1:
                    parts.append('expected all in one table, or each as a file')
                raise InputError('; '.join(parts))

    def _recognised(self) -> None:
        used = {choice.header for choice in self.chosen.values()}
        families = {family(key) for key in self.chosen} | self.without
        found: dict[str, list[tuple[str, Match]]] = {}
        for header, column in self.table.columns.items():
            if header in used:
                continue
            first = without_count(header)
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
        first = next(iter(self.table.columns))
        for header in list(self.refused):
            if 'time' in self.chosen or 'time' in self.without:
                break
            column, unnamed = self.table.columns[header], is_unnamed(header)
            if looks_like_time(column) and column[0] != column[-1] and (
                    unnamed or recognise(header).quantity == 'time'  # Time [hh:mm:ss]
                    or (_DATE.fullmatch(header) and ':' in cell_text(column[0])
                        or header == first and _KEY.fullmatch(header)) and holds_times(column)):
                self.chosen['time'] = Choice(header, why='dates without a name' if unnamed else '')
                del self.refused[header]

    def _by_unit(self) -> None:
        """Take a column of an unknown name for what is missing, if it alone has such a unit."""
        families = {family(key) for key in self.chosen} | self.without
        for like, kind in (('N', 'force'), ('Pa', 'pressure'), ('m', 'strain'), ('s', 'time')):
            if kind in families:
                continue
            found = []
            for header in self.table.columns:
                why, column = self.refused.get(header, ''), self.table.columns[header]
                unit = dimension_of(header, self.table.units.get(header, ''))
                if unit is not None and unit.like == like and column.dtype.kind in 'fO' and (
                        why == 'not known' or why.startswith('may be ')):
                    values = numbers(column)[0]
                    found.append((header, unit, values[np.isfinite(values)]))
            relative = [entry for entry in found if absolute_of(entry[0]) is False]
            if kind == 'pressure' and len(relative) == 1:
                found = relative  # beside the absolute one
            if len(found) != 1:
                continue
            (header, unit, values), = found
            if kind == 'time' and ((np.diff(values) < 0).mean() > 0.02 or not np.ptp(values)):
                continue
            # a displacement comes near zero, a length never does: no muscle shortens by half
            key = kind if kind != 'strain' else 'length' if (
                values.min() > 0.5 * values.max()) else 'shift'
            absolute = absolute_of(header) if unit.absolute is None else unit.absolute
            gauge = ', as gauge' if kind == 'pressure' and absolute is None else ''
            self.chosen[key] = Choice(header, unit, absolute=absolute,
                                      why=f'by its unit alone{gauge}')
            del self.refused[header]

    def _why_not(self, header: str, column: np.ndarray, match: Match, families: set[str]) -> str:
        if not match.quantity and match.why == 'not known':
            unit = (self.table.unit_text(header) or '').strip()
            return 'text' if mostly_text(column) else match.why if unit not in ELECTRIC else (
                f'in {unit}: tell what one {unit} is worth')
        if not match.quantity or not match.score:
            return match.why
        if match.score < _ENOUGH:
            return f'may be {match.quantity}, but not all its words or its unit are known'
        if family(match.quantity) in families:
            return f'{family(match.quantity)} was told'
        if match.quantity == 'strain' and match.unit and match.unit.factor < _MICRO:
            return 'of a strain gauge'
        if match.quantity == 'trial':
            if _CYCLE.search(header) and any(recognise(other).quantity == 'time'
                                             for other in self.table.columns):
                return 'cycles, of one trial where the clock runs on'
            count = len({cell for cell in column.tolist() if cell == cell})
            return (f'{count} different values in {len(column)} rows: no trials'
                    if count * _ROWS_PER_TRIAL > len(column) else '')
        if match.quantity != 'time' and is_text(column):
            values, words = numbers(column)
            if not np.isfinite(values).any():
                return 'text' if words.any() else 'blank'
        elif column.dtype.kind == 'f' and np.isnan(column).all():
            return 'blank'
        return ''

    def _one_of_each(self, found: dict[str, list[tuple[str, Match]]]) -> None:
        """Choose one column of those found for each quantity; of several strains the plainest."""
        self._name_pressures(found)
        strains = [key for key in STRAINS if key in found]
        for key in strains[1:]:
            self._refuse(found.pop(key), f'{strains[0]} is there')
        for key, entries in found.items():
            header, match = self._best(key, entries)
            absolute = match.unit.absolute if match.unit else match.absolute
            longer = key == 'elongation' or 'strain' in header.casefold() and is_longer(header)
            self.chosen[key] = Choice(header, match.unit, -1 if longer else 1, absolute=absolute)

    def _name_pressures(self, found: dict[str, list[tuple[str, Match]]]) -> None:
        """Take a single numbered pressure for the pressure; refuse one beside several numbers."""
        pressures = [key for key in found if key.partition('.')[0] == 'pressure']
        if len(pressures) == 1 and not pressures[0].endswith('pressure'):
            header = found[pressures[0]][0][0]
            if not re.search(r'\bpressure\.', header):  # `p2` alone is the pressure
                found['pressure'] = found.pop(pressures[0])
        elif len(pressures) > 1 and 'pressure' in pressures:
            entries = found.pop('pressure')
            pressures.remove('pressure')
            if max(match.score for _, match in entries) >= max(
                    match.score for key in pressures for _, match in found[key]):
                first = found[pressures[0]][0][0]
                raise InputError(f"{self.table.name}: '{entries[0][0]}' beside '{first}'; "
                                 'expected one name per motor unit')
            self._refuse(entries, 'other columns name the motor units')

    def _best(self, key: str, entries: list[tuple[str, Match]]) -> tuple[str, Match]:
        """Return the only column of the highest score; the others are refused."""
        highest = max(match.score for _, match in entries)
        best = self._different(key, [entry for entry in entries if entry[1].score == highest])
        if len(best) > 1:  # a load cell of three axes of which one is used
            still = [entry for entry in best
                     if not np.nan_to_num(numbers(self.table.columns[entry[0]])[0]).any()]
            if len(best) == len(still) + 1:
                self._refuse(still, 'zero in all rows')
                best = [entry for entry in best if entry not in still]
        if len(best) > 1:
            self._refuse(best, f'may be {shown(key)}, as another may')
            names = ' and '.join(f"'{header}'" for header, _ in best[:3])
            of_units = ' '.join(f'--columns "pressure.mu{k + 1}={header}"'
                                for k, (header, _) in enumerate(best))
            raise InputError(
                f'{self.table.name}: {names} both may be {shown(key)}; expected one, or to be '
                f'told, for example --columns "{shown(key)}={best[0][0]}"'
                + f', or one for each motor unit, {of_units}' * (key == 'pressure')
                + f', or their sum, "force={" + ".join(header for header, _ in best)}"'
                # axes, or a raw and a filtered one, do not add up
                * (key == 'force' and all(match.part for _, match in best)))
        self._refuse([entry for entry in entries
                      if entry is not best[0] and entry[0] not in self.refused],
                     f"less like {shown(key)} than '{best[0][0]}'")
        return best[0]

    def _different(self, key: str, entries: list[tuple[str, Match]]) -> list[tuple[str, Match]]:
        """Return the columns without repetitions of another, such as a clock for each channel."""
        kept: list[tuple[str, Match]] = []
        for entry in entries:
            header, match = entry
            cells = self.table.columns[header]
            # two load cells may show equal forces, which add up
            same = next((other for other, known in kept
                         if (key != 'force' or known.part == match.part)
                         and _same(self.table.columns[other], cells, known.unit, match.unit)
                         ), None)
            first = next((other for other, _ in kept if same_name(other, header)), None)
            if same is None and key == 'time' and first is not None:
                self.refused[header] = f"called as '{first}'"
            elif same is None:
                kept.append(entry)
            else:
                self.refused[header] = f"the same as '{same}'"
        return kept

    def _refuse(self, entries: list[tuple[str, Match]], why: str) -> None:
        self.refused.update({header: why for header, _ in entries})

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
            entries.append(Taken(header, shown(key), choice.unit.text if choice.unit else '',
                                 choice.sign, why))
        return tuple(entries)


def _same(one: np.ndarray, other: np.ndarray, unit: Unit | None, another: Unit | None) -> bool:
    """Return whether two columns hold the same cells, or the same readings in two units."""
    if unit is not None and another is not None and unit.factor != another.factor and (
            one.dtype.kind == other.dtype.kind == 'f' and unit[2:] == another[2:]):
        size = _ROUNDED * np.nanmax(np.abs(one), initial=0.0) * unit.factor
        return bool(np.allclose(one * unit.factor, other * another.factor, 0.0, size, True))
    if unit != another or one.dtype.kind != other.dtype.kind:
        return False
    return (np.array_equal(one, other, equal_nan=True) if one.dtype.kind == 'f' else
            one.tolist() == other.tolist())
