# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a file of any format to a `Table`; what the columns mean is told later (`data.columns`).

The content tells the format, not the ending: what looks like a workbook is read as one.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from fam_bundle_ros.data.formats import arrays, labview, matlab, text, workbook
from fam_bundle_ros.data.formats.table import check_size, Table
from fam_bundle_ros.errors import InputError

__all__ = ['is_bag', 'read_table', 'SUFFIXES', 'Table']

#: Endings of files that are read.
SUFFIXES = ('.csv', '.txt', '.tsv', '.dat', '.asc', '.log', '.xlsx', '.xlsm', '.lvm', '.tdms',
            '.mat', '.h5', '.hdf5', '.parquet', '.feather', '.npz', '.npy', '.json', '.jsonl',
            '.mcap',
            '.db3')
#: First bytes of formats that cannot be read, and what to do.
_REFUSED = (
    (b'\xd0\xcf\x11\xe0', 'an old or a protected Excel file; expected it saved as .xlsx'),
    (b'\x1f\x8b', 'compressed by gzip; expected it unpacked'),
    (b'7z\xbc\xaf', 'compressed; expected it unpacked'),
    (b'<!DOCTYPE', 'a web page; expected it saved as .csv or .xlsx'),
    (b'<html', 'a web page; expected it saved as .csv or .xlsx'),
    (b'<table', 'a web page; expected it saved as .csv or .xlsx'),
    (b'<?xml', 'an XML file; expected it saved as .csv or .xlsx'),
    (b'%PDF', 'a PDF; expected a table, such as a CSV'),
    (b'\x80\x04\x95', 'a pickle, which may run code; expected for example to_csv or to_parquet'),
)
_READERS: tuple[tuple[bytes, Callable[..., Table]], ...] = (
    (b'PK\x03\x04', workbook.read_zip), (b'TDSm', labview.read_tdms),
    (b'MATLAB 5.0 MAT-file', matlab.read_mat), (b'MATLAB 7.3 MAT-file', matlab.read_hdf),
    (b'\x89HDF\r\n\x1a\n', matlab.read_hdf), (b'PAR1', partial(arrays.read_arrow, kind='parquet')),
    (b'ARROW1', partial(arrays.read_arrow, kind='feather')), (b'\x93NUMPY', arrays.read_npy),
)


def is_bag(path: Path) -> bool:
    """Return whether a path is a ROS 2 bag: a folder, or a file of one."""
    if path.is_dir() or path.suffix.lower() in ('.mcap', '.db3'):
        return True
    with open(path, 'rb') as stream:
        return stream.read(16).startswith((b'\x89MCAP0\r\n', b'SQLite format 3'))


def read_table(path: Path, sheet: str | None = None, drop_bad: bool = False) -> Table:
    """
    Return the table that a file holds.

    Parameters
    ----------
    path : path
    sheet : str, optional
        Sheet of a workbook, group of a .tdms file, variable of a .mat file.
    drop_bad : bool, optional
        Leave rows of a text file out that have more cells than columns.

    Raises
    ------
    InputError
        One sentence: what the file is and what to do.
    """
    check_size(path)
    with open(path, 'rb') as stream:
        head = stream.read(512)
    for magic, words in _REFUSED:
        if head.lstrip(b'\xef\xbb\xbf \r\n').startswith(magic):
            raise InputError(f'{path.name}: {words}')
    for magic, reader in _READERS:
        if head.startswith(magic):
            return reader(path, sheet)
    if head.lstrip(b'\xef\xbb\xbf').startswith(b'LabVIEW Measurement'):
        return labview.read_lvm(path)
    if path.suffix.lower() == '.mat':  # version 4 has no mark
        return matlab.read_mat(path, sheet)
    if path.suffix.lower() in ('.json', '.jsonl', '.ndjson'):
        return arrays.read_json(path)
    return text.read_text(path, drop_bad)
