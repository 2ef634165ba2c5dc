# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The valve, one chamber, and the closed forms that the controller uses."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import mass_flow, RT
from fam_bundle_ros.plant import (
    ChamberConfig,
    fastest_fall,
    fastest_rise,
    linearise,
    ValveConfig,
)
from fam_bundle_ros.plant.circuit import spool_step

AMBIENT = 101325.0
C, B = 3.93e-9, 0.3


@pytest.mark.parametrize('ratio', [0.01, 0.15, 0.3])
def test_choked_flow_knows_no_downstream_pressure(ratio):
    """At or below the critical ratio the mass flow is C p1 rho0."""
    assert mass_flow(C, B, 6e5, ratio * 6e5) == pytest.approx(C * 6e5 * 1.185, rel=1e-12)


def test_flow_falls_continuously_to_zero_at_equal_pressures():
    """Above the critical ratio the flow falls without a jump, linearly at the end."""
    ratios = np.linspace(0.3, 1.0, 20001)
    flow = np.array([mass_flow(C, B, 6e5, r * 6e5) for r in ratios])
    assert np.all(np.diff(flow) <= 0.0)
    assert np.max(-np.diff(flow)) < 0.005 * flow[0]
    assert flow[-1] == 0.0
    assert flow[-6] == pytest.approx(5.0 * flow[-2], rel=1e-6)


def test_flow_runs_back_when_the_pressures_are_swapped():
    """Mass flow is odd in the direction."""
    assert mass_flow(C, B, 2e5, 5e5) == -mass_flow(C, B, 5e5, 2e5)


def test_warm_air_flows_less():
    """The mass flow goes with one over the square root of the upstream temperature."""
    assert mass_flow(C, B, 6e5, 5e5, temperature=4.0 * 293.15) == pytest.approx(
        0.5 * mass_flow(C, B, 6e5, 5e5))


@pytest.mark.parametrize('name', ['inflow_exponent', 'outflow_exponent', 'volume_exponent'])
@pytest.mark.parametrize(('value', 'possible'), [
    (0.99, False), (1.0, True), (1.4, True), (1.41, False)])
def test_air_is_compressed_between_slowly_and_quickly(name, value, possible):
    """Isothermal with the exponent 1, adiabatic with 1.4; no chamber is beyond."""
    if possible:
        assert getattr(ChamberConfig(**{name: value}), name) == value
    else:
        with pytest.raises(InputError, match=f'{name} is {value}; .* at least 1, at most 1.4'):
            ChamberConfig(**{name: value})


def test_valve_is_closed_within_its_dead_band():
    """No flow below the dead band, full flow at full command, and the map can be inverted."""
    valve = ValveConfig(dead_band=0.05)
    assert valve.flow(valve.opening(0.049), 2e5, 6e5) == 0.0
    assert valve.flow(valve.opening(1.0), 1.5e5, 6e5) == pytest.approx(C * 6e5 * 1.185)
    # half open to the ambient: choked by its own pressure, whatever the supply
    assert valve.flow(-0.5, 6e5, 7e5) == pytest.approx(-0.5 * C * 6e5 * 1.185)
    for opening in (-1.0, -0.37, 0.0, 0.02, 1.0):
        assert valve.opening(valve.command(opening)) == pytest.approx(opening)
    assert valve.command(0.0) == 0.0
    assert (valve.opening(1.2), valve.opening(-1.2)) == (1.0, -1.0)
    assert (valve.command(1.2), valve.command(-1.2)) == (1.0, -1.0)


@pytest.mark.parametrize('damping', [0.4, 0.7, 0.95])
def test_spool_follows_at_minus_3_db_at_its_bandwidth(damping):
    """A sine at the bandwidth comes out with 1/sqrt(2) of its size."""
    valve = ValveConfig(bandwidth=125.0, damping=damping)
    dt = 1e-5
    a, b, c, d = spool_step(valve.natural_frequency, damping, dt)
    position, rate, peak = 0.0, 0.0, 0.0
    for k in range(20000):
        command = math.sin(2.0 * math.pi * 125.0 * (k + 0.5) * dt)
        error = position - command
        position, rate = command + a * error + b * rate, c * error + d * rate
        if k > 15000:
            peak = max(peak, abs(position))
    assert peak == pytest.approx(math.sqrt(0.5), rel=2e-3)


def _time_to(end, start, volume, exponent, flow):
    """Return when an accurate integration of the chamber crosses ``end`` (absolute, Pa)."""
    def crossing(t, p):
        return p[0] - end
    crossing.terminal = True
    solution = solve_ivp(lambda t, p: [exponent * RT * flow(p[0]) / volume], (0.0, 5.0), [start],
                         events=crossing, rtol=1e-10, atol=1e-3, max_step=1e-3)
    return solution.t_events[0][0]


@pytest.mark.parametrize('exponent', [1.0, 1.2])
@pytest.mark.parametrize(('start', 'end'), [(0.0, 50e3), (0.0, 300e3), (250e3, 480e3),
                                        (499.6e3, 499.9e3), (0.0, 499.9e3)])
def test_fill_time_in_closed_form_is_that_of_the_differential_equation(start, end, exponent):
    """Choked line, arc sine and logarithm together give the time of the integrated chamber."""
    supply, volume = 500e3 + AMBIENT, 12e-6
    expected = _time_to(end + AMBIENT, start + AMBIENT, volume, exponent,
                        lambda p: mass_flow(C, B, supply, p))
    assert fastest_rise(start, end, volume, 500e3, exponent=exponent) == pytest.approx(
        expected, rel=1e-5)


def test_isothermal_filling_takes_longer_in_proportion_to_the_exponent():
    """Without the heat of compression the same air gives less pressure rate."""
    slow = fastest_rise(0.0, 300e3, 12e-6, 500e3, exponent=1.0)
    assert slow == pytest.approx(1.2 * fastest_rise(0.0, 300e3, 12e-6, 500e3), rel=1e-12)


@pytest.mark.parametrize(('start', 'end'), [(400e3, 250e3), (400e3, 5e3), (10e3, 20.0)])
def test_vent_time_is_that_of_the_differential_equation(start, end):
    """The vent time agrees with the integrated chamber, choked or not."""
    expected = _time_to(end + AMBIENT, start + AMBIENT, 12e-6, 1.2,
                        lambda p: -mass_flow(C, B, p, AMBIENT))
    assert fastest_fall(start, end, 12e-6) == pytest.approx(expected, rel=1e-3)


def test_unreachable_pressures_take_for_ever_and_reached_ones_no_time():
    """Filling to the supply or venting to ambient never ends; going the wrong way is done."""
    assert math.isinf(fastest_rise(0.0, 500e3, 12e-6, 500e3))
    assert math.isinf(fastest_fall(100e3, 0.0, 12e-6))
    assert fastest_rise(2e5, 1e5, 12e-6, 500e3) == fastest_fall(1e5, 2e5, 12e-6) == 0.0


def test_chamber_is_an_integrator_when_choked_and_a_lag_when_not():
    """The time constant is infinite while the flow is choked, and finite above."""
    choked = linearise(50e3, 15e-6, 600e3)
    assert choked.fill_gain == pytest.approx(1.2 * RT * C * (600e3 + AMBIENT) * 1.185 / 15e-6)
    assert math.isinf(choked.fill_time_constant)
    assert linearise(400e3, 15e-6, 500e3).fill_time_constant < 0.1


def test_linearised_lag_predicts_how_a_small_disturbance_decays():
    """Two fills that differ by 100 Pa approach each other with the stated time constant."""
    point = linearise(450e3, 15e-6, 500e3, opening=0.3)
    supply = 500e3 + AMBIENT

    def rate(p):
        return 1.2 * RT / 15e-6 * 0.3 * mass_flow(C, B, supply, p)

    p, q, dt = 450e3 + AMBIENT, 450.1e3 + AMBIENT, 1e-6
    for _ in range(20):
        p, q = p + dt * rate(p), q + dt * rate(q)
    decay = math.log((q - p) / 100.0) / (20 * dt)
    assert -1.0 / decay == pytest.approx(point.fill_time_constant, rel=0.01)


@pytest.mark.parametrize(('values', 'word'), [
    ({'bandwidth': 0.0}, 'bandwidth'), ({'conductance': -1.0}, 'conductance'),
    ({'dead_band': math.nan}, 'dead_band'), ({'damping': 1.0}, 'damping')])
def test_impossible_valve_fails(values, word):
    """A valve that cannot be is refused with the name of what is wrong."""
    with pytest.raises(InputError, match=word):
        ValveConfig(**values)
