# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Groups of samples: each sample is in one, with those that it belongs to."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.data.grouping import (
    merge,
    pressure_levels,
    pressure_speed,
    reversals,
    rms,
    strain_bins,
    varying_unit,
)
from fam_bundle_ros.data.measurement import build


def test_noisy_isobars_are_levels_with_their_means():
    """In any order of the rows, however few of them; levels rise with the pressure."""
    rng = np.random.default_rng(0)
    true = rng.permutation(np.repeat([0, 1, 2, 3], [400, 200, 50, 4]))
    pressure = np.array([1e5, 2e5, 2.5e5, 4e5])[true] + 500.0 * rng.normal(size=654)
    level, means = pressure_levels(pressure)
    assert (level == true).all()
    assert_allclose(means, [pressure[true == k].mean() for k in range(4)])


def test_a_swept_pressure_is_cut_into_eight_equal_ranges():
    """Equal bins also for too many levels, and for a level far wider than the gaps."""
    swept = np.linspace(0.0, 400e3, 1600, endpoint=False)
    level, means = pressure_levels(swept)
    assert level.tolist() == np.repeat(np.arange(8), 200).tolist()
    assert_allclose(means, swept.reshape(8, 200).mean(1))
    many = np.repeat(np.arange(24.0), 5)
    assert len(pressure_levels(many)[1]) == 24
    assert len(pressure_levels(np.append(many, 24.0))[1]) == 8
    assert len(pressure_levels(np.append(np.linspace(0.0, 1.0, 300), 1.5))[1]) < 8
    assert len(pressure_levels(np.append(np.linspace(0.0, 1.0, 300), 9.0))[1]) == 2


def test_one_pressure_is_one_level():
    """One level, whose mean is the pressure."""
    level, means = pressure_levels(np.full(5, 2e5))
    assert level.tolist() == [0] * 5
    assert means.tolist() == [2e5]


def test_strain_bins_are_equally_wide_and_hold_all():
    """The highest strain is in the last; the edges are those of the bins."""
    strain = np.random.default_rng(1).uniform(-0.05, 0.25, 500)
    index, edges = strain_bins(strain, 6)
    assert (edges[0], edges[-1]) == (strain.min(), strain.max())
    assert_allclose(np.diff(edges), np.ptp(strain) / 6.0)
    assert set(index) == set(range(6))
    assert np.all((edges[index] <= strain) & (strain <= edges[index + 1]))


def test_two_wide_bands_of_pressure_are_no_levels():
    """One of 0 to 30 and one of 60 to 100 kPa: each is cut as a ramp would be."""
    column = 1e3 * np.concatenate([np.linspace(0.0, 30.0, 31), np.linspace(60.0, 100.0, 41)])
    index, _ = pressure_levels(column)
    assert max(np.ptp(column[index == k]) for k in np.unique(index)) < 13e3


def test_strains_of_a_map_have_a_bin_each_with_edges_half_way():
    """As many strains as bins at most."""
    strain = np.repeat([0.0, 0.1, 0.15, 0.3], 3)
    index, edges = strain_bins(strain, 4)
    assert index.tolist() == np.repeat(np.arange(4), 3).tolist()
    assert_allclose(edges, [0.0, 0.05, 0.125, 0.225, 0.3], atol=2e-6)
    assert edges[0] < 0.0
    assert edges[-1] > 0.3
    assert_allclose(strain_bins(strain, 3)[1], [0.0, 0.1, 0.2, 0.3])


def test_merged_blocks_are_neighbours_and_of_like_size():
    """Ten groups in four blocks: two or three each; few enough are left as they are."""
    labels = np.repeat([3, 7, 8, 20, 21, 30, 31, 33, 40, 50], 2)
    merged = merge(labels, 4)
    assert merged.tolist() == np.repeat([0, 0, 0, 1, 1, 2, 2, 2, 3, 3], 2).tolist()
    assert merge(labels, 10).tolist() == np.repeat(np.arange(10), 2).tolist()


def test_rms_of_nothing_is_no_number():
    """Of 3 and 4 it is the root of 12.5."""
    assert rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5))
    assert np.isnan(rms([]))


def test_isobars_are_named_by_the_unit_whose_pressure_varies_most(muscle):
    """Not by the highest pressure; how fast it changes is asked of that unit too."""
    time = 0.1 * np.arange(200)
    strain = 0.1 - 0.1 * np.cos(time)
    pressure = np.stack([np.full(200, 3e5), 1e5 + 4e3 * time, np.full(200, 5e4)], -1)
    data = build('three', strain, pressure, muscle(strain, 3e5), None, time)
    assert varying_unit(data) == 1
    assert_allclose(pressure_speed(data), 4e3, rtol=1e-3)
    falling = replace(data, pressure=pressure[::-1])
    assert_allclose(pressure_speed(falling), 4e3, rtol=1e-3)


def test_the_direction_is_unknown_two_rows_about_a_turn_and_where_a_trial_begins(muscle):
    """A rest in between is no turn, nor is what the trial before did."""
    strain = np.linspace(0.0, 0.2, 24)
    data = build('log', strain, np.full(24, 2e5), muscle(strain, 2e5), np.repeat([0, 1], 12),
                 0.1 * np.arange(24))
    way = np.repeat([1, -1, 1, 0, -1], [6, 6, 5, 1, 6])
    unsure = reversals(replace(data, direction=way))
    expected = np.zeros(24, bool)
    expected[[0, 4, 5, 6, 7, 12]] = True
    assert unsure.tolist() == expected.tolist()
    assert not reversals(replace(data, time=None)).any()
