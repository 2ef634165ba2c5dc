# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Kernels run as plain Python and compiled, on the same records, with the same numbers."""

from dataclasses import dataclass
import os
import subprocess
import sys

import pytest

from fam_bundle_ros import kernels

needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
RATE = 0.5


@dataclass
class Valve:
    opening: float


@dataclass
class Chamber:
    pressure: float
    flow: list
    steps: int
    open: bool
    valve: Valve


def chamber():
    """Return a chamber with a valve half open."""
    return Chamber(2.0, [1.0, -0.25], 0, False, Valve(0.5))


def helper(state, i):
    """Let one flow act."""
    state.pressure += RATE * state.valve.opening * state.flow[i]


def kernel(state, count):
    """Let all flows act and fade."""
    for _ in range(count):
        for i in range(2):
            helper(state, i)
            state.flow[i] *= 0.9
        state.steps += 1
    state.open = state.pressure > 1.0
    return state.pressure


def test_a_record_returns_to_the_instance_it_was_packed_from():
    """Packing and unpacking loses no field, nested or not."""
    full, empty = chamber(), Chamber(0.0, [0.0, 0.0], 7, True, Valve(0.0))
    kernels.unpack(kernels.pack(full), empty)
    assert empty == full


def test_a_record_of_text_is_refused():
    """Only numbers can be packed; the field's class is named."""
    with pytest.raises(TypeError, match='Valve'):
        kernels.pack(Valve('wide'))


@needs_numba
def test_compiled_and_plain_kernels_change_their_records_alike():
    """A kernel that calls another one gives the same numbers on a record and on a dataclass."""
    plain, packed = chamber(), chamber()
    record = kernels.pack(packed)
    assert kernels.compiled(kernel)(record, 5) == pytest.approx(kernel(plain, 5), rel=1e-15)
    kernels.unpack(record, packed)
    assert packed == plain


@needs_numba
def test_the_fingerprint_follows_the_kernels_that_are_called(monkeypatch):
    """Changed code or constants of a called kernel must not find old compiled code."""
    before = kernels.fingerprint(kernel)
    monkeypatch.setitem(kernel.__globals__, 'RATE', 0.6)
    assert kernels.fingerprint(kernel) != before


@needs_numba
def test_a_kernel_of_a_file_without_a_module_name_is_found_in_the_cache(tmp_path):
    """A user's file is no module that the next process can import; its compiled code loads."""
    (tmp_path / 'own.py').write_text('def kernel(x):\n    return 2.0 * x\n')
    (tmp_path / 'run.py').write_text(
        'import importlib.util\n'
        'from fam_bundle_ros import kernels\n'
        'spec = importlib.util.spec_from_file_location("only_here", "own.py")\n'
        'own = importlib.util.module_from_spec(spec)\n'
        'spec.loader.exec_module(own)\n'
        'fast = kernels.compiled(own.kernel)\n'
        'print(fast(1.5), sum(fast.stats.cache_hits.values()))\n')
    shown = [subprocess.run(
        [sys.executable, 'run.py'], cwd=tmp_path, capture_output=True, text=True, check=True,
        env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)}).stdout.split() for _ in range(2)]
    assert shown == [['3.0', '0'], ['3.0', '1']]


@needs_numba
def test_processes_that_start_together_compile_once(tmp_path):
    """The second waits for the first and loads what it has compiled."""
    (tmp_path / 'own.py').write_text('def kernel(x):\n    return 2.0 * x\n')
    (tmp_path / 'run.py').write_text(
        'import sys\n'
        'from fam_bundle_ros import kernels\n'
        'import own\n'
        'fast = kernels.compiled(own.kernel)\n'
        'print("ready", flush=True)\n'
        'sys.stdin.readline()\n'
        'print(fast(1.5), sum(fast.stats.cache_hits.values()))\n')
    both = [subprocess.Popen(
        [sys.executable, 'run.py'], cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True, env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)}) for _ in range(2)]
    for process in both:
        assert process.stdout.readline() == 'ready\n'
    for process in both:
        process.stdin.write('\n')
        process.stdin.flush()
    assert sorted(process.communicate()[0] for process in both) == ['3.0 0\n', '3.0 1\n']


@needs_numba
def test_what_two_processes_compiled_for_two_sizes_of_records_works_in_a_third(tmp_path):
    """Of two and of three units: neither is taken for the other."""
    # of a length at which it does not become part of what calls it
    long = 40 * '        units.pressure[i] += math.sin(units.pressure[i])\n'
    (tmp_path / 'run.py').write_text(
        'import math, sys\n'
        'from dataclasses import dataclass\n'
        'from fam_bundle_ros import kernels\n'
        '@dataclass\n'
        'class Units:\n'
        '    pressure: list\n'
        '    steps: int\n'
        'def helper(units):\n'
        '    for i in range(len(units.pressure)):\n'
        + long +
        '    units.steps += 1\n'
        'def kernel(units):\n'
        '    helper(units)\n'
        '    helper(units)\n'
        'for n in sys.argv[1]:\n'
        '    units = kernels.pack(Units([1.0] * int(n), 4))\n'
        '    kernels.compiled(kernel)(units)\n'
        '    print((units["pressure"] == math.pi).sum(), units["steps"])\n')
    shown = [subprocess.run(
        [sys.executable, 'run.py', units], cwd=tmp_path, capture_output=True, text=True,
        check=True, env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)}).stdout
        for units in ('2', '3', '23', '32')]
    assert shown == ['2 6\n', '3 6\n', '2 6\n3 6\n', '3 6\n2 6\n']
