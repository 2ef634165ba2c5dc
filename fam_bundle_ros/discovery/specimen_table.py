# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Read a table of specimens: a recording of each, its dimensions and other known numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
import csv
from dataclasses import dataclass, field, replace
from io import StringIO
import os
from pathlib import Path
import re
from typing import Any

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.data.recipe import Recipe
from fam_bundle_ros.discovery.reading import recipe_for
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.units import si_factor

#: Dimensions of the braid that a table may have, with a unit that is convertible to this one.
DIMENSIONS = {'length': 'm', 'radius': 'm', 'diameter': 'm', 'braid_angle': 'deg',
              'wall_thickness': 'm'}
#: Other names of these dimensions.
_ALIASES = {'rest_length': 'length', 'initial_length': 'length', 'l0': 'length',
            'outer_radius': 'radius', 'r0': 'radius', 'outer_diameter': 'diameter',
            'od': 'diameter', 'angle': 'braid_angle', 'wall': 'wall_thickness',
            'thickness': 'wall_thickness'}
_HEADER = re.compile(r'^\s*(?P<name>[^\[\]]+?)\s*(\[(?P<unit>[^\]]*)\])?\s*$')


@dataclass(frozen=True)
class Specimen:
    """
    One muscle and its recording.

    Attributes
    ----------
    name : str
    data : path or Measurement
    dimensions : dict of str to float
        ``length``, ``radius``, ``braid_angle``, ``wall_thickness``, as far as known, SI.
    facts : dict of str to float
        All numbers of the table, by header: dimensions, age, supplier's code, ...
    remarks : dict of str to str
        All text of the table, by header: the supplier, a name of the muscle, ...
    units : dict of str to str
        Units by header.
    """

    name: str
    data: Any
    dimensions: Mapping[str, float] = field(default_factory=dict)
    facts: Mapping[str, float] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def model(self, nominal: Bundle) -> Bundle:
        """Return a model with the dimensions of this specimen."""
        return nominal.with_parameters({f'geometry.{name}': value
                                        for name, value in self.dimensions.items()})

    def measurement(self, nominal: Bundle) -> Measurement:
        """Return the recording; lengths in it are converted with this specimen's rest length."""
        if isinstance(self.data, Measurement):
            return self.data
        return read_measurement(self.data, recipe=recipe_for(nominal, Recipe(
            rest_length=self.dimensions.get('length'))))


def dimension_of(column: str) -> str:
    """Return the dimension in a column, in any case and by any usual name; empty for none."""
    name = re.sub(r'[\s_-]+', '_', column.lower())
    name = _ALIASES.get(name, name)
    return name if name in DIMENSIONS else ''


def unused_columns(specimens: Iterable[Specimen]) -> list[str]:
    """Return a note for each column with a unit of length or angle that is no dimension."""
    units = {name: unit for specimen in specimens for name, unit in specimen.units.items()}
    return [f"column '{name} [{unit}]' is not one of the dimensions {', '.join(DIMENSIONS)}: "
            'it is only compared with the constants' for name, unit in units.items()
            if not dimension_of(name) and (_is_like(unit, 'm') or _is_like(unit, 'deg'))]


def incomplete_columns(specimens: Sequence[Specimen]) -> list[str]:
    """Return a note for each column of numbers that is blank for some specimens."""
    columns = dict.fromkeys(fact for specimen in specimens for fact in specimen.facts)
    without = {column: [each.name for each in specimens if column not in each.facts]
               for column in columns}
    return [f"column '{column}' has no number for {', '.join(names)}: constants are compared "
            'with it in the others' for column, names in without.items() if names]


def _is_like(unit: str, like: str) -> bool:
    try:
        return bool(si_factor(unit, like))
    except InputError:
        return False


def read_specimens(path: str | Path) -> list[Specimen]:
    """
    Read a table of specimens.

    Parameters
    ----------
    path : str or Path
        CSV with a column ``file`` (relative to the table) and any of ``length [mm]``,
        ``radius [mm]`` or ``diameter [mm]``, ``braid_angle [deg]``, ``wall_thickness [mm]``, in
        any unit, and further numbers (``age [days]``). Columns are separated by commas, or by
        semicolons or tabs; with these, numbers may have a decimal comma.

    Raises
    ------
    InputError
        Without the column ``file``, or for a dimension that has no unit or is no positive number.
    """
    path = Path(path)
    try:
        with open(path, newline='', encoding='utf-8-sig') as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: {error}') from error
    separator = max(',;\t', key=text.partition('\n')[0].count)
    rows = [row for row in csv.reader(StringIO(text, newline=''), delimiter=separator)
            if any(cell.strip() for cell in row)]
    point = '.' if separator == ',' else ','
    found = [_HEADER.match(cell) for cell in rows[0]] if rows else []
    headers = [(match['name'], match['unit']) if match else ('', None) for match in found]
    names = [name.lower() for name, _ in headers]
    if 'file' not in names:
        raise InputError(f"{path}: columns {', '.join(names) or 'none'}; expected one called "
                         "'file', and dimensions such as 'length [mm]'")
    specimens = [_specimen(path, number, headers, row, point)
                 for number, row in enumerate(rows[1:], start=2)]
    files = Counter(specimen.data.resolve() for specimen in specimens)
    for specimen in specimens:
        if files[specimen.data.resolve()] > 1:
            raise InputError(f"{path}: {specimen.data} is in column 'file' twice; expected one "
                             'row for each recording')
    return [replace(specimen, name=name) for specimen, name in zip(
        specimens, _names([specimen.data for specimen in specimens]))]


def _names(files: Sequence[Path]) -> list[str]:
    """Return the stem of each file; with its folder, and its suffix, if another has the same."""
    root = os.path.commonpath([file.parent.resolve() for file in files]) if files else ''
    whole = [Path(os.path.relpath(file.resolve(), root)) for file in files]
    found = [file.stem for file in files]
    for longer in ([file.with_suffix('') for file in whole], whole):
        times = Counter(found)
        found = [name if times[name] == 1 else '_'.join(file.parts)
                 for name, file in zip(found, longer)]
    return found


def _specimen(path: Path, number: int, headers: list[tuple[str, str | None]], row: list[str],
              point: str) -> Specimen:
    dimensions, facts, remarks, units, file = {}, {}, {}, {}, ''
    for (name, unit), cell in zip(headers, row):
        where = f"{path}, row {number}, column '{name}'"
        dimension = dimension_of(name)
        if name.lower() == 'file':
            file = cell.strip()
        elif cell.strip() and name:
            if unit:
                units[name] = unit
            try:
                value = float(cell.replace(point, '.'))
            except ValueError:
                if dimension:
                    raise InputError(f"{where}: '{cell}'; expected a number") from None
                remarks[name] = cell.strip()
                continue
            facts[name] = value
            if dimension:
                if not unit:
                    raise InputError(
                        f"{where} has no unit; expected for example "
                        f"'{name} [{'deg' if dimension == 'braid_angle' else 'mm'}]'")
                if not value > 0.0:
                    raise InputError(f'{where}: {cell}; expected a number above 0')
                value *= si_factor(unit, DIMENSIONS[dimension])
                if dimension == 'diameter':
                    dimension, value = 'radius', value / 2
                dimensions[dimension] = value
    if not file:
        raise InputError(f'{path}, row {number}: no file; expected the name of a recording')
    return Specimen(Path(file).stem, path.parent / file, dimensions, facts, remarks, units)
