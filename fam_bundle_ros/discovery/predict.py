# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Predict the reading of the load cell in a measurement."""

from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Motion

#: Step of strain for the slope.
_STEP = 1e-3
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

    Raises
    ------
    InputError
        If data and model have different motor units.
    """
    return model.predict(motion(matched(model, data)))


def stiffness(model: Bundle, data: Measurement) -> np.ndarray | None:
    """
    Return -dF/de of the model in each row, (T,), N, for data at a constant force; else None.

    At constant force the strain is the measured quantity; its error is that of the force divided
    by the stiffness. The force counts as constant if its standard deviation is below a tenth of
    that of the strain times the stiffness.
    """
    below, above = (model.force(data.strain + step, data.pressure) for step in (-_STEP, _STEP))
    slope = np.maximum((below - above) / (2.0 * _STEP), 0.0)
    usual = float(np.std(data.strain)) * float(np.median(slope))
    return slope if float(np.std(data.force)) < _CONSTANT * usual else None


def free_mask(model: Bundle, data: Measurement) -> np.ndarray:
    """Return the rows at or beyond free strain according to the model, (T,) bool."""
    return model.force(data.strain, data.pressure) <= 0.0
