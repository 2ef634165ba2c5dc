# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
How many small faults the tests notice: ``make mutants`` (one or two hours; not in ``make test``).

In copies of the committed tree, without numba: coverage says which tests run which line and how
long they take; places to break are drawn at random (seeded), cosmic-ray breaks them one at a
time, and the tests that run the line are run until one fails. Results go to a file that a second
call goes on with. Tests that take long are left out: what is noticed is a lower bound.

    scripts/mutants.py FOLDER [COUNT] [SEED] [JOBS]
"""

from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
import difflib
from functools import cache
import json
import os
from pathlib import Path
import random
import signal
import sqlite3
import subprocess
import sys
import time

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from coverage.numbits import numbits_to_nums

#: Those whose tests take longest come last.
ROOMS = ('model', 'plant', 'data', 'control', 'discovery')
OPERATORS = (
    'NumberReplacer', 'AddNot', 'ReplaceTrueWithFalse', 'ReplaceFalseWithTrue',
    'ReplaceAndWithOr', 'ReplaceOrWithAnd', 'ZeroIterationForLoop', 'ReplaceBreakWithContinue',
    'ReplaceUnaryOperator_Delete_Not', 'ReplaceUnaryOperator_USub_UAdd',
    *(f'ReplaceBinaryOperator_{a}' for a in ('Add_Sub', 'Sub_Add', 'Mul_Div', 'Div_Mul',
                                             'Pow_Mul', 'Mod_Add')),
    *(f'ReplaceComparisonOperator_{a}' for a in (
        'Eq_NotEq', 'NotEq_Eq', 'Lt_LtE', 'Lt_GtE', 'LtE_Lt', 'LtE_Gt', 'Gt_GtE', 'Gt_LtE',
        'GtE_Gt', 'GtE_Lt', 'Is_IsNot', 'IsNot_Is')))
#: s on a core; a test that takes longer when traced is left out.
LONGEST = 10
#: s of tests, as traced, that are run for one place; s after which they hang.
EFFORT, PATIENCE = 25, 600


def environment(tree, **more):
    """Return the environment of tests in a copy: its own code, no compiler, one core."""
    return {**os.environ, 'FAM_BUNDLE_PLAIN': '1', 'OMP_NUM_THREADS': '1', 'CI': '1',
            'PYTHONPATH': f'{tree}:{Path(__file__).parent.resolve()}',
            'PYTHONDONTWRITEBYTECODE': '1', **more}


def copies_of_head(folder, count):
    """Return clones of the committed tree; what an interrupted call broke is mended."""
    trees = [folder / f'tree{i}' for i in range(count)]
    for tree in trees:
        if not tree.exists():
            subprocess.run(['git', 'clone', '-q', '.' if tree is trees[0] else trees[0], tree],
                           check=True)
        subprocess.run(['git', 'checkout', '-q', '.'], cwd=tree, check=True)
        # Known by hash, not by time: a place may be broken and mended within one tick.
        subprocess.run([sys.executable, '-m', 'compileall', '-q', '--invalidation-mode',
                        'checked-hash', 'fam_bundle_ros'], cwd=tree, check=True)
    return trees


def trace(tree, room, folder):
    """Run the tests and doctests of a room under coverage, once for all later calls."""
    if (folder / f'{room}.json').exists():
        return
    more = {'MUTANTS_TRACE': f'{folder}/{room}.json', 'MUTANTS_LONGEST': str(LONGEST)}
    with (folder / f'{room}.log').open('w') as log:
        subprocess.run(
            [sys.executable, '-m', 'coverage', 'run', '--source=fam_bundle_ros',
             f'--data-file={folder}/{room}.coverage', '-m', 'pytest', '-q', '--tb=no',
             '-p', 'mutants_trace', '-p', 'no:cacheprovider', f'test/{room}',
             f'fam_bundle_ros/{room}'], cwd=tree, env=environment(tree, **more), stdout=log)


class Tests:
    """The tests of some rooms that run a line, and what they cost."""

    def __init__(self, folder, rooms):
        self.users, self.seconds, self.lines = {}, {}, defaultdict(set)
        for room in rooms:
            told = json.loads((folder / f'{room}.json').read_text())
            self.users.update(told['tests'])
            self.seconds.update(told['seconds'])
            for path, name, bits in sqlite3.connect(folder / f'{room}.coverage').execute(
                    'select file.path, context.context, line_bits.numbits from line_bits '
                    'join file on file.id = file_id join context on context.id = context_id'):
                file = 'fam_bundle_ros' + path.rpartition('/fam_bundle_ros')[2]
                for line in numbits_to_nums(bits):
                    self.lines[file, line].add(name)

    def of(self, path, line):
        """Return the tests of a line, the quick before the slow, as long as there is time."""
        names = self.lines[path, line] - {''}
        if not names:   # runs at import: the tests of the file
            names = set().union(*(found for (file, _), found in self.lines.items()
                                  if file == path))
        able = sorted((test for test, used in self.users.items()
                       if test in names or names.intersection(used)),
                      key=lambda test: self._cost(test, ()))
        chosen, made, cost = [], set(), 0.
        for test in able:
            cost += self._cost(test, made)
            if cost > EFFORT and chosen:
                break
            chosen.append(test)
            made.update(self.users[test])
        return chosen

    def _cost(self, test, made):
        return self.seconds[test] + sum(self.seconds[fixture] for fixture in self.users[test]
                                        if fixture not in made and fixture in self.seconds)


def places(tree):
    """Return {(file, position): changes that can be made there}."""
    found = defaultdict(list)
    for path in sorted(file for room in ROOMS
                       for file in (tree / 'fam_bundle_ros' / room).rglob('*.py')):
        nodes = list(ast_nodes(get_ast(path.read_text())))
        for name in OPERATORS:
            operator, occurrence = get_operator(f'core/{name}')(), 0
            for node in nodes:
                for start, _ in operator.mutation_positions(node):
                    found[str(path.relative_to(tree)), start].append((name, occurrence))
                    occurrence += 1
    return found


def noticed(tree, path, change, tests):
    """Return whether a test fails, or hangs, with one change of a file; and the change."""
    name, occurrence = change
    file = tree / path
    right = file.read_text()
    wrong = mutate_code(right, get_operator(f'core/{name}')(), occurrence)
    diff = ''.join(difflib.unified_diff(right.splitlines(True), wrong.splitlines(True),
                                        f'a/{path}', f'b/{path}'))
    if not tests:
        return False, diff
    file.write_text(wrong)
    running = subprocess.Popen(
        [sys.executable, '-m', 'pytest', '-x', '-q', '--tb=no', '-p', 'no:cacheprovider', *tests],
        cwd=tree, env=environment(tree), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True)
    try:
        return running.wait(PATIENCE) != 0, diff
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
        return True, diff
    finally:
        file.write_text(right)


def main(folder, count=200, seed=1, jobs=2):
    """Break `count` places; print what the tests did not notice."""
    folder.mkdir(exist_ok=True)
    trees = copies_of_head(folder, jobs)
    changes = places(trees[0])
    results = folder / f'mutants_{seed}.jsonl'
    done = {tuple(row['place']) for row in map(json.loads, results.open())
            } if results.exists() else set()
    chance = random.Random(seed)
    drawn = {place: chance.choice(changes[place])
             for place in chance.sample(sorted(changes), count)}
    room_of = {place: place[0].split('/')[1] for place in drawn}

    def run(work, *arguments):
        tree = trees.pop()
        try:
            return work(tree, *arguments)
        finally:
            trees.append(tree)

    def judge(place, rooms, last=False):
        (path, start), change, began = place, drawn[place], time.perf_counter()
        for room in rooms:
            traced[room].result()
        found, diff = run(noticed, path, change, known(rooms).of(path, start[0]))
        if not (found or last):
            # One that its own tests do not notice may be noticed by those of another package.
            others = tuple(room for room in ROOMS if room not in rooms)
            work.append(pool.submit(judge, place, others, last=True))
            return
        with results.open('a') as file:
            file.write(json.dumps({
                'place': [path, *start], 'change': change, 'diff': diff, 'noticed': found,
                'by': rooms if found else [], 'seconds': round(time.perf_counter() - began, 1),
            }) + '\n')
        print(f"{'noticed' if found else 'SURVIVED'} {path}:{start[0]} {change[0]}", flush=True)

    known = cache(lambda rooms: Tests(folder, rooms))
    with ThreadPoolExecutor(jobs) as pool:
        # First in, first out: what waits for a trace comes after it.
        traced = {room: pool.submit(run, trace, room, folder) for room in ROOMS}
        work = [pool.submit(judge, place, (room_of[place],))
                for place in sorted(drawn, key=lambda place: ROOMS.index(room_of[place]))
                if (place[0], *place[1]) not in done]
        for task in work:   # grows
            task.result()
    rows = [json.loads(line) for line in results.open()]
    print(f"{sum(row['noticed'] for row in rows)} of {len(rows)} faults noticed; the others:")
    for row in rows:
        if not row['noticed']:
            print(row['diff'])


if __name__ == '__main__':
    main(Path(sys.argv[1]).resolve(), *map(int, sys.argv[2:]))
