# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads and checks the topics ``reference/...`` of the recruitment controller."""

from collections.abc import Callable
import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from fam_bundle_ros.control import Reference
from fam_bundle_ros.control.direct import DirectPressures
from fam_bundle_ros.control.reference_rate import FULL_STRAIN, ReferenceRate
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import Meter, Report, WARN
from fam_bundle_ros.nodes.recruitment_parameters import force_limits
from fam_bundle_ros.units import FASTEST

#: A change between two references above this share of the range is a step.
_STEP = 0.02


class ReferenceIntake:
    """
    Listens to references of force, strain and pressures.

    ``take`` is called with stamp (ns) and `Reference` of each valid message. The bundle tells
    length, largest pressures and blocked force.
    """

    def __init__(self, node: BundleNode, bundle: Bundle, take: Callable[[int, Reference], None]):
        self._node = node
        self._take = take
        self._units = bundle.n
        self._length = bundle.length
        self._pressures = DirectPressures(bundle)
        self._forces = force_limits(bundle.largest_force, node.p['force_low'],
                                    node.p['force_high'])
        self._force_rate = ReferenceRate(_STEP * bundle.largest_force)
        self._strain_rate = ReferenceRate(_STEP * FULL_STRAIN)
        #: Rate and age of the valid messages.
        self.meter = Meter()
        self._kind = ''
        #: Kinds before and after each change since the last report.
        self._changes: list[tuple[str, str]] = []
        for topic, kind, read in (
                (interface.REFERENCE_FORCE, WrenchStamped, self._force),
                (interface.REFERENCE_STRAIN, JointState, self._strain),
                (interface.REFERENCE_PRESSURES, JointState, self._pressure)):
            node.subscribe(topic, kind, self._reader(read))

    def report(self, report: Report) -> None:
        """Add rate and age, and a warning of changes of their kind."""
        self.meter.report(report, 'reference')
        if len(self._changes) > 1:
            report.add(WARN, f'references changed {len(self._changes)} times between '
                       + ' and '.join(sorted(self._changes[-1])))
        self._changes = []

    def _reader(self, read: Callable[[Any, float], Reference]) -> Callable[[Any], None]:
        """Return a callback that reads references, and notes changes of their kind."""
        def callback(message: Any) -> None:
            stamp = interface.stamp_ns(message.header.stamp)
            # `ros2 topic pub` and short programs leave the stamp at 0.
            time = 1e-9 * (stamp or self._node.get_clock().now().nanoseconds)
            reference = read(message, time)
            self.meter.tick()
            if reference.kind != self._kind != '':
                self._changes.append((self._kind, reference.kind))
            self._kind = reference.kind
            self._take(stamp, reference)
        return callback

    def _force(self, message: WrenchStamped, time: float) -> Reference:
        value, (low, high) = interface.read_force(message), self._forces
        if not low <= value <= high:
            # Reached, it would be taken for a broken load cell.
            raise InputError(f'reference is {value:g} N; expected {low:g} to {high:g} N '
                             '(force_low, force_high)')
        return Reference('force', value, self._force_rate.update(time, value))

    def _strain(self, message: JointState, time: float) -> Reference:
        value, rate = interface.read_strain(message, self._length)
        if math.isnan(rate):
            rate = self._strain_rate.update(time, value)
        if not abs(rate) <= FASTEST:
            raise InputError(f'reference moves at {rate:g} 1/s; expected a size up to '
                             f'{FASTEST:g}')
        if not abs(value) <= 1.0:
            raise InputError(f'reference is {value:g}; expected a size up to 1')
        return Reference('strain', value, rate)

    def _pressure(self, message: JointState, time: float) -> Reference:
        reference = Reference('pressure', pressure=interface.read_pressures(message, self._units))
        self._pressures.checked(reference)
        return reference
