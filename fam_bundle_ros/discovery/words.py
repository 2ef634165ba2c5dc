# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says in words: its verdict, what to measure next, and what to beware of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.discovery import candidates as cand
from fam_bundle_ros.discovery.experiment import best_experiment, without_force
from fam_bundle_ros.discovery.fit import Fit, Problem
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.templates import Described


@dataclass
class Finding:
    """
    A verdict, what is left in the error, and the share of it that is explained.

    ``refused`` says why what the search chose is no answer, ``hidden`` what these data cannot
    show at all, ``rest`` what effects leave that explain a part, ``offset`` by how much trials
    differ, in words, ``next`` what to do about it.
    """

    verdict: str
    left: Described
    explained: float = 1.0
    refused: str = ''
    hidden: str = ''
    rest: str = ''
    offset: str = ''
    next: str = ''

    @property
    def named(self) -> bool:
        """Whether the effects of the search are part of the answer."""
        return self.verdict in ('missing_effect', 'partial')


def summarise(finding: Finding, search: Search, tied: tuple[tuple[str, ...], ...],
              base: Fit) -> str:
    """Return the verdict in a sentence."""
    moved = {key.partition('.')[2]: value for key, value in base.moved().items()
             if abs(value) > 0.2}
    far = ', '.join(f'{key} {value:+.1f}' for key, value in moved.items())
    if finding.verdict == 'adequate' and finding.rest:
        return ('nothing is left in the error that strain, pressure or motion foretell: '
                f'{finding.rest} between neighbours or repeats, the rest is slow or uneven noise')
    if finding.verdict == 'adequate':
        return 'the model explains the data down to their noise'
    if finding.verdict == 'recalibrate':
        return (f"the model's own parameters explain the error (tolerances moved: "
                f'{far or "little"}); no effect is missing')
    if finding.verdict == 'unexplained':
        shape = finding.left.templates[0].words if finding.left.templates else 'no plain shape'
        if finding.hidden:
            return finding.hidden
        near = ' and '.join(cand.head(name) for name in search.chosen)
        return ('the error has a structure that no effect of the catalogue explains; it looks '
                f'like this: {shape}' + (f' (nearest: {near}, but {finding.refused})'
                                         if near else ''))
    shapes = [f'{cand.head(name)} (shape: {name})' if name != cand.head(name) else name
              for name in search.chosen]
    named, one = ' and '.join(shapes), len(shapes) == 1
    if finding.verdict == 'partial':
        text = (f"{named} {'explains' if one else 'explain'} "
                f'{100 * finding.explained:.0f} % of the error, but ' + (
                    finding.rest or f"{'its' if one else 'their'} shape is not quite right"))
    else:
        text = (f"{named} {'is missing and explains' if one else 'are missing and explain'} the "
                'error down to the noise')
    if tied:
        text += '; these data cannot tell apart ' + '; '.join(' and '.join(g) for g in tied)
    return text


def next_experiment(problem: Problem, search: Search, finding: Finding,
                    tied: tuple[tuple[str, ...], ...], data: Measurement) -> str:
    """Return the experiment that would tell most."""
    if finding.next:
        return finding.next
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


def _runner_up(search: Search) -> tuple[str, ...] | None:
    if not search.chosen:
        return None
    rest = set(search.chosen[:-1])
    last = cand.head(search.chosen[-1])
    keys = [key for key in search.fits if len(key) == len(search.chosen) and rest <= set(key)
            and all(cand.head(n) != last for n in set(key) - rest)]
    return min(keys, key=lambda key: search.score(key, search.scale), default=None)


def notes_on(data: Measurement, floor: NoiseFloor, base: Fit, final: Fit) -> tuple[str, ...]:
    """Return what a reader should know besides: odd noise, moved geometry, the protocol."""
    notes = []
    if floor.note:
        notes.append(floor.note)
    if cand.force_hardly_changes(data):
        notes.append(f'the force hardly changes ({data.force.mean():.3g} N, standard deviation '
                     f'{data.force.std():.2g} N): such data fix neither the scale of the model '
                     'nor a bias; let a dynamometer move the bundle, or hang it on a spring')
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
