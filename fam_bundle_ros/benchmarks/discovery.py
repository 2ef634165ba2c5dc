# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The discovery benchmark: how often the hidden effect is found, and how often a wrong one is named.

Every case comes from `discovery_cases`, which shares no code with the catalogue. Each figure is
printed with its target; the confusion table shows which effects were named instead.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
import time
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks import discovery_cases as make
from fam_bundle_ros.benchmarks.discovery_truth import OUTSIDERS
from fam_bundle_ros.campaign.pool import each, Progress
from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.diagnose import diagnose
from fam_bundle_ros.discovery.options import family, Options
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.jsonfile import plain

SETS = ('single', 'other', 'clean', 'parameters', 'outside', 'pairs', 'small')
_KINDS = ('static', 'dynamic', 'bundle')
#: Smallest rms of a hidden effect in the evaluation, after a refit of the model without it (in
#: standard deviations of the noise).
_VISIBLE = 0.2


@dataclass(frozen=True)
class Task:
    """One case to generate and diagnose."""

    group: str
    kind: str
    seed: int
    hidden: tuple[str, ...] = ()
    form: str = 'same'
    noise: str = 'white'
    off: float = 0.4
    outsider: str = ''
    size: float = 1.0


def tasks(cases: int, sets: Iterable[str] = SETS) -> list[Task]:
    """Return the benchmark's tasks: ``cases`` of each kind of data in each set."""
    found: list[Task] = []
    for group in sets:
        for kind in _KINDS:
            names = make.HIDEABLE[kind]
            for k in range(cases):
                if group in ('single', 'other'):
                    form = 'same' if group == 'single' else 'other'
                    found.append(Task(group, kind, k, (names[k % len(names)],), form))
                elif group == 'clean':
                    for noise in ('white', 'ar', 'outliers'):
                        found.append(Task(f'clean {noise}', kind, k, noise=noise, off=0.0))
                elif group == 'parameters':
                    found.append(Task(group, kind, k, off=0.8))
                elif group == 'outside':
                    name = OUTSIDERS[k % len(OUTSIDERS)]
                    found.append(Task(group, kind, k, outsider=name))
                elif group == 'pairs' and kind in make.PAIRS:
                    pair = make.PAIRS[kind][k % len(make.PAIRS[kind])]
                    found.append(Task(f'pairs {kind}', kind, k, pair))
                elif group == 'small' and kind == 'static':
                    found.append(Task(group, kind, k, ('coulomb_friction',), size=0.045))
    return found


def run(task: Task, choices: Choices | None = None) -> dict[str, Any]:
    """Generate a case, diagnose it, and return the evaluation as plain numbers."""
    case = make.make_case(task.kind, task.seed, task.hidden, task.form, task.noise, task.off,
                          task.outsider, task.size)
    begun = time.process_time()
    result = diagnose(case.model, case.data, choices=choices)
    seconds = time.process_time() - begun
    visible = visible_rms(case)
    named = set(result.effects)
    right = [{name, *make.SAME_PHYSICS.get(name, ())} for name in case.hidden]
    ranking = [entry.effect for entry in result.ranking]
    ties = [set(group) for group in result.tied]

    def covers(want: set[str]) -> bool:
        return bool(named & want) or any(group & want and group & named for group in ties)

    found = bool(right) and all(map(covers, right))
    first = ranking[0] if ranking else ''
    families = {family(name) for name in case.hidden}
    row: dict[str, Any] = {
        'group': task.group, 'kind': task.kind, 'case': case.name, 'hidden': list(case.hidden),
        'outsider': task.outsider, 'verdict': result.verdict, 'effects': list(result.effects),
        'shapes': list(result.shapes), 'tied': [list(group) for group in result.tied],
        'visible': visible, 'size': case.size, 'seconds': seconds, 'noise': case.noise,
        'error_over_floor': result.error_N['best'] / case.noise,
        'verdict_right': result.verdict in case.verdicts,
        'found': found, 'exact': found and len(named) == len(right),
        'top_three': bool(right) and any(want & set(ranking[:3]) for want in right)
        and (len(right) == 1 or all(want & set(ranking[:6]) for want in right)),
        'family': bool(families & {family(n) for n in result.effects}) or any(
            families & {family(n) for n in group} for group in ties),
        'probability': result.ranking[0].probability if ranking else 0.0, 'first': first,
        'confident_wrong': bool(named) and not found
        and result.verdict == 'missing_effect' and not result.tied,
        'named': bool(named),
    }
    row.update(_parameters(case, result))
    return plain(row)


def visible_rms(case: make.Case) -> float:
    """Return the rms error of the refitted model without the hidden effect, in noise sd."""
    cells = reduce(case.model, case.data)
    search = Search(Options(case.model, cells, Choices()))
    base = search.fitter.without_discrepancy(search.fit(search.options.own))
    return rms(predict(base.model, case.data) - case.shown_force) / case.noise


def _parameters(case: make.Case, result: Any) -> dict[str, Any]:
    """Return relative errors of the parameters that have the same meaning, and their coverage."""
    errors, inside, flagged = [], [], []
    if case.form == 'same':
        known = {e.key: e for e in result.parameters}
        for key, truth in case.parameters.items():
            estimate = known.get(key)
            if estimate is None or truth == 0:
                continue
            errors.append(abs(estimate.si - truth) / abs(truth))
            low, high = estimate.si_interval
            inside.append(bool(low <= truth <= high))
            flagged.append(bool(estimate.flag))
    return {'parameter_errors': errors, 'inside': inside, 'flagged': flagged}


# --- the table ---------------------------------------------------------------------------------

def table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rates of correct answers, each with its target."""
    figures: list[dict[str, Any]] = []

    def add(measure: str, chosen: list[dict[str, Any]], value: Callable[[dict[str, Any]], Any],
            target: float, at_least: bool = True, reduce: Callable = np.mean) -> None:
        values = [value(row) for row in chosen]
        values = [item for v in values for item in (v if isinstance(v, list) else [v])]
        values = [v for v in values if v is not None]
        if not values:
            return
        reached = float(reduce(np.asarray(values, float)))
        figures.append({'measure': measure, 'cases': len(chosen), 'value': reached,
                        'target': target, 'at_least': at_least,
                        'met': reached >= target if at_least else reached <= target})

    def group(name: str) -> list[dict[str, Any]]:
        return [row for row in rows if row['group'] == name]

    def visible(name: str) -> list[dict[str, Any]]:
        return [row for row in group(name) if row['visible'] >= _VISIBLE]

    def false_alarm(row: dict[str, Any]) -> bool:
        return row['named'] or row['verdict'] == 'unexplained'

    for kind in _KINDS:
        seen, other = ([row for row in visible(name) if row['kind'] == kind]
                       for name in ('single', 'other'))
        add(f'true effect or a tie with it first, {kind}', seen, lambda r: r['found'], 0.95)
        add(f'in the top three, {kind}', seen, lambda r: r['found'] or r['top_three'], 0.98)
        add(f'wrong and confident, {kind}', seen, lambda r: r['confident_wrong'], 0.02, False)
        add(f'right family, other form, {kind}', other, lambda r: r['family'], 0.90)
        add(f'true effect or a tie, other form, {kind}', other, lambda r: r['found'], 0.90)
    for noise in ('white', 'ar', 'outliers'):
        add(f'false discovery, {noise} noise', group(f'clean {noise}'), false_alarm, 0.02, False)
    add('parameter errors named as an effect', group('parameters'), false_alarm, 0.02, False)
    outside = visible('outside')
    add('outside the library: unexplained or partial', outside,
        lambda r: r['verdict'] in ('unexplained', 'partial'), 0.80)
    add('outside the library: a wrong name', outside, lambda r: r['named'], 0.10, False)
    for kind, target in (('static', 0.85), ('dynamic', 0.75)):
        add(f'two effects both found, nothing else, {kind}', group(f'pairs {kind}'),
            lambda r: r['exact'], target)
    good = [r for r in group('single') if r['found']]
    add('error after adding over the noise (median)', good, lambda r: r['error_over_floor'],
        1.05, False, np.median)
    add('parameter error (median)', good, lambda r: r['parameter_errors'], 0.05, False, np.median)
    add('95 % intervals that hold the truth, or flagged', good,
        lambda r: [a or b for a, b in zip(r['inside'], r['flagged'])], 0.85)
    add('effect of 0.2 noise sd found',
        [r for r in group('small') if 0.15 <= r['size'] <= 0.3], lambda r: r['found'], 0.90)
    add('seconds per case (median)', rows, lambda r: r['seconds'], 3.0, False, np.median)
    return figures


def calibration(rows: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Return the stated probability of the first candidate and how often it was correct."""
    chosen = [r for r in rows if r['group'] in ('single', 'other') and r['named']
              and r['visible'] >= _VISIBLE]
    edges = (0.0, 0.5, 0.75, 0.9, 0.98, 1.01)
    out = []
    for low, high in zip(edges[:-1], edges[1:]):
        part = [r for r in chosen if low <= r['probability'] < high]
        if part:
            right = [any(r['first'] in (name, *make.SAME_PHYSICS.get(name, ()))
                         for name in r['hidden']) for r in part]
            out.append({'claimed': float(np.mean([r['probability'] for r in part])),
                        'right': float(np.mean(right)), 'cases': float(len(part))})
    return out


def confusion(rows: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """Return the wrong answers for each hidden effect, with their number."""
    wrong: dict[str, Counter] = {}
    for row in rows:
        bad = not row['found'] if row['hidden'] else (
            row['named'] or (row['verdict'] == 'unexplained' and not row['outsider'])
            or (bool(row['outsider']) and row['verdict'] not in ('unexplained', 'partial')))
        if bad:
            truth = f"{row['group']}: {'+'.join(row['hidden']) or row['outsider'] or 'none'}"
            answer = '+'.join(row['effects']) or row['verdict']
            wrong.setdefault(truth, Counter())[answer] += 1
    return {truth: dict(counter.most_common()) for truth, counter in sorted(wrong.items())}


def benchmark(cases: int = 150, sets: Iterable[str] = SETS, processes: int | None = None,
              progress: Progress = None, scheduler: str | None = None) -> dict[str, Any]:
    """
    Run the benchmark.

    Parameters
    ----------
    cases : int
        Number of cases of each kind of data in each set.
    sets : iterable of str
        Some of `SETS`.
    processes, progress, scheduler
        See `campaign.pool.each`.

    Returns
    -------
    dict
        ``rows`` (one per case), ``table``, ``calibration``, ``confusion``.
    """
    rows = each(run, tasks(cases, sets), processes, progress, scheduler)
    return {'rows': rows, 'table': table(rows), 'calibration': calibration(rows),
            'confusion': confusion(rows)}
