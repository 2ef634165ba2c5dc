# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gains with margins, on the linearised chamber."""

import math

import numpy as np
import pytest

from fam_bundle_ros.control import PidConfig, PidGains, tune
from fam_bundle_ros.errors import InputError

pytest.importorskip('control')


@pytest.mark.parametrize('period', [1e-3, 2e-3, 5e-3])
def test_margins_hold_at_every_operating_point(period):
    """8 dB and 55 degrees are kept at every volume and pressure."""
    result = tune(sample_period=period, transport_delay=0.5 * period)
    assert result.gain_margin_db >= 8.0
    assert result.phase_margin_deg >= 55.0 - 1e-6
    assert all(row['rate_per_opening'] != 0.0 for row in result.rows())


def test_more_dead_time_gives_lower_gains():
    """The gain goes about with the inverse of the dead time, as for any integrator."""
    fast, slow = (tune(sample_period=t, transport_delay=t).gains.p for t in (1e-3, 8e-3))
    assert 2.0 < fast / slow < 8.0


def test_scheduling_buys_gain():
    """A loop that is not told the volume must leave room for the smallest one."""
    assert tune().gains.p > 1.3 * tune(scheduled=False).gains.p


def test_the_default_gains_are_those_for_the_default_loop():
    """Rounded to a thousandth."""
    tuned, default = tune().gains, PidGains()
    assert (default.p, default.i, default.d) == pytest.approx((tuned.p, tuned.i, tuned.d),
                                                              rel=1e-3)


def test_phase_margin_agrees_with_the_bode_plot():
    """Integrator, spool, PI and a true dead time: the margin where the magnitude is 1."""
    result = tune(derivative=0.0)
    hertz = np.geomspace(0.3, 300.0, 300)
    s, natural = 2j * np.pi * hertz, 2.0 * np.pi * result.spool_frequency
    loop = (np.exp(-s * result.dead_time) * (result.gains.p + result.gains.i / s) / s
            / (1.0 + 1.4 * s / natural + (s / natural) ** 2))
    crossover = np.interp(0.0, -np.log(np.abs(loop)), hertz)
    margin = 180.0 + np.interp(crossover, hertz, np.degrees(np.unwrap(np.angle(loop))))
    assert crossover == pytest.approx(result.crossover_hz[0], rel=0.02)
    assert margin % 360.0 == pytest.approx(result.phase_margin_deg, abs=1.5)


def test_tuned_gains_hold_in_the_time_domain(chamber):
    """A step of 20 kPa with the tuned gains overshoots by less than 3 kPa and settles."""
    gains = tune(sample_period=2e-3, transport_delay=1e-3).gains
    loop = chamber(pressure=100e3, period=2e-3, gains=gains,
                   config=PidConfig(flow_lag=1.8e-3, quiet_error=500.0))
    rows = loop.run(120e3, 0.3)
    assert max(p for _, p, _ in rows) < 123e3
    assert math.isclose(rows[-1][1], 120e3, abs_tol=1.2e3)


def test_impossible_margins_fails():
    """A dead time of a minute leaves no gain that keeps the margins."""
    with pytest.raises(InputError, match='no gain keeps'):
        tune(sample_period=2e-3, transport_delay=60.0)
    with pytest.raises(InputError, match='sample period'):
        tune(sample_period=0.0)
