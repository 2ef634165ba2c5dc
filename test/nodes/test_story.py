# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The whole promise in one run: a hidden effect is found in a bag, added, and used to control."""

import numpy as np

from fam_bundle_ros.discovery import (
    add_effect,
    Choices,
    compare,
    diagnose,
    read_measurement,
)
from fam_bundle_ros.discovery.log_rows import unknown_direction
from fam_bundle_ros.model import load_model, save_model
from fam_bundle_ros.nodes.session import run_trajectory
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import Trajectory

#: A force that swings through RS1 and RS2 while the strain swings too, at another pace.
PLAN = Trajectory(
    'swing', 'force', 8.0, lambda t: 70.0 + 40.0 * np.sin(np.pi * t / 4.0),
    lambda t: 10.0 * np.pi * np.cos(np.pi * t / 4.0), Dynamometer(0.1),
    imposed=lambda t: 0.1 + 0.04 * np.sin(0.8 * np.pi * max(t, 0.0)))


def tracking_error(log):
    """Return the rms of reached minus asked-for force after the start, N."""
    settled = log.time > 1.0
    return float(np.sqrt(np.mean((log.force - log.reference)[settled] ** 2)))


def test_a_hidden_effect_is_found_added_and_controlled_against(tmp_path, domain_id):
    """Friction in the rig's model file: bag -> diagnose -> add -> both errors fall, over ROS."""
    believed = config_path('models/spie2021_plain.yaml')
    hidden = tmp_path / 'rig.yaml'
    hidden.write_text(believed.read_text() + '  - coulomb_friction: {force: 6 N}\n')

    before = run_trajectory(believed, PLAN, plant_model=hidden, bag=tmp_path / 'bag',
                            domain=domain_id, log_level='warn')
    measured = read_measurement(tmp_path / 'bag')
    found = diagnose(load_model(believed), measured, choices=Choices(most=2))
    assert found.verdict == 'missing_effect'
    assert found.effects == ('coulomb_friction',)

    better = add_effect(load_model(believed), found, measured)
    save_model(better.model, tmp_path / 'better.yaml')
    after = run_trajectory(tmp_path / 'better.yaml', PLAN, plant_model=hidden, domain=domain_id,
                           log_level='warn')

    old, new = (compare(load_model(path), measured)
                for path in (believed, tmp_path / 'better.yaml'))
    assert old.error_N > 10.0
    # rows at the turning points belong to no direction, and to no fit
    known = ~unknown_direction(measured)
    assert np.sqrt(np.mean(new.residual[known] ** 2)) < 1.05 * found.noise.value
    low, high = better.model.effect('coulomb_friction').intervals['force']
    assert low - 0.1 < 6.0 < high + 0.1
    # without an observer the old model is off by 10 N here and the new one by 3.6 N
    old_error, new_error = tracking_error(before), tracking_error(after)
    assert new_error < 1.5
    assert new_error < 0.8 * old_error
