# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The muscles of a bundle as arrays of numbers, and calls of the generated functions with them.

Arrays have the motor units on the last axis; SI units, gauge pressures.
"""

from collections.abc import Sequence
from functools import cached_property
import math
from typing import Any

import numpy as np

from fam_bundle_ros.model import rows
from fam_bundle_ros.model.compose import composition, MUSCLES
from fam_bundle_ros.model.effect import Effect
from fam_bundle_ros.model.geometry import Geometry
from fam_bundle_ros.model.laws.base import SHAPE
from fam_bundle_ros.model.parts import Motion, MotorUnit
from fam_bundle_ros.model.seam import Model


class Muscles:
    """
    Motor units and effects, prepared for computation.

    Parameters
    ----------
    motor_units : sequence of MotorUnit
    effects : sequence of Effect
    """

    def __init__(self, motor_units: Sequence[MotorUnit], effects: Sequence[Effect]):
        self.motor_units, self.effects = motor_units, effects
        self.laws = composition(tuple(effect.law for effect in effects))
        self._units = np.arange(len(motor_units))
        self._tabled = [effect.table for effect in effects if effect.table is not None]

    @cached_property
    def geometry(self) -> Geometry:
        """Geometry with fields of shape (n,)."""
        return Geometry.stack([unit.geometry for unit in self.motor_units])

    @cached_property
    def shape(self) -> np.ndarray:
        """Geometry and number of muscles of each motor unit, (G, n)."""
        units = [[*(getattr(unit.geometry, name) for name in SHAPE), unit.muscles]
                 for unit in self.motor_units]
        return np.array(units, float).T

    @cached_property
    def _common_shape(self) -> list[Any]:
        """The rows of `shape`; one number if equal for all motor units, which is faster."""
        return [row[0] if (row == row[0]).all() else row for row in self.shape]

    @cached_property
    def parameters(self) -> np.ndarray:
        """Values of all effects, (K,)."""
        return np.array([value for e in self.effects for value in e.values.values()], float)

    @cached_property
    def tables(self) -> np.ndarray:
        """Measured tables in one array, (T,), which begins with the start index of each table."""
        if not self._tabled:
            return np.zeros(0)
        flat = [table.flat for table in self._tabled]
        first = len(flat) + np.cumsum([0, *(len(table) for table in flat)])[:-1]
        return np.concatenate([first, *flat]).astype(float)

    @cached_property
    def _lists(self) -> tuple[list, list, list]:
        return self.shape.T.tolist(), self.parameters.tolist(), self.tables.tolist()

    def model(self, compiled: bool) -> Model:
        """Return functions and numbers for the control loop; see `Bundle.model`."""
        width = max(len(self.laws.memory), 1)
        memory, after = (np.zeros((len(self._units), width)) for _ in range(2))
        if compiled:
            return Model(*self.laws.pointers, np.ascontiguousarray(self.shape.T),
                         self.parameters.copy(), self.tables.copy(), memory, after)
        return Model(*self.laws.plain, *self._lists, memory.tolist(), after.tolist())

    # --- forces --------------------------------------------------------------------------------

    def at_rest(self, strain, pressure, strain_rate) -> np.ndarray:
        """Return the forces (..., n) at equilibrium."""
        strain, pressure, strain_rate = given = _columns(strain, pressure, strain_rate)
        shape = np.broadcast_shapes(*(item.shape[:-1] for item in given))
        if math.prod(shape) > rows.BLOCK:
            strain, pressure, strain_rate = (
                np.broadcast_to(item, (*shape, item.shape[-1])).reshape(-1, item.shape[-1])
                for item in given)
            motion = Motion(strain[:, 0], pressure, strain_rate[:, 0])
            return rows.unit_forces(self, motion).reshape(*shape, -1)
        with np.errstate(all='ignore'):
            force = self.laws.functions('arrays').muscle_at_rest(
                self._units, strain, strain_rate, pressure, 0.0, self.shape, self.parameters,
                self.tables)
        return self._of_units(force, strain, pressure, strain_rate)

    def start_state(self) -> dict[str, Any]:
        """Return the state before the first sample."""
        return {'memory': self.model(compiled=False).memory, 'time': 0.0, 'begun': False}

    def step(self, state: dict[str, Any], dt: float, strain: float, pressure: np.ndarray,
             strain_rate: float) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the forces at the next sample and the state after it; see `Bundle.step`."""
        start = not state['begun']
        time = 0.0 if start else state['time'] + dt
        self.warn_outside(strain, pressure)
        memory = state['memory']
        if pressure.ndim == 1:
            after = [list(row) for row in memory]
            felt, force = pressure.tolist(), self.laws.plain[0]
            forces = [force(unit, float(strain), float(strain_rate), felt, time, dt, start,
                            *self._lists, memory, after) for unit in range(len(felt))]
            return np.array(forces), {'memory': after, 'time': time, 'begun': True}
        with np.errstate(all='ignore'):
            # parameters as Python floats: calls of NumPy take half of the time
            value = self.laws.functions('arrays').muscle(
                self._units, strain, strain_rate, pressure, time, dt, start, start,
                self._common_shape, self._lists[1], self.tables, np.transpose(memory),
                [None] * len(memory[0]))
            forces = self._common_shape[MUSCLES] * value
        return (forces if np.shape(forces) == pressure.shape
                else np.broadcast_to(forces, pressure.shape)), state

    def record(self, motion: Motion) -> np.ndarray:
        """Return the forces (T, n) over a record."""
        self.warn_outside(np.asarray(motion.strain)[:, None], motion.pressure)
        return rows.unit_forces(self, motion)

    def gas(self, what: str, strain, pressure) -> np.ndarray:
        """Return gas ``volume`` or ``volume_slope`` (..., n)."""
        strain, pressure, _ = _columns(strain, pressure)
        with np.errstate(all='ignore'):
            value = getattr(self.laws.functions('arrays'), what)(
                self._units, strain, pressure, 0.0, self.shape, self.parameters, self.tables)
        return self._of_units(value, strain, pressure)

    def _of_units(self, value, *like):
        """Return the value of each motor unit: that of one muscle times the number of muscles."""
        shape = np.broadcast_shapes(*(np.shape(item) for item in like))
        return self.shape[MUSCLES] * np.broadcast_to(value, shape)

    def warn_outside(self, strain, pressure) -> None:
        """Warn, once, about strains and pressures (Pa) that a table of the model lacks."""
        for table in self._tabled:
            table.warn_outside(strain, pressure)


def _columns(strain, pressure, strain_rate=0.0):
    """Return arrays that broadcast to (..., n)."""
    return (np.asarray(strain, float)[..., None], np.asarray(pressure, float),
            np.asarray(strain_rate, float)[..., None])
