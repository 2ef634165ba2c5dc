# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Differences between muscles that are nominally equal."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import of_unit

_PARAMETERS: dict[str, Any] = {
    f'mu{i}': Parameter(0.0, '1', -0.4, 0.4, f'cross section of unit {i} over unit 1, minus 1')
    for i in range(2, 7)}
_LENGTHS: dict[str, Any] = {
    f'mu{i}': Parameter(0.0, 'mm', -10.0, 10.0, f'length of unit {i} minus that of unit 1')
    for i in range(2, 7)}


@law('geometry', changes='area', family='mismatch', per_unit='later', leaves=('smooth1',),
     look=('indigo', 'dot'), summary='motor units of unequal strength',
     source='up to 10 % between nominally equal muscles; relative cross section derived',
     signature='the error changes sign when the active motor unit changes',
     off=dict.fromkeys(_PARAMETERS, 0.0), **_PARAMETERS)
def motor_unit_mismatch(unit, mu2, mu3, mu4, mu5, mu6):
    """
    Cross section of unit i times (1 + m_i), m_1 = 0: relative to the first motor unit.

    Motor units after the sixth are unchanged.
    """
    return of_unit(unit, 0.0, mu2, mu3, mu4, mu5, mu6)


@law('geometry', changes='strain', family='unit_length', per_unit='later',
     leaves=('smooth0', 'smooth1'), look=('indigo', 'longdashdot'),
     summary='motor units of unequal length between the same ends',
     source='derived: l = L (1 - e) at both units, the strain of one of rest length L + d',
     signature='the error has the shape of dF/de of one motor unit',
     remedy='measure the rest length of each muscle, clamped as in the bundle',
     off=dict.fromkeys(_LENGTHS, 0.0), **_LENGTHS)
def unit_length_mismatch(unit, strain, length, mu2, mu3, mu4, mu5, mu6):
    """
    Strain e -> 1 - (1 - e) L/(L + d_i), d_1 = 0: lengths relative to the first motor unit.

    A longer unit is slack, and is shortened before it pulls. Motor units after the sixth are
    unchanged.
    """
    longer = of_unit(unit, 0.0, mu2, mu3, mu4, mu5, mu6)
    return (1.0 - strain) * longer / np.maximum(length + longer, 0.25 * length)
