# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Adequate, recalibrate, missing effect, partial or unexplained: what a search amounts to.

The rules look at what the fit leaves: has it a shape, does it come back at each visit, is it more
than the noise, and would a plain shape that no chosen effect can make explain more with less?
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import RESOLUTION
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor, what_does_not_repeat
from fam_bundle_ros.data.trials import Offsets, trial_offsets
from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.fit import Fit, Problem
from fam_bundle_ros.discovery.search import Scale, Search
from fam_bundle_ros.discovery.structure import surface_share
from fam_bundle_ros.discovery.templates import describe, Described, nominal_fit
from fam_bundle_ros.discovery.words import Finding

#: A model that leaves so much of the force's standard deviation tells hardly more than a constant.
_NOTHING = 0.9
#: "Down to the noise" is said of errors up to this many noise floors, which are themselves
#: uncertain by several per cent.
_AT_NOISE = 1.2
#: A shape in what is left counts from this gain in chi2 (some four hundred shapes are tried).
_SHAPE_GATE = 25.0
#: ... and from this size, in noise standard deviations.
_SHAPE_SIZE = 0.3


def judge(problem: Problem, search: Search, floor: NoiseFloor) -> Finding:
    """Return the verdict on what a search chose, or on its choosing nothing."""
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
        return Finding('recalibrate' if moved(problem, search) else 'adequate', left)
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


def hold_against_noise(full: Problem, final: Fit, finding: Finding, offsets: Offsets | None,
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


def moved(problem: Problem, search: Search) -> bool:
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
