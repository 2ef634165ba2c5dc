# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Makes the simulated example cases of the workbench in config/data/examples/.

    python scripts/make_examples.py

Each is a sweep of strain at constant pressures by this project's own model engine, with one effect
(or none) that the starting model lacks, and noise; where an effect is hidden the dimensions are a
little off too. Seeds are fixed; the files ship, so that nobody needs to run this.
"""

from pathlib import Path

import numpy as np

from fam_bundle_ros.data.measurement import build, write_csv
from fam_bundle_ros.model import (
    Bundle,
    catalogue,
    Geometry,
    Motion,
    MotorUnit,
    Parameter,
    save_model,
)
from fam_bundle_ros.model.expression import expression_law

FOLDER = Path(__file__).resolve().parent.parent / 'config' / 'data' / 'examples'
NOISE = {'force': 0.6, 'pressure': 0.3e3, 'strain': 1e-4}
SAMPLES, PERIOD = 90, 0.23


def bundle(name, units, effects, pressure):
    """Return a bundle of muscles of the paper's rig."""
    geometry = Geometry(6.35e-3, 0.127, np.radians(33.0), 1.59e-3)
    return Bundle(name, [MotorUnit(f'mu{k + 1}', 1, geometry, pressure) for k in range(units)],
                  [catalogue.get(effect)() for effect in effects])


def sweeps(isobars, highest, cycles):
    """Return time, strain, pressure, trial: each isobar ``cycles`` times up and down."""
    phase = np.linspace(0.0, 1.0, SAMPLES // 2, endpoint=False)
    once = highest * np.concatenate([phase, 1.0 - phase])
    strain = np.tile(once, len(isobars) * cycles)
    pressure = np.repeat(np.asarray(isobars, float), SAMPLES * cycles, axis=0)
    trial = np.repeat(np.arange(len(isobars) * cycles), SAMPLES)
    return PERIOD * np.arange(len(strain)), strain, pressure, trial


def write(name, truth, start, motion, seed):
    """Simulate, add noise, write the CSV and the model that its user starts from."""
    time, strain, pressure, trial = motion
    rng = np.random.default_rng(seed)
    begins = np.r_[True, np.diff(trial) != 0]
    rate = np.gradient(strain, time)
    force = truth.predict(Motion(strain, pressure, rate, time, begins))
    data = build(name, strain + rng.normal(0.0, NOISE['strain'], len(strain)),
                 pressure + rng.normal(0.0, NOISE['pressure'], pressure.shape),
                 force + rng.normal(0.0, NOISE['force'], len(strain)),
                 trial, time, [unit.name for unit in truth.motor_units])
    write_csv(data, FOLDER / f'{name}.csv')
    save_model(start.named(f'{name}_start'), FOLDER / f'{name}.model.yaml')


def main():
    """Write every case."""
    seven = np.linspace(0.0, 413.7e3, 7)
    single = sweeps(seven[np.random.default_rng(7).permutation(7), None], 0.25, 2)
    rubber = ('mesh', 'bladder_elasticity')
    off = {'geometry.radius': 6.40e-3, 'geometry.braid_angle': np.radians(33.1)}

    start = bundle('start', 1, rubber, 413.7e3)
    truth = start.with_parameters(off).with_effect('coulomb_friction', force=6.66)
    write('hidden_friction', truth, start, single, 11)

    write('nothing_missing', start, start, single, 12)

    stop = expression_law('end_stop', '-k * max(0, strain - at)', 'force', (
        Parameter('k', 'N', 500.0, 0.0, 5000.0, ''), Parameter('at', '1', 0.17, 0.0, 0.3, '')))
    write('a_stranger', start.with_parameters(off).with_effect(stop()), start, single, 13)

    top = 344.7e3
    start = bundle('start', 2, rubber, top)
    levels = [(top * a, top * b) for a, b in (
        (1, 0), (1, .1), (1, .2), (1, .4), (1, .6), (1, .8), (1, 1), (.5, 0), (0, 0), (.5, .3))]
    order = np.random.default_rng(8).permutation(len(levels))
    truth = start.with_parameters(off).with_effect('resistive_buckling')
    write('bundle_push_back', truth, start, sweeps(np.array(levels)[order], 0.24, 1), 14)


if __name__ == '__main__':
    main()
