# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Long work in a process of its own, with progress and cancel; the page stays responsive."""

import asyncio
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.processes import on_one_core

_SPAWN = get_context('spawn')
#: Time between two looks for messages of the process, s.
_PERIOD = 0.05


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
        self._here, self._there = _SPAWN.Pipe(duplex=False)
        self._process = _SPAWN.Process(target=_work, args=(self._there, function, arguments),
                                       daemon=True)
        self._cancelled = False
        #: Share that is done, 0 to 1, and the present step.
        self.share, self.words = 0.0, 'starting'

    async def run(self) -> Any:
        """
        Return the result.

        Raises `Cancelled`, InputError for input that the work cannot use, else `WorkerError`.
        """
        try:
            # in a thread: the arguments may be larger than a pipe's buffer
            await asyncio.to_thread(self._process.start)
            # only the process holds this end now, so that the pipe ends with it
            self._there.close()
            while not self._cancelled:
                while not self._here.poll():
                    await asyncio.sleep(_PERIOD)
                kind, content = self._here.recv()
                if kind == 'result':
                    return content
                if kind == 'failed':
                    raise content
                self.share, self.words = content
        except (EOFError, OSError):
            if not self._cancelled:
                raise WorkerError('the worker process ended without a result') from None
        finally:
            self._kill()
        raise Cancelled

    def cancel(self) -> None:
        """Stop at once."""
        self._cancelled = True
        self._kill()

    def _kill(self) -> None:
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


@on_one_core
def _work(page: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Call a function in the new process and send what it reports, returns or raises."""
    try:
        page.send(('result', function(
            lambda share, words: page.send(('progress', (share, words))), *arguments)))
    except InputError as error:
        page.send(('failed', error))
    except Exception as error:  # the page must show every failure
        page.send(('failed', WorkerError(f'{type(error).__name__}: {error}')))
