# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the bundle pulls on."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import Arm, Dynamometer, MassSpring, SeriesSpringMass
from fam_bundle_ros.plant.loads import (
    drift,
    GRAVITY,
    holding_force,
    inertia,
    kick,
    LoadState,
    stiffness,
)

LENGTH = 0.127
WIDE = (-0.15, 0.5)
MOVING = [
    MassSpring(mass=4.0, stiffness_against=1500.0, spring_rest=0.003),
    SeriesSpringMass(mass=3.0, stiffness_series=8e3, stiffness_against=500.0),
    Arm(),
]


def move(load, motion, force, seconds, dt=1e-4):
    """
    Let a load move under a bundle force given as a function of the strain; return its motion.

    Half drift, kick by the midpoint rule, half drift, as the rig does.
    """
    record = load.record
    for _ in range(round(seconds / dt)):
        drift(record, motion, 0.5 * dt, 0.0)
        rate, place_rate = kick(record, motion, 0.5 * dt, force(motion.strain), LENGTH)
        motion.acceleration = 2.0 * (rate - motion.strain_rate) / dt
        motion.place_acceleration = 2.0 * (place_rate - motion.place_rate) / dt
        motion.strain_rate += dt * motion.acceleration
        motion.place_rate += dt * motion.place_acceleration
        drift(record, motion, 0.5 * dt, 0.5 * dt)
    return motion


def impose(load, motion, seconds, dt=1e-3):
    """Let a dynamometer move."""
    for _ in range(round(seconds / dt)):
        drift(load.record, motion, dt, 0.0)


def test_mass_on_a_spring_keeps_period_and_energy():
    """Undamped, the mass returns after 2 pi sqrt(m/k) and has lost nothing after 500 turns."""
    load = MassSpring(mass=4.0, stiffness_against=3e3, damping=0.0, gravity=0.0, stops=WIDE)
    period = 2.0 * math.pi * math.sqrt(4.0 / 3e3)
    dt = period / 400
    motion = LoadState(0.1)
    for turns in (1, 499):
        motion = move(load, motion, lambda e: 0.0, turns * period, dt)
        assert motion.strain == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize('load', [
    MassSpring(mass=4.0, stiffness_against=1500.0, damping=20.0, stops=WIDE),
    Arm(damping=0.1, stops=WIDE)], ids=['mass', 'arm'])
def test_damped_load_follows_its_differential_equation(load):
    """The rig's step agrees with an accurate integrator of the load's stated equation."""
    def force(strain):
        return 120.0 - 400.0 * strain

    def rates(t, y):
        x, v = y
        if isinstance(load, MassSpring):
            return [v, (force(x / LENGTH) - 4.0 * GRAVITY - 1500.0 * x - 20.0 * v) / 4.0]
        angle, spin = load.rest_angle + x / load.moment_arm, v / load.moment_arm
        torque = (force(x / LENGTH) * load.moment_arm - load.damping * spin
                  - load.mass * GRAVITY * load.centre * math.sin(angle))
        return [v, torque / load.moment_of_inertia * load.moment_arm]

    exact = solve_ivp(rates, (0.0, 0.3), [0.0, 0.0], rtol=1e-9, atol=1e-12).y[:, -1]
    motion = move(load, LoadState(0.0), force, 0.3, dt=1e-3)
    assert motion.strain * LENGTH == pytest.approx(exact[0], abs=5e-6)


@pytest.mark.parametrize('load', MOVING, ids=lambda load: type(load).__name__)
def test_load_rests_where_the_bundle_balances_it(load):
    """A load at rest under a steady bundle force sits where holding_force says."""
    def force(strain):
        return 90.0 - 300.0 * strain

    motion = load.start(LENGTH)
    for _ in range(5000):
        rate = motion.strain_rate
        move(load, motion, lambda e, rate=rate: force(e) - 40.0 * rate, 1e-3, 1e-3)
    assert abs(motion.strain_rate) < 1e-4
    assert load.stops[0] < motion.strain < load.stops[1]
    assert force(motion.strain) == pytest.approx(
        load.holding_force(motion.strain, LENGTH), abs=0.05)


@pytest.mark.parametrize('load', MOVING, ids=lambda load: type(load).__name__)
@pytest.mark.parametrize('strain', [-0.05, 0.01, 0.1, 0.2])
def test_stiffness_is_the_slope_of_the_holding_force(load, strain):
    """The stiffness that a strain loop sees is d(holding force)/d(strain)."""
    step = 1e-6
    slope = (load.holding_force(strain + step, LENGTH)
             - load.holding_force(strain - step, LENGTH)) / (2.0 * step)
    assert load.stiffness(strain, LENGTH) == pytest.approx(slope, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize('load', MOVING, ids=lambda load: type(load).__name__)
def test_load_stays_within_its_end_stops(load):
    """No force drives a load through a stop, and it leaves the stop without sticking."""
    up = move(load, load.start(LENGTH), lambda e: 2000.0, 1.0)
    assert (up.strain, up.strain_rate) == (load.stops[1], 0.0)
    down = move(load, up, lambda e: -2000.0, 1.0)
    assert (down.strain, down.strain_rate) == (load.stops[0], 0.0)
    for stop, force in zip(load.stops, (-2000.0, 2000.0)):
        assert kick(load.record, LoadState(stop), 1e-3, force, LENGTH)[0] == 0.0


def test_inertia_is_what_a_sudden_force_accelerates():
    """From rest at balance, one newton more gives 1/inertia of strain acceleration."""
    for load in (MassSpring(stops=WIDE), Arm(stops=WIDE)):
        force = load.holding_force(0.1, LENGTH) + 1.0
        rate, _ = kick(load.record, LoadState(0.1), 1e-6, force, LENGTH)
        assert rate / 1e-6 == pytest.approx(1.0 / load.inertia(0.1, LENGTH), rel=1e-3)
    both = SeriesSpringMass(mass=3.0, fitting_mass=0.5)
    assert both.inertia(0.1, LENGTH) == pytest.approx(3.5 * LENGTH)


def test_a_dynamometer_moves_by_itself_whatever_the_force():
    """It is infinitely stiff and heavy, and any force holds it."""
    record, moving = Dynamometer(0.1).record, LoadState(0.1, 0.02)
    assert math.isnan(holding_force(record, 0.1, LENGTH))
    assert stiffness(record, 0.1, LENGTH) == inertia(record, LENGTH) == math.inf
    assert kick(record, moving, 1e-3, 1e3, LENGTH) == (0.02, 0.0)


def test_dynamometer_goes_to_its_target_at_the_speed_asked_for():
    """The strain moves at the imposed rate, arrives exactly and rests there."""
    load = Dynamometer(strain=0.02)
    motion = load.start(LENGTH)
    load.impose(motion, 0.12, -0.5)
    impose(load, motion, 0.1)
    assert motion.strain == pytest.approx(0.07)
    assert motion.strain_rate == pytest.approx(0.5)
    impose(load, motion, 0.2)
    assert (motion.strain, motion.strain_rate) == (0.12, 0.0)


def test_dynamometer_arrives_exactly_at_any_target():
    """However the steps round, the machine ends on the target and at rest."""
    load = Dynamometer()
    motion = load.start(LENGTH)
    for target in np.random.default_rng(0).uniform(-0.1, 0.4, 300).tolist():
        load.impose(motion, target, 3.7)
        impose(load, motion, 0.15)
        assert (motion.strain, motion.strain_rate) == (target, 0.0)


@pytest.mark.parametrize('damping', [0.0, 30.0])
def test_mass_behind_a_spring_follows_its_differential_equation(damping):
    """Fitting and mass, lifted through a damped spring, agree with an accurate integration."""
    load = SeriesSpringMass(mass=3.0, stiffness_series=4e3, stiffness_against=200.0,
                            fitting_mass=0.5, damping=damping, spring_damping=20.0, stops=WIDE)

    def rates(t, y):
        x, u, z, w = y
        pull = max(4e3 * (x - z) + 20.0 * (u - w), 0.0) if x > z else 0.0
        return [u, (90.0 - 300.0 * x / LENGTH - pull - damping * u) / 0.5,
                w, (pull - 3.0 * GRAVITY - 200.0 * z - damping * w) / 3.0]

    start = (0.01, 0.0, 0.0, 0.0)
    exact = solve_ivp(rates, (0.0, 0.2), start, rtol=1e-10, atol=1e-12, max_step=1e-3).y[:, -1]
    error = []
    for dt in (2e-3, 1e-3):
        motion = move(load, LoadState(start[0] / LENGTH), lambda e: 90.0 - 300.0 * e, 0.2, dt)
        found = (motion.strain * LENGTH, motion.strain_rate * LENGTH, motion.place,
                 motion.place_rate)
        error.append(np.abs(np.array(found) - exact))
    assert np.all(error[1] < 1e-3 * np.abs(exact))
    assert np.all(error[1] < 0.35 * error[0])


@pytest.mark.parametrize('arrives', [0.3, 0.5, 0.8])
@pytest.mark.parametrize('up', [1.0, -1.0], ids=['lower stop', 'upper stop'])
def test_arrival_at_a_stop_is_of_second_order(arrives, up):
    """A mass that falls on its stop while it is pulled off leaves it as the exact one does."""
    load = MassSpring(mass=2.0, damping=0.0, gravity=0.0, stops=(0.0, 0.5))
    stop = load.stops[up < 0.0]
    pull, speed, dt = 30.0, 2.0, 1e-3
    acceleration = pull / (2.0 * LENGTH)
    arrival = (3.0 + arrives) * dt
    begin = stop + up * (speed * arrival - 0.5 * acceleration * arrival ** 2)
    motion = move(load, LoadState(begin, -up * speed, acceleration=up * acceleration),
                  lambda e: up * pull, 0.02, dt)
    flight = 0.02 - arrival
    # First order would be up to half a step too long or too short.
    assert up * motion.strain_rate == pytest.approx(acceleration * flight,
                                                    abs=0.02 * acceleration * dt)
    assert up * (motion.strain - stop) == pytest.approx(0.5 * acceleration * flight ** 2,
                                                        abs=0.02 * acceleration * flight * dt)


@pytest.mark.parametrize('up', [1.0, -1.0], ids=['lower stop', 'upper stop'])
def test_pressed_onto_a_stop_a_mass_rests_from_its_arrival_on(up):
    """The impact takes all speed, and no force adds any towards the stop."""
    load = MassSpring(mass=2.0, damping=0.0, gravity=0.0, stops=(0.0, 0.5))
    stop = load.stops[up < 0.0]
    motion = LoadState(stop + up * 2e-3, -up * 1.0, acceleration=-up * 500.0)
    drift(load.record, motion, 3e-3, 1e-3)
    assert (motion.strain, motion.strain_rate) == (stop, 0.0)


def test_tendon_does_not_push():
    """A mass in the air behind a slack series spring does not feel the bundle lengthen."""
    load = SeriesSpringMass(stops=WIDE, gravity=0.0)
    motion = move(load, LoadState(0.0, place=0.02), lambda e: -20.0, 0.05)
    assert motion.strain < -0.01
    assert (motion.place, motion.place_rate) == (0.02, 0.0)
    assert load.holding_force(-0.05, LENGTH) == 0.0


def test_mass_on_its_floor_carries_what_the_spring_does_not():
    """Pulled by less than its weight, the mass stays put and the spring takes the pull."""
    load = SeriesSpringMass(mass=5.0, stiffness_series=4e3, floor=0.002)
    motion = move(load, load.start(LENGTH), lambda e: 30.0, 2.0, 1e-3)
    assert (motion.place, motion.place_rate) == (0.002, 0.0)
    assert 4e3 * (motion.strain * LENGTH - 0.002) == pytest.approx(30.0, rel=1e-6)
    rate, place_rate = kick(load.record, motion, 1e-3, 30.0, LENGTH)
    assert place_rate == 0.0
    assert rate == pytest.approx(0.0, abs=1e-6)
    motion.strain = 0.01  # the tendon is slack
    assert kick(load.record, motion, 1e-3, 30.0, LENGTH)[1] == 0.0


def test_behind_a_slack_tendon_each_mass_is_braked_by_its_own_damping():
    """With m u' = -c u an implicit step divides the speed by 1 + h c/m, as often as is asked."""
    load = SeriesSpringMass(mass=1.0, gravity=0.0, damping=4.0, fitting_mass=0.2, stops=WIDE)
    motion = LoadState(0.05, 0.3, place=0.02, place_rate=0.1)
    for _ in range(3):
        motion.strain_rate, motion.place_rate = kick(load.record, motion, 1e-3, 0.0, LENGTH)
    assert motion.strain_rate == pytest.approx(0.3 / 1.02 ** 3)
    assert motion.place_rate == pytest.approx(0.1 / 1.004 ** 3)


def test_damper_in_a_tendon_does_not_push():
    """A fitting that comes back fast leaves the mass behind the spring alone."""
    load = SeriesSpringMass(gravity=0.0, damping=0.0, spring_damping=100.0, stops=WIDE)
    motion = LoadState(0.1, -1.0 / LENGTH, place=0.1 * LENGTH - 1e-4)
    rate, place_rate = kick(load.record, motion, 1e-4, 0.0, LENGTH)
    assert place_rate == 0.0
    assert rate == -1.0 / LENGTH


@pytest.mark.parametrize(('make', 'word'), [
    (lambda: MassSpring(mass=0.0), 'mass'),
    (lambda: MassSpring(stops=(0.2, 0.1)), 'stops'),
    (lambda: SeriesSpringMass(stiffness_series=-1.0), 'stiffness_series'),
    (lambda: Arm(moment_arm=math.nan), 'moment_arm'),
    (lambda: Dynamometer(strain=0.7), 'strain'),
    (lambda: Dynamometer().impose(LoadState(0.0), 0.9), 'imposed strain'),
    (lambda: Dynamometer().impose(LoadState(0.0), 0.1, np.inf), 'imposed strain rate'),
])
def test_impossible_load_fails(make, word):
    """A load that cannot be is refused with the name of what is wrong."""
    with pytest.raises(InputError, match=word):
        make()
