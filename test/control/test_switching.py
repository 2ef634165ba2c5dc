# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
When the state machine switches, on curves of straight lines.

RS1 gives up to 246 N, of which the last 4 N are the overlap with RS2, which gives up to 742 N.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.control import RecruitmentMachine, SwitchingConfig
from fam_bundle_ros.control.switching import (
    Demand,
    HYSTERESIS,
    NEGLECT,
    release_level,
    REVERSAL_AWARE,
    rise_within,
    SwitchingSettings,
    widths,
)
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

DT = 0.01


class Machine:
    """A machine in a state, with margins of 1 N and 2 N; it is told demands in N and N/s."""

    def __init__(self, table, state, **config):
        self.table = table
        self.machine = RecruitmentMachine(2, SwitchingConfig(**{
            'margin': 1.0, 'hysteresis': 2.0, 'dwell': 0.0, **config}))
        self.machine.reset(state)

    def tell(self, force, rate=0.0, acceleration=0.0, duration=DT, feedback=0.0, **further):
        """Return the time of the first switch (nan for none) and why."""
        for k in range(max(round(duration / DT), 1)):
            why = self.machine.update(DT, SimpleNamespace(table=self.table),
                                      Demand(force, rate, acceleration, smooth_rate=rate,
                                             feedback=feedback, **{'own_rate': rate, **further}))
            if why:
                return (k + 1) * DT, why
        return float('nan'), ''


@pytest.mark.parametrize(('force', 'rate', 'acceleration', 'said'), [
    (246.5, 0.0, 0.0, ''), (247.5, 0.0, 0.0, 'by more than 1.0 N'),
    (240.0, 100.0, 0.0, 'rising by 100.0 N/s'), (230.0, 100.0, 0.0, ''),
    (240.0, -100.0, 0.0, ''), (240.0, 100.0, -2000.0, '')])
def test_the_next_unit_comes_when_it_is_needed_or_the_demand_heads_there(
        made, force, rate, acceleration, said):
    """Beyond the margin, or ahead of the overlap; not when the demand turns before the limit."""
    _, why = Machine(made(), 1).tell(force, rate, acceleration)
    assert said in why
    assert bool(why) == bool(said)


@pytest.mark.parametrize(('slowing', 'recruited'), [(-769.0, True), (-806.0, False)])
def test_ahead_of_need_one_standard_deviation_is_enough(made, slowing, recruited):
    """A demand that will turn at 246.5 N, half the margin beyond RS1, is met in time."""
    why = Machine(made(), 1).tell(240.0, 100.0, slowing)[1]
    assert ('rising' in why) == recruited


@pytest.mark.parametrize(('rate', 'slowing', 'recruited'), [
    (100.0, -8330.0, False), (100.0, -3330.0, True)])
def test_the_less_a_dip_can_be_avoided_the_surer_must_be_the_need(made, rate, slowing, recruited):
    """At 245.9 N, with no room left, a demand that turns at 246.5 N is waited for."""
    why = Machine(made(), 1).tell(245.9, rate, slowing)[1]
    assert ('rising' in why) == recruited


@pytest.mark.parametrize(('force', 'rate', 'recruited'), [
    (242.0, 3.0, True), (245.9, 3.0, False), (245.9, 60.0, True)])
def test_where_there_is_no_room_to_be_early_a_slow_demand_is_waited_for(
        made, force, rate, recruited):
    """A rate that may be the rest of a stop is not followed for seconds."""
    why = Machine(made(), 1).tell(force, rate)[1]
    assert ('rising' in why) == recruited


@pytest.mark.parametrize(('lasted', 'recruited'), [(3.0, False), (6.0, True)])
def test_a_slow_rise_is_expected_to_last_as_long_as_it_has(made, lasted, recruited):
    """At 242 N the dip can still be compensated; RS1 gives 246 N, the demand rises by 1 N/s."""
    machine = Machine(made(), 1)
    assert machine.tell(200.0, 1.0, duration=lasted)[1] == ''
    assert ('rising by 1.0 N/s' in machine.tell(242.0, 1.0)[1]) == recruited
    machine.machine.reset(1)
    machine.tell(200.0, 1.0, duration=lasted)
    machine.tell(200.0, 0.0)
    assert machine.tell(242.0, 1.0)[1] == ''


@pytest.mark.parametrize(('force', 'recruited'), [(241.0, False), (242.0, True)])
def test_only_at_the_last_moment_a_slow_rise_is_expected_to_last(made, force, recruited):
    """A patient crossing may begin 1 N earlier, but the demand may also stop there."""
    machine = Machine(made(), 1)
    machine.tell(200.0, 1.0, duration=20.0)
    assert bool(machine.tell(force, 1.0, patience=2.0)[1]) == recruited


def test_a_rise_within_the_tolerance_is_none(made):
    """5 mN/s: the end of a filter, or noise."""
    machine = Machine(made(), 1)
    machine.tell(200.0, 5e-3, duration=6.0)
    assert machine.tell(242.0, 1.0)[1] == ''


def test_a_constant_demand_is_near_the_limit_as_long_as_that_has_been_falling(made):
    """The strain takes 1 N/s from what RS1 gives, for 6 s."""
    machine = Machine(made(), 1)
    machine.tell(200.0, 1.0, own_rate=0.0, duration=6.0)
    assert 'rising by 1.0 N/s' in machine.tell(242.0, 1.0, own_rate=0.0)[1]


@pytest.mark.parametrize(('force', 'step', 'climb', 'recruited'), [
    (241.0, 2.0, 6.0, True), (241.0, 2.0, 5.0, False), (241.0, 0.5, 6.0, False),
    (244.0, 2.0, 4.0, False), (244.0, 2.0, 12.0, True)])
def test_stairs_are_expected_to_rise_as_much_again(made, force, step, climb, recruited):
    """The next step must lead into the overlap (242 N), and the stairs beyond RS1 (246 N)."""
    machine = Machine(made(), 1)
    assert ('rising in steps' in machine.tell(force, step=step, climb=climb)[1]) == recruited
    machine.machine.reset(1)
    machine.machine.memory.wary = True
    assert machine.tell(force, step=step, climb=climb)[1] == ''


def test_a_unit_that_adds_nothing_is_not_recruited(made):
    """Beyond RS1 stays beyond where the next unit cannot pull."""
    table = made()
    table.top[2] = table.top[1]
    assert Machine(table, 1).tell(300.0)[1] == ''


@pytest.mark.parametrize(('force', 'rate', 'recruited'), [(400.0, 0.0, True),
                                                          (240.0, 100.0, False)])
def test_a_demand_beyond_doubt_recruits_a_unit_that_adds_less_than_the_doubt(
        made, force, rate, recruited):
    """RS2 adds 50 N, the demand is sure to 100 N: beyond 346 N it comes, ahead of need not."""
    table = made()
    table.top[2] = table.top[1] + 50.0
    machine = Machine(table, 1, margin=None)
    why = machine.machine.update(DT, SimpleNamespace(table=table),
                                 Demand(force, rate, uncertainty=100.0, smooth_rate=rate))
    assert bool(why) == recruited


@pytest.mark.parametrize(('force', 'released'), [(-107.9, False), (-108.1, True)])
def test_a_force_that_the_state_cannot_give_releases_whatever_the_margins(made, force, released):
    """
    Two units push back with 8 N at least, and the last has 100 N to its line's end when empty.

    A model that is 200 N off does not change that.
    """
    machine = Machine(made(), 2, margin=200.0, hysteresis=400.0)
    time, _ = machine.tell(force, duration=0.5)
    assert (time == DT) == released
    assert machine.machine.state == (1 if released else 2)


@pytest.mark.parametrize(('force', 'released'), [(-127.9, False), (-128.1, True)])
def test_what_is_in_doubt_while_a_unit_crosses_releases_no_other(made, force, released):
    """A bias was found with other units at work: 120 N of doubt count until all have arrived."""
    table = made()
    why = Machine(table, 2).machine.update(DT, SimpleNamespace(table=table),
                                           Demand(force, doubt=120.0))
    assert ('force of RS2' in why) == released


def test_a_demand_that_turned_back_is_looked_at_with_care(made):
    """Recruited ahead and not needed: released on the way down, and looked ahead less far."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    assert 'rising' in machine.tell(212.0, 100.0, patience=0.2)[1]
    assert machine.tell(238.0, -100.0)[1] == ''
    assert 'turned back before it was needed' in machine.tell(205.0, -100.0)[1]
    # 55 ms: the time in which the unit could be filled at the usual pace
    assert machine.tell(230.0, 100.0, duration=1.0, patience=0.2)[1] == ''
    assert 'rising' in machine.tell(240.0, 100.0, patience=0.2)[1]


@pytest.mark.parametrize(('reference', 'released'), [(240.8, True), (241.0, False)])
def test_a_unit_is_needed_by_what_was_asked_whatever_feedback_takes_off_since(
        made, reference, released):
    """RS1, which gives 246 N, lacked 5 N when it was left; RS2 pulls 3 N more than its model."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    assert 'rising' in machine.tell(240.0, 100.0, feedback=5.0)[1]
    machine.tell(reference - 3.0, 0.0, feedback=-3.0)
    assert bool(machine.tell(197.0, -100.0, feedback=-3.0)[1]) == released


@pytest.mark.parametrize(('force', 'own_rate', 'recruited'), [
    (212.0, 100.0, True), (230.0, 0.0, False), (240.0, 0.0, True)])
def test_a_motion_of_the_strain_is_predicted_no_further_than_a_usual_crossing_takes(
        made, force, own_rate, recruited):
    """Where the limit falls by 100 N/s and the demand rests, there is no patience."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    assert bool(machine.tell(force, 100.0, own_rate=own_rate, patience=0.2)[1]) == recruited


@pytest.mark.parametrize(('patience', 'force', 'recruited'), [
    (0.2, 211.0, False), (0.2, 212.0, True), (0.0, 235.0, False)])
def test_the_more_time_a_crossing_takes_the_earlier_it_begins(made, patience, force, recruited):
    """The overlap begins at 242 N; at 100 N/s a crossing of 0.3 s begins 30 N below it."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    assert bool(machine.tell(force, 100.0, patience=patience)[1]) == recruited


@pytest.mark.parametrize(('lasted', 'recruited'), [(0.1, False), (0.3, True)])
def test_a_rise_is_predicted_no_longer_than_it_has_lasted(made, lasted, recruited):
    """A step that is read as a rate for a moment begins no slow crossing."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    machine.tell(100.0, 0.0)
    machine.tell(100.0, 100.0, duration=lasted)
    assert bool(machine.tell(212.0, 100.0, patience=0.2)[1]) == recruited


@pytest.mark.parametrize(('spare', 'recruited'), [(3.9, False), (4.1, True)])
def test_no_unit_begins_whose_push_back_the_units_on_their_way_leave_no_room_for(
        made, spare, recruited):
    """Its dip is 4 N; a demand beyond the limit recruits it all the same."""
    assert bool(Machine(made(), 1).tell(240.0, 100.0, spare=spare)[1]) == recruited
    assert Machine(made(), 1).tell(247.5, 100.0, spare=0.0)[1]


def test_what_feedback_takes_away_is_no_demand_that_turned_back(made):
    """Friction that turns round takes 4 N of the demand; the reference has to go back itself."""
    machine = Machine(made(), 1)
    assert 'rising' in machine.tell(240.0, 100.0, feedback=5.0)[1]
    assert machine.tell(236.0, -100.0, feedback=1.0)[1] == ''
    assert 'turned back before it was needed' in machine.tell(232.0, -100.0, feedback=1.0)[1]


@pytest.mark.parametrize(('rests', 'released'), [(240.0, False), (237.1, False), (236.9, True)])
def test_a_demand_that_stops_where_it_was_recruited_for_releases_nothing(made, rests, released):
    """Recruited at 240 N and 100 N/s: less its lead of 10 ms and the band of 2 N is 237 N."""
    machine = Machine(made(), 0)
    assert machine.tell(1.0)[1]
    assert machine.machine.state == 1
    assert machine.tell(240.0, 100.0)[1]
    assert bool(machine.tell(rests, duration=5.0)[1]) == released


def test_at_rest_below_the_overlap_a_unit_is_released_in_time(made):
    """After three quarters of a second, not before."""
    time, why = Machine(made(), 2).tell(100.0, duration=5.0)
    assert 'at rest for' in why
    assert time == pytest.approx(0.75, abs=2 * DT)


def test_a_slow_rise_to_where_a_unit_is_needed_is_no_rest(made):
    """At 2 N/s, below the rate of a rest: within 3 s 234 N rise above the level of 239 N."""
    assert Machine(made(), 2).tell(234.0, 2.0, duration=2.0)[1] == ''
    assert 'at rest for' in Machine(made(), 2).tell(232.0, 2.0, duration=2.0)[1]


def test_a_unit_that_moving_demands_do_not_need_is_released_in_the_end(made):
    """After ten seconds."""
    time, why = Machine(made(), 2).tell(100.0, -30.0, duration=20.0)
    assert 'below 239.0 N for 10.0 s' in why
    assert time == pytest.approx(10.0, abs=2 * DT)


def test_a_unit_that_is_cheap_to_fill_again_is_released_at_once(made):
    """Where it must hold less than 0.3 of what it held, on the way down."""
    table = made()
    machine = Machine(table, 2)
    table.bottom_pressure[1] = 200e3
    assert machine.tell(300.0)[1] == ''
    table.bottom_pressure[1] = 50e3
    assert machine.tell(100.0, 10.0)[1] == ''
    assert 'only 50 kPa to fill again' in machine.tell(100.0, -30.0)[1]


@pytest.mark.parametrize(('asked', 'until'), [(198.0, 146.0), (202.0, 200.0)])
def test_a_unit_that_was_missed_is_kept_for_longer(made, asked, until):
    """
    Released at 200 N, recruited again at 248 N, of which feedback has added what the unit pulled.

    Where the reference had not risen, it may not have been empty: as much again is kept in
    reserve, or 198 - 50 - 2 N. Where it had, RS1 lacks force at 202 N only, less the band.
    """
    machine = Machine(made(), 2)
    assert 'at rest' in machine.tell(200.0, duration=5.0)[1]
    assert 'by more than 1.0 N' in machine.tell(248.0, feedback=248.0 - asked)[1]
    assert machine.machine.memory.back == (asked < 200.0)
    assert machine.tell(until + 0.1, duration=20.0)[1] == ''
    assert 'below 239.0 N for' in machine.tell(until - 0.1, duration=20.0)[1]


@pytest.mark.parametrize(('away', 'rate', 'kept'), [
    (9.0, 0.0, True), (11.0, 0.0, False), (9.0, -30.0, True), (11.0, -30.0, False)])
def test_a_unit_that_is_needed_again_within_the_absence_time_is_kept_for_as_long(
        made, away, rate, kept):
    """Demands to and fro across the limit: neither a rest nor a cheap filling releases it."""
    table = made()
    machine = Machine(table, 2)
    assert 'at rest' in machine.tell(100.0, duration=5.0)[1]
    machine.tell(100.0, duration=away)
    table.bottom_pressure[1] = 200e3
    assert 'by more than' in machine.tell(248.0)[1]
    machine.tell(300.0)
    table.bottom_pressure[1] = 50e3
    time, why = machine.tell(100.0, rate, duration=20.0)
    assert ('for 10.0 s' in why) == kept
    assert (time > 9.9) == kept


def test_a_unit_that_turning_demands_nearly_need_is_kept_the_second_time(made):
    """Recruited in vain twice within the absence time: it would be a third time."""
    machine = Machine(made(), 1)
    machine.tell(100.0, 100.0, duration=0.5)
    assert 'rising' in machine.tell(240.0, 100.0)[1]
    assert 'turned back' in machine.tell(205.0, -100.0)[1]
    machine.tell(100.0, 100.0, duration=0.5)
    assert 'rising' in machine.tell(240.0, 100.0)[1]
    assert machine.tell(205.0, -100.0, duration=9.0)[1] == ''


def test_a_unit_after_one_that_was_recruited_is_not_brought_back(made):
    """However much of the demand is feedback: it was not released."""
    machine = Machine(made(), 0)
    assert machine.tell(5.0)[1]
    assert machine.tell(248.0, feedback=248.0)[1]
    assert machine.machine.state == 2
    assert not machine.machine.memory.back


def test_a_demand_below_all_that_a_state_can_releases_at_once(made):
    """RS2 pulls at least -8 N; lowering its last unit until it is empty comes first."""
    assert 'below -8.0 N, the least force of RS2' in Machine(made(), 2).tell(-109.0)[1]


def test_a_lowered_unit_that_is_alone_is_not_released_at_rest(made):
    """It holds what force there is; one that is not lowered is vented after a while."""
    assert 'at rest' in Machine(made(), 1).tell(-30.0, duration=5.0)[1]
    table = made()
    table.lowered[0] = 1
    assert Machine(table, 1).tell(-30.0, duration=5.0)[1] == ''
    assert 'force of RS1' in Machine(table, 1).tell(-60.0)[1]


def test_a_rising_demand_releases_nothing(made):
    """However far it is below."""
    assert Machine(made(), 2).tell(-9.0, 30.0, duration=20.0)[1] == ''


@pytest.mark.parametrize(('policy', 'level'), [('neglect', 246.0), ('hysteresis', 241.0)])
def test_simple_policies_release_below_a_level(made, policy, level):
    """The limit of the state below; with hysteresis the push-back and the margin below that."""
    assert Machine(made(), 2, policy=policy).tell(level + 0.5)[1] == ''
    assert 'release MU2: demand' in Machine(made(), 2, policy=policy).tell(level - 0.5)[1]


@pytest.mark.parametrize(('policy', 'waits'), [
    ('neglect', False), ('hysteresis', True), ('reversal_aware', True)])
def test_dwell_holds_for_opposite_switches_only(made, policy, waits):
    """Two units in two ticks, but no way back within the dwell time; neglect knows none."""
    machine = Machine(made(), 0, policy=policy, dwell=1.0)
    assert machine.tell(300.0)[1].startswith('recruit MU1')
    assert machine.tell(300.0)[1].startswith('recruit MU2')
    time, _ = machine.tell(-9.0, duration=5.0)
    assert (time > 0.9) == waits


@pytest.mark.parametrize('acceleration', [-400.0, -50.0, 0.0, 300.0])
@pytest.mark.parametrize('jerk', [-3000.0, 0.0, 900.0])
@pytest.mark.parametrize('horizon', [0.05, 0.5])
def test_a_demand_rises_as_far_as_its_turning_point(acceleration, jerk, horizon):
    """The highest that it comes within the horizon; what speeds it up does not count."""
    demand = Demand(rate=60.0, acceleration=acceleration, jerk=jerk)
    t = np.linspace(0.0, horizon, 100_001)
    way = 60.0 * t + min(acceleration, 0.0) * t ** 2 / 2.0 + min(jerk, 0.0) * t ** 3 / 6.0
    assert rise_within(demand, horizon) == pytest.approx(way.max(), rel=1e-6)


def test_margins_and_levels_are_those_of_the_policy(made):
    """By hand where given; two margins of band otherwise, and none where doubt is neglected."""
    table, demand = made(), Demand(uncertainty=1.0, more_below=2.0)

    def settings(policy, margin=math.nan, hysteresis=math.nan):
        return SwitchingSettings(policy, 0.0, margin, hysteresis, 1.0, 1.0, 0.5, 0.1, 0.2, 1e6)
    assert widths(settings(NEGLECT, 5.0, 7.0), demand) == (0.0, 0.0, 0.0)
    assert widths(settings(HYSTERESIS), demand) == (1.0, 3.0, 6.0)
    assert widths(settings(REVERSAL_AWARE), Demand(uncertainty=0.1)) == (0.1, 0.1, 0.5)
    assert widths(settings(REVERSAL_AWARE, 5.0, 7.0), demand) == (5.0, 5.0, 7.0)
    for state in (1, 2):
        top, dip = table.top[state - 1], table.dip[state - 1]
        assert dip == pytest.approx(4.0)
        assert release_level(settings(NEGLECT), table, state, 3.0, 6.0) == top
        assert release_level(settings(HYSTERESIS), table, state, 3.0, 6.0) == top - 3.0 - 6.0
        assert release_level(settings(HYSTERESIS), table, state, 3.0, 1.0) == top - 3.0 - dip
        assert release_level(settings(REVERSAL_AWARE), table, state, 3.0, 6.0) == (
            top - dip - 3.0 - 6.0)
        assert math.isnan(release_level(settings(NEGLECT), table, 0, 3.0, 6.0))


@pytest.mark.parametrize(('feedback', 'waits'), [(0.0, False), (60.0, True)])
def test_a_reference_that_jumps_beyond_the_limit_does_not_wait(made, feedback, waits):
    """Just after a release it is met at once; what feedback alone asks for waits for the dwell."""
    machine = Machine(made(), 2, dwell=1.0)
    assert machine.tell(100.0, duration=2.0)[1].startswith('release MU2')
    time, why = machine.tell(300.0, feedback=feedback, duration=2.0)
    assert why.startswith('recruit MU2')
    assert (time > 0.9) == waits


@pytest.mark.parametrize(('policy', 'recruited'), [('reversal_aware', True), ('neglect', False)])
def test_a_bundle_that_is_too_soft_gets_the_next_unit_and_keeps_it(made, policy, recruited):
    """Whatever the demand, and for the absence time after the state below was last too soft."""
    machine = Machine(made(), 1, policy=policy)
    assert (machine.tell(20.0, soft=1)[1] != '') == recruited
    if recruited:
        assert machine.tell(20.0, soft_below=1, duration=20.0)[1] == ''
        assert machine.tell(20.0, duration=9.0)[1] == ''
        assert machine.tell(20.0, soft_below=1)[1] == ''
        time, why = machine.tell(20.0, duration=11.0)
        assert time == pytest.approx(10.0, abs=2 * DT)
        assert why.endswith('for 10.0 s')


def test_a_unit_that_was_filled_for_stiffness_and_then_needed_is_released_as_any_other(made):
    """At rest below the overlap, in less than a second."""
    machine = Machine(made(), 1)
    machine.tell(20.0, soft=1)
    machine.tell(400.0)
    assert 'at rest' in machine.tell(20.0, duration=2.0)[1]


def test_an_error_that_the_model_file_states_is_no_reason_to_leave_a_force_short(paper_bundle):
    """
    A slow ramp beyond the first unit's limit, with a model that says it is 15 N wrong.

    Feedback sees how far the first unit is off: the second is recruited once it is missed, not
    15 N later. To release it, the error counts: the first unit alone is not being measured.
    """
    limit = float(paper_bundle.force(0.12, [paper_bundle.max_pressure[0], 0.0]))
    ramp = Trajectory('ramp', 'force', 15.0, lambda t: limit - 15.0 + 2.0 * max(t, 0.0),
                      lambda t: 2.0, Dynamometer(0.12), prepare=1.0)
    stated = paper_bundle.named(paper_bundle.name, error=15.0)
    certain, doubtful = (ClosedLoop(paper_bundle, model=model).run(ramp)
                         for model in (paper_bundle, stated))
    assert certain.state.max() == doubtful.state.max() == 2
    assert np.abs(doubtful.error).max() < np.abs(certain.error).max() + 1.0
    assert doubtful.switches == certain.switches
