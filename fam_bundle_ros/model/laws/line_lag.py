# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lag of the line between the pressure sensor at the valve and the muscle."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import lag

_FAMILY: dict[str, Any] = {
    'family': 'line_lag', 'delay': 'time_constant', 'leaves': ('pressure_rate', 'decay'),
    'signature': 'the residual is in proportion to the rate of the pressure',
    'off': {'time_constant': 0.0},
    'time_constant': Parameter(0.02, 's', 0.0, 2.0, 'lag of the line')}


@law('pressure', **_FAMILY, look=('teal', 'dash'), memory=('lagged', 'last'),
     summary='first-order lag of the line between pressure sensor and muscle',
     source='first-order line; 5-50 ms as measured on tube-fed muscles')
def pressure_line_lag(pressure, start, dt, lagged, last, time_constant):
    """Pressure p in the muscle, tau dp/dt = P - p; the sensor (P) is at the valve."""
    felt = lag(lagged, last, pressure, time_constant, start, dt)
    return felt - pressure, felt, pressure


@law('pressure', **_FAMILY, variant_of='pressure_line_lag', look=('sky', 'dashdot'),
     memory=('halfway', 'lagged', 'last'),
     summary='second-order lag of the line: two restrictions and two volumes',
     source='two equal first-order lines in series; 5-50 ms as measured on tube-fed muscles')
def pressure_line_double(pressure, start, dt, halfway, lagged, last, time_constant):
    """tau/2 dq/dt = P - q, tau/2 dp/dt = q - p: tau is the lag behind a steady rise."""
    half = 0.5 * time_constant
    between = lag(halfway, last, pressure, half, start, dt)
    felt = lag(lagged, halfway, between, half, start, dt)
    return felt - pressure, between, felt, pressure
