# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Margins and steps of the loops, over the error of the model."""

import pytest

from fam_bundle_ros.control import LoadModel, OuterConfig, PidConfig, tune
from fam_bundle_ros.control.loop_tuning import pressure_steps, tune_force, tune_strain

pytest.importorskip('control')


@pytest.mark.parametrize('delay', [5e-3, 10e-3, 15e-3])
def test_a_pressure_step_overshoots_by_5_percent_at_most_when_the_delay_is_told(delay):
    """At every volume; it settles within three lags of the loop, and not before its delay."""
    gains = tune(sample_period=2e-3, transport_delay=delay).gains
    for step in pressure_steps(gains, PidConfig(transport_delay=delay), 2e-3, delay,
                               gain_errors=(0.0,)):
        assert step.overshoot <= 0.05
        assert delay < step.settling < 0.05


def test_a_delay_that_is_not_told_overshoots():
    """What the prediction is for: the same gains, 15 ms of delay and none told."""
    gains = tune(sample_period=2e-3, transport_delay=15e-3).gains
    told, untold = (max(step.overshoot for step in pressure_steps(
        gains, PidConfig(transport_delay=known), 2e-3, 15e-3, gain_errors=(0.0,)))
        for known in (15e-3, 0.0))
    assert untold > 2.0 * told


@pytest.mark.parametrize('delay', [5e-3, 10e-3, 15e-3])
def test_the_force_loop_keeps_a_gain_margin_of_2_where_the_model_is_half_off(delay):
    """The closed form for the default force gain agrees with python-control."""
    result = tune_force(OuterConfig(delay=delay, gain_error=0.5))
    assert min(point.gain_margin_db for point in result.points) == pytest.approx(6.02, abs=0.05)
    assert result.points[-1].gain_error == 0.5


def test_a_model_without_error_gives_a_step_without_overshoot():
    """Then the observer has nothing to say, and the gain on the error only shortens the lag."""
    points = {point.gain_error: point for point in tune_force().points}
    assert points[0.0].overshoot == 0.0
    assert points[0.0].settling < points[0.5].settling


def test_what_is_learnt_to_be_late_makes_the_observer_patient():
    """The time of the observer is the lag of the loop."""
    quick, late = tune_force(), tune_force(lag=0.03)
    assert late.settings['bias_time'] == pytest.approx(quick.settings['bias_time'] + 0.03)
    assert late.points[-1].gain_margin_db == pytest.approx(6.02, abs=0.05)


@pytest.mark.parametrize(('delay', 'mass'), [
    (10e-3, 1.0), (5e-3, 3.0), (15e-3, 3.0), (10e-3, 10.0)])
def test_the_strain_loop_keeps_its_margins_on_a_mass_without_damping(paper_bundle, delay, mass):
    """6 dB and 29 degrees (hardly less between frequencies) over stiffness and force."""
    load = LoadModel(inertia=mass * paper_bundle.length)
    result = tune_strain(paper_bundle, load, OuterConfig(delay=delay))
    assert min(point.gain_margin_db for point in result.points) > 5.5
    assert min(point.phase_margin_deg for point in result.points) > 28.0
    assert result.settings['strain_integral'] > 0.0


def test_strain_gains_that_know_of_no_delay_are_unstable_on_a_mass_without_damping(paper_bundle):
    """A PD that adds stiffness and damping where it is formed: margins below 0, never settled."""
    load = LoadModel(inertia=1.5 * paper_bundle.length)
    result = tune_strain(paper_bundle, load, OuterConfig(
        delay=10e-3, strain_gain=400.0, strain_integral=2000.0, strain_damping=12.0))
    assert max(point.gain_margin_db for point in result.points) < 0.0
    assert max(point.phase_margin_deg for point in result.points) < 0.0


def test_a_longer_delay_leaves_less(paper_bundle):
    """Less of the integral, and no more damping."""
    load = LoadModel(inertia=3.0 * paper_bundle.length)
    found = [tune_strain(paper_bundle, load, OuterConfig(delay=delay)).settings
             for delay in (0.0, 5e-3, 15e-3)]
    assert found[0]['strain_damping'] >= found[1]['strain_damping'] > found[2]['strain_damping']
    integrals = [each['strain_integral'] for each in found]
    assert integrals == sorted(integrals, reverse=True)
    assert integrals[0] > integrals[2] > 100.0
