# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Muscles compressed past their free strain: they push back, buckle, and collapse."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place

_SIGNATURE = ('the error appears only past the free strain of the pressure: the model pushes back '
              'too much or too little there')


class ResistiveBuckling(Effect):
    """
    Lowest force of a compressed muscle: a plateau (post-buckling), then a hinge (post-collapse).

    The tensile model is continued below zero until its size reaches
    F_b = F_E + c pi r0^2 P; past the collapse strain e_c = e_0 + s P the muscle folds like a
    three-hinge column, F = 4 M/(L0 sin phi), cos phi = (1 - e)/(1 - e_c),
    M = M_0 + m pi P r0^3, where that is smaller than the plateau.

    The default Euler load is that of the [K21] tube with clamped ends,
    4 pi^2 E I/L0^2 with E = 6 (C10 + C01) = 2.88 N.
    """

    name = 'resistive_buckling'
    summary = 'resistive force past free strain: buckling plateau, then collapse'
    source = ('regions named by Kim, Mazzoleni and Bryant 2021, SPIE 11586; formulas derived '
              '(three-hinge column), constants chosen to come nearest to their figure 4')
    place = Place.LIMIT
    family = 'resistive'
    signature = _SIGNATURE
    parameters = (
        Parameter('euler_load', 'N', 2.88, 0.0, 200.0, 'buckling load at zero pressure'),
        Parameter('pressure_share', '1', 0.35, 0.0, 2.0, 'part of pi r0^2 P that adds to it'),
        Parameter('collapse_strain', '1', 0.05, 0.0, 0.4, 'strain at collapse, zero pressure'),
        Parameter('collapse_slope', '1/MPa', 0.15 / 0.06895, 0.0, 10.0,
                  'growth of the collapse strain with pressure'),
        Parameter('hinge_moment', 'N*m', 0.010, 0.0, 2.0, 'hinge moment at zero pressure'),
        Parameter('hinge_share', '1', 0.5, 0.0, 2.0, 'part of pi P r0^3 that adds to it'),
    )
    off = {'euler_load': 1e6, 'collapse_strain': 10.0}

    def contribution(self, x):
        g = x.geometry
        pressure = np.maximum(x.pressure, 0.0)
        plateau = self.euler_load + self.pressure_share * g.area * pressure
        collapse = self.collapse_strain + self.collapse_slope * pressure
        moment = self.hinge_moment + self.hinge_share * g.area * g.radius * pressure
        # a collapse strain beyond any that a muscle reaches must not turn the cosine around
        cosine = (1.0 - x.strain) / np.maximum(1.0 - collapse, 0.05)
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 1e-12))
        hinge = 4.0 * moment / (g.length * sine)
        return -np.where(x.strain > collapse, np.minimum(plateau, hinge), plateau)


class ResistivePlateau(Effect):
    """Lowest force of a compressed muscle, -(F_E + c pi r0^2 P), with no collapse."""

    name = 'resistive_plateau'
    variant_of = 'resistive_buckling'
    summary = 'resistive force past free strain that saturates and never drops'
    source = 'derived: Euler load of the tube plus a pressure part'
    place = Place.LIMIT
    family = 'resistive'
    signature = _SIGNATURE
    parameters = (
        Parameter('euler_load', 'N', 2.88, 0.0, 200.0, 'buckling load at zero pressure'),
        Parameter('pressure_share', '1', 0.35, 0.0, 2.0, 'part of pi r0^2 P that adds to it'),
    )
    off = {'euler_load': 1e6}

    def contribution(self, x):
        return -(self.euler_load
                 + self.pressure_share * x.geometry.area * np.maximum(x.pressure, 0.0))
