# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether a rig conforms to the interface: names, types, rates, units, signs, noise."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
import time
from typing import Any

import numpy as np
from rclpy.context import Context
from std_msgs.msg import Bool

from fam_bundle_ros.control.safety import WatchConfig
from fam_bundle_ros.data.rates import spread
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.e_stop import UNHEARD
from fam_bundle_ros.nodes.process import ros_context, Spinner, StopSignals
from fam_bundle_ros.nodes.recording import matching_qos
from fam_bundle_ros.plant.faults import UNITS

#: A FluidPressure below this is not absolute, Pa; a motor unit at rest shows about 101 kPa.
_ABSOLUTE = 50e3
#: Largest pressure, Pa gauge.
_HIGHEST = 1.5e6
#: Deviation of a reading of ambient pressure by weather, altitude and sensor offset, Pa.
_NEAR = 0.15 * ATMOSPHERE
#: Force (N) and strain below which neither sign nor unit can be determined.
_LITTLE_FORCE, _LITTLE_STRAIN = 20.0, 0.02
#: Slowest rate that the control loop can use, Hz.
_SLOWEST = 50.0
#: A larger latency than this comes from clocks that differ, not from the network, s.
_APART = 1.0


@dataclass(frozen=True)
class Finding:
    """One thing that was checked."""

    ok: bool
    what: str
    #: What was found, and what to do if it is wrong.
    detail: str
    #: No error was found, but the user must check something.
    note: bool = False

    @property
    def verdict(self) -> str:
        """Return ``ok``, ``note`` or ``FAIL``."""
        return 'FAIL' if not self.ok else 'note' if self.note else 'ok'

    def __str__(self) -> str:
        return f'{self.verdict:4} {self.what}: {self.detail}'


class _Listener(BundleNode):
    """Collects stamps and values of a rig's sensors."""

    def __init__(self, context: Context, namespace: str, length: float):
        super().__init__('check_rig', (), context=context, namespace=namespace)
        self._length = length
        #: Steady time (s), stamp (ns), latency (s) and value of each reading.
        self.rows: dict[str, list[tuple[float, int, float, float]]] = {}
        self.bad: dict[str, str] = {}
        #: Whether `e_stop` was received with the QoS of the controllers.
        self.stop_heard = False
        self.subscribe(interface.E_STOP, Bool, self._on_stop, interface.E_STOP_HEARD)

    def _on_stop(self, message: Bool) -> None:
        self.stop_heard = True

    def listen(self, topic: str, kind: Any, read: Callable[[Any], float]) -> None:
        """Collect a topic with whatever QoS its publishers offer."""
        rows = self.rows.setdefault(topic, [])

        def take(message: Any) -> None:
            try:
                value = read(message)
            except InputError as error:
                self.bad[topic] = str(error)
                return
            stamp = interface.stamp_ns(message.header.stamp)
            rows.append((time.monotonic(), stamp, self.latency(stamp), value))
        name = self.resolve_topic_name(topic)
        offers = [info.qos_profile for info in self.get_publishers_info_by_topic(name)]
        self.create_subscription(kind, topic, take, matching_qos(offers))

    def types(self) -> dict[str, list[str]]:
        """Return the topics that have a publisher, with their types."""
        return {name: types for name, types in self.get_topic_names_and_types()
                if self.count_publishers(name)}


def check_rig(namespace: str = interface.NAMESPACE, seconds: float = 3.0, *,
              forces: tuple[float, float], units: int = 1,
              domain: int | None = None, length: float = 0.127, gauge: bool = False,
              patience: float = 5.0,
              progress: Callable[[float], None] | None = None) -> list[Finding]:
    """
    Listen to a rig and return what is right and wrong with what it sends.

    Parameters
    ----------
    namespace : str
    seconds : float
        How long readings are collected.
    forces : tuple of float, N
        Smallest and largest possible force, as of `force_limits`.
    units : int
        Motor units that the rig must have; more are checked too, with a note.
    domain : int, optional
        ROS domain; that of the environment by default.
    length : float, m
        Rest length, for a rig that sends the contraction alone.
    gauge : bool
        The rig sends gauge pressure, as with the parameter ``pressure_is_gauge``.
    patience : float, s
        Time-out for the topics of the rig.
    progress : callable, optional
        Called with the seconds so far.

    Returns
    -------
    list of Finding
    """
    with ros_context(domain) as context:
        node = _Listener(context, namespace, length)
        with closing(Spinner(context, [node])) as spinner, StopSignals() as signals:
            begin = time.monotonic()
            sensors = {node.resolve_topic_name(name) for name in (
                interface.FORCE, interface.STRAIN, *_pressures(units))}
            until = partial(spinner.until, ended=lambda: signals.received)
            until(lambda: sensors <= set(node.types()), patience)
            there = _listen(node, length)
            # The first message of a discovered topic may take seconds to arrive.
            until(lambda: all(node.rows.values()) or bool(node.bad),
                  begin + patience - time.monotonic())
            begin = time.monotonic()
            while time.monotonic() - begin < seconds and not signals.received:
                spinner.spin(0.2)
                if progress:
                    progress(time.monotonic() - begin)
            if signals.received:
                raise KeyboardInterrupt
            more = [Finding(True, 'motor units', f'{there}, but {units} in the model: no node '
                            'commands the others', note=True)] if there > units else []
            return more + _judge(node, max(units, there), seconds, gauge, forces)


def _pressures(units: int) -> list[str]:
    return [interface.pressure_topic(unit) for unit in range(1, units + 1)]


def _listen(node: _Listener, length: float) -> int:
    """Subscribe to every sensor of the right type; return the number of motor units."""
    types = node.types()
    units = 0
    while units < interface.MOST_UNITS and node.resolve_topic_name(
            interface.pressure_topic(units + 1)) in types:
        units += 1
    readers: dict[str, Callable[[Any], float]] = {
        interface.FORCE: interface.read_force,
        interface.STRAIN: lambda m: interface.read_strain(m, length)[0],
        # Not converted: whether they are gauge or absolute is to be found out.
        **{name: lambda m: m.fluid_pressure for name in (interface.SUPPLY, *_pressures(units))}}
    for topic in interface.topics(units):
        name = node.resolve_topic_name(topic.name)
        if topic.name in readers and topic.type_name in types.get(name, ()):
            node.listen(topic.name, topic.type, readers[topic.name])
    return units


def _judge(node: _Listener, units: int, seconds: float, gauge: bool,
           forces: tuple[float, float]) -> list[Finding]:
    types = node.types()
    expected = {topic.name: topic for topic in interface.topics(units)}
    findings = []
    for name in (interface.FORCE, interface.STRAIN, *_pressures(units), interface.SUPPLY):
        found = types.get(node.resolve_topic_name(name), [])
        wanted = expected[name].type_name
        optional = name == interface.SUPPLY
        if wanted not in found:
            seen = f"is {', '.join(found)}" if found else 'no publisher'
            findings.append(Finding(optional and not found, name, f'{seen}; expected {wanted}'
                                    + (' (optional)' if optional else '')))
            continue
        findings += _judge_channel(name, node.rows.get(name, []), node.bad.get(name), seconds,
                                   gauge, forces)
    for i in range(units):
        name = interface.valve_topic(i + 1)
        heard = node.count_subscribers(name)
        findings.append(Finding(heard > 0, name, f'subscribed by {heard}' if heard else
                                'no subscriber: the valve driver must subscribe'))
    stop = node.count_publishers(interface.E_STOP)
    heard = stop != 1 or node.stop_heard
    findings.append(Finding(stop == 1 and heard, interface.E_STOP,
                            f'publishers: {stop}; expected one' if heard else UNHEARD))
    return findings


def _judge_channel(name: str, rows: list[tuple[float, int, float, float]], bad: str | None,
                   seconds: float, gauge: bool, forces: tuple[float, float]) -> list[Finding]:
    if bad:
        return [Finding(False, name, bad)]
    if len(rows) < 5:
        return [Finding(False, name, f'{len(rows)} messages in {seconds:g} s')]
    times, stamps, latencies, values = (np.array(column) for column in zip(*rows))
    rate = (len(times) - 1) / max(times[-1] - times[0], 1e-9)
    # As it is shown: the timer of a driver at 50 Hz gives 49.97.
    quick = round(rate) >= _SLOWEST
    findings = [Finding(quick, f'{name} rate', f'{rate:.0f} Hz'
                        + ('' if quick else f'; expected {_SLOWEST:g} Hz or more'))]
    steps = np.diff(stamps)
    stamped = bool(np.all(stamps > 0) and np.all(steps >= 0) and np.any(steps > 0))
    findings.append(Finding(stamped, f'{name} stamps', 'rise' if stamped else
                            'are zero or go backwards; expected the time of the reading'))
    if stamped:
        findings.append(_judge_latency(name, latencies, rate))
        if gaps := _gaps(name, 1e-9 * float(np.max(steps))):
            findings.append(gaps)
    finite = values[np.isfinite(values)]
    if len(finite) < len(values):
        findings.append(Finding(False, f'{name} values',
                                f'{len(values) - len(finite)} of {len(values)} are not numbers'))
    if len(finite) and np.ptp(finite) == 0.0:
        findings.append(Finding(True, f'{name} noise', f'none: all {len(finite)} readings are the '
                                'same; is it alive? Set stuck_time to 0 for an instrument without '
                                'noise', note=True))
    if len(finite):
        findings.append(_judge_values(name, finite, gauge, forces))
    return findings


def _judge_latency(name: str, latencies: np.ndarray, rate: float) -> Finding:
    """Judge the age of readings on arrival, and whether the clocks agree."""
    middle, late = np.quantile(latencies, (0.5, 0.99))
    seen = f'{1e3 * middle:.1f} ms, jitter {1e3 * (late - middle):.1f} ms'
    most = 3.0 / rate
    if abs(middle) > _APART:
        return Finding(True, f'{name} latency', f'{middle:.3g} s: the clocks of rig and this '
                       'machine disagree; synchronise them (chrony, PTP) or set '
                       'clocks_synchronised false', note=True)
    if not -most < middle < late < most:
        return Finding(True, f'{name} latency', f'{seen}: more than three samples '
                       f'({1e3 * most:.0f} ms) are refused (max_latency)', note=True)
    return Finding(True, f'{name} latency', f'{seen}; the clocks agree')


def _gaps(name: str, longest: float) -> Finding | None:
    """Return a note of a pause (s) after which the controllers take a reading as lost."""
    if longest <= WatchConfig.timeout:
        return None
    return Finding(True, f'{name} gaps', f'none for {longest:.2f} s by the stamps: cable, driver, '
                   'or a busy machine? The controllers take a reading as lost after '
                   f'{WatchConfig.timeout:g} s (sensor_timeout)', note=True)


def _judge_values(name: str, values: np.ndarray, gauge: bool,
                  forces: tuple[float, float]) -> Finding:
    middle = float(np.median(values))
    noise = spread(np.diff(values)) / np.sqrt(2.0) if len(values) > 2 else 0.0
    if name == interface.FORCE:
        return _judge_force(middle, noise, forces)
    if name == interface.STRAIN:
        return _judge_strain(middle, noise)
    return _judge_pressure(name, middle, noise, gauge)


def _judge_force(middle: float, noise: float, forces: tuple[float, float]) -> Finding:
    seen = f'{middle:.2f} N, noise {noise:.2f} N'
    if abs(middle) < _LITTLE_FORCE:
        return Finding(True, 'force unit and sign', f'{seen}; cannot be determined at rest: pull '
                       'with a known weight, and see the same positive value in N', note=True)
    low, high = forces
    if not low <= middle <= high:
        return Finding(False, 'force unit and sign', f'{seen}; expected {low:.0f} to {high:.0f} '
                       'N, tension positive: is the sign or the unit wrong?')
    return Finding(True, 'force sign', f'{seen}; whether it is N cannot be determined: compare '
                   'with a known weight' if middle > 0.0 else f'{seen}: right only if the bundle '
                   'is pressed together; pull with a known weight, and see the same positive '
                   'value in N', note=True)


def _judge_strain(middle: float, noise: float) -> Finding:
    seen = f'{middle:.4f}, noise {noise:.1e}'
    if abs(middle) < _LITTLE_STRAIN:
        return Finding(True, 'strain unit and sign', f'{seen}; cannot be determined near zero: '
                       'shorten the bundle by a tenth, and see 0.1', note=True)
    if not -0.1 < middle < 0.5:
        return Finding(False, 'strain unit and sign', f'{seen}; expected a fraction (not % or '
                       'mm), positive when shorter')
    if middle < 0.0:
        return Finding(True, 'strain unit and sign', f'{seen}: right only if the bundle is '
                       'stretched; shorten it, and see more', note=True)
    return Finding(True, 'strain unit and sign', seen)


def _judge_pressure(name: str, middle: float, noise: float, gauge: bool) -> Finding:
    what, seen = f'{name} unit', f'{middle / 1e3:.1f} kPa, noise {noise / 1e3:.2f} kPa'
    unit = next((unit for unit, factor in UNITS['pressure'].items()
                 if abs(middle / factor - ATMOSPHERE) < _NEAR),
                'kPa' if name == interface.SUPPLY and 50.0 < middle < 3e3 else '')
    if unit and noise < 0.1 * middle:
        # A gauge reading in Pa would hardly have this offset and so little noise.
        return Finding(False, what, f'{middle:.4g}, noise {noise:.2g}: looks like {unit}, '
                       'expected Pa')
    if gauge:
        if abs(middle - ATMOSPHERE) < _NEAR:
            return Finding(False, what, f'{seen}: looks absolute; leave out --gauge and '
                           'pressure_is_gauge, or vent it first')
        ok = -_NEAR < middle < _HIGHEST
        little = abs(middle) < _NEAR
        return Finding(ok, what, f'{seen} gauge' + (
            '; expected Pa' if not ok else '; Pa or kPa cannot be determined at rest: see that it '
            'rises with the air' if little else ''), note=ok and little)
    ok = _ABSOLUTE < middle < _HIGHEST + ATMOSPHERE
    hint = ('' if ok else '; FluidPressure is absolute: set pressure_is_gauge (here --gauge) for '
            'a driver that sends gauge' if middle <= _ABSOLUTE else '; expected Pa')
    return Finding(ok, what, f'{seen}{hint}' if hint else seen.replace(' kPa,', ' kPa absolute,'))
