# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the bundle pulls on."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.plant import Arm, Dynamometer, MassSpring, SeriesSpringMass
from fam_bundle_ros.plant.loads import GRAVITY

LENGTH = 0.127
WIDE = (-0.15, 0.5)
MOVING = [
    MassSpring(mass=4.0, stiffness_against=1500.0, spring_rest=0.003),
    SeriesSpringMass(mass=3.0, stiffness_series=8e3, stiffness_against=500.0),
    Arm(),
]


def move(load, motion, force, seconds, dt=1e-4):
    """Let a load move under a bundle force given as a function of the strain."""
    for _ in range(round(seconds / dt)):
        motion = load.drift(motion, dt, LENGTH)
        motion = load.kick(motion, dt, force(motion[0]), LENGTH)
    return motion


def test_mass_on_a_spring_keeps_period_and_energy():
    """Undamped, the mass returns after 2 pi sqrt(m/k) and has lost nothing after 500 turns."""
    load = MassSpring(mass=4.0, stiffness_against=3e3, damping=0.0, gravity=0.0, stops=WIDE)
    period = 2.0 * math.pi * math.sqrt(4.0 / 3e3)
    dt = period / 400
    motion = (0.1, 0.0)
    for turns in (1, 499):
        motion = move(load, motion, lambda e: 0.0, turns * period, dt)
        assert motion[0] == pytest.approx(0.1, rel=1e-3)


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
    motion = move(load, (0.0, 0.0), force, 0.3)
    assert motion[0] * LENGTH == pytest.approx(exact[0], abs=2e-5)


@pytest.mark.parametrize('load', MOVING, ids=lambda load: type(load).__name__)
def test_load_rests_where_the_bundle_balances_it(load):
    """A load at rest under a steady bundle force sits where holding_force says."""
    def force(strain):
        return 90.0 - 300.0 * strain

    motion = load.start(LENGTH)
    for _ in range(5000):
        motion = load.drift(motion, 1e-3, LENGTH)
        motion = load.kick(motion, 1e-3, force(motion[0]) - 40.0 * motion[1], LENGTH)
    assert abs(motion[1]) < 1e-4
    assert load.stops[0] < motion[0] < load.stops[1]
    assert force(motion[0]) == pytest.approx(load.holding_force(motion[0], LENGTH), abs=0.05)


@pytest.mark.parametrize('load', MOVING, ids=lambda load: type(load).__name__)
@pytest.mark.parametrize('strain', [0.01, 0.1, 0.2])
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
    assert up[:2] == (load.stops[1], 0.0)
    down = move(load, up, lambda e: -2000.0, 1.0)
    assert down[:2] == (load.stops[0], 0.0)


def test_inertia_is_what_a_sudden_force_accelerates():
    """From rest at balance, one newton more gives 1/inertia of strain acceleration."""
    for load in (MassSpring(stops=WIDE), Arm(stops=WIDE)):
        force = load.holding_force(0.1, LENGTH) + 1.0
        rate = load.kick((0.1, 0.0), 1e-6, force, LENGTH)[1]
        assert rate / 1e-6 == pytest.approx(1.0 / load.inertia(0.1, LENGTH), rel=1e-3)


def test_dynamometer_goes_to_its_target_at_the_speed_asked_for():
    """The strain moves at the imposed rate, arrives exactly and rests there."""
    load = Dynamometer(strain=0.02)
    motion = load.impose(load.start(LENGTH), 0.12, -0.5)
    motion = move(load, motion, lambda e: 1e4, 0.1, dt=1e-3)
    assert motion[0] == pytest.approx(0.07)
    assert motion[1] == pytest.approx(0.5)
    motion = move(load, motion, lambda e: 1e4, 0.2, dt=1e-3)
    assert motion[:2] == (0.12, 0.0)


def test_dynamometer_arrives_exactly_at_any_target():
    """However the steps round, the machine ends on the target and at rest."""
    load = Dynamometer()
    motion = load.start(LENGTH)
    for target in np.random.default_rng(0).uniform(-0.1, 0.4, 300).tolist():
        motion = load.impose(motion, target, 3.7)
        motion = move(load, motion, lambda e: 0.0, 0.15, dt=1e-3)
        assert motion[:2] == (target, 0.0)


def test_tendon_does_not_push():
    """A mass in the air behind a slack series spring does not feel the bundle lengthen."""
    load = SeriesSpringMass(stops=WIDE, gravity=0.0)
    motion = move(load, (0.0, 0.0, 0.02, 0.0), lambda e: -20.0, 0.05)
    assert motion[0] < -0.01
    assert motion[2:] == (0.02, 0.0)


@pytest.mark.parametrize(('make', 'word'), [
    (lambda: MassSpring(mass=0.0), 'mass'),
    (lambda: MassSpring(stops=(0.2, 0.1)), 'stops'),
    (lambda: SeriesSpringMass(stiffness_series=-1.0), 'stiffness_series'),
    (lambda: Arm(moment_arm=math.nan), 'moment_arm'),
    (lambda: Dynamometer(strain=0.7), 'strain'),
    (lambda: Dynamometer().impose((0.0, 0.0, 0.0, 1.0), 0.9), 'imposed strain'),
    (lambda: Dynamometer().impose((0.0, 0.0, 0.0, 1.0), 0.1, np.inf), 'imposed strain rate'),
])
def test_impossible_load_fails(make, word):
    """A load that cannot be is refused with the name of what is wrong."""
    with pytest.raises(InputError, match=word):
        make()
