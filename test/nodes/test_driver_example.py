# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The driver that users copy keeps the contract of docs/how_to/driver.md."""

from importlib.util import module_from_spec, spec_from_file_location
import math
import re
import signal
import subprocess
import sys

from geometry_msgs.msg import WrenchStamped
import pytest
from rclpy.exceptions import InvalidHandle
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.rig_check import check_rig
from fam_bundle_ros.resources import config_path

DRIVER = config_path('examples/driver.py')


class FakeBoard:
    """Valves, a supply and two muscles, 5 ms a call."""

    def __init__(self):
        self.pressure = [0.0, 0.0]
        self.button = self.supply = False
        self.valves = [-1.0, -1.0]
        self.written = []

    def read(self):
        return 12.5, 0.01, [101325.0 + value for value in self.pressure], self.button

    def write(self, supply, valves):
        self.supply, self.valves = supply, valves
        self.written.append((supply, *valves))
        for i, valve in enumerate(valves):
            goal = 400e3 * supply if valve > 0.0 else 0.0
            self.pressure[i] += 0.1 * abs(valve) * (goal - self.pressure[i])


@pytest.fixture(scope='module')
def example():
    """Return the example as a module, patient: the machine may be busy."""
    spec = spec_from_file_location('driver_example', DRIVER)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Loop:
    """The driver, its board, and a controller that says what a test wants."""

    def __init__(self, graph, example):
        self.graph, self.board = graph, FakeBoard()
        self.valve, self.enable, self.delay = 0.5, True, 0
        graph.spin(0.0)
        self.node = example.Driver(self.board, context=graph.context)
        graph.spinner.executor.add_node(self.node)
        self.stops = graph.listen('e_stop', Bool, interface.LATCHED)
        self.pressure = graph.listen('mu1/pressure', FluidPressure)
        self._valves = [graph.probe.create_publisher(JointState, f'mu{i}/valve_command', 10)
                        for i in (1, 2)]
        self._enable = graph.probe.create_publisher(Bool, 'supply_enable', 10)
        graph.probe.create_subscription(FluidPressure, 'mu2/pressure', self._answer, 10)
        graph.probe.every(0.05, self._beat)

    def _answer(self, message):
        if self.valve is not None:
            stamp = interface.stamp_ns(message.header.stamp) + self.delay
            for unit, publisher in enumerate(self._valves, 1):
                publisher.publish(interface.valve_message(stamp, unit, self.valve))

    def _beat(self):
        if self.enable is not None:
            self._enable.publish(Bool(data=self.enable))

    def filled(self):
        self.graph.until(lambda: min(self.board.pressure) > 100e3, 'pressure')

    def vented(self):
        self.graph.until(lambda: max(self.board.pressure) < 5e3, 'vented')


@pytest.fixture
def loop(graph, example, monkeypatch):
    """Yield a driver at work; the time-outs wait for a machine that is busy."""
    monkeypatch.setattr(example, 'COMMAND_TIMEOUT', 0.5)
    loop = Loop(graph, example)
    yield loop
    graph.spinner.executor.remove_node(loop.node)
    loop.node.destroy_node()


def test_valves_do_not_wait_for_what_is_published(loop):
    """A publish may block, or fail as here: the board has been told before."""
    before = len(loop.board.written)
    loop.node.destroy_publisher(loop.node.force)
    with pytest.raises(InvalidHandle):
        loop.node.tick()
    assert len(loop.board.written) == before + 1


def test_no_command_is_skipped(graph, loop):
    """Of two that come between two ticks: a test pulse is a single command."""
    loop.filled()
    loop.valve = None
    now = graph.probe.now_ns()
    before = len(loop.board.written)
    for value in (0.25, 0.75):
        loop.node.on_valve(0, interface.valve_message(now, 1, value))
    assert [valve for _, valve, _ in loop.board.written[before:]] == [0.25, 0.75]


def test_a_clock_that_stands_still_keeps_no_valve_open(loop):
    """/clock pauses, or the machine's clock is set back, just when the controller ends."""
    loop.filled()
    clock = loop.node.get_clock()
    clock.set_ros_time_override(clock.now())
    clock._set_ros_time_is_active(True)
    loop.valve = None
    loop.vented()


def test_readings_are_as_the_interface_says(graph, loop):
    """N, m, absolute Pa; all channels of a sample carry one stamp."""
    force = graph.listen('force', WrenchStamped)
    strain = graph.listen('strain', JointState)
    graph.until(lambda: min(map(len, (force, strain, loop.pressure))) > 5, 'readings')
    assert (force[-1].wrench.force.x, force[-1].header.frame_id) == (12.5, 'load_cell')
    assert interface.read_strain(strain[-1], 0.1)[0] == pytest.approx(0.1)
    assert loop.pressure[0].fluid_pressure >= 101325.0
    stamps = [{interface.stamp_ns(m.header.stamp) for m in messages}
              for messages in (force, strain, loop.pressure)]
    assert len(stamps[0] & stamps[1] & stamps[2]) >= 5
    assert not loop.stops[-1].data


def test_air_flows_while_it_is_commanded_and_allowed(loop):
    """Fresh commands and supply_enable fill; without commands the valves exhaust."""
    loop.filled()
    assert loop.board.supply
    loop.valve = None
    loop.vented()
    assert loop.board.supply


@pytest.mark.parametrize('enable', [False, None])
def test_without_supply_enable_the_supply_is_cut_and_dumped(loop, enable):
    """False, or silence; it opens again with true."""
    loop.filled()
    loop.enable = enable
    loop.vented()
    assert (loop.board.supply, *loop.board.valves) == (False, -1.0, -1.0)
    loop.enable = True
    loop.filled()


@pytest.mark.parametrize(('value', 'unit'), [(math.nan, 1), (7.0, 1), (0.5, 2)])
def test_impossible_command_is_none(graph, loop, value, unit):
    """A command that is no number from -1 to 1, or for another joint, counts as silence."""
    publisher = graph.probe.create_publisher(JointState, 'mu1/valve_command', 10)
    loop.filled()
    loop.valve = None
    timer = graph.probe.every(0.01, lambda: publisher.publish(
        interface.valve_message(graph.probe.now_ns(), unit, value)))
    loop.vented()
    timer.cancel()


@pytest.mark.parametrize('delay', [-1_000_000_000, 3_600_000_000_000])
def test_old_commands_open_nothing_and_those_of_the_future_do_not_last(graph, loop, delay):
    """The age of a command is that of its stamp, never less than since it came."""
    loop.delay = delay
    if delay < 0:
        graph.until(lambda: len(loop.board.written) > 100, 'some time')
        assert {valves for _, *valves in map(tuple, loop.board.written)
                for valves in [tuple(valves)]} == {(-1.0, -1.0)}
    else:
        loop.filled()
        loop.valve = None
        loop.vented()


def test_stop_button_vents_and_is_told(graph, loop):
    """The last e_stop is kept for those who come later."""
    loop.filled()
    loop.board.button = True
    loop.vented()
    assert not loop.board.supply
    late = graph.listen('e_stop', Bool, interface.LATCHED)
    graph.until(lambda: late, 'the latched message')
    assert late[-1].data


def test_check_rig_finds_nothing_wrong_and_ctrl_c_vents(graph, domain_id, tmp_path):
    """The example as a process: check-rig passes; its last word to the board is to vent."""
    written = tmp_path / 'written'
    written.touch()
    process = subprocess.Popen([sys.executable, '-c', f"""
import random, runpy
names = runpy.run_path({str(DRIVER)!r})
class Board:
    def __init__(self):
        self.out = open({str(written)!r}, 'w', buffering=1)
    def read(self):
        noise = random.gauss(0.0, 1.0)
        return 50.0 + 0.1 * noise, 0.006 + 1e-6 * noise, [101325.0 + 100.0 * noise] * 2, False
    def write(self, supply, valves):
        print(supply, valves, file=self.out)
names['main'].__globals__['Board'] = Board
names['main']()
"""], stderr=subprocess.PIPE, text=True)
    findings = check_rig(seconds=0.5, forces=(-200.0, 5000.0), units=2, domain=domain_id,
                         patience=15.0)
    enable = graph.probe.create_publisher(Bool, 'supply_enable', 10)
    graph.probe.every(0.05, lambda: enable.publish(Bool(data=True)))
    graph.until(lambda: written.read_text().endswith('True [-1.0, -1.0]\n'), 'supply')
    process.send_signal(signal.SIGINT)
    graph.until(lambda: process.poll() is not None, 'the end')
    _, errors = process.communicate()
    assert [str(finding) for finding in findings if not finding.ok
            if finding.what != 'supply/pressure'] == []
    assert {'force rate', 'mu2/pressure rate', 'e_stop'} <= {each.what for each in findings}
    assert process.returncode == 0, errors
    assert written.read_text().endswith('False [-1.0, -1.0]\n')


def test_page_names_topics_and_types_of_the_interface(repository):
    """The page of drivers lists what a rig sends and takes, with the types of the interface."""
    page = (repository / 'docs/how_to/driver.md').read_text()
    rows = dict(re.findall(r'^\| `([\w/<>]+)` \| (\w+/\w+) \| (?:in|out)', page, re.MULTILINE))
    known = {re.sub(r'^mu1', 'mu<i>', topic.name): topic.type_name.replace('/msg', '')
             for topic in interface.topics(1)}
    assert {name: known.get(name, kind) for name, kind in rows.items()} == rows
    assert {'force', 'strain', 'mu<i>/pressure', 'supply/pressure', 'e_stop',
            'mu<i>/valve_command', 'supply_enable', 'reference/dynamometer'} == set(rows)
