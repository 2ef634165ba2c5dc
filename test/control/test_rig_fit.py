# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What pressures tell of a valve, without ROS."""

import numpy as np
import pytest

from fam_bundle_ros.control.rig_fit import (
    apart_words,
    bands_apart_words,
    fit_valve,
    split_volume,
)
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.pneumatics import (
    POLYTROPIC,
    pressure_rate,
    valve_flow,
    valve_opening,
    ValveFlow,
)

PERIOD, SUPPLY, AMBIENT, VOLUME = 5e-3, 100e3, 101325.0, 19e-6


def record(valve, delay, noise=350.0, fine=10, swell=0.0):
    """Return stamps, pressures and commands of strokes; ``swell`` in m^3/Pa of the chamber."""
    rng = np.random.default_rng(1)
    commands = np.concatenate([np.r_[np.full(n, side * (valve.dead_band + beyond)), np.zeros(10)]
                               for beyond in (0.03, 0.06, 0.1, 0.2)
                               for side, n in ((1.0, 12), (-1.0, 9))])
    pressure, shown = AMBIENT, []
    for k in range(len(commands) * fine):
        if k % fine == 0:
            shown.append(pressure - AMBIENT)
        time = k * PERIOD / fine - delay
        command = commands[int(time / PERIOD)] if time >= 0.0 else 0.0
        flow = valve_flow(valve, valve_opening(valve, command), pressure, SUPPLY + AMBIENT,
                          AMBIENT)
        taken = VOLUME + swell * (pressure - AMBIENT + POLYTROPIC * pressure)
        pressure += PERIOD / fine * pressure_rate(pressure, taken, 0.0, flow)
    return (PERIOD * np.arange(len(commands)), shown + noise * rng.standard_normal(len(commands)),
            commands)


@pytest.mark.parametrize(('conductance', 'band', 'delay'), [
    (3.93e-9, 0.04, 0.0), (1.5e-9, 0.12, 0.017), (6e-9, 0.0, 0.006)])
def test_a_valve_is_found_from_its_strokes(conductance, band, delay):
    """Conductance to 5 %, dead band to 0.01, dead time to 2 ms, below the noise of the gauge."""
    fit = fit_valve(*record(ValveFlow(conductance, 0.3, band), delay), VOLUME, SUPPLY)
    assert fit.conductance == pytest.approx(conductance, rel=0.05)
    assert fit.dead_band == pytest.approx(band, abs=0.01)
    assert fit.delay == pytest.approx(delay, abs=2e-3)
    assert fit.misfit < 2.0 * 350.0


def test_a_muscle_that_shortens_as_it_fills_does_not_falsify_its_valve():
    """On a spring: without the motion, a third of the flow would be missing."""
    swell = 0.25 * VOLUME / SUPPLY
    time, pressure, command = record(ValveFlow(3e-9, 0.3, 0.05), 0.0, noise=0.0, swell=swell)
    fit = fit_valve(time, pressure, command, VOLUME + swell * pressure, SUPPLY)
    assert fit.conductance == pytest.approx(3e-9, rel=0.03)
    still = fit_valve(time, pressure, command, VOLUME, SUPPLY)
    assert still.conductance < 0.75 * 3e-9


@pytest.mark.parametrize('band', [0.063, 0.067])
def test_a_dead_band_between_the_places_tried_first_is_found_on_either_side(band):
    """They are 0.01 apart; without noise the fit is finer."""
    fit = fit_valve(*record(ValveFlow(3e-9, 0.3, band), 0.008, noise=0.0), VOLUME, SUPPLY)
    assert fit.dead_band == pytest.approx(band, abs=1e-3)
    assert fit.misfit < 30.0


def test_a_valve_that_moves_nothing_is_refused():
    """A pressure that does not follow the commands has no conductance."""
    time, _, command = record(ValveFlow(), 0.0)
    with pytest.raises(InputError, match='no command moves the pressure'):
        fit_valve(time, -1e3 * np.cumsum(command), command, VOLUME, SUPPLY)
    with pytest.raises(InputError, match='5 samples'):
        fit_valve(time[:5], time[:5], command[:5], VOLUME, SUPPLY)


def test_muscles_of_different_size_tell_the_tube():
    """C/(V + T) of two sizes gives both; of one size it does not."""
    gas, tube, told = np.array([9e-6, 30e-6]), 7e-6, 4e-6
    fitted = 3e-9 * (gas + told) / (gas + tube)
    conductance, found = split_volume(fitted, gas, told)
    assert (conductance, found) == (pytest.approx(3e-9), pytest.approx(tube))
    assert split_volume(fitted, [14e-6, 14e-6], told) is None


def test_valves_that_differ_by_more_than_a_controller_tolerates_are_told():
    """One conductance is given to all loops; 30 % off is what they learn."""
    assert apart_words([3.9e-9, 4.3e-9, 3.0e-9], ['mu1', 'mu2', 'mu3']) == ''
    told = apart_words([3.94e-9, 1.26e-9], ['mu1', 'mu2'])
    assert 'mu1 3.94e-09, mu2 1.26e-09' in told
    assert 'within 30 %' in told


def test_dead_bands_that_differ_by_more_than_a_controller_tolerates_are_told():
    """A mean of 0.17 is wrong for both."""
    assert bands_apart_words([0.04, 0.07, 0.05], ['mu1', 'mu2', 'mu3']) == ''
    told = bands_apart_words([0.3, 0.045], ['mu1', 'mu2'])
    assert 'mu1 0.300, mu2 0.045' in told
    assert 'within 0.106 of their mean of 0.172' in told
