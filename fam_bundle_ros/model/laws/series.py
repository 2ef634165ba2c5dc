# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is in series with a muscle gives way: fittings, tendons, load cell, frame."""

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter


@law('geometry', changes='strain', family='series', needs='three strains', leaves=('smooth2',),
     look=('vermillion', 'dot'),
     summary='fittings, tendon and frame in series with a muscle give way to its pull',
     source='system compliance of tensile testing, ASTM D3379; solved for the ideal braid',
     signature='the error grows with the square of pressure and fades towards the free strain',
     remedy='hang a stiff rod in place of the muscle, or watch the muscle itself with a camera',
     off={'compliance': 0.0},
     compliance=Parameter(5.0, 'mm/kN', 0.0, 500.0, 'displacement per force of one muscle'))
def series_compliance(pressure, stretch, length, area, cot2, sin2, compliance):
    """
    E -> e + c F/L0: between its fittings the muscle is shorter than where strain is measured.

    F is that of the ideal braid at the changed stretch l', which makes l' + a (3 l'^2/tan^2 a0 -
    1/sin^2 a0) = l with a = c pi r0^2 P/L0. Returns l - l'. Each muscle has a spring of its own:
    of a frame that several pull on, what one does to the others is not in it.
    """
    a = compliance * area * np.maximum(pressure, 0.0) / length
    b = stretch + a / sin2
    return stretch - 2.0 * b / (1.0 + np.sqrt(1.0 + 12.0 * a * cot2 * b))
