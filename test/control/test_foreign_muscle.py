# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The muscle of the benchmark that shares no law with the catalogue."""

import math

import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.benchmarks.foreign_muscle import (
    BRAID,
    FOLDED,
    muscle_plant,
    own_tension,
    own_volume,
    tension,
    Wrong,
)
from fam_bundle_ros.benchmarks.plants import (
    model_error,
    paper_bundle,
    PLANTS,
    sweep,
    UNITS,
)

LENGTH = 0.127
#: `measured` has tests of its own.
MUSCLES = {name: kind.muscle for name, kind in PLANTS.items()
           if kind.muscle is not None and name != 'measured'}


def cycle(seed, count=6000):
    """Return a closed cycle of strain and pressures (T,) and (T, 2) with turns of both."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0.0, 2.0 * math.pi, count)
    swing = sum(rng.normal(size=(3, 1)) * np.sin((k + 1) * phase + rng.uniform(0, 6, (3, 1)))
                for k in range(4)) / 4.0
    strain = 0.11 + 0.06 * np.clip(swing[0], -1.0, 1.0)
    return strain, np.clip(150e3 + 140e3 * swing[1:], 0.0, None).T


@pytest.mark.parametrize('name', MUSCLES)
def test_no_cycle_of_strain_and_pressure_gives_more_work_than_the_surface(name):
    """Over closed cycles the muscle gives no more work than its table along the braid's path."""
    plant = muscle_plant(paper_bundle(2), MUSCLES[name])
    model = plant.model(False)
    strain, pressure = (np.concatenate([part] * 3) for part in cycle(1))
    given = table = 0.0
    before = None
    for k, (e, p) in enumerate(zip(strain.tolist(), pressure.tolist())):
        forces, pulls, braids = [], [], []
        for i in range(2):
            forces.append(model.force(i, e, 0.0, p, 0.0, 1e-3, k == 0, *model[3:]))
            after = model.after[i]
            # What the straight and the folded surface pull; a fold moves no energy by itself.
            pulls.append(tension(i, after[BRAID], p[i], model.shape[i], model.tables, after))
            braids.append(after[BRAID])
        for row, after in zip(model.memory, model.after):
            row[:] = after
        # The first round leaves the start behind, which was nobody's cycle.
        if before and k > len(strain) // 3:
            given += 0.5 * (sum(forces) + sum(before[0])) * (e - before[3]) * LENGTH
            table += sum(0.5 * (pulls[i] + before[1][i]) * (braids[i] - before[2][i]) * LENGTH
                         for i in range(2))
        before = forces, pulls, braids, e
    # J; the cycles turn over some joules.
    assert given <= table + 2e-3
    if MUSCLES[name].friction > 0.0:
        assert given < table - 0.02


@pytest.mark.parametrize('name', ['friction', 'play', 'everything'])
def test_friction_acts_at_constant_strain(name):
    """A pressure that goes up and down at one strain leaves a loop of twice the friction."""
    wrong = MUSCLES[name]
    plant = muscle_plant(paper_bundle(2), Wrong(wrong.own_surface, False, 0.0, wrong.friction,
                                            wrong.slide))
    up = np.linspace(150e3, 300e3, 400)
    pressure = np.concatenate([up, up[::-1]])[:, None] * [1.0, 0.0]
    force = sweep(plant, np.full(800, 0.1), pressure)
    gap = force[600] - force[199]
    assert gap == pytest.approx(2.0 * wrong.friction, rel=0.15)


def test_a_short_slide_is_a_play_in_pressure():
    """Turned round, the pressure goes back by 2 Fc/(df/dp) before the force answers."""
    plant = muscle_plant(paper_bundle(2), MUSCLES['play'])
    up = np.linspace(150e3, 300e3, 301)
    pressure = np.concatenate([up, up[::-1]])[:, None] * [1.0, 0.0]
    force = sweep(plant, np.full(602, 0.1), pressure)
    slope = (force[250] - force[150]) / (pressure[250, 0] - pressure[150, 0])
    back = pressure[300, 0] - pressure[301:, 0]
    still = back[np.abs(force[301:] - force[300]) < 0.5].max()
    assert still == pytest.approx(2.0 * MUSCLES['play'].friction / slope, rel=0.2)
    assert still > 10e3


def test_a_folded_muscle_pushes_back_less_and_unfolds_later():
    """On the way back the push-back stays small below the strain at which it fell."""
    plant = muscle_plant(paper_bundle(2), Wrong(snap=True))
    straight = muscle_plant(paper_bundle(2), Wrong())
    strain = np.concatenate([np.linspace(0.02, 0.08, 300), np.linspace(0.08, 0.02, 300)])
    force, usual = (sweep(each, strain, np.zeros((600, 2))) for each in (plant, straight))
    kept = force / usual
    assert kept[:120] == pytest.approx(1.0, abs=1e-9)
    assert kept[280:320] == pytest.approx(0.45, abs=1e-6)
    folds = strain[np.flatnonzero(kept[:300] < 0.9)[0]]
    unfolds = strain[300 + np.flatnonzero(kept[300:] > 0.9)[0]]
    assert folds - unfolds == pytest.approx(0.012, abs=1e-3)
    assert plant.model(False).after[0][FOLDED] == 0.0


def test_own_gas_volume_does_the_work_of_the_own_tension():
    """In tension p dV over strain is what the pressure adds to the force, times the length."""
    for e in (0.02, 0.08, 0.15):
        rise = float(own_tension(np.array(e), 300e3) - own_tension(np.array(e), 200e3))
        slope = float(own_volume(np.array(e + 1e-5)) - own_volume(np.array(e - 1e-5))) / 2e-5
        assert 100e3 * slope == pytest.approx(rise * LENGTH, rel=1e-4)


def test_model_on_the_plant_with_all_wrong_is_off_by_7_newton():
    """As the benchmark is to have it, for every number of units; and each muscle is off."""
    for units in UNITS:
        assert model_error('everything', units) >= 7.0
    for name in MUSCLES:
        assert model_error(name, 2) > 0.5
    assert model_error('units_10', 2) > 1.9 * model_error('units_5', 2) > 3.0 * model_error(
        'units_2', 2)


def test_a_plant_of_nothing_wrong_is_the_model():
    """The table alone gives the model's forces to a few tenths of a newton, and its volumes."""
    model = paper_bundle(3)
    plant = muscle_plant(model, Wrong())
    rng = np.random.default_rng(3)
    strain, pressure = rng.uniform(0.0, 0.25, 200), rng.uniform(0.0, 340e3, (200, 3))
    off = sweep(plant, strain, pressure) - model.force(strain, pressure)
    assert np.sqrt(np.mean(off ** 2)) < 0.3
    made = plant.model(False)
    volume = [made.volume(2, e, p, 0.0, *made[3:6]) for e, p in zip(strain, pressure)]
    assert volume == pytest.approx(model.gas_volume(strain)[:, 2], rel=1e-3)


@pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
def test_compiled_muscle_is_the_plain_one():
    """Forces and memory along a cycle agree."""
    plant = muscle_plant(paper_bundle(2), MUSCLES['everything'])
    plain, quick = plant.model(False), plant.model(True)
    one_step = kernels.compiled(_force)
    strain, pressure = cycle(5, 300)
    for k, (e, p) in enumerate(zip(strain.tolist(), np.ascontiguousarray(pressure))):
        for i in range(2):
            expected = _force(plain, i, e, p.tolist(), k == 0)
            assert one_step(quick, i, e, p, k == 0) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        plain.memory[:] = [list(row) for row in plain.after]
        quick.memory[:] = quick.after
    assert quick.memory.tolist() == [pytest.approx(row, rel=1e-9, abs=1e-12)
                                     for row in plain.memory]


def _force(model, unit, strain, pressure, start):
    return model.force(unit, strain, 0.0, pressure, 0.0, 1e-3, start, model.shape,
                       model.parameters, model.tables, model.memory, model.after)
