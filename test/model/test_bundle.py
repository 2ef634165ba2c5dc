# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Motor units in parallel: onset pressure, overlap, other sizes and counts."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, catalogue, MotorUnit
from fam_bundle_ros.model.laws.bladder import bladder_elasticity
from fam_bundle_ros.model.laws.mesh import mesh
from fam_bundle_ros.model.parts import SensorError

from .conftest import PAPER, units


def test_forces_of_motor_units_add(paper_bundle):
    """The bundle's force is the sum over units, each as if it were alone."""
    alone = Bundle('one', units(1), paper_bundle.effects)
    together = paper_bundle.force(0.15, [3e5, 1e5])
    assert_allclose(together, alone.force(0.15, [3e5]) + alone.force(0.15, [1e5]))


def test_a_unit_of_three_muscles_pulls_three_times_as_much(muscle):
    """Count scales force and gas volume alike."""
    three = Bundle('three', [replace(muscle.motor_units[0], muscles=3)], muscle.effects)
    assert_allclose(three.force(0.1, [2e5]), 3 * muscle.force(0.1, [2e5]))
    assert_allclose(three.gas_volume(0.1), 3 * muscle.gas_volume(0.1))


def test_onset_pressure_is_where_the_dip_is_made_good(paper_bundle):
    """At the onset pressure MU2 gives what it gave when off; below it less, above it more."""
    overlap = paper_bundle.overlap(0.2, 1)
    force = paper_bundle.force(0.2, paper_bundle.state_pressures(
        2, np.array([0.0, overlap.dip_pressure, overlap.onset_pressure])))
    assert_allclose(force[2], force[0], atol=1e-6)
    assert_allclose(force[0] - force[1], overlap.dip)
    assert overlap.dip > 5.0
    assert 0.0 < overlap.dip_pressure < overlap.onset_pressure < 344.7e3


def test_no_dip_before_the_free_strain(paper_bundle):
    """A muscle that is not compressed helps from the first kilopascal."""
    overlap = paper_bundle.overlap(0.0, 1)
    assert overlap.dip == 0.0
    assert overlap.onset_pressure == 0.0
    assert_allclose(overlap.high, 163.4, atol=0.05)


def test_a_unit_that_never_helps_has_no_onset(paper_bundle):
    """Past the free strain of its highest pressure a unit only pushes back."""
    assert np.isnan(paper_bundle.onset_pressure(0.25, 2))
    onset = paper_bundle.onset_pressure(0.2, 2)
    just, not_quite = (Bundle('two', units(2, share * onset), paper_bundle.effects)
                       for share in (1.001, 0.999))
    assert_allclose(just.onset_pressure(0.2, 2), onset, rtol=1e-6)
    assert np.isnan(not_quite.onset_pressure(0.2, 2))


@given(st.floats(0.02, 0.22), st.floats(0.0, 1.0), st.sampled_from([
    (344.7e3, 344.7e3), (250e3, 400e3), (400e3, 250e3), (40e3, 344.7e3), (344.7e3, 40e3)]))
def test_both_states_reach_every_force_of_the_overlap(strain, where, highest):
    """One force and strain, two ways to make it, each within the limits of its unit."""
    bundle = Bundle('two', [replace(unit, max_pressure=limit)
                            for unit, limit in zip(units(2), highest, strict=True)],
                    [mesh(), bladder_elasticity()]).with_effect('resistive_buckling')
    overlap = bundle.overlap(strain, 1)
    demand = overlap.low + where * overlap.width
    for state in (1, 2):
        last = np.linspace(0.0, highest[state - 1], 4001)
        force = bundle.force(strain, bundle.state_pressures(state, last))
        assert np.min(np.abs(force - demand)) < 0.15


def test_new_sizes_keep_the_ratio_of_the_units():
    """A refitted radius is that of the first unit; the second one scales with it."""
    big = replace(PAPER, radius=2 * PAPER.radius, wall_thickness=2 * PAPER.wall_thickness)
    bundle = Bundle('mixed', [MotorUnit('a', 1, PAPER), MotorUnit('b', 1, big)], [mesh()])
    other = bundle.with_parameters({'geometry.radius': 6.0e-3})
    assert_allclose(other.geometry.radius, [6.0e-3, 12.0e-3])
    with pytest.raises(InputError, match="geometry has no dimension 'diameter'"):
        bundle.with_parameters({'geometry.diameter': 1.0})


def test_an_added_effect_leaves_the_model_it_was_added_to_alone(muscle):
    """Models are values: with_effect gives a new one."""
    other = muscle.with_effect('coulomb_friction', force=4.0)
    assert [e.name for e in muscle.effects] == ['mesh', 'bladder_elasticity']
    assert other.effect('coulomb_friction').force == 4.0
    assert other.without_effect('coulomb_friction').force(0.1, [2e5]) == muscle.force(0.1, [2e5])
    again = other.with_effect('coulomb_friction', force=7.0)
    assert [e.name for e in again.effects] == [e.name for e in other.effects]
    assert again.effect('coulomb_friction').force == 7.0


def test_under_another_name_a_model_is_the_same(muscle):
    """Error and notes stay unless others are given."""
    first = muscle.named('first', 1.5, {'by': 'me'})
    assert (first.name, first.error, first.notes) == ('first', 1.5, {'by': 'me'})
    second = first.named('second')
    assert (second.name, second.error, second.notes) == ('second', 1.5, {'by': 'me'})
    assert second.force(0.1, [2e5]) == muscle.force(0.1, [2e5])


def test_without_sensor_effects_readings_are_the_truth(paper_bundle):
    """At any time and rate, and back."""
    shown = paper_bundle.readings(90.0, 0.2, np.array([1e5, 0.0]), 30.0, 0.5)
    assert_allclose(np.hstack(shown), [90.0, 0.2, 1e5, 0.0], rtol=0.0)
    assert_allclose(np.hstack(paper_bundle.felt(*shown[1:], 30.0, 0.5)), [0.2, 1e5, 0.0], rtol=0.0)


def test_a_pressure_for_another_number_of_units_is_refused(paper_bundle):
    """Nothing is broadcast silently."""
    with pytest.raises(InputError, match=r'shape \(3,\); expected 2 motor units'):
        paper_bundle.force(0.1, [1e5, 1e5, 1e5])
    with pytest.raises(InputError, match=r'expected 2 motor units'):
        paper_bundle.step(paper_bundle.start_state(), 0.01, 0.1, [1e5])


def test_names_must_differ(muscle):
    """Two effects of one name would overwrite each other."""
    with pytest.raises(InputError, match='effect mesh is named twice'):
        Bundle('double', muscle.motor_units, [mesh(), mesh()])


def test_muscles_in_parallel_have_one_rest_length(muscle):
    """Units of 127 and 200 mm have no common strain: refused, with both lengths."""
    unit = muscle.motor_units[0]
    longer = replace(unit, name='mu2', geometry=replace(unit.geometry, length=0.2))
    with pytest.raises(InputError, match='from 127.0 to 200.0 mm'):
        Bundle('two', [unit, longer], muscle.effects)


@pytest.mark.parametrize(('sizes', 'odd'), [
    ((4.0, 5.0, 6.0), ''), ((6.0, 4.0, 5.0), 'mu1 is larger than mu2'),
    ((4.0, 6.0, 5.0), 'mu2 is larger than mu3'), ((5.0, 5.0, 4.99), '')])
def test_a_larger_unit_before_a_smaller_one_is_told_of(sizes, odd):
    """By the section of all its muscles; a hundredth is no difference."""
    bundle = Bundle('three', [MotorUnit(f'mu{k + 1}', 1, replace(PAPER, radius=1e-3 * size))
                              for k, size in enumerate(sizes)], [mesh()])
    assert bundle.unusual_order.startswith(odd)
    assert bool(bundle.unusual_order) == bool(odd)
    many = Bundle('two', [MotorUnit('a', 3, PAPER), MotorUnit('b', 2, PAPER)], [mesh()])
    assert many.unusual_order.startswith('a is larger than b')
    wide = replace(PAPER, radius=2.0 * PAPER.radius)  # four times the section
    assert not Bundle('two', [MotorUnit('a', 1, wide), MotorUnit('b', 5, PAPER)],
                      [mesh()]).unusual_order


def test_what_is_felt_is_what_gauges_show_without_their_errors(paper_bundle):
    """Bias, gain and drift of each gauge, and the lag of the strain; force by its own formula."""
    bundle = Bundle('gauges', paper_bundle.motor_units, paper_bundle.effects)
    bundle.sensor_error = SensorError(2.0, 0.1, -0.3, 4e3, -0.05, 70.0, 0.01, 0.2, 1e-3, 0.02)
    force, strain = np.array([5.0, 90.0]), np.array([0.02, 0.2])
    pressure, time, rate = np.array([[1e5, 0.0], [3e5, 2e5]]), np.array([7.0, 30.0]), 0.05
    shown = bundle.readings(force, strain, pressure, time, rate)
    assert_allclose(shown[0], 1.1 * force + 2.0 - 0.3 * time)
    assert_allclose(shown[1], 1.2 * strain + 0.01 + 1e-3 * time - 0.02 * rate)
    assert_allclose(shown[2], 0.95 * pressure + 4e3 + 70.0 * time[:, None])
    felt = bundle.felt(*shown[1:], time, rate)
    assert_allclose(felt[0], strain)
    assert_allclose(felt[1], pressure, atol=1e-9)


def test_a_bundle_without_motor_units_or_a_state_that_it_has_not_is_refused(paper_bundle):
    """What there is, and what was asked for."""
    with pytest.raises(InputError, match='none: a bundle needs at least one motor unit'):
        Bundle('none', [], paper_bundle.effects)
    for state in (0, 2):
        with pytest.raises(InputError, match=f'a recruitment state from 1 to 1, not {state}'):
            paper_bundle.overlap(0.2, state)


def test_an_effect_file_that_is_not_there_is_named(tmp_path):
    """Before anything is run."""
    with pytest.raises(InputError, match=r'mine\.py: is not a Python file'):
        list(catalogue.from_python_file(tmp_path / 'mine.py'))
