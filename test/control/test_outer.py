# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The force and strain loops, apart from the rest."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.control import LoadModel, OuterConfig
from fam_bundle_ros.control.outer_loop import (
    FORCE,
    outer_settings,
    outer_step,
    OuterState,
    STRAIN,
    uncertainties,
)
from fam_bundle_ros.control.saturation import FREE, GAP, HIGH, LOW
from fam_bundle_ros.control.signals import MeasurementRecord
from fam_bundle_ros.control.strain_gains import RATE_LAG
from fam_bundle_ros.control.strain_loop import gain_at, holding_force, present_stiffness

DT = 2e-3
#: s: how late a command is on average that is held for a sample.
HOLD = 0.5 * DT


class Loop:
    """An outer loop on the paper's bundle, told measurements and references."""

    def __init__(self, bundle, load=LoadModel(), **config):
        self.settings = outer_settings(OuterConfig(**config), load, bundle)
        self.state = OuterState()

    def run(self, value, force=0.0, strain=0.1, believed=0.0, duration=DT, **more):
        """Return the last target."""
        given = {'kind': FORCE, 'rate': 0.0, 'saturated': FREE, 'speed': 0.0, 'lag': 0.0,
                 'lead': 0.0, 'asked': believed, 'reach': 4.0, **more}
        for _ in range(round(duration / DT)):
            outer_step(self.settings, self.state,
                       MeasurementRecord(force, strain, given['speed'], [0.0, 0.0]), believed,
                       given['asked'], given['reach'], given['kind'], value, given['rate'],
                       given['saturated'], given['lag'], 0.0, given['lead'], DT)
        return self.state.target


def test_what_the_model_lacks_is_in_the_demand_within_the_lag_of_the_loop(paper_bundle):
    """After four lags (dead time, pressures, sample) nearly all of it is asked for."""
    loop = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD, force_gain=0.0)
    loop.run(40.0, force=40.0, believed=40.0, duration=1.0)
    target = loop.run(40.0, force=37.0, believed=40.0, duration=4.0 * 12e-3)
    assert target.force - 40.0 == pytest.approx(3.0, rel=0.05)
    later = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD, force_gain=0.0)
    later.run(40.0, force=40.0, believed=40.0, duration=1.0, lag=0.1)
    slow = later.run(40.0, force=37.0, believed=40.0, duration=4.0 * 12e-3, lag=0.1)
    assert slow.force - 40.0 < 1.5


def test_a_lag_that_is_known_and_the_doubt_of_it_are_independent(paper_bundle):
    """So they add in squares: 40 ms, known to 30 ms, make the loop as slow as 50 ms."""
    loop = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD)
    outer_step(loop.settings, loop.state, MeasurementRecord(40.0, 0.1, 0.0, [0.0, 0.0]), 40.0,
               40.0, 4.0, FORCE, 40.0, 0.0, FREE, 40e-3 - 10e-3 - DT, 30e-3, 0.0, DT)
    assert loop.state.lag == pytest.approx(50e-3)


@pytest.mark.parametrize(('asked', 'rate', 'share'), [
    (40.0, 0.0, 1.0),      # the pressures are there: the model gives no more, so ask for more
    (80.0, 0.0, 0.1),      # they are on their way, all but the 4 N that they may leave
    (80.0, 6000.0, 1.0),   # behind a reference that moves they always are
])
def test_what_pressures_on_their_way_will_give_is_not_asked_for_twice(
        paper_bundle, asked, rate, share):
    """The gain on the error answers what the pressures asked for already will not mend."""
    loop = Loop(paper_bundle, delay=0.0, force_gain=0.4)
    loop.run(80.0, force=40.0, believed=40.0, asked=asked, rate=rate, duration=0.5)
    assert loop.state.late == pytest.approx(share * 40.0, rel=1e-3)


def test_noise_alone_is_not_corrected(paper_bundle):
    """Half a newton of noise moves the demand by less than 0.05 N rms; an offset is still met."""
    loop, random = Loop(paper_bundle), np.random.default_rng(4)
    for offset, duration in ((0.0, 10.0), (2.0, 10.0)):
        seen = [loop.run(40.0, force=40.0 - offset + 0.5 * float(random.standard_normal()),
                         believed=40.0).force for _ in range(round(duration / DT))][-2000:]
        assert np.mean(seen) - 40.0 == pytest.approx(offset, abs=0.1)
        assert np.std(seen) < 0.06
        if not offset:
            assert np.sqrt(np.mean(np.square(np.array(seen) - 40.0))) < 0.05


def test_an_error_far_beyond_the_noise_is_met_at_once_after_a_quiet_time(paper_bundle):
    """Friction turns by 6 N in noise of 2 N: within 50 ms half of it is asked for."""
    loop, random = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD, force_gain=0.0), \
        np.random.default_rng(2)
    for force in random.normal(40.0, 2.0, 2500):
        loop.run(40.0, force=float(force), believed=40.0)
    asked = [loop.run(40.0, force=float(force), believed=40.0).force
             for force in random.normal(34.0, 2.0, 25)]
    assert np.mean(asked[15:]) - 40.0 > 3.0


def test_what_the_pressures_do_not_give_is_integrated(paper_bundle):
    """A valve that sticks: force as the model says for the pressures, but not what was asked."""
    loop = Loop(paper_bundle)
    target = loop.run(40.0, force=37.0, believed=37.0, asked=40.0, duration=2.0)
    assert target.force > 41.0
    moving = Loop(paper_bundle)
    for k in range(1000):
        target = moving.run(0.04 * k, rate=20.0, force=0.04 * k - 0.2, believed=0.04 * k - 0.2,
                            asked=0.04 * k)
    assert target.force - 0.04 * 999 < 0.6


def test_a_force_that_does_not_come_is_asked_for_slowly(paper_bundle):
    """A unit with a low supply: more is missing than a loose valve explains, and nothing moves."""
    loop = Loop(paper_bundle, force_gain=0.0)
    missing = {'force': 20.0, 'believed': 20.0, 'asked': 40.0, 'reach': 4.0}
    assert loop.run(40.0, **missing, duration=1.25).force == pytest.approx(50.0, abs=0.5)
    assert loop.run(40.0, **missing, duration=5.0).force == pytest.approx(60.0, abs=0.1)
    # once the pressures are there it is forgotten within some lags of the loop
    there = {'force': 40.0, 'believed': 40.0, 'asked': 40.0, 'reach': 4.0}
    assert loop.run(40.0, **there, duration=1.0).force == pytest.approx(40.0, abs=0.1)


def test_feed_forward_leads(paper_bundle):
    """
    A reference that says its rate is asked for where it will be when the pressures follow.

    Of the dead time commands have what readings have not.
    """
    for reading_share, force in ((1.0, 41.0), (0.5, 42.0), (0.0, 43.0)):
        target = Loop(paper_bundle, lead_time=5e-3 - HOLD, delay=10e-3, feedback=False,
                      reading_share=reading_share).run(40.0, rate=200.0)
        assert target.force == target.feed_forward == pytest.approx(force)


@pytest.mark.parametrize('reading_share', [0.0, 0.5, 1.0])
def test_a_force_that_is_late_by_the_dead_time_of_its_reading_is_no_error(
        paper_bundle, reading_share):
    """Where a ramp is tracked the reading shows what was to be there before."""
    loop = Loop(paper_bundle, delay=10e-3, reading_share=reading_share, force_gain=1.0)
    force = 40.0 - reading_share * 10e-3 * 200.0
    target = loop.run(40.0, force=force, believed=force - 5.0, rate=200.0, duration=1.0)
    assert target.force - target.feed_forward == pytest.approx(-loop.state.bias, abs=1e-9)
    assert loop.state.behind == pytest.approx(reading_share * 10e-3)


def test_of_a_lag_that_is_learnt_the_load_cell_is_reckoned_to_have_a_quarter(paper_bundle):
    """The rest is asked for earlier; a reading that is late by a quarter is no error."""
    for learnt in ({'lag': 20e-3}, {'lead': 20e-3}, {'lag': 5e-3, 'lead': 15e-3}):
        loop = Loop(paper_bundle, delay=0.0, lead_time=0.0, force_gain=1.0)
        target = loop.run(40.0, force=40.0 - 0.25 * 20e-3 * 200.0, rate=200.0, **learnt)
        assert target.feed_forward == pytest.approx(40.0 + (0.75 * 20e-3 + HOLD) * 200.0)
        assert loop.state.late == pytest.approx(0.0)


def test_a_strain_that_is_late_by_the_dead_time_of_its_reading_is_no_error(paper_bundle):
    """What is corrected is how far it is from just that."""
    for beyond in (0.0, 1e-3):
        loop = Loop(paper_bundle, LoadModel(force=10.0), delay=10e-3, strain_gain=400.0,
                    strain_integral=0.0, strain_damping=0.0, still=0.0)
        strain = 0.1 - 0.5 * 10e-3 * 0.2 - beyond
        target = loop.run(0.1, kind=STRAIN, strain=strain, rate=0.2, speed=0.2)
        assert target.force - target.feed_forward == pytest.approx(400.0 * beyond)


def test_the_force_gain_sleeps_until_there_is_more_than_noise(paper_bundle):
    """A reading beside the reference is corrected where the model is off, not where it fits."""
    def demand(believed):
        loop = Loop(paper_bundle, force_gain=1.0)
        loop.run(40.0, force=40.0, believed=40.0, duration=1.0)
        target = loop.run(40.0, force=30.0, believed=believed, duration=0.03)
        return target.force + loop.state.bias - 40.0
    assert demand(believed=30.0) == 0.0
    assert demand(believed=40.0) > 5.0


def test_a_force_that_was_taken_over_fades(paper_bundle):
    """The first demand is the force that is there; after its time 37 % of the step is left."""
    loop = Loop(paper_bundle, fade_time=0.2)
    loop.state.taking_over, loop.state.taken = True, 30.0
    first = loop.run(70.0, force=30.0, believed=30.0).force
    assert first == pytest.approx(30.0, abs=0.5)
    later = loop.run(70.0, force=30.0, believed=30.0, duration=0.2 - DT).force
    assert 70.0 - later == pytest.approx(40.0 * math.exp(-1.0), rel=0.01)


@pytest.mark.parametrize(('saturated', 'goes_on'), [(FREE, True), (GAP, True), (LOW, True),
                                                    (HIGH, False)])
@pytest.mark.parametrize('kind', [FORCE, STRAIN])
def test_integrals_stop_in_the_direction_of_a_limit(paper_bundle, kind, saturated, goes_on):
    """An error that asks for more is not learnt while the bundle gives all it can."""
    loop = Loop(paper_bundle, feed_forward=False)
    value = 0.2 if kind == STRAIN else 50.0
    loop.run(value, kind=kind, saturated=saturated)
    begun = loop.state.integral
    loop.run(value, kind=kind, duration=0.5, saturated=saturated)
    assert (loop.state.integral > begun) == goes_on


def test_strain_feed_forward_is_the_load(paper_bundle):
    """Holding force where the reference will be, drag, and inertia times its acceleration."""
    load = LoadModel(force=10.0, stiffness=200.0, inertia=0.3, damping=3.0)
    loop = Loop(paper_bundle, load, feedback=False, lead_time=0.0, delay=0.0)
    for k in range(200):
        rate = 2.0 * k * DT
        target = loop.run(0.1, kind=STRAIN, rate=rate)
    assert target.force == pytest.approx(
        10.0 + 200.0 * (0.1 + HOLD * rate) + 3.0 * rate + 0.3 * 2.0, rel=1e-6)
    assert target.strain_rate == rate


def test_a_load_is_held_where_the_reference_will_be_when_the_command_is_there(paper_bundle):
    """Half of the dead time is on the way of the command."""
    loop = Loop(paper_bundle, LoadModel(stiffness=200.0), feedback=False, lead_time=2e-3 - HOLD,
                delay=10e-3)
    target = loop.run(0.1, kind=STRAIN, rate=0.2)
    assert target.strain == pytest.approx(0.1 + 7e-3 * 0.2)
    assert target.force == pytest.approx(200.0 * target.strain)


def test_strain_feedback_is_a_pid_behind_a_play(paper_bundle):
    """Gains on error, its integral and its rate; changes within the band are left out."""
    loop = Loop(paper_bundle, LoadModel(force=1.0), feed_forward=False, strain_gain=400.0,
                strain_integral=2000.0, strain_damping=5.0, still=0.2)
    first = loop.run(0.11, kind=STRAIN, believed=0.0, speed=0.1).force
    expected = 400.0 * 0.01 + 2000.0 * 0.01 * DT - 5.0 * 0.1
    assert first == pytest.approx(expected - 0.2)
    loop.run(0.1, kind=STRAIN, duration=8.0)
    calm = loop.run(0.1, kind=STRAIN).force
    assert loop.run(0.1 + 0.1 / 400.0, kind=STRAIN).force == calm
    assert loop.run(0.1 + 10.0 / 400.0, kind=STRAIN).force > calm + 9.0


@pytest.mark.parametrize('noise', [1e-4, 1e-3, 1e-2])
def test_a_correction_of_a_strain_keeps_still_in_its_noise(paper_bundle, noise):
    """However large: the demand changes by less than a fifth of what noise makes of the gains."""
    loop, random = Loop(paper_bundle, LoadModel(force=1.0), strain_gain=400.0,
                        strain_integral=0.0, strain_damping=0.0), np.random.default_rng(1)
    strains = 0.1 + noise * random.standard_normal(2000)
    demands = [loop.run(0.1, strain=strain, kind=STRAIN).force for strain in strains]
    assert np.abs(np.diff(demands[1000:])).mean() < 0.2 * 400.0 * np.abs(np.diff(strains)).mean()
    assert loop.state.noise == pytest.approx(400.0 * noise, rel=0.15)


def test_a_correction_that_moves_is_no_noise(paper_bundle):
    """100 N/s: neither a wide band nor a doubt of the demand comes of it."""
    loop = Loop(paper_bundle, LoadModel(force=1.0), strain_gain=400.0, strain_integral=0.0,
                strain_damping=0.0)
    demands = [loop.run(0.1, strain=0.1 - 0.25 * DT * k, kind=STRAIN).force for k in range(500)]
    assert np.diff(demands[10:]) == pytest.approx(100.0 * DT)
    assert loop.state.noise < 1e-6


@pytest.mark.parametrize('felt', [-15.0, 15.0])
def test_a_strain_that_is_right_asks_for_no_other_force(paper_bundle, felt):
    """What friction holds is no error: a force unlike the model's does not move the demand."""
    loop = Loop(paper_bundle, LoadModel(force=20.0, inertia=0.3))
    begun = loop.run(0.1, force=20.0, believed=20.0, kind=STRAIN, duration=0.2).force
    stuck = loop.run(0.1, force=20.0 + felt, believed=20.0, kind=STRAIN, duration=2.0).force
    assert stuck == begun


def test_a_load_that_the_integral_finds_is_no_doubt_of_the_demand(paper_bundle):
    """While the demand grows by 50 N to lift a load, the margins of the state machine stay."""
    loop = Loop(paper_bundle, LoadModel(force=20.0, inertia=0.3), strain_integral=2500.0)
    begun = loop.run(0.1, force=20.0, believed=20.0, kind=STRAIN, duration=3.0).force
    grown = loop.run(0.11, force=20.0, believed=20.0, kind=STRAIN, duration=2.2).force
    assert grown > begun + 50.0
    assert sum(uncertainties(loop.settings, loop.state)) < loop.settings.model_error + 1.0


def test_pressures_are_worked_out_for_a_strain_within_reach(paper_bundle):
    """For the reference strain, but no further than ``strain_reach`` from the present one."""
    loop = Loop(paper_bundle, strain_reach=0.03)
    assert loop.run(0.12, kind=STRAIN).strain == pytest.approx(0.12)
    assert loop.run(0.2, kind=STRAIN).strain == pytest.approx(0.13)
    assert loop.run(40.0, strain=0.17, speed=0.4).strain == 0.17


def test_a_load_that_drives_the_strain_away_meets_the_stiffness_of_the_muscles(paper_bundle):
    """A weight that is added does not lower the strain for which pressures are computed."""
    loop = Loop(paper_bundle, strain_reach=0.03)
    assert loop.run(0.1, kind=STRAIN, strain=0.1).strain == pytest.approx(0.1)
    assert loop.run(0.1, kind=STRAIN, strain=0.02).strain == pytest.approx(0.1)
    assert loop.run(0.1, kind=STRAIN, strain=0.19).strain == pytest.approx(0.1)
    assert loop.run(0.05, kind=STRAIN, strain=0.1).strain == pytest.approx(0.07)


def test_a_strain_reference_after_a_force_begins_at_the_present_strain(paper_bundle):
    """Not where the strain reference before it has ended."""
    loop = Loop(paper_bundle, strain_reach=0.03)
    loop.run(0.2, kind=STRAIN, strain=0.2)
    loop.run(40.0, strain=0.05)
    assert loop.run(0.25, kind=STRAIN, strain=0.05).strain == pytest.approx(0.08)


def test_a_strain_loop_without_a_load_takes_over_the_demand(paper_bundle):
    """What held the load before is where the integral begins."""
    loop = Loop(paper_bundle)
    held = loop.run(55.0, force=55.0, believed=55.0, duration=0.5).force
    assert loop.run(0.1, force=55.0, believed=55.0, kind=STRAIN).force == pytest.approx(held)


@pytest.mark.parametrize(('rate', 'speed', 'quick'), [
    (-0.1, 0.0, 1.0),     # friction holds the strain, the reference goes away from it
    (-0.1, -0.05, 0.5),   # it follows at half the rate
    (-0.1, -0.1, 0.0),    # it follows
    (-0.1, 0.1, 1.0),     # it still goes the other way
    (0.1, 0.0, 0.0),      # the reference comes towards it
    (0.0, 0.0, 0.0),      # nothing is to move
])
def test_a_strain_that_friction_holds_gets_the_force_for_its_error_within_two_lags(
        paper_bundle, rate, speed, quick):
    """Stiffness times error over two lags of the loop; one that follows, its usual integral."""
    loop = Loop(paper_bundle, LoadModel(damping=5.0), delay=5e-3, lead_time=5e-3 - HOLD,
                reading_share=0.0)
    error, pressures = -0.01, [150e3, 0.0]
    stiffness = present_stiffness(loop.settings, pressures)
    usual = gain_at(loop.settings, loop.settings.strain_integral, stiffness, 0.0)
    asked = stiffness / (2.0 * (5e-3 + 5e-3 + DT + RATE_LAG))
    assert asked > 1.5 * usual
    outer_step(loop.settings, loop.state, MeasurementRecord(10.0, 0.1, speed, pressures), 10.0,
               10.0, 4.0, STRAIN, 0.1, 0.0, FREE, 0.0, 0.0, 0.0, DT)
    held = loop.state.integral
    outer_step(loop.settings, loop.state, MeasurementRecord(10.0, 0.1, speed, pressures), 10.0,
               10.0, 4.0, STRAIN, 0.1 + error, rate, FREE, 0.0, 0.0, 0.0, DT)
    assert (loop.state.integral - held) / (error * DT) == pytest.approx(
        usual + quick * (asked - usual))


@pytest.mark.parametrize(('pressure', 'error'), [(150e3, -0.01), (10e3, -0.01), (10e3, -0.08)])
@pytest.mark.parametrize(('speed', 'quick'), [(0.0, 1.0), (-0.5, 0.5), (-1.0, 0.0)])
def test_the_force_that_moves_a_load_not_told_is_searched_for_quickly(
        paper_bundle, speed, quick, pressure, error):
    """
    Stiffness times error in a lag, as far as the integral alone would be quicker (``speed``).

    The stiffness is at least that of pressures which hold a usual load; the error at most
    ``strain_reach``, or a weight would be lifted with too much force.
    """
    loop = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD)
    pressures = [pressure, 0.0]
    stiffness = present_stiffness(loop.settings, pressures)
    usual = gain_at(loop.settings, loop.settings.strain_integral, stiffness, 0.0)
    asked = (max(stiffness, 0.07 * loop.settings.most_stiffness)
             / (5e-3 + 5e-3 + DT + RATE_LAG))
    pace = usual / stiffness * abs(error)
    for wanted in (0.1, 0.1 + error):
        held = loop.state.integral
        outer_step(loop.settings, loop.state,
                   MeasurementRecord(10.0, 0.1, speed * pace, pressures), 10.0, 10.0, 4.0, STRAIN,
                   wanted, 0.0, FREE, 0.0, 0.0, 0.0, DT)
    assert (loop.state.integral - held) / (max(error, -0.03) * DT) == pytest.approx(
        usual + quick * (asked - usual))


def test_a_search_is_no_slower_than_an_integral_that_was_set(paper_bundle):
    """A user's own gain of 1 MN/s."""
    loop = Loop(paper_bundle, strain_integral=1e6)
    for wanted in (0.1, 0.09):
        held = loop.state.integral
        outer_step(loop.settings, loop.state, MeasurementRecord(10.0, 0.1, 0.0, [10e3, 0.0]), 10.0,
                   10.0, 4.0, STRAIN, wanted, 0.0, FREE, 0.0, 0.0, 0.0, DT)
    assert (loop.state.integral - held) / (-0.01 * DT) == pytest.approx(1e6)


@pytest.mark.parametrize(('rate', 'speed', 'share', 'config'), [
    (0.0, 0.0, 1.0, {}),    # the strain rests
    (0.0, -0.2, 0.6, {}),   # it makes up 0.008 of 0.02 before a response
    (0.0, -1.0, 0.0, {}),   # it makes up all
    (0.0, 0.2, 1.0, {}),    # it goes the other way
    (-0.2, -0.2, 1.0, {}),  # it follows a reference that moves
    (0.0, -1.0, 1.0, {'strain_reach': 0.03}),   # it is near its reference
    (0.0, -1.0, 1.0, {'feed_forward': False}),  # it moves by the integral alone
])
def test_what_the_strain_makes_up_itself_after_a_step_is_not_integrated(
        paper_bundle, rate, speed, share, config):
    """The rest is, so that the strain does not overshoot by what the integral has wound up."""
    loop = Loop(paper_bundle, LoadModel(damping=5.0), **{
        'delay': 5e-3, 'lead_time': 5e-3 - HOLD, 'reading_share': 0.0, 'strain_reach': 0.01,
        **config})
    error, pressures = -2.0 * 2.0 * 0.2 * (5e-3 + 5e-3 + DT + RATE_LAG) / 0.8, [150e3, 0.0]
    usual = gain_at(loop.settings, loop.settings.strain_integral,
                         present_stiffness(loop.settings, pressures), 0.0)
    for wanted, slope in ((0.1, 0.0), (0.1 + error, rate)):
        held = loop.state.integral
        outer_step(loop.settings, loop.state, MeasurementRecord(10.0, 0.1, speed, pressures), 10.0,
                   10.0, 4.0, STRAIN, wanted, slope, FREE, 0.0, 0.0, 0.0, DT)
    assert (loop.state.integral - held) / (error * DT) == pytest.approx(share * usual)


@pytest.mark.parametrize(('saturated', 'way'), [(HIGH, 1.0), (LOW, -1.0)])
def test_a_strain_that_turns_back_is_met_from_the_limit_of_the_force(
        paper_bundle, saturated, way):
    """An integral beyond what the pressures give is not unwound first, nor while it is needed."""
    loop = Loop(paper_bundle, LoadModel(force=30.0), strain_integral=2000.0)
    begun = loop.run(0.1, force=30.0, believed=30.0, kind=STRAIN).force
    wound = loop.run(0.1 + way * 0.01, force=30.0, believed=30.0, kind=STRAIN,
                     duration=2.0).force - begun
    assert way * wound > 35.0
    limit = {'asked': begun + 0.5 * wound, 'saturated': saturated, 'kind': STRAIN,
             'force': 30.0, 'believed': 30.0}
    kept = loop.run(0.1 + way * 0.01, **limit).force - begun
    assert kept == pytest.approx(wound, abs=0.1)
    left = loop.run(0.1 - way * 0.001, **limit).force - begun
    assert left == pytest.approx(0.5 * wound, abs=1.0)


def test_an_integral_that_is_off_stays_off_where_friction_holds(paper_bundle):
    """A user who asks for no integral gets none."""
    loop = Loop(paper_bundle, strain_integral=0.0)
    loop.run(0.1, kind=STRAIN)
    before = loop.state.integral
    loop.run(0.09, kind=STRAIN, rate=-0.1, duration=0.2)
    assert loop.state.integral == before


@pytest.mark.parametrize(('feedback', 'expected'), [(False, (2.5, 0.0)), (True, (1.0, 1.5))])
def test_uncertainty_is_noise_and_a_tenth_of_the_bias_and_an_error_that_nothing_corrects(
        feedback, expected):
    """Three standard deviations of its noise; without feedback the model's own error on top."""
    settings = SimpleNamespace(model_error=1.5, feedback=feedback)
    state = SimpleNamespace(noise=0.2, observer=SimpleNamespace(bias=-3.0))
    assert uncertainties(settings, state) == pytest.approx(expected)


@pytest.mark.parametrize('config', [
    {'feed_forward': False, 'force_gain': 1.0, 'force_integral': 0.0, 'filter_time': 0.01}, {}])
def test_noise_of_the_demand_is_what_the_readings_make_of_it(paper_bundle, config):
    """With white noise of 0.5 N on a force that the model gets wrong by 3 N to and fro."""
    loop, random, demands = Loop(paper_bundle, **config), np.random.default_rng(1), []
    for k in range(6000):
        error = 3.0 * math.sin(2.0 * k * DT)
        loop.run(40.0, force=float(random.normal(40.0 + error, 0.5)), believed=40.0)
        demands.append(loop.state.demand)
    rough = np.array(demands[3000:]) - np.convolve(demands, np.full(101, 1.0 / 101.0),
                                                   mode='same')[3000:]
    assert loop.state.noise == pytest.approx(np.std(rough[:-100]), rel=0.25)


def test_a_bias_that_is_being_found_is_no_doubt_of_the_demand(paper_bundle):
    """A force that is 25 N less than the model's leaves the margins at a tenth of that."""
    loop = Loop(paper_bundle)
    loop.run(40.0, force=40.0, believed=40.0, duration=1.0)
    for duration in (0.02, 0.1, 0.5, 1.0):
        loop.run(40.0, force=15.0, believed=40.0, duration=duration)
        assert (sum(uncertainties(loop.settings, loop.state))
                < loop.settings.model_error + 2.5 + 1.0)


def test_a_table_of_the_load_is_linear_between_its_points(paper_bundle):
    """As NumPy interpolates, and its ends hold beyond them."""
    table = ((0.0, 5.0), (0.1, 30.0), (0.2, 45.0))
    settings = Loop(paper_bundle, LoadModel(table=table)).settings
    for strain in (-0.1, 0.0, 0.04, 0.1, 0.17, 0.2, 0.3):
        assert holding_force(settings, strain) == pytest.approx(
            np.interp(strain, *np.transpose(table)))


@pytest.mark.parametrize('gain', [0.0, 0.6])
def test_the_noise_that_a_demand_is_said_to_have_is_what_it_has(paper_bundle, gain):
    """On an error of 20 N and 4 Hz, all of which is believed; what the noise alone changes."""
    rng, told, demands = np.random.default_rng(3), [], []
    noise = 0.5 * rng.normal(size=3000)
    for size in (0.0, 1.0):
        loop = Loop(paper_bundle, delay=5e-3, lead_time=5e-3 - HOLD, force_gain=gain)
        demand = []
        for k in range(3000):
            error = 20.0 * math.sin(8.0 * math.pi * k * DT)
            target = loop.run(40.0, force=40.0 + error + size * noise[k], believed=40.0)
            demand.append(target.force)
            told.append(loop.state.noise)
        demands.append(np.array(demand))
    found = np.std((demands[1] - demands[0])[1000:])
    assert np.mean(told[4000:]) == pytest.approx(found, rel=0.2)
    assert sum(uncertainties(loop.settings, loop.state)) >= 3.0 * told[-1]
