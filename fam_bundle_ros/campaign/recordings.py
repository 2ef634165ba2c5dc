# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Find the recordings of a campaign: files of a folder and rows of a table of specimens."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
import os
from pathlib import Path

from fam_bundle_ros.data.formats import SUFFIXES
from fam_bundle_ros.data.measurement import file_digest
from fam_bundle_ros.discovery.specimen_table import read_specimens, Specimen
from fam_bundle_ros.errors import InputError

#: File that marks a folder of results, which has no recordings.
MARK = 'campaign.json'
#: File that marks a folder as a ROS 2 bag.
_BAG = 'metadata.yaml'


@dataclass(frozen=True)
class Recording:
    """One recording of a campaign."""

    #: Path relative to the folder, absolute if it is elsewhere: the key of every table.
    file: str
    #: Absolute path.
    path: Path
    #: Hash of its content; empty if it cannot be read.
    sha256: str
    #: Its row in the table of specimens.
    specimen: Specimen | None = None
    #: Why it cannot be read; empty if it can.
    problem: str = ''

    @property
    def dimensions(self) -> Mapping[str, float]:
        """Known dimensions of the specimen, SI."""
        return {} if self.specimen is None else self.specimen.dimensions

    @property
    def muscle(self) -> str:
        """Name of the muscle: from the column ``muscle`` of the table, else the file."""
        if self.specimen is None:
            return self.file
        facts, remarks = self.specimen.facts, self.specimen.remarks
        return remarks.get('muscle') or (f"{facts['muscle']:g}" if 'muscle' in facts
                                         else self.file)


def find(folder: Path, table: Path | None = None, pattern: str = '*',
         skip: tuple[Path, ...] = ()) -> list[Recording]:
    """
    Return the recordings in a folder and in a table, in the order of their names.

    Parameters
    ----------
    folder : Path
        Searched recursively, except hidden folders and results of campaigns. A ROS 2 bag (a
        folder) is one recording.
    table : Path, optional
        Table of specimens; a missing file in it is a recording with a problem.
    pattern : str
        Pattern of the file names, such as ``'*.csv'``.
    skip : tuple of Path
        Files that are not recordings: recipes, tables.

    Raises
    ------
    InputError
        For a folder without recordings, a bad table, or two rows with the same file.
    """
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder; expected one with recordings')
    listed = {Path(specimen.data).resolve(): specimen
              for specimen in (read_specimens(table) if table is not None else [])}
    left = {path.resolve() for path in (*skip, *([table] if table is not None else []))}
    # by the name in the folder, which may be a link; the table may have another path to the file
    names = {str(path.relative_to(folder)): path for path in _files(folder, pattern)
             if path.resolve() not in left}
    there = {path.resolve() for path in names.values()}
    names.update({str(path): path for path in listed if path not in there})
    found = [_recording(name, path.absolute(), listed.get(path.resolve()))
             for name, path in sorted(names.items())]
    if not found:
        raise InputError(f"{folder}: no recording called '{pattern}' with one of the endings "
                         f"{', '.join(SUFFIXES)}")
    return found


def _files(folder: Path, pattern: str) -> Iterator[Path]:
    for where, folders, names in os.walk(folder):
        here = Path(where)
        if _BAG in names and fnmatch(here.name, pattern):
            folders.clear()
            yield here
            continue
        if MARK in names:
            folders.clear()
            continue
        folders[:] = [name for name in folders if not name.startswith('.')]
        for name in names:
            known = Path(name).suffix.lower() in SUFFIXES and not name.startswith('.')
            if known and fnmatch(name, pattern):
                yield here / name


def _recording(file: str, path: Path, specimen: Specimen | None) -> Recording:
    try:
        return Recording(file, path, file_digest(path), specimen)
    except OSError as error:
        return Recording(file, path, '', specimen, f'cannot be read ({error.strerror})')
