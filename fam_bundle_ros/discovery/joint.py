# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Log posteriors of sets of effects on all specimens.

Effects of the muscle are the same in all specimens; errors of the sensors are those of each rig.
The log posterior of a set of muscle effects is its log prior, plus the log evidence of every
specimen with the sensor errors that are most probable in it (each with its prior odds), plus the
log Bayes factor of constants with a common value in all specimens (see `material`). A recording
that an effect cannot influence contributes its evidence without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import softmax

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.material import sharings
from fam_bundle_ros.discovery.options import Change, head, Names, Options
from fam_bundle_ros.discovery.posterior import least_loss, Posterior
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.model import Place

#: Number of sets of each specimen that are compared on all specimens.
_SETS = 6


def sensor_errors(options: Options, names: Names) -> Names:
    """Return the sensor errors of a set that the model as given does not have."""
    had = {head(name) for name in options.own}
    return tuple(name for name in names
                 if options.effects[name].place is Place.SENSOR and head(name) not in had)


def of_muscle(options: Options, names: Names) -> Names:
    """Return the effects of a set without `sensor_errors`."""
    return tuple(sorted(set(names) - set(sensor_errors(options, names))))


class JointPosterior:
    """
    Log posteriors of sets of muscle effects on all specimens.

    Attributes
    ----------
    searches : sequence of Search
    counted : sequence of int
        Those whose evidence counts.
    options : Options
        With the effects that any of the recordings can show.
    """

    def __init__(self, searches: Sequence[Search], counted: Sequence[int]):
        self.searches, self.counted = searches, counted
        self.options = replace(searches[0].options, addable=tuple(
            effect for k in counted for effect in searches[k].options.addable))
        self._known: dict[Names, tuple[float, list[Fit]]] = {}
        self._errors: list[set[Names]] = []
        sets = {self.options.own: None}
        for k, search in enumerate(searches):
            names = [fit.names for fit in Posterior.of(search).fits]
            if k in counted:
                sets |= dict.fromkeys(list(dict.fromkeys(
                    of_muscle(search.options, each) for each in names))[:_SETS])
            self._errors.append({(), *(sensor_errors(search.options, each)
                                       for each in names[:_SETS])})
        for each in sets:
            self.value(each)

    def value(self, names: Names) -> float:
        """Return the log posterior of a set, up to a constant."""
        return self._of(names)[0]

    def fits(self, names: Names) -> list[Fit]:
        """Return the fit of each specimen, with its most probable sensor errors."""
        return list(self._of(names)[1])

    def _of(self, names: Names) -> tuple[float, list[Fit]]:
        if names not in self._known:
            fits = [max((search.fit(tuple(sorted({*self._shown(search, names), *errors})))
                         for errors in sets), key=lambda fit: fit.posterior)
                    for search, sets in zip(self.searches, self._errors)]
            self._known[names] = (
                self.options.log_prior(names)
                + sum(self._own(k, fits[k], names) for k in self.counted)
                + sum(each.log_factor for each in sharings([fits[k] for k in self.counted])),
                fits)
        return self._known[names]

    @staticmethod
    def _shown(search: Search, names: Names) -> Names:
        """Return the effects of a set that a recording can show; for others, the model's own."""
        shown = tuple(name for name in names if name in search.options.effects)
        lost = {head(name) for name in names} - {head(name) for name in shown}
        return (*shown, *(name for name in search.options.own if head(name) in lost))

    def _own(self, k: int, fit: Fit, names: Names) -> float:
        """Return the log posterior of a specimen without the prior of the muscle effects."""
        search = self.searches[k]
        return fit.posterior - search.options.log_prior(self._shown(search, names))

    def probability(self) -> dict[str, float]:
        """Return the probability of each change of the muscle, by its label."""
        log = np.array([value for value, _ in self._known.values()])
        found: dict[str, float] = {}
        for each, share in zip(self._known, softmax(log)):
            for label in {c.label for c in self.options.changes(each)}:
                found[label] = found.get(label, 0.0) + float(share)
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def named(self) -> tuple[Names, list[Change]]:
        """Return the best set reduced to the effects to name, and its changes."""
        names = max(self._known, key=self.value)
        null = self.value(self.options.own)
        while True:
            loss = {change: self.value(names) - self.value(change.undone(names))
                    for change in self.options.changes(names)}
            least = min(loss, key=lambda change: loss[change], default=None)
            if least is None or loss[least] >= least_loss(self.value(names) - null):
                return names, sorted(loss, key=lambda change: -loss[change])
            names = least.undone(names)

    def reduced(self, names: Names) -> list[Fit]:
        """
        Return the fit of each specimen, reduced to the effects that this specimen needs.

        Sensor errors are named by the rule for all effects. An effect of the muscle is taken from
        specimens with clear evidence against it, if the evidence of others is clearly for it.
        """
        fits = self.fits(names)
        for change in self.options.changes(names):
            fewer = change.undone(names)
            gain = [self._own(k, a, names) - self._own(k, b, fewer) for k, (a, b) in enumerate(
                zip(self.fits(names), self.fits(fewer)))]
            if max(gain[k] for k in self.counted) > settings.LEAST_LOSS:
                fits = [search.fit(change.undone(fit.names)) if each < -settings.LEAST_LOSS
                        else fit for search, fit, each in zip(self.searches, fits, gain)]
        return [self._without_weak(search, fit) for search, fit in zip(self.searches, fits)]

    @staticmethod
    def _without_weak(search: Search, fit: Fit) -> Fit:
        """Return a fit without sensor errors whose evidence is too weak to name them."""
        while True:
            fewer = [search.fit(Change(name, '').done(fit.names))
                     for name in sensor_errors(search.options, fit.names)]
            best = max(fewer, key=lambda each: each.posterior, default=None)
            if best is None or fit.posterior - best.posterior >= least_loss(
                    fit.posterior - search.null.posterior):
                return fit
            fit = best

    def ties(self, names: Names, answer: Sequence[Change], odds: float
             ) -> tuple[tuple[str, ...], ...]:
        """Return groups: a shape of the answer, then the shapes that can replace it."""
        return _ties(names, [change.new for change in answer if change.new],
                     sorted(set(self.options.effects) - set(names)),
                     lambda other: self._known.get(other, (-np.inf, []))[0],
                     self.value(names) - np.log(odds))

    def error_ties(self, k: int, fit: Fit, odds: float) -> tuple[tuple[str, ...], ...]:
        """Return groups: a sensor error of a specimen's fit, then those that can replace it."""
        search, options = self.searches[k], self.searches[k].options
        others = sensor_errors(options, tuple(sorted(set(options.effects) - set(fit.names))))
        return _ties(fit.names, sensor_errors(options, fit.names), others,
                     lambda names: search.fit(names).posterior, fit.posterior - np.log(odds))


def _ties(names: Names, own: Sequence[str], others: Sequence[str],
          value: Callable[[Names], float], least: float) -> tuple[tuple[str, ...], ...]:
    """Return groups: one of a set's ``own``, then the others that keep its value above least."""
    groups = [(name, *(other for other in others
                       if value(Change(name, other).done(names)) > least)) for name in own]
    return tuple(group for group in groups if len(group) > 1)
