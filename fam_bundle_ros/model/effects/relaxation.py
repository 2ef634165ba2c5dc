# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Slow relaxation of rubber and braid after each step."""

import numpy as np

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place
from fam_bundle_ros.model.effects.lag import low_pass


class _Relaxation(Effect):
    place = Place.LOSS
    family = 'relaxation'
    memory = True
    signature = 'the residual decays after each step or reversal, over a fixed time'

    def contribution(self, x):
        return 0.0 * x.force


class ViscoelasticRelaxation(_Relaxation):
    """
    Standard linear solid: a Maxwell arm of relative stiffness s beside the elastic muscle.

    F = s (F_el - y), tau dy/dt = F_el - y: a fast step shows (1 + s) F_el and relaxes to F_el.
    """

    name = 'viscoelastic_relaxation'
    summary = 'force relaxes towards its equilibrium with one time constant'
    source = 'standard linear solid; size 1-20 %, 0.5-100 s as reported for McKibben muscles'
    parameters = (
        Parameter('share', '1', 0.05, 0.0, 0.6, 'extra force of a fast step'),
        Parameter('time_constant', 's', 5.0, 0.1, 300.0, 'time constant of the decay'),
    )
    off = {'share': 0.0}

    def advance(self, x, state):
        slow, state = low_pass(x.force, self.time_constant, x, state)
        return self.share * (x.force - slow), state


class RelaxationProny(_Relaxation):
    """Two Maxwell arms side by side: a Prony series of two terms."""

    name = 'relaxation_prony'
    variant_of = 'viscoelastic_relaxation'
    summary = 'force relaxes with a fast and a slow time constant'
    source = 'Prony series of two terms'
    parameters = (
        Parameter('fast_share', '1', 0.03, 0.0, 0.6, 'extra force that decays fast'),
        Parameter('fast_time', 's', 1.0, 0.1, 10.0, 'fast time constant'),
        Parameter('slow_share', '1', 0.03, 0.0, 0.6, 'extra force that decays slowly'),
        Parameter('slow_time', 's', 20.0, 5.0, 300.0, 'slow time constant'),
    )
    off = {'fast_share': 0.0, 'slow_share': 0.0}

    def advance(self, x, state):
        before = state or (None, None)
        fast, first = low_pass(x.force, self.fast_time, x, before[0])
        slow, second = low_pass(x.force, self.slow_time, x, before[1])
        force = np.asarray(x.force)
        return (self.fast_share * (force - fast) + self.slow_share * (force - slow),
                (first, second))
