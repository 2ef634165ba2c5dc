# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Steps of the force: all active units move together, and return to filling in turn later."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.benchmarks.control_trajectories import make_trajectory
from fam_bundle_ros.benchmarks.margins import CONTROLLERS, loop_of
from fam_bundle_ros.benchmarks.plants import model_of
from fam_bundle_ros.control import (
    Allocator,
    ControllerConfig,
    Instant,
    Measurement,
    RecruitmentController,
    Reference,
)
from fam_bundle_ros.control.baselines import BaselineConfig
from fam_bundle_ros.control.inverse import change_in_turn, change_together, Shares
from fam_bundle_ros.control.jump import is_climbing, Jump, step_of
from fam_bundle_ros.control.outer_loop import FORCE
from fam_bundle_ros.plant import Dynamometer
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

from .at_once import Bench

STRAIN = 0.16


def together(bundle, demand, base, count):
    """Return the shares of a demand (N) with the first units active, from pressures (Pa)."""
    curves, n = Allocator(bundle).curves(Instant(STRAIN)), bundle.n
    shares = Shares([0.0] * n, [0.0] * n)
    change_together(curves.table, curves.model, demand, list(range(n)), count, [math.nan] * n,
                    base, shares)
    return shares, curves


def stairs(bundle, levels, seconds, strain=STRAIN):
    """Return the log of the model as its own plant, with a step of the force every so often."""
    return ClosedLoop(bundle, bundle).run(Trajectory(
        'stairs', 'force', seconds * len(levels),
        lambda t: levels[min(int(max(t, 0.0) / seconds), len(levels) - 1)], lambda t: 0.0,
        Dynamometer(strain), prepare=1.0))


def at(log, time):
    """Return the index of a time (s)."""
    return int(np.searchsorted(log.time, time))


@pytest.mark.parametrize('demand', [15.0, 40.0])
def test_active_units_change_by_one_amount_within_their_branches(bundles, demand):
    """The bundle gives the demand; a unit that changes by less is at the end of its branch."""
    bundle, base = bundles[3], [300e3, 250e3, 0.0]
    shares, curves = together(bundle, demand, base, 2)
    assert bundle.force(STRAIN, shares.pressure) == pytest.approx(demand, abs=0.1)
    changes = np.subtract(shares.pressure, base)[:2]
    lowest, highest = curves.bottom_pressure[:2], bundle.max_pressure[:2]
    expected = np.clip(np.add(base[:2], changes[np.argmax(np.abs(changes))]), lowest, highest)
    assert shares.pressure[:2] == pytest.approx(expected)
    assert shares.pressure[2] == 0.0


def test_what_active_units_cannot_give_together_is_missing(bundles):
    """Above the limits of both, and below their bottoms."""
    curves = Allocator(bundles[3]).curves(Instant(STRAIN))
    for beyond, demand in ((7.0, curves.top[2] + 7.0), (-3.0, curves.floor[2] - 3.0)):
        shares, _ = together(bundles[3], demand, [300e3, 100e3, 0.0], 2)
        assert shares.missing == pytest.approx(beyond, abs=1e-3)


def test_steps_are_followed_nearly_as_soon_as_with_one_equal_pressure_with_less_air():
    """Six units; filling in turn they are 1.27 times as late (rms)."""
    # those that `fam_bundle benchmark-control` finds for this plant
    gains = BaselineConfig(force_gain=1.56, force_integral=51.9, filter_time=0.02)
    trajectory, late, air = make_trajectory('steps', model_of('nominal', 6)), [], []
    for name in ('reversal_aware', 'equal_pressure'):
        loop = loop_of('nominal', 6, CONTROLLERS[name], gains)
        loop.compiled = False  # compilation for six units takes longer than the two runs
        log = loop.run(trajectory)
        late.append(np.sqrt(np.mean(log.error ** 2)))
        air.append(log.air[-1])
    assert late[0] < 1.1 * late[1]
    assert air[0] < 0.65 * air[1]


def test_a_demand_that_steps_again_and_again_keeps_its_units(paper_bundle):
    """A single step down releases the second unit, although it was recruited ahead of need."""
    def state_at_the_end(*levels):
        return stairs(paper_bundle, levels, 1.5).state[-1]
    assert state_at_the_end(70.0, 15.0) == 1
    assert state_at_the_end(15.0, 70.0, 15.0) == 2


def test_a_demand_that_steps_a_little_at_a_limit_does_not_switch_at_each_step(paper_bundle):
    """Around the limit of RS1, by what the last unit makes alone."""
    limit = float(paper_bundle.force(0.12, [paper_bundle.max_pressure[0], 0.0]))
    steps = (-3.0, 2.0, -2.0, -7.0, -2.0, -7.0, -2.0, 2.0)
    log = stairs(paper_bundle, [limit + step for step in steps], 1.5, 0.12)
    assert len(log.decisions) <= 2
    assert log.state[-1] == 2


@pytest.mark.parametrize('step', [0.8, 2.0])
def test_stairs_never_fall_below_the_step_before(paper_bundle, step):
    """Up through the limit of RS1; the smaller steps are no larger than a ramp's between ticks."""
    limit = float(paper_bundle.force(0.12, [paper_bundle.max_pressure[0], 0.0]))
    levels = np.arange(limit - 12.0, limit + 3.0, step)
    log = stairs(paper_bundle, levels.tolist(), 0.6, 0.12)
    assert log.state[-1] == 2
    held = levels[np.clip((log.time / 0.6).astype(int) - 1, 0, len(levels) - 1)]
    assert (log.force - held)[log.time > 1.2].min() > -0.3


def test_a_slow_ramp_through_a_limit_does_not_dip(paper_bundle):
    """1 N/s from before the overlap on: at the limit nothing could compensate 5 N."""
    limit = float(paper_bundle.force(0.12, [paper_bundle.max_pressure[0], 0.0]))
    log = ClosedLoop(paper_bundle, paper_bundle).run(Trajectory(
        'ramp', 'force', 14.0, lambda t: limit - 11.0 + t, lambda t: 1.0, Dynamometer(0.12),
        prepare=1.5))
    assert log.state[-1] == 2
    assert np.abs(log.error).max() < 0.5


@pytest.mark.parametrize(('values', 'rates', 'step', 'climb'), [
    ([0, 2, 4, 7], [0, 0, 0, 0], 3.0, 5.0),
    ([0, 0.2, 0.5], [0, 0, 0], 0.3, 0.3),
    ([0, 2, 4.05], [0, 0, 0], 2.05, 2.05),
    ([0, 2, 2.05], [0, 0, 0], 2.0, 0.0),
    ([0, 2], [0, 0], 2.0, 0.0),
    ([0, 2, 4, 3], [0, 0, 0, 0], -1.0, 0.0),
    ([0, 2, 4, 3, 5], [0, 0, 0, 0, 0], 2.0, 0.0),
    ([0, 2, 4, 6], [0, 0, 1, 0], 0.0, 0.0)])
def test_a_reference_climbs_from_the_second_step_up_on(values, rates, step, climb):
    """Not after a step down or a motion with a rate, nor after a pause of the absence time."""
    settings = SimpleNamespace(step=1.0, switching=SimpleNamespace(absence_time=10.0))
    jump = Jump([0.0])
    for value, rate in zip(values, rates):
        for _ in range(3):
            step_of(settings, jump, FORCE, float(value), float(rate), 0.5)
    assert (jump.rise, jump.climb) == pytest.approx((step, climb))
    assert is_climbing(settings, jump) == (climb > 0.0)
    for _ in range(20):
        step_of(settings, jump, FORCE, float(values[-1]), 0.0, 0.5)
    assert not is_climbing(settings, jump)
    step_of(settings, jump, FORCE, values[-1] + 2.0, 0.0, 0.5)
    assert jump.climb == 0.0


def test_enabling_begins_no_climb_in_the_middle(paper_bundle):
    """Steps before it do not count."""
    bench = Bench(paper_bundle, 0.16)
    for force in (20.0, 22.0, 24.0):
        bench.hold(force, 0.1)
    jump = bench.controller.memory.jump
    assert jump.climb == 2.0
    bench.controller.enable(Measurement(24.0, 0.16, 0.0, bench.pressure))
    bench.hold(24.0, 0.1)
    bench.hold(26.0, 0.1)
    assert (jump.rise, jump.climb) == (2.0, 0.0)


def test_units_return_to_filling_in_turn_without_a_change_of_the_force(paper_bundle):
    """Ten seconds after the last step, MU1 goes to its limit again and MU2 compensates."""
    log = stairs(paper_bundle, (15.0, 74.0, 62.0), 13.0)
    after, before, end = (at(log, t) for t in (26.5, 35.5, 38.9))
    apart = log.setpoint[:, 0] - log.setpoint[:, 1]
    assert log.setpoint[after, 0] < 330e3
    assert log.setpoint[before] == pytest.approx(log.setpoint[after], abs=3e3)
    assert log.setpoint[end, 0] == paper_bundle.max_pressure[0]
    assert apart[end] > apart[before] + 20e3
    assert np.abs(log.error[after:]).max() < 0.5


def test_a_step_soon_after_enable_is_not_added_to_the_force_at_enable(paper_bundle):
    """From 60 N with a reference of 110 N, then 40 N: by the offset it would be 10 N at first."""
    controller, pressure = RecruitmentController(paper_bundle), np.array([320e3, 280e3])
    force = float(paper_bundle.force(STRAIN, pressure))
    controller.enable(Measurement(force, STRAIN, 0.0, pressure))
    demands = []
    for k in range(40):
        command = controller.update(2e-3, Measurement(force, STRAIN, 0.0, pressure),
                                    Reference('force', 110.0 if k < 5 else 40.0))
        demands.append(command.demand)
        pressure = command.pressure
        force = float(paper_bundle.force(STRAIN, pressure))
    assert demands[5:] == pytest.approx([40.0] * 35, abs=2.0)


@pytest.mark.parametrize('limit', [[344.7e3, 20e3, 344.7e3], [20e3, 344.7e3, 344.7e3]])
def test_a_unit_whose_limit_is_too_low_to_pull_does_not_block_the_next(bundles, limit):
    """The demand is met by those after it."""
    bundle = bundles[3]
    controller = RecruitmentController(bundle, ControllerConfig(max_pressure=limit))
    pressure = np.zeros(3)
    for _ in range(600):
        force = float(bundle.force(0.12, pressure))
        pressure = controller.update(2e-3, Measurement(force, 0.12, 0.0, pressure),
                                     Reference('force', 60.0)).pressure
    assert float(bundle.force(0.12, pressure)) == pytest.approx(60.0, abs=0.5)
    assert pressure[limit.index(20e3)] == 0.0


@pytest.mark.parametrize(('levels', 'together'), [
    ((60.0, 56.0), False), ((60.0, 20.0), True), ((20.0, 60.0, 56.0), False)])
def test_a_step_that_one_unit_can_make_is_left_to_it(paper_bundle, levels, together):
    """Others would only add their hysteresis; a step that needs more flow moves all."""
    log, last = stairs(paper_bundle, levels, 1.0), len(levels) - 1
    moved = np.ptp(log.setpoint[at(log, last - 0.1):at(log, last + 0.2)], axis=0) > 1e3
    assert list(moved) == [together, True]


def test_a_reference_that_tells_its_rate_does_not_step(paper_bundle):
    """A fast ramp by ticks of more than 2 N is filled in turn throughout."""
    controller, pressure = RecruitmentController(paper_bundle), np.zeros(2)
    for k in range(40):
        force = float(paper_bundle.force(0.1, pressure))
        pressure = controller.update(5e-3, Measurement(force, 0.1, 0.0, pressure), Reference(
            'force', 60.0 + 3.0 * k if k < 10 else 87.0, 600.0 if k < 10 else 1e-3)).pressure
    assert controller.memory.jump.on == 0


def test_in_turn_a_fall_begins_at_the_last_unit_and_a_rise_at_the_first(bundles):
    """To the end of its branch, then the other one: as units are filled."""
    bundle, base = bundles[3], [200e3, 200e3, 0.0]
    curves = Allocator(bundle).curves(Instant(STRAIN))
    middle = sum(curves.at(k, base[k]) for k in range(3))
    for demand in np.linspace(curves.floor[2] + 0.1, curves.top[2] - 0.1, 30):
        shares = Shares([0.0] * 3, [0.0] * 3)
        change_in_turn(curves.table, curves.model, demand, [0, 1, 2], 2, [math.nan] * 3, base,
                       shares)
        first, last = shares.pressure[:2]
        assert bundle.force(STRAIN, shares.pressure) == pytest.approx(demand, abs=0.1)
        assert shares.missing == 0.0
        if demand > middle:
            assert last == 200e3 or first == bundle.max_pressure[0]
        else:
            assert first == 200e3 or last == curves.bottom_pressure[1]
