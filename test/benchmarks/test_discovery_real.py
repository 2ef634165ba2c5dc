# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Discovery on measured muscles: what is kept away, and the score there."""

import numpy as np
import pytest

from fam_bundle_ros.benchmarks.discovery_real import measured, score, Split, splits, summary
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import read_measurement
from fam_bundle_ros.errors import InputError


@pytest.fixture
def shipped(repository):
    """Return the measured map that ships, and its model file."""
    (found,) = measured(repository / 'config' / 'data')
    return found


def test_a_map_keeps_inner_strain_levels_and_isobars_away(shipped):
    """Four inner levels of six, then ten draws of five isobars; never the outermost."""
    data = read_measurement(shipped[0])
    kept = list(splits(data))
    assert [words.split()[0] for words, _ in kept] == ['strain'] * 4 + ['5'] * 10
    for words, test in kept:
        column = data.strain if words.startswith('strain') else data.pressure[:, 0]
        assert column[~test].min() < column[test].min()
        assert column[~test].max() > column[test].max()
        assert len(np.unique(column[test].round(3))) == (1 if column is data.strain else 5)


def test_a_log_keeps_whole_trials_away():
    """A third of nine trials, and no row of them to train on."""
    trial = np.repeat(np.arange(9), 20)
    time = np.tile(np.arange(20) * 0.1, 9)
    data = build('log', 0.1 + 0.1 * np.sin(7.0 * time), np.full((180, 1), 2e5), 50.0 + time, trial,
                 time)
    kept = list(splits(data, draws=4))
    assert len(kept) == 4
    for _, test in kept:
        assert len(set(trial[test])) == 3
        assert not set(trial[test]) & set(trial[~test])


def test_a_measured_muscle_is_explained_better_than_by_six_free_numbers(shipped):
    """DMSP-20 with five isobars away: named, and nearer on them than the empirical form."""
    data = read_measurement(shipped[0])
    away, test = list(splits(data))[5]
    row = score(Split(*shipped, away, test))
    assert row['verdict'] in ('missing_effect', 'partial')
    assert {'slack', 'bladder', 'end_caps'} <= set(row['families'])
    assert row['held_out_N'] < row['empirical_N'] < 6.0
    found = summary([row, {**row, 'ratio': 3.0, 'effects': [], 'families': ['slack']}])
    assert (found['splits'], found['named'], found['worst']) == (2, 1, 3.0)
    assert found['always'] == {row['data']: ('slack',)}


def test_a_folder_without_models_fails(tmp_path):
    """A measurement alone cannot be judged: the folder is named, and what it needs."""
    (tmp_path / 'run.csv').write_text('strain,pressure [kPa],force [N]\n')
    with pytest.raises(InputError, match=r'with a model NAME\.model\.yaml'):
        measured(tmp_path)
