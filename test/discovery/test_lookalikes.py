# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What one effect imitates of another is told where the data cannot tell them apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.cells import reduce
from fam_bundle_ros.discovery.covariance import Covariance
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.lookalikes import (
    alike_at_one_pace,
    alike_at_one_rate,
    late_force,
    late_or_lagging,
)
from fam_bundle_ros.discovery.options import Change, Options
from fam_bundle_ros.discovery.priors import Prior
from fam_bundle_ros.discovery.settings import Choices


@pytest.mark.parametrize(('rates', 'alike'), [((1.0, 1.0), True), ((1.0, 4.0), False)])
def test_memory_found_at_one_rate_of_the_pressure_is_doubtful(paper_muscle, rates, alike):
    """Filled and vented at fixed lengths; a second rate tells lag, creep and friction apart."""
    ways = [np.concatenate([np.linspace(0.0, 4e5, int(100 / rate)),
                            np.linspace(4e5, 0.0, int(100 / rate))]) for rate in rates] * 3
    pressure, trial = np.concatenate(ways), np.repeat(np.arange(6), [len(way) for way in ways])
    strain, time = 0.02 * (trial // 2), 0.1 * np.arange(len(trial))
    force = 1e-4 * pressure + np.random.default_rng(0).normal(0.0, 0.3, len(trial))
    cells = reduce(paper_muscle, build('fill', strain, pressure, force, trial, time))
    said = alike_at_one_rate(cells, [Change('', 'pressure_creep'), Change('', 'end_caps')])
    assert bool(said) == alike
    assert not alike or 'changes at 40.4 kPa/s only' in said[0]
    assert not alike or '(pressure_creep)' in said[0]
    assert not alike_at_one_rate(cells, [Change('', 'end_caps')])


def test_a_valve_that_is_opened_wide_is_another_rate_though_it_takes_few_rows(paper_muscle):
    """A fifth of the way of the pressure in a fiftieth of the time."""
    ramp, step = np.linspace(0.0, 3e5, 400), np.linspace(0.0, 3e5, 8)
    pressure = np.tile(np.concatenate([ramp, ramp[::-1], step, step[::-1]]), 4)
    trial = np.repeat(np.arange(4), len(pressure) // 4)
    force = 1e-4 * pressure + np.random.default_rng(0).normal(0.0, 0.3, len(trial))
    cells = reduce(paper_muscle, build('steps', 0.02 * trial, pressure, force, trial,
                                       0.02 * np.arange(len(trial))))
    assert not alike_at_one_rate(cells, [Change('', 'pressure_creep')])


@pytest.mark.parametrize(('late', 'line', 'told'), [
    (0.02, 0.0, True), (0.02, 0.04, False), (0.0, 0.02, False)])
def test_a_force_that_is_logged_late_is_no_lag_of_the_line(paper_muscle, late, line, told):
    """It lags behind the strain as behind the pressure; a line is behind the pressure alone."""
    time = np.arange(0.0, 20.0, 0.01)

    def force_at(now):
        pressure = 200e3 + 150e3 * np.sin(2.0 * (now - line))
        return paper_muscle.force(0.09 + 0.08 * np.sin(3.1 * now), pressure[:, None])

    noise = np.random.default_rng(3).normal(0.0, 0.2, len(time))
    data = build('log', 0.09 + 0.08 * np.sin(3.1 * time),
                 (200e3 + 150e3 * np.sin(2.0 * time))[:, None], force_at(time - late) + noise,
                 time=time)
    cells = reduce(paper_muscle, data)
    options = Options.of(paper_muscle, cells, Choices())
    found = [Change('', 'pressure_line_lag'), Change('', 'strain_sensor_lag')]
    names = tuple(sorted((*options.own, *(change.new for change in found))))
    fitter = Fitter(Covariance(cells, 0.01))
    physics = fitter.without_discrepancy(
        fitter.fit(names, options.bundle(names), options.priors(names)))
    said = late_force(physics, found)
    assert bool(said) == told
    assert not told or 'behind the strain by 20 ms and behind the pressure by 20 ms' in said[0]
    assert not late_force(physics, found[:1])


@pytest.mark.parametrize(('strain', 'told'), [(-1e-3, True), (1e-3, False)])
def test_a_strain_that_lags_behind_the_force_is_no_late_force(strain, told):
    """However uncertain both lags are."""
    lags = {'strain_sensor_lag.lag': strain, 'pressure_line_lag.time_constant': 1e-3}
    priors = tuple(Prior(key, -1.0, 1.0, 0.0, 1.0, 'normal') for key in lags)
    physics = SimpleNamespace(priors=priors, u=np.array(list(lags.values())),
                              covariance=np.diag([2e-3, 2e-3]) ** 2)
    found = [Change('', key.partition('.')[0]) for key in lags]
    assert bool(late_force(physics, found)) == told


@pytest.mark.parametrize('held', [True, False])
def test_at_a_fixed_length_a_lag_of_the_line_may_be_that_of_the_force(paper_muscle, held):
    """Where the strain rests, only the pressure has something to be behind of."""
    time = np.arange(0.0, 20.0, 0.02)
    strain = 0.05 + 0.0 * time if held else 0.05 + 0.04 * np.sin(time)
    pressure = 200e3 + 150e3 * np.sin(2.0 * time)
    data = build('log', strain, pressure[:, None],
                 paper_muscle.force(strain, (pressure - 6e3 * np.cos(2.0 * time))[:, None]),
                 time=time)
    cells, found = reduce(paper_muscle, data), [Change('', 'pressure_line_lag')]
    options, fitter = Options.of(paper_muscle, cells, Choices()), Fitter(Covariance(cells, 0.01))
    names = found[0].done(options.own)
    physics = fitter.without_discrepancy(
        fitter.fit(names, options.bundle(names), options.priors(names)))
    said = late_or_lagging(cells, physics, found)
    assert bool(said) == held
    assert not held or 'pressure_line_lag (20 ms) looks the same as a force that is logged' in (
        said[0])
    assert not late_or_lagging(cells, physics, [])


@pytest.mark.parametrize(('pause', 'alike'), [(2.0, True), (120.0, False)])
def test_warming_up_and_softening_are_told_apart_by_a_pause(paper_muscle, pause, alike):
    """In a pause the muscle warms up or cools down, and travels nowhere."""
    time, cycles = np.arange(0.0, 20.0, 0.05), 4
    strain = np.tile(0.08 - 0.08 * np.cos(2.0 * np.pi * time / 10.0), cycles)
    clock = np.concatenate([time + k * 20.0 + (k > 1) * pause for k in range(cycles)])
    pressure = np.full((len(strain), 1), 200e3)
    force = paper_muscle.force(strain, pressure)
    cells = reduce(paper_muscle, build('cycles', strain, pressure, force, time=clock))
    found = [Change('', 'softening_gradual'), Change('', 'temperature')]
    said = alike_at_one_pace(cells, found)
    assert bool(said) == alike
    assert not alike or '(softening_gradual, temperature)' in said[0]
    assert not alike_at_one_pace(cells, found[:1])
