# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A muscle that shares no law with the catalogue: a table of tension between elastic ends, with drag.

The tension f(q, p) of the braid at its own strain q comes from a table, and the ends are a spring
K between it and the muscle's strain e:

    F = K (q - e) = f(q, p) - Fc z,   dz/dq = (1 - z sign(dq))/slide    (Dahl 1968)

At constant strain a rising pressure stretches the ends, so that the braid moves: friction acts
there too. With a short ``slide`` it is Coulomb friction, and after a reversal of the pressure the
force only responds once the pressure has changed by about 2 Fc/(df/dp): backlash in pressure.
Spring and friction create no energy, for any strain and pressure. In the range of push-back a
second table applies above the strain at which the muscle folds, with hysteresis (snap-through).
These forms were invented for this benchmark.
"""

from dataclasses import dataclass
import math

import numpy as np

from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import ForeignPlant

#: Grid of the tables: first strain and pressure (Pa), steps, counts.
STRAINS, PRESSURES = (-0.06, 0.005, 85), (0.0, 5e3, 141)
#: Radius and rest length of the muscle to which forces and volumes below apply, m.
_RADIUS, _LENGTH = 6.35e-3, 0.127
#: Stiffness of the ends of one such muscle, N per strain.
_ENDS = 20e3
#: Folding: strain at zero pressure, its slope over pressure (1/Pa), half width of the hysteresis,
#: time constant (s), remaining share of the push-back.
_FOLD, _FOLD_SLOPE, _FOLD_WIDTH, _FOLD_TIME, _FOLDED = 0.045, 2.3e-6, 0.006, 4e-3, 0.45
#: Places in ``shape``, of each motor unit.
SCALE, FRICTION, SLIDE, ENDS, SNAP = range(5)
#: Places in memory: strain of the braid, Dahl's z, degree of folding (0..1), its target (0 or 1).
BRAID, RUB, FOLDED, FOLD = range(4)
#: Tolerance of the force balance of the braid, N.
_BALANCE = 1e-8


@dataclass(frozen=True)
class Wrong:
    """Differences between a plant's muscles and the model."""

    #: Use a tension surface of this module; else that of the model, read from a table.
    own_surface: bool = False
    #: Whether the push-back drops when a muscle folds.
    snap: bool = False
    #: Relative strength error of the motor units, alternating in sign.
    scale: float = 0.0
    #: Fc of a muscle of 6.35 mm radius, N; 0 for none (and stiff ends).
    friction: float = 0.0
    #: Strain over which the friction builds up.
    slide: float = 3e-4


def muscle_plant(model: Bundle, wrong: Wrong) -> ForeignPlant:
    """Return a plant with the sizes of a model and the differences ``wrong``."""
    strain, pressure = grid()
    sizes = sizes_of(model)
    if wrong.own_surface:
        force = np.multiply.outer(sizes, own_tension(strain[:, None], pressure))
        gas = np.multiply.outer(sizes, own_volume(strain))
    else:
        all_units = np.broadcast_to(pressure[:, None], (len(pressure), model.n))
        force = np.moveaxis(model.unit_forces(strain[:, None], all_units), -1, 0)
        gas = model.gas_volume(strain).T
    return table_plant(model, wrong, force, gas)


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Return strains and pressures (Pa) of the tables."""
    strain, pressure = (first + step * np.arange(count)
                        for first, step, count in (STRAINS, PRESSURES))
    return strain, pressure


def sizes_of(model: Bundle) -> list[float]:
    """Return the area of each motor unit, relative to that of one muscle of 6.35 mm."""
    return [unit.muscles * (unit.geometry.radius / _RADIUS) ** 2 for unit in model.motor_units]


def ends_of(size: float) -> float:
    """Return the stiffness of a motor unit's ends, N per strain."""
    return _ENDS * size


def table_plant(model: Bundle, wrong: Wrong, force: np.ndarray, gas: np.ndarray) -> ForeignPlant:
    """
    Return a plant of given surfaces; sizes, length, pressures and names are those of a model.

    ``force`` (n, strains, pressures), N, is the tension of the braid of each motor unit on the
    `grid`, ``gas`` (n, strains), m^3, its gas volume.
    """
    sizes = sizes_of(model)
    folded = np.where(force < 0.0, _FOLDED * force, force)
    shape = [[1.0 + (wrong.scale if i % 2 else -wrong.scale), wrong.friction * size, wrong.slide,
              ends_of(size), float(wrong.snap)] for i, size in enumerate(sizes)]
    tables = np.concatenate([[model.n], force.ravel(), folded.ravel(), gas.ravel()]).tolist()
    return ForeignPlant(muscle_force, muscle_volume, model.length, model.max_pressure.tolist(),
                        model.names, memory=4, tables=tables, shape=shape)


def own_tension(strain: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Return the force of one muscle of 6.35 mm, N: a braid that locks early, a stiff wall."""
    area = math.pi * _RADIUS ** 2
    lever = 3.75 * np.maximum(1.0 - strain / 0.295, 0.0) ** 1.1 + np.minimum(strain, 0.0) * 9.0
    wall = 20.0 * np.tanh(strain / 0.045) + 45.0 * strain
    return pushing_back(area * pressure * lever - wall, pressure)


def pushing_back(tension: np.ndarray, pressure: np.ndarray, size: float = 1.0) -> np.ndarray:
    """Return a tension, N, whose negative values saturate at the push-back of the muscle."""
    most = size * (2.0 + 10.0 * -np.expm1(-pressure / 140e3))
    return np.where(tension > 0.0, tension, most * np.tanh(tension / most))


def own_volume(strain: np.ndarray) -> np.ndarray:
    """Return the gas volume of one muscle of 6.35 mm, m^3: p dV is the work of its tension."""
    inside = np.maximum(1.0 - strain / 0.295, 0.0)
    grown = 3.75 * 0.295 / 2.1 * (1.0 - inside ** 2.1) + 4.5 * np.minimum(strain, 0.0) ** 2
    return 8.6e-6 + math.pi * _RADIUS ** 2 * _LENGTH * grown


# --- kernels -----------------------------------------------------------------------------------
# In all of them: strain and braid are strains, pressure is in Pa (gauge), dt in s; shape, tables,
# memory and after are rows of the motor unit as in `ForeignPlant`; start marks the first step.

def muscle_force(unit, strain, pressure, dt, start, shape, tables, memory, after):
    """Return the tension of a motor unit, N; update the memory of its braid."""
    p = pressure[unit]
    begun = strain if start else memory[BRAID]
    fold(shape, memory, after, begun if shape[FRICTION] > 0.0 else strain, p, dt, start)
    if shape[FRICTION] <= 0.0:
        after[BRAID], after[RUB] = strain, 0.0
        return tension(unit, strain, p, shape, tables, after)
    rubbed, friction = 0.0 if start else memory[RUB], 0.0 if start else shape[FRICTION]
    low, high = begun, begun
    gap_low = gap_high = balance(unit, begun, begun, rubbed, strain, p, friction, shape, tables,
                                 after)
    step = gap_low / shape[ENDS]
    # The balance decreases with the braid's strain: bracket the root, then Illinois method.
    for _ in range(60):
        if gap_low * gap_high < 0.0 or abs(gap_high) < _BALANCE:
            break
        low, gap_low = high, gap_high
        high += step
        gap_high = balance(unit, high, begun, rubbed, strain, p, friction, shape, tables, after)
    for _ in range(60):
        if abs(gap_high) < _BALANCE:
            break
        middle = high - gap_high * (high - low) / (gap_high - gap_low)
        gap = balance(unit, middle, begun, rubbed, strain, p, friction, shape, tables, after)
        if gap * gap_high < 0.0:
            low, gap_low = high, gap_high
        else:
            gap_low *= 0.5
        high, gap_high = middle, gap
    after[BRAID] = high
    after[RUB] = rubbed if start else dahl(rubbed, high - begun, shape[SLIDE])
    return shape[ENDS] * (high - strain)


def balance(unit, braid, begun, rubbed, strain, pressure, friction, shape, tables, after):
    """Return the force balance of the braid, N: tension minus friction minus force of the ends."""
    return (tension(unit, braid, pressure, shape, tables, after)
            - friction * dahl(rubbed, braid - begun, shape[SLIDE])
            - shape[ENDS] * (braid - strain))


def dahl(rubbed, way, slide):
    """Return Dahl's z after a displacement in one direction, exactly."""
    if way >= 0.0:
        return 1.0 - (1.0 - rubbed) * math.exp(-way / slide)
    return -1.0 + (1.0 + rubbed) * math.exp(way / slide)


def fold(shape, memory, after, braid, pressure, dt, start):
    """Update whether the muscle folds, and its degree of folding."""
    limit = _FOLD + _FOLD_SLOPE * pressure
    wanted = 1.0 if braid > limit else 0.0
    if not start and abs(braid - limit) < _FOLD_WIDTH:
        wanted = memory[FOLD]
    if shape[SNAP] <= 0.0:
        wanted = 0.0
    after[FOLD] = wanted
    after[FOLDED] = wanted if start else (
        wanted + (memory[FOLDED] - wanted) * math.exp(-dt / _FOLD_TIME))


def tension(unit, braid, pressure, shape, tables, after):
    """Return the tension of the braid from the tables of the straight and folded muscle, N."""
    units, columns = int(tables[0]), PRESSURES[2]
    i, x = place(braid, STRAINS[0], STRAINS[1], STRAINS[2])
    j, y = place(pressure, PRESSURES[0], PRESSURES[1], columns)
    at = 1 + (unit * STRAINS[2] + i) * columns + j
    value = bilinear(tables, at, columns, x, y)
    folded = after[FOLDED]
    if folded > 0.0:
        at += units * STRAINS[2] * columns
        value += folded * (bilinear(tables, at, columns, x, y) - value)
    return shape[SCALE] * value


def bilinear(tables, at, columns, x, y):
    """Return the bilinear interpolation in a table."""
    low = tables[at] + y * (tables[at + 1] - tables[at])
    at += columns
    return low + x * (tables[at] + y * (tables[at + 1] - tables[at]) - low)


def place(value, first, step, count):
    """Return the interval of an even grid that contains a value, and the position in it, 0..1."""
    where = min(max((value - first) / step, 0.0), count - 1.0)
    i = min(int(where), count - 2)
    return i, where - i


def muscle_volume(unit, strain, tables):
    """Return the gas volume of a motor unit, m^3, linear between points."""
    units, count = int(tables[0]), STRAINS[2]
    i, x = place(strain, STRAINS[0], STRAINS[1], count)
    at = 1 + 2 * units * count * PRESSURES[2] + unit * count + i
    return tables[at] + x * (tables[at + 1] - tables[at])
