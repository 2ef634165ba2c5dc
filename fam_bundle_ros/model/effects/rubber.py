# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rubber that is not always the same: temperature and softening (Mullins)."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place
from fam_bundle_ros.model.scan import affine_scan, clamp_scan


class Temperature(Effect):
    """
    Rubber elasticity in proportion to absolute temperature, warming up over the log.

    F = F_bladder (dT/T0) (1 - exp(-t/tau)), T0 = 293.15 K: entropic elasticity with a first-order
    warm-up since the log began.
    """

    name = 'temperature'
    summary = 'bladder stiffens as it warms up'
    source = 'entropic rubber elasticity, 0.3 %/K; first-order warm-up derived'
    place = Place.FORCE
    family = 'temperature'
    across_trials = True
    signature = 'the error drifts with clock time and follows the bladder force'
    parameters = (
        Parameter('rise', 'K', 10.0, -60.0, 150.0, 'change of temperature after the warm-up'),
        Parameter('time_constant', 's', 300.0, 10.0, 5000.0, 'time constant of the warm-up'),
    )
    off = {'rise': 0.0}
    _REFERENCE = 293.15

    def contribution(self, x):
        warm = -np.expm1(-np.asarray(x.time) / self.time_constant)
        return x.bladder * (self.rise / self._REFERENCE) * warm


class Softening(Effect):
    """
    Bladder softer over the first cycles: F = -d F_bladder (1 - exp(-s/s0)), s = strain travelled.

    Travel is counted behind a play of half width 0.2 % strain, so that sensor noise does not
    count as motion. The bladder recovers between trials; see `softening_lifetime`.
    """

    name = 'softening'
    summary = 'Mullins softening: bladder loses stiffness over the first cycles'
    source = 'derived: exponential in strain travelled'
    place = Place.FORCE
    family = 'softening'
    memory = True
    signature = 'the error shrinks from cycle to cycle at the same strain and pressure'
    parameters = (
        Parameter('depth', '1', 0.15, 0.0, 0.8, 'share of the stiffness that is lost'),
        Parameter('travel', '1', 0.5, 0.02, 10.0, 'strain travelled until 63 % are lost'),
    )
    off = {'depth': 0.0}
    _PLAY = 2e-3

    def contribution(self, x):
        return -self.depth * x.bladder

    def advance(self, x, state):
        strain = np.asarray(x.strain, float)
        centre, travelled = (strain[0], 0.0 * strain[0]) if state is None else state
        lower = np.where(x.start, strain, strain - self._PLAY)
        upper = np.where(x.start, strain, strain + self._PLAY)
        path = clamp_scan(lower, upper, centre)
        moved = np.abs(np.diff(path, axis=0, prepend=np.asarray(centre)[None]))
        recovery = 1.0 if self.across_trials else np.where(x.start, 0.0, 1.0)
        travel = affine_scan(recovery, np.where(x.start, 0.0, moved), travelled)
        lost = self.depth * -np.expm1(-travel / self.travel)
        return -lost * x.bladder, (path[-1], travel[-1])


class SofteningLifetime(Softening):
    """As `softening`, but the bladder does not recover: travel is counted over all trials."""

    name = 'softening_lifetime'
    variant_of = 'softening'
    summary = 'Mullins softening that stays from trial to trial'
    across_trials = True
