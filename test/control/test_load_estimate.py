# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A load of which the controller is told nothing."""

import numpy as np
import pytest

from fam_bundle_ros.control import (
    ControllerConfig,
    LoadModel,
    Measurement,
    OuterConfig,
    RecruitmentController,
    Reference,
)
from fam_bundle_ros.control.load_estimate import (
    dry_friction,
    law_doubt,
    learn_load,
    load_law,
    LoadEstimate,
)
from fam_bundle_ros.control.outer_loop import outer_settings
from fam_bundle_ros.nodes.profile import load_profile
from fam_bundle_ros.plant import Arm, MassSpring
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

DT, MOST, USUAL, TIME = 4e-3, 2e3, 0.3, 0.02


def learnt(strain, force, state=None):
    """Return what is known of a load after readings of strain and force."""
    state = state or LoadEstimate()
    for reading in zip(strain, force):
        learn_load(state, *reading, MOST, USUAL, TIME, DT)
        # The strain loop decides; here, for two steps for each of stiffness, damping and inertia.
        state.known = state.places >= 6
    return state


def moved(duration):
    """Return a strain of three sines with its rate and acceleration, from rest at zero."""
    t = np.arange(0.0, duration, DT)
    turns = 2.0 * np.pi * np.array([0.3, 0.9, 2.1])
    sizes = np.array([0.05, 0.02, 0.01])
    phase = np.outer(t, turns)
    return (((1.0 - np.cos(phase)) * sizes).sum(1), (np.sin(phase) * turns * sizes).sum(1),
            (np.cos(phase) * turns ** 2 * sizes).sum(1))


@pytest.mark.parametrize(('stiffness', 'damping', 'inertia'), [
    (600.0, 5.0, 0.4), (0.0, 5.0, 0.7), (200.0, 15.0, 17.0)])
def test_a_spring_a_weight_and_an_arm_are_told_apart(stiffness, damping, inertia):
    """Stiffness, damping and inertia to what 0.2 N of noise leave."""
    strain, rate, bend = moved(8.0)
    force = 20.0 + stiffness * strain + damping * rate + inertia * bend
    state = learnt(strain, force + 0.2 * np.random.default_rng(0).standard_normal(len(strain)))
    assert state.known
    assert state.value[0] == pytest.approx(stiffness, abs=40.0)
    assert state.value[1] == pytest.approx(damping, abs=3.0 + 0.5 * inertia)
    assert state.value[2] == pytest.approx(inertia, rel=0.1, abs=0.15)
    assert state.offset + load_law(state, strain[-1], rate[-1], bend[-1]) == pytest.approx(
        force[-1], abs=1.0)


@pytest.mark.parametrize('only', range(3))
def test_what_a_load_has_not_is_not_found(only):
    """Of stiffness, damping and inertia one alone: the other two are nearly none."""
    motion = moved(8.0)
    state = learnt(motion[0], 20.0 + (400.0, 15.0, 0.8)[only] * motion[only])
    for k, (part, size, within) in enumerate(zip(state.value, (400.0, 15.0, 0.8),
                                                 (20.0, 0.75, 0.08))):
        assert part == pytest.approx(size * (k == only), abs=within)


def test_an_inertia_that_nothing_shows_stays_the_usual_one():
    """A slow motion tells the stiffness."""
    slow = np.linspace(0.0, 0.1, 2500)
    state = learnt(slow, 20.0 + 400.0 * slow)
    assert state.value[0] == pytest.approx(400.0, rel=0.02)
    assert state.inertia == pytest.approx(USUAL)


def test_an_inertia_is_relied_on_but_for_its_doubt_which_goes_with_its_root():
    """It may change by a share of itself from place to place, beside what else moves forces."""
    strain, _, bend = moved(20.0)
    doubt = []
    for inertia in (1.25, 20.0):
        state = learnt(strain, 20.0 + inertia * bend)
        assert state.value[2] == pytest.approx(inertia, rel=0.05)
        doubt.append(state.value[2] - state.inertia)
    assert doubt[1] / doubt[0] == pytest.approx(4.0, rel=0.15)


def test_at_rest_nothing_is_learnt_and_nothing_forgotten():
    """Ten minutes of noise later the load is as it was; a force that changes is the offset's."""
    strain, rate, bend = moved(8.0)
    state = learnt(strain, 20.0 + 600.0 * strain + 0.4 * bend)
    learnt(np.full(100, strain[-1]), np.full(100, 20.0 + 600.0 * strain[-1]), state)
    before = list(state.value)
    rng = np.random.default_rng(1)
    n = round(600.0 / DT)
    learnt(strain[-1] + 1e-4 * rng.standard_normal(n), 50.0 + 0.2 * rng.standard_normal(n), state)
    assert state.value[:3] == before[:3]
    assert state.offset + before[0] * strain[-1] == pytest.approx(50.0, abs=0.2)


def test_a_stop_that_is_left_is_no_stiff_load():
    """A weight on the ground is given 40 N, half a second later it moves."""
    strain, _, _ = moved(3.0)
    force = np.concatenate([np.linspace(0.0, 40.0, 125), np.full(125, 40.0)])
    state = learnt(np.zeros(250), force)
    assert not state.known
    for reading in strain:
        learnt([reading], [40.0], state)
        assert state.value[0] < 10.0
    assert state.known


def lifted(stiffness, damping, inertia, weight, rise, duration, noise=0.0):
    """Return strain and force of a load on a stop; the force rises, later as the load allows."""
    strain, rate, force, log = 0.0, 0.0, 0.0, []
    for _ in range(round(duration / DT)):
        for _ in range(10):
            force += 0.1 * DT * (rise - 3e3 * rate)
            bend = (force - weight - stiffness * strain - damping * rate) / inertia
            rate = max(rate + 0.1 * DT * bend, 0.0) if strain <= 0.0 else rate + 0.1 * DT * bend
            strain = max(strain + 0.1 * DT * rate, 0.0)
        log.append((strain, force))
    strain, force = np.array(log).T
    return strain, force + noise * np.random.default_rng(3).standard_normal(len(force))


@pytest.mark.parametrize(('stiffness', 'inertia'), [(0.0, 0.9), (800.0, 0.9), (300.0, 0.3)])
def test_a_load_that_is_lifted_off_a_stop_is_known_soon(stiffness, inertia):
    """Though the stop held a part of the force until then, which the filters still contain."""
    strain, force = lifted(stiffness, 4.0, inertia, 40.0, 300.0, 0.6, noise=0.05)
    start = int(np.argmax(strain > 0.0))
    end = start + round(0.2 / DT)
    state = learnt(strain[:end], force[:end])
    assert state.value[0] == pytest.approx(stiffness, abs=120.0)
    assert state.value[2] == pytest.approx(inertia, rel=0.2)
    assert state.offset == pytest.approx(40.0, abs=4.0)


def test_a_weight_that_is_put_on_at_rest_is_no_inertia():
    """It moves the load, which shows its inertia and the weight at once."""
    strain, _, bend = moved(6.0)
    state = learnt(strain, 40.0 + 0.9 * bend)
    rest = strain[-1]
    learnt(np.full(100, rest), np.full(100, 40.0), state)
    t = np.arange(1, 76) * DT
    sunk = 0.02 * (np.cos(2.0 * np.pi * 2.0 * t) - 1.0)
    for k in range(len(t)):
        bend = -0.02 * (4.0 * np.pi) ** 2 * np.cos(4.0 * np.pi * t[k])
        learnt([rest + sunk[k]], [60.0 + 0.9 * bend], state)
        assert 0.6 < state.value[2] < 1.2


def test_the_doubt_of_a_force_is_that_of_the_way_to_it():
    """None where the load moves as now; of the stiffness alone at the present rate."""
    strain, rate, bend = moved(3.0)
    state = learnt(strain, 20.0 + 600.0 * strain + 0.4 * bend)
    here = (state.strains[2], state.rate, state.bend)
    assert law_doubt(state, *here) == 0.0
    for k in range(3):
        there = [value + 0.01 * (i == k) for i, value in enumerate(here)]
        assert law_doubt(state, *there) == pytest.approx(
            0.01 * np.sqrt(state.covariance[k][k]))


def test_the_other_values_go_with_one_that_ends_at_its_bound():
    """A weight in a slow start: a stiffness of less than none would have made its inertia less."""
    strain, rate, bend = moved(0.6)
    state = learnt(strain, 20.0 + 0.8 * bend)
    assert state.value[2] == pytest.approx(0.8, rel=0.1)


def test_a_weight_that_is_put_on_does_not_turn_the_stiffness_round():
    """30 N more from one reading to the next, on a spring of 600 N."""
    strain, _, _ = moved(8.0)
    force = 20.0 + 600.0 * strain
    middle = len(strain) // 2
    force[middle:] += 30.0
    estimates = []
    state = learnt(strain[:middle], force[:middle])
    for k in range(middle, len(strain)):
        learnt(strain[k:k + 1], force[k:k + 1], state)
        estimates.append(state.value[0])
    assert min(estimates) > 100.0
    assert max(estimates) < 1100.0
    assert estimates[-1] == pytest.approx(600.0, rel=0.1)


def test_a_weight_that_is_put_on_is_held_within_half_a_second():
    """The force at zero strain takes up four fifths of 30 N while the strain rests."""
    strain, _, _ = moved(8.0)
    state = learnt(strain, 20.0 + 600.0 * strain)
    last = strain[-1]
    learnt(np.full(125, last), np.full(125, 50.0 + 600.0 * last), state)
    assert state.offset == pytest.approx(50.0, abs=6.0)


def rubbing(friction):
    """Return what is known of a rubbing spring after ramps with rests, and its middle force."""
    t = np.arange(0.0, 12.0, DT)
    strain = np.interp(t, [0.0, 2.0, 3.0, 5.0, 6.0, 8.0, 9.0, 11.0],
                       [0.0, 0.08, 0.08, 0.02, 0.02, 0.09, 0.09, 0.04])
    middle = 20.0 + 600.0 * strain
    way = np.sign(np.gradient(strain))
    return learnt(strain, middle + friction * way), strain[-1], middle[-1]


@pytest.mark.parametrize('friction', [0.0, 3.0, 8.0])
def test_dry_friction_of_a_load_is_half_of_what_the_ways_differ_by(friction):
    """A spring needs more force upwards than downwards."""
    state, _, _ = rubbing(friction)
    assert dry_friction(state) == pytest.approx(friction, abs=0.1 + 0.15 * friction)


def test_a_force_that_friction_may_hold_is_no_load():
    """A loop that pulls at a load which sticks must not read its own pull as more load."""
    state, strain, middle = rubbing(8.0)
    learnt(np.full(250, strain), np.full(250, middle), state)
    before = state.offset
    learnt(np.full(250, strain), np.full(250, middle + 5.0), state)
    assert state.offset == pytest.approx(before, abs=0.2)
    learnt(np.full(250, strain), np.full(250, middle + 40.0), state)
    assert state.offset == pytest.approx(before + 40.0 - 8.0, abs=4.0)


def test_another_estimate_changes_no_force_here(paper_bundle):
    """While the load is moved its force as believed never jumps by more than its reading does."""
    strain, rate, bend = moved(8.0)
    force = 20.0 + 600.0 * strain + 1500.0 * strain ** 2
    state, believed = LoadEstimate(), []
    for k in range(len(strain)):
        learnt(strain[k:k + 1], force[k:k + 1], state)
        if state.known:
            believed.append(state.offset + load_law(state, strain[k], rate[k], bend[k]))
    assert np.abs(np.diff(believed)).max() < 2.0


def test_what_was_missed_in_a_gap_teaches_nothing():
    """Readings stop for a minute, and begin elsewhere."""
    strain, _, _ = moved(4.0)
    state = learnt(strain, 20.0 + 600.0 * strain)
    before = list(state.value)
    learn_load(state, 0.2, 300.0, MOST, USUAL, TIME, 60.0)
    learnt(np.full(100, 0.2), np.full(100, 300.0), state)
    assert state.value[:3] == before[:3]
    assert state.offset + before[0] * 0.2 == pytest.approx(300.0, rel=0.3)


def test_what_a_stop_held_is_forgotten_in_a_gap():
    """It belongs to the motion before: of a load at rest afterwards it is no part."""
    strain, force = lifted(300.0, 4.0, 0.9, 40.0, 300.0, 0.6)
    state = learnt(strain, force)
    assert abs(state.value[3]) > 1.0
    state.offset, here = 40.0, 40.0 + state.value[0] * 0.1
    learn_load(state, 0.1, here, MOST, USUAL, TIME, 60.0)
    for _ in range(50):
        learnt([0.1], [here], state)
        assert state.offset == pytest.approx(40.0, abs=0.01)


def tracked(bundle, told_load, **config):
    """Return the log of a mass on a spring that follows steps of its strain."""
    path = load_profile('strain_steps')
    loop = ClosedLoop(bundle, controller=ControllerConfig(outer=OuterConfig(**config)),
                      told_load=told_load)
    load = MassSpring(mass=1.5, stiffness_against=2500.0)
    return loop.run(Trajectory('spring', 'strain', path.duration, path.value, path.rate, load,
                               prepare=2.0))


def test_a_spring_that_nobody_told_of_is_followed_nearly_as_well(paper_bundle):
    """The way to the start shows enough of it; an integral alone is thirty times worse."""
    told, untold = (tracked(paper_bundle, known) for known in (True, False))
    size = [np.sqrt(np.mean(log.error ** 2)) for log in (told, untold)]
    assert size[1] < 1.3 * size[0]


@pytest.mark.parametrize('mass', [0.02, 0.1])
def test_a_plate_of_a_few_grams_that_nobody_told_of_is_moved_without_swinging(paper_bundle, mass):
    """Gains for a usual load are too large: its own oscillation shows that it is lighter."""
    profile = load_profile('strain_steps')
    loop = ClosedLoop(paper_bundle, paper_bundle)
    log = loop.run(Trajectory('plate', 'strain', profile.duration, profile.value, profile.rate,
                              MassSpring(mass=mass, stiffness_against=100.0, damping=1.0)))
    late = log.time > 2.0
    error = log.strain - np.array([profile.value(t) for t in log.time])
    assert np.sqrt(np.mean(error[late] ** 2)) < 3e-3


def test_a_robots_arm_that_nobody_told_of_does_not_swing(paper_bundle):
    """After a second and a half the gains go with its inertia, sixty times the usual one."""
    times, strains = [0.0, 1.2, 1.6, 2.8, 3.2, 4.4], [0.01, 0.10, 0.10, 0.145, 0.145, 0.05]
    arm = Arm(mass=1.5, moment_of_inertia=0.06, damping=0.05)
    ways = (lambda t: float(np.interp(t, times, strains)),
            lambda t: float(np.interp(t + 5e-3, times, strains)
                            - np.interp(t - 5e-3, times, strains)) / 0.01)
    size = []
    for told in (True, False):
        log = ClosedLoop(paper_bundle, told_load=told).run(
            Trajectory('arm', 'strain', 5.0, *ways, arm, prepare=1.5))
        size.append(np.sqrt(np.mean(log.error[log.time > 1.5] ** 2)))
    assert size[1] < 3.0 * size[0]


def test_a_weight_is_lifted_off_its_stop_without_being_dropped(paper_bundle):
    """Nobody told of it; it neither falls back nor runs ahead of the reference."""
    ways = (lambda t: min(t / 1.5, 1.0) * 0.08, lambda t: 0.08 / 1.5 if t < 1.5 else 0.0)
    log = ClosedLoop(paper_bundle, told_load=False).run(
        Trajectory('lift', 'strain', 4.0, *ways, MassSpring(mass=5.0, damping=40.0)))
    assert np.sqrt(np.mean(log.error ** 2)) < 8e-3
    ahead = log.strain - np.array([ways[0](t) for t in log.time])
    assert ahead.max() < 3e-3
    assert np.all(np.maximum.accumulate(log.strain) - log.strain < 5e-3)


def test_a_force_reference_ends_what_is_known_of_the_load(paper_bundle):
    """Something else may hold the bundle then."""
    controller = RecruitmentController(paper_bundle)
    for k in range(300):
        strain = 3e-4 * k
        controller.update(DT, Measurement(20.0 + 500.0 * strain, strain, 0.075, [1e5, 0.0]),
                          Reference('strain', strain, 0.075))
    assert controller.outer.load.known
    controller.update(DT, Measurement(60.0, 0.09, 0.0, [1e5, 0.0]), Reference('force', 60.0))
    assert not controller.outer.load.known


def test_gains_that_were_given_do_not_go_with_the_inertia(paper_bundle):
    """Only those worked out do."""
    assert outer_settings(OuterConfig(), LoadModel(), paper_bundle).worked_out
    assert not outer_settings(OuterConfig(strain_gain=100.0), LoadModel(), paper_bundle).worked_out
