# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is late on a rig: dead time and lag of readings and commands, backlash, a narrow line."""

import math

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import ATMOSPHERE, RT
from fam_bundle_ros.plant import (
    ChamberConfig,
    Dynamometer,
    Rig,
    RigConfig,
    SensorConfig,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.plant.lines import DelayLine, lag, put, read_between, read_held

IDEAL = vars(SensorConfig.ideal())
PERIOD = 2e-3


def through_line(read, delay, period, signal, count=400):
    """Return what comes out of a delay line that is read whenever a sample enters."""
    line, out, found = DelayLine.empty(1), [0.0], []
    for k in range(count):
        put(line, k * period, [signal(k * period)], delay)
        read(line, k * period - delay, out)
        found.append(out[0])
    return np.array(found)


@pytest.mark.parametrize('delay', [2e-3, 5e-3, 7.3e-3, 0.05, 0.3])
def test_a_line_shows_what_was_a_delay_ago(delay):
    """Linear between samples, also of delays that are no multiple of the period, or very long."""
    found = through_line(read_between, delay, PERIOD, math.sin)
    time = PERIOD * np.arange(400)
    late = time > delay
    assert found[late] == pytest.approx(np.sin(time[late] - delay), abs=5e-5)
    assert not found[~late].any()


def test_a_held_signal_comes_in_steps_a_delay_later():
    """Commands hold until the next one; none has arrived before the first."""
    found = through_line(read_held, 5e-3, PERIOD, lambda t: 1.0 + round(t / PERIOD), 10)
    assert found.tolist() == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]


def test_lag_is_exact_for_a_ramp_in_any_number_of_steps():
    """A first-order lag follows a ramp r t at r (t - T (1 - exp(-t/T)))."""
    time_constant, rate, end = 0.02, 3.0, 0.05
    for count in (1, 7, 50):
        dt, state = end / count, 0.0
        for k in range(count):
            state = lag(state, rate * k * dt, rate * (k + 1) * dt, dt, time_constant)
        assert state == pytest.approx(
            rate * (end - time_constant * (1.0 - math.exp(-end / time_constant))), rel=1e-12)
    assert lag(5.0, 0.0, 2.0, 1e-3, 0.0) == 2.0


def drive(bundle, **config):
    """Return times, true and shown values of a rig that is filled and vented, by channel."""
    config.setdefault('sensors', SensorConfig.ideal())
    rig = Rig(bundle, RigConfig(load=Dynamometer(strain=0.1), **config))
    rows = []
    for k in range(120):
        command = 0.4 if k < 40 else 0.0 if k < 60 else -0.3
        rig.step([command, 0.0], PERIOD)
        truth, shown = rig.truth, rig.readings
        rows.append((truth.time, truth.force, truth.pressure[0], shown.force, shown.pressure[0]))
    return np.array(rows).T, rig


def test_readings_are_the_truth_of_a_delay_ago(bundle):
    """Force and pressure come 6 ms late, unchanged."""
    (_, force, pressure, shown_force, shown), _ = drive(
        bundle, sensors=SensorConfig(**{**IDEAL, 'delay': 3 * PERIOD}))
    assert shown[3:] == pytest.approx(pressure[:-3], rel=1e-12)
    assert shown_force[3:] == pytest.approx(force[:-3], rel=1e-12)


def test_commands_act_a_delay_later(bundle):
    """The same pressures as without the dead time, 6 ms later."""
    (_, _, prompt, _, _), _ = drive(bundle)
    (_, _, late, _, _), _ = drive(bundle, valve=ValveConfig(delay=3 * PERIOD))
    assert late[3:] == pytest.approx(prompt[:-3], rel=1e-9, abs=1e-3)
    assert abs(late - prompt).max() > 5e3


def test_lag_of_each_channel_is_its_own(bundle):
    """With a lag in force alone pressure is shown as it is, force behind by about the lag."""
    (_, force, pressure, shown_force, shown), _ = drive(
        bundle, sensors=SensorConfig(**{**IDEAL, 'force_lag': 4e-3}))
    assert shown == pytest.approx(pressure, rel=1e-12)
    rising = slice(20, 38)
    behind = (force - shown_force)[rising] / np.gradient(force, PERIOD)[rising]
    assert np.median(behind) == pytest.approx(4e-3, rel=0.15)


def test_a_spool_with_backlash_turns_late_and_stays_open(bundle):
    """It opens half the backlash less; told to shut, it stays ajar by as much."""
    rigs = [Rig(bundle, RigConfig(load=Dynamometer(strain=0.1), valve=ValveConfig(hysteresis=h)))
            for h in (0.0, 0.2)]
    for rig in rigs:
        rig.step([0.3, -0.5], 0.05)
    assert [rig.state.air.spool[0] for rig in rigs] == pytest.approx([0.3, 0.2], abs=1e-6)
    for rig in rigs:
        rig.step([0.0, -0.45], 0.05)
    assert [rig.state.air.spool[0] for rig in rigs] == pytest.approx([0.0, 0.1], abs=1e-6)
    assert rigs[1].state.air.spool[1] == pytest.approx(-0.4, abs=1e-6)


def narrow(**more):
    """Return a line of two volumes, isothermal, so that p V is air."""
    return ChamberConfig(tube_volume=7e-6, inflow_exponent=1.0, outflow_exponent=1.0,
                         volume_exponent=1.0, **more)


def test_a_narrow_line_holds_all_the_air_that_came(bundle):
    """Air in line and muscle is what the valve let in, less what it let out."""
    _, rig = drive(bundle, chamber=narrow(line_volume=3e-6, line_conductance=2e-9),
                   supply=SupplyConfig(volume=1.0))
    air, balance = rig.state.air, rig.air
    volume = float(bundle.gas_volume(0.1)[0]) + 4e-6
    for unit in range(2):
        assert air.volume[unit] == pytest.approx(volume, rel=1e-12)
    held = sum((air.pressure[i] - ATMOSPHERE) * volume + (air.line[i] - ATMOSPHERE) * 3e-6
               for i in range(2)) / RT
    assert held == pytest.approx(balance.delivered - balance.exhausted, rel=1e-6)


def test_the_gauge_of_a_narrow_line_runs_ahead_of_the_muscle(bundle):
    """While filling it shows more than the muscle has, at rest the same; a wide line is as one."""
    chamber = narrow(line_volume=3e-6, line_conductance=2e-9)
    rig = Rig(bundle, RigConfig(load=Dynamometer(strain=0.1), chamber=chamber,
                                sensors=SensorConfig.ideal()))
    ahead = rig.step([0.4, 0.0], 0.01).pressure[0] - rig.state.gauge[0]
    assert ahead > 20e3
    rig.step([0.0, 0.0], 0.5)
    assert rig.readings.pressure[0] == pytest.approx(rig.state.gauge[0], rel=1e-6)
    assert rig.truth.force == pytest.approx(
        float(bundle.force(0.1, rig.readings.pressure)), rel=1e-6)
    (_, _, one, _, _), _ = drive(bundle, chamber=narrow())
    (_, _, wide, _, _), _ = drive(bundle, chamber=narrow(line_volume=3e-6, line_conductance=1e-6))
    assert wide == pytest.approx(one, abs=300.0)


@pytest.mark.parametrize(('make', 'word'), [
    (lambda: SensorConfig(delay=-1e-3), 'delay'),
    (lambda: SensorConfig(force_lag=math.nan), 'force_lag'),
    (lambda: ValveConfig(hysteresis=0.6), 'hysteresis'),
    (lambda: ValveConfig(delay=-1.0), 'delay'),
    (lambda: ChamberConfig(line_volume=6e-6), 'line_volume'),
    (lambda: ChamberConfig(line_conductance=0.0), 'line_conductance'),
])
def test_what_no_rig_has_fails(make, word):
    """Values out of range are refused by their name."""
    with pytest.raises(InputError, match=word):
        make()
