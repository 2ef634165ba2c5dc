# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Independent tasks on several cores; nobody is left when the command is ended."""

import math
import os
import signal
import subprocess
import sys
import time

import pytest

from fam_bundle_ros.campaign.pool import as_done, each, WorkerDied

#: A command whose processes sleep for as long as a benchmark works.
COMMAND = """
import sys, time
from fam_bundle_ros.campaign.pool import each
from fam_bundle_ros.cli import app, main

if __name__ == '__main__':
    app.app = lambda **given: each(time.sleep, [60.0] * 2, 2)
    sys.exit(main([]))
"""


def processes(group):
    """Return the ids of the processes of a group."""
    found = subprocess.run(['pgrep', '-g', str(group)], capture_output=True, text=True)
    return found.stdout.split()


@pytest.mark.parametrize('workers', [1, 2])
def test_results_keep_the_order_of_the_tasks(workers):
    """Whatever ends first; progress counts every task once."""
    told = []
    assert each(math.sqrt, [4.0, 9.0, 16.0], workers, lambda *step: told.append(step)) == [
        2.0, 3.0, 4.0]
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_a_worker_computes_on_one_core(monkeypatch):
    """Linear algebra is told so before it is imported; the environment here is as it was."""
    monkeypatch.delenv('OMP_NUM_THREADS', raising=False)
    assert each(os.getenv, ['OMP_NUM_THREADS'] * 2, 2) == ['1', '1']
    assert 'OMP_NUM_THREADS' not in os.environ


@pytest.mark.parametrize('workers', [1, 2])
def test_a_task_that_fails_fails_the_rest(workers):
    """Its own error comes out."""
    with pytest.raises(ValueError, match='math domain error'):
        each(math.sqrt, [1.0, -1.0], workers)


def test_a_task_that_takes_its_process_along_stops_no_other():
    """It is tried once more, alone; without a word on what to do then it is an error."""
    tasks = [signal.SIGCHLD, signal.SIGKILL, signal.SIGCHLD, signal.SIGCHLD, signal.SIGCHLD]
    found = dict(as_done(signal.raise_signal, tasks, 2, lost=lambda task: f'lost {task.name}'))
    assert found == {0: None, 1: 'lost SIGKILL', 2: None, 3: None, 4: None}
    with pytest.raises(WorkerDied, match='SIGKILL.*died twice'):
        each(signal.raise_signal, tasks[:2], 2)


def test_a_script_that_starts_processes_while_it_is_imported_is_told_so(tmp_path):
    """No task is to blame, and it is said once."""
    script = tmp_path / 'script.py'
    script.write_text('import math\nfrom fam_bundle_ros.campaign.pool import each\n'
                      'each(math.sqrt, [4.0] * 9, 2)\n')
    told = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert told.returncode == 1
    assert "below `if __name__ == '__main__':`" in told.stderr.splitlines()[-1]


@pytest.mark.parametrize(('end', 'count', 'status', 'words'), [
    (signal.SIGTERM, 2, 1, 'fam_bundle: stopped\n'),
    (signal.SIGTERM, 3, 1, 'fam_bundle: stopped\n'),
    (signal.SIGINT, 4, 1, 'fam_bundle: stopped\n'),
    (signal.SIGKILL, 4, -signal.SIGKILL, '')])
def test_no_process_is_left_when_a_command_is_ended(end, count, status, words, tmp_path):
    """As `kill`, Ctrl-C and `kill -9` do, while its processes start and when all are there."""
    script = tmp_path / 'command.py'
    script.write_text(COMMAND)
    command = subprocess.Popen(
        [sys.executable, str(script)], start_new_session=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
        # where tests run in the background Ctrl-C is ignored, and that is inherited
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    deadline = time.monotonic() + 60.0
    while len(processes(command.pid)) < count and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(processes(command.pid)) >= count
    os.kill(command.pid, end)
    _, said = command.communicate(timeout=60)
    # after a kill Python's own tracker may speak of semaphores; the command cannot speak any more
    assert (command.returncode, said if words else '') == (status, words)
    while processes(command.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not processes(command.pid)
