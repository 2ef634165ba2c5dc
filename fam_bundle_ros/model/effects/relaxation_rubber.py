# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Relaxation of the rubber alone: it remembers strain, whatever the pressure."""

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place
from fam_bundle_ros.model.effects.lag import low_pass


class RelaxationRubber(Effect):
    """
    A Maxwell arm in strain: F = -k (e - y), tau dy/dt = e - y.

    Unlike `viscoelastic_relaxation`, whose arm carries a share of the whole force, a step of
    pressure at a fixed strain leaves no trace.
    """

    name = 'relaxation_rubber'
    variant_of = 'viscoelastic_relaxation'
    summary = 'rubber relaxes after a change of strain, at any pressure alike'
    source = 'derived: one Maxwell arm beside the bladder'
    place = Place.LOSS
    family = 'relaxation'
    memory = True
    signature = ('the residual decays after each change of strain, over a fixed time and by the '
                 'same amount at every pressure')
    parameters = (
        Parameter('stiffness', 'N', 60.0, 0.0, 5000.0, 'force of the arm per unit of strain'),
        Parameter('time_constant', 's', 3.0, 0.1, 300.0, 'time constant of the decay'),
    )
    off = {'stiffness': 0.0}

    def contribution(self, x):
        return 0.0 * x.strain

    def advance(self, x, state):
        slow, state = low_pass(x.strain, self.time_constant, x, state)
        return -self.stiffness * (x.strain - slow), state
