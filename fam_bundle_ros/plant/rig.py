# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated rig as an object: a plant with its valves, supply, load and sensors.

The equations are kernels: `fam_bundle_ros.plant.circuit` for the air, `loads` for the load,
`motion` for both with the bundle's force, `sensors` for the instruments. `Rig` holds their state
and checks its arguments. Deterministic: the same seed and the same calls give the same bytes.
"""

from collections.abc import Sequence
import copy
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.parts import SensorError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE
from fam_bundle_ros.plant.checks import require
from fam_bundle_ros.plant.circuit import Air, AirBalance, AirConfig
from fam_bundle_ros.plant.faults import fault_record, Faults
from fam_bundle_ros.plant.loads import Dynamometer, Load
from fam_bundle_ros.plant.motion import (
    begin,
    E_STOP,
    OVER_PRESSURE,
    rig_step,
    RigRecord,
    RigState,
    RUNNING,
    true_channels,
)
from fam_bundle_ros.plant.pneumatics import ChamberConfig, ValveConfig
from fam_bundle_ros.plant.sensors import (
    Draws,
    FORCE,
    PRESSURE,
    read_sensors,
    Readings,
    SensorConfig,
    SensorRecord,
    SensorState,
    STRAIN,
    SUPPLY,
)
from fam_bundle_ros.plant.supply import SupplyConfig


@dataclass(frozen=True)
class RigConfig:
    """
    Configuration of a simulated rig without the bundle.

    Parameters
    ----------
    load : Load
    valve : ValveConfig
        The same for all motor units.
    chamber : ChamberConfig
    supply : SupplyConfig
    sensors : SensorConfig
    step : float, s
        Longest internal step.
    ambient_pressure : float, Pa (absolute)
    trip_pressure : float, Pa (gauge)
        Pressure of a chamber above which the rig is stopped.
    """

    load: Load = field(default_factory=Dynamometer)
    valve: ValveConfig = field(default_factory=ValveConfig)
    chamber: ChamberConfig = field(default_factory=ChamberConfig)
    supply: SupplyConfig = field(default_factory=SupplyConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    step: float = 1e-3
    ambient_pressure: float = ATMOSPHERE
    trip_pressure: float = 450e3

    def __post_init__(self):
        require(self, 'step', above=0.0, most=0.01)
        require(self, 'ambient_pressure', least=30e3, most=200e3)
        require(self, 'trip_pressure', above=0.0)


#: Pa: largest muscle pressure for which the default rig is designed (Kim et al. 2021).
_USUAL = 344.7e3


def rig_for(bundle: Any) -> RigConfig:
    """
    Return the default rig, with supply, trip and relief pressures scaled to a bundle's limit.

    At least those of the default rig, which is designed for 344.7 kPa.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> rig = rig_for(SimpleNamespace(max_pressure=[689.4e3]))
    >>> print(f'{rig.supply.pressure / 1e3:.0f} kPa, trip at {rig.trip_pressure / 1e3:.0f} kPa')
    1000 kPa, trip at 900 kPa
    """
    usual, scale = RigConfig(), max(*bundle.max_pressure, _USUAL) / _USUAL
    return replace(
        usual, trip_pressure=scale * usual.trip_pressure,
        supply=replace(usual.supply, pressure=scale * usual.supply.pressure),
        chamber=replace(usual.chamber, relief_pressure=scale * usual.chamber.relief_pressure))


def _dependences(plant, model) -> tuple[bool, bool]:
    """Return whether the plant's force depends on the strain rate, its volume on pressure."""
    rate = volume = False
    for strain in (0.0, 0.1, 0.2):
        for share in (0.0, 0.3, 0.9):
            pressure = [share * float(p) for p in plant.max_pressure]
            more = [p + 1e4 for p in pressure]
            for i in range(plant.n):
                slow, fast = (model.force(i, strain, v, pressure, 0.0, 0.0, True, model.shape,
                                          model.parameters, model.tables, model.memory,
                                          model.after) for v in (-0.05, 0.05))
                rate = rate or slow != fast
                low, high = (model.volume(i, strain, p, 0.0, model.shape, model.parameters,
                                          model.tables) for p in (pressure, more))
                volume = volume or low != high
    return rate, volume


def _gauge_errors(plant) -> tuple[list[float], list[float], list[float], list[float]]:
    """Return gain, offset, drift (1/s) and lag (s) of each channel of a plant's gauges."""
    def shown(true: float, time: float) -> np.ndarray:
        force, strain, pressure = plant.readings(true, true, np.full(plant.n, true), time)
        return np.array([force, strain, true, *np.broadcast_to(pressure, plant.n)], float)

    offset = shown(0.0, 0.0)
    late = getattr(plant, 'sensor_error', SensorError()).strain_lag
    lag = [max(-late, 0.0)] * len(offset)
    lag[STRAIN] = max(late, 0.0)
    return ((shown(1.0, 0.0) - offset).tolist(), offset.tolist(),
            (shown(0.0, 1.0) - offset).tolist(), lag)


class Rig:
    """
    A bundle on a simulated rig.

    Parameters
    ----------
    bundle : Bundle or ForeignPlant
        All its effects are simulated: those of the muscles in the force, `leak` and
        `supply_droop` in the air, sensor effects in the readings.
    config : RigConfig
    seed : int
        Seed of the sensors' noise.
    faults : Faults, optional
        Faults from the start.

    Attributes
    ----------
    faults : Faults
    load : Load
    length : float
        Rest length of the bundle, m.
    record, state, sensors, shown : RigRecord, RigState, SensorRecord, SensorState
    model : Model
        Records for kernels.
    draws : Draws
        Random numbers of the instruments for the next samples.

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> from fam_bundle_ros.resources import config_path
    >>> rig = Rig(load_model(config_path('models/spie2021.yaml')), seed=1)
    >>> readings = rig.step([0.5, -1.0], 0.02)
    >>> bool(readings.pressure[0] > 1e5)
    True
    """

    def __init__(self, bundle: Any, config: RigConfig = RigConfig(), seed: int = 0,
                 faults: Faults | None = None):
        self.bundle = bundle
        self.config = config
        self.faults = faults or Faults()
        self._known: Faults | None = None
        self.length = float(bundle.length)
        self._seed = seed
        self._describe()
        self.reset()

    def _describe(self) -> None:
        """Compute the records of bundle and configuration."""
        bundle, config = self.bundle, self.config
        air = AirConfig.of(config.valve, config.chamber, config.supply, config.ambient_pressure,
                           bundle.pneumatics.supply_resistance)
        tube = float(config.chamber.tube_volume)
        self.record = RigRecord(air, float(config.step), self.length, tube,
                                tube - config.chamber.line_volume, float(config.trip_pressure),
                                *_dependences(bundle, bundle.model(False)))
        self.sensors = SensorRecord.of(config.sensors, *_gauge_errors(bundle))

    def reset(self) -> None:
        """Return to the initial state: at rest, vented, seeded, not stopped. Faults stay."""
        self.load, n = self.config.load, self.bundle.n
        self._load = self.load.record
        self.model = self.bundle.model(False)
        self.state = RigState.at_rest(Air.at_rest(self.record.air, [0.0] * n),
                                      self.load.start(self.length))
        begin(self.record, self.model, self.state)
        self.shown = SensorState.fresh(n + PRESSURE)
        self.draws = Draws(self._seed, n + PRESSURE)
        self._e_stop_reason = ''
        self._look_at_faults()
        self._read()

    @property
    def readings(self) -> Readings:
        """The latest sample of the sensors."""
        return self._readings

    @property
    def truth(self) -> Readings:
        """True values: readings of ideal sensors now."""
        motion = self.state.motion
        return self._as_readings(self._true(), motion.strain_rate)

    @property
    def air(self) -> AirBalance:
        """Air balance since the start."""
        return self.state.air.balance

    @property
    def air_mass(self) -> float:
        """Air drawn by the valves from the supply since the start, kg."""
        return self.state.air.balance.delivered

    @property
    def work(self) -> float:
        """Work done on the load since the start, J."""
        return self.state.work

    @property
    def e_stopped(self) -> str:
        """Reason of the stop; empty while the rig runs."""
        state = self.state
        if state.reason == OVER_PRESSURE:
            return (f'{self.bundle.names[state.tripped_unit]} at '
                    f'{state.tripped_pressure / 1e3:.0f} kPa, above the trip of '
                    f'{self.config.trip_pressure / 1e3:.0f} kPa')
        return self._e_stop_reason if state.reason == E_STOP else ''

    def step(self, valve_commands: Sequence[float], duration: float) -> Readings:
        """
        Advance by ``duration`` seconds with the valve commands held.

        Parameters
        ----------
        valve_commands : sequence of float, shape (n,)
            -1 exhaust .. 0 closed .. +1 fill; clipped. Not used while the rig is stopped.
        duration : float, s

        Raises
        ------
        InputError
            For a wrong number of commands, a command that is not finite, a duration that is not
            positive, or a fault of a motor unit that does not exist.
        """
        commands = self._checked(valve_commands)
        if not 0.0 < duration < math.inf:
            raise InputError(f'duration is {duration!r} s; expected a positive number')
        self._look_at_faults()
        rig_step(self.record, self._load, self.model, self.state, commands, self._broken,
                 duration)
        for unit, position in self.faults.stuck_valve.items():
            if position is None:
                self.faults.stuck_valve[unit] = self._broken.stuck[unit]
        self._read()
        return self._readings

    def impose_strain(self, strain: float, rate: float | None = None) -> None:
        """
        Move the dynamometer to a strain at a strain rate, 1/s (by default `Dynamometer.speed`).

        Raises
        ------
        InputError
            When the load is not a dynamometer or the strain is out of its range.
        """
        if not isinstance(self.load, Dynamometer):
            raise InputError(f'the load is a {type(self.load).__name__}; '
                             'only a Dynamometer imposes a strain')
        self.load.impose(self.state.motion, strain, rate)

    def change_load(self, **changes: float) -> None:
        """
        Change the load during motion (load step), for example ``change_load(mass=8.0)``.

        Raises
        ------
        InputError
            When the load has no such parameter or its value is out of range.
        """
        self.load = changed_load(self.load, changes)
        self._load = self.load.record

    def change_bundle(self, bundle: Any) -> None:
        """
        Exchange the bundle: strain, pressures, load and noise are kept.

        The memory of the effects is reset.

        Raises
        ------
        InputError
            When the bundle has another number of motor units or another rest length.
        """
        if (bundle.n, float(bundle.length)) != (self.bundle.n, self.length):
            raise InputError(f'{bundle.n} motor units of {1e3 * float(bundle.length):g} mm; the '
                             f'rig has {self.bundle.n} of {1e3 * self.length:g} mm')
        self.bundle, self._known = bundle, None
        self._describe()
        self.model = bundle.model(False)
        begin(self.record, self.model, self.state)

    def tare(self) -> None:
        """Zero the force reading at the present force, without noise."""
        sensors = self.sensors
        self.shown.tare = (sensors.gain[FORCE] * self.state.force + sensors.offset[FORCE]
                           + sensors.drift[FORCE] * self.state.time + sensors.bias[FORCE])

    def open_supply(self, open_: bool) -> None:
        """Open the supply, or shut it off and dump it; it stays shut while the rig is stopped."""
        self.state.air.dumping = not open_ or self.state.reason != RUNNING

    def e_stop(self, reason: str = 'emergency stop') -> None:
        """Shut off and dump the supply, and switch all valves to exhaust until `e_stop_reset`."""
        if self.state.reason == RUNNING:
            self.state.reason, self._e_stop_reason = E_STOP, reason
        self.state.air.dumping = True

    def e_stop_reset(self) -> bool:
        """
        Run again after an emergency stop.

        Returns
        -------
        bool
            False (still stopped) while a chamber is above the trip pressure.
        """
        if max(self.state.gauge) > self.config.trip_pressure:
            return False
        self.state.reason, self.state.air.dumping = RUNNING, False
        return True

    def _look_at_faults(self) -> None:
        """Update the record of the faults if they have changed."""
        if self._known != self.faults:
            self._known = copy.deepcopy(self.faults)
            self._broken = fault_record(self.faults, self.bundle.pneumatics.leak_rate,
                                        self.bundle.n)

    def _true(self) -> list[float]:
        """Return the true value of every channel."""
        true = [0.0] * (self.bundle.n + PRESSURE)
        true_channels(self.record, self.state, true)
        return true

    def _read(self) -> None:
        read_sensors(self.sensors, self.shown, self._true(), self.state.time, self._broken,
                     *self.draws.row())
        self._readings = self._as_readings(self.shown.shown, self.shown.strain_rate)

    def _as_readings(self, channels, strain_rate) -> Readings:
        return Readings(self.state.time, channels[FORCE], channels[STRAIN],
                        channels[STRAIN] * self.length, strain_rate,
                        np.array(channels[PRESSURE:]), channels[SUPPLY])

    def _checked(self, commands: Sequence[float]) -> list[float]:
        values = [float(c) for c in commands]
        if len(values) != self.bundle.n:
            raise InputError(f'{len(values)} valve commands; expected one for each of the '
                             f'{self.bundle.n} motor units')
        for i, value in enumerate(values):
            if not math.isfinite(value):
                raise InputError(f'valve command {i + 1} is {value}; expected -1 to 1')
        return values


def changed_load(load: Load, changes: dict[str, float]) -> Load:
    """Return a load with changed parameters; InputError for an unknown name."""
    try:
        return replace(load, **changes)  # type: ignore[type-var]
    except TypeError as error:
        raise InputError(f'{type(load).__name__} cannot change '
                         f"{', '.join(changes)}") from error
