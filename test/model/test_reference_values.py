# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Numbers worked out by hand or taken from the literature that the model must meet.

The tables are those of the project's physics notes for the rig of Kim, Mazzoleni and Bryant
(SPIE 11586, 2021): r0 6.35 mm, L0 127 mm, a0 33 deg, t 1.59 mm; latex of Klute and Hannaford.
"""

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.model import Bundle, Geometry, MotorUnit
from fam_bundle_ros.model.laws.bladder import bladder_elasticity, bladder_thick
from fam_bundle_ros.model.laws.mesh import mesh

from .conftest import PAPER, units

PRESSURES = np.array([68.95, 137.9, 206.8, 275.8, 344.7, 413.7])[:, None] * 1e3


def test_volumes_of_the_papers_muscle():
    """The bladder takes 7.0480 mL of the 16.09 mL inside the braid."""
    wall = PAPER.wall_area * PAPER.length
    assert_allclose(wall, 7.0480e-6, rtol=1e-5)
    tube = Bundle('tube', units(1), [mesh()])
    assert_allclose(tube.gas_volume(0.0) + wall, 16.09e-6, atol=5e-9)


def test_ideal_free_strain():
    """The ideal muscle shortens by 1 - 1/(sqrt 3 cos a0) at any pressure."""
    ideal = Bundle('ideal', units(1), [mesh()])
    assert_allclose(ideal.free_strain(PRESSURES), 0.31159, atol=5e-6)


def test_blocked_force(muscle):
    """At zero strain the bladder is at rest and the braid pulls 0.474 N per kPa."""
    assert_allclose(muscle.blocked_force(PRESSURES),
                    [32.7, 65.4, 98.0, 130.7, 163.4, 196.1], atol=0.05)


def test_free_strain_with_bladder_grows_with_pressure(muscle):
    """The bladder takes free strain away, most at low pressure."""
    assert_allclose(muscle.free_strain(PRESSURES),
                    [.0979, .1669, .2019, .2227, .2365, .2465], atol=5e-5)


@pytest.mark.parametrize(('strain', 'forces'), [
    (0.10, [-0.5, 20.4, 41.3, 62.2, 83.0, 103.9]),
    (0.20, [-19.9, -9.6, 0.7, 11.1, 21.4, 31.7])])
def test_force_of_mesh_and_bladder(muscle, strain, forces):
    """Force over pressure at 10 and 20 % strain."""
    assert_allclose(muscle.force(strain, PRESSURES), forces, atol=0.05)


def test_bladder_force_alone():
    """The tube pushes back 14.31, 21.35, 30.21 N at 5, 10, 20 % strain."""
    tube = Bundle('tube', units(1), [bladder_elasticity()])
    assert_allclose(tube.force(np.array([.05, .10, .20]), [0.0]), [-14.31, -21.35, -30.21],
                    atol=5e-3)


def test_rubber_is_at_rest_at_zero_strain():
    """No bladder of the family pushes or pulls at its rest length."""
    for name in ('bladder_elasticity', 'bladder_linear', 'bladder_ogden', 'bladder_polynomial',
                 'bladder_thick'):
        tube = Bundle('tube', units(1), [mesh()]).with_effect(name)
        assert_allclose(tube.force(0.0, [0.0]), 0.0, atol=1e-9)


def test_a_linear_tube_is_a_spring_at_every_pressure():
    """One newton per strain and newton of stiffness, in both directions."""
    tube = Bundle('tube', units(1), [mesh()])
    strain, pressure = np.array([[-0.02], [0.1], [0.3]]), np.array([[0.0], [3e5]])
    with_spring = tube.with_effect('bladder_linear', stiffness=300.0).force(strain, pressure)
    assert_allclose(with_spring - tube.force(strain, pressure), -300.0 * strain * [1.0, 1.0])


def test_ogden_s_rubber_of_exponent_two_is_neo_hooke_s():
    """W = mu/2 (I1 - 3) in either name, so that c10 = mu/2 and c01 = 0."""
    strain, tube = np.linspace(0.0, 0.3, 9), Bundle('tube', units(1), [mesh()])
    ogden = tube.with_effect('bladder_ogden', modulus=200e3, exponent=2.0)
    hooke = tube.with_effect('bladder_elasticity', c10=100e3, c01=0.0)
    pressure = np.full((9, 1), 2e5)
    assert_allclose(ogden.force(strain, pressure), hooke.force(strain, pressure), rtol=1e-9)


def test_bladder_force_is_the_slope_of_its_energy():
    """The printed dW/dl is the derivative of the Mooney-Rivlin energy (virtual work)."""
    strain = np.linspace(0.02, 0.3, 9)
    k, c10, c01 = PAPER.cot2, 118.4e3, 105.7e3

    def energy(stretch):
        around = 1 + k * (1 - stretch ** 2)
        first = stretch ** 2 + around + 1 / (stretch ** 2 * around) - 3
        second = 1 / stretch ** 2 + 1 / around + stretch ** 2 * around - 3
        return c10 * first + c01 * second

    h = 1e-6
    slope = (energy(1 - strain + h) - energy(1 - strain - h)) / (2 * h)
    tube = Bundle('tube', units(1), [bladder_elasticity()])
    assert_allclose(tube.force(strain, np.zeros((9, 1))),
                    PAPER.wall_area * slope, rtol=1e-6)


def test_a_thick_tube_s_force_is_the_slope_of_the_energy_of_all_its_layers():
    """Two hundred layers of Yeoh's rubber, each keeping its volume; a thin one is as printed."""
    strain = np.linspace(0.02, 0.25, 9)
    edges = np.linspace((PAPER.radius - PAPER.wall_thickness) ** 2, PAPER.radius ** 2, 201)
    square = 0.5 * (edges[1:] + edges[:-1])[:, None]

    def energy(stretch):
        outside = PAPER.radius ** 2 * (1 + PAPER.cot2 * (1 - stretch ** 2))
        around = (outside - (PAPER.radius ** 2 - square) / stretch) / square
        first = stretch ** 2 + around + 1 / (stretch ** 2 * around) - 3
        return np.pi * np.diff(edges) @ (150e3 * (first - 0.1 * first ** 2))

    h = 1e-6
    slope = (energy(1 - strain + h) - energy(1 - strain - h)) / (2 * h)
    still = np.zeros((9, 1))
    tube = Bundle('tube', units(1), [bladder_thick(c10=150e3, stiffening=-0.1)])
    assert_allclose(tube.force(strain, still), slope, rtol=1e-3)
    thin = [MotorUnit('mu1', 1, Geometry(PAPER.radius, PAPER.length, PAPER.braid_angle, 1e-6))]
    assert_allclose(Bundle('thin', thin, [bladder_thick(c10=150e3)]).force(strain, still),
                    Bundle('thin', thin, [bladder_elasticity(c10=150e3, c01=0.0)]).force(
                        strain, still), rtol=1e-3)


def test_bundle_free_strain_dips_when_the_second_unit_fills(paper_bundle):
    """Raising MU2 from zero first shortens the bundle's reach (free strain gradient reversal)."""
    second = np.array([0, 34.5, 68.95, 137.9, 172.4, 206.8, 275.8, 344.7]) * 1e3
    pressure = np.column_stack([np.full(8, 344.7e3), second])
    assert_allclose(paper_bundle.free_strain(pressure),
                    [.2356, .2335, .2266, .2211, .2185, .2227, .2302, .2365], atol=6e-5)


def test_without_resistive_force_the_bladder_alone_gives_no_reversal():
    """Mesh and bladder continued below zero: free strain starts at 0.1870 and only rises."""
    plain = Bundle('plain', units(2), [mesh(), bladder_elasticity()])
    second = np.linspace(0.0, 344.7e3, 40)
    free = plain.free_strain(np.column_stack([np.full(40, 344.7e3), second]))
    assert_allclose(free[0], 0.1870, atol=5e-5)
    assert np.all(np.diff(free) > 0.0)


def test_plateau_alone_gives_the_reversal_too():
    """With |F| capped at 3 N + 0.03 N/kPa P2 the free strain falls to 0.2218 and returns."""
    capped = Bundle('capped', units(2), [mesh(), bladder_elasticity()]).with_effect(
        'resistive_plateau', euler_load=3.0, pressure_share=0.03e-3 / PAPER.area)
    second = np.array([0.0, 69e3, 200e3, 344.7e3])
    free = capped.free_strain(np.column_stack([np.full(4, 344.7e3), second]))
    assert_allclose(free, [.2314, .2279, .2218, .2365], atol=5e-5)
