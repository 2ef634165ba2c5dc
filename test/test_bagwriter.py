# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Bags can be read whenever they were flushed, by rosbags as by rosbag2's own format."""

from contextlib import closing
import resource
import struct
import subprocess
import sys

from hypothesis import given, settings, strategies
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from fam_bundle_ros.bagwriter import BagWriter
from fam_bundle_ros.errors import InputError

TYPES = get_typestore(Stores.ROS2_JAZZY)
BOOL, UINT8 = 'std_msgs/msg/Bool', 'std_msgs/msg/UInt8'


def raw(value):
    """Return a UInt8 in CDR."""
    return bytes(TYPES.serialize_cdr(TYPES.types[UINT8](value), UINT8))


def read(path):
    """Return (topic, stamp, value) of every message, and the reader's connections by topic."""
    with AnyReader([path], default_typestore=TYPES) as reader:
        messages = [(c.topic, stamp, reader.deserialize(data, c.msgtype).data)
                    for c, stamp, data in reader.messages()]
        return messages, {c.topic: c for c in reader.connections}


@given(strategies.lists(strategies.tuples(
    strategies.sampled_from('abc'), strategies.integers(0, 2**62), strategies.integers(0, 255),
    strategies.booleans()), min_size=1, max_size=30))
@settings(max_examples=25)
def test_bag_gives_back_what_was_written_in_order_of_time(tmp_path_factory, rows):
    """Whatever the stamps and wherever it was flushed, every message comes back."""
    folder = tmp_path_factory.mktemp('bags') / 'bag'
    with closing(BagWriter(folder)) as writer:
        for topic, stamp, value, flush in rows:
            writer.write(f'/{topic}', UINT8, stamp, raw(value))
            if flush:
                writer.flush()
    messages, connections = read(folder)
    assert sorted(messages) == sorted((f'/{t}', stamp, value) for t, stamp, value, _ in rows)
    assert [stamp for _, stamp, _ in messages] == sorted(stamp for _, stamp, _, _ in rows)
    assert {topic: c.msgcount for topic, c in connections.items()} == {
        f'/{t}': sum(row[0] == t for row in rows) for t in {row[0] for row in rows}}


def test_bag_on_a_disk_that_is_full_keeps_what_it_had(tmp_path):
    """A file that may not grow any more, as on a full disk; closing it changes nothing."""
    folder, limits = tmp_path / 'bag', resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = BagWriter(folder)
    for k in range(3):
        writer.write('/a', UINT8, k, raw(k))
    writer.flush()
    for k in range(3, 1000):
        writer.write('/a', UINT8, k, raw(k % 256))
    size = (folder / 'bag.mcap').stat().st_size
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 4000, limits[1]))
    try:
        with pytest.raises(OSError, match='large'):
            writer.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    writer.close()
    assert read(folder)[0] == [('/a', k, k) for k in range(3)]
    assert (folder / 'bag.mcap').stat().st_size == size


def test_bag_can_be_read_after_every_flush_while_it_is_written(tmp_path):
    """A reader beside the writer sees all up to the last flush, with types and QoS."""
    writer = BagWriter(tmp_path / 'bag')
    for k in range(5):
        writer.write('/a', UINT8, k, raw(k), latched=True)
        writer.flush()
        writer.write('/b', BOOL, k, bytes(TYPES.serialize_cdr(TYPES.types[BOOL](True), BOOL)))
        messages, connections = read(tmp_path / 'bag')
        assert [m for m in messages if m[0] == '/a'] == [('/a', i, i) for i in range(k + 1)]
        assert sum(m[0] == '/b' for m in messages) == k
        assert connections['/a'].ext.offered_qos_profiles[0].durability.name == 'TRANSIENT_LOCAL'
    writer.close()


def test_large_bag_flushes_itself(tmp_path):
    """What is lost is never more than a chunk, whoever forgets to flush."""
    writer = BagWriter(tmp_path / 'bag')
    for k in range(40):
        writer.write('/a', UINT8, k, raw(0) + bytes(100_000))
    with AnyReader([tmp_path / 'bag'], default_typestore=TYPES) as reader:
        assert 25 < sum(1 for _ in reader.messages()) < 40
    writer.close()


def test_file_alone_can_be_read_without_its_folder(tmp_path):
    """The mcap file has all that readers need, its summary at the place that the footer says."""
    with closing(BagWriter(tmp_path / 'bag')) as writer:
        writer.write('/a', UINT8, 7, raw(9))
    path = tmp_path / 'bag' / 'bag.mcap'
    assert read(path)[0] == [('/a', 7, 9)]
    data = path.read_bytes()
    start, offsets, _ = struct.unpack('<QQI', data[-28:-8])
    assert data[start] == 0x03
    assert data[offsets] == 0x0E


def test_file_is_one_run_of_records_however_often_it_was_flushed(tmp_path):
    """From its begin to its end: header, chunks with indexes, one end of data, one footer."""
    with closing(BagWriter(tmp_path / 'bag')) as writer:
        for k in range(4):
            writer.write('/a', UINT8, k, raw(k))
            writer.flush()
    data = (tmp_path / 'bag' / 'bag.mcap').read_bytes()
    place, operations = 8, []
    while place < len(data) - 8:
        operation, size = struct.unpack_from('<BQ', data, place)
        operations.append(operation)
        place += 9 + size
    assert place == len(data) - 8
    assert data[place:] == data[:8]
    assert operations[:9] == [1, 6, 7, 6, 7, 6, 7, 6, 7]
    assert (operations.count(0x0F), operations.count(0x02)) == (1, 1)
    assert operations[-1] == 0x02


def test_killed_writer_leaves_what_it_had_flushed(tmp_path):
    """SIGKILL right after more messages: those of the last flush and all before are there."""
    script = ("import os, signal, sys\n"
              "from fam_bundle_ros.bagwriter import BagWriter\n"
              "writer = BagWriter(sys.argv[1])\n"
              "raw = bytes.fromhex(sys.argv[2])\n"
              "for k in range(1000):\n"
              "    writer.write('/a', 'std_msgs/msg/UInt8', k, raw)\n"
              "    if k == 899:\n"
              "        writer.flush()\n"
              "os.kill(os.getpid(), signal.SIGKILL)\n")
    folder = tmp_path / 'bag'
    assert subprocess.run([sys.executable, '-c', script, str(folder), raw(5).hex()]
                          ).returncode == -9
    assert [stamp for _, stamp, _ in read(folder)[0]] == list(range(900))


def test_empty_bag_is_removed(tmp_path):
    """Without messages no folder is left that would stand in the way of the next try."""
    BagWriter(tmp_path / 'bag').close()
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_there_fails(tmp_path):
    """An old recording is never overwritten."""
    with pytest.raises(InputError, match='is there already'):
        BagWriter(tmp_path)
