# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Find the recordings of a campaign: files of a folder and rows of a table of specimens."""

from collections.abc import Container, Iterable, Iterator, Mapping
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

    #: Path relative to the folder: the key of every table.
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
        Table of specimens. Its paths are relative to the folder of the table.
    pattern : str
        Pattern of the file names, such as ``'*.csv'``.
    skip : tuple of Path
        Files that are not recordings: recipes, tables.

    Raises
    ------
    InputError
        For a folder without recordings, a bad table, two rows with the same file, or a row with
        a file that is not in the folder.
    """
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder; expected one with recordings')
    listed = {Path(specimen.data).resolve(): specimen
              for specimen in (read_specimens(table) if table is not None else [])}
    left = {path.resolve() for path in (*skip, *([table] if table is not None else []))}
    files = [*_named(folder, listed), *_files(folder)]
    if table is not None:
        _check_all_there(table, folder, listed, {path.resolve() for path in files})
    # one for each file, also if a link in the folder is another name of it
    names = {path.resolve(): path for path in sorted(files, key=lambda path: not path.is_symlink())
             if fnmatch(path.name, pattern)}
    found = [_recording(str(path.relative_to(folder)), path.absolute(), listed.get(real))
             for real, path in sorted(names.items(), key=lambda item: str(item[1]))
             if real not in left]
    if not found:
        raise InputError(f"{folder}: no recording called '{pattern}' with one of the endings "
                         f"{', '.join(SUFFIXES)}")
    return found


def _named(folder: Path, listed: Iterable[Path]) -> list[Path]:
    """Return the files in the folder that the table names, also with an unknown ending."""
    root = folder.resolve()
    return [folder / path.relative_to(root) for path in listed
            if path.is_relative_to(root) and path.exists()]


def _check_all_there(table: Path, folder: Path, listed: Mapping[Path, Specimen],
                     there: Container[Path]) -> None:
    for path, specimen in listed.items():
        if path in there:
            continue
        data = Path(specimen.data)
        written = data.relative_to(table.parent) if data.is_relative_to(table.parent) else data
        meant = (folder / written).resolve()
        example = f", '{os.path.relpath(meant, table.parent)}'" if meant in there else ''
        raise InputError(
            f"{table}, column 'file': '{written}' is not among the recordings in {folder}; "
            f'expected a path from the folder of the table{example}')


def _files(folder: Path) -> Iterator[Path]:
    for where, folders, names in os.walk(folder):
        here = Path(where)
        if _BAG in names:
            folders.clear()
            yield here
            continue
        if MARK in names:
            folders.clear()
            continue
        folders[:] = [name for name in folders if not name.startswith('.')]
        for name in names:
            if Path(name).suffix.lower() in SUFFIXES and not name.startswith('.'):
                yield here / name


def _recording(file: str, path: Path, specimen: Specimen | None) -> Recording:
    try:
        return Recording(file, path, file_digest(path), specimen)
    except OSError as error:
        return Recording(file, path, '', specimen, f'cannot be read ({error.strerror})')
