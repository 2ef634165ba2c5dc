# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A tendon pulls and never pushes."""

from fam_bundle_ros.model.effects.base import Effect, Place


class TendonSlack(Effect):
    """F = max(0, F)."""

    name = 'tendon_slack'
    summary = 'tendon ends: the muscle goes slack instead of pushing back'
    source = 'Mazzoleni et al. 2020, SPIE 11374'
    place = Place.LIMIT
    family = 'slack'
    signature = 'the measured force is never below zero where the model pushes back'

    def contribution(self, x):
        return 0.0 * (x.strain + x.pressure)
