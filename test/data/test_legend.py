# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Columns whose names stand in lines above the table."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement

NAMES = 'time [s]', 'contraction [%]', 'pressure [kPa]', 'load cell [N]'


def write(path, log, legend, head, separator=','):
    """Write a log below a legend and a head."""
    rows = zip(log[0], 100 * log[1], log[2] / 1e3, log[3])
    path.write_text(legend + head + ''.join(
        separator.join(f'{cell:.5f}' for cell in row) + '\n' for row in rows))
    return path


@pytest.mark.parametrize(('entry', 'head', 'separator'), [
    ('# CH{} = {}\n', 'CH1,CH2,CH3,CH4\n', ','), ('ai {}: {}\n', 'AI1;AI2;AI3;AI4\n', ';'),
    ('# col {}: {}\n', '', ' '), ('# {}) {}\n', '', ' ')])
def test_names_of_a_legend(tmp_path, log, entry, head, separator):
    """They were not looked for: columns without names, or with the words of the last line."""
    legend = ''.join(entry.format(at, name) for at, name in enumerate(NAMES, 1))
    path = write(tmp_path / 'log.txt', log, legend, head, separator)
    data = read_measurement(path)
    assert np.allclose(data.time, log[0], atol=1e-4)
    assert np.allclose(data.strain, log[1], atol=1e-4)
    assert np.allclose(data.pressure[:, 0], log[2])
    assert np.allclose(data.force, log[3], atol=1e-4)
    assert any("is 'load cell [N]'" in note for note in data.notes)


def test_what_the_user_tells_counts_more(tmp_path, log):
    """A column that is told keeps its header, the others have the names of the legend."""
    legend = ''.join(f'CH{at} = {name}\n' for at, name in enumerate(NAMES, 1))
    path = write(tmp_path / 'log.csv', log, legend, 'CH1,CH2,CH3,CH4\n')
    data = read_measurement(path, columns={'force': 'CH4 * 2 N'})
    assert np.allclose(data.force, 2 * log[3], atol=1e-4)
    assert np.allclose(data.time, log[0], atol=1e-4)


def test_a_list_of_other_things_names_no_columns(tmp_path, log):
    """Four instruments above four columns with names of their own."""
    legend = '# 1: load cell\n# 2: pressure sensor\n# 3: camera\n# 4: valve\n'
    path = write(tmp_path / 'log.csv', log, legend, ','.join(NAMES) + '\n')
    assert np.allclose(read_measurement(path).force, log[3], atol=1e-4)
