# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The motion in a measurement as a model gets it."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.predict import predict


@pytest.mark.parametrize('pause', [0.0, 60.0])
def test_friction_remembers_the_trial_before_in_one_recording(paper_muscle, pause):
    """Presliding begins anew after a pause, and not where only the number of the trial changes."""
    model = paper_muscle.with_effect('presliding_dahl', force=5.0, width=0.02)
    time = 0.02 * np.arange(2000)
    strain = 0.1 + 0.05 * np.sin(0.5 * time)
    later = np.arange(2000) >= 1000

    def forces(trial):
        return predict(model, build('log', strain, np.full(2000, 2e5), np.zeros(2000), trial,
                                    time + pause * later))
    apart = np.abs(forces(later.astype(int)) - forces(np.zeros(2000, int)))
    assert apart[:1000].max() < 0.1  # smoothing ends with a trial
    assert (apart[1000:].max() > 2.0) == bool(pause)
