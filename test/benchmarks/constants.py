#!/usr/bin/env python3
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every constant of the search for missing effects, doubled and halved: what answers change.

    python test/benchmarks/constants.py --cases 200 --rows constants.jsonl --page docs/...

Simulated cases of `fam_bundle benchmark-discovery`, the practice cases, and measured muscles with
rows kept away. One case is diagnosed once for each constant and factor before the next case
begins, and each answer is appended to ``--rows``: a run that was ended goes on where it was, and
the table is of the cases that are complete.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import zip_longest
import json
from pathlib import Path
from typing import Any

import numpy as np

from fam_bundle_ros.atomic import write_whole
from fam_bundle_ros.benchmarks import discovery, discovery_real
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery import diagnose, settings
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.model import load_model
from fam_bundle_ros.report.numbers import number

ROOT = Path(__file__).resolve().parents[2]
#: What the rows of a run are compared with.
AS_IT_IS = ('as it is', 1.0)
#: An effect that is smaller than this cannot be found (noise standard deviations).
VISIBLE = 0.2


def constants() -> dict[str, Any]:
    """Return every number that the search goes by: a user's choices, then `settings`."""
    found = {f'Choices.{name}': value for name, value in vars(Choices()).items()}
    return {**found, **{name: value for name, value in vars(settings).items()
                        if name.isupper()}}


def changed(value: Any, factor: float) -> Any:
    """Return a constant times a factor; a count stays a whole number, at least 1."""
    if isinstance(value, int):
        return max(1, int(value * factor + 0.5))
    return value * factor


@contextmanager
def with_constant(name: str, factor: float) -> Iterator[Choices]:
    """Set one constant for a while; yields the choices of a user."""
    if name == AS_IT_IS[0]:
        yield Choices()
    elif name.startswith('Choices.'):
        name = name.removeprefix('Choices.')
        yield replace(Choices(), **{name: changed(getattr(Choices(), name), factor)})
    else:
        before = getattr(settings, name)
        setattr(settings, name, changed(before, factor))
        try:
            yield Choices()
        finally:
            setattr(settings, name, before)


@dataclass(frozen=True)
class Case:
    """One thing to diagnose: its name and what scores it."""

    name: str
    score: Callable[[Choices], dict[str, Any]]


def simulated(count: int) -> list[Case]:
    """Return so many cases of the benchmark, evenly from all its sets and kinds."""
    tasks = discovery.tasks(1 + count // 20)
    chosen = [tasks[int(k)] for k in np.linspace(0, len(tasks) - 1, count)]

    def case(task: discovery.Task) -> Case:
        def score(choices: Choices) -> dict[str, Any]:
            row = discovery.run(task, choices)
            right = (row['found'] if row['hidden'] else row['verdict_right'] if task.outsider
                     else not row['named'] and row['verdict'] != 'unexplained')
            blind = bool(row['hidden'] or task.outsider) and row['visible'] < VISIBLE
            return {'right': None if blind else bool(right),
                    'wrong': bool(row['confident_wrong']), 'verdict': row['verdict'],
                    'effects': row['effects']}
        hidden = '+'.join(task.hidden) or task.outsider or 'none'
        return Case(f'{task.group} {task.kind} {hidden} {task.form} {task.seed}', score)
    return [case(task) for task in chosen]


def practice(folder: Path) -> list[Case]:
    """Return the cases of a folder with `answers.json`."""
    answers = json.loads((folder / 'answers.json').read_text())

    def case(name: str, answer: dict[str, Any]) -> Case:
        def score(choices: Choices) -> dict[str, Any]:
            result = diagnose(load_model(folder / f'{name}.model.yaml'),
                              read_measurement(folder / f'{name}.csv'), choices=choices)
            named = {*result.effects, *(n for group in result.tied for n in group)}
            fits = result.verdict in (answer['verdict'], *answer['verdict_also'])
            known = {*answer['hidden'], *answer['also_right']} \
                if answer['verdict'] == 'missing_effect' else set()
            hit = bool(named & known) if known else not named
            return {'right': fits and hit, 'verdict': result.verdict,
                    'effects': list(result.effects),
                    'wrong': result.verdict == 'missing_effect' and not result.tied and not hit}
        return Case(f'practice {name}', score)
    return [case(name, answer) for name, answer in answers.items()]


def measured(folder: Path, count: int) -> list[Case]:
    """Return the measured muscles of a folder, each with so many of its splits."""
    def case(split: discovery_real.Split) -> Case:
        def score(choices: Choices) -> dict[str, Any]:
            row = discovery_real.score(split, choices)
            return {key: row[key] for key in ('verdict', 'effects', 'ratio', 'held_out_N')}
        return Case(f'{split.data.stem}, without {split.away}', score)

    found = []
    for data, model in discovery_real.measured(folder):
        every = list(discovery_real.splits(read_measurement(data)))
        for k in np.unique(np.linspace(0, len(every) - 1, min(count, len(every))).astype(int)):
            found.append(case(discovery_real.Split(data, model, *every[int(k)])))
    return found


def in_turn(*kinds: Sequence[Case]) -> list[Case]:
    """Return the cases one kind after the other, so that a short run has some of each."""
    return [case for turn in zip_longest(*kinds) for case in turn if case is not None]


def variants() -> list[tuple[str, float]]:
    """Return the constants as they are, then each halved and doubled."""
    return [AS_IT_IS, *((name, factor) for name in constants() for factor in (0.5, 2.0))]


def read_rows(path: Path) -> dict[tuple[str, str, float], dict[str, Any]]:
    """Return the rows of a file by case, constant and factor; none where there is no file."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines]
    return {(row['case'], row['constant'], row['factor']): row for row in rows}


def run(cases: Sequence[Case], path: Path) -> None:
    """Score what is not in the file yet, case by case, and append it."""
    for case in cases:
        done = read_rows(path)
        for name, factor in variants():
            if (case.name, name, factor) in done:
                continue
            with with_constant(name, factor) as choices:
                row = {'case': case.name, 'constant': name, 'factor': factor,
                       **case.score(choices)}
            with open(path, 'a', encoding='utf-8') as file:
                file.write(json.dumps(row) + '\n')
        print(f'{case.name}: done', flush=True)


# --- the table ---------------------------------------------------------------------------------

def complete(rows: dict[tuple[str, str, float], dict[str, Any]]) -> list[str]:
    """Return the cases that every constant and factor has a row of, in their order."""
    names = dict.fromkeys(case for case, _, _ in rows)
    return [case for case in names if all((case, *variant) in rows for variant in variants())]


def summed(rows: dict[tuple[str, str, float], dict[str, Any]], cases: Sequence[str],
           variant: tuple[str, float]) -> dict[str, Any]:
    """
    Return what one variant answers on all cases.

    Returns
    -------
    dict
        ``right`` and ``wrong`` (and confident) of ``judged`` cases whose truth is known and can
        be seen; ``named`` and the median and worst ``ratios`` of the measured splits; ``other``:
        cases whose effects are not those of the constants as they are.
    """
    here = [rows[(case, *variant)] for case in cases]
    base = [rows[(case, *AS_IT_IS)] for case in cases]
    judged = [(row, one) for row, one in zip(here, base) if one.get('right') is not None]
    ratios = [row['ratio'] for row in here if 'ratio' in row]
    return {'judged': len(judged), 'right': sum(bool(row['right']) for row, _ in judged),
            'wrong': sum(row['wrong'] for row, _ in judged),
            'named': sum(bool(row['effects']) for row in here if 'ratio' in row),
            'ratios': (float(np.median(ratios)), max(ratios)) if ratios else None,
            'other': sum(set(row['effects']) != set(one['effects'])
                         for row, one in zip(here, base))}


def cells(found: dict[str, Any]) -> list[str]:
    """Return the cells of one variant."""
    ratios = [number(value) for value in found['ratios']] if found['ratios'] else ['', '']
    return [f"{found['right']} of {found['judged']}", str(found['wrong']), str(found['named']),
            *ratios, str(found['other'])]


def shown(value: Any) -> str:
    """Return a constant as the table has it."""
    if isinstance(value, np.ndarray):
        return f'{number(float(value[value > 0].min()))} to {number(float(value.max()))}'
    return number(float(value))


def page(rows: dict[tuple[str, str, float], dict[str, Any]], command: str) -> str:
    """Return the page in Markdown: constants that change most first."""
    cases = complete(rows)
    if not cases:
        return ''
    base = summed(rows, cases, AS_IT_IS)
    lines = []
    for name, value in constants().items():
        both = [summed(rows, cases, (name, factor)) for factor in (0.5, 2.0)]
        lost = max(base['right'] - found['right'] + found['wrong'] - base['wrong']
                   for found in both)
        lines.append(((-lost, -max(found['other'] for found in both)), [
            [f'`{name}`', shown(value), word, *cells(found)]
            for word, found in zip(('half', 'double'), both)]))
    lines.sort(key=lambda line: line[0])
    head = ['constant', 'value', 'times', 'right', 'wrong and confident', 'named',
            'ratio (median)', 'ratio (worst)', 'other answer']
    table = [head, ['---'] * len(head), ['as they are', '', '', *cells(base)],
             *(row for _, pair in lines for row in pair)]
    text = '\n'.join(f"| {' | '.join(row)} |" for row in table)
    return f"""# Constants of the search

`{command}` (it goes on where it was ended; this page has the {len(cases)} cases that were \
complete, so read it as a first look: `--cases 200 --splits 14` takes a night)

Every number that the search for missing effects goes by (`fam_bundle_ros/discovery/settings.py`) \
is halved and doubled, one at a time, the most sensitive first. *Right* and *wrong and confident* \
count simulated cases whose truth is known; *named* and the *ratio* (error on rows kept away over \
that of a six-parameter empirical form) are of measured muscles; *other answer* counts the cases \
in which other effects are named than with the constants as they are. A grid is moved as a whole. \
A share that is doubled to 1 and more (`MOST_OF_IT`) asks for what nothing can reach.

{text}

The cases: {'; '.join(cases)}.
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is asked on the command line, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--cases', type=int, default=4, help='simulated cases (4)')
    parser.add_argument('--practice', type=Path, default=ROOT / 'test/data/practice',
                        help='folder with answers.json')
    parser.add_argument('--real', type=Path, default=ROOT / 'config/data',
                        help='folder of NAME.csv with NAME.model.yaml')
    parser.add_argument('--splits', type=int, default=2, help='splits of each measured muscle (2)')
    parser.add_argument('--rows', type=Path, default=Path('constants.jsonl'),
                        help='answers so far; is continued (constants.jsonl)')
    parser.add_argument('--page', type=Path, help='Markdown that is written at the end')
    parser.add_argument('--only-page', action='store_true', help='score nothing')
    asked = parser.parse_args(arguments)
    if not asked.only_page:
        run(in_turn(measured(asked.real, asked.splits), practice(asked.practice),
                    simulated(asked.cases)), asked.rows)
    text = page(read_rows(asked.rows), 'python test/benchmarks/constants.py --cases '
                f'{asked.cases} --splits {asked.splits}')
    if asked.page is None:
        print(text)
    elif text:
        write_whole(asked.page, text)


if __name__ == '__main__':
    main()
