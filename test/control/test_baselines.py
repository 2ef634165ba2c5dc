# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The two schemes without a model: one pressure for all, and orderly switching with a PI."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.control import ControllerConfig, Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.baselines import (
    baseline_settings,
    baseline_step,
    BaselineConfig,
    BaselineState,
    pi_answer,
    play,
)
from fam_bundle_ros.control.outer_loop import FORCE
from fam_bundle_ros.control.reasons import NONE
from fam_bundle_ros.control.saturation import SATURATION
from fam_bundle_ros.control.signals import command_record
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle
from fam_bundle_ros.plant import Dynamometer, MassSpring
from fam_bundle_ros.simulation import ClosedLoop, Trajectory


def hold(kind, value, load, duration=3.0):
    """Return a trajectory that asks for one value."""
    return Trajectory('hold', kind, duration, lambda t: value, lambda t: 0.0, load, prepare=1.0)


def controller(bundle, scheme, **gains):
    """Return a controller without filter and quiet band."""
    return RecruitmentController(bundle, ControllerConfig(
        scheme=scheme, still=0.0, baseline=BaselineConfig(**{'filter_time': 0.0, **gains})))


def seen(force, n=2):
    """Return a measurement of a force."""
    return Measurement(force, 0.1, 0.0, np.zeros(n))


@pytest.mark.parametrize('scheme', ['equal_pressure', 'threshold'])
@pytest.mark.parametrize(('kind', 'value', 'load'), [
    ('force', 20.0, Dynamometer(strain=0.16)), ('force', 60.0, Dynamometer(strain=0.16)),
    ('strain', 0.09, MassSpring(mass=3.0, damping=40.0))])
def test_error_settles_to_nothing(paper_bundle, scheme, kind, value, load):
    """The integral leaves no lasting error, with one unit or with both needed."""
    log = ClosedLoop(paper_bundle, controller=ControllerConfig(scheme=scheme), seed=2).run(
        hold(kind, value, load))
    assert abs(np.mean(log.error[-250:])) < (0.3 if kind == 'force' else 1e-3)


def test_equal_pressure_gives_all_units_one_pressure(bundles):
    """Whatever their size."""
    # plain: the compiled loop of three units would be compiled for little else
    log = ClosedLoop(bundles[3], controller=ControllerConfig(scheme='equal_pressure'), seed=2,
                     compiled=False).run(hold('force', 30.0, Dynamometer(strain=0.12), 1.0))
    assert np.ptp(log.setpoint, axis=1).max() == 0.0
    assert log.setpoint.min() > 30e3


def test_threshold_fills_one_unit_after_the_other(bundles):
    """No unit has pressure before those ahead of it are full."""
    bundle = bundles[3]
    top = float(bundle.force(0.12, bundle.max_pressure))
    log = ClosedLoop(bundle, controller=ControllerConfig(scheme='threshold'), seed=2,
                     compiled=False).run(
        Trajectory('rise', 'force', 6.0, lambda t: 0.15 * t * top, lambda t: 0.0,
                   Dynamometer(strain=0.12), prepare=1.0))
    assert set(log.state) == {1, 2, 3}
    for behind in (1, 2):
        begun = log.setpoint[:, behind] > 0.0
        assert np.all(log.setpoint[begun, behind - 1] == bundle.max_pressure[behind - 1])
    assert any('MU2' in text for _, text in log.decisions)


@pytest.mark.parametrize(('scheme', 'pressure', 'kept'), [
    ('equal_pressure', [150e3, 150e3], [150e3, 150e3]),
    ('equal_pressure', [200e3, 0.0], [100e3, 100e3]),
    ('threshold', [200e3, 0.0], [200e3, 0.0]),
    ('threshold', [344.7e3, 90e3], [344.7e3, 90e3])])
def test_enabling_goes_on_from_the_pressures_that_are_there(paper_bundle, scheme, pressure, kept):
    """Equal pressure divides them among units by their force; in turn each unit keeps its own."""
    loop = controller(paper_bundle, scheme)
    measurement = Measurement(50.0, 0.1, 0.0, np.array(pressure))
    loop.enable(measurement)
    command = loop.update(5e-3, measurement, Reference('force', 50.0, 0.0))
    assert command.pressure == pytest.approx(kept)
    assert command.state == sum(p > 0.0 for p in kept)


def test_gains_are_shares_of_what_the_bundle_gives(paper_bundle):
    """An error of the whole range of force answers with gain times the largest pressure."""
    full = paper_bundle.max_pressure
    span = float(paper_bundle.force(0.1, full) - paper_bundle.force(0.1, 0.0 * full))
    one = controller(paper_bundle, 'equal_pressure', force_gain=0.5, force_integral=0.0)
    command = one.update(4e-3, seen(10.0), Reference('force', 10.0 + 0.4 * span))
    assert command.pressure == pytest.approx(0.2 * full)
    rising = controller(paper_bundle, 'equal_pressure', force_gain=0.0, force_integral=2.0)
    for _ in range(100):
        command = rising.update(5e-3, seen(10.0), Reference('force', 10.0 + 0.4 * span))
    assert command.pressure == pytest.approx(0.4 * 2.0 * 0.5 * full)


def test_gains_for_a_strain_are_shares_of_a_fifth(paper_bundle):
    """An error of 0.2 answers with gain times the largest pressure, whatever the bundle."""
    made = controller(paper_bundle, 'equal_pressure', strain_gain=0.5, strain_integral=0.0)
    command = made.update(4e-3, seen(10.0), Reference('strain', 0.1 + 0.08))
    assert command.pressure == pytest.approx(0.5 * 0.08 / 0.2 * paper_bundle.max_pressure)


@pytest.mark.parametrize('scheme', ['equal_pressure', 'threshold'])
def test_integral_stops_at_full_pressure(paper_bundle, scheme):
    """After a minute of a demand out of reach, less is given as soon as less is asked for."""
    made = controller(paper_bundle, scheme)
    for _ in range(6000):
        command = made.update(1e-2, seen(100.0), Reference('force', 1000.0))
    assert command.saturated == 'high'
    assert command.pressure == pytest.approx(paper_bundle.max_pressure)
    for _ in range(30):
        command = made.update(1e-2, seen(100.0), Reference('force', 80.0))
    assert command.pressure[-1] < 0.9 * paper_bundle.max_pressure[-1]


def test_threshold_waits_between_switches(paper_bundle):
    """However the error swings, two switches are a dwell time apart."""
    made = controller(paper_bundle, 'threshold', force_gain=50.0, dwell=0.2)
    states, dt = [], 4e-3
    for k in range(500):
        error = 50.0 if k % 10 < 5 else -50.0
        states.append(made.update(dt, seen(50.0), Reference('force', 50.0 + error)).state)
    switches = np.flatnonzero(np.diff(states)) * dt
    assert len(switches) > 2
    assert np.diff(switches).min() >= 0.2 - 1e-9


def test_baselines_vent_without_readings(paper_bundle):
    """As every scheme: hold, then vent."""
    made = controller(paper_bundle, 'equal_pressure')
    for _ in range(100):
        before = made.update(4e-3, seen(0.0), Reference('force', 30.0))
    assert before.pressure[0] > 0.0
    for _ in range(100):
        after = made.update(4e-3, seen(float('nan')), Reference('force', 30.0))
    assert not after.pressure.any()


def test_gain_that_is_none_fails():
    """A gain that is not a number, or negative, is refused by its name."""
    with pytest.raises(InputError, match='strain_gain is -1'):
        BaselineConfig(strain_gain=-1.0)


def test_out_of_reach_is_said_at_the_ends_only(paper_bundle):
    """Between empty and full nothing is saturated; a scheme without a model claims no margins."""
    one = controller(paper_bundle, 'threshold', force_integral=1.0)
    command = one.update(5e-3, seen(10.0), Reference('force', 5.0))
    assert (command.state, command.saturated) == (0, 'low')
    for _ in range(20):
        command = one.update(5e-3, seen(10.0), Reference('force', 12.0))
    assert (command.state, command.saturated) == (1, '')
    assert 0.0 < command.pressure[0] < paper_bundle.max_pressure[0]
    assert command.margins.uncertainty == 0.0
    assert np.isnan(command.margins.recruit)
    for _ in range(4000):
        command = one.update(5e-3, seen(10.0), Reference('force', 500.0))
    assert (command.state, command.saturated) == (2, 'high')


def test_a_bundle_that_was_never_driven_is_vented_and_in_reach():
    """The command before the first."""
    command = command_record(3)
    assert (command.pressure, command.active, command.share) == ([0.0] * 3, [0] * 3, [0.0] * 3)
    assert (command.state, SATURATION[command.saturated]) == (0, '')


def test_equal_pressure_goes_up_to_the_limit_of_each_unit(paper_bundle):
    """The common pressure ends at the highest limit; a unit that takes less stays at its own."""
    first, second = paper_bundle.motor_units
    unlike = Bundle('unlike', [replace(first, max_pressure=200e3), second], paper_bundle.effects)
    one = controller(unlike, 'equal_pressure', force_gain=100.0)
    command = one.update(5e-3, seen(10.0), Reference('force', 500.0))
    assert command.pressure == pytest.approx([200e3, second.max_pressure])


@pytest.mark.parametrize('equal', [True, False])
def test_a_unit_that_begins_or_ends_is_told_once_in_turn_and_never_at_equal_pressure(
        paper_bundle, equal):
    """Two seconds of a force that is too small, then of one that is too large."""
    bundle, state, command = paper_bundle, BaselineState(), command_record(2)
    settings = baseline_settings(BaselineConfig(), bundle, bundle.max_pressure)
    changes = 0
    for k in range(1000):
        before, command.reason.why = state.state, NONE
        baseline_step(settings, state, equal, [0, 1], bundle.max_pressure.tolist(), 0.0, seen(0.0),
                      FORCE, 50.0 if k < 500 else -50.0, 4e-3, command)
        changes += state.state != before
        assert (command.reason.why != NONE) == (state.state != before and not equal)
    assert changes > 1


def test_threshold_hands_over_at_full_and_at_empty(bundles):
    """Up and down, ramps of each unit's share in its order, each from where the last one ends."""
    bundle, dt = bundles[3], 4e-3
    settings = baseline_settings(BaselineConfig(force_gain=0.0, filter_time=0.0, dwell=0.0),
                                 bundle, bundle.max_pressure)
    state, command, order = BaselineState(), command_record(3), [0, 1, 2]
    full, rows = bundle.max_pressure.tolist(), []
    for error in (30.0, -30.0):
        for _ in range(2500):
            baseline_step(settings, state, False, order, full, 0.0, seen(0.0, 3), FORCE, error,
                          dt, command)
            rows.append(list(command.pressure))
            assert command.share == pytest.approx(
                np.array(rows[-1]) / max(sum(rows[-1]), 1e-9))
    rows = np.array(rows) / bundle.max_pressure
    assert rows.min() == 0.0
    assert rows.max() == 1.0
    assert np.all(rows[2499] == 1.0)
    assert np.all(rows[-1] == 0.0)
    assert np.all((rows[:, 1:] == 0.0) | (rows[:, :-1] == 1.0))
    # a unit's own share of the error moves it
    each = 10.0 * 30.0 / settings.force_range * dt / np.array(settings.share)
    steps = np.diff(rows, axis=0)
    for k in range(3):
        inside = (rows[1:, k] > 0.0) & (rows[1:, k] < 1.0)
        assert np.abs(steps[inside, k]).max() < 1.01 * each[k]
        assert np.median(np.abs(steps[inside, k])) == pytest.approx(each[k])


@pytest.mark.parametrize(('proportional', 'integral', 'step', 'answer', 'after'), [
    (0.2, 0.3, 0.1, 0.6, 0.4), (0.2, 0.9, 0.1, 1.0, 0.9), (0.2, 0.9, -0.1, 1.0, 0.8),
    (-0.4, 0.3, -0.1, 0.0, 0.3), (-0.4, 0.3, 0.1, 0.0, 0.4), (0.3, 0.7, 0.1, 1.0, 0.7)])
def test_the_integral_stops_at_either_end(proportional, integral, step, answer, after):
    """It goes on as soon as it would lead back."""
    state = BaselineState(integral=integral)
    assert pi_answer(state, proportional, step) == pytest.approx(answer)
    assert state.integral == pytest.approx(after)


def test_changes_within_the_quiet_band_are_left_out():
    """Of a pressure between empty and full; beyond the band it stays behind by it."""
    command = command_record(1)
    for wanted, given in ((100e3, 98e3), (99e3, 98e3), (97e3, 98e3), (90e3, 92e3), (1e3, 3e3),
                          (0.0, 0.0), (200e3, 200e3), (199.5e3, 200e3)):
        play(command, 0, wanted, 200e3, 2e3)
        assert command.pressure == [pytest.approx(given)]
