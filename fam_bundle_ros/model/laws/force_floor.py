# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A load cell, or an amplifier, that reads no less than some force."""

from fam_bundle_ros.model.laws.base import law, Parameter


@law('limit', family='slack', leaves=('past_free',), off={'level': -1e6},
     variant_of='tendon_slack', look=('brown', 'longdash'),
     summary='readings end at a lowest force that need not be zero',
     source='derived: range of a load cell or its amplifier',
     signature='the measured force is never below one value where the model pushes back',
     level=Parameter(0.0, 'N', -50.0, 50.0, 'lowest force that is read'))
def force_floor(level):
    """F = max(level, F)."""
    return level
