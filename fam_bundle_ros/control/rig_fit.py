# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Identification of a valve: conductance, dead band and dead time from commands and pressures.

Independent of ROS. Pressures are gauge.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fam_bundle_ros.control.valve_learning import CONDUCTANCE_DOUBT, dead_band_doubt
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, mass_flow, POLYTROPIC, RT, ValveFlow

#: Grids of dead times (s) and dead bands (share of the full command); number of refinements.
_DELAYS, _BANDS = np.linspace(0.0, 0.08, 41), np.linspace(0.0, 0.5, 51)
_FINER = 3
#: Least number of samples for a fit.
_LEAST = 20


@dataclass(frozen=True)
class ValveFit:
    """
    Result of `fit_valve`.

    Attributes
    ----------
    conductance : float, m^3/(s Pa)
        For the gas volume given: pressures determine only their ratio.
    dead_band : float
    delay : float, s
        From the stamp of a reading to the flow due to its command, including the spool's lag.
    misfit : float, Pa
        rms of the residual.
    """

    conductance: float
    dead_band: float
    delay: float
    misfit: float


def fit_valve(time: ArrayLike, pressure: ArrayLike, command: ArrayLike, volume: ArrayLike,
              supply: float, ambient: float = ATMOSPHERE,
              critical_ratio: float = ValveFlow().critical_ratio, blocks: Sequence[int] = ()
              ) -> ValveFit:
    """
    Fit the valve of one motor unit by least squares.

    For a given dead time and dead band, the integral of dp/dt = n (R T m - p dV/dt)/V
    (`pressure_rate`, ISO 6358 for m) at the measured pressures and volumes is linear in the
    conductance. Dead time and dead band are searched for on a grid that is refined around the best
    point.

    Parameters
    ----------
    time, pressure, command : array_like (T,), s, Pa and 1
        Stamps, readings, and the command computed from each.
    volume : array_like, scalar or (T,), m^3
        Gas volume with tubing.
    supply : float, Pa
    ambient : float, Pa (absolute)
    critical_ratio : float
    blocks : sequence of int
        Samples at which a new record starts; each has its own offset, so that leaks and settling
        air do not accumulate.

    Raises
    ------
    InputError
        With too few samples, or if no command changes the pressure.
    """
    t, p, u = (np.asarray(values, float) for values in (time, pressure, command))
    v = np.broadcast_to(np.asarray(volume, float), t.shape)
    if len(t) < _LEAST:
        raise InputError(f'{len(t)} samples of valve and pressure; expected {_LEAST} or more')
    flow_in, flow_out = (np.array([mass_flow(1.0, critical_ratio, *ends) for ends in pairs])
                         for pairs in ([(supply + ambient, x + ambient) for x in p],
                                       [(x + ambient, ambient) for x in p]))
    # Without the fall of the pressure that is due to a growing volume.
    swept = np.diff(v) * (p[1:] + p[:-1] + 2.0 * ambient) / (v[1:] + v[:-1])
    driven = p + POLYTROPIC * np.concatenate([[0.0], np.cumsum(swept)])
    record = _Record(t, driven, u, POLYTROPIC * RT * flow_in / v, POLYTROPIC * RT * flow_out / v,
                     [0, *blocks, len(t)])
    delays, bands = _DELAYS, _BANDS
    best = (np.inf, 0.0, 0.0, 0.0)
    for _ in range(_FINER):
        for delay in delays:
            for band in bands:
                cost, conductance = record.cost(max(delay, 0.0), min(max(band, 0.0), 0.9))
                if cost < best[0]:
                    best = cost, conductance, max(delay, 0.0), min(max(band, 0.0), 0.9)
        delays = best[2] + (delays[1] - delays[0]) * np.linspace(-1.0, 1.0, 9)
        bands = best[3] + (bands[1] - bands[0]) * np.linspace(-1.0, 1.0, 9)
    cost, conductance, delay, band = best
    if not conductance > 0.0:
        raise InputError('no command moves the pressure; expected it to rise with positive ones')
    return ValveFit(float(conductance), float(band), float(delay), float(np.sqrt(cost)))


class _Record:
    """A record, prepared for many evaluations."""

    def __init__(self, time, pressure, command, filling, venting, edges):
        self._time, self._command = time, command
        self._filling, self._venting = filling, venting
        self._blocks = [slice(a, b) for a, b in zip(edges, edges[1:]) if b - a > 1]
        self._pressure = self._centred(pressure)

    def _centred(self, values):
        return np.concatenate([values[block] - values[block].mean() for block in self._blocks])

    def cost(self, delay: float, band: float) -> tuple[float, float]:
        """Return the mean squared misfit (Pa^2) and the conductance."""
        size = np.clip((np.abs(self._command) - band) / (1.0 - band), 0.0, 1.0)
        opened = np.sign(self._command) * size
        # Commands are held until the next: integrate them over time, delayed by the dead time.
        widths = np.diff(self._time)
        rise = np.zeros(len(self._time))
        for side, rate in ((np.maximum(opened, 0.0), self._filling),
                           (np.minimum(opened, 0.0), self._venting)):
            total = np.concatenate([[0.0], np.cumsum(side[:-1] * widths)])
            late = np.interp(self._time - delay, self._time, total)
            rise[1:] += np.diff(late) * 0.5 * (rate[1:] + rate[:-1])
        shape = self._centred(np.cumsum(rise))
        power = float(shape @ shape)
        if power <= 0.0:
            return float(np.mean(self._pressure ** 2)), 0.0
        conductance = max(float(shape @ self._pressure) / power, 0.0)
        return float(np.mean((self._pressure - conductance * shape) ** 2)), conductance


def split_volume(conductances: Sequence[float], gas: Sequence[float], told: float
                 ) -> tuple[float, float] | None:
    """
    Return conductance and tube volume of equal valves on muscles of different volumes.

    Pressures determine only C/(V + T); with different gas volumes V, C and T follow from two or
    more of them by least squares.

    Parameters
    ----------
    conductances : sequence (n,), m^3/(s Pa)
        Fitted with the tube volume ``told``.
    gas : sequence (n,), m^3
        Gas volumes of the muscles.
    told : float, m^3
        Assumed tube volume.

    Returns
    -------
    (float, float) or None
        None where the volumes are too similar, or the tube volume is implausible.
    """
    volume = np.asarray(gas, float)
    if volume.max() < 1.5 * volume.min():
        return None
    ratio = np.asarray(conductances, float) / (volume + told)
    # C - r T = r V, with equal weights of the ratios.
    (conductance, tube), *_ = np.linalg.lstsq(
        np.stack([1.0 / ratio, -np.ones(len(ratio))], axis=1), volume, rcond=None)
    if not 0.0 <= tube <= volume.max():
        return None
    return float(conductance), float(tube)


def apart_words(conductances: Sequence[float], names: Sequence[str]) -> str:
    """
    Return that the valves differ by more than a controller tolerates, else an empty string.

    The controllers take one conductance for all, which may be wrong by `CONDUCTANCE_DOUBT`.

    Parameters
    ----------
    conductances : sequence (n,), m^3/(s Pa)
    names : sequence of str
        Motor units, in the same order.
    """
    values = np.asarray(conductances, float)
    if np.all(np.abs(values / values.mean() - 1.0) <= CONDUCTANCE_DOUBT):
        return ''
    told = ', '.join(f'{name} {value:.3g}' for name, value in zip(names, values))
    return (f'conductances are {told} m^3/(s Pa); expected equal valves, within '
            f'{100.0 * CONDUCTANCE_DOUBT:.0f} % of their mean. A load that moves while a unit '
            'fills falsifies its fit: hold it, or check valves and tubes')


def bands_apart_words(dead_bands: Sequence[float], names: Sequence[str]) -> str:
    """
    Return that dead bands differ by more than a controller tolerates, else an empty string.

    Parameters
    ----------
    dead_bands : sequence (n,)
    names : sequence of str
        Motor units, in the same order.
    """
    values = np.asarray(dead_bands, float)
    middle = float(values.mean())
    most = dead_band_doubt(middle)
    if np.all(np.abs(values - middle) <= most):
        return ''
    told = ', '.join(f'{name} {value:.3f}' for name, value in zip(names, values))
    return (f'dead bands are {told}; expected equal valves, within {most:.3f} of their mean of '
            f'{middle:.3f}, which all loops are given')
