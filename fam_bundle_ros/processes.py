# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one: their environment, their standard output, their end."""

import os
import sys
from typing import IO

#: Python code before a program: it gets Ctrl-C when its standard input is closed, also by a kill
#: of the process that started it, and where a script put that in the background (its children
#: ignore Ctrl-C).
ENDS_WITH_STDIN = """
import os, signal, sys, threading
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Thread(target=lambda: (sys.stdin.read(), os.kill(os.getpid(), signal.SIGINT)),
                 daemon=True).start()
"""


def environment() -> dict[str, str]:
    """Return the environment of a Python that finds the packages of this one, on one core."""
    return {**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1',
            'PYTHONPATH': os.pathsep.join(part for part in sys.path if part)}


def own_stdout(mode: str = 'w') -> IO:
    """
    Return standard output for messages; what libraries print from now on goes to standard error.

    Parameters
    ----------
    mode : str
        ``w`` for text that is written line by line, ``wb`` for bytes.
    """
    out = os.fdopen(os.dup(sys.stdout.fileno()), mode, buffering=1 if mode == 'w' else -1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return out
