# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Measurements of a muscle that is written down here: no model of the package is needed."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build


def ideal_force(strain, pressure):
    """Return the force of an ideal braid, N: radius 6.35 mm, braid angle 33 deg."""
    angle = np.radians(33.0)
    braid = 3.0 * (1.0 - strain) ** 2 / np.tan(angle) ** 2 - 1.0 / np.sin(angle) ** 2
    return np.pi * 6.35e-3 ** 2 * pressure * braid


@pytest.fixture(scope='session')
def muscle():
    """Return the force of the muscle as a function of strain and gauge pressure."""
    return ideal_force


@pytest.fixture
def log(muscle):
    """Return time, strain, pressure (Pa) and force of a log, SI."""
    time = 0.05 * np.arange(240)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 4.0)
    pressure = np.repeat([150e3, 280e3, 410e3], 80)
    return time, strain, pressure, muscle(strain, pressure)


@pytest.fixture
def sweeps():
    """Return a function that makes isobar sweeps with noise of 0.6 N by default."""
    def make(noise=0.6, seed=0, cycles=2, speed=0.024, friction=0.0):
        rng = np.random.default_rng(seed)
        once = 0.24 * np.concatenate([np.linspace(0, 1, 40), np.linspace(1, 0, 40)])
        clock = np.linspace(0, 0.48 / speed, 80)
        levels = np.tile(np.linspace(0, 413.7e3, 6), cycles)
        strain = np.tile(once, len(levels))
        way = np.tile(np.repeat([1.0, -1.0], 40), len(levels))
        pressure = np.repeat(levels, 80)
        trial = np.repeat(np.arange(len(levels)), 80)
        time = np.concatenate([clock + k * (clock[-1] + 3) for k in range(len(levels))])
        force = ideal_force(strain, pressure) - friction * way
        force = force + noise * rng.standard_normal(len(force))
        return build('sweeps', strain, pressure, force, trial, time)
    return make
