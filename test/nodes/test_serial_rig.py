# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""serial_rig over real ROS, against a board on a pseudo terminal or a TCP socket."""

import math
import random
import signal
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
import pytest

pytest.importorskip('serial', reason='pyserial is not installed')

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.serial_rig import SerialRig

from .board import FakeBoard, Pty, Tcp

AMBIENT = 101325.0
#: A machine that is busy with other tests is not what most of these are about.
PATIENT = {'board_timeout': 10.0, 'command_timeout': 5.0}


class Loop:
    """A rig, its board, and a controller that answers pressures with what a test says."""

    def __init__(self, graph, board, **overrides):
        self.graph, self.board = graph, board
        self.valves = dict.fromkeys(range(1, board.units + 1), 0.5)
        self.enable = True
        self.rig = graph.add(SerialRig(context=graph.context, overrides={
            'url': board.port.url, 'units': board.units, 'start_stopped': False,
            'reconnect_interval': 0.1, **PATIENT, **overrides}))
        self.diagnostics = graph.listen('/diagnostics', DiagnosticArray)
        self.stops = graph.listen('e_stop', Bool, interface.LATCHED)
        self.pressure = {}
        for unit in self.valves:
            self._answer(unit)
        self._enable = graph.probe.create_publisher(Bool, 'supply_enable', 10)
        graph.probe.every(0.005, board.step)
        graph.probe.every(0.05, self._beat)

    def _answer(self, unit):
        probe = self.graph.probe
        publisher = probe.create_publisher(JointState, interface.valve_topic(unit), 10)
        heard = self.pressure[unit] = []

        def answer(message):
            heard.append(message)
            if self.valves[unit] is not None:
                stamp = interface.stamp_ns(message.header.stamp)
                publisher.publish(interface.valve_message(stamp, unit, self.valves[unit]))
        probe.create_subscription(FluidPressure, interface.pressure_topic(unit), answer, 10)

    def _beat(self):
        if self.enable is not None:
            self._enable.publish(Bool(data=self.enable))

    def until(self, condition, what, seconds=15.0):
        self.graph.until(condition, what, seconds)

    @property
    def stopped(self):
        """What e_stop said last; None before it said anything."""
        return self.stops[-1].data if self.stops else None

    def filled(self):
        """Both units are under pressure."""
        self.until(lambda: min(self.board.pressure) > 100.0, 'pressure')

    def vented(self):
        self.until(lambda: max(self.board.pressure) < 5.0 and not self.board.supply, 'vented')

    def reset(self):
        return self.graph.call(Trigger, 'e_stop_reset')

    def status(self, text=''):
        """Return diagnostics of now, once a message or value says a text."""
        def find():
            for message in reversed(self.diagnostics):
                status = message.status[0]
                if status.name == 'bundle/serial_rig':
                    values = {pair.key: pair.value for pair in status.values}
                    return status, values
            return None
        self.diagnostics.clear()

        def says():
            self.rig._diagnostics.publish()
            self.graph.spin()
            return find() and text in ' '.join((find()[0].message, *find()[1].values()))
        self.until(says, f'diagnostics: {text}')
        return find()


@pytest.fixture(params=[Pty, Tcp], ids=['pty', 'tcp'])
def any_port(request, tmp_path):
    """Yield a serial port and then a TCP port."""
    port = request.param(tmp_path)
    yield port
    port.close()


@pytest.fixture
def port(tmp_path):
    """Yield a serial port."""
    port = Pty(tmp_path)
    yield port
    port.close()


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


def test_error_while_a_line_is_read_stops_the_rig_and_not_the_process(graph, port):
    """What nobody has foreseen shuts air and valves, says what it was, and the node goes on."""
    loop = Loop(graph, FakeBoard(port))
    loop.valves = {1: 0.25, 2: 0.25}
    loop.until(lambda: loop.board.valves == [250, 250] and loop.board.supply, 'the command')
    readings = loop.rig._scales.readings

    def broken(sample):
        raise ZeroDivisionError('no such scale')
    loop.rig._scales.readings = broken
    loop.until(lambda: loop.board.valves == [-1000, -1000] and not loop.board.supply, 'the vent')
    loop.status('ZeroDivisionError: no such scale')
    loop.rig._scales.readings = readings
    count = len(loop.pressure[1])
    loop.until(lambda: len(loop.pressure[1]) > count, 'readings again')


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


def test_last_line_of_a_process_vents(graph, port):
    """Ctrl-C: the board hears stop, the status is 0."""
    board = FakeBoard(port, units=1)
    process = subprocess.Popen(
        [sys.executable, '-c', 'import sys; from fam_bundle_ros.nodes.serial_rig import main; '
         'sys.argv[0] = "serial_rig"; sys.exit(main())', '--ros-args', '-p', f'url:={port.url}',
         '-p', 'units:=1', '-p', 'start_stopped:=false'],
        stderr=subprocess.PIPE, text=True)
    graph.probe.every(0.005, board.step)
    graph.until(lambda: len(board.heard) > 5, 'commands')
    assert board.heard[-1][3] == 0
    process.send_signal(signal.SIGINT)
    graph.until(lambda: process.poll() is not None, 'the end')
    graph.until(lambda: board.heard[-1][2:] == (0, 1, [-1000]), 'the vent')
    _, errors = process.communicate()
    assert process.returncode == 0
    assert 'Traceback' not in errors


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
