# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fit one set of effects to cells: its most probable parameters and its evidence.

The fit is least squares of whitened residuals with the priors as additional rows. The evidence is
Laplace's approximation at the optimum; parameters at a bound count as fixed. The hyperparameters
of the discrepancy are found by coordinate ascent on a grid, in small steps, starting from a large
white misfit (annealing): otherwise the discrepancy would absorb what physics can explain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqrf
from scipy.special import log_ndtr

from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Covariance, GRID, Hyper
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.model import Bundle

#: White misfits of the annealing, as places on the grid; 0 is none.
COOLING = range(12, -1, -2)
#: Start of the discrepancy after the annealing, as places on the grid.
_FIRST = Hyper(even=7, odd=6, white=6, slow=6, speed=6)
#: Longest step of a fit, in widths of the priors.
_LONGEST = 2.0
#: A fit stops when a step reduces chi2 by less; about the accuracy of the log evidence.
_ROUGH = 0.2
#: Hyperparameters are final when another place on the grid gains less, in log units.
_SETTLED = 0.3
#: Log units below which two places on the grid count as equal.
_EQUAL = 1e-3
#: Most grid places of an amplitude per place of a length: 2^(5/2) in quarter decades.
_RIDGE = 3
#: Step from an amplitude of zero: the first places on the grid hardly change the evidence.
_LEAP = 4

#: Coordinates u (p,), and residual (n,) and slopes (n, p) at u.
Point = tuple[np.ndarray, np.ndarray, np.ndarray]


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


@dataclass(frozen=True)
class Fit:
    """
    A set of effects fitted to cells.

    Attributes
    ----------
    names : tuple of str
        Effects of the model, sorted.
    model : Bundle
        With the fitted values.
    priors : tuple of Prior
    u : ndarray, shape (p,)
        Coordinates of the priors.
    hyper : Hyper
    residual : ndarray, shape (n,), N
    slopes : ndarray, shape (n, p), N
        Derivatives of the predicted force with respect to u.
    evidence, white_evidence : float
        Log evidence with the discrepancy, and the best one with a white misfit instead.
    log_prior : float
        Log prior probability of the set.
    promise : float
        Excess of the linear model's log evidence over `evidence`: large at a kink of the model.
    covariance : ndarray, shape (p, p)
        Of u, by Laplace's approximation.
    """

    names: tuple[str, ...]
    model: Bundle
    priors: tuple[Prior, ...]
    u: np.ndarray
    hyper: Hyper
    residual: np.ndarray
    slopes: np.ndarray
    evidence: float
    white_evidence: float = -np.inf
    log_prior: float = 0.0
    promise: float = 0.0
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)), repr=False)

    @property
    def posterior(self) -> float:
        """Log posterior of the set, up to a constant."""
        return self.evidence + self.log_prior

    @property
    def white_posterior(self) -> float:
        """Log posterior of the set fitted without a discrepancy, up to a constant."""
        return self.white_evidence + self.log_prior

    @cached_property
    def start(self) -> dict[str, float]:
        """The fitted u by key of the parameter: start values for a neighbouring set."""
        return {prior.key: float(u) for prior, u in zip(self.priors, self.u)}

    @cached_property
    def linear(self) -> Linear:
        """The model linearised at the fitted u."""
        return Linear.of(self.priors, self.u, self.residual, self.slopes)

    @property
    def at_bound(self) -> np.ndarray:
        """Return which parameters are at a bound, (p,) bool."""
        return pinned(self.priors, self.u)


def pinned(priors: Sequence[Prior], u: np.ndarray) -> np.ndarray:
    """Return which coordinates are at a limit, (p,) bool."""
    return np.array([not prior.limits[0] + 1e-9 < value < prior.limits[1] - 1e-9
                     for prior, value in zip(priors, u)], bool)


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
        Use the sizes at u as means, as in `Fitter.log_evidence`.
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


@dataclass
class Fitter:
    """
    Fits models to cells under one covariance.

    Attributes
    ----------
    cells : Cells
    covariance : Covariance
    rival_errors : list of list of ndarray, N
        For each fold the errors of each rival on its test cells. They are the same for all models
        and computed once, by `held_out.held_out`.
    """

    cells: Cells
    covariance: Covariance
    rival_errors: list[list[np.ndarray]] | None = None

    def residual(self, model: Bundle, priors: Sequence[Prior], u: np.ndarray) -> np.ndarray:
        """Return measured minus predicted force of the cells, (n,), N."""
        return self._off(with_coordinates(model, priors, u).predict(self.cells.motion))

    def linearised(self, model: Bundle, priors: Sequence[Prior], u: np.ndarray,
                   kept: Mapping[str, np.ndarray] | None = None,
                   ) -> tuple[np.ndarray, np.ndarray]:
        """
        Return residual (n,) and derivatives of the predicted force in u (n, p), N.

        Parameters
        ----------
        kept : mapping of str to ndarray (n,), optional
            Slopes that need not be computed again, by key.
        """
        known = kept or {}
        moved = with_coordinates(model, priors, u)
        asked = [j for j, prior in enumerate(priors) if prior.key not in known]
        slope = np.array([priors[j].slope(u[j]) for j in asked])
        force, columns = moved.jacobian(self.cells.motion, [priors[j].key for j in asked])
        slopes = np.empty((len(self.cells), len(priors)), order='F')
        columns = self.cells.mean(columns) * slope
        slopes[:, asked] = np.where(np.isfinite(columns), columns, 0.0)
        for j, prior in enumerate(priors):
            if prior.key in known:
                slopes[:, j] = known[prior.key]
        return self._off(force), slopes

    def _off(self, force: np.ndarray) -> np.ndarray:
        """Return measured minus predicted force of the cells, from predictions of the rows."""
        mean = self.cells.mean(force)
        return self.cells.force - np.where(np.isfinite(mean), mean, 1e6)

    def log_evidence(self, h: Hyper, at: Linear, reached: bool = False) -> float:
        """
        Return the log evidence of a linearised model.

        Parameters
        ----------
        reached : bool
            Use the misfit at u instead of the minimum of the linear model. At a kink (slack
            tendon, threshold) the nonlinear model does not reach that minimum.
        """
        n, k = len(at.columns), len(at.own)
        # by QR: with slopes that are large and nearly parallel I + B'B is not positive definite
        stacked = np.zeros((n + k, k + 1), order='F')
        white = stacked[:n] = self.covariance.whiten(h, at.columns)
        stacked[n + np.arange(k), np.arange(k)] = 1.0
        factor = dgeqrf(stacked, overwrite_a=1)[0]
        diagonal = np.diag(factor)
        misfit = float(np.sum((white[:, k] - white[:, :k] @ at.own) ** 2) + at.own @ at.own
                       ) if reached else diagonal[k] ** 2
        return float(at.constant - 0.5 * misfit - np.log(np.abs(diagonal[:k])).sum()
                     - self.covariance.log_determinant(h) + self.covariance.log_prior(h)
                     + (_log_evidence_of_sizes(factor, at, reached) if at.sizes else 0.0))

    def evidence_of(self, fit: Fit) -> float:
        """
        Return the log posterior of a set under this covariance, from the fit's linear model.

        For a covariance in which some cells carry no information (`Covariance.without`).
        """
        return fit.log_prior - fit.promise + self.log_evidence(fit.hyper, fit.linear)

    def most_probable(self, model: Bundle, priors: Sequence[Prior], u: np.ndarray,
                      whiten: Callable[[np.ndarray], np.ndarray], iterations: int,
                      tolerance: float = 0.05, at: Point | None = None) -> Point:
        """
        Return the most probable u under a covariance, with residual and slopes at it.

        Levenberg-Marquardt with bounds and exact derivatives; it stops when the quadratic model
        predicts a decrease of chi2 below ``tolerance``. scipy's solver takes several times as
        long for so few parameters, and this method is called some thousand times.

        Parameters
        ----------
        u : ndarray, shape (p,)
            Start values.
        whiten : callable
            Whitens residuals (n,) or slopes (n, p).
        at : Point, optional
            Residual and slopes at u, if known.
        """
        low, high = np.array([prior.limits for prior in priors]).T
        residual, slopes = at[1:] if at is not None else self.linearised(model, priors, u)
        damping = 1e-3
        for _ in range(iterations):
            white = whiten(np.concatenate([residual[:, None], slopes], axis=1))
            a, b = white[:, 0], white[:, 1:]
            cost = float(a @ a + u @ u)
            gradient, hessian = b.T @ a - u, b.T @ b + np.eye(len(u))
            free = ~(((u <= low) & (gradient < 0)) | ((u >= high) & (gradient > 0)))
            moved = False
            for _ in range(7):
                part = hessian[np.ix_(free, free)]
                step = np.zeros(len(u))
                step[free] = np.linalg.solve(part + damping * np.diag(np.diag(part)),
                                             gradient[free])
                tried = np.clip(u + np.clip(step, -_LONGEST, _LONGEST), low, high)
                step = tried - u
                if 2.0 * gradient @ step - step @ hessian @ step < tolerance:
                    break
                there = self.residual(model, priors, tried)
                if float(np.sum(whiten(there) ** 2) + tried @ tried) < cost:
                    u, moved = tried, True
                    damping = max(damping / 6.0, 1e-8)
                    break
                damping *= 8.0
            if not moved:
                break
            # slopes take many times as long as the force: compute them only for accepted steps
            residual, slopes = self.linearised(model, priors, u)
        return u, residual, slopes

    def whitener(self, h: Hyper) -> Callable[[np.ndarray], np.ndarray]:
        """Return the whitening function for hyperparameters."""
        return lambda values: self.covariance.whiten(h, values)

    def best_hyper(self, h: Hyper, at: Linear, reach: int = 99, fixed: Sequence[str] = (),
                   reached: bool = False) -> tuple[Hyper, float]:
        """
        Return the hyperparameters of the highest log evidence near h, and that log evidence.

        Coordinate ascent on the grid.

        Parameters
        ----------
        reach : int
            Most places on the grid by which each hyperparameter may move.
        fixed : sequence of str
            Hyperparameters that do not move.
        """
        known: dict[Hyper, float] = {}

        def value(q: Hyper) -> float:
            if q not in known:
                known[q] = self.log_evidence(q, at, reached)
            return known[q]

        first = h
        value(h)
        for _ in range(6):
            before = h
            for axis in self.covariance.axes:
                if axis in fixed:
                    continue
                if axis in ('strain', 'pressure') and not (h.even or h.odd or h.speed):
                    continue
                if axis == 'tau' and not h.slow:
                    continue
                for step in (-1, 1, *((_LEAP,) if not getattr(h, axis) else ())):
                    while True:
                        place = getattr(h, axis) + step
                        if not 0 <= place < getattr(GRID, axis) or (
                                abs(place - getattr(first, axis)) > reach):
                            break
                        q = h._replace(**{axis: place})
                        if value(q) <= value(h) + _EQUAL:
                            break
                        h = q
            if h == before:
                break
        return h, known[h]

    def along_ridge(self, h: Hyper, at: Linear, reach: int = 99, reached: bool = False,
                    ) -> tuple[Hyper, float]:
        """
        Return the hyperparameters of the highest log evidence with another length, and its value.

        For a Matern 5/2 covariance the data determine only amplitude / length^(5/2) (Zhang 2004,
        J. Am. Stat. Assoc. 99, 250), so coordinate ascent stops on this ridge: move both at once.
        Twice the length means 5.7 times the amplitude, three places of a quarter decade, or
        fewer where the other length stays. Parameters as in `best_hyper`.
        """
        parts = [part for part in ('even', 'odd', 'speed') if getattr(h, part)]
        moved = [parts] if len(parts) < 2 else [parts, *([part] for part in parts)]
        places = [h._replace(**{axis: getattr(h, axis) + step},
                             **{part: getattr(h, part) - step * more for part in some})
                  for axis in ('strain', 'pressure') for step in (-1, 1)
                  for more in range(1, min(_RIDGE, reach) + 1) for some in moved if some]
        places = [q for q in places if all(0 <= place < size for place, size in zip(q, GRID))]
        values = [self.log_evidence(q, at, reached) for q in (h, *places)]
        # the first of equal places, so that the choice does not depend on rounding
        best = next(k for k, value in enumerate(values) if value >= max(values) - _EQUAL)
        return (h, *places)[best], values[best]

    def first_hyper(self) -> Hyper:
        """Return the small discrepancy from which the climb starts after the annealing."""
        axes = self.covariance.axes
        return _FIRST._replace(**{axis: 0 for axis in ('odd', 'slow', 'speed')
                                  if axis not in axes})

    def fit(self, names: tuple[str, ...], model: Bundle, priors: Sequence[Prior],
            start: Mapping[str, float] | None = None, hyper: Hyper | None = None,
            log_prior: float = 0.0) -> Fit:
        """
        Return the fit of a set of effects.

        Parameters
        ----------
        start : mapping of str to float, optional
            Start values of u by key; by default those of the priors.
        hyper : Hyper, optional
            Of a similar set: a second start beside the small discrepancy after the annealing.
        """
        starts = start or {}
        u = np.array([np.clip(starts.get(p.key, p.start), *p.limits) for p in priors])
        first = (u, *self.linearised(model, priors, u))
        white, point, _ = self._annealed(model, priors, first, 12, _ROUGH)
        tries = [self._climb(model, priors, point, self.first_hyper(), 2)]
        if hyper is not None:
            tries.append(self._climb(model, priors, first, hyper, 99))
        evidence, point, h = max(tries, key=lambda found: found[0])
        return self._finished(names, model, priors, point[0], h, point[1], point[2], evidence,
                              white, log_prior)

    def without_discrepancy(self, fit: Fit) -> Fit:
        """
        Return the set refitted with a white misfit, of the size of highest evidence.

        A discrepancy biases the physical parameters (Brynjarsdottir and O'Hagan 2014).
        """
        value, (u, residual, slopes), h = self._annealed(
            fit.model, fit.priors, (fit.u, fit.residual, fit.slopes), 25)
        return self._finished(fit.names, fit.model, fit.priors, u, h, residual, slopes, value,
                              value, fit.log_prior)

    def _annealed(self, model: Bundle, priors: Sequence[Prior], point: Point, iterations: int,
                  tolerance: float = 0.05) -> tuple[float, Point, Hyper]:
        """Fit without discrepancy: reduce the white misfit as long as the evidence grows."""
        best: tuple[float, Point, Hyper] | None = None
        for place in COOLING:
            h = Hyper(white=place)
            point = self.most_probable(model, priors, point[0], self.whitener(h), iterations,
                                       tolerance, point)
            value = self.log_evidence(h, Linear.of(priors, *point), reached=True)
            if best is not None and value <= best[0]:
                break
            best = (value, point, h)
        assert best is not None
        return best

    def _finished(self, names: tuple[str, ...], model: Bundle, priors: Sequence[Prior],
                  u: np.ndarray, h: Hyper, residual: np.ndarray, slopes: np.ndarray,
                  evidence: float, white: float, log_prior: float) -> Fit:
        whitened = self.covariance.whiten(h, slopes)
        spread = np.linalg.inv(np.eye(len(u)) + whitened.T @ whitened)
        at = Linear.of(priors, u, residual, slopes)
        promise = self.log_evidence(h, at) - evidence
        return Fit(names, with_coordinates(model, priors, u), tuple(priors), u, h, residual,
                   slopes, evidence, white, log_prior, promise, spread)

    def _climb(self, model: Bundle, priors: Sequence[Prior], point: Point, h: Hyper, reach: int,
               ) -> tuple[float, Point, Hyper]:
        """Fit parameters and hyperparameters alternately; return the best evidence."""
        best: tuple[float, Point, Hyper] | None = None
        for k in range(8):
            point = self.most_probable(model, priors, point[0], self.whitener(h), 6 if k else 12,
                                       _ROUGH, point)
            at = Linear.of(priors, *point)
            now = self.log_evidence(h, at, reached=True)
            held = self.log_evidence(h, at) > now + _ROUGH
            better, high = self.best_hyper(h, at, reach, reached=held)
            if high - now < _SETTLED:
                better, high = self.along_ridge(better, at, reach, held)
            found = [(now, point, h), (self.log_evidence(better, at, reached=True), point, better)]
            best = max([best, *found] if best else found, key=lambda each: each[0])
            if high - now < _SETTLED:
                break
            h = better
        assert best is not None
        return best


def with_coordinates(model: Bundle, priors: Sequence[Prior], u: np.ndarray) -> Bundle:
    """Return a model with its parameters set to coordinates u of their priors."""
    return model.with_parameters({prior.key: prior.theta(value)
                                  for prior, value in zip(priors, u)})
