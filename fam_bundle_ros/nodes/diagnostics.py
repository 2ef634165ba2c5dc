# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Reports of the nodes on /diagnostics, once a second (REP-107)."""

from collections.abc import Callable
from dataclasses import dataclass, field
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode

OK = 0
WARN = 1
ERROR = 2


@dataclass
class Report:
    """State of a node: the worst level wins, its messages are joined."""

    level: int = OK
    messages: list[str] = field(default_factory=list)
    #: Key and value as tools show them.
    values: dict[str, str] = field(default_factory=dict)

    def add(self, level: int, message: str) -> None:
        """Add a message and its level."""
        if level > self.level:
            self.level = level
        self.messages.append(message)

    def value(self, key: str, value: Any, digits: int = 4) -> None:
        """Add a value; floats are shortened."""
        self.values[key] = f'{value:.{digits}g}' if isinstance(value, float) else str(value)


class Meter:
    """Measures rate, age and longest gap of messages between two reports."""

    def __init__(self) -> None:
        #: Steady time of the last tick, s.
        self.last: float | None = None
        self._count = 0
        self._longest = 0.0
        self._since = time.monotonic()
        #: Steady time of the message from which intervals are counted, s, and their number.
        self._first: float | None = None
        self._intervals = 0

    def tick(self) -> None:
        """Count a message."""
        now = time.monotonic()
        if self.last is not None:
            self._longest = max(self._longest, now - self.last)
            self._intervals += 1
        else:
            self._first = now
        self.last = now
        self._count += 1

    def report(self, report: Report, name: str, rate: float = 0.0) -> str:
        """
        Add rate (Hz), age and longest gap (s) to a report and reset the counters.

        Messages that come at less than half of ``rate`` (Hz; 0 for any) are a warning, as every
        second sample is missing; so are those at more than twice of it, which the computer may
        not keep up with. Return that as text, empty for none.
        """
        now = time.monotonic()
        other = ''
        if self._first is not None and self.last is not None and self.last > self._first:
            seen = self._intervals / (self.last - self._first)
            if rate > 0.0 and not 0.5 * rate <= seen <= 2.0 * rate:
                other = f'{name} comes at {seen:.0f} Hz, the parameter rate says {rate:g}'
                report.add(WARN, other)
        self._first, self._intervals = self.last, 0
        report.value(f'{name} rate', self._count / max(now - self._since, 1e-6))
        report.value(f'{name} age', 'never' if self.last is None else now - self.last)
        report.value(f'{name} longest gap', self._longest)
        self._count, self._longest, self._since = 0, 0.0, now
        return other


class Diagnostics:
    """
    Publishes a node's reports, which ``fill`` fills; messages that it refused are added.

    ``hardware`` is ``simulated`` or ``rig``, where the node knows.
    """

    def __init__(self, node: BundleNode, fill: Callable[[Report], None], hardware: str = ''):
        self._node = node
        self._fill = fill
        self._hardware = hardware
        self._publisher = node.publisher(interface.DIAGNOSTICS, DiagnosticArray)
        node.every(1.0, self.publish)

    def publish(self) -> None:
        """Publish a report now."""
        report = Report()
        self._fill(report)
        for topic, (count, why) in self._node.refused.items():
            report.add(WARN, f'{topic}: {count} refused: {why}')
        self._node.refused.clear()
        status = DiagnosticStatus(
            level=bytes([report.level]), name=self._node.get_fully_qualified_name()[1:],
            message='; '.join(report.messages) or 'OK', hardware_id=self._hardware,
            values=[KeyValue(key=key, value=value) for key, value in report.values.items()])
        message = DiagnosticArray(status=[status])
        message.header.stamp = interface.to_stamp(self._node.now_ns())
        self._publisher.publish(message)
