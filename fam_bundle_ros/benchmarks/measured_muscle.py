# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Bundles of a measured muscle, and the model that `diagnose` makes of its measurements.

The muscle is the Festo DMSP-20 of ``config/data`` (Martens and Boblan, Actuators 6(4), 33, 2017,
table A1). The model is what a user has who measures a muscle, diagnoses it and builds a bundle of
such muscles. As tension only was measured, the push-back of the plant is that of `foreign_muscle`,
which the model does not know.
"""

from functools import cache

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import PchipInterpolator

from fam_bundle_ros.benchmarks.foreign_muscle import (
    ends_of,
    grid,
    pushing_back,
    sizes_of,
    table_plant,
    Wrong,
)
from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.discovery import diagnose
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.model.own_muscle import bundle_of
from fam_bundle_ros.plant import ForeignPlant
from fam_bundle_ros.resources import config_path

DATA, DATA_SHEET = 'data/dmsp20_static_map.csv', 'data/dmsp20_static_map.model.yaml'
#: Highest operating pressure of a DMSP-20, Pa (data sheet).
MAX_PRESSURE = 600e3
#: Pressures between which the growth of the gas volume is measured, Pa: no level is slack there.
_FILLED = (450e3, 675e3)


@cache
def diagnosed_bundle(units: int) -> Bundle:
    """Return a bundle of the muscle, with the effects named, one muscle in each motor unit."""
    return bundle_of(_diagnosed(), f'{units} DMSP-20', [1] * units, MAX_PRESSURE)


@cache
def _diagnosed() -> Bundle:
    return diagnose(load_model(config_path(DATA_SHEET)), read_measurement(config_path(DATA))).best


def measured_plant(model: Bundle, wrong: Wrong) -> ForeignPlant:
    """
    Return a bundle of the measured muscle with the differences ``wrong``.

    The model, from `diagnosed_bundle`, gives length and number of motor units.
    """
    force, gas = muscle_tables(model, friction=wrong.friction > 0.0)
    return table_plant(model, wrong, np.repeat(force[None], model.n, axis=0),
                       np.repeat(gas[None], model.n, axis=0))


def muscle_tables(model: Bundle, friction: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """
    Return tension (N) and gas volume (m^3) of one measured muscle on the `grid` of the plants.

    Monotone interpolation over pressure at each measured strain, then over strain; straight
    beyond. The force grows by p dV/dx of the gas, so that what the pressure adds to the tension is
    the slope of the volume.

    Parameters
    ----------
    model : Bundle
        For the volume at rest, and the stiffness of the ends.
    friction : bool
        Return the tension over the strain of the braid rather than that of the muscle: with
        friction a plant's ends are elastic, and those of the muscle are part of its measurement.

    Returns
    -------
    force : ndarray (strains, pressures)
    gas : ndarray (strains,)
    """
    data = read_measurement(config_path(DATA))
    strain, pressure = grid()
    pulls = data.force > 0.0
    pulled, filled, force = data.strain[pulls], data.pressure[pulls, 0], data.force[pulls]
    levels = np.unique(pulled)
    lines = np.array([_straight_beyond(filled[pulled == e], force[pulled == e], pressure)
                      for e in levels])
    tension = _straight_beyond(levels, lines, strain)
    growth = np.maximum(np.diff([_straight_beyond(pressure, tension.T, np.array([p]))[0]
                                 for p in _FILLED], axis=0)[0] / np.ptp(_FILLED), 0.0)
    gas = cumulative_trapezoid(growth * model.length, strain, initial=0.0)
    gas += float(model.gas_volume(0.0)[0]) - np.interp(0.0, strain, gas)
    size = sizes_of(model)[0]
    table = pushing_back(tension, pressure, size)
    if friction:
        ends = ends_of(size)
        table = np.stack([np.interp(strain, strain + column / ends, column)
                          for column in table.T], axis=-1)
    return table, gas


def _straight_beyond(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return y (len(x), ...) interpolated at points: monotone between them, straight beyond."""
    inside = PchipInterpolator(x, y, axis=0)
    ends = np.clip(at, x[0], x[-1])
    slopes = np.diff(y, axis=0) / np.diff(x).reshape(-1, *[1] * (np.ndim(y) - 1))
    way = (at - ends).reshape(-1, *[1] * (np.ndim(y) - 1))
    return inside(ends) + way * np.where(way < 0.0, slopes[0], slopes[-1])
