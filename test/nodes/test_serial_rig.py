# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Readings and commands of serial_rig over real ROS, with a board on a pseudo terminal or TCP."""

from geometry_msgs.msg import WrenchStamped
import pytest

pytest.importorskip('serial', reason='pyserial is not installed')

from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.serial_rig import SerialRig

from .board import FakeBoard
from .serial_loop import Loop

AMBIENT = 101325.0


def test_readings_come_in_the_units_of_the_interface(graph, any_port):
    """Scale and offset make N, m and Pa; gauge becomes absolute; stamps are those of now."""
    board = FakeBoard(any_port)
    board.pressure = [20.0, 30.0]
    board._flow = lambda dt: None
    loop = Loop(graph, board, **{'force.scale': -2.0, 'force.offset': 1.0, 'mu2.scale': 2000.0,
                                 'mu2.offset': -500.0})
    force = graph.listen('force', WrenchStamped)
    strain = graph.listen('strain', JointState)
    supply = graph.listen('supply/pressure', FluidPressure)
    loop.until(lambda: min(map(len, (force, strain, supply, *loop.pressure.values()))) > 20,
               'readings')
    assert force[-1].wrench.force.x == -24.0
    assert force[-1].header.frame_id == 'load_cell'
    assert (list(strain[-1].name), list(strain[-1].position)) == (['contraction'], [0.01])
    assert supply[-1].fluid_pressure == 600e3 + AMBIENT
    assert loop.pressure[1][-1].fluid_pressure == 20e3 + AMBIENT
    assert loop.pressure[2][-1].fluid_pressure == 60e3 - 500.0 + AMBIENT
    assert loop.pressure[2][-1].header.frame_id == 'mu2'
    age = graph.probe.now_ns() - interface.stamp_ns(force[-1].header.stamp)
    assert 0 <= age < 1e9


def test_absolute_sensors_stay_absolute(graph, port):
    """With board_sends_gauge false nothing is added to what the board sends."""
    board = FakeBoard(port, units=1)
    board.pressure = [150.0]
    board._flow = lambda dt: None
    loop = Loop(graph, board, board_sends_gauge=False)
    loop.until(lambda: loop.pressure[1], 'pressure')
    assert loop.pressure[1][-1].fluid_pressure == pytest.approx(150e3)


def test_stamps_are_the_times_of_the_readings(graph, port):
    """Lines that arrive ten at a time are stamped as far apart as the board read them."""
    board = FakeBoard(port)
    held = []

    def hold(data):
        held.append(data)
        if len(held) < 10:
            return b''
        together = b''.join(held)
        held.clear()
        return together
    board.mangle = hold
    loop = Loop(graph, board)
    heard = graph.listen('force', WrenchStamped)
    board.force = 0.0
    sent = board.send

    def numbered():
        board.force = board.number
        sent()
    board.send = numbered
    loop.until(lambda: len(heard) > 80, 'readings')
    stamps = {round(m.wrench.force.x): interface.stamp_ns(m.header.stamp) for m in heard[40:]}
    first, *rest = sorted(stamps)
    for number in rest:
        true = (board.times[number] - board.times[first]) % 2**32 * 1e-6
        assert (stamps[number] - stamps[first]) * 1e-9 == pytest.approx(
            true, abs=2e-3 + 0.02 * true)
    steps = [stamps[b] - stamps[a] for a, b in zip(sorted(stamps), rest)]
    assert min(steps) > 0


def test_valve_commands_reach_the_board(graph, any_port):
    """What is commanded opens the valves, in thousandths, with the supply."""
    loop = Loop(graph, FakeBoard(any_port))
    loop.valves = {1: 0.25, 2: -0.125}
    loop.until(lambda: loop.board.valves == [250, -125] and loop.board.supply, 'the command')
    loop.until(lambda: loop.board.pressure[0] > 100.0, 'pressure')
    assert loop.board.pressure[1] < 1.0
    status, values = loop.status('open')
    assert status.hardware_id == 'rig'
    assert values['air'] == 'open'
    assert values['board'] == 'fake'
    assert (values['lines lost'], values['lines garbled']) == ('0', '0')
    assert 0.0 < float(values['round trip, s']) < 5.0
    assert float(values['sample rate']) > 20.0


def test_command_carries_the_time_of_the_reading_that_it_answers(graph, port):
    """A board sees on its own clock how old the reading behind a command is."""
    loop = Loop(graph, FakeBoard(port, units=1))
    loop.valves = {1: None}
    publisher = graph.probe.create_publisher(JointState, 'mu1/valve_command', 10)
    old = []

    def answer():
        if len(loop.pressure[1]) > 30:
            # 20 samples, 0.1 s or more, ago.
            stamp = interface.stamp_ns(loop.pressure[1][-21].header.stamp)
            newest = interface.stamp_ns(loop.pressure[1][-1].header.stamp)
            publisher.publish(interface.valve_message(stamp, 1, 0.4))
            old.append((newest - stamp) * 1e-9)
        return any(heard[4] == [400] for heard in loop.board.heard)
    loop.until(answer, 'the command')
    number, ticks, *_ = next(heard for heard in loop.board.heard if heard[4] == [400])
    age = (loop.board.ticks() - ticks) % 2**32 * 1e-6
    assert age > 0.9 * min(old)
    loop.until(lambda: loop.board.why == 2, 'the board to refuse old answers')


def test_every_sample_is_answered_at_once(graph, port):
    """A command goes out when all motor units have theirs, not with the next heartbeat."""
    loop = Loop(graph, FakeBoard(port))
    board = loop.board

    def in_a_row():
        numbers = [min(board.times, key=lambda n: abs(board.times[n] - ticks))
                   for _, ticks, *_ in board.heard[-12:]]
        return any(numbers[k:k + 6] == list(range(numbers[k], numbers[k] + 6))
                   for k in range(len(numbers) - 5))
    loop.until(in_a_row, 'six answers to six samples')


def test_valve_joint_of_ros2_control_drives_the_board(graph, port):
    """A JointState of JointStateTopicSystem: effort alone, stamped when it was sent."""
    loop = Loop(graph, FakeBoard(port, units=1))
    loop.valves = {1: None}
    publisher = graph.probe.create_publisher(JointState, 'mu1/valve_command', 1)

    def write():
        message = JointState(name=['mu1_valve'], effort=[0.2])
        message.header.stamp = graph.probe.get_clock().now().to_msg()
        publisher.publish(message)
        return loop.board.valves == [200] and loop.board.pressure[0] > 100.0
    loop.until(write, 'pressure')


@pytest.mark.parametrize(('name', 'value', 'text'), [
    ('url', 'telegraph://x', "parameter url is 'telegraph://x'; expected a serial port as"),
    ('mu2.scale', 0.0, 'parameter mu2.scale is 0; expected a number other than 0'),
    ('use_sim_time', True, 'use_sim_time must be false'),
    ('lock_step', True, 'lock_step and use_sim_time must be false'),
    ('units', 99, 'parameter units is 99; expected a whole number from 1 to 16'),
])
def test_bad_parameter_fails(ros_context, name, value, text):
    """One line that says what was given and what is expected."""
    with pytest.raises(InputError, match=text.replace('(', r'\(')):
        SerialRig(context=ros_context, overrides={name: value})
