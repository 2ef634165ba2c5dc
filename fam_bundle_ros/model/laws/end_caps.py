# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Ends that do not shorten: the strain of the active part is larger than the measured strain."""

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
     dead_length=Parameter(8.0, 'mm', 0.0, 100.0, 'inactive length'))
def end_caps(strain, length, dead_length):
    """Strain e -> e L0/(L0 - Le): a length Le of the muscle is inactive."""
    active = np.maximum(length - dead_length, 0.25 * length)
    return strain * (length / active - 1.0)


@law('geometry', **_FAMILY, variant_of='end_caps', look=('olive', 'dash'),
     off={'factor': 0.0, 'low_pressure': 0.0},
     summary='tapered ends, whose effect is larger at low pressure',
     source='Tondu and Lopez 2000, IEEE CSM 20(2): strain factor; pressure form from memory',
     factor=Parameter(0.1, '1', -0.2, 0.6, 'relative extra strain at high pressure'),
     low_pressure=Parameter(0.0, '1', -0.5, 1.0, 'additional extra strain at zero pressure'),
     pressure_scale=Parameter(100.0, 'kPa', 20.0, 400.0, 'pressure over which that decays'))
def tondu_factor(strain, pressure, factor, low_pressure, pressure_scale):
    """Strain e -> (1 + k + j exp(-P/p0)) e: tapered ends, with more effect at low pressure."""
    fading = np.exp(-np.maximum(pressure, 0.0) / pressure_scale)
    return strain * (factor + low_pressure * fading)


@law('geometry', **_FAMILY, variant_of='end_caps', needs='several lengths',
     look=('olive', 'dashdot'), off={'dead_length': 0.0, 'share': 0.0},
     summary='end effect that depends on length: clamped ends and a share of the whole length',
     source='strain factor of Tondu and Lopez 2000, IEEE CSM 20(2), for the tapered ends; dead '
            'length at the fittings derived',
     dead_length=Parameter(8.0, 'mm', 0.0, 100.0, 'inactive length, equal for all muscles'),
     share=Parameter(0.05, '1', 0.0, 0.5, 'relative extra strain, equal for all lengths'))
def end_effect_of_length(strain, length, dead_length, share):
    """
    Strain e -> (1 + k) e L0/(L0 - Le): the factor decreases towards 1 + k with the length L0.

    Muscles of one length determine only the factor, as a dead length alone (`end_caps`) or a
    factor alone (`tondu_factor`) does: two lengths are needed to separate Le from k.
    """
    active = np.maximum((length - dead_length) / (1.0 + share), 0.25 * length)
    return strain * (length / active - 1.0)
