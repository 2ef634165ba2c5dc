# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The controllers on a rig with faults of its own, over real ROS, with config/rig.yaml."""

from collections import deque
import math
import signal
import time
from types import SimpleNamespace

from geometry_msgs.msg import WrenchStamped
import pytest
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, Float64, String
import yaml

from fam_bundle_ros.control.plausibility import GENTLE
from fam_bundle_ros.control.safety import Health
from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.diagnostics import Report
from fam_bundle_ros.nodes.pressure_pid import PressurePidNode
from fam_bundle_ros.nodes.process import ros_context
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.supply_enable import SupplyEnable
from fam_bundle_ros.plant import Dynamometer, Rig, RigConfig, SupplyConfig
from fam_bundle_ros.resources import config_path

from .whole_bundle import warnings_of

PERIOD = 5e-3
AMBIENT = 101325.0
TRIP = 396.4e3
#: Pa, what a fully open valve lets in during two periods near the trip.
TWO_PERIODS = 140e3


class FaultyRig:
    """A rig that obeys docs/how_to/driver.md, with sensors and valves that may be wrong."""

    def __init__(self, graph, force, e_stop=True, supply=True, latency=0.1):
        self.graph, self.force, self.latency = graph, force, latency
        self.rig = Rig(load_model(config_path('models/spie2021.yaml')), RigConfig(
            load=Dynamometer(strain=0.1), supply=SupplyConfig(pressure=600e3), trip_pressure=1e7))
        #: What goes wrong: pressures shown, valve commands that arrive, s of delay, stamp or not.
        self.shown = lambda pressure: pressure
        self.valves = lambda commands: commands
        self.late, self.stamped, self.ambient = 0.0, True, AMBIENT
        self.commands, self.leave = [(-1.0, 0), (-1.0, 0)], (False, 0)
        self.highest, self.leaves, self.queue = 0.0, [], deque()
        #: When the rig was last moved, ns; s for which this process waited for its turn at most.
        self.moved, self.held_up = graph.probe.now_ns(), 0.0
        probe, make = graph.probe, graph.probe.create_publisher
        self.outputs = [(make(WrenchStamped, 'force', 10), interface.force_message),
                        (make(JointState, 'strain', 10), lambda stamp, strain:
                         interface.strain_message(stamp, strain, 0.0, 0.127))]
        self.outputs += [(make(FluidPressure, topic, 10), self.pressure) for topic in (
            'mu1/pressure', 'mu2/pressure', *(['supply/pressure'] if supply else []))]
        self.reference = make(WrenchStamped, 'reference/force', 10)
        if e_stop:
            make(Bool, 'e_stop', interface.LATCHED).publish(Bool(data=False))
        for unit in (1, 2):
            def command(message, unit=unit):
                self.commands[unit - 1] = (message.effort[0],
                                           interface.stamp_ns(message.header.stamp))
            probe.create_subscription(JointState, interface.valve_topic(unit), command, 1)
        probe.create_subscription(Bool, 'supply_enable', self.take, interface.RELIABLE)
        probe.every(PERIOD, self.tick)

    def pressure(self, stamp, value):
        return interface.pressure_message(stamp, value, self.ambient)

    def take(self, message):
        self.leave = message.data, self.graph.probe.now_ns()
        self.leaves.append(message.data)

    def tick(self):
        # a rig goes on while this process waits for its turn
        now, before = self.graph.probe.now_ns(), self.moved
        self.held_up = max(self.held_up, (now - before) * 1e-9 - PERIOD)
        given = self.leave[0] and before - self.leave[1] < 500_000_000
        self.rig.open_supply(given)
        while self.moved < now:
            self.moved += round(1e9 * PERIOD)
            self.rig.step(self.valves([
                command if given and (before - stamp < 1e9 * self.latency or self.late) else -1.0
                for command, stamp in self.commands]), PERIOD)
            self.highest = max(self.highest, *self.rig.truth.pressure)
        read = self.rig.readings
        self.queue.append((now, (read.force, read.strain, *self.shown(read.pressure.tolist()),
                                 read.supply if self.ambient else read.supply * 1e-3)))
        while len(self.queue) > 1 and now - self.queue[1][0] >= self.late * 1e9:
            self.queue.popleft()
        stamp, values = self.queue[0]
        if now - stamp >= self.late * 1e9:
            for (publisher, write), value in zip(self.outputs, values):
                publisher.publish(write(stamp if self.stamped else 0, value))
        self.reference.publish(interface.force_message(now, self.force(now * 1e-9)))


@pytest.fixture
def rig(graph):
    """Return a function that adds the rig and the controllers; enabled unless told otherwise."""
    def begin(force=lambda t: 60.0, enable=True, pids=(1, 2), gauge=False, latency=0.1,
              **keywords):
        # Timeouts of a machine that does other things too; limits and latches are the rig's.
        values = {**yaml.safe_load(config_path('rig.yaml').read_text())['/**']['ros__parameters'],
                  'sensor_timeout': 1.0, 'max_latency': latency, 'pressure_is_gauge': gauge}
        graph.add(*[PressurePidNode(unit, context=graph.context, overrides=values)
                    for unit in pids],
                  RecruitmentNode(context=graph.context, overrides=values))
        rig = FaultyRig(graph, force, latency=latency, **keywords)
        rig.node = graph._nodes[-1]
        if enable:
            graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
            assert graph.enable().success
        return rig
    return begin


def sine(time):
    """Return a reference that fills and vents all the time."""
    return 60.0 + 30.0 * math.sin(6.28 * time)


def enabled(graph):
    """Ask for enable; return success and message."""
    answer = graph.enable()
    return answer.success, answer.message


def vented(graph, rig):
    """Wait until the bundle is latched, its supply cut, and empty."""
    graph.until(lambda: rig.node._guard.latched, 'the latch')
    graph.until(lambda: rig.leaves[-1] is False, 'supply_enable false')
    graph.until(lambda: max(rig.rig.truth.pressure) < 5e3, 'empty')
    assert rig.highest < TRIP + TWO_PERIODS


def test_a_sound_rig_is_controlled_without_an_alarm(graph, rig):
    """supply_enable is false before enable, true after it, at 10 Hz, and nothing latches."""
    # samples of a machine that does other things are late: that would be an alarm
    rig = rig(sine, enable=False, latency=1.0)
    graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
    assert set(rig.leaves) <= {False}
    assert enabled(graph) == (True, 'on, from the pressures as they are')
    graph.until(lambda: max(rig.rig.truth.pressure) > 150e3, 'pressure')
    count, begun = len(rig.leaves), time.monotonic()
    graph.spin(1.0)
    seconds = time.monotonic() - begun
    assert set(rig.leaves[count:]) == {True}
    assert 7.0 <= (len(rig.leaves) - count) / seconds <= 12.0
    assert not rig.node._guard.latched


@pytest.mark.parametrize('supply', [True, False])
def test_gauge_kilopascals_let_no_air_in(graph, rig, supply):
    """The unit that check-rig's hint leads to, with and without a supply that tells."""
    rig = rig(enable=False, gauge=True, supply=supply)
    rig.ambient, rig.shown = 0.0, lambda pressure: [1e-3 * p for p in pressure]
    graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
    assert enabled(graph)[0]
    vented(graph, rig)
    # besides what a full valve lets in while a busy machine holds this process up
    assert rig.highest < 200e3 + TWO_PERIODS * rig.held_up / (2.0 * PERIOD)
    # Where samples are late the air of the trial may be told by its force first.
    assert rig.node._guard.word in ({'SUPPLY'} if supply else {'NO_RESPONSE', 'FORCE'})


FAULTS = {
    'half': (lambda rig: setattr(rig, 'shown', lambda p: [0.5 * x for x in p])),
    'exchanged': (lambda rig: setattr(rig, 'shown', lambda p: p[::-1])),
    'late': (lambda rig: setattr(rig, 'late', 0.3)),
    'no stamps': (lambda rig: setattr(rig, 'stamped', False)),
    'reversed': (lambda rig: setattr(rig, 'valves', lambda c: [-x for x in c])),
    'hangs open': (lambda rig: setattr(rig, 'valves', lambda c: [1.0, c[1]])),
}


def freeze(rig):
    """Let the pressures stand still as they are now."""
    last = rig.rig.readings.pressure.tolist()
    rig.shown = lambda pressure: last


@pytest.mark.parametrize('fault', [*FAULTS, 'frozen'])
def test_fault_at_work_latches_and_comes_back_by_enable_only(graph, rig, fault):
    """Found in a sine, below trip and two periods of air; repaired, it stays vented."""
    rig = rig(sine)
    graph.until(lambda: max(rig.rig.truth.pressure) > 150e3, 'pressure')
    graph.spin(0.4)
    FAULTS.get(fault, freeze)(rig)
    vented(graph, rig)
    rig.shown, rig.valves, rig.late, rig.stamped = (lambda p: p), (lambda c: c), 0.0, True
    graph.spin(0.6)
    assert max(rig.rig.truth.pressure) < 5e3
    graph.until(lambda: enabled(graph)[0], 'enable')
    graph.until(lambda: max(rig.rig.truth.pressure) > 150e3, 'pressure')


@pytest.mark.parametrize('fault', ['half', 'exchanged', 'reversed'])
def test_fault_from_the_start_is_found_at_the_first_air(graph, rig, fault):
    """Before any force is reached."""
    rig = rig(enable=False)
    # Until the supply is empty, as it is without permission.
    graph.spin(0.5)
    FAULTS[fault](rig)
    graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
    assert enabled(graph)[0]
    vented(graph, rig)


@pytest.mark.parametrize('supply', [True, False])
def test_no_valve_exhausts_widely_while_the_supply_rises(graph, rig, supply, capfd):
    """After `enable`: a reversed valve would fill. Nor is the wait of a usual start warned of."""
    rig = rig(enable=False, supply=supply)
    graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
    graph.spin(0.5)
    commands = graph.listen(interface.valve_topic(1), JointState)
    assert enabled(graph)[0]
    graph.until(lambda: max(rig.rig.truth.pressure) > 20e3, 'air')
    sent = [message.effort[0] for message in commands]
    allowed = next(k for k, command in enumerate(sent) if command > -1.0)
    assert min(sent[allowed:]) >= -GENTLE
    assert 'waits for the supply' not in ''.join(capfd.readouterr())


def test_enable_names_what_speaks_against_it(graph, rig):
    """Nobody publishes e_stop, a pressure loop is silent, a motor unit is too high."""
    rig = rig(enable=False, pids=(2,), e_stop=False)
    graph.until(lambda: rig.node._oversight.watches[2].age is not None, 'readings')
    graph.until(lambda: rig.node._oversight.loops.silent(10.0) == [0], 'the loop of mu2')
    success, message = enabled(graph)
    assert not success
    assert 'e_stop has no publisher' in message
    assert 'the pressure loop of mu1 is silent' in message
    assert 'mu2' not in message
    # absolute where gauge is expected; nothing is left after seconds of exhaust
    rig.shown = lambda pressure: [pressure[0], 101e3]
    graph.until(lambda: max(rig.node._oversight.pressure) > 100e3, 'the reading')
    rig.node._shut_since -= 3.0
    assert 'mu2 shows 101 kPa after ' in enabled(graph)[1]
    rig.shown = lambda pressure: [pressure[0], 500e3]
    graph.until(lambda: max(rig.node._oversight.pressure) > 400e3, 'the reading')
    assert 'mu2 is at 500 kPa, above 396 kPa' in enabled(graph)[1]
    graph.spin(0.3)
    assert set(rig.leaves) == {False}


def test_air_that_no_latch_lets_out_is_told(graph, rig, capfd):
    """A valve hangs open and the supply does not shut: the log must not end with `vented`."""
    rig = rig(lambda t: 60.0)
    graph.until(lambda: max(rig.rig.truth.pressure) > 150e3, 'pressure')
    open_supply = rig.rig.open_supply
    rig.rig.open_supply = lambda given: open_supply(True)
    rig.valves = lambda commands: [1.0, commands[1]]
    warned = warnings_of(graph)
    graph.until(lambda: warned('s of exhaust: shut the supply by hand'), 'the warning')
    assert rig.node._guard.latched
    assert 's of exhaust: shut the supply by hand' in ''.join(capfd.readouterr())


@pytest.mark.parametrize('silent', ['force', 'strain'])
def test_enable_is_refused_while_a_sensor_is_silent(graph, rig, silent):
    """It would open the supply, and latch two seconds later."""
    rig = rig(enable=False)
    graph.until(lambda: not rig.node._oversight.refusal(), 'a bundle that can be enabled')
    place = ('force', 'strain').index(silent)
    rig.outputs[place] = (SimpleNamespace(publish=lambda message: None), rig.outputs[place][1])
    graph.until(lambda: rig.node._oversight.watches[place].health == Health.VENT, 'silence')
    success, message = enabled(graph)
    assert not success
    assert f'{silent}: no reading for' in message
    assert set(rig.leaves) == {False}


@pytest.mark.parametrize('missing', ['force', 'strain'])
def test_air_waits_for_enable_until_every_reading_was_there(graph, rig, missing):
    """A driver that starts its load cell or encoder late moves nothing by that."""
    rig = rig(enable=False)
    place = ('force', 'strain').index(missing)
    output = rig.outputs[place]
    rig.outputs[place] = (SimpleNamespace(publish=lambda message: None), output[1])
    graph.until(lambda: rig.node._oversight.watches[2].age is not None, 'readings')
    graph.until(lambda: enabled(graph)[1].startswith(f'no {missing} yet'), 'the refusal')
    # enabled by an earlier version, or its reading forgotten: it does not resume by itself
    rig.node._enable()
    graph.until(lambda: rig.node._guard.word == 'LOST', 'the latch')
    assert f'no {missing} yet' in rig.node._guard.now.reason
    rig.outputs[place] = output
    graph.until(lambda: rig.node._oversight.readable, 'every reading')
    graph.spin(0.5)
    assert rig.highest < 5e3


def until_there(found):
    """Wait until another process is found."""
    end = time.monotonic() + 60.0
    while not found():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_a_pressure_loop_that_dies_or_stops_vents_all(graph, rig, number, start):
    """The other motor unit is not loaded in its place, and its return brings no pressure."""
    process = start('pressure_pid', '--ros-args', '--params-file', str(config_path('rig.yaml')),
                    '-r', '__node:=pressure_pid_mu1', '-p', 'max_latency:=1.0')
    try:
        # without a turn for the nodes of this process: they begin together, with the rig
        until_there(lambda: graph.probe.publisher_count('mu1/valve_command') == 1)
        # on a machine that does other things neither process has to answer within 0.1 s
        rig = rig(sine, pids=(2,), enable=False, latency=1.0)
        graph.until(lambda: rig.commands[0][1], 'a command for mu1')
        graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')
        graph.until(lambda: rig.rig.truth.pressure[0] > 150e3, 'pressure')
        process.send_signal(number)
        vented(graph, rig)
        assert rig.node._guard.word in ('PID_LOST', 'NO_RESPONSE', 'UNEXPLAINED_PRESSURE')
        process.send_signal(signal.SIGCONT)
        graph.spin(0.6)
        assert max(rig.rig.truth.pressure) < 5e3
    finally:
        process.kill()
        process.communicate()


def active_with_button(graph, rig):
    """Return a bundle that is enabled, and the publisher of its emergency stop."""
    rig = rig(enable=False, e_stop=False)
    button = graph.probe.create_publisher(Bool, 'e_stop', interface.LATCHED)
    button.publish(Bool(data=False))
    graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    return rig, button


def test_an_emergency_stop_that_nobody_publishes_any_more_ends_it(graph, rig):
    """Its button would do nothing; said at once, and off after resume_within."""
    rig, button = active_with_button(graph, rig)
    assert graph.set('recruitment_controller', resume_within=0.3)[0].successful
    graph.probe.destroy_publisher(button)
    vented(graph, rig)
    assert 'e_stop has no publisher, for 0.3 s' in rig.node._guard.now.reason


def test_an_emergency_stop_stays_in_log_and_diagnostics(graph, rig, capfd):
    """A button that was pressed and released is the reason why nothing moves, until enable."""
    rig = rig()
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    rig.node._oversight.e_stop.take(Bool(data=True))
    rig.node._oversight.e_stop.take(Bool(data=False))
    graph.until(lambda: rig.node._guard.word == 'OFF', 'OFF')
    assert 'OFF since an emergency stop, until enabled again' in said(rig.node)
    assert capfd.readouterr().err.count('emergency stop: vented; off until enabled again') == 1
    graph.until(lambda: enabled(graph)[0], 'enable')
    graph.enable(False)
    graph.until(lambda: rig.node._guard.word == 'OFF', 'OFF')
    assert 'emergency stop' not in said(rig.node)


def test_a_stop_that_is_released_at_once_is_not_missed(graph, rig):
    """Both messages wait when the controllers come to look, as after a busy moment."""
    rig, button = active_with_button(graph, rig)
    button.publish(Bool(data=True))
    button.publish(Bool(data=False))
    graph.until(lambda: rig.node._guard.word == 'OFF', 'OFF')
    assert 'OFF since an emergency stop' in said(rig.node)
    graph.until(lambda: not rig.leave[0], 'the end of supply_enable')
    graph.spin(0.7)  # longer than a ramp of the pressures, which needs the supply
    assert not any(rig.leaves[rig.leaves.index(False, rig.leaves.index(True)):])


def test_a_publisher_of_another_type_is_told_by_its_type(graph, rig, domain_id):
    """What it sends never arrives: whoever looks for a second rig would find none."""
    rig = rig()
    with ros_context(domain_id) as other:
        stray = Node('stray', namespace='bundle', context=other)
        stray.create_publisher(Float64, 'force', 10)
        graph.until(lambda: rig.node._guard.word == 'OTHER', 'the latch')
        assert rig.node._guard.now.reason.startswith(
            '2 publishers on force, of the types geometry_msgs/msg/WrenchStamped and '
            'std_msgs/msg/Float64; expected one')
        stray.destroy_node()


def said(node):
    """Return the message of a node's diagnostics."""
    report = Report()
    node._report(report)
    return '; '.join(report.messages)


def test_enable_needs_an_emergency_stop_that_is_received(graph, rig):
    """A publisher that is volatile, or has never sent, would stop nothing."""
    rig = rig(enable=False, e_stop=False)
    volatile = graph.probe.create_publisher(Bool, 'e_stop', 10)
    graph.until(lambda: rig.node.publisher_count('e_stop') == 1, 'the publisher')
    volatile.publish(Bool(data=True))
    graph.until(lambda: rig.node._oversight.watches[2].age is not None, 'readings')
    success, message = enabled(graph)
    assert not success
    assert 'e_stop has a publisher, but nothing was received: it must be reliable' in message
    graph.probe.destroy_publisher(volatile)
    button = graph.probe.create_publisher(Bool, 'e_stop', interface.LATCHED)
    button.publish(Bool(data=False))
    graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')


def test_a_stop_reset_beside_a_second_publisher_is_reset_once_more(graph, rig):
    """As after a driver was killed and started again; the reason says what helps."""
    rig = rig(enable=False, e_stop=False)
    killed, driver = (graph.probe.create_publisher(Bool, 'e_stop', interface.LATCHED)
                      for _ in range(2))
    driver.publish(Bool(data=True))
    stop = rig.node._oversight.e_stop
    graph.until(lambda: stop.on and rig.node.publisher_count('e_stop') == 2, 'the stop')
    driver.publish(Bool(data=False))
    graph.until(lambda: stop.doubt, 'the doubt')
    graph.probe.destroy_publisher(killed)
    graph.until(lambda: rig.node.publisher_count('e_stop') == 1, 'one publisher')
    success, message = enabled(graph)
    assert not success
    assert 'it was reset while e_stop had 2 publishers' in message
    assert 'stop and reset once more' in message
    for on in (True, False):
        driver.publish(Bool(data=on))
        graph.until(lambda on=on: stop.on == on, 'stop and reset')
    graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')


def test_a_stop_of_a_node_that_has_ended_says_what_helps(graph, rig):
    """The rig's own publisher has nothing to take back: without a hint it stays on for good."""
    rig = rig(enable=False, e_stop=False)
    driver, button = (graph.probe.create_publisher(Bool, 'e_stop', interface.LATCHED)
                      for _ in range(2))
    driver.publish(Bool(data=False))
    button.publish(Bool(data=True))
    stop = rig.node._oversight.e_stop
    graph.until(lambda: stop.on and stop.why == 'the emergency stop is on', 'the stop')
    graph.probe.destroy_publisher(button)
    graph.until(lambda: 'has ended; stop and reset once more' in enabled(graph)[1], 'the hint')


def test_a_bundle_is_not_enabled_while_a_pressure_loop_is_stopped(graph, rig):
    """A controller that was started again knows of no stop; its unit would stay empty."""
    rig = rig(enable=False, pids=(1,))
    loop = graph.probe.create_publisher(String, 'mu2/pid_state', interface.LATCHED)
    valve = graph.probe.create_publisher(JointState, 'mu2/valve_command', interface.PUBLISH)
    said = ['VENT E_STOP']
    graph.probe.every(0.05, lambda: loop.publish(String(data=said[0])))
    graph.probe.every(0.05, lambda: valve.publish(
        interface.valve_message(graph.probe.now_ns(), 2, -1.0)))
    text = 'the pressure loop of mu2 is in emergency stop: stop and reset once more'
    graph.until(lambda: enabled(graph) == (False, text), 'the refusal')
    said[0] = 'VENT OFF'
    graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')


def test_what_is_repeated_does_not_wait_for_what_was_lost(graph, rig):
    """Behind a lost packet a reliable subscription is silent for up to a second."""
    rig = rig(enable=False)
    name = rig.node.resolve_topic_name
    for topic, others in (('supply_enable', 3), ('mu1/pid_state', 1)):
        def of_nodes(topic=topic):
            return [info for info in graph.probe.get_subscriptions_info_by_topic(name(topic))
                    if info.node_name != 'probe']
        graph.until(lambda others=others: len(of_nodes()) == others, topic)
        assert {info.qos_profile.reliability for info in of_nodes()} == {
            ReliabilityPolicy.BEST_EFFORT}


@pytest.mark.parametrize(('topic', 'kind'), [
    ('mu1/pressure', FluidPressure), ('supply_enable', Bool), ('mu2/valve_command', JointState)])
def test_enable_needs_one_rig_and_one_controller(graph, rig, topic, kind):
    """A simulation that is started beside a rig, or a controller that was left running."""
    rig = rig(enable=False)
    other = graph.probe.create_publisher(kind, topic, 10)
    graph.until(lambda: f'2 publishers on {topic}' in rig.node._oversight.refusal(), topic)
    assert not enabled(graph)[0]
    graph.probe.destroy_publisher(other)
    graph.until(lambda: enabled(graph)[0], 'a bundle that can be enabled')


def test_a_second_rig_on_the_same_topics_ends_it(graph, rig):
    """Its readings belong to other muscles, however much they look alike."""
    rig = rig()
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    graph.probe.create_publisher(FluidPressure, 'mu2/pressure', 10)
    vented(graph, rig)
    assert rig.node._guard.word == 'OTHER'
    assert '2 publishers on mu2/pressure' in rig.node._guard.now.reason


def test_a_recruitment_controller_that_stood_still_latches(graph, rig):
    """It cannot know what happened meanwhile."""
    rig = rig(sine)
    graph.until(lambda: max(rig.rig.truth.pressure) > 100e3, 'pressure')
    rig.node._supply._said -= 2.0
    vented(graph, rig)
    assert rig.node._guard.word == 'STOPPED'


@pytest.mark.parametrize('first', ['the heartbeat', 'the owner'])
def test_a_leave_that_has_lapsed_is_said_again_by_enable_only(graph, first):
    """False and then true is what releases a pressure loop that has latched meanwhile."""
    node = graph.add(BundleNode('owner', (), context=graph.context))
    lapses = []
    supply = SupplyEnable(node, lapses.append)
    said = graph.listen('supply_enable', Bool, interface.RELIABLE)
    graph.until(lambda: supply.set(True) or (said and said[-1].data), 'true')
    supply._said -= 2.0
    if first == 'the owner':
        supply.set(True)
    graph.until(lambda: not said[-1].data, 'false')
    graph.spin(0.3)
    assert not said[-1].data
    assert [round(silence) for silence in lapses] == [2]


def test_permission_for_the_supply_is_repeated_with_the_samples(graph):
    """It does not lapse while the timer of an executor that was held up is silent."""
    node = graph.add(BundleNode('owner', (), context=graph.context))
    node.every = lambda period, callback: None
    supply = SupplyEnable(node, lambda silence: None)
    said = graph.listen('supply_enable', Bool, interface.RELIABLE)
    graph.until(lambda: supply.set(True) or len(said) > 3, 'more than one message')
    assert said[-1].data


def test_two_controllers_of_one_rig_do_not_take_turns(graph, rig):
    """One that says the supply must be shut ends the other, and says why."""
    rig = rig()
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    other = graph.probe.create_publisher(Bool, 'supply_enable', interface.RELIABLE)
    graph.until(lambda: other.publish(Bool(data=False)) or rig.node._guard.latched, 'the latch')
    vented(graph, rig)
    assert rig.node._guard.word == 'OTHER'


def test_limits_are_not_raised_while_it_acts(graph, rig):
    """Lower is welcome; higher has to wait until it is off."""
    rig = rig()
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    for node in ('recruitment_controller', 'pressure_pid_mu1'):
        graph.until(lambda: rig.rig.truth.pressure[0] > 100e3, 'pressure')
        refused = graph.set(node, over_pressure_factor=3.0)[0]
        assert not refused.successful
        assert 'it may be lowered from 1.15 and not set to 3' in refused.reason
        assert graph.set(node, over_pressure_factor=1.12)[0].successful
    # beyond the noise and the delay that are told, no reading contradicts the inflow
    for changes in ({'quiet_error': 50e3}, {'transport_delay': 0.5}):
        assert 'is a limit' in graph.set('pressure_pid_mu1', **changes)[0].reason
    assert not graph.set('recruitment_controller', reference_timeout=0.0)[0].successful
    graph.enable(False)
    graph.until(lambda: rig.node._guard.word == 'OFF', 'OFF')
    assert graph.set('recruitment_controller', over_pressure_factor=1.2)[0].successful


def test_parameters_that_take_long_to_apply_wait_until_it_is_off(graph, rig):
    """New gains of the strain loop would hold up the setpoints until both units are vented."""
    rig = rig()
    graph.until(lambda: rig.node._guard.word == 'ACTIVE', 'ACTIVE')
    for name in ('load_model__stiffness', 'load_model__inertia', 'load_model__damping',
                 'outer__delay'):
        refused = graph.set('recruitment_controller', **{name: 0.3})[0]
        assert 'only while the node does not act' in refused.reason
    # the others apply at once
    assert graph.set('recruitment_controller', load_model__force=1.0, margin=2.0,
                     outer__still=0.3, policy='hysteresis', feedback=False)[0].successful
    graph.spin(0.3)
    assert rig.node._guard.word == 'ACTIVE'
    graph.enable(False)
    graph.until(lambda: rig.node._guard.word == 'OFF', 'OFF')
    assert graph.set('recruitment_controller', load_model__inertia=0.3)[0].successful
    assert rig.node.controller.config.load.inertia == 0.3


def test_every_pressure_loop_says_how_it_is(graph, rig):
    """One word, a cause and a reason, for who listens and for who comes late."""
    rig = rig(sine)
    graph.until(lambda: rig.rig.truth.pressure[0] > 100e3, 'pressure')
    said = graph.listen('mu1/pid_state', String, interface.LATCHED)
    graph.until(lambda: said and said[-1].data == 'ACTIVE', 'ACTIVE')
    rig.shown = lambda pressure: [500e3, pressure[1]]
    graph.until(lambda: said[-1].data.startswith('LATCHED OVER_PRESSURE: mu1 '), 'the latch')
    late = graph.listen('mu1/pid_state', String, interface.LATCHED)
    graph.until(lambda: late and late[-1].data == said[-1].data, 'what was said before')
