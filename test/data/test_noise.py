# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The noise floor of quantised load cells, and held muscles in cells."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.data import noise_floor
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.noise import _chance_of_less, _chosen, force_step, visit_cells
from fam_bundle_ros.data.trials import trial_offsets


def stepped(data, step):
    """Return a measurement whose load cell reads in steps."""
    return build('stepped', data.strain, data.pressure, step * np.round(data.force / step),
                 data.trial, data.time)


@pytest.mark.parametrize(('noise', 'step'), [(0.0, 3.0), (0.3, 3.0), (0.9, 1.0), (0.9, 0.01),
                                             (0.5, 1.0)])
def test_a_quantised_load_cell_is_as_noisy_as_it_rounds(sweeps, muscle, noise, step):
    """Noise and rounding step / sqrt(12) together, within a quarter, whichever is larger."""
    data = stepped(sweeps(noise=noise, cycles=4), step)
    residual = data.force - muscle(data.strain, data.pressure[:, 0])
    floor = noise_floor(data, residual)
    assert floor.quantum == pytest.approx(step)
    assert floor.value == pytest.approx(np.hypot(noise, step / np.sqrt(12.0)), rel=0.25)


def test_readings_that_stay_are_not_free_of_noise(muscle):
    """Slow sweeps under a coarse load cell: neighbours agree, and still the cell rounds."""
    time = 0.01 * np.arange(12_000)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 60.0)
    pressure = np.where(time < 60.0, 2e5, 3e5)
    true = muscle(strain, pressure)
    data = build('slow', strain, pressure, 3.0 * np.round(true / 3.0), None, time)
    floor = noise_floor(data, data.force - true)
    assert floor.differences == pytest.approx(3.0 / np.sqrt(12.0), rel=0.1)


def test_outliers_of_a_quantised_load_cell_are_no_noise(sweeps, muscle):
    """3 % of the rows 40 N off, read in steps of 1 N."""
    data = stepped(sweeps(noise=0.5, cycles=4), 1.0)
    force = data.force.copy()
    force[::33] += 40.0
    data = build('outliers', data.strain, data.pressure, force, data.trial, data.time)
    floor = noise_floor(data, force - muscle(data.strain, data.pressure[:, 0]))
    assert floor.value == pytest.approx(0.58, rel=0.4)


def test_a_coarse_load_cell_is_spoken_of(sweeps):
    """The step is named where it makes the noise, and not where it does not."""
    assert 'in steps of 3 N' in str(noise_floor(stepped(sweeps(noise=0.1), 3.0)))
    assert 'steps' not in str(noise_floor(sweeps()))


def test_readings_without_a_step_have_none(sweeps):
    """Floats of a simulation, and levels of which there are few, are no quantised readings."""
    assert force_step(sweeps().force) == 0.0
    assert force_step(np.repeat([0.0, 10.0, 20.0], 30)) == 0.0


def test_noise_is_found_in_spite_of_outliers(sweeps, muscle):
    """3 % of the rows 40 N off leave the floor within a quarter."""
    data = sweeps(noise=0.6)
    force = data.force.copy()
    force[::33] += 40.0
    data = build('outliers', data.strain, data.pressure, force, data.trial, data.time)
    floor = noise_floor(data, force - muscle(data.strain, data.pressure[:, 0]))
    assert floor.value == pytest.approx(0.6, rel=0.25)


def test_a_held_muscle_visits_one_strain(muscle):
    """Strain that is constant but for rounding makes one bin, so that repeats are found."""
    rng = np.random.default_rng(0)
    pressure = np.tile(np.concatenate([np.linspace(0, 4e5, 80), np.linspace(4e5, 0, 80)]), 5)
    strain = 0.1 + 1e-6 * rng.standard_normal(800)
    force = muscle(0.1, pressure) + 0.5 * rng.standard_normal(800)
    data = build('held', strain, pressure, force, None, 0.05 * np.arange(800))
    cell, _ = visit_cells(data)
    assert len(np.unique(cell)) < 130
    assert noise_floor(data, force - muscle(0.1, pressure)).repeats == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize(('repeats', 'pairs', 'by', 'note'), [
    (0.5, 1000, 'repeats', 'a fine ripple'), (1.0, 1000, 'second differences', ''),
    (2.0, 1000, 'second differences', 'slow noise'), (0.7, 1000, 'repeats', 'a fine ripple'),
    (0.7, 10, 'second differences', ''), (0.6, 37, 'second differences', ''),
    (1.5, 15, 'second differences', ''), (1.5, 1000, 'second differences', 'slow noise')])
def test_repeats_are_believed_only_when_they_clearly_agree_better(repeats, pairs, by, note):
    """By a quarter, as one noise looks in one of 100 cases; that they agree worse is said."""
    floor = _chosen(np.zeros(9), 1.0, repeats, None, 1.0, pairs)
    assert floor.basis == by
    assert note in floor.note
    assert bool(note) == bool(floor.note)


@pytest.mark.parametrize('pairs', [13, 37, 200])
def test_the_chance_of_agreeing_pairs_is_that_of_white_noise(pairs):
    """As often as medians of drawn noise are below the ratio, even and odd."""
    drawn = np.abs(np.random.default_rng(0).standard_normal((20_000, pairs)))
    deviation = 1.4826 * np.median(drawn, 1)
    for ratio in (0.7, 0.9, 1.1):
        found = _chance_of_less(ratio, pairs)
        assert found == pytest.approx(np.mean(deviation < ratio), abs=0.015)


def test_noise_that_lasts_is_no_offset_of_a_trial(sweeps):
    """Noise of ten rows makes trials differ by more than white noise would: no offset yet."""
    data = sweeps(cycles=2)
    white = np.random.default_rng(3).normal(size=len(data))
    assert trial_offsets(data, lfilter([1.0], [1.0, -0.8], white)) is None
    found = trial_offsets(data, white + 4.0 * (data.trial == 1))
    assert found.rows[data.trial == 1].mean() - found.rows[data.trial == 7].mean(
        ) == pytest.approx(4.0, abs=1.0)


def test_an_offset_below_the_resolution_is_not_told(sweeps):
    """A ten-thousandth of the largest force is what a load cell can show."""
    data = sweeps(cycles=2)
    most = np.abs(data.force).max()
    assert trial_offsets(data, 1e-5 * most * (data.trial < 6)) is None
    assert trial_offsets(data, 1e-2 * most * (data.trial < 6)) is not None
