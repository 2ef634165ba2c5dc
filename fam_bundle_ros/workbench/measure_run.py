# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs an experiment on the bundle of the page "Live", in a process of `fam_bundle measure`.

This process does not use ROS. The other one vents and ends when its standard input closes, and so
also when the workbench is killed.
"""

import asyncio
from collections import deque
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
import re
import signal
import sys

from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.processes import ENDS_WITH_STDIN, environment
from fam_bundle_ros.resources import shipped_or_own
from fam_bundle_ros.workbench import live

#: Folder of the recordings, below the working directory.
FOLDER = 'fam_bundle_measurements'
#: Time to vent and to switch the controller off before the process is killed, s.
_FAREWELL = 12.0
#: Number of lines kept of the error output.
_LINES = 12
_PROGRESS = re.compile(r'measure: (\d+) %(?:, (.*))?')
_STOPPED = 'stopped and vented: '
#: The command, with more frequent lines of progress.
_COMMAND = f"""{ENDS_WITH_STDIN}
from fam_bundle_ros.cli import common, main
common.SAY = 0.4
sys.exit(main())
"""


@dataclass(frozen=True)
class Order:
    """
    An experiment to be run, with the controller's model, into a new CSV (``out``).

    ``resume`` continues an unfinished recording.
    """

    protocol: str
    model: str
    namespace: str
    out: str
    resume: bool = False

    @classmethod
    def new(cls, protocol: str, model: str, namespace: str) -> 'Order':
        """Return an order whose CSV is named by the time."""
        out = Path(FOLDER).absolute() / f'{datetime.now():%Y%m%d_%H%M%S_%f}.csv'
        return cls(protocol, model, namespace, str(out))

    @property
    def arguments(self) -> list[str]:
        """Arguments of ``fam_bundle``."""
        return ['measure', '--rig', '--yes', '--model', self.model, '--namespace', self.namespace,
                '--out', self.out, *(['--resume'] if self.resume else []), '--', self.protocol]


class MeasureRun:
    """The measurement of a bundle, one at a time."""

    def __init__(self) -> None:
        #: The last order.
        self.order: Order | None = None
        #: Share that is done, 0 to 1; present step and time left.
        self.share, self.words = 0.0, ''
        #: CSV of the last measurement if it is complete; why it ended early if not.
        self.file = self.failure = ''
        self._process: asyncio.subprocess.Process | None = None
        self.running = self._stopped = False

    @property
    def kept(self) -> bool:
        """Whether a measurement ended early with segments, so that it can be resumed."""
        return not self.running and self.order is not None and bool(
            self.failure) and Path(f'{self.order.out}.parts').is_dir()

    async def run(self, order: Order) -> None:
        """
        Measure; return at the end, with the outcome in `file` or `failure`.

        InputError when one is running already, or the folder cannot be created.
        """
        if self.running:
            raise InputError('a measurement is running already: stop it first')
        folder = Path(order.out).parent
        with system_errors(folder, 'cannot be made'):
            folder.mkdir(parents=True, exist_ok=True)
        self.running, self._stopped = True, False
        self.order, self.share, self.words = order, 0.0, 'starting'
        self.file = self.failure = ''
        try:
            status, last = await self._talk(order)
            if status == 0:
                self.share, self.file = 1.0, order.out
            else:
                self.failure = 'it was stopped' if self._stopped else reason(last)
        finally:
            self.running = False

    async def _talk(self, order: Order) -> tuple[int, list[str]]:
        # FORCE_COLOR would replace the lines by a progress bar
        variables = {key: value for key, value in environment().items() if key != 'FORCE_COLOR'}
        # a session of its own: Ctrl-C in a terminal goes to the workbench, which ends the process
        process = self._process = await asyncio.create_subprocess_exec(
            sys.executable, '-c', _COMMAND, *order.arguments, env=variables,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE, start_new_session=True)
        assert process.stderr is not None
        if self._stopped:
            process.send_signal(signal.SIGINT)
        last: deque[str] = deque(maxlen=_LINES)
        while line := await process.stderr.readline():
            said = line.decode(errors='replace').strip()
            found = _PROGRESS.fullmatch(said)
            if found:
                self.share, self.words = int(found[1]) / 100.0, found[2] or ''
            elif said:
                last.append(said)
        return await process.wait(), list(last)

    async def stop(self) -> None:
        """End it as Ctrl-C does: everything is vented, complete segments are kept."""
        if not self.running:
            return
        self._stopped, self.words = True, 'stopping and venting ...'
        # if the process is killed, the controller vents as it gets no more references
        await live.end(self._process, _FAREWELL)


def reason(lines: list[str]) -> str:
    """
    Return why the command ended, from its last lines.

    Examples
    --------
    >>> reason(['stopped and vented: force is 450 N', '2 of 3 segments are kept in x', 'more'])
    'stopped and vented: force is 450 N'
    >>> reason(['fam_bundle: no samples of a bundle under /bundle']), reason([])
    ('no samples of a bundle under /bundle', 'it ended without a message')
    """
    for line in lines:
        if line.startswith(_STOPPED):
            return line
    return lines[-1].removeprefix('fam_bundle: ') if lines else 'it ended without a message'


def model_file(name_or_path: str) -> str:
    """Return the path of a model as nodes find it; InputError if it does not exist."""
    try:
        return str(shipped_or_own(name_or_path, 'models').absolute())
    except InputError as error:
        raise InputError(f'{error}; expected the model file of the controller') from None
