# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A bundle: motor units in parallel that share the strain, their forces add.

Pressures are gauge, Pa, with the motor units on the last axis; strains are positive when shorter.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import geometry as geo
from fam_bundle_ros.model.effects import catalogue
from fam_bundle_ros.model.effects.base import Effect, Place, Sample, SensorError
from fam_bundle_ros.model.geometry import Geometry
from fam_bundle_ros.model.muscle import Muscle
from fam_bundle_ros.model.parts import Motion, MotorUnit, Overlap

#: Rest lengths within 2 % are equal but for how they were measured.
_EQUAL_LENGTHS = 1.02


class Bundle:
    """
    Motor units in their order of recruitment, and the effects that act in every muscle of them.

    Parameters
    ----------
    name : str
    motor_units : sequence of MotorUnit
    effects : sequence of Effect
        Each name once.
    error : float, N
        Root mean square error of the model on the data it was fitted to; 0 when not known.
    notes : mapping
        What else a model file says (provenance); kept, not used.

    Raises
    ------
    InputError
        When there is no motor unit, two effects or two units share a name, or rest lengths
        differ.
    """

    def __init__(self, name, motor_units, effects, error: float = 0.0,
                 notes: Mapping[str, Any] | None = None):
        self.name = name
        self.motor_units: tuple[MotorUnit, ...] = tuple(motor_units)
        self.effects: tuple[Effect, ...] = tuple(effects)
        self.error = error
        self.notes = dict(notes or {})
        if not self.motor_units:
            raise InputError(f'{name}: a bundle needs at least one motor unit')
        for what, items in (('motor unit', self.motor_units), ('effect', self.effects)):
            names = [item.name for item in items]
            double = {item for item in names if names.count(item) > 1}
            if double:
                raise InputError(f'{name}: {what} {", ".join(sorted(double))} is named twice')
        lengths = [unit.geometry.length for unit in self.motor_units]
        if max(lengths) > _EQUAL_LENGTHS * min(lengths):
            raise InputError(
                f'{name}: rest lengths from {1e3 * min(lengths):.1f} to '
                f'{1e3 * max(lengths):.1f} mm; muscles in parallel contract by the same way, and '
                'the model has one strain for all of them: expected one length')
        self._muscle = Muscle(self.effects)
        self.geometry = Geometry.stack([unit.geometry for unit in self.motor_units])
        self._count = np.array([float(unit.muscles) for unit in self.motor_units])
        #: Highest gauge pressure of each motor unit, Pa, shape (n,).
        self.max_pressure = np.array([unit.max_pressure for unit in self.motor_units])

    def __repr__(self):
        units = ', '.join(f'{u.name}: {u.muscles}' for u in self.motor_units)
        return f'Bundle({self.name}; {units}; {", ".join(e.name for e in self.effects)})'

    @property
    def n(self) -> int:
        """Number of motor units."""
        return len(self.motor_units)

    @property
    def unusual_order(self) -> str:
        """Say which unit is recruited before a smaller one (muscles times area); else empty."""
        size = [unit.muscles * unit.geometry.radius ** 2 for unit in self.motor_units]
        for i in range(1, self.n):
            if size[i] < 0.99 * size[i - 1]:
                return (f'{self.motor_units[i - 1].name} is larger than '
                        f'{self.motor_units[i].name} and is recruited before it, as the model '
                        'file lists them; smallest first is usual')
        return ''

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on what was before."""
        return self._muscle.memory

    @property
    def pneumatics(self) -> tuple[Effect, ...]:
        """Effects of the air supply, which a plant integrates."""
        return self._muscle.at(Place.PNEUMATICS)

    @property
    def sensors(self) -> tuple[Effect, ...]:
        """Effects of the gauges, which belong to the comparison with data."""
        return self._muscle.at(Place.SENSOR)

    # --- force ---------------------------------------------------------------------------------

    def unit_forces(self, strain: ArrayLike, pressure: ArrayLike, strain_rate: ArrayLike = 0.0
                    ) -> np.ndarray:
        """
        Return the tension of each motor unit at equilibrium, N.

        Parameters
        ----------
        strain : array_like (...)
        pressure : array_like (..., n), Pa (gauge)
        strain_rate : array_like (...), 1/s
            Losses without memory (friction, damping) act at this rate.

        Returns
        -------
        array (..., n)
        """
        force, _ = self._muscle.force(self._sample(strain, pressure, strain_rate))
        return self._count * force

    def force(self, strain: ArrayLike, pressure: ArrayLike, strain_rate: ArrayLike = 0.0
              ) -> np.ndarray:
        """Return the tension of the whole bundle, N, shape (...); see `unit_forces`."""
        return self.unit_forces(strain, pressure, strain_rate).sum(axis=-1)

    def start_state(self) -> dict[str, Any]:
        """Return the memory of a bundle at the first sample of a trial."""
        return {'effects': {}, 'time': 0.0, 'begun': False}

    def step(self, state: dict[str, Any], dt: float, strain: float, pressure: ArrayLike,
             strain_rate: float = 0.0) -> tuple[np.ndarray, dict[str, Any]]:
        """
        Advance one tick: the same effects as `simulate`, sample by sample.

        Parameters
        ----------
        state : dict
            From `start_state` or from the step before; it is not changed.
        dt : float, s
            Time since the last step (not used at the first one).
        strain, strain_rate : float, and 1/s
        pressure : array_like (n,) or (k, n), Pa (gauge)
            With (k, n): k candidates for this tick, all from the same memory; the state that
            comes back is then of no use.

        Returns
        -------
        unit_forces : array (n,) or (k, n), N
        state : dict
        """
        self._check_width(pressure)
        pressure = np.asarray(pressure, float)[None]
        time = state['time'] + dt if state['begun'] else 0.0
        x = Sample(np.array([[strain]]), pressure, np.array([[strain_rate]]), self.geometry,
                   dt=np.array([[dt]]), start=np.array([[not state['begun']]]), time=time)
        force, after = self._muscle.force(x, state['effects'])
        forces = np.broadcast_to(self._count * force, pressure.shape)[0]
        return forces, {'effects': after, 'time': time, 'begun': True}

    def simulate(self, motion: Motion) -> np.ndarray:
        """
        Return the tension of each motor unit over a record, N, shape (T, n).

        Memory begins afresh where ``motion.start`` says so. Without time the static forces.
        """
        if motion.time is None:
            return self.unit_forces(motion.strain, motion.pressure, motion.strain_rate)
        if not self.has_memory:
            x = self._sample(motion.strain, motion.pressure, motion.strain_rate)
        else:
            start = motion.start if motion.start is not None else np.arange(
                len(motion.time)) == 0
            dt = np.diff(motion.time, prepend=motion.time[0])
            x = self._sample(motion.strain, motion.pressure, motion.strain_rate)
            x.dt = np.where(start, 0.0, dt)[:, None]
            x.start = start[:, None]
        x.time = (motion.time - motion.time[0])[:, None]
        force, _ = self._muscle.force(x, {})
        return self._count * np.broadcast_to(force, motion.pressure.shape)

    def _sample(self, strain, pressure, strain_rate):
        self._check_width(pressure)
        return Sample(np.asarray(strain, float)[..., None], np.asarray(pressure, float),
                      np.asarray(strain_rate, float)[..., None], self.geometry)

    def _check_width(self, pressure):
        if np.shape(pressure)[-1:] != (self.n,):
            raise InputError(f'{self.name}: pressure has shape {np.shape(pressure)}; expected '
                             f'{self.n} motor units on the last axis')

    # --- gauges --------------------------------------------------------------------------------

    @cached_property
    def sensor_error(self) -> SensorError:
        """How the gauges of this model differ from the truth."""
        return self._muscle.sensor_error()

    def readings(self, force, strain, pressure):
        """Return what the gauges show for a true force, strain and pressure."""
        s = self.sensor_error
        return (force * (1.0 + s.force_gain) + s.force_bias, strain + s.strain_bias,
                pressure * (1.0 + s.pressure_gain) + s.pressure_bias)

    def predict(self, motion: Motion) -> np.ndarray:
        """
        Return the force that the load cell would show over a record of readings, N, shape (T,).

        Strain and pressure of ``motion`` are readings: they are corrected by the model's sensor
        effects before the muscles feel them. This is what is compared with a measurement.
        """
        if not self.sensors:
            return self.simulate(motion).sum(axis=-1)
        s = self.sensor_error
        felt = replace(motion, strain=motion.strain - s.strain_bias,
                       pressure=(motion.pressure - s.pressure_bias) / (1.0 + s.pressure_gain))
        return self.simulate(felt).sum(axis=-1) * (1.0 + s.force_gain) + s.force_bias

    # --- gas -----------------------------------------------------------------------------------

    def gas_volume(self, strain: ArrayLike) -> np.ndarray:
        """Return the gas volume of each motor unit without tubes, m^3, shape (..., n)."""
        strain = np.asarray(strain, float)[..., None]
        return self._count * (geo.volume(self.geometry, strain) - self.geometry.bladder_volume)

    def gas_volume_slope(self, strain: ArrayLike) -> np.ndarray:
        """Return dV/de of each motor unit, m^3, shape (..., n)."""
        return self._count * geo.volume_slope(self.geometry,
                                              np.asarray(strain, float)[..., None])

    # --- other models --------------------------------------------------------------------------

    def effect(self, name: str) -> Effect:
        """Return an effect of this model by name; InputError when it has none."""
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise InputError(f"{self.name}: has no effect '{name}'; it has "
                         f"{', '.join(e.name for e in self.effects)}")

    def with_effect(self, effect, **values: float) -> 'Bundle':
        """
        Return a bundle with one more effect: an Effect, or the name of one and its SI values.

        An effect of that name that is already there is replaced.
        """
        if isinstance(effect, str):
            effect = catalogue.get(effect)(**values)
        kept = [e for e in self.effects if e.name != effect.name]
        return self._with(effects=[*kept, effect])

    def without_effect(self, name: str) -> 'Bundle':
        """Return a bundle without an effect; InputError when it has none of that name."""
        self.effect(name)
        return self._with(effects=[e for e in self.effects if e.name != name])

    def with_parameters(self, values: Mapping[str, float]) -> 'Bundle':
        """
        Return a bundle with other parameter values (SI).

        Parameters
        ----------
        values : mapping
            Keys ``effect.parameter``, or ``geometry.radius`` (also length, wall_thickness,
            braid_angle): the value for the first motor unit; the others keep their ratio to it
            (the braid angle: their difference).
        """
        changes: dict[str, dict[str, float]] = {}
        for key, value in values.items():
            owner, _, name = key.partition('.')
            changes.setdefault(owner, {})[name] = float(value)
        dimensions = changes.pop('geometry', {})
        for owner, new in changes.items():
            for name in new:
                self.effect(owner).parameter(name)
        effects = [e.replace(**changes[e.name]) if e.name in changes else e
                   for e in self.effects]
        units = self.motor_units
        if dimensions:
            units = tuple(replace(unit, geometry=self._resized(unit.geometry, dimensions))
                          for unit in units)
        return Bundle(self.name, units, effects, self.error, self.notes)

    def _resized(self, geometry, dimensions):
        first = self.motor_units[0].geometry
        new = {}
        for name, value in dimensions.items():
            if name not in ('radius', 'length', 'braid_angle', 'wall_thickness'):
                raise InputError(f"geometry has no dimension '{name}'")
            own, reference = getattr(geometry, name), getattr(first, name)
            new[name] = own - reference + value if name == 'braid_angle' \
                else own * value / reference
        values = {name: new.get(name, getattr(geometry, name))
                  for name in ('radius', 'length', 'braid_angle', 'wall_thickness')}
        return Geometry(**values)

    def _with(self, **changes) -> 'Bundle':
        parts = {'name': self.name, 'motor_units': self.motor_units, 'effects': self.effects,
                 'error': self.error, 'notes': self.notes, **changes}
        return Bundle(**parts)

    def named(self, name: str, error: float | None = None,
              notes: Mapping[str, Any] | None = None) -> 'Bundle':
        """Return the same model under another name, with its error and notes."""
        return self._with(name=name, error=self.error if error is None else error,
                          notes=self.notes if notes is None else notes)

    # --- what the bundle can do ----------------------------------------------------------------

    def free_strain(self, pressure: ArrayLike, highest: float = 0.45) -> np.ndarray:
        """
        Return the strain at which the bundle's force first falls to zero, shape (...).

        ``pressure`` has shape (..., n). NaN where the force is still positive at ``highest``.
        """
        pressure = np.asarray(pressure, float)
        grid = np.linspace(-0.02, highest, 471)
        force = self.force(grid, pressure[..., None, :])
        fallen = force <= 1e-9
        index = np.argmax(fallen, axis=-1)
        low = grid[np.maximum(index - 1, 0)]
        high = grid[index]
        for _ in range(30):
            middle = 0.5 * (low + high)
            positive = self.force(middle, pressure) > 1e-9
            low, high = np.where(positive, middle, low), np.where(positive, high, middle)
        return np.where(fallen.any(axis=-1), 0.5 * (low + high), np.nan)

    def blocked_force(self, pressure: ArrayLike) -> np.ndarray:
        """Return the force at zero strain, N, shape (...); ``pressure`` has shape (..., n)."""
        return self.force(0.0, pressure)

    def state_pressures(self, state: int, last: ArrayLike) -> np.ndarray:
        """
        Return pressures (..., n) of recruitment state RSk in orderly recruitment.

        Motor units before the k-th are at their maximum, those after it at zero, the k-th at
        ``last`` (...), Pa.
        """
        last = np.asarray(last, float)
        pressure = np.zeros(last.shape + (self.n,))
        pressure[..., :state - 1] = self.max_pressure[:state - 1]
        pressure[..., state - 1] = last
        return pressure

    def overlap(self, strain: float, state: int, points: int = 257) -> Overlap:
        """
        Return the forces that RSk and RSk+1 can both give at a strain.

        Parameters
        ----------
        strain : float
        state : int
            k, from 1 to n - 1.
        points : int
            Pressures of motor unit k + 1 that are tried before the onset is refined.

        Returns
        -------
        Overlap
        """
        if not 1 <= state < self.n:
            raise InputError(f'overlap needs a recruitment state from 1 to {self.n - 1}, '
                             f'not {state}')
        last = np.linspace(0.0, self.max_pressure[state], points)
        force = self.force(strain, self.state_pressures(state + 1, last))
        full, lowest = float(force[0]), int(np.argmin(force))
        lower_state = self.force(strain, self.state_pressures(
            state, np.linspace(0.0, self.max_pressure[state - 1], points)))
        onset = self.onset_pressure(strain, state + 1)
        return Overlap(low=max(float(force[lowest]), float(lower_state.min())), high=full,
                       dip=full - float(force[lowest]), dip_pressure=float(last[lowest]),
                       onset_pressure=onset)

    def onset_pressure(self, strain: float, unit: int, points: int = 257) -> float:
        """
        Return the pressure at which motor unit ``unit`` (from 1) is back at its force for zero.

        Past it the unit helps the bundle; before it the unit pushes back more than when it is
        off. 0 where it helps at once, NaN where it never does within its maximum pressure.
        """
        index = unit - 1

        def gain(pressure):
            pressures = np.zeros(np.shape(pressure) + (self.n,))
            pressures[..., index] = pressure
            forces = self.unit_forces(strain, pressures)[..., index]
            return forces - self.unit_forces(strain, np.zeros(self.n))[index]

        grid = np.linspace(0.0, self.max_pressure[index], points)
        below = np.flatnonzero(gain(grid[1:]) <= 1e-9)
        if len(below) == 0:
            return 0.0
        if below[-1] + 2 >= points:
            return float('nan')
        low, high = grid[below[-1] + 1], grid[below[-1] + 2]
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if gain(middle) > 0.0 else (middle, high)
        return float(0.5 * (low + high))
