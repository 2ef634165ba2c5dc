# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Muscles sold as equal that are not."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, GeometryChange, Parameter, Place


class MotorUnitMismatch(Effect):
    """
    Cross-section of unit i times (1 + m_i), m_1 = 0: sizes relative to the first motor unit.

    Bundles of more than six motor units keep the rest as they are.
    """

    name = 'motor_unit_mismatch'
    summary = 'motor units of unequal strength'
    source = 'up to 10 % between muscles sold as equal; relative cross-section derived'
    place = Place.GEOMETRY
    family = 'mismatch'
    signature = 'the error changes sign when the active motor unit changes'
    parameters = tuple(Parameter(f'mu{i}', '1', 0.0, -0.4, 0.4,
                                 f'relative cross-section of unit {i} against unit 1')
                       for i in range(2, 7))
    off = {p.name: 0.0 for p in parameters}

    @classmethod
    def active(cls, units):
        return cls.parameters[:max(units - 1, 0)]

    def contribution(self, x):
        sizes = [0.0] + [self.values[p.name] for p in self.parameters]
        count = np.shape(x.pressure)[-1]
        return GeometryChange(area=np.array((sizes + [0.0] * count)[:count]))
