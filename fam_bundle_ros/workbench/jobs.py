# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Long work in a process of its own, with progress and cancel; the page stays responsive."""

import asyncio
from collections.abc import Callable
import pickle
import sys
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import environment
from fam_bundle_ros.workbench.worker import LENGTH


class Cancelled(Exception):
    """The user stopped the work."""


class WorkerError(RuntimeError):
    """The worker failed for a reason that is not the user's input."""


class Job:
    """
    One run of a function of `worker` in a process of its own.

    It is called with a progress callable and ``arguments``, which are pickled.
    """

    def __init__(self, function: Callable[..., Any], *arguments: Any):
        self._work = (function, arguments)
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = False
        #: Share that is done, 0 to 1, and the present step.
        self.share, self.words = 0.0, 'starting'

    async def run(self) -> Any:
        """
        Return the result.

        Raises `Cancelled`, InputError for input that the work cannot use, else `WorkerError`.
        """
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, '-m', 'fam_bundle_ros.workbench.worker', env=environment(),
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, limit=1 << 30)
        try:
            if self._cancelled:
                raise Cancelled
            return await self._talk(self._process)
        except (asyncio.IncompleteReadError, ConnectionError, BrokenPipeError):
            if self._cancelled:
                raise Cancelled from None
            raise WorkerError('the worker process ended without a result') from None
        finally:
            self._kill()
            await self._process.wait()

    async def _talk(self, process: asyncio.subprocess.Process) -> Any:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps(self._work))
        await process.stdin.drain()
        process.stdin.close()
        while True:
            size, = LENGTH.unpack(await process.stdout.readexactly(LENGTH.size))
            kind, content = pickle.loads(await process.stdout.readexactly(size))
            if kind == 'progress':
                self.share, self.words = content
            elif kind == 'result':
                return content
            elif kind == 'input_error':
                raise InputError(content)
            else:
                raise WorkerError(content)

    def cancel(self) -> None:
        """Stop at once."""
        self._cancelled = True
        self._kill()

    def _kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
