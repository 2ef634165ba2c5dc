# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Differences between muscles that are nominally equal."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import of_unit

_PARAMETERS: dict[str, Any] = {
    f'mu{i}': Parameter(0.0, '1', -0.4, 0.4, f'cross section of unit {i} over unit 1, minus 1')
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
