# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Forces of a bundle over a long record, and their derivatives with respect to parameters.

The generated text of the bundle's `Composition` is run with arrays of rows as numbers and a
`RowLaw` for each law, so that the order of the laws is defined only there. A record is computed
in blocks, so that the temporary arrays stay small; memory is carried from block to block.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, TYPE_CHECKING

import numpy as np

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.compose import MUSCLES
from fam_bundle_ros.model.dual import applied, Dual, DualWords, slopes_of, value_of
from fam_bundle_ros.model.geometry import DERIVED, derived, DIMENSIONS
from fam_bundle_ros.model.laws.base import Place, SHAPE
from fam_bundle_ros.model.parts import Motion
from fam_bundle_ros.model.rowlaw import row_law

if TYPE_CHECKING:
    from fam_bundle_ros.model.muscles import Muscles

#: Rows in a block: few enough that arrays between laws stay in the processor's cache, and enough
#: that the overhead of a call is small.
BLOCK = 8192
#: Relative step of central differences: cube root of the rounding of a double.
_STEP = 6e-6


def unit_forces(model: 'Muscles', motion: Motion) -> np.ndarray:
    """
    Return the tension of each motor unit over a record, N, shape (T, n).

    Memory is reset where ``motion.start`` is True. Without time these are the static forces.
    """
    force = np.empty((model.shape.shape[1], len(motion.strain)))
    for unit, rows, value in _blocks(_Numbers(model, ()), _floats(motion.strain),
                                     _floats(motion.pressure).T, motion):
        force[unit, rows] = value
    return force.T


def reading(model: 'Muscles', motion: Motion, keys: Sequence[str] = ()
            ) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the reading of the load cell over a record, and its derivatives.

    Parameters
    ----------
    model : Muscles
    motion : Motion
        Readings of strain and pressure.
    keys : sequence of str
        ``effect.parameter`` or ``geometry.radius`` ..., as in `Bundle.with_parameters`.

    Returns
    -------
    force : array (T,), N
    jacobian : array (T, K), N per SI unit of each key

    Raises
    ------
    InputError
        For a key that the model does not have.
    NotImplementedError
        If the source of a law cannot be differentiated.
    """
    numbers = _Numbers(model, keys)
    time = motion.clock
    rate = _floats(motion.strain_rate)
    strain = numbers.true('strain', _floats(motion.strain), time, rate)
    pressure = numbers.true('pressure', np.ascontiguousarray(_floats(motion.pressure).T), time,
                            rate)
    # a table is of true values, as gauges without errors would read them
    model.warn_outside(value_of(strain)[:, None], value_of(pressure).T)
    force = np.zeros(len(motion.strain))
    jacobian = np.zeros((len(keys), len(force)))
    for _, rows, value in _blocks(numbers, strain, pressure, motion):
        force[rows] += value_of(value)
        for key, slope in slopes_of(value).items():
            jacobian[key, rows] += slope
    bias, gain = numbers.error('force', time, rate)
    jacobian *= value_of(gain)
    for key, slope in slopes_of(gain).items():
        jacobian[key] += slope * force
    for key, slope in slopes_of(bias).items():
        jacobian[key] += slope
    return force * value_of(gain) + value_of(bias), jacobian.T


def differences(bundle: Any, motion: Motion, keys: Sequence[str]) -> np.ndarray:
    """Return the derivatives of `Bundle.predict` by central differences, (T, K)."""
    jacobian = np.empty((len(motion.strain), len(keys)))
    for column, key in enumerate(keys):
        owner, _, name = key.partition('.')
        if owner == 'geometry':
            value = getattr(bundle.motor_units[0].geometry, name)
            step = _STEP * value
        else:
            value = bundle.effect(owner).values[name]
            # for a parameter of zero the step is relative to its upper bound
            step = _STEP * (abs(value) or abs(bundle.effect(owner).limits(name)[1]) or 1.0)
        above, below = (bundle.with_parameters({key: value + sign * step}).predict(motion)
                        for sign in (1.0, -1.0))
        jacobian[:, column] = (above - below) / (2.0 * step)
    return jacobian


class _Numbers:
    """The parameters and dimensions of a model; those named by keys are dual numbers."""

    def __init__(self, model, keys):
        self.model = model
        self.parameters = model.parameters.tolist()
        self.shape = model.shape.T.tolist()
        dimensions = {}
        for key, text in enumerate(keys):
            owner, _, name = text.partition('.')
            if owner == 'geometry' and name in DIMENSIONS:
                dimensions[name] = key
            elif (owner, name) in model.laws.parameters:
                index = model.laws.parameters.index((owner, name))
                self.parameters[index] = Dual(self.parameters[index], {key: 1.0})
            else:
                raise InputError(
                    f"the model has no parameter '{text}'; expected 'geometry.' with one of "
                    f"{', '.join(DIMENSIONS)}, or an effect of the model and its parameter, such "
                    'as ' + ' or '.join(map('.'.join, model.laws.parameters[:2])))
        if dimensions:
            self.shape = [self._resized(one, dimensions) for one in self.shape]

    def _resized(self, one, dimensions):
        """Return a unit's shape with derivatives; its dimensions scale with the first unit's."""
        one = list(one)
        for name, key in dimensions.items():
            index = SHAPE.index(name)
            ratio = 1.0 if name == 'braid_angle' else one[index] / self.model.shape[index, 0]
            one[index] = Dual(one[index], {key: ratio})
        of = [one[SHAPE.index(name)] for name in ('radius', 'braid_angle', 'wall_thickness')]
        for name, value in zip(DERIVED, applied(derived, *of), strict=True):
            one[SHAPE.index(name)] = value
        return one

    def error(self, quantity, time, rate):
        """Return b and g of sensors that read g x + b; (n, 1) or numbers, 0 and 1 if exact."""
        bias, gain = 0.0, 1.0
        for _, law, part in self.model.laws.at(Place.SENSOR):
            if part.changes != quantity:
                continue
            values = {argument: self.parameters[self.model.laws.parameters.index(
                (law.name, name))] for argument, name in law.names.items()}
            units = np.arange(len(self.shape))[:, None]
            read = {'time': time, 'strain_rate': rate, 'unit': units, **values}
            at_zero, at_one = (
                applied(part.function, *({**read, quantity: at}[name] for name in part.arguments)
                        )[0] for at in (0.0, 1.0))
            bias, gain = at_zero + bias, at_one - at_zero + gain
        return bias, gain

    def true(self, quantity, shown, time, rate):
        """Return the true value for a reading; sensor laws are linear."""
        bias, gain = self.error(quantity, time, rate)
        return (shown - bias) / gain


def _blocks(numbers: _Numbers, strain: Any, pressure: Any, motion: Motion
            ) -> Iterator[tuple[int, slice, Any]]:
    """
    Yield the force of each motor unit, block by block: unit, rows, force in N.

    ``strain`` (T,) and ``pressure`` (n, T), Pa, are the true values, without sensor errors.
    """
    laws, tables = numbers.model.laws, numbers.model.tables
    functions = _functions(laws)
    rate = _floats(motion.strain_rate)
    count = len(motion.strain)
    time, (dt, start, first) = motion.clock, motion.stepping
    stepping = laws.has_memory and motion.time is not None
    memory = [[0.0] * len(laws.memory) for _ in numbers.shape]
    for begin in range(0, count, BLOCK):
        rows = slice(begin, min(begin + BLOCK, count))
        felt = _part(strain, rows)
        for unit, shape in enumerate(numbers.shape):
            given = unit, felt, rate[rows], _part(pressure, (unit, rows)), time[rows]
            if stepping:
                after = [0.0] * len(laws.memory)
                force = functions.muscle(
                    *given, dt[rows], start[rows], first[rows], shape, numbers.parameters,
                    tables, memory[unit], after)
                memory[unit] = after
            else:
                force = functions.muscle_at_rest(*given, shape, numbers.parameters, tables)
            yield unit, rows, force * shape[MUSCLES]


@lru_cache(maxsize=512)
def _functions(laws):
    return laws.functions_of(DualWords, row_law)


def _floats(values):
    return np.asarray(values, float)


def _part(number, rows):
    """Return some rows of an array or of a dual number."""
    if not isinstance(number, Dual):
        return number[rows]
    return Dual(number.value[rows], {key: slope[rows] if np.ndim(slope) else slope
                                     for key, slope in number.slopes.items()})
