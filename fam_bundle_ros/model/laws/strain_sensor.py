# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Errors of the displacement sensor."""

from typing import Any

from fam_bundle_ros.model.laws.base import law, Parameter

_FAMILY: dict[str, Any] = {
    'family': 'strain_sensor', 'changes': 'strain', 'leaves': ('smooth0', 'smooth1'),
    'remedy': 'measure the rest length and the clamped ends with a calliper'}


@law('sensor', **_FAMILY, off={'offset': 0.0}, look=('olive', 'dot'),
     summary='displacement sensor with an offset, or error of the rest length',
     source='instrument error model; sizes 1-5 N and 1-6 % as seen on rigs',
     signature='the error has the shape of dF/de at every pressure',
     offset=Parameter(0.0, '1', -0.05, 0.05, 'offset of the reading'))
def strain_sensor_offset(offset):
    """Strain reading = strain + o."""
    return offset


@law('sensor', **_FAMILY, variant_of='strain_sensor_offset', needs='length readings',
     off={'excess': 0.0}, look=('olive', 'longdashdot'),
     summary='error of the rest length by which length readings were made strains',
     source='derived: e = 1 - l/L0 with the true L0',
     signature='the error has the shape of (1 - e) dF/de at every pressure',
     excess=Parameter(0.0, '1', -0.1, 0.1, 'true rest length over the one in use, minus 1'))
def strain_rest_length(strain, excess):
    """Strain reading = 1 - (1 - e)(1 + x)."""
    return -(1.0 - strain) * excess


@law('sensor', changes='strain', family='strain_sensor_lag', leaves=('speed',),
     remedy='log strain and force by one clock and with the same filters',
     off={'lag': 0.0}, look=('olive', 'longdash'),
     summary='delay between the readings of strain and force',
     source='first-order lag of a sensor, y + tau dy/dt = u; exact for its reading y',
     signature='the error is in proportion to the strain rate and to the slope of the force over '
               'strain',
     lag=Parameter(0.0, 's', -0.1, 0.1, 'lag of the strain reading; below zero of the force'))
def strain_sensor_lag(strain_rate, lag):
    """Strain reading = strain - tau de/dt, with the rate of the reading."""
    return -lag * strain_rate
