# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories: values, rates, files, messages."""

from builtin_interfaces.msg import Duration
import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes.profile import load_profile, Points, profile_from
from fam_bundle_ros.nodes.reference_generator import trajectory_profile
from fam_bundle_ros.resources import config_names


@pytest.mark.parametrize('name', config_names('trajectories'))
def test_every_shipped_trajectory_loads(name):
    """What ships can be named by its file name alone."""
    assert load_profile(name).duration > 1.0


def test_rate_is_the_derivative_of_the_value():
    """Value and rate of a cubic profile belong together, to first order of the step."""
    profile = Points('p', 'strain', (0.0, 1.0, 3.0), (0.0, 0.1, 0.05), (0.0, 0.05, 0.0))
    t = np.linspace(0.01, 2.99, 400)
    numeric = [(profile.value(x + 1e-6) - profile.value(x - 1e-6)) / 2e-6 for x in t]
    np.testing.assert_allclose([profile.rate(x) for x in t], numeric, atol=1e-6)


def test_ends_are_held():
    """Before the first and after the last point nothing moves."""
    profile = Points('p', 'force', (1.0, 2.0), (5.0, 9.0))
    assert (profile.value(0.0), profile.rate(0.0)) == (5.0, 0.0)
    assert (profile.value(7.0), profile.rate(7.0)) == (9.0, 0.0)


BASE = {'name': 'steps', 'format': 'fam-bundle-trajectory/1', 'quantity': 'force',
        'points': [['0 s', '1 N']]}


@pytest.mark.parametrize(('change', 'text'), [
    ({'format': 'x'}, "expected a mapping with 'format"),
    ({'quantity': 'torque'}, "quantity is 'torque'; expected force or strain"),
    ({'speed': 1}, "unknown key 'speed'"),
    ({'interpolation': 'spline'}, 'expected linear or smooth'),
    ({'points': []}, 'has no points'),
    ({'points': [['0 s']]}, r'point 1 is .*expected \[time, value\]'),
    ({'points': [['0 s', '1 mm']]}, 'point 1: '),
    ({'points': [['0 s', '1 N'], ['0 s', '2 N']]}, 'not after point 1'),
    ({'points': [['0 s', '1 MN']]}, 'expected a time from 0 and a force up to 10000 N'),
])
def test_bad_file_says_what_and_where(change, text):
    """Each mistake is one sentence that names the file."""
    with pytest.raises(InputError, match=text) as error:
        profile_from({**BASE, **change}, 'steps.yaml')
    assert str(error.value).startswith('steps.yaml')


def test_file_that_is_not_there_fails():
    """A wrong name lists what ships."""
    with pytest.raises(InputError, match='force_ramp'):
        load_profile('force_rmap')


def point(seconds, position, velocity=None):
    """Return a trajectory point."""
    return JointTrajectoryPoint(
        time_from_start=Duration(sec=seconds), positions=[position],
        velocities=[] if velocity is None else [velocity])


def test_rates_that_lead_far_off_the_points_are_refused():
    """Between two points at 60 N the cubic would go to meganewtons and back."""
    with pytest.raises(InputError, match='rates of 1e.09 and -1e.09 per s lead off by up to'):
        trajectory_profile(JointTrajectory(
            joint_names=['force'], points=[point(0, 60.0, 1e9), point(1, 60.0, -1e9)]), 0.127)


def test_contraction_trajectory_becomes_strain():
    """Metres over the rest length."""
    profile = trajectory_profile(JointTrajectory(
        joint_names=['contraction'], points=[point(0, 0.0), point(2, 0.0254)]), 0.127)
    assert profile.kind == 'strain'
    assert profile.value(1.0) == pytest.approx(0.1)


def test_trajectory_of_other_joints_fails():
    """An arm's trajectory is none of ours."""
    with pytest.raises(InputError, match='joints shoulder, elbow'):
        trajectory_profile(JointTrajectory(joint_names=['shoulder', 'elbow']), 0.127)
