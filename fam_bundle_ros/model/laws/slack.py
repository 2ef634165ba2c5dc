# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Tendon ends, which transmit tension only."""

from fam_bundle_ros.model.laws.base import law


@law('limit', family='slack', leaves=('past_free',), look=('brown', 'solid'),
     summary='tendon ends: the muscle goes slack instead of pushing back',
     source='Mazzoleni et al. 2020, SPIE 11374',
     signature='the measured force is never below zero where that of the model is')
def tendon_slack():
    """F = max(0, F)."""
    return 0.0
