# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Files are written whole or not at all."""

import ast
import subprocess
import sys

import pytest

from fam_bundle_ros.atomic import whole, write_whole
from fam_bundle_ros.errors import InputError, system_errors

#: What writes files by itself, and why that is no result of a command.
OWN_WAYS = {
    'atomic.py': 'the one way', 'mcapfile.py': 'a bag grows, whole after every flush',
    'model/source.py': 'cache, beside and renamed', 'workbench/intake.py': 'scratch file',
    'nodes/fault_processes.py': 'scratch file', 'discovery/worker.py': 'a pipe',
    'nodes/live_feed.py': 'a pipe', 'benchmarks/speed_studies.py': 'scratch files',
    'processes.py': 'standard output',
}


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    """When writing breaks off, the old content stays and no draft is left behind."""
    path = tmp_path / 'result.json'
    write_whole(path, 'old')

    def break_off():
        with whole(path) as draft:
            draft.write_text('half')
            raise RuntimeError('power cut')

    with pytest.raises(RuntimeError):
        break_off()
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_of_the_system_is_told_with_path_reason_and_hint(tmp_path):
    """The sentence of the command line for a folder that cannot be made."""
    said = r'^results: cannot be made \(No such file or directory\); expected another$'
    with pytest.raises(InputError, match=said), \
            system_errors('results', 'cannot be made', '; expected another'):
        (tmp_path / 'missing' / 'results').mkdir()


def test_killed_writer_leaves_the_old_file(tmp_path):
    """SIGKILL in the middle of writing: the old content is there, whole."""
    path = tmp_path / 'result.json'
    write_whole(path, 'old')
    script = ("import os, signal, sys\n"
              "from fam_bundle_ros.atomic import whole\n"
              "with whole(sys.argv[1]) as draft:\n"
              "    draft.write_text('half')\n"
              "    os.kill(os.getpid(), signal.SIGKILL)\n")
    assert subprocess.run([sys.executable, '-c', script, str(path)]).returncode == -9
    assert path.read_text() == 'old'


def test_writing_where_nothing_can_be_written_fails(tmp_path):
    """A folder that is not there, or is a file, is a user's error that names the path."""
    with pytest.raises(InputError, match='absent'):
        write_whole(tmp_path / 'absent' / 'a.txt', 'x')


def written_by_hand(path):
    """Return the lines in which a module opens a file to write, or writes one."""
    lines = []
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
        modes = [each.value for each in (*node.args, *(k.value for k in node.keywords))
                 if isinstance(each, ast.Constant) and each.value in ('w', 'wb', 'x', 'xb', 'a')]
        if (name in ('open', 'fdopen') and modes) or name in ('write_text', 'write_bytes'):
            target = node.func.value if isinstance(node.func, ast.Attribute) else node.args[0]
            if getattr(target, 'id', '') != 'draft':
                lines.append(node.lineno)
    return lines


def test_every_result_goes_the_one_way(repository):
    """No module of the package writes a file but into a draft that is then renamed."""
    package = repository / 'fam_bundle_ros'
    found = {str(path.relative_to(package)): lines for path in sorted(package.rglob('*.py'))
             if (lines := written_by_hand(path))}
    assert {name: lines for name, lines in found.items() if name not in OWN_WAYS} == {}
