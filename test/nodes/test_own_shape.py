# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A bundle whose muscles push back in a way that no law has: found, added, and controlled with."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery import Choices, compare, diagnose
from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes.session import run_trajectory
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import Trajectory

#: Up through the overlap of RS1 and RS2, at a strain where an empty muscle folds.
RAMP = Trajectory('ramp', 'force', 4.5, lambda t: 45.0 + 20.0 * min(max(t - 1.0, 0.0), 2.5),
                  lambda t: 20.0 * (1.0 < t < 3.5), Dynamometer(0.1))
#: N, of the load cell.
NOISE = 0.6


def pushed_back(strain, pressure):
    """Return the lowest force: constant up to a strain, then it decays to a quarter, N."""
    most = 2.5 + 5.5e-5 * pressure
    beyond = np.maximum(strain - 0.06 - 0.02e-5 * pressure, 0.0)
    return -most * (0.25 + 0.75 * np.exp(-beyond / 0.02))


def free_strains(bundle, pressure, others):
    """Return where the force over strain is first zero, for each pressure of MU2."""
    grid = np.linspace(0.0, 0.27, 2701)
    forces = (bundle.force(grid, np.tile([pressure, other], (2701, 1))) for other in others)
    return np.array([grid[np.argmax(force <= 0.0)] for force in forces])


@pytest.fixture
def files(tmp_path):
    """Return the model file of the user, without push-back, and that of the rig, a table."""
    believed, rig = tmp_path / 'believed.yaml', tmp_path / 'rig.yaml'
    text = config_path('models/spie2021_plain.yaml').read_text()
    believed.write_text(text.replace('  - resistive_buckling\n', ''))
    muscle = load_model(believed)
    rows = ['strain,pressure [kPa],force [N]']
    for strain in np.linspace(-0.02, 0.3, 65):
        for pressure in np.linspace(0.0, 400e3, 33):
            force = max(muscle.unit_forces(strain, [pressure] * 2)[0],
                        pushed_back(strain, pressure))
            rows.append(f'{strain:.6f},{pressure / 1e3:.4f},{force:.5f}')
    (tmp_path / 'table.csv').write_text('\n'.join(rows))
    rig.write_text(text.partition('effects:')[0]
                   + 'effects:\n  - measured_surface: {table: table.csv}\n')
    return believed, rig


def measured(bundle):
    """Return slow sweeps of the strain at 25 pairs of pressures, in random order, with noise."""
    rng = np.random.default_rng(0)
    levels = np.linspace(0.0, 344.7e3, 5)
    pairs = rng.permutation([(first, second) for first in levels for second in levels])
    once = 0.27 * np.concatenate([np.linspace(0, 1, 40), np.linspace(1, 0, 40)])
    strain, pressure = np.tile(once, 25), np.repeat(pairs, 80, axis=0)
    force = bundle.force(strain, pressure) + NOISE * rng.standard_normal(len(strain))
    time = np.arange(25)[:, None] * 20.0 + np.linspace(0.0, 18.0, 80)
    return build('sweeps', strain, pressure, force, np.repeat(np.arange(25), 80), time.ravel())


def dip(log):
    """Return the largest error within half a second of a motor unit that is switched on, N."""
    error, switched = np.abs(log.force - log.reference), log.time[1:][np.diff(log.state) > 0]
    near = [abs(log.time - at) < 0.5 for at in switched[switched > 1.0]]
    return float(error[np.any(near, axis=0)].max())


def test_push_back_of_an_unknown_shape_is_found_added_and_used(files, tmp_path, domain_id):
    """Named as push-back, not as right; free strain falls and returns as on the rig, dips go."""
    believed, rig = files
    plant, old = load_model(rig), load_model(believed)
    data = measured(plant)
    found = diagnose(old, data, choices=Choices(most=1))
    assert found.verdict == 'partial'
    assert found.effects == ('resistive_buckling',)
    found.recommended.save(tmp_path / 'better.yaml')
    better = load_model(tmp_path / 'better.yaml')
    assert found.error_N['model'] > 20.0
    assert compare(better, data).error_N < 1.5 * NOISE

    others = np.linspace(0.0, 344.7e3, 12)
    for pressure in (200e3, 344.7e3):
        truth = free_strains(plant, pressure, others)
        assert truth.argmin() not in (0, len(others) - 1)  # falls, and returns
        assert np.abs(free_strains(better, pressure, others) - truth).max() < 0.005
        assert np.abs(free_strains(old, pressure, others) - truth).max() > 0.04

    before, after = (
        run_trajectory(path, RAMP, plant_model=rig, domain=domain_id, log_level='warn')
        for path in (believed, tmp_path / 'better.yaml'))
    assert before.state.max() == after.state.max() == 2
    assert dip(after) < dip(before) / 3.0
