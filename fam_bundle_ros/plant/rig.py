# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated rig: bundle, valves, supply, load and sensors, integrated with a fixed step.

Per internal step: the load moves at its present speed, the air moves (with sub-steps of its own)
while the gas volumes change, the bundle gives its force at the new strain and pressures (its
memory advances by one step), and the force accelerates the load. Where the force depends on the
rate, the new rate is found implicitly: dry friction is far too stiff for an explicit step.
Deterministic: the same seed and the same calls give the same bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.model.pneumatics import ATMOSPHERE
from fam_bundle_ros.plant.checks import require
from fam_bundle_ros.plant.circuit import AirBalance, Circuit
from fam_bundle_ros.plant.loads import Dynamometer, Load, Motion
from fam_bundle_ros.plant.pneumatics import ChamberConfig, ValveConfig
from fam_bundle_ros.plant.sensors import Readings, SensorConfig, SensorFaults, Sensors
from fam_bundle_ros.plant.supply import SupplyConfig

#: 1/s: how exactly the strain rate is solved for where the force depends on it.
_RATE_TOLERANCE = 1e-5
#: Strains over which gas volumes are tabulated; beyond them the volume stays as at the end.
_STRAIN_RANGE = (-0.16, 0.52)
_STRAIN_INTERVALS = 4080


@dataclass(frozen=True)
class RigConfig:
    """
    Everything about a simulated rig but the bundle.

    Parameters
    ----------
    load : Load
    valve : ValveConfig
        One kind for all motor units.
    chamber : ChamberConfig
    supply : SupplyConfig
    sensors : SensorConfig
    step : float, s
        Longest internal step.
    ambient_pressure : float, Pa (absolute)
    trip_pressure : float, Pa (gauge)
        A chamber above it stops the rig.
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


@dataclass
class Faults(SensorFaults):
    """What is broken at the moment; change it at any time. Motor units count from 0."""

    #: Spool position (-1..1) of valves that no longer move; None: where it is now.
    stuck_valve: dict[int, float | None] = field(default_factory=dict)
    #: Time constant in s with which a chamber's gauge pressure leaks away.
    leak: dict[int, float] = field(default_factory=dict)

    def clear(self) -> None:
        """Repair everything."""
        self.__dict__.update(Faults().__dict__)


class Rig:
    """
    A bundle on a simulated rig.

    Parameters
    ----------
    bundle : Bundle
        Every effect that it names acts here: the muscles' in the force, `leak` and
        `supply_droop` in the air, sensor effects in the readings.
    config : RigConfig
    seed : int
        Of the sensors' noise.

    Attributes
    ----------
    faults : Faults
    load : Load
    length : float
        Rest length of the bundle, m.
    work : float
        Done on the load so far, J.
    e_stopped : str
        Why the rig was stopped; empty while it runs.

    Examples
    --------
    >>> from fam_bundle_ros.model import load_model
    >>> from fam_bundle_ros.resources import config_path
    >>> rig = Rig(load_model(config_path('models/spie2021.yaml')), seed=1)
    >>> readings = rig.step([0.5, -1.0], 0.02)
    >>> bool(readings.pressure[0] > 1e5)
    True
    """

    def __init__(self, bundle: Bundle, config: RigConfig = RigConfig(), seed: int = 0):
        self.bundle = bundle
        self.config = config
        self.faults = Faults()
        self.length = float(bundle.motor_units[0].geometry.length)
        self._leak_rate = bundle.pneumatics.leak_rate
        self._volumes = self._tabulate_volumes()
        self._circuit = Circuit(bundle.n, config.valve, config.chamber, config.supply,
                                config.ambient_pressure,
                                bundle.pneumatics.supply_resistance)
        self._sensors = Sensors(config.sensors, bundle.n, seed)
        self._rate_matters = self._depends_on_rate()
        self.reset()

    def reset(self) -> None:
        """Return to the start: at rest, vented, seed as new, not stopped. Faults stay."""
        self.load = self.config.load
        self.work = 0.0
        self.e_stopped = ''
        self._time = 0.0
        self._gap_slope = -1.0
        self._motion: Motion = self.load.start(self.length)
        self._circuit.reset()
        self._sensors.reset()
        self._memory: Any = self.bundle.start_state()
        self._volume = self._volume_at(self._motion[0])
        self._force = float(np.sum(self.bundle.unit_forces(self._motion[0], self._gauge())))
        self._readings = self._read()

    @property
    def readings(self) -> Readings:
        """The latest sample of the sensors."""
        return self._readings

    @property
    def truth(self) -> Readings:
        """What perfect sensors would show now."""
        ambient = self.config.ambient_pressure
        strain, rate = self._motion[:2]
        return Readings(self._time, self._force, strain, strain * self.length, rate,
                        np.array([p - ambient for p in self._circuit.pressure]),
                        self._circuit.manifold - ambient)

    @property
    def air(self) -> AirBalance:
        """Where the air went so far."""
        return self._circuit.balance

    @property
    def air_mass(self) -> float:
        """Air that the valves have taken from the supply so far, kg."""
        return self._circuit.balance.delivered

    def step(self, valve_commands: Sequence[float], duration: float) -> Readings:
        """
        Advance the rig with the valve commands held, and read the sensors once at the end.

        Parameters
        ----------
        valve_commands : sequence of float, shape (n,)
            -1 exhaust, 0 closed, 1 fill; sizes above 1 count as 1.
        duration : float, s
            Divided into equal internal steps no longer than `RigConfig.step`.

        Raises
        ------
        InputError
            For a wrong number of commands, a command that is not finite, a duration that is not
            positive, or a fault of a motor unit that is not there.
        """
        commands = self._checked(valve_commands)
        if not 0.0 < duration < math.inf:
            raise InputError(f'duration is {duration!r} s; expected a positive number')
        leaks, stuck = self._apply_faults()
        count = max(1, math.ceil(duration / self.config.step - 1e-9))
        dt = duration / count
        for _ in range(count):
            self._advance(dt, commands, leaks, stuck)
        self._time += duration
        self._readings = self._read()
        return self._readings

    def impose_strain(self, strain: float, rate: float | None = None) -> None:
        """
        Let the dynamometer go to a strain at a strain rate (its own largest by default).

        Raises
        ------
        InputError
            When the load is not a dynamometer or cannot go there.
        """
        if not isinstance(self.load, Dynamometer):
            raise InputError(f'the load is a {type(self.load).__name__}; '
                             'only a Dynamometer imposes a strain')
        self._motion = self.load.impose(self._motion, strain, rate)

    def change_load(self, **changes: float) -> None:
        """
        Change the load in motion, for example ``change_load(mass=8.0)``: a load step.

        Raises
        ------
        InputError
            When the load has no such value or it is out of range.
        """
        try:
            self.load = replace(self.load, **changes)  # type: ignore[type-var]
        except TypeError as error:
            raise InputError(f'{type(self.load).__name__} cannot change '
                             f"{', '.join(changes)}") from error

    def tare(self) -> None:
        """Zero the force reading at the present force (as the mean of many samples would)."""
        self._sensors.tare = self._shown().force + self.config.sensors.force_bias

    def e_stop(self, reason: str = 'emergency stop') -> None:
        """Shut off and dump the supply, switch all valves to exhaust, and stay so."""
        if not self.e_stopped:
            self.e_stopped = reason
        self._circuit.dumping = True

    def e_stop_reset(self) -> bool:
        """
        Run again after an emergency stop.

        Returns
        -------
        bool
            False, and still stopped, while a chamber is above the trip pressure.
        """
        if max(self._gauge()) > self.config.trip_pressure:
            return False
        self.e_stopped = ''
        self._circuit.dumping = False
        return True

    def _advance(self, dt: float, commands: list[float], leaks: list[float],
                 stuck: dict[int, float]) -> None:
        before, force_before = self._motion[0], self._force
        moved = self.load.drift(self._motion, dt, self.length)
        volume = self._volume_at(moved[0])
        if self.e_stopped:
            commands = [-1.0] * len(commands)
        if stuck:
            commands = [stuck.get(i, command) for i, command in enumerate(commands)]
        self._circuit.advance(dt, commands, self._volume, volume, leaks)
        self._volume = volume
        gauge = self._gauge()
        self._motion, self._force, self._memory = self._accelerate(moved, dt, np.array(gauge))
        self.work += (0.5 * (force_before + self._force) * (self._motion[0] - before)
                      * self.length)
        if not self.e_stopped and max(gauge) > self.config.trip_pressure:
            unit = gauge.index(max(gauge))
            self.e_stop(f'{self.bundle.motor_units[unit].name} at {max(gauge) / 1e3:.0f} kPa, '
                        f'above the trip of {self.config.trip_pressure / 1e3:.0f} kPa')

    def _accelerate(self, moved: Motion, dt: float, gauge: np.ndarray,
                    ) -> tuple[Motion, float, Any]:
        """
        Return motion, force and memory after the force has acted for ``dt``.

        Solves rate = kick(force(rate)): one evaluation where the force knows no rate, else
        secants on the gap between the two, which falls with the rate for any force that
        dissipates; between a sign change they are those of the Illinois rule. The slope of the
        step before gives the first one.
        """
        def attempt(rate):
            forces, memory = self.bundle.step(self._memory, dt, moved[0], gauge, rate)
            force = float(np.add.reduce(forces))
            motion = self.load.kick(moved, dt, force, self.length)
            return motion[1] - rate, (motion, force, memory)

        low = moved[1]
        gap_low, result = attempt(low)
        if not self._rate_matters or abs(gap_low) <= _RATE_TOLERANCE:
            return result
        high = low - gap_low / self._gap_slope
        gap_high, result = attempt(high)
        for _ in range(30):
            if abs(gap_high) <= _RATE_TOLERANCE:
                break
            self._gap_slope = min((gap_high - gap_low) / (high - low), -1.0)
            rate = high - gap_high / self._gap_slope
            gap, result = attempt(rate)
            if gap * gap_high < 0.0:
                low, gap_low = high, gap_high
            elif gap_low * gap_high < 0.0:
                gap_low *= 0.5
            else:
                low, gap_low = high, gap_high
            high, gap_high = rate, gap
        return result

    def _gauge(self) -> list[float]:
        """Return gauge pressures as the muscles feel them: none is sucked below ambient."""
        ambient = self.config.ambient_pressure
        return [max(p - ambient, 0.0) for p in self._circuit.pressure]

    def _shown(self) -> Readings:
        """Return the truth with the sensor effects of the model file in it."""
        truth = self.truth
        if not self.bundle.sensors:
            return truth
        force, strain, pressure = self.bundle.readings(
            truth.force, truth.strain, truth.pressure)
        return replace(truth, force=float(force), strain=float(strain),
                       contraction=float(strain) * self.length, pressure=pressure)

    def _read(self) -> Readings:
        return self._sensors.read(self._shown(), self.length, self.faults)

    def _checked(self, commands: Sequence[float]) -> list[float]:
        values = [float(c) for c in commands]
        if len(values) != self.bundle.n:
            raise InputError(f'{len(values)} valve commands; expected one for each of the '
                             f'{self.bundle.n} motor units')
        for i, value in enumerate(values):
            if not math.isfinite(value):
                raise InputError(f'valve command {i + 1} is {value}; expected -1 to 1')
        return [min(max(value, -1.0), 1.0) for value in values]

    def _apply_faults(self) -> tuple[list[float], dict[int, float]]:
        """Return leak rates per chamber and positions of stuck valves."""
        for unit in (*self.faults.leak, *self.faults.stuck_valve):
            if not 0 <= unit < self.bundle.n:
                raise InputError(f'fault of motor unit {unit}; there are 0 to '
                                 f'{self.bundle.n - 1}')
        leaks = [self._leak_rate] * self.bundle.n
        for unit, time_constant in self.faults.leak.items():
            leaks[unit] += 1.0 / time_constant
        stuck = {}
        for unit, position in self.faults.stuck_valve.items():
            if position is None:
                position = self.faults.stuck_valve[unit] = self._circuit.spool[unit]
            stuck[unit] = position
        return leaks, stuck

    def _tabulate_volumes(self) -> list[list[float]]:
        """Return gas volumes with tubing on an even grid of strains: quicker than the formula."""
        grid = np.linspace(*_STRAIN_RANGE, _STRAIN_INTERVALS + 1)
        volume = np.asarray(self.bundle.gas_volume(grid), dtype=float)
        return (np.maximum(volume, 0.0) + self.config.chamber.tube_volume).tolist()

    def _volume_at(self, strain: float) -> list[float]:
        low, high = _STRAIN_RANGE
        place = (strain - low) / (high - low) * _STRAIN_INTERVALS
        k = min(max(int(place), 0), _STRAIN_INTERVALS - 1)
        share = min(max(place - k, 0.0), 1.0)
        return [a + share * (b - a)
                for a, b in zip(self._volumes[k], self._volumes[k + 1], strict=True)]

    def _depends_on_rate(self) -> bool:
        """Return whether the bundle's force changes with the strain rate."""
        pressure = 0.5 * np.asarray(self.bundle.max_pressure, dtype=float)
        slow, fast = (self.bundle.step(self.bundle.start_state(), self.config.step, 0.1,
                                       pressure, rate)[0] for rate in (-0.05, 0.05))
        return not np.array_equal(slow, fast)
