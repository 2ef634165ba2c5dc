# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A controller without a plant: pressures follow at once."""

import numpy as np

from fam_bundle_ros.control import (
    Allocator,
    ControllerConfig,
    Instant,
    Measurement,
    OuterConfig,
    RecruitmentController,
    Reference,
)

DT = 5e-3
#: Feed-forward alone: the demand is the reference.
OPEN = OuterConfig(feedback=False)


class Bench:
    """A controller whose pressures are there at once, on the model that it inverts."""

    def __init__(self, bundle, strain, noise=0.0, seed=0, **config):
        self.bundle, self.strain, self.noise = bundle, strain, noise
        self.controller = RecruitmentController(bundle, ControllerConfig(**config))
        self.pressure = np.zeros(bundle.n)
        self._random = np.random.default_rng(seed)
        self.curves = Allocator(bundle).curves(Instant(strain))

    def update(self, demand, rate=0.0, kind='force', dt=DT):
        """Return the command of one tick."""
        force = float(self.bundle.force(self.strain, self.pressure))
        force += self.noise * self._random.standard_normal()
        command = self.controller.update(
            dt, Measurement(force, self.strain, 0.0, self.pressure), Reference(kind, demand, rate))
        self.pressure = command.pressure
        return command

    def ramp(self, start, end, rate):
        """Return the commands of a ramp."""
        count = max(int(abs(end - start) / rate / DT), 2)
        slope = np.sign(end - start) * rate
        return [self.update(float(f), slope) for f in np.linspace(start, end, count)]

    def hold(self, demand, duration):
        """Return the commands of a hold."""
        return [self.update(demand) for _ in range(int(duration / DT))]


def switches(commands):
    """Return the changes of state over commands."""
    return np.diff([c.state for c in commands])
