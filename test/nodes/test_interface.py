# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages of the interface, both ways."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface


def test_pressure_goes_out_absolute_and_comes_back_gauge():
    """FluidPressure carries absolute pressure; inside it is gauge."""
    message = interface.pressure_message(5, 200e3, 101325.0)
    assert message.fluid_pressure == 301325.0
    assert interface.read_pressure(message, 101325.0) == 200e3


def test_gauge_driver_is_taken_as_it_is():
    """A driver that sends gauge pressure is read without taking ambient off."""
    message = interface.pressure_message(5, 200e3, 0.0)
    assert interface.read_pressure(message, 101325.0, is_gauge=True) == 200e3


@pytest.mark.parametrize('value', [3, np.float32(3.0), np.int64(3), np.float64(3.0)])
def test_scalars_of_any_kind_arrive_as_numbers(value):
    """An int or a numpy scalar would go out as garbage: everything is cast."""
    assert interface.force_message(1, value).wrench.force.x == 3.0
    assert interface.strain_message(1, value, value, 0.1).position[1] == 3.0
    assert interface.pressure_message(1, value, 0).fluid_pressure == 3.0
    assert interface.valve_message(1, 1, np.float32(0.5)).effort[0] == 0.5


def test_numpy_bool_stays_true():
    """Bool(np.bool_(True)) would be sent as False."""
    assert interface.bool_message(np.bool_(True)).data is True
    assert interface.state_message(np.int64(2)).data == 2


def test_strain_from_contraction_alone():
    """A rig that gives the contraction alone is enough: strain = contraction / length."""
    message = JointState(name=['contraction'], position=[0.0127], velocity=[0.127])
    assert interface.read_strain(message, 0.127) == (pytest.approx(0.1), pytest.approx(1.0))


def test_strain_without_velocity_has_no_rate():
    """A missing velocity is nan, not zero."""
    strain, rate = interface.read_strain(JointState(name=['strain'], position=[0.1]), 0.127)
    assert strain == 0.1
    assert math.isnan(rate)


def test_strain_of_other_joints_fails():
    """A message about something else says what was expected."""
    with pytest.raises(InputError, match="joints elbow; expected 'strain' or 'contraction'"):
        interface.read_strain(JointState(name=['elbow'], position=[0.1]), 0.127)


@pytest.mark.parametrize(('name', 'effort', 'text'), [
    ('mu2_valve', [0.5], "expected 'mu1_valve'"), ('mu1_valve', [], 'with 0 efforts'),
    ('mu1_valve', [1.5], 'expected -1 to 1'), ('mu1_valve', [math.nan], 'is nan')])
def test_valve_command_that_cannot_be_meant_fails(name, effort, text):
    """Commands for another valve, without effort or out of range are refused."""
    with pytest.raises(InputError, match=text):
        interface.read_valve(JointState(name=[name], effort=effort), 1)


def test_stamps_survive_the_way_there_and_back():
    """Nanoseconds come back as they went, also past 2^31 ns."""
    for stamp in (0, 1, 999_999_999, 1_795_000_000_123_456_789):
        assert interface.stamp_ns(interface.to_stamp(stamp)) == stamp


def test_names_are_relative_but_for_ros_own():
    """REP-135: a namespace moves every topic; /diagnostics stays global by convention."""
    names = [topic.name for topic in interface.topics(3)]
    assert [name for name in names if name.startswith('/')] == ['/diagnostics']
    assert 'mu3/valve_command' in names
    assert 'mu4/pressure' not in names
    assert interface.topics(1)[0].type_name == 'geometry_msgs/msg/WrenchStamped'


def test_recruitment_says_who_is_on_and_how_much():
    """Per motor unit on or off, and its share."""
    message = interface.recruitment_writer(2)(3, np.array([True, False]), np.array([0.7, 0.3]))
    assert (list(message.position), list(message.effort)) == ([1.0, 0.0], [0.7, 0.3])
    assert list(message.name) == ['mu1', 'mu2']


def test_a_writer_leaves_nothing_of_the_message_before():
    """What was sent once is written over in all of its values, its stamp among them."""
    write = interface.recruitment_writer(2)
    write(3, [True, True], [0.4, 0.6])
    assert write(2_000_000_005, [False, True], [0.0, 1.0]) == interface.recruitment_writer(2)(
        2_000_000_005, [False, True], [0.0, 1.0])
    strain = interface.strain_writer(0.1)
    strain(3, 0.2, 0.3)
    assert strain(4, 0.1, 0.0) == interface.strain_message(4, 0.1, 0.0, 0.1)


def test_pressures_come_by_name_and_every_unit_needs_one():
    """The order of the names is free; a missing or a second one is refused."""
    message = interface.reference_pressures_writer(2)(5, (1e5, 2e5))
    assert interface.read_pressures(message, 2) == (1e5, 2e5)
    turned = JointState(name=['mu2', 'mu1'], effort=[2e5, 1e5])
    assert interface.read_pressures(turned, 2) == (1e5, 2e5)
    for names, efforts in ((['mu1'], [1e5]), (['mu1', 'mu2'], [1e5]), (['mu1', 'mu1'], [0.0] * 2)):
        with pytest.raises(InputError, match='expected mu1, mu2 with one each'):
            interface.read_pressures(JointState(name=names, effort=efforts), 2)


@pytest.mark.parametrize(('names', 'told'), [([''], "joints ''; expected"), ([], 'joints none;')])
def test_an_empty_name_of_a_joint_can_be_seen_in_the_refusal(names, told):
    """It is not the same as no joint."""
    with pytest.raises(InputError, match=told):
        interface.read_strain(JointState(name=names, position=[0.1] * len(names)), 0.127)
