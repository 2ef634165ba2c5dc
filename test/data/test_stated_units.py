# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units that stand beside a table, in a line of their own or with a label before them."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement

HEAD = 'time,strain,pressure,force\n'
LBF, PSI = 4.4482216, 6894.757


def rows(log):
    """Return the rows of a log in s, -, psi, lbf."""
    return ''.join(','.join(f'{cell:.6f}' for cell in row) + '\n' for row in zip(
        log[0], log[1], log[2] / PSI, log[3] / LBF))


@pytest.mark.parametrize('text', [
    '# pressure in psi, force in lbf\n' + HEAD + '{}',
    'Force unit: lbf\nPressure unit: psi\n\n' + HEAD + '{}',
    'Unit of force,lbf\nUnit of pressure,psi\n\n' + HEAD + '{}',
    'Unit system: US customary (psi, lbf)\n' + HEAD + '{}',
    '# units: s, -, psi, lbf\n' + HEAD + '{}',
    HEAD + '{}# units: s, -, psi, lbf\n',
    'Units,s,-,psi,lbf\n' + HEAD + '{}',
])
def test_units_are_those_that_a_line_states(tmp_path, log, text):
    """A force in lbf was read as one in N: the guess did not look at what the file says."""
    path = tmp_path / 'log.csv'
    path.write_text(text.format(rows(log)))
    data = read_measurement(path)
    assert data.time is not None
    assert np.abs(data.force - log[3]).max() < 1e-3
    assert np.abs(data.pressure[:, 0] - log[2]).max() < 1.0


@pytest.mark.parametrize('line', [
    'Load cell: 500 lbf', 'force limit in lbf', '# force in lbf or force in kN',
    '# force in lbf, force in kN', 'supply in kgf'])
def test_other_lines_state_no_unit(tmp_path, log, line):
    """A range, a limit, two units: none is that of the readings."""
    path = tmp_path / 'log.csv'
    path.write_text(f'{line}\n{HEAD.replace("sure", "sure [kPa]")}{rows(log)}')
    data = read_measurement(path)
    assert np.abs(data.force - log[3] / LBF).max() < 1e-3
    assert any(each.why == 'N guessed, no unit given' for each in data.taken)
