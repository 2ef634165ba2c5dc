# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fit one set of effects to cells: its most probable parameters and its evidence.

The fit is least squares of whitened residuals with the priors as additional rows. Parameters and
hyperparameters of the discrepancy are fitted alternately, in small steps, starting from a large
white misfit (annealing): otherwise the discrepancy would absorb what physics can explain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.hyperparameters import along_ridge, ascend, Value
from fam_bundle_ros.discovery.linear import Linear, log_evidence, pinned
from fam_bundle_ros.discovery.predict import STEP
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.model import Bundle, Motion

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
#: A force whose stiffness is below this share of that of the model as given determines no strain.
_NO_STIFFNESS = 1e-3

#: Coordinates u (p,), and residual (n,) and slopes (n, p) at u.
Point = tuple[np.ndarray, np.ndarray, np.ndarray]
#: Log evidence, point and hyperparameters.
Found = tuple[float, Point, Hyper]


@dataclass(frozen=True, eq=False)
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

    @property
    def point(self) -> Point:
        """The fitted u, with residual and slopes there."""
        return self.u, self.residual, self.slopes

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


@dataclass
class Fitter:
    """
    Fits models to the cells of a covariance.

    Attributes
    ----------
    covariance : Covariance
    rival_errors : dict of str to list of ndarray, N
        Errors of each rival on the test cells of each fold. They are the same for all models and
        computed once, by `held_out.held_out`.
    """

    covariance: Covariance
    rival_errors: dict[str, list[np.ndarray]] | None = None
    #: What was computed, as the same fits are compared in several steps towards an answer.
    _alone: dict[Fit, Fit] = field(default_factory=dict, repr=False)
    _refitted: dict[tuple[Fit, bytes], Point] = field(default_factory=dict, repr=False)

    @property
    def cells(self) -> Cells:
        """Cells to which the models are fitted."""
        return self.covariance.cells

    def residual(self, model: Bundle, priors: Sequence[Prior], u: np.ndarray) -> np.ndarray:
        """Return measured minus predicted force of the cells, (n,), N; see `in_strain`."""
        moved = with_coordinates(model, priors, u)
        motion, mean = self._seen_by(moved)
        if self.cells.stiffness is None:
            return self._off(mean(moved.predict(motion)))
        below, above = (mean(moved.predict(there)) for there in _beside(motion))
        return in_strain(self.cells, self._off(0.5 * (below + above)), _slope(below, above))[0]

    def linearised(self, model: Bundle, priors: Sequence[Prior], u: np.ndarray,
                   kept: Mapping[str, np.ndarray] | None = None,
                   ) -> tuple[np.ndarray, np.ndarray]:
        """
        Return residual (n,) and derivatives of the predicted force in u (n, p), N.

        Data at constant force are scored in strain, see `in_strain`.

        Parameters
        ----------
        kept : mapping of str to ndarray (n,), optional
            Slopes that need not be computed again, by key.
        """
        known = kept or {}
        moved = with_coordinates(model, priors, u)
        asked = [j for j, prior in enumerate(priors) if prior.key not in known]
        slope = np.array([priors[j].slope(u[j]) for j in asked])
        motion, mean = self._seen_by(moved)
        keys = [priors[j].key for j in asked]
        if self.cells.stiffness is None:
            force, columns = map(mean, moved.jacobian(motion, keys))
            residual = self._off(force)
        else:
            below, above = ([mean(each) for each in moved.jacobian(there, keys)]
                            for there in _beside(motion))
            stiff, bends = map(_slope, below, above)
            residual, by_force, by_stiffness = in_strain(
                self.cells, self._off(0.5 * (below[0] + above[0])), stiff)
            columns = (by_force[:, None] * 0.5 * (below[1] + above[1])
                       - by_stiffness[:, None] * bends)
        slopes = np.empty((len(self.cells), len(priors)), order='F')
        columns = columns * slope
        slopes[:, asked] = np.where(np.isfinite(columns), columns, 0.0)
        for j, prior in enumerate(priors):
            if prior.key in known:
                slopes[:, j] = known[prior.key]
        return residual, slopes

    def _seen_by(self, model: Bundle) -> tuple[Motion, Callable[[np.ndarray], np.ndarray]]:
        """Return the motion for which a model is computed, and its averages over cells."""
        return (self.cells.motion, self.cells.mean) if model.has_memory else self.cells.blocks

    def _off(self, mean: np.ndarray) -> np.ndarray:
        """Return measured minus predicted force of the cells, (n,), N."""
        return self.cells.force - np.where(np.isfinite(mean), mean, 1e6)

    def evidence_of(self, fit: Fit) -> float:
        """
        Return the log posterior of a set under this covariance, from the fit's linear model.

        For a covariance in which some cells carry no information (`Covariance.without`).
        """
        return fit.log_prior - fit.promise + log_evidence(self.covariance, fit.hyper, fit.linear)

    def most_probable(self, model: Bundle, priors: Sequence[Prior], at: Point,
                      whiten: Callable[[np.ndarray], np.ndarray], iterations: int,
                      tolerance: float = 0.05) -> Point:
        """
        Return the most probable u under a covariance, with residual and slopes at it.

        Levenberg-Marquardt with bounds and exact derivatives; it stops when the quadratic model
        predicts a decrease of chi2 below ``tolerance``. scipy's solver takes several times as
        long for so few parameters, and this method is called some thousand times.

        Parameters
        ----------
        at : Point
            Where to start.
        whiten : callable
            Whitens residuals (n,) or slopes (n, p).
        """
        low, high = np.array([prior.limits for prior in priors]).T
        u, residual, slopes = at
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

    def best_hyper(self, h: Hyper, at: Linear, fixed: Sequence[str] = ()) -> tuple[Hyper, float]:
        """Return the hyperparameters of the highest log evidence near h, and that log evidence."""
        value = self._value(at)
        best = ascend(h, value, [axis for axis in self.covariance.axes if axis not in fixed])
        return best, value(best)

    def beside_discrepancy(self, fit: Fit, start: Hyper) -> Fit:
        """Return a fit with the same parameters, and the discrepancy most probable beside them."""
        hyper, evidence = self.best_hyper(start, fit.linear)
        return replace(fit, hyper=hyper, evidence=evidence)

    def _value(self, at: Linear, reached: bool = False) -> Value:
        """Return the log evidence of a linear model as a function of the hyperparameters."""
        return cache(lambda h: log_evidence(self.covariance, h, at, reached))

    def first_hyper(self) -> Hyper:
        """Return the small discrepancy from which the climb starts after the annealing."""
        axes = self.covariance.axes
        return _FIRST._replace(**{axis: 0 for axis in ('odd', 'slow', 'speed')
                                  if axis not in axes})

    def fit(self, names: tuple[str, ...], model: Bundle, priors: Sequence[Prior],
            log_prior: float = 0.0) -> Fit:
        """
        Return the fit of a set of effects, annealed from the start values of its priors.

        It depends on the set alone: where a similar set is far off (geometry that stands in for a
        missing bladder), a fit that starts there may end at a local optimum.
        """
        u, residual, slopes = self._point(model, priors, {})
        start = Fit(names, model, tuple(priors), u, Hyper(), residual, slopes, -np.inf,
                    log_prior=log_prior)
        white, point, _ = self._annealed(start, 12, _ROUGH)
        return self._finished(start, self._climb(start, point, self.first_hyper(), 2), white)

    def from_similar(self, fit: Fit, start: Mapping[str, float], hyper: Hyper) -> Fit:
        """
        Return the better of a fit and one that starts at that of a similar set.

        Parameters
        ----------
        fit : Fit
        start : mapping of str to float
            Values of u by key; of other parameters those of the priors.
        hyper : Hyper
            Of the similar set.
        """
        found = self._climb(fit, self._point(fit.model, fit.priors, start), hyper, 99)
        return fit if found[0] <= fit.evidence else self._finished(
            fit, found, fit.white_evidence)

    def _point(self, model: Bundle, priors: Sequence[Prior], start: Mapping[str, float]) -> Point:
        u = np.array([np.clip(start.get(p.key, p.start), *p.limits) for p in priors])
        return u, *self.linearised(model, priors, u)

    def without_discrepancy(self, fit: Fit) -> Fit:
        """
        Return the set refitted with a white misfit, of the size of highest evidence.

        A discrepancy biases the physical parameters (Brynjarsdottir and O'Hagan 2014).
        """
        if fit not in self._alone:
            self._alone[fit] = self._without_discrepancy(fit)
        return self._alone[fit]

    def _without_discrepancy(self, fit: Fit) -> Fit:
        found = self._annealed(fit, 25)
        if found[0] < fit.white_evidence - _ROUGH:
            # the discrepancy had led to another optimum than `fit` found without it
            u, residual, slopes = self._point(fit.model, fit.priors, {})
            start = replace(fit, u=u, residual=residual, slopes=slopes)
            found = max(found, self._annealed(start, 25), key=lambda each: each[0])
        return self._finished(fit, found, found[0])

    def refit_to(self, fit: Fit, kept: np.ndarray) -> Point:
        """
        Return the most probable point of a set fitted to some of the cells, (n,) bool.

        The misfit stays that of ``fit``, which has no discrepancy. There may be two optima, nearly
        equal on the kept cells and tens of times apart on the others. A fit from the optimum for
        all cells alone would know the others. So another one is annealed from the start values
        of the priors, and the more probable of the two is returned.
        """
        key = fit, kept.tobytes()
        if key not in self._refitted:
            self._refitted[key] = self._refit_to(fit, kept)
        return self._refitted[key]

    def _refit_to(self, fit: Fit, kept: np.ndarray) -> Point:
        sd = 1.0 / self.covariance.whiten(fit.hyper, np.ones(len(kept)))[kept]

        def whitener(heat: float) -> Callable[[np.ndarray], np.ndarray]:
            return lambda values: (values[kept].T / (heat * sd)).T

        whiten = whitener(1.0)
        cold = self._point(fit.model, fit.priors, {})
        heat = float(np.sqrt(np.mean(whiten(cold[1]) ** 2)))
        while heat > 1.0:
            cold = self.most_probable(fit.model, fit.priors, cold, whitener(heat), 12)
            heat /= 2.0
        found = [self.most_probable(fit.model, fit.priors, point, whiten, 25)
                 for point in (fit.point, cold)]
        return min(found, key=lambda at: float(np.sum(whiten(at[1]) ** 2) + at[0] @ at[0]))

    def _annealed(self, fit: Fit, iterations: int, tolerance: float = 0.05) -> Found:
        """Fit without discrepancy: reduce the white misfit as long as the evidence grows."""
        best: Found | None = None
        point = fit.point
        for place in COOLING:
            h = Hyper(white=place)
            point = self.most_probable(fit.model, fit.priors, point, self.whitener(h), iterations,
                                       tolerance)
            value = log_evidence(self.covariance, h, Linear.of(fit.priors, *point), reached=True)
            if best is not None and value <= best[0]:
                break
            best = (value, point, h)
        assert best is not None
        return best

    def _finished(self, fit: Fit, found: Found, white: float) -> Fit:
        """Return a fit that ends at what was found, with its evidence without a discrepancy."""
        evidence, (u, residual, slopes), h = found
        whitened = self.covariance.whiten(h, slopes)
        spread = np.linalg.inv(np.eye(len(u)) + whitened.T @ whitened)
        at = Linear.of(fit.priors, u, residual, slopes)
        return replace(fit, model=with_coordinates(fit.model, fit.priors, u), u=u, hyper=h,
                       residual=residual, slopes=slopes, evidence=evidence, white_evidence=white,
                       promise=log_evidence(self.covariance, h, at) - evidence, covariance=spread)

    def _climb(self, fit: Fit, point: Point, h: Hyper, reach: int) -> Found:
        """Fit parameters and hyperparameters alternately; return the best evidence."""
        best: Found | None = None
        for k in range(8):
            point = self.most_probable(fit.model, fit.priors, point, self.whitener(h),
                                       6 if k else 12, _ROUGH)
            at = Linear.of(fit.priors, *point)
            linear, reached = self._value(at), self._value(at, reached=True)
            now = reached(h)
            value = reached if linear(h) > now + _ROUGH else linear
            better = ascend(h, value, self.covariance.axes, reach)
            if value(better) - now < _SETTLED:
                better = along_ridge(better, value, reach)
            high = value(better)
            found = [(now, point, h), (reached(better), point, better)]
            best = max([best, *found] if best else found, key=lambda each: each[0])
            if high - now < _SETTLED:
                break
            h = better
        assert best is not None
        return best


def in_strain(cells: Cells, off: np.ndarray, stiff: np.ndarray,
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return the residual of cells at constant force, (n,), N, and its derivatives.

    It is the error of the strain that the model predicts, times the stiffness of the model as
    given. The former is the error of the force over the stiffness of the model that is fitted.
    Beyond the range of the strain, where this says little, it grows with the logarithm: were it
    constant there, no fit would find the way back, and a smooth discrepancy could explain it. A
    force that does not depend on the strain determines no strain: its error is the whole range.

    Parameters
    ----------
    off : ndarray, shape (n,), N
        Measured minus predicted force.
    stiff : ndarray, shape (n,), N
        -dF/de of the model that is fitted.

    Returns
    -------
    residual, by_force, by_stiffness : ndarray, shape (n,)
        The derivatives are those in ``off`` (1) and in ``stiff`` (1).
    """
    assert cells.stiffness is not None
    most, off = cells.strain_range, off - cells.strain_noise
    least = _NO_STIFFNESS * cells.stiffness
    bounded, sign = np.maximum(stiff, least), np.where(off < 0.0, -1.0, 1.0)
    error = np.abs(off) / bounded
    far = (error >= most) | (stiff <= 0.0)
    beyond = np.maximum(error / most, 1.0)
    residual = sign * np.where(far, most * (1.0 + np.log(beyond)), error)
    by_force = 1.0 / (bounded * beyond) * ~(far & (error < most))
    by_stiffness = -sign * np.where(far, most, error) / bounded * (stiff > least)
    return (cells.stiffness * residual + cells.strain_noise, cells.stiffness * by_force,
            cells.stiffness * by_stiffness)


def _beside(motion: Motion) -> tuple[Motion, Motion]:
    """Return a motion at slightly smaller and at slightly larger strains."""
    return replace(motion, strain=motion.strain - STEP), replace(
        motion, strain=motion.strain + STEP)


def _slope(below: np.ndarray, above: np.ndarray) -> np.ndarray:
    """Return minus the derivative in the strain of what was computed `_beside` a motion."""
    return (below - above) / (2.0 * STEP)


def with_coordinates(model: Bundle, priors: Sequence[Prior], u: np.ndarray) -> Bundle:
    """Return a model with its parameters set to coordinates u of their priors."""
    return model.with_parameters({prior.key: prior.theta(value)
                                  for prior, value in zip(priors, u)})
