# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The surface that physics leaves, against the conditional mean and spread of a normal."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance, Hyper
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.settings import AMPLITUDES, PRESSURE_LENGTHS, STRAIN_LENGTHS
from fam_bundle_ros.discovery.surface import _averaged, Surface, way_of
from fam_bundle_ros.model.laws.discrepancy import ROUNDING

HYPER = Hyper(even=9, strain=2, pressure=1, odd=7, white=4)


@pytest.fixture(scope='module')
def fitter(make_sweeps, paper_muscle):
    """Return cells of sweeps with an even and an odd error."""
    data = make_sweeps(extra=lambda e, p, way, t: 4.0 * np.sin(e / 0.05) - 2e-5 * p * way)
    cells = reduce(paper_muscle, data, most=80)
    return Fitter(Covariance(cells, 0.01))


def smooth(cells, strain, pressure):
    """Return the Matern part between points and cells by its definition."""
    e = (strain[:, None] - cells.strain) / cells.strain_range / STRAIN_LENGTHS[2]
    p = (pressure - cells.pressure[:, 0]) / cells.pressure_range[0] / PRESSURE_LENGTHS[1]
    distance = np.sqrt(5.0 * (e ** 2 + p ** 2))
    return (1.0 + distance + distance ** 2 / 3.0) * np.exp(-distance)


def test_even_and_odd_parts_are_conditional_means(fitter, paper_muscle):
    """Given what is left at the places, with their noise and the white misfit."""
    surface = Surface.of(fitter, paper_muscle, HYPER)
    cells = surface.covariance.cells
    even, odd, white = ((AMPLITUDES[k] * fitter.cells.force_sd) ** 2 for k in (9, 7, 4))
    between = smooth(cells, cells.strain, cells.pressure)
    both = np.outer(cells.direction, cells.direction)
    whole = (even * between + odd * between * both
             + np.diag(cells.variance + white))
    weights = np.linalg.solve(whole, cells.force)
    strain, pressure = np.linspace(-0.02, 0.26, 7), np.linspace(0.0, 4e5, 7)[:, None]
    across = smooth(cells, strain, pressure)
    found = surface.parts(strain, pressure)
    assert_allclose(found[0], even * across @ weights, rtol=1e-6, atol=1e-9)
    assert_allclose(found[1], odd * across @ (cells.direction * weights), rtol=1e-6, atol=1e-9)
    left = even - even ** 2 * np.einsum('ij,ij->i', across, np.linalg.solve(whole, across.T).T)
    assert_allclose(surface.sd(strain, pressure, 0), np.sqrt(left), rtol=1e-6)


def test_what_was_planted_is_in_the_surface(fitter, paper_muscle):
    """The even error over the strain, the odd one over the pressure; rows have both."""
    surface = Surface.of(fitter, paper_muscle, HYPER)
    strain = np.linspace(0.03, 0.21, 10)
    for pressure in (82.74e3, 330.96e3):
        even, odd = surface.parts(strain, np.full((10, 1), pressure))
        assert even == pytest.approx(4.0 * np.sin(strain / 0.05), abs=0.8)
        assert odd == pytest.approx(-2e-5 * pressure, abs=0.8)
    cells = fitter.cells
    rows = np.flatnonzero(cells.label >= 0)[::7]
    even, odd = surface.parts(cells.data.strain[rows], cells.data.pressure[rows])
    assert_allclose(surface.of_rows(cells, rows),
                    even + odd * np.tanh(cells.motion.strain_rate[rows] / ROUNDING))


def test_a_loss_that_the_search_sees_by_its_speed_is_in_the_surface(fitter, paper_muscle):
    """The table knows no speed, but both ways: the part of the speed is odd as well."""
    by_speed = HYPER._replace(odd=0, speed=7)
    surface = Surface.best(fitter, paper_muscle, by_speed)
    _, odd = surface.parts(np.linspace(0.03, 0.21, 10), np.full((10, 1), 330.96e3))
    assert odd == pytest.approx(-2e-5 * 330.96e3, abs=0.8)
    assert Hyper(speed=7).fits_a_table
    neither = Surface.best(fitter, paper_muscle, HYPER._replace(odd=0))
    assert neither.hyper.odd == 0


def test_cells_that_do_not_count_leave_the_surface_as_it_is_without_them(fitter, paper_muscle):
    """Their rows are in no place."""
    used = fitter.cells.strain < 0.15
    surface = Surface.of(fitter, paper_muscle, HYPER, used)
    assert surface.covariance.cells.strain.max() < 0.16
    assert Surface.of(fitter, paper_muscle, HYPER).covariance.cells.strain.max() > 0.22


def test_places_are_means_over_all_visits_and_as_sure_as_visits_agree(fitter):
    """Rows of noise 0.6 N, and what visits differ by besides."""
    cells = fitter.cells
    data, rng = cells.data, np.random.default_rng(1)
    label = np.where(np.arange(len(data)) % 50 == 0, -1, np.round(data.strain / 0.06).astype(int))
    shift = 3.0 * rng.normal(size=12)[data.trial]
    off = 2.0 * label + shift
    found = _averaged(cells, off, label, np.sign(data.direction).astype(float))
    rows = np.bincount(label[label >= 0])
    for k in range(len(rows)):
        inside = label == k
        assert found.force[k] == pytest.approx(off[inside].mean())
        assert found.strain[k] == pytest.approx(data.strain[inside].mean())
        assert found.direction[k] == pytest.approx(np.sign(data.direction[inside]).mean())
    visits = np.array([[off[(label == k) & (data.trial == t)].mean() - found.force[k]
                        for t in range(12)] for k in range(len(rows))])
    between = np.sum(visits ** 2) / (visits.size - len(rows))
    variance = cells.noise ** 2 / rows + between / 12.0
    assert_allclose(found.variance, variance)
    assert_allclose(found.count, rows)
    assert found.time is None


def test_the_way_of_a_row_is_that_of_its_motion(fitter):
    """Fully one way in a sweep, none at rest; of a held muscle that of its pressure."""
    cells = fitter.cells
    assert_allclose(way_of(cells)[100:110], np.tanh(cells.motion.strain_rate[100:110] / ROUNDING))
    still = replace(cells, motion=replace(cells.motion, strain_rate=np.zeros(len(cells.data))))
    assert not way_of(still).any()
