# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Each fault does to readings, valves and air what its name says, and nothing else."""

import math

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import Faults, SensorConfig, SupplyConfig
from fam_bundle_ros.plant.faults import fault_record, UNITS
from fam_bundle_ros.units import si_factor

from . import rigs

DT = 5e-3
FILLED = [200e3, 120e3]


@pytest.fixture
def make(bundle):
    """Return a function that makes a rig with ideal sensors, filled, and then with faults."""
    def rig(faults=None, filled=FILLED, **config):
        made = rigs.make(bundle, **config)
        rigs.drive(made, filled, 120 * DT)
        made.faults = faults or Faults()
        return made
    return rig


def shut(rig, count):
    """Return so many readings with the valves shut."""
    return [rig.step([0.0, 0.0], DT) for _ in range(count)]


def filling(rig, count, command=(0.2, 0.0)):
    """Return so many pairs of reading and truth, mu1 filling."""
    return [(rig.step(command, DT), rig.truth) for _ in range(count)]


# --- readings ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('faults', 'expected'), [
    (Faults(gain={'mu1/pressure': 0.5}), lambda true, k: 0.5 * true),
    (Faults(offset={'mu1/pressure': -30e3}), lambda true, k: true - 30e3),
    (Faults(units={'mu1/pressure': 'psi'}), lambda true, k: true / 6894.757),
    (Faults(drift={'mu1/pressure': 20e3}), lambda true, k: true + 20e3 * k * DT),
    (Faults(units={'mu1/pressure': 'kPa'}, gain={'mu1/pressure': -1.0}),
     lambda true, k: -1e-3 * true),
    (Faults(gain={'mu1/pressure': 0.5}, offset={'mu1/pressure': -30e3}),
     lambda true, k: 0.5 * true - 30e3),
], ids=['gain', 'offset', 'units', 'drift', 'units and sign', 'gain and offset'])
def test_faulty_reading_is_a_function_of_the_true_one(make, faults, expected):
    """Gain, offset, unit and drift change the reading of their channel by the stated rule."""
    rig = make(faults)
    for k, (reading, truth) in enumerate(filling(rig, 20)):
        assert reading.pressure[0] == pytest.approx(expected(truth.pressure[0], k), abs=1e-6)
        assert reading.pressure[1] == pytest.approx(truth.pressure[1])
        assert reading.force == pytest.approx(truth.force)


@pytest.mark.parametrize('faults', [Faults(frozen={'mu1/pressure'}),
                                    Faults(silent={'mu1/pressure'})], ids=['frozen', 'silent'])
def test_frozen_reading_repeats_the_last_one_until_repaired(make, faults):
    """The reading stands still at its last value while the truth moves on, and then follows."""
    rig = make()
    before = rig.step([0.0, 0.0], DT).pressure[0]
    rig.faults = faults
    pairs = filling(rig, 20)
    assert {reading.pressure[0] for reading, _ in pairs} == {before}
    assert pairs[-1][1].pressure[0] > before + 20e3
    rig.faults = Faults()
    reading = rig.step([0.0, 0.0], DT)
    assert reading.pressure[0] == pytest.approx(rig.truth.pressure[0])


def test_plugged_reading_stays_and_has_its_noise(make):
    """The pressure at the sensor stays, the noise of its amplifier goes on."""
    rig = make(sensors=SensorConfig(pressure_noise=300.0, pressure_resolution=0.0))
    for _ in range(4):  # whatever the noise is at that moment
        rig.faults = Faults()
        rig.step([-0.3, 0.0], 0.1)
        rig.faults = Faults(plugged={'mu1/pressure'})
        rig.step([0.0, 0.0], DT)
        before = rig.truth.pressure[0]
        pairs = filling(rig, 60, (0.06, 0.0))
        shown = np.array([reading.pressure[0] for reading, _ in pairs])
        assert np.mean(shown) == pytest.approx(before, abs=4.0 * 300.0 / math.sqrt(60))
    assert np.std(shown) == pytest.approx(300.0, rel=0.3)
    assert pairs[-1][1].pressure[0] > before + 50e3
    rig.faults = Faults()
    assert rig.step([0.0, 0.0], DT).pressure[0] == pytest.approx(rig.truth.pressure[0], abs=2e3)


def test_range_of_a_sensor_ends_in_noise(make):
    """It shows what is true up to the end of its range, and that end above, each with noise."""
    rig = make(Faults(range_end={'mu1/pressure': 50e3}), [20e3, 20e3],
               sensors=SensorConfig(pressure_noise=300.0, pressure_resolution=0.0))
    pairs = filling(rig, 100, (0.06, 0.0))
    true, shown = (np.array([one.pressure[0] for one in column]) for column in zip(
        *((truth, reading) for reading, truth in pairs)))
    assert np.abs(shown - true)[true < 48e3] == pytest.approx(0.0, abs=1.5e3)
    assert np.mean(shown[true > 52e3]) == pytest.approx(50e3, abs=100.0)
    assert np.std(shown[true > 52e3]) == pytest.approx(300.0, rel=0.2)


def test_delayed_reading_shows_what_was(make):
    """A delay of 0.1 s shows the reading of 0.1 s ago, once it has lasted for so long."""
    rig = make(Faults(delay={'mu1/pressure': 0.1}))
    pairs = filling(rig, 60, (0.05, 0.0))
    for k in range(25, 60):
        assert pairs[k][0].pressure[0] == pytest.approx(pairs[k - 20][1].pressure[0])


@pytest.mark.parametrize('between', [Faults(), Faults(gain={'force': 2.0})],
                         ids=['repaired', 'another fault'])
def test_delay_begins_anew_after_a_repair(make, between):
    """A second fault does not show what was held up in the first one."""
    late = Faults(delay={'mu1/pressure': 0.1})
    rig = make(late)
    old = filling(rig, 30, (0.06, 0.0))[-1][1].pressure[0]
    rig.faults = between
    now = filling(rig, 30, (0.06, 0.0))[-1][1].pressure[0]
    assert now > old + 10e3
    rig.faults = late
    assert rig.step([0.0, 0.0], DT).pressure[0] > old + 0.9 * (now - old)


def test_spikes_are_single_readings_ten_times_a_second(make):
    """One reading in 0.1 s is off by the spike, all others are true."""
    rig = make(Faults(spike={'mu1/pressure': -150e3}))
    off = np.array([reading.pressure[0] - truth.pressure[0]
                    for reading, truth in filling(rig, 101, (0.0, 0.0))])
    assert sorted(set(np.round(off))) == [-150e3, 0.0]
    spikes = np.flatnonzero(off < -1.0)
    assert len(spikes) == 5
    assert set(np.diff(spikes)) == {20}


def test_a_dropout_blanks_the_reading_and_not_the_truth(make):
    """A lost sensor is nan in the readings only; the other channels show what is true."""
    rig = make(Faults(dropout={'mu1/pressure'}))
    reading = rig.step([0.5, 0.0], 0.02)
    assert math.isnan(reading.pressure[0])
    assert rig.truth.pressure[0] > FILLED[0]
    assert reading.pressure[1] == pytest.approx(rig.truth.pressure[1])


def test_lost_messages_leave_the_reading_before(make):
    """Of half of the messages the reader has nothing: it keeps what it had."""
    rig = make(Faults(lost={'mu1/pressure': 0.5}))
    shown = np.array([r.pressure[0] for r, _ in filling(rig, 300, (0.052, 0.0))])
    assert 0.35 < np.mean(np.diff(shown) == 0.0) < 0.65


def test_exchanged_sensors_show_each_other(make):
    """Both readings are true, each at the other's name."""
    rig = make(Faults(exchanged={'mu1/pressure': 'mu2/pressure'}))
    reading = rig.step([0.0, 0.0], DT)
    assert reading.pressure == pytest.approx(rig.truth.pressure[::-1])


def test_frozen_strain_has_no_rate(make):
    """What differentiates a frozen reading finds that nothing moves."""
    rig = make()
    rig.impose_strain(0.2, 0.1)
    moving = shut(rig, 60)[-1].strain_rate
    rig.faults = Faults(frozen={'strain'})
    assert moving > 0.05
    assert abs(shut(rig, 60)[-1].strain_rate) < 1e-3 * moving


def test_faults_of_readings_leave_the_truth_alone(make):
    """Instruments that lie change nothing in valves, air and force."""
    everything = Faults(
        gain={'force': 2.0}, delay={'strain': 0.1}, frozen={'supply'},
        exchanged={'mu1/pressure': 'mu2/pressure'}, spike={'force': 100.0}, dropout={'strain'})
    sound, broken = make(), make(everything)
    for _ in range(20):
        sound.step([0.3, -0.2], DT)
        broken.step([0.3, -0.2], DT)
    assert broken.truth.pressure.tolist() == sound.truth.pressure.tolist()
    assert broken.truth.force == sound.truth.force


# --- valves, muscles, supply -------------------------------------------------------------------

def test_reversed_valve_fills_when_told_to_exhaust(make):
    """The unit's pressure rises under a command of -1, also of the emergency stop."""
    rig = make(Faults(reversed_valve={0}))
    rig.step([-0.3, 0.0], 0.05)
    assert rig.truth.pressure[0] > FILLED[0] + 50e3
    assert rig.truth.pressure[1] == pytest.approx(FILLED[1], abs=1e3)


def test_exchanged_valves_obey_each_others_commands(make):
    """A command to fill mu1 fills mu2."""
    rig = make(Faults(exchanged_valves={0: 1}))
    rig.step([0.3, 0.0], 0.05)
    assert rig.truth.pressure[0] == pytest.approx(FILLED[0], abs=1e3)
    assert rig.truth.pressure[1] > FILLED[1] + 50e3


def test_a_stuck_valve_ignores_its_command(make):
    """One that is stuck where it is fills on against an exhaust command; the other obeys."""
    rig = make(filled=[0.0, 0.0])
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


def test_a_leak_empties_its_chamber_with_its_time_constant(make):
    """After five of them hardly any pressure is left; the other unit keeps its own."""
    rig = make(Faults(leak={1: 0.1}))
    rig.step([0.0, 0.0], 0.5)
    assert rig.truth.pressure[1] == pytest.approx(math.exp(-5.0) * FILLED[1], rel=0.15)
    assert rig.truth.pressure[0] == pytest.approx(FILLED[0], abs=1e3)


def test_leaking_valve_fills_its_unit_though_it_is_shut(make):
    """Air seeps in from the supply until the unit is at supply pressure, and comes from there."""
    supply = SupplyConfig(pressure=400e3)
    rig = make(Faults(leaking_valve={0: 0.1}), supply=supply)
    drawn = rig.air_mass
    rig.step([0.0, 0.0], 2.0)
    assert rig.truth.pressure[0] == pytest.approx(400e3, rel=0.01)
    assert rig.truth.pressure[1] == pytest.approx(FILLED[1], abs=1e3)
    assert rig.air_mass > drawn


def test_leaking_valve_keeps_the_balance_of_air(make):
    """What the regulator gave is what chambers, exhaust and manifold have."""
    rig = make(Faults(leaking_valve={0: 0.1}))
    before, manifold = rig.air.drawn - rig.air.delivered, rig.truth.supply
    rig.step([-0.2, 0.0], 1.0)
    stored = (rig.truth.supply - manifold) * rig.config.supply.volume / (287.0 * 293.15)
    assert rig.air.drawn - rig.air.delivered - before == pytest.approx(
        stored, abs=1e-3 * rig.air.drawn)


def test_burst_muscle_loses_its_pressure_at_once(make):
    """After three time constants 5 % of the gauge pressure is left; the other unit is sound."""
    rig = make(Faults(burst={0}))
    rig.step([0.0, 0.0], 0.03)
    assert rig.truth.pressure[0] == pytest.approx(math.exp(-3.0) * FILLED[0], rel=0.15)
    assert rig.truth.pressure[1] == pytest.approx(FILLED[1], abs=1e3)


def test_lost_supply_empties_what_is_open_to_it(make):
    """Where the hose comes off, the manifold goes to ambient, and units that are being filled."""
    rig = make(Faults(supply=0.0))
    drawn = rig.air.drawn
    rig.step([1.0, 0.0], 2.0)
    assert rig.air.drawn == drawn
    assert rig.truth.supply < 5e3
    assert rig.truth.pressure[0] < 5e3
    assert rig.truth.pressure[1] == pytest.approx(FILLED[1], abs=1e3)


def test_regulator_that_fails_gives_more_than_its_set_point(make):
    """A share above 1 raises the supply pressure."""
    rig = make(Faults(supply=1.4))
    shut(rig, 200)
    assert rig.truth.supply == pytest.approx(1.4 * rig.config.supply.pressure, rel=0.01)


# --- words -------------------------------------------------------------------------------------

@pytest.mark.parametrize(('faults', 'words'), [
    (Faults(gain={'mu3/pressure': 2.0}), "gain: no sensor channel 'mu3/pressure'; there are"),
    (Faults(exchanged={'force': 'forse'}), "no sensor channel 'forse'"),
    (Faults(burst={2}), 'burst of motor unit 2; there are 0 to 1'),
    (Faults(exchanged_valves={0: 5}), 'motor unit 5'),
    (Faults(exchanged={'force': 'force'}), 'with itself'),
    (Faults(units={'force': 'psi'}), "units of force is 'psi'; expected kN, kgf, lbf"),
    (Faults(lost={'force': 2.0}), 'lost of force is 2; expected a share from 0 to 1'),
    (Faults(delay={'force': -1.0}), 'delay of force is -1; expected 0 to 60 s'),
    (Faults(gain={'force': math.nan}), 'gain of force is nan; expected a number'),
    (Faults(leak={0: 0.0}), 'leak of mu1 is 0; expected a time constant above 0 s'),
    (Faults(stuck_valve={1: 3.0}), 'stuck_valve of mu2 is 3; expected -1 to 1'),
    (Faults(supply=-1.0), 'supply is -1; expected a number from 0'),
])
def test_impossible_fault_fails(faults, words):
    """A fault of what is not there, or a value that cannot be, is refused in one sentence."""
    with pytest.raises(InputError, match=words):
        fault_record(faults, 0.0, 2)


def test_faults_say_what_is_broken():
    """Every fault has its words, channel or motor unit first."""
    faults = Faults(frozen={'force'}, gain={'strain': 0.5}, burst={0}, stuck_valve={1: None},
                    exchanged_valves={0: 1}, noise_factor=2.0)
    assert faults.text == ('strain gain 0.5, force frozen, noise x2, mu2 stuck valve, '
                           'mu1 exchanged valves mu2, mu1 burst')
    assert Faults().text == ''


@pytest.mark.parametrize(('quantity', 'unit'), [
    (quantity, unit) for quantity, units in UNITS.items() for unit in units])
def test_a_wrong_unit_is_that_unit(quantity, unit):
    """A driver that sends a unit gives the numbers that the unit's definition gives."""
    like = {'pressure': 'Pa', 'force': 'N', 'strain': '1'}[quantity]
    assert 1.0 / UNITS[quantity][unit] == pytest.approx(si_factor(unit, like), rel=1e-6)


def test_faults_of_messages_can_be_left_to_the_process_that_sends_them():
    """What remains is a copy with all others; the original keeps its own."""
    faults = Faults(silent={'force'}, late={'strain': 0.1}, lost={'strain': 0.5},
                    gain={'force': 2.0}, frozen={'strain'})
    rest = faults.without_messages()
    assert rest == Faults(gain={'force': 2.0}, frozen={'strain'})
    rest.gain.clear()
    assert faults == Faults(silent={'force'}, late={'strain': 0.1}, lost={'strain': 0.5},
                            gain={'force': 2.0}, frozen={'strain'})
