# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A change during a log: rows of two muscles, or of one rig before and after something was moved.

Each side of the change is then explained by the same model with other parameters, and no effect is
needed. The evidence of the two parts is compared with that of the most probable set of effects
(Bayesian comparison of a single change point, Smith 1975, Biometrika 62, 407). A change is as
probable beforehand as a missing effect, and equally so at each cell of the log. It must be more
probable with a discrepancy and without one: a discrepancy in two parts can follow what one part
could not, such as damping at two speeds one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery.artefacts import Artefact
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Hyper
from fam_bundle_ros.discovery.fitter import COOLING, Fitter
from fam_bundle_ros.discovery.linear import log_evidence
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.told import number


@dataclass(frozen=True)
class ChangePoints:
    """
    The points of a log at which something may have changed: between two of its cells.

    A point is the number of cells before it.

    Attributes
    ----------
    cells : Cells
    least : int
        Number of cells before the first point and after the last one.
    """

    cells: Cells
    least: int

    @classmethod
    def of(cls, search: Search) -> ChangePoints | None:
        """Return those of a log, or None for a map and for too few cells for two models."""
        cells = search.fitter.cells
        least = len(search.null.priors) + 1  # fewer cells determine no model
        return None if cells.time is None or len(cells) < 2 * least else cls(cells, least)

    @cached_property
    def order(self) -> np.ndarray:
        """The cells in the order of the log, (n,) int."""
        return np.argsort(self.cells.mean(np.arange(len(self.cells.label), dtype=float)))

    @cached_property
    def before(self) -> np.ndarray:
        """The number of cells before each, (n,) int."""
        return np.argsort(self.order)

    @property
    def points(self) -> range:
        """All points."""
        return range(self.least, len(self.cells) - self.least + 1)

    def after(self, point: int) -> np.ndarray:
        """Return which cells come after a point, (n,) bool."""
        return self.before >= point

    def rows(self, point: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of the cell before a point, and those of the cell after it."""
        before, after = (np.flatnonzero(self.cells.label == cell)
                         for cell in self.order[point - 1:point + 1])
        return before, after

    def row(self, point: int) -> int:
        """Return the row at a point: the first one of a trial, if one begins there."""
        before, after = self.rows(point)
        start = np.flatnonzero(self.cells.data.start)
        between = start[(start > before[-1]) & (start <= after[0])]
        return int(between[0] if len(between) else after[0])

    def where(self, row: int) -> str:
        """Return the words for a row: its time, and its trial if there are several."""
        data = self.cells.data
        assert data.time is not None
        time, name = f'{data.time[row]:.4g} s', data.trial_names[int(data.trial[row])]
        if data.start[row]:
            return f'trial {name} ({time})'
        return time + (f' of trial {name}' if np.ptp(data.trial) else '')

    def log_prior(self, search: Search) -> float:
        """Return the log prior odds of one change at one point."""
        share = search.options.choices.inclusion
        return float(np.log(share / (1.0 - share) / len(self.points)))


@dataclass(frozen=True)
class TwoModels:
    """One model before a row and another from there on: log odds against effects, and words."""

    log_odds: float
    artefact: Artefact


def two_models(search: Search) -> TwoModels | None:
    """
    Return the change of the model that is more probable than every set of effects, or None.

    Its place is that of the highest evidence of the model as given, linearised at its fit to all
    cells; there it is fitted to each part by itself.
    """
    changes = ChangePoints.of(search)
    if changes is None:
        return None
    null, covariance, cells = search.null, search.fitter.covariance, changes.cells

    def linear(gone: np.ndarray) -> float:
        part = covariance.without(gone)
        return max(log_evidence(part, Hyper(white=white), null.linear) for white in COOLING)

    after = changes.after(max(changes.points, key=lambda point: linear(
        changes.after(point)) + linear(~changes.after(point))))
    log_odds = null.log_prior + changes.log_prior(search) - best_posteriors(search)
    left, used = [], cells.label >= 0
    for gone in (after, ~after):
        part = Fitter(covariance.without(gone))
        fit = part.fit(null.names, null.model, null.priors)
        alone = part.without_discrepancy(fit)
        log_odds += fit.evidence, alone.evidence
        left.append(cells.residual_of_rows(alone.model)[used & ~gone[cells.label]])
    if log_odds.min() <= 0.0:
        return None
    where = changes.where(changes.row(int((~after).sum())))
    error, digits = number(rms(np.concatenate(left)), 2), int(log_odds.min() / np.log(10.0))
    return TwoModels(float(log_odds.min()), Artefact(
        f'one model for the rows before {where}, and another from there on, leave '
        f'{error} N and are more probable than any effects (odds above 1e{digits} to 1): two '
        'muscles in one file, something on the rig that was changed, or a muscle that changed as '
        'no effect describes',
        'diagnose the rows before and after this by themselves'))


def best_posteriors(search: Search) -> np.ndarray:
    """Return the best log posteriors of effects, with a discrepancy and without it, (2,)."""
    return np.array([search.best.posterior,
                     max(fit.white_posterior for fit in search.fits.values())])
