# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A reading that stands still while a loop hunts about it, and sound ones that stand still too."""

import math

import pytest

from fam_bundle_ros.control.safety import FROZEN, SensorWatch, WatchConfig
from fam_bundle_ros.control.travel import Travel

PERIOD = 5e-3


def watched(unit, setpoint, shown, duration):
    """Run a chamber whose gauge shows `shown(pressure)`; return watch and rows of numbers."""
    watch = SensorWatch('mu1 pressure', 'Pa', WatchConfig(-50e3, 1.6e6, stuck_time=0.5))
    travel, rows = Travel(52e3, 2.0 * PERIOD), []
    for _ in range(round(duration / PERIOD)):
        reading = shown(unit.pressure)
        watch.see(unit.time, reading, travel.see(unit.time, reading,
                                                 unit.pid.state.shown.expected_rate))
        rows.append((unit.time, unit.pressure))
        if watch.cause:
            break
        command = unit.pid.update(setpoint(unit.time), reading, PERIOD, unit.supply, unit.volume)
        for _ in range(50):
            unit._advance(command, PERIOD / 50)
    return watch, rows


def hunting(time):
    """Return a setpoint to and fro about 200 kPa."""
    return 200e3 + 15e3 * math.sin(2.0 * math.pi * time)


def test_a_frozen_reading_is_found_where_the_loop_hunts_about_it(chamber):
    """Small openings, up and down: the pressure itself has gone by more than 50 kPa meanwhile."""
    unit = chamber(pressure=200e3, period=PERIOD)
    unit.pid.reset()
    watch, rows = watched(unit, hunting, lambda pressure: 200e3, 5.0)
    assert watch.cause == FROZEN
    assert rows[-1][0] < 1.5
    pressure = [row[1] for row in rows]
    assert max(pressure) - min(pressure) > 52e3


@pytest.mark.parametrize('setpoint', [
    hunting, lambda time: 200e3, lambda time: 200e3 + 1e3 * time,
    lambda time: 200e3 + 1e3 * math.sin(2.0 * math.pi * time)])
@pytest.mark.parametrize('rig', [{}, {'leak': 1.0}, {'dead_band': 0.07}, {'dead_band': 0.02}])
def test_a_sound_gauge_without_noise_is_not_taken_for_a_frozen_one(chamber, setpoint, rig):
    """It shows steps of 5 kPa; at rest, in slow ramps, with leaks, with another dead band."""
    unit = chamber(pressure=200e3, period=PERIOD, **rig)
    watch, rows = watched(unit, setpoint, lambda pressure: round(pressure / 5e3) * 5e3, 10.0)
    assert (watch.cause, rows[-1][0] > 9.9) == ('', True)


def test_down_counts_as_up_and_a_gap_for_no_more_than_two_samples():
    """After a second without readings nothing is known of what the valve did."""
    travel = Travel(50e3, 0.01)
    assert [travel.see(0.01 * k, 200e3, -2e6) for k in range(4)] == [False, False, False, True]
    travel = Travel(50e3, 0.01)
    assert [travel.see(1.0 * k, 200e3, 1e6) for k in range(6)] == [False] * 6
