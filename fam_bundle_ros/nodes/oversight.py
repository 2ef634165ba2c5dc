# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Supervision by the recruitment controller: readings, pressure loops, own process; latches."""

from collections.abc import Callable, Iterable
import math
import time

import numpy as np

from fam_bundle_ros.control import Measurement
from fam_bundle_ros.control.agreement import ForceWatch
from fam_bundle_ros.control.safety import (
    FORCE,
    Guard,
    Health,
    kilopascals,
    LOST,
    LostTime,
    OTHER,
    OVER_PRESSURE,
    PID_LOST,
    SensorWatch,
    State,
    STOPPED,
    trip_pressure,
    WatchConfig,
)
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes import interface, loops
from fam_bundle_ros.nodes.base import BundleNode, GAUGE
from fam_bundle_ros.nodes.e_stop import EmergencyStop
from fam_bundle_ros.nodes.loops import PressureLoops
from fam_bundle_ros.nodes.recruitment_parameters import force_limits
from fam_bundle_ros.nodes.sensing import Sample, Sensing
from fam_bundle_ros.nodes.supply_enable import TIMEOUT
from fam_bundle_ros.told import number

#: Change of a pressure that must change the readings of force and strain, Pa.
_MOVED = 30e3
#: Share of the largest pressure below which a latched unit may be enabled again: tolerates drift
#: of the sensor.
_EMPTY = 0.1
#: Time after which a chamber that is open to ambient is empty, s: many times the time constant of
#: a valve that fills within a second.
_EXHAUSTED = 2.0
#: Time within which pressure loops receive `enable`, s.
_HEAR = 0.5
#: Tolerated error of model and load cell together, as a share of the blocked force.
_FORCE_ERROR = 0.05


class Oversight:
    """
    Watches readings and pressure loops for a node, and tells why it must not act.

    Parameters
    ----------
    node : BundleNode
        The recruitment controller, with its parameters.
    clock : callable
        Returns the time of the watches, s.
    on_latch : callable
        Called after a latch.
    on_e_stop : callable
        Called when the emergency stop is activated.
    """

    def __init__(self, node: BundleNode, bundle: Bundle, clock: Callable[[], float],
                 on_latch: Callable[[], None], on_e_stop: Callable[[], None]):
        self._node, self._clock, self._on_latch = node, clock, on_latch
        self._n = bundle.n
        units = range(1, bundle.n + 1)
        self._readings = (interface.FORCE, interface.STRAIN, interface.SUPPLY,
                          *map(interface.pressure_topic, units))
        #: Topics that have one publisher each: with two, rigs or controllers are mixed.
        self.topics = (*self._readings, interface.E_STOP, interface.SUPPLY_ENABLE,
                       *map(interface.setpoint_topic, units), *map(interface.valve_topic, units))
        self._limit = bundle.max_pressure.tolist()
        self.guard = Guard()
        #: Force, strain, pressures.
        self.watches = self._make_watches(bundle.largest_force)
        #: The last readings, Pa.
        self.pressure = [math.nan] * bundle.n
        #: Last force (N) and strain, nan where they cannot be trusted.
        self._force = self._strain = math.nan
        self.set_model(bundle)
        self._moved_from: dict[str, tuple[float, list[float]]] = {}
        self._lost_readings, self._lost_stop = LostTime(), LostTime()
        #: Why a stop would not be noticed; empty while it would.
        self._stop_unheard = ''
        #: Which readings have several publishers; empty for none.
        self._second_rig = ''
        self._enabled_at = 0.0
        self._alive = time.monotonic()
        self.loops = PressureLoops(node, bundle.n, self.latch)
        self.e_stop = EmergencyStop(node, on_e_stop)
        if not node.lock_step:
            node.every(loops.PERIOD, self._look_at_publishers)

    def _make_watches(self, largest: float) -> list[SensorWatch]:
        """Return the watches of all readings; ``largest`` force of the model, N."""
        p = self._node.p
        lowest, highest = force_limits(largest, p['force_low'], p['force_high'])
        if highest < largest:
            text = (f'force_high is {highest:g} N, but the model reaches {largest:.0f} N at '
                    'max_pressure: a force in between counts as a broken load cell, and vents')
            self._node.say(text, text)

        def config(low: float, high: float, stuck: float, below: str = '') -> WatchConfig:
            return WatchConfig(low, high, p['sensor_timeout'], p['hold_time'],
                               p['recovery_time'], stuck, self._node.max_latency, below)
        return [
            SensorWatch('force', 'N', config(lowest, highest, p['stuck_time'])),
            SensorWatch('strain', '', config(p['strain_low'], p['strain_high'],
                                             p['strain_stuck_time'])),
            *(SensorWatch(f'mu{i + 1} pressure', 'Pa', config(-50e3, 1.6e6, 0.0, GAUGE))
              for i in range(self._n))]

    def set_model(self, bundle: Bundle) -> None:
        """Compare the force with this model from now on."""
        model = bundle.model(False)

        def unit_force(unit: int, strain: float, pressure: float) -> float:
            # With the initial memory state: friction and hysteresis are within the tolerance.
            return float(model.force(unit, strain, 0.0, [pressure] * bundle.n, 0.0, 0.0, True,
                                     model.shape, model.parameters, model.tables, model.memory,
                                     model.after))
        self._force_watch = ForceWatch(unit_force, _FORCE_ERROR * bundle.largest_force,
                                       3.0 / self._node.p['rate'])

    # --- readings ------------------------------------------------------------------------------

    @property
    def readable(self) -> bool:
        """Whether every reading can be trusted."""
        return all(watch.health == Health.GOOD for watch in self.watches)

    @property
    def unreadable(self) -> str:
        """Why readings cannot be trusted."""
        return '; '.join(watch.reason for watch in self.watches
                         if watch.health != Health.GOOD and watch.reason)

    def trusted(self, sample: Sample, sensing: Sensing) -> Measurement:
        """Return the readings with nan for those that cannot be trusted."""
        now = self._clock()
        self.pressure = sample.pressure
        values = [sample.force, sample.strain, *sample.pressure]
        for watch, (channel, meter), value in zip(self.watches, sensing.meters.items(), values):
            last = meter.last
            if self._node.lock_step:
                watch.see(now, value, self._must_move(watch.name, value, sample.pressure))
            elif last is not None and last != watch.age:
                watch.see(last, value, self._must_move(watch.name, value, sample.pressure),
                          sensing.latency[channel])
                watch.check(now)
            else:
                watch.check(now)
        force, strain, *pressure = (
            value if watch.health == Health.GOOD else math.nan
            for watch, value in zip(self.watches, values))
        self._force, self._strain = force, strain
        return Measurement(force, strain, sample.rate, np.array(pressure))

    def _must_move(self, name: str, value: float, pressure: list[float]) -> bool:
        """Whether pressures have moved so far that this reading cannot have stayed the same."""
        if name not in ('force', 'strain'):
            return False
        before = self._moved_from.get(name)
        if before is None or before[0] != value:
            self._moved_from[name] = (value, pressure)
            return False
        return any(abs(a - b) > _MOVED for a, b in zip(pressure, before[1]))

    # --- what latches --------------------------------------------------------------------------

    def latch(self, cause: str, reason: str) -> None:
        """Vent all motor units until the bundle is enabled again."""
        if self.guard.latch(self._clock(), cause, reason):
            self._on_latch()
            self._node.get_logger().error(f'{cause}: {reason}; off until enabled again')

    def look_at_pressure(self, unit: int, pressure: float) -> None:
        """Latch at once where a pressure is too high; called for every reading."""
        limit = self._trip(unit)
        if pressure > limit:
            self.latch(OVER_PRESSURE, f'mu{unit + 1} at {kilopascals(pressure)}, above '
                       f'{kilopascals(limit)}')

    def look(self, sample: Sample, enabled: bool, off_target: bool) -> None:
        """
        Latch if a sample, the pressure loops or a long loss require it.

        While the controller is off (not ``enabled``), only the pressures are checked.
        ``off_target`` tells that the reference has been missed for longer than a transient.
        """
        for unit, pressure in enumerate(sample.pressure):
            self.look_at_pressure(unit, pressure)
        if not enabled:
            return
        self._look_for_loss()
        if self._second_rig:
            self.latch(OTHER, f'{self._second_rig}: a second rig, a simulation, or '
                       'a driver that was killed less than 20 s ago?')
        for watch in self.watches:
            if watch.cause:
                self.latch(watch.cause, watch.reason)
        if silent := self.loops.silent(self._patience):
            self.latch(PID_LOST, _silence(silent))
        if self.guard.now.state is not State.ACTIVE:
            self._force_watch.begin()
        elif self.readable and (wrong := self._force_watch.see(
                self._clock(), sample.force, sample.strain, sample.pressure, off_target)):
            self.latch(FORCE, f'{wrong}: pressure, force or strain sensor, or a wrong model?')
        if self._clock() - self._enabled_at > _HEAR:
            for unit in range(self._n):
                if latched := self.loops.latched(unit):
                    self.latch(latched.partition(': ')[0], f'mu{unit + 1} stays latched after '
                               f'enable, {latched}')

    def _look_for_loss(self) -> None:
        """Latch after a loss so long that pressure must not return by itself."""
        now, patience = self._clock(), self._node.p['resume_within']
        lost = [watch.reason for watch in self.watches
                if watch.health in (Health.WAITING, Health.VENT)]
        if self._lost_readings.see(now, bool(lost), patience):
            self.latch(LOST, f"{'; '.join(lost)}: vented for {patience:g} s in all")
        if trouble := self.loops.troubled(patience):
            self.latch(LOST, f'{trouble}, for {patience:g} s in all')
        if self._lost_stop.see(now, bool(self._stop_unheard), patience):
            self.latch(LOST, f'{self._stop_unheard}, for {patience:g} s')

    def _look_at_publishers(self) -> None:
        """Detect a second rig, and an emergency stop that has lost its publisher."""
        self._second_rig = '; '.join(crowded(self._node, self._readings))
        if not self._node.p['e_stop_required']:
            return
        before, self._stop_unheard = self._stop_unheard, self.e_stop.unheard()
        if self._stop_unheard and not before and self.guard.now.state is State.ACTIVE:
            self._node.get_logger().warning(
                f'{self._stop_unheard}: is the emergency stop connected? Off after '
                f"{self._node.p['resume_within']:g} s (resume_within)")

    def notice_stop(self) -> None:
        """Exclude the time in which this process stood still from the pressure loops' silence."""
        before, self._alive = self._alive, time.monotonic()
        still = self._alive - before
        if still > loops.PERIOD:
            self.loops.excuse(still)

    def stood_still(self, seconds: float) -> None:
        """Latch: `supply_enable` was late by ``seconds``, so that the driver has cut the air."""
        self.latch(STOPPED, f'this process stood still: nothing on supply_enable for '
                   f'{seconds:.2f} s')

    def contradicted(self) -> None:
        """Latch: another node publishes false on `supply_enable`."""
        self.latch(OTHER, 'another node says false on supply_enable while this one says true: a '
                   'second recruitment controller?')

    # --- enable --------------------------------------------------------------------------------

    def refusal(self, exhausted: float = 0.0) -> str:
        """
        Return why the bundle cannot be enabled now; empty when it can.

        ``exhausted`` is the time since the supply was shut and all valves exhaust, s.
        """
        node, reasons = self._node, crowded(self._node, self.topics)
        if self.e_stop.on:
            reasons.append(self.e_stop.why)
        elif node.p['e_stop_required'] and (unheard := self.e_stop.unheard()):
            reasons.append(f'{unheard} (for a rig without one: e_stop_required false)')
        if not node.lock_step:
            reasons += [watch.reason for watch in self.watches[:2]
                        if watch.health in (Health.WAITING, Health.VENT)]
        silent = self.loops.silent(self._patience)
        for unit, pressure in enumerate(self.pressure):
            watch, limit = self.watches[2 + unit], self._trip(unit)
            if unit in silent:
                reasons.append(_silence([unit]))
            # A loop that took no part in the reset: it was made beside a second publisher.
            if (not node.lock_step and self.loops.stopped(unit)
                    and self.e_stop.is_off_for(self._patience)):
                reasons.append(f'the pressure loop of mu{unit + 1} is in emergency stop: stop and '
                               'reset once more')
            if not node.lock_step and watch.health in (Health.WAITING, Health.VENT):
                reasons.append(watch.reason)
            elif pressure > limit:
                reasons.append(f'mu{unit + 1} is at {kilopascals(pressure)}, above '
                               f'{kilopascals(limit)}')
            elif full := self._still_full(unit, exhausted):
                reasons.append(full)
            elif (why := self.loops.latched(unit)) and pressure > _EMPTY * self._limit[unit]:
                reasons.append(f'mu{unit + 1} is latched ({why}) and still shows '
                               f'{kilopascals(pressure)}')
        return '; '.join(reasons or self.force_contradiction())

    def still_full(self, exhausted: float) -> list[str]:
        """Return the motor units that an exhaust of so many seconds has not emptied, as text."""
        return [text for unit in range(self._n) if self.watches[2 + unit].health == Health.GOOD
                and (text := self._still_full(unit, exhausted))]

    def _still_full(self, unit: int, exhausted: float) -> str:
        # A sensor with so large an offset could hide a pressure above the trip.
        pressure, limit = self.pressure[unit], self._trip(unit)
        if not (exhausted > _EXHAUSTED and pressure > limit - self._limit[unit]):
            return ''
        hint = ('shut the supply by hand' if pressure > limit else
                'is it absolute? Then pressure_is_gauge is wrong'
                if self._node.p['pressure_is_gauge'] else 'sensor, unit or exhaust?')
        return (f'mu{unit + 1} shows {kilopascals(pressure)} after {exhausted:.1f} s of exhaust: '
                f'{hint}')

    def force_contradiction(self) -> list[str]:
        """Return why the force contradicts pressures below the trip."""
        limits = [self._trip(unit) for unit in range(self._n)]
        if not math.isfinite(self._force + self._strain + sum(self.pressure)):
            return []
        unit = self._force_watch.above(self._force, self._strain, self.pressure, limits)
        if unit is None:
            return []
        return [f'mu{unit + 1} shows {kilopascals(self.pressure[unit])}, but a force of '
                f'{number(self._force)} N says that it is above {kilopascals(limits[unit])}']

    def release(self) -> None:
        """Reset the watches after `enable`."""
        self._enabled_at = self._clock()
        self.guard.release(self._enabled_at)
        # Sensors that are still lost get the full time again; a repeated value may be correct.
        for lost in (self._lost_readings, self._lost_stop, *self.loops.trouble):
            lost.reset()
        self._moved_from.clear()
        self._force_watch.begin()
        for watch in self.watches:
            watch.forgive_repeats()

    @property
    def _patience(self) -> float:
        """Tolerated silence of a pressure loop, s."""
        return max(2.0 * float(self._node.p['sensor_timeout']), TIMEOUT)

    def _trip(self, unit: int) -> float:
        return trip_pressure(self._limit[unit], self._node.p['over_pressure_factor'])


def crowded(node: BundleNode, topics: Iterable[str]) -> list[str]:
    """Return in words which topics have more than one publisher."""
    return [f'{count} publishers on {topic}{_types(node, topic)}; expected one'
            for topic in topics if (count := node.publisher_count(topic)) > 1]


def _types(node: BundleNode, topic: str) -> str:
    """Return the types of a topic's publishers in words, if they differ."""
    kinds = sorted({info.topic_type for info in node.get_publishers_info_by_topic(topic)})
    return f", of the types {' and '.join(kinds)}" if len(kinds) > 1 else ''


def _silence(units: list[int]) -> str:
    return '; '.join(f'the pressure loop of mu{unit + 1} is silent' for unit in units)
