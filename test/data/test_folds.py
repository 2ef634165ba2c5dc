# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Held-out folds leave out what was measured together."""

import numpy as np
import pytest

from fam_bundle_ros.data.folds import fold_labels
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.errors import InputError


@pytest.fixture
def static_map(muscle):
    """Return a map of six strains and five pressures, as a table lists it."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 0.2, 6),
                                                 np.linspace(1e5, 5e5, 5)))
    return build('map', e, p, muscle(e, p))


@pytest.mark.parametrize('by', ['trial', 'isobar'])
def test_a_trial_and_an_isobar_are_in_one_fold_and_each_is_left_out(sweeps, by):
    """No group is on both sides of a split, and no row is in none."""
    data = sweeps()
    groups = {'trial': data.trial, 'isobar': np.round(data.pressure[:, 0] / 1e3)}[by]
    label = fold_labels(data, by)
    assert set(label) == set(range(8 if by == 'trial' else label.max() + 1))
    assert all(len(set(label[groups == group])) == 1 for group in np.unique(groups))


def test_outer_strain_levels_are_never_left_out(static_map):
    """A model is asked to interpolate in strain, not to extrapolate."""
    label = fold_labels(static_map, 'strain')
    assert set(np.round(static_map.strain[label >= 0], 3)) == {0.04, 0.08, 0.12, 0.16}
    assert label.max() == 3


def test_isobars_of_a_map_are_its_pressures(static_map):
    """Five pressures give five folds; at most two are given where two are asked for."""
    label = fold_labels(static_map, 'isobar')
    assert label.max() == 4
    assert all(len(set(static_map.pressure[label == k, 0])) == 1 for k in range(5))
    assert fold_labels(static_map, 'isobar', most=2).max() == 1


def test_folds_of_no_kind_fail(static_map):
    """The message says which there are."""
    with pytest.raises(InputError, match="folds by 'row'; expected one of trial, isobar, strain"):
        fold_labels(static_map, 'row')


@pytest.mark.parametrize(('count', 'kept'), [(30, 28), (31, 24)])
def test_many_strains_of_a_map_are_cut_into_eight_bins(muscle, count, kept):
    """Of which the inner six are left out in turn; up to 30 strains are levels of their own."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 0.2, count), [1e5, 2e5, 3e5]))
    label = fold_labels(build('map', e, p, muscle(e, p)), 'strain')
    assert len(np.unique(e[label >= 0])) == pytest.approx(kept, abs=1)
    assert label.max() == (7 if count == 30 else 5)
    assert (label[np.isin(e, (0.0, 0.2))] == -1).all()
    # rising with the strain, each strain in one
    order = np.argsort(e, kind='stable')
    inner = label[order][label[order] >= 0]
    assert np.all(np.diff(inner) >= 0)
    assert np.bincount(inner).min() > 0.4 * np.bincount(inner).max()


def test_a_strain_that_is_held_has_no_inner_levels(muscle):
    """Strains that differ only by rounding are one level."""
    strain = 0.1 + 1e-6 * np.random.default_rng(0).normal(size=60)
    pressure = np.linspace(0.0, 3e5, 60)
    data = build('held', strain, pressure, muscle(0.1, pressure))
    assert len(set(fold_labels(data, 'strain'))) <= 7
    assert set(fold_labels(data, 'isobar')) == set(range(8))
