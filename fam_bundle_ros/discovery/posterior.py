# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Posterior over all fitted sets: probability of each effect, ties between effects, which to name.

Probabilities are Bayesian averages over the fitted sets (Hoeting et al. 1999), averaged also over
posteriors in which one isobar, strain level or trial is left out. For a real muscle every set is
an approximation; the posterior of all data is then overconfident, and can prefer another set when
one level is removed (Huggins and Miller 2023, who average over bootstraps). An effect is named
when the log posterior of the best set drops enough without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.special import log_softmax, logsumexp

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.fitter import Fit, Fitter
from fam_bundle_ros.discovery.held_out import folds
from fam_bundle_ros.discovery.options import Change, Names, Options
from fam_bundle_ros.discovery.search import Search


@dataclass(frozen=True)
class LikelySet:
    """
    A set of effects and its probability over all sets that were fitted.

    Attributes
    ----------
    changes : tuple of Change
        Against the model as given; empty for that model itself, recalibrated.
    probability : float
    chosen : bool
        Whether it is the answer.
    """

    changes: tuple[Change, ...]
    probability: float
    chosen: bool

    def __str__(self) -> str:
        return ', '.join(map(str, self.changes)) or 'nothing missing'

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as JSON has it."""
        return {'set': str(self), 'probability': self.probability, 'chosen': self.chosen}


class Trade(NamedTuple):
    """Changes of the chosen set, and other changes that together can replace them."""

    gone: frozenset[Change]
    came: frozenset[Change]

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all its changes."""
        return tuple(dict.fromkeys(change.label for changes_ in self
                                   for change in sorted(changes_, key=str)))

    def without(self, other: Trade) -> Trade:
        """Return this trade without the changes of a smaller trade that it contains."""
        if self.gone >= other.gone and self.came >= other.came:
            return Trade(self.gone - other.gone, self.came - other.came)
        return self

    def to_dict(self) -> dict[str, list[str]]:
        """Return the entry as JSON has it."""
        return {key: sorted(map(str, changes_)) for key, changes_ in self._asdict().items()}

    def __str__(self) -> str:
        return ' and '.join(' with '.join(sorted(map(str, changes_))) for changes_ in self)


@dataclass(frozen=True)
class Posterior:
    """
    All fitted sets with their probabilities.

    Attributes
    ----------
    options : Options
    fits : tuple of Fit
        Most probable first.
    log_weights : ndarray, shape (n,)
        Natural logarithm of the probability of each set.
    """

    options: Options
    fits: tuple[Fit, ...]
    log_weights: np.ndarray

    @classmethod
    def of(cls, search: Search) -> Posterior:
        """Return the posterior of a search on all data."""
        fits = sorted(search.fits.values(), key=lambda fit: -fit.posterior)
        return cls(search.options, tuple(fits),
                   log_softmax([fit.posterior for fit in fits]))

    @classmethod
    def over_folds(cls, search: Search, chosen: Fit) -> Posterior:
        """
        Return the average of the leave-one-fold-out posteriors, with equal weight per kind.

        Computed for the `settings.WEIGHED` most probable sets and the chosen one, linearised at
        the fit to all data; other sets keep their probability. Without folds, the posterior of
        all data.
        """
        whole, fitter = cls.of(search), search.fitter
        top = [k for k, fit in enumerate(whole.fits)
               if k < settings.WEIGHED or fit.names == chosen.names]
        by_kind: dict[str, list[np.ndarray]] = {}
        for kind, _, test in folds(fitter.cells):
            there = Fitter(fitter.covariance.without(test))
            by_kind.setdefault(kind, []).append(log_softmax(
                [there.evidence_of(whole.fits[k]) for k in top]))
        if not by_kind:
            return whole
        log = whole.log_weights.copy()
        log[top] = logsumexp([logsumexp(each, axis=0) - np.log(len(each))
                              for each in by_kind.values()], axis=0) - np.log(len(by_kind))
        order = np.argsort(-log, kind='stable')
        return cls(search.options, tuple(whole.fits[k] for k in order), log_softmax(log[order]))

    @cached_property
    def weights(self) -> np.ndarray:
        """Probability of each set, as sorted."""
        return np.exp(self.log_weights)

    def near(self, chosen: Fit, odds: float) -> list[int]:
        """Return the indices of the sets within ``odds`` of the chosen one."""
        place = [fit.names for fit in self.fits].index(chosen.names)
        return np.flatnonzero(self.log_weights >= self.log_weights[place] - np.log(odds)).tolist()

    def _rivals(self, chosen: Fit, odds: float) -> list[int]:
        """
        Return the sets `near` the chosen one that are more probable than what both have in common.

        Where a discrepancy is as probable as an effect of the chosen set, effects without any
        influence can be beside it, and replace nothing.
        """
        own = self.options.changes(chosen.names)
        log = {fit.names: weight for fit, weight in zip(self.fits, self.log_weights)}
        found = []
        for k in self.near(chosen, odds):
            common = chosen.names
            for change in own:
                common = common if change in self._changes[k] else change.undone(common)
            if self.fits[k].names == common or self.log_weights[k] > log.get(common, -np.inf):
                found.append(k)
        return found

    @cached_property
    def _changes(self) -> list[list[Change]]:
        return [self.options.changes(fit.names) for fit in self.fits]

    def likely(self, chosen: Names, most: int = 8) -> list[LikelySet]:
        """Return the ``most`` most probable sets, and the chosen one if it is not among them."""
        found = [LikelySet(tuple(set_), float(weight), fit.names == chosen)
                 for fit, set_, weight in zip(self.fits, self._changes, self.weights)]
        return found[:most] + [each for each in found[most:] if each.chosen]

    def labels(self) -> list[str]:
        """Return the labels of all changes that were tried."""
        return list(dict.fromkeys(change.label for set_ in self._changes for change in set_))

    def probability(self, is_one: Callable[[Change], bool]) -> float:
        """Return the total probability of the sets with a change for which ``is_one`` is true."""
        return float(sum(weight for weight, set_ in zip(self.weights, self._changes)
                         if any(is_one(change) for change in set_)))

    def of_label(self, label: str) -> float:
        """Return the probability of a change by its label."""
        return self.probability(lambda change: change.label == label)

    def expected_wrong(self, fit: Fit) -> float:
        """
        Return how many effects of a set are wrong or missing, minus the same of the empty set.

        Expected number, by the probability of each effect: the median probability model has the
        least (Barbieri and Berger 2004).
        """
        return sum(1.0 - 2.0 * self.of_label(change.label)
                   for change in self.options.changes(fit.names))

    def best_with(self, label: str) -> tuple[Fit, Change]:
        """Return the most probable set with a change of this label, and that change."""
        return next((fit, change) for fit, set_ in zip(self.fits, self._changes)
                    for change in set_ if change.label == label)

    def ties(self, named: Iterable[Change], chosen: Fit, odds: float) -> list[tuple[str, ...]]:
        """
        Return groups of labels: a named effect, then the effects that can replace it.

        An effect can replace the named one if the set with this exchange is within ``odds`` of
        the chosen set.
        """
        groups = []
        labels = {change.label for change in self.options.changes(chosen.names)}
        near = self._rivals(chosen, odds)
        for change in named:
            others = []
            for k in near:
                there = {other.label for other in self._changes[k]}
                if (len(there) == len(labels) and change.label not in there
                        and labels - {change.label} <= there):
                    others += sorted(there - labels)
            if others:
                groups.append((change.label, *dict.fromkeys(others)))
        return groups

    def trades(self, chosen: Fit, odds: float, ties: Iterable[tuple[str, ...]]) -> list[Trade]:
        """
        Return exchanges of several changes of the chosen set, beyond the one-to-one ``ties``.

        They are the differences to the sets within ``odds`` of it; smaller trades are subtracted
        from larger ones that contain them.
        """
        own = frozenset(self.options.changes(chosen.names))
        sets = [frozenset(self._changes[k]) for k in self._rivals(chosen, odds)]
        found: list[Trade] = []
        for other in sorted(sets, key=lambda set_: len(own ^ set_)):
            trade = Trade(own - other, other - own)
            for known in found:
                trade = trade.without(known)
            if trade.gone and trade.came:
                found.append(trade)
        tied = [{group[0], other} for group in ties for other in group[1:]]
        return [trade for trade in found if len(trade.gone) + len(trade.came) > 2
                or (len(trade.labels) == 2 and set(trade.labels) not in tied)]

    def spread(self, key: str, value: float) -> float | None:
        """
        Return the standard deviation of a parameter's u about a value, over all sets with it.

        None if no set has the parameter.
        """
        total = weight_sum = 0.0
        for fit, weight in zip(self.fits, self.weights):
            keys = [prior.key for prior in fit.priors]
            if key not in keys or weight < 1e-4:
                continue
            place = keys.index(key)
            own = fit.covariance[place, place]
            total += weight * (own + (fit.u[place] - value) ** 2)
            weight_sum += weight
        return float(np.sqrt(total / weight_sum)) if weight_sum else None


def least_loss(gain: float) -> float:
    """Return the loss of log posterior from which an effect is named, if all together gain so."""
    return max(settings.LEAST_LOSS, settings.LEAST_SHARE * gain)


def named(search: Search, fit: Fit) -> tuple[Fit, list[Change], dict[str, float]]:
    """
    Return a set reduced to the effects to name, its changes and their losses by label.

    The loss of a change is the drop of the log posterior without it. Changes with too small a
    loss are undone, the smallest first; the rest is sorted by loss, largest first.
    """
    options = search.options
    while True:
        loss = {change: fit.posterior - search.fit(change.undone(fit.names), fit.start,
                                                   fit.hyper).posterior
                for change in options.changes(fit.names)}
        gain = fit.posterior - search.null.posterior
        least = min(loss, key=lambda change: loss[change], default=None)
        if least is None or loss[least] >= least_loss(gain):
            order = sorted(loss, key=lambda change: -loss[change])
            return fit, order, {change.label: loss[change] for change in order}
        fit = search.fits[least.undone(fit.names)]
