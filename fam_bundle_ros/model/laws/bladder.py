# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Elastic force of the rubber tube inside the braid, a function of strain: five shapes."""

import math
from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'bladder', 'leaves': ('smooth0', 'past_free'),
    'signature': 'the error depends on strain alone and is the same at every pressure, zero '
                 'included: free strain then changes with pressure'}


@law('force', **_FAMILY, look=('green', 'solid'),
     summary='Mooney-Rivlin rubber tube that resists shortening and widening',
     source='Klute and Hannaford 2000, ASME JDSMC 122; latex constants as printed there',
     off={'c10': 0.0, 'c01': 0.0},
     c10=Parameter(118.4, 'kPa', 0.0, 1500.0, 'first Mooney-Rivlin constant'),
     c01=Parameter(105.7, 'kPa', 0.0, 1500.0, 'second Mooney-Rivlin constant'))
def bladder_elasticity(stretch, braid, cos2, sin2, cot2, wall_area, c10, c01):
    """
    Mooney-Rivlin tube, F = (V_bladder/L0) dW/dl; V_bladder/L0 is the cross-section of the wall.

    dW/dl = C10 [2 l (1 - k) - 2/(l^3 u) + 2 k/(l u^2)]
    + C01 [-2/l^3 + 2 k l/u^2 + 2 l u - 2 k l^3], with k = 1/tan^2 a0 and u = (r/r0)^2, which is
    1 + k (1 - l^2) for threads that do not stretch.
    """
    square = stretch * stretch
    cube = square * stretch
    u = (braid - square * cos2) / sin2
    first = 2.0 * (stretch * (1.0 - cot2) - 1.0 / (cube * u) + cot2 / (stretch * u * u))
    second = 2.0 * (cot2 * stretch / (u * u) - 1.0 / cube + stretch * u - cot2 * cube)
    return wall_area * (c10 * first + c01 * second)


@law('force', **_FAMILY, variant_of='bladder_elasticity', look=('green', 'dash'),
     summary='rubber tube as a cubic in strain, without a material law',
     source='derived: third-order expansion of any elastic tube about its rest length',
     off={'k1': 0.0, 'k2': 0.0, 'k3': 0.0},
     k1=Parameter(200.0, 'N', 0.0, 2e4, 'linear coefficient'),
     k2=Parameter(0.0, 'N', -2e5, 2e5, 'quadratic coefficient'),
     k3=Parameter(0.0, 'N', -1e6, 1e6, 'cubic coefficient'))
def bladder_polynomial(strain, k1, k2, k3):
    """F = -(k1 e + k2 e^2 + k3 e^3)."""
    return -strain * (k1 + strain * (k2 + strain * k3))


@law('force', **_FAMILY, variant_of='bladder_elasticity', look=('brown', 'longdashdot'),
     summary='rubber tube as a spring beside the braid, without a material law',
     source='derived: first-order expansion of any elastic tube about its rest length',
     off={'stiffness': 0.0}, stiffness=Parameter(200.0, 'N', 0.0, 2e4, 'force per strain'))
def bladder_linear(strain, stiffness):
    """F = -k e."""
    return -stiffness * strain


@law('force', **_FAMILY, variant_of='bladder_elasticity', look=('green', 'dot'),
     summary='one-term Ogden rubber tube',
     source='derived: Ogden 1972 strain energy with the stretches of Klute and Hannaford 2000',
     off={'modulus': 0.0},
     modulus=Parameter(450.0, 'kPa', 0.0, 5000.0, 'Ogden mu'),
     exponent=Parameter(1.8, '1', 1.0, 8.0, 'Ogden alpha'))
def bladder_ogden(stretch, braid, cos2, sin2, cot2, wall_area, modulus, exponent):
    """One-term Ogden tube, W = (mu/alpha) (l1^alpha + l2^alpha + l3^alpha - 3), incompressible."""
    around = np.sqrt((braid - stretch * stretch * cos2) / sin2)
    wall = 1.0 / (stretch * around)
    slope = -cot2 * stretch / around
    power = exponent - 1.0
    energy_slope = (stretch ** power + around ** power * slope
                    - wall ** exponent * (1.0 / stretch + slope / around))
    return wall_area * modulus * energy_slope


@law('force', **_FAMILY, variant_of='bladder_elasticity', look=('green', 'longdashdot'),
     summary='rubber tube with a thick wall that stiffens or softens with stretch (Yeoh)',
     source='Yeoh 1993, Rubber Chem. Technol. 66, 754, first two terms; incompressible tube after '
            'Rivlin 1949, Phil. Trans. R. Soc. A 242, 173; c10 that of a small stretch of the '
            'latex of Klute and Hannaford 2000',
     off={'c10': 0.0},
     c10=Parameter(224.1, 'kPa', 0.0, 3000.0, 'half the shear modulus'),
     stiffening=Parameter(0.0, '1', -0.25, 1.0, 'c20 over c10: below zero it softens'))
def bladder_thick(stretch, radius, wall_thickness, braid, cos2, sin2, cot2, wall_area, c10,
                  stiffening):
    """
    Tube of incompressible rubber whose outside follows the braid, F = int dW/dl dA over its wall.

    W = C10 ((I1 - 3) + s (I1 - 3)^2), I1 = l^2 + q + 1/(l^2 q). A layer of radius R at rest
    has the circumferential stretch sqrt(q), q = 1/l + (r0/R)^2 (u - 1/l), with u as in
    `bladder_elasticity`: the inside widens more than the outside. Gauss's rule with three points
    over R^2.
    """
    u, inner = (braid - stretch * stretch * cos2) / sin2, 1.0 - wall_thickness / radius
    middle, half = 0.5 * (1.0 + inner * inner), 0.5 * (1.0 - inner * inner)
    reach = math.sqrt(0.6) * half
    total = (5.0 * _layer(stretch, u, cot2, middle - reach, stiffening)
             + 8.0 * _layer(stretch, u, cot2, middle, stiffening)
             + 5.0 * _layer(stretch, u, cot2, middle + reach, stiffening)) / 18.0
    return wall_area * c10 * total


def _layer(stretch, u, cot2, share, stiffening):
    """Return dW/dl over C10 of the layer of R^2 = share r0^2."""
    square = stretch * stretch
    around = 1.0 / stretch + (u - 1.0 / stretch) / share
    slope = -1.0 / square + (1.0 / square - 2.0 * cot2 * stretch) / share
    first = square + around + 1.0 / (square * around) - 3.0
    first_slope = (2.0 * stretch + slope - (2.0 / stretch + slope / around) / (square * around))
    return first_slope * (1.0 + 2.0 * stiffening * first)
