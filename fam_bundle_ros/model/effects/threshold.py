# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressure that is spent on seating the bladder before the braid pulls."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place

_PRESSURE = Parameter('pressure', 'kPa', 30.0, 0.0, 200.0, 'pressure that is lost')


class _Threshold(Effect):
    place = Place.PRESSURE
    family = 'threshold'
    off = {'pressure': 0.0}


class ThresholdPressure(_Threshold):
    """P -> max(0, P - Pth)."""

    name = 'threshold_pressure'
    summary = 'no force below a threshold pressure, a shift above it'
    source = 'dead band of 20-90 kPa as reported for McKibben muscles; ramp form'
    signature = ('the error has the shape of dF/dP, is zero at zero pressure and the same above a '
                 'threshold')
    parameters = (_PRESSURE,)

    def contribution(self, x):
        return -np.minimum(np.maximum(x.pressure, 0.0), self.pressure)


class SoftThreshold(_Threshold):
    """P -> P - Pth (1 - exp(-P/Pth)): the bladder seats gradually."""

    name = 'soft_threshold'
    variant_of = 'threshold_pressure'
    summary = 'pressure lost on seating the bladder, gradually'
    source = 'derived: smooth form of threshold_pressure'
    signature = 'the error has the shape of dF/dP and grows from zero to a constant with pressure'
    parameters = (_PRESSURE,)

    def contribution(self, x):
        scale = max(self.pressure, 1e-6)
        return -self.pressure * -np.expm1(-np.maximum(x.pressure, 0.0) / scale)
