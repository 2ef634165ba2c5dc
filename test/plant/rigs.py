# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rigs with ideal sensors, and a hand that fills their muscles."""

import numpy as np

from fam_bundle_ros.plant import Dynamometer, Rig, RigConfig, SensorConfig

IDEAL = SensorConfig.ideal()


def make(bundle, load=None, seed=0, **values):
    """Return a rig with ideal sensors unless said otherwise."""
    values.setdefault('sensors', IDEAL)
    return Rig(bundle, RigConfig(load=load or Dynamometer(strain=0.1), **values), seed)


def drive(rig, target, seconds, dt=5e-3):
    """Bring the chambers to gauge pressures with a simple proportional controller."""
    readings = []
    for _ in range(round(seconds / dt)):
        error = (np.asarray(target) - rig.truth.pressure) / 100e3
        command = np.where(abs(error) > 1e-3, np.sign(error) * 0.04 + 0.3 * error, 0.0)
        readings.append(rig.step(np.clip(command, -1.0, 1.0), dt))
    return readings
