# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a bundle is made of, what it is put through, and what is found out about it."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fam_bundle_ros.model.geometry import Geometry

#: Highest gauge pressure that a motor unit may have, Pa, and its most muscles.
MAX_PRESSURE = 20e6
MOST_MUSCLES = 1000


@dataclass(frozen=True)
class MotorUnit:
    """
    Muscles that share one valve.

    Parameters
    ----------
    name : str
    muscles : int
        How many equal muscles it holds.
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
    A record of what the bundle did: the input of `Bundle.simulate` and `Bundle.predict`.

    Parameters
    ----------
    strain : array (T,)
    pressure : array (T, n), Pa (gauge)
    strain_rate : array (T,), 1/s
    time : array (T,), s, or None for a static map (no memory, no order)
    start : array (T,) of bool
        The first sample of each trial, where memory begins afresh.
    """

    strain: np.ndarray
    pressure: np.ndarray
    strain_rate: np.ndarray
    time: np.ndarray | None = None
    start: np.ndarray | None = None

    @cached_property
    def clock(self) -> np.ndarray:
        """Time since the record began, (T,), s; zero without time."""
        if self.time is None:
            return np.zeros(len(self.strain))
        return np.asarray(self.time, float) - self.time[:1]

    @cached_property
    def stepping(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Time steps (T,), s, zero where a trial begins; where one does; where the record does."""
        first = np.arange(len(self.strain)) == 0
        start = first if self.start is None else first | self.start
        return np.where(start, 0.0, np.diff(self.clock, prepend=0.0)), start, first


@dataclass(frozen=True)
class Overlap:
    """
    Forces at one strain that two neighbouring recruitment states can both give.

    Parameters
    ----------
    low, high : float, N
        The overlap region; ``high`` is the largest force of the lower state.
    dip : float, N
        How far the force falls while the next motor unit fills: its push-back.
    dip_pressure, onset_pressure : float, Pa (gauge)
        Pressure of the next unit at the bottom of the dip, and where the force is back.
    """

    low: float
    high: float
    dip: float
    dip_pressure: float
    onset_pressure: float
    width: float = field(init=False)

    def __post_init__(self):
        """Work out the width of the region."""
        object.__setattr__(self, 'width', self.high - self.low)


@dataclass(frozen=True)
class SensorError:
    """
    Errors of readings: shown = true (1 + gain) + bias + drift t.

    Of each channel: biases in N, Pa and strain, gains dimensionless, drifts per s; t since the
    log, or the rig, began. The strain's lag, s: below zero the other channels are late.
    """

    force_bias: float = 0.0
    force_gain: float = 0.0
    force_drift: float = 0.0
    pressure_bias: float = 0.0
    pressure_gain: float = 0.0
    pressure_drift: float = 0.0
    strain_bias: float = 0.0
    strain_gain: float = 0.0
    strain_drift: float = 0.0
    strain_lag: float = 0.0


@dataclass(frozen=True)
class Pneumatics:
    """
    Properties of a bundle's air that the plant needs.

    Parameters
    ----------
    leak_rate : float, 1/s
        Relative loss of gauge pressure of a closed chamber.
    supply_resistance : float, Pa s/kg
        Fall of the supply's pressure per mass flow.
    """

    leak_rate: float = 0.0
    supply_resistance: float = 0.0
