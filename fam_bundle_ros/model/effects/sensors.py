# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the gauges show against what the muscle feels: shown = true (1 + gain) + bias.

Sensor effects belong to the comparison with data and to a simulated rig's readings, never to the
muscle that the controller inverts.
"""

from fam_bundle_ros.model.effects.base import Effect, Parameter, Place, SensorError

_SOURCE = 'instrument error model; sizes 1-5 N and 1-6 % as seen on rigs'


class _Sensor(Effect):
    place = Place.SENSOR
    source = _SOURCE


class ForceSensorBias(_Sensor):
    """Force reading = force + b."""

    name = 'force_sensor_bias'
    summary = 'load cell with an offset'
    family = 'force_sensor'
    signature = 'the error is the same everywhere'
    parameters = (Parameter('bias', 'N', 0.0, -50.0, 50.0, 'offset of the reading'),)
    off = {'bias': 0.0}

    def contribution(self, x):
        return SensorError(force_bias=self.bias)


class ForceSensorGain(_Sensor):
    """Force reading = force (1 + g)."""

    name = 'force_sensor_gain'
    summary = 'load cell with a wrong gain'
    family = 'force_sensor'
    signature = 'the error is in proportion to the force'
    parameters = (Parameter('gain', '1', 0.0, -0.3, 0.3, 'relative error of the reading'),)
    off = {'gain': 0.0}

    def contribution(self, x):
        return SensorError(force_gain=self.gain)


class PressureSensorBias(_Sensor):
    """Pressure reading = pressure + b."""

    name = 'pressure_sensor_bias'
    summary = 'pressure gauge with an offset'
    family = 'pressure_sensor'
    signature = 'the error has the shape of dF/dP and does not vanish at zero pressure'
    parameters = (Parameter('bias', 'kPa', 0.0, -60.0, 60.0, 'offset of the reading'),)
    off = {'bias': 0.0}

    def contribution(self, x):
        return SensorError(pressure_bias=self.bias)


class PressureSensorGain(_Sensor):
    """Pressure reading = pressure (1 + g)."""

    name = 'pressure_sensor_gain'
    summary = 'pressure gauge with a wrong gain'
    family = 'pressure_sensor'
    signature = 'the error is in proportion to the pressure part of the force'
    parameters = (Parameter('gain', '1', 0.0, -0.3, 0.3, 'relative error of the reading'),)
    off = {'gain': 0.0}

    def contribution(self, x):
        return SensorError(pressure_gain=self.gain)


class StrainSensorOffset(_Sensor):
    """Strain reading = strain + o."""

    name = 'strain_sensor_offset'
    summary = 'rest length or zero of the displacement sensor is off'
    family = 'strain_sensor'
    signature = 'the error has the shape of dF/de at every pressure'
    parameters = (Parameter('offset', '1', 0.0, -0.05, 0.05, 'offset of the reading'),)
    off = {'offset': 0.0}

    def contribution(self, x):
        return SensorError(strain_bias=self.offset)
