# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction whose reversals are rounded as an exponential in strain."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Place
from fam_bundle_ros.model.effects.friction import PreslidingHysteresis
from fam_bundle_ros.model.scan import affine_scan, clamp_scan


class PreslidingDahl(Effect):
    """
    Dahl friction: F = -(Fc + cP P) z, dz/de = (1 - z sgn(de))/w.

    Strain is taken behind a play of half width 0.02 %, so that sensor noise at rest does not wear
    the friction away. At the start of a trial z is zero.
    """

    name = 'presliding_dahl'
    variant_of = 'presliding_hysteresis'
    summary = 'dry friction that builds up exponentially with strain after a reversal'
    source = 'Dahl 1968 solid friction model, first order'
    place = Place.LOSS
    family = 'dry_friction'
    memory = True
    signature = PreslidingHysteresis.signature
    parameters = PreslidingHysteresis.parameters
    off = PreslidingHysteresis.off
    _PLAY = 2e-4

    def contribution(self, x):
        return 0.0 * x.strain

    def advance(self, x, state):
        strain = np.asarray(x.strain, float)
        centre, built = (strain[0], 0.0 * strain[0]) if state is None else state
        lower = np.where(x.start, strain, strain - self._PLAY)
        upper = np.where(x.start, strain, strain + self._PLAY)
        path = clamp_scan(lower, upper, centre)
        moved = np.diff(path, axis=0, prepend=np.asarray(centre)[None])
        gain = np.where(x.start, 0.0, np.exp(-np.abs(moved) / self.width))
        pull = np.where(x.start, 0.0, np.sign(moved) * (1.0 - gain))
        slip = affine_scan(gain, pull, built)
        size = self.force + self.per_pressure * np.maximum(x.pressure, 0.0)
        return -size * slip, (path[-1], slip[-1])
