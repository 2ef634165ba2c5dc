# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which of the fitted sets of effects is the answer, and which one predicts best.

Evidence is in units of the noise; rows that a fit has not seen (`held_out`) are in newtons.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import softmax

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.estimates import is_dead
from fam_bundle_ros.discovery.evidence import Fit
from fam_bundle_ros.discovery.held_out import (
    held_out,
    held_out_physics,
    HeldOut,
    splits,
    squares_of_folds,
)
from fam_bundle_ros.discovery.posterior import Change, changes, named, Posterior
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.verdict import (
    bent,
    far,
    is_structured,
    need_of_structure,
    small,
    what_is_left,
)
from fam_bundle_ros.model import Bundle

#: Ties that are put to the test on held-out folds.
_TRIED = 24
#: Strains, and pressures, at which they are compared.
_POINTS = 24


def best_of_ties(search: Search, chosen: Fit, found: list[Change], worth: dict[str, float],
                 choices: Choices) -> tuple[Fit, list[Change]]:
    """
    Return the chosen set, or one as probable that predicts unseen rows better.

    Those within a standard error of the best on the folds (Breiman et al. 1984) are alike there;
    between strains that were measured they may be far apart. Of them the most probable one that is
    as near to what all of them predict as any, within the noise of a row: a single set predicts
    best where it is nearest to the average over sets (Barbieri and Berger 2004).
    Only where structure is left: down to the noise folds can tell nothing that evidence does not,
    and of shapes alike the `plainest` will do.
    """
    fitter = search.fitter
    if not found:
        return chosen, found
    physics = fitter.without_discrepancy(chosen)
    if what_is_left(fitter.covariance, chosen, physics).total <= small(fitter.cells):
        return plainest(search, chosen, found, choices)
    near = _near(search, chosen.posterior, choices)
    # what is no part of an answer by itself is none beside a tie either
    earned = {fit.names: fit for fit in (named(search, fit)[0] for fit in near)}
    earned.pop(chosen.names, None)
    tried = [chosen, *sorted(earned.values(), key=lambda fit: -fit.posterior)]
    alone = [physics, *(fitter.without_discrepancy(fit) for fit in tried[1:])]
    squares = [squares_of_folds(fitter, fit) for fit in alone]
    least = min(squares, key=np.sum)
    alike = [k for k, each in enumerate(squares) if as_good(each, least)]
    away = away_from_all(fitter.cells, [alone[k].model for k in alike],
                         softmax([tried[k].posterior for k in alike]))
    best = next(tried[k] for k, square in zip(alike, away)
                if square <= away.min() + fitter.cells.noise ** 2)
    order = changes(search.options, best.names)
    return best, sorted(order, key=lambda change: -worth.get(change.label, 0.0))


def plainest(search: Search, chosen: Fit, found: list[Change], choices: Choices,
             ) -> tuple[Fit, list[Change]]:
    """
    Return the chosen set with shapes of its effects of fewer parameters and fewer dead ones.

    A parameter that the data do not move costs no evidence: a shape with it is as probable as one
    without. Only shapes whose error on unseen rows is no larger, but for what noise hides.
    """
    fitter, labels = search.fitter, [change.label for change in found]
    hidden = (settings.VISIBLE * fitter.cells.noise) ** 2
    physics = fitter.without_discrepancy(chosen)
    least = _dead(physics, found)
    for fit in _near(search, chosen.posterior, choices) if least else ():
        order = changes(search.options, fit.names)
        if ({change.label for change in order} != set(labels)
                or len(fit.priors) >= len(chosen.priors)):
            continue
        other = fitter.without_discrepancy(fit)
        dead = _dead(other, order)
        if dead < least and (held_out_physics(fitter, other) ** 2
                             <= held_out_physics(fitter, physics) ** 2 + hidden):
            least, chosen = dead, fit
            found = sorted(order, key=lambda change: labels.index(change.label))
    return chosen, found


def _dead(physics: Fit, found: list[Change]) -> int:
    """Return how many parameters of what was found the data do not move."""
    new = {change.new for change in found}
    return sum(prior.key.split('.')[0] in new
               for prior, dead in zip(physics.priors, is_dead(physics)) if dead)


def _near(search: Search, posterior: float, choices: Choices) -> list[Fit]:
    """Return sets that are at most so many times less probable than one, most probable first."""
    return [fit for fit in Posterior.of(search).fits
            if fit.posterior > posterior - np.log(choices.odds)][:_TRIED]


def away_from_all(cells: Cells, models: list[Bundle], weights: np.ndarray) -> np.ndarray:
    """
    Return how far each model is from all of them, (k,), N^2: mean squares, weighted.

    At rest, at pressures of the cells and strains evenly over their range, measured or not.
    """
    pressure = cells.pressure[np.linspace(0, len(cells) - 1, _POINTS).astype(int)]
    strain = np.linspace(cells.strain.min(), cells.strain.max(), _POINTS)
    force = np.array([model.force(strain[:, None], pressure) for model in models])
    return np.array([np.mean((force - each) ** 2, axis=(1, 2)) @ weights for each in force])


def predictive(search: Search, chosen: Fit, physics: Fit, choices: Choices) -> Fit:
    """
    Return the set to predict with: of those as probable as the best, of least error on folds.

    It may hold effects that earn no name, and other shapes of those that do. Only where structure
    is left, as in `best_of_ties`, and where there are folds.
    """
    fitter = search.fitter
    if not splits(fitter.cells) or what_is_left(
            fitter.covariance, chosen, physics).total <= small(fitter.cells):
        return physics
    near = _near(search, search.best.posterior, choices)
    tried = [physics, *(fitter.without_discrepancy(fit) for fit in near
                        if fit.names != chosen.names)]
    return min(tried, key=lambda fit: held_out_physics(fitter, fit))


def believed(search: Search, choices: Choices) -> tuple[Fit, list[Change]]:
    """
    Return the most probable set of effects that are likelier than not, where structure is needed.

    Beside a small error a smooth discrepancy is hardly less probable than an effect. But the one
    says that something is missing as the other does: it is no reason to name nothing. An effect
    in more than half of the posterior is (Barbieri and Berger 2004). Look-alikes share it, so
    that none may have half: then the most probable set, within the odds of nothing, whose effects
    explain all of the structure alone, without a discrepancy beside them.
    """
    fitter, null = search.fitter, search.null
    left = what_is_left(fitter.covariance, null, fitter.without_discrepancy(null))
    if not is_structured(fitter.cells, need_of_structure(fitter, null), left, choices.inclusion):
        return null, []
    posterior = Posterior.of(search)
    for fit in posterior.fits:
        found = changes(search.options, fit.names)
        if all(posterior.of_label(change.label) > 0.5 for change in found):
            if found:
                return fit, found
            break
    for fit in _near(search, null.posterior, choices):
        found = changes(search.options, fit.names)
        if found and _explains_alone(search, fit, choices.inclusion):
            return fit, found
    return null, []


def _explains_alone(search: Search, fit: Fit, inclusion: float) -> bool:
    """Return whether physics without a discrepancy leaves no structure that needs one."""
    fitter = search.fitter
    alone = fitter.without_discrepancy(fit)
    hyper, evidence = fitter.best_hyper(fit.hyper, alone.linear)
    beside = replace(alone, hyper=hyper, evidence=evidence)
    left = what_is_left(fitter.covariance, beside, beside)
    return not is_structured(fitter.cells, need_of_structure(fitter, beside), left, inclusion)


def that_predict(search: Search, chosen: Fit, found: list[Change], physics: Fit,
                 inclusion: float) -> tuple[Fit, list[Change], Fit, HeldOut]:
    """
    Return the chosen set without effects that predict nothing on rows not seen, or are bent.

    Those are effects without which physics does as well there. Where structure is left, evidence
    measures it in units of the noise, so that an effect which imitates a hundredth of the misfit
    gains tens of log units: there an effect stays only if it predicts better by more than a
    standard error over the folds. Where none is left, an effect goes only if nothing is worse
    without it, with a discrepancy too; the last one only if the evidence for it needs a
    discrepancy besides.

    Beside structure a law that is `bent` goes too, not the last one: others may be named without
    it. Where dimensions are off as well, it is no muscle as it was described, and all stay for
    `verdict.judge` to refuse.
    """
    fitter = search.fitter
    held = held_out(fitter, physics, chosen)
    left = what_is_left(fitter.covariance, chosen, physics)
    structured = is_structured(fitter.cells, need_of_structure(fitter, chosen), left, inclusion)
    while found:
        for change in reversed(found):
            fewer = search.fit(change.undone(chosen.names), chosen.start, chosen.hyper)
            without = fitter.without_discrepancy(fewer)
            error = held_out(fitter, without, fewer)
            if structured:
                goes = as_good(error.squares, held.squares) or (
                    len(found) > 1 and _is_bent(physics, change) and not far(physics))
            else:
                goes = error.is_no_worse(held) and (
                    len(found) > 1 or fewer.white_posterior >= chosen.white_posterior)
            if goes:
                found = [other for other in found if other is not change]
                chosen, physics, held = fewer, without, error
                break
        else:
            break
    return chosen, found, physics, held


def _is_bent(physics: Fit, change: Change) -> bool:
    return any(key.startswith(f'{change.new}.') for key in bent(physics))


def as_good(squares: np.ndarray, best: np.ndarray) -> bool:
    """Return whether mean squares of folds are within a standard error of others (Breiman)."""
    more = squares - best
    return bool(more.sum() <= np.sqrt(len(more)) * np.std(more, ddof=len(more) > 1))
