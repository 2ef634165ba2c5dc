# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated rig: valves, chambers, supply, load, sensors around a bundle. No ROS here."""

from fam_bundle_ros.plant import loads, sensors
from fam_bundle_ros.plant.circuit import AirBalance
from fam_bundle_ros.plant.faults import Faults
from fam_bundle_ros.plant.foreign import ForeignPlant
from fam_bundle_ros.plant.loads import Arm, Dynamometer, Load, MassSpring, SeriesSpringMass
from fam_bundle_ros.plant.pneumatics import (
    ChamberConfig,
    ChamberLinearisation,
    fastest_fall,
    fastest_rise,
    linearise,
    ValveConfig,
)
from fam_bundle_ros.plant.rig import Rig, rig_for, RigConfig
from fam_bundle_ros.plant.sensors import Readings, SensorConfig
from fam_bundle_ros.plant.supply import air_energy, available_energy, liquid_energy, SupplyConfig

__all__ = [
    'air_energy', 'AirBalance', 'Arm', 'available_energy', 'ChamberConfig',
    'ChamberLinearisation', 'Dynamometer', 'fastest_fall', 'fastest_rise', 'Faults',
    'ForeignPlant', 'linearise', 'liquid_energy', 'Load', 'loads', 'MassSpring', 'Readings',
    'Rig', 'rig_for', 'RigConfig', 'SensorConfig', 'sensors', 'SeriesSpringMass', 'SupplyConfig',
    'ValveConfig',
]
