# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which effect is the model missing? Verdict, effects, ties, and what to measure next.

    result = diagnose(load_model('model.yaml'), read_measurement('data.csv'))
    print(result)

The search (`search`) refits every candidate together with the model's own parameters on blocks of
neighbours; what it chose is confirmed on every row. This module turns the search into a verdict
with numbers, `words` into sentences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import time
from typing import Any, NamedTuple

import numpy as np

from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.compare import compare
from fam_bundle_ros.discovery.fit import Fit, held_out_of_whole, Problem
from fam_bundle_ros.discovery.grouping import rms
from fam_bundle_ros.discovery.measurement import RESOLUTION
from fam_bundle_ros.discovery.noise import noise_floor, NoiseFloor, what_does_not_repeat
from fam_bundle_ros.discovery.reading import as_measurement
from fam_bundle_ros.discovery.result import Candidate, Diagnosis
from fam_bundle_ros.discovery.search import GATE, Progress, Scale, Search
from fam_bundle_ros.discovery.structure import surface_share
from fam_bundle_ros.discovery.templates import describe, Described, nominal_fit
from fam_bundle_ros.discovery.trials import Offsets, trial_offsets
from fam_bundle_ros.discovery.uncertainty import confounding, covariance, estimates
from fam_bundle_ros.discovery.words import Finding, next_experiment, notes_on, summarise
from fam_bundle_ros.model import Bundle, catalogue, Place

#: From a fit of the search to an error in N.
ErrorOf = Callable[[Fit], float]
#: Rows that the search works on; longer logs are averaged down to about this many.
SEARCH_ROWS = 3000
#: Effects whose scores differ by less cannot be told apart (odds of 20 to 1).
TIE = 6.0
#: Where something is still missing, an error larger by this factor is no reason for a choice.
_NEAR = 1.1
#: A model that leaves so much of the force's standard deviation tells hardly more than a constant.
_NOTHING = 0.9
#: "Down to the noise" is said of errors up to this many noise floors, which are themselves
#: uncertain by several per cent.
_AT_NOISE = 1.2
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
    final = _shown(full, search)
    finding = _verdict(problem, search, comparison.noise)
    if rms(base.residual[full.weight]) < RESOLUTION * np.abs(data.force).max():
        finding = Finding('recalibrate' if _moved(problem, search) else 'adequate', finding.left)
    finding = _down_to_the_noise(full, final, finding, offsets)
    told = finding.named or finding.verdict == 'unexplained'
    reshapes = _reshapes(search, search.chosen if finding.named else []) if told else []
    rival = _rival(search, reshapes)
    error = _error_on_every_row(full, base, search)
    if rival is not None:
        finding = _less_sure(search, finding, rival, error)
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
               + _reshaped(search, finding, reshapes, error)),
        rows_left_out=int((~kept).sum()), confounding=confounding(final, scale),
        ladder=_ladder(full, model, search, chosen), seconds=time.perf_counter() - begun)


# --- verdict -----------------------------------------------------------------------------------

def _verdict(problem: Problem, search: Search, floor: NoiseFloor) -> Finding:
    base, final = search.fit(()), search.fit(search.chosen)
    left = describe(problem, final)
    spread = float(problem.data.force[problem.weight].std())
    rest = rms(final.residual[problem.weight])
    if rest > _NOTHING * spread and not cand.force_hardly_changes(problem.data):
        return Finding('unexplained', left, 0.0, hidden='the force does not follow the model at '
                       f'all: the refitted model leaves {100 * rest / spread:.0f} % of its '
                       'standard deviation',
                       next='check columns, units and that data and model are of one muscle')
    structured = _structured(problem, final, left)
    if not search.chosen:
        if structured:
            return Finding('unexplained', left, 0.0)
        if floor.hides_loops:
            return Finding('unexplained', Described([]), 0.0, hidden=floor.note,
                           next='give the time of each row, or one file for each direction of '
                           'motion')
        return Finding('recalibrate' if _moved(problem, search) else 'adequate', left)
    before = search.excess(())
    explained = 1.0 - search.excess(search.chosen) / max(before, 1e-9)
    if not structured:
        return Finding('missing_effect', left, explained)
    shape = _outsider(problem, search, final)
    if shape is not None:
        return Finding('unexplained', shape, explained, 'that shape explains more with less')
    if explained < 0.7:
        return Finding('unexplained', describe(problem, base), explained,
                       f'it explains only {100 * explained:.0f} % of the error')
    return Finding('partial', left, explained)


def _shown(full: Problem, search: Search) -> Fit:
    """
    Return the chosen effects confirmed on every row, without those whose size may be zero.

    The search weighs an effect with all that the fit moves along with it; to be named, its own
    size must differ from nothing (95 %). Another effect that does as well takes its place.
    """
    from scipy import stats
    weak: set[str] = set()
    while search.chosen:
        final = confirm(full, search.fit(search.chosen))
        known = covariance(final, Scale.of(full, final))
        keys = [term.key.partition('.') for term in final.terms]
        for name in search.chosen:
            effect = search.effects[name]
            sizes = [j for j, (owner, _, own) in enumerate(keys)
                     if owner == name and effect.off.get(own) == 0.0]
            value = np.array([final.values[j] / final.terms[j].scale for j in sizes])
            distance = float(value @ np.linalg.pinv(known[np.ix_(sizes, sizes)]) @ value)
            if sizes and distance < stats.chi2.ppf(0.95, len(sizes)):
                weak.add(name)
                now = search.score(search.chosen, search.scale)
                rest = set(search.chosen) - {name}
                others = [(search.score(key, search.scale), (set(key) - rest).pop())
                          for key in search.fits if len(key) == len(search.chosen)
                          and rest <= set(key) and not weak & set(key)]
                score, other = min(others, default=(np.inf, name))
                if score < now + TIE:
                    search.chosen[search.chosen.index(name)] = other
                else:
                    search.drop(name)
                break
        else:
            return final
    return confirm(full, search.fit(()))


def _down_to_the_noise(full: Problem, final: Fit, finding: Finding, offsets: Offsets | None,
                       ) -> Finding:
    """Return the verdict less sure where trials have offsets, or more than noise is left."""
    kept = full.weight
    data, left = full.data.select(kept), final.residual[kept]
    if finding.named and rms(left) < RESOLUTION * np.abs(data.force).max():
        return replace(finding, verdict='missing_effect')
    found = offsets or trial_offsets(data, left)
    if found is not None and found.size > _SHAPE_SIZE * full.row_noise:
        finding = replace(finding, offset=str(found))
        tare = 'tare the load cell before each trial and measure again'
        if finding.verdict in ('adequate', 'recalibrate'):
            return replace(finding, verdict='unexplained', hidden=str(found), next=tare)
        if finding.named:
            return replace(finding, verdict='partial', rest=str(found), next=tare)
    if finding.verdict not in ('missing_effect', 'adequate'):
        return finding
    floor = noise_floor(data, left).value
    pure = what_does_not_repeat(data, left)
    if pure is not None:
        floor = max(floor, rms(pure[np.isfinite(pure)]))
    if rms(left) < max(_AT_NOISE * floor, RESOLUTION * np.abs(data.force).max()):
        return finding
    rest = f'{rms(left):.3g} N are left where the noise is {floor:.3g} N'
    return replace(finding, rest=rest,
                   verdict='partial' if finding.named else finding.verdict)


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
            if (len(key) == len(search.chosen) and rest <= set(key) and left < _NEAR * error
                    and cand.head(new[0]) not in known):
                near[cand.head(new[0])] = left
        notes += [f'{other} instead of {cand.head(name)} would leave {left:.3g} N instead of '
                  f'{error:.3g} N: do not build on the choice between the two'
                  for other, left in sorted(near.items(), key=lambda item: item[1])[:2]]
    return tuple(notes)


class Reshape(NamedTuple):
    """
    Another shape of an effect that the model has, in its place or beside it.

    ``instead`` is the chosen effect that it makes needless, empty where it joins them all.
    """

    where: str
    shape: str
    instead: str
    fit: Fit
    score: float

    def left(self, error: ErrorOf) -> str:
        """Return what it would leave, in words."""
        return f'{self.shape} {self.where} would leave {error(self.fit):.3g} N'


def _reshapes(search: Search, names: list[str]) -> list[Reshape]:
    """Return the model's effects in their other shapes, beside the chosen effects or for one."""
    found = []
    tries = []
    for old, shape in cand.other_shapes(search.model):
        tries.append((search.model.without_effect(old), f"in the place of the model's {old}",
                      shape))
        if shape.place is Place.FORCE:  # two laws of one wall in sum are a law of it too
            tries.append((search.model, f"beside the model's {old}", shape))
    for model, where, shape in tries:
        trial = Search(search.problem, model, {**search.effects, shape.name: shape})
        for instead in ['', *names]:
            held = [shape.name, *(name for name in names if name != instead)]
            try:
                for count in range(len(held) + 1):
                    fit = trial.fit(held[:count])
            except ValueError:  # a shape that this model cannot take
                break
            found.append(Reshape(where, shape.name, instead, fit,
                                 trial.score(held, search.scale)))
    return found


def _rival(search: Search, reshapes: list[Reshape]) -> Reshape | None:
    """
    Return the shape of an effect of the model's own that does as well as an effect it lacks.

    By the score that candidates are compared by; and it must explain as much: a shape of fewer
    parameters alone scores well where there is little to explain.
    """
    loss = search.scale.inflation * search.scale.tau
    final = search.fit(search.chosen)
    now = search.score(search.chosen, search.scale)
    for each in sorted((r for r in reshapes if r.instead), key=lambda r: r.score):
        without = search.fit([name for name in search.chosen if name != each.instead])
        reached = (without.chi2 - each.fit.chi2) / loss + without.prior - each.fit.prior
        needed = (without.chi2 - final.chi2) / loss + without.prior - final.prior
        if each.score < now + TIE and reached * _NEAR > needed:
            return each
    return None


def _less_sure(search: Search, finding: Finding, rival: Reshape, error: ErrorOf) -> Finding:
    """Return the verdict where a shape of an effect of the model's own does as well, or better."""
    text = rival.left(error)
    finding = replace(finding, next=f'write {rival.shape} {rival.where} into the model file and '
                      'diagnose again')
    if rival.score + GATE < search.score(search.chosen, search.scale):
        near = ' and '.join(cand.head(name) for name in search.chosen)
        return replace(finding, verdict='unexplained',
                       hidden=f'{text}, and explains more with less than {near}')
    return replace(finding, verdict='partial', rest='; '.join(filter(None, (finding.rest, text))))


def _join(tied: tuple[tuple[str, ...], ...], name: str, other: str) -> tuple[tuple[str, ...], ...]:
    """Return the ties with one more in the group that an effect leads."""
    if not any(group[0] == name for group in tied):
        return (*tied, (name, other))
    return tuple((*group, other) if group[0] == name else group for group in tied)


def _reshaped(search: Search, finding: Finding, reshapes: list[Reshape], error: ErrorOf,
              ) -> tuple[str, ...]:
    """Return notes where another shape of an effect that the model has would do better."""
    before = search.fit(search.chosen if finding.named else [])
    usual = search.problem.samples - len(before.terms)
    notes = []
    for each in reshapes:
        if not each.instead and before.chi2 > usual and (
                each.fit.chi2 - usual < 0.3 * (before.chi2 - usual)):
            notes.append(f'{each.left(error)} instead of {error(before):.3g} N')
    return tuple(notes)
