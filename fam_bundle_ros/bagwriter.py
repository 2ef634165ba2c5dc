# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Writes ROS 2 bags (mcap) without ROS; message definitions by the package rosbags (``tools``).

The bag is readable after every flush, even if the process is killed later.
"""

from pathlib import Path
import shutil
from typing import Any

import yaml

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.errors import InputError, system_errors
from fam_bundle_ros.extras import library
from fam_bundle_ros.mcapfile import McapFile

#: Size of pending messages, bytes, at which they are flushed automatically.
_LARGEST_CHUNK = 2 ** 20
_FOREVER = {'sec': 2147483647, 'nsec': 4294967295}
#: libyaml if available: metadata are written at every flush, which takes 0.1 s in plain Python.
_DUMPER = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


class BagWriter:
    """
    A bag that is being written.

    Parameters
    ----------
    folder : path
        Must not exist yet.
    name : str, optional
        Name of the file in it; that of the folder by default.

    Raises
    ------
    InputError
        When rosbags is not installed or the folder exists.
    """

    def __init__(self, folder: str | Path, name: str = ''):
        types = library('rosbags.typesys', 'writing a bag')
        self.folder = Path(folder)
        if self.folder.exists():
            raise InputError(f'{folder}: is there already; expected the name of a new folder')
        self._types = types.get_typestore(types.Stores.ROS2_JAZZY)
        #: Channel of each topic, and its entry in metadata.yaml.
        self._channels: dict[str, int] = {}
        self._topics: list[dict[str, Any]] = []
        self._flushed = -1
        #: Messages written so far.
        self.count = 0
        with system_errors(folder, 'cannot be written'):
            self.folder.mkdir(parents=True)
            self._name = f'{name or self.folder.name}.mcap'
            self._file = McapFile(self.folder / self._name, 'fam_bundle_ros')
            self.flush()

    def write(self, name: str, kind: str, stamp: int, raw: bytes | memoryview,
              latched: bool = False) -> None:
        """
        Add a serialised message, in CDR.

        ``name`` is the full name of the topic, ``kind`` its type, as in
        ``sensor_msgs/msg/JointState``; the stamp is in ns. A ``latched`` topic is played back with
        transient local durability.
        """
        channel = self._channels.get(name)
        if channel is None:
            channel = self._channels[name] = self._add(name, kind, latched)
        self._file.write(channel, stamp, raw)
        self.count += 1
        if self._file.pending > _LARGEST_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Write all pending messages to the file, with metadata."""
        if self._flushed == self.count:
            return
        self._flushed = self.count
        about = self._metadata()
        self._file.flush(_yaml(about))
        write_whole(self.folder / 'metadata.yaml', _yaml({'rosbag2_bagfile_information': about}))

    def close(self) -> None:
        """Finish the bag. An empty one is removed."""
        self.flush()
        self._file.close()
        if not self.count:
            # Remove the folder that we made: it would block the next attempt.
            shutil.rmtree(self.folder)

    def _add(self, name: str, kind: str, latched: bool) -> int:
        definition = self._types.generate_msgdef(kind, ros_version=2)[0]
        qos = [_qos(latched)]
        self._topics.append({
            'name': name, 'type': kind, 'serialization_format': 'cdr',
            'offered_qos_profiles': qos, 'type_description_hash': self._types.hash_rihs01(kind)})
        encoding = 'ros2idl' if definition.startswith('=' * 80 + '\nIDL: ') else 'ros2msg'
        return self._file.add_channel(name, kind, definition, encoding, {
            'offered_qos_profiles': _yaml(qos).strip()})

    def _metadata(self) -> dict[str, Any]:
        """Return the content of metadata.yaml, version 9 of rosbag2."""
        begin = {'nanoseconds_since_epoch': self._file.start}
        lasts = {'nanoseconds': self._file.end - self._file.start}
        return {
            'version': 9, 'storage_identifier': 'mcap', 'relative_file_paths': [self._name],
            'duration': lasts, 'starting_time': begin, 'message_count': self.count,
            'topics_with_message_count': [
                {'topic_metadata': topic,
                 'message_count': self._file.counts[self._channels[topic['name']]]}
                for topic in self._topics],
            'compression_format': '', 'compression_mode': '',
            'files': [{'path': self._name, 'starting_time': begin, 'duration': lasts,
                       'message_count': self.count}],
            'custom_data': None, 'ros_distro': 'jazzy'}


def _yaml(content: Any) -> str:
    return str(yaml.dump(content, Dumper=_DUMPER, sort_keys=False))


def _qos(latched: bool) -> dict[str, Any]:
    """Return the quality of service that is offered when the bag is played back."""
    return {
        'history': 'keep_last', 'depth': 10, 'reliability': 'reliable',
        'durability': 'transient_local' if latched else 'volatile', 'deadline': dict(_FOREVER),
        'lifespan': dict(_FOREVER), 'liveliness': 'automatic',
        'liveliness_lease_duration': dict(_FOREVER), 'avoid_ros_namespace_conventions': False}
