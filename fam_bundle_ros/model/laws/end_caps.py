# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The ends of a muscle do not shorten: strain of the active part is larger than that measured."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'end_caps', 'changes': 'strain', 'leaves': ('smooth1',),
    'signature': 'the error is in proportion to pressure and grows with strain',
    'remedy': 'measure the rest length and the clamped ends with a calliper'}


@law('geometry', **_FAMILY, off={'dead_length': 0.0}, look=('olive', 'solid'),
     summary='clamped ends that do not shorten, so the active length is smaller',
     source='derived: inactive length at the fittings; 5-30 % as reported',
     dead_length=Parameter(8.0, 'mm', 0.0, 100.0, 'length that takes no part'))
def end_caps(strain, length, dead_length):
    """E -> e L0/(L0 - Le): a length Le of the muscle takes no part."""
    active = np.maximum(length - dead_length, 0.2 * length)
    return strain * (length / active - 1.0)


@law('geometry', **_FAMILY, variant_of='end_caps', look=('olive', 'dash'),
     off={'factor': 0.0, 'low_pressure': 0.0},
     summary='tapered ends that matter more at low pressure',
     source='Tondu and Lopez 2000, IEEE CSM 20(2): strain factor; pressure form from memory',
     factor=Parameter(0.1, '1', -0.2, 0.6, 'relative extra strain at high pressure'),
     low_pressure=Parameter(0.0, '1', -0.5, 1.0, 'further extra at zero pressure'),
     pressure_scale=Parameter(100.0, 'kPa', 20.0, 400.0, 'pressure over which it fades'))
def tondu_factor(strain, pressure, factor, low_pressure, pressure_scale):
    """E -> (1 + k + j exp(-P/p0)) e: tapered ends, more so at low pressure."""
    fading = np.exp(-np.maximum(pressure, 0.0) / pressure_scale)
    return strain * (factor + low_pressure * fading)
