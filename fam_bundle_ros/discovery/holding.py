# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Does a model still hold? A sequential test on residuals as they come, with a rate of false alarms.

The hypothesis is that the mean error is at most a tolerance d at every state: never mind how the
rig moves. Residuals of one kind of state (direction, part of the range of strain and of pressure)
are averaged until a mean m of standard deviation s is as good as independent of the one before.
Such a look has the e-value

    L = mean over a of cosh(a m / s) / (exp(a^2 / 2) cosh(a d / s)),    E[L] <= 1 while |mean| <= d

since E[cosh(a z)] = exp(a^2 / 2) cosh(a mean(z)) for a normal z of unit variance. The looks go
into the sum of Shiryaev and Roberts, R <- (R + 1) L, and an alarm is raised at R >= A: the mean
number of looks to a false alarm is at least A, whatever the order of states (Roberts 1966,
Technometrics 8, 411-430; Shin, Ramdas and Rinaldo 2023, arXiv:2203.03532). A look is at most worth
A^(1/3): one blow against the load cell is no alarm. Since when is Page's estimate: the last time
at which the sum of log L was zero (Page 1954, Biometrika 41, 100-115), and the end of the look
that raised it, which may have begun while the model held.

The standard deviation is that of the residual's second differences over short means within one
direction, times the correlation that their lag shows: coloured noise makes looks longer and rarer.
"""

from collections import deque
from dataclasses import dataclass
import math

import numpy as np

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle

__all__ = ['Holding', 'Noise', 'tolerance_of']

#: s over which samples are averaged first, and the shortest look in such means.
_SHORT, _LEAST = 0.05, 5
#: Sizes of an error beyond the tolerance, in standard deviations of a look, that are tried.
_SIZES = np.array([0.5, 1.0, 2.0])
#: Looks that it takes to raise an alarm.
_FEWEST = 3
#: Second differences that the noise is taken from, and the fewest that tell it.
_DIFFERENCES, _FEW = 1200, 20
#: 1/s, below which a muscle counts as at rest: a tenth of the strain's range in a minute.
_CRAWL = 2e-3
#: Largest correlation of neighbouring short means that looks can be stretched for.
_CORRELATED = 0.9
#: Times the autocorrelation time that a look is long: neighbours then share a tenth.
_APART = 5.0


def tolerance_of(bundle: Bundle) -> float:
    """
    Return the mean error that a model may have at a state while it holds, N.

    Twice the error of its fit, as its file tells it, and what counts as small in a diagnosis: a
    share of the largest force.
    """
    largest = float(bundle.blocked_force(bundle.max_pressure))
    return max(2.0 * float(bundle.error), settings.SMALL * largest)


class Noise:
    """
    The standard deviation of short means of a residual, and their correlation.

    From second differences, which cancel slow errors of the model; see `data.noise` for records.

    Attributes
    ----------
    value : float, N
        Of a short mean; nan before enough is known.
    time : float
        Short means per independent one, at least 1.
    """

    def __init__(self) -> None:
        self._near: deque[float] = deque(maxlen=_DIFFERENCES)
        self._wide: deque[float] = deque(maxlen=_DIFFERENCES)
        self._run: deque[float] = deque(maxlen=5)
        self._new = 0
        self.value, self.time = math.nan, 1.0

    def interrupt(self) -> None:
        """Say that the next mean does not follow the one before."""
        self._run.clear()

    def add(self, mean: float) -> None:
        """Take a short mean, N."""
        run = self._run
        run.append(mean)
        if len(run) >= 3:
            self._near.append(run[-1] - 2.0 * run[-2] + run[-3])
            self._new += 1
        if len(run) == 5:
            self._wide.append(run[4] - 2.0 * run[2] + run[0])
        # a median of a thousand numbers is not worth taking for each
        if self._new >= _FEW and 2 * len(self._wide) >= _FEW:
            self._new = 0
            self._work_out()

    def _work_out(self) -> None:
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
    """Return the variance of second differences at a lag over that of the noise."""
    return 6.0 - 8.0 * rho ** lag + 2.0 * rho ** (2 * lag)


def _variance(values: deque[float]) -> float:
    """Return the variance of normal numbers among outliers."""
    return (1.4826 * float(np.median(np.abs(np.array(values))))) ** 2


@dataclass
class _Look:
    """Sum of the short means of one kind of state."""

    total: float = 0.0
    count: int = 0


class Holding:
    """
    Watches residuals for a mean error beyond a tolerance.

    Parameters
    ----------
    tolerance : float, N
        Mean error that is no failure; see `tolerance_of`.
    max_pressure : float, Pa
        Sum over the motor units: the scale of kinds of states.
    false_alarms : float, 1/h
        Most that a model which holds may cause, on average.
    recovery : float, s
        Without a further alarm for so long the model holds again.

    Attributes
    ----------
    holds : bool
    since : float, s
        When it ceased to hold, as far as can be told; nan while it holds.
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
        Take a sample.

        Parameters
        ----------
        time : float, s
            Not before that of the sample before; else, and after a gap, means begin anew.
        strain : float
        pressure : float, Pa (gauge)
            Sum over the motor units.
        residual : float, N
            Measured minus modelled force; what is not finite is left out.
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
            # the mean in which it turned is of neither direction
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
        """Add a look that ended at a time to the evidence."""
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
