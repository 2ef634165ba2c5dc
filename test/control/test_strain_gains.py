# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Gains of the strain loop, and what they are worked out from, against simulated time."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.control.outer import LoadModel, OuterConfig
from fam_bundle_ros.control.outer_loop import outer_settings
from fam_bundle_ros.control.strain_gains import (
    _costs,
    _plants,
    DAMPED,
    drag_of,
    GAIN_ERRORS,
    RATE_LAG,
    SPAN,
    stiffness_grid,
    stiffnesses_between,
    strain_gains,
    unit_stiffness,
)
from fam_bundle_ros.model import Bundle

STIFFNESS, INERTIA, LAG = 800.0, 0.5, 0.02


@pytest.mark.parametrize('size', [0.02, 30.0])
def test_gains_are_in_proportion_to_stiffness_inertia_and_damping(size):
    """Strains and times are the same then."""
    usual = strain_gains(STIFFNESS, INERTIA, 2.0, LAG)
    other = strain_gains(size * STIFFNESS, size * INERTIA, size * 2.0, LAG)
    assert [other.gain, other.integral, other.damping] == pytest.approx(
        [size * usual.gain, size * usual.integral, size * usual.damping])


def squared_error(gain, integral, rate, seconds=2.0, dt=2.5e-4):
    """Return the mean over plants of the integral of strain^2 after a load step of 1 N."""
    stiffness = np.repeat([STIFFNESS / SPAN, STIFFNESS, STIFFNESS * SPAN], 3)
    error = np.tile(GAIN_ERRORS, 3)
    drag = 2.0 * 0.01 * np.sqrt(stiffness * INERTIA)
    x = v = whole = filtered = square = np.zeros(9)
    late = [np.zeros(9)] * round(LAG / dt)
    for _ in range(round(seconds / dt)):
        filtered = filtered + dt / RATE_LAG * (v - filtered)
        whole = whole + dt * x
        late.append(-(gain * x + integral * whole + rate * filtered))
        pull = (1.0 + error) * (late.pop(0) + 1.0)
        v = v + dt * (pull - drag * v - stiffness * x) / INERTIA
        x = x + dt * v
        square = square + dt * x * x
    return float(square.mean())


def costs(*gains):
    """Return what the design reckons for controllers (gain, integral, rate)."""
    s = 1j * np.sqrt(STIFFNESS / INERTIA) * np.logspace(-2.7, 1.3, 2000)
    each = STIFFNESS / INERTIA
    plants = _plants(s, (each / SPAN, each, each * SPAN), 0.0) / INERTIA
    control = np.array([gain + integral / s + rate * s / (1.0 + RATE_LAG * s)
                        for gain, integral, rate in gains]) * np.exp(-s * LAG)
    return _costs(s, plants, control)


def test_the_cost_of_gains_is_the_squared_error_after_a_load_step():
    """By Parseval: pi times the integral over time, for any controller that has its margin."""
    best = strain_gains(STIFFNESS, INERTIA, 0.0, LAG)
    gains = [(share * best.gain, part * best.integral, more * best.damping)
             for share, part, more in ((1.0, 1.0, 1.0), (1.0, 0.5, 1.0), (1.0, 0.3, 0.8))]
    found = costs(*gains)
    assert np.isfinite(found).all()
    times = np.array([squared_error(*each) for each in gains])
    assert found / times == pytest.approx(np.pi, rel=0.05)


def test_gains_without_margin_have_no_cost():
    """Unstable ones, ones that are near it, and an integral of the wrong sign."""
    assert np.isinf(costs((0.0, 60e3, 0.0), (3000.0, 1000.0, 0.0), (0.0, -1000.0, 0.0))).all()


def test_the_gains_are_better_than_others_near_by():
    """With each of them a little more or less the cost is higher, or a margin is lost."""
    best = strain_gains(STIFFNESS, INERTIA, 0.0, LAG)
    chosen = np.array([best.gain, best.integral, best.damping])
    assert chosen[1] > 0.0
    least = costs(chosen)[0]
    assert np.isfinite(least)
    for k, step in ((0, 0.12 * STIFFNESS), (1, 0.3 * chosen[1]), (2, 1.0)):
        for sign in (1.0, -1.0):
            other = chosen + sign * step * (np.arange(3) == k)
            assert costs(other)[0] > 0.98 * least


@pytest.mark.parametrize('lag', [0.012, 0.025, 0.04])
@pytest.mark.parametrize(('stiffness', 'inertia'), [
    (300.0, 0.15), (1500.0, 0.15), (8000.0, 0.15), (8000.0, 0.6), (800.0, 2.5), (300.0, 5.0)])
def test_every_loop_keeps_its_distance_from_instability(stiffness, inertia, lag):
    """
    With 1 % damping, with 30 %, and with a mixture of both gains for what is in between.

    On a fine grid, which a narrow resonance does not slip through, however late the loop is.
    """
    s = 1j * np.sqrt(stiffness / inertia) * np.logspace(-2.7, 1.3, 6000)
    little, much = (strain_gains(stiffness, inertia, 2.0 * ratio * np.sqrt(stiffness * inertia),
                                 lag) for ratio in (0.01, DAMPED))
    for ratio in (0.01, 0.05, 0.1, 0.2, DAMPED):
        share = ratio / DAMPED if ratio > 0.01 else 0.0
        gain, integral, rate = (
            getattr(little, name) + share * (getattr(much, name) - getattr(little, name))
            for name in ('gain', 'integral', 'damping'))
        control = (gain + integral / s + rate * s / (1.0 + RATE_LAG * s)) * np.exp(-s * lag)
        for factor in (1.0 / SPAN, 1.0, SPAN):
            k = factor * stiffness
            drag = 2.0 * max(ratio * np.sqrt(stiffness * inertia), 0.01 * np.sqrt(k * inertia))
            for error in GAIN_ERRORS:
                around = 1.0 + control * (1.0 + error) / (inertia * s * s + drag * s + k)
                assert np.abs(around).min() > 0.48
                turned = np.unwrap(np.angle(s * around))
                assert abs(turned[-1] - 0.5 * np.pi) < 0.5 * np.pi


def test_stiffnesses_of_units_are_slopes_of_their_force(bundles):
    """At half and all of the largest pressure those of the model, at none zero."""
    bundle = bundles[3]
    slope, bend = unit_stiffness(bundle)
    for share in (0.5, 1.0):
        pressure = share * bundle.max_pressure
        near, far = (bundle.unit_forces(strain, pressure) for strain in (0.09, 0.11))
        assert slope * pressure + bend * pressure ** 2 == pytest.approx((near - far) / 0.02)


def test_a_muscle_of_small_contraction_is_stiff_at_every_pressure(bundles):
    """Although it is slack at 10 % and half of its pressure."""
    units = [replace(unit, max_pressure=100e3) for unit in bundles[3].motor_units]
    short = Bundle('short', units, bundles[3].effects)
    slope, bend = unit_stiffness(short)
    for share in (0.1, 0.5, 1.0):
        pressure = share * short.max_pressure
        assert np.all(slope * pressure + bend * pressure ** 2 > 0.0)


def test_stiffnesses_for_which_gains_are_worked_out_go_up_in_even_ratios(bundles):
    """From the first unit at a tenth of its pressure to all at theirs, beside the load's own."""
    bundle, load = bundles[3], 30.0
    grid = stiffness_grid(bundle, load)
    slope, bend = unit_stiffness(bundle)
    most, first = bundle.max_pressure, 0.1 * bundle.max_pressure[0]
    assert grid[-1] == pytest.approx(load + np.sum(slope * most + bend * most ** 2))
    assert grid[0] == pytest.approx(load + slope[0] * first + bend[0] * first ** 2)
    ratios = np.array(grid[1:]) / grid[:-1]
    assert np.ptp(ratios) < 1e-9
    assert SPAN < ratios[0] <= SPAN ** 2
    assert len(stiffness_grid(bundle, 1e6)) == 2


@pytest.mark.parametrize('stiffness', [0.3, 26.0, 438.7])
def test_stiffnesses_for_heavy_loads_go_down_to_the_heaviest(stiffness):
    """In steps whose ranges meet, and the same steps wherever they end."""
    below = stiffnesses_between(stiffness / 100.0, stiffness, INERTIA)
    assert below[0] / SPAN ** 2 <= stiffness / 100.0 < below[0]
    assert below[-1] < stiffness <= below[-1] * SPAN ** 2
    assert np.array(below[1:]) / below[:-1] == pytest.approx(SPAN ** 2)
    assert set(below) <= set(stiffnesses_between(1e-3, 1e3, INERTIA))


@pytest.mark.parametrize('lighter', [False, True])
def test_only_an_unknown_load_may_be_heavier_or_lighter_than_is_usual(bundles, lighter):
    """With a known one gains stay those of the stiffnesses; the record has one size."""
    bundle = bundles[3]
    known, unknown = (outer_settings(OuterConfig(), load, bundle)
                      for load in (LoadModel(force=10.0), LoadModel()))
    usual, found = stiffness_grid(bundle, 0.0), np.array(unknown.stiffnesses)
    beyond = found > usual[-1] if lighter else found < usual[0]
    assert beyond.sum() >= 4
    assert known.stiffnesses == unknown.stiffnesses
    assert np.all(np.diff(found) >= 0.0)
    assert len({gain for gain, out in zip(known.strain_integral[0], beyond) if out}) == 1
    assert len({gain for gain, out in zip(unknown.strain_integral[0], beyond) if out}) >= 4


def test_any_load_has_a_hundredth_of_critical_damping():
    """Or its own, where that is more."""
    assert drag_of(400.0, 1.0, 0.0) == pytest.approx(0.4)
    assert drag_of(400.0, 1.0, 3.0) == 3.0
