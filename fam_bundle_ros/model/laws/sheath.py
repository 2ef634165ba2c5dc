# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A sheath, or a bladder bonded to its braid: loss of force over the first strain."""

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter


@law('force', family='sheath', leaves=('smooth0',), off={'size': 0.0}, look=('brown', 'dot'),
     summary='sheath whose resistance builds up over the first strain and then is constant',
     source='exponential term of the force function of Sarosi et al. 2015, J. Theor. Appl. Mech.',
     signature='the error falls over the first strain to a constant, equally at every pressure',
     size=Parameter(20.0, 'N', 0.0, 2000.0, 'force lost at large strain'),
     width=Parameter(0.05, '1', 2e-3, 0.5, 'strain over which it builds up'))
def saturating_sheath(strain, size, width):
    """F = -c (1 - exp(-e/w)) for e > 0 [Sarosi 2015]."""
    return size * np.expm1(-np.maximum(strain, 0.0) / width)
