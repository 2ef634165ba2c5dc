# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which experiment tells two models apart: a T-criterion over a short menu.

For each experiment the difference of the two predictions is taken, less what the weaker model
could make up by moving its parameters within what the present data leave open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.evidence import Fit, Fitter
from fam_bundle_ros.model import Bundle, catalogue, Motion

#: Below this many noise standard deviations (summed squares) an experiment tells nothing.
_USELESS = 9.0
_PLAIN = 'sweep each isobar up and down, with the time logged'
#: What is harder to do than the plain sweep must separate by so much more: another speed tells
#: nothing about effects that do not depend on it.
_WORTH = 1.1


@dataclass(frozen=True)
class Experiment:
    """A proposal: what to do, and how far apart it would drive the two models (chi2)."""

    words: str
    separation: float


def menu(cells: Cells, model: Bundle) -> list[tuple[str, Motion]]:
    """Return experiments within the range of the data, as motions of some hundred samples."""
    data = cells.data
    low, high = float(data.strain.min()), float(data.strain.max())
    top = data.pressure.max(axis=0)
    usual = float(np.percentile(np.abs(data.strain_rate), 75)) if not data.is_static else 0.0
    usual = usual or 0.02
    levels = np.linspace(0.15, 1.0, 4)
    tests = [
        (_PLAIN, _sweeps(low, high, top, levels, usual)),
        ('sweep the same isobars ten times faster', _sweeps(low, high, top, levels, 10 * usual)),
        ('sweep the same isobars ten times slower', _sweeps(low, high, top, levels, usual / 10)),
        ('step the strain, hold each step for 60 s and log the decay', _holds(low, high, top)),
        ('make small strain loops about one point at a fixed pressure',
         _sweeps(low + 0.4 * (high - low), low + 0.5 * (high - low), top, levels, usual)),
        ('step the pressure at a fixed strain', _pressure_steps(low, high, top)),
        ('sweep at zero pressure', _sweeps(low, high, top, np.zeros(1), usual)),
        ('sweep low isobars (5 to 20 % of the highest pressure)',
         _sweeps(low, high, top, np.array([0.05, 0.1, 0.15, 0.2]), usual)),
        ('compress each isobar past its free strain',
         _sweeps(low, min(high + 0.08, 0.4), top, levels, usual)),
        ('repeat the first isobar after an hour', _late(low, high, top, usual)),
    ]
    if model.n > 1:
        for k, unit in enumerate(model.motor_units):
            alone = np.zeros(model.n)
            alone[k] = top[k]
            tests.append((f'sweep with {unit.name} alone under pressure',
                          _sweeps(low, high, alone, levels, usual)))
    return tests


def best_experiment(fitter: Fitter, first: Fit, second: Fit,
                    ) -> tuple[Experiment | None, list[Experiment]]:
    """
    Return the experiment that separates two fitted models most, and all of them, best first.

    None when no force test of the menu tells them apart.
    """
    ranked = []
    known = np.linalg.inv(second.covariance)
    for words, motion in menu(fitter.cells, first.model):
        slope = np.array([prior.slope(u) for prior, u in zip(second.priors, second.u)])
        force, columns = second.model.jacobian(motion, [p.key for p in second.priors])
        gap = (first.model.predict(motion) - force) / fitter.cells.noise
        columns = columns * slope / fitter.cells.noise
        part = columns.T @ gap
        separation = float(gap @ gap - part @ np.linalg.solve(known + columns.T @ columns, part))
        if np.isfinite(separation):
            ranked.append(Experiment(words, max(separation, 0.0)))
    plain = max((item.separation for item in ranked if item.words == _PLAIN), default=0.0)
    ranked.sort(key=lambda item: (-item.separation if item.separation > _WORTH * plain
                                  else -plain, item.words != _PLAIN))
    top = ranked[0] if ranked and ranked[0].separation > _USELESS else None
    return top, ranked


def without_force(first: str, second: str) -> str:
    """Return what tells two effects apart where no force test does: the remedy of one of them."""
    laws = catalogue.available()
    for name in (first, second):
        if name in laws and laws[name].remedy:
            return laws[name].remedy
    return 'measure radius and braid angle with a calliper'


def _sweeps(low: float, high: float, top: np.ndarray, levels: np.ndarray, rate: float) -> Motion:
    once = np.linspace(0.0, 1.0, 25)
    path = low + (high - low) * np.concatenate([once, once[::-1]])
    duration = 2 * (high - low) / rate
    strain = np.tile(path, len(levels))
    time = np.concatenate([k * (duration + 1.0) + np.linspace(0, duration, len(path))
                           for k in range(len(levels))])
    way = np.tile(np.repeat([rate, -rate], len(once)), len(levels))
    pressure = np.repeat(levels, len(path))[:, None] * top[None, :]
    start = np.arange(len(strain)) % len(path) == 0
    return Motion(strain, pressure, way, time, start)


def _holds(low: float, high: float, top: np.ndarray) -> Motion:
    steps = low + (high - low) * np.array([0.2, 0.6, 0.4, 0.8])
    strain = np.repeat(steps, 60)
    time = np.arange(len(strain)) * 1.0
    pressure = np.repeat(0.7 * top[None, :], len(strain), axis=0)
    return Motion(strain, pressure, np.zeros(len(strain)), time, time == 0)


def _pressure_steps(low: float, high: float, top: np.ndarray) -> Motion:
    time = np.arange(240) * 0.01
    share = np.where((time // 0.3) % 2 == 0, 0.4, 0.9)
    strain = np.full(len(time), low + 0.4 * (high - low))
    return Motion(strain, share[:, None] * top[None, :], np.zeros(len(time)), time, time == 0)


def _late(low: float, high: float, top: np.ndarray, rate: float) -> Motion:
    base = _sweeps(low, high, top, np.array([0.5, 0.5]), rate)
    assert base.time is not None
    time = base.time.copy()
    time[len(time) // 2:] += 3600.0
    return Motion(base.strain, base.pressure, base.strain_rate, time, base.start)
