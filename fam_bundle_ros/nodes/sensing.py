# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Samples of a rig for recruitment and monitor: force, strain and pressures brought together.

In lock-step a sample is complete when every channel has its stamp. In wall time it is complete
when every channel has a new value; if a channel is slower or silent, the owner's timer takes the
available values. A sample is processed after all messages that are already queued, so that
pressure loops in the same process answer first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import math
import time
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.control.observer import learn_noise, may_be_spike, NoiseState
from fam_bundle_ros.control.rate import USUAL_NOISE
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode, REMIND
from fam_bundle_ros.nodes.diagnostics import Meter, Report
from fam_bundle_ros.nodes.gate import Gate
from fam_bundle_ros.units import FASTEST

#: Cut-off of the low-pass for the differentiated strain, Hz.
_RATE_CUTOFF = 20.0


@dataclass(frozen=True)
class Sample:
    """Readings that belong together; nan where a channel is lost."""

    #: ns.
    stamp: int
    #: N.
    force: float
    #: 1 and 1/s.
    strain: float
    rate: float
    #: Pa (gauge).
    pressure: list[float]
    #: Value of the channel ``reference``, where a sample waits for it.
    reference: Any = None
    #: Whether it has no new value: time has passed without messages.
    silent: bool = False


class StrainRate:
    """Differentiates a strain without velocity, with a low-pass; spikes are left out."""

    def __init__(self) -> None:
        self._last: tuple[int, float] | None = None
        self._rate = 0.0
        self._noise = NoiseState()

    def update(self, stamp: int, strain: float) -> float:
        """Return the rate, 1/s; restarts after a reading that is not finite."""
        if not math.isfinite(strain):
            self._last = None
            return math.nan
        if self._last is None:
            self._last, self._rate, self._noise = (stamp, strain), 0.0, NoiseState()
        dt, noise = (stamp - self._last[0]) * 1e-9, self._noise
        spike = may_be_spike(noise, strain - self._rate * dt, USUAL_NOISE)
        learn_noise(noise, strain, USUAL_NOISE, dt)
        if spike:
            return self._rate
        if dt > 0.0:
            gain = -math.expm1(-2.0 * math.pi * _RATE_CUTOFF * dt)
            self._rate += gain * ((strain - self._last[1]) / dt - self._rate)
        self._last = (stamp, strain)
        return self._rate


class Sensing:
    """
    Subscribes a node to its rig.

    Parameters
    ----------
    node : BundleNode
        With the parameters of `LISTENER`.
    length : float, m
        Rest length of the bundle.
    on_sample : callable
        Called with each complete `Sample`.
    with_reference : bool
        Whether samples in lock-step wait for the channel ``reference`` too; it comes by `put`.
    on_pressure : callable, optional
        In wall time, called at once with motor unit (from 0) and gauge pressure of each message,
        for checks that must not wait for the other channels.
    """

    def __init__(self, node: BundleNode, units: int, length: float,
                 on_sample: Callable[[Sample], None], with_reference: bool = False,
                 on_pressure: Callable[[int, float], None] | None = None):
        self._node = node
        self._on_pressure = None if node.lock_step else on_pressure
        self._pressures = interface.unit_names(units)
        self._length = length
        self._on_sample = on_sample
        self._with_reference = with_reference and node.lock_step
        sensors = ['force', 'strain', *self._pressures]
        #: Rate and age of each channel.
        self.meters = {name: Meter() for name in sensors}
        #: Age on arrival of the last reading of each channel, s (wall time only).
        self.latency = dict.fromkeys(sensors, 0.0)
        self._latest: dict[str, Any] = {}
        #: Channels with a new value, and its stamp, ns.
        self._fresh: dict[str, int] = {}
        self._gate = Gate([*sensors, *(['reference'] if self._with_reference else [])])
        self._rate = StrainRate()
        self._last_sample = time.monotonic()
        self._stamp = -1
        #: Fires once after a reset, after all queued messages. `Executor.create_task` would do
        #: the same, but crashes Python when a task raises. The timer has its own clock, as a reset
        #: calls all due timers of its clock once more, and each such call delays their next one by
        #: a period.
        self._due = node.create_timer(1e-9, self._complete_fresh,
                                      clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._due.cancel()
        self._listen('force', interface.FORCE, WrenchStamped, interface.read_force)
        self._listen('strain', interface.STRAIN, JointState, self._read_strain)
        for i, name in enumerate(self._pressures):
            self._listen(name, interface.pressure_topic(i + 1), FluidPressure,
                         partial(self._read_pressure, i))

    def check_time(self) -> None:
        """Detect missing channels; call this from a timer, for a rig that is silent."""
        if self._node.lock_step:
            if lost := self._gate.overdue(self._node.p['lock_step_timeout']):
                self._node.say('lost', f"no {', '.join(lost)} any more", 0.0)
                self._complete_gate()
        elif self._latest and time.monotonic() - self._last_sample > 2.0 / self._node.p['rate']:
            self._complete()

    def report(self, report: Report) -> None:
        """Add rate and age of every channel; warn of one that is far off its rate."""
        rate = 0.0 if self._node.lock_step else self._node.p['rate']
        for name, meter in self.meters.items():
            if other := meter.report(report, name, rate):
                self._node.say(f'{name} rate', other, REMIND)

    # --- messages ------------------------------------------------------------------------------

    def _listen(self, channel: str, topic: str, kind: Any, read: Callable[[Any], Any]) -> None:
        tick = self.meters[channel].tick

        def take(message: Any) -> None:
            value = read(message)
            tick()
            self.put(channel, interface.stamp_ns(message.header.stamp), value)
        self._node.subscribe(topic, kind, take)

    def _read_strain(self, message: JointState) -> tuple[float, float]:
        """Return strain and rate; a strain that moves faster than any muscle is no reading."""
        strain, rate = interface.read_strain(message, self._length)
        if not abs(rate) <= FASTEST:
            if not math.isnan(rate):
                self._node.say('velocity', f'strain moves at {rate:.3g} 1/s by its velocity, '
                               f'faster than any muscle ({FASTEST:g} 1/s): wrong unit? '
                               'The strain is differentiated instead')
            rate = self._rate.update(interface.stamp_ns(message.header.stamp), strain)
            if abs(rate) > FASTEST:
                self._node.say('fast', f'strain moves at {rate:.3g} 1/s by its readings, faster '
                               f'than any muscle ({FASTEST:g} 1/s): wrong unit? Unused')
                strain = math.nan
        return strain, rate

    def _read_pressure(self, unit: int, message: FluidPressure) -> float:
        value = interface.read_pressure(message, self._node.ambient,
                                        self._node.p['pressure_is_gauge'])
        if self._on_pressure is not None:
            self._on_pressure(unit, value)
        return value

    def put(self, channel: str, stamp: int, value: Any) -> None:
        """Take a value of a channel, in its units, and the time of the measurement, ns."""
        if self._node.lock_step:
            if self._gate.put(channel, stamp, value):
                self._complete_gate()
            return
        self._latest[channel], self._fresh[channel] = value, stamp
        self.latency[channel] = self._node.latency(stamp)
        if self._all_fresh:
            self._due.reset()

    @property
    def _all_fresh(self) -> bool:
        return len(self._fresh) == len(self.meters)

    def _complete_fresh(self) -> None:
        self._due.cancel()
        if self._all_fresh:
            self._complete()

    def _complete_gate(self) -> None:
        self._stamp = self._gate.stamp
        self._hand_over(self._gate.value)

    def _complete(self) -> None:
        """Hand over the last values; without a new one the sample is silent."""
        silent = not self._fresh
        if not silent:
            self._last_sample = time.monotonic()
            # Only new values: a silent channel whose clock is ahead must not stop the time.
            self._stamp = max(self._fresh.values())
        self._fresh.clear()
        self._hand_over(self._latest.get, silent)

    def _hand_over(self, value: Callable[[str, Any], Any], silent: bool = False) -> None:
        """Make a sample of ``value(channel, value if there is none)``."""
        strain, rate = value('strain', (math.nan, math.nan))
        self._on_sample(Sample(
            self._stamp, value('force', math.nan), strain, rate,
            [value(name, math.nan) for name in self._pressures],
            value('reference', None) if self._with_reference else None, silent))
