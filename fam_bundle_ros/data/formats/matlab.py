# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""MATLAB .mat files: up to version 7 by scipy, 7.3 (HDF5) by h5py; other HDF5 files alike."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.data.formats.arrays import of_arrays
from fam_bundle_ros.data.formats.table import reading_as, Table
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library

_OPAQUE = ("holds a MATLAB table or timeseries, which only MATLAB reads; expected a struct: "
           "s = table2struct(T, 'ToScalar', true); save('log.mat', '-struct', 's')")


def read_mat(path: Path, sheet: str | None = None) -> Table:
    """
    Return the table of a .mat file up to version 7: vectors, structs of them, or a matrix.

    Raises
    ------
    InputError
        For a damaged file, one without numbers, and one that holds MATLAB objects only.
    """
    from scipy.io import loadmat
    with reading_as(path, 'a .mat file', Exception):  # scipy raises many kinds on damaged files
        values = loadmat(path, simplify_cells=True)
    opaque = any(type(value).__name__ == 'MatlabOpaque' or 'FunctionWorkspace' in key
                 for key, value in values.items())
    values = {key: value for key, value in values.items() if not key.startswith('__')
              and type(value).__name__ != 'MatlabOpaque'}
    return _chosen(path, values, sheet, opaque)


def read_hdf(path: Path, sheet: str | None = None) -> Table:
    """Return the table of a .mat file of version 7.3, or of another HDF5 file."""
    h5py = library('h5py', f'{path.name}: reading it')
    with reading_as(path, 'HDF5', OSError, RuntimeError, ValueError), h5py.File(
            path, 'r') as file:
        values = {key: _of_node(file, node, 0) for key, node in file.items()
                  if not key.startswith('#')}
        values.update(_units_of(file))
        opaque = '#subsystem#' in file
    return _chosen(path, {key: value for key, value in values.items() if value is not None},
                   sheet, opaque)


def _chosen(path: Path, values: dict[str, Any], sheet: str | None, opaque: bool) -> Table:
    if sheet is not None:
        if sheet not in values:
            raise InputError(f"{path.name}: no variable '{sheet}'; expected one of "
                             f"{', '.join(values) or 'none'}")
        values = {sheet: values[sheet]}
    try:
        return of_arrays(path.name, '.mat', values)
    except InputError:
        if opaque:
            raise InputError(f'{path.name}: {_OPAQUE}') from None
        raise


def _units_of(group: Any) -> dict[str, str]:
    """Return the units that a group and its datasets carry as attributes."""
    units = {key: _text(value) for key, value in group.attrs.items()
             if key.casefold().endswith(('_unit', '_units'))}
    for key, child in group.items():
        unit = child.attrs.get('units', child.attrs.get('unit'))
        if unit is not None:
            units[f'{key}_unit'] = _text(unit)
    return units


def _text(value: Any) -> str:
    return value.decode(errors='replace') if isinstance(value, bytes) else str(value)


def _of_node(file: Any, node: Any, depth: int) -> Any:
    """Return the values of a dataset, a dict for a group, None for other nodes."""
    if depth > 4:
        return None
    if isinstance(node, Mapping):
        inner = {key: _of_node(file, child, depth + 1) for key, child in node.items()}
        inner.update(_units_of(node))
        return {key: value for key, value in inner.items() if value is not None}
    if node.dtype.kind == 'V' and node.dtype.names:
        table = node[()]
        return {name: table[name] for name in table.dtype.names}
    if _text(node.attrs.get('MATLAB_class', '')) == 'char' and node.dtype.kind in 'ui':
        return ''.join(map(chr, np.asarray(node[()]).ravel(order='F')))
    if node.dtype.kind == 'O':
        cells = np.asarray(node[()]).ravel()
        if len(cells) > 10_000:
            return None
        if all(isinstance(cell, (bytes, str)) for cell in cells):
            texts = list(map(_text, cells))
            return texts[0] if node.shape == () else np.array(texts, object)
        try:  # a cell array: references to its cells
            return np.array([_of_node(file, file[cell], depth + 1) for cell in cells], object)
        except (KeyError, TypeError, ValueError):
            return None
    if node.dtype.kind in 'biuf':
        return np.asarray(node[()])
    if node.dtype.kind == 'S':
        return np.char.decode(np.asarray(node[()]), errors='replace')
    return None
