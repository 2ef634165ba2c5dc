# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Search over sets of effects: two beam searches, then exchanges around the best set.

One beam ranks sets by evidence, the other by evidence without the discrepancy, which can absorb
what a partly correct set leaves. The beams go on to at least two changes beyond the best set.
Then effects of the best set are removed, replaced and given other shapes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import COOLING, Fit, Fitter
from fam_bundle_ros.discovery.linear import Linear, log_evidence
from fam_bundle_ros.discovery.options import family, Names, Options

Progress = Callable[..., None] | None
#: Offset of the additional starts for log-normal constants of a new effect, in prior widths.
_STARTS = 1.2


class Screened(NamedTuple):
    """A set that was only linearised, with its start and the log posteriors as of a `Fit`."""

    names: Names
    start: dict[str, float]
    posterior: float
    white_posterior: float


#: Log posterior of a fitted or a screened set, by which sets are ranked.
_Ranking = Callable[[Any], float]
_WHOLE: _Ranking = attrgetter('posterior')
#: Without a discrepancy.
_WHITE: _Ranking = attrgetter('white_posterior')


def _ranked(sets: Iterable[Any], value: _Ranking) -> list:
    """
    Return sets, the most probable first; sets equal to three decimals in the order of their names.

    Sets whose effects are fitted to zero are equally probable; rounding, which differs between
    compiled and plain laws, must not decide their order.
    """
    return sorted(sets, key=lambda each: (-round(value(each), 3), each.names))


def _unlike(ranked: list[Fit]) -> list[Fit]:
    """Return the first set of each combination of families, so that a beam stays diverse."""
    kept: dict[frozenset[str], Fit] = {}
    for fit in ranked:
        kept.setdefault(frozenset(map(family, fit.names)), fit)
    return list(kept.values())[:settings.BEAM]


@dataclass
class Search:
    """
    The search for the sets of highest posterior.

    Without `run` it fits only the sets that `fit` is asked for.

    Attributes
    ----------
    options : Options
    fits : dict of Names to Fit
        Every set that was fitted.
    """

    options: Options
    progress: Progress = None
    fits: dict[Names, Fit] = field(default_factory=dict)

    @cached_property
    def fitter(self) -> Fitter:
        """Fits sets to the cells of the options."""
        return Fitter(Covariance(self.options.cells, self.options.choices.unexplained))

    def run(self) -> Search:
        """Fit sets until no further change improves the best one."""
        null = self.fit(self.options.own)
        level = [null]
        best = null
        for depth in range(1, self.options.choices.most + 1):
            self._tell(min(depth, 5))
            found = {}
            for node in level:
                for fit in self.singles if node is null else self._expand(node, 1):
                    found[fit.names] = fit
            if not found:
                break
            ranked = _ranked(found.values(), _WHOLE)
            white = _ranked(found.values(), _WHITE)
            level = list({fit.names: fit for fit in [*_unlike(ranked), *_unlike(white)]}.values())
            if ranked[0].posterior > best.posterior:
                best = ranked[0]
            elif depth > len(self.options.changes(best.names)) + 1:
                break
        self._around(_WHITE, 6)
        self._around(_WHOLE, 9)
        self._settle()
        return self

    @cached_property
    def singles(self) -> list[Fit]:
        """The most promising sets with one change, fitted."""
        return self._expand(self.fit(self.options.own), 2)

    @property
    def null(self) -> Fit:
        """The model with its own effects."""
        return self.fits[self.options.own]

    @property
    def best(self) -> Fit:
        """The set of the highest posterior."""
        return max(self.fits.values(), key=lambda fit: fit.posterior)

    def near(self, fits: Iterable[Fit], exchange: bool) -> None:
        """Fit the model's own set and those of other fits; then exchange effects, if asked."""
        self.fit(self.options.own)
        for fit in fits:
            self.fit(fit.names, fit.start, fit.hyper)
        if exchange:
            self._around(_WHOLE, 11)

    def with_memory(self) -> list[Fit]:
        """
        Return the most probable sets whose force depends on the past, of unlike effects.

        Before `run`, of the sets with one change.
        """
        fits = [*self.singles, *self.fits.values()]
        return _unlike(_ranked((fit for fit in fits if fit.model.has_memory), _WHOLE))

    def fit(self, names: Names, start: Mapping[str, float] | None = None,
            hyper: Hyper | None = None) -> Fit:
        """Return the fit of a set; a new one is also fitted from a similar set, if given."""
        if names not in self.fits:
            self.fits[names] = self.fitter.fit(names, self.options.bundle(names),
                                               self.options.priors(names),
                                               self.options.log_prior(names))
            if start is not None and hyper is not None:
                self.again(names, start, hyper)
        return self.fits[names]

    def again(self, names: Names, start: Mapping[str, float], hyper: Hyper) -> Fit:
        """Return the better of a set's fit and one that starts at a similar set."""
        self.fits[names] = self.fitter.from_similar(self.fit(names), start, hyper)
        return self.fits[names]

    def _expand(self, node: Fit, wide: int) -> list[Fit]:
        """Return the most promising sets with one change more, fitted."""
        further = self.options.further(node.names)
        known = [self.fits[names] for names in further if names in self.fits]
        screened = [self.screen(node, names) for names in further if names not in self.fits]
        count = wide * settings.FITTED
        promising = [s for ranking in (_WHOLE, _WHITE)
                     for s in _ranked(screened, ranking)[:count]]
        return [*known, *(self.fit(s.names, s.start, node.hyper) for s in promising)]

    def _around(self, ranking: _Ranking, step: int) -> None:
        """Remove, replace and reshape effects of the best set until it does not improve."""
        for turn in range(3):
            best = max(self.fits.values(), key=ranking)
            self._tell(step + turn)
            for names in self.options.back(best.names):
                # from this start too: at a local optimum the smaller set looks too improbable
                fewer = self.again(names, best.start, best.hyper)
                swaps = [self.screen(fewer, other) for other in self.options.further(names)
                         if other not in self.fits]
                for s in _ranked(swaps, ranking)[:settings.BEAM]:
                    self.fit(s.names, s.start, best.hyper)
            for names in self.options.reshaped(best.names):
                if names not in self.fits:
                    self.fit(names, self.screen(best, names).start, best.hyper)
            for names in self.options.reshaped_own(best.names):
                self.fit(names)
            if max(self.fits.values(), key=ranking) is best:
                break

    def _settle(self) -> None:
        """Refit the sets with one change less than a tie of the best, starting at that tie."""
        odds = np.log(self.options.choices.odds)
        settled = set()
        for fit in _ranked(self.fits.values(), _WHOLE):
            if fit.posterior < self.best.posterior - odds:
                break
            for names in self.options.back(fit.names):
                known = self.fits.get(names)
                if names not in settled and (known is None or known.posterior < fit.posterior):
                    self.again(names, fit.start, fit.hyper)
                    settled.add(names)

    def screen(self, node: Fit, names: Names) -> Screened:
        """Return the highest log posterior of a set, linearised near the fit of a similar one."""
        priors = self.options.priors(names)
        new = [k for k, p in enumerate(priors) if p.key not in node.start]
        first = np.array([node.start.get(p.key, p.start) for p in priors])
        starts = [first]
        for k in new:
            if priors[k].kind == 'log':
                for step in (-_STARTS, _STARTS):
                    start = first.copy()
                    start[k] = np.clip(step, *priors[k].limits)
                    starts.append(start)
        hypers = {node.hyper}
        for fewer in (2, 4):
            hypers.add(node.hyper._replace(**{
                axis: max(1, getattr(node.hyper, axis) - fewer)
                for axis in ('even', 'odd', 'white', 'slow', 'speed')
                if getattr(node.hyper, axis) > 1}))
        kept = {p.key: node.slopes[:, k] for k, p in enumerate(node.priors)}
        bundle, log_prior = self.options.bundle(names), self.options.log_prior(names)
        best, white = (-np.inf, first), -np.inf
        for u in starts[:7]:
            at = Linear.of(priors, u, *self.fitter.linearised(bundle, priors, u, kept))
            for h in hypers:
                value = log_evidence(self.fitter.covariance, h, at)
                best = max(best, (value, u), key=lambda pair: pair[0])
            for place in COOLING:
                white = max(white, log_evidence(self.fitter.covariance, Hyper(white=place), at))
        return Screened(names, dict(zip((p.key for p in priors), best[1])), best[0] + log_prior,
                        white + log_prior)

    def _tell(self, step: int) -> None:
        if self.progress:
            self.progress(0.08 * step, 'trying sets of effects')
