# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Sentences of a diagnosis: its verdict, the next experiment and notes on the data."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import NoiseFloor
from fam_bundle_ros.data.protocol import Protocol
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.experiment import (
    best_experiment,
    finer,
    NOISE_MARGIN,
    plain,
    remedy_of,
)
from fam_bundle_ros.discovery.fitter import Fit, Fitter
from fam_bundle_ros.discovery.held_out import HeldOut
from fam_bundle_ros.discovery.options import Change, head
from fam_bundle_ros.discovery.posterior import Posterior, Trade
from fam_bundle_ros.discovery.templates import Template
from fam_bundle_ros.discovery.verdict import Finding, is_enough, TOLERANCES
from fam_bundle_ros.model import Bundle, catalogue, Place
from fam_bundle_ros.told import counted, number

Ties = tuple[tuple[str, ...], ...]
#: Most trades named in the summary; all are in a list of the diagnosis.
_TOLD = 2


class Next(NamedTuple):
    """What to measure next: a sentence, and the protocol if it is a force test."""

    words: str
    protocol: Protocol | None = None


def what(change: Change) -> str:
    """Return the words for a change."""
    if not change.new:
        return f'{change.old} taken away'
    if change.old:
        return f'{change.new} in place of {change.old}'
    same = change.new == head(change.new)
    return change.new if same else f'{head(change.new)} (shape: {change.new})'


def renamed(name: str, changed: Sequence[str]) -> str:
    """Return a model's name with its changes appended, or their number if three or more."""
    return '_'.join([name, *(changed if len(changed) < 3 else [f'{len(changed)}_changes'])])


def summarise(finding: Finding, answer: Sequence[Change], found: Sequence[Change], ties: Ties,
              trades: Sequence[Trade], base: Fit, shapes: Sequence[Template],
              error: Mapping[str, float]) -> str:
    """
    Return the verdict in a sentence, after what was corrected in the data.

    Parameters
    ----------
    finding : Finding
    answer, found : sequence of Change
        Changes that are named, and those chosen before the verdict, which may refuse them.
    ties : tuple of tuple of str
    trades : sequence of Trade
    base : Fit
        The model recalibrated.
    shapes : sequence of Template
        Shapes that the error resembles.
    error : mapping of str to float
        Rms errors ``recalibrated`` and ``best``, the latter in the ``used`` rows alone (see
        `error_of_used`), and the noise floor ``noise``, N.
    """
    return '; '.join([*finding.corrected, _verdict(finding, answer, found, ties, trades, base,
                                                   shapes, error)])


def _verdict(finding: Finding, answer: Sequence[Change], found: Sequence[Change], ties: Ties,
             trades: Sequence[Trade], base: Fit, shapes: Sequence[Template],
             error: Mapping[str, float]) -> str:
    """Return the verdict in a sentence; parameters as in `summarise`."""
    faint = (f'; {number(finding.faint, 2)} N rms of a smooth shape are left, less than half the '
             'noise of a row: a smaller --unexplained searches for effects of this size'
             if finding.faint else '')
    if finding.verdict == 'adequate':
        return 'the model explains ' + _down_to('the data down to their noise', error) + faint
    if finding.verdict == 'recalibrate':
        far = ', '.join(f'{p.key.partition(".")[2]} {u:+.1f}' for p, u in zip(
            base.priors, base.u) if abs(u) > 0.2)
        rest = (f'what is left is below {settings.SMALL:.0%} of the largest force, where no '
                'effect is looked for' if _above_noise(error) else 'no effect is missing')
        return (f"the model's own parameters explain {_down_to('the error', error)} (tolerances "
                f'moved: {far or "little"}); {rest}{faint}')
    if finding.verdict == 'unexplained':
        if finding.artefacts:
            return '; '.join(artefact.words for artefact in finding.artefacts)
        shape = _shape(shapes, 'no plain shape')
        near = ' and '.join(map(what, found))
        why = '; '.join(finding.refusals) or (
            f'{number(finding.after.shown, 2)} N of structure would be left')
        return ('the error has a structure that no effect of the catalogue explains; it looks '
                f'like this: {shape}' + (f' (nearest: {near}, but {why})' if near else ''))
    text, s = ' and '.join(map(what, answer)), 's' if len(answer) == 1 else ''
    if finding.verdict == 'partial':
        text += (f' take{s} the error from {error["recalibrated"]:.3g} to {error["best"]:.3g} N; '
                 + _left(finding, error['best']))
        cautions = [*(f'first settle this: {slip}' for slip in finding.slips), *finding.warnings]
        if cautions:
            text += '; caution: ' + '; '.join(cautions)
    elif finding.after.rough > settings.VISIBLE * error['best']:
        text += (f' explain{s} the error down to {error["best"]:.3g} N: more than the noise, but '
                 f'without a smooth shape and below {settings.SMALL:.0%} of the largest force')
    else:
        text += f' explain{s} ' + _down_to('the error down to the noise', error)
    if ties or trades:
        more = f' (and {len(trades) - _TOLD} more)' if len(trades) > _TOLD else ''
        text += '; these data cannot tell apart ' + '; '.join(
            [*(' and '.join(group) for group in ties), *map(str, trades[:_TOLD])]) + more
    return text


def _shape(shapes: Sequence[Template], otherwise: str) -> str:
    """Return the words for the best shape, if it is most of the error."""
    most = [shape.words for shape in shapes[:1] if shape.explained >= settings.MOST_OF_IT]
    return most[0] if most else otherwise


def _left(finding: Finding, best: float) -> str:
    """Return the size of the discrepancy; it may exceed the error of a distorted model."""
    left = finding.after.shown
    if not left:
        return 'no smooth discrepancy is left'
    near = ' if the dimensions stay near their usual values' if left > best else ''
    return f'a smooth discrepancy of {number(left, 2)} N is left{near}'


def _above_noise(error: Mapping[str, float]) -> bool:
    return error['used'] ** 2 - error['noise'] ** 2 > (settings.VISIBLE * error['used']) ** 2


def _down_to(noise_only: str, error: Mapping[str, float]) -> str:
    """Return what is explained: the words for all but noise, or that more is left."""
    best, noise, used = error['best'], error['noise'], error['used']
    if _above_noise(error):
        return (f'the error down to {used:.3g} N rms, above the noise floor of {noise:.3g} N, '
                'without a further shape that is known')
    if best ** 2 - used ** 2 > (settings.VISIBLE * best) ** 2:
        return f'{noise_only} ({used:.3g} N in the rows that fits use)'
    return noise_only


def error_of_used(cells: Cells, model: Bundle, error: float) -> float:
    """
    Return the rms error of a model in the rows that fits use, N.

    Spikes and rows of unknown direction of motion say nothing about the model. Of a long log,
    whose rows were averaged, it is ``error``, that in all rows.
    """
    if cells.rows > len(cells.label):
        return error
    return _error_of_used(cells, model)


def _error_of_used(cells: Cells, model: Bundle) -> float:
    return rms(cells.residual_of_rows(model)[cells.label >= 0])


def next_experiment(fitter: Fitter, posterior: Posterior, finding: Finding,
                    answer: Sequence[Change], chosen: Fit, ties: Ties, trades: Sequence[Trade],
                    shapes: Sequence[Template], base: Fit) -> Next:
    """
    Return the experiment that best separates the answer from its most probable rival.

    If the odds of each effect against all sets without it are above those of a tie, no experiment
    is needed to name the effects: measure what is left, or all of it more finely.

    Parameters
    ----------
    base : Fit
        The model recalibrated; the other parameters as in `diagnose`.
    """
    if finding.slips:
        return Next('check the columns, the units, the signs and whether the pressure is '
                    'absolute, and diagnose again')
    if finding.artefacts:
        return Next('; '.join(artefact.remedy for artefact in finding.artefacts))
    certain = False
    if answer:
        least_sure = min(answer, key=lambda change: posterior.of_label(change.label))
        gone: Collection[str | Change] = (least_sure.label,)
        came: Collection[str | Change] = ()
        if ties:
            gone, came = ties[0][:1], ties[0][1:2]
        elif trades:
            gone, came = trades[0]
        rival = _rival(posterior, gone, came, chosen)
        probability, odds = posterior.of_label(least_sure.label), posterior.options.choices.odds
        certain = not came and probability > odds * (1.0 - probability)
        if rival is not None and not certain:
            own = _labels(posterior, chosen)
            one, other = (' and '.join(sorted(map(str, changes))) for changes in (gone, came))
            other = other or next((label for label in _labels(posterior, rival)
                                   if label not in own), 'the model without it')
            best, _ = best_experiment(fitter, chosen, rival)
            if best is None and came:
                return Next(f'no force test of the menu separates {one} from {other}; '
                            + remedy_of(one, other))
            if best is not None:
                why = f'separates {one} from {other} (by {np.sqrt(best.separation):.0f} noise sd)'
                return Next(f'{best.words}: {why}', replace(best.protocol, notes=why))
    if finding.verdict in ('unexplained', 'partial'):
        shape = _shape(shapes, '')
        return Next('measure where the error is largest again, in finer steps and at two speeds'
                    + (f'; it looks like this: {shape}' if shape else ''),
                    finer(fitter.cells, chosen.model))
    if finding.verdict == 'recalibrate':
        moved, _ = max(zip(base.priors, base.u), key=lambda pair: abs(pair[1]))
        owner = moved.key.partition('.')[0]
        if owner == 'geometry':
            return Next('measure radius and braid angle with a calliper: they explain the error')
        return Next(f'use the refitted constants of {owner}: they moved most and cannot be '
                    'measured with a calliper')
    if fitter.cells.data.is_static:
        return Next('log a sweep up and down with time: a static map shows neither friction nor '
                    'memory', plain(fitter.cells, chosen.model))
    if certain:
        test = finer(fitter.cells, chosen.model)
        return Next(f'none needed to name {"it" if len(answer) == 1 else "them"}: the odds are '
                    f'more than {posterior.options.choices.odds:.3g} to 1 against all that was '
                    f'tried without; for narrower intervals, {test.name}', test)
    return Next('none needed within this range; to test the model further, widen it (beyond free '
                'strain, another speed)')


def _labels(posterior: Posterior, fit: Fit) -> list[str]:
    return [change.label for change in posterior.options.changes(fit.names)]


def _rival(posterior: Posterior, gone: Collection[str | Change],
           came: Collection[str | Change], chosen: Fit) -> Fit | None:
    """Return the most probable set without ``gone`` and with ``came``, changes or their labels."""
    for fit in posterior.fits:
        there = {*posterior.options.changes(fit.names), *_labels(posterior, fit)}
        if fit is not chosen and there.isdisjoint(gone) and there.issuperset(came):
            return fit
    return None


def notes_on(cells: Cells, floor: NoiseFloor, base: Fit, final: Fit, held: HeldOut,
             afresh: bool = False) -> tuple[str, ...]:
    """
    Return notes on the noise, rows left out, geometry that moved much, and the protocol.

    ``afresh`` as `Measurement.afresh`: the clock runs on, and yet the memory starts anew.
    """
    notes, data = [], cells.data
    if floor.note:
        notes.append(floor.note)
    left_out = int((cells.label < 0).sum())
    if left_out:
        why = ', '.join(f'{rows} {words}' for words, rows in cells.unused.items())
        averaged = (f' (averages of neighbours; the log has {cells.rows})'
                    if cells.rows > len(cells.label) else '')
        notes.append(f'{left_out} of {len(cells.label)} rows{averaged} are not used ({why}); on '
                     f'the others the best error is {_error_of_used(cells, final.model):.3g} N')
    if cells.one_force:
        assert cells.stiffness is not None
        notes.append(f'the force is constant ({data.force.mean():.3g} N): errors in N are those '
                     f"of the strain times the model's stiffness (100 N are "
                     f'{100.0 / np.median(cells.stiffness):.2g} of strain); mean, plane and '
                     'empirical form are a mean strain, a line and a cubic in the pressure')
        untried = ', '.join(name for name, law in catalogue.available().items()
                            if law.is_of_force_alone and law.candidate)
        notes.append('a single force determines neither the scale of the model nor a bias (not '
                     f'tried: {untried}): measure on a dynamometer, or with other weights')
    tables = [effect.name for effect in final.model.effects
              if effect.law.place is Place.RESIDUAL]
    if tables:
        notes.append(f'if {tables[0]} was made from these rows, the held-out errors are too '
                     'small: its table contains the rows that are left out')
    if not held.kinds:
        notes.append('the data have no folds to leave out: held-out errors are those of the fit')
    refits = [('recalibration alone', base)]
    if final is not base:
        refits.insert(0, ('the refit', final))
    for words, fit in refits:
        far = [f'{p.key} {u:+.1f}' for p, u in zip(fit.priors, fit.u)
               if abs(u) > TOLERANCES and p.key.startswith('geometry')]
        if far:
            notes.append(f'{words} moves the geometry beyond its tolerances: '
                         + ', '.join(far) + ' tolerances')
    anew = int(data.restart.sum()) - 1
    remembers = [effect.name for effect in final.model.effects if effect.law.memory]
    if anew and remembers and not data.is_static:
        why = ('the data are less probable if the muscle remembers the trial before' if afresh else
               'the clock pauses or goes back there, or a file begins')
        notes.append(f'the memory of {" and ".join(remembers)} starts anew at '
                     f'{counted(anew, "trial")}: {why}')
    for unit, pressure, limit in zip(final.model.motor_units, data.pressure.T,
                                     final.model.max_pressure):
        if pressure.max() > NOISE_MARGIN * limit:
            notes.append(f'{unit.name}: pressures up to {1e-3 * pressure.max():.4g} kPa are above '
                         f'the max_pressure of the model, {1e-3 * limit:.4g} kPa')
    if ascends(data):
        notes.append('isobars were run in ascending order: effects of pressure and of time cannot '
                     'be separated')
    return tuple(dict.fromkeys(notes))


def not_named(posterior: Posterior, chosen: Fit, mentioned: Iterable[str]) -> tuple[str, ...]:
    """
    Return sentences on effects of a probability above one half that are not in the answer.

    Such an effect improves the prediction (Barbieri and Berger 2004, Ann. Stat. 32, 870), but
    naming it needs more evidence: see `settings.LEAST_LOSS`.

    Parameters
    ----------
    chosen : Fit
        The set that is the answer.
    mentioned : iterable of str
        Labels that are named elsewhere, in ties and trades.
    """
    known = {*_labels(posterior, chosen), *mentioned}
    notes = []
    for label in posterior.labels():
        probability = posterior.of_label(label)
        if label in known or probability <= 0.5:
            continue
        why = ('it does not improve the prediction of held-out folds, or its constants are '
               'implausible' if is_enough(probability) else 'the evidence for it is weak')
        notes.append(f'{label} is likelier than not ({probability:.2f}) but not named: {why}')
    return tuple(notes)


def ascends(data: Measurement) -> bool:
    """Return whether the trials of a log are isobars in the order of rising pressure."""
    trials = [data.pressure[data.trial == k].sum(-1) for k in np.unique(data.trial)]
    if data.is_static or len(trials) < 3:
        return False
    means = np.array([trial.mean() for trial in trials])
    return bool(np.all(np.diff(means) > 0)
                and max(map(np.ptp, trials)) < 0.2 * np.ptp(means))
