# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Threads that stretch under their own tension."""

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter


@law('geometry', changes='braid', family='braid', leaves=('smooth2',), look=('teal', 'solid'),
     summary='threads stretch in proportion to their tension',
     source='derived: hoop balance of the braid with elastic threads',
     signature='the error grows with the square of pressure, also at zero strain',
     off={'compliance': 0.0},
     compliance=Parameter(50.0, '1/GPa', 0.0, 500.0, 'relative stretch per pressure at zero '
                                                     'strain'))
def braid_elasticity(pressure, stretch, compliance):
    """
    Thread length b -> b (1 + s), s = c P l.

    The hoop balance of a cylinder of n turns gives a tension of P b L0 l/(2 pi n^2) of all
    threads together, in proportion to P l. The longer threads enter the mesh by B = (1 + s)^2, so
    that at e = 0 the force falls with P^2. Returns B - 1.
    """
    longer = compliance * np.maximum(pressure, 0.0) * stretch
    return longer * (2.0 + longer)
