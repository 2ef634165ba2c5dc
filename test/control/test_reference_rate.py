# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""References that are given without a rate."""

import math
from pathlib import Path

import numpy as np
import pytest

from fam_bundle_ros.control import Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.reference_rate import ReferenceRate, SampledReference
from fam_bundle_ros.model import load_model

MODEL = Path(__file__).parents[2] / 'config' / 'models' / 'spie2021_plain.yaml'
TICK = 5e-3


def read(values, step=5.0):
    """Return values and rates that are read from one value per tick."""
    sampled = SampledReference(step)
    return np.array([sampled.update(TICK * k, value) for k, value in enumerate(values)]).T


def sine(time):
    """Return a force reference, N."""
    return 40.0 + 20.0 * np.sin(2.0 * np.pi * 0.5 * time)


def sine_rate(time):
    """Return its rate, N/s."""
    return 20.0 * np.pi * np.cos(2.0 * np.pi * 0.5 * time)


def test_values_that_are_new_at_each_tick_are_followed_exactly():
    """No extrapolation; the rate within a twentieth of its largest value."""
    time = TICK * np.arange(400)
    value, rate = read(sine(time))
    assert np.array_equal(value, sine(time))
    assert rate[2:] == pytest.approx(sine_rate(time[2:] - TICK / 2.0), abs=20.0 * np.pi / 20.0)


@pytest.mark.parametrize('hold', [2, 3, 4])
def test_values_that_are_held_for_some_ticks_are_extrapolated(hold):
    """A staircase of a sine: within a fifth of its steps, the rate within a quarter."""
    tick = np.arange(800)
    value, rate = read(sine(TICK * hold * (tick // hold)))
    late = tick > 4 * hold
    step = 20.0 * np.pi * TICK * hold
    assert abs(value - sine(TICK * tick))[late].max() < 0.2 * step
    assert rate[late] == pytest.approx(sine_rate(TICK * tick[late]), abs=0.25 * 20.0 * np.pi)


@pytest.mark.parametrize('hertz', [60.0, 130.0])
def test_uneven_intervals_between_values_are_no_rests(hertz):
    """New values every 3 or 4, or every 1 or 2 ticks of 5 ms: no rate of 0 in between."""
    tick = np.arange(400)
    number = (tick * TICK * hertz).astype(int)
    _, rate = read(20.0 * number / hertz)
    assert rate[20:].min() > 0.0
    assert np.mean(rate[20:]) == pytest.approx(20.0, rel=0.1)


def test_a_rest_between_two_motions_is_no_interval():
    """After it a value that stays is at rest as soon as ever, and two steps are no motion."""
    value, rate = read([0.0] * 100 + [1.0] * 4 + [2.0] * 40)
    assert np.all(rate == 0.0)
    assert np.all(value[104:] == 2.0)
    value, rate = read([0.0] * 100 + [1.0] * 4 + [2.0] * 4 + [3.0] * 40)
    assert rate[108] > 0.0
    assert np.all(rate[115:] == 0.0)
    assert np.all(value[115:] == 3.0)


def test_a_motion_that_ends_is_at_rest_after_one_interval():
    """At each tick: at once. Every fourth tick: when the next value is overdue."""
    for hold, late in ((1, 0), (4, 6)):
        tick = np.arange(100)
        value, rate = read(np.minimum(0.1 * hold * (tick // hold), 4.0))
        end = 40 + late
        assert np.all(rate[end + 1:] == 0.0)
        assert np.all(value[end + 1:] == 4.0)
        assert value.max() <= 4.0 + 0.1 * late


def test_a_value_that_is_no_number_is_passed_on_and_forgotten():
    """The controller holds its pressures for that tick only."""
    values = list(0.1 * np.arange(20.0))
    values[10] = math.nan
    value, rate = read(values)
    assert np.array_equal(np.isnan(value), np.isnan(values))
    assert np.isfinite(rate).all()
    assert rate[14:] == pytest.approx(0.1 / TICK)


@pytest.mark.parametrize('size', [0.1, 30.0])
def test_a_single_change_is_a_step(size):
    """Small or large: no rate, as a rate of one tick would recruit."""
    value, rate = read([10.0] * 20 + [10.0 + size] * 20)
    assert np.all(rate == 0.0)
    assert value[20] == 10.0 + size


def test_a_motion_that_begins_at_full_speed_has_a_rate():
    """Changes beyond the step from the first tick on: the second one continues the first."""
    reader = ReferenceRate(5.0)
    assert [reader.update(TICK * k, 8.0 * k) for k in range(4)] == pytest.approx(
        [0.0, 0.0, 1600.0, 1600.0])


def tracking_error(reference):
    """Return the rms of force, N, of pressures that lag by 20 ms behind the command."""
    bundle = load_model(MODEL)
    controller, pressure, errors = RecruitmentController(bundle), np.zeros(2), []
    for k in range(800):
        force = float(bundle.force(0.1, pressure))
        errors.append(sine(TICK * k) - force)
        command = controller.update(TICK, Measurement(force, 0.1, 0.0, pressure), reference(k))
        pressure = pressure + (1.0 - np.exp(-TICK / 20e-3)) * (command.pressure - pressure)
    return float(np.sqrt(np.mean(np.square(errors[200:]))))


@pytest.mark.parametrize('hold', [1, 4])
def test_force_reference_without_a_rate_is_followed_as_with_one(hold):
    """A sine of 0.5 Hz, as values of each tick or of each fourth: no more than 1.2 times the rms.

    With a rate of 0 the error is half as large again.
    """
    def held(k):
        return float(sine(TICK * hold * (k // hold)))
    told = tracking_error(lambda k: Reference('force', float(sine(TICK * k)),
                                              float(sine_rate(TICK * k))))
    assert tracking_error(lambda k: Reference('force', held(k))) < 1.2 * told
    assert tracking_error(lambda k: Reference('force', held(k), 0.0)) > 1.5 * told


def test_strain_reference_without_a_rate_has_that_of_its_values():
    """The same state and target as with the rate told, from the second tick on."""
    bundle = load_model(MODEL)
    told, without = RecruitmentController(bundle), RecruitmentController(bundle)
    measurement = Measurement(20.0, 0.1, 0.02, np.array([150e3, 0.0]))
    for k in range(20):
        strain = 0.1 + 0.02 * TICK * k
        expected = told.update(TICK, measurement, Reference('strain', strain, 0.02))
        command = without.update(TICK, measurement, Reference('strain', strain))
        assert without.memory.outer.target.strain_rate == pytest.approx(0.02 if k > 0 else 0.0)
    assert command.state == expected.state
