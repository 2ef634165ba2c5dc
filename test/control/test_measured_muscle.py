# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The plant of a measured muscle, and the model that a user of these measurements would have."""

import numpy as np
import pytest

from fam_bundle_ros.benchmarks import measured_muscle
from fam_bundle_ros.benchmarks.control import model_of, plant_of
from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
from fam_bundle_ros.benchmarks.foreign_muscle import grid, Wrong
from fam_bundle_ros.benchmarks.margins import CONTROLLERS, loop_of
from fam_bundle_ros.benchmarks.measured_muscle import (
    DATA,
    diagnosed_bundle,
    measured_plant,
    muscle_tables,
)
from fam_bundle_ros.benchmarks.plants import sweep
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.resources import config_path


@pytest.fixture(scope='module', autouse=True)
def diagnosed(diagnose_map):
    """Let the model of the muscle be the one that was found already."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured_muscle, 'diagnose', diagnose_map)
        yield


@pytest.fixture(scope='module')
def readings():
    """Return the readings of a muscle that pulls: strain, pressure, force."""
    data = read_measurement(config_path(DATA))
    pulls = data.force > 0.0
    return data.strain[pulls], data.pressure[pulls, 0], data.force[pulls]


def at_rest(plant, strain, pressure):
    """Return the force of two units at one pressure, N."""
    return float(sweep(plant, np.array([strain]), np.full((1, 2), pressure))[0])


@pytest.mark.parametrize('friction', [0.0, 2.5])
def test_the_plant_pulls_as_was_measured(readings, friction):
    """Up to the steps of the table; elastic ends do not count twice where there is friction."""
    plant = measured_plant(diagnosed_bundle(2), Wrong(friction=friction))
    found = [at_rest(plant, e, p) / 2.0 for e, p, _ in zip(*readings)]
    assert found == pytest.approx(readings[2], abs=3.0)


def test_a_heavy_load_that_nobody_told_is_held_at_rest():
    """46 kg on gains for lighter loads swung by 0.05 in strain for good."""
    # without the gains six units swing as two do, and take 20 s to compile
    log = loop_of('measured', 2, CONTROLLERS['untold_load'], BaselineConfig()).run(
        make_trajectory('load_step', model_of('measured', 2), plant_of('measured', 2),
                        long=False))
    held = (log.time > 5.5) & (log.time < 6.0)  # a second after the load has changed
    assert np.abs(log.error[held]).max() < 0.002


def test_where_it_was_slack_the_plant_pushes_back():
    """By as much as the muscles of the benchmark, in proportion to its section."""
    model = diagnosed_bundle(2)
    size = (model.motor_units[0].geometry.radius / 6.35e-3) ** 2
    plant = measured_plant(model, Wrong())
    for pressure in (0.0, 200e3):
        most = size * (2.0 + 10.0 * -np.expm1(-pressure / 140e3))
        assert at_rest(plant, 0.24, pressure) / 2.0 == pytest.approx(-most, rel=0.01)


def test_gas_does_the_work_that_pressure_adds_to_the_force():
    """Its volume grows by df/dp times the length, at pressures at which every level pulls."""
    model = diagnosed_bundle(2)
    force, gas = muscle_tables(model)
    strain, pressure = grid()
    low, high = (int(np.argmin(abs(pressure - p))) for p in (450e3, 675e3))
    for k in np.flatnonzero((strain > 0.01) & (strain < 0.19)):
        growth = (gas[k + 1] - gas[k - 1]) / (strain[k + 1] - strain[k - 1])
        added = (force[k, high] - force[k, low]) / (pressure[high] - pressure[low])
        assert growth == pytest.approx(added * model.length, rel=0.03)
    assert np.interp(0.0, strain, gas) == pytest.approx(float(model.gas_volume(0.0)[0]))


def test_the_controllers_model_explains_the_readings_and_expects_a_push_back(readings):
    """Nearly as well as they repeat, and as a bundle between rigid ends."""
    strain, pressure, force = readings
    model = diagnosed_bundle(3)
    found = model.unit_forces(strain, np.stack([pressure] * 3, axis=-1))
    assert np.sqrt(np.mean((found[:, 0] - force) ** 2)) < 4.0
    assert np.ptp(found, axis=1) == pytest.approx(0.0)
    assert np.all(model.unit_forces(0.24, [0.0] * 3) < -1.0)
