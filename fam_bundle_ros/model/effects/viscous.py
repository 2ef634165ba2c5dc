# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Losses that grow with speed."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place


class _Viscous(Effect):
    place = Place.LOSS
    family = 'viscous'
    signature = 'the residual is odd in the rate and grows with speed'


class ViscousDamping(_Viscous):
    """F = -c L0 de/dt."""

    name = 'viscous_damping'
    summary = 'damping in proportion to the speed of shortening'
    source = 'size 10-300 N s/m as reported for McKibben muscles; linear law'
    parameters = (Parameter('coefficient', 'N*s/m', 100.0, 0.0, 5000.0, 'damping per muscle'),)
    off = {'coefficient': 0.0}

    def contribution(self, x):
        return -self.coefficient * x.geometry.length * x.strain_rate


class ViscousPower(_Viscous):
    """F = -c v0 |v/v0|^n sgn(v), v = L0 de/dt, v0 = 10 mm/s; n = 1 is viscous_damping."""

    name = 'viscous_power'
    variant_of = 'viscous_damping'
    summary = 'damping as a power of the speed'
    source = 'derived: power law through the linear one at 10 mm/s'
    parameters = (
        Parameter('coefficient', 'N*s/m', 100.0, 0.0, 5000.0, 'damping at 10 mm/s'),
        Parameter('exponent', '1', 0.7, 0.3, 2.5, 'power of the speed'),
    )
    off = {'coefficient': 0.0}
    _SPEED = 0.01

    def contribution(self, x):
        speed = x.geometry.length * x.strain_rate / self._SPEED
        return -self.coefficient * self._SPEED * np.sign(speed) * np.abs(speed) ** self.exponent
