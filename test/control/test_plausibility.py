# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Readings that disagree with the inflow, the supply or the force, without ROS."""

import itertools
import math

import pytest

from fam_bundle_ros.control import PidConfig, PressurePid
from fam_bundle_ros.control.agreement import ForceWatch, SupplyWatch
from fam_bundle_ros.control.plausibility import GENTLE, InflowConfig, InflowWatch
from fam_bundle_ros.control.safety import OVER_PRESSURE, trip_pressure
from fam_bundle_ros.model import load_model
from fam_bundle_ros.model.pneumatics import ATMOSPHERE
from fam_bundle_ros.plant import (
    Dynamometer,
    linearise,
    Rig,
    RigConfig,
    SensorConfig,
    SupplyConfig,
    ValveConfig,
)
from fam_bundle_ros.resources import config_path

PERIOD = 5e-3
SUPPLY = 600e3
#: Pa above the trip: what flows in at full opening in two control periods, at 0.1 strain.
TWO_PERIODS = 2.0 * PERIOD * linearise(396e3, 19e-6, SUPPLY).fill_gain


class Loop:
    """Two pressure loops with their inflow watches on the simulated rig, no recruitment."""

    def __init__(self, noise=1.0, conductance=1.0, delay=0, seed=0):
        self.bundle = load_model(config_path('models/spie2021_plain.yaml'))
        self.rig = Rig(self.bundle, RigConfig(
            load=Dynamometer(strain=0.1), supply=SupplyConfig(pressure=SUPPLY), step=PERIOD / 2,
            valve=ValveConfig(conductance=3.93e-9 * conductance), trip_pressure=1e7,
            sensors=SensorConfig(pressure_noise=350.0 * noise)), seed=seed)
        pid = PidConfig()
        most = float(self.bundle.max_pressure[0])
        self.trip = trip_pressure(most)
        self.loops = [PressurePid(config=pid) for _ in range(2)]
        self.watches = [InflowWatch(f'mu{i + 1}', InflowConfig(
            pid.valve, SUPPLY, most, self.trip - most, pid.transport_delay + 2e-3 + 3 * PERIOD,
            PERIOD, 4.0 * pid.quiet_error)) for i in range(2)]
        self.late = [[-1.0, -1.0]] * delay
        self.cause = self.text = ''
        self.highest = self.time = 0.0

    def run(self, seconds, setpoint, shown=lambda p: p, valves=lambda c: c, strain=None):
        """Run until a watch fires or the time is over; return whether one fired."""
        before = self.bundle.gas_volume([self.rig.truth.strain])[0] + 5e-6
        for _ in range(round(seconds / PERIOD)):
            if strain is not None:
                self.rig.impose_strain(strain(self.time), 1.0)
            truth, pressure = self.rig.truth, shown(self.rig.readings.pressure.tolist())
            volume = self.bundle.gas_volume([truth.strain])[0] + 5e-6
            swept, before = volume - before, volume
            commands = []
            for i in range(2):
                cause, text = self.watches[i].see(self.time, pressure[i], float(volume[i]))
                if pressure[i] > self.trip:
                    cause, text = OVER_PRESSURE, f'{pressure[i]} Pa'
                if cause and not self.cause:
                    self.cause, self.text = cause, text
                command = self.watches[i].forced
                if command is not None:
                    self.loops[i].reset()
                else:
                    command = self.loops[i].update(setpoint(self.time)[i], pressure[i], PERIOD,
                                                   None, float(volume[i]),
                                                   float(swept[i]) / PERIOD)
                if self.watches[i].gentle:
                    command = max(command, -GENTLE)
                self.watches[i].commanded(command)
                commands.append(command)
            self.late.append(commands)
            self.rig.step(valves(self.late.pop(0)), PERIOD)
            self.time += PERIOD
            self.highest = max(self.highest, *self.rig.truth.pressure)
            if self.cause:
                return True
        return False


def sine(frequency, mean=180e3, size=140e3):
    """Return setpoints of both units that go up and down in turn."""
    def setpoint(time):
        swing = size * math.sin(2.0 * math.pi * frequency * time)
        return mean + swing, mean - swing
    return setpoint


def steps(time):
    """Return setpoints that jump, as transitions make them."""
    k = int(time / 0.4)
    return ((0.0, 250e3, 50e3, 200e3, 0.0, 120e3)[k % 6],
            (240e3, 0.0, 100e3, 0.0, 250e3, 20e3)[k % 6])


def ramp(time):
    """Return a slow ramp and a slower one."""
    return min(100e3 * time, 330e3), min(30e3 * time, 330e3)


@pytest.mark.parametrize('conductance', [0.7, 1.3])
@pytest.mark.parametrize('delay', [0, 2])
@pytest.mark.parametrize('setpoint', [sine(0.2), sine(2.0), steps, ramp])
def test_no_false_alarm_in_normal_work(setpoint, delay, conductance):
    """Noise doubled, sines, jumps, a valve 30 % off, late commands, a moving muscle: silence."""
    loop = Loop(noise=2.0, conductance=conductance, delay=delay)
    assert not loop.run(3.0, setpoint), loop.text
    loop = Loop(noise=2.0, conductance=conductance, delay=delay, seed=1)
    assert not loop.run(3.0, setpoint, strain=lambda t: 0.1 + 0.06 * math.sin(9.4 * t)), loop.text


@pytest.mark.parametrize(('delay', 'conductance'), [(0, 1.3), (1, 1.2), (2, 1.2)])
def test_overshoot_at_the_largest_pressure_is_no_fault(delay, conductance):
    """The valve explains a rise that goes on above the last setpoint while commands are late."""
    loop = Loop(noise=2.0, delay=delay, conductance=conductance)
    assert not loop.run(1.6, lambda t: (344e3, 100e3) if t % 0.8 < 0.4 else (0.0, 344e3)), \
        loop.text
    assert loop.highest > 350e3


def test_a_spike_is_no_fault():
    """One reading far off, up or down, is left to the other watches."""
    for size in (-60e3, 120e3):
        loop = Loop()
        loop.run(0.5, lambda t: (150e3, 0.0))
        assert not loop.run(PERIOD, lambda t: (150e3, 0.0), lambda p, s=size: [p[0] + s, p[1]])
        assert not loop.run(0.5, lambda t: (150e3, 0.0))
    loop = Loop()
    loop.run(0.5, lambda t: (344.6e3, 0.0))
    for _ in range(10):
        # The way back from a spike at the top is no rise.
        assert not loop.run(PERIOD, lambda t: (344.6e3, 0.0), lambda p: [p[0] - 60e3, p[1]])
        assert not loop.run(0.1, lambda t: (344.6e3, 0.0))


@pytest.mark.parametrize('factor', [1e-3, 1.0 / 6894.8, 1e-5, 0.5, 0.0])
def test_a_wrong_unit_is_found_by_half_a_fill(factor):
    """kPa, psi, bar in place of Pa, a reading of half: found before much air is in."""
    loop = Loop(delay=1)
    assert loop.run(1.0, lambda t: (300e3, 0.0), lambda p: [factor * x for x in p])
    assert 'mu1 shows' in loop.text
    assert loop.highest < 0.5 * 344.7e3


def test_exchanged_channels_are_found_by_half_a_fill():
    """The pressure rises where no air was let in."""
    loop = Loop(delay=1)
    assert loop.run(1.0, lambda t: (300e3, 0.0), lambda p: p[::-1])
    assert loop.cause == 'UNEXPLAINED_PRESSURE'
    assert loop.highest < 0.5 * 344.7e3


def test_a_reversed_valve_is_found_by_half_a_fill():
    """Opened to exhaust little at first: it fills, and that is seen."""
    loop = Loop(delay=1)
    loop.late = [[0.0, 0.0]]
    assert loop.run(1.0, lambda t: (0.0, 0.0), valves=lambda c: [-x for x in c])
    assert loop.cause == 'UNEXPLAINED_PRESSURE'
    assert loop.highest < 0.5 * 344.7e3


@pytest.mark.parametrize('setpoint', [sine(0.5), sine(1.0), sine(2.0)])
@pytest.mark.parametrize('at', [0.8, 1.0, 1.2, 1.4, 1.6])
def test_a_frozen_reading_in_a_sine_is_found_in_time(setpoint, at):
    """At any phase: the bounds leave what the valve lets in over the longest delay."""
    loop = Loop(delay=1)
    assert not loop.run(at, setpoint)
    frozen = loop.rig.readings.pressure.tolist()
    assert loop.run(2.0, setpoint, lambda p: frozen)
    assert loop.highest < loop.trip + TWO_PERIODS


def test_a_reading_that_becomes_half_is_found():
    """The drop has no exhaust to explain it."""
    loop = Loop(delay=1)
    assert not loop.run(1.0, sine(0.5))
    assert loop.run(2.0, sine(0.5), lambda p: [0.5 * x for x in p])
    assert loop.highest < loop.trip + TWO_PERIODS


@pytest.mark.parametrize('opening', [0.1, 0.5, 1.0])
def test_a_valve_that_hangs_open_is_found(opening):
    """The pressure goes where no command sends it; two periods later nobody can be faster."""
    loop = Loop(delay=1)
    loop.run(1.0, lambda t: (250e3, 0.0))
    assert loop.run(1.0, lambda t: (250e3, 0.0), valves=lambda c: [opening, c[1]])
    assert loop.highest < loop.trip + opening * TWO_PERIODS


def test_a_valve_that_hangs_open_at_the_top_is_found_at_once():
    """The first reading that shows it rises tells where it leads: no second one is needed."""
    loop = Loop()
    loop.run(1.0, lambda t: (344e3, 0.0))
    before = loop.rig.truth.pressure[0]
    assert loop.run(1.0, lambda t: (344e3, 0.0), valves=lambda c: [1.0, c[1]])
    assert 'before the valve can react' in loop.text
    # The rig made a step before that reading and one more with its answer.
    assert loop.highest < before + TWO_PERIODS


@pytest.mark.parametrize('rise', [lambda t: 25e3 * t, lambda t: 6e3 * (t > 0.5)])
def test_a_small_rise_at_the_top_leads_nowhere(rise):
    """Slow, or once by a little more than noise: what leads above the trip is fast and large."""
    watch = InflowWatch('mu1', Loop().watches[0].config)
    for k in range(220):
        assert watch.see(k * PERIOD, 346e3 + rise(k * PERIOD), 19e-6)[0] == ''
        watch.commanded(0.0)


@pytest.mark.parametrize(('share', 'hinted'), [(0.0, False), (0.4, True)])
def test_a_sensor_that_responds_too_little_hints_at_the_rig_s_parameters(share, hinted):
    """A dead one does not."""
    loop = Loop()
    assert loop.run(3.0, lambda t: (200e3, 0.0), shown=lambda p: [share * p[0], p[1]])
    assert loop.cause == 'NO_RESPONSE'
    assert ('conductance or gas volume may be wrong' in loop.text) == hinted


def test_the_supply_s_reading_cannot_disarm_it():
    """A supply that is shown as zero expects no less air than its parameter."""
    watches = [InflowWatch('mu1', Loop().watches[0].config) for _ in range(2)]
    found = []
    for watch, supply in zip(watches, (math.nan, 0.0)):
        for k in range(100):
            if watch.see(k * PERIOD, 0.0, 20e-6, supply)[0]:
                found.append(k)
                break
            watch.commanded(0.0 if watch.holding else 1.0)
    assert found[0] == found[1]


@pytest.mark.parametrize('filled', [1, 2, 3])
def test_commands_that_came_too_late_are_no_fault(filled):
    """A simulator, or rig, that was held up counts on evenly, its valve still as it was."""
    watch = InflowWatch('mu1', Loop().watches[0].config)
    for k in range(200):
        gap = 0.5 if k == filled else PERIOD
        # Air from the last command before the pause is all that ever comes in.
        shown = 44e3 * min(k, 1)
        said = watch.see(k * PERIOD, shown, 20e-6, gap=gap)
        assert said == ('', ''), said
        watch.commanded(1.0 if k < filled else 0.0)


@pytest.mark.parametrize('missed', [1, 2, 3, 4])
def test_a_command_that_a_rig_missed_is_no_fault(missed):
    """A driver that reads commands by its own clock: one is gone before it was looked at."""
    loop, count = Loop(), itertools.count()
    before = [[0.0, 0.0]]

    def valves(commands):
        if next(count) != missed:
            before[0] = commands
        return before[0]
    assert not loop.run(1.0, lambda t: (250e3, 0.0), valves=valves), loop.text


@pytest.mark.parametrize('filled', [0.005, 0.01, 0.015])
def test_a_rig_that_is_held_up_is_no_fault(filled):
    """A gap between readings, in which nothing moved, right after the valve was opened."""
    loop = Loop()
    loop.run(1.0, lambda t: (50e3, 0.0))
    assert not loop.run(filled, lambda t: (250e3, 0.0)), loop.text
    loop.time += 0.045
    assert not loop.run(1.0, lambda t: (250e3, 0.0)), loop.text


def test_a_rig_that_vents_by_itself_is_no_fault():
    """Commands were lost for so long that the driver exhausted, as docs/how_to/driver.md asks."""
    loop = Loop()
    loop.run(1.0, lambda t: (200e3, 0.0))
    loop.time += 0.4
    for _ in range(80):
        loop.rig.step([-1.0, -1.0], PERIOD)
    assert not loop.run(1.0, lambda t: (200e3, 0.0)), loop.text


@pytest.mark.parametrize('pause', [0.11, 0.12, 0.14])
def test_an_exhaust_of_the_driver_lasts_until_the_next_command_acts(pause):
    """The controllers stood still for a little longer than a driver waits for commands, 0.1 s."""
    loop, count = Loop(), itertools.count()
    loop.run(1.0, lambda t: (250e3, 0.0))
    loop.time += pause
    late = round((pause - 0.1 + loop.watches[0].config.lag) / PERIOD)

    def valves(commands):
        return commands if next(count) >= late else [-1.0, -1.0]
    assert not loop.run(1.0, lambda t: (250e3, 0.0), valves=valves), loop.text


def test_supply_agrees_within_a_fifth():
    """A little droop is in order; half or double, for longer than the patience, is not."""
    watch = SupplyWatch(600e3, 0.2)
    for k, shown in enumerate((600e3, 500e3, 700e3, 300e3, 600e3)):
        watch.see(0.1 * k, shown)
    assert watch.text == ''
    for shown in (300e3, 1200e3):
        watch = SupplyWatch(600e3, 0.2)
        assert [watch.see(t, shown) for t in (0.0, 0.1, 0.3)] == [False] * 3
        assert f'shows {shown / 1e3:.0f} kPa' in watch.text


@pytest.fixture
def force_watch():
    """Return a watch over the paper's bundle, and its force at 0.1 strain."""
    bundle = load_model(config_path('models/spie2021_plain.yaml'))
    model = bundle.model(False)

    def unit_force(unit, strain, pressure):
        return model.force(unit, strain, 0.0, [pressure] * 2, 0.0, 0.0, True, model.shape,
                           model.parameters, model.tables, model.memory, model.after)
    return ForceWatch(unit_force, 16.0, 0.015), lambda p: float(bundle.force(0.1, p))


@pytest.mark.parametrize('true', [240e3, 300e3, 396e3])
def test_a_force_that_no_pressure_explains_is_found(force_watch, true):
    """Pressures that show half of what is there are told by the force, however slowly it rose."""
    watch, force = force_watch
    said = [watch.see(0.005 * k, force([true, 0.0]), 0.1, [0.5 * true, 0.0]) for k in range(6)]
    assert said[:3] == [''] * 3
    assert 'pressures shown give' in said[-1]


@pytest.mark.parametrize('true', [0.0, 60e3, 120e3, 200e3, 344e3])
@pytest.mark.parametrize('gain', [0.93, 1.0, 1.07])
def test_a_model_that_is_a_little_wrong_is_no_fault(force_watch, true, gain):
    """Units 7 % off and 5 N besides, on either unit, in tension and push-back."""
    watch, force = force_watch
    for pressures in ([true, 0.0], [200e3, true]):
        for bias in (-5.0, 5.0):
            measured = gain * force(pressures) + bias
            assert all(not watch.see(0.005 * k, measured, 0.1, pressures, True)
                       for k in range(40))


def test_a_muscle_that_folds_where_its_model_pushes_is_no_fault():
    """A model without buckling believes that an empty unit pushes with 30 N; it does with 3 N."""
    watch = ForceWatch(lambda unit, strain, pressure: pressure / 4e3 - 30.0 * unit, 10.0, 0.02)
    for k in range(10):
        assert watch.see(0.01 * k, 25.0 - 3.0, 0.1, [100e3, 0.0]) == ''
    watch.see(0.1, 60.0, 0.1, [100e3, 0.0])
    assert watch.see(0.2, 60.0, 0.1, [100e3, 0.0])


def test_a_force_that_is_too_low_is_a_fault_only_where_the_target_is_missed(force_watch):
    """A muscle may be weaker than its model; a controller that gets nowhere is told why."""
    watch, force = force_watch
    shown = [340e3, 340e3]
    for off_target in (False, True):
        said = [watch.see(0.01 * k, 0.3 * force(shown), 0.1, shown, off_target) for k in range(9)]
        assert ('give at least' in said[-1]) == off_target
    # the clock was set back: the patience begins anew
    assert watch.see(-5.0, 0.3 * force(shown), 0.1, shown, True) == ''
    assert watch.see(-4.9, 0.3 * force(shown), 0.1, shown, True)


@pytest.mark.parametrize('gain', [0.93, 1.0, 1.07])
def test_the_force_tells_which_unit_is_above_its_limit(force_watch, gain):
    """A reading that drifted down at the top; not a model 7 % off, whatever the pressures."""
    watch, force = force_watch
    limit = [396e3, 396e3]
    assert watch.above(force([440e3, 72e3]), 0.1, [340e3, 72e3], limit) == 0
    for shown in ([0.0, 0.0], [340e3, 0.0], [340e3, 340e3], [200e3, 60e3]):
        assert watch.above(gain * force(shown) + 2.0, 0.1, shown, limit) is None


def test_only_commands_that_can_have_acted_explain_a_pressure():
    """A command younger than the valve's delay let nothing in; the one before it still did."""
    made = InflowWatch('mu1', Loop().watches[0].config)
    made._clock = 1.0
    made._commands.clear()
    made._commands.extend([(0.5, -0.4), (0.75, 0.3), (0.9, 1.0)])
    assert made._range_of_commands(0.15, 0.0) == (0.3, 1.0)
    assert made._range_of_commands(0.15, 0.2) == (-0.4, 0.3)
    assert made._range_of_commands(0.15, 0.3) == (-0.4, -0.4)


@pytest.mark.parametrize('share', [-1e-3, 1e-3])
def test_the_bounds_of_a_motion_hold_slow_and_quick_compression(share):
    """P V^n is constant, n from 1 (slow) to 1.4 (quick): a chamber that changes by 0.1 %."""
    watch, pressure, volume = Loop().watches[0], 200e3, 20e-6
    low, high = (watch._motion(pressure, volume, share * volume, most) for most in (False, True))
    changes = [(pressure + ATMOSPHERE) * ((1.0 + share) ** -exponent - 1.0)
               for exponent in (1.0, 1.2, 1.4)]
    assert low - 2.0 < min(changes) < max(changes) < high + 2.0
    assert high - low == pytest.approx(max(changes) - min(changes), rel=0.05)
