# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a model says the load cell would have shown in a measurement."""

import numpy as np

from fam_bundle_ros.discovery.measurement import Measurement
from fam_bundle_ros.discovery.rates import smooth
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, Motion


def motion(data: Measurement) -> Motion:
    """
    Return the record of what the muscles did, as the model's engine takes it.

    Strain and pressure of a log are smoothed as far as their own noise allows.
    """
    if data.time is None:
        return Motion(data.strain, data.pressure, data.strain_rate, None, data.start)
    strain = smooth(data.time, data.strain, data.trial)
    pressure = np.stack([smooth(data.time, column, data.trial) for column in data.pressure.T], -1)
    return Motion(strain, pressure, data.strain_rate, data.time, data.start)


def check_units(model: Bundle, data: Measurement) -> None:
    """
    Raise InputError unless data and model have the same motor units.

    Names need not agree (a log may call them otherwise); their number must.
    """
    columns = data.pressure.shape[1]
    if columns != model.n:
        raise InputError(
            f'{data.name}: {columns} pressure column{"s" * (columns > 1)}; expected {model.n}, '
            f'one for each motor unit of model {model.name}')


def predict(model: Bundle, data: Measurement) -> np.ndarray:
    """
    Return the force that the model predicts for each row, (T,), N.

    Raises
    ------
    InputError
        Where data and model do not have the same number of motor units.
    """
    check_units(model, data)
    return model.predict(motion(data))


def free_mask(model: Bundle, data: Measurement) -> np.ndarray:
    """Return where the model holds the bundle at or past its free strain, (T,) bool."""
    return model.force(data.strain, data.pressure) <= 0.0
