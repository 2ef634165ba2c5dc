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
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.discovery.artefacts import Artefact
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.change_point import against, Places, places_of
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import COOLING, Fit, Fitter
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import motion
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.model import Law, Place
from fam_bundle_ros.units import express

#: Time constants of an offset that comes gradually, as shares of the log.
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
    place : int
        Number of cells before it.
    begin : float
        `_clock` of the first row after it.
    where : str
    log_odds : float
        Against the most probable set of effects without it.
    """

    law: Law
    size: float
    place: int
    begin: float
    where: str
    log_odds: float

    @property
    def quantity(self) -> str:
        """The reading: force, strain, or pressure (of every motor unit)."""
        return self.law.parts[0].changes

    @property
    def artefact(self) -> Artefact:
        """The jump in words, with what to do about it."""
        size = express(abs(self.size), self.law.parameters[0].unit, 2)
        return Artefact(
            f'from {self.where} on the {self.quantity} reads {size} '
            f'{"more" if self.size > 0 else "less"} than before (corrected here): a sensor that '
            'was set to zero again, or something that slipped',
            f'correct the {self.quantity} of these rows before adding an effect, or diagnose '
            'those before and after by themselves')

    def undone(self, data: Measurement) -> Measurement:
        """Return a measurement without the jump."""
        after = _clock(data) >= self.begin
        values = getattr(data, self.quantity)
        return replace(data, **{self.quantity: (values.T - self.size * after).T})


def sensor_jump(search: Search) -> Jump | None:
    """
    Return the jump of a reading that is more probable than every set of effects, or None.

    It is tried beside the most probable set and in place of its effects, at the place where the
    evidence of the linear model without a discrepancy is highest. The likeliest one is subtracted
    and its set fitted again: the force is not linear in a large jump of strain or pressure. Then
    it is compared with offsets of all sensors that come gradually, beside the same sets.
    """
    places, options = places_of(search), search.options
    if places is None:
        return None
    rows = places.cells.data
    if len(rows) < places.cells.rows and not _runs_on(rows):
        return None  # rows that were averaged have no number in the log
    best, names = set(options.changes(search.best.names)), _offsets(options)
    fits = [fit for fit in search.fits.values() if best.issuperset(options.changes(fit.names))]
    tried = [_beside(search, places, search.fitter, fit, name) for fit in fits for name in names]
    if not tried:
        return None
    first = max(tried, key=lambda each: each.jump.log_odds)
    if first.jump.log_odds <= 0.0:
        return None
    cells, fit = _without(places.cells, first.jump), first.fit
    covariance = search.fitter.covariance
    fitter = Fitter(Covariance(cells, covariance.unexplained, places.cells.force_sd))
    again = fitter.fit(fit.names, options.bundle(fit.names), fit.priors, fit.log_prior)
    found = max(first, _beside(search, places, fitter, again, first.jump.law.name, first.jump),
                key=lambda each: each.jump.log_odds)
    gradual = np.max([_gradual(search, fit, name) for fit in fits for name in names], axis=0)
    odds = np.append(found.posterior - gradual + np.log((len(_GRADUAL) + 1) / len(places.all)),
                     found.seen_again + places.log_prior(search))
    return found.jump if odds.min() > 0.0 else None


class _Tried(NamedTuple):
    """
    A jump beside a set of effects.

    Attributes
    ----------
    jump : Jump
    fit : Fit
        The set without the jump.
    posterior : ndarray, shape (2,)
        Log posteriors of both together, with a discrepancy and without one.
    seen_again : float
        See `_seen_again`.
    """

    jump: Jump
    fit: Fit
    posterior: np.ndarray
    seen_again: float


def _runs_on(data: Measurement) -> bool:
    """Return whether the clock runs on from trial to trial."""
    return bool((np.diff(data.clock) >= 0.0).all())


def _clock(data: Measurement) -> np.ndarray:
    """Return the time of the rows, or their numbers if the clock starts anew, (T,)."""
    return data.clock if _runs_on(data) else np.arange(len(data), dtype=float)


def _offsets(options: Options) -> list[str]:
    """Return the names of the laws of a sensor that is off by a constant."""
    return [name for name, effect in options.effects.items()
            if effect.law.place is Place.SENSOR and not effect.law.variant_of
            and set(effect.law.parts[0].arguments) == set(effect.law.names)]


def _beside(search: Search, places: Places, fitter: Fitter, fit: Fit, name: str,
            known: Jump | None = None) -> _Tried:
    """
    Return the most probable jump of a reading beside one set of effects.

    Parameters
    ----------
    fitter : Fitter
        With its cells the set was fitted.
    name : str
        Law of the offset.
    known : Jump, optional
        A jump that was subtracted from these cells; the returned one is at its place.
    """
    prior, column = _offset(search.options, fitter, fit, name)
    place = known.place if known else _likeliest(places, fitter, fit, column)
    begun = known.size / prior.width if known else 0.0
    column = column * places.after(place)
    posterior, coordinate = _with_column(fitter, fit, prior, column, begun)
    log_odds = (np.min(posterior + against(search)) + places.log_prior(search)
                - np.log(len(_offsets(search.options))))
    jump = Jump(search.options.effects[name].law, prior.width * coordinate, place,
                float(_clock(places.cells.data)[places.row(place)]), places.where(place),
                float(log_odds))
    return _Tried(jump, fit, posterior,
                  _seen_again(fitter, fit.residual + begun * column, column))


def _gradual(search: Search, fit: Fit, name: str) -> np.ndarray:
    """
    Return the highest log posteriors, (2,), of a gradual offset of a sensor beside a set.

    It approaches its value exponentially, or grows in proportion to time.
    """
    prior, column = _offset(search.options, search.fitter, fit, name)
    cells = search.fitter.cells
    time = cells.mean(_clock(cells.data))
    share = (time - time.min()) / np.ptp(time)
    shapes = [share, *(1.0 - np.exp(-share / constant) for constant in _GRADUAL)]
    return np.max([_with_column(search.fitter, fit, prior, column * shape)[0]
                   for shape in shapes], axis=0)


def _with_column(fitter: Fitter, fit: Fit, prior: Prior, column: np.ndarray, begun: float = 0.0,
                 ) -> tuple[np.ndarray, float]:
    """
    Return the log posteriors of a fit with one more column, and the coordinate of this.

    Parameters
    ----------
    prior : Prior
        Of the coordinate.
    column : ndarray, shape (n,), N
    begun : float
        The coordinate in the residual of the fit.

    Returns
    -------
    posterior : ndarray, shape (2,)
        With a discrepancy and without one.
    coordinate : float
    """
    at = Linear.of((prior, *fit.priors), np.append(begun, fit.u), fit.residual,
                   np.column_stack([column, fit.slopes]))
    white = max(log_evidence(fitter.covariance, Hyper(white=w), at) for w in COOLING)
    hyper, whole = fitter.best_hyper(fit.hyper, at)
    return np.array([whole, white]) + fit.log_prior, _first_coordinate(fitter, hyper, at)


def _offset(options: Options, fitter: Fitter, fit: Fit, name: str) -> tuple[Prior, np.ndarray]:
    """Return the prior of a sensor's offset, and the slope of the force in it, (n,), N."""
    names = tuple(sorted({*fit.names, name}))
    priors = options.priors(names)
    u = np.array([fit.start.get(prior.key, 0.0) for prior in priors])
    own = next(k for k, prior in enumerate(priors) if prior.key.startswith(f'{name}.'))
    return priors[own], fitter.linearised(options.bundle(names), priors, u)[1][:, own]


def _likeliest(places: Places, fitter: Fitter, fit: Fit, column: np.ndarray) -> int:
    """
    Return the place from which on one more column, (n,), N, is most probable beside a fit.

    The evidence of the linear model with one more coordinate, whose prior is standard normal: of
    all places at once from the QR factors of the fit's own columns.
    """
    after = np.stack([places.after(place) for place in places.all], -1)
    found, own = np.full(after.shape[1], -np.inf), fit.linear
    for white in COOLING:
        h = Hyper(white=white)
        base = fitter.covariance.whiten(h, own.columns)
        padded = np.zeros((len(own.own), after.shape[1] + 1))
        q, _ = np.linalg.qr(np.concatenate([base[:, :-1], np.eye(len(own.own))]))
        beside = np.concatenate([np.column_stack([
            fitter.covariance.whiten(h, column[:, None] * after), base[:, -1]]), padded])
        beside -= q @ (q.T @ beside)
        size = np.sum(beside[:, :-1] ** 2, axis=0) + 1.0
        shared = beside[:, :-1].T @ beside[:, -1]
        found = np.maximum(found, log_evidence(fitter.covariance, h, own)
                           + 0.5 * shared ** 2 / size - 0.5 * np.log(size))
    return places.all[int(np.argmax(found))]


def _seen_again(fitter: Fitter, residual: np.ndarray, column: np.ndarray) -> float:
    """
    Return the log Bayes factor of a column beside any function of place and direction.

    Residual and column, (n,), N, without their means at each strain, pressures and direction, with
    the white misfit that is most probable for either.
    """
    cells = fitter.cells
    visited = np.unique(np.column_stack([cells.place, cells.direction]), axis=0,
                        return_inverse=True)[1].ravel()
    both = np.stack([residual, column])
    mean = np.stack([np.bincount(visited, each) for each in both]) / np.bincount(visited)
    apart, beside = both - mean[:, visited]
    variance = cells.variance + np.array(
        [[fitter.covariance.variance(white)] for white in COOLING])
    alone = -0.5 * np.sum(apart ** 2 / variance + np.log(variance), axis=1)
    size = np.sum(beside ** 2 / variance, axis=1) + 1.0
    shared = np.sum(apart * beside / variance, axis=1)
    return float(np.max(alone + 0.5 * shared ** 2 / size - 0.5 * np.log(size)) - np.max(alone))


def _first_coordinate(fitter: Fitter, h: Hyper, at: Linear) -> float:
    """Return the most probable first coordinate of a linear model."""
    k = len(at.own)
    stacked = np.concatenate([fitter.covariance.whiten(h, at.columns), np.eye(k, k + 1)])
    return float(np.linalg.lstsq(stacked[:, :k], stacked[:, k], rcond=None)[0][0])


def _without(cells: Cells, jump: Jump) -> Cells:
    """Return the same cells of a measurement without a jump."""
    data = jump.undone(cells.data)
    strain = cells.mean(data.strain)
    return replace(cells, data=data, motion=motion(data), force=cells.mean(data.force),
                   strain=strain, pressure=cells.mean(data.pressure),
                   strain_coordinate=cells.strain_coordinate + strain - cells.strain)
