# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The pressure loop on a chamber of its own (not the plant's): ISO 6358 valve, spool, noise."""

from dataclasses import replace
import math
from random import Random

import pytest

from fam_bundle_ros.control import PidConfig, PidGains, PressurePid
from fam_bundle_ros.control.valve_learning import (
    begin_readings,
    learn_dead_band,
    learn_flow,
    ValveLearningState,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    flow_for,
    mass_flow,
    pressure_rate,
    ValveFlow,
)

CONFIG = PidConfig(flow_lag=1.5e-3)


def choked_time(volume, supply, low, high):
    """Return the time from low to high gauge pressure at the valve's choked flow."""
    flow = mass_flow(3.93e-9, 0.3, supply + ATMOSPHERE, 0.0)
    return (high - low) / pressure_rate(ATMOSPHERE, volume, 0.0, flow)


@pytest.mark.parametrize('volume', [14e-6, 18e-6, 24e-6])
@pytest.mark.parametrize('supply', [500e3, 600e3])
def test_rise_is_nearly_as_fast_as_choked_flow_allows(chamber, volume, supply):
    """0 -> 300 kPa takes at most 1.2 times the choked 10-90 % time, overshoot below 2 %."""
    rows = chamber(volume=volume, supply=supply).run(300e3, 0.3)
    start = next(t for t, p, _ in rows if p > 30e3)
    end = next(t for t, p, _ in rows if p > 270e3)
    assert end - start < 1.2 * choked_time(volume, supply, 30e3, 270e3)
    assert max(p for _, p, _ in rows) < 1.02 * 300e3
    assert abs(rows[-1][1] - 300e3) < 1.5e3


@pytest.mark.parametrize('dead_band', [0.02, 0.04, 0.07])
def test_no_limit_cycle_at_rest_whatever_the_true_dead_band(chamber, dead_band):
    """At rest the pressure stands still, though the dead band is known only within a factor."""
    loop = chamber(dead_band=dead_band, noise=200.0)
    loop.run(200e3, 1.0)
    before = loop.air
    rest = [p for _, p, _ in loop.run(200e3, 3.0)]
    assert max(rest) - min(rest) < 1e3
    assert loop.air - before < 0.02 * before


def slow_ramp(t):
    """Return a setpoint that goes to and fro by 50 kPa/s between 150 and 250 kPa."""
    return 150e3 + 50e3 * (2.0 - abs(t % 4.0 - 2.0))


def quick_ramp(t):
    """Return a pressure that goes up by 200 kPa in 0.2 s, and down again, in Pa."""
    return 100e3 + 1e6 * abs((t + 0.2) % 0.4 - 0.2)


def worst_error(loop, duration):
    """Return how far a chamber is from `slow_ramp` at most, Pa."""
    return max(abs(p - slow_ramp(t)) for t, p, _ in loop.run(slow_ramp, duration))


def test_a_dead_band_that_is_wider_than_told_is_learnt_on_the_move(chamber):
    """The second time up and down the pressure turns round with half the error of the first."""
    config = PidConfig(flow_lag=11.5e-3)
    loop = chamber(dead_band=0.07, delay=10e-3, config=config, noise=100.0, period=2e-3,
                   pressure=150e3, gains=PidGains(20.0, 60.0, 0.0))
    first = worst_error(loop, 4.0)
    assert worst_error(loop, 4.0) < 0.5 * first
    loop.pid.reset()
    assert worst_error(loop, 4.0) < 0.5 * first


def test_a_step_with_a_dead_band_wider_than_told_does_not_overshoot(chamber):
    """What the integral made up for until the dead band was learnt is not given twice."""
    loop = chamber(volume=15e-6, dead_band=0.07, delay=20e-3, period=2e-3,
                   config=PidConfig(flow_lag=21.8e-3, volume=10e-6), gains=PidGains(22.0, 61.0))
    loop.volume_told = 10e-6
    assert max(p for _, p, _ in loop.run(340e3, 1.5)) < 1.03 * 340e3


def test_how_much_a_valve_passes_is_learnt(chamber):
    """After ten quick ramps half or one and a half of what was told is as good as all of it."""
    def error(told):
        loop = chamber(dead_band=0.0, delay=8e-3, period=2e-3, pressure=100e3,
                       gains=PidGains(35.0, 150.0), config=PidConfig(
                           valve=ValveFlow(told, dead_band=0.0), flow_lag=9.8e-3))
        loop.run(quick_ramp, 4.0)
        return max(abs(p - quick_ramp(t - 9.8e-3)) for t, p, _ in loop.run(quick_ramp, 0.4))
    assert max(error(7.86e-9), error(2.62e-9)) < 1.3 * error(3.93e-9)


@pytest.mark.parametrize(('share', 'towards'), [(0.8, -1.0), (1.2, 1.0)])
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_each_side_of_a_valve_learns_from_its_own_rates_only(side, share, towards):
    """A share of the rate comes: the flow of that side goes there, by its own size of a rate.

    The other side passes a tenth, which must not matter.
    """
    def learnt(other):
        valve, rate, dt = ValveLearningState(), side * 2e5, 2e-3
        full = {side: 1e6, -side: other}
        begin_readings(valve, 2e5)
        for k in range(1, 100):
            learn_dead_band(valve, 0.05, 2e5 + share * rate * dt * k, rate * dt * k, 0.0, 0.0,
                            full[1.0], full[-1.0], 0.01, dt)
            learn_flow(valve, side * dt * k, 0.0, full[1.0], full[-1.0], 0.01, dt)
        return {1.0: valve.fill_flow, -1.0: valve.vent_flow}
    found = learnt(1e5)
    assert 0.01 < towards * (found[side] - 1.0) < 0.2
    assert found[-side] == 1.0
    assert learnt(1e7) == found


def test_no_flow_is_learnt_from_noise_at_rest_nor_from_a_fault(chamber):
    """Noise moves it by less than 1 %, a supply that is gone for a second by less than 5 %."""
    loop = chamber(noise=350.0, pressure=200e3)
    loop.run(200e3, 3.0)
    band = loop.pid.state.learnt
    assert max(abs(band.fill_flow - 1.0), abs(band.vent_flow - 1.0)) < 0.01
    loop.supply = 0.0
    loop.run(300e3, 1.0)
    assert abs(band.fill_flow - 1.0) < 0.05


def test_a_dead_band_is_learnt_at_once_and_then_kept():
    """What the first 50 ms show is nearly believed; after a second of other readings, a third."""
    def learnt(band, missing, duration):
        begin_readings(band, 200e3)
        before = band.fill
        for k in range(1, round(duration / 2e-3) + 1):
            learn_dead_band(band, 1.0, 200e3, missing * 2e-3 * k, 2e-3 * k, 0.0, 1e6, 1e6, 5e-3,
                            2e-3)
        return band.fill - before
    new, old = ValveLearningState(), ValveLearningState()
    learnt(old, 0.0, 1.0)
    assert learnt(new, 2e4, 0.05) > 0.8 * 0.02
    assert learnt(old, 2e4, 0.05) < 0.4 * 0.02


def test_what_is_learnt_of_venting_is_the_mirror_of_filling():
    """Half of what is due comes, the integral makes up for some: both sides learn the same."""
    taken = {}
    for side in (1.0, -1.0):
        band = ValveLearningState()
        begin_readings(band, 200e3)
        taken[side] = [learn_dead_band(
            band, 0.05, 200e3 + side * 1e3 * k, side * 2e3 * k, side * 2e-3 * k, side * 1e5,
            900e3, 900e3, 0.05, 2e-3) for k in range(1, 200)]
        assert (band.fill if side > 0 else band.vent) > 0.005
        assert (band.vent if side > 0 else band.fill) == 0.0
    assert sum(taken[1.0]) > 1e3
    assert taken[-1.0] == pytest.approx([-each for each in taken[1.0]])


def test_of_a_dead_band_that_is_as_told_nothing_else_is_learnt(chamber):
    """Neither noise nor wide openings move it by a tenth of itself, nor steps of a setpoint."""
    loop = chamber(noise=100.0)
    loop.run(slow_ramp, 4.0)
    for k in range(20):
        loop.run(100e3 + 100e3 * (k % 2), 0.1)
    loop.run(lambda t: 200e3 + 2e3 * (t // 4e-3 % 50), 0.4)
    assert max(abs(loop.pid.state.learnt.fill), abs(loop.pid.state.learnt.vent)) < 4e-3


def test_a_pressure_that_never_answers_widens_the_dead_band_within_its_doubt(chamber):
    """A dead sensor opens the valve by what a dead band may be off besides, no more."""
    pid = PressurePid(config=CONFIG)
    for _ in range(2000):
        pid.update(101e3, 100e3, 2e-3)
    assert pid.state.learnt.fill == pytest.approx(0.5 * 0.04 + 0.02)
    gentle, learnt = (PressurePid(config=replace(CONFIG, ceiling=102e3, reach=0.1))
                      for _ in range(2))
    learnt.state.learnt.fill, learnt.state.learnt.fill_flow = 0.04, 0.4
    assert learnt.update(300e3, 100e3, 2e-3) < gentle.update(300e3, 100e3, 2e-3) + 1e-4


def test_valve_stays_shut_at_rest_without_noise(chamber):
    """A reading within the quiet band asks for no flow at all."""
    loop = chamber(pressure=150e3)
    loop.run(150e3, 0.2)
    assert all(command == 0.0 for _, _, command in loop.run(150e3, 0.5))


def test_integral_makes_up_for_a_leak(chamber):
    """With a leak the pressure is held within the quiet band and a little."""
    loop = chamber(leak=1.0)
    loop.run(250e3, 1.0)
    tail = [p for _, p, _ in loop.run(250e3, 2.0)]
    assert abs(sum(tail) / len(tail) - 250e3) < 1.5e3


def test_moving_setpoint_is_followed_by_feed_forward(chamber):
    """A sine of 100 kPa at 1 Hz is followed within 2 % of its size, after a delay of 5 ms."""
    def sine(t):
        return 200e3 + 100e3 * math.sin(2.0 * math.pi * t)
    rows = chamber().run(sine, 3.0)
    errors = [p - sine(t - 5e-3) for t, p, _ in rows if t > 1.0]
    assert max(map(abs, errors)) < 2e3


@pytest.mark.parametrize('mode', ['back_calculation', 'conditional_integration'])
def test_anti_windup_keeps_a_saturated_loop_from_overshooting(chamber, mode):
    """After a second at a setpoint above the supply, going down is not held up by the integral."""
    def fall_time(mode):
        loop = chamber(supply=250e3, config=replace(CONFIG, anti_windup=mode))
        # The loop does not know that the supply has sunk.
        loop.told_supply = 600e3
        loop.run(400e3, 1.0)
        rows = loop.run(150e3, 1.0)
        return next((t - rows[0][0] for t, p, _ in rows if p < 155e3), math.inf)
    assert fall_time(mode) < 0.2
    assert fall_time('none') > 2.0 * fall_time(mode)


@pytest.mark.parametrize('mode', ['back_calculation', 'conditional_integration'])
@pytest.mark.parametrize('fault', [{'supply': 150e3}, {'valve': ValveFlow(conductance=0.0)}])
def test_a_fault_that_passes_leaves_no_overshoot(chamber, mode, fault):
    """Two seconds without an answer are not learnt as a leak: afterwards it is a plain step."""
    loop = chamber(config=replace(CONFIG, anti_windup=mode))
    plain = max(p for _, p, _ in loop.run(300e3, 1.0))
    loop.run(0.0, 1.0)
    whole = {name: getattr(loop, name) for name in fault}
    vars(loop).update(fault)
    loop.run(300e3, 2.0)
    vars(loop).update(whole)
    rows = loop.run(300e3, 1.0)
    assert max(p for _, p, _ in rows) < plain + 2.5e3
    assert abs(rows[-1][1] - 300e3) < 1.5e3


@pytest.mark.parametrize('noise', [0.0, 350.0])
def test_followed_setpoint_does_not_stay_above_setpoint_and_reading(noise):
    """A sensor whose tube is off: a setpoint that was once asked for is not filled for ever."""
    pid = PressurePid(config=CONFIG)
    random = Random(1)
    for k in range(250):
        setpoint = 300e3 if k < 200 else 50e3
        pid.update(setpoint, random.gauss(0.0, noise), 2e-3, supply=500e3)
    assert pid.diagnostics.followed_setpoint == pytest.approx(50e3, abs=100.0)


@pytest.mark.parametrize('reading', [-3e3, 0.0, 5e3, 300e3])
def test_setpoint_of_zero_is_exhaust_whatever_the_sensor_shows(reading):
    """Open to exhaust within 50 ms of a setpoint of 0, and it stays so."""
    pid = PressurePid(config=CONFIG)
    random = Random(1)

    def run(setpoint, count):
        return [pid.update(setpoint, reading + random.gauss(0.0, 350.0), 2e-3, supply=500e3)
                for _ in range(count)]
    run(reading, 100)
    assert set(run(0.0, 500)[25:]) == {-1.0}


def test_first_fill_waits_for_no_more_than_the_spool(chamber):
    """From exhaust a chamber fills as soon as from a shut valve, but for 2 ms of spool travel."""
    def fill_time(rest):
        loop = chamber()
        loop.run(0.0, rest)
        return next(t for t, p, _ in loop.run(300e3, 0.2) if p > 270e3) - rest
    assert fill_time(0.5) < fill_time(0.0) + 2e-3


def test_an_emptied_chamber_follows_a_ramp_down_to_the_end(chamber):
    """A ramp to 0 is no jump to exhaust: the pressure falls as the setpoint does."""
    loop = chamber()
    loop.run(300e3, 0.5)
    rows = loop.run(lambda t: max(300e3 * (1.0 - (t - 0.5)), 0.0), 1.2)
    errors = [p - max(300e3 * (1.0 - (t - 0.505)), 0.0) for t, p, _ in rows]
    assert max(map(abs, errors)) < 2e3
    assert rows[-1][2] == -1.0


def test_gains_are_scheduled_with_volume(chamber):
    """Told the volume, the loop answers alike from 12 to 24 mL."""
    def overshoot_and_end(volume):
        rows = chamber(volume=volume, pressure=100e3).run(120e3, 0.1)
        return max(p for _, p, _ in rows), rows[200][1]
    small, large = overshoot_and_end(12e-6), overshoot_and_end(24e-6)
    assert small[0] == pytest.approx(large[0], abs=1e3)
    assert small[1] == pytest.approx(large[1], abs=2e3)


def test_derivative_acts_on_the_measurement_only():
    """A jump of the setpoint gives the same first command with and without derivative gain."""
    commands = []
    for d in (0.0, 0.3):
        config = replace(CONFIG, feed_forward=False, quiet_error=0.0)
        pid = PressurePid(PidGains(20.0, 0.0, d), config)
        pid.update(100e3, 100e3, 1e-3)
        commands.append(pid.update(150e3, 100e3, 1e-3))
    assert commands[0] == pytest.approx(commands[1])
    assert commands[0] > 0.0


def test_switching_on_goes_on_from_the_command_that_was_there():
    """After reset(u) the first command is u again, whatever the valve's dead band."""
    for command in (0.3, -0.2, 0.0):
        pid = PressurePid(config=CONFIG)
        pid.reset(command)
        assert pid.update(200e3, 200e3, 1e-3, supply=500e3) == pytest.approx(command, abs=0.02)


def test_a_command_that_was_taken_over_fades():
    """A tenth of a second after reset(u), at the setpoint, the valve is shut."""
    pid = PressurePid(config=CONFIG)
    pid.reset(0.3)
    commands = [pid.update(200e3, 200e3, 1e-3, supply=500e3) for _ in range(200)]
    assert commands[-1] == 0.0


def test_large_errors_act_at_once_and_small_ones_filtered():
    """The wanted rate is p times the error beyond the band, unfiltered where that is large."""
    config = PidConfig(feed_forward=False, quiet_error=100.0, filter_time=0.1)
    for jump, share in ((-40e3, 1.0), (-300.0, 0.0)):
        pid = PressurePid(PidGains(20.0, 0.0, 0.0), config)
        for pressure in (100e3, 100e3 + jump):
            pid.update(100e3, pressure, 1e-3)
        expected = share * 20.0 * (abs(jump) - 100.0)
        assert pid.diagnostics.wanted_rate == pytest.approx(expected)


def test_feedback_waits_for_what_is_on_its_way():
    """A chamber that follows a ramp behind lag and half a sample leaves little to feedback."""
    pid, rate, dt = PressurePid(config=PidConfig(flow_lag=4e-3)), 400e3, 2e-3
    pressure = 0.0
    for k in range(200):
        pid.update(rate * k * dt, pressure, dt)
        pressure = max(pid.diagnostics.followed_setpoint - rate * (4e-3 + 0.5 * dt), 0.0)
    assert pid.diagnostics.wanted_rate == pytest.approx(rate, rel=0.1)


def test_what_was_learnt_on_the_move_fades_at_rest(chamber):
    """After a leak has been mended, the integral is gone in half a second of rest."""
    loop = chamber(leak=1.0)
    loop.run(250e3, 1.5)
    learnt = loop.pid.diagnostics.integral
    for _ in range(500):
        loop.pid.update(250e3, 250e3, 1e-3, 500e3, 20e-6)
    assert abs(loop.pid.diagnostics.integral) < 0.05 * abs(learnt)


def test_a_moving_muscle_is_given_the_air_that_it_takes():
    """At the setpoint, the flow into a growing volume is p dV/dt/(R T)."""
    pid = PressurePid(config=CONFIG)
    for _ in range(3):
        command = pid.update(200e3, 200e3, 2e-3, 500e3, 20e-6, 2e-5)
    valve, absolute = CONFIG.valve, 200e3 + ATMOSPHERE
    flow = valve.flow(valve.opening(command), absolute, 500e3 + ATMOSPHERE)
    assert flow == pytest.approx(flow_for(absolute, 20e-6, 2e-5, 0.0), rel=1e-6)
    assert flow > 0.0


def test_followed_setpoint_does_not_ring_at_low_rates():
    """At 20 ms per sample the followed setpoint approaches from one side."""
    pid = PressurePid(config=CONFIG)
    pid.update(100e3, 100e3, 0.02)
    for _ in range(20):
        pid.update(104e3, 100e3, 0.02)
        assert pid.diagnostics.followed_setpoint <= 104e3


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_a_lost_reading_shuts_the_valve_and_leaves_no_trace(bad):
    """NaN gives 0 and the next good reading works as at the start."""
    pid = PressurePid(config=CONFIG)
    pid.update(200e3, 150e3, 1e-3)
    assert pid.update(200e3, bad, 1e-3) == 0.0
    assert math.isfinite(pid.update(200e3, 150e3, 1e-3))


@pytest.mark.parametrize('lost', [{'supply': math.nan}, {'volume': math.nan}, {'volume': 0.0},
                                  {'volume_rate': math.nan}, {'supply': math.inf}])
def test_a_lost_supply_or_volume_shuts_the_valve_and_leaves_no_trace(lost):
    """What the flow is reckoned from counts like the pressure: never a command that is NaN."""
    pid = PressurePid(config=CONFIG)
    pid.update(200e3, 150e3, 1e-3)
    assert pid.update(200e3, 150e3, 1e-3, **lost) == 0.0
    assert math.isfinite(pid.update(200e3, 150e3, 1e-3))


def test_a_clock_that_jumps_back_repeats_the_command():
    """Nothing is integrated over a time step that is not positive, or infinite."""
    pid = PressurePid(config=CONFIG)
    command = pid.update(200e3, 150e3, 1e-3)
    assert pid.update(200e3, 190e3, 0.0) == command
    assert pid.update(200e3, 190e3, -1.0) == command
    assert pid.update(200e3, 190e3, math.inf) == command
    assert math.isfinite(pid.update(200e3, 190e3, 1e-3))


def test_bad_settings_fails():
    """What cannot be meant is refused with the value that came."""
    with pytest.raises(InputError, match='-1'):
        PidGains(p=-1.0)
    with pytest.raises(InputError, match="'clamp'"):
        PidConfig(anti_windup='clamp')
    with pytest.raises(InputError, match='volume'):
        PidConfig(volume=0.0)
