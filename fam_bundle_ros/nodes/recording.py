# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Records the topics of the interface into a bag (mcap), byte for byte as they were sent.

Needs the package rosbags (extra ``tools``), not rosbag2.
"""

from collections.abc import Callable, Iterable
from contextlib import closing, ExitStack
from functools import partial
from pathlib import Path
import struct
import time
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from fam_bundle_ros.bagwriter import BagWriter
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.interface import Topic
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals

#: Time-out of `record` for the first topic, s.
_PATIENCE = 10.0
#: Period of writing to the disk, s: a killed process loses no more than this.
FLUSH = 0.5
#: Depth of the queue of a topic; a full queue drops its oldest message.
_DEPTH = 200
#: Delay of the recorder that may lose messages, s: `_DEPTH` messages at 200 Hz.
_HELD_UP = 1.0


class Recorder(BundleNode):
    """
    Subscribes to topics and writes their messages.

    Messages with a header are recorded at their own stamp, others at the newest stamp received,
    so that in lock-step the bag of a run is reproducible. Keywords as of `BundleNode`.
    """

    def __init__(self, writer: BagWriter, **keywords: Any):
        super().__init__('recorder', (), **keywords)
        self._writer = writer
        self._newest = 0
        #: Why nothing is written any more, as when the disk is full; empty while all is well.
        self.failure = ''
        # Written to the disk regularly, in case this process is killed.
        self.every(FLUSH, lambda: self._write(writer.flush))
        #: Full names of the topics that are recorded.
        self.recorded: set[str] = set()

    def add(self, topics: Iterable[Topic], qos: QoSProfile | None = None) -> None:
        """Record topics, with a QoS that suits ours or the given one."""
        for topic in topics:
            name = self.resolve_topic_name(topic.name)
            if name in self.recorded:
                continue
            self.recorded.add(name)
            headed = 'header' in topic.type.get_fields_and_field_types()

            def take(raw: bytes, name: str = name, topic: Topic = topic,
                     headed: bool = headed) -> None:
                self._write(partial(self._writer.write, name, topic.type_name,
                                    self._stamp(raw, headed), raw, topic.latched))
            self.create_subscription(
                topic.type, topic.name, take,
                qos or (interface.LATCHED if topic.latched else interface.LOCK_STEP), raw=True)

    def discover(self) -> None:
        """Record the topics of the interface that are on the graph and not recorded yet."""
        known = {self.resolve_topic_name(topic.name): topic
                 for topic in interface.topics(interface.MOST_UNITS)}
        for name, types in self.get_topic_names_and_types():
            topic = known.get(name)
            if topic is None or name in self.recorded or topic.type_name not in types:
                continue
            offers = [info.qos_profile for info in self.get_publishers_info_by_topic(name)]
            if offers:
                self.add([topic], matching_qos(offers))

    def _write(self, action: Callable[[], None]) -> None:
        if self.failure:
            return
        try:
            action()
        except OSError as error:
            self.failure = f'{self._writer.folder}: cannot be written any more ({error.strerror})'
            self.get_logger().error(self.failure)

    def _stamp(self, raw: bytes, headed: bool) -> int:
        stamp = 0
        if headed:
            # CDR: 4 bytes with the byte order, then the header, which begins with the stamp.
            sec, nanosec = struct.unpack_from('<iI' if raw[1] & 1 else '>iI', raw, 4)
            stamp = sec * 1_000_000_000 + nanosec
        self._newest = max(self._newest, stamp)
        return stamp or self._newest or time.time_ns()


def matching_qos(offers: Iterable[QoSProfile]) -> QoSProfile:
    """Return the most reliable QoS that is compatible with all these publishers."""
    offers = list(offers)
    reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offers)
    latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
    return QoSProfile(
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE))


def record(folder: str | Path, seconds: float | None = None,
           namespace: str = interface.NAMESPACE, domain: int | None = None,
           progress: Callable[[float, int], None] | None = None) -> int:
    """
    Record a bundle that runs elsewhere, until the time is over or Ctrl-C.

    Parameters
    ----------
    folder : path
        New folder for the bag.
    seconds : float, optional
        From the first message on.
    namespace : str
    domain : int, optional
        ROS domain; that of the environment by default.
    progress : callable, optional
        Called with seconds and messages so far, a few times a second.

    Returns
    -------
    int
        Number of messages.

    Raises
    ------
    InputError
        When no topic of the interface is found within 10 s, or the disk is full.
    """
    with ExitStack() as ending:
        context = ending.enter_context(ros_context(domain))
        writer = ending.enter_context(closing(BagWriter(folder)))
        node = Recorder(writer, context=context, namespace=namespace)
        spinner = ending.enter_context(closing(Spinner(context, [node])))
        signals = ending.enter_context(StopSignals())
        begin = time.monotonic()
        heard: float | None = None
        now = begin
        while not signals.received:
            before = now
            node.discover()
            spinner.spin(0.25)
            if node.failure:
                raise InputError(node.failure)
            now = time.monotonic()
            if heard is not None and now - before > _HELD_UP:
                node.get_logger().warning(
                    f'held up from {before - heard:.1f} to {now - heard:.1f} s of the recording: '
                    'sensor readings of that time may be missing')
            if heard is None:
                # Discovery takes seconds and is not part of the recording.
                heard = now if writer.count else None
                if heard is None and now - begin > _PATIENCE:
                    raise InputError(f'no topics of a bundle under {node.get_namespace()}; '
                                     'is the rig running, in this ROS domain?')
                continue
            if progress:
                progress(now - heard, writer.count)
            if seconds is not None and now - heard >= seconds:
                break
        return writer.count
