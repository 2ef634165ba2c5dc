# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Constants of the material: which parameters have the same value in all specimens.

The posterior of each specimen is approximated as normal. For a set S of an effect's parameters,
B_S is the Bayes factor of common values for all specimens against separate ones. All S have the
same prior probability, so the evidence is multiplied by the mean of B_S. The parameters of an
effect are treated jointly, as one specimen may determine only a combination of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.estimates import DEAD, unit_of
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.model import Place

#: Most parameters of one effect treated jointly; the number of sets is two to this power.
_TOGETHER = 8


class Relation(NamedTuple):
    """
    How a parameter depends on the columns of the table.

    Attributes
    ----------
    goes_with : str
        Column on which it depends by a power law; empty for none.
    power : float or None
        Exponent of the power law.
    interval : tuple of float or None
        Its 95 % interval, which excludes zero.
    ordered : dict of str to str
        If there is no power law: columns in whose order the values are, ``rises`` or ``falls``.
    chance : float
        Share of all orders of the values that are as ordered.
    """

    goes_with: str = ''
    power: float | None = None
    interval: tuple[float, float] | None = None
    ordered: Mapping[str, str] = {}
    chance: float = 1.0


class Constant(NamedTuple):
    """
    One parameter of the effects in all specimens.

    Attributes
    ----------
    key, unit : str
    specimens : list of str
        Names of those that can show it.
    values, sd : list of float
        Estimate and standard deviation in each of them, in the unit.
    shared : float
        Probability that all have the same value.
    value : float
        The common value, in the unit.
    odds : float
        Odds from which it is said that the values are the same, or that they differ.
    relation : Relation
        To the columns of the table; only for values that differ.
    """

    key: str
    unit: str
    specimens: list[str]
    values: list[float]
    sd: list[float]
    shared: float
    value: float
    odds: float
    relation: Relation = Relation()

    @property
    def is_shared(self) -> bool | None:
        """Whether all specimens have the same value; None if undecided."""
        if self.odds * min(self.shared, 1.0 - self.shared) > max(self.shared, 1.0 - self.shared):
            return None
        return self.shared > 0.5

    def __str__(self) -> str:
        unit = f' {self.unit}' if self.unit else ''
        if self.is_shared:
            return (f'{self.key} is {self.value:.4g}{unit} in all '
                    f'(probability {self.shared:.2f}): a constant of the material')
        text = ', '.join(f'{value:.4g}' for value in self.values) + unit
        if self.is_shared is None:
            return (f'{self.key} is undecided: one value in all has a probability of '
                    f'{self.shared:.2f} ({text})')
        found = self.relation
        if found.interval is not None:
            low, high = found.interval
            return (f'{self.key} goes with {found.goes_with} (power {found.power:.2g}, '
                    f'{low:.2g} to {high:.2g}: {text}): not a constant of the material')
        if found.ordered:
            ways = ', '.join(f'{way} with {column}' for column, way in found.ordered.items())
            return (f'{self.key} {ways}, but not as a power law ({text}; '
                    f'1 of {1.0 / found.chance:.0f} orders would)')
        return f'{self.key} differs ({text}) and depends on no column of the table'

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as JSON has it."""
        return {**self._asdict(), 'is_shared': self.is_shared,
                'relation': self.relation._asdict()}


@dataclass(frozen=True)
class Sharing:
    """
    Which parameters of one effect the specimens have in common.

    Attributes
    ----------
    keys : tuple of str
    places : list of int
        Which of the specimens have the effect.
    x, sd : ndarray, shape (k, n)
        `Prior.coordinate` of each specimen and its standard deviation.
    width : ndarray, shape (k,)
        Widths of the priors.
    log_factor : float
        Log of the mean Bayes factor.
    shared : ndarray, shape (k,)
        Probability of a common value.
    one : ndarray, shape (k,)
        The common coordinate, from the most probable set with it.
    """

    keys: tuple[str, ...]
    places: list[int]
    x: np.ndarray
    sd: np.ndarray
    width: np.ndarray
    log_factor: float
    shared: np.ndarray
    one: np.ndarray


def sharings(fits: Sequence[Fit]) -> list[Sharing]:
    """
    Return the parameters that specimens have in common, by effect; without sensor errors.

    An effect is compared in the specimens that have it, if these are two or more.
    """
    groups: dict[str, list[str]] = {}
    for fit in fits:
        for key in (prior.key for prior in fit.priors):
            effect = key.partition('.')[0]
            if effect != 'geometry' and fit.model.effect(effect).place is not Place.SENSOR:
                known = groups.setdefault(effect, [])
                known += [key] if key not in known else []
    having = {effect: [k for k, fit in enumerate(fits) if effect in fit.names]
              for effect in groups}
    return [_sharing(fits, tuple(keys[k:k + _TOGETHER]), having[effect])
            for effect, keys in groups.items() if len(having[effect]) > 1
            for k in range(0, len(keys), _TOGETHER)]


def _sharing(every: Sequence[Fit], keys: tuple[str, ...], places: list[int]) -> Sharing:
    fits = [every[k] for k in places]
    at = [[[prior.key for prior in fit.priors].index(key) for key in keys] for fit in fits]
    priors = [[fit.priors[j] for j in places] for fit, places in zip(fits, at)]
    centre = np.array([p.coordinate(0.0) for p in priors[0]])
    widths = np.array([[p.width for p in each] for each in priors])
    x = np.array([[p.coordinate(u) for p, u in zip(each, fit.u[j])]
                  for each, fit, j in zip(priors, fits, at)])
    # in widths of the widest prior, so that the prior is a standard normal
    width = widths.max(axis=0)
    z = (x - centre) / width
    spread = np.array([fit.covariance[np.ix_(j, j)] * np.outer(w, w) / np.outer(width, width)
                       for fit, j, w in zip(fits, at, widths)])
    sets = [list(chosen) for size in range(len(keys) + 1)
            for chosen in combinations(range(len(keys)), size)]
    found = [_bayes_factor(z[:, chosen], spread[:, chosen][:, :, chosen]) for chosen in sets]
    log = np.array([factor for factor, _ in found])
    total = float(logsumexp(log))
    one, shared = centre.copy(), np.zeros(len(keys))
    for j in range(len(keys)):
        holding = [k for k, chosen in enumerate(sets) if j in chosen]
        shared[j] = np.exp(logsumexp(log[holding]) - total)
        likeliest = max(holding, key=lambda k: log[k])
        one[j] += width[j] * found[likeliest][1][sets[likeliest].index(j)]
    sd = np.sqrt(np.diagonal(spread, axis1=1, axis2=2)) * width
    return Sharing(keys, places, x.T, sd.T, width, total - len(keys) * float(np.log(2.0)),
                   shared, one)


def _bayes_factor(z: np.ndarray, spread: np.ndarray) -> tuple[float, np.ndarray]:
    """
    Return the log Bayes factor of common values for all specimens, and these values, (k,).

    Posteriors N(z_i, S_i) under a standard normal prior imply normal likelihoods of precision
    S_i^-1 - 1.

    Parameters
    ----------
    z : ndarray, shape (n, k)
    spread : ndarray, shape (n, k, k)
    """
    size = z.shape[1]
    if not size:
        return 0.0, np.zeros(0)
    precisions, pulls, each = [], [], 0.0
    for mean, posterior in zip(z, spread):
        values, vectors = np.linalg.eigh(posterior)
        values = np.maximum(values, 1e-12)
        precision = (vectors * np.maximum(1.0 / values - 1.0, 1e-9)) @ vectors.T
        pull = (vectors / values) @ (vectors.T @ mean)
        precisions.append(precision)
        pulls.append(pull)
        each += _log_evidence(precision, pull)[0]
    together, one = _log_evidence(np.sum(precisions, axis=0), np.sum(pulls, axis=0))
    return together - each, one


def _log_evidence(precision: np.ndarray, pull: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the log integral of exp(-z P z/2 + b z) under a standard normal, and the mean."""
    whole = precision + np.eye(len(pull))
    mean = np.linalg.solve(whole, pull)
    return float(0.5 * pull @ mean - 0.5 * np.linalg.slogdet(whole)[1]), mean


def constants(fits: Sequence[Fit], facts: Sequence[Mapping[str, float]], names: Sequence[str],
              odds: float) -> list[Constant]:
    """
    Return for each parameter whether it is common to all specimens, or how it differs.

    Parameters
    ----------
    facts : sequence of mapping
        Known numbers of each specimen: length, age, ...
    names : sequence of str
        Of the specimens.
    odds : float
        Odds from which the values are said to be the same, or to differ.
    """
    found = []
    for sharing in sharings(fits):
        having = [fits[k] for k in sharing.places]
        for j, key in enumerate(sharing.keys):
            x, s = sharing.x[j], sharing.sd[j]
            if np.all(s > DEAD * sharing.width[j]):
                continue
            unit, size = unit_of(having[0].model, key)
            prior = next(p for p in having[0].priors if p.key == key)
            *u, one = (np.append(x, sharing.one[j]) - prior.coordinate(0.0)) / prior.width
            values = np.array([prior.theta(each) for each in u])
            sd = s * [prior.slope(each) for each in u] / prior.width
            each = Constant(
                key, unit, [names[k] for k in sharing.places], (values / size).tolist(),
                (sd / size).tolist(), float(sharing.shared[j]), prior.theta(one) / size, odds)
            found.append(each if each.is_shared is not False else each._replace(
                relation=_relation(values, sd, [facts[k] for k in sharing.places])))
    return found


def _relation(values: np.ndarray, sd: np.ndarray, facts: Sequence[Mapping[str, float]],
              ) -> Relation:
    """
    Return how a parameter depends on columns that have three or more distinct values.

    For a power law, a weighted line is fitted to the logarithms. Its residual scatter must be
    consistent with the errors of the fits (chi-square test). A column counts for the specimens
    that have a number in it.
    """
    from scipy import stats
    best, least, ordered, chance = Relation(), np.inf, {}, 1.0
    for fact in sorted(set().union(*facts)):
        known = [k for k, each in enumerate(facts) if fact in each]
        x, s, t = values[known], sd[known], np.array([facts[k][fact] for k in known])
        _, alike = np.unique(t, return_counts=True)
        if len(alike) < 3:
            continue
        way = np.sign(np.subtract.outer(t, t) * np.subtract.outer(x, x))
        if np.all(way >= 0) or np.all(way <= 0):
            ordered[fact] = 'rises' if np.all(way >= 0) else 'falls'
            chance = 2.0 * float(np.prod([factorial(n) for n in alike])) / factorial(len(t))
        if np.any(t <= 0.0) or np.any(x <= 0.0):
            continue
        y, spread = np.log(x), s / x
        line = np.stack([np.ones(len(t)), np.log(t)], -1) / spread[:, None]
        found, _, _, _ = np.linalg.lstsq(line, y / spread, rcond=None)
        left = float(np.sum((y / spread - line @ found) ** 2))
        power, reach = float(found[1]), 1.96 * float(np.sqrt(np.linalg.inv(line.T @ line)[1, 1]))
        plausible = stats.chi2.sf(left, len(t) - 2) > settings.ALARM
        if plausible and left < least and abs(power) > reach:
            best, least = Relation(fact, power, (power - reach, power + reach)), left
    return best if best.goes_with else Relation(ordered=ordered, chance=chance)
