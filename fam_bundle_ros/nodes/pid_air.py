# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gas volume, supply and plausible pressures of a motor unit, for its pressure loop."""

import math
from typing import Any

from fam_bundle_ros.control import PidConfig
from fam_bundle_ros.control.agreement import SupplyWatch
from fam_bundle_ros.control.plausibility import InflowConfig, InflowWatch
from fam_bundle_ros.control.safety import LATCH_TIME, OVER_PRESSURE_FACTOR, SUPPLY, trip_pressure
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import Report, WARN
from fam_bundle_ros.nodes.interface import FASTEST
from fam_bundle_ros.nodes.pid_readings import Latest, Volume

#: Lag from command to flow in addition to the dead time, s.
_SPOOL_LAG = 2e-3
#: Default delay of a driver from a command to the reading of its effect, in samples.
SAMPLES = 3.0
#: Bound of the noise of a pressure difference, in units of ``quiet_error`` (three standard
#: deviations of the noise): holds for noise twice as large.
_NOISE = 4.0
#: Time for the supply to rise after `supply_enable`: with and without a supply sensor, s.
_SUPPLY_START, _SUPPLY_UNSEEN = 1.0, 0.3


class Air:
    """
    Keeps strain and supply, and checks pressure and supply for plausibility.

    Parameters
    ----------
    node : BundleNode
        With the parameters of `pid_parameters`.
    bundle : Bundle
    unit : int
        From 1.
    config : PidConfig

    Attributes
    ----------
    strain, supply : Latest
    inflow : InflowWatch
    """

    def __init__(self, node: BundleNode, bundle: Any, unit: int, config: PidConfig):
        self._node = node
        self._max_pressure = float(bundle.max_pressure[unit - 1])
        self._volumes = Volume(bundle, unit - 1, node.p['tube_volume'])
        self.strain, self.supply = Latest('strain'), Latest('supply')
        self.inflow = InflowWatch(f'mu{unit}', self._inflow_config(config))
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
        Return cause and reason if a pressure (Pa) is implausible; see `InflowWatch.see`.

        Parameters
        ----------
        time : float, s
            Stamp of the reading.
        pressure : float, Pa (gauge)
        gap : float, s
            Time since the previous reading arrived.
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
