# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors of the pressure gauges."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'pressure_sensor', 'changes': 'pressure', 'leaves': ('smooth1', 'smooth2'),
    'remedy': 'vent the muscle and read the pressure gauge',
    'source': 'instrument error model; sizes 1-5 N and 1-6 % as seen on rigs'}


@law('sensor', **_FAMILY, off={'bias': 0.0}, look=('orange', 'dot'),
     summary='pressure gauge with an offset',
     signature='the error has the shape of dF/dP and does not vanish at zero pressure',
     bias=Parameter(0.0, 'kPa', -60.0, 60.0, 'offset of the reading'))
def pressure_sensor_bias(bias):
    """Pressure reading = pressure + b."""
    return bias


@law('sensor', **_FAMILY, off={'gain': 0.0}, look=('orange', 'dashdot'),
     summary='pressure gauge with a wrong gain',
     signature='the error is in proportion to the pressure part of the force',
     gain=Parameter(0.0, '1', -0.3, 0.3, 'relative error of the reading'))
def pressure_sensor_gain(pressure, gain):
    """Pressure reading = pressure (1 + g)."""
    return gain * pressure
