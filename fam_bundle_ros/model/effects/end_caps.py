# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The ends of a muscle do not shorten: strain of the active part is larger than that measured."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, GeometryChange, Parameter, Place


class _EndCaps(Effect):
    place = Place.GEOMETRY
    family = 'end_caps'
    signature = 'the error is in proportion to pressure and grows with strain'


class EndCaps(_EndCaps):
    """e -> e L0/(L0 - Le): a length Le of the muscle takes no part."""

    name = 'end_caps'
    summary = 'clamped ends that do not shorten, so the active length is smaller'
    source = 'derived: inactive length at the fittings; 5-30 % as reported'
    parameters = (Parameter('dead_length', 'mm', 8.0, 0.0, 100.0, 'length that takes no part'),)
    off = {'dead_length': 0.0}

    def contribution(self, x):
        length = x.geometry.length
        active = np.maximum(length - self.dead_length, 0.2 * length)
        return GeometryChange(strain=x.strain * (length / active - 1.0))


class TonduFactor(_EndCaps):
    """e -> (1 + k + j exp(-P/p0)) e: tapered ends, more so at low pressure."""

    name = 'tondu_factor'
    variant_of = 'end_caps'
    summary = 'tapered ends that matter more at low pressure'
    source = 'Tondu and Lopez 2000, IEEE CSM 20(2): strain factor; pressure form from memory'
    parameters = (
        Parameter('factor', '1', 0.1, -0.2, 0.6, 'relative extra strain at high pressure'),
        Parameter('low_pressure', '1', 0.0, -0.5, 1.0, 'further extra at zero pressure'),
        Parameter('pressure_scale', 'kPa', 100.0, 20.0, 400.0, 'pressure over which it fades'),
    )
    off = {'factor': 0.0, 'low_pressure': 0.0}

    def contribution(self, x):
        fading = np.exp(-np.maximum(x.pressure, 0.0) / self.pressure_scale)
        return GeometryChange(strain=x.strain * (self.factor + self.low_pressure * fading))
