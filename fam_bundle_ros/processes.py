# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Threads and memory of this process; environment, output and end of its worker processes."""

from collections.abc import Iterator
from contextlib import contextmanager
import ctypes
import os
import sys
from typing import IO

from threadpoolctl import threadpool_limits

#: Python code before a program: raises KeyboardInterrupt when standard input is closed, also when
#: the parent process is killed, or runs in the background of a script (whose children ignore
#: Ctrl-C).
ENDS_WITH_STDIN = """
import os, signal, sys, threading
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Thread(target=lambda: (sys.stdin.read(), os.kill(os.getpid(), signal.SIGINT)),
                 daemon=True).start()
"""

#: Decorator: BLAS uses one thread while a function runs. With matrices of a few hundred rows its
#: threads mostly wait for each other, many times longer if other programs run.
on_one_core = threadpool_limits.wrap(limits=1, user_api='blas')

#: Of glibc's malloc.h: parameters of `mallopt`.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3


def keep_freed_memory() -> None:
    """
    Let the C library keep freed memory for reuse, if it is glibc; does nothing with others.

    By default it returns freed arrays of some 100 kB to the system, which then clears them again
    page by page: a quarter of the time of a diagnosis of a long log.
    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None) if os.name == 'posix' else None
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, 1 << 30)
        mallopt(_MMAP_THRESHOLD, 1 << 25)  # the largest that glibc accepts


def environment() -> dict[str, str]:
    """Return the environment for a Python process with the same packages and one thread."""
    return {**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1',
            'PYTHONPATH': os.pathsep.join(part for part in sys.path if part)}


@contextmanager
def variables(**values: str) -> Iterator[None]:
    """Set environment variables within a block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def own_stdout() -> IO[str]:
    """Return standard output for lines; redirect later prints of libraries to standard error."""
    out = os.fdopen(os.dup(sys.stdout.fileno()), 'w', buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return out
