# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Mullins softening: rubber gets softer over its first cycles."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import affine, before, play

#: Half width of the play (dead zone) of the strain before travel is counted.
_NOISE = 2e-3


def _worn(bladder, depth):
    """F = -d F_bladder: the equilibrium value, after long travel."""
    return -depth * bladder


_FAMILY: dict[str, Any] = {
    'family': 'softening', 'leaves': ('drift', 'drift_trial'), 'memory': ('centre', 'travelled'),
    'equilibrium': _worn, 'off': {'depth': 0.0},
    'source': 'derived: exponential or hyperbolic in strain travelled',
    'signature': 'the error shrinks from cycle to cycle at the same strain and pressure',
    'depth': Parameter(0.15, '1', 0.0, 0.8, 'share of the stiffness that is lost'),
    'travel': Parameter(0.5, '1', 0.02, 10.0,
                        'strain travelled until 63 % (hyperbolic: half) of it is lost')}


def _travelled(strain, start, since, centre, travelled):
    """Return the strain behind its play, and the strain travelled since a start."""
    path = play(centre, strain, _NOISE, start)
    moved = np.where(start, 0.0, np.abs(path - before(centre, path)))
    return path, affine(travelled, np.where(since, 0.0, 1.0), moved)


@law('force', **_FAMILY, look=('green', 'dashdot'),
     summary='Mullins softening: bladder loses stiffness over the first cycles')
def softening(bladder, strain, start, centre, travelled, depth, travel):
    """
    Bladder softens over the first cycles: F = -d F_bladder (1 - exp(-s/s0)), s = strain travelled.

    The strain first passes a play of half width 0.2 %, so that sensor noise does not count as
    travel. The bladder recovers between trials; see `softening_lifetime`.
    """
    path, way = _travelled(strain, start, start, centre, travelled)
    return depth * np.expm1(-way / travel) * bladder, path, way


@law('force', **_FAMILY, variant_of='softening', across_trials=True, look=('green', 'longdash'),
     summary='Mullins softening that stays from trial to trial')
def softening_lifetime(bladder, strain, start, log_start, centre, travelled, depth, travel):
    """As `softening`, but the bladder does not recover: travel is counted over all trials."""
    path, way = _travelled(strain, start, log_start, centre, travelled)
    return depth * np.expm1(-way / travel) * bladder, path, way


@law('force', **_FAMILY, variant_of='softening', across_trials=True, look=('brown', 'dashdot'),
     summary='Mullins softening that stays, fast at first and never quite complete')
def softening_gradual(bladder, strain, start, log_start, centre, travelled, depth, travel):
    """As `softening_lifetime`, but hyperbolic: F = -d F_bladder s/(s + s0)."""
    path, way = _travelled(strain, start, log_start, centre, travelled)
    return -depth * way / (way + travel) * bladder, path, way
