# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Noise floor with which errors are compared: that of the fits, which sees noise with a memory."""

from dataclasses import replace

import numpy as np

from fam_bundle_ros.data.mean_noise import mean_noise
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.data.noise import noise_floor, NoiseFloor
from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.cells import extent, visits
from fam_bundle_ros.discovery.log_rows import spikes, stretches, unknown_direction


def floor_of(data: Measurement, residual: np.ndarray) -> NoiseFloor:
    """
    Return the noise floor of a measurement; of a log, with the noise that has a memory.

    Second differences of rows do not see such noise. As in the fits (`cells.reduce`), its size is
    estimated from means of neighbours within the visits; in a long log, from a part of the rows.

    Parameters
    ----------
    residual : ndarray, shape (T,), N
        Measured minus modelled force.
    """
    floor = noise_floor(data, residual)
    if data.is_static or floor.differences is None or floor.basis == 'repeats':
        return floor
    few = stretches(replace(data, force=residual), settings.ROWS)
    if len(few) <= settings.CELLS:
        return floor
    stay = visits(few, few.direction, *extent(few), settings.CELLS)
    used = ~(spikes(few, few.force, floor.value) | unknown_direction(few))
    found = mean_noise(few.force[used], stay[used], floor)
    if found is None:
        return floor
    memory = found.correlation if floor.visits is None else floor.correlation
    return replace(floor, value=found.sd, basis='means of neighbours', correlation=memory)
