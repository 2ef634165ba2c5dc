# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The whole rig: statics, energy, determinism, safety, faults, and hidden effects."""

from dataclasses import replace
import math

import numpy as np
import pytest

from fam_bundle_ros import plant as plant_package
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, loads_model, Motion
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
    SupplyConfig,
)
from fam_bundle_ros.plant.rig import _dependences

IDEAL = SensorConfig.ideal()


def make(bundle, load=None, seed=0, **values):
    """Return a rig with ideal sensors unless said otherwise."""
    values.setdefault('sensors', IDEAL)
    return Rig(bundle, RigConfig(load=load or Dynamometer(strain=0.1), **values), seed)


def drive(rig, target, seconds, dt=5e-3):
    """Bring the chambers to gauge pressures with a simple proportional controller."""
    readings = []
    for _ in range(round(seconds / dt)):
        error = (np.asarray(target) - rig.truth.pressure) / 100e3
        command = np.where(abs(error) > 1e-3, np.sign(error) * 0.04 + 0.3 * error, 0.0)
        readings.append(rig.step(np.clip(command, -1.0, 1.0), dt))
    return readings


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


def test_plant_and_record_give_the_same_force(bundle):
    """Stepped in the rig or computed over its record, effects with memory give one force."""
    model = (bundle.with_effect('viscoelastic_relaxation').with_effect('presliding_hysteresis')
             .with_effect('pressure_line_lag'))
    rig = make(model)
    rows = []
    for k in range(300):
        rig.impose_strain(0.1 + 0.05 * math.sin(k / 20.0), 3.0)
        rig.step([0.15 * math.sin(k / 15.0), 0.1], 1e-3)
        truth = rig.truth
        rows.append((truth.time, truth.strain, truth.strain_rate, truth.force, *truth.pressure))
    rows = np.array(rows)
    motion = Motion(strain=rows[:, 1], pressure=np.maximum(rows[:, 4:], 0.0),
                    strain_rate=rows[:, 2], time=rows[:, 0])
    assert model.simulate(motion).sum(axis=-1) == pytest.approx(rows[:, 3], abs=1e-6)


def test_hidden_effect_is_one_line_in_the_model_file(bundle, repository):
    """A model file with friction and a load cell bias gives a rig that shows both."""
    text = (repository / 'config/models/spie2021_plain.yaml').read_text()
    hidden = loads_model(text + '  - coulomb_friction: {force: 5 N}\n'
                                '  - force_sensor_bias: {bias: 3 N}\n')
    rig, plain = make(hidden), make(bundle)
    for r in (rig, plain):
        drive(r, [250e3, 50e3], 0.3)
    assert rig.readings.force - rig.truth.force == pytest.approx(3.0)
    for r in (rig, plain):
        r.impose_strain(0.12, 0.05)
        r.step([0.0, 0.0], 0.1)
    # Each of the two muscles rubs with 5 N against the shortening.
    assert rig.truth.force == pytest.approx(plain.truth.force - 10.0, abs=0.1)


def test_gauges_err_as_the_model_file_says(bundle):
    """Gain and offset of every gauge effect are in the readings, and not in the truth."""
    model = bundle
    for name, values in {'force_sensor_gain': {'gain': 0.1}, 'force_sensor_bias': {'bias': 2.0},
                         'force_sensor_drift': {'rate': 0.9},
                         'pressure_sensor_gain': {'gain': -0.05},
                         'pressure_sensor_bias': {'bias': 3e3},
                         'strain_sensor_offset': {'offset': 0.01}}.items():
        model = model.with_effect(name, **values)
    rig = make(model)
    drive(rig, [250e3, 50e3], 0.3)
    truth, shown = rig.truth, rig.readings
    assert truth.time == pytest.approx(0.3)
    force, strain, pressure = model.readings(truth.force, truth.strain, truth.pressure, truth.time)
    assert (shown.force, shown.strain) == pytest.approx((force, strain), rel=1e-12)
    assert shown.pressure == pytest.approx(pressure, rel=1e-12)
    assert shown.supply == truth.supply
    assert truth.force == pytest.approx(float(bundle.force(0.1, truth.pressure)), rel=1e-9)


@pytest.mark.parametrize('lag', [0.02, -0.02])
def test_a_lag_of_the_strain_is_behind_the_force_or_before_it(bundle, lag):
    """At 0.05 1/s the late channel shows what was 20 ms ago: the strain, or all the others."""
    rig, speed = make(bundle.with_effect('strain_sensor_lag', lag=lag)), 0.05
    for k in range(200):
        before = rig.truth.force
        rig.impose_strain(0.1 + 1e-3 * speed * k, speed)
        rig.step([0.0, 0.0], 1e-3)
    slope = (rig.truth.force - before) / 1e-3
    strain_late, force_late = max(lag, 0.0), max(-lag, 0.0)
    assert rig.truth.strain - rig.readings.strain == pytest.approx(strain_late * speed, rel=0.01,
                                                                   abs=1e-9)
    assert rig.truth.force - rig.readings.force == pytest.approx(force_late * slope, rel=0.05,
                                                                 abs=1e-9)


def test_rig_solves_only_for_what_its_plant_depends_on(bundle):
    """Rate and swelling are solved for where a force knows the rate, a volume the pressure."""
    record = make(bundle).record
    assert not record.rate_matters
    assert not record.swells
    assert make(bundle.with_effect('viscous_damping')).record.rate_matters


def test_leak_in_the_model_file_empties_a_closed_chamber(bundle):
    """The leak effect acts on every chamber with its time constant."""
    rig = make(bundle.with_effect('leak', time_constant=2.0))
    drive(rig, [250e3, 100e3], 0.5)
    rig.step([0.0, 0.0], 0.05)
    before = rig.truth.pressure
    rig.step([0.0, 0.0], 1.0)
    assert rig.truth.pressure == pytest.approx(before * math.exp(-0.5), rel=1e-6)


def test_supply_droop_in_the_model_file_lowers_the_manifold(bundle):
    """While a unit fills, the manifold dips further with the effect than without."""
    lowest = []
    for model in (bundle, bundle.with_effect('supply_droop', resistance=2e7)):
        rig = make(model)
        lowest.append(min(rig.step([0.5, 0.5], 1e-3).supply for _ in range(20)))
    assert lowest[1] < lowest[0] - 5e3


def test_emergency_stop_vents_and_stays(bundle):
    """After e_stop all chambers fall below 5 kPa and no command fills them, until the reset."""
    rig = make(bundle)
    drive(rig, [300e3, 200e3], 0.5)
    rig.e_stop('button')
    rig.step([1.0, 1.0], 0.15)
    assert np.all(rig.truth.pressure < 5e3)
    rig.step([1.0, 1.0], 1.0)
    assert np.all(rig.truth.pressure < 5e3)
    assert rig.e_stopped == 'button'
    assert rig.e_stop_reset()
    rig.step([0.1, 0.1], 0.1)
    assert np.all(rig.truth.pressure > 50e3)
    assert rig.e_stopped == ''


def test_a_supply_that_was_shut_stays_shut_while_the_rig_is_stopped(bundle):
    """Shut, it is dumped and no valve fills; it can be opened after the reset of a stop only."""
    rig = make(bundle)
    rig.open_supply(False)
    rig.step([1.0, 1.0], 0.5)
    assert np.all(rig.truth.pressure < 5e3)
    rig.e_stop()
    rig.open_supply(True)
    rig.step([1.0, 1.0], 0.5)
    assert max(rig.truth.supply, *rig.truth.pressure) < 5e3
    assert rig.e_stop_reset()
    rig.open_supply(True)
    rig.step([0.1, 0.1], 0.1)
    assert np.all(rig.truth.pressure > 50e3)


def test_emergency_stop_vents_through_a_valve_that_is_stuck_open(bundle):
    """A valve stuck on fill vents backwards, through the manifold's dump valve."""
    rig = make(bundle)
    drive(rig, [300e3, 0.0], 0.5)
    rig.faults.stuck_valve[0] = 0.5
    rig.e_stop()
    rig.step([0.0, 0.0], 0.5)
    assert np.all(rig.truth.pressure < 5e3)


def test_overpressure_trips_the_rig(bundle):
    """A chamber above 450 kPa stops the rig, with the motor unit named, and never bursts it."""
    rig = make(bundle, supply=SupplyConfig(pressure=700e3))
    highest = max(max(rig.step([0.0, 1.0], 1e-3).pressure) for _ in range(200))
    assert rig.e_stopped.startswith('mu2 at 4')
    assert highest < 500e3
    assert rig.truth.pressure[1] < 5e3
    assert rig.truth.supply < 5e3


def test_reset_of_the_stop_is_refused_above_the_trip_pressure(bundle):
    """While a chamber is still above the trip pressure the rig stays stopped."""
    rig = make(bundle, supply=SupplyConfig(pressure=700e3))
    while not rig.e_stopped:
        rig.step([1.0, 0.0], 1e-3)
    assert not rig.e_stop_reset()
    assert rig.e_stopped


def test_stuck_valve_ignores_its_command(bundle):
    """A valve stuck where it is keeps filling against an exhaust command; the other obeys."""
    rig = make(bundle)
    rig.step([0.1, 0.1], 0.05)
    rig.faults.stuck_valve = {0: None}
    before = rig.truth.pressure
    rig.step([-1.0, -1.0], 0.02)
    assert rig.truth.pressure[0] > before[0]
    assert rig.truth.pressure[1] < before[1]
    assert rig.faults.stuck_valve == pytest.approx({0: 0.1}, abs=1e-3)
    rig.faults.clear()
    rig.step([-1.0, -1.0], 0.2)
    assert np.all(rig.truth.pressure < 1e3)


def test_leak_fault_comes_on_top_of_the_model_s_leak(bundle):
    """Two leaks of 2 s empty a chamber as one of 1 s does."""
    rig = make(bundle.with_effect('leak', time_constant=2.0))
    drive(rig, [250e3, 100e3], 0.5)
    rig.faults.leak[0] = 2.0
    rig.step([0.0, 0.0], 0.05)
    before = rig.truth.pressure
    rig.step([0.0, 0.0], 0.5)
    assert rig.truth.pressure == pytest.approx(before * np.exp([-0.5, -0.25]), rel=1e-6)


def test_leak_fault_empties_one_chamber(bundle):
    """The chamber with the fault loses its pressure, the other keeps it."""
    rig = make(bundle)
    drive(rig, [200e3, 200e3], 0.5)
    rig.faults.leak[1] = 0.1
    rig.step([0.0, 0.0], 0.5)
    assert rig.truth.pressure[0] > 190e3
    assert rig.truth.pressure[1] < 10e3


def test_dropout_fault_blanks_the_reading_and_not_the_truth(bundle):
    """A lost sensor is nan in the readings only."""
    rig = make(bundle)
    rig.faults.dropout = {'mu1/pressure'}
    readings = rig.step([0.5, 0.0], 0.02)
    assert math.isnan(readings.pressure[0])
    assert rig.truth.pressure[0] > 0.0


def test_tare_zeroes_the_force_reading(bundle):
    """After tare the force reading has no mean, and the truth is as before."""
    rig = make(bundle.with_effect('force_sensor_bias', bias=4.0),
               sensors=SensorConfig(force_bias=2.0))
    rig.tare()
    force = [rig.step([0.0, 0.0], 1e-3).force for _ in range(500)]
    assert abs(np.mean(force)) < 0.2
    assert rig.truth.force == pytest.approx(float(bundle.force(0.1, [0.0, 0.0])))


def test_tare_zeroes_whatever_the_gauge_makes_of_the_force(bundle):
    """Gain, offset and drift of the plant's gauge under pressure, at any time."""
    model = bundle.with_effect('force_sensor_bias', bias=4.0).with_effect(
        'force_sensor_gain', gain=0.1).with_effect('force_sensor_drift', rate=0.5)
    rig = make(model, sensors=replace(IDEAL, force_bias=2.0))
    drive(rig, [250e3, 80e3], 1.0)
    assert abs(rig.step([0.0, 0.0], 1e-3).force) > 50.0
    rig.tare()
    assert abs(rig.step([0.0, 0.0], 1e-3).force) < 0.05


def test_other_muscles_of_the_rig_have_its_motor_units_and_length(bundle):
    """What is changed is the model; strain and pressures stay."""
    rig = make(bundle)
    drive(rig, [250e3, 80e3], 0.5)
    before = rig.truth.pressure.copy()
    weak = bundle.with_effect('coulomb_friction', force=3.0)
    rig.change_bundle(weak)
    rig.step([0.0, 0.0], 1e-3)
    assert rig.truth.pressure == pytest.approx(before, rel=1e-3)
    assert rig.bundle is weak
    alone = Bundle('one', bundle.motor_units[:1], bundle.effects)
    with pytest.raises(InputError, match='1 motor units of 127 mm; the rig has 2 of 127 mm'):
        rig.change_bundle(alone)
    longer = bundle.with_parameters({'geometry.length': 0.2})
    with pytest.raises(InputError, match='2 motor units of 200 mm; the rig has 2 of 127 mm'):
        rig.change_bundle(longer)


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


def test_a_drag_that_acts_under_pressure_alone_is_a_drag(bundle):
    """And without one the force knows no rate; the volume knows the pressure where braids give."""
    assert _dependences(bundle, bundle.model()) == (False, False)
    drag = loads_model("""
        format: fam-bundle-model/1
        motor_units:
          - geometry: {radius: 6.35 mm, length: 127 mm, braid_angle: 33 deg,
                       wall_thickness: 1.59 mm}
        effects:
          - my_drag: {expression: "-k * strain_rate * max(pressure - p0, 0)", place: loss,
                      parameters: {k: 0.02 N*s/kPa, p0: 80 kPa}}
        """).effects[0]
    dragged, soft = bundle.with_effect(drag), bundle.with_effect('braid_elasticity')
    assert _dependences(dragged, dragged.model()) == (True, False)
    assert _dependences(soft, soft.model()) == (False, True)


def test_configurations_of_a_rig_cannot_be_changed(not_frozen):
    """Its states and records, and faults, are what changes."""
    assert {name for name in not_frozen(plant_package)
            if not name.endswith(('State', 'Record'))} == {
                'Air', 'AirBalance', 'AirScratch', 'DelayLine', 'Faults'}
