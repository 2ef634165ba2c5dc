# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressure drop of the supply: integrated by the plant, visible in logs with valve commands."""

from fam_bundle_ros.model.laws.base import law, Parameter


@law('pneumatics', changes='supply_resistance', family='supply', candidate=False,
     look=('blue', 'dot'), summary='pressure of the shared manifold drops while units fill',
     source='linear source resistance; drops of 10-60 kPa as measured',
     signature='all units fill slower when several fill at once', off={'resistance': 0.0},
     resistance=Parameter(20.0, 'kPa*s/g', 0.0, 1000.0, 'drop per mass flow from the supply'))
def supply_droop(resistance):
    """The manifold's pressure drops in proportion to the mass flow from the supply."""
    return resistance
