# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Gaussian process of the residual over strain, pressure and direction, for a table of the model.

The search uses cells of single visits, which are wide if the motion is fast. For a table all
visits to the same place are averaged; this gives enough rows for places of 1/60 of the range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from fam_bundle_ros.data.grouping import varying_unit
from fam_bundle_ros.discovery.cells import Cells, places, Predicts
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.linear import Linear
from fam_bundle_ros.discovery.log_rows import averages
from fam_bundle_ros.model.laws.discrepancy import DEAD, ROUNDING
from fam_bundle_ros.model.vocabulary import bound, dahl

#: Points of the table over strain and pressure, enough for a length scale of 0.06 of the range.
STRAINS, PRESSURES = 41, 25


@dataclass(frozen=True)
class Surface:
    """
    The mean of a Gaussian process over strain, pressure and direction (Kennedy and O'Hagan 2001).

    Attributes
    ----------
    covariance : Covariance
        Covariance of the places.
    hyper : Hyper
    lower : ndarray, shape (n, n)
        Cholesky factor of the places' covariance.
    weights : ndarray, shape (n,)
    """

    covariance: Covariance
    hyper: Hyper
    lower: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, fitter: Fitter, model: Predicts, hyper: Hyper, used: np.ndarray | None = None,
           ) -> Surface:
        """
        Return the surface of a model's residual, with given hyperparameters.

        Parameters
        ----------
        used : ndarray of bool, shape (n,), optional
            Cells whose rows are used; all by default.
        """
        covariance = _covariance(fitter, model, hyper, used)
        lower = cholesky(covariance.matrix(hyper), lower=True)
        half = solve_triangular(lower, covariance.cells.force, lower=True)
        return cls(covariance, hyper, lower,
                   solve_triangular(lower, half, lower=True, trans=1))

    @classmethod
    def best(cls, fitter: Fitter, model: Predicts, needed: Hyper, *others: Hyper) -> Surface:
        """
        Return the surface of a model's residual, with the most probable hyperparameters.

        Parameters
        ----------
        needed : Hyper
            Of the joint fit with a discrepancy: a start of the search, beside a small amplitude.
            An even part of amplitude zero stays zero, and so does the odd part of one that is the
            same in both directions: a part that depends on the speed is odd.
        *others : Hyper
            Other starts.
        """
        covariance = _covariance(fitter, model, needed, None)
        there = covariance.cells
        local = Fitter(covariance)
        none = tuple(axis for axis, there in (('even', needed.even), ('odd', needed.both_ways))
                     if not there)
        small = local.first_hyper()._replace(**dict.fromkeys(none, 0))
        at = Linear.of((), np.zeros(0), there.force, np.zeros((len(there), 0)))
        found = [local.best_hyper(h, at, fixed=none)
                 for h in (needed._replace(slow=0, speed=0), small, *others)]
        return cls.of(fitter, model, max(found, key=lambda each: each[1])[0])

    def parts(self, strain: np.ndarray, pressure: np.ndarray, unit: int | None = None,
              ) -> tuple[np.ndarray, np.ndarray]:
        """
        Return the even part, and the odd part while shortening or after filling, (k,), N.

        Parameters
        ----------
        strain : ndarray, shape (k,)
        pressure : ndarray, shape (k, m), Pa
        unit : int, optional
            Only the part of this motor unit.
        """
        cells, h = self.covariance.cells, self.hyper
        even, odd = (self.covariance.variance(place) for place in (h.even, h.odd))
        across = self.covariance.across(h, strain, pressure, unit)
        return even * across @ self.weights, odd * across @ (cells.direction * self.weights)

    def sd(self, strain: np.ndarray, pressure: np.ndarray, unit: int) -> np.ndarray:
        """Return the standard deviation of a motor unit's even part, (k,), N; see `parts`."""
        even = self.covariance.variance(self.hyper.even)
        across = self.covariance.across(self.hyper, strain, pressure, unit)
        known = solve_triangular(self.lower, even * across.T, lower=True)
        left = even / pressure.shape[1] - np.sum(known ** 2, axis=0)
        return np.sqrt(np.maximum(left, 0.0))

    def of_rows(self, cells: Cells, rows: np.ndarray) -> np.ndarray:
        """Return the force of the surface in some rows of the cells' record, N."""
        data = cells.data
        even, odd = self.parts(data.strain[rows], data.pressure[rows])
        return even + odd * way_of(cells)[rows]


def way_of(cells: Cells) -> np.ndarray:
    """Return the direction of each row as `discrepancy_surface` computes it, (T,), -1 to 1."""
    record = cells.motion
    moving = np.tanh(record.strain_rate / ROUNDING)
    if not cells.data.is_held:
        return moving
    column = record.pressure[:, varying_unit(cells.data)]
    step = float(np.ptp(column)) / (PRESSURES - 1)
    begin = np.arange(len(column)) == 0 if record.start is None else record.start
    way, _ = bound(dahl, 'scans')(0.0, 0.0, column, DEAD * step, step, begin)
    return (1.0 - np.abs(moving)) * way


def _covariance(fitter: Fitter, model: Predicts, hyper: Hyper, used: np.ndarray | None,
                ) -> Covariance:
    """Return the covariance of a model's residual, averaged over all visits to each place."""
    cells = fitter.cells
    kept = cells.label >= 0
    if used is not None:
        kept &= used[cells.label]
    off = cells.residual_of_rows(model)
    way = way_of(cells) if hyper.both_ways else np.zeros(len(off))
    there = _averaged(cells, off, places(cells, kept, np.sign(way).astype(int)), way)
    return Covariance(there, fitter.covariance.unexplained, cells.force_sd)


def _averaged(cells: Cells, off: np.ndarray, label: np.ndarray, way: np.ndarray) -> Cells:
    """
    Return residuals of rows, (T,), N, averaged over places, as cells without time.

    The scatter between visits is noise of the mean.
    """
    data, kept = cells.data, label >= 0
    rows = np.bincount(label[kept]).astype(float)
    mean = averages(label, len(rows))
    force = mean(off)
    visit, index, length = np.unique(np.stack([label[kept], data.trial[kept]]), axis=1,
                                     return_inverse=True, return_counts=True)
    visits = np.bincount(visit[0])
    apart = np.bincount(index.ravel(), off[kept]) / length - force[visit[0]]
    between = np.sum(apart ** 2) / max(len(apart) - len(force), 1)
    variance = cells.noise ** 2 / rows + between / visits
    nowhere = np.zeros(len(rows))
    return replace(
        cells, label=label, count=rows, variance=variance, force=force,
        strain=mean(data.strain), strain_coordinate=mean(data.strain),
        pressure=mean(data.pressure), direction=mean(way), speed=nowhere, trial=nowhere,
        time=None, stiffness=None, one_force=False, strain_noise=0.0)
