# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Held-out folds leave out what was measured together, and nothing twice."""

import numpy as np
import pytest

from fam_bundle_ros.data import Folds, held_out
from fam_bundle_ros.data.folds import offered
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.errors import InputError


@pytest.fixture
def static_map(muscle):
    """Return a map of six strains and five pressures, as a table lists it."""
    e, p = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 0.2, 6),
                                                 np.linspace(1e5, 5e5, 5)))
    return build('map', e, p, muscle(e, p))


@pytest.mark.parametrize('by', ['trial', 'isobar', 'strain'])
def test_train_and_test_share_no_row_and_no_group(sweeps, by):
    """Each fold is whole: no trial, isobar or strain level is on both sides."""
    data = sweeps()
    groups = {'trial': data.trial, 'isobar': np.round(data.pressure[:, 0] / 1e3),
              'strain': Folds('strain').labels(data)}[by]
    for train, test in Folds(by).split(data):
        assert not set(train) & set(test)
        assert len(train) + len(test) == len(data)
        assert not set(groups[train]) & set(groups[test])


@pytest.mark.parametrize('by', ['trial', 'isobar'])
def test_every_row_is_left_out_once(sweeps, by):
    """Together the folds of trials and isobars cover the data."""
    data = sweeps()
    assert Folds('trial').n_splits(data) == 8
    left = np.concatenate([test for _, test in Folds(by).split(data)])
    assert np.array_equal(np.sort(left), np.arange(len(data)))


def test_outer_strain_levels_are_never_left_out(static_map):
    """A model is asked to interpolate in strain, not to extrapolate."""
    left = np.concatenate([test for _, test in Folds('strain').split(static_map)])
    assert set(np.round(static_map.strain[left], 3)) == {0.04, 0.08, 0.12, 0.16}
    assert Folds('strain').n_splits(static_map) == 4


def test_isobars_of_a_map_are_its_pressures(static_map):
    """Five pressures give five folds; at most two are given where two are asked for."""
    assert Folds('isobar').n_splits(static_map) == 5
    assert Folds('isobar', most=2).n_splits(static_map) == 2
    assert offered(static_map) == ['isobar', 'strain']


def test_held_out_errors_are_those_of_rows_not_seen(static_map):
    """An estimator that remembers its rows is exact on them and useless on others."""
    class Mean:
        def fit(self, data):
            self.seen, self.mean = set(data.force), data.force.mean()
            return self

        def predict(self, data):
            assert not self.seen & set(data.force)
            return np.full(len(data), self.mean)

    folds = Folds('strain')
    residual = held_out(Mean(), static_map, folds)
    never = folds.labels(static_map) < 0
    assert np.isnan(residual[never]).all()
    first = folds.labels(static_map) == 0
    mean = static_map.force[~first].mean()
    assert np.allclose(residual[first], static_map.force[first] - mean)


def test_folds_that_the_data_do_not_offer_fail(static_map):
    """One trial cannot be left out; the message says what can."""
    with pytest.raises(InputError, match='fewer than two trials .* isobar, strain'):
        list(Folds('trial').split(static_map))


@pytest.mark.parametrize('wrong', [{'by': 'row'}, {'most': 1}])
def test_folds_of_no_kind_fail(wrong):
    """Unknown kinds and fewer than two folds are refused."""
    with pytest.raises(InputError):
        Folds(**wrong)
