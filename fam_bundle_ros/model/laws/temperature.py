# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Change of the bladder's elasticity with temperature."""

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

#: Reference temperature of the bladder's constants, K.
_REFERENCE = 293.15


@law('force', family='temperature', across_trials=True, leaves=('smooth0', 'drift'),
     look=('brown', 'dash'), summary='bladder stiffens as it warms up',
     source='entropic rubber elasticity, 0.3 %/K; first-order warm-up derived',
     signature='the error drifts with clock time and follows the bladder force',
     off={'rise': 0.0},
     rise=Parameter(10.0, 'K', -80.0, 80.0, 'change of temperature after the warm-up'),
     time_constant=Parameter(300.0, 's', 10.0, 5000.0, 'time constant of the warm-up'))
def temperature(bladder, time, rise, time_constant):
    """
    Rubber elasticity in proportion to absolute temperature, warming up over the log.

    F = F_bladder (dT/T0) (1 - exp(-t/tau)), T0 = 293.15 K: entropic elasticity with a first-order
    warm-up since the log began.
    """
    return bladder * (rise / _REFERENCE) * -np.expm1(-time / time_constant)
