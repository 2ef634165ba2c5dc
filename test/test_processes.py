# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one speak on a standard output of their own, and end with it."""

import platform
import signal
import subprocess
import sys

import pytest

from fam_bundle_ros.processes import ENDS_WITH_STDIN, environment


def test_what_libraries_print_is_not_among_the_messages():
    """It goes to standard error; the message goes to standard output."""
    done = subprocess.run(
        [sys.executable, '-c', 'from fam_bundle_ros.processes import own_stdout\n'
         'out = own_stdout()\nprint("a library", flush=True)\nout.write("told\\n")'],
        capture_output=True, text=True, check=True, env=environment())
    assert (done.stdout, done.stderr) == ('told\n', 'a library\n')


@pytest.mark.parametrize('before', [signal.SIG_DFL, signal.SIG_IGN])
def test_it_gets_ctrl_c_when_its_input_is_closed(before):
    """As when the process that started it was killed; also in the background of a script."""
    # not signal.pause(): it may begin after Python took note of the signal, and wait for another
    program = f'{ENDS_WITH_STDIN}\nimport time\nwhile True:\n    time.sleep(0.05)'
    process = subprocess.Popen([sys.executable, '-c', program], stdin=subprocess.PIPE,
                               stderr=subprocess.DEVNULL,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, before))
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGINT


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='only glibc can be told so')
def test_freed_memory_is_kept_for_the_next_array():
    """A page that is returned to the system has to be cleared by it when it is used again."""
    program = """
import resource
import numpy as np
from fam_bundle_ros.processes import keep_freed_memory

def cleared_pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    [np.ones(100_000 * count) for count in range(1, 9)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed_memory()
print(*(cleared_pages() for _ in range(4)))
"""
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          check=True, env=environment())
    first, *again = map(int, done.stdout.split())
    assert max(again) < first / 10
