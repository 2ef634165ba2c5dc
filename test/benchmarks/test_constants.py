# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The study of the search's constants: each is changed alone, and a run goes on where it was."""

from collections import Counter
import json

from fam_bundle_ros.discovery import settings

from . import constants as study


def test_each_constant_is_changed_alone_and_put_back():
    """Choices go by argument, the others by the module; counts stay whole."""
    before = {name: value for name, value in vars(settings).items() if name.isupper()}
    with study.with_constant('LEAST_LOSS', 2.0):
        assert settings.LEAST_LOSS == 6.0
        assert settings.BEAM == before['BEAM']
    with study.with_constant('BEAM', 0.5):
        assert settings.BEAM == 2
    with study.with_constant('Choices.odds', 0.5) as choices:
        assert choices.odds == 10.0
    assert all(vars(settings)[name] is value for name, value in before.items())
    assert {'Choices.unexplained', 'AMPLITUDES', 'MOST_OF_IT'} <= set(study.constants())


def test_every_change_is_tried_on_as_many_cases():
    """Each case takes its share in turn, after the constants as they are, and none twice."""
    shares = study.shares(cases=40, changes=6)
    assert all(share[0] == study.AS_IT_IS and len(set(share)) == len(share) for share in shares)
    tried = Counter(variant for share in shares for variant in share[1:])
    assert set(tried) == set(study.variants()[1:])
    assert max(tried.values()) - min(tried.values()) <= 2


def test_measured_muscles_get_every_change(tmp_path):
    """There are few of them; simulated cases get their share."""
    cases = [study.Case(name, lambda choices: {}, whole=name == 'muscle')
             for name in ('simulated', 'muscle')]
    study.run(cases, 6, tmp_path / 'rows.jsonl')
    count = Counter(case for case, _, _ in study.read_rows(tmp_path / 'rows.jsonl'))
    assert count == {'simulated': 7, 'muscle': len(study.variants())}
    muscles = study.measured(study.ROOT / 'config/data', 2)
    assert muscles
    assert all(case.whole for case in muscles)


def test_a_run_goes_on_where_it_was_ended(tmp_path):
    """Only missing rows are scored; a change is counted on the cases that had it."""
    path, scored = tmp_path / 'rows.jsonl', []

    def score(choices):
        scored.append(settings.LEAST_LOSS)
        good = settings.LEAST_LOSS < 6.0
        return {'right': good, 'wrong': not good, 'verdict': '', 'effects': ['a'] * good}

    changes = 2 * len(study.constants())
    study.run([study.Case('one', score)], changes, path)
    assert len(scored) == changes + 1
    lines = path.read_text().splitlines()
    path.write_text('\n'.join([*lines[:-3], '']))
    study.run([study.Case('one', score)], changes, path)
    assert len(scored) == changes + 1 + 3
    with open(path, 'a') as file:
        file.write(json.dumps({'case': 'unchanged', 'constant': 'as it is', 'factor': 1.0}) + '\n')
    page = study.page(study.read_rows(path), 'command')
    rows = [line for line in page.splitlines() if line.startswith('| `')]
    assert rows[0].startswith('| `LEAST_LOSS`')  # the most sensitive first
    assert '| double | 1 | 0 (1) of 1 | 1 (0) |' in rows[1]
