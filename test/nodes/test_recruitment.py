# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The recruitment node, with PIDs, reference generator and simulated rig."""

from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Bool, UInt8

from fam_bundle_ros.model import load_model, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.resources import config_path

from .whole_bundle import hold


def test_ramp_goes_up_and_down_the_states_without_chatter(graph, bundle):
    """RS1 -> RS2 -> RS1 on a ramp through the overlap: each switch once, force on the ramp."""
    ramp = Points('ramp', 'force', (0.0, 0.3, 1.5, 1.8, 3.0), (40.0, 40.0, 120.0, 120.0, 30.0))
    rig, _ = bundle(ramp)
    states = graph.listen('recruitment_state', UInt8, interface.LATCHED)
    graph.advance(rig, lambda: states and states[-1].data == 2, 'RS2')
    graph.advance(rig, lambda: states[-1].data == 1 and graph.pacer.time > 3.0, 'RS1')
    assert [m.data for m in states if m.data] == [1, 2, 1]
    error = [truth.force - ramp.value(time) for time, truth, _ in graph.pacer.log
             if time > 0.3]
    assert np.sqrt(np.mean(np.square(error))) < 1.0


def test_every_answer_in_lock_step_repeats_supply_enable(graph, bundle):
    """No timer repeats it there: who came late would never hear it."""
    rig, _ = bundle()
    graph.advance(rig, 0.1)
    heard = graph.listen('supply_enable', Bool, interface.RELIABLE)
    graph.advance(rig, lambda: heard, 'supply_enable')
    count, steps = len(heard), len(graph.pacer.log)
    graph.advance(rig, 0.1)
    assert all(message.data for message in heard)
    assert len(heard) - count >= len(graph.pacer.log) - steps - 2


def test_no_supply_enable_comes_before_the_first_answer_in_lock_step(graph, bundle):
    """
    A pressure loop that has received a false answers a setpoint with a vent until it is told true.

    The true and the setpoint are on two topics: which is received first would decide the run.
    """
    heard = graph.listen('supply_enable', Bool, interface.RELIABLE)
    rig, _ = bundle()
    graph.advance(rig, lambda: len(heard) > 5, 'supply_enable')
    assert all(message.data for message in heard)


def test_dwell_inside_the_overlap_does_not_chatter(graph, bundle):
    """A demand that both states can give, with noise, is held in one of them."""
    rig, _ = bundle(hold(79.0))
    states = graph.listen('recruitment_state', UInt8, interface.LATCHED)
    graph.advance(rig, 2.0)
    assert len([m for m in states if m.data]) <= 2


def test_strain_reference_moves_the_mass(graph, bundle):
    """The kind of the last reference is the control mode: here strain, with a load model."""
    rig, _ = bundle(Points('lift', 'strain', (0.0, 0.1, 0.7), (0.02, 0.02, 0.06)),
                    load__kind='mass_spring', load_model__force=49.0,
                    load_model__inertia=0.635)
    graph.advance(rig, 1.3)
    assert rig.rig.truth.strain == pytest.approx(0.06, abs=0.004)


def test_policy_and_model_change_while_it_runs(graph, bundle, tmp_path):
    """A better model file is taken over while it is off; a bad one is refused in words."""
    rig, node = bundle(hold(60.0))
    graph.advance(rig, 0.5)
    better = tmp_path / 'better.yaml'
    save_model(load_model(config_path('models/spie2021.yaml')).named('better'), better)
    refused = graph.set('recruitment_controller', model=str(better))[0]
    assert not refused.successful
    assert 'only while the controller is off' in refused.reason
    assert node.bundle.name == 'spie2021'
    graph.enable(False)
    longer = tmp_path / 'longer.yaml'
    longer.write_text(better.read_text().replace('127 mm', '130 mm'))
    refused = graph.set('recruitment_controller', model=str(longer))[0]
    assert 'the length 0.13, here 0.127: restart all nodes' in refused.reason
    assert graph.set('recruitment_controller', model=str(better))[0].successful
    graph.enable()
    assert node.bundle.name == 'better'
    refused = graph.set('recruitment_controller', model='/nowhere.yaml')[0]
    assert not refused.successful
    assert '/nowhere.yaml: no such file' in refused.reason
    assert not graph.set('recruitment_controller', policy='guess')[0].successful
    assert graph.set('recruitment_controller', policy='hysteresis', scheme='batch')[0].successful
    graph.advance(rig, 1.0)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


def test_setpoints_are_absolute_and_carry_the_sample_s_stamp(graph, bundle):
    """What goes to the PIDs is what FluidPressure is defined to be."""
    rig, node = bundle(hold(60.0))
    setpoints = graph.listen('mu1/pressure_setpoint', FluidPressure)
    shares = graph.listen('recruitment', JointState)
    graph.advance(rig, 0.5)
    assert setpoints[-1].fluid_pressure == pytest.approx(node.setpoints[0] + 101325.0)
    stamps = [interface.stamp_ns(m.header.stamp) for m in setpoints]
    assert {b - a for a, b in zip(stamps, stamps[1:])} == {5_000_000}
    assert list(shares[-1].position) == [1.0, 0.0]
    assert sum(shares[-1].effort) == pytest.approx(1.0)


def test_valve_commands_reach_the_rig_before_the_slower_work_on_a_sample(graph):
    """In one process the controller turns to a sample once the pressure loops have answered."""
    nodes = graph.add(*make_nodes(graph.context, overrides={
        'simulate': False, 'generate': False, 'monitor': False}))
    controller = next(node for node in nodes if isinstance(node, RecruitmentNode))
    strain = interface.strain_writer(0.127)
    samples = {interface.STRAIN: (JointState, lambda stamp, value: strain(stamp, value, 0.0)),
               interface.FORCE: (WrenchStamped, interface.force_writer()),
               **{interface.pressure_topic(unit): (FluidPressure, interface.pressure_writer(1e5))
                  for unit in (1, 2)}}
    publishers = [(graph.probe.create_publisher(kind, topic, interface.PUBLISH), write)
                  for topic, (kind, write) in samples.items()]
    late, worked = [], []

    def answered(message):
        late.append(interface.stamp_ns(message.header.stamp) <= controller._answered)

    def sample():
        worked.append(controller._answered)
        stamp = graph.probe.now_ns()
        for publisher, write in publishers:
            publisher.publish(write(stamp, 0.1))
    for unit in (1, 2):
        graph.probe.create_subscription(JointState, interface.valve_topic(unit), answered,
                                        interface.LOCK_STEP)
    graph.probe.every(0.02, sample)
    graph.until(lambda: len(set(worked)) > 50, 'samples that the controller has worked on')
    assert len(late) > 50
    # Samples that pile up on a busy machine may be worked on before they are answered.
    assert np.mean(late) < 0.5
