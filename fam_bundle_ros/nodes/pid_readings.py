# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a pressure loop keeps besides its PID.

Gas volume, supply and plausible pressures of the motor unit; gaps of the readings; duration of an
error.
"""

import math
import time
from typing import Any

import numpy as np

from fam_bundle_ros.control import PidConfig
from fam_bundle_ros.control.agreement import SupplyWatch
from fam_bundle_ros.control.observer import learn_noise, may_be_spike, NoiseState
from fam_bundle_ros.control.plausibility import InflowConfig, InflowWatch
from fam_bundle_ros.control.rate import USUAL_NOISE
from fam_bundle_ros.control.safety import LATCH_TIME, OVER_PRESSURE_FACTOR, SUPPLY, trip_pressure
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import Report, WARN
from fam_bundle_ros.units import FASTEST

#: Lag from command to flow in addition to the dead time, s.
_SPOOL_LAG = 2e-3
#: Default delay of a driver from a command to the reading of its effect, in samples.
SAMPLES = 3.0
#: Bound of the noise of a pressure difference, in units of ``quiet_error`` (three standard
#: deviations of the noise): holds for noise twice as large.
_NOISE = 4.0
#: Time for the supply to rise after `supply_enable`: with and without a supply sensor, s.
_SUPPLY_START, _SUPPLY_UNSEEN = 1.0, 0.3


class Latest:
    """The last value and rate of an optional reading, until it is too old."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._value, self._received = (math.nan, math.nan), -math.inf
        self._seen = False

    def take(self, value: float, rate: float = math.nan) -> None:
        """Take a reading."""
        self._value, self._received = (value, rate), time.monotonic()
        self._seen = self._seen or math.isfinite(value)

    def value(self, patience: float) -> tuple[float, float]:
        """Return value and rate, nan where they are older than ``patience`` (s)."""
        fresh = time.monotonic() - self._received <= patience
        return self._value if fresh else (math.nan, math.nan)

    def lost(self, patience: float) -> bool:
        """Whether the reading was available and is now older than ``patience`` (s)."""
        return self._seen and not math.isfinite(self.value(patience)[0])


class Volume:
    """Table of gas volume and slope over strain, as the model is too slow for every tick."""

    def __init__(self, bundle: Any, index: int, tube: float):
        self._grid = np.linspace(-0.15, 0.5, 651)
        volume = np.maximum(bundle.gas_volume(self._grid)[:, index], 0.0) + max(tube, 1e-7)
        self._volume = volume.tolist()
        self._slope = np.gradient(volume, self._grid).tolist()
        #: Smallest and largest volume in operation (strain 0 to 0.3), m^3.
        self.ends = min(self._volume[150:451]), max(self._volume[150:451])
        #: Largest relative change of the volume per strain there.
        self.steepest = float(np.max(np.abs(self._slope[150:451]) / volume[150:451]))

    def at(self, strain: float) -> tuple[float | None, float]:
        """Return volume (m^3) and dV/dstrain; (None, 0) where the strain is not known."""
        if not -0.15 <= strain <= 0.5:
            return None, 0.0
        k = round((strain + 0.15) * 1000.0)
        return self._volume[k], self._slope[k]


class Air:
    """
    Keeps strain and supply, and checks pressure and supply for plausibility.

    Parameters
    ----------
    node : BundleNode
        With the parameters of `pid_parameters`.
    unit : int
        From 1.
    """

    def __init__(self, node: BundleNode, bundle: Any, unit: int, config: PidConfig):
        self._node = node
        self._max_pressure = float(bundle.max_pressure[unit - 1])
        self._volumes = Volume(bundle, unit - 1, node.p['tube_volume'])
        self.strain, self.supply = Latest('strain'), Latest('supply')
        self.inflow = InflowWatch(f'mu{unit}', self._inflow_config(config))
        self._strain_noise = NoiseState()
        margin = self.inflow.config.margin
        #: Jump of the strain that needs no second reading: at constant gas it moves the pressure
        #: by half of the tolerated error at most.
        self._jump = 0.5 * margin / (
            (self._max_pressure + margin + node.ambient) * self._volumes.steepest)
        self._supply_watch = SupplyWatch(node.p['supply.pressure'], LATCH_TIME)
        self._begun = -math.inf

    def begin(self, now: float) -> None:
        """Restart the checks at the time (s) when the supply opens."""
        self.inflow.begin()
        self._supply_watch.begin()
        self._begun = now

    def change(self, config: PidConfig) -> None:
        """Change the settings."""
        self.inflow.change(self._inflow_config(config))

    def _inflow_config(self, config: PidConfig) -> InflowConfig:
        p, late = self._node.p, self._node.max_latency
        period = 1.0 / p['rate']
        return InflowConfig(
            config.valve, p['supply.pressure'], self._max_pressure,
            trip_pressure(self._max_pressure, OVER_PRESSURE_FACTOR) - self._max_pressure,
            p['transport_delay'] + _SPOOL_LAG + (
                late if math.isfinite(late) else SAMPLES * period),
            period, _NOISE * p['quiet_error'], self._node.ambient)

    @property
    def _patience(self) -> float:
        """Largest age of strain and supply, s; in lock-step they come with the pressure."""
        return math.inf if self._node.lock_step else self._node.p['auxiliary_timeout']

    def take_strain(self, strain: float, rate: float) -> None:
        """Take strain and rate (1/s); a spike is left out."""
        noise, spike = self._strain_noise, False
        if math.isfinite(strain):
            spike = may_be_spike(noise, strain, self._jump)
            learn_noise(noise, strain, USUAL_NOISE, 1.0 / self._node.p['rate'])
        if not spike:
            self.strain.take(strain, rate)

    def now(self) -> tuple[float | None, float | None, float]:
        """
        Return supply (Pa) and volume (m^3), None where not known, and volume rate (m^3/s).

        A velocity that no muscle has is taken as 0.
        """
        strain, rate = self.strain.value(self._patience)
        volume, slope = self._volumes.at(strain)
        supply = self.supply.value(self._patience)[0]
        return (supply if math.isfinite(supply) else None, volume,
                slope * rate if abs(rate) <= FASTEST else 0.0)

    def impossible(self, time: float, pressure: float, gap: float) -> tuple[str, str]:
        """
        Return cause and reason if a gauge pressure (Pa) is implausible; see `InflowWatch.see`.

        The time (s) is the stamp of the reading, ``gap`` (s) the time since the previous one
        arrived.
        """
        volume, _ = self._volumes.at(self.strain.value(self._patience)[0])
        return self.inflow.see(time, pressure, self._volumes.ends if volume is None else volume,
                               self.supply.value(self._patience)[0], gap)

    def starts(self, now: float) -> bool:
        """Whether the supply may still be rising after `begin`."""
        return now - self._begun < _SUPPLY_START

    def supply_agrees(self, now: float) -> tuple[bool, str, str]:
        """
        Return whether the supply has its pressure, and cause and reason if it has not.

        The cause is empty while the supply may still be rising.
        """
        watch, since = self._supply_watch, now - self._begun
        supply = self.supply.value(self._patience)[0]
        if not math.isfinite(supply):
            return since > _SUPPLY_UNSEEN, '', f'not measured, it gets {_SUPPLY_UNSEEN:g} s'
        agrees = watch.see(now, supply, _SUPPLY_START if self.starts(now) else None)
        return agrees, SUPPLY if watch.lasts else '', watch.text

    def report(self, report: Report) -> float:
        """Report what is measured; return the supply pressure in use, Pa."""
        p = self._node.p
        supply, volume, _ = self.now()
        report.value('supply, Pa', 'not measured' if supply is None else supply)
        report.value('volume', 'not measured' if volume is None else 'of the measured strain')
        for reading, name in ((self.strain, 'volume'), (self.supply, 'supply.pressure')):
            if reading.lost(self._patience):
                report.add(WARN, f'no {reading.name} any more: the parameter {name}, '
                           f'{p[name]:g}, takes its place')
        return float(p['supply.pressure'] if supply is None else supply)


class LongestGap:
    """
    The longest gap between recent readings.

    Gaps count for ``window`` (s) at least and for twice this time at most.

    Examples
    --------
    >>> gaps = LongestGap(1.0)
    >>> gaps.see(0.0, 0.05), gaps.see(0.5, 0.005), gaps.see(1.2, 0.005), gaps.see(2.3, 0.005)
    (0.05, 0.05, 0.05, 0.005)
    """

    def __init__(self, window: float):
        self._window = window
        self._since = -math.inf
        self._before = self._lately = 0.0

    def see(self, now: float, gap: float) -> float:
        """Take a gap (s) that ended ``now``; return the longest."""
        if now - self._since >= self._window:
            self._since, self._before, self._lately = now, self._lately, 0.0
        self._lately = max(self._lately, gap)
        return max(self._before, self._lately)


class Stretch:
    """Time for which a value has been beyond a bound on one side."""

    def __init__(self) -> None:
        self.lasted = 0.0
        self._side, self._since = 0, 0.0

    def see(self, now: float, value: float, far: float) -> None:
        """Take a value at a time (s); the bounds are -``far`` and ``far``."""
        side = (value > far) - (value < -far)
        if side != self._side or now < self._since:
            self._side, self._since = side, now
        self.lasted = now - self._since if side else 0.0
