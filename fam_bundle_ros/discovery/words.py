# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says in words: its verdict, what to measure next, and what to beware of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.protocol import Protocol
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.evidence import Fit, Fitter
from fam_bundle_ros.discovery.experiment import best_experiment, finer, plain, without_force
from fam_bundle_ros.discovery.held_out import HeldOut
from fam_bundle_ros.discovery.options import head
from fam_bundle_ros.discovery.posterior import Change, Posterior, Trade
from fam_bundle_ros.discovery.templates import Template
from fam_bundle_ros.discovery.verdict import Finding

Ties = tuple[tuple[str, ...], ...]
#: Trades that a sentence tells; the others stand in a list.
_TOLD = 2


class Next(NamedTuple):
    """What to measure next: in words, and as a protocol where it is a force test."""

    words: str
    protocol: Protocol | None = None


def what(change: Change) -> str:
    """Return a change in words."""
    if not change.new:
        return f'{change.old} taken away'
    if change.old:
        return f'{change.new} in place of {change.old}'
    same = change.new == head(change.new)
    return change.new if same else f'{head(change.new)} (shape: {change.new})'


def renamed(name: str, changed: Sequence[str]) -> str:
    """Return a model's name with what was changed; the number of changes from three on."""
    return '_'.join([name, *(changed if len(changed) < 3 else [f'{len(changed)}_changes'])])


def summarise(finding: Finding, answer: Sequence[Change], found: Sequence[Change], ties: Ties,
              trades: Sequence[Trade], base: Fit, shapes: Sequence[Template],
              error: Mapping[str, float]) -> str:
    """
    Return the verdict in a sentence.

    Parameters
    ----------
    finding : Finding
    answer, found : sequence of Change
        What is named, and what was chosen before the verdict refused it.
    ties : tuple of tuple of str
    trades : sequence of Trade
    base : Fit
        The model recalibrated.
    shapes : sequence of Template
        What the error looks like.
    error : mapping of str to float
        Rms errors ``recalibrated`` and ``best``, and the floor of the ``noise``, N.
    """
    if finding.verdict == 'adequate':
        return 'the model explains the data down to their noise'
    if finding.verdict == 'recalibrate':
        far = ', '.join(f'{p.key.partition(".")[2]} {u:+.1f}' for p, u in zip(
            base.priors, base.u) if abs(u) > 0.2)
        return (f"the model's own parameters explain the error (tolerances moved: "
                f'{far or "little"}); no effect is missing')
    if finding.verdict == 'unexplained':
        if finding.artefacts:
            return '; '.join(artefact.words for artefact in finding.artefacts)
        shape = shapes[0].words if shapes else 'no plain shape'
        near = ' and '.join(map(what, found))
        why = '; '.join(finding.refusals) or (
            f'{finding.after.total:.2g} N of structure would stay')
        return ('the error has a structure that no effect of the catalogue explains; it looks '
                f'like this: {shape}' + (f' (nearest: {near}, but {why})' if near else ''))
    text, s = ' and '.join(map(what, answer)), 's' if len(answer) == 1 else ''
    if finding.verdict == 'partial':
        text += (f' take{s} the error from {error["recalibrated"]:.3g} to {error["best"]:.3g} N; '
                 f'{finding.after.total:.2g} N of it are left to a smooth discrepancy')
        if finding.warnings:
            text += '; doubtful: ' + '; '.join(finding.warnings)
    elif finding.after.rough > settings.VISIBLE * error['best']:
        text += (f' explain{s} the error down to {error["best"]:.3g} N: more than the noise, but '
                 f'without a smooth shape and below {settings.SMALL:.0%} of the largest force')
    elif error['best'] ** 2 - error['noise'] ** 2 > (settings.VISIBLE * error['best']) ** 2:
        text += (f' explain{s} all of the error that has a shape; {error["best"]:.3g} N rms are '
                 f'left without one, above the noise floor of {error["noise"]:.3g} N')
    else:
        text += f' explain{s} the error down to the noise'
    if ties or trades:
        more = f' (and {len(trades) - _TOLD} trades more)' if len(trades) > _TOLD else ''
        text += '; these data cannot tell apart ' + '; '.join(
            [*(' and '.join(group) for group in ties), *map(str, trades[:_TOLD])]) + more
    return text


def next_experiment(fitter: Fitter, posterior: Posterior, finding: Finding,
                    answer: Sequence[Change], chosen: Fit, ties: Ties,
                    shapes: Sequence[Template], base: Fit) -> Next:
    """
    Return the experiment that would tell most.

    Parameters
    ----------
    base : Fit
        The model recalibrated; the others as in `diagnose`.
    """
    if finding.artefacts:
        return Next('; '.join(artefact.remedy for artefact in finding.artefacts))
    if answer:
        least_sure = min(answer, key=lambda change: posterior.of_label(change.label))
        tie = ties[0] if ties else (least_sure.label, '')
        rival = _rival(posterior, tie, chosen)
        if rival is not None:
            other = tie[1] or next((label for label in _labels(posterior, rival)
                                    if label != tie[0]), 'the model without it')
            best, _ = best_experiment(fitter, chosen, rival)
            if best is None and ties:
                return Next(f'no force test of the menu separates {tie[0]} from {other}; '
                            + without_force(tie[0], other))
            if best is not None:
                why = (f'separates {tie[0]} from {other} '
                       f'(by {np.sqrt(best.separation):.0f} noise sd)')
                return Next(f'{best.words}: {why}', replace(best.protocol, notes=why))
    if finding.verdict == 'unexplained':
        shape = shapes[0].words if shapes else 'the error'
        return Next(f'measure where the error is largest again, in finer steps and at two speeds '
                    f'({shape})', finer(fitter.cells, chosen.model))
    if finding.verdict == 'recalibrate':
        moved, _ = max(zip(base.priors, base.u), key=lambda pair: abs(pair[1]))
        owner = moved.key.partition('.')[0]
        if owner == 'geometry':
            return Next('measure radius and braid angle with a calliper: they explain the error')
        return Next(f'take the refitted constants of {owner}: they moved most, and no calliper '
                    'shows them')
    if fitter.cells.data.is_static:
        return Next('log a sweep up and down with time: friction and memory cannot be seen in a '
                    'map', plain(fitter.cells, chosen.model))
    return Next('none needed within this range; widen it (past free strain, another speed) to '
                'go on')


def _labels(posterior: Posterior, fit: Fit) -> list[str]:
    from fam_bundle_ros.discovery.posterior import changes
    return [change.label for change in changes(posterior.options, fit.names)]


def _rival(posterior: Posterior, tie: tuple[str, ...], chosen: Fit) -> Fit | None:
    """Return the most probable set that has the rival of a tie instead, or any without it."""
    for fit in posterior.fits:
        labels = _labels(posterior, fit)
        if fit is not chosen and tie[0] not in labels and (not tie[1] or tie[1] in labels):
            return fit
    return None


def notes_on(cells: Cells, floor: NoiseFloor, base: Fit, final: Fit, held: HeldOut,
             ) -> tuple[str, ...]:
    """Return what a reader should know besides: odd noise, moved geometry, the protocol."""
    notes, data = [], cells.data
    if floor.note:
        notes.append(floor.note)
    left_out = int((cells.label < 0).sum())
    if left_out:
        missed = (data.force - final.model.predict(cells.motion))[cells.label >= 0]
        notes.append(f'{left_out} of {len(cells.label)} rows are in no cell: spikes, rows where '
                     'the direction of motion is not known (the first of a trial, turning '
                     'points), or visits beyond the number that is worked with; on the others '
                     f'the best error is {rms(missed):.3g} N')
    if cells.stiffness is not None:
        notes.append(f'the force is constant ({data.force.mean():.3g} N): errors in N are those '
                     f"of the strain times the model's stiffness (100 N are "
                     f'{100.0 / np.median(cells.stiffness):.2g} of strain); mean, plane and '
                     'empirical form are a mean strain, a line and a cubic in the pressure')
        notes.append('one force fixes neither the scale of the model nor a bias: let a '
                     'dynamometer move the bundle, or hang other weights on it')
    if not held.kinds:
        notes.append('nothing could be left out to test on: held-out errors are those of the fit')
    for words, fit in (('the refit', final), ('recalibration alone', base)):
        far = [f'{p.key} {u:+.1f}' for p, u in zip(fit.priors, fit.u)
               if abs(u) > 3.0 and p.key.startswith('geometry')]
        if far:
            notes.append(f'{words} moves geometry beyond what tolerances allow: '
                         + ', '.join(far) + ' tolerances')
    if ascends(data):
        notes.append('isobars were run in ascending order: pressure and time cannot be told apart')
    return tuple(dict.fromkeys(notes))


def not_named(posterior: Posterior, chosen: Fit, told: Iterable[str]) -> tuple[str, ...]:
    """
    Return in words which effects are likelier than not without being part of an answer.

    An effect in more than half of the posterior predicts better than none (Barbieri and Berger
    2004, Ann. Stat. 32, 870), but a name asks for more: see `settings.LEAST_LOSS`.

    Parameters
    ----------
    posterior : Posterior
    chosen : Fit
        The set that is the answer.
    told : iterable of str
        Labels that are said elsewhere, as ties and trades are.
    """
    known = {*_labels(posterior, chosen), *told}
    return tuple(
        f'{label} is likelier than not ({posterior.of_label(label):.2f}) but not named: the '
        'evidence for it is weak, it predicts nothing on rows not seen, or its constants are '
        'hard to believe'
        for label in posterior.labels()
        if label not in known and posterior.of_label(label) > 0.5)


def ascends(data: Measurement) -> bool:
    """Return whether each trial of a log is an isobar of a higher pressure than the one before."""
    trials = [data.pressure[data.trial == k].sum(-1) for k in np.unique(data.trial)]
    if data.is_static or len(trials) < 3:
        return False
    means = np.array([trial.mean() for trial in trials])
    return bool(np.all(np.diff(means) > 0)
                and max(map(np.ptp, trials)) < 0.2 * np.ptp(means))
