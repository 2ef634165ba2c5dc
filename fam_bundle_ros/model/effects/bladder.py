# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The rubber tube inside the braid: three shapes of one physics, elastic force in strain alone."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place


class _Bladder(Effect):
    place = Place.FORCE
    family = 'bladder'
    signature = ('the error depends on strain alone and is the same at every pressure, zero '
                 'included: free strain then changes with pressure')


class BladderElasticity(_Bladder):
    """
    Mooney-Rivlin tube, F = (V_bladder/L0) dW/dl; V_bladder/L0 is the cross-section of the wall.

    dW/dl = C10 [2 l (1 - k) - 2/(l^3 u) + 2 k/(l u^2)]
    + C01 [-2/l^3 + 2 k l/u^2 + 2 l u - 2 k l^3], with k = 1/tan^2 a0 and u = (r/r0)^2, which is
    1 + k (1 - l^2) for threads that do not stretch.
    """

    name = 'bladder_elasticity'
    summary = 'Mooney-Rivlin rubber tube that resists shortening and widening'
    source = 'Klute and Hannaford 2000, ASME JDSMC 122; latex constants as printed there'
    parameters = (
        Parameter('c10', 'kPa', 118.4, 0.0, 1500.0, 'first Mooney-Rivlin constant'),
        Parameter('c01', 'kPa', 105.7, 0.0, 1500.0, 'second Mooney-Rivlin constant'),
    )
    off = {'c10': 0.0, 'c01': 0.0}

    def contribution(self, x):
        g = x.geometry
        stretch = 1.0 - x.strain
        square = stretch * stretch
        cube = square * stretch
        k = g.cot2
        u = (x.braid - square * g.cos2) / g.sin2
        first = 2.0 * (stretch * (1.0 - k) - 1.0 / (cube * u) + k / (stretch * u * u))
        second = 2.0 * (k * stretch / (u * u) - 1.0 / cube + stretch * u - k * cube)
        return g.wall_area * (self.c10 * first + self.c01 * second)


class BladderPolynomial(_Bladder):
    """F = -(k1 e + k2 e^2 + k3 e^3)."""

    name = 'bladder_polynomial'
    variant_of = 'bladder_elasticity'
    summary = 'rubber tube as a cubic in strain, no material law'
    source = 'derived: third-order expansion of any elastic tube about its rest length'
    parameters = (
        Parameter('k1', 'N', 200.0, 0.0, 2e4, 'linear coefficient'),
        Parameter('k2', 'N', 0.0, -2e5, 2e5, 'quadratic coefficient'),
        Parameter('k3', 'N', 0.0, -1e6, 1e6, 'cubic coefficient'),
    )
    off = {'k1': 0.0, 'k2': 0.0, 'k3': 0.0}

    def contribution(self, x):
        e = x.strain
        return -e * (self.k1 + e * (self.k2 + e * self.k3))


class BladderOgden(_Bladder):
    """One-term Ogden tube, W = (mu/alpha) (l1^alpha + l2^alpha + l3^alpha - 3), incompressible."""

    name = 'bladder_ogden'
    variant_of = 'bladder_elasticity'
    summary = 'one-term Ogden rubber tube'
    source = 'derived: Ogden 1972 strain energy with the stretches of Klute and Hannaford 2000'
    parameters = (
        Parameter('modulus', 'kPa', 450.0, 0.0, 5000.0, 'Ogden mu'),
        Parameter('exponent', '1', 1.8, 1.0, 8.0, 'Ogden alpha'),
    )
    off = {'modulus': 0.0}

    def contribution(self, x):
        g = x.geometry
        axial = 1.0 - x.strain
        around = np.sqrt((x.braid - axial * axial * g.cos2) / g.sin2)
        wall = 1.0 / (axial * around)
        slope = -g.cot2 * axial / around
        power = self.exponent - 1.0
        energy_slope = (axial ** power + around ** power * slope
                        - wall ** self.exponent * (1.0 / axial + slope / around))
        return g.wall_area * self.modulus * energy_slope
