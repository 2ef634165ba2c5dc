# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A model beside a running rig: its prediction, its error, whether it still holds. No ROS.

`LiveModel` predicts sample by sample; `ModelWatch` keeps the error of the last minute, the memory
of the last minutes, and the test of `fam_bundle_ros.discovery.holding` on the residual.
"""

from collections import deque
from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.memory import Memory
from fam_bundle_ros.data.rates import spread
from fam_bundle_ros.discovery.holding import Holding, tolerance_of
from fam_bundle_ros.discovery.locate import locate
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.told import number

#: Number of samples from which the noise floor is estimated.
_NOISE_SAMPLES = 1000
#: Number of bins of strain and of pressure in which a failure is located.
_BINS = 6


class LiveModel:
    """
    A model that follows a rig sample by sample.

    Its sensor effects are removed from the readings and added to the force, as in `predict`.
    """

    def __init__(self, bundle: Bundle):
        self.bundle = bundle
        #: s since it was made.
        self._time = 0.0
        self.reset()

    def reset(self) -> None:
        """Begin a new trial."""
        self._state = self.bundle.start_state()

    def step(self, dt: float, strain: float, pressure: list[float], rate: float) -> float:
        """
        Return the force that the load cell should show now, N; nan for unusable readings.

        Parameters
        ----------
        dt : float, s
            Time since the last step.
        pressure : list of float, Pa (gauge)
        rate : float, 1/s
            Strain rate.
        """
        if not math.isfinite(strain + rate + sum(pressure)):
            self.reset()
            return math.nan
        self._time += dt
        strain, felt = self.bundle.felt(strain, np.array(pressure), self._time, rate)
        forces, self._state = self.bundle.step(self._state, dt, strain, felt, rate)
        return float(self.bundle.readings(forces.sum(), strain, felt, self._time)[0])


class ModelWatch:
    """
    The error of a model while a rig runs, and the test whether it still holds.

    Parameters
    ----------
    window : float, s
        Window of the rms error.
    seconds : float, s
        Length of the memory.
    false_alarms : float, 1/h
        Largest rate of false alarms, for a model that holds.
    tolerance : float, N, optional
        Largest tolerated mean error at a state; from the model by default.
    """

    def __init__(self, bundle: Bundle, window: float = 60.0, seconds: float = 300.0,
                 false_alarms: float = 0.1, tolerance: float | None = None):
        self._window, self._false_alarms, self._tolerance = window, false_alarms, tolerance
        self.memory = Memory([unit.name for unit in bundle.motor_units],
                             bundle.max_pressure.tolist(), seconds)
        self._scale = float(bundle.max_pressure.sum())
        self._time = math.nan
        self._begin(bundle)

    def change(self, bundle: Bundle) -> None:
        """
        Watch another model of the same rig.

        The memory is kept; if the old model had failed, only the part since its failure.
        """
        if not self.holding.holds:
            self.memory.forget(self.holding.since)
        self._begin(bundle)

    def _begin(self, bundle: Bundle) -> None:
        self.bundle = bundle
        tolerance = tolerance_of(bundle) if self._tolerance is None else self._tolerance
        self.holding = Holding(tolerance, self._scale, self._false_alarms, self._window)
        #: Where the model fails, as text; empty until this is located.
        self.where = ''
        #: For each second of the window: start (s), sum of squared residuals (N^2), samples.
        self._squares: deque[list[float]] = deque()
        self._residuals: deque[float] = deque(maxlen=_NOISE_SAMPLES)

    def add(self, time: float, strain: float, pressure: Sequence[float], force: float,
            residual: float) -> None:
        """
        Take a sample, at a time, s, with gauge pressures, Pa, and the force, N.

        The residual, N, is measured minus modelled force; one that is not finite is skipped.
        """
        self.memory.add(time, strain, pressure, force)
        if time < self._time:
            # the clock was set
            self._squares.clear()
        self._time = time
        if not math.isfinite(residual):
            return
        self.holding.add(time, strain, sum(pressure), residual)
        self._residuals.append(residual)
        squares = self._squares
        if not squares or time - squares[-1][0] >= 1.0:
            squares.append([time, 0.0, 0.0])
            while time - squares[0][0] > self._window:
                squares.popleft()
        squares[-1][1] += residual * residual
        squares[-1][2] += 1.0

    @property
    def error(self) -> float:
        """Rms of the residual over the window, or since the model changed, N; nan at first."""
        count = sum(second[2] for second in self._squares)
        return math.sqrt(sum(second[1] for second in self._squares) / count) if count else math.nan

    @property
    def noise(self) -> float:
        """Noise of a sample, N; nan at first."""
        residual = np.array(self._residuals)
        return noise_floor(residual) if len(residual) > 50 else math.nan

    @property
    def since(self) -> float:
        """Time from which on the memory describes the present rig, s."""
        return -math.inf if self.holding.holds else self.holding.since

    @property
    def words(self) -> str:
        """Whether the model holds, in a sentence."""
        watch = self.holding
        if not watch.looks:
            return 'WAITING for motion and samples to judge the model by'
        if watch.holds:
            return (f'the model holds: its mean error was within {number(watch.tolerance, 2)} N '
                    f'wherever the rig was ({watch.looks} looks)')
        ago = max(self._time - watch.since, 0.0)
        return (f'the model no longer holds, since about {ago:.0f} s ago: its mean error is '
                f'beyond {number(watch.tolerance, 2)} N'
                + (f'; {self.where}' if self.where else ''))

    def state(self) -> dict[str, Any]:
        """Return what goes out as JSON; numbers that are not known are None."""
        def known(value: float) -> float | None:
            return value if math.isfinite(value) else None
        watch = self.holding
        return {'holds': watch.holds, 'words': self.words, 'model': self.bundle.name,
                'error_N': known(self.error), 'noise_N': known(self.noise),
                'tolerance_N': watch.tolerance, 'where': self.where, 'looks': watch.looks,
                'since_s': None if watch.holds else known(self._time - watch.since),
                'memory_s': self.memory.seconds}


def failure_words(bundle: Bundle, data: Measurement) -> str:
    """Return where a model fails on data, in words; empty where nothing stands out."""
    residual = data.force - predict(bundle, data)
    regions = locate(data, residual, noise_floor(residual), most=2, bins=_BINS)
    return '; '.join(str(region) for region in regions)


def error_on(bundle: Bundle, data: Measurement) -> float:
    """Return the rms error of a model on data, N; InputError if their motor units differ."""
    return rms(data.force - predict(bundle, data))


def noise_floor(residual: np.ndarray) -> float:
    """
    Return the noise of evenly sampled residuals, N, from second differences.

    Slow errors of the model cancel in the differences; the median rejects moments of switching.
    """
    return spread(np.diff(residual, 2)) / math.sqrt(6.0)
