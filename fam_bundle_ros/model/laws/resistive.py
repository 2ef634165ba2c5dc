# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Resistive force of muscles compressed beyond free strain: buckling and collapse."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'resistive', 'pushes_back': True, 'leaves': ('past_free',),
    'signature': 'the error appears only past the free strain of the pressure: the resistive '
                 'force of the model is too large or too small',
    'euler_load': Parameter(2.88, 'N', 0.0, 200.0, 'buckling load at zero pressure'),
    'pressure_share': Parameter(0.35, '1', 0.0, 2.0, 'share of pi r0^2 P added to it')}


@law('limit', **_FAMILY, look=('vermillion', 'solid'),
     summary='resistive force past free strain: buckling plateau, then collapse',
     source='regions named by Kim, Mazzoleni and Bryant 2021, SPIE 11586; formulas derived '
            '(three-hinge column), constants fitted to their figure 4',
     off={'euler_load': 1e6, 'collapse_strain': 10.0},
     collapse_strain=Parameter(0.05, '1', 0.0, 0.4, 'strain at collapse, zero pressure'),
     collapse_slope=Parameter(0.15 / 0.06895, '1/MPa', 0.0, 10.0,
                              'growth of the collapse strain with pressure'),
     hinge_moment=Parameter(0.010, 'N*m', 0.0, 2.0, 'hinge moment at zero pressure'),
     hinge_share=Parameter(0.5, '1', 0.0, 2.0, 'share of pi P r0^3 added to it'))
def resistive_buckling(pressure, strain, area, radius, length, euler_load, pressure_share,
                       collapse_strain, collapse_slope, hinge_moment, hinge_share):
    """
    Lowest force of a compressed muscle: a plateau (post-buckling), then a hinge (post-collapse).

    The tensile model is continued below zero until its absolute value reaches
    F_b = F_E + c pi r0^2 P; beyond the collapse strain e_c = e_0 + s P the muscle folds like a
    three-hinge column whose halves are L0 (1 - e_c)/2 long,
    F = 4 M/(L0 (1 - e_c) sin phi), cos phi = (1 - e)/(1 - e_c), M = M_0 + m pi P r0^3, where
    that is smaller than the plateau.

    The default Euler load is that of the [K21] tube with clamped ends,
    4 pi^2 E I/L0^2 with E = 6 (C10 + C01) = 2.88 N.
    """
    pressure = np.maximum(pressure, 0.0)
    plateau = euler_load + pressure_share * area * pressure
    collapse = collapse_strain + collapse_slope * pressure
    moment = hinge_moment + hinge_share * area * radius * pressure
    # limited, so that a very large collapse strain does not change the sign of the cosine
    folded = np.maximum(1.0 - collapse, 0.05)
    cosine = (1.0 - strain) / folded
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 1e-12))
    hinge = 4.0 * moment / (length * folded * sine)
    return -np.where(strain > collapse, np.minimum(plateau, hinge), plateau)


@law('limit', **_FAMILY, variant_of='resistive_buckling', look=('vermillion', 'dash'),
     summary='resistive force past free strain that saturates and does not collapse',
     source='derived: Euler load of the tube plus a pressure part', off={'euler_load': 1e6})
def resistive_plateau(pressure, area, euler_load, pressure_share):
    """Lowest force of a compressed muscle, -(F_E + c pi r0^2 P), without collapse."""
    return -(euler_load + pressure_share * area * np.maximum(pressure, 0.0))
