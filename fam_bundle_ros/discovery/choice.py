# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Choose the answer among the fitted sets of effects, and the set that predicts best.

The evidence compares the misfit with the noise; the cross-validation error (`held_out`) is in N.
"""

from __future__ import annotations

import numpy as np
from scipy.special import softmax

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells, negligible
from fam_bundle_ros.discovery.estimates import is_dead
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.held_out import (
    held_out,
    held_out_physics,
    HeldOut,
    squares_of_folds,
)
from fam_bundle_ros.discovery.options import Change, Names
from fam_bundle_ros.discovery.posterior import named, Posterior
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.verdict import (
    implausible_constants,
    implausible_geometry,
    leaves_structure,
    remaining_discrepancy,
)
from fam_bundle_ros.model import Bundle

#: Most sets of nearly equal probability that are compared by cross-validation.
_TRIED = 24
#: Number of strains, and of pressures, at which the predictions of these sets are compared.
_POINTS = 24


def best_of_ties(search: Search, chosen: Fit, found: list[Change], loss: dict[str, float],
                 ) -> tuple[Fit, list[Change]]:
    """
    Return the chosen set, or a set of similar probability that predicts held-out folds better.

    Sets whose cross-validation error is at most the lowest plus its standard error are equal
    (Breiman et al. 1984), but their predictions between the measured strains may differ. Of these
    sets, take the most probable one whose distance to their weighted average is the smallest, up
    to the noise of a row: the single set closest to the average predicts best (Barbieri and
    Berger 2004). The most probable one has the fewest wrong effects, as far as probabilities
    tell. If no structure is left in the residual, folds give no information beyond the evidence:
    return the `plainest` set.

    Parameters
    ----------
    found : list of Change
        Changes of ``chosen`` against the model as given.
    loss : dict of str to float
        Drop of the log posterior without each change, by label; sorts the changes returned.
    """
    fitter = search.fitter
    if not found:
        return chosen, found
    physics = fitter.without_discrepancy(chosen)
    if not folds_tell(search, chosen, physics):
        return plainest(search, chosen, found)
    # remove the weak effects of each set, as was done for the chosen set
    reduced = {fit.names: fit for fit in (
        named(search, fit)[0] for fit in _near(search, chosen.posterior))}
    reduced.pop(chosen.names, None)
    told = Posterior.over_folds(search, chosen)
    tried = sorted([chosen, *reduced.values()],
                   key=lambda fit: (round(told.expected_wrong(fit), 3), -fit.posterior))
    alone = [physics if fit is chosen else fitter.without_discrepancy(fit) for fit in tried]
    squares = [squares_of_folds(fitter, fit) for fit in alone]
    least = min(squares, key=np.sum)
    alike = [k for k, each in enumerate(squares)
             if np.sum(each) <= np.sum(least) + standard_error(least)]
    away = mean_square_distance(fitter.cells, [alone[k].model for k in alike],
                                softmax([tried[k].posterior for k in alike]))
    best = next(tried[k] for k, square in zip(alike, away)
                if square <= away.min() + fitter.cells.noise ** 2)
    order = search.options.changes(best.names)
    return best, sorted(order, key=lambda change: -loss.get(change.label, 0.0))


def folds_tell(search: Search, chosen: Fit, physics: Fit) -> bool:
    """
    Return whether a set leaves an error that held-out folds can tell from that of another set.

    It is structure that is visible in the noise, however small beside the largest force, or an
    error that is not negligible.
    """
    left = remaining_discrepancy(search.fitter.covariance, chosen, physics)
    return (left.total > negligible(search.fitter.cells)
            or leaves_structure(search, chosen, physics))


def plainest(search: Search, chosen: Fit, found: list[Change]) -> tuple[Fit, list[Change]]:
    """
    Return the chosen set with simpler shapes of its effects: fewer parameters, fewer dead ones.

    A dead parameter (its posterior is its prior) does not lower the evidence, so the evidence
    cannot reject a shape that has one. A simpler shape is taken only if its cross-validation
    error is not larger by more than the noise can hide.
    """
    fitter, labels = search.fitter, [change.label for change in found]
    hidden = (settings.VISIBLE * fitter.cells.noise) ** 2
    physics = fitter.without_discrepancy(chosen)
    least = _dead(physics, found)
    for fit in _near(search, chosen.posterior) if least else ():
        order = search.options.changes(fit.names)
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
    """Return the number of dead parameters of the effects that were found."""
    new = {change.new for change in found}
    return sum(prior.key.split('.')[0] in new
               for prior, dead in zip(physics.priors, is_dead(physics)) if dead)


def _near(search: Search, posterior: float) -> list[Fit]:
    """Return the sets within the odds of a tie of a log posterior, most probable first."""
    least = posterior - np.log(search.options.choices.odds)
    return [fit for fit in Posterior.of(search).fits if fit.posterior > least][:_TRIED]


def mean_square_distance(cells: Cells, models: list[Bundle], weights: np.ndarray) -> np.ndarray:
    """
    Return the weighted mean square distance of each model's force to the others', (k,), N^2.

    Compared at rest, at pressures of the cells and at strains evenly spaced over their range.

    Parameters
    ----------
    weights : ndarray, shape (k,)
        Probabilities of the models.
    """
    pressure = cells.pressure[np.linspace(0, len(cells) - 1, _POINTS).astype(int)]
    strain = np.linspace(cells.strain.min(), cells.strain.max(), _POINTS)
    force = np.array([model.force(strain[:, None], pressure) for model in models])
    return np.array([np.mean((force - each) ** 2, axis=(1, 2)) @ weights for each in force])


def likelier_than_not(search: Search, chosen: Fit, found: list[Change],
                      ) -> tuple[Fit, list[Change]]:
    """
    Return the most probable set with these changes whose effects each are likelier than not.

    It is used where the chosen set, which may be the model as given, leaves structure, but no
    further effect has enough evidence: a smooth discrepancy can be nearly as probable as an effect
    that is small, or that shows at a few speeds only, though both say that something is missing.
    One half is the limit of the median probability model (Barbieri and Berger 2004).
    Similar effects share the probability, so none may reach one half: then, if nothing else was
    found and it is likelier than not that something is missing, return the most probable set,
    within the odds of the chosen one, whose effects explain the structure without a discrepancy.

    Parameters
    ----------
    found : list of Change
        Changes of ``chosen``, most important first; empty for the model as given.
    """
    fitter = search.fitter
    if not leaves_structure(search, chosen, fitter.without_discrepancy(chosen)):
        return chosen, found
    posterior, changes = Posterior.of(search), search.options.changes
    for fit in posterior.fits:
        added = [change for change in changes(fit.names) if change not in found]
        if all(posterior.of_label(change.label) > 0.5 for change in changes(fit.names)):
            if set(found) < set(changes(fit.names)):
                return fit, [*found, *added]
            break
    missing = 1.0 - posterior.weights[[fit.names for fit in posterior.fits].index(
        search.null.names)]
    for fit in () if found or missing <= 0.5 else _near(search, chosen.posterior):
        alone = fitter.beside_discrepancy(fitter.without_discrepancy(fit), fit.hyper)
        if changes(fit.names) and not leaves_structure(search, alone, alone):
            return fit, changes(fit.names)
    return chosen, found


def drop_unpredictive(search: Search, chosen: Fit, found: list[Change], physics: Fit,
                      ) -> tuple[Fit, list[Change], Fit, HeldOut]:
    """
    Return the chosen set without effects that do not improve the prediction of held-out folds.

    Where the residual still has structure, the evidence compares it with the small noise, so an
    effect that imitates one percent of the misfit gains tens of log units. There an effect stays
    only if it lowers the cross-validation error by more than one standard error over the folds,
    and all effects only if they do so together: of two, each may undo what the other does.
    Without structure, an effect is removed only if no kind of fold gets worse, with and without
    the discrepancy; the last effect only if the evidence for it depends on a discrepancy.

    An effect that without a discrepancy changes the force by too little to be seen, and has no
    evidence there, is removed: its evidence was that of another value, with the discrepancy.
    (Without it other constants may give the same force, but at values that are unlikely.)

    Where structure is left, an effect with implausible constants is removed as well, unless it is
    the last. If the geometry is implausible too, the model describes another muscle: all effects
    stay, for `verdict.judge` to refuse.

    Parameters
    ----------
    chosen, physics : Fit
        The set, fitted with and without a discrepancy.
    found : list of Change
        Changes of the set, most important first.
    """
    fitter = search.fitter
    held = held_out(fitter, physics, chosen)
    structured = folds_tell(search, chosen, physics)
    while found:
        for gone in [[change] for change in reversed(found)] + [found] * structured:
            fewer = search.fit(_undone(gone, chosen.names), chosen.start, chosen.hyper)
            without = fitter.without_discrepancy(fewer)
            error = held_out(fitter, without, fewer)
            idle = fewer.white_posterior >= chosen.white_posterior
            if structured:
                goes = within_standard_error(error.squares, held.squares) or (
                    len(found) > len(gone) and _is_implausible(physics, gone[0])
                    and not implausible_geometry(physics))
            else:
                goes = error.is_no_worse(held) and (len(found) > 1 or idle)
            if goes or idle and not _is_seen(fitter.cells, physics, without):
                found = [change for change in found if change not in gone]
                chosen, physics, held = fewer, without, error
                break
        else:
            break
    return chosen, found, physics, held


def _is_seen(cells: Cells, one: Fit, other: Fit) -> bool:
    """Return whether two fits differ by as much as evidence of `settings.LEAST_LOSS` requires."""
    # a difference of chi-squared x gives a log likelihood ratio of at most x / 2
    square = (one.residual - other.residual) ** 2 / cells.variance
    return bool(np.sum(square) > 2.0 * settings.LEAST_LOSS)


def _undone(changes: list[Change], names: Names) -> Names:
    """Return the effects of a set without some of its changes."""
    for change in changes:
        names = change.undone(names)
    return names


def _is_implausible(physics: Fit, change: Change) -> bool:
    return any(key.startswith(f'{change.new}.') for key in implausible_constants(physics))


def within_standard_error(squares: np.ndarray, best: np.ndarray) -> bool:
    """Return whether mean squares of folds, (k,), are within a standard error of the best."""
    more = squares - best
    return bool(more.sum() <= standard_error(more))


def standard_error(squares: np.ndarray) -> float:
    """Return the standard error of the sum of contributions of folds, (k,)."""
    return float(np.sqrt(len(squares)) * np.std(squares, ddof=len(squares) > 1))
