# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ``fam_bundle campaign``: which muscles lack which effect, and correlations."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.campaign import Campaign
from fam_bundle_ros.campaign.trends import LEAST
from fam_bundle_ros.model.own_muscle import muscle_words
from fam_bundle_ros.report import campaign_figures as figures
from fam_bundle_ros.report.map_page import model_section
from fam_bundle_ros.report.page import Headline, Page, Picture, provenance, Section, Table
from fam_bundle_ros.told import counted, number

#: Largest number of trends that are drawn; all are in the table.
_DRAWN = 6
#: Number of recordings with the largest errors that are named.
_NAMED = 5
#: Longer tables are folded.
_LONG = 40


def campaign_page(result: Campaign, files: Sequence[tuple[str, str | Path]] = (),
                  more: Sequence[tuple[str, str]] = ()) -> Page:
    """
    Return the page of a campaign.

    ``files`` are (what it is, path): model, recipe, table of specimens; ``more`` are further rows
    (what, value) of provenance.
    """
    sections = [_missing(result), *([_trends(result)] if result.facts else []), _errors(result),
                _recordings(result), *_left_out(result),
                model_section(result.model)]
    computed = f'{result.computed} of {len(result.recordings)}'
    return Page(f'What {result.model.name} is missing, over {len(result.recordings)} recordings',
                _lead(result), _headline(result), sections,
                provenance(files, [*more, ('computed in this run', computed)]))


def _lead(result: Campaign) -> str:
    words = [f'{counted(len(result.counted), "recording")} of '
             f'{counted(len(result.muscles), "muscle")} were evaluated.']
    named = [share for share in result.shares if share.muscles][:3]
    words += [f'{share.effect} is missing in {share.muscles} of {share.of}.' for share in named]
    if result.counted and not named:
        words.append('No effect is missing in half of the recordings of any muscle.')
    words += [f'{each}.' for each in (*result.clear_contrasts[:2], *result.clear_trends[:3])]
    return ' '.join([*words, f'Model {muscle_words(result.model)}.'])


def _headline(result: Campaign) -> list[Headline]:
    duplicates = sum(bool(row['duplicate_of']) for row in result.recordings)
    doubtful = f', {len(result.doubtful)} to check first' if result.doubtful else ''
    cards = [Headline('Recordings', str(len(result.recordings)),
                      f'{len(result.failed)} failed, {counted(duplicates, "duplicate")}'
                      f'{doubtful}'),
             Headline('Muscles', str(len(result.muscles)))]
    if result.counted:
        verdict, count = next(iter(result.verdicts.items()))
        cards.append(Headline('Verdict', verdict.replace('_', ' '),
                              f'in {count} of {len(result.counted)}, the most frequent'))
        before, after = (float(np.median([row[key] for row in result.counted]))
                         for key in ('model_error_N', 'best_error_N'))
        cards += [Headline('Error of the model', f'{number(before)} N',
                           'rms, median of recordings'),
                  Headline('Best', f'{number(after)} N', 'with the effects found in each')]
    return cards


def _missing(result: Campaign) -> Section:
    verdicts = ', '.join(f'{name.replace("_", " ")} {count}'
                         for name, count in result.verdicts.items())
    items: list[Any] = []
    drawing = figures.lacking(result)
    if drawing is not None:
        items.append(Picture(
            'lacking', 'Which muscles lack which effect', drawing,
            'Probability that the effect belongs to the model, of each muscle (mean of its '
            'recordings). Dot: named in at least half of them. Ring: tied with another effect '
            'that the data cannot distinguish. Muscles that lack the same effects are adjacent.'))
        items.append(Table(
            ('effect', 'muscles that lack it', 'of', 'share (%)', '95 % from', 'to', 'tied'),
            [(('effect', s.effect), s.muscles, s.of, 100.0 * s.muscles / s.of, 100.0 * s.low,
              100.0 * s.high, s.tied) for s in result.shares],
            'The interval is for the share in the population, if these muscles are a random '
            'sample (Wilson). Tied: muscles in which the effect or another one is missing.'))
    if result.contrasts:
        items.append(Table(
            ('effect', 'number', 'lack it', 'their median', 'others', 'their median', 'p value'),
            [(('effect', c.effect), c.fact, c.lacking, c.median_lacking, c.others,
              c.median_others, c.p) for c in result.contrasts[:_LONG]],
            'Whether muscles that lack an effect differ from the others in a number of the table. '
            'p value: Mann-Whitney test, Holm correction for '
            f'{counted(len(result.contrasts), "test")}. A difference may also mean that the '
            'effect is easier to detect in these muscles.'))
    return Section('What is missing', f'Verdicts: {verdicts or "none"}.', items)


def _trends(result: Campaign) -> Section:
    clear = result.clear_trends
    asked = counted(len(result.trends), 'test')
    text = (f'{counted(len(clear), "significant trend")} of a parameter with a number of the '
            f'table ({asked}, Holm correction).' if clear else
            'No parameter has a significant trend with a number of the table '
            f'({asked}). A trend needs at least {LEAST} muscles in which the data determine the '
            'parameter.')
    text += ('\n\nA parameter of an effect is known only if the effect was named. Numbers of the '
             'table that are correlated (such as length and age) cannot be separated here.')
    items: list[Any] = []
    if clear:
        items.append(Picture(
            'trends', 'Parameters and their trends', figures.over_facts(clear[:_DRAWN]),
            'One point for each muscle with the 95 % interval of its fit; axes are logarithmic. '
            'Dashed: power law, each muscle weighted by the error of its fit and by the scatter '
            'between muscles. Intervals much wider than the scatter: the errors of the fits are '
            'correlated, because the parameter is confounded with another.'))
    if result.trends:
        items.append(Table(
            ('parameter', 'trend with', 'power', '95 % from', 'to', 'muscles', 'scatter (%)',
             'p value'),
            [(t.parameter, t.fact, t.power, t.power_low, t.power_high, len(t.values),
              100.0 * t.scatter, t.p) for t in result.trends[:_LONG]],
            'Scatter: differences between muscles beyond the errors of their fits. p value: for a '
            'true power of 0.'))
    return Section('Trends of parameters', text, items)


def _errors(result: Campaign) -> Section:
    if not result.counted:
        return Section('Errors', 'No recording could be evaluated.')
    highest = sorted(result.counted, key=_over_noise, reverse=True)[:_NAMED]
    text = 'Largest errors with the effects found, in multiples of the noise: ' + ', '.join(
        f"{row['file']} {number(_over_noise(row), 2)}" for row in highest) + '.'
    return Section('Errors', text, [Picture(
        'errors', 'Error of each recording', figures.errors(result),
        'Rms over all rows. If the best model is well above the noise floor, no effect of the '
        'catalogue explains the remaining error.')])


def _over_noise(row: dict[str, Any]) -> float:
    """Return the error with the effects found, relative to the noise."""
    return float(row['best_error_N'] / max(row['noise_floor_N'], 1e-9))


def _recordings(result: Campaign) -> Section:
    rows = [(row['file'], row['muscle'], row['verdict'].replace('_', ' '),
             '; '.join(part for part in (row['effects'], row['replaced'],
                                         row['removed'] and f"without {row['removed']}") if part),
             row['tied'], row['model_error_N'], row['best_error_N'], row['held_out_N'],
             row['noise_floor_N'], _over_noise(row)) for row in result.counted]
    return Section('Recordings', '', [Table(
        ('file', 'muscle', 'verdict', 'effects', 'tied', 'error (N)', 'best (N)', 'held out (N)',
         'noise (N)', 'best / noise'), rows)] if rows else [], folded=len(rows) > _LONG)


def _left_out(result: Campaign) -> list[Section]:
    items = []
    if result.doubtful:
        used = any(row['counted'] for row in result.doubtful)
        items.append(Table(
            ('file', 'check first', 'error (N)', 'noise (N)'),
            [(row['file'], row['check_first'], row['model_error_N'], row['noise_floor_N'])
             for row in result.doubtful],
            'Counted all the same (--as-read).' if used else
            'Not counted: correct the unit or sign in the file or in the recipe, and start again. '
            'If the data are right, --as-read counts them.'))
    if result.failed:
        items.append(Table(('file', 'why it failed'),
                           [(row['file'], row['error']) for row in result.failed]))
    twice = [row for row in result.recordings if row['duplicate_of']]
    if twice:
        items.append(Table(('file', 'is identical to'),
                           [(row['file'], row['duplicate_of']) for row in twice]))
    strange = [row for row in result.counted if not row['in_table']] if result.facts else []
    if strange:
        items.append(Table(('evaluated, but not in the table of specimens', 'dimensions'),
                           [(row['file'], 'those of the model') for row in strange]))
    return [Section('Left out, or in doubt', '', items)] if items else []
