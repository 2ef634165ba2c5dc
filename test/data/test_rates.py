# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The parts that smoothed rates are made of, against plain least squares and known signals."""

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.data import rates
from fam_bundle_ros.data.rates import (
    _local,
    begins,
    direction,
    locally,
    parts_of,
    sample_noise,
    signal_step,
    slope,
    spread,
    turning,
    usual_step,
)
from fam_bundle_ros.data.smoothing import _is_held, smooth


@pytest.fixture
def rng():
    """Return random numbers, the same ones for each test."""
    return np.random.default_rng(7)


@pytest.fixture
def uneven(rng):
    """Return time and value of 40 samples at uneven steps."""
    return np.cumsum(rng.uniform(0.05, 0.15, 40)), rng.normal(size=40)


@pytest.mark.parametrize('half', [2, 6])
def test_local_fits_are_those_of_least_squares(uneven, half):
    """Value and slope of each window, cut at the ends; within, by how much the slope changes."""
    time, value = uneven
    found = _local(time, value, half)
    for k in range(40):
        rows = slice(max(k - half, 0), k + half + 1)
        t, y = time[rows] - time[k], value[rows]
        assert_allclose((found.slope[k], found.value[k]), np.polyfit(t, y, 2)[1:], rtol=1e-6)
        powers = np.vander(t, 3)
        assert found.slope_sd[k] == pytest.approx(
            np.sqrt(np.linalg.inv(powers.T @ powers)[1, 1]), rel=1e-6)
        if k < half or k >= 40 - half:
            assert (found.bend[k], found.bend_sd[k], found.missed[k]) == (0.0, np.inf, np.inf)
            continue
        columns = np.stack([np.ones(len(t)), t, t ** 2, np.maximum(t, 0.0)], -1)
        best, squares, _, _ = np.linalg.lstsq(columns, y)
        sd = np.sqrt(np.linalg.inv(columns.T @ columns)[3, 3])
        assert_allclose((found.bend[k], found.bend_sd[k]), (best[3], sd), rtol=1e-6)
        assert found.missed[k] == pytest.approx(np.sqrt(squares[0] / (len(t) - 4)), rel=1e-6)


def test_two_rows_have_the_slope_between_them_and_one_has_none():
    """Nothing is smoothed there, and no change of the slope is known."""
    two = _local(np.array([0.0, 0.5]), np.array([1.0, 2.0]), 2)
    assert two.value.tolist() == [1.0, 2.0]
    assert two.slope.tolist() == [2.0, 2.0]
    assert_allclose(two.slope_sd, np.sqrt(2.0) / 0.5)
    assert two.bend.tolist() == [0.0, 0.0]
    assert np.isinf([two.bend_sd, two.missed]).all()
    assert _local(np.array([3.0]), np.array([1.0]), 2).slope.tolist() == [0.0]


def test_blocks_of_rows_give_what_the_whole_gives(uneven, monkeypatch):
    """All rows of each part are covered."""
    parts = [np.arange(17), np.arange(17, 40)]
    whole = [_local(uneven[0][rows], uneven[1][rows], 3) for rows in parts]
    monkeypatch.setattr(rates, '_BLOCK', 5)
    for found, first, second in zip(locally(*uneven, parts, 3), *whole):
        assert_allclose(found, np.concatenate([first, second]), rtol=1e-9)


def test_a_run_begins_where_any_label_changes():
    """The first row always begins a run."""
    one, other = np.array([1, 1, 2, 2, 2, 1]), np.array([0, 0, 0, 5, 5, 5])
    assert begins(one, other).tolist() == [True, False, True, True, False, True]
    assert begins(one).tolist() == [True, False, True, False, False, True]


def test_the_usual_step_is_that_of_the_sampling():
    """Of an even log, of packets of four rows; a day lies between trials, 10 s between levels."""
    trial = np.repeat([4, 5], 60)
    even = 0.1 * np.arange(120) + 86400.0 * (trial == 5)
    assert usual_step(even, trial) == pytest.approx(0.1)
    packets = 0.4 * (np.arange(120) // 4) + 1e-4 * (np.arange(120) % 4)
    assert usual_step(packets, np.zeros(120, int)) == pytest.approx(0.1, rel=0.1)
    levels = 0.1 * np.arange(600) + 10.0 * (np.arange(600) // 100)
    assert usual_step(levels, np.zeros(600, int)) == pytest.approx(0.1)
    assert usual_step(np.array([0.0, 9.0]), np.array([0, 1])) == 1.0
    assert usual_step(np.array([0.0, 9.0]), np.array([0, 0])) == 9.0


@pytest.mark.parametrize(('pause', 'count'), [(5.0, 2), (6.0, 3)])
def test_windows_end_at_trials_and_at_pauses_longer_than_the_widest(pause, count):
    """That is 55 steps: of 0.1 s each, 5.5 s."""
    trial = np.repeat([0, 1], 200)
    time = 0.1 * np.arange(400) + pause * (np.arange(400) >= 300)
    parts = parts_of(time, trial)
    assert [rows[0] for rows in parts] == [0, 200, 300][:count]
    assert np.concatenate(parts).tolist() == list(range(400))


def test_the_spread_of_differences_is_that_without_the_outliers(rng):
    """Of normal ones, and of steps that are mostly zero."""
    gaps = 3.0 + 2.0 * rng.normal(size=20_000)
    gaps[::20] += 100.0
    assert spread(gaps) == pytest.approx(2.0, rel=0.1)
    steps = np.round(rng.normal(size=20_000) * 0.5)
    whole = steps.std()
    steps[::100] = 60.0
    assert spread(steps) < 0.1
    assert spread(steps, 1.0) == pytest.approx(whole, rel=0.02)
    # coarse, not small: the deviation of all within five steps
    assert spread(np.round(rng.normal(size=20_000) * 1.5), 1.0) == pytest.approx(
        np.hypot(1.5, np.sqrt(1.0 / 12.0)), rel=0.02)


def test_the_noise_of_samples_is_that_without_the_signal(rng):
    """A parabola in each trial, far from the other: third differences leave it out."""
    trial = np.repeat([0, 1], 5000)
    signal = 1e-5 * np.arange(10_000.0) ** 2 + 1e4 * trial
    noise = 0.2 * rng.normal(size=10_000)
    assert sample_noise(signal + noise, trial) == pytest.approx(0.2, rel=0.05)
    assert sample_noise(noise[:6], trial[:6]) == 0.0
    assert sample_noise(noise[:7], trial[:7]) > 0.0
    short = np.arange(400) // 4  # one third difference in each trial
    jumps = 1e3 * rng.normal(size=100)[short]
    assert sample_noise(noise[:400] + jumps, short) == pytest.approx(0.2, rel=0.3)


def test_a_pressure_set_in_steps_is_held_between_them(rng):
    """Isobars one after another in one trial; a ramp after them stays one."""
    time = 0.02 * np.arange(1600)
    levels = np.repeat([80e3, 160e3, 240e3, 320e3], 300)
    set_to = np.concatenate([levels, np.linspace(0.0, 2e5, 400)])
    found = smooth(time, set_to + rng.normal(0.0, 300.0, 1600), np.zeros(1600, int)).value
    for begin in range(0, 1200, 300):
        level = found[begin:begin + 300]
        assert np.ptp(level) == 0.0
        assert level[0] == pytest.approx(set_to[begin], abs=60.0)
    assert found[1200:] == pytest.approx(set_to[1200:], abs=1200.0)


def test_white_noise_is_held_and_a_swing_or_a_drift_is_not(rng):
    """Of many records of one level few are taken for moving ones."""
    noise = rng.normal(size=(200, 990))
    assert np.mean([_is_held(each, 1.0) for each in noise]) > 0.97
    swing = 1.0 * np.sin(np.arange(990))
    assert not any(_is_held(each + swing, 1.0) for each in noise)
    drift = 0.5 * np.sin(np.arange(990) / 150.0)
    assert not any(_is_held(each + drift, 1.0) for each in noise)
    assert _is_held(noise[0, :66], 1.0)
    assert not _is_held(noise[0, :65], 1.0)


def test_smoothing_takes_the_noise_of_a_ramp_and_keeps_a_step(rng):
    """A quadratic over 33 rows leaves 1.5/sqrt(33) of it; beside the step nothing is smeared."""
    count = 4000
    signal = 0.02 * np.arange(count) + 60.0 * (np.arange(count) >= 2000)
    noise = rng.normal(size=count)
    found = smooth(0.1 * np.arange(count), signal + noise, np.zeros(count, int)).value - signal
    inside = np.r_[50:1950, 2050:3950]
    assert np.std(found[inside]) < 0.45
    assert np.std(found[inside]) > 0.2
    assert np.abs(found[1990:2010]).max() < 4.0
    found = smooth(np.arange(9.0), np.arange(9.0), np.zeros(9, int))
    assert found.value.tolist() == list(range(9))


@pytest.mark.parametrize('way', [1.0, 2.0, 4.0])
def test_smoothing_keeps_a_tip(rng, way):
    """A triangle of 1, 2, 4 times the noise in a row: each leg is smoothed by itself."""
    row = np.arange(4000)
    triangle = way * np.abs((row + 100) % 200 - 100.0)
    found = smooth(0.1 * row, triangle + rng.normal(size=4000), np.zeros(4000, int)).value
    found -= triangle
    # towards the other tip is positive
    tips = np.arange(100, 3950, 100)
    inwards = np.where(triangle[tips] < 50.0 * way, 1.0, -1.0) * found[tips]
    assert abs(inwards.mean()) < 0.5
    assert np.abs(found[tips]).mean() < 0.8
    assert np.sqrt(np.mean(found ** 2)) < 0.34


@pytest.mark.parametrize(('way', 'leg'), [(4.0, 45), (4.0, 100), (1.0, 200), (0.1, 400)])
def test_the_error_that_smoothing_leaves_is_told(way, leg):
    """Larger at the ends of the log and at the tips of a triangle, where fewer rows tell it."""
    row = np.arange(8 * leg + 1)
    triangle = way * np.abs((row + leg) % (2 * leg) - leg)
    draws = [smooth(0.02 * row, triangle + np.random.default_rng(k).normal(size=len(row)),
                    np.zeros(len(row), int)) for k in range(60)]
    off = np.array([each.value - triangle for each in draws])
    told = np.sqrt(np.mean([each.left ** 2 for each in draws], axis=0))
    tip = np.minimum(row % leg, -row % leg)
    inside = (row > leg // 2) & (row < len(row) - leg // 2)
    for place in (inside & (tip > 8), inside & (tip <= 4), row < 3, row > row[-1] - 3):
        found = np.sqrt(np.mean(off[:, place] ** 2))
        # a tip that is hardly beyond the noise is not seen by all draws
        assert found == pytest.approx(np.sqrt(np.mean(told[place] ** 2)),
                                      rel=0.3 if way < 1.0 else 0.2)
    assert told[inside & (tip > 8)].max() < 0.6 * told[inside & (tip == 0)].min() or way < 1.0


def test_the_mean_of_what_is_held_is_as_good_as_its_rows(rng):
    """And a signal without noise has no error."""
    held = smooth(0.1 * np.arange(400), rng.normal(size=400), np.zeros(400, int))
    assert held.noise == pytest.approx(1.0, rel=0.2)
    assert_allclose(held.left, held.noise / 20.0)
    exact = smooth(np.arange(9.0), np.arange(9.0), np.zeros(9, int))
    assert (exact.left.max(), exact.noise) == (0.0, 0.0)


@pytest.mark.parametrize('step', [0.01, 0.5])
def test_the_noise_that_a_slope_names_is_the_noise_it_has(rng, step):
    """Two ramps with noise of 1 a row, in units of their time."""
    trial = np.repeat([0, 1], 10_000)
    time = step * np.arange(20_000)
    true = 0.3 / step * np.where(trial == 0, 1.0, -1.0)
    signal = np.where(trial == 0, 1.0, -1.0) * 0.3 * np.arange(20_000)
    found = slope(time, signal + rng.normal(size=20_000), trial)
    inside = np.r_[100:9900, 10_100:19_900]
    assert np.median(found.window) == 55
    assert np.std((found.rate - true)[inside]) == pytest.approx(found.noise[5000], rel=0.1)
    # of a line, as the quadratic is even
    assert np.median(found.noise) == pytest.approx(np.sqrt(12.0 / 55.0 ** 3) / step, rel=0.05)


def test_a_clean_enough_rate_is_not_smoothed_further(rng):
    """Noise of a ten-thousandth of what moves in a row: the narrowest window is enough."""
    rows = np.arange(500.0)
    found = slope(rows, rows + 1e-4 * rng.normal(size=500), np.zeros(500, int))
    assert (found.window == 5).all()
    assert_allclose(found.rate, 1.0, atol=1e-3)


def test_between_jumps_of_a_reading_its_slope_is_that_of_the_rest(rng):
    """A gauge that slips every 40 rows by fifty times what it moves in one."""
    rows = np.arange(400)
    value = 0.2 * rows + 10.0 * (rows // 40) + 1e-3 * rng.normal(size=400)
    found = slope(rows.astype(float), value, np.zeros(400, int))
    between = np.abs(rows % 40 - 20) < 15
    assert_allclose(found.rate[between], 0.2, atol=0.01)


@pytest.mark.parametrize('late', [-0.4, -0.2, 0.2, 0.4])
def test_a_corner_between_two_samples_is_found_where_it_is(rng, late):
    """The sample next to it has the slope of the leg that it is on; all others theirs."""
    rows, corner = np.arange(400.0), 200.0 + late
    value = np.where(rows < corner, 0.2 * rows, 0.2 * corner + 1.0 * (rows - corner))
    found = slope(rows, value + 1e-4 * rng.normal(size=400), np.zeros(400, int))
    assert_allclose(found.rate[:200], 0.2, atol=0.04)
    assert_allclose(found.rate[201:], 1.0, atol=0.04)
    assert found.rate[200] == pytest.approx(1.0 if late < 0.0 else 0.2, abs=0.04)


def test_levels_that_were_set_and_even_ramps_are_no_steps_of_a_reading(rng):
    """Sixteen changes and steps in its range at least, all multiples of the smallest."""
    trial = np.zeros(400, int)
    reading = 0.5 * np.round(20.0 * np.sin(np.arange(400) / 15.0))
    assert signal_step(reading, trial) == 0.5
    assert signal_step(reading + 0.02 * rng.normal(size=400), trial) == 0.0
    assert signal_step(0.7 * np.arange(400.0), trial) == 0.0
    assert signal_step(0.5 * np.round(7.0 * np.sin(np.arange(400) / 15.0)), trial) == 0.0
    assert signal_step(np.repeat(0.5 * np.arange(16.0), 25), trial) == 0.0
    assert signal_step(np.repeat(0.5 * np.arange(20.0), 20), trial) == 0.5
    # what lies between two trials is no change
    trials = np.arange(400) // 20
    assert signal_step(reading + 0.123 * trials, trials) == pytest.approx(0.5)
    assert signal_step(reading + 0.123 * trials, trial) == 0.0


def test_what_is_slow_or_goes_nowhere_is_at_rest():
    """Below three deviations of the noise, or a fiftieth of fast motion, or the least travel."""
    time, trial = 0.1 * np.arange(60), np.zeros(60, int)
    rate = np.repeat([1.0, 0.03, 0.01, -0.01, -0.03, -1.0], 10)
    assert direction(time, rate, 0.0, trial, 0.0)[::10].tolist() == [1, 1, 0, 0, -1, -1]
    assert direction(time, rate, 0.02, trial, 0.0)[::10].tolist() == [1, 0, 0, 0, 0, -1]
    # up for 2 s at 1 and 0.03 per s, down likewise but for the last row, which ends the log
    assert direction(time, rate, 0.0, trial, 1.0)[::10].tolist() == [1, 1, 0, 0, 0, 0]
    assert direction(time, rate, 0.0, trial, 1.04)[::10].tolist() == [0] * 6
    # a trial of its own begins no run of another
    halves = np.repeat([0, 1], 30)
    steady = direction(time, np.ones(60), 0.0, halves, 2.95)
    assert steady.tolist() == [0] * 60
    assert direction(time, np.ones(60), 0.0, trial, 2.95).tolist() == [1] * 60


@pytest.mark.parametrize(('moving', 'turns'), [
    ([1, 1, 0, 0, -1], [0, 0, 1, 1, 0]), ([-1, 0, 0, 0, 1], [0, 1, 1, 1, 0]),
    ([1, 1, 1, 0, 0, 0, 0, 0, -1, -1], [0, 0, 1, 1, 0, 0, 0, 1, 1, 0]),
    ([1, 1, 0, 0, 1], [0] * 5), ([0, 0, 1, -1, -1], [1, 1, 0, 0, 0]),
    ([1, 0, -1, 0, 1, 0], [0, 1, 0, 1, 0, 1]), ([0, 0, 0], [0, 0, 0])])
def test_the_way_of_a_short_rest_where_the_motion_may_turn_is_unknown(moving, turns):
    """
    Between opposite motions, and where the log begins or ends. A window of three rows.

    Of a longer rest, a hold, only the ends; across trials nothing.
    """
    window = np.full(len(moving), 3)
    assert turning(np.array(moving), np.zeros(len(moving), int), window).tolist() == turns
    assert not turning(np.array(moving), np.arange(len(moving)), window).any()


def test_the_window_of_a_rest_is_that_where_it_begins():
    """Four rows at rest are a hold for a window of three, and a turn for one of nine."""
    moving, trial = np.array([1, 1, 0, 0, 0, 0, -1, -1]), np.zeros(8, int)
    narrow, wide = np.full(8, 9), np.full(8, 3)
    narrow[2:7], wide[2:7] = 3, 9
    assert turning(moving, trial, narrow).tolist() == [0, 1, 1, 0, 0, 1, 1, 0]
    assert turning(moving, trial, wide).tolist() == [0, 0, 1, 1, 1, 1, 0, 0]


def test_commanded_levels_and_ramps_are_not_smoothed():
    """Isometric log in one trial: ramps in steps of 9.18 kPa, told to 10 Pa; six lengths."""
    ramp = np.concatenate([np.linspace(0.0, 450e3, 50), np.linspace(450e3, 0.0, 50)])
    pressure = np.tile(ramp.round(-1), 6)
    strain = np.repeat(np.linspace(0.0, 0.2, 6), 100)
    time = 0.1 * np.tile(np.arange(100), 6) + np.repeat(20.0 * np.arange(6), 100)
    trial = np.zeros(600, int)
    assert_allclose(smooth(time, pressure, trial).value, pressure, atol=10.0)
    assert_allclose(smooth(time, strain, trial).value, strain, atol=1e-12)


@pytest.mark.parametrize('noise', [0.0, 2e-3])
def test_ramps_whose_rows_are_uneven_in_time_are_smoothed_by_their_noise_only(noise):
    """Rows picked from a longer log, 2.4 and 2.5 s apart: their tips were 0.01 too low."""
    rng = np.random.default_rng(2)
    once = 2.45 * np.arange(8)
    time = np.round(np.concatenate([20.3 * k + once for k in range(5)]), 1)
    trial = np.repeat(np.arange(5), 8)
    value = 0.22 * (1.0 - np.abs(1.0 - 2.0 * (time - 20.0 * trial) / 20.0))
    read = value + noise * rng.standard_normal(40)
    assert np.abs(smooth(time, read, trial).value - value).max() <= 4.0 * noise + 1e-9
