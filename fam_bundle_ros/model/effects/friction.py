# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction of the braid: two shapes, one without and one with pre-sliding."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place
from fam_bundle_ros.model.scan import clamp_scan

_FORCE = Parameter('force', 'N', 4.0, 0.0, 100.0, 'friction force at zero pressure')
_PER_PRESSURE = Parameter('per_pressure', 'N/kPa', 0.0, 0.0, 1.0, 'growth with gauge pressure')


class CoulombFriction(Effect):
    """F = -(Fc + cP P) tanh((de/dt)/w), the smoothed sign of the rate."""

    name = 'coulomb_friction'
    summary = 'dry friction of thread on thread, independent of speed'
    source = 'Chou and Hannaford 1996 (threads rub, width independent of speed); tanh smoothing'
    place = Place.LOSS
    family = 'dry_friction'
    signature = ('the residual splits by direction of motion and not by speed: loops of a '
                 'constant width')
    parameters = (
        _FORCE, _PER_PRESSURE,
        Parameter('smoothing', '1/s', 2e-3, 1e-5, 1.0, 'strain rate at which the sign is rounded',
                  fitted=False),
    )
    off = {'force': 0.0, 'per_pressure': 0.0}

    def contribution(self, x):
        size = self.force + self.per_pressure * np.maximum(x.pressure, 0.0)
        return -size * np.tanh(x.strain_rate / self.smoothing)


class PreslidingHysteresis(Effect):
    """
    Maxwell slip: elements that stick, stretch and slide, F = -(Fc + cP P) mean(z_j/d_j).

    Each element is a stop operator of the strain, z in [-d_j, d_j]; the half widths are
    d (1/4, 1/2, 1, 2), so that the corner of a loop is rounded over a strain of about d.
    At the start of a trial the elements are relaxed.
    """

    name = 'presliding_hysteresis'
    summary = 'dry friction that sticks before it slides (Maxwell slip)'
    source = 'derived: Maxwell slip, as a Prandtl-Ishlinskii sum of stop operators'
    place = Place.LOSS
    family = 'dry_friction'
    memory = True
    signature = ('the residual splits by direction of motion, its corners are rounded over a '
                 'fixed strain after each reversal, minor loops are smaller')
    parameters = (
        _FORCE, _PER_PRESSURE,
        Parameter('width', '1', 0.01, 5e-4, 0.1, 'strain over which a reversal is rounded'),
    )
    off = {'force': 0.0, 'per_pressure': 0.0}
    _SPREAD = (0.25, 0.5, 1.0, 2.0)

    def contribution(self, x):
        return 0.0 * x.strain

    def advance(self, x, state):
        strain = np.asarray(x.strain, float)
        if state is None:
            state = [strain[0]] * len(self._SPREAD)
        slip, after = 0.0, []
        for share, play in zip(self._SPREAD, state, strict=True):
            half = share * self.width
            lower = np.where(x.start, strain, strain - half)
            upper = np.where(x.start, strain, strain + half)
            centre = clamp_scan(lower, upper, play)
            slip = slip + (strain - centre) / (half * len(self._SPREAD))
            after.append(centre[-1])
        size = self.force + self.per_pressure * np.maximum(x.pressure, 0.0)
        return -size * slip, after
