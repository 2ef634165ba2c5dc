# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes ROS 2 bags (mcap) without ROS, by the package rosbags (extra ``tools``)."""

from pathlib import Path
import shutil
from typing import Any

from fam_bundle_ros.errors import InputError


class BagWriter:
    """
    A bag that is being written.

    Parameters
    ----------
    folder : path
        Must not exist yet.

    Raises
    ------
    InputError
        When rosbags is not installed or the folder is there already.
    """

    def __init__(self, folder: str | Path):
        try:
            from rosbags.rosbag2 import StoragePlugin, Writer
            from rosbags.typesys import get_typestore, Stores
        except ImportError:
            raise InputError('writing a bag needs the package rosbags: install the extra '
                             "'tools'") from None
        self.folder = Path(folder)
        if self.folder.exists():
            raise InputError(f'{folder}: is there already; expected the name of a new folder')
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._connections: dict[str, Any] = {}
        self._writer = Writer(self.folder, version=9, storage_plugin=StoragePlugin.MCAP)
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
            self._writer.open()
        except OSError as error:
            raise InputError(f'{folder}: cannot be written ({error.strerror})') from None
        #: Messages written so far.
        self.count = 0

    def write(self, name: str, kind: str, stamp: int, raw: bytes | memoryview,
              latched: bool = False) -> None:
        """
        Add a serialised message.

        Parameters
        ----------
        name : str
            Full name of the topic.
        kind : str
            Type, as in ``sensor_msgs/msg/JointState``.
        stamp : int, ns
        raw : bytes
            In CDR.
        latched : bool
            Offered with transient local durability when it is played back.
        """
        connection = self._connections.get(name)
        if connection is None:
            connection = self._connections[name] = self._writer.add_connection(
                name, kind, typestore=self._types, offered_qos_profiles=[_qos(latched)])
        self._writer.write(connection, stamp, raw)
        self.count += 1

    def close(self) -> None:
        """Finish the bag: without this it cannot be read. An empty one is removed."""
        self._writer.close()
        if not self.count:
            # We made the folder; left behind, it would stand in the way of the next try.
            shutil.rmtree(self.folder)


def _qos(latched: bool) -> Any:
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )
    forever = QosTime(2147483647, 4294967295)
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Qos(QosHistory.KEEP_LAST, 10, QosReliability.RELIABLE, durability, forever, forever,
               QosLiveliness.AUTOMATIC, forever, False)
