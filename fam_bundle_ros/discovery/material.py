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
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from fam_bundle_ros.discovery.estimates import DEAD, unit_of
from fam_bundle_ros.discovery.fitter import Fit

#: Significance level of the chi-square test for a power law.
_ALARM = 0.01
#: Most parameters of one effect treated jointly; the number of sets is two to this power.
_TOGETHER = 8


class Constant(NamedTuple):
    """
    One parameter of the effects in all specimens.

    Attributes
    ----------
    key, unit : str
    values, sd : list of float
        Estimate and standard deviation in each specimen, in the unit.
    shared : float
        Probability that all specimens have the same value.
    value : float
        The common value, in the unit.
    goes_with : str
        Column of the table on which it depends by a power law; empty for none.
    power : float
        Exponent of the power law.
    """

    key: str
    unit: str
    values: list[float]
    sd: list[float]
    shared: float
    value: float
    goes_with: str
    power: float

    def __str__(self) -> str:
        unit = f' {self.unit}' if self.unit else ''
        if self.shared > 0.5:
            return (f'{self.key} is {self.value:.4g}{unit} in all '
                    f'(probability {self.shared:.2f}): a constant of the material')
        text = ', '.join(f'{value:.4g}' for value in self.values)
        if self.goes_with:
            return (f'{self.key} goes with {self.goes_with} (power {self.power:.2g}: {text}{unit})'
                    ': not a constant of the material')
        return f'{self.key} differs ({text}{unit}) and depends on no column of the table'


@dataclass(frozen=True)
class Sharing:
    """
    Which parameters of one effect the specimens have in common.

    Attributes
    ----------
    keys : tuple of str
    x, sd : ndarray, shape (k, n)
        Value in each specimen and its standard deviation; logarithms for log-normal priors.
    width : ndarray, shape (k,)
        Widths of the priors.
    log_factor : float
        Log of the mean Bayes factor.
    shared : ndarray, shape (k,)
        Probability of a common value.
    one : ndarray, shape (k,)
        The common value, from the most probable set with it.
    """

    keys: tuple[str, ...]
    x: np.ndarray
    sd: np.ndarray
    width: np.ndarray
    log_factor: float
    shared: np.ndarray
    one: np.ndarray


def sharings(fits: Sequence[Fit]) -> list[Sharing]:
    """Return the parameters that specimens have in common, by effect; without sensor errors."""
    groups: dict[str, list[str]] = {}
    for prior in fits[0].priors:
        effect = prior.key.partition('.')[0]
        if effect != 'geometry' and fits[0].model.effect(effect).place.value != 'sensor':
            groups.setdefault(effect, []).append(prior.key)
    return [_sharing(fits, tuple(keys[k:k + _TOGETHER])) for keys in groups.values()
            for k in range(0, len(keys), _TOGETHER)]


def _sharing(fits: Sequence[Fit], keys: tuple[str, ...]) -> Sharing:
    at = [[[prior.key for prior in fit.priors].index(key) for key in keys] for fit in fits]
    priors = [[fit.priors[j] for j in places] for fit, places in zip(fits, at)]
    centre = np.array([np.log(p.value) if p.kind == 'log' else p.value for p in priors[0]])
    widths = np.array([[p.width for p in each] for each in priors])
    x = np.array([[np.log(p.value) if p.kind == 'log' else p.value for p in each]
                  for each in priors]) + widths * [fit.u[j] for fit, j in zip(fits, at)]
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
    return Sharing(keys, x.T, sd.T, width, total - len(keys) * float(np.log(2.0)), shared, one)


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


def constants(fits: Sequence[Fit], facts: Sequence[Mapping[str, float]]) -> list[Constant]:
    """
    Return for each parameter whether it is common to all specimens or follows a power law.

    Parameters
    ----------
    facts : sequence of mapping
        Known numbers of each specimen: length, age, ...
    """
    found = []
    for sharing in sharings(fits):
        for j, key in enumerate(sharing.keys):
            x, s = sharing.x[j], sharing.sd[j]
            if np.all(s > DEAD * sharing.width[j]):
                continue
            unit, size = unit_of(fits[0].model, key)
            is_log = next(p for p in fits[0].priors if p.key == key).kind == 'log'
            shared = float(sharing.shared[j])
            goes_with, power = ('', 0.0) if shared > 0.5 else _goes_with(x, s, facts, is_log)
            values = np.exp(x) if is_log else x
            one = float(np.exp(sharing.one[j]) if is_log else sharing.one[j])
            found.append(Constant(
                key, unit, (values / size).tolist(),
                (s * (values if is_log else 1.0) / size).tolist(), shared, one / size, goes_with,
                power))
    return found


def _goes_with(x: np.ndarray, s: np.ndarray, facts: Sequence[Mapping[str, float]], is_log: bool
               ) -> tuple[str, float]:
    """
    Return the fact on which a parameter depends by a power law, and the exponent; empty for none.

    A weighted line is fitted to the logarithms, for three or more specimens. Its residual scatter
    must be consistent with the errors of the fits (chi-square test).
    """
    from scipy import stats
    best: tuple[float, str, float] | None = None
    for fact in sorted(set.intersection(*map(set, facts))):
        t = np.array([each[fact] for each in facts])
        positive = is_log or bool(np.all(x > 0.0))
        if len(x) < 3 or np.any(t <= 0.0) or len(np.unique(t)) < 2 or not positive:
            continue
        y, spread = (x, s) if is_log else (np.log(x), s / x)
        line = np.stack([np.ones(len(t)), np.log(t)], -1) / spread[:, None]
        found, _, _, _ = np.linalg.lstsq(line, y / spread, rcond=None)
        left = float(np.sum((y / spread - line @ found) ** 2))
        if stats.chi2.sf(left, len(t) - 2) > _ALARM and (best is None or left < best[0]):
            best = (left, fact, float(found[1]))
    return best[1:] if best is not None else ('', 0.0)
