# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A recording that is killed keeps what it heard; one that is held up says so."""

import re
import resource
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from fam_bundle_ros.data.bagfile import read_bag
from fam_bundle_ros.nodes import recording
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator


def forces(folder):
    """Return how many forces are in a bag; 0 where there is none yet."""
    if not (folder / 'metadata.yaml').is_file():
        return 0
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        wanted = [c for c in reader.connections if c.topic == '/bundle/force']
        return sum(1 for _ in reader.messages(connections=wanted)) if wanted else 0


def growing(folder):
    """Return the same of a bag that may be written at this very moment."""
    try:
        return forces(folder)
    except Exception:  # read in the middle of a write any byte is half of another
        return 0


def recording_of(graph, quiet, folder, **options):
    """Return a process that records a simulated rig of the graph into a folder."""
    graph.add(PlantSimulator(context=graph.context, overrides={
        **quiet, 'rate': 100.0, 'faults.drift': 'mu1/pressure=1e4'}))
    graph.spin()
    return subprocess.Popen([sys.executable, '-m', 'fam_bundle_ros', 'record', str(folder)],
                            stderr=subprocess.PIPE, text=True, **options)


def test_sigkill_leaves_a_bag_up_to_the_last_second(graph, quiet, tmp_path):
    """`fam_bundle record` is killed: all that was on the disk by then opens, second by second."""
    folder, seen = tmp_path / 'bag', [0]
    process = recording_of(graph, quiet, folder)

    def more_than(count):
        seen.append(growing(folder))
        return seen[-1] > count
    try:
        graph.until(lambda: more_than(0), 'a recording with forces')
        first = seen[-1]
        # It grows while it is written, without an end.
        graph.until(lambda: more_than(first + 60), 'more')
    finally:
        process.kill()
        process.wait()
    assert forces(folder) >= max(seen)
    assert len(read_bag(folder)) > 50
    # What a busy machine adds to this is not ours.
    assert recording.FLUSH < 1.0


def test_a_recording_that_was_held_up_warns_of_it(graph, quiet, tmp_path):
    """For 1.5 s its process does not run (a busy disk, a laptop's lid): when, is on stderr."""
    folder = tmp_path / 'bag'
    process = recording_of(graph, quiet, folder)
    try:
        graph.until(lambda: growing(folder) > 60, 'a recording with forces')
        process.send_signal(signal.SIGSTOP)
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            graph.spin()
        process.send_signal(signal.SIGCONT)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, errors
    begin, last = map(float, re.search(r'held up from ([\d.]+) to ([\d.]+) s', errors).groups())
    assert last - begin > 1.4


def test_a_recording_on_a_full_disk_ends_with_one_line(graph, quiet, tmp_path):
    """Files that may not grow are refused by the system like those on a full disk."""
    process = recording_of(graph, quiet, tmp_path / 'bag', preexec_fn=lambda: resource.setrlimit(
        resource.RLIMIT_FSIZE, (100_000, 100_000)))
    try:
        graph.until(lambda: process.poll() is not None, 'the end of the recording')
        errors = process.stderr.read()
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 2, errors
    assert errors.splitlines()[-1].endswith('bag: cannot be written any more (File too large)')
    assert 'Exception' not in errors
    assert 'Error occurred' not in errors
