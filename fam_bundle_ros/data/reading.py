# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""From a file of any format, a ROS 2 bag, a pandas frame or arrays to a `Measurement`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fam_bundle_ros.data.bagfile import bag_table, read_bag
from fam_bundle_ros.data.columns import described, read_columns
from fam_bundle_ros.data.formats import is_bag, read_table, Table
from fam_bundle_ros.data.formats.arrays import of_arrays, of_frame
from fam_bundle_ros.data.formats.long import wide
from fam_bundle_ros.data.formats.quality import without_bad
from fam_bundle_ros.data.formats.stacking import one_way_below_the_other, parts_of_one, unstacked
from fam_bundle_ros.data.formats.stamps import oldest_first, with_stamps
from fam_bundle_ros.data.formats.table import names_column
from fam_bundle_ros.data.formats.titles import filled_down, titled, with_legend
from fam_bundle_ros.data.formats.unit_columns import with_unit_columns
from fam_bundle_ros.data.measurement import file_digest, Measurement, Taken
from fam_bundle_ros.data.recipe import load_recipe, Recipe
from fam_bundle_ros.resources import data_path

#: Rows that `preview` shows.
PREVIEW_ROWS = 20


def read_measurement(source: Any, *, columns: Mapping[str, str] | None = None,
                     rest_length: float | str | None = None, gauge: bool | None = None,
                     ambient_pressure: float | None = None,
                     max_pressure: float | str | None = None, max_strain: float | None = None,
                     sheet: str | None = None, drop_bad: bool | None = None,
                     recipe: Recipe | str | Path | None = None,
                     name: str | None = None) -> Measurement:
    r"""
    Read a measurement from a file, a ROS 2 bag, a pandas frame or a dict of arrays.

    Text tables of any separator, Excel, LabVIEW (.lvm, .tdms), MATLAB (.mat), parquet, feather,
    .npz, JSON. Columns are recognised by their names, in English or German, and their units;
    ``taken`` of the result says what each was taken for.

    Parameters
    ----------
    source : path, pandas.DataFrame, mapping of str to array, or Table
        A path may be the name of data that ships: ``'dmsp20_static_map'``.
    columns : mapping of str to str, optional
        Quantity (time, trial, strain, contraction, elongation, length, pressure,
        pressure.<motor unit>, force, strain_rate) to column: the header, its name with a unit,
        ``'-F [N]'`` to turn the sign, its number, any of these with a calibration
        (``'AI1 * 50 N - 2 N'``), a constant (``'300 kPa'``, ``'100 Hz'``), or ``'none'`` where no
        column is to be taken for it.
    rest_length : float (m) or str ('250 mm'), optional
        Needed where the data give a length instead of a strain.
    gauge : bool, optional
        Whether pressures are gauge or absolute; by default as headers say (``psia``, ``abs``),
        gauge where they do not, and absolute in bags.
    ambient_pressure : float, Pa, optional
        Taken off absolute pressures; by default 101.325 kPa.
    max_pressure : float (Pa) or str, optional
        Highest gauge pressure of this muscle, where it is above 1 MPa.
    max_strain : float, optional
        Highest strain of this muscle, where it is above 0.5.
    sheet : str, optional
        Sheet of a workbook, group of a .tdms file, variable of a .mat file.
    drop_bad : bool, optional
        Leave rows out, and count them, that hold a word where a number is expected, or more cells
        than columns.
    recipe : Recipe or path, optional
        All of these together; what is given beside it counts more.
    name : str, optional
        Name for messages and reports; by default the file's.

    Raises
    ------
    InputError
        One sentence that names the file, the row and what was expected.

    Examples
    --------
    >>> import numpy as np
    >>> rows = 20
    >>> data = read_measurement({'L [mm]': 250.0 - np.arange(rows), 'p (bar)': np.arange(rows) % 3,
    ...                          'Kraft [N]': np.arange(rows)}, rest_length='250 mm')
    >>> len(data), float(data.pressure.max()), round(float(data.strain[10]), 3)
    (20, 200000.0, 0.04)
    """
    used = _recipe(recipe, columns=columns, rest_length=rest_length, gauge=gauge,
                   ambient_pressure=ambient_pressure, max_pressure=max_pressure,
                   max_strain=max_strain, sheet=sheet, drop_bad=drop_bad)
    path = _path(source)
    if path is not None and is_bag(path) and not used.columns:
        measured = read_bag(path, used, name)
        if measured is not None:
            return measured
    measured = read_columns(_table(source, path, used, name), used)
    return measured if path is None else replace(measured, sha256=file_digest(path))


def read_recordings(sources: Sequence[str | Path], *, recipe: Recipe | str | Path | None = None,
                    ) -> list[Measurement]:
    """
    Return the measurements of several files; one where each file has a part of one recording.

    Such are a file for each topic or logger, with a clock each and no quantity in two of them. A
    header that stands in two, or none, is told with the name of its file: 'force column 4'.

    Parameters
    ----------
    sources : sequence of path
    recipe : Recipe or path, optional

    Raises
    ------
    InputError
        As `read_measurement`.
    """
    used = _recipe(recipe)
    paths = [data_path(source) for source in sources]
    if len(paths) > 1 and not any(map(is_bag, paths)):
        tables = [_table(path, path, used, None) for path in paths]
        if (whole := parts_of_one(tables)) is not None:
            return [read_columns(whole, used)]
        return [replace(read_columns(table, used), sha256=file_digest(path))
                for table, path in zip(tables, paths)]
    return [read_measurement(path, recipe=used) for path in paths]


@dataclass(frozen=True)
class Preview:
    """
    What a file looks like and what it was taken for, before anything is computed with it.

    Attributes
    ----------
    name, kind : str
        The file's name, and what it is ('text separated by tabs', 'sheet Run 1', ...).
    taken : tuple of Taken
        What each column was taken for, and why not.
    cells : dict of str to list of str
        The first rows of each column.
    rows : int
    problem : str
        The error that `read_measurement` would raise; empty where the file is taken.
    measurement : Measurement or None
    """

    name: str
    kind: str
    taken: tuple[Taken, ...]
    cells: Mapping[str, list[str]]
    rows: int
    problem: str
    measurement: Measurement | None


def preview(source: Any, *, recipe: Recipe | str | Path | None = None, name: str | None = None,
            **options: Any) -> Preview:
    """
    Return the first rows of a file, what each column was taken for, and what is wrong.

    Parameters
    ----------
    source, recipe, name, options
        As for `read_measurement`.

    Raises
    ------
    InputError
        Only where the file is no table at all.
    """
    used = _recipe(recipe, **options)
    table = _table(source, _path(source), used, name)
    taken, problem, measured = described(table, used)
    cells = {header: [_cell(value) for value in column[:PREVIEW_ROWS]]
             for header, column in table.columns.items()}
    return Preview(table.name, table.kind, taken, cells, len(table.rows), problem, measured)


def taken_words(measurement: Measurement) -> str:
    """
    Return in one line what the columns of a file were taken for; empty where it is as written.

    As written are columns that are called by their quantity and carry their unit.
    """
    used, unused, plain = [], [], True
    for taken in measurement.taken:
        if not taken.quantity:
            unused.append(f"'{taken.header}' ({taken.why})")
            continue
        said = f' ({taken.why})' if taken.why else ''
        turned = ', sign turned round' if taken.turned else ''
        used.append(f"{taken.quantity} '{taken.header}'{said}{turned}")
        first = taken.header.partition('[')[0].strip()
        plain &= not said and first.casefold() == taken.quantity.casefold()
    if plain and not unused:
        return ''
    rest = measurement.rest_length
    used += [f'rest length {1e3 * rest:.4g} mm'] if rest else []
    return ', '.join(used) + (f'; not used: {", ".join(unused)}' if unused else '')


def _recipe(recipe: Recipe | str | Path | None, **options: Any) -> Recipe:
    if not isinstance(recipe, Recipe):
        recipe = Recipe() if recipe is None else load_recipe(recipe)
    return recipe.merged(**options)


def _path(source: Any) -> Path | None:
    if isinstance(source, (Mapping, Table)) or hasattr(source, 'columns'):
        return None
    return data_path(source)


def _table(source: Any, path: Path | None, recipe: Recipe, name: str | None) -> Table:
    if path is not None:
        table = bag_table(path) if is_bag(path) else read_table(path, recipe.sheet,
                                                                recipe.drop_bad)
    elif isinstance(source, Table):
        table = source
    elif isinstance(source, Mapping):
        table = of_arrays(name or 'arrays', 'arrays', source)
    else:
        table = of_frame(source, name or 'frame')
    told = recipe.columns
    side_by_side = partial(unstacked, told=told)
    for change in (partial(with_legend, told=told.values()), oldest_first, with_stamps, wide,
                   without_bad, partial(with_unit_columns, told=told.values()), filled_down,
                   titled, one_way_below_the_other, side_by_side):
        changed = change(table)
        gone = [header for header in table.columns if header not in changed.columns]
        made = [header for header in changed.columns if header not in table.columns]
        # a recipe names the columns that were made
        names = {key: text for key, text in told.items()
                 if not any(names_column(text, header) for header in made)}
        asked = any(names_column(text, header) for header in gone for text in names.values())
        # a pressure that the user tells replaces that of names and titles
        twice = change in (titled, side_by_side) and 'pressure' in made and any(
            key.partition('.')[0] == 'pressure' for key in names)
        if not asked and not twice:
            table = changed
    return table if name is None else replace(table, name=name)


def _cell(value: Any) -> str:
    if value is None or value != value:
        return ''
    return f'{value:.6g}' if isinstance(value, float) else str(value)[:60]
