# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which effect is the model missing? Verdict, effects, ties, and what to measure next.

    result = diagnose(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)

The search (`search`) refits every candidate together with the model's own parameters on blocks of
neighbours; what it chose is confirmed on every row. `verdict` says what that amounts to, `words`
puts it into sentences, and this module brings it all together with numbers.
"""

from __future__ import annotations

from dataclasses import replace
import time
from typing import Any

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import RESOLUTION
from fam_bundle_ros.data.noise import noise_floor
from fam_bundle_ros.data.reading import as_measurement
from fam_bundle_ros.data.trials import trial_offsets
from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.fit import confirm, ErrorOf, Fit, held_out_of_whole, Problem
from fam_bundle_ros.discovery.reshapes import (
    find_reshapes,
    find_rival,
    less_sure,
    notes_on_reshapes,
    Reshape,
)
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.search import NEAR, Progress, Scale, Search, TIE
from fam_bundle_ros.discovery.uncertainty import confounding, estimates
from fam_bundle_ros.discovery.verdict import hold_against_noise, judge, moved
from fam_bundle_ros.discovery.words import Finding, next_experiment, notes_on, summarise
from fam_bundle_ros.model import Bundle, catalogue

#: Rows that the search works on; longer logs are averaged down to about this many.
SEARCH_ROWS = 3000


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
    data = as_measurement(measurement)
    comparison = compare(model, data)
    data = comparison.measurement
    offsets = trial_offsets(data, comparison.residual) if data.is_static else None
    if offsets is not None:
        # repeats tell them whatever the model lacks, and a map has no memory that could make them
        data = replace(data, force=data.force - offsets.rows)
    problem = Problem(data, model, largest=rows)
    search = Search(problem, model, cand.candidates(model, data), progress).run()
    if progress:
        progress(0.9, 'weighing what is left')
    full = problem if problem.block == 1 else Problem(data, model, largest=len(data))
    base = confirm(full, search.fit(()))
    final = confirm(full, search.fit(search.chosen))
    finding = judge(problem, search, comparison.noise)
    if rms(base.residual[full.weight]) < RESOLUTION * np.abs(data.force).max():
        finding = Finding('recalibrate' if moved(problem, search) else 'adequate', finding.left)
    finding = hold_against_noise(full, final, finding, offsets)
    told = finding.named or finding.verdict == 'unexplained'
    reshapes = find_reshapes(search, search.chosen if finding.named else []) if told else []
    rival = find_rival(search, reshapes)
    error = _error_on_every_row(full, base, search)
    if rival is not None:
        finding = less_sure(search, finding, rival, error)
    chosen = search.chosen if finding.named else []
    final = final if chosen else base
    scale = Scale.of(full, final)
    ranking = _ranking(search, full, final, chosen, rival, error)
    tied = _ties(search, chosen)
    next_one = next_experiment(problem, search, finding, tied, data)
    if rival is not None and chosen:
        tied = _join(tied, cand.head(rival.instead), rival.shape)
    kept = full.weight
    floor = noise_floor(data.select(kept), final.residual[kept])
    keep_nominal = finding.verdict == 'adequate'
    return Diagnosis(
        verdict=finding.verdict, summary=summarise(finding, search, tied, base),
        model=model, measurement=comparison.measurement, comparison=comparison,
        effects=tuple(cand.head(name) for name in chosen), shapes=tuple(chosen),
        error_N={'model': rms(comparison.residual[kept]), 'recalibrated': rms(
            base.residual[kept]), 'best': rms(final.residual[kept])},
        noise=floor, ranking=ranking, tied=tied, located=comparison.located,
        next_experiment=next_one,
        parameters=tuple(estimates(final, scale)), moved=final.moved(),
        best=model if keep_nominal else with_intervals(final, scale, kept),
        recalibrated=base.model, shapes_left=tuple(finding.left.templates),
        notes=(data.notes + ((finding.offset,) if finding.offset else ())
               + notes_on(data, floor, base, final) + _rivals(search, finding, tied, error)
               + notes_on_reshapes(search, finding, reshapes, error)),
        rows_left_out=int((~kept).sum()), confounding=confounding(final, scale),
        ladder=_ladder(full, model, search, chosen), seconds=time.perf_counter() - begun)


def _error_on_every_row(full: Problem, base: Fit, search: Search) -> ErrorOf:
    """
    Return a function from a fit of the search to its error on every row, N rms.

    Averaged rows have less noise: by as much as the base model's error, confirmed on every row,
    is larger there.
    """
    thin = search.problem.weight
    noise = rms(base.residual[full.weight]) ** 2 - rms(search.fit(()).residual[thin]) ** 2
    return lambda fit: float(np.hypot(rms(fit.residual[thin]), np.sqrt(max(noise, 0.0))))


def _ranking(search: Search, full: Problem, final: Fit, chosen: list[str],
             rival: Reshape | None, error: ErrorOf) -> tuple[Candidate, ...]:
    """Return every effect with the best set that holds it; chosen effects first."""
    scale = search.scale
    # sets of as many effects compete with each other, and with none at all
    count = max(len(chosen), 1)
    scores = {key: search.score(key, scale) for key in search.fits if len(key) in (0, count)}
    best = min(scores.values())
    weights = {key: np.exp(-0.5 * min(score - best, 700.0)) for key, score in scores.items()}
    total = sum(weights.values())
    if rival is not None:
        total += np.exp(0.5 * min(best - rival.score, 700.0))
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
        entries.append(Candidate(
            name, shape, cand.family(shape), float(sum(weights[k] for k in sets) / total),
            rms(fit.residual[full.weight]) if fit is final else error(fit),
            float(scores[key] - best), tuple(own),
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
        steps.append({'step': 'recalibrated' if not count else f'+ {chosen[count - 1]}',
                      'error_N': rms(here.residual[kept]),
                      'held_out_N': held_out_of_whole(full, here, search.problem, fit)})
    return steps


def with_intervals(fit: Fit, scale: Scale, kept: np.ndarray) -> Bundle:
    """
    Return the fitted model with its error and the intervals of its effects' parameters.

    The error is that of the rows ``kept`` (T,) of bool: spikes are the rig's, not the model's.
    """
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
    return Bundle(model.name, model.motor_units, effects, rms(fit.residual[kept]), model.notes)


def _rivals(search: Search, finding: Finding, tied: tuple[tuple[str, ...], ...],
            error_of: ErrorOf) -> tuple[str, ...]:
    """
    Return notes on other effects that leave hardly more, where the shape is not quite right.

    What was chosen is then ahead by what it asks of the model's own parameters, which says little
    as long as something is missing.
    """
    if finding.verdict != 'partial':
        return ()
    error = error_of(search.fit(search.chosen))
    notes = []
    for name in search.chosen:
        rest = {other for other in search.chosen if other != name}
        known = {cand.head(n) for n in search.chosen} | {
            n for group in tied if cand.head(name) in group for n in group}
        near = {}
        for key in search.fits:
            new = [n for n in key if n not in rest]
            left = error_of(search.fit(key))
            if (len(key) == len(search.chosen) and rest <= set(key) and left < NEAR * error
                    and cand.head(new[0]) not in known):
                near[cand.head(new[0])] = left
        notes += [f'{other} instead of {cand.head(name)} would leave {left:.3g} N instead of '
                  f'{error:.3g} N: do not build on the choice between the two'
                  for other, left in sorted(near.items(), key=lambda item: item[1])[:2]]
    return tuple(notes)


def _join(tied: tuple[tuple[str, ...], ...], name: str, other: str) -> tuple[tuple[str, ...], ...]:
    """Return the ties with one more in the group that an effect leads."""
    if not any(group[0] == name for group in tied):
        return (*tied, (name, other))
    return tuple((*group, other) if group[0] == name else group for group in tied)
