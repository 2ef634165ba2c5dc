# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Many independent tasks on the cores of this machine; no process is left when it ends."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
import os
from typing import Any

Progress = Callable[[int, int], None] | None
#: Linear algebra on one core each: the processes are the parallelism.
_ONE_CORE = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')


def each(function: Callable[[Any], Any], tasks: Iterable[Any], workers: int | None = None,
         progress: Progress = None) -> list[Any]:
    """
    Return the result of every task, in their order.

    Parameters
    ----------
    function : callable
        Of a module, so that a fresh process finds it; tasks and results can be pickled.
    tasks : iterable
    workers : int, optional
        Processes; all cores by default. With 1 it is done here.
    progress : callable, optional
        Called with how many are done, and of how many.
    """
    todo = list(tasks)
    results: list[Any] = [None] * len(todo)
    for done, (place, result) in enumerate(as_done(function, todo, workers), 1):
        results[place] = result
        if progress:
            progress(done, len(todo))
    return results


def as_done(function: Callable[[Any], Any], todo: Sequence[Any], workers: int | None = None,
            ) -> Iterator[tuple[int, Any]]:
    """
    Yield the place of each task and its result as it is done; see `each`.

    An error, Ctrl-C or SIGTERM ends the processes at once.
    """
    count = min(workers or os.cpu_count() or 1, max(len(todo), 1))
    if count == 1:
        yield from enumerate(map(function, todo))
        return
    # not forked: a fork keeps the threads' locks, and linear algebra that uses every core
    with _one_core_each(), ProcessPoolExecutor(count, get_context('spawn')) as pool:
        places = {pool.submit(function, task): place for place, task in enumerate(todo)}
        try:
            for future in as_completed(places):
                yield places[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                process.terminate()
            raise


@contextmanager
def _one_core_each() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _ONE_CORE}
    os.environ.update(dict.fromkeys(_ONE_CORE, '1'))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
