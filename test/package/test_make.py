# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""When ``make`` cannot do its work it says in one line what to do."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

TOOLS = ('make', 'sh', 'awk', 'cat', 'cksum', 'grep', 'mkdir', 'rm', 'rmdir', 'sed', 'tail', 'tr')
FILES = ('Makefile', 'requirements.txt', 'requirements-ubuntu.txt', 'setup.cfg', 'setup.py')


@pytest.fixture
def tree(repository, tmp_path):
    """Return a folder with what ``make install`` reads and a PATH folder without any Python."""
    root = tmp_path / 'tree'
    (root / 'bin').mkdir(parents=True)
    for name in FILES:
        shutil.copy(repository / name, root)
    shutil.copytree(repository / 'scripts', root / 'scripts')
    for tool in TOOLS:
        (root / 'bin' / tool).symlink_to(shutil.which(tool))
    return root


def add_python(tree, name, script):
    """Put an executable shell script of the given name on the tree's PATH."""
    path = tree / 'bin' / name
    path.write_text(f'#!/bin/sh\n{script}\n')
    path.chmod(0o755)
    return path


def add_working_python(tree):
    """Put the interpreter of this test on the tree's PATH as python3."""
    (tree / 'bin' / 'python3').symlink_to(getattr(sys, '_base_executable', sys.executable))


def make_install(tree, *arguments, **environment):
    """Run ``make install`` in the tree; return its status and its lines."""
    run = subprocess.run(
        ['make', 'install', *arguments], cwd=tree, capture_output=True, text=True, timeout=100,
        env={'PATH': str(tree / 'bin'), 'HOME': str(tree), 'PIP_CONFIG_FILE': os.devnull,
             'PIP_INDEX_URL': 'http://127.0.0.1:9/simple', 'PIP_NO_CACHE_DIR': '1',
             **environment},
    )
    lines = (run.stdout + run.stderr).splitlines()
    return run.returncode, [line for line in lines if line.startswith('fam_bundle_ros: ')]


def test_no_python_fails(tree):
    """Without any Python one line says which to install."""
    status, lines = make_install(tree)
    assert status != 0
    assert len(lines) == 1
    assert 'Python 3.11 or 3.12 is needed, found none that runs' in lines[0]
    assert 'apt install' in lines[0]


def test_wrong_python_fails(tree):
    """A Python that is too new is named, with what to install."""
    add_python(tree, 'python3', 'case $1 in -V) echo Python 3.13.0;; *) exit 1;; esac')
    status, lines = make_install(tree)
    assert status != 0
    assert len(lines) == 1
    assert 'Python 3.11 or 3.12 is needed, found Python 3.13.0' in lines[0]


def test_wrong_python_named_by_the_user_fails(tree):
    """``make PYTHON=...`` with a wrong version does not fall back on another in silence."""
    add_working_python(tree)
    old = add_python(tree, 'old', 'case $1 in -V) echo Python 3.9.2;; *) exit 1;; esac')
    status, lines = make_install(tree, f'PYTHON={old}')
    assert status != 0
    assert len(lines) == 1
    assert 'found Python 3.9.2' in lines[0]


def test_python_without_venv_fails(tree):
    """Debian's Python without its venv package is answered with the package's name."""
    add_python(tree, 'python3', 'case "$2" in *ensurepip*) exit 1;; *print*) echo python3.12;; '
                                'esac')
    status, lines = make_install(tree)
    assert status != 0
    assert len(lines) == 1
    assert "'sudo apt install python3.12-venv'" in lines[0]


def test_a_half_made_venv_is_made_again_and_without_a_network_that_is_told(tree):
    """
    What an interrupted install left is replaced; one line names the index and what to check.

    A python3.12 that is on PATH but does not start gives way to a python3 that does.
    """
    add_python(tree, 'python3.12', 'echo "python3.12: not installed" >&2; exit 127')
    add_working_python(tree)
    left_over = Path(tree, '.venv', 'lib', 'left_over')
    left_over.mkdir(parents=True)
    Path(tree, '.venv', 'pyvenv.cfg').write_text('home = /nowhere\n')
    status, (found, made, *_, last) = make_install(tree)
    assert 'half made' in found
    assert not left_over.exists()
    assert made.startswith(f'fam_bundle_ros: making .venv with {tree}/bin/python3 (3.')
    assert status != 0
    assert 'pip cannot reach the package index: check the network' in last
    assert not (tree / '.venv' / '.complete').exists()


def test_something_else_named_venv_is_left_alone(tree):
    """A .venv that is no virtual environment is not deleted but named."""
    add_working_python(tree)
    precious = Path(tree, '.venv', 'notes.txt')
    precious.parent.mkdir()
    precious.write_text('mine')
    status, lines = make_install(tree)
    assert status != 0
    assert 'move it away' in lines[0]
    assert precious.read_text() == 'mine'


def test_ros_distro_without_ros_fails(tree):
    """With ROS_DISTRO set but no rclpy to be found, one line says what to source."""
    add_working_python(tree)
    status, lines = make_install(tree, ROS_DISTRO='jazzy')
    assert status != 0
    assert 'finds no rclpy: source /opt/ros/jazzy/setup.sh' in lines[-1]
    assert not (tree / '.venv').exists()


def test_a_complete_venv_is_left_alone(repository):
    """A second ``make install`` does nothing and says nothing."""
    if Path(sys.prefix) != repository / '.venv':
        pytest.skip('this test runs only from the .venv that make makes')
    environment = {k: v for k, v in os.environ.items() if k not in ('MAKEFLAGS', 'MAKELEVEL')}
    run = subprocess.run(['make', 'install'], cwd=repository, capture_output=True, text=True,
                         env=environment, timeout=100)
    assert (run.returncode, run.stdout) == (0, '')
