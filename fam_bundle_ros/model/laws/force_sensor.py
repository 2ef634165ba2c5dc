# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the load cell shows against the force that the bundle has.

Sensor laws belong to the comparison with data and to a simulated rig's readings, never to the
muscle that the controller inverts. They are linear in what is read.
"""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'force_sensor', 'changes': 'force',
    'leaves': ('smooth0', 'smooth1', 'force'),
    'remedy': 'hang a known weight on the load cell',
    'source': 'instrument error model; sizes 1-5 N and 1-6 % as seen on rigs'}


@law('sensor', **_FAMILY, off={'bias': 0.0}, look=('grey', 'solid'),
     summary='load cell with an offset', signature='the error is the same everywhere',
     bias=Parameter(0.0, 'N', -50.0, 50.0, 'offset of the reading'))
def force_sensor_bias(bias):
    """Force reading = force + b."""
    return bias


@law('sensor', **_FAMILY, off={'gain': 0.0}, look=('grey', 'dash'),
     summary='load cell with a wrong gain', signature='the error is in proportion to the force',
     gain=Parameter(0.0, '1', -0.3, 0.3, 'relative error of the reading'))
def force_sensor_gain(force, gain):
    """Force reading = force (1 + g)."""
    return gain * force
