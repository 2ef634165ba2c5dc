# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plants of the control benchmark that differ from the controller's model.

Each except ``nominal`` has one difference, ``everything`` has all, and so has ``measured``, a
bundle of a measured muscle with the model that `diagnose` makes of it. The muscles
(`foreign_muscle`, `measured_muscle`) use the interface of foreign plants and share no law with the
catalogue. Differences between muscle and controller (dead time, lag, valve, line) are
configuration of the rig. Controllers know only the model, the supply, the nominal valve and the
dead time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from fam_bundle_ros.benchmarks.foreign_muscle import muscle_plant, Wrong
from fam_bundle_ros.benchmarks.measured_muscle import (
    diagnosed_bundle,
    MAX_PRESSURE,
    measured_plant,
)
from fam_bundle_ros.model import Bundle, Geometry, load_model, MotorUnit
from fam_bundle_ros.plant import (
    ChamberConfig,
    rig_for,
    RigConfig,
    SensorConfig,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.resources import config_path

MODEL = 'models/spie2021_plain.yaml'
#: Numbers of motor units.
UNITS = (2, 3, 6)
#: Radius (m) and muscles of each motor unit, smallest first.
_SIZES = {3: ((4.0e-3, 1), (5.0e-3, 1), (6.35e-3, 1)),
          6: ((3.5e-3, 1), (4.0e-3, 1), (4.5e-3, 1), (5.0e-3, 1), (5.0e-3, 2), (6.35e-3, 2))}
#: Share of the dead time in the readings; the rest is in the commands.
_READING = 0.6

SLUGGISH = SensorConfig(force_lag=4e-3, pressure_lag=2e-3, strain_lag=1e-3, force_resolution=0.2,
                        pressure_resolution=500.0, strain_resolution=1e-4)
STICKY = ValveConfig(dead_band=0.07, hysteresis=0.03, bandwidth=90.0)
NARROW = ChamberConfig(tube_volume=7e-6, line_volume=3e-6, line_conductance=5e-9)
#: Factor on valves, lines and supply for a DMSP-20: its valve passes 350 l/min at 6 bar.
_LARGER = 3.5


@cache
def paper_bundle(units: int) -> Bundle:
    """Return the bundle of `MODEL`, or one of other sizes (`UNITS`) with its effects."""
    paper = load_model(config_path(MODEL))
    if units == paper.n:
        return paper
    return Bundle(f'{units} units', [
        MotorUnit(f'mu{k + 1}', muscles, Geometry(radius, 0.127, math.radians(33.0),
                                                  0.25 * radius), 344.7e3)
        for k, (radius, muscles) in enumerate(_SIZES[units])], paper.effects)


@dataclass(frozen=True)
class PlantKind:
    """A plant of the benchmark."""

    name: str
    words: str
    #: Differences of the muscles; None for the controller's own model.
    muscle: Wrong | None = None
    #: With its dead times.
    rig: RigConfig = field(default_factory=RigConfig)
    noise_factor: float = 1.0
    #: Returns the controller's model for a number of motor units.
    bundle: Callable[[int], Bundle] = paper_bundle
    #: Returns a plant for that model and the differences ``muscle``.
    plant: Callable[[Bundle, Wrong], Any] = muscle_plant

    @property
    def delay(self) -> float:
        """Dead time of reading and command together, s; known to the controllers."""
        return self.rig.sensors.delay + self.rig.valve.delay


def _late(delay: float, sensors: SensorConfig = SensorConfig(),
          valve: ValveConfig = ValveConfig(), **more: Any) -> RigConfig:
    """Return a rig whose readings and commands have a dead time, s."""
    return RigConfig(sensors=SensorConfig(**{**vars(sensors), 'delay': _READING * delay}),
                     valve=ValveConfig(**{**vars(valve), 'delay': (1.0 - _READING) * delay}),
                     **more)


def _larger(rig: RigConfig) -> RigConfig:
    """Return a rig with valves, lines and supply enlarged for a DMSP-20."""
    valve, chamber, usual = rig.valve, rig.chamber, rig_for(
        SimpleNamespace(max_pressure=[MAX_PRESSURE]))
    return replace(
        rig, trip_pressure=usual.trip_pressure,
        supply=replace(rig.supply, pressure=usual.supply.pressure,
                       volume=_LARGER * rig.supply.volume,
                       resistance=rig.supply.resistance / _LARGER,
                       flow_limit=_LARGER * rig.supply.flow_limit),
        valve=replace(valve, conductance=_LARGER * valve.conductance),
        chamber=replace(chamber, relief_pressure=usual.chamber.relief_pressure,
                        tube_volume=_LARGER * chamber.tube_volume,
                        line_volume=_LARGER * chamber.line_volume,
                        line_conductance=_LARGER * chamber.line_conductance))


#: Rig of the plants with all differences.
_ALL = _late(10e-3, SLUGGISH, STICKY, chamber=NARROW, supply=SupplyConfig(resistance=3e6))

PLANTS = {kind.name: kind for kind in (
    PlantKind('everything', 'all of the following at once, with a dead time of 10 ms',
              Wrong(own_surface=True, snap=True, scale=0.06, friction=2.5, slide=3e-4), _ALL),
    PlantKind('measured', 'a measured Festo DMSP-20 with all other differences, and the model '
              'that `diagnose` makes of its map',
              Wrong(snap=True, scale=0.06, friction=2.5, slide=3e-4), _larger(_ALL),
              bundle=diagnosed_bundle, plant=measured_plant),
    PlantKind('surface', 'realistic surface of tension and push-back instead of the laws',
              Wrong(own_surface=True)),
    PlantKind('snap', 'push-back drops when a muscle folds, and returns with hysteresis',
              Wrong(snap=True)),
    PlantKind('units_10', 'motor units alternately 10 % weaker and stronger', Wrong(scale=0.10)),
    PlantKind('units_5', 'motor units alternately 5 % weaker and stronger', Wrong(scale=0.05)),
    PlantKind('units_2', 'motor units alternately 2 % weaker and stronger', Wrong(scale=0.02)),
    PlantKind('friction', 'Dahl friction of the braid, also at constant strain',
              Wrong(friction=3.0, slide=3e-4)),
    PlantKind('play', 'backlash of about 10 kPa in pressure, also at constant strain',
              Wrong(friction=2.0, slide=1e-5)),
    PlantKind('delay_15', 'dead time of 15 ms', rig=_late(15e-3)),
    PlantKind('delay_10', 'dead time of 10 ms', rig=_late(10e-3)),
    PlantKind('delay_5', 'dead time of 5 ms', rig=_late(5e-3)),
    PlantKind('sensors', 'lag of 1 to 4 ms and coarse readings', rig=RigConfig(sensors=SLUGGISH)),
    PlantKind('line', 'narrow line between valve with sensor and muscle',
              rig=RigConfig(chamber=NARROW)),
    PlantKind('valve', 'backlash of the spool, larger dead band, slower',
              rig=RigConfig(valve=STICKY)),
    PlantKind('noise', 'noise of all sensors doubled', noise_factor=2.0),
    PlantKind('nominal', 'the model itself'),
)}


def model_of(name: str, units: int) -> Bundle:
    """Return the model of the controller of a plant."""
    return PLANTS[name].bundle(units)


@cache
def plant_of(name: str, units: int) -> Any:
    """Return the Bundle or ForeignPlant of a plant's rig."""
    kind, model = PLANTS[name], model_of(name, units)
    return model if kind.muscle is None else kind.plant(model, kind.muscle)


@cache
def model_error(name: str, units: int, better: Bundle | None = None) -> float:
    """
    Return the error of the controller's model, or of a ``better`` one, on a plant, N rms, at rest.

    Over slow pressure sweeps, up and down and from unit to unit in the order of recruitment, at
    constant strains: it includes friction and snap, but not dead time and lag.
    """
    plant = plant_of(name, units)
    model = better or model_of(name, units)
    if plant is model:
        return 0.0
    shares = np.concatenate([np.linspace(0.0, units, 60 * units),
                             np.linspace(units, 0.0, 60 * units)])
    pressure = (np.clip(shares[:, None] - np.arange(units), 0.0, 1.0) * model.max_pressure)
    squares = []
    for strain in (0.08, 0.12, 0.16, 0.20):
        path = np.full(len(pressure), strain)
        squares.append(np.mean((sweep(plant, path, pressure) - sweep(model, path, pressure)) ** 2))
    return float(np.sqrt(np.mean(squares)))


def sweep(plant: Any, strain: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Return the force, N, shape (T,), of any plant along strains (T,) and pressures (T, n)."""
    model, force, dt = plant.model(False), np.zeros(len(strain)), 0.05
    for k, (e, p) in enumerate(zip(strain.tolist(), pressure.tolist())):
        for i in range(plant.n):
            force[k] += model.force(i, e, 0.0, p, k * dt, dt, k == 0, model.shape,
                                    model.parameters, model.tables, model.memory, model.after)
        for row, after in zip(model.memory, model.after):
            row[:] = after
    return force
