# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The shared supply: a manifold fed by a regulator, and the energy drawn from it."""

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, RT
from fam_bundle_ros.plant.checks import require


@dataclass(frozen=True)
class SupplyConfig:
    """
    A manifold of finite volume that all valves share, fed by a pressure regulator.

    The flow of the regulator is (pressure - manifold)/resistance (droop), between 0 and its flow
    limit.

    Parameters
    ----------
    pressure : float, Pa (gauge)
        Set point of the regulator.
    volume : float, m^3
        Manifold with the lines to the valves.
    resistance : float, Pa/(kg/s)
        Droop of regulator and line; the model effect ``supply_droop`` adds to it.
    flow_limit : float, kg/s
        6e-3 is about 300 l/min of free air.
    dump_conductance : float, m^3/(s Pa)
        Sonic conductance of the valve that empties the manifold at an emergency stop.
    """

    pressure: float = 500e3
    volume: float = 1e-4
    resistance: float = 1e6
    flow_limit: float = 6e-3
    dump_conductance: float = 1.6e-8

    def __post_init__(self):
        require(self, 'pressure', 'volume', 'resistance', 'flow_limit', 'dump_conductance',
                above=0.0)


def air_energy(air_mass: float, supply_pressure: float, ambient: float = ATMOSPHERE) -> float:
    """
    Return P_s V of the air drawn from a supply, J, with the volume V at supply pressure.

    Parameters
    ----------
    air_mass : float, kg
    supply_pressure : float, Pa (gauge)
    ambient : float, Pa (absolute)

    Examples
    --------
    >>> print(f'{air_energy(1e-3, 500e3):.1f} J')
    70.0 J
    """
    return supply_pressure * air_mass * RT / (supply_pressure + ambient)


def available_energy(air_mass: float, supply_pressure: float,
                     ambient: float = ATMOSPHERE) -> float:
    """
    Return the largest work, J, of the air at room temperature: m R T ln(p_s/p_a).

    Arguments as for `air_energy`.
    """
    return air_mass * RT * float(np.log1p(supply_pressure / ambient))


def liquid_energy(volume, pressure, supply_pressure: float, threshold: float = 5e3) -> float:
    """
    Return P_s V, J, that the same motion would draw from a supply of incompressible fluid.

    A motor unit under pressure draws the increase of its volume at supply pressure, and returns
    nothing to the supply; a vented one exchanges fluid with the tank without energy.

    Parameters
    ----------
    volume : array_like, (T, n), m^3
        Volume inside the muscles of each motor unit over time.
    pressure : array_like, (T, n), Pa (gauge)
    supply_pressure : float, Pa (gauge)
    threshold : float, Pa
        Below this gauge pressure a motor unit counts as vented.

    Raises
    ------
    InputError
        When the two arrays have different shapes.
    """
    volume = np.asarray(volume, dtype=float)
    pressure = np.asarray(pressure, dtype=float)
    if volume.shape != pressure.shape:
        raise InputError(f'volume has the shape {volume.shape} and pressure {pressure.shape}; '
                         'expected the same (time, motor unit)')
    growth = np.maximum(np.diff(volume, axis=0), 0.0)
    return supply_pressure * float(np.sum(growth[pressure[1:] > threshold]))
