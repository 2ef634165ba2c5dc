# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a model says the load cell would have shown in a measurement."""

from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Motion

#: Strain over which a slope is taken.
_STEP = 1e-3
#: Share of what the strain's changes are worth, below which the force counts as constant.
_CONSTANT = 0.1


def motion(data: Measurement) -> Motion:
    """
    Return the record of what the muscles did, as the model's engine takes it.

    Strain and pressure of a log are smoothed as far as their own noise allows.
    """
    strain, pressure = data.smoothed
    return Motion(strain, pressure, data.strain_rate, data.time, data.start)


def matched(model: Bundle, data: Measurement) -> Measurement:
    """
    Return the data with their pressure columns in the order of the model's motor units.

    Columns are matched by name; columns ``mu1`` ... ``mun``, as ROS topics count them, by number.

    Raises
    ------
    InputError
        Where data and model have other motor units.
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
        Where data and model have other motor units.
    """
    return model.predict(motion(matched(model, data)))


def stiffness(model: Bundle, data: Measurement) -> np.ndarray | None:
    """
    Return -dF/de of the model in each row, (T,), N, for data at a constant force; else None.

    There the strain is what was measured: its error is the force's over the stiffness. A force is
    constant that changes by less than a tenth of what the strain's changes are worth.
    """
    below, above = (model.force(data.strain + step, data.pressure) for step in (-_STEP, _STEP))
    slope = np.maximum((below - above) / (2.0 * _STEP), 0.0)
    worth = float(np.std(data.strain)) * float(np.median(slope))
    return slope if float(np.std(data.force)) < _CONSTANT * worth else None


def free_mask(model: Bundle, data: Measurement) -> np.ndarray:
    """Return where the model holds the bundle at or past its free strain, (T,) bool."""
    return model.force(data.strain, data.pressure) <= 0.0
