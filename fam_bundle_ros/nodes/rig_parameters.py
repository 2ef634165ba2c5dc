# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated rig as ROS parameters: load, instruments, supply, valves."""

from dataclasses import fields
from typing import Any

import numpy as np

from fam_bundle_ros.control import LoadModel
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.nodes.parameters import Spec
from fam_bundle_ros.plant import (
    Arm,
    ChamberConfig,
    Dynamometer,
    Load,
    MassSpring,
    rig_for,
    RigConfig,
    SensorConfig,
    SeriesSpringMass,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.simulation import load_model_of

#: Loads by the name that a parameter gives them, with the parameters that they take.
_LOADS: dict[str, tuple[type[Load], dict[str, str]]] = {
    'dynamometer': (Dynamometer, {'strain': 'load.strain', 'speed': 'load.speed'}),
    'mass_spring': (MassSpring, {
        'mass': 'load.mass', 'stiffness_against': 'load.stiffness_against',
        'damping': 'load.damping'}),
    'series_spring_mass': (SeriesSpringMass, {
        'mass': 'load.mass', 'stiffness_series': 'load.stiffness_series',
        'stiffness_against': 'load.stiffness_against', 'damping': 'load.damping'}),
    'arm': (Arm, {
        'mass': 'load.arm.mass', 'moment_of_inertia': 'load.arm.moment_of_inertia',
        'centre': 'load.arm.centre', 'moment_arm': 'load.arm.moment_arm',
        'rest_angle': 'load.arm.rest_angle', 'damping': 'load.arm.damping'}),
}

LOAD = (
    Spec('load.kind', 'mass_spring', 'what the bundle pulls on', choices=tuple(_LOADS)),
    Spec('load.profile', '', 'trajectory file (quantity strain) that the dynamometer imposes'),
    Spec('load.repeat', False, 'the dynamometer repeats the profile'),
    Spec('load.strain', 0.1, 'strain that the dynamometer holds', -0.15, 0.5, dynamic=True),
    Spec('load.speed', 1.0, 'largest strain rate of the dynamometer, 1/s', 1e-4, 100.0,
         dynamic=True),
    Spec('load.mass', 5.0, 'mass, kg', 0.01, 1e4, dynamic=True),
    Spec('load.stiffness_against', 0.0, 'spring that resists contraction, N/m', 0.0, 1e6,
         dynamic=True),
    Spec('load.stiffness_series', 10e3, 'spring between bundle and mass, N/m', 1.0, 1e7,
         dynamic=True),
    Spec('load.damping', 5.0, 'damping of the guide, N s/m', 0.0, 1e5, dynamic=True),
    Spec('load.arm.mass', 1.5, 'mass of forearm and load, kg', 0.01, 1e3, dynamic=True),
    Spec('load.arm.moment_of_inertia', 0.06, 'about the joint, kg m^2', 1e-5, 1e3, dynamic=True),
    Spec('load.arm.centre', 0.18, 'distance of the centre of mass from the joint, m', 1e-3, 10.0,
         dynamic=True),
    Spec('load.arm.moment_arm', 0.03, 'radius of the pulley, m', 1e-3, 1.0, dynamic=True),
    Spec('load.arm.rest_angle', 0.35, 'joint angle at zero strain, from hanging, rad', -3.2, 3.2,
         dynamic=True),
    Spec('load.arm.damping', 0.05, 'damping of the joint, N m s/rad', 0.0, 1e3, dynamic=True),
)

_SENSORS = {f'sensors.{f.name}': f.name for f in fields(SensorConfig)
            if f.name not in ('dropout', 'on_dropout')}
_UNITS = {'force': 'N', 'pressure': 'Pa', 'strain': 'dimensionless', 'rate': 'Hz'}


def _unit(field: str) -> str:
    """Return the unit of a field of `SensorConfig`."""
    return 's' if field.endswith(('lag', 'delay')) else _UNITS[field.partition('_')[0]]


RIG = (
    *(Spec(name, getattr(SensorConfig(), field),
           f"{field.replace('_', ' ')} of the instruments, {_unit(field)}",
           -1e5 if field.endswith('bias') else 1e-3 if field == 'rate_cutoff' else 0.0, 1e5)
      for name, field in _SENSORS.items()),
    Spec('supply.pressure', SupplyConfig().pressure, 'set point of the regulator, Pa gauge',
         1e3, 1.5e6),
    Spec('supply.resistance', SupplyConfig().resistance, 'droop of the supply, Pa/(kg/s)',
         1.0, 1e12),
    Spec('valve.conductance', ValveConfig().conductance, 'sonic conductance, m^3/(s Pa)',
         1e-12, 1e-5),
    Spec('valve.dead_band', ValveConfig().dead_band, 'largest command that does not open the '
         'valve', 0.0, 0.9),
    Spec('valve.bandwidth', ValveConfig().bandwidth, 'of the spool, Hz', 1.0, 1e4),
    Spec('valve.hysteresis', 0.0, 'backlash between command and spool', 0.0, 0.5),
    Spec('valve.delay', 0.0, 'dead time of the commands, s', 0.0, 1.0),
    Spec('chamber.line_volume', 0.0, 'volume of the tube between valve and restriction, with the '
         'pressure sensor, m^3; 0 for one pressure', 0.0, ChamberConfig().tube_volume),
    Spec('chamber.line_conductance', ChamberConfig().line_conductance,
         'sonic conductance of that restriction, m^3/(s Pa)', 1e-12, 1e-5),
    Spec('chamber.relief_pressure', ChamberConfig().relief_pressure,
         'opening pressure of the relief valves, Pa gauge', 1e3, 1.5e6),
    Spec('trip_pressure', RigConfig().trip_pressure,
         'a motor unit above it stops the rig, Pa gauge', 1e3, 1.5e6),
)


def load_from(values: dict[str, Any]) -> Load:
    """Return the load that the parameters describe."""
    kind, names = _LOADS[values['load.kind']]
    return kind(**{field: values[name] for field, name in names.items()})


def load_change(kind: str, changes: dict[str, Any]) -> dict[str, float]:
    """Return the fields of a load that the changed parameters set."""
    return {field: changes[name] for field, name in _LOADS[kind][1].items() if name in changes}


def load_model_parameters(load: Load, length: float) -> dict[str, float]:
    """Return the load's parameters for the controller, for a rest length (m) of the bundle."""
    known = load_model_of(load, length)
    force, stiffness = _line(known)
    return {'load_model.force': force, 'load_model.stiffness': stiffness,
            'load_model.inertia': float(known.inertia),
            'load_model.damping': float(known.damping)}


def _line(known: LoadModel) -> tuple[float, float]:
    """Return force at zero strain and stiffness (N) of a load; of a table, the line fit."""
    if not known.table:
        return float(known.force), float(known.stiffness)
    strain, force = np.array(known.table).T
    # The parameters must not be negative; a fit of zero may be, by rounding.
    slope = max(float(np.polyfit(strain, force, 1)[0]), 0.0)
    return max(float(np.mean(force - slope * strain)), 0.0), slope


def pressure_parameters(bundle: Bundle) -> dict[str, float]:
    """Return supply, trip and relief pressures that a bundle needs above the defaults, Pa."""
    rig = rig_for(bundle)
    if rig == RigConfig():
        return {}
    return {'supply.pressure': rig.supply.pressure, 'trip_pressure': rig.trip_pressure,
            'chamber.relief_pressure': rig.chamber.relief_pressure}


def rig_config(values: dict[str, Any]) -> RigConfig:
    """Return the rig that the parameters describe."""
    return RigConfig(
        load=load_from(values),
        valve=ValveConfig(**_of('valve', values)), chamber=ChamberConfig(**_of('chamber', values)),
        supply=SupplyConfig(**_of('supply', values)),
        sensors=SensorConfig(**{field: values[name] for name, field in _SENSORS.items()}),
        ambient_pressure=values['ambient_pressure'], trip_pressure=values['trip_pressure'])


def _of(part: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a part of the rig that are parameters."""
    return {spec.name.partition('.')[2]: values[spec.name] for spec in RIG
            if spec.name.startswith(f'{part}.')}
