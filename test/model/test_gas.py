# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The gas volume follows from the mesh: what the gas gives, the braid pulls."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.model import Bundle, catalogue, loads_model, MotorUnit, Place
from fam_bundle_ros.model.laws.mesh import mesh

from .conftest import PAPER, units

FORMULAS = ('0.1 * strain', '0.02 + 0.3 * strain', 'k * strain ** 2 * tanh(pressure / 1e5 / u)',
            '-0.1 * sin(3 * strain)', '0.05 * exp(-pressure / 2e5 / u) * strain + 0.01',
            '0.1 * (1 - stretch ** 2)')


def formula(number):
    """Return a user's geometry effect."""
    return loads_model(f"""
format: fam-bundle-model/1
motor_units:
  - geometry: {{radius: 6.35 mm, length: 127 mm, braid_angle: 33 deg, wall_thickness: 1.59 mm}}
effects:
  - own: {{expression: "{FORMULAS[number]}", place: geometry,
           parameters: {{k: 0.4, u: 1 Pa}}}}
""").effects[0]


GEOMETRY = [name for name in catalogue.names() if catalogue.get(name).place is Place.GEOMETRY]
#: An effect is made anew for each example, so there are few with many strains each.
FEW, MANY = 10, 20
strains, pressures = (st.lists(st.floats(*ends), min_size=MANY, max_size=MANY).map(np.array)
                      for ends in ((-0.02, 0.35), (1e3, 6e5)))
shares = st.lists(st.floats(0.05, 0.95), min_size=5, max_size=5)


def bundle_with(*effects):
    """Return two units of mesh alone, with these effects."""
    return Bundle('gas', units(2), [mesh(), *effects])


def of(name, share):
    """Return a geometry effect with values within its bounds."""
    law = catalogue.get(name)
    return law(**{p.name: p.scale * (p.lower + s * (p.upper - p.lower))
                  for p, s in zip(law.parameters, share, strict=False)})


@pytest.mark.parametrize('name', [*GEOMETRY, *range(len(FORMULAS))])
@given(share=shares, strain=strains, pressure=pressures)
@settings(max_examples=FEW)
def test_pressure_times_the_change_of_volume_is_the_work_of_the_mesh(name, share, strain,
                                                                      pressure):
    """P dV/de = F L0 for every geometry effect, at fixed stretch of the threads."""
    effect = formula(name) if isinstance(name, int) else of(name, share)
    bundle = bundle_with(effect)
    felt = np.stack([pressure, 0.5 * pressure], -1)
    work = bundle.unit_forces(strain, felt) * PAPER.length
    assert_allclose(felt * bundle.gas_volume_slope(strain, felt), work, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('name', [
    *(name for name in GEOMETRY if catalogue.get(name).parts[0].changes != 'braid'),
    *range(len(FORMULAS))])
@given(share=shares, strain=strains, pressure=pressures)
@settings(max_examples=FEW)
def test_the_volume_is_what_its_slope_adds_up_to(name, share, strain, pressure):
    """At one pressure, with threads that do not stretch."""
    bundle = bundle_with(formula(name) if isinstance(name, int) else of(name, share))
    felt, h = np.stack([pressure, np.full(MANY, 2e5)], -1), 1e-5
    rise = bundle.gas_volume(strain + h, felt) - bundle.gas_volume(strain - h, felt)
    assert_allclose(rise / (2 * h), bundle.gas_volume_slope(strain, felt), rtol=1e-5, atol=1e-9)


@given(strain=strains, pressure=pressures)
@settings(max_examples=FEW)
def test_at_fixed_thread_stretch_the_volume_rises_by_its_slope(strain, pressure):
    """Threads stretched by s make a muscle of the same kind, B = (1 + s)^2 [CH96]."""
    bundle = bundle_with(catalogue.get('braid_elasticity')(compliance=2e-7))
    felt = np.stack([pressure, pressure], -1)
    stretched = (1.0 + 2e-7 * pressure * (1.0 - strain)) ** 2

    def volume(e):
        stretch = 1.0 - e
        return PAPER.area * PAPER.length * stretch * (
            stretched - stretch ** 2 * PAPER.cos2) / PAPER.sin2 - PAPER.wall_area * PAPER.length

    both = np.stack([volume(strain)] * 2, -1)
    assert_allclose(bundle.gas_volume(strain, felt), both, rtol=1e-12)
    h = 1e-5
    rise = np.stack([volume(strain + h) - volume(strain - h)] * 2, -1)
    assert_allclose(bundle.gas_volume_slope(strain, felt), rise / (2 * h), rtol=1e-6, atol=1e-9)


def test_a_dead_length_is_an_active_muscle_that_is_shorter():
    """End caps: what moves is a muscle of length L0 - Le, at its own strain."""
    caps = bundle_with(catalogue.get('end_caps')(dead_length=0.027))
    short = Bundle('short', [MotorUnit('a', 1, replace(PAPER, length=0.1))], [mesh()])
    strain = np.linspace(0.0, 0.2, 5)
    grown = (caps.gas_volume(strain) - caps.gas_volume(0.0))[:, 0]
    own = short.gas_volume(1.27 * strain)[:, 0]
    assert_allclose(grown, own - own[0], rtol=1e-9)


def test_the_volume_at_rest_is_that_of_the_cylinder():
    """16.09 mL inside the braid less 7.0480 mL of rubber, whatever geometry effect acts."""
    for effects in ([], [catalogue.get('end_caps')()], [catalogue.get('tondu_factor')()]):
        assert_allclose(bundle_with(*effects).gas_volume(0.0), 16.088e-6 - 7.048e-6, atol=5e-9)


def test_pressure_that_is_lost_is_not_felt_by_the_geometry():
    """The threads stretch with the pressure that reaches the muscle."""
    soft = bundle_with(catalogue.get('braid_elasticity')())
    late = soft.with_effect('threshold_pressure', pressure=5e4)
    assert_allclose(late.gas_volume(0.1, [2.5e5, 1.5e5]), soft.gas_volume(0.1, [2e5, 1e5]))
