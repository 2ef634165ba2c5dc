# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A model linearised at its parameters, and its evidence under a covariance of the residual.

The priors are additional rows of least squares; parameters at a bound count as fixed.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqrf
from scipy.special import log_ndtr

from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.priors import Prior


class Linear(NamedTuple):
    """
    A model linearised at u: the data from which its evidence follows for any hyperparameters.

    Attributes
    ----------
    columns : ndarray, shape (n, k + 1), N
        Slopes in the k coordinates that are not at a limit, then the residual where these are
        zero. Order of the coordinates: ordinary ones, those of `others`, sizes that may be zero.
    own : ndarray, shape (k,)
        Values of these coordinates.
    sizes : int
        Number of sizes that may be zero.
    others : tuple of (int, int, float)
        Pairs of which either may be zero: place of the logarithmic coordinate, place of the size,
        and the value of the former at which the linear model has none of it.
    constant : float
        Part of the log evidence that depends only on the priors and the number of cells.
    """

    columns: np.ndarray
    own: np.ndarray
    sizes: int
    others: tuple[tuple[int, int, float], ...]
    constant: float

    @classmethod
    def of(cls, priors: Sequence[Prior], u: np.ndarray, residual: np.ndarray,
           slopes: np.ndarray) -> Linear:
        """Return the linear model for residual (n,) and slopes (n, p) at u (p,)."""
        held = pinned(priors, u)
        half = np.array([p.kind == 'half' for p in priors], bool)
        there = {p.key: k for k, p in enumerate(priors) if half[k] and not held[k]}
        beside = np.array([p.beside in there for p in priors], bool)
        free = np.concatenate([np.flatnonzero(~held & ~half & ~beside),
                               np.flatnonzero(~held & beside), np.flatnonzero(~held & half)])
        own, place = u[free], {k: j for j, k in enumerate(free.tolist())}
        # u is the logarithm over its width: in the linear model a step of -1 / width gives zero
        others = tuple((place[k], place[there[p.beside]], float(u[k] - 1.0 / p.width))
                       for k, p in enumerate(priors) if beside[k] and not held[k])
        columns = np.empty((len(residual), len(own) + 1), order='F')
        columns[:, :-1] = slopes[:, free]
        columns[:, -1] = residual + columns[:, :-1] @ own
        absent = np.sum(half & held & (u <= 0.0))
        return cls(columns, own, int(np.sum(half & ~held)), others, float(
            -np.log(2.0) * absent - 0.5 * np.sum(u[held] ** 2)
            - 0.5 * len(residual) * np.log(2.0 * np.pi)))


def pinned(priors: Sequence[Prior], u: np.ndarray) -> np.ndarray:
    """Return which coordinates are at a limit, (p,) bool."""
    return np.array([not prior.limits[0] + 1e-9 < value < prior.limits[1] - 1e-9
                     for prior, value in zip(priors, u)], bool)


def log_evidence(covariance: Covariance, h: Hyper, at: Linear, reached: bool = False) -> float:
    """
    Return the log evidence of a linearised model, by Laplace's approximation.

    Parameters
    ----------
    covariance : Covariance
        Of the residual, for the same cells as ``at``.
    h : Hyper
    at : Linear
    reached : bool
        Use the misfit at u instead of the minimum of the linear model. At a kink (slack
        tendon, threshold) the nonlinear model does not reach that minimum.
    """
    n, k = len(at.columns), len(at.own)
    # by QR: with slopes that are large and nearly parallel I + B'B is not positive definite
    stacked = np.zeros((n + k, k + 1), order='F')
    white = stacked[:n] = covariance.whiten(h, at.columns)
    stacked[n + np.arange(k), np.arange(k)] = 1.0
    factor = dgeqrf(stacked, overwrite_a=1)[0]
    diagonal = np.diag(factor)
    misfit = float(np.sum((white[:, k] - white[:, :k] @ at.own) ** 2) + at.own @ at.own
                   ) if reached else diagonal[k] ** 2
    return float(at.constant - 0.5 * misfit - np.log(np.abs(diagonal[:k])).sum()
                 - covariance.log_determinant(h) + covariance.log_prior(h)
                 + (_log_evidence_of_sizes(factor, at, reached) if at.sizes else 0.0))


def _log_evidence_of_sizes(factor: np.ndarray, at: Linear, reached: bool) -> float:
    """
    Return the correction of the log evidence for sizes that are not negative and may be zero.

    The prior of a size is zero with probability one half, else half-normal. Let m and s be mean
    and standard deviation of its posterior under a normal prior of width 1. Relative to that
    prior, a positive size contributes Phi(m / s), and a size of zero contributes half the ratio
    of posterior to prior density at zero (Dickey 1971, Ann. Math. Stat. 42, 204). If the size is
    positive, the other size of its law is zero with probability one half (friction proportional
    to the pressure without a constant part).

    Parameters
    ----------
    factor : ndarray, shape (n + k, k + 1)
        R of the stacked slopes, prior and residual.
    at : Linear
    reached : bool
        Use the sizes at u as means, as in `log_evidence`.
    """
    k = len(at.own)
    others = len(at.others)
    first = k - at.sizes - others
    # Python floats: called some ten thousand times for 1 to 4 sizes, where numpy is slower
    rows = factor[first:k, first:k + 1].tolist()
    root = _inverse_of_upper(rows)
    sd = [math.hypot(*row) for row in root]
    mean = at.own[first:].tolist() if reached else [
        sum(value * right[-1] for value, right in zip(row, rows)) for row in root]
    above = [float(log_ndtr(m / s)) for m, s in zip(mean, sd)]
    for place, size, none in at.others:
        i, j = place - first, size - first
        away = (none - mean[i]) / sd[i]
        shared = sum(a * b for a, b in zip(root[i], root[j])) / sd[i]
        alone = float(log_ndtr((mean[j] + shared * away) / math.sqrt(sd[j] ** 2 - shared ** 2)))
        gone = 0.5 * (none ** 2 - away ** 2) - math.log(sd[i])
        above[j] = float(np.logaddexp(above[j], alone + gone)) - math.log(2.0)
    return sum(float(np.logaddexp(above[j], -0.5 * (mean[j] / sd[j]) ** 2
                                  - math.log(2.0 * sd[j]))) for j in range(others, len(sd)))


def _inverse_of_upper(rows: list[list[float]]) -> list[list[float]]:
    """Return the inverse of an upper triangular matrix; columns beyond the square are ignored."""
    size = len(rows)
    root = [[0.0] * size for _ in rows]
    for j in range(size):
        root[j][j] = 1.0 / rows[j][j]
        for i in range(j - 1, -1, -1):
            root[i][j] = -sum(rows[i][m] * root[m][j] for m in range(i + 1, j + 1)) / rows[i][i]
    return root
