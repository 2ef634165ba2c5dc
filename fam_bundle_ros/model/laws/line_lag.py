# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lag of the line between the pressure sensor at the valve and the muscle."""

from fam_bundle_ros.model.laws.base import law, Parameter
from fam_bundle_ros.model.vocabulary import lag


@law('pressure', family='line_lag', leaves=('pressure_rate', 'decay'), look=('teal', 'dash'),
     summary='first-order lag of the line between pressure sensor and muscle',
     source='first-order line; 5-50 ms as measured on tube-fed muscles',
     signature='the residual is in proportion to the rate of the pressure',
     memory=('lagged', 'last'), off={'time_constant': 0.0},
     time_constant=Parameter(0.02, 's', 0.0, 2.0, 'lag of the line'))
def pressure_line_lag(pressure, start, dt, lagged, last, time_constant):
    """Pressure p in the muscle, tau dp/dt = P - p; the sensor (P) is at the valve."""
    felt = lag(lagged, last, pressure, time_constant, start, dt)
    return felt - pressure, felt, pressure
