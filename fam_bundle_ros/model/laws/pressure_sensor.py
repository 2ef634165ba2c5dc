# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors of the pressure gauges."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import of_unit

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


_OF_UNITS: dict[str, Any] = {**_FAMILY, 'family': 'unit_gauge', 'per_unit': 'each',
                             'remedy': 'connect all pressure gauges to one line and compare them'}
_BIASES: dict[str, Any] = {f'mu{i}': Parameter(0.0, 'kPa', -60.0, 60.0, f'offset of unit {i}')
                           for i in range(1, 7)}
_GAINS: dict[str, Any] = {f'mu{i}': Parameter(0.0, '1', -0.3, 0.3, f'relative error of unit {i}')
                          for i in range(1, 7)}


@law('sensor', **_OF_UNITS, off=dict.fromkeys(_BIASES, 0.0), look=('blue', 'dash'),
     summary='pressure gauges with an offset of each motor unit',
     signature='the error has the shape of dF/dP of one motor unit', **_BIASES)
def unit_pressure_bias(unit, mu1, mu2, mu3, mu4, mu5, mu6):
    """Pressure reading of unit i = pressure + b_i."""
    return of_unit(unit, mu1, mu2, mu3, mu4, mu5, mu6)


@law('sensor', **_OF_UNITS, off=dict.fromkeys(_GAINS, 0.0), look=('blue', 'dashdot'),
     summary='pressure gauges with a wrong gain of each motor unit',
     signature='the error is in proportion to the pressure part of the force of one motor unit',
     **_GAINS)
def unit_pressure_gain(unit, pressure, mu1, mu2, mu3, mu4, mu5, mu6):
    """Pressure reading of unit i = pressure (1 + g_i)."""
    return pressure * of_unit(unit, mu1, mu2, mu3, mu4, mu5, mu6)
