# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Joint refit of a model to a measurement: least squares with tolerances as priors.

The model's own parameters move together with those of an added effect, each held by what is known
before: geometry by its tolerances, constants of the model's effects by half their size. A small
Levenberg-Marquardt with bounds, written for many fits of few parameters on the same data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fam_bundle_ros.data.grouping import blocks, reversals, rms
from fam_bundle_ros.data.measurement import Measurement, RESOLUTION
from fam_bundle_ros.data.noise import autocorrelation_time, second_differences
from fam_bundle_ros.discovery.predict import motion, predict
from fam_bundle_ros.model import Bundle, Effect
from fam_bundle_ros.model.geometry import BRAID_ANGLE_TOLERANCE, RADIUS_TOLERANCE

#: How far a constant of the model's own effects is commonly off, relative.
CONSTANT_TOLERANCE = 0.5
#: Rows at rest or at a crawl are left out where at least this share of the rows is in motion.
_MOVING = 0.5
_STEP = 1e-3


@dataclass(frozen=True)
class Term:
    """
    One free parameter: key, bounds, the size in which it is counted, and what is known before.

    ``prior`` is None for a parameter of an added effect: nothing is known before but its bounds.
    """

    key: str
    lower: float
    upper: float
    scale: float
    start: float
    prior: float | None = None


def base_terms(model: Bundle) -> list[Term]:
    """Return the free parameters that a model has of its own: geometry, then its effects'."""
    first = model.motor_units[0].geometry
    thinnest = 1.02 * max(u.geometry.wall_thickness / u.geometry.radius
                          for u in model.motor_units)
    radius, angle = float(first.radius), float(first.braid_angle)
    spread = [float(u.geometry.braid_angle) - angle for u in model.motor_units]
    terms = [
        Term('geometry.radius', thinnest * radius, 4.0 * radius, RADIUS_TOLERANCE * radius,
             radius, radius),
        Term('geometry.braid_angle', np.radians(8.0) - min(spread), np.radians(54.0) - max(spread),
             BRAID_ANGLE_TOLERANCE, angle, angle)]
    for effect in model.effects:
        terms += effect_terms(effect, model.n, known=True)
    return terms


def effect_terms(effect: Effect, units: int, known: bool = False) -> list[Term]:
    """
    Return the free parameters of an effect.

    Parameters
    ----------
    units : int
        Motor units of the bundle: some effects have a parameter for each.
    known : bool
        True where the values are the model's own (a prior about them holds).
    """
    terms = []
    for parameter in effect.active(units):
        if not parameter.fitted:
            continue
        low, high = effect.limits(parameter.name)
        value = effect.values[parameter.name]
        if high <= low:
            continue
        size = abs(value) if value else 0.05 * (high - low)
        if known:
            size = CONSTANT_TOLERANCE * abs(value) if value else 0.1 * (high - low)
        terms.append(Term(f'{effect.name}.{parameter.name}', low, high, size, value,
                          value if known else None))
    return terms


@dataclass
class Fit:
    """
    A model fitted to a problem.

    Attributes
    ----------
    model : Bundle
    terms : list of Term
    values : ndarray, shape (p,)
        SI, in the order of ``terms``.
    residual : ndarray, shape (T,), N
    chi2 : float
        Sum of squares over the noise variance, spikes left out.
    prior : float
        Squared tolerances moved, summed.
    jacobian : ndarray, shape (T, p)
        Of the whitened prediction in scaled parameters.
    """

    model: Bundle
    terms: list[Term]
    values: np.ndarray
    residual: np.ndarray
    chi2: float
    prior: float
    jacobian: np.ndarray
    added: tuple[str, ...] = ()

    @property
    def cost(self) -> float:
        """Return what the fit has made small."""
        return self.chi2 + self.prior

    def moved(self) -> dict[str, float]:
        """Return how many tolerances each of the model's own parameters has moved."""
        return {term.key: float((value - term.prior) / term.scale)
                for term, value in zip(self.terms, self.values) if term.prior is not None}


#: From a fit to an error in N.
ErrorOf = Callable[[Fit], float]


class Problem:
    """
    A measurement made ready for many fits.

    Parameters
    ----------
    data : Measurement
    model : Bundle
        The model to start from; its residual shows noise and spikes.
    largest : int
        Longer logs are averaged in blocks of neighbours down to about this many rows, as far as
        their motion allows, and beyond that represented by stretches from all over the log.
    noise : float, N, optional
        Standard deviation of one row's noise; by default measured.
    """

    def __init__(self, data: Measurement, model: Bundle, largest: int = 6000,
                 noise: float | None = None):
        self.full = data
        self.block = 1
        self.data = data
        if not data.is_static and len(data) > largest:
            self.block = min(int(np.ceil(len(data) / largest)), widest_block(data))
            self.data = average(stretches(data, largest * self.block), self.block)
        self.motion = motion(self.data)
        residual = self.data.force - predict(model, self.data)
        self.noise = noise or second_differences(self.data, residual) or 1e-9
        finest = RESOLUTION * max(float(np.abs(self.data.force).max()), 1e-9)
        self.noise = max(self.noise, finest)
        self.weight = ~spikes(self.data, residual, self.noise) & ~reversals(self.data)
        moving = self.data.direction != 0
        # at a crawl the sign of a noisy rate is a guess, and so is the force of friction
        if moving.mean() >= _MOVING:
            self.weight &= moving
        if noise is None and self.weight.sum() < len(self.data):
            kept = self.data.select(self.weight)
            self.noise = max(second_differences(kept, residual[self.weight]) or self.noise,
                             finest)
        self.model = model
        #: Noise of one row of the measurement, before neighbours were averaged.
        self.row_noise = self.noise
        if self.block > 1:
            whole = second_differences(data, data.force - predict(model, data))
            self.row_noise = max(whole or 0.0, self.noise)

    @property
    def samples(self) -> int:
        """Number of rows that count."""
        return int(self.weight.sum())

    def residual(self, model: Bundle) -> np.ndarray:
        """Return measured minus modelled force, (T,), N."""
        return self.data.force - model.predict(self.motion)

    def chi2(self, residual: np.ndarray) -> float:
        """Return the sum of squares over the noise variance."""
        return float(np.sum((residual[self.weight] / self.noise) ** 2))

    def correlation(self, residual: np.ndarray) -> float:
        """Return samples per independent sample of a residual (at least 1)."""
        kept = np.where(self.weight, residual, 0.0)
        return autocorrelation_time(kept, self.data.trial)

    def fit(self, model: Bundle, terms: Sequence[Term], start: Mapping[str, float] | None = None,
            iterations: int = 25, tolerance: float = 0.05, huber: bool = False) -> Fit:
        """
        Refit ``terms`` of a model from their start values (or from ``start``).

        Stops when a step gains less than ``tolerance`` (in chi2).
        """
        terms = list(terms)
        scale = np.array([t.scale for t in terms])
        low = np.array([t.lower for t in terms])
        high = np.array([t.upper for t in terms])
        centre = np.array([np.nan if t.prior is None else t.prior for t in terms])
        held = np.isfinite(centre)
        given = start or {}
        theta = np.clip(np.array([given.get(t.key, t.start) for t in terms], float), low, high)

        def evaluate(values: np.ndarray) -> np.ndarray:
            bundle = model.with_parameters({t.key: v for t, v in zip(terms, values)})
            return self.residual(bundle)

        def cost_of(residual: np.ndarray, values: np.ndarray) -> tuple[float, float]:
            z = (values[held] - centre[held]) / scale[held]
            total = self.chi2(residual)
            return (total if np.isfinite(total) else np.inf), float(np.sum(z * z))

        residual = evaluate(theta)
        chi2, prior = cost_of(residual, theta)
        damping = 1e-3
        jacobian = np.zeros((len(residual), len(terms)))
        fresh = False
        for _ in range(iterations):
            jacobian = self._jacobian(evaluate, theta, residual, scale, low, high)
            fresh = True
            if not terms:
                break
            r = np.where(self.weight, residual, 0.0) / self.noise
            gradient = jacobian.T @ r
            hessian = jacobian.T @ jacobian
            z = np.where(held, (theta - np.nan_to_num(centre)) / scale, 0.0)
            gradient -= z * held
            hessian[np.diag_indices_from(hessian)] += held * 1.0
            free = ~(((theta <= low) & (gradient < 0)) | ((theta >= high) & (gradient > 0)))
            gained = 0.0
            for _ in range(8):
                step = np.zeros(len(terms))
                part = hessian[np.ix_(free, free)]
                diagonal = np.diag(part).copy()
                part = part + np.diag(damping * (diagonal + 1e-9 * diagonal.max(initial=1.0))
                                      + 1e-12)
                step[free] = np.linalg.lstsq(part, gradient[free], rcond=None)[0]
                trial = np.clip(theta + step * scale, low, high)
                new = evaluate(trial)
                new_chi2, new_prior = cost_of(new, trial)
                gained = chi2 + prior - new_chi2 - new_prior
                if np.isfinite(gained) and gained > 0:
                    theta, residual, chi2, prior = trial, new, new_chi2, new_prior
                    damping = max(damping / 5.0, 1e-7)
                    fresh = False
                    break
                damping *= 8.0
            if not gained > tolerance:
                break
        if not fresh:
            jacobian = self._jacobian(evaluate, theta, residual, scale, low, high)
        fitted = model.with_parameters({t.key: v for t, v in zip(terms, theta)})
        return Fit(fitted, terms, theta, residual, chi2, prior, jacobian)

    def _jacobian(self, evaluate, theta: np.ndarray, residual: np.ndarray, scale: np.ndarray,
                  low: np.ndarray, high: np.ndarray) -> np.ndarray:
        columns = np.zeros((len(residual), len(theta)))
        for j in range(len(theta)):
            step = _STEP * scale[j]
            if theta[j] + step > high[j]:
                step = -step
            moved = theta.copy()
            moved[j] += step
            change = (residual - evaluate(moved)) * (scale[j] / (step * self.noise))
            columns[:, j] = np.where(self.weight & np.isfinite(change), change, 0.0)
        return columns


def widest_block(data: Measurement, least: int = 8) -> int:
    """Return how many neighbours may be averaged before the motion within them is lost."""
    width = least
    reach = 0.05 * float(np.ptp(data.strain))
    while width < 4096:
        steps = np.abs(data.strain[2 * width:] - data.strain[:-2 * width])
        steps = steps[data.trial[2 * width:] == data.trial[:-2 * width]]
        if not len(steps) or np.percentile(steps, 90) > reach:
            break
        width *= 2
    return width


def stretches(data: Measurement, most: int, count: int = 12) -> Measurement:
    """Return unbroken stretches from all over a log, each a trial, so many rows in all."""
    if len(data) <= 1.25 * most:
        return data
    length = most // count
    begins = np.linspace(0, len(data) - length, count).astype(int)
    rows = np.concatenate([np.arange(begin, begin + length) for begin in begins])
    piece = np.repeat(np.arange(count), length)
    picked = data.select(rows)
    _, trial = np.unique(np.stack([piece, picked.trial], -1), axis=0, return_inverse=True)
    trial = np.cumsum(np.diff(trial.ravel(), prepend=trial.ravel()[0]) != 0)
    return replace(picked, trial=trial, trial_names=tuple(
        f'stretch {k + 1}' for k in range(int(trial.max()) + 1)))


def average(data: Measurement, block: int) -> Measurement:
    """Return the log with so many neighbours averaged into one row, trial by trial."""
    position = np.arange(len(data)) - np.flatnonzero(data.start)[np.cumsum(data.start) - 1]
    first = (position % block == 0)
    label = np.cumsum(first) - 1
    count = np.bincount(label)
    first_rows = np.flatnonzero(first)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(label, values) / count

    rate = mean(data.strain_rate)
    return replace(
        data, strain=mean(data.strain), force=mean(data.force), strain_rate=rate,
        pressure=np.stack([mean(column) for column in data.pressure.T], -1),
        trial=data.trial[first_rows], direction=data.direction[first_rows],
        time=None if data.time is None else mean(data.time))


def spikes(data: Measurement, residual: np.ndarray, noise: float, half: int = 3,
           threshold: float = 5.0) -> np.ndarray:
    """
    Return which rows stand alone: far from the median of their neighbours in time, (T,) bool.

    An effect that a model lacks moves neighbours together; an outlier stands by itself.
    """
    rows = len(residual)
    if data.is_static or rows < 2 * half + 1:
        return np.zeros(rows, bool)
    offsets = np.arange(-half, half + 1)
    window = np.clip(np.arange(rows)[:, None] + offsets, 0, rows - 1)
    own = data.trial[window] == data.trial[:, None]
    own &= (np.arange(rows)[:, None] + offsets == window)
    own &= own[:, ::-1]  # a slope must not make the ends of a trial stand out
    near = np.where(own, residual[window], residual[:, None])
    return np.abs(residual - np.median(near, axis=1)) > threshold * noise


def held_out_residual(problem: Problem, fit: Fit, scheme: str = '') -> np.ndarray:
    """
    Return the residual of every row from a refit that has not seen its block, (T,), N.

    Each block is left out in turn and the whole model refitted on the rest.

    Parameters
    ----------
    scheme : str
        `isobar`, `trial`, `time` or `strain`; by default the first that the data offers.
    """
    schemes = blocks(problem.data)
    schemes.pop('direction', None)
    if not schemes:
        return fit.residual
    label = schemes.get(scheme, next(iter(schemes.values())))
    start = {t.key: v for t, v in zip(fit.terms, fit.values)}
    residual = fit.residual.copy()
    used = problem.weight
    try:
        for block in np.unique(label):
            rows = label == block
            if not (used & ~rows).any():
                continue
            problem.weight = used & ~rows
            again = problem.fit(fit.model, fit.terms, start, iterations=8, tolerance=0.5)
            residual[rows] = again.residual[rows]
    finally:
        problem.weight = used
    return residual


def held_out_of_whole(whole: Problem, refitted: Fit, thin: Problem, fit: Fit) -> float:
    """
    Return the error of refits on blocks left out, N rms, for a fit confirmed on every row.

    Blocks are left out of ``thin``, which may have averaged neighbours: what leaving out adds to
    the error of ``fit`` there is added to that of ``refitted`` on the rows of ``whole``.
    """
    added = held_out_error(thin, fit) ** 2 - rms(fit.residual[thin.weight]) ** 2
    return float(np.sqrt(max(rms(refitted.residual[whole.weight]) ** 2 + added, 0.0)))


def held_out_error(problem: Problem, fit: Fit, scheme: str = '') -> float:
    """Return the rms of `held_out_residual` over the rows that count, N."""
    residual = held_out_residual(problem, fit, scheme)[problem.weight]
    return float(np.sqrt(np.mean(residual ** 2))) if len(residual) else float('nan')


def confirm(full: Problem, fit: Fit) -> Fit:
    """Return a fit of the search refitted on every row."""
    if len(full.data) == len(fit.residual):
        return fit
    again = full.fit(fit.model, fit.terms,
                     {t.key: v for t, v in zip(fit.terms, fit.values)}, iterations=4,
                     tolerance=1.0)
    again.added = fit.added
    return again
