# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
An experiment that is driven on the bundle of the page "Live": a process of `fam_bundle measure`.

ROS stays out of this process. The other one ends, and vents, when its standard input closes, so
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

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import ENDS_WITH_STDIN, environment
from fam_bundle_ros.resources import shipped_or_own
from fam_bundle_ros.workbench import live

#: Where the recordings go, below the working directory.
FOLDER = 'fam_bundle_measurements'
#: s to vent and to switch the controller off, before it is killed.
_FAREWELL = 12.0
#: Lines of its error output that are kept.
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
    A measurement to be made.

    Attributes
    ----------
    protocol, model : str
        Files, or names of what ships; the model is that of the controller.
    namespace : str
    out : str
        New CSV.
    resume : bool
        Go on with what is there of it.
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
        """What follows ``fam_bundle`` on a command line."""
        return ['measure', '--rig', '--yes', '--model', self.model, '--namespace', self.namespace,
                '--out', self.out, *(['--resume'] if self.resume else []), '--', self.protocol]


class MeasureRun:
    """
    The measurement of a bundle, one at a time.

    Attributes
    ----------
    running : bool
        Whether one is under way.
    order : Order or None
        The last that was given.
    share : float
        How far it is, 0 to 1.
    words : str
        What it is doing, and how long it takes still.
    file : str
        The CSV of the last one, once it is complete; else empty.
    failure : str
        Why the last one ended before it was complete; else empty.
    """

    def __init__(self) -> None:
        self.order: Order | None = None
        self.share, self.words = 0.0, ''
        self.file = self.failure = ''
        self._process: asyncio.subprocess.Process | None = None
        self.running = self._stopped = False

    @property
    def kept(self) -> bool:
        """Whether there are segments of a measurement that ended early, to resume."""
        return not self.running and self.order is not None and bool(
            self.failure) and Path(f'{self.order.out}.parts').is_dir()

    async def run(self, order: Order) -> None:
        """
        Measure; return when it is over: `file` or `failure` says how.

        Raises
        ------
        InputError
            Where one is under way already, or the recording has no place.
        """
        if self.running:
            raise InputError('a measurement is under way already: stop it first')
        try:
            Path(order.out).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f'{Path(order.out).parent}: cannot be made ({error.strerror})'
                             ) from None
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
        # FORCE_COLOR would make a bar of the lines
        variables = {key: value for key, value in environment().items() if key != 'FORCE_COLOR'}
        # a session of its own: Ctrl-C in a terminal is for the workbench, which ends it
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
        # where it is killed the controller vents: its references no longer come
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


def model_file(told: str) -> str:
    """Return the path of a model as nodes find it; InputError where there is none here."""
    try:
        return str(shipped_or_own(told, 'models').absolute())
    except InputError as error:
        raise InputError(f'{error}; expected the model file of the controller') from None
