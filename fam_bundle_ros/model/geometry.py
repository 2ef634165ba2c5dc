# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dimensions of one McKibben muscle, in SI units.

Strain is e = (L0 - L)/L0, positive when shorter.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Radius tolerance (relative) and braid angle tolerance (rad): usual errors of values from a data
#: sheet or calliper; widths of their priors in a refit.
RADIUS_TOLERANCE = 0.04
BRAID_ANGLE_TOLERANCE = np.radians(1.5)

#: Dimensions of a muscle, and the units in which they are shown and written.
DIMENSIONS = {'radius': 'mm', 'length': 'mm', 'braid_angle': 'deg', 'wall_thickness': 'mm'}
#: Names of the values that `derived` returns.
DERIVED = ('cos2', 'sin2', 'cot2', 'area', 'wall_area')


def derived(radius, braid_angle, wall_thickness):
    """Return cos^2, sin^2, 1/tan^2 of the braid angle, pi r0^2, and the wall's cross section."""
    cosine, sine = np.cos(braid_angle), np.sin(braid_angle)
    inner = radius - wall_thickness
    area = np.pi * radius * radius
    return (cosine * cosine, sine * sine, cosine * cosine / (sine * sine), area,
            area - np.pi * inner * inner)


@dataclass(frozen=True)
class Geometry:
    """
    Initial dimensions of a muscle.

    Parameters
    ----------
    radius : float or array, m
        Initial outer radius r0.
    length : float or array, m
        Initial (active) length L0.
    braid_angle : float or array, rad
        Initial angle a0 of the threads, from the axis.
    wall_thickness : float or array, m
        Wall of the bladder, t < r0.
    """

    radius: Any
    length: Any
    braid_angle: Any
    wall_thickness: Any
    #: cos^2 a0, sin^2 a0, 1/tan^2 a0.
    cos2: Any = field(init=False)
    sin2: Any = field(init=False)
    cot2: Any = field(init=False)
    #: pi r0^2, m^2, and the cross-section of the bladder's wall, pi (r0^2 - (r0 - t)^2), m^2.
    area: Any = field(init=False)
    wall_area: Any = field(init=False)

    def __post_init__(self):
        """Compute once what the model needs at every tick."""
        values = derived(self.radius, self.braid_angle, self.wall_thickness)
        for name, value in zip(DERIVED, values, strict=True):
            object.__setattr__(self, name, value)

    @classmethod
    def stack(cls, geometries):
        """Return one Geometry with array fields (n,) from n geometries."""
        return cls(*(np.array([getattr(g, name) for g in geometries], float)
                     for name in DIMENSIONS))


def geometry_problem(radius: float, length: float, braid_angle: float, wall_thickness: float,
                     ) -> tuple[str, str] | None:
    """
    Return the name of an invalid dimension and what is required; None if all are valid.

    Parameters
    ----------
    radius, length, wall_thickness : float, m
    braid_angle : float, rad
    """
    given = {'radius': radius, 'length': length, 'braid_angle': braid_angle,
             'wall_thickness': wall_thickness}
    for key, value in given.items():
        if value <= 0.0:
            return key, 'must be above zero'
    if radius > 0.4 * length:
        return 'radius', ('must be below 0.4 of the length: a muscle is longer than thick (is it '
                          'the diameter?)')
    if wall_thickness >= radius:
        return 'wall_thickness', 'must be below the radius'
    if not 5.0 < np.degrees(braid_angle) < 54.7:
        return 'braid_angle', 'must lie between 5 and 54.7 deg, so that the muscle contracts'
    return None
