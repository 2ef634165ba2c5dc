# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which effect is the model missing? Verdict, effects, ties, and what to measure next.

    result = diagnose(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)

The measurement is reduced once (`cells`); sets of effects are searched (`search`) under one
likelihood with a discrepancy in every model (`covariance`, `evidence`); `posterior` says what all
sets say together, `verdict` what that amounts to. This module passes it on and adds the numbers.
"""

from __future__ import annotations

from dataclasses import replace
import time
from typing import Any

import numpy as np
from scipy.special import softmax

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.data.reading import as_measurement
from fam_bundle_ros.data.trials import Offsets, trial_offsets
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.add import recommend
from fam_bundle_ros.discovery.cells import Cells, reduce
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.estimates import confounding, estimates, with_intervals
from fam_bundle_ros.discovery.evidence import Fit, Fitter
from fam_bundle_ros.discovery.held_out import (
    beyond_cells,
    held_out,
    held_out_physics,
    HeldOut,
    splits,
    squares_of_folds,
)
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.options import family, Options
from fam_bundle_ros.discovery.posterior import Change, changes, named, Posterior
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.search import Progress, Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.templates import describe
from fam_bundle_ros.discovery.verdict import (
    Artefact,
    DOUBTED,
    Finding,
    is_structured,
    judge,
    need_of_structure,
    small,
    what_is_left,
)
from fam_bundle_ros.discovery.words import next_experiment, not_named, notes_on, renamed, summarise
from fam_bundle_ros.model import Bundle, catalogue
from fam_bundle_ros.processes import on_one_core

#: Ties that are put to the test on held-out folds.
_TRIED = 24
#: Strains, and pressures, at which they are compared.
_POINTS = 24
#: Candidates of a ranking whose error is worked out without a discrepancy.
_TOLD = 6


@on_one_core
def diagnose(model: Bundle, measurement: Any, *, progress: Progress = None,
             choices: Choices | None = None) -> Diagnosis:
    """
    Find out whether a model is adequate, off in its parameters, or missing an effect.

    Parameters
    ----------
    model : Bundle
    measurement : Measurement, path, or DataFrame
    progress : callable, optional
        Called with a share from 0 to 1 and a word about what is being done.
    choices : Choices, optional
        How much unexplained structure is normal, the odds of a tie, and the like.

    Raises
    ------
    InputError
        For bad data, or where data and model have other motor units.

    Returns
    -------
    Diagnosis
    """
    begun = time.perf_counter()
    choices = choices or Choices()
    comparison = compare(model, as_measurement(measurement))
    data, offsets = _tared(comparison.measurement, comparison.residual)
    cells = reduce(model, data)
    fitter = Fitter(cells, Covariance(cells, choices.unexplained))
    search = Search(Options.of(model, cells, choices), fitter, progress).run()
    if progress:
        progress(0.9, 'weighing what is left')
    chosen, found = _best_of_ties(search, *named(search, search.best), choices)
    if not found:
        chosen, found = _believed(search, choices)
    physics = fitter.without_discrepancy(chosen)
    base = fitter.without_discrepancy(search.null) if found else physics
    likely = bool(found)
    chosen, found, physics, held = _that_foretell(search, chosen, found, physics,
                                                  choices.inclusion)
    if offsets is None and not data.is_static:
        offsets = _offsets_left(cells, physics)
    finding = judge(fitter, search.null, base, chosen, physics, found, held,
                    _artefacts(offsets, comparison.noise), choices.inclusion, likely)
    if finding.verdict == 'unexplained' and found:
        held = held_out(fitter, base, search.null)
    answer = found if finding.named else []
    final, joint = (physics, chosen) if finding.named else (base, search.null)
    posterior = Posterior.over_folds(search, chosen)
    ties = tuple(posterior.ties(answer, chosen, choices.odds))
    trades = tuple(posterior.trades(chosen, choices.odds, ties)) if answer else ()
    told = estimates(final, posterior if answer else None)
    best, recalibrated = _written(model, final, told), _written(model, base, estimates(base))
    if finding.verdict == 'adequate':
        best = model
    error = {name: rms(data.force - predict(bundle, data)) for name, bundle in
             (('recalibrated', recalibrated), ('best', best))}
    error = {'model': comparison.error_N, **error}
    beyond = beyond_cells(cells, final, error['best'] if final is not base else
                          error['recalibrated'])
    held = held.of_rows(beyond)
    before, leftover = (Leftover.of(fitter, fit, beside.hyper)
                        for fit, beside in ((base, search.null), (final, joint)))
    recommended = recommend(best, final, joint, held, fitter)
    foretelling = _foretelling(search, chosen, physics, choices) if finding.named else physics
    if foretelling is not physics:
        likely_set = search.fits[foretelling.names]
        recommended = recommend(
            _written(model, foretelling, estimates(foretelling, posterior)), foretelling,
            likely_set, held_out(fitter, foretelling, likely_set).of_rows(beyond), fitter)
    residual = data.force - predict(best, data)
    shapes = describe(cells, final)
    alike = {label for group in ties for label in group}.union(*(each.labels for each in trades))
    doubts = () if finding.verdict == 'unexplained' else not_named(posterior, chosen, alike)
    further = next_experiment(fitter, posterior, finding, answer, chosen, ties, shapes)
    return Diagnosis(
        verdict=finding.verdict, model=model, measurement=comparison.measurement,
        summary=summarise(finding, answer, found, ties, trades, base, shapes, error),
        comparison=comparison,
        effects=tuple(change.label for change in answer if not change.old),
        shapes=tuple(change.new for change in answer if not change.old),
        replaced={change.old: change.new for change in answer if change.old and change.new},
        removed=tuple(change.old for change in answer if not change.new),
        error_N=error, noise=noise_floor(data, residual),
        ranking=_ranking(search, posterior, answer, final, finding, beyond), tied=ties,
        located=comparison.located,
        next_experiment=further.words, next_protocol=further.protocol,
        parameters=tuple(told),
        moved={p.key: float(u) for p, u in zip(final.priors, final.u) if p.own},
        best=best, recalibrated=recalibrated, shapes_left=shapes,
        notes=(*data.notes, *finding.refusals, *finding.warnings, *doubts,
               *notes_on(cells, comparison.noise, base, final, held)),
        rows_left_out=int((cells.label < 0).sum()), confounding=confounding(final),
        held_out=held, recommended=recommended, leftover=leftover,
        leftover_before=before, likely=tuple(posterior.likely(joint.names)), traded=trades,
        ladder=_ladder(search, answer, error, base, held, beyond),
        seconds=time.perf_counter() - begun)


def _tared(data: Measurement, residual: np.ndarray) -> tuple[Measurement, Offsets | None]:
    """Return a map without what its trials differ by: no memory could make that."""
    offsets = trial_offsets(data, residual) if data.is_static else None
    if offsets is None:
        return data, None
    return replace(data, force=data.force - offsets.rows), offsets


def _offsets_left(cells: Cells, physics: Fit) -> Offsets | None:
    """Return what the trials of a log differ by where it is more than a part of the noise."""
    residual = cells.data.force - physics.model.predict(cells.motion)
    kept = cells.label >= 0
    found = trial_offsets(cells.data.select(kept), residual[kept])
    return found if found is not None and found.size > settings.VISIBLE * cells.noise else None


def _artefacts(offsets: Offsets | None, floor: NoiseFloor) -> list[Artefact]:
    found = []
    if offsets is not None:
        found.append(Artefact(str(offsets),
                              'tare the load cell before each trial and measure again'))
    if floor.hides_loops:
        found.append(Artefact(floor.note, 'log the time of each row and measure again'))
    return found


def _best_of_ties(search: Search, chosen: Fit, found: list[Change], worth: dict[str, float],
                  choices: Choices) -> tuple[Fit, list[Change]]:
    """
    Return the chosen set, or one as probable that foretells unseen rows better.

    Those within a standard error of the best on the folds (Breiman et al. 1984) are alike there;
    between strains that were measured they may be far apart. Of them the most probable one that is
    as near to what all of them foretell as any, within the noise of a row: a single set foretells
    best where it is nearest to the average over sets (Barbieri and Berger 2004).
    Only where structure is left: down to the noise folds can tell nothing that evidence does not.
    """
    fitter = search.fitter
    if not found:
        return chosen, found
    physics = fitter.without_discrepancy(chosen)
    if what_is_left(fitter.covariance, chosen, physics).total <= small(fitter.cells):
        return chosen, found
    near = _near(search, chosen.posterior, choices)
    # what is no part of an answer by itself is none beside a tie either
    earned = {fit.names: fit for fit in (named(search, fit)[0] for fit in near)}
    earned.pop(chosen.names, None)
    tried = [chosen, *sorted(earned.values(), key=lambda fit: -fit.posterior)]
    alone = [physics, *(fitter.without_discrepancy(fit) for fit in tried[1:])]
    squares = [squares_of_folds(fitter, fit) for fit in alone]
    least = min(squares, key=np.sum)
    alike = [k for k, each in enumerate(squares) if _as_good(each, least)]
    away = _away_from_all(fitter.cells, [alone[k].model for k in alike],
                          softmax([tried[k].posterior for k in alike]))
    best = next(tried[k] for k, square in zip(alike, away)
                if square <= away.min() + fitter.cells.noise ** 2)
    order = changes(search.options, best.names)
    return best, sorted(order, key=lambda change: -worth.get(change.label, 0.0))


def _near(search: Search, posterior: float, choices: Choices) -> list[Fit]:
    """Return sets that are at most so many times less probable than one, most probable first."""
    return [fit for fit in Posterior.of(search).fits
            if fit.posterior > posterior - np.log(choices.odds)][:_TRIED]


def _away_from_all(cells: Cells, models: list[Bundle], weights: np.ndarray) -> np.ndarray:
    """
    Return how far each model is from all of them, (k,), N^2: mean squares, weighted.

    At rest, at pressures of the cells and strains evenly over their range, measured or not.
    """
    pressure = cells.pressure[np.linspace(0, len(cells) - 1, _POINTS).astype(int)]
    strain = np.linspace(cells.strain.min(), cells.strain.max(), _POINTS)
    force = np.array([model.force(strain[:, None], pressure) for model in models])
    return np.array([np.mean((force - each) ** 2, axis=(1, 2)) @ weights for each in force])


def _foretelling(search: Search, chosen: Fit, physics: Fit, choices: Choices) -> Fit:
    """
    Return the set to foretell with: of those as probable as the best, of least error on folds.

    It may hold effects that earn no name, and other shapes of those that do. Only where structure
    is left, as in `_best_of_ties`, and where there are folds.
    """
    fitter = search.fitter
    if not splits(fitter.cells) or what_is_left(
            fitter.covariance, chosen, physics).total <= small(fitter.cells):
        return physics
    near = _near(search, search.best.posterior, choices)
    tried = [physics, *(fitter.without_discrepancy(fit) for fit in near
                        if fit.names != chosen.names)]
    return min(tried, key=lambda fit: held_out_physics(fitter, fit))


def _believed(search: Search, choices: Choices) -> tuple[Fit, list[Change]]:
    """
    Return the most probable set of effects that are likelier than not, where structure is needed.

    Beside a small error a smooth discrepancy is hardly less probable than an effect. But the one
    says that something is missing as the other does: it is no reason to name nothing. An effect
    in more than half of the posterior is (Barbieri and Berger 2004).
    """
    fitter, null = search.fitter, search.null
    left = what_is_left(fitter.covariance, null, fitter.without_discrepancy(null))
    if not is_structured(fitter.cells, need_of_structure(fitter, null), left, choices.inclusion):
        return null, []
    posterior = Posterior.of(search)
    for fit in posterior.fits:
        found = changes(search.options, fit.names)
        if all(posterior.of_label(change.label) > 0.5 for change in found):
            return fit, found
    return null, []


def _that_foretell(search: Search, chosen: Fit, found: list[Change], physics: Fit,
                   inclusion: float) -> tuple[Fit, list[Change], Fit, HeldOut]:
    """
    Return the chosen set without effects that foretell nothing on rows not seen.

    Those are effects without which physics does as well there. Where structure is left, evidence
    measures it in units of the noise, so that an effect which imitates a hundredth of the misfit
    gains tens of log units: there an effect stays only if it foretells better by more than a
    standard error over the folds. Where none is left, an effect goes only if nothing is worse
    without it, with a discrepancy too; the last one only if the evidence for it needs a
    discrepancy besides.
    """
    fitter = search.fitter
    held = held_out(fitter, physics, chosen)
    left = what_is_left(fitter.covariance, chosen, physics)
    structured = is_structured(fitter.cells, need_of_structure(fitter, chosen), left, inclusion)
    squares = squares_of_folds(fitter, physics)
    while found:
        for change in reversed(found):
            fewer = search.fit(change.undone(chosen.names), chosen.start, chosen.hyper)
            without = fitter.without_discrepancy(fewer)
            error, each = held_out(fitter, without, fewer), squares_of_folds(fitter, without)
            if structured:
                goes = _as_good(each, squares)
            else:
                goes = error.is_no_worse(held) and (
                    len(found) > 1 or fewer.white_posterior >= chosen.white_posterior)
            if goes:
                found = [other for other in found if other is not change]
                chosen, physics, held, squares = fewer, without, error, each
                break
        else:
            break
    return chosen, found, physics, held


def _as_good(squares: np.ndarray, best: np.ndarray) -> bool:
    """Return whether mean squares of folds are within a standard error of others (Breiman)."""
    more = squares - best
    return bool(more.sum() <= np.sqrt(len(more)) * np.std(more, ddof=len(more) > 1))


def _written(model: Bundle, fit: Fit, told: list) -> Bundle:
    """Return a fitted model that says in its name what it is."""
    had = {effect.name for effect in model.effects}
    new = [effect.name for effect in fit.model.effects if effect.name not in had]
    gone = [name for name in had if name not in {e.name for e in fit.model.effects}]
    words = [*new, *(f'without_{name}' for name in gone)] or ['recalibrated']
    error = float(np.sqrt(np.mean(fit.residual ** 2)))
    return with_intervals(fit.model.named(renamed(model.name, words)), told, error)


def _ranking(search: Search, posterior: Posterior, answer: list[Change], final: Fit,
             finding: Finding, beyond: float) -> tuple[Candidate, ...]:
    """Return every effect that was tried with the best set that holds it; named ones first."""
    fitter = search.fitter
    most = DOUBTED if finding.warnings or finding.refusals else 1.0
    most = 0.5 if finding.refusals or (finding.verdict == 'unexplained') else most
    chosen = {change.label: change for change in answer}
    order = [*chosen, *sorted((label for label in posterior.labels() if label not in chosen),
                              key=lambda label: -posterior.of_label(label))]
    entries = []
    for place, label in enumerate(order):
        best = posterior.best_with(label)
        if best is None:
            continue
        fit, change = best
        if label in chosen:
            fit, change = final, chosen[label]
        elif place < max(_TOLD, len(chosen) + 2):
            fit = fitter.without_discrepancy(fit)
        square = np.average(fit.residual ** 2, weights=fitter.cells.count)
        error = float(np.hypot(np.sqrt(square), beyond))
        name = change.name
        own = [e for e in estimates(fit) if e.key.startswith(f'{name}.')] if change.new else []
        probability = posterior.of_label(label)
        law = catalogue.available().get(name)
        entries.append(Candidate(
            label, name, family(name), min(probability, most), error,
            search.best.posterior - best[0].posterior, tuple(own),
            law.signature if law else '', replaces=change.old if change.new else '',
            removes=not change.new))
    return tuple(entries)


def _ladder(search: Search, answer: list[Change], error: dict[str, float], base: Fit,
            held: HeldOut, beyond: float) -> list[dict[str, Any]]:
    """Return the error after each step, on all rows and on folds left out."""
    fitter = search.fitter

    def square(fit: Fit) -> float:
        return float(np.average(fit.residual ** 2, weights=fitter.cells.count))

    def step(words: str, fit: Fit) -> dict[str, Any]:
        return {'step': words, 'error_N': float(np.hypot(np.sqrt(square(fit)), beyond)),
                'held_out_N': float(np.hypot(held_out_physics(fitter, fit), beyond))}

    steps = [{'step': 'model', 'error_N': error['model'], 'held_out_N': error['model']},
             {**step('recalibrated', base), 'error_N': error['recalibrated']}]
    names, left = search.options.own, list(answer)
    while len(left) > 1:
        # The change that takes most of the error first: each step shows what it brings.
        tried = [(change, fitter.without_discrepancy(search.fit(_after(names, change))))
                 for change in left]
        change, fit = min(tried, key=lambda pair: square(pair[1]))
        steps.append(step(_in_words(change), fit))
        names = _after(names, change)
        left.remove(change)
    for change in left:
        steps.append({'step': _in_words(change), 'error_N': error['best'],
                      'held_out_N': held.physics})
    return steps


def _after(names: tuple[str, ...], change: Change) -> tuple[str, ...]:
    """Return the effects of a model after a change."""
    return tuple(sorted({*(n for n in names if n != change.old), change.new} - {''}))


def _in_words(change: Change) -> str:
    return f'+ {change.new}' if change.new else f'- {change.old}'
