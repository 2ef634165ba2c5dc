# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The state machine and the controller, without a plant: pressures follow at once."""

from types import SimpleNamespace

from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from fam_bundle_ros import control
from fam_bundle_ros.control import (
    Allocator,
    ControllerConfig,
    LoadModel,
    Measurement,
    OuterConfig,
    RecruitmentController,
    Reference,
    SwitchingConfig,
)
from fam_bundle_ros.errors import InputError

from .at_once import Bench, DT, OPEN, switches


@pytest.mark.parametrize(('units', 'policy'), [(2, 'hysteresis'), (6, 'reversal_aware')])
def test_ramp_goes_through_all_states_and_back(bundles, units, policy):
    """Up and down through every state once, in order, and the force is met at the end."""
    bench = Bench(bundles[units], 0.12, policy=policy, outer=OPEN)
    top = bench.curves.top[-1] - 2.0
    up = bench.ramp(2.0, top, 40.0)
    assert sorted({c.state for c in up}) == list(range(1, units + 1))
    assert np.all(switches(up) >= 0)
    assert bench.bundle.force(0.12, bench.pressure) == pytest.approx(top, abs=0.3)
    down = bench.ramp(top, 2.0, 80.0) + bench.hold(2.0, units)
    assert np.all(switches(down) <= 0)
    assert down[-1].state == 1


@pytest.mark.parametrize('rate', [-0.2, 0.2])
def test_a_moving_muscle_gets_the_pressures_of_where_it_will_be(paper_bundle, rate):
    """When the command is there: after dead time and lead it has moved on."""
    outer = OuterConfig(feedback=False, delay=20e-3, lead_time=10e-3)
    moving = Bench(paper_bundle, 0.1, outer=outer)
    for _ in range(60):
        moving.strain += rate * DT
        command = moving.update(20.0)
    here, there = (Bench(paper_bundle, moving.strain + late * rate, outer=outer).hold(
        20.0, 0.3)[-1].pressure for late in (0.0, 30e-3))
    assert abs(here - there).max() > 4e3
    assert command.pressure == pytest.approx(there, abs=0.2 * abs(here - there).max())


@given(units=st.sampled_from([2, 3, 6]), strain=st.floats(0.0, 0.2),
       shares=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=5), rate=st.floats(40.0, 300.0))
# Recruited ahead of need, and then the demand stops: at rest it counts as needed all the same.
@example(units=6, strain=0.125, shares=[0.0, 0.03125], rate=40.0)
@example(units=6, strain=0.125, shares=[0.0, 0.001953125], rate=126.0)
@settings(deadline=None, max_examples=10)
def test_monotone_demand_gives_monotone_recruitment(bundles, units, strain, shares, rate):
    """A demand that only rises never releases, one that only falls never recruits."""
    bench = Bench(bundles[units], strain, outer=OPEN)
    low, high = max(bench.curves.top[0], 0.0), bench.curves.top[-1]
    levels = low + np.sort(shares) * max(high - low, 0.0)
    up = bench.hold(levels[0], 0.5)
    up += [c for a, b in zip(levels, levels[1:]) for c in bench.ramp(a, b, rate)]
    up += bench.hold(levels[-1], 0.5)
    assert np.all(switches(up) >= 0)
    down = [c for a, b in zip(levels[::-1], levels[-2::-1]) for c in bench.ramp(a, b, rate)]
    assert np.all(switches(down) <= 0)


@given(strain=st.floats(0.0, 0.2), targets=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=8),
       rate=st.floats(40.0, 200.0))
@settings(deadline=None, max_examples=10)
def test_release_never_leaves_a_demand_unmet(bundles, strain, targets, rate):
    """After a release the state below can give the demand, whatever came before."""
    at_once = OuterConfig(feedback=False, lead_time=0.0, delay=0.0)
    bench = Bench(bundles[3], strain, outer=at_once)
    low, high = max(bench.curves.top[0], 0.0) + 1.0, bench.curves.top[-1]
    last, state = low, 0
    for share in targets:
        goal = low + share * max(high - low, 0.0)
        for force in np.linspace(last, goal, max(int(abs(goal - last) / rate / DT), 2)):
            command = bench.update(float(force), np.sign(goal - last) * rate)
            if command.state < state:
                assert command.state == state - 1
                assert force <= bench.curves.top[command.state] + 1e-9
            state = command.state
        last = goal


@given(strain=st.floats(0.06, 0.2), targets=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=6),
       rate=st.floats(30.0, 200.0), policy=st.sampled_from(['hysteresis', 'reversal_aware']))
@example(strain=0.1953125, targets=[0.125, 0.0], rate=30.0, policy='reversal_aware')
@settings(deadline=None, max_examples=10)
def test_falling_branch_is_crossed_never_held(bundles, strain, targets, rate, policy):
    """
    Between empty and the bottom of its branch no unit stays for more than 0.3 s.

    Nor, where two cross at once and compensate for each other, for more than that each; and none
    rests there for 0.1 s.
    """
    bench = Bench(bundles[3], strain, policy=policy, outer=OPEN)
    low, high = max(bench.curves.top[0], 0.0) + 1.0, bench.curves.top[-1]
    last, since, passed = low, np.zeros(3), []
    for share in targets:
        goal = low + share * max(high - low, 0.0)
        commands = bench.ramp(last, goal, rate) + bench.hold(goal, 0.5)
        for command in commands:
            falling = (command.pressure > 0.0) & (
                command.pressure < bench.curves.bottom_pressure - 500.0)
            since = np.where(falling, since + DT, 0.0)
            assert since.max() < 0.3 * max(falling.sum(), 1)
            passed.append(command.pressure)
            long = since > 0.1
            assert np.all(np.abs(passed[-1] - passed[-round(0.1 / DT):][0])[long] > 1e3)
        last = goal


def test_transition_keeps_the_force_on_the_demand(paper_bundle):
    """Crossing up and down, the model's force stays within 0.3 N of the demand in every tick."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN, still=0.0)
    bench.hold(10.0, 0.5)
    errors = []
    for command in bench.ramp(10.0, 70.0, 15.0) + bench.ramp(70.0, 10.0, 15.0):
        errors.append(bench.bundle.force(0.16, command.pressure) - command.demand)
    for _ in range(500):
        command = bench.update(10.0)
        errors.append(bench.bundle.force(0.16, command.pressure) - 10.0)
    assert command.state == 1
    assert np.max(np.abs(errors)) < 0.3


@pytest.mark.parametrize('units', [2, 6])
def test_every_climb_is_like_the_first(bundles, units):
    """After a climb and a full release each unit is recruited at the same demand as before."""
    bench = Bench(bundles[units], 0.12, outer=OPEN)
    top, climbs = bench.curves.top[-1] - 2.0, []
    for _ in range(2):
        up = bench.ramp(2.0, top, 80.0)
        climbs.append([up[i].demand for i in np.flatnonzero(switches(up))])
        bench.ramp(top, 2.0, 160.0)
        bench.hold(2.0, 0.9 * units)
    assert len(climbs[0]) >= units - 1
    # The first is from RS0, the second from RS1.
    assert climbs[1] == pytest.approx(climbs[0][-len(climbs[1]):], abs=0.5)


@pytest.mark.parametrize('uneven', [0.0, 0.2, 0.6])
def test_uneven_sample_times_recruit_nothing(paper_bundle, uneven):
    """A ramp that ends well within RS1 never needs MU2, however the ticks are scattered."""
    random, bench = np.random.default_rng(0), Bench(paper_bundle, 0.1, outer=OPEN)
    time = 0.0
    while time < 3.0:
        dt = DT * (1.0 + uneven * random.uniform(-1.0, 1.0))
        time += dt
        value = min(5.0 + 100.0 * time, 65.0)
        command = bench.update(value, 100.0 if value < 65.0 else 0.0, dt=dt)
        assert command.state <= 1, command.explanation
    assert value < bench.curves.top[1] - 15.0


def test_the_observer_goes_on_while_a_unit_is_crossed(paper_bundle):
    """A unit that is weaker than the model is made up for during its crossing already."""
    bench = Bench(paper_bundle, 0.16)
    bench.bundle = paper_bundle.with_effect('motor_unit_mismatch', mu2=-0.2)
    bench.hold(20.0, 1.0)
    memory, moved = bench.controller.memory, []
    for force in np.linspace(20.0, 70.0, 600):
        before, crossing = memory.outer.bias, memory.crossings.count > 0
        bench.update(float(force), 50.0 / 3.0)
        if crossing:
            moved.append(memory.outer.bias - before)
    assert len(moved) > 5
    assert np.any(moved)


def test_the_model_is_asked_for_the_rate_that_a_strain_reference_says(paper_bundle):
    """And with a force reference for the rate that is measured, without its noise."""
    bench = Bench(paper_bundle, 0.1)
    for kind, value, rate, asked in (('strain', 0.1, 0.07, 0.07), ('force', 40.0, 5.0, 0.0)):
        for _ in range(20):
            bench.update(value, rate, kind)
        assert bench.controller.memory.table.moment.strain_rate == asked


def test_units_with_different_limits_share_one_grid(bundles):
    """Common pressures in ``batch``: the table has them for every unit, cut at its limit."""
    allocator = Allocator(bundles[3], max_pressure=(100e3, 200e3, 300e3))
    assert allocator.grid[0] == [min(p, 100e3) for p in allocator.grid[2]]
    assert max(allocator.grid[1]) == 200e3


def test_a_step_beyond_the_present_state_is_met_as_fast_as_the_valves_go(paper_bundle):
    """Where nobody can make up for the push-back, the next unit is not brought in gently."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    bench.hold(30.0, 1.0)
    met = [command.saturated == '' for command in bench.hold(90.0, 0.2)]
    assert met.index(True) * DT <= 0.02


def test_all_units_that_a_step_needs_begin_in_one_tick(bundles):
    """Each valve fills its own unit: five of six start with the first tick of the step."""
    bench = Bench(bundles[6], 0.16, outer=OPEN)
    bench.hold(10.0, 1.0)
    before = bench.controller.state
    assert bench.update(100.0).state - before >= 3


def test_a_push_back_that_is_not_there_is_crossed_as_slowly_as_feedback_needs(paper_bundle):
    """On a ramp the force is off by less than 40 % of the push-back of 6.4 N."""
    bench, off = Bench(paper_bundle, 0.16, noise=0.1), []
    bench.bundle = SimpleNamespace(force=lambda strain, pressure: np.maximum(
        paper_bundle.unit_forces(strain, pressure), 0.0).sum())
    bench.ramp(0.0, 10.0, 20.0)
    assert bench.controller.state == 1
    for force in np.arange(10.0, 45.0, 0.1):
        off.append(bench.bundle.force(0.16, bench.update(float(force), 20.0).pressure) - force)
    assert bench.controller.state == 2
    assert max(np.abs(off)) < 0.4 * 6.4


def test_full_is_full_and_empty_is_empty(paper_bundle):
    """The quiet band stops short of neither end."""
    bench = Bench(paper_bundle, 0.1, outer=OPEN, scheme='all_on', still=5e3)
    top = bench.curves.top[-1]
    assert bench.hold(top - 0.5, 0.1)[-1].pressure[0] < paper_bundle.max_pressure[0]
    assert bench.hold(top + 5.0, 0.1)[-1].pressure == pytest.approx(paper_bundle.max_pressure,
                                                                    abs=0.0)
    bench = Bench(paper_bundle, 0.16, outer=OPEN, still=5e3)
    assert bench.hold(70.0, 1.0)[-1].pressure[1] > 0.0
    assert bench.hold(10.0, 3.0)[-1].pressure[1] == 0.0


def test_pressures_change_only_by_more_than_the_quiet_band(paper_bundle):
    """A demand that asks for 300 Pa more moves nothing, one for 600 Pa does."""
    bench = Bench(paper_bundle, 0.1, outer=OPEN, still=400.0)
    before = bench.hold(40.0, 0.5)[-1].pressure[0]
    slope = bench.curves.slope(0, before)
    # The play leaves the pressure below what was asked for by its width.
    assert bench.update(40.0 - 300.0 * slope).pressure[0] == before
    assert bench.update(40.0 + 600.0 * slope).pressure[0] > before + 100.0


def test_the_models_memory_goes_on_with_every_tick(paper_bundle):
    """After a swing it is what the bundle itself remembers of the strains, but for their noise."""
    bundle = paper_bundle.with_effect('presliding_hysteresis', force=4.0)
    controller, state = RecruitmentController(bundle), bundle.start_state()
    pressure = np.array([200e3, 0.0])
    for strain in 0.1 + 0.02 * np.sin(np.linspace(0.0, 4.0, 100)):
        controller.update(DT, Measurement(30.0, strain, 0.0, pressure), Reference('force', 30.0))
        rate = controller.memory.table.moment.strain_rate
        _, state = bundle.step(state, DT, strain, pressure, rate)
    assert np.ravel(controller.model.memory) == pytest.approx(np.ravel(state['memory']), abs=2e-5)
    assert np.any(state['memory'])


@pytest.mark.parametrize('noise', [2e-5, 1e-4, 2e-4, 4e-4])
def test_noise_of_the_strain_recruits_nothing(paper_bundle, noise):
    """What RS1 can give wavers as noise sets in; a demand close to it stays in RS1."""
    bench, random = Bench(paper_bundle, 0.16, outer=OPEN), np.random.default_rng(1)
    level = bench.curves.crossing[1] - 1.0
    bench.hold(level, 1.0)
    for strain in random.normal(0.16, noise, 1000):
        bench.strain = float(strain)
        assert bench.update(level).state == 1


def test_all_on_stays_all_on(paper_bundle):
    """No demand, however small or long, releases a unit of the single equivalent motor unit."""
    bench = Bench(paper_bundle, 0.1, scheme='all_on')
    assert {command.state for command in bench.hold(1.0, 3.0)} == {2}


def test_enabling_counts_no_unit_on_its_falling_branch(paper_bundle):
    """A pressure below the bottom of the branch is a unit that is off."""
    controller = Bench(paper_bundle, 0.16).controller
    for second, state in ((0.0, 1), (40e3, 1), (150e3, 2)):
        controller.enable(Measurement(30.0, 0.16, 0.0, np.array([200e3, second])))
        assert controller.state == state


@pytest.mark.parametrize(('end', 'rate', 'said'), [(38.0, 0.0, ''), (60.0, 500.0, 'rising by')])
def test_a_step_is_no_rate_and_a_fast_ramp_is_no_step(paper_bundle, end, rate, said):
    """A step inside RS1 recruits nothing ahead; a ramp of 2.5 N per tick is seen coming."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    bench.hold(20.0, 1.0)
    demands = np.arange(20.0, end, rate * DT) if rate else [end] * 100
    told = [bench.update(float(f), rate).explanation for f in demands]
    assert said in ''.join(told)
    assert any(told) == bool(said)


@pytest.mark.parametrize('step', [0.3, 1.5, 4.0])
def test_a_step_of_any_size_is_no_rate(paper_bundle, step):
    """To 1 N below the overlap; as a rate the smaller ones would be hundreds of N/s."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    end = bench.curves.crossing[1] - 1.0
    bench.hold(end - step, 1.0)
    for command in bench.hold(end, 0.2):
        assert command.state == 1
        assert bench.controller.memory.demand.rate == pytest.approx(0.0, abs=1e-6)


def test_a_limit_that_comes_down_to_the_demand_counts_as_a_demand_that_rises(paper_bundle):
    """At a constant demand, contraction takes away what RS1 can give: MU2 comes in time."""
    bench, told = Bench(paper_bundle, 0.12, outer=OPEN), []
    bench.hold(45.0, 1.0)
    for strain in np.linspace(0.12, 0.18, 400):
        bench.strain = float(strain)
        told.append(bench.update(45.0).explanation)
    assert 'recruit MU2: demand 45.0 N rising by' in ''.join(told)


def test_what_is_learnt_at_rest_is_no_demand_that_rises(paper_bundle):
    """RS2's limit comes down as MU2 is found to be weak; the demand comes down with it."""
    bench, rates, limits = Bench(paper_bundle, 0.16), [], []
    bench.bundle = paper_bundle.with_effect('motor_unit_mismatch', mu2=-0.2)
    bench.hold(70.0, 0.3)
    for _ in range(400):
        limits.append(bench.update(70.0).margins.limit)
        rates.append(bench.controller.memory.demand.rate)
    assert limits[0] - limits[-1] > 0.5
    assert max(map(abs, rates)) < 0.01


@pytest.mark.parametrize(('demand', 'said'), [(-40.0, 'low'), (300.0, 'high'), (75.0, 'gap')])
def test_out_of_reach_is_told_from_not_in_reach_yet(paper_bundle, demand, said):
    """Below all, beyond all, or only beyond the present state."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    bench.hold(30.0, 1.0)
    assert bench.update(demand).saturated == said


def test_a_gap_in_the_readings_counts_from_its_own_beginning(paper_bundle):
    """Short losses do not add up."""
    bench = Bench(paper_bundle, 0.16)
    held = bench.hold(40.0, 1.0)[-1].pressure
    lost = Measurement(np.nan, 0.16, 0.0, held)
    for _ in range(10):
        for _ in range(6):
            command = bench.controller.update(DT, lost, Reference('force', 40.0))
        assert command.state == 1
        bench.update(40.0)


def test_every_decision_is_explained(paper_bundle):
    """The explanation names the unit and the forces that decided."""
    bench = Bench(paper_bundle, 0.16, policy='hysteresis', outer=OPEN)
    bench.hold(30.0, 0.5)
    words = [c.explanation for c in bench.ramp(30.0, 60.0, 15.0) if c.explanation]
    assert len(words) == 1
    assert words[0].startswith('recruit MU2: demand 44.')
    assert "above RS1's 44.5 N by more than" in words[0]


@pytest.mark.parametrize(('demand', 'said'), [(200.0, 'high'), (-60.0, 'low'), (30.0, '')])
def test_saturation_is_said(paper_bundle, demand, said):
    """Out of reach above or below is told apart."""
    bench = Bench(paper_bundle, 0.16, outer=OPEN)
    assert bench.hold(demand, 2.0)[-1].saturated == said


def test_integral_does_not_wind_up_while_out_of_reach(paper_bundle):
    """After ten seconds of an impossible demand the way down is not delayed."""
    outer = OuterConfig(feed_forward=False)
    bench = Bench(paper_bundle, 0.16, outer=outer)
    bench.hold(30.0, 3.0)
    bench.hold(300.0, 10.0)
    bench.hold(30.0, 1.0)
    assert bench.bundle.force(0.16, bench.pressure) == pytest.approx(30.0, abs=1.0)


@pytest.mark.parametrize('feed_forward', [True, False])
def test_feedback_makes_a_wrong_model_exact_at_rest(paper_bundle, feed_forward):
    """With a plant weaker by a tenth the force at rest is still the reference."""
    bench = Bench(paper_bundle, 0.16, outer=OuterConfig(feed_forward=feed_forward))
    bench.bundle = paper_bundle.with_effect('motor_unit_mismatch', mu2=-0.1)
    bench.hold(70.0, 6.0)
    assert bench.bundle.force(0.16, bench.pressure) == pytest.approx(70.0, abs=0.3)


def test_enabling_starts_from_the_pressures_that_are_there(paper_bundle):
    """Switching on at any pressures moves none of them by more than a few kPa at first."""
    for pressure in ([200e3, 0.0], [344.7e3, 180e3], [200e3, 150e3], [150e3, 220e3]):
        bench = Bench(paper_bundle, 0.16)
        bench.pressure = np.array(pressure)
        force = float(paper_bundle.force(0.16, bench.pressure))
        measurement = Measurement(force, 0.16, 0.0, bench.pressure)
        bench.controller.enable(measurement)
        first = bench.update(20.0).pressure
        assert np.max(np.abs(first - pressure)) < 12e3


@pytest.mark.parametrize('offset', [-8.0, 8.0])
@pytest.mark.parametrize(('kind', 'told', 'feed_forward'), [
    ('force', False, True), ('force', False, False), ('strain', False, True),
    ('strain', True, True), ('strain', True, False)])
def test_enabling_holds_a_load_that_the_model_does_not_explain(paper_bundle, offset, kind, told,
                                                               feed_forward):
    """
    At rest at its reference no pressure moves, though the muscles pull 8 N more or less.

    The observer of the force follows what is learnt with a lag: some 2 kPa.
    """
    pressure = np.array([247e3, 0.0])
    force = float(paper_bundle.force(0.08, pressure)) + offset
    controller = RecruitmentController(paper_bundle, ControllerConfig(
        load=LoadModel(force=force) if told else LoadModel(),
        outer=OuterConfig(feed_forward=feed_forward)))
    measurement = Measurement(force, 0.08, 0.0, pressure)
    controller.enable(measurement)
    reference = Reference(kind, force if kind == 'force' else 0.08, 0.0)
    for _ in range(200):
        assert controller.update(DT, measurement, reference).pressure == pytest.approx(
            pressure, abs=2.5e3 if kind == 'force' and feed_forward else 50.0)
    assert abs(controller.memory.table.pull[0] - 1.0) > 0.05  # and has learnt meanwhile


@pytest.mark.parametrize('pressure', [[200e3, 200e3], [150e3, 300e3]])
def test_after_enabling_units_return_to_filling_in_turn_without_a_bump(paper_bundle, pressure):
    """From the pressures of another controller; no valve has to be fast for the force to stay."""
    bench = Bench(paper_bundle, 0.16)
    bench.pressure = np.array(pressure)
    force = float(paper_bundle.force(0.16, bench.pressure))
    bench.controller.enable(Measurement(force, 0.16, 0.0, bench.pressure))
    for _ in range(1000):
        before = bench.pressure
        bench.update(force)
        assert np.max(np.abs(bench.pressure - before)) < 12e3
        assert paper_bundle.force(0.16, bench.pressure) == pytest.approx(force, abs=0.5)
    assert bench.pressure[0] == paper_bundle.max_pressure[0] or bench.pressure[1] == 0.0


@pytest.mark.parametrize('kind', ['force', 'strain'])
def test_after_a_reset_a_controller_does_as_a_new_one(paper_bundle, kind):
    """Whatever went before: no filter, observer, heading or state of it is left."""
    used, new = Bench(paper_bundle, 0.12), Bench(paper_bundle, 0.12)
    for bench, before in ((used, 200), (new, 0)):
        for k in range(before):
            bench.update({'force': 80.0, 'strain': 0.2}[kind] * k / before, kind=kind)
        bench.controller.reset()
        bench.pressure = np.zeros(paper_bundle.n)
    for k in range(100):
        target = {'force': 30.0, 'strain': 0.1}[kind] * min(k / 50, 1.0)
        assert used.update(target, kind=kind).pressure == pytest.approx(
            new.update(target, kind=kind).pressure, abs=1.0)


@pytest.mark.parametrize('how', ['another kind of reference', 'enabled anew'])
def test_a_strain_loop_that_knows_no_load_goes_on_from_the_force_that_holds_it(paper_bundle, how):
    """At the strain where a load hangs still, taking over moves no pressure, then or later."""
    bench = Bench(paper_bundle, 0.12)
    bench.hold(60.0, 2.0)
    held = bench.pressure
    if how == 'enabled anew':
        force = float(paper_bundle.force(0.12, held))
        bench.controller.enable(Measurement(force, 0.12, 0.0, held))
    for _ in range(200):
        assert bench.update(0.12, kind='strain').pressure == pytest.approx(held, abs=2e3)


def test_enabling_holds_the_pressures_until_time_goes_on(paper_bundle):
    """A first tick without a time step repeats what was taken over, not a vented bundle."""
    bench = Bench(paper_bundle, 0.1)
    measurement = Measurement(30.0, 0.1, 0.0, np.array([200e3, 0.0]))
    bench.controller.enable(measurement)
    command = bench.controller.update(0.0, measurement, Reference('force', 40.0))
    assert command.pressure == pytest.approx([200e3, 0.0])
    assert command.state == 1
    assert list(command.active) == [True, False]


def test_enabling_takes_over_no_pressure_that_cannot_be_commanded(paper_bundle):
    """A gauge below zero or above the limit, or without a reading."""
    controller = Bench(paper_bundle, 0.1).controller
    for shown, taken in ((-300.0, 0.0), (400e3, 344.7e3), (np.nan, 0.0), (120e3, 120e3)):
        measurement = Measurement(30.0, 0.1, 0.0, np.array([200e3, shown]))
        controller.enable(measurement)
        command = controller.update(0.0, measurement, Reference('force', 40.0))
        assert command.pressure.tolist() == [200e3, taken]


def test_a_decision_is_told_once_though_readings_are_lost(paper_bundle):
    """Ticks that hold the last command do not say its reason again."""
    bench = Bench(paper_bundle, 0.1)
    assert bench.update(40.0).explanation.startswith('recruit MU1')
    lost = Measurement(np.nan, 0.1, 0.0, np.zeros(2))
    held = [bench.controller.update(DT, lost, Reference('force', 40.0)) for _ in range(3)]
    assert [command.explanation for command in held] == ['', '', '']


def test_lost_readings_hold_then_vent_then_recover(paper_bundle):
    """NaN holds the pressures for a moment, then vents; good readings bring control back."""
    bench = Bench(paper_bundle, 0.16)
    held = bench.hold(40.0, 1.0)[-1].pressure
    lost = Measurement(np.nan, 0.16, 0.0, held)
    commands = [bench.controller.update(DT, lost, Reference('force', 40.0)) for _ in range(100)]
    assert commands[6].pressure == pytest.approx(held)
    assert not commands[9].pressure.any()
    assert not commands[-1].pressure.any()
    assert [c.explanation for c in commands if c.explanation][-1].startswith('vent: no usable')
    bench.pressure = np.zeros(2)
    assert bench.hold(40.0, 1.0)[-1].state == 1


def test_a_demand_at_the_limit_of_a_unit_moves_the_next_one_across_its_kink_once(paper_bundle):
    """
    The demand goes up and down by 10 mN: across 1.6 kPa to and fro it would be a limit cycle.

    Once the demand has fallen by more than its uncertainty, the unit returns.
    """
    bench = Bench(paper_bundle, 0.11, outer=OPEN, still=0.0)
    bench.hold(80.0, 1.0)
    table = bench.controller.memory.table
    limit = table.top_force[0] + table.bottom_force[1]
    waits = bench.hold(limit - 3.0, 0.1)[-1].pressure[1]
    second = [bench.hold(limit + 0.01 * (-1) ** k, 0.04)[-1].pressure[1] for k in range(20)]
    assert min(second) > waits + 1.5e3
    assert np.ptp(second) < 300.0
    assert bench.hold(limit - 3.0, 0.1)[-1].pressure[1] == pytest.approx(waits, abs=1.0)


@pytest.mark.parametrize('broken', [
    {'force': 1e30}, {'strain': 1e30}, {'pressure': 1e200}, {'reference': 1e300}])
def test_one_absurd_number_leaves_no_trace(paper_bundle, broken):
    """As a NaN, it counts as missing: in a filter it would outlast its one sample by seconds."""
    bench = Bench(paper_bundle, 0.1)
    held = bench.hold(60.0, 1.0)[-1].pressure
    given = {'force': 60.0, 'strain': 0.1, 'pressure': held[0], 'reference': 60.0, **broken}
    command = bench.controller.update(
        DT, Measurement(given['force'], given['strain'], 0.0, np.array([given['pressure'],
                                                                       held[1]])),
        Reference('force', given['reference']))
    assert command.pressure == pytest.approx(held)
    bench.hold(60.0, 1.0)
    assert paper_bundle.force(0.1, bench.pressure) == pytest.approx(60.0, abs=0.5)


@pytest.mark.parametrize(('kind', 'value'), [('force', 60.0), ('strain', 0.1)])
@pytest.mark.parametrize('spike', [0.1, -0.05])
def test_a_spike_of_the_strain_moves_no_pressure(paper_bundle, kind, value, spike):
    """A single reading far from those before and after it."""
    bench = Bench(paper_bundle, 0.1, noise=0.3)
    bench.hold(60.0, 1.0)
    [bench.update(value, kind=kind) for _ in range(200)]
    held = bench.pressure
    force = float(paper_bundle.force(0.1, held))
    told = [bench.controller.update(
        DT, Measurement(force, 0.1 + spike, spike / DT, held),
        Reference(kind, value, 0.0)).pressure]
    told += [bench.update(value, kind=kind).pressure for _ in range(20)]
    assert np.abs(np.array(told) - held).max() < 1e3


def test_user_order_is_followed(bundles):
    """With the order given, that unit is filled first."""
    bench = Bench(bundles[3], 0.1, order=(2, 0, 1), outer=OPEN)
    command = bench.hold(5.0, 0.5)[-1]
    assert list(command.active) == [False, False, True]


def test_bad_settings_and_references_fails(paper_bundle):
    """What cannot be meant is refused with the value that came."""
    with pytest.raises(InputError, match="'smart'"):
        ControllerConfig(policy='smart')
    with pytest.raises(InputError, match="'all'"):
        ControllerConfig(scheme='all')
    with pytest.raises(InputError, match='margin is -1'):
        SwitchingConfig(margin=-1.0)
    bench = Bench(paper_bundle, 0.1)
    with pytest.raises(InputError, match="'torque'"):
        bench.update(1.0, kind='torque')


@pytest.mark.parametrize('policy', ['hysteresis', 'reversal_aware'])
def test_where_the_force_rises_with_the_strain_pressures_are_for_the_strain_that_is_there(
        bundles, policy):
    """
    Where push-back collapses: else the strain would be driven away from its reference.

    Elsewhere muscles are springs, and the force that draws the strain back is left to act; also
    where the default policy has filled the units that push back.
    """
    strains = np.linspace(0.03, 0.2, 171)
    forces = bundles[6].force(strains, np.tile([200e3, 0, 0, 0, 0, 0], (171, 1)))
    rises = np.argmax(np.gradient(forces))
    assert forces[rises + 2] > forces[rises - 2] + 1.0
    for wanted, there in ((rises - 2, rises + 2), (rises + 2, rises - 2), (100, 104), (104, 100)):
        load = LoadModel(force=float(forces[wanted]))
        bench = Bench(bundles[6], strains[there], outer=OPEN, load=load, policy=policy)
        for _ in range(100):
            bench.update(strains[wanted], kind='strain')
        away = strains[there] - strains[wanted]
        back = bench.bundle.force(strains[there], bench.pressure) - forces[wanted]
        if wanted >= 100:
            assert back == pytest.approx(float(forces[there] - forces[wanted]), abs=0.05)
        elif policy == 'hysteresis':
            assert back == pytest.approx(0.0, abs=0.05)
            continue
        assert back * away < 0.0


@pytest.mark.parametrize('asked', [40.0, 150.0])
def test_a_force_that_cannot_be_reached_is_no_error_of_the_model(paper_bundle, asked):
    """A rig as the model, all units at their limit: nothing is missing that pressures owe."""
    controller, pressure = RecruitmentController(paper_bundle), np.zeros(2)
    for _ in range(500):
        force = float(paper_bundle.force(0.12, pressure))
        pressure = controller.update(DT, Measurement(force, 0.12, 0.0, pressure),
                                     Reference('force', asked)).pressure
    assert (max(pressure) > 340e3) == (asked > 100.0)
    assert abs(controller.memory.outer.observer.bias) < 0.5


def test_settings_references_and_commands_cannot_be_changed(not_frozen):
    """What kernels work on is a state, settings or a record, or one of these."""
    assert {name for name in not_frozen(control)
            if not name.endswith(('State', 'Settings', 'Record'))} == {
                'Crossings', 'CurveTable', 'Demand', 'Jump', 'LoadEstimate', 'Margins', 'Moment',
                'PidDiagnostics', 'Reason', 'Shares', 'Target'}
