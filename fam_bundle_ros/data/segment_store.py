# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Keeps the segments of an experiment until it is complete, and goes on where it ended.

Beside ``log.csv`` there is a folder ``log.csv.parts`` while it is made: the protocol and one file
for each segment that is complete, each written whole or not at all. In the end they become
``log.csv``, as `fam_bundle_ros.data.read_measurement` takes it, and the folder goes.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
import shutil
import time
from typing import NamedTuple

from fam_bundle_ros.atomic import whole, write_whole
from fam_bundle_ros.data.measurement import labels_of
from fam_bundle_ros.data.protocol import dumps_protocol, Protocol, Segment
from fam_bundle_ros.errors import InputError, system_errors

_PROTOCOL = 'protocol.yaml'


class Row(NamedTuple):
    """A sample."""

    #: s.
    time: float
    strain: float
    #: Pa (gauge).
    pressure: tuple[float, ...]
    #: N.
    force: float


class SegmentStore:
    """
    The recording of an experiment on its way.

    Parameters
    ----------
    out : path
        The CSV that is to be made.
    motor_units : sequence of str
        Their names.
    resume : bool
        Whether to go on with what is there.

    Raises
    ------
    InputError
        Where the CSV is there already, or segments of an experiment that is not to be resumed or
        is another one.
    """

    def __init__(self, out: str | Path, protocol: Protocol, motor_units: Sequence[str],
                 resume: bool = False):
        self.out = Path(out)
        self.folder = self.out.with_name(f'{self.out.name}.parts')
        pressures = [f'{label} [kPa]' for label in labels_of(motor_units)]
        self._header = ','.join(['time [s]', 'trial', 'strain', *pressures, 'force [N]']) + '\n'
        self._text = dumps_protocol(protocol)
        if self.out.suffix != '.csv':
            raise InputError(f'{out}: expected the name of a new CSV file (.csv)')
        if self.out.exists():
            raise InputError(f'{out}: is there already; expected the name of a new CSV file')
        if self.folder.exists():
            self._check(resume)

    def _check(self, resume: bool) -> None:
        if not resume:
            raise InputError(f'{self.folder}: segments of an experiment that did not end; '
                             'expected --resume to go on with it, or another name')
        try:
            begun = (self.folder / _PROTOCOL).read_text(encoding='utf-8')
        except OSError:
            # Killed before anything was recorded.
            begun = self._text
        if begun != self._text:
            raise InputError(f'{self.folder}: was begun with another protocol; expected that one, '
                             'or another name')

    @property
    def done(self) -> frozenset[int]:
        """The numbers of the segments that are complete."""
        return frozenset(int(path.stem) for path in self._files())

    def clock(self) -> float:
        """Return the time of the experiment, s; it goes on while the program does not run."""
        files = self._files()
        if not files:
            return 0.0
        last = max(files, key=_end)
        return _end(last) + max(time.time() - last.stat().st_mtime, 0.0)

    def keep(self, segment: Segment, rows: Iterable[Row]) -> None:
        """Write a complete segment."""
        if not self.folder.exists():
            with system_errors(self.folder, 'cannot be made'):
                self.folder.mkdir()
            write_whole(self.folder / _PROTOCOL, self._text)
        write_whole(self.folder / f'{segment.number:05d}.csv', ''.join(
            f'{row.time:.6f},{segment.number},{row.strain:.7g},'
            + ','.join(f'{value / 1e3:.6g}' for value in row.pressure)
            + f',{row.force:.6g}\n' for row in rows))

    def finish(self) -> None:
        """Write the CSV of all segments, and the protocol beside it; remove the folder."""
        with whole(self.out) as draft, open(draft, 'w', encoding='utf-8') as stream:
            stream.write(self._header)
            for path in self._files():
                stream.write(path.read_text(encoding='utf-8'))
        write_whole(self.out.with_suffix('.protocol.yaml'), self._text)
        shutil.rmtree(self.folder)

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob('[0-9]*.csv')) if self.folder.is_dir() else []


def _end(path: Path) -> float:
    """Return the time of the last row of a file, s."""
    with open(path, 'rb') as stream:
        last = b''
        for line in stream:
            last = line
    return float(last.partition(b',')[0] or 0.0)
