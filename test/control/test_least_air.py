# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The least air that any allocation could use."""

import numpy as np
import pytest

from fam_bundle_ros.benchmarks.control_metrics import held_air
from fam_bundle_ros.benchmarks.least_air import least_air
from fam_bundle_ros.model.pneumatics import (
    ATMOSPHERE,
    GAS_CONSTANT,
    POLYTROPIC,
    REFERENCE_TEMPERATURE,
)


def test_least_air_of_one_filling_is_the_air_in_the_chambers(paper_bundle):
    """To rise once at a constant strain the least is the tensile pressure sum times volume."""
    time = np.linspace(0.0, 2.0, 200)
    force = np.interp(time, [0.0, 2.0], [0.0, 70.0])
    found = least_air(paper_bundle, time, force, np.full(200, 0.16))
    at = np.array([0.0, 100e3])
    low, high = paper_bundle.unit_forces(0.16, np.stack([at, at + 100e3], axis=-1))[1]
    slope = (high - low) / 100e3
    pressure_sum = (70.0 - 2.0 * (low - slope * 100e3)) / slope
    volume = float(paper_bundle.gas_volume(0.16)[0]) + 5e-6
    expected = pressure_sum * volume / (POLYTROPIC * GAS_CONSTANT * REFERENCE_TEMPERATURE)
    assert found == pytest.approx(expected, rel=0.01)


def test_no_run_needs_less_than_the_least_air(paper_bundle):
    """Two ways to the same forces, slow and at a constant strain: both draw at least the bound."""
    rng = np.random.default_rng(5)
    time = np.linspace(0.0, 8.0, 1601)
    second = np.interp(time, np.linspace(0.0, 8.0, 6), rng.uniform(80e3, 200e3, 6))
    first = np.interp(time, np.linspace(0.0, 8.0, 6), rng.uniform(200e3, 340e3, 6))
    pressure = np.stack([first, second], axis=-1)
    force = paper_bundle.force(np.full(1601, 0.14), pressure)
    volume = float(paper_bundle.gas_volume(0.14)[0]) + 5e-6
    drawn = held_air(paper_bundle, pressure[0], 0.14, 5e-6) + np.maximum(
        np.diff(pressure, axis=0), 0.0).sum() * volume / (
            POLYTROPIC * GAS_CONSTANT * REFERENCE_TEMPERATURE)
    least = least_air(paper_bundle, time, force, np.full(1601, 0.14))
    assert 0.5 * drawn < least <= drawn


def moving(bundle, pressure, low=0.05, high=0.2):
    """Return time, forces and rising strains of a bundle that keeps its pressures (n,)."""
    time = np.linspace(0.0, 3.0, 301)
    strain = np.interp(time, [0.0, 3.0], [low, high])
    return time, bundle.force(strain, np.tile(pressure, (301, 1))), strain


def test_vented_units_draw_no_air_however_they_move(paper_bundle):
    """Open exhausts breathe ambient air, which nobody has to compress."""
    assert least_air(paper_bundle, *moving(paper_bundle, [0.0, 0.0])) == pytest.approx(
        0.0, abs=1e-9)


def test_units_that_widen_at_full_pressure_draw_what_fills_them(paper_bundle):
    """At the largest force there is no choice: the filling, and then p dV/(R T)."""
    full = paper_bundle.max_pressure
    time, force, strain = moving(paper_bundle, full)
    volume = paper_bundle.gas_volume(strain)
    widened = (full + ATMOSPHERE) @ (volume[-1] - volume[0]) / (
        GAS_CONSTANT * REFERENCE_TEMPERATURE)
    assert widened > 0.2 * held_air(paper_bundle, full, strain[0], 5e-6)
    assert least_air(paper_bundle, time, force, strain) == pytest.approx(
        held_air(paper_bundle, full, strain[0], 5e-6) + widened, rel=0.02)


def test_a_force_out_of_reach_takes_the_nearest(paper_bundle):
    """More than the bundle has costs what its largest force costs."""
    time, full = np.linspace(0.0, 1.0, 101), paper_bundle.max_pressure
    assert least_air(paper_bundle, time, np.full(101, 1e4), np.full(101, 0.1)) == pytest.approx(
        held_air(paper_bundle, full, 0.1, 5e-6), rel=1e-6)


def test_a_force_below_that_at_rest_is_had_on_the_falling_branch(paper_bundle):
    """A little air makes a muscle push back; the little is found, not the more beyond the dip."""
    time, strain = np.linspace(0.0, 1.0, 101), 0.2
    grid = np.linspace(0.0, 120e3, 601)
    first, second = np.meshgrid(grid, grid, indexing='ij')
    force = paper_bundle.force(strain, np.stack([first, second], axis=-1))
    wanted = float(force[0, 0]) - 1.0
    cheapest = (first + second)[np.abs(force - wanted) < 0.02].min()
    air = held_air(paper_bundle, np.array([cheapest, 0.0]), strain, 5e-6)
    assert least_air(paper_bundle, time, np.full(101, wanted),
                     np.full(101, strain)) == pytest.approx(air, rel=0.03)
