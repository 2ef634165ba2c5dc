# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressure lost in pressing the bladder against the braid, before the braid pulls."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'threshold', 'off': {'pressure': 0.0}, 'leaves': ('smooth1', 'smooth2'),
    'lost': Parameter(30.0, 'kPa', 0.0, 200.0, 'pressure that is lost', name='pressure')}


@law('pressure', **_FAMILY, look=('orange', 'solid'),
     summary='no force below a threshold pressure; above it the pressure is reduced by it',
     source='dead band of 20-90 kPa as reported for McKibben muscles; ramp form',
     signature='the error has the shape of dF/dP, is zero at zero pressure and the same above a '
               'threshold')
def threshold_pressure(pressure, lost):
    """P -> max(0, P - Pth)."""
    return -np.minimum(np.maximum(pressure, 0.0), lost)


@law('pressure', **_FAMILY, variant_of='threshold_pressure', look=('orange', 'dash'),
     summary='threshold pressure that is lost gradually, while the bladder meets the braid',
     source='derived: smooth form of threshold_pressure',
     signature='the error has the shape of dF/dP and grows from zero to a constant with pressure',
     sharpness=Parameter(1.5, '1', 1.0, 6.0, 'how suddenly the braid takes hold'))
def soft_threshold(pressure, lost, sharpness):
    """
    P -> P - Pth (1 - exp(-(P/Pth)^n))^(1/n): the bladder meets the braid gradually.

    With n = 1.7 it is Pth tanh(P/Pth) within 2 % of Pth, with a large n `threshold_pressure`.
    """
    # above zero, where the root has a slope
    share = np.maximum(pressure, 1e-3) / np.maximum(lost, 1e-6)
    most = lost * (-np.expm1(-share ** sharpness)) ** (1.0 / sharpness)
    return -np.minimum(np.maximum(pressure, 0.0), most)
