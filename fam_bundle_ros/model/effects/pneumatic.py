# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of the air supply: the plant integrates them, so they show where valves are logged."""

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place


class _Pneumatic(Effect):
    place = Place.PNEUMATICS

    def contribution(self, x):
        return None


class Leak(_Pneumatic):
    """A closed chamber loses gauge pressure as p ~ exp(-t/tau)."""

    name = 'leak'
    summary = 'chambers leak to the surroundings'
    source = 'exponential decay with tau of 74-4900 s as measured on muscles'
    family = 'leak'
    signature = 'pressure falls while the valves are closed'
    parameters = (Parameter('time_constant', 's', 300.0, 1.0, 1e9, 'decay of gauge pressure'),)
    off = {'time_constant': 1e9}


class SupplyDroop(_Pneumatic):
    """The manifold's pressure falls in proportion to the flow that it gives."""

    name = 'supply_droop'
    summary = 'shared manifold dips while units fill'
    source = 'linear source resistance; dips of 10-60 kPa as measured'
    family = 'supply'
    signature = 'all units fill slower when several fill at once'
    parameters = (Parameter('resistance', 'kPa*s/g', 20.0, 0.0, 1000.0,
                            'droop per mass flow from the supply'),)
    off = {'resistance': 0.0}
