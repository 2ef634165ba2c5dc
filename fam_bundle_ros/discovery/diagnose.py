# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which effect is the model missing? Verdict, effects, ties, and what to measure next.

    result = diagnose(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)

The measurement is reduced to cells (`cells`). Sets of effects are searched (`search`) with one
likelihood, which has a discrepancy in every model (`covariance`, `linear`). `posterior` averages
over the sets, `verdict` gives the verdict. This module runs these steps and collects the results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import time
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.trial_offsets import Offsets, trial_offsets
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.add import recommend
from fam_bundle_ros.discovery.artefacts import artefacts
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.change_point import two_models, TwoModels
from fam_bundle_ros.discovery.choice import (
    best_of_ties,
    drop_unpredictive,
    likelier_than_not,
)
from fam_bundle_ros.discovery.compare import compare, Comparison, floor_of
from fam_bundle_ros.discovery.estimates import confounding, estimates, with_intervals
from fam_bundle_ros.discovery.fitter import Fit
from fam_bundle_ros.discovery.held_out import beyond_cells, held_out, held_out_physics, HeldOut
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.lookalikes import late_or_lagging
from fam_bundle_ros.discovery.options import Change, family, Options
from fam_bundle_ros.discovery.posterior import named, Posterior
from fam_bundle_ros.discovery.predict import predict, stiffness
from fam_bundle_ros.discovery.reading import measurement_of
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.search import Progress, Search
from fam_bundle_ros.discovery.sensor_jump import Jump, sensor_jump
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.templates import describe
from fam_bundle_ros.discovery.verdict import Finding, judge, shown_probability
from fam_bundle_ros.discovery.words import (
    error_of_used,
    next_experiment,
    not_named,
    notes_on,
    renamed,
    summarise,
)
from fam_bundle_ros.model import Bundle, catalogue
from fam_bundle_ros.processes import on_one_core

#: Candidates at the top of a ranking whose error is computed by a refit without discrepancy.
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
        Called with a share from 0 to 1 and the name of the current step.
    choices : Choices, optional
        Settings: how much unexplained structure is normal, the odds of a tie, and others.

    Raises
    ------
    InputError
        For bad data, or if data and model have different motor units.

    Returns
    -------
    Diagnosis
    """
    begun = time.perf_counter()
    choices = choices or Choices()
    given = measurement_of(model, measurement)
    searched = Searched.of(model, given, choices, progress)
    comparison, data, search = searched.comparison, searched.data, searched.search
    fitter, cells = search.fitter, search.fitter.cells
    if progress:
        progress(0.9, 'weighing what is left')
    judged = searched.alone()
    chosen, found, physics, base, held, finding = judged
    answer = found if finding.named else []
    final = judged.final
    joint = chosen if finding.named else search.null
    posterior = Posterior.over_folds(search, chosen)
    ties = tuple(posterior.ties(answer, chosen, choices.odds))
    trades = tuple(posterior.trades(chosen, choices.odds, ties)) if answer else ()
    parameters = estimates(final, posterior if answer else None)
    best, recalibrated = _written(model, final, parameters), _written(model, base, estimates(base))
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
    noise = floor_of(data, data.force - predict(best, data), stiffness(best, data))
    shapes = describe(cells, final)
    alike = {label for group in ties for label in group}.union(*(each.labels for each in trades))
    doubts = () if finding.verdict == 'unexplained' else not_named(posterior, chosen, alike)
    further = next_experiment(fitter, posterior, finding, answer, chosen, ties, trades, shapes,
                              base)
    return Diagnosis(
        verdict=finding.verdict, model=model, measurement=comparison.measurement,
        summary=summarise(finding, answer, found, ties, trades, base, shapes,
                          {**error, 'noise': noise.value,
                           'used': error_of_used(cells, best, error['best'])}),
        comparison=comparison,
        effects=tuple(change.label for change in answer if not change.old),
        shapes=tuple(change.new for change in answer if not change.old),
        replaced={change.old: change.new for change in answer if change.old and change.new},
        removed=tuple(change.old for change in answer if not change.new),
        error_N=error, noise=noise,
        ranking=_ranking(search, posterior, answer, final, finding, beyond), tied=ties,
        located=comparison.located,
        next_experiment=further.words, next_protocol=further.protocol,
        parameters=tuple(parameters),
        moved={p.key: float(u) for p, u in zip(final.priors, final.u) if p.own},
        best=best, recalibrated=recalibrated,
        shapes_left=shapes if finding.verdict in ('unexplained', 'partial') else (),
        notes=tuple(dict.fromkeys(
            (*data.notes, *finding.notes, *late_or_lagging(cells, final, answer), *doubts,
             *notes_on(cells, comparison.noise, base, final, held,
                       afresh=given.remembers and not searched.data.remembers)))),
        rows_left_out=int((cells.label < 0).sum()), confounding=confounding(final),
        held_out=held, recommended=recommended, leftover=leftover,
        leftover_before=before, likely=tuple(posterior.likely(joint.names)), traded=trades,
        ladder=_ladder(search, answer, error, base, held, beyond),
        artefacts=tuple(artefact.words for artefact in finding.artefacts),
        seconds=time.perf_counter() - begun)


class Judged(NamedTuple):
    """
    A set of effects with its verdict.

    Attributes
    ----------
    chosen, physics : Fit
        The set, fitted with and without a discrepancy.
    found : list of Change
    base : Fit
        The model as given, fitted without a discrepancy.
    held : HeldOut
        Of the set; of the model as given if the verdict refuses it.
    finding : Finding
    """

    chosen: Fit
    found: list[Change]
    physics: Fit
    base: Fit
    held: HeldOut
    finding: Finding

    @property
    def final(self) -> Fit:
        """The set without a discrepancy, or the model as given if the verdict refuses the set."""
        return self.physics if self.finding.named else self.base


@dataclass(frozen=True)
class Searched:
    """
    A measurement and the search for the effects that it shows.

    Attributes
    ----------
    comparison : Comparison
        With the model as given.
    data : Measurement
        Without offsets between the trials of a map.
    offsets : Offsets or None
        These offsets.
    search : Search
    jump : Jump or None
        That was subtracted from the measurement.
    """

    comparison: Comparison
    data: Measurement
    offsets: Offsets | None
    search: Search
    jump: Jump | None = None

    @classmethod
    def of(cls, model: Bundle, measurement: Measurement, choices: Choices,
           progress: Progress = None, lengths: int = 1) -> Searched:
        """
        Return the finished search; ``lengths`` as in `Options.of`.

        Where the clock runs on between trials, the muscle may remember the trial before, or not
        (it was set anew): the search is that of the assumption under which the data are more
        probable. If a reading jumps during the log, this is subtracted and the search begins anew.
        """
        told = 0.0

        def ahead(share: float, words: str) -> None:
            nonlocal told
            if progress and told < share < 0.9:  # a second search begins anew
                told = share
                progress(share, words)

        def begun(data: Measurement) -> Searched:
            return cls._begun(model, data, choices, ahead, lengths)

        found = cls._likeliest(measurement, begun)
        jump = sensor_jump(found.search)
        if jump and not (found.change and found.change.log_odds > jump.log_odds):
            found = replace(begun(jump.undone(found.comparison.measurement)), jump=jump)
            found.search.run()
        return found

    @staticmethod
    def _likeliest(measurement: Measurement, begun: Callable[[Measurement], Searched]
                   ) -> Searched:
        """Return the finished search with the likelier past of the trials."""
        found = begun(measurement)
        if not measurement.remembers:
            found.search.run()
            return found
        # sets with one change are often enough to tell, and much faster than a whole search
        found = _likelier_past(found, measurement, begun)
        found.search.run()
        other = _likelier_past(found, measurement, begun, exchange=True)
        if other is not found:
            other.search.run()
        return max(found, other, key=lambda each: each.search.best.posterior)

    @classmethod
    def _begun(cls, model: Bundle, measurement: Measurement, choices: Choices,
               progress: Progress, lengths: int) -> Searched:
        comparison = compare(model, measurement, choose_past=False)
        data, offsets = _tared(comparison.measurement, comparison.residual)
        options = Options.of(model, reduce(model, data), choices, lengths)
        return cls(comparison, data, offsets, Search(options, progress))

    @cached_property
    def change(self) -> TwoModels | None:
        """A change of the model during the log that is more probable than every set of effects."""
        return two_models(self.search)

    def alone(self) -> Judged:
        """
        Choose the set that explains this measurement, and judge it.

        Where neither it nor what cross-validation leaves of it is an answer, the whole set comes
        nearest. Effects that do not reduce the error of rows are no answer where the model alone,
        recalibrated, leaves noise.
        """
        search = self.search
        chosen, found = likelier_than_not(
            search, *best_of_ties(search, *named(search, search.best)))
        likely = bool(found)
        physics = search.fitter.without_discrepancy(chosen)
        judged = self._judged(*drop_unpredictive(search, chosen, found, physics), likely)
        if judged.finding.worse:
            without = self.with_set(search.null)
            if without.finding.verdict in ('adequate', 'recalibrate'):
                return without
        if judged.finding.verdict == 'unexplained':
            if len(judged.found) < len(found):
                whole = self.with_set(chosen)
                judged = judged if whole.finding.named else whole
            return self._nearest(judged)
        return judged

    def _nearest(self, judged: Judged) -> Judged:
        """Return a refused set, or the single change that leaves less, for the same evidence."""
        search = self.search
        single = [fit for fit in search.fits.values()
                  if len(search.options.changes(fit.names)) == 1]
        if not single:
            return judged
        best = max(single, key=lambda fit: fit.white_posterior)
        log_odds = search.best.posterior - best.posterior
        alone = self.with_set(best, ['a smooth discrepancy is '
                                     f'{np.exp(min(log_odds, 99.0)):.2g} times as probable'])
        closer = rms(alone.physics.residual) < rms(judged.physics.residual)
        # what drifts or swings beside it would be told in its place
        return alone if closer and not alone.finding.artefacts else judged

    def with_set(self, chosen: Fit, refusals: Sequence[str] = ()) -> Judged:
        """Judge a given set; ``refusals`` are reasons against it that are known before."""
        found = self.search.options.changes(chosen.names)
        physics = self.search.fitter.without_discrepancy(chosen)
        held = held_out(self.search.fitter, physics, chosen)
        return self._judged(chosen, found, physics, held, bool(found), refusals)

    def _judged(self, chosen: Fit, found: list[Change], physics: Fit, held: HeldOut,
                likely: bool, refusals: Sequence[str] = ()) -> Judged:
        fitter, null = self.search.fitter, self.search.null
        base = fitter.without_discrepancy(null) if likely else physics
        beside = ((self.change.artefact,) if self.change else
                  artefacts(fitter, chosen, physics, self.comparison.noise, self.offsets))
        if self.change:
            refusals = (*refusals, self.change.artefact.words)
        finding = judge(self.search, base, chosen, physics, found, held, beside, likely,
                        self.comparison.slips, refusals,
                        (self.jump.words,) if self.jump else ())
        if finding.verdict == 'unexplained' and found:
            held = held_out(fitter, base, null)
        return Judged(chosen, found, physics, base, held, finding)


def _likelier_past(found: Searched, measurement: Measurement,
                   begun: Callable[[Measurement], Searched], exchange: bool = False) -> Searched:
    """
    Return a search, or one with the other assumption on the trial before, if that is likelier.

    Compared by the most probable sets: those with a memory that were fitted so far, fitted again
    under the other assumption and, after a whole search, exchanged there effect by effect. The
    other assumption is that the memory starts anew with each trial or, if this is that of the
    search, that the muscle remembers.
    """
    likely = found.search.with_memory()
    if not likely:
        return found
    other = begun(measurement.afresh() if found.data.remembers else measurement)
    # a lag of a pressure that changes between the trials only is then without influence
    other.search.near([fit for fit in likely
                       if set(fit.names) <= set(other.search.options.effects)], exchange)
    gain = other.search.best.posterior - found.search.best.posterior
    return other if gain > settings.LEAST_LOSS else found


def _tared(data: Measurement, residual: np.ndarray) -> tuple[Measurement, Offsets | None]:
    """Return a map without the offsets between its trials, which a static model cannot explain."""
    offsets = trial_offsets(data, residual) if data.is_static else None
    if offsets is None:
        return data, None
    return replace(data, force=data.force - offsets.rows), offsets


def _written(model: Bundle, fit: Fit, parameters: list) -> Bundle:
    """Return a fitted model with intervals and error, and its changes in its name."""
    had = {effect.name for effect in model.effects}
    new = [effect.name for effect in fit.model.effects if effect.name not in had]
    gone = [name for name in had if name not in {e.name for e in fit.model.effects}]
    words = [*new, *(f'without_{name}' for name in gone)] or ['recalibrated']
    return with_intervals(fit.model.named(renamed(model.name, words)), parameters,
                          rms(fit.residual))


def _ranking(search: Search, posterior: Posterior, answer: list[Change], final: Fit,
             finding: Finding, beyond: float) -> tuple[Candidate, ...]:
    """Return every effect that was tried, with its most probable set; named effects first."""
    fitter = search.fitter
    chosen = {change.label: change for change in answer}
    order = [*chosen, *sorted((label for label in posterior.labels() if label not in chosen),
                              key=lambda label: -posterior.of_label(label))]
    entries = []
    for place, label in enumerate(order):
        best, change = posterior.best_with(label)
        fit = best
        if label in chosen:
            fit, change = final, chosen[label]
        elif place < max(_TOLD, len(chosen) + 2):
            fit = fitter.without_discrepancy(best)
        error = _error_of_rows(search, fit, beyond)
        name = change.name
        own = [e for e in estimates(fit) if e.key.startswith(f'{name}.')] if change.new else []
        probability = shown_probability(finding, label, posterior.of_label(label),
                                        label in chosen)
        law = catalogue.available().get(name)
        beside = [] if label in chosen else [
            other.label for other in search.options.changes(best.names) if other != change]
        entries.append(Candidate(
            label, name, family(name), probability, error,
            search.best.posterior - best.posterior, tuple(own),
            law.signature if law else '', replaces=change.old if change.new else '',
            removes=not change.new, beside=tuple(beside)))
    return tuple(entries)


def _error_of_rows(search: Search, fit: Fit, beyond: float) -> float:
    """Return the error of a fit with the scatter of rows about their cells added, N rms."""
    return float(np.hypot(np.sqrt(search.fitter.cells.mean_square(fit.residual)), beyond))


def _ladder(search: Search, answer: list[Change], error: dict[str, float], base: Fit,
            held: HeldOut, beyond: float) -> list[dict[str, Any]]:
    """Return the error after each change, on all rows and on held-out folds."""
    fitter = search.fitter

    def step(words: str, fit: Fit) -> dict[str, Any]:
        return {'step': words, 'error_N': _error_of_rows(search, fit, beyond),
                'held_out_N': float(np.hypot(held_out_physics(fitter, fit), beyond))}

    steps = [{'step': 'model', 'error_N': error['model'], 'held_out_N': error['model']},
             {**step('recalibrated', base), 'error_N': error['recalibrated']}]
    names, left = search.options.own, list(answer)
    while len(left) > 1:
        # the change that reduces the error most comes first
        tried = [(change, fitter.without_discrepancy(search.fit(change.done(names))))
                 for change in left]
        change, fit = min(tried, key=lambda pair: fitter.cells.mean_square(pair[1].residual))
        steps.append(step(_in_words(change), fit))
        names = change.done(names)
        left.remove(change)
    for change in left:
        steps.append({'step': _in_words(change), 'error_N': error['best'],
                      'held_out_N': held.physics})
    return steps


def _in_words(change: Change) -> str:
    return f'+ {change.new}' if change.new else f'- {change.old}'
