# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The integrator of the rig: its order, its energy, its air, and the compiled way."""

import copy
from dataclasses import fields, is_dataclass, replace
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fam_bundle_ros import kernels
from fam_bundle_ros.model.pneumatics import mass_flow, RT
from fam_bundle_ros.plant import (
    Arm,
    ChamberConfig,
    Dynamometer,
    Faults,
    MassSpring,
    Rig,
    RigConfig,
    SensorConfig,
    SeriesSpringMass,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.plant.faults import fault_record
from fam_bundle_ros.plant.foreign import ForeignPlant
from fam_bundle_ros.plant.loads import GRAVITY
from fam_bundle_ros.plant.motion import E_STOP, OVER_PRESSURE, rig_step

LENGTH, AMBIENT, TUBE = 0.127, 101325.0, 5e-6
#: A valve that closes exactly when told to and a supply that gives what is asked.
QUICK = ValveConfig(bandwidth=1e4, dead_band=0.0)
STIFF = SupplyConfig(volume=1e4, flow_limit=1.0)


def drag_force(strain, strain_rate, pressure, unit):
    """A muscle that pulls less the shorter it is, with viscous drag."""
    return 3.5e-4 * pressure[unit] * (1.0 - strain / 0.3) - 25.0 * strain_rate


def smooth_force(strain, pressure, unit):
    """The same muscle without drag."""
    return 3.5e-4 * pressure[unit] * (1.0 - strain / 0.3)


def curved_volume(strain):
    """A volume that grows with contraction, less and less."""
    return 9e-6 + 50e-6 * strain - 60e-6 * strain * strain


def swelling_volume(strain, pressure, unit):
    """The same, in a muscle that swells with pressure, less and less."""
    return (9e-6 + 50e-6 * strain) * (1.0 + 0.4 * pressure[unit] / (3e5 + pressure[unit]))


def make(load, force=smooth_force, volume=curved_volume, units=1, **values):
    """Return a rig around a foreign plant, with ideal sensors."""
    plant = ForeignPlant(force, volume, LENGTH, [400e3] * units)
    values.setdefault('sensors', SensorConfig.ideal())
    return Rig(plant, RigConfig(load=load, **values))


def test_coupled_air_and_load_follow_their_differential_equations_to_second_order():
    """Mass, drag, chamber and valve against an accurate integration: half the step, a quarter."""
    mass, opening, seconds = 4.0, 0.05, 0.12
    load = MassSpring(mass=mass, stiffness_against=800.0, damping=10.0, stops=(-0.15, 0.5))

    def rates(t, y):
        strain, rate, p = y
        force = drag_force(strain, rate, [p - AMBIENT], 0)
        volume = curved_volume(strain) + TUBE
        swept = (50e-6 - 120e-6 * strain) * rate
        inflow = opening * mass_flow(3.93e-9, 0.3, 500e3 + AMBIENT, p)
        x = (strain + 0.15) * LENGTH
        hold = mass * GRAVITY + 800.0 * (x - 0.15 * LENGTH) + 10.0 * rate * LENGTH
        return [rate, (force - hold) / (mass * LENGTH), 1.2 * (RT * inflow - p * swept) / volume]

    def found(step):
        rig = make(load, drag_force, valve=QUICK, supply=STIFF, step=step)
        rig.state.motion.strain = 0.05
        rig.state.air.pressure = [200e3 + AMBIENT]
        rig.state.air.volume = [curved_volume(0.05) + TUBE]
        rig.state.air.spool = [opening]
        rig.step([opening], seconds)
        truth = rig.truth
        return np.array([truth.strain, truth.strain_rate, truth.pressure[0] + AMBIENT])

    exact = solve_ivp(rates, (0.0, seconds), [0.05, 0.0, 200e3 + AMBIENT], rtol=1e-11,
                      atol=1e-10).y[:, -1]
    errors = [np.abs(found(step) - exact) for step in (4e-3, 2e-3, 1e-3)]
    assert np.all(errors[2] < [1e-6, 1e-4, 1.0])
    for coarse, fine in zip(errors, errors[1:]):
        assert coarse / fine == pytest.approx([4.0, 4.0, 4.0], rel=0.15)


def test_four_kilograms_at_the_default_step_are_within_a_fifth_of_a_newton(bundle):
    """Lifted and dropped on its stop by brisk valves, the mass is at 1 ms as at 25 us."""
    def force(step):
        rig = Rig(bundle, replace(RigConfig(), load=MassSpring(mass=4.0), step=step,
                                        sensors=SensorConfig.ideal()))
        return [rig.step([0.12 * math.sin(k / 12.0) * (8.0 if k % 100 < 4 else 1.0),
                          0.12 * math.sin(k / 9.0)], 2e-3).force for k in range(300)]

    assert np.max(np.abs(np.subtract(force(RigConfig().step), force(2.5e-5)))) < 0.2


def test_work_is_what_the_mass_gains_to_rounding():
    """Without damping and springs, the work is kinetic and potential energy at any step."""
    rig = make(MassSpring(mass=3.0, damping=0.0, stops=(-0.15, 0.5)), step=5e-3)
    moved = []
    for k in range(100):
        rig.step([0.2 if k < 10 else 0.0], 5e-3)
        truth = rig.truth
        x, v = truth.contraction + 0.15 * LENGTH, truth.strain_rate * LENGTH
        assert rig.work == pytest.approx(1.5 * v * v + 3.0 * GRAVITY * x, rel=1e-9, abs=1e-12)
        moved.append(truth.strain)
    assert 0.1 < max(moved) < 0.5


def test_work_on_a_test_machine_is_the_integral_of_the_force():
    """Of a force linear in the strain exactly; there and back it is none."""
    rig = make(Dynamometer(0.0), force=lambda strain: 100.0 - 400.0 * strain)
    rig.impose_strain(0.2, 1.0)
    rig.step([0.0], 0.2)
    assert rig.work == pytest.approx((100.0 * 0.2 - 200.0 * 0.2 ** 2) * LENGTH, rel=1e-9)
    rig.impose_strain(0.0, 0.5)
    rig.step([0.0], 0.4)
    assert rig.work == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('gauge', [(480e3, 460e3, 470e3), (460e3, 470e3, 480e3),
                                   (470e3, 480e3, 460e3)])
def test_of_several_chambers_above_the_trip_the_highest_is_named(gauge):
    """In whatever order they stand, with its pressure."""
    rig = make(Dynamometer(0.1), units=3)
    rig.state.air.pressure = [AMBIENT + each for each in gauge]
    rig.step([0.0] * 3, 1e-5)
    worst = int(np.argmax(gauge))
    assert rig.e_stopped.startswith(f'{rig.bundle.names[worst]} at 480 kPa')


def test_swelling_chambers_keep_their_air():
    """Isothermal p V of chambers that swell with pressure is the air that went in, no less."""
    rig = make(MassSpring(mass=2.0, damping=20.0), volume=swelling_volume, units=2,
               chamber=ChamberConfig(TUBE, 1.0, 1.0, 1.0))
    assert rig.record.swells

    def content():
        gauge = rig.truth.pressure
        volume = [swelling_volume(rig.truth.strain, np.maximum(gauge, 0.0), i) + TUBE
                  for i in range(2)]
        assert rig.state.air.volume == pytest.approx(volume, rel=1e-12)
        return float(np.sum((gauge + AMBIENT) * volume)) / RT

    start = content()
    for k in range(200):
        rig.step([0.3 * math.sin(k / 10.0), 0.2 * math.sin(k / 15.0)], 5e-3)
        air = rig.air
        assert content() - start == pytest.approx(air.delivered - air.exhausted,
                                                  abs=2e-6 * air.delivered)
    assert rig.truth.strain > 0.02


def test_filling_of_a_swelling_chamber_does_not_depend_on_the_step():
    """The chamber swells while it fills, not after each step."""
    def pressure(step):
        rig = make(Dynamometer(0.1), volume=swelling_volume, valve=QUICK, supply=STIFF, step=step)
        rig.state.air.spool = [0.3]
        return [float(rig.step([0.3], 0.01).pressure[0]) for _ in range(8)]

    coarse, fine = pressure(1e-2), pressure(5e-4)
    assert fine[-1] > 250e3
    assert coarse == pytest.approx(fine, abs=50.0)


def test_swelling_makes_a_chamber_softer():
    """With the valve shut p V^1.2 stays as it is, the volume that of strain and pressure."""
    rig = make(Dynamometer(0.1), volume=swelling_volume)
    rig.step([0.3], 0.05)
    rig.step([0.0], 0.05)

    def constant():
        p = float(rig.truth.pressure[0])
        return (p + AMBIENT) * (swelling_volume(rig.truth.strain, [p], 0) + TUBE) ** 1.2

    before, pressure = constant(), rig.truth.pressure[0]
    rig.impose_strain(0.02, 1.0)
    rig.step([0.0], 0.1)
    assert rig.truth.pressure[0] > pressure + 50e3
    assert constant() == pytest.approx(before, rel=1e-8)


@pytest.mark.parametrize('load', [
    MassSpring(mass=1.0, damping=1e4, stops=(-0.15, 0.5)),
    SeriesSpringMass(fitting_mass=0.1, spring_damping=1e3, stops=(-0.15, 0.5))],
    ids=['guide', 'tendon'])
def test_stiff_damping_of_a_load_does_not_swing_its_rate(load):
    """Damping that stops the end of the muscle in a tenth of a step brings it down at once."""
    rig = make(load)
    motion = rig.state.motion
    motion.strain, motion.strain_rate, motion.place = 0.05, 0.5, 0.05 * LENGTH - 1e-4
    rates = []
    for _ in range(5):
        rig.step([0.0], 1e-3)
        rates.append(rig.truth.strain_rate)
    assert abs(rates[0]) < 0.1
    assert np.all(np.abs(np.diff(rates)) < 0.15)


def test_stiff_drag_of_a_muscle_does_not_swing_its_rate():
    """A load that moves at the speed of a strong drag stays there, step by step."""
    rig = make(MassSpring(mass=1.0, damping=0.0, gravity=0.0, stops=(-0.15, 0.5)),
               force=lambda strain_rate: 50.0 - 2000.0 * strain_rate)
    rig.state.motion.strain_rate = 0.04
    for _ in range(4):
        rig.step([0.0], 1e-3)
    assert rig.truth.strain_rate == pytest.approx(0.025, abs=1e-4)


def test_force_of_time_acts_at_its_time():
    """A force that grows with time gives the speed of its integral."""
    rig = make(MassSpring(mass=2.0, damping=0.0, gravity=0.0, stops=(-0.15, 0.5)),
               force=lambda time: 100.0 * time)
    for _ in range(10):
        rig.step([0.0], 10e-3)
    assert rig.truth.strain_rate * LENGTH == pytest.approx(0.5 * 100.0 * 0.1 ** 2 / 2.0)
    assert rig.truth.force == pytest.approx(10.0)


# --- the compiled way --------------------------------------------------------------------------

def numbers(item):
    """Return every number of a state in a flat list."""
    if is_dataclass(item):
        return [x for field in fields(item) for x in numbers(getattr(item, field.name))]
    return [x for each in item for x in numbers(each)] if isinstance(item, list) else [item]


def steep_force(strain, strain_rate, pressure, unit, start, memory, after, dt):
    """Dry friction, a push from the other muscle, and a slow memory of the strain."""
    before = strain if start else memory[0]
    after[0] = before + (strain - before) * dt / (0.05 + dt)
    return (3.5e-4 * pressure[unit] * (1.0 - strain / 0.3) - 2e-5 * pressure[1 - unit]
            - 6.0 * math.tanh(strain_rate / 2e-3) - 40.0 * (strain - after[0]))


needs_numba = pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')


@needs_numba
@pytest.mark.parametrize('load', [
    Dynamometer(0.1), MassSpring(mass=4.0), SeriesSpringMass(mass=2.0, stiffness_against=300.0),
    Arm()], ids=lambda load: type(load).__name__)
def test_compiled_rig_is_the_plain_one_in_every_state(load):
    """Faults, trip, relief, emergency stop and memory: 1e-9 in every number of the state."""
    plant = ForeignPlant(steep_force, swelling_volume, LENGTH, [400e3] * 2, memory=1,
                         leak_rate=0.05, supply_resistance=1e6)
    plain = Rig(plant, RigConfig(load=load, supply=SupplyConfig(pressure=700e3)))
    broken = [Faults(exchanged_valves={0: 1}, leaking_valve={0: 0.05}, supply=0.8),
              Faults(stuck_valve={0: None}, leak={1: 0.3}, reversed_valve={1}, burst={0}),
              Faults(stuck_valve={1: 0.8})]
    records = [fault_record(each, 0.05, 2) for each in broken]
    rig, moved, state = (kernels.pack(each) for each in (plain.record, load.record, plain.state))
    packed, model = kernels.pack_all(records), plant.model(True)
    model.memory[:] = plain.model.memory
    step, reasons = kernels.compiled(rig_step), set()
    for k in range(360):
        if k == 330:
            plain.state.reason, plain.state.air.dumping = E_STOP, True
            state['reason'], state['air']['dumping'] = E_STOP, True
        commands = [0.3 * math.sin(k / 9.0), 0.25 * math.sin(k / 14.0)]
        fault = k // 100 % 3
        rig_step(plain.record, load.record, plain.model, plain.state, commands, records[fault],
                 2e-3)
        step(rig, moved, model, state, np.array(commands), packed[fault], 2e-3)
        reasons.add(plain.state.reason)
    written = copy.deepcopy(plain.state)
    kernels.unpack(state, written)
    assert numbers(written) == pytest.approx(numbers(plain.state), rel=1e-9, abs=1e-9)
    assert model.memory == pytest.approx(np.array(plain.model.memory), rel=1e-9)
    assert {OVER_PRESSURE, E_STOP} <= reasons
