#!/usr/bin/env python3
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every constant of the search for missing effects, doubled and halved: what answers change.

    python test/benchmarks/constants.py --cases 200 --rows constants.jsonl --page docs/...

Simulated cases of `fam_bundle benchmark-discovery`, the practice cases, and measured muscles with
rows kept away. Each case is diagnosed with the constants as they are and with ``--changes`` of
the changed constants, so that all changes get the same number of cases; measured muscles get all
changes. The table compares each change with the constants as they are on the cases that had it.
Each answer is appended to ``--rows``: a run that was ended goes on where it was.
"""

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
from fam_bundle_ros.told import shown

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
    """One thing to diagnose: its name, what scores it, and whether it gets every change."""

    name: str
    score: Callable[[Choices], dict[str, Any]]
    whole: bool = False


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
        return Case(f'{split.data.stem}, without {split.away}', score, whole=True)

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


def shares(cases: int, changes: int) -> list[list[tuple[str, float]]]:
    """Return the variants of each case: as it is, then its share of the changes, none twice."""
    every = variants()[1:]
    draw = np.random.default_rng(0)
    turns = np.concatenate([draw.permutation(len(every))
                            for _ in range(1 + cases * changes // len(every))])
    return [[AS_IT_IS, *dict.fromkeys(every[i] for i in turns[k * changes:(k + 1) * changes])]
            for k in range(cases)]


def run(cases: Sequence[Case], changes: int, path: Path) -> None:
    """Score what is not in the file yet, case by case, and append it."""
    for case, share in zip(cases, shares(len(cases), changes)):
        done = read_rows(path)
        for name, factor in variants() if case.whole else share:
            if (case.name, name, factor) in done:
                continue
            with with_constant(name, factor) as choices:
                row = {'case': case.name, 'constant': name, 'factor': factor,
                       **case.score(choices)}
            with open(path, 'a', encoding='utf-8') as file:
                file.write(json.dumps(row) + '\n')
        print(f'{case.name}: done', flush=True)


# --- the table ---------------------------------------------------------------------------------

def summed(rows: dict[tuple[str, str, float], dict[str, Any]],
           variant: tuple[str, float]) -> dict[str, Any]:
    """
    Return what one variant answers beside the constants as they are, on the cases that had it.

    Returns
    -------
    dict
        ``cases``; ``judged``: those whose truth is known and can be seen; of these ``right`` and
        ``wrong`` (and confident), and ``was_right`` and ``was_wrong`` with the constants as they
        are; ``other``: cases whose effects are other ones; the median and the worst ``ratio`` of
        the errors on the rows that were kept away of measured muscles, None without such cases.
    """
    pairs = [(row, rows[(case, *AS_IT_IS)]) for (case, *of), row in rows.items()
             if tuple(of) == variant]
    judged = [pair for pair in pairs if pair[1].get('right') is not None]
    ratios = [row['held_out_N'] / base['held_out_N'] for row, base in pairs if 'ratio' in row]

    def count(key: str, which: int) -> int:
        return sum(bool(pair[which][key]) for pair in judged)

    return {'cases': len(pairs), 'judged': len(judged),
            'right': count('right', 0), 'was_right': count('right', 1),
            'wrong': count('wrong', 0), 'was_wrong': count('wrong', 1),
            'other': sum(set(row['effects']) != set(base['effects']) for row, base in pairs),
            'ratio': (float(np.median(ratios)), max(ratios)) if ratios else None}


def cells(found: dict[str, Any]) -> list[str]:
    """Return the cells of one variant."""
    ratios = [shown(value) for value in found['ratio']] if found['ratio'] else ['', '']
    return [str(found['cases']), f"{found['right']} ({found['was_right']}) of {found['judged']}",
            f"{found['wrong']} ({found['was_wrong']})", str(found['other']), *ratios]


def written(value: Any) -> str:
    """Return a constant as the table has it."""
    if isinstance(value, np.ndarray):
        return f'{shown(float(value[value > 0].min()))} to {shown(float(value.max()))}'
    return shown(float(value))


def page(rows: dict[tuple[str, str, float], dict[str, Any]], command: str) -> str:
    """Return the page in Markdown: constants that change most first."""
    base = [row for (_, *of), row in rows.items() if tuple(of) == AS_IT_IS]
    judged = [row for row in base if row.get('right') is not None]
    lines = []
    for name, value in constants().items():
        both = [summed(rows, (name, factor)) for factor in (0.5, 2.0)]
        lost = max(found['was_right'] - found['right'] + found['wrong'] - found['was_wrong']
                   for found in both)
        lines.append(((-lost, -max(found['other'] for found in both)), [
            [f'`{name}`', written(value), word, *cells(found)]
            for word, found in zip(('half', 'double'), both)]))
    lines.sort(key=lambda line: line[0])
    head = ['constant', 'value', 'times', 'cases', 'right (before)',
            'wrong and confident (before)', 'other answer', 'error (median)', 'error (worst)']
    table = [head, ['---'] * len(head), *(row for _, pair in lines for row in pair)]
    text = '\n'.join(f"| {' | '.join(row)} |" for row in table)
    return f"""# Constants of the search

`{command}` (it goes on where it was ended)

Every number that the search for missing effects goes by (`fam_bundle_ros/discovery/settings.py`) \
is halved and doubled, one at a time, the most sensitive first. {len(base)} cases were diagnosed \
with the constants as they are; of the {len(judged)} of them whose truth is known and can be seen \
{sum(row['right'] for row in judged)} are right and {sum(row['wrong'] for row in judged)} wrong \
and confident. Each change was tried on the measured muscles and on its share of the other cases \
(drawn in turn, so that all have about as many); in parentheses is what the constants as they are \
answer on the same cases. *Other answer* counts the cases in which other effects are named; the \
*error* is that on rows kept away from measured muscles, over the one with the constants as they \
are. A grid is moved as a whole. A share that is doubled to 1 and more (`MOST_OF_IT`) asks for \
what nothing can reach.

{text}
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
    parser.add_argument('--changes', type=int, default=6, help='changes of each case (6)')
    parser.add_argument('--rows', type=Path, default=Path('constants.jsonl'),
                        help='answers so far; is continued (constants.jsonl)')
    parser.add_argument('--page', type=Path, help='Markdown that is written at the end')
    parser.add_argument('--only-page', action='store_true', help='score nothing')
    asked = parser.parse_args(arguments)
    if not asked.only_page:
        run(in_turn(measured(asked.real, asked.splits), practice(asked.practice),
                    simulated(asked.cases)), asked.changes, asked.rows)
    text = page(read_rows(asked.rows), 'python test/benchmarks/constants.py --cases '
                f'{asked.cases} --splits {asked.splits} --changes {asked.changes}')
    if asked.page is None:
        print(text)
    else:
        write_whole(asked.page, text)


if __name__ == '__main__':
    main()
