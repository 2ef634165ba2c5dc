# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows that stand alone, and rows that only seem to."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.log_rows import spikes

NOISE = 0.5


@pytest.fixture
def log():
    """Return a log whose strain steps within 30 ms every two seconds; its force is noise."""
    time = 0.01 * np.arange(2000)
    strain = np.interp(time % 4.0, [0.0, 1.0, 1.03, 3.0, 3.03, 4.0],
                       [0.02, 0.02, 0.08, 0.08, 0.02, 0.02])
    rng = np.random.default_rng(0)
    return build('steps', strain + 1e-4 * rng.standard_normal(2000), np.full((2000, 1), 2e5),
                 NOISE * rng.standard_normal(2000), None, time)


def test_a_row_far_from_its_neighbours_stands_alone(log):
    """Twenty noise standard deviations at rest: that row, and no other one."""
    residual = log.force.copy()
    residual[250] += 20.0 * NOISE
    assert np.flatnonzero(spikes(log, residual, NOISE)).tolist() == [250]


@pytest.mark.parametrize(('rows', 'found'), [(8, True), (6, False)])
def test_a_short_log_has_a_spike_where_it_has_neighbours_on_both_sides(log, rows, found):
    """Three before it and three after it."""
    short = log.select(np.arange(len(log)) < rows)
    residual = np.where(np.arange(rows) == 4, 20.0 * NOISE, short.force)
    assert spikes(short, residual, NOISE).any() == found
    assert not spikes(short, short.force, NOISE).any()


def test_what_a_step_of_the_strain_does_is_no_spike(log):
    """A force in proportion to the rate lasts three rows at each step: none of them goes."""
    residual = log.force + 20.0 * log.strain_rate
    assert np.abs(residual).max() > 20.0 * NOISE
    assert not spikes(log, residual, NOISE).any()


@pytest.mark.parametrize('late', range(4))
def test_what_comes_shortly_after_a_step_may_be_its_response(log, late):
    """One row of force, up to three rows after the strain has stepped."""
    stepped = np.abs(np.diff(log.strain, prepend=log.strain[0])) > 0.01
    residual = log.force + 20.0 * NOISE * np.roll(stepped & ~np.roll(stepped, -1), late)
    assert not spikes(log, residual, NOISE).any()


@pytest.mark.parametrize('row', [996, 1003])
def test_the_way_from_trial_to_trial_is_no_step_of_the_strain(log, row):
    """A spike three rows from the end of a sweep, or from where the next begins, is one."""
    trial = np.repeat([0, 1], 1000)
    strain = np.tile(np.linspace(0.0, 0.2, 1000), 2) + 2e-5 * log.force
    two = build('two', strain, log.pressure, log.force, trial, log.time + 5.0 * trial)
    residual = log.force.copy()
    residual[row] += 20.0 * NOISE
    assert np.flatnonzero(spikes(two, residual, NOISE)).tolist() == [row]


def test_spikes_are_found_while_the_muscle_moves_evenly(log):
    """A sweep is no step, however fast."""
    strain = np.linspace(0.0, 0.2, 2000)
    sweep = build('sweep', strain, log.pressure, log.force, None, log.time)
    residual = log.force.copy()
    residual[700] -= 20.0 * NOISE
    assert np.flatnonzero(spikes(sweep, residual, NOISE)).tolist() == [700]
