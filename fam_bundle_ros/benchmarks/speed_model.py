# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the model on arrays: a million forces against plain NumPy, the Jacobian of a fit."""

import time

import numpy as np

from fam_bundle_ros.benchmarks.plants import paper_bundle
from fam_bundle_ros.benchmarks.speed import best, Figure, paired, Row, where_of
from fam_bundle_ros.model import Bundle, catalogue, Motion, Place

_ROWS = 1_000_000
_FIT_ROWS, _FIT_PARAMETERS = 24_000, 12
#: Targets: not slower than plain NumPy; whole catalogue within five times; Jacobian ten times
#: faster.
REACH, REACH_CATALOGUE, REACH_JACOBIAN = 1.0, 5.0, 0.1


def motion_of(rows: int) -> Motion:
    """Return a motion of two units over strains and pressures."""
    t = 4e-3 * np.arange(rows)
    strain = 0.1 + 0.05 * np.sin(0.3 * t)
    pressure = 170e3 * np.stack([1.0 + np.sin(0.8 * t), 1.0 + np.sin(0.2 * t + 1.0)], axis=-1)
    return Motion(strain, pressure, 0.015 * np.cos(0.3 * t), t)


def by_hand(bundle: Bundle, strain: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """
    Return the force (T,) of mesh and bladder as a user would write it in NumPy.

    Chou and Hannaford (1996) and the Mooney-Rivlin tube of Klute and Hannaford (2000), for units
    of one size.
    """
    g = bundle.motor_units[0].geometry
    c10, c01 = (bundle.effect('bladder_elasticity').values[name] for name in ('c10', 'c01'))
    cos2 = np.cos(g.braid_angle) ** 2
    sin2 = 1.0 - cos2
    k = cos2 / sin2
    stretch = 1.0 - strain
    mesh = np.pi * g.radius ** 2 * pressure * (
        3.0 * stretch ** 2 * k - 1.0 / sin2)[:, None]
    u = (1.0 - stretch ** 2 * cos2) / sin2
    first = stretch * (1.0 - k) - 1.0 / (stretch ** 3 * u) + k / (stretch * u ** 2)
    second = k * stretch / u ** 2 - 1.0 / stretch ** 3 + stretch * u - k * stretch ** 3
    wall = np.pi * (g.radius ** 2 - (g.radius - g.wall_thickness) ** 2)
    tube = 2.0 * wall * (c10 * first + c01 * second)
    return (mesh + tube[:, None]).sum(axis=-1)


def whole_catalogue(bundle: Bundle) -> Bundle:
    """Return the bundle with one effect of every family that acts in the muscles."""
    present = {effect.family for effect in bundle.effects}
    for name in catalogue.names():
        law = catalogue.get(name)
        outside = law.place in (Place.SENSOR, Place.PNEUMATICS)
        # A table in a file has no default.
        if outside or law.family in present or law.load is not None:
            continue
        bundle = bundle.with_effect(name)
        present.add(law.family)
    return bundle


def forces(scale: float) -> list[Figure]:
    """Return the time of a million forces, mesh and bladder and the whole catalogue."""
    rows = max(int(_ROWS * scale), 1000)
    simple, motion = paper_bundle(2).without_effect('resistive_buckling'), motion_of(rows)
    strain, pressure = motion.strain, motion.pressure
    hand, ours = by_hand(simple, strain, pressure), simple.force(strain, pressure)
    if not np.allclose(hand, ours, rtol=1e-9, atol=1e-9):
        raise AssertionError('the force by hand is not that of the bundle')
    whole = whole_catalogue(paper_bundle(2))
    by_numpy, packaged, all_laws = paired(
        [lambda: by_hand(simple, strain, pressure), lambda: simple.force(strain, pressure),
         lambda: whole.simulate(motion)], budget=2.0 * scale, least=2)
    peer = 'mesh + bladder in NumPy by hand'
    return [Figure(f'{rows:.0e} rows, mesh + bladder', 1e3 * packaged, 'ms', peer,
                   1e3 * by_numpy, REACH),
            Figure(f'{rows:.0e} rows, {len(whole.effects)} effects, one of every family',
                   1e3 * all_laws, 'ms', peer, 1e3 * by_numpy, REACH_CATALOGUE)]


def where_forces(scale: float) -> str:
    """Return where the whole catalogue spends its time."""
    whole = whole_catalogue(paper_bundle(2))
    motion = motion_of(max(int(0.2 * _ROWS * scale), 1000))
    return where_of(lambda: whole.simulate(motion))


def fit_case(scale: float) -> tuple[Bundle, Motion, list[str]]:
    """Return a bundle, a log and twelve parameters to be fitted."""
    bundle = paper_bundle(2).with_effect('coulomb_friction', force=3.0).with_effect(
        'viscous_damping')
    keys = [f'{effect.name}.{parameter.name}' for effect in bundle.effects
            for parameter in effect.parameters]
    return bundle, motion_of(max(int(_FIT_ROWS * scale), 200)), keys[:_FIT_PARAMETERS]


def differences(bundle: Bundle, motion: Motion, keys: list[str]) -> np.ndarray:
    """Return the Jacobian (T, K) of `predict` by forward differences, as least_squares would."""
    start, columns = bundle.predict(motion), []
    for key in keys:
        effect, _, name = key.partition('.')
        value = bundle.effect(effect).values[name]
        step = 1e-6 * max(abs(value), 1e-6)
        moved = bundle.with_parameters({key: value + step})
        columns.append((moved.predict(motion) - start) / step)
    return np.stack(columns, axis=-1)


def jacobians(scale: float) -> list[Figure]:
    """Return the time of prediction and Jacobian, compared with forward differences."""
    bundle, motion, keys = fit_case(scale)
    shape = f'{len(motion.strain)} rows x {len(keys)} parameters'
    begin = time.perf_counter()
    exact = bundle.jacobian(motion, keys)[1]
    first = time.perf_counter() - begin
    near = differences(bundle, motion, keys)
    gap = float(np.max(np.abs(near - exact) / (np.abs(exact).max(axis=0) + 1e-300)))
    ours, theirs = paired([lambda: bundle.jacobian(motion, keys),
                           lambda: differences(bundle, motion, keys)], 1.0 * scale, least=2)
    predict = best(lambda: bundle.predict(motion), 0.3 * scale)
    return [Figure(shape, 1e3 * ours, 'ms', 'forward differences on predict', 1e3 * theirs,
                   REACH_JACOBIAN, note=f'first call {1e3 * first:.0f} ms; predict alone '
                   f'{1e3 * predict:.2g} ms; the two differ by {gap:.0e}')]


def where_jacobian(scale: float) -> str:
    """Return where the Jacobian spends its time."""
    bundle, motion, keys = fit_case(scale)
    return where_of(lambda: [bundle.jacobian(motion, keys) for _ in range(5)])


ROWS = (
    Row('force', 'force of a million rows', forces, where_forces),
    Row('jacobian', 'prediction and Jacobian of a fit', jacobians, where_jacobian),
)
