# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows that a column of the log itself calls bad."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement

BAD = slice(100, 120)


def columns(log, header, good, bad):
    """Return a log with nonsense in some rows, and a column that says which."""
    time, strain, pressure, force = log
    wrong = force.copy()
    wrong[BAD] = np.linspace(-80.0, 200.0, 20)
    flags = np.array([good] * len(time), float if isinstance(good, float) else object)
    flags[BAD] = bad
    return {'time [s]': time, 'strain': strain, 'pressure [kPa]': pressure / 1e3,
            'force [N]': wrong, header: flags}


@pytest.mark.parametrize(('header', 'good', 'bad'), [
    ('valid', 1.0, 0.0), ('Quality', 'Good', 'Bad'), ('status', 'OK', 'FAULT'),
    ('exclude', 0.0, 1.0), ('is_outlier', 'False', 'True'), ('Ausrei\u00dfer', '', 'x')])
def test_rows_that_a_column_calls_bad_are_left_out(log, header, good, bad):
    """They were read, with their nonsense, and the column was 'not known'."""
    data = read_measurement(columns(log, header, good, bad))
    kept = np.delete(np.arange(len(log[0])), BAD)
    assert np.abs(data.force - log[3][kept]).max() < 1e-9
    assert f"20 rows left out that '{header}' calls bad (first row 101)" in data.notes


@pytest.mark.parametrize(('header', 'good', 'bad'), [
    ('status', 1.0, 2.0), ('status', 'running', 'hold'), ('valve', 1.0, 0.0),
    ('valid', 0.0, 1.0)])
def test_states_of_the_rig_are_no_quality(log, header, good, bad):
    """A state, and a flag that would call most rows bad, leave no row out."""
    data = read_measurement(columns(log, header, good, bad))
    assert len(data) == len(log[0])
