# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors on what a fit has not seen, and the rivals that it is held against."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.reading import read_measurement
from fam_bundle_ros.discovery import rivals
from fam_bundle_ros.discovery.cells import Cells, reduce
from fam_bundle_ros.discovery.held_out import (
    beyond_cells,
    folds,
    held_out,
    held_out_physics,
    HeldOut,
    splits,
    squares_of_folds,
)
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.model import load_model

HELD = HeldOut(3.0, 4.0, {'mean': 12.0}, {'trial': (3.0, 4.0), 'strain': (5.0, 2.0)}, blind=6.0)


def test_no_worse_is_no_worse_on_any_kind_of_folds():
    """Alone, and at best with or without the discrepancy."""
    assert HELD.best == 3.0
    assert HELD.is_no_worse(HELD)
    for worse in (replace(HELD, physics=3.1, discrepancy=2.0),
                  replace(HELD, kinds={'trial': (3.1, 1.0), 'strain': (5.0, 2.0)}),
                  replace(HELD, kinds={'trial': (3.0, 4.0), 'strain': (5.0, 2.1)})):
        assert not worse.is_no_worse(HELD)
    assert replace(HELD, physics=3.1, discrepancy=2.9).best == 2.9
    better = replace(HELD, kinds={'trial': (2.0, 9.0), 'strain': (1.0, 9.0)})
    assert better.is_no_worse(HELD)
    assert not HELD.is_no_worse(better)


def test_errors_of_rows_are_those_of_cells_and_what_rows_are_off_besides():
    """Added by their squares, to the rivals too."""
    rows = HELD.of_rows(4.0)
    assert (rows.physics, rows.rivals, rows.blind) == (
        5.0, {'mean': pytest.approx(np.hypot(12.0, 4.0))}, pytest.approx(np.hypot(6.0, 4.0)))
    assert rows.discrepancy == pytest.approx(np.hypot(4.0, 4.0))
    assert rows.kinds == HELD.kinds
    cells = SimpleNamespace(count=np.array([1.0, 3.0]))
    cells.mean_square = lambda residual: Cells.mean_square(cells, residual)
    fit = SimpleNamespace(residual=np.array([4.0, -2.0]))
    assert beyond_cells(cells, fit, 5.0) == pytest.approx(np.sqrt(25.0 - 28.0 / 4.0))
    assert beyond_cells(cells, fit, 1.0) == 0.0


@pytest.fixture(scope='module')
def fitted(make_sweeps, paper_muscle):
    """Return a fitter on few cells, and the fit of the model without a discrepancy."""
    cells = reduce(paper_muscle, make_sweeps(cycles=1), most=60)
    search = Search(Options(paper_muscle, cells, Choices()))
    fitter, joint = search.fitter, search.fit(search.options.own)
    return fitter, fitter.without_discrepancy(joint)


def test_cells_are_left_out_once_with_their_trial_isobar_or_strain(fitted):
    """Those that are there and those that are not are all cells."""
    cells = fitted[0].cells
    found = dict(splits(cells))
    assert list(found) == ['trial', 'isobar', 'strain']
    for k, label in enumerate(found['trial']):
        others = found['trial'][cells.trial == cells.trial[k]]
        assert np.all(others == label)
    for kind, there, gone in folds(cells):
        assert np.all(there != gone)
        label = found[kind]
        assert len(np.unique(label[gone])) == 1
        assert np.all(label[there] != label[gone][0])
    times = sum(gone.astype(int) for kind, _, gone in folds(cells) if kind == 'isobar')
    assert np.all(times == 1)


def test_the_held_out_error_is_that_of_refits_without_each_fold(fitted):
    """Squares of all folds by their rows, of a model refitted by least squares."""
    fitter, fit = fitted
    cells, total, rows = fitter.cells, 0.0, 0.0
    each = []
    sd = 1.0 / fitter.covariance.whiten(fit.hyper, np.ones(len(cells)))
    for _, there, gone in folds(cells):
        # near the fit the model is linear
        columns = np.vstack([fit.slopes[there] / sd[there, None], np.eye(len(fit.u))])
        target = np.append(fit.residual[there] / sd[there], -fit.u)
        step = np.linalg.lstsq(columns, target, rcond=None)[0]
        off = (fit.residual - fit.slopes @ step)[gone]
        each.append(np.sum(cells.count[gone] * off ** 2))
        total, rows = total + each[-1], rows + cells.count[gone].sum()
    assert squares_of_folds(fitter, fit) == pytest.approx(np.array(each) / rows, rel=0.1, abs=1e-3)
    assert held_out_physics(fitter, fit) == pytest.approx(np.sqrt(total / rows), rel=0.03)


def test_a_fold_is_predicted_by_a_fit_that_has_never_seen_it(repository):
    """
    DMSP-20 at three strains: what the outer two say of the middle one is 60 N off.

    A fit that starts at the one to all three is as probable there, and only 4 N off in the middle.
    """
    folder = repository / 'config' / 'data'
    model = load_model(folder / 'dmsp20_static_map.model.yaml')
    data = read_measurement(folder / 'dmsp20_static_map.csv')
    three, outer = (data.select(np.abs(data.strain[:, None] - strains).min(axis=1) < 2e-3)
                    for strains in ([0.0, 0.098, 0.25], [0.0, 0.25]))

    def fitted(rows):
        search = Search(Options.of(model, reduce(model, rows), Choices()))
        return search.fitter, search.fitter.without_discrepancy(search.fit(
            ('end_caps', 'mesh', 'saturating_sheath', 'tendon_slack', 'threshold_pressure')))
    (fitter, fit), (_, alone) = fitted(three), fitted(outer)
    middle = three.select(np.abs(three.strain - 0.098) < 2e-3)
    truly = rms(middle.force - predict(alone.model, middle))
    found, = [rms(fitter.refit_to(fit, there)[1][gone])
              for kind, there, gone in folds(fitter.cells) if kind == 'strain']
    assert found == pytest.approx(truly, rel=0.1) == pytest.approx(63.0, rel=0.1)
    assert rms(fit.residual) < 2.0


def test_contributions_of_the_folds_add_up_to_the_mean_square_error(fitted):
    """Each fold by its rows, so that folds of two models can be compared one by one."""
    fitter, fit = fitted
    found = held_out(fitter, fit, fit)
    assert len(found.squares) == len([*folds(fitter.cells)]) > 1
    assert found.squares.sum() == pytest.approx(found.physics ** 2)


def test_what_cannot_be_left_out_has_the_error_of_the_fit(fitted, monkeypatch):
    """Data of one place: there are no folds, and 2 N rms are 2 N rms."""
    fitter, fit = fitted
    monkeypatch.setattr('fam_bundle_ros.discovery.held_out.splits', lambda cells: [])
    sign = np.where(np.arange(len(fit.residual)) % 2, 2.0, -2.0)
    assert squares_of_folds(fitter, replace(fit, residual=sign)) == pytest.approx(4.0)
    assert held_out_physics(fitter, replace(fit, residual=sign)) == pytest.approx(2.0)


def test_a_rival_is_fitted_to_cells_by_their_rows():
    """Of two forces at one place the mean by their weights; a curve is of degree 5."""
    e, p = np.tile(np.linspace(0.0, 0.2, 12), 2), np.repeat([[1e5], [3e5]], 12, axis=0)
    weight = np.repeat([1.0, 3.0], 12)
    force = 10.0 * np.repeat([0.0, 1.0], 12)
    assert rivals.mean(e, p, force, weight)(e[:2], p[:2]) == pytest.approx(7.5)
    curve = 3.0 - 40.0 * e + 900.0 * e ** 2 - 2e4 * e ** 5
    found = rivals.strain_alone(e, p, curve + force, weight)(e, p)
    assert_allclose(found, curve + 7.5, atol=1e-6)
    flat = force - 20.0 * e
    assert_allclose(rivals.plane(e, p, flat, weight)(e, p), flat, atol=1e-9)


@pytest.mark.parametrize(('away', 'least'), [(0.047, 4.59), (0.098, 3.37), (0.155, 1.85),
                                             (0.199, 2.89)])
def test_the_empirical_form_is_fitted_to_a_measured_muscle_as_well_as_can_be(repository, away,
                                                                             least):
    """To a DMSP-20 without one strain; ``least`` (N rms) from many starting points."""
    data = read_measurement(repository / 'config/data/dmsp20_static_map.csv')
    there = data.select(np.abs(data.strain - away) > 0.01)
    found = rivals.empirical(there.strain, there.pressure, there.force, np.ones(len(there)))
    off = found(there.strain, there.pressure) - there.force
    assert np.sqrt(np.mean(off ** 2)) == pytest.approx(least, abs=0.01)


@pytest.mark.parametrize(('rival', 'degree'), [('mean', 0), ('plane', 1), ('empirical', 3),
                                               (rivals.BLIND, 0)])
def test_at_a_constant_force_rivals_are_polynomials_of_the_pressure(rival, degree):
    """Of the strain, told in newtons by the model's stiffness."""
    rng = np.random.default_rng(0)
    pressure = rng.uniform(0.0, 4e5, 40)
    x = pressure / 4e5
    strain = 0.2 * x + 0.1 * x ** 2 - 0.15 * x ** 3 + 0.02 * x ** 4
    stiffness = rng.uniform(300.0, 900.0, 40)
    cells = SimpleNamespace(strain=strain, pressure=pressure[:, None], count=np.ones(40),
                            force=np.full(40, 50.0), stiffness=stiffness, one_force=True)
    train = np.arange(40) < 30
    best = np.polynomial.Polynomial.fit(x[train], strain[train], degree)
    within = np.clip(best(x[~train]), strain.min(), strain.max())
    expected = stiffness[~train] * (within - strain[~train])
    assert_allclose(rivals.rival_error(rival, cells, train, ~train), expected, atol=1e-6)
