# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Columns without layout: parquet and feather (pyarrow), .npz and .npy (NumPy), JSON."""

from collections.abc import Mapping
from dataclasses import replace
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.column_names import recognise, STRAINS
from fam_bundle_ros.data.formats.channels import as_columns, clocks_in, filled_up, Series
from fam_bundle_ros.data.formats.table import plain_columns, reading_as, Table, unique
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

#: Longer arrays in a record (images, maps) are not read.
_ARRAY = 16


def read_arrow(path: Path, sheet: str | None = None, *, kind: str) -> Table:
    """Return the table of a 'parquet' or 'feather' file; fields may carry a unit in metadata."""
    pyarrow, reader, _ = (library(module, f'{path.name}: reading it')
                          for module in ('pyarrow', f'pyarrow.{kind}', 'pandas'))
    units = {}
    with reading_as(path, kind, OSError, ValueError, pyarrow.ArrowException):
        table = reader.read_table(path)
        for entry in table.schema:
            for key, value in (entry.metadata or {}).items():
                if key.decode(errors='replace').casefold() in ('unit', 'units'):
                    units[entry.name] = value.decode(errors='replace')
        frame = table.to_pandas()
        # where pandas keeps the attrs of a frame
        frame.attrs = json.loads((table.schema.metadata or {}).get(b'PANDAS_ATTRS', b'{}'))
    return of_frame(frame, path.name, kind, units)


def of_frame(frame: Any, name: str, kind: str = 'frame',
             units: Mapping[str, str] | None = None) -> Table:
    """Return the table of a pandas frame; an index with a name, or of times, is a column."""
    if frame.index.name or frame.index.dtype.kind in 'mM':
        frame = frame.rename_axis(frame.index.name or 'time').reset_index()
    told = frame.attrs.get('units', {})
    return Table(name, kind, plain_columns(frame), units or (
        {str(key): str(unit) for key, unit in told.items()} if isinstance(told, Mapping) else {}))


def read_npz(path: Path) -> Table:
    """Return the table of an .npz: its arrays of equal length."""
    with reading_as(path, 'an .npz without objects'), np.load(path, allow_pickle=False) as packed:
        values = {name: packed[name] for name in packed.files}
    return of_arrays(path.name, '.npz', values)


def read_npy(path: Path, sheet: str | None = None) -> Table:
    """Return the table of an .npy: fields of a structured array, or columns."""
    with reading_as(path, 'an .npy without objects'):
        values = np.load(path, allow_pickle=False)
    if values.dtype.names:
        return of_arrays(path.name, '.npy', {name: values[name] for name in values.dtype.names})
    return of_arrays(path.name, '.npy', {'column': values})


def read_json(path: Path) -> Table:
    """Return the table of a JSON file: lists by name, or a list of records."""
    pandas = library('pandas', f'{path.name}: reading it')
    expected = ValueError, TypeError, AttributeError, RecursionError
    try:
        values = json.loads(path.read_text(encoding='utf-8-sig'))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError):
        with reading_as(path, 'JSON', *expected):
            lines = path.read_text(encoding='utf-8-sig').splitlines()
            return _of_records([json.loads(line) for line in lines if line.strip()], path.name,
                               'JSON lines')
    if isinstance(values, list):
        with reading_as(path, 'JSON', *expected):
            return _of_records(values, path.name, 'JSON')
    inner = list(values.values()) if isinstance(values, dict) else []
    if inner and all(isinstance(each, dict) and len(each) > len(inner) and not any(
            isinstance(cell, (dict, list)) for cell in each.values()) for each in inner):
        return of_frame(pandas.DataFrame(values), path.name, 'JSON')  # as pandas writes by default
    return of_arrays(path.name, 'JSON', values if isinstance(values, dict) else {})


def _of_records(records: list[dict[str, Any]], name: str, kind: str) -> Table:
    """Return the table of records; those before the first sample tell settings and units."""
    pandas = library('pandas', f'{name}: reading it')
    frame = pandas.json_normalize([{
        key: dict(enumerate(value)) if isinstance(value, list) and len(value) <= _ARRAY else value
        for key, value in record.items()} for record in _samples(records)])
    filled = frame.notna().to_numpy()
    readings = (filled.sum(axis=0) > 1) & np.array(
        [kind.kind in 'iuf' for kind in frame.dtypes], bool)
    first = int(np.argmax(filled[:, readings].any(axis=1))) if readings.any() else 0
    told = {str(key): cell for _, row in frame[:first].iterrows() for key, cell in row.items()
            if cell == cell}
    table = of_frame(frame.loc[first:, filled[first:].any(axis=0) | ~filled.any(axis=0)
                               ].reset_index(drop=True), name, kind)
    return replace(table, rows=table.rows + first, above=tuple(
        f'{key} = {cell}' for key, cell in told.items()), units={
            header: str(cell) for key, cell in told.items() for header in table.columns
            if _is_unit_of(key, header)})


def _samples(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """
    Return records with one sample each; a packet of several holds lists of equal length.

    They tell force, pressure and strain, or the time of some; or one list of records does.
    What else it holds is that of all its samples. Other lists are one sample of several sensors.

    Examples
    --------
    >>> _samples([{'id': 7, 't': [0, 1], 'force': [5, 6]}])
    [{'id': 7, 't': 0, 'force': 5}, {'id': 7, 't': 1, 'force': 6}]
    """
    found: list[dict[str, Any]] = []
    for record in records:
        lists = {key: value for key, value in record.items() if isinstance(value, list) and value}
        samples = [dict(zip(lists, cells)) for cells in zip(*lists.values())]
        if len(lists) == 1 and all(isinstance(sample, dict) for sample in [*lists.values()][0]):
            samples = [*lists.values()][0]
        known = {recognise(key).quantity for key in samples[0]} if samples else set()
        told = 'time' in known or known >= {'force', 'pressure'} and known & {*STRAINS}
        if told and len(samples[0]) > 1 and len({*map(len, lists.values())}) == 1:
            whole = {key: value for key, value in record.items() if key not in lists}
            found += [{**whole, **sample} for sample in samples]
        else:
            found.append(record)
    return found


def flattened(values: Mapping[str, Any], clock: str = 'time') -> dict[str, Any]:
    """
    Return nested mappings as one: 'log.force'.

    The times of a channel stand before it, unless they are those of the one before; shorter
    channels are padded with nan.
    """
    flat = _flat(values, '', 4)
    rows = max((len(value.readings) for value in flat.values() if isinstance(value, Series)),
               default=0)
    whole: dict[str, Any] = {}
    times, count = np.zeros(0), 0
    for name, value in flat.items():
        if not isinstance(value, Series):
            whole[name] = value
            continue
        if not np.array_equal(times, value.clock):
            count, times = count + 1, value.clock
            whole[clock if count == 1 else f'{clock} ({count})'] = filled_up(times, rows)
        whole[name] = filled_up(value.readings, rows)
        if value.unit:
            whole[f'{name}_unit'] = value.unit
    return whole


def _flat(values: Mapping[str, Any], prefix: str, depth: int) -> dict[str, Any]:
    """Return nested mappings as one mapping; channels with times become `Series`."""
    flat: dict[str, Any] = {}
    pairs = _pairs(values)
    for key, value in values.items():
        name = f'{prefix}.{key}' if prefix else str(key)
        if isinstance(value, (list, np.ndarray)) and np.size(value) and np.ndim(value) and all(
                isinstance(entry, Mapping) for entry in value):
            value = _channels(list(value)) or _joined(list(value))
        channels = _channels([value]) or _readings(name, value) if isinstance(
            value, Mapping) else {}
        series = _series(value) if isinstance(value, Mapping) else pairs.get(key)
        if series is not None:
            flat[name if series.label in ('', *flat) else series.label] = series
        elif channels and not flat.keys() & channels:
            flat.update(channels)
        elif isinstance(value, Mapping) and depth:
            flat.update(_flat(value, name, depth - 1))
        else:
            flat[name] = value
    return flat


def _pairs(values: Mapping[str, Any]) -> dict[str, Series]:
    """Return matrices of two columns, time and reading, as Simulink's To Workspace writes them."""
    pairs = {}
    for key, value in values.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in 'iuf' and value.ndim == 2 and (
                min(value.shape) == 2 < max(value.shape)):
            clock, readings = (value if len(value) == 2 else value.T).astype(float)
            if (np.diff(clock) > 0).all():
                pairs[key] = Series(clock, readings)
    known = {recognise(key).quantity for key in pairs} - {'', 'time'}
    return pairs if len(known) > 1 else {}


#: Fields of a struct that holds one channel and its times, as Simulink's timeseries.
_SERIES = ('time', 't', 'times'), ('data', 'y', 'value', 'values', 'signal')


def _series(entry: Mapping[str, Any]) -> Series | None:
    """Return the channel of a struct of one and its times; else None."""
    fields = {key.casefold(): value for key, value in entry.items()}
    if isinstance(signal := fields.get('signals'), Mapping):  # a structure with time of Simulink
        fields |= signal
    clock, values = (next((fields[key] for key in keys if isinstance(
        fields.get(key), (list, np.ndarray))), ()) for keys in _SERIES)
    clock, values = np.ravel(clock), np.ravel(values)
    if not 1 < len(clock) == len(values) or {clock.dtype.kind, values.dtype.kind} - set('biuf'):
        return None
    info = fields.get('datainfo')
    inner = {key.casefold(): value for key, value in info.items()} if isinstance(
        info, Mapping) else {}
    unit = next((found for found in (fields.get('units'), fields.get('unit'), inner.get('units'))
                 if isinstance(found, str)), '')
    name = fields.get('label')
    return Series(clock.astype(float), values.astype(float), unit,
                   name if isinstance(name, str) else '')


#: Fields of a struct that holds one channel, as dSPACE and Simulink write them: name, unit.
_CHANNEL = ('name', 'label', 'title'), ('unit', 'units')


def _channels(entries: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Return vectors by name from structs that hold a name and a vector, {} for others."""
    found: dict[str, Any] = {}
    for entry in entries:
        texts = {key.casefold(): value for key, value in entry.items() if isinstance(value, str)}
        name, unit = (next((texts[key] for key in keys if texts.get(key)), '')
                      for keys in _CHANNEL)
        vectors = [value for value in entry.values()
                   if isinstance(value, (list, np.ndarray)) and np.size(value) > 1]
        if not name or name in found or len(vectors) != 1:
            return {}
        found[name] = vectors[0]
        if unit:
            found[f'{name}_unit'] = unit
    return found


def _readings(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return the vector of a struct that holds nothing else but texts, and its unit; else {}."""
    fields = {key.casefold(): value for key, value in entry.items()}
    vectors = [key for key, value in fields.items()
               if not isinstance(value, str) and np.size(value)]
    if len(vectors) != 1 or vectors[0] not in _SERIES[1] or np.size(fields[vectors[0]]) < 2:
        return {}
    unit = next((text for key in _CHANNEL[1] if isinstance(text := fields.get(key), str)), '')
    return {name: fields[vectors[0]], **({f'{name}_unit': unit} if unit else {})}


def _runs(values: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return several structs of the same quantities: run1.p, run1.F, run2.p, run2.F; else []."""
    runs = [run for run in values.values() if isinstance(run, Mapping)]
    fields = {tuple(run) for run in runs}
    known = {recognise(field).quantity for field in next(iter(fields), ())} - {'', 'time'}
    others = any(np.size(value) > 1 for value in values.values() if not isinstance(value, Mapping))
    return runs if len(runs) > 1 == len(fields) < len(known) and not others else []


def _units_behind(fields: list[str]) -> list[str]:
    """
    Return fields with that of a unit behind that of its readings.

    Examples
    --------
    >>> _units_behind(['F', 'p', 'F_unit', 'p_unit'])
    ['F', 'F_unit', 'p', 'p_unit']
    """
    names = {field: next((name for name in fields if name != field and _is_unit_of(field, name)),
                         field) for field in fields}
    return sorted(fields, key=lambda field: (fields.index(names[field]), field != names[field]))


def _joined(entries: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Return an array of structs as one: samples one by one, or the vectors of several trials."""
    lengths = [max((len(np.ravel(value)) for value in entry.values()
                    if isinstance(value, (list, np.ndarray))), default=1) for entry in entries]
    if max(lengths) < 2:
        return {field: [entry.get(field) for entry in entries] for field in entries[0]}
    whole: dict[str, Any] = {}
    for field in _units_behind(list(entries[0])):
        texts = {entry.get(field) for entry in entries if isinstance(entry.get(field), str)}
        if len(texts) == 1 and all(isinstance(entry.get(field), str) for entry in entries):
            whole[field] = texts.pop()
            continue
        parts = [np.ravel(entry.get(field, ())) for entry in entries]
        parts = [np.repeat(part, length) if len(part) == 1 else part
                 for part, length in zip(parts, lengths)]
        if all(len(part) == length for part, length in zip(parts, lengths)):
            whole[field] = np.concatenate(parts)
    return {**whole, 'trial': np.repeat(np.arange(1.0, len(entries) + 1.0), lengths)}


def of_arrays(name: str, kind: str, values: Mapping[str, Any]) -> Table:
    """
    Return the table of arrays by name: those of the most common length.

    Nested mappings are flattened; a matrix gives a column each (named by a list of as many
    texts, if there is one); texts named ``units.<name>`` or ``<name>_unit`` are units, as is
    a list ``units`` with one for each.
    """
    found = _by_shape(flattened(_joined(runs) if (runs := _runs(values)) else values))
    vectors, matrices = found.vectors, found.matrices
    trials = _side_by_side(vectors, matrices)
    vectors = trials or vectors
    for key, columns in matrices.items():
        count = columns.shape[1]
        heads = next((names for names in found.labels if len(names) == count),
                     [f'{key} {i + 1}' for i in range(count)])
        vectors.update(dict(zip(heads, columns.T)))
    read = [key for key, vector in vectors.items() if vector.dtype.kind in 'fmM']
    listed = dict(next((zip(read, texts) for texts in found.units if len(texts) == len(read)), ()))
    series = {key: vector for key, vector in vectors.items()
              if vector.dtype.kind == 'f' and len(vector) > 1}
    if not series:
        raise InputError(f'{name}: no columns of numbers in it; expected arrays of equal length '
                         'for strain (or length), pressure and force')
    lengths = [len(vector) for vector in series.values()]
    rows = max(lengths, key=lambda length: (lengths.count(length), length))
    kept = as_columns(series)
    if not clocks_in(Table(name, kind, kept)):
        kept = {key: vector for key, vector in vectors.items() if len(vector) == rows}
    heads = unique(_short_names(list(kept)))
    units = {head: listed[key] for key, head in zip(kept, heads) if listed.get(key)}
    units |= {head: text for key, head in zip(kept, heads) for label, text in found.texts.items()
              if _is_unit_of(label, key.rpartition('.')[2])}
    other = [key for key in vectors if key not in kept and vectors[key].dtype.kind == 'f']
    notes = [f'of another length, not used: {", ".join(other)}'] if other else []
    notes += ['columns of matrices are trials: read one below the other'] if trials else []
    above = tuple(f'{key.rpartition(".")[2]} = {text}' for key, text in found.texts.items())
    return Table(name, kind, dict(zip(heads, kept.values())), units, notes=tuple(notes),
                 above=above)


class _Found(NamedTuple):
    """Vectors and matrices (floats; vectors may be text), texts, lists of names and of units."""

    vectors: dict[str, np.ndarray]
    matrices: dict[str, np.ndarray]
    texts: dict[str, str]
    labels: list[list[str]]
    units: list[list[str]]


def _by_shape(flat: Mapping[str, Any]) -> _Found:
    """Return values sorted by what they are; a matrix has more rows than columns."""
    found = _Found({}, {}, {}, [], [])
    for key, value in flat.items():
        try:
            array = np.squeeze(np.asarray(value))
        except ValueError:
            continue
        kind = array.dtype.kind
        if isinstance(value, str):
            found.texts[key] = value
        elif array.ndim == 0 or not array.size:
            if kind in 'USif' and array.size:
                found.texts[key] = str(array[()])
        elif array.ndim == 1 and kind in 'biufUSOmM':
            # scipy gives a blank text as an empty array
            texts = [cell if np.size(cell) else '' for cell in array.tolist()] if (
                kind in 'USO' and len(array) < 60) else []
            if texts and all(isinstance(text, str) for text in texts):
                if key.rpartition('.')[2].casefold() in _CHANNEL[1]:
                    found.units.append(texts)
                    continue
                found.labels.append(texts)
            found.vectors[key] = array if kind in 'mM' else array.astype(
                float if kind in 'biuf' else object)
        elif array.ndim == 2 and kind in 'biuf':
            found.matrices[key] = (array if len(array) >= array.shape[1] else array.T
                                   ).astype(float)
    return found


def _is_unit_of(label: str, name: str) -> bool:
    """Return whether a text is called as the unit of a name: 'units.F', 'F_unit'."""
    first, _, last = label.rpartition('.')
    return last in (f'{name}_unit', f'{name}_units') or last == name and first.rpartition('.')[
        2].casefold() in ('unit', 'units')


def _side_by_side(vectors: Mapping[str, np.ndarray], matrices: dict[str, np.ndarray],
                  ) -> dict[str, np.ndarray]:
    """Return trials that are columns of matrices, {} for none; remove these matrices."""
    shape = next((matrix.shape for key, matrix in matrices.items()
                  if recognise(key.rpartition('.')[2]).quantity == 'force'), (0, 0))
    alike = [key for key, matrix in matrices.items() if matrix.shape == shape]
    if len(alike) < 2:  # a bundle has one force, and a pressure for each motor unit
        return {}
    rows, count = shape
    found = {key: np.tile(vector, count) for key, vector in vectors.items() if len(vector) == rows}
    found |= {key: matrices.pop(key).ravel('F') for key in alike}
    return {**found, 'trial': np.repeat(np.arange(1.0, count + 1.0), rows)}


def _short_names(keys: list[str]) -> list[str]:
    """Return names without a common prefix: `log.force` becomes `force`."""
    while keys and all('.' in key for key in keys) and len({key.split('.')[0]
                                                            for key in keys}) == 1:
        keys = [key.partition('.')[2] for key in keys]
    return keys
