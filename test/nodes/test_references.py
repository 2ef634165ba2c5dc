# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""References between their messages, without ROS."""

from pathlib import Path

import numpy as np
import pytest

from fam_bundle_ros.control import Measurement, RecruitmentController, Reference
from fam_bundle_ros.control.reference_rate import ReferenceRate
from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes.references import MovingReference

MODEL = Path(__file__).parents[2] / 'config' / 'models' / 'spie2021.yaml'


def told(hertz, jitter, rate=20.0, late=0.0, seed=0):
    """Return arrival, stamp and value of messages: a ramp from 10 to 54 N, begun at 1 s."""
    random, time = np.random.default_rng(seed), np.arange(0.0, 4.0, 1.0 / hertz)
    stamps = time + jitter / hertz * random.uniform(-1.0, 1.0, time.size)
    arrivals = time + 1e-3 + late / hertz * random.uniform(0.0, 1.0, time.size)
    return list(zip(arrivals, stamps, 10.0 + rate * np.clip(time - 1.0, 0.0, 44.0 / rate)))


def rates_of(messages):
    """Return times and what `ReferenceRate` reads, N/s."""
    reader = ReferenceRate(5.0)
    return np.array([(stamp, reader.update(stamp + 1.0, value))
                     for _, stamp, value in messages]).T


@pytest.mark.parametrize('hertz', [50.0, 100.0, 200.0])
@pytest.mark.parametrize('jitter', [0.0, 0.1, 0.2])
def test_a_streamed_ramp_is_read_at_its_rate(hertz, jitter):
    """20 N/s with jitter of the stamps: 20 +- 3 N/s, and where it begins no more than 25."""
    for seed in range(10):
        times, rates = rates_of(told(hertz, jitter, seed=seed))
        ramp = (times > 1.0 + 5.0 / hertz) & (times < 3.15)
        assert abs(rates[ramp] - 20.0).max() < 3.0
        assert rates.max() < 25.0
        assert abs(rates[times > 3.2 + 2.5 / hertz]).max() < 1e-9


def test_the_end_of_a_ramp_is_read_at_the_next_value_but_one():
    """What stands still has no rate, though it moved for seconds."""
    times, rates = rates_of(told(100.0, 0.0))
    assert np.all(rates[times > 3.215] == 0.0)
    assert np.all(rates[(times > 1.05) & (times < 3.195)] > 18.0)


def test_a_step_or_a_pause_has_no_rate():
    """A change beyond the step, and values further apart than 0.1 s."""
    reader = ReferenceRate(5.0)
    for k, value in enumerate([10.0, 10.0, 30.0, 30.0]):
        assert reader.update(1.0 + 0.01 * k, value) == 0.0
    assert reader.update(3.0, 31.0) == 0.0


@pytest.mark.parametrize('hertz', [50.0, 100.0])
def test_a_streamed_ramp_recruits_where_a_smooth_one_does(hertz):
    """The second unit is called within 1 N of where it is without messages in between."""
    bundle = load_model(MODEL)

    def recruited(reference_at):
        controller, pressure = RecruitmentController(bundle), np.zeros(2)
        for time in np.arange(0.0, 3.2, 4e-3):
            reference = reference_at(float(time))
            force = float(bundle.force(0.16, pressure))
            command = controller.update(4e-3, Measurement(force, 0.16, 0.0, pressure), reference)
            pressure = pressure + 0.4 * (command.pressure - pressure)
            if command.state == 2:
                return reference.value
        return np.inf
    smooth = recruited(lambda t: Reference('force', 10.0 + 20.0 * max(t - 1.0, 0.0),
                                           20.0 if t > 1.0 else 0.0))
    reader, moving, messages = ReferenceRate(5.0), MovingReference(), told(hertz, 0.2, late=0.3)

    def streamed(time):
        while messages and (messages[0][0] <= time or moving.last is None):
            arrival, stamp, value = messages.pop(0)
            moving.take(Reference('force', value, reader.update(stamp + 1.0, value)), arrival)
        return moving.at(time)
    assert recruited(streamed) == pytest.approx(smooth, abs=1.0)


def test_messages_that_come_late_make_no_jumps():
    """Arrivals wander by a third of the interval: from tick to tick the ramp goes on as it did."""
    moving, messages, values = MovingReference(), told(50.0, 0.0, late=0.3), []
    for time in np.arange(1.5, 3.0, 4e-3):
        while messages[0][0] <= time:
            arrival, _, value = messages.pop(0)
            moving.take(Reference('force', value, 20.0 if value > 10.0 else 0.0), arrival)
        values.append(moving.at(float(time)).value)
    steps = np.diff(values) / 4e-3
    assert steps.max() < 32.0
    assert steps.min() > 8.0


def test_ramp_told_now_and_then_is_no_stairs():
    """Messages at 50 Hz with 20 % of jitter, ticks at 250 Hz: the ramp itself at every tick."""
    moving, random = MovingReference(), np.random.default_rng(0)
    due, seen = 0.0, []
    for tick in np.arange(0.0, 1.0, 0.004):
        if tick >= due:
            moving.take(Reference('force', 10.0 + 100.0 * tick, 100.0), float(tick))
            due = tick + 0.02 * (1.0 + 0.2 * random.uniform(-1.0, 1.0))
        seen.append((tick, moving.at(float(tick)).value))
    time, value = np.array(seen)[10:].T
    assert value == pytest.approx(10.0 + 100.0 * time, abs=0.8)
    assert np.median(np.abs(value - 10.0 - 100.0 * time)) < 1e-6


def test_reference_that_is_overdue_has_stopped():
    """A publisher that goes away in the middle of a ramp leaves its last value, at rest."""
    moving = MovingReference()
    for time in (0.0, 0.02):
        moving.take(Reference('strain', 0.1 + time, 1.0), time)
    assert moving.at(0.03) == Reference('strain', pytest.approx(0.13), 1.0)
    assert moving.at(0.07) == Reference('strain', pytest.approx(0.12), 0.0)


def test_single_reference_and_steps_stay_as_they_are():
    """One message alone, or one that says no rate, is a step."""
    moving = MovingReference()
    assert moving.at(0.0) is None
    moving.take(Reference('strain', 0.1, 0.5), 0.0)
    assert moving.at(0.3) == Reference('strain', 0.1, 0.0)
    moving.take(Reference('force', 20.0), 0.4)
    assert moving.at(0.41) == Reference('force', 20.0)
