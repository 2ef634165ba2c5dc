# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A bundle: motor units in parallel, with one common strain; their forces are added.

Pressures are gauge, Pa, with the motor units on the last axis; strains are positive when shorter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import catalogue, reach
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.geometry import DIMENSIONS, Geometry
from fam_bundle_ros.model.laws.base import Place
from fam_bundle_ros.model.muscles import Muscles
from fam_bundle_ros.model.parts import Motion, MotorUnit, Pneumatics, SensorError
from fam_bundle_ros.model.rows import differences, reading
from fam_bundle_ros.model.seam import Model

#: Rest lengths within 2 % count as equal: the error of their measurement.
_EQUAL_LENGTHS = 1.02


class Bundle:
    """
    Motor units in their order of recruitment, and the effects that act in all their muscles.

    Parameters
    ----------
    name : str
    motor_units : sequence of MotorUnit
    effects : sequence of Effect
        With different names.
    error : float, N
        Root mean square error of the model on the data it was fitted to (with a
        `discrepancy_surface`, on data left out); 0 if not known.
    notes : mapping
        Further entries of a model file (provenance); kept, not used.

    Raises
    ------
    InputError
        Without a motor unit, if two effects or two units have the same name, or if rest lengths
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
                f'{1e3 * max(lengths):.1f} mm; muscles in parallel contract by the same distance, '
                'and the model has one strain for all of them: expected one length')
        self._muscles = Muscles(self.motor_units, self.effects)
        #: Highest gauge pressure of each motor unit, Pa, shape (n,).
        self.max_pressure = np.array([unit.max_pressure for unit in self.motor_units])
        #: Rest length of the first motor unit, m.
        self.length = float(lengths[0])
        self.names = tuple(unit.name for unit in self.motor_units)

    def __reduce__(self):
        return Bundle, (self.name, self.motor_units, self.effects, self.error, self.notes)

    def __repr__(self):
        units = ', '.join(f'{u.name}: {u.muscles}' for u in self.motor_units)
        return f'Bundle({self.name}; {units}; {", ".join(e.name for e in self.effects)})'

    def _repr_html_(self) -> str:
        from fam_bundle_ros.model.own_muscle import muscle_words
        rows = ''.join(f'<tr><td>{escape(each)}</td></tr>' for each in map(repr, self.effects))
        return f'<p>{escape(muscle_words(self))}</p><table>{rows}</table>'

    @property
    def n(self) -> int:
        """Number of motor units."""
        return len(self.motor_units)

    @property
    def geometry(self) -> Geometry:
        """Geometry of the motor units, with fields of shape (n,)."""
        return self._muscles.geometry

    @property
    def unusual_order(self) -> str:
        """Warning if a unit is recruited before a smaller one (muscles times area), else empty."""
        size = [unit.muscles * unit.geometry.radius ** 2 for unit in self.motor_units]
        for i in range(1, self.n):
            if size[i] < 0.99 * size[i - 1]:
                return (f'{self.motor_units[i - 1].name} is larger than '
                        f'{self.motor_units[i].name} and is recruited before it, as the model '
                        'file lists them; smallest first is usual')
        return ''

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on earlier samples."""
        return self._muscles.laws.has_memory

    @property
    def path_memory(self) -> tuple[int, ...]:
        """Number of each field of the memory that is of the path alone (`Law.remembers_path`)."""
        kinds = {effect.law.name: effect.law for effect in self.effects}
        return tuple(k for k, (name, _) in enumerate(self._muscles.laws.memory)
                     if kinds[name].remembers_path)

    @property
    def sensors(self) -> tuple[Effect, ...]:
        """Sensor effects, which are used only for the comparison with data."""
        return tuple(effect for effect in self.effects if effect.place is Place.SENSOR)

    @cached_property
    def pneumatics(self) -> Pneumatics:
        """Leak rate and supply resistance, for the plant."""
        total = {'leak_rate': 0.0, 'supply_resistance': 0.0}
        for _, law, part in self._muscles.laws.at(Place.PNEUMATICS):
            total[part.changes] += part.function(**self._arguments(law))
        return Pneumatics(**total)

    def _arguments(self, law):
        """Return the parameter values of a law by argument name of its function."""
        values = self.effect(law.name).values
        return {argument: values[name] for argument, name in law.names.items()}

    def model(self, compiled: bool = False) -> Model:
        """
        Return this model for a control loop, with its memory reset.

        Raises
        ------
        fam_bundle_ros.kernels.NotCompiled
            If ``compiled`` is True but numba is not installed or cannot compile a user's effect;
            the plain model still works.
        """
        return self._muscles.model(compiled)

    @property
    def curve(self) -> Any:
        """
        Force over pressure as a C function, with the signature `fam_bundle_ros.model.seam.CURVE`.

        Raises `NotCompiled` as `model` does.
        """
        return self._muscles.laws.curve

    # --- force ---------------------------------------------------------------------------------

    def unit_forces(self, strain: ArrayLike, pressure: ArrayLike, strain_rate: ArrayLike = 0.0,
                    warn: bool = True) -> np.ndarray:
        """
        Return the tension of each motor unit at equilibrium, N.

        Parameters
        ----------
        strain : array_like (...)
        pressure : array_like (..., n), Pa (gauge)
        strain_rate : array_like (...), 1/s
            Losses without memory (friction, damping) act at this rate.
        warn : bool
            Warn, once, if a table of the model is asked outside its range.

        Returns
        -------
        array (..., n)
        """
        self._check_width(pressure)
        if warn:
            self._muscles.warn_outside(np.asarray(strain, float)[..., None],
                                       np.asarray(pressure, float))
        return self._muscles.at_rest(strain, pressure, strain_rate)

    def force(self, strain: ArrayLike, pressure: ArrayLike, strain_rate: ArrayLike = 0.0
              ) -> np.ndarray:
        """Return the tension of the whole bundle, N, shape (...); see `unit_forces`."""
        return self.unit_forces(strain, pressure, strain_rate).sum(axis=-1)

    def start_state(self) -> dict[str, Any]:
        """Return the state for `step` before the first sample of a trial."""
        return self._muscles.start_state()

    def step(self, state: dict[str, Any], dt: float, strain: float, pressure: ArrayLike,
             strain_rate: float = 0.0) -> tuple[np.ndarray, dict[str, Any]]:
        """
        Advance by one sample, with the same laws as `simulate`.

        Parameters
        ----------
        state : dict
            From `start_state` or the last step; it is not changed.
        dt : float, s
            Time since the last step (not used at the first one).
        strain, strain_rate : float, and 1/s
        pressure : array_like (n,) or (k, n), Pa (gauge)
            With (k, n): k candidates for this sample, all with the same memory; the state is then
            returned unchanged.

        Returns
        -------
        unit_forces : array (n,) or (k, n), N
        state : dict
        """
        self._check_width(pressure)
        return self._muscles.step(state, dt, strain, np.asarray(pressure, float), strain_rate)

    def simulate(self, motion: Motion) -> np.ndarray:
        """
        Return the tension of each motor unit over a record, N, shape (T, n).

        Memory is reset where ``motion.start`` is True. Without time these are the static forces.
        """
        self._check_width(motion.pressure)
        return self._muscles.record(motion)

    def _check_width(self, pressure):
        if np.shape(pressure)[-1:] != (self.n,):
            raise InputError(f'{self.name}: pressure has shape {np.shape(pressure)}; expected '
                             f'{self.n} motor units on the last axis')

    # --- gauges --------------------------------------------------------------------------------

    @cached_property
    def sensor_error(self) -> SensorError:
        """
        Errors of the sensors of this model.

        Sensor laws are linear in the measured quantity, in time and in the strain rate.
        """
        total: dict[str, float] = {}
        for _, law, part in self._muscles.laws.at(Place.SENSOR):
            def shown(true, time, rate, part=part, values=self._arguments(law)):
                read = {part.changes: true, 'time': time, 'strain_rate': rate,
                        'unit': np.arange(self.n)}
                return part.function(**values, **{
                    name: value for name, value in read.items() if name in part.arguments})
            bias = shown(0.0, 0.0, 0.0)
            found = [('bias', bias), ('gain', shown(1.0, 0.0, 0.0) - bias),
                     ('drift', shown(0.0, 1.0, 0.0) - bias)]
            if part.changes == 'strain':
                found.append(('lag', bias - shown(0.0, 0.0, 1.0)))
            for name, value in found:
                key = f'{part.changes}_{name}'
                total[key] = total.get(key, 0.0) + value
        return SensorError(**total)

    def readings(self, force: Any, strain: Any, pressure: Any, time: Any = 0.0,
                 strain_rate: Any = 0.0) -> tuple[Any, Any, Any]:
        """
        Return the readings of force, strain and pressure.

        Parameters
        ----------
        force, strain : array_like (...), N and 1
            True values.
        pressure : array_like (..., n), Pa (gauge)
        time : array_like (...), s
            Since the start of the log or the rig.
        strain_rate : array_like (...), 1/s
            Of the reading.
        """
        s = self.sensor_error
        return (force * (1.0 + s.force_gain) + s.force_bias + s.force_drift * time,
                strain * (1.0 + s.strain_gain) + s.strain_bias + s.strain_drift * time
                - s.strain_lag * strain_rate,
                pressure * (1.0 + s.pressure_gain) + s.pressure_bias
                + s.pressure_drift * np.asarray(time)[..., None])

    def felt(self, strain: Any, pressure: Any, time: Any = 0.0, strain_rate: Any = 0.0,
             ) -> tuple[Any, Any]:
        """Return the true strain and pressure from their readings: the inverse of `readings`."""
        s = self.sensor_error
        return ((strain - s.strain_bias - s.strain_drift * time + s.strain_lag * strain_rate)
                / (1.0 + s.strain_gain),
                (pressure - s.pressure_bias - s.pressure_drift * np.asarray(time)[..., None])
                / (1.0 + s.pressure_gain))

    def predict(self, motion: Motion) -> np.ndarray:
        """
        Return the reading of the load cell over a record of readings, N, shape (T,).

        Strain and pressure of ``motion`` are readings; they are first corrected by the model's
        sensor effects. The result is comparable with a measured force.
        """
        self._check_width(motion.pressure)
        return reading(self._muscles, motion)[0]

    def jacobian(self, motion: Motion, keys: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """
        Return the prediction of `predict` and its derivatives with respect to parameters.

        Derivatives are exact to rounding; with a user's law that is not straight-line arithmetic,
        central differences are used.

        Parameters
        ----------
        motion : Motion
            Readings.
        keys : sequence of str
            As in `with_parameters`: ``effect.parameter``, ``geometry.radius``, ...

        Returns
        -------
        prediction : array (T,), N
        jacobian : array (T, K), N per SI unit

        Raises
        ------
        InputError
            For a key that the model does not have.
        """
        self._check_width(motion.pressure)
        try:
            return reading(self._muscles, motion, keys)
        except NotImplementedError:
            return self.predict(motion), differences(self, motion, keys)

    # --- gas -----------------------------------------------------------------------------------

    def gas_volume(self, strain: ArrayLike, pressure: ArrayLike | None = None) -> np.ndarray:
        """
        Return the gas volume of each motor unit without tubes, m^3, shape (..., n).

        The volume of the cylinder at rest plus its change by virtual work: P dV is the work of
        the mesh force pi r0^2 P (3 l^2/tan^2 a0 - B/sin^2 a0), with strain and area as changed by
        geometry effects, at fixed stretch B of the threads.

        Parameters
        ----------
        strain : array_like (...)
        pressure : array_like (..., n), Pa (gauge)
            Needed if a geometry effect depends on it; by default zero.
        """
        return self._gas('volume', strain, pressure)

    def gas_volume_slope(self, strain: ArrayLike, pressure: ArrayLike | None = None
                         ) -> np.ndarray:
        """Return dV/de at constant pressure of each motor unit, m^3, shape (..., n)."""
        return self._gas('volume_slope', strain, pressure)

    def _gas(self, what, strain, pressure):
        pressure = np.zeros(self.n) if pressure is None else pressure
        self._check_width(pressure)
        return self._muscles.gas(what, strain, pressure)

    # --- other models --------------------------------------------------------------------------

    def effect(self, name: str) -> Effect:
        """Return an effect of this model by name; InputError if there is none."""
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise InputError(f"{self.name}: has no effect '{name}'; it has "
                         f"{', '.join(e.name for e in self.effects)}")

    def with_effect(self, effect, **values: float) -> 'Bundle':
        """
        Return a bundle with an effect added: an Effect, or the name of one and its SI values.

        It replaces an effect of the same name.
        """
        if isinstance(effect, str):
            effect = catalogue.get(effect)(**values)
        kept = [e for e in self.effects if e.name != effect.name]
        return self._with(effects=[*kept, effect])

    def without_effect(self, name: str) -> 'Bundle':
        """Return a bundle without an effect; InputError if there is none of that name."""
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
        for owner in changes:
            self.effect(owner)
        effects = [e.replace(**changes[e.name]) if e.name in changes else e
                   for e in self.effects]
        units = self.motor_units
        if dimensions:
            units = tuple(replace(unit, geometry=self._resized(unit.geometry, dimensions))
                          for unit in units)
        return self._with(motor_units=units, effects=effects)

    def _resized(self, geometry, dimensions):
        first = self.motor_units[0].geometry
        new = {}
        for name, value in dimensions.items():
            if name not in DIMENSIONS:
                raise InputError(f"geometry has no dimension '{name}'")
            own, reference = getattr(geometry, name), getattr(first, name)
            new[name] = own - reference + value if name == 'braid_angle' \
                else own * value / reference
        return replace(geometry, **new)

    def _with(self, **changes) -> 'Bundle':
        parts = {'name': self.name, 'motor_units': self.motor_units, 'effects': self.effects,
                 'error': self.error, 'notes': self.notes, **changes}
        return Bundle(**parts)

    def named(self, name: str, error: float | None = None,
              notes: Mapping[str, Any] | None = None) -> 'Bundle':
        """Return the same model under another name, with its error and notes."""
        return self._with(name=name, error=self.error if error is None else error,
                          notes=self.notes if notes is None else notes)

    # --- limits of the bundle (see `fam_bundle_ros.model.reach`) -------------------------------

    free_strain = reach.free_strain
    state_pressures = reach.state_pressures
    overlap = reach.overlap
    onset_pressure = reach.onset_pressure

    def blocked_force(self, pressure: ArrayLike) -> np.ndarray:
        """Return the force at zero strain, N, shape (...); ``pressure`` has shape (..., n)."""
        return self.force(0.0, pressure)

    @property
    def largest_force(self) -> float:
        """Force at zero strain and the largest pressures, N."""
        return float(self.blocked_force(self.max_pressure))
