# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A measurement before it is opened: first rows, recognised columns, and the user's corrections.

Plain Python; the page draws it. After each change `Incoming.look` reads the whole file again, so
that the page shows the errors of the real reader.
"""

from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
import re

from fam_bundle_ros.data import Measurement, taken_words
from fam_bundle_ros.data.column_names import likes, recognise
from fam_bundle_ros.data.formats import Table
from fam_bundle_ros.data.missing_units import example_unit
from fam_bundle_ros.data.reading import Preview, preview
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.data.told_columns import name_of, told_column
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.workbench.muscle import MuscleForm

#: Quantities of a column, and their names on the page.
QUANTITY_WORDS = {
    '': 'not used', 'time': 'time', 'trial': 'trial', 'strain': 'strain (shorter is +)',
    'contraction': 'contraction (shorter is +)', 'elongation': 'elongation (longer is +)',
    'length': 'length', 'pressure': 'pressure', 'force': 'force', 'strain_rate': 'strain rate'}
#: Units to choose from, by SI unit; a unit of the file that is not here is added.
UNITS = {'N': ('N', 'kN', 'mN', 'lbf', 'kgf', 'gf'),
         'Pa': ('kPa', 'Pa', 'MPa', 'bar', 'mbar', 'psi', 'kPa abs', 'Pa abs', 'MPa abs',
                'bar abs', 'mbar abs', 'psi abs'),
         'm': ('mm', 'cm', 'm', 'in'), 's': ('s', 'ms', 'us', 'min'), '1': ('ratio', '%'),
         '1/s': ('1/s', '%/s')}


#: Hints of messages for the command line -> hints for the page.
_FIELDS = ((r' \(--rest-length, rest_length, or (?:a|its) model\)', ': the Length of your muscle'),
           (r'; if its numbers are in another unit.* what one (\S+) is worth.*',
            r'; choose its column in the table, with a unit or what one \1 is worth'),
           (r'; (?:tell it|expected it told)\b.*--columns.*', '; choose it in the table'),
           (r'; expected one, or to be told,.*', '; choose one in the table'),
           (r'; expected zero at the rest length, and the direction:.*',
            '; choose in the table what it is, contraction or elongation, and its sign'),
           (r' \(--drop-bad: so do words\)', ''),
           (r', or --max-pressure for a muscle that goes further',
            ', or a higher pressure of your muscle'),
           (r', or --max-strain for a muscle that goes further', ''))


@dataclass(frozen=True)
class Column:
    """A column as the page lists it."""

    header: str
    #: Its first rows.
    cells: tuple[str, ...]
    quantity: str
    unit: str
    #: Factor of the readings, 1 or -1.
    sign: int
    #: How it was recognised, or why it is not used.
    why: str
    #: What one count is worth, and an offset: ``* 50 N - 2 N``.
    scale: str = ''
    #: Whether ``why`` is an error in what the user said of it.
    wrong: bool = False

    @property
    def turned(self) -> bool:
        """Whether the user inverts the sign of the readings."""
        return (self.sign < 0) != (self.quantity == 'elongation')


@dataclass(frozen=True)
class Said:
    """What the user said of a column."""

    header: str
    unit: str
    turned: bool
    scale: str = ''

    def entry(self, quantity: str) -> str:
        """Return it as in a recipe: header, unit or calibration, and sign."""
        # with the worth of a count the unit of the readings is of no use
        unit = '' if quantity == 'trial' or '*' in self.scale else self.unit
        told = f" [{'1' if unit == 'ratio' else unit}]" if unit else ''
        scale = f' {self.scale}' if self.scale and quantity != 'trial' else ''
        return f'{"-" if self.turned else ""}{self.header}{told}{scale}'


@dataclass
class Incoming:
    """A measurement that is being read."""

    name: str
    origin: str
    #: None for a bag, whose topics define the quantities.
    table: Table | None = None
    #: Function of the rest length (m or None) to the measurement of a bag.
    read_bag: Callable[[float | None], Measurement] | None = None
    #: Gives the rest length, and the model to start from.
    muscle: MuscleForm = field(default_factory=MuscleForm)
    #: The user's settings: quantity to column, as in a recipe.
    told: dict[str, str] = field(default_factory=dict)
    #: Of these the columns that were set on the page.
    said_of: dict[str, Said] = field(default_factory=dict)
    sha256: str = ''
    #: Whether rows with words among the numbers are left out.
    drop_bad: bool = False
    #: Its path on this machine; empty for an upload.
    file: str = ''

    def __post_init__(self) -> None:
        if self.table is not None and self.muscle.base is None:
            pressures = sum(taken.quantity.partition('.')[0] == 'pressure'
                            for taken in self.look().taken)
            self.muscle.values['muscles'] = ', '.join(['1'] * max(pressures, 1))

    def again(self) -> 'Incoming':
        """Return a copy that can be changed independently."""
        other = copy(self)
        other.told, other.muscle = dict(self.told), deepcopy(self.muscle)
        other.said_of = dict(self.said_of)
        return other

    @property
    def recipe(self) -> Recipe:
        """How the file is read at present."""
        return Recipe(columns=dict(self.told), rest_length=self.muscle.quantity('length'),
                      max_pressure=self.muscle.quantity('max_pressure'),
                      drop_bad=self.drop_bad)

    def look(self) -> Preview:
        """Read the file with the present settings; the preview has measurement or problem."""
        if self.table is not None:
            wrong = self.wrong()
            if wrong:  # the other columns are listed as without the error
                key, why = next(iter(wrong.items()))
                usable = self.recipe.merged(columns=dict.fromkeys(wrong, 'none'))
                return replace(preview(self.table, recipe=usable), measurement=None, problem=(
                    f"{self.name}: column '{self.said_of[key].header}': {why}"))
            seen = preview(self.table, recipe=self.recipe)
            return seen if seen.measurement is None else replace(
                seen, measurement=replace(seen.measurement, sha256=self.sha256))
        assert self.read_bag is not None
        try:
            measured = self.read_bag(self.muscle.quantity('length'))
        except InputError as error:
            return Preview(self.name, 'ROS 2 bag', (), {}, 0, str(error), None)
        return Preview(self.name, 'ROS 2 bag', (), {}, len(measured), '', measured)

    def wrong(self) -> dict[str, str]:
        """Return the errors in what the user said of columns, by quantity."""
        found: dict[str, str] = {}
        for key, said in self.said_of.items():
            assert self.table is not None
            try:
                told_column(self.table, key, self.told[key])
            except InputError as error:
                text = str(error).partition(': ')[2]
                found[key] = (
                    f"'{said.scale}' is no calibration; expected one like '{self.hint(key)}'"
                    if said.scale and text.startswith('no column ') else
                    re.sub(rf"^column '-?{re.escape(said.header)}': ", '', text))
        return found

    @staticmethod
    def hint(quantity: str) -> str:
        """Return an example of a calibration: what one count is worth, and an offset."""
        unit = example_unit(quantity.partition('.')[0])
        return f'* 50 {unit} - 2 {unit}'

    @staticmethod
    def said(problem: str) -> str:
        """Return a problem with the page's fields instead of the command line's options."""
        for option, field_words in _FIELDS:
            problem = re.sub(option, field_words, problem)
        return problem

    def columns(self, seen: Preview) -> list[Column]:
        """Return the columns of a preview with their first rows."""
        wrong = {self.said_of[key].header: (key, why) for key, why in self.wrong().items()}
        found = []
        for taken in seen.taken:
            cells, said = tuple(seen.cells.get(taken.header, ())), self._said(taken.header)
            if taken.header in wrong and said is not None:
                key, why = wrong[taken.header]
                turned = said.turned != (key == 'elongation')
                found.append(Column(taken.header, cells, key, said.unit, -1 if turned else 1,
                                    why, said.scale, True))
                continue
            unit = ('ratio' if taken.unit in ('1', '-') else taken.unit) + (
                ' abs' if 'absolute' in taken.why else '')
            found.append(Column(taken.header, cells, taken.quantity, unit, taken.sign, taken.why,
                                said.scale if said else ''))
        return found

    def _said(self, header: str) -> Said | None:
        return next((said for said in self.said_of.values() if said.header == header), None)

    @cached_property
    def quantities(self) -> list[tuple[str, str]]:
        """Choices for a column: keys and names; a pressure for each motor unit."""
        headers = self.table.columns if self.table is not None else ()
        pressures = sum(recognise(header).quantity == 'pressure' for header in headers)
        units = [(f'pressure.mu{k}', f'pressure of MU{k}')
                 for k in range(1, min(max(2, pressures), 6) + 1)]
        listed = list(QUANTITY_WORDS.items())
        after = list(QUANTITY_WORDS).index('pressure') + 1
        return [*listed[:after], *units, *listed[after:]]

    @staticmethod
    def units_for(quantity: str, present: str) -> tuple[str, ...]:
        """Return the units to choose from for a quantity, with the present one."""
        base = quantity.partition('.')[0]
        if base in ('', 'trial'):
            return ()
        known = tuple(unit for like in likes(base) for unit in UNITS[like])
        return known if present in known or not present else (present, *known)

    def change(self, column: Column, among: Sequence[Column], quantity: str | None = None,
               unit: str | None = None, turned: bool | None = None, scale: str | None = None,
               ) -> None:
        """
        Set quantity, unit, sign (``turned``) and calibration of one column; None changes nothing.

        If another column of all, ``among``, had this quantity, it loses it. ``scale`` is ``* 50 N
        - 2 N`` or a part of it; ``50 N`` is the worth of one count too.
        """
        new = column.quantity if quantity is None else quantity
        if column.quantity and column.quantity != new:
            self.told[column.quantity] = 'none'
            self.said_of.pop(column.quantity, None)
        if not new:
            return
        if new.startswith('pressure'):
            # once a pressure is set, the reader ignores the others unless they are set too
            for other in among:
                if other.quantity.startswith('pressure') and other.header != column.header and (
                        other.quantity != new):
                    self.told.setdefault(other.quantity, Said(
                        other.header, other.unit, other.turned).entry(other.quantity))
        base = new.partition('.')[0]
        # the unit is kept only if it suits the new quantity
        kept = column.unit if new == column.quantity or any(
            column.unit in UNITS[like] for like in likes(base) if like in UNITS) else ''
        used = kept if unit is None else unit
        before = self._said(column.header)
        worth = (before.scale if before else '') if scale is None else _scale(column, scale)
        self.said_of = {key: said for key, said in self.said_of.items()
                        if said.header != column.header}
        self.said_of[new] = Said(column.header, used,
                                 column.turned if turned is None else turned, worth)
        self.told[new] = self.said_of[new].entry(new)
        for key in [key for key in self.told if key != new and _family(key) == _family(new)
                    and self.told[key] == 'none']:
            del self.told[key]

    def constant(self, quantity: str, value: str) -> None:
        """Set a constant for a quantity without a column; '' removes it."""
        if value.strip():
            self.told[quantity] = value.strip()
        else:
            self.told.pop(quantity, None)

    def measurement(self) -> Measurement:
        """Return the measurement for the present columns and muscle; InputError says why not."""
        seen = self.look()
        if seen.measurement is None:
            raise InputError(seen.problem)
        return seen.measurement

    @staticmethod
    def plain(seen: Preview) -> bool:
        """Return whether every column is named by quantity and unit, so that none is in doubt."""
        return seen.measurement is not None and not taken_words(seen.measurement)


def _family(key: str) -> str:
    base = key.partition('.')[0]
    return 'strain' if base in ('strain', 'contraction', 'elongation', 'shift', 'length') else key


def _scale(column: Column, typed: str) -> str:
    """Return a calibration as typed, or as pasted from an advice: 'force=U [V] * 50 N'."""
    text = re.sub(r'^[\w.]+\s*=\s*', '', typed.strip())
    for name in (column.header, name_of(column.header)):
        text = text.removeprefix(name).strip()
    return f'* {text}' if text[:1].isdigit() else text
