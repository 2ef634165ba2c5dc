# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Run independent tasks in this process, in processes of this machine, or on a Dask cluster.

All processes on this machine end with the call, also after Ctrl-C, SIGTERM or SIGKILL.
"""

import asyncio
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
import logging
from multiprocessing import (
    active_children,
    connection,
    get_context,
    parent_process,
    resource_tracker,
)
import os
import signal
import threading
from typing import Any
import warnings

from fam_bundle_ros.campaign.version import code_version
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.extras import library
from fam_bundle_ros.processes import variables

Progress = Callable[[int, int], None] | None
#: Returns a substitute for the result of a task whose process died; None: raise `WorkerDied`.
Lost = Callable[[Any], Any] | None
#: Set to 1, as several processes with several threads each would compete for the cores.
_ONE_CORE = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')
#: Signals that end a command.
_ENDS = (signal.SIGINT, signal.SIGTERM)
#: Timeout of the scheduler, s.
_ANSWER = 10.0


class WorkerDied(RuntimeError):
    """The process of a task was killed or crashed, also at the second attempt."""


def each(function: Callable[[Any], Any], tasks: Iterable[Any], workers: int | None = None,
         progress: Progress = None, scheduler: str | None = None) -> list[Any]:
    """
    Return the results of all tasks, in their order.

    Parameters
    ----------
    function : callable
        Defined in a module, so that a new process can import it; tasks and results must be
        picklable.
    workers : int, optional
        Number of processes; by default that of cores. 1: run in this process.
    progress : callable, optional
        Called with the number of finished tasks and the number of all tasks.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:8786``, whose workers run the tasks.
    """
    todo = list(tasks)
    results: list[Any] = [None] * len(todo)
    for done, (place, result) in enumerate(as_done(function, todo, workers, scheduler), 1):
        results[place] = result
        if progress:
            progress(done, len(todo))
    return results


def as_done(function: Callable[[Any], Any], todo: Sequence[Any], workers: int | None = None,
            scheduler: str | None = None, lost: Lost = None) -> Iterator[tuple[int, Any]]:
    """
    Yield the index and the result of each task when it is finished; see `each`.

    After an error, Ctrl-C or SIGTERM the processes are terminated. On a cluster, tasks that have
    not started are cancelled; its workers keep running.

    Parameters
    ----------
    lost : callable, optional
        Takes a task whose process died and returns a substitute for its result. On this machine
        such a task is first tried once more, alone; on a cluster, as often as its option
        ``distributed.scheduler.allowed-failures`` says.

    Raises
    ------
    InputError
        If the scheduler does not answer, its workers have other code, or Dask is not installed.
    WorkerDied
        If a process dies and ``lost`` is None.
    """
    if scheduler is not None:
        if workers is not None:
            raise InputError(f'{workers} workers and the scheduler {scheduler}; expected one of '
                             'the two (a cluster has its own workers)')
        yield from _on_cluster(function, todo, scheduler, lost)
        return
    count = min(workers or os.cpu_count() or 1, max(len(todo), 1))
    if count == 1:
        yield from enumerate(map(function, todo))
        return
    with variables(**dict.fromkeys(_ONE_CORE, '1')):
        suspects = yield from _in_processes(function, dict(enumerate(todo)), count)
        while suspects:
            # one at a time, to find the task that kills its process
            place, task = suspects.popitem()
            died = yield from _in_processes(function, {place: task}, 1)
            if died:
                yield place, _substitute(lost, task)


def _in_processes(function: Callable[[Any], Any], todo: dict[int, Any], count: int,
                  ) -> Generator[tuple[int, Any], None, dict[int, Any]]:
    """
    Yield indices and results; return the tasks that were running when a process died.

    Tasks that had not started then are run by new processes.
    """
    suspects: dict[int, Any] = {}
    while todo:
        before = set(active_children())
        # not forked: a fork inherits locks of threads, and linear algebra set up for all cores
        with ProcessPoolExecutor(count, get_context('spawn'), _begin_worker) as pool:
            # no more tasks than processes, so that the running ones are known if a process dies
            under_way: dict[Future, int] = {}
            waiting = iter(list(todo))
            try:
                while True:
                    for place in waiting:
                        with _signals_wait():
                            future = pool.submit(function, todo[place])
                        under_way[future] = place
                        if len(under_way) == count:
                            break
                    if not under_way:
                        break
                    for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                        result = future.result()
                        place = under_way.pop(future)
                        del todo[place]
                        yield place, result
            except BrokenProcessPool:
                _can_start()
                suspects.update({place: todo.pop(place) for place in under_way.values()})
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in set(active_children()) - before:
                    process.terminate()
                raise
    return suspects


def _can_start() -> None:
    """Raise WorkerDied if a new process dies without a task: then the cause is not a task."""
    try:
        with ProcessPoolExecutor(1, get_context('spawn'), _begin_worker) as pool:
            pool.submit(os.getpid).result()
    except BrokenProcessPool as error:
        raise WorkerDied('processes die at their start; expected a script that calls this below '
                         "`if __name__ == '__main__':`, since each process imports it, and enough "
                         'memory') from error


def _substitute(lost: Lost, task: Any) -> Any:
    if lost is None:
        raise WorkerDied(f'the process that worked on {task!r} died twice: killed, out of memory, '
                         'or a crash')
    return lost(task)


@contextmanager
def _signals_wait() -> Iterator[None]:
    """
    Block Ctrl-C and SIGTERM while processes are started.

    A process interrupted during its start would print a traceback. It inherits the blocked
    signals, until `_begin_worker`.
    """
    resource_tracker.ensure_running()  # its start unblocks signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_worker() -> None:
    """Ignore Ctrl-C, which the parent handles, and exit when the parent process has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDS)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (connection.wait([parent.sentinel]), os._exit(1)),
                         daemon=True).start()


def _on_cluster(function: Callable[[Any], Any], todo: Sequence[Any], address: str, lost: Lost,
                ) -> Iterator[tuple[int, Any]]:
    distributed = library('distributed', f'scheduler {address}: a cluster')
    with _client(distributed, address) as client:
        places = {future: place for place, future in enumerate(
            client.map(function, list(todo), pure=False))}
        try:
            for future in distributed.as_completed(list(places), loop=client.loop):
                place = places.pop(future)
                try:
                    result = future.result()
                except distributed.KilledWorker:
                    result = _substitute(lost, todo[place])
                except distributed.CancelledError as error:
                    raise InputError(f'scheduler {address}: the connection was lost; expected it '
                                     'to run until the end') from error
                future.release()  # frees the result in the cluster's memory
                yield place, result
        except BaseException:
            client.cancel(list(places), force=True)
            raise


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    """Yield a client of a scheduler whose workers have the code of this process."""
    # checked before a client is made, which takes 20 s to close if it cannot connect
    with ThreadPoolExecutor(1) as alone:
        try:
            kind = alone.submit(asyncio.run, _kind(distributed, address)).result()
        except (OSError, ValueError) as error:
            kind, why = '', str(error).strip() or 'timeout'
        else:
            why = f'what answers is a {kind}'
    if kind != 'Scheduler':
        raise InputError(f'scheduler {address}: no scheduler answers ({why}); expected the '
                         'address that `dask scheduler` prints, such as tcp://192.168.1.5:8786')
    logger = logging.getLogger('distributed.client')
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # its tracebacks repeat the error below
    try:
        with distributed.Client(address, timeout=_ANSWER, set_as_default=False) as client:
            _check(client, address)
            yield client
    finally:
        logger.setLevel(level)


async def _kind(distributed: Any, address: str) -> str:
    """Return the type of the server at an address: 'Scheduler', 'Worker', ..."""
    security = distributed.Security()  # from the configuration of Dask
    server = distributed.rpc(address, timeout=_ANSWER,
                             connection_args=security.get_connection_args('client'))
    try:
        return (await asyncio.wait_for(server.identity(), _ANSWER))['type']
    finally:
        await server.close_rpc()


def _check(client: Any, address: str) -> None:
    expected = code_version(whole=True)
    try:
        found = client.run(code_version, whole=True)
    except ModuleNotFoundError as error:
        raise InputError(f'scheduler {address}: a worker has no package {error.name}; expected '
                         'fam_bundle_ros installed where workers run') from error
    if not found:
        warnings.warn(f'scheduler {address} has no worker yet: waiting for the first',
                      stacklevel=2)
    for worker, version in found.items():
        if version != expected:
            raise InputError(f'scheduler {address}: worker {worker} has fam_bundle_ros {version}; '
                             f'expected {expected}, as here')
