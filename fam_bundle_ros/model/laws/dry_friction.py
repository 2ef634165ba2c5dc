# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction of the braid: two shapes without pre-sliding and two with it."""

from typing import Any

import numpy as np

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import dahl, play

_FRICTION: dict[str, Any] = {
    'family': 'dry_friction', 'off': {'force': 0.0, 'per_pressure': 0.0},
    'leaves': ('friction', 'decay'),
    'force_0': Parameter(4.0, 'N', 0.0, 2000.0, 'friction force at zero pressure',
                         name='force'),
    'per_pressure': Parameter(0.0, 'N/kPa', 0.0, 1.0, 'growth with gauge pressure')}
_PRESLIDING: dict[str, Any] = {
    'signature': 'the residual splits by direction of motion, its corners are rounded over a '
                 'fixed strain after each reversal, minor loops are smaller',
    'width': Parameter(0.01, '1', 5e-4, 0.1, 'strain over which a reversal is rounded')}
#: Up to a sweep over a usual range, 20 %, in 10 s: dry friction is as large in slow sweeps as in
#: fast ones (Chou and Hannaford 1996). Rounded over more it would be in proportion to the speed of
#: most motions, which is damping.
_SMOOTHING = Parameter(2e-3, '1/s', 1e-5, 0.02, 'strain rate at which the sign is rounded')
#: Half width of the play (dead zone) of the strain in `presliding_dahl`.
_NOISE = 2e-4


@law('loss', **_FRICTION, look=('purple', 'solid'),
     summary='dry friction between threads, independent of speed',
     source='Chou and Hannaford 1996 (threads rub, width independent of speed); tanh smoothing',
     signature='the residual splits by direction of motion and not by speed: loops of a constant '
               'width',
     smoothing=_SMOOTHING)
def coulomb_friction(pressure, strain_rate, force_0, per_pressure, smoothing):
    """F = -(Fc + cP P) tanh((de/dt)/w), the smoothed sign of the rate."""
    return -_size(pressure, force_0, per_pressure) * np.tanh(strain_rate / smoothing)


@law('loss', **_FRICTION, variant_of='coulomb_friction', look=('purple', 'dash'),
     summary='dry friction that is larger at low speed (Stribeck)',
     source='Stribeck term after Armstrong-Helouvry et al. 1994, Automatica 30; Gaussian form',
     signature='the residual splits by direction of motion, more so at low speeds',
     rise=Parameter(0.5, '1', 0.0, 5.0, 'ratio of friction at rest to that at speed, minus 1'),
     speed=Parameter(0.02, '1/s', 1e-4, 2.0, 'strain rate over which it falls'),
     smoothing=_SMOOTHING)
def stribeck_friction(pressure, strain_rate, force_0, per_pressure, rise, speed, smoothing):
    """F = -(Fc + cP P) (1 + b exp(-(v/vs)^2)) tanh(v/w), v = de/dt."""
    more = 1.0 + rise * np.exp(-(strain_rate / speed) ** 2)
    return -_size(pressure, force_0, per_pressure) * more * np.tanh(strain_rate / smoothing)


@law('loss', **_FRICTION, **_PRESLIDING, look=('wine', 'solid'),
     memory=('centre_1', 'centre_2', 'centre_3', 'centre_4'),
     summary='dry friction that sticks before it slides (Maxwell slip)',
     source='derived: Maxwell slip, as a Prandtl-Ishlinskii sum of stop operators')
def presliding_hysteresis(pressure, strain, start, centre_1, centre_2, centre_3, centre_4,
                          force_0, per_pressure, width):
    """
    Maxwell slip: elements that stick, stretch and slide, F = -(Fc + cP P) mean(z_j/d_j).

    Each element is a stop operator of the strain, z in [-d_j, d_j]; the half widths are
    d (1/4, 1/2, 1, 2), so that the corner of a loop is rounded over a strain of about d.
    At the start of a trial the elements are relaxed.
    """
    after_1 = play(centre_1, strain, 0.25 * width, start)
    after_2 = play(centre_2, strain, 0.5 * width, start)
    after_3 = play(centre_3, strain, width, start)
    after_4 = play(centre_4, strain, 2.0 * width, start)
    slip = 0.25 * ((strain - after_1) / (0.25 * width) + (strain - after_2) / (0.5 * width)
                   + (strain - after_3) / width + (strain - after_4) / (2.0 * width))
    return -_size(pressure, force_0, per_pressure) * slip, after_1, after_2, after_3, after_4


@law('loss', **_FRICTION, **_PRESLIDING, variant_of='presliding_hysteresis',
     look=('wine', 'dash'), memory=('centre', 'built_up'),
     summary='dry friction that builds up exponentially with strain after a reversal',
     source='Dahl 1968 solid friction model, first order')
def presliding_dahl(pressure, strain, start, centre, built_up, force_0, per_pressure, width):
    """
    Dahl friction: F = -(Fc + cP P) z, dz/de = (1 - z sgn(de))/w.

    The strain first passes a play of half width 0.02 %, so that sensor noise at rest does not
    change z. At the start of a trial z is zero.
    """
    slip, path = dahl(centre, built_up, strain, _NOISE, width, start)
    return -_size(pressure, force_0, per_pressure) * slip, path, slip


def _size(pressure, force_0, per_pressure):
    return force_0 + per_pressure * np.maximum(pressure, 0.0)
