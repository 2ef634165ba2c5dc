# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The whole rig: statics, energy of the air, determinism, and loads."""

from dataclasses import replace
import math

import numpy as np
import pytest

from fam_bundle_ros import plant as plant_package
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import (
    Arm,
    available_energy,
    ChamberConfig,
    Dynamometer,
    MassSpring,
    Rig,
    rig_for,
    RigConfig,
    SensorConfig,
    SeriesSpringMass,
)

from .rigs import drive, IDEAL, make


def test_dynamometer_reads_the_model_at_its_strain_and_pressures(bundle):
    """On a dynamometer the force is that of the model at the rig's own strain and pressures."""
    rig = make(bundle)
    drive(rig, [250e3, 80e3], 0.5)
    truth = rig.truth
    assert truth.pressure == pytest.approx([250e3, 80e3], abs=1e3)
    assert truth.force == pytest.approx(float(bundle.force(0.1, truth.pressure)), rel=1e-9)


@pytest.mark.parametrize('load', [MassSpring(stiffness_against=2e3), SeriesSpringMass(), Arm()],
                         ids=lambda load: type(load).__name__)
def test_load_comes_to_rest_where_the_bundle_balances_it(bundle, load):
    """At rest the bundle's force is the load's holding force."""
    rig = make(bundle.with_effect('viscous_damping', coefficient=100.0), load)
    drive(rig, [250e3, 120e3], 4.0)
    truth = rig.truth
    assert 0.01 < truth.strain < load.stops[1] - 0.01
    assert abs(truth.strain_rate) < 1e-3
    assert truth.force == pytest.approx(load.holding_force(truth.strain, rig.length), abs=0.1)


def test_mass_does_not_lift_before_the_force_exceeds_its_weight(bundle):
    """A mass on its support stays there below its weight and rises above it."""
    rig = make(bundle, MassSpring(mass=8.0))
    drive(rig, [120e3, 0.0], 0.5)
    assert rig.truth.force < 8.0 * 9.80665
    assert rig.truth.strain == 0.0
    drive(rig, [250e3, 0.0], 0.5)
    assert rig.truth.strain > 0.01


def test_work_is_what_the_mass_has_gained(bundle):
    """Lifting slowly, the work done on the load is weight times height and a little drag."""
    rig = make(bundle.with_effect('viscous_damping', coefficient=40.0), MassSpring(mass=6.0))
    drive(rig, [250e3, 0.0], 4.0)
    height = rig.truth.contraction
    assert height > 5e-3
    assert 6.0 * 9.80665 * height < rig.work < 1.1 * 6.0 * 9.80665 * height


@pytest.mark.parametrize('exponents', [(1.0, 1.0, 1.0), (1.2, 1.2, 1.2)])
def test_work_never_exceeds_the_energy_of_the_air(bundle, exponents):
    """Over random lifting, work done stays below what the air drawn could ever give."""
    rig = make(bundle, MassSpring(mass=3.0, stiffness_against=1500.0, damping=20.0),
               chamber=ChamberConfig(5e-6, *exponents))
    rng = np.random.default_rng(2)
    for _ in range(60):
        drive(rig, rng.uniform(0.0, 340e3, 2), 0.05)
        limit = available_energy(rig.air_mass, rig.config.supply.pressure)
        assert rig.work <= limit
    assert rig.work > 0.005 * limit


def test_air_that_was_drawn_is_somewhere(bundle):
    """Regulator = valves + manifold; valves = chambers + exhaust, in isothermal chambers."""
    rig = make(bundle, Arm(), chamber=ChamberConfig(5e-6, 1.0, 1.0, 1.0))

    def content():
        volume = bundle.gas_volume(rig.truth.strain) + 5e-6
        return float(np.sum((rig.truth.pressure + 101325.0) * volume)) / (287.05 * 293.15)

    start, manifold = content(), rig.truth.supply
    rng = np.random.default_rng(1)
    for _ in range(40):
        drive(rig, rng.uniform(0.0, 340e3, 2), 0.05)
    air = rig.air
    stored = (rig.truth.supply - manifold) * rig.config.supply.volume / (287.05 * 293.15)
    assert air.drawn == pytest.approx(air.delivered + stored, rel=1e-9)
    assert air.delivered == pytest.approx(content() - start + air.exhausted, rel=1e-4)
    assert rig.air_mass == air.delivered


def test_same_seed_gives_the_same_bytes(bundle):
    """Two rigs of one seed, and one rig after reset, show identical readings."""
    def log(rig):
        readings = drive(rig, [200e3, 50e3], 0.2) + drive(rig, [50e3, 250e3], 0.2)
        return np.array([[r.time, r.force, r.strain, r.contraction, r.strain_rate, r.supply,
                          *r.pressure] for r in readings]).tobytes()

    noisy = bundle.with_effect('coulomb_friction').with_effect('viscoelastic_relaxation')
    rig = make(noisy, Arm(), seed=7, sensors=SensorConfig())
    first = log(rig)
    rig.reset()
    assert log(rig) == first
    assert log(make(noisy, Arm(), seed=7, sensors=SensorConfig())) == first
    assert log(make(noisy, Arm(), seed=8, sensors=SensorConfig())) != first


@pytest.mark.parametrize('load', [MassSpring(stiffness_against=2e3, damping=40.0), Arm()],
                         ids=lambda load: type(load).__name__)
@pytest.mark.parametrize('effect', [None, 'coulomb_friction', 'viscoelastic_relaxation'])
def test_halving_the_step_changes_little(bundle, load, effect):
    """
    At 0.5 instead of 1 ms the force moves by less than 0.3 N rms, the strain by less than 2e-4.

    Where dry friction changes sign the instant shifts by a fraction of a step: hence rms.
    """
    model = bundle.with_effect(effect) if effect else bundle
    coarse, fine = make(model, load, step=1e-3), make(model, load, step=5e-4)
    force, strain = [], []
    for k in range(200):
        command = [0.12 * math.sin(k / 12.0), 0.12 * math.sin(k / 9.0)]
        a, b = coarse.step(command, 5e-3), fine.step(command, 5e-3)
        force.append(a.force - b.force)
        strain.append(a.strain - b.strain)
    assert coarse.truth.strain != coarse.load.stops[0]
    assert np.sqrt(np.mean(np.square(force))) < 0.3
    assert np.max(np.abs(strain)) < 2e-4


def test_one_step_of_ten_milliseconds_is_ten_of_one(bundle):
    """How a duration is cut into calls does not matter while the command is held."""
    once, often = make(bundle, Arm()), make(bundle, Arm())
    for _ in range(20):
        once.step([0.2, 0.1], 0.01)
        for _ in range(10):
            often.step([0.2, 0.1], 1e-3)
    # Drifts of two steps in one call are joined; the spool is averaged over other spans then.
    assert once.truth.force == pytest.approx(often.truth.force, abs=2e-3)
    assert once.truth.time == pytest.approx(0.2)


def test_friction_holds_the_load_where_the_lag_of_force_is_small(bundle):
    """Stiff dry friction sticks: no chatter of the rate while the pressure creeps."""
    rig = make(bundle.with_effect('coulomb_friction', force=8.0), MassSpring(mass=4.0))
    drive(rig, [250e3, 0.0], 1.0)
    rates = []
    for _ in range(200):
        rig.step([0.0, 0.0], 1e-3)
        rates.append(rig.truth.strain_rate)
    assert np.max(np.abs(rates)) < 2e-3
    assert np.max(np.abs(np.diff(rates))) < 1e-4


def test_load_step_changes_the_balance_and_not_the_motion(bundle):
    """More mass in motion lets the bundle sink without a jump in strain."""
    rig = make(bundle.with_effect('viscous_damping', coefficient=40.0), MassSpring(mass=4.0))
    drive(rig, [250e3, 0.0], 2.0)
    before = rig.truth.strain
    rig.change_load(mass=6.0)
    assert rig.truth.strain == before
    drive(rig, [250e3, 0.0], 2.0)
    assert rig.truth.strain < before - 0.01
    rig.reset()
    assert rig.load.mass == 4.0


def test_closed_muscle_that_is_stretched_and_shortened_returns(bundle):
    """A slow cycle of strain with closed valves brings the pressure back."""
    rig = make(bundle)
    drive(rig, [200e3, 0.0], 0.5)
    rig.step([0.0, 0.0], 0.05)
    before = rig.truth.pressure[0]
    rig.impose_strain(0.2, 0.2)
    rig.step([0.0, 0.0], 0.6)
    assert rig.truth.pressure[0] < before - 30e3
    rig.impose_strain(0.1, 0.2)
    rig.step([0.0, 0.0], 0.6)
    assert rig.truth.pressure[0] == pytest.approx(before, rel=1e-5)


def test_rig_of_six_units_runs(bundle):
    """Nothing in the rig counts on two motor units."""
    units = [bundle.motor_units[0].__class__(f'mu{i + 1}', 1 + i, bundle.motor_units[0].geometry)
             for i in range(6)]
    rig = make(Bundle('six', units, bundle.effects))
    rig.step([0.5, 0.4, 0.3, 0.2, 0.1, 0.0], 0.05)
    assert np.all(np.diff(rig.truth.pressure) < 0.0)


@pytest.mark.parametrize(('act', 'word'), [
    (lambda rig: rig.step([0.0], 0.01), '1 valve commands'),
    (lambda rig: rig.step([0.0, math.nan], 0.01), 'valve command 2 is nan'),
    (lambda rig: rig.step([0.0, 0.0], 0.0), 'duration'),
    (lambda rig: rig.change_load(colour=1.0), 'Dynamometer cannot change colour'),
    (lambda rig: rig.change_load(strain=3.0), 'Dynamometer.strain'),
    (lambda rig: (rig.faults.leak.update({4: 1.0}), rig.step([0.0, 0.0], 0.01)), 'motor unit 4'),
])
def test_misuse_fails(bundle, act, word):
    """What cannot be done is refused in one sentence."""
    with pytest.raises(InputError, match=word):
        act(make(bundle))


def test_only_a_dynamometer_imposes_a_strain(bundle):
    """Asking a mass for a strain is refused."""
    with pytest.raises(InputError, match='MassSpring'):
        make(bundle, MassSpring()).impose_strain(0.1)


def test_the_default_rig_suits_muscles_that_take_more_pressure(bundle):
    """Supply above trip above limit, in the proportions that it has for the paper's muscles."""
    assert rig_for(bundle) == RigConfig()
    strong = Bundle('strong', [replace(unit, max_pressure=800e3) for unit in bundle.motor_units],
                    bundle.effects)
    rig, usual, scale = rig_for(strong), RigConfig(), 800e3 / 344.7e3
    assert rig.trip_pressure == pytest.approx(scale * usual.trip_pressure)
    assert rig.supply.pressure == pytest.approx(scale * usual.supply.pressure)
    assert rig.chamber.relief_pressure == pytest.approx(scale * usual.chamber.relief_pressure)
    ours = Rig(strong, replace(rig, sensors=IDEAL, load=Dynamometer(strain=0.1)))
    drive(ours, [780e3, 780e3], 3.0)
    assert not ours.e_stopped
    assert ours.truth.pressure == pytest.approx([780e3, 780e3], rel=0.02)


def test_configurations_of_a_rig_cannot_be_changed(not_frozen):
    """Its states and records, and faults, are what changes."""
    assert {name for name in not_frozen(plant_package)
            if not name.endswith(('State', 'Record'))} == {
                'Air', 'AirBalance', 'AirScratch', 'DelayLine', 'Faults'}
