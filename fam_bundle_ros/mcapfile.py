# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Writes an MCAP file that is complete after every flush, even if the process is killed later.

The format: https://mcap.dev/spec. Messages are collected in a chunk. A flush overwrites the end of
the file (summary and footer) with the chunk and a new end, in one write: after a kill the file has
all messages up to the last flush, with an index.
"""

from collections.abc import Mapping
from pathlib import Path
import struct
import zlib

_MAGIC = b'\x89MCAP0\r\n'
(_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX) = range(1, 9)
_STATISTICS, _METADATA, _METADATA_INDEX, _SUMMARY_OFFSET, _DATA_END = range(0x0B, 0x10)


def _text(value: str) -> bytes:
    data = value.encode()
    return struct.pack('<I', len(data)) + data


def _map(values: Mapping[str, str]) -> bytes:
    data = b''.join(_text(key) + _text(value) for key, value in values.items())
    return struct.pack('<I', len(data)) + data


def _record(operation: int, *parts: bytes) -> bytes:
    body = b''.join(parts)
    return struct.pack('<BQ', operation, len(body)) + body


class McapFile:
    """
    An MCAP file that is being written.

    Parameters
    ----------
    path : path
        Must not exist yet.
    library : str
        Name of the writing software.

    Attributes
    ----------
    counts : dict of int to int
        Number of messages of each channel.
    start, end : int, ns
        First and last time of a message; 0 without messages.
    """

    def __init__(self, path: Path, library: str):
        self._file = path.open('xb', buffering=0)
        self._schemas: dict[str, int] = {}
        #: Records of schemas and channels: in the chunk of their first use, and in the summary.
        self._schema_records: list[bytes] = []
        self._channel_records: list[bytes] = []
        self._chunk_indexes: list[bytes] = []
        self._chunk = bytearray()
        #: Time and place in the chunk of each message, by channel.
        self._places: dict[int, list[tuple[int, int]]] = {}
        self.counts: dict[int, int] = {}
        self.start = self.end = 0
        self._any = False
        head = _MAGIC + _record(_HEADER, _text('ros2'), _text(library))
        self._file.write(head)
        #: Offset of the next chunk in the file, and what the file has from there on.
        self._offset, self._ending = len(head), b''

    @property
    def pending(self) -> int:
        """Size of the messages that are not flushed yet, bytes."""
        return len(self._chunk)

    def add_channel(self, topic: str, schema: str, definition: str, encoding: str,
                    metadata: Mapping[str, str]) -> int:
        """Add a topic with messages in CDR of a schema; return its channel."""
        if schema not in self._schemas:
            self._schemas[schema] = len(self._schemas) + 1
            self._schema_records.append(_record(
                _SCHEMA, struct.pack('<H', self._schemas[schema]), _text(schema),
                _text(encoding), _text(definition)))
            self._chunk += self._schema_records[-1]
        channel = len(self._channel_records) + 1
        self._channel_records.append(_record(
            _CHANNEL, struct.pack('<HH', channel, self._schemas[schema]), _text(topic),
            _text('cdr'), _map(metadata)))
        self._chunk += self._channel_records[-1]
        self.counts[channel] = 0
        return channel

    def write(self, channel: int, time: int, data: bytes | memoryview) -> None:
        """Add a message with its time, ns."""
        if not self._any:
            self._any, self.start, self.end = True, time, time
        self.start, self.end = min(self.start, time), max(self.end, time)
        self._places.setdefault(channel, []).append((time, len(self._chunk)))
        self._chunk += _record(_MESSAGE, struct.pack('<HIQQ', channel, 0, time, time), bytes(data))
        self.counts[channel] += 1

    def flush(self, metadata: str) -> None:
        """
        Write all pending messages to the file; ``metadata`` is for rosbag2.

        Raises
        ------
        OSError
            The disk is full, for instance; the file is as after the flush before.
        """
        chunk = self._close_chunk()
        tail = self._tail(self._offset + len(chunk), metadata)
        try:
            self._put(chunk + tail)
        except OSError:
            self._file.truncate(self._offset)
            self._put(self._ending)
            raise
        self._offset, self._ending = self._offset + len(chunk), tail

    def _put(self, data: bytes) -> None:
        """Write at the offset of the next chunk."""
        self._file.seek(self._offset)
        written = 0
        while written < len(data):
            written += self._file.write(memoryview(data)[written:])

    def close(self) -> None:
        """Close the file without a flush."""
        self._file.close()

    def _close_chunk(self) -> bytes:
        """Return the chunk with the index of its messages, and start a new one."""
        if not self._chunk:
            return b''
        times = [time for places in self._places.values() for time, _ in places]
        span = struct.pack('<QQ', min(times, default=0), max(times, default=0))
        size = struct.pack('<Q', len(self._chunk))
        chunk = _record(_CHUNK, span, size, struct.pack('<I', zlib.crc32(self._chunk)), _text(''),
                        size, bytes(self._chunk))
        indexes, offsets = b'', []
        for channel, places in self._places.items():
            offsets.append(struct.pack('<HQ', channel, self._offset + len(chunk) + len(indexes)))
            indexes += _record(
                _MESSAGE_INDEX, struct.pack('<HI', channel, 16 * len(places)),
                b''.join(struct.pack('<QQ', time, place) for time, place in places))
        self._chunk_indexes.append(_record(
            _CHUNK_INDEX, span, struct.pack('<QQI', self._offset, len(chunk), 10 * len(offsets)),
            *offsets, struct.pack('<Q', len(indexes)), _text(''), size, size))
        self._chunk.clear()
        self._places.clear()
        return chunk + indexes

    def _tail(self, begin: int, metadata: str) -> bytes:
        """Return the end of a file whose chunks end at ``begin``."""
        about = _record(_METADATA, _text('rosbag2'), _map({'serialized_metadata': metadata}))
        tail = about + _record(_DATA_END, struct.pack('<I', 0))
        summary = begin + len(tail)
        counts = b''.join(struct.pack('<HQ', *item) for item in self.counts.items())
        groups = (
            (_SCHEMA, b''.join(self._schema_records)),
            (_CHANNEL, b''.join(self._channel_records)),
            (_CHUNK_INDEX, b''.join(self._chunk_indexes)),
            (_METADATA_INDEX, _record(_METADATA_INDEX, struct.pack('<QQ', begin, len(about)),
                                      _text('rosbag2'))),
            (_STATISTICS, _record(_STATISTICS, struct.pack(
                '<QHIIIIQQI', sum(self.counts.values()), len(self._schemas), len(self.counts), 0,
                1, len(self._chunk_indexes), self.start, self.end, len(counts)), counts)))
        places = []
        for operation, records in groups:
            if records:
                places.append(_record(_SUMMARY_OFFSET, struct.pack(
                    '<BQQ', operation, begin + len(tail), len(records))))
                tail += records
        offsets = begin + len(tail)
        return (tail + b''.join(places)
                + _record(_FOOTER, struct.pack('<QQI', summary, offsets, 0)) + _MAGIC)
