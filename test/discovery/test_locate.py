# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Where an error was planted is where it is found, in rows, numbers and words."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.discovery.locate import _boxes, _corner_sums, locate

ALL = (-1, 1)


@pytest.fixture
def planted(sweeps):
    """Return sweeps (six isobars 83 kPa apart) and a function that makes an error in a box."""
    data = sweeps()
    noise = 0.3 * np.random.default_rng(3).normal(size=len(data))

    def rows(low=0.0, high=0.24, first=0, last=5, ways=ALL):
        level = np.round(data.pressure[:, 0] / 82.74e3)
        return ((data.strain >= low) & (data.strain <= high) & (level >= first) & (level <= last)
                & np.isin(data.direction, ways))
    return data, noise, rows


@pytest.mark.parametrize(('box', 'words'), [
    ({}, 'everywhere'),
    ({'high': 0.0799}, 'strain below 0.08 at every pressure'),
    ({'low': 0.1601}, 'strain above 0.16 at every pressure'),
    ({'low': 0.0601, 'high': 0.1199}, 'strain 0.06 to 0.12 at every pressure'),
    ({'first': 3, 'last': 3}, 'every strain at 248 kPa'),
    ({'last': 1}, 'every strain at 83 kPa and below'),
    ({'first': 4}, 'every strain at 331 kPa and above'),
    ({'first': 2, 'last': 4}, 'every strain at 165 to 331 kPa'),
    ({'last': 0, 'high': 0.0599}, 'strain below 0.06 at 0 kPa'),
    ({'first': 5, 'low': 0.1401, 'ways': (1,)},
     'strain above 0.14 at 414 kPa while shortening'),
    ({'first': 1, 'last': 2, 'ways': (-1,)}, 'every strain at 83 to 165 kPa while lengthening'),
    ({'ways': (1,)}, 'everywhere while shortening')])
def test_an_error_in_a_box_is_found_where_it_is(planted, box, words):
    """Its rows, its size and sign, and that it is all there is beyond the noise."""
    data, noise, rows = planted
    wrong = rows(**box)
    residual = noise - 5.0 * wrong
    region, *others = locate(data, residual, 0.3)
    assert region.where == words
    assert np.mean(region.rows == wrong) > 0.98  # a row on an edge may be in either bin
    assert region.samples == region.rows.sum()
    assert region.bias_N == pytest.approx(residual[region.rows].mean())
    assert region.error_N == pytest.approx(np.sqrt(np.mean(residual[region.rows] ** 2)))
    squares = residual ** 2 - 0.3 ** 2
    share = squares[region.rows].sum() / squares.sum()
    assert region.share == pytest.approx(min(share, 1.0))
    assert region.share > 0.95
    assert all(other.share < 0.05 for other in others)


def test_an_error_of_the_size_of_the_noise_is_found_if_many_rows_have_it(planted):
    """At each place it is in the mean of the rows; that noise alone is anywhere is not said."""
    data, noise, rows = planted
    wrong = rows(low=0.1601)
    region, *_ = locate(data, noise - 0.35 * wrong, 0.3)
    assert np.mean(region.rows == wrong) > 0.9
    assert region.bias_N == pytest.approx(-0.35, abs=0.05)


def test_a_gauge_a_little_below_zero_is_told_as_zero(planted):
    """Not as minus zero."""
    data, noise, rows = planted
    region, *_ = locate(replace(data, pressure=data.pressure - 200.0),
                        noise - 5.0 * rows(last=0, high=0.0599), 0.3)
    assert region.where == 'strain below 0.06 at 0 kPa'


def test_two_errors_are_two_regions_the_larger_first(planted):
    """No row is in both; asked for one region, the larger comes alone."""
    data, noise, rows = planted
    small, large = rows(low=0.1201, first=4), rows(high=0.0599, last=1)
    residual = noise + 3.0 * small - 6.0 * large
    found = locate(data, residual, 0.3)
    assert [region.where for region in found[:2]] == [
        'strain below 0.06 at 83 kPa and below', 'strain above 0.12 at 331 kPa and above']
    assert found[1].bias_N == pytest.approx(3.0, abs=0.1)
    assert not (found[0].rows & found[1].rows).any()
    assert sum(region.share for region in found) == pytest.approx(1.0, abs=0.05)
    assert len(locate(data, residual, 0.3, most=1)) == 1


def test_friction_has_the_sign_of_the_motion(planted):
    """An error of one sign both ways has not, nor one that is there in one direction only."""
    data, noise, rows = planted
    said = ', with the sign of the motion'
    assert locate(data, noise - 3.0 * data.direction, 0.3)[0].where == f'everywhere{said}'
    assert said not in locate(data, noise - 3.0, 0.3)[0].where
    # nor one that only changes a little with it
    mixed = np.where(np.arange(len(data)) % 2, 6.0, -6.0) - data.direction
    assert not any(said in each.where for each in locate(data, noise + mixed, 0.3))
    assert said not in locate(data, noise - 3.0 * rows(ways=(1,)), 0.3)[0].where


def test_noise_is_nowhere(planted):
    """Nor is an error that is none at all."""
    data, noise, _ = planted
    assert locate(data, noise, 0.3) == ()
    assert locate(data, 0.0 * noise, 0.3) == ()


def test_rows_past_the_free_strain_are_told_as_such(planted):
    """Where the region is made of them and holds most of them."""
    data, noise, rows = planted
    past = rows(low=0.1601)
    assert locate(data, noise + 5.0 * past, 0.3, past)[0].where == 'past free strain'
    one_way = past & (data.direction > 0)
    assert locate(data, noise + 5.0 * one_way, 0.3, one_way)[0].where == (
        'past free strain while shortening')
    assert locate(data, noise + 5.0 * past, 0.3, rows(low=0.0801))[0].where.startswith('strain')
    assert locate(data, noise + 5.0 * past, 0.3, rows(low=0.2201))[0].where.startswith('strain')


def test_a_region_of_a_bundle_names_the_unit_whose_pressure_it_is(planted):
    """Of several motor units the one that varies."""
    data, noise, rows = planted
    held = np.stack([np.full(len(data), 2e5), data.pressure[:, 0]], -1)
    two = replace(data, pressure=held, motor_units=('mu1', 'mu2'))
    assert locate(two, noise + 5.0 * rows(first=3, last=3), 0.3)[0].where == (
        'every strain at mu2 248 kPa')


def test_a_lone_trial_takes_three_others_and_most_of_the_error(planted):
    """Beside an error in another trial it is no lone one; nor with three trials in all."""
    data, noise, _ = planted
    wrong = data.trial == 7
    found = locate(data, noise + 5.0 * wrong, 0.3)
    assert [region.where for region in found] == [f'trial {data.trial_names[7]} alone']
    for other in (noise + 5.0 * wrong + 1.0 * (data.trial == 2), noise + 5.0):
        assert 'alone' not in locate(data, other, 0.3)[0].where
    three = data.select(data.trial < 3)
    three = replace(three, trial_names=data.trial_names[:3])
    assert 'alone' not in locate(three, 5.0 * (three.trial == 1.0), 0.3)[0].where


def test_sums_of_boxes_are_differences_of_corner_sums():
    """Every box once, the whole and single cells among them."""
    table = np.random.default_rng(0).normal(size=(3, 4))
    corner, boxes = _corner_sums(table), list(_boxes(3, 4))
    assert len(boxes) == len(set(boxes)) == 6 * 10
    for (a, b), (c, d) in boxes:
        held = (corner[b + 1, d + 1] - corner[a, d + 1] - corner[b + 1, c] + corner[a, c])
        assert held == pytest.approx(table[a:b + 1, c:d + 1].sum())
