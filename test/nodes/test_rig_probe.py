# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A rig that is probed with air: one simulator process, faults one after another by service."""

import itertools
import json
from pathlib import Path
import re

import pytest
from rclpy.context import Context
from sensor_msgs.msg import FluidPressure

from fam_bundle_ros.cli.rig_commands import check_rig
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import refuse_unknown
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.rig_hand import Hand, Session
from fam_bundle_ros.nodes.rig_probe import probe_rig
from fam_bundle_ros.nodes.rig_unit import Probe, UnitProbe

SUPPLY = 120e3


@pytest.fixture
def simulator(graph, start):
    """Yield a function that sets parameters of a simulated rig at low supply, in a process."""
    process = start('plant_simulator', '--ros-args', *(item for name, value in {
        'supply.pressure': SUPPLY, 'start_stopped': 'false', 'load.kind': 'dynamometer',
        'valve.conductance': 3.0e-9, 'valve.dead_band': 0.07,
        'valve.delay': 0.008}.items() for item in ('-p', f'{name}:={value}')))
    yield lambda **values: graph.set('plant_simulator', **values)
    process.terminate()
    process.communicate(timeout=60)


def failed(probe):
    """Return what failed, in words."""
    return [f'{finding.what}: {finding.detail}' for finding in probe.findings if not finding.ok]


def test_a_file_that_cannot_be_written_is_refused_before_a_valve_opens():
    """The measured values would be lost."""
    with pytest.raises(InputError, match='/proc/rig.yaml: cannot be written'):
        check_rig('nowhere', 0.5, 'spie2021', active=True, yes=True, out=Path('/proc/rig.yaml'))


def test_a_rig_is_probed(simulator, paper_bundle, domain_id, tmp_path):
    """A sound rig gives a file that controllers start from; each fault is named, and vents."""
    def probe():
        return probe_rig(paper_bundle, SUPPLY, domain=domain_id, patience=15.0)
    simulator()
    written, told = tmp_path / 'rig.yaml', tmp_path / 'found.json'
    check_rig('bundle', 0.5, 'spie2021', active=True, supply='120 kPa', yes=True, out=written,
              json_file=told)
    found = json.loads(told.read_text())['parameters']
    assert found['valve.conductance'] == pytest.approx(3.0e-9, rel=0.1)
    assert found['valve.dead_band'] == pytest.approx(0.07, abs=0.01)
    # The spool's own lag is not in it; a busy machine may answer a sample later.
    assert 0.006 < found['transport_delay'] < 0.016
    assert found['outer.delay'] == pytest.approx(
        max(found['transport_delay'], 1.0 / found['rate']), abs=1e-4)
    assert found['quiet_error'] == pytest.approx(3 * 350.0, rel=0.3)
    assert (found['pressure_is_gauge'], found['rate']) == (False, pytest.approx(200.0, rel=0.02))
    assert_controllers_start(written, found, domain_id)

    simulator(faults__units='mu1/pressure=kPa', faults__gain='mu2/pressure=0.5',
              command_timeout=1.0)
    assert_says(probe(), 'mu1 valve: commanded to fill by', r'mu2 scale: shows (59\.[89]|60)',
                'mu2 watchdog: stays at')
    simulator(faults__units='', faults__gain='force=-1.0', faults__leak='mu1=0.3',
              command_timeout=0.1, supply_timeout=10.0)
    assert_says(probe(), 'mu1 tightness: loses', 'mu2 force: changed by -',
                'supply_enable: mu2 stays at')
    simulator(faults__gain='', faults__leak='', faults__reversed_valve='mu1', faults__supply=5.0)
    assert_says(probe(), 'vented: supply/pressure shows')
    simulator(faults__supply=1.0, faults__exchanged_valves='mu1=mu2')
    # mu1's command goes to mu2's valve, which is in order; the other way it is reversed.
    assert_says(probe(), 'mu1 valve: reversed', 'mu2 valve: commanded to fill')
    with pytest.raises(InputError, match='supply is 600 kPa; expected a low one'):
        probe_rig(paper_bundle, 600e3, domain=domain_id)


def assert_says(probe, *words):
    """A probe that failed in these ways leaves no parameters."""
    text = '\n'.join(failed(probe))
    for word in words:
        assert re.search(word, text)
    assert probe.parameters == {}


def assert_controllers_start(written, found, domain_id):
    """Start controllers from a parameter file and look at what they were told."""
    context = Context()
    context.init(args=['--ros-args', '--params-file', str(written)], domain_id=domain_id)
    nodes = [PressurePidNode(1, context=context), RecruitmentNode(context=context)]
    try:
        refuse_unknown(nodes)
        for name, value in found.items():
            told = [node.p[name] for node in nodes if node.has_parameter(name)]
            assert told, name
            assert set(told) == {value}, name
    finally:
        for node in nodes:
            node.destroy_node()
        context.try_shutdown()


def test_a_rig_that_is_slower_than_the_clock_gets_its_own_time(graph):
    """A rig whose time runs at a quarter of the clock's: a wait of 0.2 s is 0.2 s of the rig."""
    hand = graph.add(Hand(graph.context, interface.NAMESPACE, 1, 0.127))
    publisher = graph.probe.create_publisher(
        FluidPressure, interface.pressure_topic(1), interface.PUBLISH)
    stamps = itertools.count(10**9, 5 * 10**6)
    graph.probe.every(0.02, lambda: publisher.publish(
        interface.pressure_message(next(stamps), 0.0, 101325.0)))
    graph.until(lambda: hand.pressure[0].rows, 'a pressure')
    first = hand.pressure[0].rows[-1][1]
    assert not Session(hand, graph.spinner, lambda: False).wait(0.2)
    assert hand.pressure[0].rows[-1][1] - first == pytest.approx(0.2, abs=0.011)


def test_readings_that_drop_out_are_no_leak(graph, paper_bundle):
    """Each reading is answered by a command; without any the driver exhausts, as it must."""
    hand = graph.add(Hand(graph.context, interface.NAMESPACE, 2, 0.127))
    publishers = [graph.probe.create_publisher(FluidPressure, interface.pressure_topic(unit),
                                               interface.PUBLISH) for unit in (1, 2)]
    shut = itertools.count()

    def publish():
        since = next(shut) if hand.command[0] == 0.0 else 0
        for publisher in publishers[10 <= since < 48:]:
            publisher.publish(interface.pressure_message(
                graph.probe.now_ns(), 1e5 if since < 48 else 0.0, 0.0))
    graph.probe.every(5e-3, publish)
    graph.until(lambda: all(len(channel.rows) > 5 for channel in hand.pressure), 'pressures')
    found = Probe()
    UnitProbe(Session(hand, graph.spinner, lambda: False), found, paper_bundle, SUPPLY, 5e-6
              )._answers_silence(0)
    tight = next(each for each in found.findings if each.what == 'mu1 tightness')
    assert tight.detail.startswith('not known: no reading for 0.')
