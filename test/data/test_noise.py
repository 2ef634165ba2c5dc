# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The noise floor of quantised load cells, and held muscles in cells."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.data import noise_floor
from fam_bundle_ros.data.grouping import visit_cells
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.noise import (
    _chance_of_less,
    _chosen,
    force_step,
    second_differences,
)
from fam_bundle_ros.data.trial_offsets import autocorrelation_time, trial_offsets


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
    """If they differ by a quarter with a chance below 1 %; a larger scatter is noted."""
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


def test_noise_that_lasts_is_no_offset_where_few_rows_tell():
    """Most cells were met by one trial only; their rows say nothing about the noise between."""
    rng, time = np.random.default_rng(1), 0.01 * np.arange(6000)
    trial = np.repeat(np.arange(6), 1000)
    strain = 0.1 + 0.1 * np.sin(2.0 * np.pi * (0.06 * time + rng.random()))
    pressure = 2e5 + 1e5 * np.sin(2.0 * np.pi * 0.02 * time)
    data = build('log', strain, pressure, 100.0 + strain, trial, time)
    alarms = 0
    for _ in range(60):
        white = rng.standard_normal((2, 6000))
        noise = white[0] + lfilter([0.33], [1.0, -0.9], white[1])
        alarms += trial_offsets(data, noise) is not None
    assert alarms < 6


def test_an_offset_below_the_resolution_is_not_told(sweeps):
    """A ten-thousandth of the largest force is what a load cell can show."""
    data = sweeps(cycles=2)
    most = np.abs(data.force).max()
    assert trial_offsets(data, 1e-5 * most * (data.trial < 6)) is None
    assert trial_offsets(data, 1e-2 * most * (data.trial < 6)) is not None


def test_each_trial_has_the_offset_that_it_was_given(sweeps):
    """Of two trials at one pressure: what they differ by, and how much that is in all."""
    data = sweeps(cycles=2)
    rng = np.random.default_rng(4)
    given = 3.0 * rng.normal(size=12)
    found = trial_offsets(data, given[data.trial] + 0.5 * rng.normal(size=len(data)))
    offset = np.array([found.rows[data.trial == k][0] for k in range(12)])
    gap = given[:6] - given[6:]
    assert offset[:6] - offset[6:] == pytest.approx(gap, abs=0.3)
    assert found.size == pytest.approx(np.sqrt(np.sum(2.0 * (0.5 * gap) ** 2) / 6.0), rel=0.05)
    assert str(found).startswith(f'each trial has its own offset, {found.size:.2g} N rms')


def test_what_all_trials_share_is_no_offset_of_one(sweeps):
    """Noise, and errors of strain, pressure and direction, however large."""
    data = sweeps(cycles=3)
    rng = np.random.default_rng(5)
    error = (9.0 * data.strain / 0.24 + 1e-5 * data.pressure[:, 0]) * data.direction
    for wrong in (0.0, error):
        assert not any(trial_offsets(data, wrong + 0.5 * rng.normal(size=len(data)))
                       for _ in range(8))


def test_rows_that_cross_the_edge_of_a_cell_again_and_again_are_no_repeats():
    """The strain is noisy there, and noise with a memory has not changed much meanwhile."""
    rng, rows = np.random.default_rng(0), 4000
    strain = 0.2 * np.abs(np.arange(rows) / 2000.0 - 1.0) + 1e-4 * rng.normal(size=rows)
    slow = lfilter([np.sqrt(1.0 - 0.9 ** 2)], [1.0, -0.9], rng.normal(size=rows))

    def log(trials):
        return build('log', strain, np.full(rows, 2e5), slow, np.arange(rows) * trials // rows,
                     0.02 * np.arange(rows))
    assert noise_floor(log(1)).repeats is None
    # two times each way
    there = np.tile(strain[::2], 2)
    twice = build('twice', there, np.full(rows, 2e5), slow, None, 0.02 * np.arange(rows))
    assert noise_floor(twice).repeats == pytest.approx(1.0, rel=0.3)


def test_a_force_that_goes_with_the_speed_is_no_offset(sweeps):
    """Half of the trials ten times faster: 4 N more in them may be an effect of the rate."""
    slow, fast = sweeps(noise=0.0, cycles=1), sweeps(noise=0.0, cycles=1, speed=0.24)
    rows = len(slow)
    data = build('speeds', np.tile(slow.strain, 2), np.tile(slow.pressure, (2, 1)),
                 np.append(slow.force, fast.force), np.append(slow.trial, slow.trial + 6),
                 np.append(slow.time, fast.time + 500.0))
    noise = 0.5 * np.random.default_rng(1).normal(size=2 * rows)
    assert trial_offsets(data, noise + 4.0 * (data.trial > 5)) is None
    assert trial_offsets(sweeps(noise=0.0), noise + 4.0 * (data.trial > 5)).size > 1.0


@pytest.mark.parametrize('named', [True, False])
def test_repeats_of_a_map_have_offsets_too(muscle, named):
    """Blocks of the file, or trials; where each point is repeated at once there are no blocks."""
    e, p = (np.tile(grid.ravel(), 3) for grid in np.meshgrid(np.linspace(0, 0.2, 9),
                                                             np.linspace(1e5, 4e5, 4)))
    block, rng = np.repeat(np.arange(3), 36), np.random.default_rng(8)
    force = muscle(e, p)
    values = np.array([0.0, 2.0, -2.0])[block] + 0.2 * rng.normal(size=108)
    data = build('map', e, p, force, block if named else None)
    found = trial_offsets(data, values)
    assert [found.rows[block == k].mean() for k in range(3)] == pytest.approx(
        [0.0, 2.0, -2.0], abs=0.2)
    assert found.size == pytest.approx(2.0, rel=0.1)
    at_once = np.argsort(np.arange(108) % 36, kind='stable')
    if not named:
        data = build('map', e[at_once], p[at_once], force[at_once])
        assert trial_offsets(data, values[at_once]) is None


def test_friction_of_a_map_is_no_offset(muscle):
    """Up in one sweep and down in the next: the two never met the same point the same way."""
    once = np.r_[np.linspace(0, 0.2, 20), np.linspace(0.2, 0, 20)]
    e, p = np.tile(once, 3), np.repeat([1e5, 2e5, 3e5], 40)
    way = np.tile(np.repeat([1.0, -1.0], 20), 3)
    data = build('map', e, p, muscle(e, p) - 4.0 * way, np.arange(120) // 20)
    noise = 0.2 * np.random.default_rng(9).normal(size=120)
    assert trial_offsets(data, noise - 4.0 * way) is None


@pytest.mark.parametrize('memory', [0.0, 0.5, 0.8])
def test_a_sample_with_a_memory_counts_less(memory):
    """Of autoregressive noise (1 + a)/(1 - a) samples make one that is independent."""
    white = np.random.default_rng(6).normal(size=40_000)
    found = autocorrelation_time(lfilter([1.0], [1.0, -memory], white), np.arange(40_000) // 4000)
    assert found == pytest.approx((1.0 + memory) / (1.0 - memory), rel=0.1)


def test_trials_are_correlated_each_with_itself_only():
    """Noise that turns its sign with each trial of four rows; what is constant counts as one."""
    trial = np.arange(400) // 4
    assert autocorrelation_time(np.where(trial % 2, 1.0, -1.0), trial) > 3.0
    assert autocorrelation_time(np.ones(50), np.zeros(50, int)) == 1.0
    alternating = np.where(np.arange(400) % 2, 1.0, -1.0)
    assert autocorrelation_time(alternating, np.zeros(400, int)) == 1.0


def test_uneven_steps_leave_the_noise_of_a_ramp_as_it_is():
    """A middle is held against the line of its neighbours where it is, not half way."""
    rng = np.random.default_rng(10)
    time = np.cumsum(rng.uniform(0.01, 0.1, 6000))
    data = build('log', 0.001 * time, 1e3 + 600.0 * time, time, None, time)
    noise = 0.5 * rng.normal(size=6000)
    assert second_differences(data, 5.0 * time + noise) == pytest.approx(0.5, rel=0.05)
    assert second_differences(data, 5.0 * time) < 1e-9
    cut = build('trials', data.strain, data.pressure, data.force, np.arange(6000) // 2, time)
    assert second_differences(cut, noise) is None


def test_noise_of_a_map_is_that_of_its_lines(muscle):
    """Of rows of one strain by their pressure, and of isobars in the file and by strain."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 0.2, 30),
                                                 np.linspace(0.0, 4e5, 20)))
    noise = 0.5 * np.random.default_rng(11).normal(size=600)
    data = build('map', e, p, muscle(e, p) + noise)
    smooth = 10.0 * e + 2e-5 * p
    floor = noise_floor(data, noise + smooth)
    assert floor.basis == 'second differences'
    assert floor.value == floor.differences == pytest.approx(0.5, rel=0.1)
    assert floor.repeats is floor.visits is None
    assert floor.correlation == 1.0
    assert floor.in_file_order == pytest.approx(0.5, rel=0.1)
    assert floor.in_strain_order == pytest.approx(0.5, rel=0.1)
    assert not floor.hides_loops
    shuffled = np.random.default_rng(12).permutation(600)
    mixed = build('map', e[shuffled], p[shuffled], data.force[shuffled])
    floor = noise_floor(mixed, (noise + smooth)[shuffled])
    assert floor.differences == pytest.approx(0.5, rel=0.1)
    assert floor.in_strain_order == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize('scattered', [False, True])
def test_a_difference_of_the_units_of_a_bundle_is_no_noise(scattered):
    """100 kPa in one unit is not 100 kPa in the other: the error of 20 N is smooth in both."""
    rng = np.random.default_rng(14)
    e, *p = (grid.ravel() for grid in np.meshgrid(
        np.linspace(0, 0.2, 9), np.linspace(0.0, 4e5, 6), np.linspace(0.0, 4e5, 6)))
    p = rng.uniform(0.0, 4e5, (len(e), 2)) if scattered else (
        np.stack(p, -1) + 300.0 * rng.normal(size=(len(e), 2)))
    noise = 0.5 * rng.normal(size=len(e))
    data = build('map', e, p, 1e-4 * p.sum(-1) - 100.0 * e + noise)
    error = 0.0 if scattered else 5e-5 * (p[:, 0] - p[:, 1])
    floor = noise_floor(data, noise + error)
    assert floor.value == pytest.approx(0.5, rel=0.25)
    assert not floor.hides_loops


def test_loops_of_a_map_are_smooth_in_the_file_and_not_by_strain(muscle):
    """Sweeps up and down without a column of time: friction is said to pass for noise."""
    once = np.r_[np.linspace(0, 0.2, 40), np.linspace(0.2, 0, 41)[1:]]
    e, p = np.tile(once, 5), np.repeat(np.linspace(1e5, 4e5, 5), 80)
    p = p + 50.0 * np.random.default_rng(14).normal(size=400)  # a regulator holds no better
    way = np.tile(np.repeat([1.0, -1.0], 40), 5)
    noise = 0.1 * np.random.default_rng(13).normal(size=400)
    data = build('map', e, p, muscle(e, p) - 4.0 * way + noise)
    floor = noise_floor(data, noise - 4.0 * way)
    assert floor.hides_loops
    assert floor.in_file_order == pytest.approx(0.1, rel=0.2)
    assert floor.in_strain_order > 2.0
    assert 'loops or drift' in floor.note
    calm = noise_floor(data, noise + 200.0 * e ** 2)  # an error of the model is smooth by strain
    assert not calm.hides_loops
    assert calm.in_strain_order == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize('memory', [0.0, 0.9])
def test_repeats_have_the_noise_of_a_sample_and_visits_tell_its_memory(muscle, memory):
    """White noise of 0.5 N, and slow noise of the same size: neighbours see hardly any of it."""
    count = 16_000
    time = 0.01 * np.arange(count)
    strain = 0.2 * np.abs((time / 20.0) % 2.0 - 1.0)
    pressure = np.where(time < 80.0, 2e5, 3e5)
    white = np.random.default_rng(14).normal(size=count)
    noise = 0.5 * np.sqrt(1.0 - memory ** 2) * lfilter([1.0], [1.0, -memory], white)
    data = build('slow', strain, pressure, muscle(strain, pressure) + noise, None, time)
    floor = noise_floor(data, noise)
    assert floor.repeats == pytest.approx(0.5, rel=0.15)
    rows = 2000.0 / 60.0  # of a visit
    # variance of a mean of correlated samples, over that of white ones
    expected = (1.0 + memory) / (1.0 - memory) - 2.0 * memory * (1.0 - memory ** rows) / (
        rows * (1.0 - memory) ** 2)
    assert floor.correlation == pytest.approx(expected, rel=0.35)
    assert floor.visits == pytest.approx(0.5 * np.sqrt(expected), rel=0.15)
    assert ('repeats differ more than neighbours do' in floor.note) == bool(memory)
    assert floor.differences == pytest.approx(0.5 * np.sqrt(
        (1.5 - 2.0 * memory + 0.5 * memory ** 2) / 1.5), rel=0.05)


def test_a_map_that_a_computer_made_has_no_noise():
    """A plane of strain and pressure, each once: nothing scatters, and nothing is below zero."""
    strain, pressure = (grid.ravel() for grid in np.meshgrid(
        0.025 * np.arange(9), 50e3 * np.arange(8)))
    floor = noise_floor(build('plane', strain, pressure, 2e-4 * pressure - 256.0 * strain))
    assert floor.repeats is None
    assert 0.0 <= floor.value < 1e-9


def test_too_few_rows_have_the_spread_of_their_residual():
    """A median deviation, and that it cannot be told from an error."""
    floor = _chosen(np.array([0.0, 1.0, 2.0, 3.0, 50.0]), None, None, None, 1.0, 0)
    assert (floor.value, floor.basis) == (1.4826, 'spread of the residual')
    assert floor.correlation == 1.0
    only = _chosen(np.zeros(9), 0.7, None, None, 1.0, 0)
    assert (only.value, only.differences, only.repeats, only.correlation) == (0.7, 0.7, None, 1.0)
    repeated = _chosen(np.zeros(9), None, 0.4, 0.5, 1.5, 20)
    assert (repeated.value, repeated.basis, repeated.correlation) == (0.4, 'repeats', 1.5)


@pytest.mark.parametrize('seed', range(3))
def test_noise_of_curves_that_share_no_strain_is_that_of_the_curves(muscle, seed):
    """As of a digitised figure: no strain comes back at another pressure."""
    rng = np.random.default_rng(seed)
    pressure = np.repeat([100e3, 200e3, 300e3, 400e3], 30)
    strain = np.concatenate([np.sort(rng.uniform(0.0, 0.24, 30)) for _ in range(4)])
    force = muscle(strain, pressure) + 2.0 * rng.standard_normal(120)
    floor = noise_floor(build('figure', strain, pressure, force),
                        force - muscle(strain, pressure))
    assert floor.basis == 'second differences'
    assert floor.value == pytest.approx(2.0, rel=0.3)
