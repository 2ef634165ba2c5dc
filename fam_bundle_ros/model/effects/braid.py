# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Threads that stretch under their own tension."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, GeometryChange, Parameter, Place


class BraidElasticity(Effect):
    """
    Thread length b -> b (1 + s), s = c P l.

    The hoop balance of a cylinder of n turns gives a thread tension of P b L0 l/(2 pi n^2) over
    all threads: in proportion to P l. The stretched kinematics enter the mesh through B =
    (1 + s)^2, so at e = 0 the force falls with P^2.
    """

    name = 'braid_elasticity'
    summary = 'threads stretch in proportion to their tension'
    source = 'derived: hoop balance of the braid with elastic threads'
    place = Place.GEOMETRY
    family = 'braid'
    signature = 'the error grows with the square of pressure, also at zero strain'
    parameters = (Parameter('compliance', '1/GPa', 50.0, 0.0, 500.0,
                            'relative stretch per pressure at zero strain'),)
    off = {'compliance': 0.0}

    def contribution(self, x):
        stretch = self.compliance * np.maximum(x.pressure, 0.0) * (1.0 - x.strain)
        return GeometryChange(braid=stretch * (2.0 + stretch))
