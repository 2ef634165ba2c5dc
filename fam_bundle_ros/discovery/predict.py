# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Predict the reading of the load cell in a measurement."""

from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.grouping import ONE_STRAIN, rms
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.data.rates import begins
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Motion

#: Steps of strain, and of pressure (Pa), for slopes.
STEP, PRESSURE_STEP = 1e-3, 1e3
#: The force counts as constant below this share of strain variation times stiffness.
_CONSTANT = 0.1


def motion(data: Measurement) -> Motion:
    """
    Return the motion in a measurement, the input of a model.

    Strain and pressure of a log are smoothed according to their noise.
    """
    strain, pressure = data.smoothed
    return Motion(strain, pressure, data.strain_rate, data.time, data.restart)


def matched(model: Bundle, data: Measurement) -> Measurement:
    """
    Return the data with their pressure columns in the order of the model's motor units.

    Columns are matched by name; columns ``mu1`` ... ``mun``, as in ROS topics, by number.

    Raises
    ------
    InputError
        If data and model have different motor units.
    """
    own = [unit.name for unit in model.motor_units]
    names = list(data.motor_units)
    if len(names) != model.n:
        raise InputError(
            f'{data.name}: {len(names)} pressure column{"s" * (len(names) > 1)}; expected '
            f'{model.n}, one for each motor unit of model {model.name}')
    if model.n == 1 or names == own:
        return data
    counted = [f'mu{i + 1}' for i in range(model.n)]
    order = own if set(names) == set(own) else counted
    strange = [name for name in names if name not in order]
    if strange:
        raise InputError(f'{data.name}: column pressure.{strange[0]}; model {model.name} has the '
                         f'motor units {", ".join(own)}')
    columns = [names.index(name) for name in order]
    return replace(data, pressure=data.pressure[:, columns], motor_units=tuple(own))


def predict(model: Bundle, data: Measurement) -> np.ndarray:
    """
    Return the force that the model predicts for each row, (T,), N.

    Under a constant force the strain is the measured quantity: it is not smoothed, see
    `strain_noise`.

    Raises
    ------
    InputError
        If data and model have different motor units.
    """
    data = matched(model, data)
    return model.predict(motion(data)) - strain_noise(data, stiffness(model, data))


def slope_in_strain(model: Bundle, data: Measurement) -> np.ndarray:
    """Return -dF/de of the model at rest in each row, (T,), N."""
    below, above = (model.force(data.strain + step, data.pressure) for step in (-STEP, STEP))
    return (below - above) / (2.0 * STEP)


def slopes_in_pressure(model: Bundle, data: Measurement) -> np.ndarray:
    """Return dF/dP of the model at rest for each motor unit in each row, (n, T), N/Pa."""
    force = model.force(data.strain, data.pressure)
    return np.array([(model.force(data.strain, data.pressure + step) - force) / PRESSURE_STEP
                     for step in PRESSURE_STEP * np.eye(model.n)])


def likelier_past(model: Bundle, data: Measurement) -> Measurement:
    """
    Return data whose memory starts anew with each trial, if the model's error is smaller so.

    The clock may run on between trials for which the muscle was set anew.
    """
    forgets = any(effect.law.memory and not effect.law.across_trials for effect in model.effects)
    if not (data.remembers and forgets):
        return data
    return min((data, data.afresh()), key=lambda each: rms(data.force - predict(model, each)))


def stiffness(model: Bundle, data: Measurement) -> np.ndarray | None:
    """
    Return -dF/de of the model in each row, (T,), N, if the force of each pass was constant.

    Then the strain is the measured quantity; its error is that of the force divided by the
    stiffness. A pass is a motion one way (of a map, all rows). The force counts as constant if
    its standard deviation, overall or within the passes, is below a tenth of that of the strain
    times the stiffness; else the result is None.
    """
    slope = slope_in_strain(model, data)
    rising = slope > 0.0
    if not rising.any() or np.ptp(data.strain) < ONE_STRAIN:
        return None
    usual = float(np.median(slope[rising]))
    force, _ = _within_passes(data, data.force)
    constant = np.where(rising, slope, usual)
    return constant if force < _least_change(data, usual) or is_one_force(data, constant) else None


def is_one_force(data: Measurement, stiff: np.ndarray | None) -> bool:
    """Return whether the force is the same in all passes of data with a `stiffness`."""
    return stiff is not None and bool(
        np.std(data.force) < _CONSTANT * np.median(stiff) * np.std(data.strain))


def strain_noise(data: Measurement, stiff: np.ndarray | None) -> np.ndarray:
    """
    Return what smoothing removed from the strain, as a force, (T,), N; zero if not `stiffness`.

    Models run on the smoothed strain. Where the strain is the measured quantity, its noise is the
    noise of the measurement, and smoothing would hide it.
    """
    if stiff is None:
        return np.zeros(len(data))
    return stiff * (data.strain - data.smoothed[0])


def noise_of(data: Measurement, residual: np.ndarray, stiff: np.ndarray | None) -> NoiseFloor:
    """
    Return the noise floor of a residual, (T,), N, of data with or without a `stiffness`.

    Under a constant force it is noise of the strain: of two visits to the same measured strain
    and pressure it would be equal, so that visits to the same force and pressure are compared.
    Rows at the lower limit of a load cell show no noise, see `above_floor`.
    """
    seen = above_floor(data, stiff)
    data, residual = data.select(seen), residual[seen]
    if stiff is not None and not data.is_static:
        _, mean = _within_passes(data, data.force)
        level = np.round(mean / _least_change(data, float(np.median(stiff))))
        data = replace(data, strain=level)
    return noise_floor(data, residual)


def above_floor(data: Measurement, stiff: np.ndarray | None) -> np.ndarray:
    """
    Return the rows of a log in which noise of the force shows, (T,) bool; of other data all.

    Where a slack muscle, or a load cell that cannot read less, gives the lowest reading in
    neighbouring rows, the noise does not show.
    """
    least = data.force == data.force.min()
    if stiff is not None or data.is_static or least.all():
        return np.ones(len(data), bool)
    beside = np.append(False, least[:-1]) | np.append(least[1:], False)
    return ~(least & beside)


def _least_change(data: Measurement, stiff: float) -> float:
    """Return the standard deviation below which the force of the passes counts as constant, N."""
    strain, _ = _within_passes(data, data.strain)
    return _CONSTANT * stiff * strain


def _within_passes(data: Measurement, values: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the standard deviation of values about the means of their passes, and these, (T,)."""
    passes = (np.zeros(len(data), int) if data.is_static
              else np.cumsum(begins(data.direction, data.trial)) - 1)
    mean = (np.bincount(passes, values) / np.bincount(passes))[passes]
    return float(np.sqrt(np.mean((values - mean) ** 2))), mean


def free_mask(model: Bundle, data: Measurement) -> np.ndarray:
    """Return the rows at or beyond free strain according to the model, (T,) bool."""
    return model.force(data.strain, data.pressure) <= 0.0
