# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the instruments of the rig show: noise, bias, quantisation, dropout, a filtered rate."""

from dataclasses import dataclass, field
import math

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant.checks import require

_BLOCK = 1024


@dataclass(frozen=True, eq=False)
class Readings:
    """
    One sample of a rig.

    Parameters
    ----------
    time : float, s
    force : float, N
        Tension positive.
    strain : float
        Positive when shorter.
    contraction : float, m
        Strain times rest length.
    strain_rate : float, 1/s
    pressure : ndarray, shape (n,), Pa (gauge)
    supply : float, Pa (gauge)
        Pressure of the manifold.

    Notes
    -----
    A channel that has dropped out is nan.
    """

    time: float
    force: float
    strain: float
    contraction: float
    strain_rate: float
    pressure: np.ndarray
    supply: float


@dataclass(frozen=True)
class SensorConfig:
    """
    Errors of the instruments; noise is white, its standard deviation given per sample.

    Parameters
    ----------
    force_noise, pressure_noise, strain_noise : float, N, Pa, 1
    force_bias, pressure_bias, strain_bias : float, N, Pa, 1
    force_resolution, pressure_resolution, strain_resolution : float, N, Pa, 1
        Readings come in multiples of these; 0 for none.
    rate_cutoff : float, Hz
        Of the first-order low-pass behind the differentiated strain.
    dropout : float
        Probability that a channel has no reading in a sample.
    on_dropout : str
        ``'nan'``, or ``'hold'`` for an instrument that repeats its last reading.
    """

    force_noise: float = 0.9
    pressure_noise: float = 350.0
    strain_noise: float = 5e-5
    force_bias: float = 0.0
    pressure_bias: float = 0.0
    strain_bias: float = 0.0
    force_resolution: float = 0.01
    pressure_resolution: float = 50.0
    strain_resolution: float = 1e-5
    rate_cutoff: float = 20.0
    dropout: float = 0.0
    on_dropout: str = 'nan'

    def __post_init__(self):
        require(self, 'force_noise', 'pressure_noise', 'strain_noise', 'force_resolution',
                'pressure_resolution', 'strain_resolution', least=0.0)
        require(self, 'force_bias', 'pressure_bias', 'strain_bias')
        require(self, 'rate_cutoff', above=0.0)
        require(self, 'dropout', least=0.0, most=1.0)
        if self.on_dropout not in ('nan', 'hold'):
            raise InputError(f"SensorConfig.on_dropout is {self.on_dropout!r}; "
                             "expected 'nan' or 'hold'")

    @classmethod
    def ideal(cls) -> 'SensorConfig':
        """Return instruments without noise and quantisation (the rate stays filtered)."""
        return cls(force_noise=0.0, pressure_noise=0.0, strain_noise=0.0,
                   force_resolution=0.0, pressure_resolution=0.0, strain_resolution=0.0)


@dataclass
class SensorFaults:
    """What is wrong with the instruments at the moment."""

    #: Names of channels without readings: 'force', 'strain', 'supply', 'mu1/pressure', ...
    dropout: set[str] = field(default_factory=set)
    #: Factor on the noise of every channel.
    noise_factor: float = 1.0


class Sensors:
    """
    The instruments of one rig, with their random numbers.

    Every sample takes one row of random numbers whatever is switched on, so that a fault or
    another noise level never changes the noise of the other channels.

    Parameters
    ----------
    config : SensorConfig
    units : int
    seed : int
    """

    def __init__(self, config: SensorConfig, units: int, seed: int):
        self.config = config
        self.channels = ('force', 'strain', 'supply',
                         *(f'mu{i + 1}/pressure' for i in range(units)))
        self._seed = seed
        c = config
        self._noise = [c.force_noise, c.strain_noise] + [c.pressure_noise] * (units + 1)
        self._bias = [c.force_bias, c.strain_bias] + [c.pressure_bias] * (units + 1)
        self._resolution = ([c.force_resolution, c.strain_resolution]
                            + [c.pressure_resolution] * (units + 1))
        self.reset()

    def reset(self) -> None:
        """Start the random numbers and the rate filter afresh; the tare is undone."""
        streams = np.random.SeedSequence(self._seed).spawn(2)
        self._normal = np.random.default_rng(streams[0])
        self._uniform = np.random.default_rng(streams[1])
        self._rows: list[list[float]] = []
        self._losses: list[list[float]] = []
        self._row = 0
        self._shown = [math.nan] * len(self.channels)
        self._last = (math.nan, math.nan)
        self._rate = 0.0
        #: N, taken off the force reading.
        self.tare = 0.0

    def read(self, truth: Readings, length: float, faults: SensorFaults) -> Readings:
        """
        Return what the instruments show of ``truth``.

        Parameters
        ----------
        truth : Readings
        length : float, m
            Rest length of the bundle.
        faults : SensorFaults

        Raises
        ------
        InputError
            When a fault names a channel that is not there.
        """
        config = self.config
        self._check(faults)
        if self._row == len(self._rows):
            width = len(self.channels)
            self._rows = self._normal.standard_normal((_BLOCK, width)).tolist()
            self._losses = self._uniform.random((_BLOCK, width)).tolist()
            self._row = 0
        normal, loss = self._rows[self._row], self._losses[self._row]
        self._row += 1
        true = [truth.force - self.tare, truth.strain, truth.supply, *truth.pressure.tolist()]
        shown = []
        for i, value in enumerate(true):
            if loss[i] < config.dropout or self.channels[i] in faults.dropout:
                shown.append(self._shown[i] if config.on_dropout == 'hold' else math.nan)
                continue
            value += self._bias[i] + faults.noise_factor * self._noise[i] * normal[i]
            step = self._resolution[i]
            shown.append(step * round(value / step) if step else value)
        self._shown = shown
        rate = self._filter(truth.time, shown[1])
        return Readings(truth.time, shown[0], shown[1], shown[1] * length, rate,
                        np.array(shown[3:]), shown[2])

    def _filter(self, time: float, strain: float) -> float:
        """Differentiate the reading and low-pass it; afresh after a reading that was lost."""
        before, at = self._last
        self._last = (strain, time)
        if math.isnan(strain):
            return math.nan
        if math.isnan(before):
            self._rate = 0.0
        elif time > at:
            gain = -math.expm1(-2.0 * math.pi * self.config.rate_cutoff * (time - at))
            self._rate += gain * ((strain - before) / (time - at) - self._rate)
        return self._rate

    def _check(self, faults: SensorFaults) -> None:
        for channel in faults.dropout:
            if channel not in self.channels:
                raise InputError(f"no sensor channel '{channel}'; there are "
                                 f"{', '.join(self.channels)}")
