# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What the recruitment node refuses, warns of, and tells of its decision."""

from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode

from .whole_bundle import hold, values_of, warnings_of


def test_reference_that_is_no_number_is_refused(graph, quiet):
    """Nan on reference/force leaves the old reference."""
    node = graph.add(RecruitmentNode(context=graph.context))
    publisher = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)

    def send(value):
        publisher.publish(interface.force_message(1, value))
        return node._reference.last is not None
    graph.until(lambda: send(30.0), 'the reference')
    for _ in range(5):
        send(float('nan'))
        graph.spin()
    assert node._reference.last.value == 30.0


def references(graph, node, kind, topic, messages):
    """Publish messages by value, in turn; return the references that the node takes."""
    publisher, found = graph.probe.create_publisher(kind, topic, 10), []

    def taken(value):
        if node._reference.last is None:  # until both sides know each other
            publisher.publish(messages[value])
        return node._reference.last and node._reference.last.value == value
    for value, message in messages.items():
        if node._reference.last:
            publisher.publish(message)
        graph.until(lambda value=value: taken(value), 'the reference')
        found.append(node._reference.last)
    return found


def test_a_strain_without_velocity_has_the_rate_of_its_values(graph, quiet):
    """Messages each 20 ms by their stamps, 0.1 1/s; with a velocity that is the rate."""
    node, messages = graph.add(RecruitmentNode(context=graph.context)), {}
    for k in range(6):
        value = 0.1 + 2e-3 * k
        messages[value] = JointState(name=['strain'], position=[value])
        messages[value].header.stamp = interface.to_stamp(20_000_000 * (k + 1))
    messages[0.2] = interface.reference_strain_writer()(140_000_000, 0.2, 0.03)
    found = references(graph, node, JointState, 'reference/strain', messages)
    assert [found[-2].rate, found[-1].rate] == pytest.approx([0.1, 0.03])


def test_a_force_without_stamps_has_the_rate_of_its_arrival(graph, quiet):
    """As `ros2 topic pub` and short programs send it."""
    node = graph.add(RecruitmentNode(context=graph.context))
    found = references(graph, node, WrenchStamped, 'reference/force', {
        value: interface.force_message(0, value) for value in (10.0, 10.5, 11.0, 11.5)})
    assert found[-1].rate > 0.0


def test_diagnostics_warn_of_a_force_that_is_not_reached(graph, bundle):
    """More is asked for than the bundle can give, for seconds."""
    rig, node = bundle(Points('too much', 'force', (0.0, 0.4, 0.5, 3.7, 3.8),
                              (60.0, 60.0, 400.0, 400.0, 60.0)))
    warned = warnings_of(graph)
    graph.advance(rig, 2.3)
    assert node._off_target.text == ''
    graph.advance(rig, 1.2)
    graph.until(lambda: warned(' N, reference is 400 N, for')
                and warned(' s: out of reach, by the model no pressures give more force at a'),
                'the warning')
    assert 'off target' in node._said
    graph.advance(rig, 1.3)
    assert node._off_target.text == ''


def test_a_load_cell_that_reads_a_tenth_ends_a_motion_too(graph, bundle):
    """A reference that goes up and down passes the wrong reading twice in every period."""
    times = np.arange(0.0, 8.1, 1.0)
    rig, node = bundle(Points('up and down', 'force', tuple(times),
                              tuple(20.0 + 70.0 * (times % 2.0))), faults__gain='force=0.1')
    graph.advance(rig, lambda: node._guard.latched, 'the latch')
    assert node._guard.word == 'FORCE'


def test_diagnostics_warn_of_a_force_that_no_pressure_below_the_trip_gives(graph, bundle):
    """Too little to stop for it, but a gauge that drifts like a leak shows in nothing else."""
    rig, node = bundle(hold(110.0))
    warned = warnings_of(graph)
    graph.advance(rig, 1.0)
    graph.set('plant_simulator', faults__offset='force=30')
    graph.advance(rig, lambda: warned('N says that it is above 396 kPa'), 'the warning')
    assert node._guard.word == 'ACTIVE'


def test_diagnostics_warn_of_who_talks_in_between(graph, live):
    """Another setpoint, another reference, the two modes in turn, references refused."""
    _, node = live()
    warned = warnings_of(graph)
    valve = graph.probe.create_publisher(JointState, 'mu1/valve_command', 10)
    graph.until(lambda: warned('2 publishers on mu1/valve_command'), 'valve commands')
    assert '2 publishers on mu1/valve_command; expected one' in node._said
    graph.probe.destroy_publisher(valve)
    setpoint = graph.probe.create_publisher(FluidPressure, 'mu1/pressure_setpoint', 10)
    force = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
    strain = graph.probe.create_publisher(JointState, 'reference/strain', 10)
    graph.until(lambda: warned('2 publishers on mu1/pressure_setpoint'), 'setpoints')
    graph.probe.destroy_publisher(setpoint)
    other = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
    graph.until(lambda: warned('2 publishers on reference/force'), 'references')
    graph.probe.destroy_publisher(other)

    def in_turn():
        force.publish(interface.force_message(1, 40.0))
        strain.publish(interface.reference_strain_writer()(1, 0.1, 0.0))
        return warned('times between force and strain')
    graph.until(in_turn, 'the modes in turn')

    def no_number():
        force.publish(interface.force_message(1, float('nan')))
        return warned('refused: reference is nan')
    graph.until(no_number, 'the refusal')


@pytest.mark.parametrize(('names', 'positions', 'velocities', 'text'), [
    (['strain'], [0.1], [1e6], 'reference moves at 1e+06 1/s; expected a size up to 10'),
    (['strain'], [0.1], [float('-inf')], 'reference moves at -inf 1/s'),
    (['contraction', 'strain'], [0.01], [], 'with 1 positions'),
    (['strain'], [0.1], [0.1, 0.2], '2 velocities'),
])
def test_strain_reference_that_cannot_be_meant_is_refused(graph, names, positions, velocities,
                                                         text):
    """It changes neither the reference nor the mode, and diagnostics say why."""
    node = graph.add(RecruitmentNode(context=graph.context))
    force = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
    strain = graph.probe.create_publisher(JointState, 'reference/strain', 10)
    warned = warnings_of(graph)
    graph.until(lambda: (force.publish(interface.force_message(1, 30.0)),
                         node._reference.last is not None)[1], 'the reference')
    message = JointState(name=names, position=positions, velocity=velocities)
    graph.until(lambda: (strain.publish(message), warned(text))[1], 'the refusal')
    assert (node._reference.last.kind, node._reference.last.value) == ('force', 30.0)


@pytest.mark.parametrize('beyond', [101.0, -31.0])
def test_a_force_that_would_count_as_a_broken_load_cell_is_no_reference(graph, beyond):
    """Reached, it would vent the bundle again and again; the reference before it stays."""
    node = graph.add(RecruitmentNode(context=graph.context, overrides={
        'force_low': -30.0, 'force_high': 100.0}))
    force = graph.probe.create_publisher(WrenchStamped, 'reference/force', 10)
    warned = warnings_of(graph)
    graph.until(lambda: (force.publish(interface.force_message(1, 100.0)),
                         node._reference.last is not None)[1], 'the reference')
    graph.until(lambda: (force.publish(interface.force_message(2, beyond)), warned(
        f'reference is {beyond:g} N; expected -30 to 100 N'))[1], 'the refusal')
    assert node._reference.last.value == 100.0


def test_diagnostics_explain_the_decision(graph, bundle):
    """State, margins, policy and rates are there for rqt."""
    rig, _ = bundle(hold(60.0))
    states = graph.diagnostics('recruitment_controller')
    graph.advance(rig, 0.5)
    # the first one may be from before the first sample
    graph.until(lambda: states and 'recruitment' in values_of(states[-1]), 'diagnostics')
    values = values_of(states[-1])
    assert values['recruitment'] == 'RS1'
    first = np.array([rig.rig.bundle.max_pressure[0], 0.0])
    most = rig.rig.bundle.force(rig.rig.truth.strain, first)
    assert float(values['recruit above, N']) == pytest.approx(most, abs=1.0)
    assert values['policy'] == 'reversal_aware'
