# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Data classes of a bundle: motor units, records of motion, overlap, sensor errors, pneumatics."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fam_bundle_ros.model.geometry import Geometry

#: Upper limit of the highest gauge pressure of a motor unit, Pa.
MAX_PRESSURE = 20e6
#: Largest number of muscles in a motor unit.
MOST_MUSCLES = 1000


@dataclass(frozen=True)
class MotorUnit:
    """
    Muscles that share one valve.

    Parameters
    ----------
    name : str
    muscles : int
        Number of equal muscles.
    geometry : Geometry
    max_pressure : float, Pa (gauge)
    """

    name: str
    muscles: int
    geometry: Geometry
    max_pressure: float = 413.7e3


@dataclass(frozen=True)
class Motion:
    """
    A record of the motion of a bundle: the input of `Bundle.simulate` and `Bundle.predict`.

    Parameters
    ----------
    strain : array (T,)
    pressure : array (T, n), Pa (gauge)
    strain_rate : array (T,), 1/s
    time : array (T,), s, or None for a static map (no memory, no order)
    start : array (T,) of bool
        The first sample of each trial, where memory is reset.
    """

    strain: np.ndarray
    pressure: np.ndarray
    strain_rate: np.ndarray
    time: np.ndarray | None = None
    start: np.ndarray | None = None

    @cached_property
    def clock(self) -> np.ndarray:
        """Time since the start of the record, (T,), s; zero for a static map."""
        if self.time is None:
            return np.zeros(len(self.strain))
        return np.asarray(self.time, float) - self.time[:1]

    @cached_property
    def stepping(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Time steps, s (0 where a trial starts); starts of trials; start of the record; (T,)."""
        first = np.arange(len(self.strain)) == 0
        start = first if self.start is None else first | self.start
        return np.where(start, 0.0, np.diff(self.clock, prepend=0.0)), start, first


@dataclass(frozen=True)
class Overlap:
    """
    Range of forces at one strain that two neighbouring recruitment states can both produce.

    Parameters
    ----------
    low, high : float, N
        Limits of the range; ``high`` is the largest force of the lower state.
    dip : float, N
        Decrease of the force while the next motor unit fills, due to its resistive force.
    dip_pressure, onset_pressure : float, Pa (gauge)
        Pressure of the next unit at the lowest force, and where the force has recovered.
    """

    low: float
    high: float
    dip: float
    dip_pressure: float
    onset_pressure: float

    @property
    def width(self) -> float:
        """Width of the range, N."""
        return self.high - self.low


@dataclass(frozen=True)
class SensorError:
    """
    Errors of the sensors: reading = true (1 + gain) + bias + drift t.

    For each channel the bias is in N, Pa or strain, the gain dimensionless, the drift per s; t is
    the time since the start of the log or rig. Those of the pressure may differ between motor
    units, shape (n,). ``strain_lag``, s, is the delay of the strain
    reading; if negative, the other channels are delayed.
    """

    force_bias: float = 0.0
    force_gain: float = 0.0
    force_drift: float = 0.0
    pressure_bias: float | np.ndarray = 0.0
    pressure_gain: float | np.ndarray = 0.0
    pressure_drift: float | np.ndarray = 0.0
    strain_bias: float = 0.0
    strain_gain: float = 0.0
    strain_drift: float = 0.0
    strain_lag: float = 0.0


@dataclass(frozen=True)
class Pneumatics:
    """
    Pneumatic properties of a bundle for the plant.

    Parameters
    ----------
    leak_rate : float, 1/s
        Relative loss of gauge pressure of a closed chamber per time.
    supply_resistance : float, Pa s/kg
        Drop of the supply pressure per mass flow.
    """

    leak_rate: float = 0.0
    supply_resistance: float = 0.0
