# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The way of a unit through its falling branch, and how fast the others must answer."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.control import Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.crossing import (
    advance,
    begin_crossing,
    crossing_pace,
    crossing_time,
    end_crossing,
    hand_over_time,
    hurry,
    is_crossing,
    no_crossings,
)
from fam_bundle_ros.control.curves import curve_table, top_at
from fam_bundle_ros.control.inverse import Shares
from fam_bundle_ros.control.observer import learn_noise
from fam_bundle_ros.control.outer_loop import FORCE, STRAIN
from fam_bundle_ros.control.reasons import AHEAD, BEYOND
from fam_bundle_ros.control.recruitment_loop import recruitment_state
from fam_bundle_ros.control.spread import BATCH, compensation_ratio, ORDERLY, reserve, room, spread
from fam_bundle_ros.control.switching import Demand
from fam_bundle_ros.control.transition import patience, send_unit
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

PACE, DT = 2e6, 1e-3


def way(target, ratio=1.0, short=False, start=0.0, pace=PACE):
    """Return the pressures of a crossing, tick by tick until it has arrived."""
    crossings, found = no_crossings(2), []
    begin_crossing(crossings, 1, target > start, start, pace)
    for _ in range(2000):
        arrived = advance(crossings, 1, DT, target, ratio, short, PACE)
        found.append(crossings.pressure[1])
        if arrived:
            return found
    pytest.fail('never arrived')


@pytest.mark.parametrize('start', [0.0, 200e3])
def test_a_crossing_gathers_and_loses_speed_and_ends_at_its_target(start):
    """From rest to the pace in 10 ms, to rest again at the target, up or down."""
    pressures = [start, *way(100e3, start=start)]
    speeds = [abs(b - a) / DT for a, b in zip(pressures, pressures[1:])]
    assert pressures[-1] == 100e3
    assert max(speeds) == pytest.approx(PACE)
    assert max(abs(b - a) for a, b in zip(speeds, speeds[1:-1])) <= 1.5 * PACE * DT / 0.01
    assert speeds[0] < 0.2 * PACE > speeds[-1]


def test_a_crossing_is_slower_where_the_others_must_move_further():
    """No unit moves faster than the pace: at a ratio of 4 it takes about four times as long."""
    assert len(way(100e3, ratio=4.0)) > 3.0 * len(way(100e3))
    assert len(way(100e3, ratio=0.5)) == len(way(100e3))


def test_a_crossing_that_cannot_be_compensated_is_as_fast_as_the_valve():
    """Twenty times the usual pace, at once, however slowly it began."""
    for pace in (PACE, PACE / 100.0):
        first = way(100e3, ratio=4.0, short=True, pace=pace)[0]
        assert first == pytest.approx(20.0 * PACE * DT)


def test_crossings_keep_their_order():
    """One that begins anew stays where it is; one that ends leaves the others in order."""
    crossings = no_crossings(3)
    for unit in (2, 0, 1, 2):
        begin_crossing(crossings, unit, True, 0.0, PACE)
    assert (crossings.count, crossings.unit) == (3, [2, 0, 1])
    end_crossing(crossings, 0)
    assert crossings.unit[:crossings.count] == [0, 1]
    assert not is_crossing(crossings, 2)


@pytest.mark.parametrize(('rate', 'pace'), [(50.0, PACE), (200.0, 100e3 * 200.0 / 4.0),
                                            (1e6, 4.0 * PACE)])
def test_a_hurry_ends_before_the_reserve_is_used_up_and_is_at_most_four_times_as_fast(rate, pace):
    """By the way that is left; a demand that stops rising slows no crossing down."""
    crossings = no_crossings(2)
    begin_crossing(crossings, 1, True, 50e3, PACE)
    hurry(crossings, 1, 150e3, rate, 4.0, 0.0, PACE)
    assert crossings.pace[1] == pytest.approx(pace)
    hurry(crossings, 1, 150e3, 0.0, 4.0, 0.0, PACE)
    assert crossings.pace[1] == pytest.approx(pace)


def test_a_crossing_is_late_where_the_error_of_the_push_back_is_larger_than_what_is_missed():
    """5 N may show, followed 20 ms late; at 4 N/s 0.63 N are missed in the time it then takes."""
    crossings = no_crossings(2)
    begin_crossing(crossings, 1, True, 50e3, 1e4)
    hurry(crossings, 1, 150e3, 4.0, -1.0, 5.0 * 0.02, PACE)
    time = 100e3 / crossings.pace[1]
    assert 5.0 * 0.02 / time == pytest.approx(4.0 * time) == pytest.approx(0.632, abs=1e-3)


def state_of(table, machine, *crossing):
    """Return a state in which the units ``crossing`` are being filled."""
    state = SimpleNamespace(table=table, crossings=no_crossings(2),
                            machine=SimpleNamespace(state=machine))
    for unit in crossing:
        begin_crossing(state.crossings, unit, True, 0.0, PACE)
    return state


def test_the_reserve_is_what_the_others_have_beside_all_that_push_back(made):
    """The limit without the unit that is being filled, minus its dip and the demand."""
    table = made()
    assert table.dip[1] == pytest.approx(4.0)
    assert reserve(state_of(table, 2, 1), 5.0, 0) == pytest.approx(table.top[1] - 4.0 - 5.0)
    assert reserve(state_of(table, 2, 0, 1), 5.0, 0) == pytest.approx(table.floor[2] - 5.0)
    assert reserve(state_of(table, 2), 5.0, 0) == math.inf


def test_a_unit_has_time_until_those_before_it_are_full(made):
    """While both are being filled the second one need not hurry before the first one is needed."""
    table = made()
    both = state_of(table, 2, 0, 1)
    assert reserve(both, 5.0, 1) == pytest.approx(table.top[1] - 4.0 - 5.0)
    assert reserve(both, 5.0, 1) > reserve(both, 5.0, 0)


def spread_with(paper_bundle, left, up=True, uncertainty=0.0, lag=0.0):
    """
    Return pace (Pa/s) and way (Pa) of the second unit after a tick.

    The demand rises by 200 N/s and has ``left`` N until the first unit is full.
    """
    controller = RecruitmentController(paper_bundle)
    controller.enable(Measurement(20.0, 0.16, 0.0, np.array([150e3, 0.0])))
    state = controller.memory
    state.machine.state = 2
    begin_crossing(state.crossings, 1, up, 0.0, 1e4)
    demand = 20.0 + reserve(state, 20.0, 1) - left
    state.demand.rate, state.demand.uncertainty, state.outer.lag = 200.0, uncertainty, lag
    spread(controller.settings, controller.model, state, demand, DT)
    return state.crossings.pace[1], state.final.pressure[1]


@pytest.mark.parametrize(('uncertainty', 'lag', 'left'), [(0.0, 0.0, 10.0), (2.0, 0.0, 8.0),
                                                          (0.0, 0.01, 8.0)])
def test_a_crossing_ends_before_the_reserve_is_in_doubt(paper_bundle, uncertainty, lag, left):
    """Of 10 N left, 2 N are in doubt, or are needed before the pressures have followed."""
    pace, way = spread_with(paper_bundle, 10.0, uncertainty=uncertainty, lag=lag)
    assert pace == pytest.approx(way * 200.0 / left)


def test_a_unit_that_is_emptied_is_in_no_hurry_while_the_demand_rises(paper_bundle):
    """It only gives back what it pushed."""
    assert spread_with(paper_bundle, 1.0, up=False)[0] == 1e4 < spread_with(paper_bundle, 1.0)[0]


@pytest.mark.parametrize(('left', 'pace'), [(50.0, 200.0 / 50.0), (10.0, 200.0 / 10.0)])
def test_a_unit_is_empty_before_the_others_are(paper_bundle, left, pace):
    """While the demand falls by 200 N/s and has ``left`` N until no pressure is left in them."""
    controller = RecruitmentController(paper_bundle)
    controller.enable(Measurement(20.0, 0.16, 0.0, np.array([150e3, 0.0])))
    state = controller.memory
    begin_crossing(state.crossings, 1, False, 40e3, 1e4)
    state.demand.rate, state.demand.uncertainty, state.outer.lag = -200.0, 0.0, 0.0
    demand = 20.0 - room(state, 20.0) + left
    spread(controller.settings, controller.model, state, demand, DT)
    assert state.crossings.pace[1] == pytest.approx(40e3 * pace)


def test_a_unit_is_emptied_at_the_usual_pace_where_all_others_are_empty(paper_bundle):
    """The reference has stepped below what this unit may pull."""
    controller = RecruitmentController(paper_bundle)
    controller.enable(Measurement(20.0, 0.16, 0.0, np.array([150e3, 0.0])))
    state = controller.memory
    begin_crossing(state.crossings, 1, False, 40e3, 1e4)
    demand = 20.0 - room(state, 20.0)
    spread(controller.settings, controller.model, state, demand + 30.0, DT)
    assert state.crossings.pace[1] == 1e4
    spread(controller.settings, controller.model, state, demand - 30.0, DT)
    assert state.crossings.pace[1] == controller.config.switching.crossing_rate


@pytest.mark.parametrize(('why', 'back', 'time'), [
    (AHEAD, False, 1.0), (BEYOND, False, 0.0), (BEYOND, True, 1.0)])
@pytest.mark.parametrize(('direction', 'pressure'), [(1, 0.0), (-1, 30e3)])
def test_a_crossing_begins_slowly_unless_the_demand_is_out_of_reach(made, why, back, time,
                                                                    direction, pressure):
    """
    In the time that the feedback needs, to the bottom or to zero, or at the usual pace.

    A unit that is only brought back, for a reference that did not rise, comes slowly too.
    """
    back = back and direction > 0
    time = 0.0 if why == BEYOND and not back else time
    table = made()
    state = SimpleNamespace(
        table=table, crossings=no_crossings(2),
        machine=SimpleNamespace(state=2 if direction > 0 else 1, direction=direction, back=back),
        demand=Demand(force=table.top[1] - 9.0, rate=200.0, patience=1.0))
    send_unit(SimpleNamespace(switching=SimpleNamespace(crossing_rate=PACE)), state,
              SimpleNamespace(pressure=[200e3, pressure], reason=SimpleNamespace(why=why)))
    distance = table.bottom_pressure[1] if direction > 0 else pressure
    assert state.crossings.pace[1] == crossing_pace(distance, PACE, time)
    assert state.crossings.pressure[1] == pressure
    assert state.crossings.rush[1] == (0 if back else 1)


@pytest.mark.parametrize('speed', [0.03, -0.03])
def test_how_fast_the_limits_come_nearer_is_known_as_soon_as_the_motion(paper_bundle, speed):
    """A held force and a strain that begins to move: within 60 ms, not a quarter of a second."""
    controller, dt, pressure = RecruitmentController(paper_bundle), 4e-3, np.array([150e3, 0.0])
    for k in range(265):
        strain = 0.12 + speed * max(k - 250, 0) * dt
        force = float(paper_bundle.force(strain, pressure))
        controller.update(dt, Measurement(force, strain, 0.0, pressure), Reference('force', 20.0))
    full = np.array([paper_bundle.max_pressure[0], 0.0])
    nearer = paper_bundle.force(strain, full) - paper_bundle.force(strain + 0.01 * speed, full)
    demand, rate = controller.memory.demand, float(nearer) / 0.01
    assert controller.state == 1
    assert [demand.rate, demand.smooth_rate] == pytest.approx([rate, rate], rel=0.25)


def test_what_feedback_adds_to_the_demand_is_told_apart(paper_bundle):
    """Of a bundle that pulls 3 N less than its model: the reference, and the rest."""
    controller, pressure = RecruitmentController(paper_bundle), np.array([150e3, 0.0])
    for _ in range(100):
        force = float(paper_bundle.force(0.12, pressure)) - 3.0
        controller.update(4e-3, Measurement(force, 0.12, 0.0, pressure), Reference('force', 20.0))
    demand = controller.memory.demand
    assert demand.feedback > 2.0
    assert demand.force - demand.feedback == pytest.approx(20.0)


def test_limits_that_come_nearer_faster_and_faster_accelerate_the_demand(paper_bundle):
    """As the strain does, by the slope of the limit."""
    controller, dt, pressure = RecruitmentController(paper_bundle), 4e-3, np.array([150e3, 0.0])
    for k in range(350):
        strain = 0.12 + 0.2 * (max(k - 250, 0) * dt) ** 2
        force = float(paper_bundle.force(strain, pressure))
        controller.update(dt, Measurement(force, strain, 0.0, pressure), Reference('force', 10.0))
    full = np.array([paper_bundle.max_pressure[0], 0.0])
    slope = (paper_bundle.force(strain + 1e-3, full) - paper_bundle.force(strain, full)) / 1e-3
    assert controller.memory.demand.acceleration == pytest.approx(-0.4 * float(slope), rel=0.3)


@pytest.mark.parametrize('strain', [0.12, 0.2, 0.27])
def test_the_largest_force_of_a_state_is_that_of_its_table_at_any_strain(paper_bundle, strain):
    """Also where a unit is of no use; and the table stays where it is."""
    controller, dt, pressure = RecruitmentController(paper_bundle), 4e-3, np.zeros(2)
    tops = {}
    for now in (strain, strain - 0.01):
        force = float(paper_bundle.force(now, pressure))
        controller.reset()
        controller.update(dt, Measurement(force, now, 0.0, pressure), Reference('force', 5.0))
        table = controller.memory.table
        tops[now] = [top_at(table, controller.model, k, strain) for k in range(3)]
        assert table.moment.strain == now
        if now == strain:
            assert tops[now] == pytest.approx(table.top)
    assert tops[strain] == pytest.approx(tops[strain - 0.01])


@pytest.mark.parametrize('pulls', [8.0, 25.0])
def test_a_unit_that_pulls_where_its_model_pushes_back_is_released_slowly(paper_bundle, pulls):
    """A force that falls by 5 N/s, and a unit with 8 or 25 N more from 20 kPa on: less than 3 N.

    One release in vain tells how much the unit pulls. With fast crossings there were three, and
    an error of 9 N. A unit that was brought back is released after the absence time.
    """
    bundle = paper_bundle
    top = float(bundle.force(0.1, [bundle.max_pressure[0], 0.0]))
    controller, pressure, dt = RecruitmentController(bundle), np.zeros(2), 5e-3
    errors, states, noise = [], [], np.random.default_rng(1).normal(0.0, 5e-3, 6400)
    for k in range(6400):
        time = dt * k
        wanted = min(20.0 * time, 1.3 * top) - 5.0 * min(max(time - 10.0, 0.0), 10.0)
        force = float(bundle.force(0.1, pressure)) + pulls * (1.0 - np.exp(-pressure[1] / 20e3))
        command = controller.update(dt, Measurement(force + noise[k], 0.1, 0.0, pressure),
                                    Reference('force', wanted))
        pressure = pressure + (1.0 - np.exp(-dt / 20e-3)) * (command.pressure - pressure)
        if time > 10.0:
            errors.append(abs(wanted - force))
            states.append(command.state)
    assert states[-1] == 1
    assert sum(a > b for a, b in zip(states, states[1:])) <= 2
    assert max(errors) < 3.0


def test_a_unit_is_brought_in_slowly_where_there_is_time(made):
    """In the time that the feedback needs, but not faster than usual."""
    assert crossing_pace(50e3, PACE, 0.2) == pytest.approx(50e3 / 0.2)
    assert crossing_pace(50e3, PACE, 3.0) == pytest.approx(50e3 / 3.0)
    assert crossing_pace(50e3, PACE, 1e-3) == crossing_pace(50e3, PACE, 0.0) == PACE
    # A unit without a falling branch has nothing to be careful with.
    assert crossing_pace(0.0, PACE, 0.2) == PACE


def test_recruitment_looks_as_far_ahead_as_a_crossing_takes(made):
    """But no further than for a twentieth of the usual pace: most demands turn back before."""
    table = made()
    table.bottom_pressure[1] = 50e3
    assert crossing_time(table, 1, PACE, 0.2) == pytest.approx(1.4 * 0.2 + 0.02)
    assert crossing_time(table, 1, PACE, 3.0) == pytest.approx(1.4 * 50e3 / (PACE / 20) + 0.02)



def test_feedback_keeps_a_hand_over_within_the_noise():
    """An error that grows steadily is behind a first-order loop by its slope times the lag."""
    doubt, noise, lag = 5.0, 0.3, 0.03
    time, found, left = hand_over_time(doubt, noise, lag), 0.0, []
    for k in range(round(time / DT)):
        left.append(doubt * k * DT / time - found)
        found += (1.0 - math.exp(-DT / lag)) * left[-1]
    assert max(left) == pytest.approx(noise, rel=0.05)


def test_the_time_of_a_crossing_is_that_of_the_longer_way(made):
    """Its own way to the bottom, or that of the unit that makes up for the dip."""
    assert crossing_time(made(), 1, PACE, 0.0) == pytest.approx(1.4 * 50e3 / PACE + 0.02)
    weak = made(slope=(2e-5, 2e-3))
    assert crossing_time(weak, 1, PACE, 0.0) == pytest.approx(1.4 * 200e3 / PACE + 0.02)
    # With nobody to make up for the dip only its own way counts.
    flat = made(slope=(0.0, 2e-3))
    assert crossing_time(flat, 1, PACE, 0.0) == pytest.approx(1.4 * 50e3 / PACE + 0.02)


@pytest.mark.parametrize(('scheme', 'expected'), [(ORDERLY, 8e-5 / 1e-3), (BATCH, 8e-5 / 3e-3)])
def test_the_ratio_is_that_of_the_slopes(made, scheme, expected):
    """Of a falling unit over the one that is being filled, or over all that share a pressure."""
    two, order = made(), [0, 1, 2]
    table = curve_table(order, [*two.grid, two.grid[0]], True)
    table.force = [*two.force, two.force[0]]
    crossings = no_crossings(3)
    begin_crossing(crossings, 2, True, 20e3, PACE)
    state = SimpleNamespace(
        table=table, crossings=crossings, units=[0, 1, 2], machine=SimpleNamespace(state=3),
        shares=Shares([100e3, 100e3, 20e3], [0.0] * 3))
    settings = SimpleNamespace(scheme=scheme)
    assert compensation_ratio(settings, state, 2, 2) == pytest.approx(expected)
    # Units that are full do not help; where none does, the last one is reckoned with.
    state.shares.pressure[0] = 300e3
    assert compensation_ratio(settings, state, 2, 2) == pytest.approx(8e-5 / 2e-3)
    state.shares.pressure[1] = 300e3
    assert compensation_ratio(settings, state, 2, 2) == pytest.approx(8e-5 / 2e-3)
    assert math.isclose(compensation_ratio(settings, state, 2, 0), 8e-5 / 2e-3)


def test_a_hand_over_is_within_the_noise_that_is_left_behind_the_loop():
    """0.5 N of noise in the readings, less behind a lag of 30 ms: the error is no more."""
    lag, doubt, dt = 0.03, 3.0, 4e-3
    readings, found, kept = np.random.default_rng(1).normal(0.0, 0.5, 50000), [0.0], []
    for reading in readings:
        found.append(found[-1] + (1.0 - math.exp(-dt / lag)) * (reading - found[-1]))
    state, settings = recruitment_state([0, 1], [[0.0, 1e5]] * 2, True), SimpleNamespace(
        switching=SimpleNamespace(horizon=5.0), outer=SimpleNamespace(feedback=True))
    state.outer.lag = lag
    for reading in readings[:2000]:
        learn_noise(state.outer.observer, reading, 0.1, dt)
        kept.append(doubt * lag / patience(settings, state, doubt, dt))
    assert np.mean(kept[1000:]) == pytest.approx(np.std(found), rel=0.1)


@pytest.mark.parametrize(('feedback', 'kind', 'expected'), [
    (True, FORCE, 2.0), (False, FORCE, 0.0), (True, STRAIN, 0.0)])
def test_only_what_a_force_feedback_can_follow_is_waited_for(feedback, kind, expected):
    """Without it, or with a strain reference, no error of a crossing is corrected meanwhile."""
    state = recruitment_state([0, 1], [[0.0, 1e5]] * 2, True)
    state.outer.kind, state.outer.lag = kind, 0.03
    settings = SimpleNamespace(switching=SimpleNamespace(horizon=2.0),
                               outer=SimpleNamespace(feedback=feedback))
    assert patience(settings, state, 1e3, DT) == expected


def test_a_push_back_that_is_not_there_is_found_on_the_way_where_the_demand_is_slow(paper_bundle):
    """Rising by 4 N/s it leaves a second for a dip of 6 N; feedback needs all of it."""
    plant = paper_bundle.with_parameters({'resistive_buckling.pressure_share': 0.12})
    ramp = Trajectory(
        'ramp', 'force', 7.5, lambda t: 20.0 + 4.0 * t, lambda t: 4.0, Dynamometer(0.16),
        prepare=1.5)
    log = ClosedLoop(plant, paper_bundle, noise_factor=0.1, seed=1).run(ramp)
    assert len(log.switches) == 1
    assert np.abs(log.error[log.switches[0]:]).max() < 0.85


def test_a_hand_over_is_in_doubt_only_while_a_unit_is_on_its_way(paper_bundle):
    """By the doubt of the push-back that is crossed and by the bias; before and after by none."""
    controller = RecruitmentController(paper_bundle)
    pressure, doubts, on_its_way = np.zeros(2), [], []
    for k in range(500):
        force = 20.0 + min(max(k - 200, 0), 100) * 0.5
        seen = Measurement(float(paper_bundle.force(0.16, pressure)), 0.16, 0.0, pressure)
        command = controller.update(4e-3, seen, Reference('force', force))
        pressure = command.pressure
        doubts.append(controller.memory.demand.doubt)
        on_its_way.append(controller.memory.crossings.count > 0)
    assert controller.state == 2
    # It is worked out before units are sent on their way in a tick.
    assert [doubt > 1.0 for doubt in doubts[1:]] == on_its_way[:-1]
    assert 0 < sum(on_its_way) < 200


def test_an_error_of_a_hand_over_is_no_lateness(paper_bundle):
    """How much earlier a ramp must be asked for is learnt before and after, not meanwhile."""
    controller = RecruitmentController(paper_bundle)
    pressure, leads, on_its_way = np.zeros(2), [], []
    for k in range(400):
        seen = Measurement(0.9 * float(paper_bundle.force(0.16, pressure)), 0.16, 0.0, pressure)
        reference = Reference('force', 5.0 + 0.15 * k, 37.5)
        pressure = controller.update(4e-3, seen, reference).pressure
        leads.append(controller.memory.adaptation.lead)
        on_its_way.append(controller.memory.crossings.count > 0)
    changed = np.diff(leads) != 0.0
    # Learnt from what the tick before has left.
    assert not np.any(changed & np.array(on_its_way[:-1]))
    assert np.any(changed[:50])
    assert np.any(changed[-50:])
    assert any(on_its_way)
