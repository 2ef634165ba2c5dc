# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The rivals of a missing effect: other shapes of the effects that the model has.

A wall that stiffens otherwise than the model's leaves an error that an effect from elsewhere may
take in good part; a law of that wall that takes as much is the better answer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.fit import ErrorOf, Fit
from fam_bundle_ros.discovery.search import GATE, NEAR, Search, TIE
from fam_bundle_ros.discovery.words import Finding
from fam_bundle_ros.model import Place


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


def find_reshapes(search: Search, names: list[str]) -> list[Reshape]:
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


def find_rival(search: Search, reshapes: list[Reshape]) -> Reshape | None:
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
        if each.score < now + TIE and reached * NEAR > needed:
            return each
    return None


def less_sure(search: Search, finding: Finding, rival: Reshape, error: ErrorOf) -> Finding:
    """Return the verdict where a shape of an effect of the model's own does as well, or better."""
    text = rival.left(error)
    finding = replace(finding, next=f'write {rival.shape} {rival.where} into the model file and '
                      'diagnose again')
    if rival.score + GATE < search.score(search.chosen, search.scale):
        near = ' and '.join(cand.head(name) for name in search.chosen)
        return replace(finding, verdict='unexplained',
                       hidden=f'{text}, and explains more with less than {near}')
    return replace(finding, verdict='partial', rest='; '.join(filter(None, (finding.rest, text))))


def notes_on_reshapes(search: Search, finding: Finding, reshapes: list[Reshape], error: ErrorOf,
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
