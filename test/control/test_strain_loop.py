# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The strain loop on masses that nothing but the loop damps, behind dead time."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.control import (
    Allocator,
    ControllerConfig,
    Instant,
    LoadModel,
    Measurement,
    OuterConfig,
    RecruitmentController,
    Reference,
    SwitchingConfig,
    tune,
)
from fam_bundle_ros.control.outer_loop import outer_settings, OuterState
from fam_bundle_ros.control.saturation import FREE
from fam_bundle_ros.control.signals import MeasurementRecord
from fam_bundle_ros.control.softness import stiffnesses
from fam_bundle_ros.control.strain_loop import (
    at_stiffness,
    gain_at,
    present_stiffness,
    strain_loop,
)
from fam_bundle_ros.model import Bundle, load_model, MotorUnit
from fam_bundle_ros.nodes.profile import load_profile
from fam_bundle_ros.plant import MassSpring, RigConfig
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import ClosedLoop, pid_config, Trajectory


def lifted(bundle, mass, delay):
    """Return the log of a mass without damping that is lifted, held and lowered."""
    rig = RigConfig()
    rig = replace(rig, sensors=replace(rig.sensors, delay=delay))
    path = load_profile('strain_steps')
    loop = ClosedLoop(bundle, controller=ControllerConfig(outer=OuterConfig(delay=delay)), rig=rig,
                      gains=tune(sample_period=2e-3, transport_delay=delay).gains,
                      pid=replace(pid_config(rig, 2e-3), transport_delay=delay))
    return loop.run(Trajectory('lift', 'strain', path.duration, path.value, path.rate,
                               MassSpring(mass=mass), prepare=2.0))


@pytest.mark.parametrize('mass', [1.5, 5.0])
def test_an_undamped_mass_follows_at_every_delay_that_is_told(paper_bundle, mass):
    """Within 0.1 % strain rms, and without air for an oscillation."""
    prompt, *late = (lifted(paper_bundle, mass, delay) for delay in (0.0, 5e-3, 10e-3, 15e-3))
    for log in late:
        assert np.sqrt(np.mean(log.error ** 2)) < 1e-3
        assert abs(log.error).max() < 3e-3
        assert log.air[-1] < 1.1 * prompt.air[-1]


@pytest.mark.parametrize(('friction', 'tracked'), [(0.0, 6e-3), (2.0, 3e-3), (4.0, 1.2e-3)])
def test_friction_of_the_model_is_compensated_along_the_reference(paper_bundle, friction, tracked):
    """
    In motion as the model says; at rest without a limit cycle, whatever the muscle really has.

    With friction that follows the measured strain, a muscle without it swung by 8e-3 for good.
    """
    model = paper_bundle.with_effect('presliding_hysteresis', force=4.0)
    plant = paper_bundle.with_effect('presliding_hysteresis', force=friction)
    rig = RigConfig()
    rig = replace(rig, valve=replace(rig.valve, delay=6e-3))
    slow = {'period': 5e-3, 'pid_period': 5e-3, 'told_load': False, 'rig': rig,
            'gains': tune(sample_period=5e-3, transport_delay=8.5e-3).gains,
            'controller': ControllerConfig(outer=OuterConfig(delay=8.5e-3))}
    sine = (lambda t: 0.08 + 0.03 * np.sin(1.6 * t), lambda t: 0.048 * np.cos(1.6 * t))
    for (value, rate), most, quiet in (
            (sine, tracked, np.inf), ((lambda t: 0.08, lambda t: 0.0), 1e-3, 0.2e3)):
        log = ClosedLoop(plant, model=model, **slow).run(Trajectory(
            'strain', 'strain', 6.0, value, rate, MassSpring(mass=3.0, damping=40.0)))
        late = log.time > 2.0
        assert np.sqrt(np.mean(log.error[late] ** 2)) < most
        assert np.std(np.diff(log.setpoint[late, 0])) < quiet


def with_muscles(bundle, counts):
    """Return a bundle of such muscles with these numbers of them in its motor units."""
    geometry = bundle.motor_units[0].geometry
    return Bundle('_'.join(map(str, counts)), [
        MotorUnit(f'mu{k}', count, geometry, 344.7e3) for k, count in enumerate(counts, 1)],
        bundle.effects)


@pytest.mark.parametrize('told', [True, False])
def test_where_empty_units_make_the_bundle_too_soft_they_are_filled(paper_bundle, told):
    """
    A muscle with six empty ones beside it: at a strain of 0.06 their push-back collapses.

    With one unit the load swung by 0.03 for good, also where its mass was told. At 0.11 the
    push-back is even, and the units are released after the absence time.
    """
    seven = with_muscles(paper_bundle, (1, 2, 4))
    times, strains = [0.0, 2.0, 4.0, 5.0, 8.0], [0.0, 0.06, 0.06, 0.11, 0.11]
    config = ControllerConfig(switching=SwitchingConfig(absence_time=0.8))
    log = ClosedLoop(seven, controller=config, told_load=told, compiled=False).run(Trajectory(
        'hold', 'strain', 8.0, lambda t: float(np.interp(t, times, strains)),
        lambda t: 0.03 if 0.0 < t < 2.0 else 0.05 if 4.0 < t < 5.0 else 0.0,
        MassSpring(mass=2.4, damping=5.0, stiffness_against=200.0)))
    soft, stiff = (log.time > 3.0) & (log.time < 4.0), log.time > 7.0
    assert np.abs(log.error[soft]).max() < 1e-3
    assert set(log.state[soft]) == {3}
    assert np.abs(log.error[stiff]).max() < 3e-3
    assert set(log.state[stiff]) == {1}
    assert 'makes RS1 too soft at this strain' in log.decisions[1][1]


@pytest.mark.parametrize(('counts', 'strain', 'held_at', 'stiffness', 'state'), [
    ((1, 2, 4), 0.06, 150e3, 1.0, 2), ((1, 2, 4), 0.11, 150e3, 1.0, 1),
    ((1, 2, 4), 0.06, 150e3, 5e3, 1), ((1, 1), 0.05, 100e3, 1.0, 1)])
def test_a_unit_is_filled_for_stiffness_where_muscles_and_load_are_too_soft(
        counts, strain, held_at, stiffness, state):
    """
    Not at a strain of 0.11, nor on a stiff spring; the only unit is not kept for it.

    At 0.05 a muscle is stiffer than the gains require: two thirds of that are enough.
    """
    bundle = with_muscles(load_model(config_path('models/spie2021.yaml')), counts)
    pressure = np.array([held_at, *[0.0] * (len(counts) - 1)])
    measured = Measurement(float(bundle.force(strain, pressure)), strain, 0.0, pressure)
    controller = RecruitmentController(bundle, ControllerConfig(
        load=LoadModel(stiffness=stiffness, inertia=0.3)))
    controller.enable(measured)
    for _ in range(3):
        controller.update(4e-3, measured, Reference('strain', strain, 0.0))
    assert controller.state == state
    assert controller.memory.demand.soft_below == (state > 1)


@pytest.mark.parametrize('strain', [0.06, 0.11])
def test_the_least_stiffness_is_the_slope_of_the_force_at_rest(paper_bundle, strain):
    """Within 0.01 of the strain, also with the last unit empty; and of the first, which holds."""
    pressure = [150e3, 20e3]
    curves = Allocator(paper_bundle).curves(Instant(strain))
    *found, held = stiffnesses(curves.table, curves.model, pressure, 1)
    assert curves.table.moment.strain == strain
    grid = strain + np.linspace(-0.01, 0.01, 5)
    for value, last in zip(found, (20e3, 0.0)):
        force = paper_bundle.force(grid, np.array([[150e3, last]] * 5))
        assert value == pytest.approx(-np.diff(force).max() / 0.005)
    alone = paper_bundle.unit_forces(grid, np.array([[150e3, 0.0]] * 5))[:, 0]
    assert held == pytest.approx((alone[0] - alone[-1]) / 0.02)


@pytest.mark.parametrize('units', [2, 6])
def test_the_stiffness_that_gains_go_by_is_the_slope_of_the_model(bundles, units):
    """At the largest pressures and at half of them, with any units under pressure."""
    bundle = bundles[units]
    settings = outer_settings(OuterConfig(), LoadModel(stiffness=50.0), bundle)
    for share in (0.5, 1.0):
        for on in (1, units):
            pressure = share * bundle.max_pressure * (np.arange(units) < on)
            forces = [bundle.unit_forces(strain, pressure)[:on].sum() for strain in (0.09, 0.11)]
            assert present_stiffness(settings, pressure) == pytest.approx(
                50.0 + (forces[0] - forces[1]) / 0.02, rel=1e-6)


def test_every_stiffness_of_six_units_gets_feedback(bundles):
    """An integral everywhere, and damping unless the dead time is long beside an oscillation."""
    settings = outer_settings(OuterConfig(delay=5e-3), LoadModel(), bundles[6])
    lowest, highest = settings.stiffnesses[0], settings.stiffnesses[-1]
    assert highest > 50.0 * lowest
    for stiffness in np.geomspace(0.5 * lowest, 2.0 * highest, 40):
        assert gain_at(settings, settings.strain_integral, stiffness, 0.0) > 0.0
        if stiffness < settings.most_stiffness:
            assert gain_at(settings, settings.strain_damping, stiffness, 0.0) > 0.0


def test_gains_do_not_jump_with_the_stiffness(bundles):
    """Linear between the stiffnesses for which they are worked out, constant outside."""
    settings = outer_settings(OuterConfig(), LoadModel(), bundles[6])
    for stiffness, gain in zip(settings.stiffnesses, settings.strain_gain[0]):
        for near in (stiffness * (1.0 - 1e-9), stiffness, stiffness * (1.0 + 1e-9)):
            assert gain_at(settings, settings.strain_gain, near, 0.0) == pytest.approx(
                gain, rel=1e-7, abs=1e-5)


@pytest.mark.parametrize('heavier', [1.0, 3.0])
@pytest.mark.parametrize(('damping', 'share'), [(0.0, 0.0), (0.2, 0.1 / 0.3), (9.0, 1.0)])
def test_a_load_that_was_found_to_be_damped_gets_quicker_gains(bundles, damping, share, heavier):
    """For half of its damping ratio, between those for 1 % and those for 30 %."""
    settings = outer_settings(OuterConfig(feed_forward=False), LoadModel(), bundles[2])
    state = OuterState(lag=0.02)
    pressures, error = [150e3, 0.0], 1e-3
    stiffness, inertia = present_stiffness(settings, pressures), heavier * settings.usual_inertia
    little, much = (heavier * at_stiffness(settings, gains, stiffness / heavier)
                    for gains in settings.strain_integral)
    assert much > 1.5 * little
    for wanted in (0.1, 0.1 + error):
        state.load.known, state.load.inertia = True, inertia
        state.load.value[1] = 2.0 * damping * np.sqrt(stiffness * inertia)
        held = state.integral
        strain_loop(settings, state, MeasurementRecord(10.0, 0.1, 0.0, pressures), wanted, 0.0,
                    FREE, 0.0, 4e-3)
    assert (state.integral - held) / (error * 4e-3) == pytest.approx(
        little + share * (much - little))


def test_a_load_whose_damping_is_told_gets_quicker_gains(bundles):
    """At every stiffness of the bundle."""
    free, damped = (outer_settings(OuterConfig(), LoadModel(inertia=0.3, damping=damping),
                                   bundles[2]) for damping in (0.0, 20.0))
    for stiffness in np.geomspace(0.3 * free.most_stiffness, free.most_stiffness, 5):
        assert gain_at(damped, damped.strain_integral, stiffness, 0.0) > 1.2 * gain_at(
            free, free.strain_integral, stiffness, 0.0)


def test_an_empty_bundle_on_a_load_that_was_identified_gets_gains(bundles):
    """Those of the lowest stiffness: there is none to divide the damping by."""
    settings, state = outer_settings(OuterConfig(), LoadModel(), bundles[2]), OuterState(lag=0.02)
    for k in range(200):
        pressure = [1e5 if k < 190 else 0.0, 0.0]
        strain_loop(settings, state, MeasurementRecord(10.0, 5e-4 * k, 0.1, pressure), 0.1, 0.0,
                    FREE, 0.0, 4e-3)
    assert state.load.known
    assert state.load.value[0] == pytest.approx(0.0, abs=1.0)
    assert np.isfinite(state.kept)


def test_a_damped_load_that_was_not_told_is_held_better_against_a_push(paper_bundle):
    """With the gains that its damping allows, half a second after a weight is added."""
    def left(damping):
        load = MassSpring(mass=1.0, damping=damping)
        path = load_profile('strain_steps')
        log = ClosedLoop(paper_bundle, told_load=False).run(Trajectory(
            'push', 'strain', path.duration, path.value, path.rate, load, prepare=1.5,
            events=((path.duration - 1.0, {'mass': 1.5}),)))
        return np.abs(log.error[log.time > path.duration - 0.5]).mean()
    assert left(100.0) < 0.8 * left(5.0)  # it was 1.04 with the gains for little damping
