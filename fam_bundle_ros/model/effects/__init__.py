# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Physical effects, one file for each, and the catalogue of them."""

from fam_bundle_ros.model.effects.base import (
    Effect,
    GeometryChange,
    Parameter,
    Place,
    Sample,
    SensorError,
)

__all__ = ['Effect', 'GeometryChange', 'Parameter', 'Place', 'Sample', 'SensorError']
