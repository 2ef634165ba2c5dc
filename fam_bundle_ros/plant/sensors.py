# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The instruments of the rig: noise, bias, quantisation, dropout, a filtered rate.

Channels are, in this order: force, strain, supply, and the pressure of each motor unit.
"""

from dataclasses import dataclass
from functools import cache
import math
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant.checks import require
from fam_bundle_ros.plant.lines import DelayLine, find, lag, PLACES, put, read_between

#: Channels before the pressures of the motor units, and the index of each.
FORCE, STRAIN, SUPPLY, PRESSURE = range(4)
_BLOCK = 1024
#: s between two spikes of a channel (`Faults.spike`).
SPIKE_INTERVAL = 0.1
#: Adding and subtracting it rounds a float to an integer (half to even, as `round`).
_ROUNDER = 1.5 * 2.0 ** 52


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
    A channel without a reading (dropout) is nan.
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
        Readings are multiples of these; 0 for no quantisation.
    force_lag, pressure_lag, strain_lag : float, s
        Time constant of the first-order lag of instrument and amplifier; 0 for none.
    delay : float, s
        Dead time of all readings (conversion, bus, driver), which keep their stamps.
    rate_cutoff : float, Hz
        Cut-off of the first-order low-pass on the differentiated strain.
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
    force_lag: float = 0.0
    pressure_lag: float = 0.0
    strain_lag: float = 0.0
    delay: float = 0.0
    rate_cutoff: float = 20.0
    dropout: float = 0.0
    on_dropout: str = 'nan'

    def __post_init__(self):
        require(self, 'force_noise', 'pressure_noise', 'strain_noise', 'force_resolution',
                'pressure_resolution', 'strain_resolution', 'force_lag', 'pressure_lag',
                'strain_lag', 'delay', least=0.0)
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
class SensorRecord:
    """Constants of the instruments for kernels; lists have one value per channel."""

    #: Sensor effects of the plant's own model: reading = gain x true + offset + drift t.
    gain: list[float]
    offset: list[float]
    drift: list[float]
    #: Errors of the instruments (`SensorConfig`).
    bias: list[float]
    noise: list[float]
    resolution: list[float]
    #: s, lag of each channel; delay of all; whether any of them is above 0.
    lag: list[float]
    delay: float
    late: bool
    rate_cutoff: float
    dropout: float
    hold: bool

    @classmethod
    def of(cls, config: SensorConfig, gain: list[float], offset: list[float],
           drift: list[float], late: list[float]) -> 'SensorRecord':
        """Return the constants; lists (c,) are the errors of the plant's gauges, ``late`` in s."""
        c, pressures = config, len(gain) - 2
        lags = [own + of_plant for own, of_plant in zip(
            [c.force_lag, c.strain_lag] + [c.pressure_lag] * pressures, late)]
        return cls(list(map(float, gain)), list(map(float, offset)), list(map(float, drift)),
                   [c.force_bias, c.strain_bias] + [c.pressure_bias] * pressures,
                   [c.force_noise, c.strain_noise] + [c.pressure_noise] * pressures,
                   [c.force_resolution, c.strain_resolution]
                   + [c.pressure_resolution] * pressures, lags, float(c.delay),
                   c.delay > 0.0 or max(lags) > 0.0, c.rate_cutoff, c.dropout,
                   c.on_dropout == 'hold')


@dataclass
class SensorState:
    """State of the instruments with their last readings."""

    shown: list[float]
    #: The same without faults.
    sound: list[float]
    #: Instruments with lag or delay: output of the lag; output of both; last true values; delay
    #: line.
    lagged: list[float]
    late: list[float]
    before: list[float]
    line: DelayLine
    #: Faults: delay line of readings without faults; start of a drift or of spikes of a channel,
    #: s, nan without them; number of spikes.
    held_up: DelayLine
    since: list[float]
    spikes: list[float]
    #: Noise of the last sample; reading at which a plugged channel stays, nan for none.
    noise: list[float]
    plugged: list[float]
    #: s, time of the last true values.
    felt_at: float = math.nan
    #: 1/s; nan without a strain reading.
    strain_rate: float = math.nan
    #: State of the rate's filter, 1/s; last strain reading and its time.
    filtered: float = 0.0
    last_strain: float = math.nan
    last_time: float = math.nan
    #: N, subtracted from the force reading.
    tare: float = 0.0

    @classmethod
    def fresh(cls, channels: int) -> 'SensorState':
        """Return the initial state, without readings."""
        def zero() -> list[float]:
            return [0.0] * channels

        def none() -> list[float]:
            return [math.nan] * channels
        return cls(shown=none(), sound=none(), lagged=zero(), late=zero(), before=zero(),
                   line=DelayLine.empty(channels), held_up=DelayLine.empty(channels),
                   since=none(), spikes=zero(), noise=zero(), plugged=none())


def read_sensors(config: Any, state: Any, true: Any, time: float, faults: Any, normal: Any,
                 chance: Any) -> None:
    """
    Take one sample of all instruments; ``state`` receives the readings.

    Parameters
    ----------
    true : vector (c,)
        True values of the channels.
    time : float, s
    normal, chance : vector (c,)
        Random numbers of this sample: standard normal, and uniform in 0..1. They are drawn in
        every case, so that a fault never changes the noise of another channel.
    """
    if config.late:
        feel_late(config, state, true, time)
    for i in range(len(true)):
        if chance[i] < config.dropout:
            if not config.hold:
                state.sound[i] = math.nan
            continue
        value = state.late[i] if config.late else true[i]
        value = config.gain[i] * value + config.offset[i] + config.drift[i] * time
        if i == FORCE:
            value -= state.tare
        state.noise[i] = faults.noise_factor * config.noise[i] * normal[i]
        value += config.bias[i] + state.noise[i]
        step = config.resolution[i]
        if step > 0.0:
            value = step * ((value / step + _ROUNDER) - _ROUNDER)
        state.sound[i] = value
    if faults.spoilt:
        spoil(faults, state, time, chance)
    else:
        state.held_up.size = 0
        for i in range(len(true)):
            state.shown[i], state.since[i] = state.sound[i], math.nan
            state.plugged[i] = math.nan
    filter_rate(config, state, time)


def spoil(faults: Any, state: Any, time: float, chance: Any) -> None:
    """
    Apply the faults to the readings ``state.sound`` at a time, s; write ``state.shown``.

    ``chance`` (c,) is that of `read_sensors`.
    """
    if faults.longest > 0.0:
        put(state.held_up, time, state.sound, faults.longest)
    else:
        state.held_up.size = 0
    for i in range(len(state.shown)):
        source = faults.reading_of[i]
        value = state.sound[source]
        if faults.delay[i] > 0.0:
            line = state.held_up
            value = line.values[(line.head + find(line, time - faults.delay[i])) % PLACES][source]
        if value > faults.range_end[i] + state.noise[source]:
            value = faults.range_end[i] + state.noise[source]
        if faults.plugged[i] == 0:
            state.plugged[i] = math.nan
        else:
            if math.isnan(state.plugged[i]):
                state.plugged[i] = value - state.noise[source]
            value = state.plugged[i] + state.noise[source]
        if faults.drift[i] == 0.0 and faults.spike[i] == 0.0:
            state.since[i] = math.nan
        elif math.isnan(state.since[i]):
            state.since[i], state.spikes[i] = time, 0.0
        value = faults.gain[i] * value + faults.offset[i]
        if not math.isnan(state.since[i]):
            value += faults.drift[i] * (time - state.since[i])
            count = math.floor((time - state.since[i]) / SPIKE_INTERVAL + 1e-6)
            if count > state.spikes[i]:
                value += faults.spike[i]
                state.spikes[i] = count
        if faults.lost[i] != 0:
            value = math.nan
        elif (not math.isnan(state.shown[i])
              and (faults.held[i] != 0 or 1.0 - chance[i] < faults.skipped[i])):
            # A frozen channel repeats; after a lost message the reader keeps the last reading.
            continue
        state.shown[i] = value


def feel_late(config: Any, state: Any, true: Any, time: float) -> None:
    """Apply lag and delay to the true values at ``time`` (s); write ``state.late``."""
    dt = time - state.felt_at
    for i in range(len(true)):
        if math.isnan(dt):
            state.lagged[i] = true[i]
        elif dt > 0.0:
            state.lagged[i] = lag(state.lagged[i], state.before[i], true[i], dt, config.lag[i])
        state.before[i] = true[i]
    state.felt_at = time
    put(state.line, time, state.lagged, config.delay)
    read_between(state.line, time - config.delay, state.late)


def filter_rate(config: Any, state: Any, time: float) -> None:
    """Differentiate the strain reading and low-pass it; reset after a lost reading."""
    strain, before, at = state.shown[STRAIN], state.last_strain, state.last_time
    state.last_strain, state.last_time = strain, time
    if math.isnan(strain):
        state.strain_rate = math.nan
        return
    if math.isnan(before):
        state.filtered = 0.0
    elif time > at:
        gain = -math.expm1(-2.0 * math.pi * config.rate_cutoff * (time - at))
        state.filtered += gain * ((strain - before) / (time - at) - state.filtered)
    state.strain_rate = state.filtered


class Draws:
    """The random numbers of a rig's instruments, one row for each sample."""

    def __init__(self, seed: int, channels: int):
        streams = np.random.SeedSequence(seed).spawn(2)
        self._normal = np.random.default_rng(streams[0])
        self._uniform = np.random.default_rng(streams[1])
        self._ahead = np.empty((2, 0, channels))

    def rows(self, count: int) -> np.ndarray:
        """Return the next rows of normal and of uniform numbers, shape (2, count, channels)."""
        if self._ahead.shape[1] < count:
            shape = (max(count, _BLOCK), self._ahead.shape[2])
            more = np.stack([self._normal.standard_normal(shape), self._uniform.random(shape)])
            self._ahead = np.concatenate([self._ahead, more], axis=1)
        rows, self._ahead = self._ahead[:, :count], self._ahead[:, count:]
        return rows

    def row(self) -> list[list[float]]:
        """Return the next row of normal and of uniform numbers."""
        return self.rows(1)[:, 0].tolist()


@cache
def channel_names(units: int) -> tuple[str, ...]:
    """Return the names of the channels, as `Faults` takes them."""
    return ('force', 'strain', 'supply', *(f'mu{i + 1}/pressure' for i in range(units)))
