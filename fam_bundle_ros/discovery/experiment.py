# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Choose the experiment that best separates two models: T-criterion over a menu of protocols.

For each experiment the first model predicts the force, and the second is refitted to it within
its bounds and the uncertainty of its present fit. The separation is the chi2 that remains.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np
from scipy.optimize import least_squares

from fam_bundle_ros.data.grouping import pressure_speed, varying_unit
from fam_bundle_ros.data.measurement import BY_STRAIN, Measurement
from fam_bundle_ros.data.protocol import (
    Hold,
    Limits,
    Pause,
    PressureSteps,
    Protocol,
    segments,
    Sweep,
)
from fam_bundle_ros.data.steps import LEAST_STRAIN, MOST_STRAIN, Pressures, Step
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.fitter import Fit, Fitter, with_coordinates
from fam_bundle_ros.model import Bundle, catalogue, Motion

#: An experiment of a smaller chi2 (three noise standard deviations) does not separate the models.
_LEAST_SEPARATION = 9.0
_PLAIN = 'sweep each isobar up and down, with the time logged'
_FASTER, _SLOWER = (f'sweep the same isobars ten times {word}' for word in ('faster', 'slower'))
#: A more difficult experiment is preferred to the plain sweep if its chi2 is larger by this
#: factor: otherwise another speed could win for effects that do not depend on the speed.
_ADVANTAGE = 1.1
#: Samples of a sweep in one direction, of a hold, and of a step: equal for all durations, so that
#: experiments of different length are comparable.
_SWEEP, _HOLD, _STEP = 25, 60, 3
#: A leg of the protocol that takes a smaller share of its course is a step.
_SHORT = 0.05
#: Force limit of an experiment, as a multiple of the largest force in the data.
_FORCE_MARGIN = 1.5
#: Relative tolerance of chi2 in the refit.
_TOLERANCE = 1e-2
#: Least range of strain (1) and least top pressure (Pa) of an experiment.
_RANGE, _PRESSURE = 0.05, 20e3
#: Proposed strains, and pressures (Pa), are multiples of this.
_STRAINS, _PRESSURES = 1e-3, 100.0
#: Largest change of pressure during a stroke on an isobar, as a share of the pressure range.
_ISOBAR = 0.2
#: Readings up to this multiple of a motor unit's pressure limit are noise about the limit.
NOISE_MARGIN = 1.05


@dataclass(frozen=True)
class Experiment:
    """A proposed protocol, and the separation of the two models in it (chi2)."""

    protocol: Protocol
    separation: float

    @property
    def words(self) -> str:
        """Description in one line."""
        return self.protocol.name


class _Range:
    """The range of the data, and protocols within it."""

    def __init__(self, cells: Cells, model: Bundle):
        data = cells.data
        # rounded to the inside, so that the protocol stays within the range of the data
        low, high = _rounded_inwards(float(data.strain.min()), float(data.strain.max()), _STRAINS)
        self.low = min(max(low, LEAST_STRAIN), MOST_STRAIN - _RANGE)
        self.high = min(max(high, self.low + _RANGE), MOST_STRAIN)
        top, limit = np.maximum(data.pressure.max(axis=0), 0.0), model.max_pressure
        top = np.where((top > limit) & (top < NOISE_MARGIN * limit), limit, top)
        self.top = top if top.max() > _PRESSURE else np.full(model.n, _PRESSURE)
        usual = (0.0 if data.is_static
                 else float(np.percentile(np.abs(data.strain_rate), 75)))
        self.rate = float(f'{usual or 0.02:.2g}')
        self._force = float(f'{_FORCE_MARGIN * max(float(np.abs(data.force).max()), 1.0):.3g}')

    def protocol(self, words: str, *steps: Step) -> Protocol:
        """Return a protocol with its limits of strain, pressure and force."""
        strains = [leg.strain for step in steps for course in step.courses()
                   for leg in (course.start, *course.legs) if leg.strain is not None]
        # a top pressure that is rounded to a multiple may be above it by the rounding of a float
        limits = Limits(max(float(self.top.max()), *self._pressures(np.ones(1), self.top)[0]),
                        (min(strains), max(max(strains), min(strains) + 1e-3)), self._force)
        return Protocol(words, len(self.top), steps, limits)

    def sweep(self, levels: np.ndarray, speed: float = 1.0, *, low: float | None = None,
              high: float | None = None, top: np.ndarray | None = None) -> Sweep:
        """Return isobars at ``levels`` times the top pressures, ``speed`` times the usual rate."""
        return Sweep((self.low if low is None else low, self.high if high is None else high),
                     speed * self.rate, self._pressures(levels, self.top if top is None else top))

    def hold(self, shares: tuple[float, ...], seconds: float) -> Hold:
        """Return steps to ``shares`` of the strain range, each held for ``seconds``."""
        return Hold(tuple(map(self._strain, shares)), seconds,
                    self._pressures(np.array([0.7]), self.top))

    def pressure_steps(self) -> PressureSteps:
        """Return pressure steps up and down at constant strain."""
        return PressureSteps(self._pressures(np.array([0.4, 0.9]), self.top), 0.3,
                             self._strain(0.4), cycles=2)

    def _strain(self, share: float) -> float:
        return round(self.low + share * (self.high - self.low), 4)

    @staticmethod
    def _pressures(levels: np.ndarray, top: np.ndarray) -> tuple[Pressures, ...]:
        return tuple(tuple(_rounded_inwards(0.0, float(value), _PRESSURES)[1]
                           for value in level * top) for level in levels)


def menu(cells: Cells, model: Bundle) -> list[Protocol]:
    """Return the protocols to choose from, within the range of the data; the plain sweep first."""
    data = _Range(cells, model)
    levels = np.linspace(0.15, 1.0, 4)
    width = data.high - data.low
    again = data.sweep(np.array([0.5]))
    tests = [
        plain(cells, model),
        data.protocol(_FASTER, data.sweep(levels, 10.0)),
        data.protocol(_SLOWER, data.sweep(levels, 0.1)),
        data.protocol('step the strain, hold each step for 60 s and log the decay',
                      data.hold((0.2, 0.6, 0.4, 0.8), 60.0)),
        data.protocol('make small strain loops about one point at a fixed pressure', data.sweep(
            levels, low=round(data.low + 0.4 * width, 4),
            high=round(data.low + 0.5 * width, 4))),
        data.protocol('step the pressure at a fixed strain', data.pressure_steps()),
        data.protocol('sweep at zero pressure', data.sweep(np.zeros(1))),
        data.protocol('sweep low isobars (5 to 20 % of the highest pressure)',
                      data.sweep(np.array([0.05, 0.1, 0.15, 0.2]))),
        data.protocol('compress each isobar past its free strain',
                      data.sweep(levels, high=max(min(data.high + 0.08, 0.4), data.high))),
        data.protocol('repeat the first isobar after an hour', again, Pause(3600.0), again),
    ]
    if model.n > 1:
        for k, unit in enumerate(model.motor_units):
            alone = np.zeros(model.n)
            alone[k] = data.top[k]
            if alone[k] > 0.0:
                tests.append(data.protocol(f'sweep with {unit.name} alone under pressure',
                                           data.sweep(levels, top=alone)))
    return tests


def plain(cells: Cells, model: Bundle) -> Protocol:
    """Return isobars over the range of the data."""
    data = _Range(cells, model)
    return data.protocol(_PLAIN, data.sweep(np.linspace(0.15, 1.0, 4)))


def finer(cells: Cells, model: Bundle) -> Protocol:
    """Return isobars over the range of the data in finer steps and at two speeds."""
    data = _Range(cells, model)
    levels = np.linspace(0.0, 1.0, 9)
    return data.protocol('sweep isobars in fine steps and at two speeds', data.sweep(levels),
                         data.sweep(levels, 4.0))


def motion(protocol: Protocol) -> Motion:
    """
    Return the motion of a protocol that imposes the strain, with some hundred samples.

    Every segment is a trial. The number of samples of a sweep, hold or step does not depend on
    its duration.
    """
    strain, pressure, rate, time, start = [], [], [], [], []
    clock = 0.0
    for segment in segments(protocol):
        course, before = segment.course, segment.course.start
        clock += segment.pause + segment.before
        first = True
        for leg in course.legs:
            if leg.seconds > 0.0:
                assert before.strain is not None
                assert leg.strain is not None
                still = before.strain == leg.strain and before.pressure == leg.pressure
                count = (_STEP if leg.seconds < _SHORT * course.seconds
                         else _HOLD if still else _SWEEP)
                share = np.linspace(0.0, 1.0, count)
                strain.append(before.strain + share * (leg.strain - before.strain))
                pressure.append(before.pressure + np.outer(share, np.subtract(
                    leg.pressure, before.pressure)))
                rate.append(np.full(count, (leg.strain - before.strain) / leg.seconds))
                time.append(clock + share * leg.seconds)
                start.append(np.arange(count) == (0 if first else -1))
                first = False
            clock += leg.seconds
            before = leg
    joined = (np.concatenate(values) for values in (strain, pressure, rate, time, start))
    return Motion(*joined)


def best_experiment(fitter: Fitter, first: Fit, second: Fit,
                    ) -> tuple[Experiment | None, list[Experiment]]:
    """
    Return the experiment that best separates two fitted models, and all of them, best first.

    The first is None if no experiment of the menu separates them. If the data are a plain sweep,
    it is omitted, as are sweeps at other speeds that separate them no better.
    """
    ranked = []
    for protocol in menu(fitter.cells, first.model):
        separation = _separation(motion(protocol), first.model, second, fitter.cells.noise)
        if np.isfinite(separation):
            ranked.append(Experiment(protocol, separation))
    plain = max((item.separation for item in ranked if item.words == _PLAIN), default=0.0)
    if _is_swept(fitter.cells.data):
        ranked = [item for item in ranked if item.words not in (_PLAIN, _FASTER, _SLOWER)
                  or item.separation > _ADVANTAGE * plain]
        plain = 0.0
    ranked.sort(key=lambda item: (-item.separation if item.separation > _ADVANTAGE * plain
                                  else -plain, item.words != _PLAIN))
    top = ranked[0] if ranked and ranked[0].separation > _LEAST_SEPARATION else None
    return top, ranked


def _separation(test: Motion, truth: Bundle, rival: Fit, noise: float) -> float:
    """Return the chi2 of ``rival`` refitted to the force of ``truth``, its posterior as prior."""
    force = truth.predict(test)
    keys = [prior.key for prior in rival.priors]
    root = np.linalg.cholesky(np.linalg.inv(rival.covariance)).T

    def off(u: np.ndarray) -> np.ndarray:
        moved = with_coordinates(rival.model, rival.priors, u).predict(test)
        return np.append((moved - force) / noise, root @ (u - rival.u))

    def slopes(u: np.ndarray) -> np.ndarray:
        _, columns = with_coordinates(rival.model, rival.priors, u).jacobian(test, keys)
        slope = np.array([prior.slope(value) for prior, value in zip(rival.priors, u)])
        columns = np.where(np.isfinite(columns), columns, 0.0)
        return np.concatenate([columns * slope / noise, root])

    if not np.isfinite(off(rival.u)).all():
        return np.nan
    low, high = np.transpose([prior.limits for prior in rival.priors])
    return float(2.0 * least_squares(off, rival.u, slopes, (low, high), ftol=_TOLERANCE).cost)


def _is_swept(data: Measurement) -> bool:
    """Return whether a log has isobars swept in both directions."""
    moving = data.direction_basis == BY_STRAIN
    if data.is_static or not {-1, 1} <= set(data.direction[moving]):
        return False
    stroke = np.ptp(data.strain) / np.median(np.abs(data.strain_rate[moving]))
    change = stroke * np.median(pressure_speed(data)[moving])
    return bool(change < _ISOBAR * np.ptp(data.pressure[:, varying_unit(data)]))


def remedy_of(first: str, second: str) -> str:
    """Return the remedy of one of two effects, for when no force test separates them."""
    laws = catalogue.available()
    for name in (first, second):
        if name in laws and laws[name].remedy:
            return laws[name].remedy
    return 'with the fitted values both give the same force: within the measured range use either'


def _rounded_inwards(low: float, high: float, step: float) -> tuple[float, float]:
    """
    Return the smallest and the largest multiple of a step within a range.

    Examples
    --------
    >>> _rounded_inwards(-6e-5, 0.20007, 1e-3)
    (0.0, 0.2)
    """
    rounding = 1e-6
    return (round(math.ceil(low / step - rounding) * step, 9) + 0.0,
            round(math.floor(high / step + rounding) * step, 9) + 0.0)
