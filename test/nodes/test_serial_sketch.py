# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The sketch of docs/how_to/serial_rig.md is compiled and keeps the rules that stand above it."""

import os
from pathlib import Path
import pty
import re
import shutil
import subprocess
import time
import tty

import pytest
import yaml

pytest.importorskip('serial', reason='pyserial is not installed')

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.serial_parameters import scale_specs, SPECS
from fam_bundle_ros.nodes.serial_protocol import (
    BoardSample,
    command_line,
    frame,
    Hello,
    hello_line,
    LineSplitter,
    read_line,
)
from fam_bundle_ros.nodes.serial_rig import SerialRig

pytestmark = pytest.mark.skipif(not shutil.which('g++'), reason='g++ is not installed')


@pytest.fixture(scope='module')
def page(repository):
    """Return the page of serial_rig."""
    return (repository / 'docs/how_to/serial_rig.md').read_text()


@pytest.fixture(scope='module')
def program(page, tmp_path_factory):
    """Return the compiled sketch."""
    folder = tmp_path_factory.mktemp('sketch')
    source = folder / 'sketch.cpp'
    source.write_text(re.search(r'```cpp\n(.*?)```', page, re.DOTALL)[1])
    built = subprocess.run(
        ['g++', '-Wall', '-Werror', '-Wno-sign-compare', '-include',
         str(Path(__file__).with_name('arduino.h')), '-o', str(folder / 'sketch'), str(source)],
        capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return folder / 'sketch'


class Sketch:
    """The sketch at one end of a serial line."""

    def __init__(self, program):
        self.far, near = pty.openpty()
        tty.setraw(near)
        self.url = os.ttyname(near)
        self._process = subprocess.Popen([program], stdin=self.far, stdout=self.far)
        self._near = near
        os.set_blocking(near, False)
        self._splitter = LineSplitter()
        self.sample = self.hello = None
        self._number = 0

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self.far)
        os.close(self._near)

    def send(self, line):
        os.write(self._near, line)

    def listen(self):
        """Take what has come."""
        try:
            data = os.read(self._near, 4096)
        except BlockingIOError:
            time.sleep(1e-3)
            return
        for line in self._splitter.feed(data):
            said = read_line(line)
            if isinstance(said, Hello):
                self.hello = said
            else:
                self.sample = said

    def command(self, valves, *, late=0, supply=True, stop=False):
        """Answer the newest sample."""
        self._number += 1
        self.send(command_line(self._number, self.sample.time - late, supply, stop, valves))

    def until(self, condition, what, command=None):
        end = time.monotonic() + 15.0
        while self.sample is None or not condition(self.sample):
            before = self.sample
            self.listen()
            if command and self.sample is not before:
                command()
            if time.monotonic() > end:
                pytest.fail(f'waited 15 s for: {what}; {self.sample}')

    def fill(self):
        self.until(lambda s: min(s.pressure) > 150.0, 'pressure',
                   lambda: self.command([1.0, 1.0]))


@pytest.fixture
def sketch(program):
    """Yield the sketch, powered on."""
    sketch = Sketch(program)
    yield sketch
    sketch.close()


def test_says_hello_and_starts_without_air(sketch):
    """It answers with version and motor units, and sends samples from the start."""
    sketch.until(lambda s: True, 'a sample')
    sketch.send(hello_line())
    sketch.until(lambda s: sketch.hello, 'hello')
    assert sketch.hello == Hello(1, 2, 'sketch')
    assert isinstance(sketch.sample, BoardSample)
    assert (sketch.sample.air, sketch.sample.command, sketch.sample.pressure) == (2, 0, (0, 0))


def test_vents_when_commands_stop(sketch):
    """Filled, then silence: the supply shuts and the muscles empty."""
    sketch.fill()
    assert sketch.sample.air == 0
    sketch.until(lambda s: s.air == 2 and s.supply == 0.0 and max(s.pressure) < 5.0, 'the vent')


@pytest.mark.parametrize(('words', 'air'), [
    ({'supply': False}, 1), ({'stop': True}, 1), ({'stop': True, 'late': 10_000_000}, 1)])
def test_vents_when_told(sketch, words, air):
    """Supply 0 or stop 1, a stop however old it is."""
    sketch.fill()
    sketch.until(lambda s: s.air == air and max(s.pressure) < 5.0, 'the vent',
                 lambda: sketch.command([1.0, 1.0], **words))


@pytest.mark.parametrize('spoil', [
    lambda sketch: sketch.command([1.0, 1.0], late=250_000),
    lambda sketch: sketch.command([1.0]),
    lambda sketch: sketch.command([1.0, 1.0, 1.0]),
    lambda sketch: sketch.command([1.0, 1.5]),
    lambda sketch: sketch.send(command_line(9, sketch.sample.time, True, False, [1.0, 1.0])
                               .replace(b',1000', b',1001', 1)),
    lambda sketch: sketch.send(b'C' * 300 + command_line(
        9, sketch.sample.time, True, False, [1.0, 1.0])),
    lambda sketch: sketch.send(frame(f'D,9,{sketch.sample.time},1,0,1000,1000')),
], ids=['late', 'one valve', 'three valves', 'too far', 'wrong CRC', 'too long', 'other letter'])
def test_obeys_no_wrong_command(sketch, spoil):
    """A command that is late, garbled, or not for this board is none."""
    sketch.until(lambda s: s.number > 60, 'samples', lambda: spoil(sketch))
    assert (sketch.sample.command, sketch.sample.pressure) == (0, (0, 0))
    sketch.fill()


def test_trips_by_itself_until_told_to_stop(page, tmp_path):
    """Above its limit it vents; commands alone do not bring the air back, stop 1 does."""
    low = tmp_path / 'low.cpp'
    low.write_text(re.search(r'```cpp\n(.*?)```', page, re.DOTALL)[1].replace(
        'LIMIT = 450', 'LIMIT = 200'))
    subprocess.run(['g++', '-include', str(Path(__file__).with_name('arduino.h')), '-o',
                    str(tmp_path / 'low'), str(low)], check=True)
    board = Sketch(tmp_path / 'low')
    try:
        board.until(lambda s: s.air == 4 and max(s.pressure) < 5.0, 'the trip',
                    lambda: board.command([1.0, 0.0]))
        number = board.sample.number
        board.until(lambda s: s.number > number + 50, 'samples',
                    lambda: board.command([0.2, 0.0]))
        assert (board.sample.air, board.sample.supply) == (4, 0.0)
        board.until(lambda s: s.air == 1, 'the end of the trip',
                    lambda: board.command([0.0, 0.0], stop=True))
        board.until(lambda s: s.air == 0, 'air', lambda: board.command([0.2, 0.0]))
    finally:
        board.close()


def test_sketch_and_serial_rig_speak_with_each_other(graph, sketch):
    """Over ROS: pressure comes, and goes when supply_enable falls silent."""
    graph.add(SerialRig(context=graph.context, overrides={
        'url': sketch.url, 'start_stopped': False, 'board_timeout': 10.0}))
    pressure = graph.listen('mu2/pressure', FluidPressure)
    states = graph.diagnostics('serial_rig')
    valves = [graph.probe.create_publisher(JointState, f'mu{i}/valve_command', 10)
              for i in (1, 2)]
    enable = graph.probe.create_publisher(Bool, 'supply_enable', 10)

    def answer(message):
        for unit, publisher in enumerate(valves, 1):
            publisher.publish(interface.valve_message(
                interface.stamp_ns(message.header.stamp), unit, 1.0))
    graph.probe.create_subscription(FluidPressure, 'mu2/pressure', answer, 10)
    beat = graph.probe.every(0.05, lambda: enable.publish(Bool(data=True)))
    graph.until(lambda: pressure and pressure[-1].fluid_pressure > 250e3, 'pressure')
    beat.cancel()
    graph.until(lambda: pressure[-1].fluid_pressure < 110e3, 'the vent')
    graph.until(lambda: any('nothing on supply_enable for 0.5 s' in pair.value
                            for state in states for pair in state.values), 'why')


def test_page_has_every_parameter(page):
    """Name and default of each, as the node declares them."""
    rows = dict(re.findall(r'^\| `([\w.]+)` \| ([^|]+?) \|', page, re.MULTILINE))
    for spec in (*SPECS, *scale_specs(1)):
        default = spec.default
        shown = (str(default).lower() if isinstance(default, bool)
                 else f"'{default}'" if isinstance(default, str) else f'{default:g}')
        assert rows.pop(spec.name) == shown
    assert {name for name in rows if '.' in name or '_' in name} == set()


def test_example_parameters_are_the_defaults(repository):
    """The parameter file that ships names every parameter, with the type and value of the node."""
    text = (repository / 'config/examples/serial_rig.yaml').read_text()
    given = yaml.safe_load(text)['/**']['ros__parameters']
    assert given.pop('ambient_pressure') == 101325.0
    defaults = {spec.name: spec.default for spec in (*SPECS, *scale_specs(2))}
    assert given == defaults
    assert {name: type(value) for name, value in given.items()} == {
        name: type(value) for name, value in defaults.items()}
