# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sets of effects, each a joint refit of the whole model on the same data, and their scores.

Score of a set: chi2/(c tau) + tolerances moved + k ln(n/tau), a BIC on the measured noise scale
with the samples that are independent (tau from the autocorrelation of the best residual) and a
variance inflation c for coloured noise or a shape that is not quite right.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.fit import base_terms, effect_terms, Fit, Problem
from fam_bundle_ros.model import Bundle, Effect, Place

#: An effect with more starts than this may sit in a wrong one.
_MANY_SHAPES = 5


@dataclass
class Scale:
    """What one unit of chi2 counts: variance inflation and correlation of a reference fit."""

    inflation: float = 1.0
    tau: float = 1.0
    samples: int = 1

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> Scale:
        """Return the scale that a fit's residual sets."""
        inflation = max(fit.chi2 / max(problem.samples - len(fit.terms), 1), 1.0)
        return cls(inflation, problem.correlation(fit.residual), problem.samples)

    @property
    def penalty(self) -> float:
        """Cost of one parameter."""
        return float(np.log(max(self.samples / self.tau, 3.0)))


@dataclass
class Sets:
    """
    The sets of effects that were fitted, each once.

    Attributes
    ----------
    problem : Problem
    model : Bundle
        The model to improve.
    effects : dict of str to Effect
        Candidates.
    fits : dict of tuple of str to Fit
        By sorted names.
    """

    problem: Problem
    model: Bundle
    effects: dict[str, Effect]
    fits: dict[tuple[str, ...], Fit] = field(default_factory=dict, kw_only=True)
    _screened: dict[tuple[tuple[str, ...], str], tuple[float, list[dict[str, float]]]] = field(
        default_factory=dict, repr=False, kw_only=True)

    def fit(self, names: Iterable[str]) -> Fit:
        """Return the joint refit of the model with some effects added (cached)."""
        key = tuple(sorted(names))
        if key in self.fits:
            return self.fits[key]
        if not key:
            self.fits[key] = self.problem.fit(self.model, base_terms(self.model))
            return self.fits[key]
        bundle, terms = self.model, base_terms(self.model)
        for name in key:
            bundle = bundle.with_effect(self.effects[name])
            terms = terms + effect_terms(self.effects[name], self.model.n)
        runs = [self.problem.fit(bundle, terms, start, iterations=6)
                for start in self._starts(key)]
        best = min(runs, key=lambda run: run.cost)
        start = {t.key: v for t, v in zip(terms, best.values)}
        fitted = self.problem.fit(bundle, terms, start)
        fitted.added = key
        self.fits[key] = fitted
        return fitted

    def _starts(self, key: tuple[str, ...]) -> list[dict[str, float]]:
        """
        Return starts for a set: the largest fitted subset, and what is new in several shapes.

        An effect of many shapes (buckling) is looked for anew beside every subset without it: the
        shape that it had alone may be a trap.
        """
        size = max(len(k) for k in self.fits if set(k) < set(key))
        parents = [k for k in self.fits if len(k) == size and set(k) < set(key)]
        found: list[dict[str, float]] = []
        for count, parent in enumerate(parents):
            fresh = [name for name in key if name not in parent]
            if len(fresh) > 1:
                if not count:
                    found.append(self._values(parent))
                continue
            many = len(cand.starts(self.effects[fresh[0]], self.model.n)) > _MANY_SHAPES
            if count and (not many or self.excess(parents[0]) < 0.05 * self.problem.samples):
                continue
            tries = self.screen(parent, fresh[0])[1][:8 if many else 3]
            found += [{**self._values(parent), **start} for start in tries]
        return found

    def _values(self, names: tuple[str, ...]) -> dict[str, float]:
        fit = self.fit(names)
        return {term.key: value for term, value in zip(fit.terms, fit.values)}

    def screen(self, held: Iterable[str], name: str) -> tuple[float, list[dict[str, float]]]:
        """
        Return roughly how much chi2 an effect could take away, and its starts, best first.

        Linear: the effect at each of its starts is a direction in which the residual may fall,
        less what the parameters of the fitted set can do by themselves.
        """
        key = (tuple(sorted(held)), name)
        if key in self._screened:
            return self._screened[key]
        fit = self.fit(key[0])
        weight, noise = self.problem.weight, self.problem.noise
        jacobian = fit.jacobian
        prior = np.array([0.0 if t.prior is None else 1.0 for t in fit.terms])
        pull = np.array([0.0 if t.prior is None else (v - t.prior) / t.scale
                         for t, v in zip(fit.terms, fit.values)])
        inverse = np.linalg.pinv(jacobian.T @ jacobian + np.diag(prior + 1e-9), hermitian=True)
        r = np.where(weight, fit.residual, 0.0) / noise
        slope = jacobian.T @ r - prior * pull
        effect = self.effects[name]

        def shift(values: dict[str, float]) -> np.ndarray:
            bundle = fit.model.with_effect(effect.replace(
                **{k.partition('.')[2]: v for k, v in values.items()}))
            return np.where(weight, fit.residual - self.problem.residual(bundle), 0.0) / noise

        def reach(columns: np.ndarray) -> float:
            across = jacobian.T @ columns
            own = columns.T @ columns - across.T @ inverse @ across
            right = columns.T @ r - across.T @ inverse @ slope
            size = np.diag(columns.T @ columns)
            own[np.diag_indices_from(own)] += 1e-6 * size + 1e-12
            return float(right @ np.linalg.solve(own, right))

        options = cand.starts(effect, self.model.n)
        shifts = [shift(values) for values in options]
        gains = [reach(column[:, None]) for column in shifts]
        terms = effect_terms(effect, self.model.n)
        first = shifts[0]
        columns = [first]
        for term in terms:
            step = 0.1 * term.scale * (-1.0 if term.start + 0.1 * term.scale > term.upper else 1.0)
            columns.append(shift({**options[0], term.key: term.start + step}) - first)
        together = reach(np.stack(columns, -1))
        # a floor has no size to scale: its starts are judged as they stand
        worth = gains if effect.place is not Place.LIMIT else [
            float(r @ r - (r - column) @ (r - column)) for column in shifts]
        order = [0, *sorted(range(1, len(options)), key=lambda k: -worth[k])]
        found = max([together, *gains]), [options[k] for k in order]
        self._screened[key] = found
        return found

    def score(self, names: Iterable[str], scale: Scale) -> float:
        """Return the score of a set (smaller is better)."""
        fit = self.fit(names)
        loss = scale.inflation * scale.tau
        return fit.chi2 / loss + fit.prior + self._oversize(fit) + scale.penalty * (
            len(fit.terms) - self._spare(fit, scale))

    def _oversize(self, fit: Fit) -> float:
        """
        Return what sizes far above the usual ones cost: one unit per e-fold, squared.

        The catalogue's defaults are sizes reported for such muscles. It matters only where the
        data cannot tell: a slow sweep that would need ten times the usual damping has friction.
        """
        cost = 0.0
        for name in fit.added:
            effect = self.effects[name]
            for parameter in effect.parameters:
                usual = parameter.default * parameter.scale
                if effect.off.get(parameter.name) != 0.0 or usual <= 0:
                    continue
                size = fit.model.effect(name).values[parameter.name]
                cost += max(np.log(max(size, 1e-300) / usual), 0.0) ** 2
        return cost

    def _spare(self, fit: Fit, scale: Scale) -> float:
        """
        Return how many parameters of added effects need not be paid for.

        An effect of several sizes (friction that may grow with pressure) pays for a size beyond
        the first only what leaving it out would cost: the shape with fewer sizes is in it.
        """
        if not fit.added:
            return 0.0
        information = fit.jacobian.T @ fit.jacobian / (scale.inflation * scale.tau)
        information += np.diag([1e-9 if t.prior is None else 1.0 for t in fit.terms])
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(information, hermitian=True)), 1e-30))
        spare = 0.0
        for name in fit.added:
            effect = self.effects[name]
            costs = []
            for j, term in enumerate(fit.terms):
                owner, _, own = term.key.partition('.')
                if owner == name and effect.off.get(own) == 0.0:
                    costs.append((fit.values[j] / (term.scale * spread[j])) ** 2)
            for cost in sorted(costs)[:-1]:
                spare += max(0.0, 1.0 - cost / scale.penalty)
        return spare

    def excess(self, names: Iterable[str]) -> float:
        """
        Return the sum of squares that a set leaves beyond the noise, in noise variances.

        What the best fit so far leaves is noise where it is less than the estimate says.
        """
        fit = self.fit(names)
        lowest = min(other.chi2 for other in self.fits.values())
        return max(fit.chi2 - min(self.problem.samples - len(fit.terms), lowest), 0.0)
