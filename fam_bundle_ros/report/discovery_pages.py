# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pages of discovery: a comparison, a diagnosis, a ladder of models."""

from collections.abc import Mapping, Sequence
from pathlib import Path
import re
from typing import Any

import numpy as np

from fam_bundle_ros.data.folds import KINDS
from fam_bundle_ros.discovery import (
    answer_figures,
    Comparison,
    Diagnosis,
    empirical_surface,
    figures,
    Ladder,
)
from fam_bundle_ros.discovery.result import KINDS as RECOMMENDED
from fam_bundle_ros.discovery.templates import SHARE
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.report.map_page import model_section
from fam_bundle_ros.report.page import Headline, Page, Picture, provenance, Section, Table
from fam_bundle_ros.told import number, shown

Files = Sequence[tuple[str, str | Path]]
#: Definition of the ladder's held-out error, for every caption.
HELD_OUT = ('Held out: each block of rows (trial, isobar or inner strain level) is predicted by a '
            'fit to the other blocks.')


def comparison_page(result: Comparison, model: Bundle, files: Files = ()) -> Page:
    """Return the page of ``fam_bundle compare``."""
    return Page(
        f'{model.name} against {result.data}',
        f'{_comparison_lead(result)} Model {muscle_words(model)}.',
        _comparison_headline(result),
        [*comparison_sections(result, model), model_section(model)],
        provenance(files, _data_rows(result)))


def comparison_sections(result: Comparison, model: Bundle) -> list[Section]:
    """Return measured against model, residual maps, loops, tables and noise."""
    words = {'rate': 'by speed', 'motor_unit': 'by motor unit'}
    tables = [Table((words.get(name, f'by {name}'), 'rows', 'error (N)', 'mean (N)',
                     'beyond noise'),
                    [(row['label'], row['samples'], row['error_N'], row['bias_N'],
                      row['beyond_noise']) for row in rows])
              for name, rows in result.tables.items() if len(rows) > 1]
    noise = result.noise
    return [
        Section('Measured and model', '', _comparison_pictures(result, model)),
        Section('Where it fails', 'Regions whose error is beyond noise, largest first. The share '
                'is of the squared error beyond noise; regions can overlap.',
                [Table(('region', 'error (N)', 'mean (N)', 'share (%)', 'rows'),
                       [(r.where, r.error_N, r.bias_N, 100.0 * r.share, r.samples)
                        for r in result.located])]) if result.located else
        Section('Where it fails', 'In no region is the error above the noise.'),
        Section('Error in numbers', '', tables),
        Section('Noise', f'The floor is {number(noise.value)} N, from {noise.basis}. '
                f'{_sentence(noise.note) if noise.note else ""}'
                f'\n\nLack of fit {number(result.lack_of_fit)}: mean square of the cell means, '
                'relative to noise alone; about 1 for a correct model.', [
                    Table(('method', 'noise (N)', 'noise that it measures'), [
                        ('second differences', noise.differences,
                         'white noise between neighbours'),
                        ('repeats', noise.repeats,
                         'all that is not reproducible at the same strain and pressure'),
                        ('visits', noise.visits,
                         'slow noise: means of whole visits to a cell')])]),
    ]


def diagnosis_page(result: Diagnosis, files: Files = ()) -> Page:
    """Return the page of ``fam_bundle diagnose``."""
    comparison = result.comparison
    error = result.error_N
    changes = [*result.effects,
               *(f'{new} in place of {old}' for old, new in result.replaced.items()),
               *(f'without {name}' for name in result.removed)]
    headline = [
        Headline('Verdict', result.verdict.replace('_', ' '), ', '.join(changes)),
        Headline('Error of the model', f"{number(error['model'])} N", 'rms, unchanged'),
        Headline('Recalibrated', f"{number(error['recalibrated'])} N",
                 'its own parameters refitted'),
        Headline('Best', f"{number(error['best'])} N", 'with the effects found'),
        Headline('Noise floor', f'{number(result.noise.value)} N', result.noise.basis)]
    return Page(
        f'What {result.model.name} is missing',
        ' '.join(map(_sentence, (
            result.summary, *(f'check first: {slip}' for slip in comparison.slips))))
        + f' Model {muscle_words(result.model)}.', headline,
        [*diagnosis_sections(result),
         *comparison_sections(comparison, result.model),
         model_section(result.best, 'Best model')],
        provenance(files, [*_data_rows(comparison),
                           ('rows left out of the fit', str(result.rows_left_out)),
                           ('time taken', f'{result.seconds:.1f} s')]))


def _sentence(text: str) -> str:
    """Return a phrase as a sentence; a name of an effect or unit is not capitalised."""
    named = re.search(r'[_:\d]', text.partition(' ')[0])
    return f'{text}.' if named else f'{text[:1].upper()}{text[1:]}.'


def diagnosis_sections(result: Diagnosis) -> list[Section]:
    """Return candidates, ladder, parameters with intervals, and what to measure next."""
    sections = [_missing_section(result)]
    if result.shapes_left:
        sections.append(Section(
            'The remaining error', 'No effect of the catalogue explains it. These simple shapes '
            'describe it best; one with a formula can be added to a model as an expression. '
            f'Each explains a share {SHARE}, {shown(result.error_N["best"])} N rms.',
            [Table(('shape', 'formula', 'k', 'unit', 'explains (%)', 'takes (N rms)'),
                   [(t.words, t.expression or '', t.coefficient, t.unit, 100.0 * t.explained,
                     t.size_N)
                    for t in result.shapes_left])]))
    sections += _unseen_section(result)
    if len(result.ladder) > 1:
        sections.append(Section('Ladder', '', [ladder_picture(
            result.ladder, result.noise.value, result.held_out.rivals['empirical'])]))
    return [*sections, *_discrepancy_section(result), _parameters_section(result)]


def _missing_section(result: Diagnosis) -> Section:
    answered = result.verdict != 'unexplained'
    title = result.shortlist_title
    items: list[Any] = _if_drawn(
        'candidates', f'{title[:1].upper()}{title[1:]}', figures.candidates(result),
        'Probability that the effect belongs to the model, over all sets of effects that were '
        'fitted together with the model’s own parameters, on average without one isobar, strain '
        'level or trial; and the error of the best set with the effect.'
        + ('' if answered else ' Conditional on one of them being correct.'))
    sets = answer_figures.sets(result)
    if sets is not None:
        items.append(Picture('sets', 'Sets of effects', sets, _sets_words(result)))
    if result.ranking:
        items.append(Table(
            ('effect', 'family', 'probability' if answered else 'among these', 'error (N)',
             'parameters', 'why'),
            [(('effect', c.effect), c.family, round(c.probability, 2), c.error_N,
              '; '.join(f'{e.key.partition(".")[2]} {e.value:.4g} {e.unit}'.rstrip()
                        for e in c.parameters), c.why) for c in result.ranking]))
    ties = ' '.join(f'These data cannot distinguish {", ".join(group[:-1])} and {group[-1]}.'
                    for group in result.tied)
    after = _sentence(f'next: {result.next_experiment}')
    return Section('What is missing', f'{ties}\n\n{after}', items)


def _parameters_section(result: Diagnosis) -> Section:
    table = Table(('parameter', 'value', 'unit', '95 % from', 'to', 'tolerances moved', 'note'),
                  [(e.key, e.value, e.unit, *e.interval, e.tolerances, e.flag)
                   for e in result.parameters])
    return Section('Parameters', '\n\n'.join(map(_sentence, result.notes)), [
        *([table] if result.parameters else []),
        *_if_drawn(
            'priors', 'Each parameter before and after the data', answer_figures.priors(result),
            'Bars are 95 % intervals. The prior of the model’s own dimensions is their tolerance, '
            'that of an effect comes from the catalogue; constants that cannot be negative are on '
            'a logarithmic scale. Values beyond six widths are drawn at six. A posterior as wide '
            'as the prior: the data do not determine the parameter; one outside the grey '
            'contradicts the prior.'),
        *_if_drawn(
            'confounding', 'Which parameters trade off', figures.confounding(result),
            'Correlation of the estimates: near 1 or −1 the data determine only a combination of '
            'the two parameters.')])


def _if_drawn(key: str, title: str, drawing: Any, caption: str) -> list[Picture]:
    """Return a picture in a list, which is empty if there is nothing to draw."""
    return [] if drawing is None else [Picture(key, title, drawing, caption)]


def ladder_page(result: Ladder, orders: Mapping[str, Sequence[float]],
                files: Files = ()) -> Page:
    """Return the page of ``fam_bundle ladder``: the error after each model."""
    first, last = result.steps[0], result.steps[-1]
    items: list[Any] = [
        ladder_picture(result.steps, result.noise.value, result.rivals_N['empirical']),
        Table(('model', 'error (N)', 'refitted (N)', 'held out (N)', 'effects'),
              [(step['step'], step['error_N'], step['refitted_N'], step['held_out_N'],
                ', '.join(step['effects'])) for step in result.steps],
              'Error: the model as in its file. Refitted: with its own parameters fitted to '
              f'these data. {HELD_OUT} {result.doubt}'.rstrip())]
    sections = [Section('Ladder', '', items)]
    if len(orders) > 1:
        steps = len(next(iter(orders.values()))) - 1
        sections.append(Section(
            'In another order', 'The reduction of the error by an effect depends on the effects '
            'added before it; the error after the last step does not.',
            [Table(('order', 'refitted (N)', *(f'+ {k + 1} (N)' for k in range(steps))),
                   [(order, *errors) for order, errors in orders.items()])]))
    return Page(
        f'Ladder on {result.data}',
        f'The error goes from {number(first["error_N"])} N ({first["step"]}) to '
        f'{number(last["error_N"])} N ({last["step"]}); the noise floor is '
        f'{number(result.noise.value)} N.', [], sections, provenance(files))


def ladder_picture(steps: Sequence[Mapping[str, Any]], noise: float | None,
                   empirical: float | None = None) -> Picture:
    """Return the ladder with its caption."""
    return Picture('ladder', 'Error after each step', figures.ladder(steps, noise, empirical),
                   f'{HELD_OUT} The axis is logarithmic.')


def _sets_words(result: Diagnosis) -> str:
    chosen = next(each for each in result.likely if each.chosen)
    words = ('Probability of each set of changes to the model, over all sets that were fitted, on '
             'average without one isobar, strain level or trial. '
             f'Coloured: the reported set ({chosen}); the others by their difference from it.')
    if result.verdict == 'unexplained':
        return f'{words} Conditional on one of them being correct; the verdict is that none is.'
    if chosen.probability < max(each.probability for each in result.likely):
        words += (' More probable sets predict held-out rows worse, or are more probable only '
                  'when a part of the data is left out.')
    return words


def _unseen_section(result: Diagnosis) -> list[Section]:
    """Return the errors of the recommended model and of its rivals on held-out rows."""
    drawing = answer_figures.unseen(result)
    if drawing is None:
        return []
    found, rivals = result.recommended, result.held_out.rivals
    smooth = rivals.get(empirical_surface.NAME)
    return [Section(
        'On held-out rows', 'Whole blocks are held out in turn. The recommended model '
        f'({RECOMMENDED[found.kind]}) has an error of {number(found.held_out_N)} N rms on them.', [
            Picture('unseen', 'Predicted and measured on held-out rows', drawing,
                    'Each point is the mean of neighbouring rows in a held-out block. On the '
                    'line, prediction and measurement are equal. Below: measured minus '
                    'predicted.'),
            Table(('model', 'error on held-out rows (N)'), [
                ('effects alone', found.held_out_physics_N),
                ('effects with the discrepancy', found.held_out_discrepancy_N),
                ('six-parameter empirical form (after Sarosi 2015)', rivals['empirical']),
                *([('the form with a surface of its residual', smooth)] if smooth else []),
                ('plane in strain and pressure', rivals['plane']),
                ('mean force', rivals['mean'])]),
            Table(('held out', 'effects alone (N)', 'with the discrepancy (N)'),
                  [(KINDS[name], *errors) for name, errors in result.held_out.kinds.items()],
                  'Means of neighbouring rows, without the noise of single rows.')])]


def _discrepancy_section(result: Diagnosis) -> list[Section]:
    drawing = answer_figures.discrepancy(result)
    if drawing is None:
        return []
    before, after = (max(float(np.abs(part).max()) for part in (each.even, each.odd, each.filling))
                     for each in (result.leftover_before, result.leftover))
    return [Section('What no effect explains', '', [
        Picture('discrepancy', 'Discrepancy before and after', drawing,
                'Smooth surface through the residual of a model: original model, recalibrated, at '
                f'most {number(before)} N; best model, {number(after)} N. '
                'Even: the same in both directions of motion; odd: while shortening, with the '
                'opposite sign while lengthening; filling: at rest after a rise of the pressure, '
                'with the opposite sign after a fall. Before and after have different scales. '
                'Between the measured states it is interpolated.')])]


def _comparison_pictures(result: Comparison, model: Bundle) -> list[Picture]:
    data = result.measurement
    by = 'isobar' if figures.has_isobars(data) else 'time'
    return [
        Picture('comparison', f'Measured and model, by {by}', figures.comparison(result),
                'Points are measured, lines are the model. Below: measured minus model; the grey '
                'band is two standard deviations of the noise floor.'),
        Picture('maps', 'Residual over strain and pressure',
                figures.residual_maps(result, model),
                'Measured minus model. The part that is the same in both directions (even) '
                'indicates an elastic or a sensor effect, the part that changes sign with the '
                'direction (odd) friction, damping or lag. Dotted: the model’s free strain.'
                if not data.is_static else
                'Measured minus model, mean of each cell. The map is static: nothing in it can '
                'depend on direction or speed.'),
        *_if_drawn('loops', 'Residual by direction of motion', figures.loops(result),
                   'Two separate bands: hysteresis that the model lacks.')]


def _comparison_headline(result: Comparison) -> list[Headline]:
    return [
        Headline('Error', f'{number(result.error_N)} N',
                 f'rms, {number(100 * result.relative_error, 2)} % of the force'),
        Headline('Mean', f'{number(result.bias_N, sign=True)} N', 'measured minus model'),
        Headline('Largest', f'{number(result.largest_N)} N', ''),
        Headline('Noise floor', f'{number(result.noise.value)} N', result.noise.basis)]


def _comparison_lead(result: Comparison) -> str:
    ratio = result.error_N / max(result.noise.value, 1e-12)
    if not result.located:
        return (f'The error of the model is {number(result.error_N)} N rms; in no region is it '
                f'above the noise ({number(result.noise.value)} N).')
    worst = result.located[0]
    return (f'The error of the model is {number(result.error_N)} N rms, {number(ratio)} times '
            f'the noise. It fails most at: {worst.where} ({number(worst.error_N)} N rms).')


def _data_rows(result: Comparison) -> list[tuple[str, str]]:
    data = result.measurement
    rows = [('data', str(data).splitlines()[0])]
    rows += [('note on the data', note) for note in (*result.slips, *data.notes)]
    return rows
