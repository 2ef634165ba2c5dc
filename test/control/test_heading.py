# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Rate, acceleration and jerk of a demand: the input of the look-ahead."""

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from fam_bundle_ros.control.heading import follow_heading, heading_now, heading_of, rest_at

from .at_once import DT


@given(steps=st.lists(st.floats(1e-4, 0.05), min_size=3, max_size=40),
       slope=st.floats(-500.0, 500.0), bandwidth=st.sampled_from([12.0, 80.0]))
@settings(deadline=None)
def test_a_ramp_shows_its_rate_whatever_the_sample_times(steps, slope, bandwidth):
    """Once the start has faded, uneven samples of a ramp give its rate and nothing else."""
    heading = heading_of(1)
    for dt in [0.05] * 60 + steps:
        follow_heading(heading, 0, heading.value[0] + slope * dt, dt, bandwidth)
    rate, acceleration, _ = heading_now(heading, 0, bandwidth)
    assert rate == pytest.approx(slope, abs=1e-3)
    assert acceleration == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize('dt', [1e-3, DT])
def test_the_filters_delay_is_made_up_for(dt):
    """Of a cubic the rate, acceleration and jerk of now come out, not those of before."""
    heading = heading_of(1)
    for k in range(1, round(1.0 / dt) + 1):
        follow_heading(heading, 0, 100.0 * (k * dt) ** 3, dt, 80.0)
    assert heading_now(heading, 0, 80.0) == pytest.approx((300.0, 600.0, 600.0), rel=0.01)


@given(dt=st.floats(1e-4, 0.02), acceleration=st.floats(-100.0, 100.0))
@settings(deadline=None)
def test_a_signal_of_constant_acceleration_shows_no_jerk(dt, acceleration):
    """However long a sample is: it is straight between samples for the filter only."""
    heading = heading_of(1)
    for k in range(1, round(1.0 / dt) + 1):
        follow_heading(heading, 0, 0.5 * acceleration * (k * dt) ** 2, dt, 80.0)
    assert heading_now(heading, 0, 80.0)[2] == pytest.approx(0.0, abs=0.01)


def test_a_signal_that_is_put_to_rest_has_no_slope():
    """Whatever it did before, the same value again is no change."""
    heading = heading_of(1)
    for k in range(50):
        follow_heading(heading, 0, float(k), DT, 80.0)
    rest_at(heading, 0, 7.0)
    follow_heading(heading, 0, 7.0, DT, 80.0)
    assert heading_now(heading, 0, 80.0) == (0.0, 0.0, 0.0)
