# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Losses that grow with speed."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'viscous', 'leaves': ('speed',),
    'signature': 'the residual is odd in the rate and grows with speed'}
#: Speed at which `viscous_power` equals `viscous_damping`, m/s.
_SPEED = 0.01


@law('loss', **_FAMILY, off={'coefficient': 0.0, 'per_pressure': 0.0}, look=('sky', 'solid'),
     summary='viscous damping in proportion to the speed of shortening',
     source='size 10-300 N s/m as reported for McKibben muscles; linear law',
     coefficient=Parameter(100.0, 'N*s/m', 0.0, 1e5, 'damping per muscle'),
     per_pressure=Parameter(0.0, 'N*s/m/kPa', 0.0, 200.0, 'growth with gauge pressure'))
def viscous_damping(pressure, strain_rate, length, coefficient, per_pressure):
    """F = -(c + cP P) L0 de/dt."""
    size = coefficient + per_pressure * np.maximum(pressure, 0.0)
    return -size * length * strain_rate


@law('loss', **_FAMILY, off={'coefficient': 0.0}, variant_of='viscous_damping',
     look=('sky', 'dash'),
     summary='damping as a power of the speed',
     source='derived: power law through the linear one at 10 mm/s',
     coefficient=Parameter(100.0, 'N*s/m', 0.0, 1e5, 'damping at 10 mm/s'),
     exponent=Parameter(0.7, '1', 0.3, 2.5, 'power of the speed'))
def viscous_power(strain_rate, length, coefficient, exponent):
    """F = -c v0 |v/v0|^n sgn(v), v = L0 de/dt, v0 = 10 mm/s; n = 1 is viscous_damping."""
    speed = length * strain_rate / _SPEED
    return -coefficient * _SPEED * np.sign(speed) * np.abs(speed) ** exponent
