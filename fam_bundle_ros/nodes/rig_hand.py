# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Valve control of `check-rig --active`: answers each reading, records both, vents at the end.

Every pressure reading is answered with the command of its motor unit, as the pressure loops do. A
reading beyond its limit, or silence, vents everything in the same callback.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import math
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.context import Context
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.process import Spinner
from fam_bundle_ros.nodes.supply_enable import PERIOD

#: Time without a reading after which a pressure is lost, s.
_SILENCE = 0.25
#: Longest duration of one spin, s.
_SLICE = 0.01
#: Time for the last messages to reach the driver, s.
_FAREWELL = 0.3
#: Largest slow-down of a simulated rig on a busy machine, relative to the clock.
_SLOWEST = 10.0


@dataclass
class Channel:
    """Readings of a channel, with the commands that answered them."""

    #: Age on arrival and stamp (s), value (as received), command that answered the reading.
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    #: Steady time of the last reading, s.
    seen: float = 0.0
    #: Value at rest without air, the standard deviation of its noise, and the largest age, s.
    zero: float = 0.0
    noise: float = 0.0
    late: float = 0.0

    @property
    def last(self) -> float:
        """Last reading minus the value at rest."""
        return self.rows[-1][2] - self.zero if self.rows else math.nan

    def since(self, start: int) -> np.ndarray:
        """Return the rows from index ``start``, shape (T, 4)."""
        return np.array(self.rows[start:]).reshape(-1, 4)

    def level(self, count: int = 10) -> float:
        """Return the median of the last ``count`` readings minus the value at rest."""
        return float(np.median([row[2] for row in self.rows[-count:]])) - self.zero

    def rest(self) -> None:
        """Use the readings so far as readings at rest."""
        values = np.array([row[2] for row in self.rows])
        self.zero = float(np.median(values))
        self.noise = float(np.std(values)) if len(values) > 1 else 0.0
        self.late = max((row[0] for row in self.rows), key=abs)


class Vented(Exception):
    """All units were vented, for the reason in the text."""


class Hand(BundleNode):
    """
    Opens valves and records the readings.

    Parameters
    ----------
    length : float, m
        Rest length, for a rig that sends the contraction alone.
    """

    def __init__(self, context: Context, namespace: str, units: int, length: float):
        super().__init__('check_rig', (), context=context, namespace=namespace)
        #: Pa as received.
        self.pressure = [Channel() for _ in range(units)]
        self.force, self.strain, self.supply = Channel(), Channel(), Channel()
        #: For each valve; None, as at first, to publish nothing.
        self.command: list[float | None] = [None] * units
        #: For ``supply_enable``; None, as at first, to publish nothing.
        self.permission: bool | None = None
        self._acting = False
        #: Rise of any pressure (Pa) and change of the force (N) at which everything is vented.
        self.limit = self.most_force = math.inf
        #: Why everything was vented; empty before.
        self.trouble = ''
        self.stopped: bool | None = None
        self._send_permission = self.sender(interface.SUPPLY_ENABLE, Bool, interface.bool_message)
        self._send = [self.sender(interface.valve_topic(i + 1), JointState,
                                  interface.valve_writer(i + 1)) for i in range(units)]
        for i in range(units):
            self.subscribe(interface.pressure_topic(i + 1), FluidPressure,
                           partial(self._on_pressure, i))
        self.subscribe(interface.FORCE, WrenchStamped, self._on_force)
        self.subscribe(interface.STRAIN, JointState, lambda message: self._note(
            self.strain, message, interface.read_strain(message, length)[0]))
        self.subscribe(interface.SUPPLY, FluidPressure, lambda message: self._note(
            self.supply, message, message.fluid_pressure))
        self.subscribe(interface.E_STOP, Bool, self._on_e_stop, interface.E_STOP_HEARD)
        self.every(0.5 * PERIOD, self._beat)

    def others(self) -> list[str]:
        """Return topics with other publishers, which show that a controller is running."""
        names = [interface.SUPPLY_ENABLE, *(interface.valve_topic(i + 1)
                                            for i in range(len(self.pressure)))]
        return [name for name in names if self.publisher_count(name) > 1]

    def begin(self) -> None:
        """Begin to publish: supply shut, valves exhausting."""
        self._acting, self.command = True, [-1.0] * len(self.command)
        self.permit(False)

    def permit(self, value: bool | None) -> None:
        """Publish ``supply_enable`` now, and repeatedly from now on."""
        self.permission = value
        self._beat()

    def vent(self, why: str) -> None:
        """Cut the supply and exhaust everything; the first reason is kept."""
        self.trouble = self.trouble or why
        if not self._acting:
            # A controller may be running: publish nothing.
            return
        self.command = [-1.0] * len(self.command)
        self.permit(False)
        for send in self._send:
            send(self.now_ns(), -1.0)

    def stop(self) -> None:
        """Vent."""
        self.vent('ended')

    def _beat(self) -> None:
        if self.permission is not None:
            self._send_permission(self.permission)

    def _note(self, channel: Channel, message: Any, value: float, command: float = math.nan
              ) -> int:
        """Record a reading; return its stamp, ns."""
        stamp = interface.stamp_ns(message.header.stamp)
        channel.seen = time.monotonic()
        channel.rows.append((self.latency(stamp), stamp * 1e-9, value, command))
        return stamp

    def _on_pressure(self, unit: int, message: FluidPressure) -> None:
        channel, command = self.pressure[unit], self.command[unit]
        stamp = self._note(channel, message, message.fluid_pressure,
                           math.nan if command is None else command)
        if not channel.last <= self.limit:
            self.vent(f'mu{unit + 1}/pressure rose by {channel.last / 1e3:.1f} kPa; at most '
                      f'{self.limit / 1e3:.0f} kPa can be')
        elif command is not None:
            self._send[unit](stamp, command)

    def _on_force(self, message: WrenchStamped) -> None:
        self._note(self.force, message, interface.read_force(message))
        if abs(self.force.last) > self.most_force:
            self.vent(f'the force changed by {self.force.last:.1f} N; at most '
                      f'{self.most_force:.0f} N can be')

    def _on_e_stop(self, message: Bool) -> None:
        self.stopped = message.data
        if message.data and self.permission:
            self.vent('the emergency stop went on')


class Session:
    """Runs a `Hand` for some time, until a condition holds, or until ``stop`` returns True."""

    def __init__(self, hand: Hand, spinner: Spinner, stop: Callable[[], bool]):
        self.hand, self._spinner, self._stop = hand, spinner, stop

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """
        Spin for some time (s); return whether ``until`` became true.

        The time is that of the pressure stamps, as a simulated rig falls behind the clock on a
        busy machine. The clock is used before the first stamp, and for a rig that is slower than
        `_SLOWEST` allows or whose stamps do not advance.

        Raises
        ------
        Vented
            When the hand had to vent, with the reason.
        """
        begin, stamp = time.monotonic(), self._stamp()

        def over() -> bool:
            passed = time.monotonic() - begin
            return passed >= seconds and (
                not self._stamp() - stamp < seconds or passed >= _SLOWEST * seconds)
        while not (done := until()) and not over():
            self._spinner.spin(_SLICE)
            if self._stop():
                self.hand.vent('interrupted')
                raise KeyboardInterrupt
            now = time.monotonic()
            for i, channel in enumerate(self.hand.pressure):
                if channel.rows and self.hand.permission and now - channel.seen > _SILENCE:
                    self.hand.vent(f'mu{i + 1}/pressure fell silent')
            if self.hand.trouble:
                self.let_go()
                raise Vented(self.hand.trouble)
        return done

    def _stamp(self) -> float:
        """Return the newest stamp of the pressures, s; NaN before the first."""
        return max((channel.rows[-1][1] for channel in self.hand.pressure if channel.rows),
                   default=math.nan)

    def let_go(self) -> None:
        """Vent, and give the messages time to arrive."""
        self.hand.vent('done')
        end = time.monotonic() + _FAREWELL
        while time.monotonic() < end:
            self._spinner.spin(_SLICE)
