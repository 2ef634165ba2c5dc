# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Viscoelastic relaxation of rubber and braid after each step."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import lag

_FAMILY: dict[str, Any] = {
    'family': 'relaxation', 'leaves': ('drift', 'drift_trial', 'pressure_rate', 'decay')}
_SIGNATURE = 'the residual decays after each step or reversal, over a fixed time'


@law('loss', **_FAMILY, signature=_SIGNATURE, look=('indigo', 'solid'),
     memory=('slow_part', 'last'), off={'share': 0.0},
     summary='force relaxes towards its equilibrium with one time constant',
     source='standard linear solid; size 1-20 %, 0.5-100 s as reported for McKibben muscles',
     share=Parameter(0.05, '1', 0.0, 0.6, 'extra force of a fast step'),
     time_constant=Parameter(5.0, 's', 0.1, 300.0, 'time constant of the decay'))
def viscoelastic_relaxation(force, start, dt, slow_part, last, share, time_constant):
    """
    Standard linear solid: a Maxwell arm of relative stiffness s parallel to the elastic muscle.

    F = s (F_el - y), tau dy/dt = F_el - y: after a fast step the total force is (1 + s) F_el and
    relaxes to F_el.
    """
    slow = lag(slow_part, last, force, time_constant, start, dt)
    return share * (force - slow), slow, force


@law('loss', **_FAMILY, variant_of='viscoelastic_relaxation', signature=_SIGNATURE,
     look=('indigo', 'dash'), memory=('fast_part', 'slow_part', 'last'),
     off={'fast_share': 0.0, 'slow_share': 0.0},
     summary='force relaxes with a fast and a slow time constant',
     source='Prony series of two terms',
     fast_share=Parameter(0.03, '1', 0.0, 0.6, 'extra force that decays fast'),
     fast_time=Parameter(1.0, 's', 0.1, 10.0, 'fast time constant'),
     slow_share=Parameter(0.03, '1', 0.0, 0.6, 'extra force that decays slowly'),
     slow_time=Parameter(20.0, 's', 5.0, 300.0, 'slow time constant'))
def relaxation_prony(force, start, dt, fast_part, slow_part, last,
                     fast_share, fast_time, slow_share, slow_time):
    """Two parallel Maxwell arms, F = s1 (F_el - y1) + s2 (F_el - y2): two Prony terms."""
    fast = lag(fast_part, last, force, fast_time, start, dt)
    slow = lag(slow_part, last, force, slow_time, start, dt)
    return fast_share * (force - fast) + slow_share * (force - slow), fast, slow, force


@law('loss', **_FAMILY, variant_of='viscoelastic_relaxation', look=('indigo', 'longdash'),
     signature='the residual decays after each change of strain, over a fixed time and equally '
               'at every pressure',
     memory=('slow_part', 'last'), off={'stiffness': 0.0},
     summary='rubber relaxes after a change of strain, equally at every pressure',
     source='derived: one Maxwell arm parallel to the bladder',
     stiffness=Parameter(60.0, 'N', 0.0, 5000.0, 'force of the arm per unit of strain'),
     time_constant=Parameter(3.0, 's', 0.1, 300.0, 'time constant of the decay'))
def relaxation_rubber(strain, start, dt, slow_part, last, stiffness, time_constant):
    """
    A Maxwell arm in strain: F = -k (e - y), tau dy/dt = e - y.

    Unlike in `viscoelastic_relaxation`, whose arm has a share of the whole force, a step of
    pressure at a fixed strain has no effect.
    """
    slow = lag(slow_part, last, strain, time_constant, start, dt)
    return -stiffness * (strain - slow), slow, strain


@law('loss', **_FAMILY, variant_of='viscoelastic_relaxation', look=('wine', 'dot'),
     signature='the residual decays after each change of strain, over decades of time and equally '
               'at every pressure',
     memory=('part_1', 'part_2', 'part_3', 'part_4', 'part_5', 'last'), off={'stiffness': 0.0},
     summary='rubber relaxes with the logarithm of time after a change of strain',
     source='stress relaxation of rubber in proportion to log time (Gent 1962, J. Appl. Polym. '
            'Sci. 6, 433); five Maxwell arms as a box spectrum',
     stiffness=Parameter(60.0, 'N', 0.0, 5000.0, 'force of all arms per unit of strain'),
     time_constant=Parameter(10.0, 's', 0.1, 300.0, 'slowest time constant'))
def relaxation_spectrum(strain, start, dt, part_1, part_2, part_3, part_4, part_5, last,
                        stiffness, time_constant):
    """
    Five equal Maxwell arms in strain, F = -k (e - mean(y_j)), tau_j dy_j/dt = e - y_j.

    tau_j is tau, tau/4, ... tau/256: between the fastest and the slowest, the force after a step
    falls in proportion to the logarithm of time. As in `relaxation_rubber`, a step of pressure at
    a fixed strain has no effect.
    """
    after_1 = lag(part_1, last, strain, time_constant, start, dt)
    after_2 = lag(part_2, last, strain, time_constant / 4.0, start, dt)
    after_3 = lag(part_3, last, strain, time_constant / 16.0, start, dt)
    after_4 = lag(part_4, last, strain, time_constant / 64.0, start, dt)
    after_5 = lag(part_5, last, strain, time_constant / 256.0, start, dt)
    slow = 0.2 * (after_1 + after_2 + after_3 + after_4 + after_5)
    return -stiffness * (strain - slow), after_1, after_2, after_3, after_4, after_5, strain
