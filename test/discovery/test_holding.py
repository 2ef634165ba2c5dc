# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Does a model still hold? False alarms at the rate that is set, and real ones soon."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from fam_bundle_ros.discovery.holding import Holding, tolerance_of
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path

RATE = 200.0
NOISE = 0.9


def times(seconds):
    """Return the times of samples, s."""
    return np.arange(round(RATE * seconds)) / RATE


def rate_of(time):
    """Return the sign of the strain rate in `watched`."""
    return np.sign(np.cos(math.pi * time))


def watched(residual, **keywords):
    """Let a strain of 5 to 15 % go to and fro every two seconds; return watch and alarms (s)."""
    watch = Holding(**{'tolerance': 2.0, 'max_pressure': 7e5, **keywords})
    time = times(len(residual) / RATE)
    strain, pressure = 0.1 + 0.05 * np.sin(math.pi * time), 3e5 + 2e5 * np.sin(time)
    alarms, held = [], True
    for row in zip(time.tolist(), strain.tolist(), pressure.tolist(), residual.tolist()):
        watch.add(*row)
        if held and not watch.holds:
            alarms.append(row[0])
        held = watch.holds
    return watch, alarms


@pytest.fixture
def noise():
    """Return a function that makes white noise of so many seconds, N."""
    rng = np.random.default_rng(11)
    return lambda seconds: rng.normal(0.0, NOISE, round(RATE * seconds))


@pytest.mark.parametrize('tolerance', [0.1, 0.5, 3.0])
def test_the_e_value_is_at_most_one_on_average_up_to_the_tolerance(tolerance):
    """E[L] by Gauss-Hermite quadrature: 1 and less for |mean| <= d, more beyond."""
    watch = Holding(tolerance, 4e5)
    spread = 0.4
    place, weight = np.polynomial.hermite_e.hermegauss(80)

    def expected(mean):
        values = [math.exp(watch.log_e_value(mean + spread * z, spread)) for z in place]
        return float(np.dot(weight, values)) / math.sqrt(2.0 * math.pi)
    for mean in (0.0, 0.5 * tolerance, -tolerance, tolerance):
        assert expected(mean) <= 1.0 + 1e-9
    assert expected(tolerance) == pytest.approx(1.0)
    assert expected(1.2 * tolerance) > 1.0


def test_an_error_as_large_as_is_allowed_raises_no_more_alarms_than_were_asked_for(noise):
    """Half an hour at the tolerance, its sign that of the motion; twelve an hour are allowed."""
    residual = noise(1800.0)
    residual += 2.0 * rate_of(times(1800.0))
    watch, alarms = watched(residual, false_alarms=12.0, recovery=1.0)
    assert len(alarms) <= 6
    assert watch.looks > 2000


def test_coloured_noise_makes_looks_longer_and_no_alarms():
    """Noise with a memory of half a second is not taken for many independent samples."""
    rng = np.random.default_rng(3)
    share = math.exp(-1.0 / (0.5 * RATE))
    residual = lfilter([1.0], [1.0, -share], rng.normal(
        0.0, 1.5 * math.sqrt(1.0 - share ** 2), round(RATE * 900.0)))
    watch, alarms = watched(residual, tolerance=0.3, false_alarms=4.0, recovery=1.0)
    assert len(alarms) <= 1
    assert watch.looks < 400


def test_noise_is_that_of_short_means_and_not_of_what_turns_with_the_motion(noise):
    """White noise of 0.9 N over ten samples: 0.28 N and 7 % for doubt, with friction too."""
    residual = noise(80.0)
    for added in (0.0, 6.0 * rate_of(times(80.0))):
        watch, _ = watched(residual + added)
        assert watch.noise.value == pytest.approx(1.07 * NOISE / math.sqrt(10.0), rel=0.07)
        assert watch.noise.time < 1.5


def test_friction_shows_in_noise_that_asks_for_long_looks():
    """Looks of a second and more would average it out if they did not keep to one direction."""
    rng = np.random.default_rng(5)
    share = math.exp(-1.0 / (0.15 * RATE))
    coloured = lfilter([1.0], [1.0, -share], rng.normal(
        0.0, 1.5 * math.sqrt(1.0 - share ** 2), round(RATE * 120.0)))
    watch, alarms = watched(coloured + 6.0 * rate_of(times(120.0)))
    assert watch.noise.time > 4.0
    assert alarms[0] < 90.0


def test_friction_is_noticed_within_a_few_seconds_and_dated(noise):
    """Errors of 4 N with the sign of the motion from 20 s on; a mean over time would be zero."""
    residual, time = noise(30.0), times(30.0)
    residual[time >= 20.0] += (4.0 * rate_of(time))[time >= 20.0]
    watch, alarms = watched(residual)
    assert 20.0 < alarms[0] < 25.0
    assert 20.0 <= watch.since < 21.5  # no row from before is among those that are diagnosed


def test_one_blow_against_the_load_cell_is_no_alarm(noise):
    """However large: an alarm takes three looks."""
    residual, time = noise(40.0), times(40.0)
    residual[(time >= 20.5) & (time < 20.7)] += 5000.0
    assert watched(residual)[1] == []


def test_a_model_holds_again_when_no_more_speaks_against_it(noise):
    """An error that goes away is forgiven after the time of recovery; the next is dated anew."""
    residual, time = noise(100.0), times(100.0)
    residual[(time >= 20.0) & (time < 40.0)] += 5.0
    watch, alarms = watched(residual[time < 80.0], recovery=20.0)
    assert len(alarms) == 1
    assert watch.holds
    assert math.isnan(watch.since)
    residual[time >= 85.0] += 5.0
    watch, alarms = watched(residual, recovery=20.0)
    assert len(alarms) == 2
    assert watch.since == pytest.approx(85.0, abs=1.5)


def test_readings_that_are_none_and_gaps_are_no_evidence(noise):
    """A watch on nan says nothing; what was before a gap is not averaged with what is after."""
    residual = noise(20.0)
    residual[::7] = math.nan
    watch, alarms = watched(residual)
    assert alarms == []
    assert watch.looks > 10
    looks = watch.looks
    for k in range(round(20.0 * RATE)):  # the clock was set back
        watch.add(k / RATE, 0.1, 2e5, residual[k - k % 7 + 1])
    assert watch.looks > looks + 10
    assert watch.holds


def test_the_tolerance_is_the_models_own_error_or_what_is_small():
    """Twice the error in the file; for a model without one 1 % of its largest force."""
    model = load_model(config_path('models/spie2021.yaml'))
    largest = float(model.blocked_force(model.max_pressure))
    assert tolerance_of(model) == pytest.approx(0.01 * largest)
    model.error = 0.04 * largest
    assert tolerance_of(model) == pytest.approx(0.08 * largest)


def test_senseless_settings_fail():
    """Tolerance and false alarms are positive."""
    with pytest.raises(InputError, match='expected positive'):
        Holding(0.0, 4e5)
    with pytest.raises(InputError, match='0 false alarms'):
        Holding(1.0, 4e5, false_alarms=0.0)
