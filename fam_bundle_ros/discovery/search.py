# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Forward, swap and backward over sets of effects, and what a further effect must show."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import (
    blocks,
    pressure_levels,
    strain_bins,
    varying_unit,
)
from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.fit import Fit, Problem
from fam_bundle_ros.discovery.sets import Scale, Sets

#: A set must beat the smaller one by this much in score (1 % false alarms on simulated noise).
GATE = 10.0
#: The first shape of a family is kept unless another one is better by this much.
HEAD_MARGIN = 6.0
MOST_EFFECTS = 4
#: Effects whose scores differ by less cannot be told apart (odds of 20 to 1).
TIE = 6.0
#: Where something is still missing, an error larger by this factor is no reason for a choice.
NEAR = 1.1
#: A further effect must be at least so large, in noise standard deviations of one row.
_SEEN = 0.15
#: A further effect must take at least this share of what the others took: a shape that is not
#: quite right leaves a few per cent ...
_PATCH = 0.02
#: ... or this, where nothing but noise is left with it.
_PATCH_TO_NOISE = 0.004
#: So many first effects are tried with twice as many second ones where none passes alone.
_AHEAD = 3
#: A candidate is refitted only if it could take away this much of chi2 by a linear look ...
_SCREEN = 4.0
#: ... and this share of what the best candidate could.
_SCREEN_SHARE = 0.01

Progress = Callable[[float, str], None] | None


@dataclass
class Search(Sets):
    """
    The way through the sets of effects.

    Attributes
    ----------
    progress : callable, optional
        Told a share from 0 to 1 and a word.
    chosen : list of str
        In the order found.
    scale : Scale
        Of the final fit.
    gains : list of float
        Score gained at each step taken.
    votes : dict of str to float
        By effect name: share of held-out blocks that it made better.
    """

    progress: Progress = None
    chosen: list[str] = field(default_factory=list)
    scale: Scale = field(default_factory=Scale)
    gains: list[float] = field(default_factory=list)
    votes: dict[str, float] = field(default_factory=dict)

    # --- the way through -----------------------------------------------------------------------

    def run(self) -> Search:
        """Add effects while they earn their place; swap; drop what is no longer needed."""
        self.fit(())
        self._settle()
        while len(self.chosen) < MOST_EFFECTS:
            best, gain = self._step() or self._look_ahead() or (None, 0.0)
            if best is None:
                break
            self.chosen.append(best)
            self.gains.append(gain)
            if len(self.chosen) > 1:
                self._swap()
        self._drop()
        self.scale = Scale.of(self.problem, self.fit(self.chosen))
        return self

    def in_best_shapes(self, names: Iterable[str]) -> list[str]:
        """Return effects each in the shape that `run` would choose, of those in ``effects``."""
        self.chosen = []
        for name in names:
            self.fit(self.chosen)
            self.chosen.append(name)
        self.fit(self.chosen)
        self._swap()
        return self.chosen

    def _step(self) -> tuple[str, float] | None:
        """Return the effect that earns its place next, and what it gains."""
        best, scale = self._best_next(self.chosen)
        if best is None:
            return None
        gain = self.score(self.chosen, scale) - self.score([*self.chosen, best], scale)
        if gain < GATE or not self._earned(self.chosen, best):
            return None
        return best, gain

    def _look_ahead(self) -> tuple[str, float] | None:
        """
        Return the first of two effects that only together earn their place.

        Where two effects are missing, what one leaves of the other is so large and so correlated
        that alone it may not pass.
        """
        held = self.chosen
        if len(held) > MOST_EFFECTS - 2 or self.excess(held) < 0.2 * self.problem.samples:
            return None
        ready = [n for n in self._options(held) if tuple(sorted([*held, n])) in self.fits]
        firsts = sorted(ready, key=lambda n: self.fit([*held, n]).cost)[:_AHEAD]
        pairs = []
        for first in firsts:
            second, scale = self._best_next([*held, first], most=2 * _AHEAD)
            if second is not None:
                pairs.append((self.fit([*held, first, second]).cost, first, second, scale))
        if not pairs:
            return None
        _, first, second, scale = min(pairs, key=lambda pair: pair[0])
        both = self.score([*held, first, second], scale)
        gain = self.score(held, scale) - both
        # each of the two must be needed beside the other
        needed = min(self.score([*held, n], scale) for n in (first, second)) - both
        if gain < 2 * GATE or needed < GATE or self.excess(
                [*held, first, second]) > 0.3 * self.excess(held):
            return None
        votes = held_out_votes(self.problem, self.fit(held), self.fit([*held, first, second]))
        return (first, gain - needed) if votes.share >= 2.0 / 3.0 and votes.ratio < 0.7 else None

    def _settle(self) -> None:
        """Set the widths that no fit moves (the rounding of a sign) where the data like them."""
        for name, effect in self.effects.items():
            for parameter in effect.parameters:
                if parameter.fitted or parameter.lower <= 0:
                    continue
                low, high = effect.limits(parameter.name)
                usual = effect.values[parameter.name]
                tries = []
                for factor in (1.0, 0.2, 4.0):
                    value = float(np.clip(usual * factor, low, high))
                    self.effects[name] = effect.replace(**{parameter.name: value})
                    tries.append((self.screen((), name)[0], -abs(np.log(factor)), value))
                    self._screened.pop(((), name))
                best, plain = max(tries), tries[0]
                # the usual one stays unless another one tells clearly more
                value = best[2] if best[0] > 1.02 * plain[0] + GATE else plain[2]
                self.effects[name] = effect.replace(**{parameter.name: value})

    def _options(self, held: Iterable[str]) -> list[str]:
        """Return the candidates beside those held: no second shape of one effect."""
        taken = {cand.head(name) for name in held}
        return [name for name in self.effects if cand.head(name) not in taken]

    def _promising(self, held: list[str], most: int = 99) -> list[str]:
        """Return the candidates that are worth a joint refit beside those held, best first."""
        options = self._options(held)
        gains = {name: self.screen(held, name)[0] for name in options}
        least = max(_SCREEN, _SCREEN_SHARE * max(gains.values(), default=0.0))
        worth = [name for name in options if gains[name] >= least]
        return sorted(worth, key=lambda name: -gains[name])[:most]

    def _best_next(self, held: list[str], most: int = 99) -> tuple[str | None, Scale]:
        options = self._promising(held, most)
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
        """Try every other candidate in the place of each effect, until none does better."""
        for _ in range(2):
            before = list(self.chosen)
            for slot in range(len(self.chosen)):
                self.chosen[slot] = self._rival(slot)
            if self.chosen == before:
                return

    def _rival(self, slot: int) -> str:
        """Return the effect that does best in a place, the one that is there unless clearly."""
        rest = self.chosen[:slot] + self.chosen[slot + 1:]
        options = self._promising(rest)
        if self.chosen[slot] not in options:
            options.append(self.chosen[slot])
        rough = min(options, key=lambda name: self.fit([*rest, name]).cost)
        scale = Scale.of(self.problem, self.fit([*rest, rough]))
        best = min(options, key=lambda name: self.score([*rest, name], scale))
        best = self._prefer_head(rest, best, scale)
        now = self.score(self.chosen, scale)
        return best if self.score([*rest, best], scale) < now - 2.0 else self.chosen[slot]

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

    def _earned(self, held: list[str], name: str) -> bool:
        """Return whether an effect holds on blocks left out, and is more than a patch."""
        before, after = self.fit(held), self.fit([*held, name])
        held_out = held_out_votes(self.problem, before, after)
        share, ratio = held_out.share, held_out.ratio
        self.votes[name] = share
        if not held and held_out.weak:
            # a first effect that most blocks are too small to judge is judged by all together
            scale = Scale.of(self.problem, after)
            return held_out.gained >= GATE * scale.inflation * scale.tau
        # most blocks must gain; a few may lose where the error falls by a lot in all (never so
        # on noise)
        if share < 2.0 / 3.0 and not (share >= 0.5 and ratio < 0.7):
            return False
        return not held or self._more_than_a_patch(held, name)

    def _more_than_a_patch(self, held: list[str], name: str) -> bool:
        """
        Return whether a further effect is more than a patch on the shape of those held.

        An effect in another shape than the truth's leaves a few per cent of what it explains, and
        some other effect always fits a part of that. A real one takes most of what is left, and
        what it takes is not small against what the others took - unless one is purely odd in the
        direction of motion and the other purely even: neither could leave the other's shape.
        """
        gained = (self.fit(held).chi2 - self.fit([*held, name]).chi2) / self.problem.samples
        if gained * self.problem.noise ** 2 < (_SEEN * self.problem.row_noise) ** 2:
            return False
        added = self._odd_share(held, name)
        apart = [(self._odd_share([*(n for n in held if n != other), name], other), added)
                 for other in held]
        if all(max(a, b) > 0.9 and min(a, b) < 0.1 and not 0.03 < a < 0.97 for a, b in apart):
            scale = Scale.of(self.problem, self.fit([*held, name]))
            return self.score(held, scale) - self.score([*held, name], scale) > 3 * GATE
        first, left = self.excess(()), self.excess(held)
        now = min(self.excess([*shapes, name]) for shapes in self._reshaped(held))
        if now > 0.5 * left:
            return False
        # to the noise and no further: a patch rarely fits so well
        clean = now < 0.1 * self.problem.samples
        return left - now > (_PATCH_TO_NOISE if clean else _PATCH) * (first - left)

    def _reshaped(self, held: list[str]) -> list[list[str]]:
        """Return the held effects, and the same with one of them in another of its shapes."""
        sets = [held]
        for slot, old in enumerate(held):
            sets += [[*held[:slot], new, *held[slot + 1:]] for new in self.effects
                     if new != old and cand.head(new) == cand.head(old)]
        return sets

    def _odd_share(self, held: Iterable[str], name: str) -> float:
        """Return how much of what an effect adds changes sign with the motion, 0 to 1."""
        fit = self.fit([*held, name])
        added = fit.residual - self.problem.residual(fit.model.without_effect(name))
        data = self.problem.data
        moving = (data.direction != 0) & self.problem.weight
        if moving.sum() < 10:
            return 0.0
        way = data.direction[moving]
        unit = varying_unit(data)
        level, _ = pressure_levels(data.pressure[moving, unit], 12)
        bins, _ = strain_bins(data.strain[moving], 12)
        cell = level * 12 + bins
        size = int(cell.max()) + 1
        change = -added[moving]
        up, down = (np.bincount(cell[way == s], change[way == s], size)
                    / np.maximum(np.bincount(cell[way == s], minlength=size), 1) for s in (1, -1))
        both = (np.bincount(cell[way == 1], minlength=size) > 0) & (
            np.bincount(cell[way == -1], minlength=size) > 0)
        odd = float(np.sum((up - down)[both] ** 2))
        even = float(np.sum((up + down)[both] ** 2))
        return odd / max(odd + even, 1e-300)


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


class HeldOut(NamedTuple):
    """
    What blocks left out say of a larger model.

    ``share`` of the blocks that it predicts better; ``ratio`` of the sums of squares on all of
    them, new over old; ``gained``, by how much chi2 falls there, without the block that gains
    most; ``weak``, whether the two differ too little in most blocks for a vote.
    """

    share: float
    ratio: float
    gained: float
    weak: bool


def held_out_votes(problem: Problem, before: Fit, after: Fit) -> HeldOut:
    """
    Return whether the larger model predicts blocks better that neither has seen.

    Blocks where the two hardly differ do not vote; nor does leaving a whole direction out, which
    cannot judge what is odd in direction. 0 where fewer than two blocks vote.
    """
    votes, total = [], np.zeros(2)
    gains: list[list[float]] = []
    for scheme, label in blocks(problem.data).items():
        if scheme == 'direction':
            continue
        gains.append([])
        for block in np.unique(label):
            rows = label == block
            old = leave_out(problem, before, rows)
            new = leave_out(problem, after, rows)
            both = np.array([np.sum(old ** 2), np.sum(new ** 2)])
            total += both
            gains[-1].append(float(both[0] - both[1]))
            if np.sum((old - new) ** 2) >= 4.0 + 0.005 * both[0]:
                votes.append(bool(both[1] < both[0]))
    share = float(np.mean(votes)) if len(votes) >= 2 else 0.0
    gained = min((sum(scheme) - max(scheme) for scheme in gains), default=0.0)
    return HeldOut(share, float(total[1] / max(total[0], 1e-300)), gained,
                   2 * len(votes) < sum(map(len, gains)))
