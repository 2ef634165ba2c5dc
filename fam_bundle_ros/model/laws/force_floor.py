# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lower limit of the range of a load cell or its amplifier."""

from fam_bundle_ros.model.laws.base import law, Parameter


@law('limit', family='slack', leaves=('past_free',), off={'level': -1e6},
     variant_of='tendon_slack', look=('brown', 'longdash'),
     summary='lower limit of the force reading, which may differ from zero',
     source='derived: range of a load cell or its amplifier',
     signature='the measured force is never below one value where that of the model is',
     level=Parameter(0.0, 'N', -50.0, 50.0, 'lowest force reading'))
def force_floor(level):
    """F = max(level, F)."""
    return level
