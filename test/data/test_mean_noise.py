# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The noise of an average: how far means of many rows scatter if each row resembles the last."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from fam_bundle_ros.data.mean_noise import _of_differences, _of_mean, mean_noise, MeanNoise

#: No steps in the readings, nothing measured twice.
PLAIN = SimpleNamespace(quantum=0.0, repeats=None, differences=None, basis='')


def slow_noise(memory, rows, seed=0):
    """Return noise of unit variance whose correlation falls to 1/e in ``memory`` rows."""
    r = np.exp(-1.0 / memory)
    white = np.random.default_rng(seed).normal(size=rows + 1000)
    return lfilter([np.sqrt(1.0 - r ** 2)], [1.0, -r], white)[1000:]


@pytest.mark.parametrize(('white', 'slow', 'memory'), [
    (0.5, 0.0, 1.0), (0.0, 0.5, 4.5), (0.5, 0.5, 10.0), (1.0, 0.5, 8.0), (0.2, 2.0, 1.5)])
def test_means_scatter_by_as_much_as_is_estimated(white, slow, memory):
    """Means of 3 to 80 rows, from visits of 5 to 100 rows."""
    rng = np.random.default_rng(1)

    def noise(rows, seed):
        return slow * slow_noise(memory, rows, seed) + white * rng.normal(size=rows)
    stay = np.repeat(np.arange(3000), rng.integers(5, 100, 3000))
    found = mean_noise(noise(len(stay), 2), stay, PLAIN)
    many = noise(2_000_000, 3)
    for rows in (3, 10, 30, 80):
        scatter = many[:len(many) // rows * rows].reshape(-1, rows).mean(axis=1).var()
        assert found.variance(np.array([rows])) == pytest.approx(scatter, rel=0.25)
    assert found.sd == pytest.approx(np.hypot(white, slow), rel=0.1)


def test_the_mean_of_one_row_is_the_row():
    """And a long mean of white noise has the variance of a row by the number of rows."""
    noise = MeanNoise(white=0.3, slow=0.4, memory=7.0)
    assert noise.sd == pytest.approx(0.5)
    assert noise.variance(np.array([1.0])) == pytest.approx(0.25)
    assert MeanNoise(0.3).variance(np.array([9.0])) == pytest.approx(0.01)


@pytest.mark.parametrize('memory', [0.7, 4.5, 50.0])
@pytest.mark.parametrize('rows', [1, 2, 8])
def test_variances_are_those_of_the_covariance_of_the_rows(memory, rows):
    """Of a mean, and of the difference of a mean to those before and after it."""
    covariance = toeplitz(np.exp(-np.arange(3.0 * rows) / memory))
    share = np.full(rows, 1.0 / rows)
    differences = np.concatenate([share, -2.0 * share, share]) / np.sqrt(6.0)
    size = np.array([float(rows)])
    assert _of_mean(size, memory) == pytest.approx(share @ covariance[:rows, :rows] @ share)
    assert _of_differences(size, memory) == pytest.approx(differences @ covariance @ differences)


def test_an_error_of_the_model_is_no_noise():
    """It changes with strain and pressure from visit to visit, and evenly within each."""
    rng = np.random.default_rng(4)
    stay = np.repeat(np.arange(300), rng.integers(4, 60, 300))
    place = np.arange(len(stay)) - np.flatnonzero(np.diff(stay, prepend=-1))[stay]
    error = 30.0 * rng.normal(size=300)[stay] + 0.3 * rng.normal(size=300)[stay] * place
    noise = 0.5 * rng.normal(size=len(stay))
    rows = np.array([1.0, 10.0, 60.0])
    alone, beside = (mean_noise(values, stay, PLAIN) for values in (noise, noise + error))
    assert beside.variance(rows) == pytest.approx(alone.variance(rows), rel=1e-6)
    assert alone.variance(rows) == pytest.approx(0.25 / rows, rel=0.2)


@pytest.mark.parametrize('noise', [0.02, 0.3, 2.0])
def test_readings_in_steps_have_the_noise_of_rounding_besides(noise):
    """Of a force that is held: it reads the same for long if the noise is less than the step."""
    rng = np.random.default_rng(5)
    stay = np.repeat(np.arange(200), 40)
    force = 20.0 * rng.normal(size=200)[stay] + noise * rng.normal(size=len(stay))
    found = mean_noise(np.round(force), stay, SimpleNamespace(**{**vars(PLAIN), 'quantum': 1.0}))
    assert found.sd == pytest.approx(np.hypot(noise, 12.0 ** -0.5), rel=0.2)


def test_a_row_has_no_more_noise_than_its_repeats():
    """A ripple of the force comes back each time: neighbours differ by it, repeats do not."""
    stay = np.repeat(np.arange(100), 30)
    ripple = slow_noise(3.0, 30)[np.tile(np.arange(30), 100)]
    floor = SimpleNamespace(quantum=0.0, repeats=0.1, differences=0.4, basis='repeats')
    assert mean_noise(ripple, stay, PLAIN).sd > 0.3
    assert mean_noise(ripple, stay, floor).sd == pytest.approx(0.1)


def test_few_repeats_that_agree_by_chance_do_not_lower_the_noise():
    """Of white noise, whose size second differences know better."""
    white = np.random.default_rng(4).normal(0.0, 1.0, 3000)
    floor = SimpleNamespace(quantum=0.0, repeats=0.7, differences=1.0, basis='second differences')
    assert mean_noise(white, np.arange(3000) // 30, floor).sd == pytest.approx(1.0, rel=0.05)


def test_a_memory_is_seen_in_visits_that_are_long_enough():
    """Means of two rows are compared from six rows on; a force without any noise has none."""
    noise = slow_noise(5.0, 600)
    assert mean_noise(noise, np.arange(600) // 2, PLAIN) is None
    assert mean_noise(noise, np.arange(600) // 5, PLAIN) is None
    assert mean_noise(np.zeros(600), np.arange(600) // 60, PLAIN) is None
    assert mean_noise(noise, np.arange(600) // 6, PLAIN).slow > 0.3
    assert mean_noise(noise, np.arange(600) // 60, PLAIN).slow > 0.5
