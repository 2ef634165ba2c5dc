# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The dynamometer of the simulated rig, moved by messages on ``reference/dynamometer``."""

import math
import time

from sensor_msgs.msg import JointState

from fam_bundle_ros.control import Reference
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.references import MovingReference
from fam_bundle_ros.plant import Dynamometer, Rig

#: s without a message after which a profile moves the dynamometer again.
_SILENT = 1.0


class ImposedStrain:
    """
    Moves the dynamometer to the strain of the last message, then at its rate until the next.

    ``node`` is the simulator; messages are refused while the load of its rig is no dynamometer.
    """

    def __init__(self, node: BundleNode, rig: Rig):
        self._node, self._rig = node, rig
        self._reference = MovingReference()
        self._now = 0.0
        self._taken, self._away = -math.inf, False
        node.subscribe(interface.REFERENCE_DYNAMOMETER, JointState, self._take)

    def _take(self, message: JointState) -> None:
        strain, rate = interface.read_strain(message, self._rig.length)
        if not isinstance(self._rig.load, Dynamometer):
            raise InputError(f'the load is a {type(self._rig.load).__name__}; only load.kind '
                             'dynamometer imposes a strain')
        # Raises for a strain beyond the dynamometer's stops.
        Dynamometer(strain)
        rate = rate if abs(rate) <= self._node.p['load.speed'] else 0.0
        self._reference.take(Reference('strain', strain, rate), self._time())
        self._taken, self._away = self._time(), True

    def forget(self) -> None:
        """Drop the reference: the dynamometer stays where it is."""
        self._reference = MovingReference()
        self._taken = -math.inf

    @property
    def obeyed(self) -> bool:
        """Whether messages move the dynamometer at present, instead of a profile."""
        return self._time() - self._taken < _SILENT

    def follow(self, target: float, period: float) -> None:
        """Follow a profile; return to it at ``load.speed`` at most after messages ended."""
        rate = abs(target - self._rig.truth.strain) / period
        if self._away:
            self.forget()
            self._away = rate > self._node.p['load.speed']
            rate = min(rate, self._node.p['load.speed'])
        self._rig.impose_strain(target, rate)

    def before(self, period: float) -> None:
        """Move the dynamometer to where it must be after the next step of the rig."""
        self._now += period
        wanted = self._reference.at(self._time() + (0.0 if self._node.lock_step else period))
        if wanted is None:
            return
        low, high = Dynamometer.stops
        target = min(max(wanted.value, low), high)
        away = abs(target - self._rig.truth.strain)
        if away > 0.0:
            self._rig.impose_strain(target, min(away / period, self._node.p['load.speed']))

    def _time(self) -> float:
        return self._now if self._node.lock_step else time.monotonic()
