# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Who lets air into a rig on a serial line, and what takes it away."""

import signal

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from fam_bundle_ros.nodes import interface

from .board import FakeBoard
from .serial_loop import Loop


def test_error_while_a_line_is_read_stops_the_rig_and_not_the_process(graph, port):
    """What nobody has foreseen shuts air and valves, says what it was, and the node goes on."""
    loop = Loop(graph, FakeBoard(port))
    loop.valves = {1: 0.25, 2: 0.25}
    loop.until(lambda: loop.board.valves == [250, 250] and loop.board.supply, 'the command')
    in_si = loop.rig._scales.in_si

    def broken(sample):
        raise ZeroDivisionError('no such scale')
    loop.rig._scales.in_si = broken
    loop.until(lambda: loop.board.valves == [-1000, -1000] and not loop.board.supply, 'the vent')
    loop.status('ZeroDivisionError: no such scale')
    loop.rig._scales.in_si = in_si
    count = len(loop.pressure[1])
    loop.until(lambda: len(loop.pressure[1]) > count, 'readings again')


def test_motor_unit_without_commands_is_vented(graph, port):
    """One that falls silent exhausts; the other goes on, and the supply stays open."""
    loop = Loop(graph, FakeBoard(port), command_timeout=0.15)
    loop.filled()
    loop.valves[2] = None
    loop.until(lambda: loop.board.pressure[1] < 5.0, 'mu2 vented')
    loop.until(lambda: loop.board.pressure[0] > 100.0 and loop.board.supply, 'mu1 goes on')
    loop.status('mu2: lost its valve commands, vented')


def test_stale_command_is_refused(graph, port):
    """A command that answers a reading of long ago opens nothing."""
    loop = Loop(graph, FakeBoard(port, units=1), command_timeout=0.1)
    loop.valves = {1: None}
    publisher = graph.probe.create_publisher(JointState, 'mu1/valve_command', 10)

    def send():
        publisher.publish(interface.valve_message(graph.probe.now_ns() - 500_000_000, 1, 1.0))
        return loop.rig._refused > 10 and len(loop.board.heard) > 10
    loop.until(send, 'refusals')
    assert {tuple(heard[4]) for heard in loop.board.heard} == {(-1000,)}
    _, values = loop.status()
    assert int(values['commands refused']) > 10


@pytest.mark.parametrize(('enable', 'why'), [
    (False, 'supply_enable is false'), (None, 'nothing on supply_enable for 0.5 s')])
def test_supply_enable_cuts_and_dumps(graph, port, enable, why):
    """False, or silence for 0.5 s: supply shut and all exhaust though valves are to fill."""
    loop = Loop(graph, FakeBoard(port))
    loop.board.patience = 10.0  # that the machine is held up is another reason
    loop.filled()
    loop.enable = enable
    loop.vented()
    assert loop.board.heard[-1][2:] == (0, 0, [-1000, -1000])
    _, values = loop.status(why)
    assert values['air'] == f'shut by serial_rig: {why}'
    assert values['last air cut'] == f'by serial_rig: {why}'
    assert loop.stopped is False
    loop.enable = True
    loop.filled()


def test_no_air_before_supply_enable_is_heard(graph, port):
    """Who publishes nothing has allowed nothing."""
    board = FakeBoard(port)
    loop = Loop(graph, board)
    loop.enable = None
    loop.until(lambda: len(board.heard) > 30, 'commands')
    assert {(supply, *valves) for _, _, supply, _, valves in board.heard} == {(0, -1000, -1000)}


def test_one_of_two_publishers_that_says_false_is_believed(graph, port):
    """Two controllers on one rig: the one that wants no air wins."""
    loop = Loop(graph, FakeBoard(port))
    loop.filled()
    other = graph.probe.create_publisher(Bool, 'supply_enable', 10)
    timer = graph.probe.every(0.1, lambda: other.publish(Bool(data=False)))
    loop.vented()
    before = len(loop.board.heard)
    loop.until(lambda: len(loop.board.heard) > before + 50, 'commands')
    assert max(supply for _, _, supply, *_ in loop.board.heard[before:]) == 0
    timer.cancel()
    loop.filled()


def test_stop_button_is_latched(graph, port):
    """The button stops; letting go of it starts nothing; e_stop_reset does."""
    loop = Loop(graph, FakeBoard(port))
    loop.filled()
    loop.board.button = True
    loop.until(lambda: loop.stopped, 'e_stop')
    loop.vented()
    answer = loop.reset()
    assert (answer.success, answer.message) == (False,
                                                'still stopped: the stop button is pressed')
    loop.board.button = False
    before = len(loop.board.heard)
    loop.until(lambda: len(loop.board.heard) > before + 20, 'commands')
    loop.until(lambda: loop.stopped, 'e_stop')
    assert {(supply, stop) for _, _, supply, stop, _ in loop.board.heard[before:]} == {(0, 1)}
    assert loop.reset().success
    loop.until(lambda: loop.stopped is False, 'e_stop off')
    loop.filled()


def test_starts_stopped_and_e_stop_services_act(graph, port):
    """As on the simulated rig: start_stopped, e_stop_reset, e_stop_trigger."""
    loop = Loop(graph, FakeBoard(port), start_stopped=True)
    loop.until(lambda: len(loop.board.heard) > 20, 'commands')
    loop.until(lambda: loop.stopped, 'e_stop')
    assert {tuple(heard[2:4]) for heard in loop.board.heard} == {(0, 1)}
    assert loop.reset().success
    loop.filled()
    assert graph.call(Trigger, 'e_stop_trigger').success
    loop.vented()
    loop.until(lambda: loop.stopped, 'e_stop')
    loop.status('stopped: e_stop_trigger was called')


@pytest.mark.parametrize('cause', ['rig', 'board'])
def test_over_pressure_stops_the_rig(graph, port, cause):
    """Above trip_pressure, or when the board says that its own limit was exceeded."""
    loop = Loop(graph, FakeBoard(port), trip_pressure=300e3 if cause == 'rig' else 1e6)
    loop.valves = {1: 0.5, 2: 0.0}
    loop.until(lambda: loop.board.pressure[0] > 100.0, 'pressure')
    if cause == 'board':
        loop.board.over_pressure = True
    loop.vented()
    loop.until(lambda: loop.stopped, 'e_stop')
    loop.status('above 300 kPa' if cause == 'rig' else 'pressure above the limit of the board')
    assert loop.reset().success


def test_last_line_of_a_process_vents(graph, port, start):
    """Ctrl-C: the board hears stop, the status is 0."""
    board = FakeBoard(port, units=1)
    process = start('serial_rig', '--ros-args', '-p', f'url:={port.url}', '-p', 'units:=1',
                    '-p', 'start_stopped:=false')
    graph.probe.every(0.005, board.step)
    graph.until(lambda: len(board.heard) > 5, 'commands')
    assert board.heard[-1][3] == 0
    process.send_signal(signal.SIGINT)
    graph.until(lambda: process.poll() is not None, 'the end')
    graph.until(lambda: board.heard[-1][2:] == (0, 1, [-1000]), 'the vent')
    _, errors = process.communicate()
    assert process.returncode == 0
    assert 'Traceback' not in errors
