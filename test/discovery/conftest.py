# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Truth built from known numbers, and the measurements that ship."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.options import Options
from fam_bundle_ros.discovery.search import Search
from fam_bundle_ros.discovery.settings import Choices
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit

PRACTICE = [f'p{k:02d}' for k in range(1, 11)]


@pytest.fixture(scope='session')
def practice(repository):
    """Return a function from a case's name to its CSV and model file."""
    def find(name):
        folder = repository / 'test' / 'data' / 'practice'
        return folder / f'{name}.csv', folder / f'{name}.model.yaml'
    return find


@pytest.fixture(scope='session')
def paper_muscle():
    """Return the muscle of the paper: ideal braid and rubber tube."""
    geometry = Geometry(6.35e-3, 0.127, np.radians(33.0), 1.59e-3)
    effects = [catalogue.get('mesh')(), catalogue.get('bladder_elasticity')()]
    return Bundle('paper', [MotorUnit('mu1', 1, geometry)], effects)


@pytest.fixture
def sweeps(make_sweeps):
    """Return `make_sweeps`."""
    return make_sweeps


@pytest.fixture(scope='session')
def make_sweeps(paper_muscle):
    """Return a function that makes isobar sweeps of a model, with noise of 0.6 N by default."""
    def make(model=None, noise=0.6, seed=0, cycles=2, speed=0.024, extra=None):
        rng = np.random.default_rng(seed)
        model = model or paper_muscle
        once = 0.24 * np.concatenate([np.linspace(0, 1, 40), np.linspace(1, 0, 40)])
        clock = np.linspace(0, 0.48 / speed, 80)
        levels = np.tile(np.linspace(0, 413.7e3, 6), cycles)
        strain = np.tile(once, len(levels))
        rate = np.tile(np.repeat([speed, -speed], 40), len(levels))
        pressure = np.repeat(levels, 80)[:, None]
        trial = np.repeat(np.arange(len(levels)), 80)
        time = np.concatenate([clock + k * (clock[-1] + 3) for k in range(len(levels))])
        from fam_bundle_ros.model import Motion
        force = model.predict(Motion(strain, pressure, rate, time))
        if extra is not None:
            force = force + extra(strain, pressure[:, 0], np.sign(rate), time)
        force = force + noise * rng.standard_normal(len(force))
        return build('sweeps', strain, pressure, force, trial, time)
    return make


@pytest.fixture
def problem(sweeps, paper_muscle):
    """Return cells of sweeps with friction, a covariance over them, and a fitter."""
    cells = reduce(paper_muscle, sweeps(paper_muscle.with_effect('coulomb_friction')), most=120)
    covariance = Covariance(cells, 0.01)
    return cells, covariance, Fitter(covariance)


@pytest.fixture(scope='session')
def searched():
    """Return a function that searches a log: the model as given, and a set with some effects."""
    def fitted(model, data, *effects):
        search = Search(Options.of(model, reduce(model, data), Choices()))
        search.fit(search.options.own)
        if effects:
            search.fit(tuple(sorted((*search.options.own, *effects))))
        return search
    return fitted
