# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which effect is the model missing? Verdict, effects, ties, and what to measure next.

    result = diagnose(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)

The search (`search`) refits every candidate together with the model's own parameters on blocks of
neighbours; what it chose is confirmed on every row. This module turns the search into words.
"""

from __future__ import annotations

from dataclasses import dataclass
import time
from typing import Any

import numpy as np

from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.experiment import best_experiment, without_force
from fam_bundle_ros.discovery.fit import Fit, held_out_error, Problem
from fam_bundle_ros.discovery.grouping import rms
from fam_bundle_ros.discovery.measurement import Measurement, read_measurement
from fam_bundle_ros.discovery.noise import noise_floor
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.search import Progress, Scale, Search
from fam_bundle_ros.discovery.structure import surface_share
from fam_bundle_ros.discovery.templates import describe, Described, nominal_fit
from fam_bundle_ros.discovery.uncertainty import confounding, estimates
from fam_bundle_ros.model import Bundle, catalogue

#: Rows that the search works on; longer logs are averaged down to about this many.
SEARCH_ROWS = 3000
#: Effects whose scores differ by less cannot be told apart (odds of 20 to 1).
TIE = 6.0
#: A shape in what is left counts from this gain in chi2 (some four hundred shapes are tried).
_SHAPE_GATE = 25.0
#: ... and from this size, in noise standard deviations.
_SHAPE_SIZE = 0.3


def diagnose(model: Bundle, measurement: Any, *, progress: Progress = None,
             rows: int = SEARCH_ROWS) -> Diagnosis:
    """
    Find out whether a model is adequate, off in its parameters, or missing an effect.

    Parameters
    ----------
    model : Bundle
    measurement : Measurement, path, or DataFrame
    progress : callable, optional
        Called with a share from 0 to 1 and a word about what is being done.
    rows : int
        Rows that the search works on.

    Raises
    ------
    InputError
        For bad data, or where data and model have other motor units.

    Returns
    -------
    Diagnosis
    """
    begun = time.perf_counter()
    data = measurement if isinstance(measurement, Measurement) else read_measurement(measurement)
    comparison = compare(model, data)
    data = comparison.measurement
    problem = Problem(data, model, largest=rows)
    search = Search(problem, model, cand.candidates(model, data), progress).run()
    if progress:
        progress(0.9, 'weighing what is left')
    finding = _verdict(problem, search)
    full = problem if problem.block == 1 else Problem(data, model, largest=len(data))
    base = confirm(full, search.fit(()))
    chosen = search.chosen if finding.named else []
    final = base if not chosen else confirm(full, search.fit(chosen))
    scale = Scale.of(full, final)
    ranking = _ranking(search, full, final, chosen)
    tied = _ties(search, chosen)
    floor = noise_floor(data.select(full.weight), final.residual[full.weight])
    kept = full.weight
    keep_nominal = finding.verdict == 'adequate'
    return Diagnosis(
        verdict=finding.verdict, summary=_summary(finding, search, ranking, tied, base),
        model=model, measurement=data, comparison=comparison,
        effects=tuple(cand.head(name) for name in chosen), shapes=tuple(chosen),
        error_N={'model': rms(comparison.residual[kept]), 'recalibrated': rms(
            base.residual[kept]), 'best': rms(final.residual[kept])},
        noise=floor, ranking=ranking, tied=tied, located=comparison.located,
        next_experiment=_next(problem, search, finding, tied, data),
        parameters=tuple(estimates(final, scale)), moved=final.moved(),
        best=model if keep_nominal else with_intervals(final, scale),
        recalibrated=base.model, shapes_left=tuple(finding.left.templates),
        notes=(data.notes + _notes(data, floor, base, final)
               + _reshaped(problem, search, finding)),
        rows_left_out=int((~kept).sum()), confounding=confounding(final, scale),
        ladder=_ladder(full, model, search, chosen), seconds=time.perf_counter() - begun)


@dataclass
class _Finding:
    verdict: str
    left: Described
    explained: float = 1.0

    @property
    def named(self) -> bool:
        """Whether the effects of the search are part of the answer."""
        return self.verdict in ('missing_effect', 'partial')


# --- verdict -----------------------------------------------------------------------------------

def _verdict(problem: Problem, search: Search) -> _Finding:
    base, final = search.fit(()), search.fit(search.chosen)
    left = describe(problem, final)
    structured = _structured(problem, final, left)
    if not search.chosen:
        if structured:
            return _Finding('unexplained', left, 0.0)
        return _Finding('recalibrate' if _moved(problem, search) else 'adequate', left)
    before = search.excess(())
    explained = 1.0 - search.excess(search.chosen) / max(before, 1e-9)
    if not structured:
        return _Finding('missing_effect', left, explained)
    shape = _outsider(problem, search, final)
    if shape is not None:
        return _Finding('unexplained', shape, explained)
    if explained < 0.7:
        return _Finding('unexplained', describe(problem, base), explained)
    return _Finding('partial', left, explained)


def _structured(problem: Problem, fit: Fit, left: Described) -> bool:
    """Return whether what a fit leaves has a shape, or comes back at each visit."""
    if left.templates and left.templates[0].gain > _SHAPE_GATE and (
            left.templates[0].size_N > _SHAPE_SIZE * problem.row_noise):
        return True
    kept = problem.weight
    if rms(fit.residual[kept]) < np.hypot(problem.noise, _SHAPE_SIZE * problem.row_noise):
        return False
    # noise, however coloured, cannot be foretold from strain, pressure and direction
    return surface_share(problem, fit) > 0.25


def _moved(problem: Problem, search: Search) -> bool:
    """Return whether the refit of the model's own parameters is more than noise."""
    base = search.fit(())
    scale = Scale.of(problem, base)
    nominal = problem.chi2(problem.residual(search.model))
    gain = (nominal - base.chi2) / (scale.inflation * scale.tau) - base.prior
    return bool(gain > 10.0 + 2.0 * len(base.terms))


def _outsider(problem: Problem, search: Search, final: Fit) -> Described | None:
    """
    Return a plain shape that beats the chosen effects and that their families cannot make.

    A library without the right shape takes the nearest one; a shape from outside that explains
    more with less is the sign of it.
    """
    families = {cand.family(name) for name in search.chosen}
    for start in (nominal_fit(problem, search.model), search.fit(())):
        found = describe(problem, start)
        if not found.templates or families & set(found.templates[0].families):
            continue
        if found.chi2 >= final.chi2:
            continue
        count = max(problem.samples - found.parameters, 1)
        scale = Scale(max(found.chi2 / count, 1.0), found.tau, problem.samples)
        theirs = (found.chi2 / (scale.inflation * scale.tau) + found.prior
                  + found.parameters * scale.penalty)
        if theirs + 10.0 < search.score(search.chosen, scale):
            return found
    return None


# --- numbers -----------------------------------------------------------------------------------

def confirm(full: Problem, fit: Fit) -> Fit:
    """Return a fit of the search refitted on every row."""
    if len(full.data) == len(fit.residual):
        return fit
    again = full.fit(fit.model, fit.terms,
                     {t.key: v for t, v in zip(fit.terms, fit.values)}, iterations=4,
                     tolerance=1.0)
    again.added = fit.added
    return again


def _ranking(search: Search, full: Problem, final: Fit, chosen: list[str],
             ) -> tuple[Candidate, ...]:
    """Return every effect with the best set that holds it; chosen effects first."""
    scale = search.scale
    # sets of as many effects compete with each other, and with none at all
    count = max(len(chosen), 1)
    scores = {key: search.score(key, scale) for key in search.fits if len(key) in (0, count)}
    best = min(scores.values())
    weights = {key: np.exp(-0.5 * min(score - best, 700.0)) for key, score in scores.items()}
    total = sum(weights.values())
    entries = []
    for name in dict.fromkeys(cand.head(n) for n in search.effects):
        sets = [key for key in scores if name in {cand.head(n) for n in key}]
        if not sets:
            continue
        key = min(sets, key=lambda k: scores[k])
        mine = tuple(sorted(chosen))
        shape = next(n for n in key if cand.head(n) == name)
        if mine and name in {cand.head(n) for n in mine}:
            key, shape = mine, next(n for n in mine if cand.head(n) == name)
        fit = final if key == mine and chosen else search.fit(key)
        problem = full if fit is final else search.problem
        own = [e for e in estimates(fit, Scale.of(problem, fit))
               if e.key.startswith(shape + '.')]
        kept = problem.weight
        entries.append(Candidate(
            name, shape, cand.family(shape), float(sum(weights[k] for k in sets) / total),
            rms(fit.residual[kept]), float(scores[key] - best), tuple(own),
            catalogue.get(shape).signature, search.votes.get(shape)))
    place = {cand.head(name): k for k, name in enumerate(chosen)}
    entries.sort(key=lambda c: (place.get(c.effect, len(place)), c.score))
    return tuple(entries)


def _ties(search: Search, chosen: list[str]) -> tuple[tuple[str, ...], ...]:
    """Return groups of effects of which one is chosen and the others would do as well."""
    groups = []
    scale = search.scale
    now = search.score(chosen, scale) if chosen else 0.0
    for slot, name in enumerate(chosen):
        rest = chosen[:slot] + chosen[slot + 1:]
        others = []
        for key in search.fits:
            new = [n for n in key if n not in rest]
            if len(key) != len(chosen) or len(new) != 1 or not set(rest) <= set(key):
                continue
            if cand.head(new[0]) == cand.head(name):
                continue
            score = search.score(key, scale)
            if score - now < TIE:
                others.append((score, cand.head(new[0])))
        if others:
            names = list(dict.fromkeys(other for _, other in sorted(others)))
            groups.append((cand.head(name), *names))
    return tuple(groups)


def _ladder(full: Problem, model: Bundle, search: Search, chosen: list[str],
            ) -> list[dict[str, Any]]:
    """Return the error after each step, on all rows and on isobars or trials left out."""
    kept = full.weight
    nominal = rms(full.residual(model)[kept])
    steps = [{'step': 'model', 'error_N': nominal, 'held_out_N': nominal}]
    for count in range(len(chosen) + 1):
        fit = search.fit(chosen[:count])
        here = confirm(full, fit)
        error = rms(here.residual[kept])
        # the search may have averaged neighbours: what leaving out adds is added to a row's error
        added = held_out_error(search.problem, fit) ** 2 - rms(
            fit.residual[search.problem.weight]) ** 2
        steps.append({'step': 'recalibrated' if not count else f'+ {chosen[count - 1]}',
                      'error_N': error, 'held_out_N': float(np.sqrt(max(error ** 2 + added, 0)))})
    return steps


def with_intervals(fit: Fit, scale: Scale) -> Bundle:
    """Return the fitted model with its error and the intervals of its effects' parameters."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for estimate in estimates(fit, scale):
        owner, _, name = estimate.key.partition('.')
        found.setdefault(owner, {})[name] = estimate.si_interval
    effects = []
    for effect in fit.model.effects:
        known = effect.replace()
        known.intervals = {**effect.intervals, **found.get(effect.name, {})}
        effects.append(known)
    model = fit.model
    return Bundle(model.name, model.motor_units, effects, rms(fit.residual), model.notes)


# --- words -------------------------------------------------------------------------------------

def _summary(finding: _Finding, search: Search, ranking: tuple[Candidate, ...],
             tied: tuple[tuple[str, ...], ...], base: Fit) -> str:
    moved = {key.partition('.')[2]: value for key, value in base.moved().items()
             if abs(value) > 0.2}
    far = ', '.join(f'{key} {value:+.1f}' for key, value in moved.items())
    if finding.verdict == 'adequate':
        return 'the model explains the data down to their noise'
    if finding.verdict == 'recalibrate':
        return (f"the model's own parameters explain the error (tolerances moved: "
                f'{far or "little"}); no effect is missing')
    if finding.verdict == 'unexplained':
        shape = finding.left.templates[0].words if finding.left.templates else 'no plain shape'
        return ('the error has a structure that no effect of the catalogue explains; it looks '
                f'like this: {shape}')
    shapes = [f'{cand.head(name)} (shape: {name})' if name != cand.head(name) else name
              for name in search.chosen]
    text = ' and '.join(shapes)
    if tied:
        text += '; these data cannot tell apart ' + '; '.join(', '.join(g) for g in tied)
    if finding.verdict == 'partial':
        return (f'{text} explains {100 * finding.explained:.0f} % of the error, but its shape is '
                'not quite right')
    return f'{text} is missing and explains the error down to the noise'


def _next(problem: Problem, search: Search, finding: _Finding,
          tied: tuple[tuple[str, ...], ...], data: Measurement) -> str:
    """Return the experiment that would tell most."""
    if finding.named and tied:
        chosen = search.chosen
        slot = [cand.head(name) for name in chosen].index(tied[0][0])
        rest = chosen[:slot] + chosen[slot + 1:]
        rival = min((key for key in search.fits if len(key) == len(chosen)
                     and set(rest) <= set(key)
                     and tied[0][1] in {cand.head(n) for n in key}),
                    key=lambda key: search.score(key, search.scale))
        best, _ = best_experiment(problem, search.fit(chosen), search.fit(rival), search.scale)
        if best is None:
            return (f'no force test of the menu separates {tied[0][0]} from {tied[0][1]}; '
                    + without_force(chosen[slot], tied[0][1]))
        return (f'{best.words}: separates {tied[0][0]} from {tied[0][1]} '
                f'(by {np.sqrt(best.separation):.0f} noise sd)')
    if finding.verdict == 'unexplained':
        shape = finding.left.templates[0].words if finding.left.templates else 'the error'
        return (f'measure where the error is largest again, in finer steps and at two speeds '
                f'({shape})')
    if finding.verdict == 'recalibrate':
        return 'measure radius and braid angle with a calliper: they explain the error'
    runner = _runner_up(search)
    if finding.named and runner is not None:
        best, _ = best_experiment(problem, search.fit(search.chosen), search.fit(runner),
                                  search.scale)
        other = cand.head(next(n for n in runner if n not in search.chosen))
        if best is not None:
            return f'{best.words}: the firmest check of {cand.head(search.chosen[-1])} against ' \
                   f'{other}'
    if data.is_static:
        return 'log a sweep up and down with time: friction and memory cannot be seen in a map'
    return 'none needed within this range; widen it (past free strain, another speed) to go on'


def _reshaped(problem: Problem, search: Search, finding: _Finding) -> tuple[str, ...]:
    """Return a note where another shape of an effect that the model has would do better."""
    if finding.verdict not in ('unexplained', 'partial'):
        return ()
    notes = []
    names = search.chosen if finding.named else []
    before = search.fit(names)
    for old, shape in cand.other_shapes(search.model):
        try:
            model = search.model.without_effect(old).with_effect(shape)
            trial = Search(problem, model, search.effects)
            after = trial.fit(names)
        except ValueError:
            continue
        if search.excess(names) > 0 and trial.excess(names) < 0.3 * search.excess(names):
            kept = problem.weight
            notes.append(f'{shape.name} instead of {old} would leave '
                         f'{rms(after.residual[kept]):.3g} N instead of '
                         f'{rms(before.residual[kept]):.3g} N')
    return tuple(notes)


def _runner_up(search: Search) -> tuple[str, ...] | None:
    if not search.chosen:
        return None
    rest = set(search.chosen[:-1])
    last = cand.head(search.chosen[-1])
    keys = [key for key in search.fits if len(key) == len(search.chosen) and rest <= set(key)
            and all(cand.head(n) != last for n in set(key) - rest)]
    return min(keys, key=lambda key: search.score(key, search.scale), default=None)


def _notes(data: Measurement, floor: Any, base: Fit, final: Fit) -> tuple[str, ...]:
    notes = []
    if floor.note:
        notes.append(floor.note)
    far = [f'{key} {value:+.1f}' for key, value in final.moved().items()
           if abs(value) > 3.0 and key.startswith('geometry')]
    if far:
        notes.append('the refit moved geometry beyond what tolerances allow: ' + ', '.join(far)
                     + ' tolerances')
    far = [f'{key} {value:+.1f}' for key, value in base.moved().items()
           if abs(value) > 3.0 and key.startswith('geometry')]
    if far and base is not final:
        notes.append('recalibration alone would move ' + ', '.join(far) + ' tolerances')
    if not data.is_static and len(data.trial_names) >= 3:
        means = np.array([data.pressure[data.trial == k].sum(-1).mean()
                          for k in range(len(data.trial_names))])
        spread = np.array([np.ptp(data.pressure[data.trial == k].sum(-1)).max()
                           for k in range(len(data.trial_names))])
        if np.all(np.diff(means) > 0) and spread.max() < 0.2 * np.ptp(means):
            notes.append('isobars were run in ascending order: pressure and time cannot be told '
                         'apart')
    return tuple(notes)
