# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
A bundle whose muscles, rig and load are thinner or thicker is controlled in the same way.

Sections, forces, volumes and flows all in proportion: only constants in N could tell the sizes
apart.
"""

from dataclasses import replace
import math

import numpy as np
import pytest

from fam_bundle_ros.control import LoadModel, OuterConfig
from fam_bundle_ros.control.outer_loop import outer_settings
from fam_bundle_ros.control.strain_loop import gain_at
from fam_bundle_ros.kernels import pack
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit
from fam_bundle_ros.nodes.profile import load_profile
from fam_bundle_ros.plant import Dynamometer, MassSpring, RigConfig
from fam_bundle_ros.simulation import ClosedLoop, Trajectory


def bundle_of(size):
    """Return two units of one muscle with a section of so many times the paper's."""
    thick = math.sqrt(size)
    geometry = Geometry(6.35e-3 * thick, 0.127, math.radians(33.0), 1.59e-3 * thick)
    return Bundle('of a size', [MotorUnit(f'mu{k + 1}', 1, geometry, 344.7e3) for k in range(2)], [
        catalogue.get('mesh')(), catalogue.get('bladder_elasticity')(),
        catalogue.get('resistive_plateau')(euler_load=2.88 * size)])


def run(size, trajectory):
    """Return the log of a bundle and a rig of a size."""
    usual = RigConfig()
    valve, sensors, supply = usual.valve, usual.sensors, usual.supply
    rig = replace(
        usual, valve=replace(valve, conductance=size * valve.conductance),
        chamber=replace(usual.chamber, tube_volume=size * usual.chamber.tube_volume),
        sensors=replace(sensors, force_noise=size * sensors.force_noise,
                        force_resolution=size * sensors.force_resolution),
        supply=replace(supply, volume=size * supply.volume, resistance=supply.resistance / size,
                       flow_limit=size * supply.flow_limit))
    return ClosedLoop(bundle_of(size), rig=rig, told_load=False).run(trajectory)


def error_of(log):
    """Return the rms error of a run, in N or strain."""
    return float(np.sqrt(np.mean(log.error ** 2)))


@pytest.mark.parametrize('size', [0.03, 20.0])
def test_steps_of_a_thin_and_a_thick_bundle_are_followed_alike(size):
    """A step of 2 N is little for one and a third of the range for the other."""
    levels = (6.0, 28.0, 48.0, 56.0, 39.0, 20.0, 52.0, 11.0)

    def stairs(size):
        return run(size, Trajectory(
            'stairs', 'force', 8.0, lambda t: size * levels[min(int(max(t, 0.0)), 7)],
            lambda t: 0.0, Dynamometer(0.16), prepare=1.5))
    usual, other = stairs(1.0), stairs(size)
    assert error_of(other) == pytest.approx(size * error_of(usual), rel=0.03)
    assert len(other.switches) == len(usual.switches)


@pytest.mark.parametrize('size', [0.03, 20.0])
def test_a_load_that_was_not_told_is_lifted_alike_by_a_thin_and_a_thick_bundle(size):
    """Both learn it; the first gains are for a load in proportion to the bundle."""
    path = load_profile('strain_steps')

    def lift(size):
        load = MassSpring(mass=2.5 * size, damping=40.0 * size)
        return run(size, Trajectory('lift', 'strain', path.duration, path.value, path.rate, load,
                                    prepare=1.5))
    assert error_of(lift(size)) == pytest.approx(error_of(lift(1.0)), rel=0.25)


@pytest.mark.parametrize('size', [0.03, 20.0])
def test_the_first_gains_for_a_load_that_was_not_told_are_in_proportion_to_the_bundle(size):
    """A load of 2.5 kg is heavy for one, and less than its fittings for the other."""
    usual, other = (outer_settings(OuterConfig(), LoadModel(), bundle_of(each))
                    for each in (1.0, size))
    for stiffness in np.geomspace(5.0, usual.most_stiffness, 9):
        for name in ('strain_gain', 'strain_integral', 'strain_damping'):
            assert gain_at(other, getattr(other, name), size * stiffness, 0.0) == pytest.approx(
                size * gain_at(usual, getattr(usual, name), stiffness, 0.0), rel=1e-6)


@pytest.mark.parametrize('load', [LoadModel(), LoadModel(force=20.0, stiffness=3e3)])
def test_the_loop_is_compiled_once_for_bundles_of_as_many_units(load):
    """Thin or thick, soft or stiff, with any load: half a minute for each other type of record."""
    types = {str(pack(outer_settings(OuterConfig(), each, bundle_of(size))).dtype)
             for size in (0.03, 0.3, 1.0, 7.0, 20.0) for each in (load, LoadModel())}
    assert len(types) == 1
