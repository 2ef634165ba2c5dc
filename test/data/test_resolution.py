# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Points far apart are no log, whatever times they have."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build

NOISE = {'strain': 5e-4, 'pressure': 1e3, 'force': 0.5}


def force(strain, pressure):
    """Return the force of a braid with a soft spring, N."""
    return 1e-3 * pressure * ((1.0 - 3.0 * strain) ** 2 + 0.1) - 300.0 * strain


def read(time, strain, pressure, seed=0):
    """Return the measurement of a motion, with noise in each reading."""
    rng = np.random.default_rng(seed)
    noise = {name: sd * rng.standard_normal(len(time)) for name, sd in NOISE.items()}
    return build('log', strain + noise['strain'], pressure + noise['pressure'],
                 force(strain, pressure) + noise['force'], time=time)


def points(repeats, seed=1, interval=20.0):
    """Return a map of 9 strains and 6 pressures in random order, and its clock."""
    strain, pressure = (each.ravel() for each in np.meshgrid(
        np.linspace(0.0, 0.24, 9), np.linspace(0.0, 500e3, 6)))
    order = np.repeat(np.random.default_rng(seed).permutation(len(strain)), repeats)
    return interval * np.arange(len(order)), strain[order], pressure[order]


@pytest.mark.parametrize('repeats', [1, 2, 3])
@pytest.mark.parametrize('interval', [0.5, 60.0])
def test_a_map_in_random_order_is_read_as_points_and_not_smoothed(repeats, interval):
    """Its steps were taken for noise of 200 N, below which every model is adequate."""
    time, strain, pressure = points(repeats, interval=interval)
    data = read(time, strain, pressure)
    assert data.is_static
    assert 'the rows are points, read without times' in data.notes[-1]
    assert np.abs(data.smoothed[0] - strain).max() < 5.0 * NOISE['strain']
    assert np.abs(data.smoothed[1][:, 0] - pressure).max() < 5.0 * NOISE['pressure']


@pytest.mark.parametrize(('noise', 'points_'), [(30.0, True), (300.0, False)])
def test_rows_are_points_if_most_of_the_error_is_due_to_the_smoothing(
        noise, points_, monkeypatch):
    """It is 150 N: with a load cell of 300 N of noise these points may be a log."""
    monkeypatch.setitem(NOISE, 'force', noise)
    assert read(*points(1)).is_static == points_


def test_every_hundredth_row_of_a_log_is_read_as_points():
    """What happened between them is not known."""
    time = 0.02 * np.arange(6000)
    strain, pressure = 0.1 - 0.1 * np.cos(0.9 * time), 250e3 + 2e5 * np.sin(0.7 * time)
    assert not read(time, strain, pressure).is_static
    assert read(*(each[::150] for each in (time, strain, pressure))).is_static


@pytest.mark.parametrize('louder', [1.0, 10.0])
def test_a_noisy_log_keeps_its_times(louder, monkeypatch):
    """The force does not follow noise of strain and pressure."""
    for name in ('strain', 'pressure'):
        monkeypatch.setitem(NOISE, name, louder * NOISE[name])
    time = 0.05 * np.arange(2000)
    strain, pressure = 0.1 - 0.1 * np.cos(0.3 * time), np.full(len(time), 300e3)
    data = read(time, strain, pressure)
    assert not data.is_static
    assert data.smoothed[0][20:-20].std() > 0.0
    assert np.std((data.smoothed[0] - strain)[20:-20]) < 0.5 * NOISE['strain']


def test_a_log_of_steps_keeps_its_times():
    """Fifteen rows at each place: most rows are like those beside them."""
    time, strain, pressure = points(15, interval=0.05)
    assert not read(time, strain, pressure).is_static


def test_an_error_that_no_gauge_shows_is_no_sign_of_points():
    """Without noise a static form fits exactly, and the smoothed values by a little less."""
    time = 0.5 * np.arange(60)
    strain = 0.1 - 0.1 * np.cos(0.9 * time)
    assert not build('log', strain, np.full(60, 3e5), 200.0 - 300.0 * strain, time=time).is_static
