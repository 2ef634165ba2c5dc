# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The ideal braid: gas pressure turned into tension."""

from fam_bundle_ros.model.effects.base import Effect, Place


class Mesh(Effect):
    """F = pi r0^2 P (3 l^2/tan^2 a0 - B/sin^2 a0), B = 1 for threads that do not stretch."""

    name = 'mesh'
    summary = 'ideal braid of inextensible threads (virtual work of the gas)'
    source = 'Chou and Hannaford 1996, IEEE T-RA 12(1)'
    place = Place.FORCE
    family = 'mesh'
    signature = 'the model has no pressure-driven force at all'

    def contribution(self, x):
        stretch = 1.0 - x.strain
        g = x.geometry
        return g.area * x.pressure * (3.0 * stretch * stretch * g.cot2 - x.braid / g.sin2)
