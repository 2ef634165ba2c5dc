# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A recording that is killed keeps what it heard."""

import subprocess
import sys

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


def test_sigkill_leaves_a_bag_up_to_the_last_second(graph, quiet, tmp_path):
    """`fam_bundle record` is killed: all that was on the disk by then opens, second by second."""
    graph.add(PlantSimulator(context=graph.context, overrides={
        **quiet, 'rate': 100.0, 'faults.drift': 'mu1/pressure=1e4'}))
    graph.spin()
    folder, seen = tmp_path / 'bag', [0]
    process = subprocess.Popen([sys.executable, '-m', 'fam_bundle_ros.cli', 'record',
                                str(folder)], stderr=subprocess.DEVNULL)

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
