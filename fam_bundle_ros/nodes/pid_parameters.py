# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node pressure_pid, and the controller settings made from them."""

from dataclasses import replace
from typing import Any

from fam_bundle_ros.control import PidConfig, PidGains
from fam_bundle_ros.control.pid import ANTI_WINDUP
from fam_bundle_ros.control.safety import HOLD_TIME, OVER_PRESSURE_FACTOR
from fam_bundle_ros.model.pneumatics import ValveFlow
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import LATENCY, LISTENER, MODEL
from fam_bundle_ros.nodes.parameters import Spec

_GAINS, _CONFIG = PidGains(), PidConfig()

SPECS = (
    Spec('motor_unit', 1, 'which motor unit, from 1', 1, interface.MOST_UNITS),
    replace(MODEL, text=f'{MODEL.text}: for gas volume and largest pressure'),
    *LISTENER, *LATENCY,
    Spec('gains.p', _GAINS.p, 'pressure rate per error, 1/s', 0.0, 1e3, dynamic=True),
    Spec('gains.i', _GAINS.i, 'pressure rate per integrated error, 1/s^2', 0.0, 1e5, dynamic=True),
    Spec('gains.d', _GAINS.d, 'on the measured pressure rate, dimensionless', 0.0, 1.0,
         dynamic=True),
    Spec('anti_windup', _CONFIG.anti_windup, 'anti-windup of the integral at the valve limits',
         choices=ANTI_WINDUP, dynamic=True),
    Spec('feed_forward', _CONFIG.feed_forward,
         'feed-forward of moving setpoints and muscles by the chamber model', dynamic=True),
    Spec('dead_band_compensation', _CONFIG.dead_band_compensation,
         'compensate the dead band of the valve, and learn its width', dynamic=True),
    Spec('quiet_error', _CONFIG.quiet_error, 'dead zone: smaller errors are not corrected, Pa',
         0.0, 1e5, dynamic=True, guards=True),
    Spec('setpoint_rate', _CONFIG.setpoint_rate, 'largest rate of the setpoint, Pa/s; a setpoint '
         'of ambient pressure empties the motor unit without it', 1e3, 1e9, dynamic=True),
    Spec('transport_delay', _CONFIG.transport_delay, 'dead time from a reading through the valve '
         'to the next reading, s', 0.0, 0.5, dynamic=True, guards=True),
    Spec('valve.conductance', _CONFIG.valve.conductance, 'sonic conductance, m^3/(s Pa)',
         1e-12, 1e-5),
    Spec('valve.dead_band', _CONFIG.valve.dead_band, 'largest command that does not open the '
         'valve', 0.0, 0.9),
    Spec('supply.pressure', _CONFIG.supply, 'supply while it is not measured, Pa gauge', 1e3,
         1.5e6),
    Spec('volume', _CONFIG.volume, 'gas volume with tubes while no strain is measured, m^3',
         1e-7, 1e-1),
    Spec('tube_volume', 5e-6, 'tube and fittings between valve and muscles, m^3', 0.0, 1e-2),
    Spec('over_pressure_factor', OVER_PRESSURE_FACTOR, 'vent and latch above the largest '
         'pressure times this', 1.0, 3.0, dynamic=True, guards=True),
    Spec('setpoint_timeout', 0.2, 'vent when the setpoint is older than this, s', 0.01, 10.0,
         dynamic=True, guards=True),
    Spec('sensor_timeout', 0.1, 'a pressure older than this is stale, s', 0.01, 10.0),
    Spec('auxiliary_timeout', 0.5, 'a strain or supply older than this is replaced by the '
         'parameters volume and supply.pressure, s', 0.01, 60.0, dynamic=True, guards=True),
    Spec('hold_time', HOLD_TIME, 'time for which a bad reading shuts the valve before it vents, s',
         0.0, 10.0),
    Spec('recovery_time', 0.2, 'time for which a reading must be good to be used again, s', 0.0,
         10.0),
    Spec('stuck_time', 0.5, 'a reading that is exactly constant for this time while the valve is '
         'open is stuck, s; 0 for never', 0.0, 60.0),
)


def settings(values: dict[str, Any]) -> tuple[PidGains, PidConfig]:
    """Return gains and settings; InputError if they are not consistent."""
    gains = PidGains(values['gains.p'], values['gains.i'], values['gains.d'])
    config = PidConfig(
        valve=ValveFlow(conductance=values['valve.conductance'],
                        dead_band=values['valve.dead_band']),
        anti_windup=values['anti_windup'], volume=values['volume'],
        supply=values['supply.pressure'],
        ambient=values['ambient_pressure'], setpoint_rate=values['setpoint_rate'],
        transport_delay=values['transport_delay'], quiet_error=values['quiet_error'],
        feed_forward=values['feed_forward'],
        dead_band_compensation=values['dead_band_compensation'])
    return gains, config
