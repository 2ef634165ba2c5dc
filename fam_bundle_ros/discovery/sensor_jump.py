# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A reading that jumps by a constant during a log: a load cell that was tared, a clamp that slipped.

The jump is an offset of a sensor, as the catalogue's laws have it, in the rows after one place.
It is compared with effects as every change is (`change_point`): beside the most probable set of
them, or in place of some of these. A drift of the sensor and a law that makes up for it may follow
a jump, and would be named. Returns to the same strain, pressures and direction of motion must show
it too: between isobars that were run once a jump is like an unknown effect of the pressure. And it
must be more probable than an offset that comes gradually, as that of a gauge that warms up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.change_point import best_posteriors, ChangePoints
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import COOLING, Fit, Fitter
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import motion
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.model import Law, Place
from fam_bundle_ros.units import express

#: Grid of the time constants of an offset that comes gradually, as shares of the log.
_GRADUAL = 0.5 ** np.arange(6)


@dataclass(frozen=True)
class Jump:
    """
    A reading that is off by a constant from some row of a log on.

    Attributes
    ----------
    law : Law
        Of a sensor that is off by a constant.
    size : float, SI
    begin : float
        `_clock` of the first row after it.
    where : str
        This row in words.
    log_odds : float
        Against the most probable set of effects without it.
    """

    law: Law
    size: float
    begin: float
    where: str
    log_odds: float

    @property
    def quantity(self) -> str:
        """The reading: force, strain, or pressure (of every motor unit)."""
        return self.law.parts[0].changes

    @property
    def words(self) -> str:
        """The jump, that it was subtracted, and what to do about it."""
        size = express(abs(self.size), self.law.parameters[0].unit, 2)
        return (f'from {self.where} on the {self.quantity} reads {size} '
                f'{"more" if self.size > 0 else "less"} than before, as if a sensor had been set '
                'to zero again or something had slipped (subtracted here; correct these rows of '
                'the file before you add effects)')

    def undone(self, data: Measurement) -> Measurement:
        """Return a measurement without the jump, with a note on it."""
        left = _shifted(data, self.quantity, -self.size * (_clock(data) >= self.begin))
        return replace(left, notes=(*data.notes, self.words))


@dataclass(frozen=True)
class _Offset:
    """
    An offset of a sensor beside a set of effects.

    Attributes
    ----------
    law : Law
    fit : Fit
        The set without it.
    fitter : Fitter
        With its cells the set was fitted.
    prior : Prior
    slope : ndarray, shape (n,), N
        Of the predicted force in the coordinate of the offset.
    taken : float
        Coordinate of the jump that was subtracted from these cells.
    """

    law: Law
    fit: Fit
    fitter: Fitter
    prior: Prior
    slope: np.ndarray
    taken: float = 0.0

    @classmethod
    def of(cls, options: Options, law: Law, fit: Fit, fitter: Fitter) -> _Offset:
        """Return the offset with its slope at the fit."""
        names = tuple(sorted({*fit.names, law.name}))
        priors = options.priors(names)
        u = np.array([fit.start.get(prior.key, 0.0) for prior in priors])
        own = next(k for k, prior in enumerate(priors) if prior.key.startswith(f'{law.name}.'))
        _, slopes = fitter.linearised(options.bundle(names), priors, u)
        return cls(law, fit, fitter, priors[own], slopes[:, own])

    def beside(self, shape: np.ndarray) -> Linear:
        """Return the linear model of the set with the offset times a shape, (n,), first."""
        fit = self.fit
        return Linear.of((self.prior, *fit.priors), np.append(self.taken, fit.u), fit.residual,
                         np.column_stack([self.slope * shape, fit.slopes]))

    def posterior(self, shape: np.ndarray) -> np.ndarray:
        """Return the log posterior of that, with a discrepancy and without one, (2,)."""
        at = self.beside(shape)
        white = max(log_evidence(self.fitter.covariance, Hyper(white=w), at) for w in COOLING)
        return self.fit.log_prior + np.array([self._hyper(at)[1], white])

    def coordinate(self, shape: np.ndarray) -> float:
        """Return the most probable coordinate of the offset."""
        at = self.beside(shape)
        k = len(at.own)
        stacked = np.concatenate([self.fitter.covariance.whiten(self._hyper(at)[0], at.columns),
                                  np.eye(k, k + 1)])
        return float(np.linalg.lstsq(stacked[:, :k], stacked[:, k], rcond=None)[0][0])

    def _hyper(self, at: Linear) -> tuple[Hyper, float]:
        return self.fitter.best_hyper(self.fit.hyper, at)


def sensor_jump(search: Search) -> Jump | None:
    """
    Return the jump of a reading that is more probable than every set of effects, or None.

    It is tried beside the most probable set and in place of its effects, at the point where the
    evidence of the linear model without a discrepancy is highest. The likeliest one is subtracted
    and its set fitted again: the force is not linear in a large jump of strain or pressure. Then
    it is compared with offsets of all sensors that come gradually, beside the same sets.
    """
    changes, options = ChangePoints.of(search), search.options
    if changes is None:
        return None
    cells = changes.cells
    if len(cells.data) < cells.rows and not _runs_on(cells.data):
        return None  # rows that were averaged have no number in the log
    best, laws = set(options.changes(search.best.names)), _laws(options)
    offsets = [_Offset.of(options, law, fit, search.fitter) for fit in search.fits.values()
               if best.issuperset(options.changes(fit.names)) for law in laws]
    if not offsets:
        return None

    def log_odds(offset: _Offset, point: int) -> float:
        gain = offset.posterior(changes.after(point)) - best_posteriors(search)
        return float(gain.min()) + changes.log_prior(search) - np.log(len(laws))

    tried = [(offset, _likeliest(offset, changes)) for offset in offsets]
    offset, point = max(tried, key=lambda each: log_odds(*each))
    if log_odds(offset, point) <= 0.0:
        return None
    offset = max(offset, _again(search, offset, changes, point),
                 key=lambda each: log_odds(each, point))
    after = changes.after(point)
    sudden = (offset.posterior(after) - _gradual(offsets)
              + np.log((len(_GRADUAL) + 1) / len(changes.points)))
    if min(*sudden, _seen_again(offset, after) + changes.log_prior(search)) <= 0.0:
        return None
    coordinate = offset.coordinate(after)
    row = _row(changes, point, offset, coordinate)
    return Jump(offset.law, offset.prior.width * coordinate, float(_clock(cells.data)[row]),
                changes.where(row), log_odds(offset, point))


def _runs_on(data: Measurement) -> bool:
    """Return whether the clock runs on from trial to trial."""
    return bool((np.diff(data.clock) >= 0.0).all())


def _clock(data: Measurement) -> np.ndarray:
    """Return the time of the rows, or their numbers if the clock starts anew, (T,)."""
    return data.clock if _runs_on(data) else np.arange(len(data), dtype=float)


def _shifted(data: Measurement, quantity: str, by: np.ndarray) -> Measurement:
    """Return a measurement with readings of a quantity that are larger, (T,), SI."""
    return replace(data, **{quantity: (getattr(data, quantity).T + by).T})


def _laws(options: Options) -> list[Law]:
    """Return the laws of a sensor that is off by a constant."""
    return [effect.law for effect in options.effects.values()
            if effect.law.place is Place.SENSOR and not effect.law.variant_of
            and set(effect.law.parts[0].arguments) == set(effect.law.names)]


def _likeliest(offset: _Offset, changes: ChangePoints) -> int:
    """
    Return the point from which on an offset is most probable, without a discrepancy.

    The evidence of the linear model with one more coordinate, whose prior is standard normal: of
    all points at once from the QR factors of the fit's own columns.
    """
    after = np.stack([changes.after(point) for point in changes.points], -1)
    found, own = np.full(after.shape[1], -np.inf), offset.fit.linear
    covariance = offset.fitter.covariance
    for white in COOLING:
        h = Hyper(white=white)
        base = covariance.whiten(h, own.columns)
        padded = np.zeros((len(own.own), after.shape[1] + 1))
        q, _ = np.linalg.qr(np.concatenate([base[:, :-1], np.eye(len(own.own))]))
        beside = np.concatenate([np.column_stack([
            covariance.whiten(h, offset.slope[:, None] * after), base[:, -1]]), padded])
        beside -= q @ (q.T @ beside)
        size = np.sum(beside[:, :-1] ** 2, axis=0) + 1.0
        shared = beside[:, :-1].T @ beside[:, -1]
        found = np.maximum(found, log_evidence(covariance, h, own)
                           + 0.5 * shared ** 2 / size - 0.5 * np.log(size))
    return changes.points[int(np.argmax(found))]


def _again(search: Search, offset: _Offset, changes: ChangePoints, point: int) -> _Offset:
    """Return the offset beside its set fitted to the cells without the jump."""
    cells, old, after = changes.cells, offset.fit, changes.after(point)
    taken = offset.coordinate(after)
    clock = _clock(cells.data)
    fitter = Fitter(Covariance(
        _without(cells, offset.law.parts[0].changes, offset.prior.width * taken * (
            clock >= clock[changes.row(point)])),
        search.options.choices.unexplained, cells.force_sd))
    fit = fitter.fit(old.names, search.options.bundle(old.names), old.priors, old.log_prior)
    return replace(_Offset.of(search.options, offset.law, fit, fitter), taken=taken)


def _without(cells: Cells, quantity: str, jump: np.ndarray) -> Cells:
    """Return the same cells of a measurement without the jump in each row, (T,), SI."""
    data = _shifted(cells.data, quantity, -jump)
    strain = cells.mean(data.strain)
    return replace(cells, data=data, motion=motion(data), force=cells.mean(data.force),
                   strain=strain, pressure=cells.mean(data.pressure),
                   strain_coordinate=cells.strain_coordinate + strain - cells.strain)


def _gradual(offsets: list[_Offset]) -> np.ndarray:
    """
    Return the highest log posteriors, (2,), of an offset that comes gradually.

    It approaches its value exponentially, or grows in proportion to time.
    """
    cells = offsets[0].fitter.cells
    time = cells.mean(_clock(cells.data))
    share = (time - time.min()) / np.ptp(time)
    shapes = [share, *(1.0 - np.exp(-share / constant) for constant in _GRADUAL)]
    return np.max([offset.posterior(shape) for offset in offsets for shape in shapes], axis=0)


def _seen_again(offset: _Offset, after: np.ndarray) -> float:
    """
    Return the log Bayes factor of a jump beside any function of strain, pressures and direction.

    Residual and jump are taken without their means at each of these, with the white misfit that
    is most probable for either.
    """
    cells, jump = offset.fitter.cells, offset.slope * after
    visited = np.unique(np.column_stack([cells.place, cells.direction]), axis=0,
                        return_inverse=True)[1].ravel()
    both = np.stack([offset.fit.residual + offset.taken * jump, jump])
    mean = np.stack([np.bincount(visited, each) for each in both]) / np.bincount(visited)
    left, jump = both - mean[:, visited]
    variance = cells.variance + np.array(
        [[offset.fitter.covariance.variance(white)] for white in COOLING])
    alone = -0.5 * np.sum(left ** 2 / variance + np.log(variance), axis=1)
    size = np.sum(jump ** 2 / variance, axis=1) + 1.0
    shared = np.sum(left * jump / variance, axis=1)
    return float(np.max(alone + 0.5 * shared ** 2 / size - 0.5 * np.log(size)) - np.max(alone))


def _row(changes: ChangePoints, point: int, offset: _Offset, coordinate: float) -> int:
    """
    Return the first row after a jump: of a trial, if one begins at the point.

    Else that from which on the residual of the rows near the point is nearer to the jump than to
    zero.
    """
    row = changes.row(point)
    if changes.cells.data.start[row]:
        return row
    before, after = changes.rows(point)
    rows = np.arange(before[0], after[-1] + 1)
    jump = coordinate * offset.slope[changes.order[point - 1:point + 1]].mean()
    residual = changes.cells.residual_of_rows(offset.fit.model)[rows]
    cost = np.cumsum((jump ** 2 - 2.0 * residual * jump)[::-1])[::-1]
    return int(rows[1 + np.argmin(cost[1:])])
