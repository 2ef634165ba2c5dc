# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sequential test whether a model still holds, on a stream of residuals, with a false alarm rate.

The hypothesis is that the mean error is at most a tolerance d at every state, however the rig
moves. Residuals of one kind of state (direction, part of the range of strain and of pressure) are
averaged until their mean m, of standard deviation s, is nearly independent of the one before.
Such a mean, called a look, has the e-value

    L = mean over a of cosh(a m / s) / (exp(a^2 / 2) cosh(a d / s)),    E[L] <= 1 while |mean| <= d

since E[cosh(a z)] = exp(a^2 / 2) cosh(a mean(z)) for a normal z of unit variance. The e-values
enter the Shiryaev-Roberts statistic, R <- (R + 1) L, and an alarm is raised at R >= A: the mean
number of looks to a false alarm is at least A, for any order of states (Roberts 1966,
Technometrics 8, 411-430; Shin, Ramdas and Rinaldo 2023, arXiv:2203.03532). L is limited to
A^(1/3), so that a single blow against the load cell gives no alarm. The time of the change is
Page's estimate: the end of the first look after the last time at which the sum of log L was zero
(Page 1954, Biometrika 41, 100-115).

The standard deviation is estimated from second differences of short means within one direction.
Their autocorrelation sets the length of a look: coloured noise makes looks longer and fewer.
"""

from collections import deque
from dataclasses import dataclass
import math

import numpy as np

from fam_bundle_ros.data.rates import spread
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

__all__ = ['Holding', 'Noise', 'tolerance_of']

#: Duration of a short mean, s, and the shortest look in short means.
_SHORT, _LEAST = 0.05, 5
#: Values of a in the e-value: errors in standard deviations of a look.
_SIZES = np.array([0.5, 1.0, 2.0])
#: Least number of looks to an alarm.
_FEWEST = 3
#: Most and fewest second differences from which the noise is estimated.
_DIFFERENCES, _FEW = 1200, 20
#: Strain rate, 1/s, below which a muscle counts as at rest.
_CRAWL = 2e-3
#: Largest correlation of neighbouring short means for which looks are lengthened.
_CORRELATED = 0.9
#: Length of a look in autocorrelation times: neighbouring looks then have a correlation of 0.1.
_APART = 5.0


def tolerance_of(bundle: Bundle) -> float:
    """
    Return the largest mean error at a state with which a model still holds, N.

    Twice the error of its fit, from the model file, but at least the error that is negligible in
    a diagnosis: a share of the largest force.
    """
    return max(2.0 * float(bundle.error), settings.SMALL * bundle.largest_force)


class Noise:
    """
    Standard deviation and autocorrelation of the short means of a residual.

    Estimated from second differences, which cancel slow errors of the model; `data.noise` does
    this for records.

    Attributes
    ----------
    value : float, N
        Standard deviation of a short mean; nan until enough samples are known.
    time : float
        Autocorrelation time in short means, at least 1.
    """

    def __init__(self) -> None:
        self._near: deque[float] = deque(maxlen=_DIFFERENCES)
        self._wide: deque[float] = deque(maxlen=_DIFFERENCES)
        self._run: deque[float] = deque(maxlen=5)
        self._new = 0
        self.value, self.time = math.nan, 1.0

    def interrupt(self) -> None:
        """Start a new run: the next mean does not follow the last one."""
        self._run.clear()

    def add(self, mean: float) -> None:
        """Add a short mean, N."""
        run = self._run
        run.append(mean)
        if len(run) >= 3:
            self._near.append(run[-1] - 2.0 * run[-2] + run[-3])
            self._new += 1
        if len(run) == 5:
            self._wide.append(run[4] - 2.0 * run[2] + run[0])
        # not after each mean: a median of a thousand numbers takes too long
        if self._new >= _FEW and 2 * len(self._wide) >= _FEW:
            self._new = 0
            self._estimate()

    def _estimate(self) -> None:
        near = _variance(self._near)
        # AR(1): var = s^2 (6 - 8 rho^k + 2 rho^2k) at lag k
        tried = np.linspace(0.0, _CORRELATED, 19)
        ratio = _lagged(tried, 2) / _lagged(tried, 1)
        rho = float(np.interp(_variance(self._wide) / max(near, 1e-12), ratio, tried))
        count = len(self._near)
        # second differences share samples: about a third of them is independent
        self.value = math.sqrt(near / float(_lagged(np.array(rho), 1))) * (
            1.0 + 2.0 / math.sqrt(2.0 * count / 3.0))
        self.time = (1.0 + rho) / (1.0 - rho)


def _lagged(rho: np.ndarray, lag: int) -> np.ndarray:
    """Return the variance of second differences at a lag divided by that of the noise."""
    return 6.0 - 8.0 * rho ** lag + 2.0 * rho ** (2 * lag)


def _variance(values: deque[float]) -> float:
    """Return a robust estimate of the variance."""
    return spread(np.array(values)) ** 2


@dataclass
class _Look:
    """Sum and number of short means of one kind of state."""

    total: float = 0.0
    count: int = 0


class Holding:
    """
    Monitor of residuals for a mean error beyond a tolerance.

    Parameters
    ----------
    tolerance : float, N
        Largest acceptable mean error; see `tolerance_of`.
    max_pressure : float, Pa
        Sum over the motor units, a third of which is the size of the pressure classes.
    false_alarms : float, 1/h
        Upper limit of the mean rate of false alarms.
    recovery : float, s
        The model holds again after this time without another alarm.

    Attributes
    ----------
    holds : bool
    since : float, s
        Estimated time at which the model ceased to hold; nan while it holds.
    looks : int
    noise : Noise

    Examples
    --------
    >>> watch = Holding(tolerance=1.0, max_pressure=4e5, false_alarms=0.1)
    >>> draw = np.random.default_rng(1).normal
    >>> for k in range(4000):
    ...     watch.add(0.005 * k, 0.1, 2e5, draw() + (3.0 if k > 2000 else 0.0))
    >>> watch.holds, round(watch.since)
    (False, 10)
    """

    def __init__(self, tolerance: float, max_pressure: float, false_alarms: float = 0.1,
                 recovery: float = 60.0):
        if not (tolerance > 0.0 and false_alarms > 0.0):
            raise InputError(f'tolerance {tolerance:g} N, {false_alarms:g} false alarms per hour; '
                             'expected positive numbers')
        self.tolerance = tolerance
        self._scale, self._recovery = max_pressure, recovery
        self.threshold = 3600.0 / (_SHORT * _LEAST) / false_alarms
        self._most = math.log(self.threshold) / _FEWEST
        self.noise = Noise()
        self.holds, self.since, self.looks = True, math.nan, 0
        self._alarm = math.nan
        self._score = -math.inf
        self._page, self._risen = 0.0, math.nan
        self._open: dict[tuple[int, int, int], _Look] = {}
        self._begin_short(math.nan, math.nan)
        self._kind: tuple[int, int, int] | None = None

    def add(self, time: float, strain: float, pressure: float, residual: float) -> None:
        """
        Add a sample; samples that are not finite are ignored.

        Parameters
        ----------
        time : float, s
            If it decreases, or after a gap, short means start again.
        strain : float
        pressure : float, Pa (gauge)
            Sum over the motor units.
        residual : float, N
            Measured minus modelled force.
        """
        if not math.isfinite(residual + strain + pressure):
            return
        if not 0.0 <= time - self._begun < 10.0 * _SHORT:
            self._begin_short(time, strain)
            self.noise.interrupt()
        elif time - self._begun >= _SHORT - 1e-6:
            self._close_short(time, strain, pressure)
            self._begin_short(time, strain)
        self._count += 1
        self._total += residual

    def _begin_short(self, time: float, strain: float) -> None:
        self._begun, self._strain = time, strain
        self._count, self._total = 0, 0.0

    def _close_short(self, time: float, strain: float, pressure: float) -> None:
        mean = self._total / self._count
        rate = (strain - self._strain) / (time - self._begun)
        direction = 0 if abs(rate) < _CRAWL else (1 if rate > 0.0 else -1)
        kind = (direction, math.floor(strain / 0.1), math.floor(3.0 * pressure / self._scale))
        if self._kind is None or kind[0] != self._kind[0]:
            # discard the short mean in which the direction changed
            self._kind = kind
            self.noise.interrupt()
            return
        self._kind = kind
        self.noise.add(mean)
        if math.isnan(self.noise.value):
            return
        look = self._open.setdefault(kind, _Look())
        look.total += mean
        look.count += 1
        if look.count >= max(_LEAST, _APART * self.noise.time):
            del self._open[kind]
            spread = self.noise.value * math.sqrt(self.noise.time / look.count)
            self._take(time, look.total / look.count, max(spread, 1e-9))

    def _take(self, time: float, mean: float, spread: float) -> None:
        """Update the statistics with a look that ended at a time."""
        self.looks += 1
        gain = min(self.log_e_value(mean, spread), self._most)
        self._page += gain
        if self._page <= 0.0:
            self._page, self._risen = 0.0, math.nan
        elif math.isnan(self._risen):
            self._risen = time
        self._score = float(np.logaddexp(self._score, 0.0)) + gain
        if self._score >= math.log(self.threshold):
            if self.holds:
                self.holds, self.since = False, self._risen
            self._alarm, self._score = time, -math.inf
        elif not self.holds and time - self._alarm > self._recovery:
            self.holds, self.since = True, math.nan
            self._page, self._risen = 0.0, math.nan

    def log_e_value(self, mean: float, spread: float) -> float:
        """Return ln L of a look, from its mean and its standard deviation, N."""
        terms = (_log_cosh(_SIZES * mean / spread) - 0.5 * _SIZES ** 2
                 - _log_cosh(_SIZES * self.tolerance / spread))
        return float(np.logaddexp.reduce(terms)) - math.log(len(_SIZES))


def _log_cosh(value: np.ndarray) -> np.ndarray:
    return np.logaddexp(value, -value) - math.log(2.0)
