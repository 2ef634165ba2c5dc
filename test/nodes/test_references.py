# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""References between their messages, without ROS."""

import numpy as np
import pytest

from fam_bundle_ros.control import Reference
from fam_bundle_ros.nodes.references import MovingReference


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
    assert moving.at(0.06) == Reference('strain', pytest.approx(0.12), 0.0)


def test_single_reference_and_steps_stay_as_they_are():
    """One message alone, or one that says no rate, is a step."""
    moving = MovingReference()
    assert moving.at(0.0) is None
    moving.take(Reference('strain', 0.1, 0.5), 0.0)
    assert moving.at(0.3) == Reference('strain', 0.1, 0.0)
    moving.take(Reference('force', 20.0), 0.4)
    assert moving.at(0.41) == Reference('force', 20.0)
