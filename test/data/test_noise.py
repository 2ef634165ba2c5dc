# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The noise floor of quantised load cells, and held muscles in cells."""

import numpy as np
import pytest

from fam_bundle_ros.data import noise_floor
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.noise import force_step, visit_cells


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
