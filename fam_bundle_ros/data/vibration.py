# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A periodic error of the force in time: a frame that vibrates, or hum folded by sampling."""

from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.rates import begins, FALSE_ALARM

#: Zero padding of the spectrum: the amplitude of a peak is found within 1 %.
_PADDED = 8
#: Bins over the range of strain or pressure, in which a periodic function of it is seen.
_BINS = 60
#: Rounds of alternating least squares for an amplitude for each trial.
_ROUNDS = 4


class Vibration(NamedTuple):
    """Period, s, and amplitude, N."""

    period: float
    amplitude: float


def vibration(measurement: Measurement, values: np.ndarray, noise: float) -> Vibration | None:
    """
    Return the sine in time that is most of what exceeds the white noise, or None.

    The spectrum is the sum of the periodograms of the trials (Deeming 1975, for rows with gaps),
    so the phase may differ between trials. Its peak must be higher than white noise reaches with
    probability `FALSE_ALARM`, and must be more than half of what exceeds the white noise, with
    more than two periods in a trial: in drift and other noise that grows towards low frequencies,
    one or two periods per trial have as much. A function of strain or pressure, and of direction,
    that is passed at constant speed is periodic in time too: means over cells of strain, or of a
    pressure, and direction must explain less, also with an amplitude for each trial, as of an
    error that grows with the pressure of isobars. Where most places are passed only once, there
    are no such means, and more than two periods in a pass are required. A sine with the period of
    the strain or of a pressure must explain less too: it may be their effect with a lag.

    Parameters
    ----------
    measurement : Measurement
        With time.
    values : ndarray, shape (T,), N
        Measured minus modelled force.
    noise : float, N
        Standard deviation of the white noise.
    """
    clock = measurement.clock
    trials = [np.flatnonzero(measurement.trial == k) for k in np.unique(measurement.trial)]
    longest = max(float(np.ptp(clock[rows])) for rows in trials)
    # shorter trials do not resolve the lowest frequency
    trials = [rows for rows in trials if np.ptp(clock[rows]) >= 0.5 * longest]
    steps = np.concatenate([np.diff(clock[rows]) for rows in trials])
    if not (steps > 0.0).any():
        return None
    # after a pause in a trial most places of a fine grid would be empty
    step = max(float(np.median(steps[steps > 0.0])), longest / (_PADDED * max(map(len, trials))))
    length = round(longest / step) + 1
    frequency = np.fft.rfftfreq(_PADDED * length, step)

    def spectrum(of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sum of periodograms over the trials, and the deviations from their means."""
        power, y = np.zeros(len(frequency)), np.zeros(len(of))
        for rows in trials:
            y[rows] = of[rows] - of[rows].mean()
            place = np.round((clock[rows] - clock[rows[0]]) / step).astype(int)
            even = np.bincount(place, y[rows], minlength=length)
            power += 2.0 / len(rows) * np.abs(np.fft.rfft(even, _PADDED * length)) ** 2
        return power, y

    power, y = spectrum(values)
    rows = np.concatenate(trials)
    total = float(y @ y)
    free = len(rows) - 3 * len(trials)
    peak = int(np.argmax(np.where(frequency > 2.0 / longest, power, 0.0)))
    height = power[peak]
    if free < 1 or not 0.0 < total - len(rows) * noise ** 2 < 2.0 * height:
        return None
    left = max(total - height, np.finfo(float).eps * total)
    ratio = height / (2 * len(trials)) / (left / free)
    chance = fdtrc(2 * len(trials), free, ratio)
    if len(frequency) / _PADDED * chance > FALSE_ALARM:
        return None
    seen = measurement.select(rows)
    place, once = _share_of_place(seen, y[rows])
    if once and frequency[peak] * _longest_pass(seen) <= 2.0:
        return None
    # sines with the periods of strain and pressures
    driven = max((power[np.argmax(spectrum(column)[0])] / total
                  for column in (measurement.strain, *measurement.pressure.T)
                  if np.ptp(column) > 0.0), default=0.0)
    other = max(place, driven)
    # the other explains as much, within two standard errors of R^2
    error = 2.0 * np.sqrt(max(other, 0.0) / len(rows)) * (1.0 - other)
    if height / total <= other + 2.0 * error:
        return None
    return Vibration(float(1.0 / frequency[peak]), float(np.sqrt(2.0 * height / len(rows))))


def _longest_pass(measurement: Measurement) -> float:
    """Return the longest time in one direction, s."""
    first = np.flatnonzero(begins(measurement.direction, measurement.trial))
    last = np.append(first[1:], len(measurement)) - 1
    return float(np.max(measurement.clock[last] - measurement.clock[first]))


def _share_of_place(measurement: Measurement, values: np.ndarray) -> tuple[float, bool]:
    """
    Return the share of the variance that place and direction explain (R^2), and if most are once.

    The place is the strain or a pressure, whichever explains more. R^2 is adjusted for the number
    of cells. Cells passed only once explain nothing: what is a function of the place there may be
    one of time. The second result is whether most rows are in such cells, of each quantity.
    """
    way = measurement.direction
    passes = np.cumsum(begins(way, measurement.trial))
    columns = [column for column in (measurement.strain, *measurement.pressure.T)
               if np.ptp(column) > 0.0]
    _, trial = np.unique(measurement.trial, return_inverse=True)
    found = [_explained(np.round(column / np.ptp(column) * _BINS), way, passes, trial.ravel(),
                        values) for column in columns]
    return (max((share for share, _ in found), default=0.0),
            all(again < 0.5 for _, again in found))


def _explained(place: np.ndarray, way: np.ndarray, passes: np.ndarray, trial: np.ndarray,
               values: np.ndarray) -> tuple[float, float]:
    """
    Return the adjusted R^2 of the means over place and way, and the share of rows passed again.

    Means are of cells with several passes. R^2 is the larger of one amplitude for all trials and
    of one for each, by alternating least squares.
    """
    _, cell = np.unique(np.stack([place, way], -1), axis=0, return_inverse=True)
    cell = cell.ravel()
    visits = np.unique(np.stack([cell, passes], -1), axis=0)[:, 0]
    again = np.bincount(visits) > 1
    shares, amplitude = [0.0], np.ones(len(values))
    for fitted in (0, *[int(trial.max())] * _ROUNDS):
        free = len(values) - int(again.sum()) - fitted
        weight = np.bincount(cell, amplitude ** 2)
        mean = np.where(again & (weight > 0.0), np.bincount(cell, amplitude * values) / np.where(
            weight > 0.0, weight, 1.0), 0.0)[cell]
        left = values - amplitude * mean
        if free > 0:
            shares.append(1.0 - float(left @ left) / free / float(np.var(values, ddof=1)))
        size = np.bincount(trial, mean ** 2)
        amplitude = (np.bincount(trial, mean * values) / np.where(size > 0.0, size, 1.0))[trial]
    return max(shares), float(np.mean(again[cell]))
