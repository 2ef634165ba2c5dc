# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A sine in time is found as long as it is none in strain."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.vibration import vibration


def log(trials=4, rows=200, step=0.05, sweep=5.0):
    """Return a log of triangular sweeps of the strain, trials 3.3 s apart."""
    clock = step * np.arange(rows)
    once = 0.2 * np.abs((2.0 * clock / sweep + 1.0) % 2.0 - 1.0)
    time = np.concatenate([clock + k * (rows * step + 3.3) for k in range(trials)])
    trial = np.repeat(np.arange(trials), rows)
    return build('log', np.tile(once, trials), 2e5 + 1e3 * time,
                 np.full(len(time), 50.0), trial, time)


def noise(count, seed=0, memory=0.0):
    """Return noise of unit standard deviation; with memory it is AR(1)."""
    white = np.random.default_rng(seed).standard_normal(count)
    return np.sqrt(1.0 - memory ** 2) * lfilter([1.0], [1.0, -memory], white)


@pytest.mark.parametrize(('trials', 'period'), [(1, 0.31), (1, 2.2), (4, 0.31), (4, 3.7)])
def test_period_and_amplitude_of_a_vibration_are_found_in_noise(trials, period):
    """Also where each trial has a phase of its own, and where rows are missing."""
    data = log(trials)
    phase = 2.0 * data.trial
    values = 1.5 * np.sin(2.0 * np.pi * data.time / period + phase) + noise(len(data))
    kept = np.random.default_rng(1).uniform(size=len(data)) < 0.8
    found = vibration(data.select(kept), values[kept], 1.0)
    assert found.period == pytest.approx(period, rel=0.05)
    assert found.amplitude == pytest.approx(1.5, rel=0.15)


@pytest.mark.parametrize('memory', [0.0, 0.8])
def test_noise_is_no_vibration(memory):
    """White, or with a memory of five rows: at most two of 200 logs."""
    data = log()
    white = np.sqrt(1.0 - memory ** 2)
    assert sum(vibration(data, noise(len(data), seed, memory), white) is not None
               for seed in range(200)) <= 2


def test_a_pause_of_a_day_in_a_trial_costs_no_memory():
    """The grid of the spectrum has no more places than a few times the rows."""
    data = log(1)
    late = np.where(np.arange(len(data)) < 100, 0.0, 86400.0)
    paused = build('paused', data.strain, data.pressure, data.force, data.trial, data.time + late)
    assert vibration(paused, noise(len(data)), 1.0) is None


@pytest.mark.parametrize('ripple', [lambda strain, way: np.cos(2.0 * np.pi * strain / 0.05),
                                    lambda strain, way: way * np.sin(2.0 * np.pi * strain / 0.05)])
def test_a_ripple_over_the_strain_is_no_vibration(ripple):
    """At constant speed it is a sine in time, but it returns at the same strain and direction."""
    data = log()
    values = 1.5 * ripple(data.strain, data.direction) + 0.5 * noise(len(data))
    assert vibration(data, values, 0.5) is None
    in_time = 1.5 * np.sin(2.0 * np.pi * data.time / 0.625 + 2.0 * data.trial)
    assert vibration(data, in_time + 0.5 * noise(len(data)), 0.5).period == pytest.approx(
        0.625, rel=0.02)


def test_a_ripple_over_the_strain_that_grows_with_the_pressure_is_no_vibration():
    """On isobars, of which each has an amplitude; a vibration with phases of its own is found."""
    data = log(5, 100)
    amplitude = np.array([0.1, 0.7, 0.25, 1.0, 0.5])[data.trial] * 6.0
    values = amplitude * np.sin(56.0 * data.strain) + 0.3 * noise(len(data))
    assert vibration(data, values, 0.3) is None
    in_time = amplitude * np.sin(2.0 * np.pi * data.time / 1.3 + 2.0 * data.trial ** 2)
    assert vibration(data, in_time + 0.3 * noise(len(data)), 0.3).period == pytest.approx(
        1.3, rel=0.05)


def test_an_error_that_returns_with_the_pressure_is_no_vibration():
    """A held muscle that is filled and vented at one rate: loops are periodic in time too."""
    sweeps = log()
    pressure = 5e5 - 2e6 * sweeps.strain + 300.0 * noise(len(sweeps), 1)
    data = build('held', np.full(len(sweeps), 0.1), pressure, sweeps.force, sweeps.trial,
                 sweeps.time)
    loop = 1.5 * data.direction * np.sin(2.0 * np.pi * pressure / 1e5)
    assert vibration(data, loop + 0.5 * noise(len(data)), 0.5) is None
    in_time = 1.5 * np.sin(2.0 * np.pi * data.time / 0.7 + 2.0 * data.trial)
    assert vibration(data, in_time + 0.5 * noise(len(data)), 0.5).period == pytest.approx(
        0.7, rel=0.02)


def test_an_error_with_the_period_of_one_pressure_is_no_vibration():
    """As where the line of the second of two units lags; at another period it is one."""
    sweeps = log(2, 800)
    second = 2e5 + 1e5 * np.sin(2.0 * np.pi * sweeps.time / 1.42)
    data = build('two units', sweeps.strain, np.stack([sweeps.pressure[:, 0], second], axis=-1),
                 sweeps.force, sweeps.trial, sweeps.time)

    def swing(period):
        return 3.0 * np.cos(2.0 * np.pi * data.time / period) + 0.3 * noise(len(data))
    assert vibration(data, swing(1.42), 0.3) is None
    assert vibration(data, swing(1.1), 0.3).period == pytest.approx(1.1, rel=0.02)


def test_a_pure_sine_is_found_without_a_warning():
    """Nothing else is left to compare it with."""
    data = log(1)
    assert vibration(data, np.sin(2.0 * np.pi * data.time / 2.0), 0.0).period == pytest.approx(2.0)


def test_a_vibration_smaller_than_the_noise_is_found():
    """It is half of the noise, and nothing else exceeds the noise."""
    data = log()
    values = 0.7 * np.sin(2.0 * np.pi * data.time / 1.4 + 2.0 * data.trial) + noise(len(data))
    assert vibration(data, values, 1.0).amplitude == pytest.approx(0.7, rel=0.2)


def test_fewer_than_two_periods_in_a_trial_are_drift():
    """A slow wave cannot be told from other drift."""
    data = log()
    wave = 5.0 * np.sin(2.0 * np.pi * data.time / 15.0 + 2.0 * data.trial)
    assert vibration(data, wave + 0.5 * noise(len(data)), 0.5) is None


def test_an_error_that_is_wavy_over_a_single_sweep_is_no_vibration():
    """Each strain is passed once each way, so a slow wave may be a function of the strain."""
    data = log(1, 400, 0.05, 20.0)

    def wave(period):
        return 2.0 * np.sin(2.0 * np.pi * data.time / period + 1.0) + 0.3 * noise(len(data))

    assert vibration(data, wave(8.5), 0.3) is None
    assert vibration(data, wave(3.0), 0.3).period == pytest.approx(3.0, rel=0.02)
    again = log(2, 400, 0.05, 10.0)
    slow = 2.0 * np.sin(2.0 * np.pi * again.time / 8.5) + 0.3 * noise(len(again))
    assert vibration(again, slow, 0.3).period == pytest.approx(8.5, rel=0.05)


@pytest.mark.parametrize(('trials', 'rows'), [(12, 1), (6, 2), (4, 4)])
def test_trials_too_short_for_a_period_show_none(trials, rows):
    """A few rows have no spectrum, and neither have zeros."""
    data = log(trials, rows)
    assert vibration(data, np.arange(float(len(data))) ** 2 % 7, 1.0) is None
    assert vibration(log(), np.zeros(800), 1.0) is None
