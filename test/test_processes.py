# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one speak on a standard output of their own, and end with it."""

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
