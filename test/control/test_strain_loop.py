# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The strain loop on masses that nothing but the loop damps, behind dead time."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.control import ControllerConfig, OuterConfig, tune
from fam_bundle_ros.nodes.profile import load_profile
from fam_bundle_ros.plant import MassSpring, RigConfig
from fam_bundle_ros.simulation import ClosedLoop, pid_config, Trajectory


def lifted(bundle, mass, delay):
    """Return the log of a mass without damping that is lifted, held and lowered."""
    rig = RigConfig()
    rig = replace(rig, sensors=replace(rig.sensors, delay=delay))
    path = load_profile('strain_steps')
    loop = ClosedLoop(bundle, controller=ControllerConfig(outer=OuterConfig(delay=delay)), rig=rig,
                      gains=tune(sample_period=2e-3, transport_delay=delay).gains,
                      pid=replace(pid_config(rig, 2e-3), transport_delay=delay))
    return loop.run(Trajectory('lift', 'strain', path.duration, path.value, path.rate,
                               MassSpring(mass=mass), prepare=2.0))


@pytest.mark.parametrize('delay', [5e-3, 10e-3, 15e-3])
@pytest.mark.parametrize('mass', [1.5, 5.0])
def test_an_undamped_mass_follows_at_every_delay_that_is_told(paper_bundle, mass, delay):
    """Within 0.1 % strain rms, and without air for an oscillation."""
    log = lifted(paper_bundle, mass, delay)
    assert np.sqrt(np.mean(log.error ** 2)) < 1e-3
    assert abs(log.error).max() < 3e-3
    prompt = lifted(paper_bundle, mass, 0.0)
    assert log.air[-1] < 1.1 * prompt.air[-1]
