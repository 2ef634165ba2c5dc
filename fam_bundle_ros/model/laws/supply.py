# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A supply that gives way: the plant integrates it, so it shows where valves are logged."""

from fam_bundle_ros.model.laws.base import law, Parameter


@law('pneumatics', changes='supply_resistance', family='supply', candidate=False,
     look=('blue', 'dot'), summary='shared manifold dips while units fill',
     source='linear source resistance; dips of 10-60 kPa as measured',
     signature='all units fill slower when several fill at once', off={'resistance': 0.0},
     resistance=Parameter(20.0, 'kPa*s/g', 0.0, 1000.0, 'droop per mass flow from the supply'))
def supply_droop(resistance):
    """The manifold's pressure falls in proportion to the flow that it gives."""
    return resistance
