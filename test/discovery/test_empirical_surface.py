# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A static map predicted without physics, and a model that is corrected to it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.grouping import rms
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import empirical_surface
from fam_bundle_ros.discovery.add import recommend
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.empirical_surface import EmpiricalSurface
from fam_bundle_ros.discovery.held_out import folds, held_out
from fam_bundle_ros.discovery.leftover import Leftover
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.predict import predict
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.discovery.words import notes_on
from fam_bundle_ros.model import load_model


def force(strain, pressure):
    """Return a six-parameter form that bends with pressure, slack below zero, N."""
    bar = pressure / 1e5
    form = (110 * bar + 20) * np.exp(-7 * strain) - 240 * strain * bar - 20 * bar
    return np.maximum(form + 8 * np.sin(1.5 * bar), 0.0)


def static_map(noise=0.3, strains=9):
    """Return a map of isobars with noise, N."""
    e, p = (x.ravel() for x in np.meshgrid(np.linspace(0.0, 0.25, strains),
                                           np.linspace(0.4e5, 4e5, 10)))
    rng = np.random.default_rng(1)
    return build('map', e, p, force(e, p) + noise * rng.standard_normal(len(e)))


def fitted(model, data):
    """Return a model's fitter, its fit with and without a discrepancy, and its held-out errors."""
    search = Search(Options(model, reduce(model, data), Choices()))
    joint = search.fit(search.options.own)
    physics = search.fitter.without_discrepancy(joint)
    return search.fitter, joint, physics, held_out(search.fitter, physics, joint)


@pytest.fixture(scope='module')
def wrong(paper_muscle):
    """Return `fitted` of a muscle that cannot have this force."""
    return fitted(paper_muscle, static_map())


def test_form_and_surface_are_right_between_the_rows(wrong):
    """The form alone is off by what bends."""
    rng = np.random.default_rng(2)
    e, p = rng.uniform(0.02, 0.23, 200), rng.uniform(0.5e5, 3.9e5, (200, 1))
    found = EmpiricalSurface.of(wrong[0])
    true = force(e, p[:, 0])
    assert rms(found.form(e, p) - true) > 2.0
    assert rms(found.force(e, p) - true) < 1.0


def test_the_form_stays_within_the_measured_forces(wrong):
    """Far outside the map the exponential would be anything."""
    cells = wrong[0].cells
    far = EmpiricalSurface.of(wrong[0]).form(np.linspace(-1.0, 1.0, 60), np.full((60, 1), 9e5))
    assert (far.min(), far.max()) == (cells.force.min(), cells.force.max())


def test_each_fold_is_predicted_without_its_rows(wrong):
    """Other forces in the rows left out change nothing that is predicted there."""
    fitter = wrong[0]
    cells, hyper = fitter.cells, EmpiricalSurface.of(fitter).surface.hyper
    every = [fold[1:] for fold in folds(cells)]
    errors = empirical_surface.errors(fitter, every)
    for (train, test), error in list(zip(every, errors))[2::4]:
        there = replace(cells, force=cells.force + 5.0 * test, data=replace(
            cells.data, force=cells.data.force + 5.0 * test[cells.label]))
        moved = SimpleNamespace(cells=there, covariance=fitter.covariance)
        predicted = EmpiricalSurface.of(moved, hyper, train).force(
            cells.strain[test], cells.pressure[test])
        np.testing.assert_allclose(cells.force[test] - predicted, error, atol=0.01)


def test_it_is_among_the_rivals_of_a_static_map_of_one_muscle_only(wrong, paper_muscle, sweeps):
    """With time, at constant force or with two units, it does not apply."""
    fitter, _, _, held = wrong
    assert held.rivals[empirical_surface.NAME] < 0.7 * held.rivals['empirical']
    assert empirical_surface.applies_to(fitter.cells)
    assert not empirical_surface.applies_to(replace(fitter.cells, stiffness=fitter.cells.force))
    assert not empirical_surface.applies_to(replace(
        fitter.cells, pressure=np.hstack([fitter.cells.pressure] * 2)))
    timed = fitted(paper_muscle, sweeps(cycles=1))
    assert empirical_surface.NAME not in timed[3].rivals


@pytest.mark.parametrize('name', ['', 'pressure_sensor_gain', 'strain_sensor_offset'])
def test_a_model_that_predicts_worse_is_corrected_to_it(paper_muscle, tmp_path, name):
    """The file that is written has the force of form and surface, whatever its gauges read."""
    model = paper_muscle.with_effect(name) if name else paper_muscle
    fitter, joint, physics, held = fitted(model, static_map(strains=8))
    found = recommend(physics.model, physics, joint, held, fitter)
    assert found.kind == empirical_surface.NAME
    assert found.held_out_N == held.rivals[empirical_surface.NAME] < 0.7 * held.best
    assert 0.2 < found.leftover.sd.min() < found.leftover.sd.max() < 1.0
    found.save(tmp_path / 'model.yaml')
    unseen = static_map(noise=0.0, strains=14)
    written = load_model(tmp_path / 'model.yaml')
    right = EmpiricalSurface.of(fitter).force(unseen.strain, unseen.pressure)
    np.testing.assert_allclose(predict(written, unseen), right, atol=0.5)
    assert rms(predict(written, unseen) - unseen.force) < 1.0
    # its table has seen the rows that folds leave out
    for fit, told in ((fitted(written, static_map(strains=8))[2], True), (physics, False)):
        notes = notes_on(fitter.cells, SimpleNamespace(note=''), fit, fit, held)
        assert any('held-out errors are too small' in note for note in notes) == told


def test_the_correction_is_exact_at_the_measured_places(paper_muscle):
    """Also where the physics bends within one step of the table, as a stiff sheath does."""
    model = paper_muscle.with_effect('saturating_sheath', size=200.0, width=2e-3)
    data = static_map(strains=8)
    search = Search(Options(model, reduce(model, data), Choices()))
    physics = search.fitter.without_discrepancy(search.fit(search.options.own))
    table = Leftover.to_empirical(search.fitter, physics)
    right = EmpiricalSurface.of(search.fitter)
    bends = physics.model.force(np.array([0.0, 0.005]), np.full((2, 1), 1e5))
    assert bends[0] - bends[1] > 20.0
    assert set(np.unique(data.strain).round(6)) <= set(table.strain)
    for level in np.unique(data.pressure):
        column = int(np.argmin(np.abs(table.pressure[0] - level)))
        assert abs(table.pressure[0, column] - level) < 1.0
        pressure = np.full((len(table.strain), 1), table.pressure[0, column])
        total = physics.model.force(table.strain, pressure) + table.even[0, :, column]
        np.testing.assert_allclose(total, right.force(table.strain, pressure))


def test_physics_that_predicts_as_well_is_not_corrected(wrong, paper_muscle):
    """Neither is one that is worse by less than the noise of a row shows."""
    fitter, joint, physics, held = wrong
    form = held.rivals[empirical_surface.NAME]
    seen = 0.5 * fitter.cells.noise
    for beyond, corrected in ((0.9, False), (1.1, True)):
        near = replace(held, physics=np.hypot(form, beyond * seen), discrepancy=np.inf)
        found = recommend(paper_muscle, physics, joint, near, fitter)
        assert (found.kind == empirical_surface.NAME) == corrected
        assert (found.leftover is None) != corrected
    one_fold = {**held.typical, empirical_surface.NAME: 1.1 * held.typical['physics']}
    for other in (replace(held, physics=0.5 * form, discrepancy=np.inf),
                  replace(held, discrepancy=np.inf, kinds={}),  # errors of the fit: no folds
                  replace(held, discrepancy=np.inf, typical=one_fold)):
        assert recommend(paper_muscle, physics, joint, other, fitter).kind == 'physics'


def test_the_typical_error_is_not_that_of_the_worst_fold(wrong):
    """The geometric mean over folds, of each model and rival."""
    fitter, _, physics, held = wrong
    every = list(folds(fitter.cells))
    surface = fitter.rival_errors[empirical_surface.NAME]
    alone = [fitter.refit_to(physics, train)[1][test] for _, train, test in every]
    for name, errors in ((empirical_surface.NAME, surface), ('physics', alone)):
        each = [np.log(rms(error)) for error in errors]
        assert held.typical[name] == pytest.approx(np.exp(np.mean(each)), rel=1e-3)
    assert held.typical[empirical_surface.NAME] < 0.6 * held.rivals[empirical_surface.NAME]
