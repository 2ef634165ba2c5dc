# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Leaks of the chambers: integrated by the plant, visible in logs with valve commands."""

from fam_bundle_ros.model.laws.base import law, Parameter


@law('pneumatics', changes='leak_rate', family='leak', candidate=False, look=('sky', 'dot'),
     summary='chambers leak to the surroundings',
     source='exponential decay with tau of 74-4900 s as measured on muscles',
     signature='pressure falls while the valves are closed', off={'time_constant': 1e9},
     time_constant=Parameter(300.0, 's', 1.0, 1e9, 'decay of gauge pressure'))
def leak(time_constant):
    """A closed chamber loses gauge pressure as p ~ exp(-t/tau): a rate of 1/tau."""
    return 1.0 / time_constant
