# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Plants that are no bundle of laws: two functions of a user, or measured tables."""

import math

import numpy as np
import pytest

from fam_bundle_ros import kernels
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import Dynamometer, ForeignPlant, MassSpring, Rig, RigConfig
from fam_bundle_ros.plant.sensors import SensorConfig

LENGTH = 0.15
needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')


def bellows_force(unit, strain, strain_rate, pressure, parameters):
    """A bellows: area times pressure against a spring and a dashpot; units push on each other."""
    return (parameters[0] * pressure[unit] - parameters[1] * strain - 8.0 * strain_rate
            - 1e-5 * pressure[1 - unit])


def bellows_volume(unit, strain, pressure):
    """A cylinder that grows longer as it pulls, and swells."""
    return (10e-6 + 5e-6 * unit) * (1.0 + 2.0 * strain) + 3e-12 * pressure[unit]


def bellows(**more):
    """Return a plant of two bellows."""
    return ForeignPlant(bellows_force, bellows_volume, LENGTH, [300e3, 300e3],
                        parameters=[4e-4, 150.0], **more)


def at_rest(plant, commands, load=None):
    """Return a rig with ideal sensors after a second under commands, valves shut at the end."""
    rig = Rig(plant, RigConfig(load=load or Dynamometer(0.1), sensors=SensorConfig.ideal()))
    rig.step(commands, 0.02)
    rig.step([0.0] * plant.n, 1.0)
    return rig


def test_rig_shows_the_force_of_the_user_s_function():
    """At rest the rig's force is the sum over the units at its own strain and pressures."""
    truth = at_rest(bellows(), [0.5, 0.3]).truth
    expected = sum(bellows_force(i, truth.strain, 0.0, truth.pressure, [4e-4, 150.0])
                   for i in range(2))
    assert truth.pressure[0] > truth.pressure[1] > 50e3
    assert truth.force == pytest.approx(expected, rel=1e-12)


def test_foreign_plant_lifts_a_mass_to_where_it_balances():
    """A hanging mass comes to rest where the bellows carry its weight."""
    truth = at_rest(bellows(), [0.5, 0.5], MassSpring(mass=5.0, damping=80.0)).truth
    assert truth.strain > 0.05
    assert truth.force == pytest.approx(5.0 * 9.80665, abs=0.05)


def test_memory_is_read_and_written_by_motor_unit():
    """Each unit counts its own samples from the start on; other units' are left alone."""
    def force(unit, strain_rate, start, memory, after):
        after[0] = 1.0 + unit if start else memory[0] + 1.0 + unit
        after[1] = 7.0
        return after[0] - 50.0 * strain_rate

    # The force is asked several times a step for its rate: only the last one counts.
    plant = ForeignPlant(force, bellows_volume, LENGTH, [3e5, 3e5], memory=2)
    rig = Rig(plant, RigConfig(load=MassSpring(mass=0.1), step=1e-3))
    rig.step([0.0, 0.0], 5e-3)
    assert rig.model.memory == [[6.0, 7.0], [12.0, 7.0]]
    rig.reset()
    assert rig.model.memory == [[1.0, 7.0], [2.0, 7.0]]


def test_leak_and_droop_of_a_foreign_plant_act():
    """A closed chamber loses gauge pressure as exp(-t/tau), and the manifold dips further."""
    rig = at_rest(bellows(), [0.5, 0.5])
    before = at_rest(bellows(leak_rate=0.5), [0.5, 0.5])
    assert before.truth.pressure[0] < 0.75 * rig.truth.pressure[0]
    lowest = [min(Rig(bellows(supply_resistance=r), RigConfig()).step([1.0, 1.0], t).supply
                  for t in (0.01, 0.02)) for r in (0.0, 2e7)]
    assert lowest[1] < lowest[0] - 5e3


def test_table_is_exact_at_its_points_and_linear_between():
    """Bilinear between measured points, constant beyond the ends."""
    strain, pressure = [0.0, 0.1, 0.25], [0.0, 150e3, 300e3]
    force = np.arange(18.0).reshape(2, 3, 3) ** 2
    volume = 10e-6 + 1e-7 * np.arange(18.0).reshape(2, 3, 3)
    plant = ForeignPlant.from_tables(strain, pressure, force, volume, LENGTH)
    model = plant.model(False)

    def at(unit, e, p):
        vector = [p, p]
        return (model.force(unit, e, 0.0, vector, 0.0, 0.0, True, *model[3:]),
                model.volume(unit, e, vector, 0.0, *model[3:6]))

    for unit in range(2):
        for i, e in enumerate(strain):
            for j, p in enumerate(pressure):
                assert at(unit, e, p) == pytest.approx((force[unit, i, j], volume[unit, i, j]))
    assert at(1, 0.05, 75e3)[0] == pytest.approx(np.mean(force[1, :2, :2]))
    assert at(0, 0.4, 1e6)[0] == force[0, 2, 2]
    assert plant.max_pressure.tolist() == [300e3, 300e3]
    slope = model.volume_slope(1, 0.05, [0.0, 75e3], 0.0, *model[3:6])
    expected = (np.mean(volume[1, 1, :2]) - np.mean(volume[1, 0, :2])) / 0.1
    assert slope == pytest.approx(expected, rel=1e-6)


@needs_numba
def test_table_compiles():
    """The compiled table gives the plain one's force and volume."""
    rng = np.random.default_rng(4)
    plant = ForeignPlant.from_tables([0.0, 0.1, 0.3], [0.0, 1e5, 2e5, 3e5],
                                     rng.uniform(0.0, 90.0, (1, 3, 4)),
                                     rng.uniform(1e-5, 2e-5, (1, 3, 4)), LENGTH)
    plain, quick = plant.model(False), plant.model(True)
    sample = kernels.compiled(_sample)
    for e, p in rng.uniform([-0.1, -1e4], [0.4, 4e5], (50, 2)).tolist():
        assert sample(quick, e, np.array([p])) == pytest.approx(
            _sample(plain, e, [p]), rel=1e-12)


def _sample(model, strain, pressure):
    return (model.force(0, strain, 0.0, pressure, 0.0, 0.0, True, model.shape, model.parameters,
                        model.tables, model.memory, model.after),
            model.volume(0, strain, pressure, 0.0, model.shape, model.parameters, model.tables))


def test_function_that_cannot_be_compiled_says_so():
    """Python that numba does not know runs plain; the compiled model is refused."""
    class Spring:
        k = 40.0

    def force(strain):
        return Spring.k * math.cos(strain)

    plant = ForeignPlant(force, bellows_volume, LENGTH, [3e5])
    assert Rig(plant, RigConfig(load=Dynamometer(0.1))).truth.force == pytest.approx(
        40.0 * math.cos(0.1))
    with pytest.raises(kernels.NotCompiled):
        plant.model(True)


@pytest.mark.parametrize(('make', 'word'), [
    (lambda: ForeignPlant(lambda stretch: 0.0, bellows_volume, LENGTH, [1e5]), "'stretch'"),
    (lambda: ForeignPlant(bellows_force, lambda strain_rate: 0.0, LENGTH, [1e5]), 'strain_rate'),
    (lambda: ForeignPlant(bellows_force, bellows_volume, 0.0, [1e5]), 'length 0.0'),
    (lambda: ForeignPlant(bellows_force, bellows_volume, LENGTH, [1e5], names='ab'), '2 names'),
    (lambda: ForeignPlant.from_tables([0.0, 0.0], [0.0, 1.0], np.zeros((1, 2, 2)),
                                      np.zeros((1, 2, 2)), LENGTH), 'strain of the table'),
    (lambda: ForeignPlant.from_tables([0.0, 0.1], [0.0, 1.0], np.zeros((1, 2, 2)),
                                      np.zeros((1, 2, 3)), LENGTH), 'volume of the table'),
])
def test_plant_that_cannot_be_fails(make, word):
    """What cannot be a plant is refused with the name of what is wrong."""
    with pytest.raises(InputError, match=word):
        make()
