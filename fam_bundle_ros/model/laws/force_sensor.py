# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Errors of the load cell.

Sensor laws are used for the comparison with data and for the readings of a simulated rig, not for
the muscle model that the controller inverts. They are linear in the measured quantity.
"""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter

_INSTRUMENT: dict[str, Any] = {
    'changes': 'force', 'source': 'instrument error model; sizes 1-5 N and 1-6 % as seen on rigs'}
_FAMILY: dict[str, Any] = {
    **_INSTRUMENT, 'family': 'force_sensor', 'leaves': ('smooth0', 'smooth1', 'force'),
    'remedy': 'hang a known weight on the load cell'}


@law('sensor', **_FAMILY, off={'bias': 0.0}, look=('grey', 'solid'),
     summary='load cell with an offset', signature='the error is the same everywhere',
     bias=Parameter(0.0, 'N', -500.0, 500.0, 'offset of the reading'))
def force_sensor_bias(bias):
    """Force reading = force + b."""
    return bias


@law('sensor', **_FAMILY, off={'gain': 0.0}, look=('grey', 'dash'),
     summary='load cell with a wrong gain', signature='the error is in proportion to the force',
     gain=Parameter(0.0, '1', -0.3, 0.3, 'relative error of the reading'))
def force_sensor_gain(force, gain):
    """Force reading = force (1 + g)."""
    return gain * force


@law('sensor', **_INSTRUMENT, family='force_sensor_drift', across_trials=True,
     leaves=('drift',), off={'rate': 0.0}, look=('grey', 'longdash'),
     summary='load cell whose zero drifts',
     signature='the error grows with time and is independent of strain and pressure',
     remedy='log the unloaded load cell before and after, and tare it in between',
     rate=Parameter(0.0, 'N/min', -60.0, 60.0, 'change of the reading at no load'))
def force_sensor_drift(time, rate):
    """Force reading = force + r t, t since the start of the log: drift with temperature."""
    return rate * time
