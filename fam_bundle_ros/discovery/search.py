# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Forward, swap and backward over sets of effects; every set is a joint refit of the whole model.

Score of a set: chi2/(c tau) + tolerances moved + k ln(n/tau), a BIC on the measured noise scale
with the samples that are independent (tau from the autocorrelation of the best residual) and a
variance inflation c for coloured noise or a shape that is not quite right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Optional

from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.fit import base_terms, effect_terms, Fit, Problem
from fam_bundle_ros.discovery.grouping import blocks
from fam_bundle_ros.model import Bundle, Effect
import numpy as np

#: A set must beat the smaller one by this much in score (1 % false alarms on simulated noise).
GATE = 10.0
#: The first shape of a family is kept unless another one is better by this much.
HEAD_MARGIN = 6.0
MOST_EFFECTS = 4

Progress = Optional[Callable[[float, str], None]]


@dataclass
class Scale:
    """What one unit of chi2 counts: variance inflation and correlation of a reference fit."""

    inflation: float = 1.0
    tau: float = 1.0
    samples: int = 1

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> 'Scale':
        """Return the scale that a fit's residual sets."""
        inflation = max(fit.chi2 / max(problem.samples - len(fit.terms), 1), 1.0)
        return cls(inflation, problem.correlation(fit.residual), problem.samples)

    @property
    def penalty(self) -> float:
        """Cost of one parameter."""
        return float(np.log(max(self.samples / self.tau, 3.0)))


@dataclass
class Search:
    """
    The sets of effects that were fitted, and the way through them.

    Attributes
    ----------
    problem : Problem
    model : Bundle
        The model to improve.
    effects : dict of str to Effect
        Candidates.
    fits : dict of tuple of str to Fit
        By sorted names.
    chosen : list of str
        In the order found.
    scale : Scale
        Of the final fit.
    gains : list of float
        Score gained at each step taken.
    votes : dict of str to float
        By effect name: share of held-out blocks that it made better.
    """

    problem: Problem
    model: Bundle
    effects: dict[str, Effect]
    progress: Progress = None
    fits: dict[tuple[str, ...], Fit] = field(default_factory=dict)
    chosen: list[str] = field(default_factory=list)
    scale: Scale = field(default_factory=Scale)
    gains: list[float] = field(default_factory=list)
    votes: dict[str, float] = field(default_factory=dict)

    def fit(self, names: Iterable[str]) -> Fit:
        """Return the joint refit of the model with some effects added (cached)."""
        key = tuple(sorted(names))
        if key in self.fits:
            return self.fits[key]
        terms = base_terms(self.model)
        if not key:
            self.fits[key] = self.problem.fit(self.model, terms)
            return self.fits[key]
        # the last fitted subset gives the start; what is new is tried from several shapes
        parents = [k for k in self.fits if set(k) < set(key)]
        parent = max(parents, key=len) if parents else ()
        before = {t.key: v for t, v in zip(self.fit(parent).terms, self.fit(parent).values)}
        fresh = [name for name in key if name not in parent]
        bundle = self.model
        for name in key:
            bundle = bundle.with_effect(self.effects[name])
            terms = terms + effect_terms(self.effects[name], self.model.n)
        tries = [dict(before)]
        for name in fresh:
            options = cand.starts(self.effects[name], self.model.n)
            tries = [{**t, **o} for t in tries for o in (options if len(fresh) == 1
                                                         else options[:1])]
        if len(tries) > 1:
            # a look at each, then the default and the two that promise most to the end
            short = [self.problem.fit(bundle, terms, start, iterations=3) for start in tries]
            order = sorted(range(1, len(tries)), key=lambda k: short[k].cost)
            tries = [{t.key: v for t, v in zip(terms, short[k].values)} for k in [0, *order[:2]]]
        fitted = min((self.problem.fit(bundle, terms, start) for start in tries),
                     key=lambda f: f.cost)
        fitted.added = key
        self.fits[key] = fitted
        return fitted

    def score(self, names: Iterable[str], scale: Scale) -> float:
        """Return the score of a set (smaller is better)."""
        fit = self.fit(names)
        count = len(fit.terms)
        return fit.chi2 / (scale.inflation * scale.tau) + fit.prior + count * scale.penalty

    # --- the way through -----------------------------------------------------------------------

    def run(self) -> 'Search':
        """Add effects while they earn their place; swap; drop what is no longer needed."""
        self.fit(())
        while len(self.chosen) < MOST_EFFECTS:
            best, scale = self._best_next(self.chosen)
            if best is None:
                break
            gain = self.score(self.chosen, scale) - self.score([*self.chosen, best], scale)
            if gain < GATE or not self._earned(self.chosen, best, scale):
                break
            self.chosen.append(best)
            self.gains.append(gain)
            if len(self.chosen) > 1:
                self._swap()
        self._drop()
        self.scale = Scale.of(self.problem, self.fit(self.chosen))
        return self

    def _options(self, held: Iterable[str]) -> list[str]:
        """Return the candidates beside those held: no second shape of one effect."""
        taken = {cand.head(name) for name in held}
        return [name for name in self.effects if cand.head(name) not in taken]

    def _best_next(self, held: list[str]) -> tuple[Optional[str], Scale]:
        options = self._options(held)
        if not options:
            return None, Scale()
        for done, name in enumerate(options):
            if self.progress:
                share = (len(held) + done / len(options)) / (MOST_EFFECTS + 1)
                self.progress(share, f'refitting with {name}')
            self.fit([*held, name])
        rough = min(options, key=lambda name: self.fit([*held, name]).cost)
        scale = Scale.of(self.problem, self.fit([*held, rough]))
        best = min(options, key=lambda name: self.score([*held, name], scale))
        return self._prefer_head(held, best, scale), scale

    def _prefer_head(self, held: list[str], name: str, scale: Scale) -> str:
        first = cand.head(name)
        if first == name or first not in self.effects:
            return name
        worse = self.score([*held, first], scale) - self.score([*held, name], scale)
        return first if worse < HEAD_MARGIN else name

    def _swap(self) -> None:
        """Try every other candidate in the place of each effect but the last."""
        for slot in range(len(self.chosen) - 1):
            rest = self.chosen[:slot] + self.chosen[slot + 1:]
            scale = Scale.of(self.problem, self.fit(self.chosen))
            now = self.score(self.chosen, scale)
            options = self._options(rest)
            for name in options:
                self.fit([*rest, name])
            best = min(options, key=lambda name: self.score([*rest, name], scale))
            best = self._prefer_head(rest, best, scale)
            if best != self.chosen[slot] and self.score([*rest, best], scale) < now - 2.0:
                self.chosen[slot] = best

    def _drop(self) -> None:
        while self.chosen:
            scale = Scale.of(self.problem, self.fit(self.chosen))
            now = self.score(self.chosen, scale)
            losses = [(self.score([n for n in self.chosen if n != name], scale) - now, name)
                      for name in self.chosen]
            loss, name = min(losses)
            if loss >= GATE:
                return
            at = self.chosen.index(name)
            self.chosen.pop(at)
            self.gains.pop(at)

    # --- does it hold on data that the fit did not see? ----------------------------------------

    def excess(self, names: Iterable[str]) -> float:
        """Return the sum of squares that a set leaves beyond the noise, in noise variances."""
        fit = self.fit(names)
        return max(fit.chi2 - (self.problem.samples - len(fit.terms)), 0.0)

    def _earned(self, held: list[str], name: str, scale: Scale) -> bool:
        """
        Return whether an effect holds on blocks left out, and is more than a patch.

        Once an effect of another shape than the truth's is in, small leftovers of that shape
        remain; a further effect must take most of what is left to be more than a patch on it.
        """
        before, after = self.fit(held), self.fit([*held, name])
        share, ratio = held_out_votes(self.problem, before, after, scale)
        self.votes[name] = share
        # most blocks must gain; a few may lose where the error falls by a lot in all (never so
        # on noise)
        if share < 2.0 / 3.0 and not (share >= 0.5 and ratio < 0.7):
            return False
        if held:
            left, now = self.excess(held), self.excess([*held, name])
            if now > 0.5 * left:
                return False
        return True


def leave_out(problem: Problem, fit: Fit, rows: np.ndarray) -> np.ndarray:
    """
    Return the whitened residual of rows that a refit has not seen, linear in the parameters.

    Parameters
    ----------
    rows : ndarray of bool, shape (T,)
    """
    r = np.where(problem.weight, fit.residual, 0.0) / problem.noise
    inside = fit.jacobian[rows]
    prior = np.diag([0.0 if t.prior is None else 1.0 for t in fit.terms])
    rest = fit.jacobian.T @ fit.jacobian - inside.T @ inside + prior
    size = np.sqrt(np.maximum(np.diag(rest), 1e-12))
    # what only the left-out rows can tell stays at zero information, not at infinity
    scaled = rest / np.outer(size, size) + 1e-6 * np.eye(len(size))
    step = np.linalg.solve(scaled, (inside.T @ r[rows]) / size) / size
    return r[rows] + inside @ step


def held_out_votes(problem: Problem, before: Fit, after: Fit, scale: Scale,
                   ) -> tuple[float, float]:
    """
    Return the share of held-out blocks that the larger model predicts better.

    And the ratio of the sums of squares on all of them, new over old.

    Blocks where the two hardly differ do not vote; nor does leaving a whole direction out, which
    cannot judge what is odd in direction. 0 where fewer than two blocks vote.
    """
    votes, total = [], np.zeros(2)
    for scheme, label in blocks(problem.data).items():
        if scheme == 'direction':
            continue
        for block in np.unique(label):
            rows = label == block
            old = leave_out(problem, before, rows)
            new = leave_out(problem, after, rows)
            apart = np.sum((old - new) ** 2) / (scale.inflation * scale.tau)
            total += np.sum(old ** 2), np.sum(new ** 2)
            if apart >= 4.0:
                votes.append(float(np.sum(new ** 2)) < float(np.sum(old ** 2)))
    share = float(np.mean(votes)) if len(votes) >= 2 else 0.0
    return share, float(total[1] / max(total[0], 1e-300))
