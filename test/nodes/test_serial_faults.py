# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Boards and lines that fail: what is lost, cut in half, unplugged, silent, deaf or restarted."""

import math
import random

from geometry_msgs.msg import WrenchStamped
import pytest
from sensor_msgs.msg import FluidPressure

from .board import FakeBoard
from .serial_loop import Loop


def test_lost_and_garbled_lines_are_counted_and_cost_no_control(graph, port):
    """Every fifth line lost, every seventh cut in half, noise between: valves go on."""
    board = FakeBoard(port)
    counts = {'lost': 0, 'garbled': 0}

    def spoil(data):
        if board.number < 20:
            return data
        if board.number % 5 == 0:
            counts['lost'] += 1
            return b''
        if board.number % 7 == 0:
            counts['lost'] += 1
            counts['garbled'] += 1
            return data[:len(data) // 2] + b'\n'
        if board.number % 11 == 0:
            counts['garbled'] += 1
            return b'\xff\x00S,1,2*\n' + data
        return data
    board.mangle = spoil
    loop = Loop(graph, board)
    loop.filled()
    loop.until(lambda: board.number > 150, 'lines')
    board.mangle = lambda data: data
    loop.valves = {1: 0.3, 2: 0.3}
    loop.until(lambda: board.valves == [300, 300], 'control')
    _, values = loop.status()
    assert (int(values['lines lost']), int(values['lines garbled'])) == (counts['lost'],
                                                                         counts['garbled'])
    assert values['last garbled line'] != 'none'
    assert loop.stopped is False


def test_noise_alone_brings_no_air(graph, any_port):
    """A port that speaks anything but the protocol: the node lives and says so."""
    noise = random.Random(1)
    board = FakeBoard(any_port)
    board._take = lambda data, now: board.heard.append(data)
    board.mangle = lambda data: noise.randbytes(200) + b'\n' * noise.randrange(2)
    loop = Loop(graph, board)
    status, values = loop.status('the board has not answered yet')
    loop.until(lambda: board.number > 200, 'noise')
    assert {data.partition(b',')[0] for data in board.heard} == {b'H'}
    loop.until(lambda: loop.stopped, 'e_stop')
    assert status.level == b'\x02'
    assert int(values['lines garbled']) > 0


@pytest.mark.parametrize(('version', 'units', 'why'), [
    (2, 2, 'the board speaks version 2 of the protocol; expected 1'),
    (1, 3, 'the board has 3 motor units; expected 2 (parameter units)')])
def test_board_that_does_not_fit_gets_no_commands(graph, port, version, units, why):
    """Another protocol, or another number of motor units."""
    board = FakeBoard(port, units)
    board.version = version
    loop = Loop(graph, board, units=2)
    loop.until(lambda: board.greetings > 2, 'greetings')
    status, _ = loop.status(why)
    assert status.level == b'\x02'
    assert board.heard == []
    assert loop.pressure[1] == []
    assert why in loop.reset().message
    loop.until(lambda: loop.stopped, 'e_stop')


def test_unplugged_and_plugged_in_again(graph, any_port):
    """The rig is stopped, and has air again only after e_stop_reset."""
    board = FakeBoard(any_port)
    loop = Loop(graph, board)
    loop.filled()
    any_port.unplug()
    loop.until(lambda: loop.stopped, 'e_stop')
    answer = loop.reset()
    assert not answer.success
    assert answer.message.startswith('still stopped: ')
    loop.vented()
    before = len(board.heard)
    any_port.plug()
    loop.until(lambda: len(board.heard) > before + 30, 'commands')
    assert {(supply, stop, *valves) for _, _, supply, stop, valves in board.heard[before:]} == {
        (0, 1, -1000, -1000)}
    _, values = loop.status('stopped: ')
    assert values['reconnects'] == '1'
    assert loop.reset().success
    loop.filled()


def test_silent_board_is_lost(graph, port):
    """A board that hangs with its port open: stopped, until it is back and e_stop_reset."""
    loop = Loop(graph, FakeBoard(port), board_timeout=0.5)
    loop.filled()
    loop.board.silent = True
    loop.until(lambda: loop.stopped, 'e_stop')
    loop.status('stopped: the board was silent for')
    loop.board.silent = False
    loop.until(lambda: loop.reset().success, 'the reset')
    loop.filled()


def test_board_that_restarts_stops_the_rig(graph, port):
    """A brown-out in the middle of work: its counter begins anew."""
    loop = Loop(graph, FakeBoard(port))
    loop.filled()
    loop.board.begin()
    loop.until(lambda: loop.stopped, 'e_stop')
    _, values = loop.status('stopped: the board has restarted')
    assert values['board restarts'] == '1'
    loop.until(lambda: loop.reset().success, 'the reset')
    loop.filled()


def test_board_that_takes_no_commands_gets_no_air(graph, any_port):
    """It still sends: the rig asks for no air, says why, and goes on when it listens again."""
    loop = Loop(graph, FakeBoard(any_port))
    loop.filled()
    loop.board.deaf = True
    loop.status('shut by serial_rig: the board has taken no command for')
    loop.vented()
    loop.board.deaf = False
    loop.filled()
    loop.status('by serial_rig: the board has taken no command')


def test_broken_sensor_shows_as_nan_and_a_missing_supply_not_at_all(graph, port):
    """A nan is for the watches of the controllers; an empty supply field is no reading."""
    board = FakeBoard(port)
    board.force, board.supply_text = 'nan', ''
    loop = Loop(graph, board)
    force = graph.listen('force', WrenchStamped)
    supply = graph.listen('supply/pressure', FluidPressure)
    loop.until(lambda: len(force) > 5, 'force')
    assert math.isnan(force[-1].wrench.force.x)
    assert supply == []
