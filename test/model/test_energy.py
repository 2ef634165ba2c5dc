# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Work, similarity and symmetry: what physics says of all laws of a kind."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.model import Bundle, catalogue, Geometry, Motion, Place
from fam_bundle_ros.model.laws.bladder import bladder_elasticity
from fam_bundle_ros.model.laws.mesh import mesh

from .conftest import PAPER, units
from .test_laws import example

LAWS = catalogue.available()
LOSSES = [name for name, law in LAWS.items() if law.place is Place.LOSS]
#: Of what drives the braid: the pressure is felt late, or by another way down than up.
LATE = [name for name, law in LAWS.items() if law.place is Place.PRESSURE and law.memory]
SENSORS = [name for name, law in LAWS.items() if law.place is Place.SENSOR]
CYCLE, CYCLES = 400, 40
ANGLE = 2.0 * np.pi * np.arange(CYCLES * CYCLE + 1) / CYCLE


def muscle(name):
    """Return an ideal muscle with one effect at values at which it does something."""
    return Bundle('one', units(1), [mesh(), bladder_elasticity(), example(name)])


def round_trip(bundle, strain, pressure, period, along):
    """Return the integral of the force along a quantity, in the last of many equal cycles."""
    time = period / CYCLE * np.arange(len(ANGLE))
    rate = np.gradient(strain, time)
    force = bundle.simulate(Motion(strain, pressure[:, None], rate, time, time == 0.0))[:, 0]
    return float(np.trapezoid(force[-CYCLE - 1:], along[-CYCLE - 1:])), float(np.ptp(
        force[-CYCLE - 1:]) * np.ptp(along))


@pytest.mark.parametrize('period', [0.5, 6.0])
@pytest.mark.parametrize('name', LOSSES)
def test_a_loss_takes_work_out_of_a_cycle_of_the_strain(name, period):
    """At one pressure, slow or fast: the muscle gives back less than was put in."""
    strain, held = 0.1 + 0.05 * np.sin(ANGLE), np.full(len(ANGLE), 2e5)
    work, size = round_trip(muscle(name), strain, held, period, strain)
    assert work < -1e-4 * size
    elastic, _ = round_trip(muscle(name).without_effect(name), strain, held, period, strain)
    assert abs(elastic) < 1e-6 * size


@pytest.mark.parametrize('period', [0.5, 6.0])
@pytest.mark.parametrize('name', LATE)
def test_a_pressure_that_is_felt_late_pulls_less_on_the_way_up(name, period):
    """At one strain the force of filling is below that of venting."""
    pressure, held = 2e5 + 1e5 * np.sin(ANGLE), np.full(len(ANGLE), 0.1)
    loop, size = round_trip(muscle(name), held, pressure, period, pressure)
    assert loop < -1e-4 * size


@pytest.mark.parametrize('size', [0.5, 3.0])
def test_a_muscle_of_twice_the_size_pulls_four_times_as_hard(size):
    """Mesh and bladder know no length of their own: forces go with the area."""
    laws = [mesh(), bladder_elasticity(), catalogue.get('braid_elasticity')(compliance=5e-8),
            catalogue.get('tondu_factor')(factor=0.1)]
    scaled = Geometry(size * PAPER.radius, size * PAPER.length, PAPER.braid_angle,
                      size * PAPER.wall_thickness)
    strain, pressure = (grid.ravel() for grid in np.meshgrid(
        np.linspace(0.0, 0.25, 6), np.linspace(0.0, 4e5, 5)))
    one, other = (Bundle('one', [replace(units(1)[0], geometry=geometry)], laws).force(
        strain, pressure[:, None]) for geometry in (PAPER, scaled))
    assert other == pytest.approx(size ** 2 * one, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('name', LOSSES)
def test_no_bound_lets_a_loss_drive_the_muscle(name):
    """Sizes of friction, damping and relaxation are not negative, whatever a fit would like."""
    assert all(parameter.lower >= 0.0 for parameter in LAWS[name].parameters)


@pytest.mark.parametrize('name', SENSORS)
def test_an_instrument_may_err_as_far_one_way_as_the_other(name):
    """No error unless told, and bounds that do not take sides."""
    for parameter in LAWS[name].parameters:
        assert parameter.default == 0.0
        assert parameter.lower == -parameter.upper


def test_a_parameter_for_each_unit_is_there_where_units_differ():
    """Of the first unit differ all others: one less; a gauge of its own: all, or none of one."""
    names = {count: {law.name: [each.name for each in law.active(count)]
                     for law in LAWS.values() if law.per_unit} for count in (1, 2, 4)}
    assert names[1]['motor_unit_mismatch'] == names[1]['unit_pressure_bias'] == []
    assert names[2]['motor_unit_mismatch'] == ['mu2']
    assert names[2]['unit_pressure_bias'] == ['mu1', 'mu2']
    assert names[4]['unit_length_mismatch'] == ['mu2', 'mu3', 'mu4']
    assert names[4]['unit_pressure_gain'] == ['mu1', 'mu2', 'mu3', 'mu4']
