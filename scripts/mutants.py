# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
How many small faults the tests notice: ``make mutants`` (hours; not part of ``make test``).

In a copy of the committed tree, without numba: coverage says which tests run which line; places
to break are drawn at random (seeded), cosmic-ray breaks them one at a time, and the tests that
run the line are run until one fails. Results go to a file that a second call goes on with.

    scripts/mutants.py FOLDER [COUNT] [SEED]
"""

from collections import defaultdict
import json
import os
from pathlib import Path
import random
import re
import shlex
import sqlite3
import subprocess
import sys
import time

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_item import MutationSpec, TestOutcome
from coverage.numbits import numbits_to_nums

ROOMS = ('model', 'plant', 'control', 'data', 'discovery')
OPERATORS = (
    'NumberReplacer', 'AddNot', 'ReplaceTrueWithFalse', 'ReplaceFalseWithTrue',
    'ReplaceAndWithOr', 'ReplaceOrWithAnd', 'ZeroIterationForLoop', 'ReplaceBreakWithContinue',
    'ReplaceUnaryOperator_Delete_Not', 'ReplaceUnaryOperator_USub_UAdd',
    *(f'ReplaceBinaryOperator_{a}' for a in ('Add_Sub', 'Sub_Add', 'Mul_Div', 'Div_Mul',
                                             'Pow_Mul', 'Mod_Add')),
    *(f'ReplaceComparisonOperator_{a}' for a in (
        'Eq_NotEq', 'NotEq_Eq', 'Lt_LtE', 'Lt_GtE', 'LtE_Lt', 'LtE_Gt', 'Gt_GtE', 'Gt_LtE',
        'GtE_Gt', 'GtE_Lt', 'Is_IsNot', 'IsNot_Is', 'In_NotIn', 'NotIn_In')))
#: Tests of a line that are run, those of few lines first; s for them.
MOST_TESTS, PATIENCE = 80, 900.0
#: Compares two kinds of controllers for minutes without numba; tests no number.
LEFT_OUT = '--ignore=test/control/test_benchmark.py'


def environment(tree):
    """Return the environment of tests in the copy: its own code, no compiler, one core."""
    return {**os.environ, 'PYTHONPATH': str(tree), 'FAM_BUNDLE_PLAIN': '1',
            'OMP_NUM_THREADS': '1', 'PYTHONDONTWRITEBYTECODE': '1'}


def copy_of_head(folder):
    """Return a clone of the committed tree."""
    tree = folder / 'tree'
    if not tree.exists():
        subprocess.run(['git', 'clone', '-q', '.', str(tree)], check=True)
    return tree


def tests_by_line(tree):
    """Return {file: {line: names of the test functions that run it}}."""
    found = tree / '.coverage'
    if not found.exists():
        (tree / '.coveragerc').write_text('[run]\nsource = fam_bundle_ros\n'
                                          'dynamic_context = test_function\n')
        subprocess.run([sys.executable, '-m', 'coverage', 'run', '-m', 'pytest', '-q', LEFT_OUT,
                        '-p', 'no:cacheprovider', *(f'test/{room}' for room in ROOMS)],
                       cwd=tree, env=environment(tree), check=True)
    table = defaultdict(lambda: defaultdict(list))
    rows = sqlite3.connect(found).execute(
        'select file.path, context.context, line_bits.numbits from line_bits '
        'join file on file.id = file_id join context on context.id = context_id')
    size = defaultdict(int)
    for path, name, bits in rows:
        lines = numbits_to_nums(bits)
        size[name] += len(lines)
        for line in lines:
            table[str(Path(path).relative_to(tree))][line].append(name)
    for lines in table.values():
        for names in lines.values():
            names.sort(key=lambda name: size[name])
    return table


def places(tree):
    """Return {(file, position): changes that can be made there}."""
    found = defaultdict(list)
    for path in sorted(file for room in ROOMS
                       for file in (tree / 'fam_bundle_ros' / room).rglob('*.py')):
        nodes = list(ast_nodes(get_ast(path.read_text())))
        for name in OPERATORS:
            operator, occurrence = get_operator(f'core/{name}')(), 0
            for node in nodes:
                for start, end in operator.mutation_positions(node):
                    found[str(path.relative_to(tree)), start].append(
                        (f'core/{name}', occurrence, start, end))
                    occurrence += 1
    return found


def command_of(tree, names):
    """Return the command that runs test functions by their name, ``module.function``."""
    files = {file.stem: file for file in (tree / 'test').rglob('test_*.py')}
    chosen = dict.fromkeys(
        f'{files[module].relative_to(tree)}::{function}'
        for module, function in (re.split(r'\.(?=[^.]*$)', name)[-2:] for name in names)
        for module in (module.split('.')[-1],) if module in files)
    tests = list(chosen)[:MOST_TESTS]
    return shlex.join([sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider',
                       *tests]) if tests else 'true'


def main(folder, count=200, seed=1):
    """Break `count` places; print what the tests did not notice."""
    tree = copy_of_head(folder.resolve())
    lines, changes = tests_by_line(tree), places(tree)
    results = folder / f'mutants_{seed}.jsonl'
    done = {tuple(row['place']) for row in map(json.loads, results.open())
            } if results.exists() else set()
    chance = random.Random(seed)
    os.environ.update(environment(tree))
    os.chdir(tree)
    for path, start in chance.sample(sorted(changes), count):
        name, occurrence, start, end = chance.choice(changes[path, start])
        if (path, *start) in done:
            continue
        began = time.perf_counter()
        outcome = mutate_and_test([MutationSpec(path, name, occurrence, start, end)],
                                  command_of(tree, lines[path].get(start[0], ())), PATIENCE)
        with results.open('a') as file:
            file.write(json.dumps({
                'place': [path, *start], 'operator': name, 'diff': outcome.diff,
                'killed': outcome.test_outcome is not TestOutcome.SURVIVED,
                'seconds': round(time.perf_counter() - began, 1)}) + '\n')
        print(f'{outcome.test_outcome.value:9} {path}:{start[0]} {name}', flush=True)
    rows = [json.loads(line) for line in results.open()]
    print(f"{sum(row['killed'] for row in rows)} of {len(rows)} faults noticed; the others:")
    for row in rows:
        if not row['killed']:
            print(row['diff'])


if __name__ == '__main__':
    main(Path(sys.argv[1]).resolve(), *map(int, sys.argv[2:]))
