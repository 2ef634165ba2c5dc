# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Readings that are lost or not believed: held, vented, and what brings pressure back."""

import math

from geometry_msgs.msg import WrenchStamped
import pytest
from sensor_msgs.msg import FluidPressure, JointState
import yaml

from fam_bundle_ros.control.safety import Change, State
from fam_bundle_ros.model import Bundle, catalogue, Geometry, MotorUnit, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.loops import LoopState
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.resources import config_path

from .whole_bundle import hold

#: Limits of the force in the parameter file that users copy.
RIG_YAML = {name: value for name, value in yaml.safe_load(
    config_path('rig.yaml').read_text())['/**']['ros__parameters'].items() if 'force_' in name}


@pytest.mark.parametrize(('fault', 'reason'), [
    ({'faults__nan': 'force'}, 'force is nan'),
    ({'faults__nan': 'strain'}, 'strain is nan'),
    ({'faults__silent': 'strain'}, 'strain'),
])
def test_lost_sensor_holds_then_vents_then_recovers(graph, bundle, fault, reason):
    """Pressures are held for hold_time, vented, and come back when the sensor does."""
    rig, node = bundle(hold(60.0))
    graph.advance(rig, 0.6)
    before = list(node.setpoints)
    graph.set('plant_simulator', **fault)
    graph.advance(rig, 0.03)
    assert node._guard.word == 'HOLD'
    assert node.setpoints == pytest.approx(before, abs=5e3)
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')
    assert any(reason in watch.reason for watch in node._oversight.watches)
    graph.set('plant_simulator', **dict.fromkeys(fault, ''))
    graph.advance(rig, 1.0)
    assert node._guard.word == 'ACTIVE'
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


@pytest.mark.parametrize(('resume_within', 'lost'), [(1.0, 1.4), (0.0, 0.4)])
def test_after_a_long_loss_pressure_waits_for_enable(graph, bundle, resume_within, lost):
    """Sensors that come back when nobody expects it any more bring no pressure with them."""
    rig, node = bundle(hold(60.0), resume_within=resume_within)
    states = graph.diagnostics('recruitment_controller')
    graph.advance(rig, 0.6)
    graph.set('plant_simulator', faults__silent='force')
    graph.advance(rig, lost)
    graph.set('plant_simulator', faults__silent='')
    # more than recovery_time
    graph.advance(rig, 0.7)
    assert rig.rig.truth.pressure.max() < 5e3
    assert node._guard.word == 'LOST'
    text = f'vented for {resume_within:g} s in all: off until enabled again'
    graph.until(lambda: states and text in states[-1].message, 'diagnostics')
    assert states[-1].level == b'\x02'
    assert graph.enable().success
    graph.advance(rig, 1.2)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


def test_a_reading_that_comes_and_goes_latches_as_one_that_stays_away(graph, bundle):
    """Each time is too short by itself; the load is not to be let go again and again."""
    rig, node = bundle(hold(60.0), resume_within=0.6, recovery_time=0.05)
    graph.advance(rig, 0.6)
    for _ in range(4):
        graph.set('plant_simulator', faults__nan='force')
        graph.advance(rig, 0.25)
        graph.set('plant_simulator', faults__nan='')
        graph.advance(rig, 0.15)
    assert node._guard.word == 'LOST'


def test_enable_once_more_does_not_put_off_a_latch(graph, bundle):
    """Whoever calls it again and again does not keep the watches from counting."""
    rig, node = bundle(hold(60.0), resume_within=0.6)
    graph.advance(rig, 0.6)
    answer = graph.enable()
    assert (answer.success, answer.message) == (True, 'on already: ACTIVE')
    graph.set('plant_simulator', faults__nan='force')
    for _ in range(4):
        graph.advance(rig, 0.2)
        graph.enable(not node._guard.latched)
    assert node._guard.word == 'LOST'


def test_frozen_force_is_not_believed(graph, bundle):
    """A force that repeats exactly while pressures move is stuck."""
    rig, node = bundle(Points('ramp', 'force', (0.0, 0.5, 2.0), (30.0, 30.0, 75.0)))
    graph.advance(rig, 0.5)
    graph.set('plant_simulator', faults__frozen='force')
    graph.advance(rig, lambda: node._guard.word in ('HOLD', 'SENSOR'), 'the watch')
    assert 'has shown exactly' in node._oversight.watches[0].reason
    graph.advance(rig, lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')


def test_encoder_without_noise_on_a_rig_that_stands_still(graph, bundle):
    """A strain that repeats exactly while pressures move is true where the load is held."""
    ramp = Points('ramp', 'force', (0.0, 0.5, 2.0), (30.0, 30.0, 75.0))
    rig, node = bundle(ramp, sensors__strain_noise=0.0)
    states = set()
    graph.advance(rig, lambda: (states.add(node._guard.word), graph.pacer.time > 2.5)[1], 'a ramp')
    assert states <= {'WAITING', 'ACTIVE'}
    assert rig.rig.truth.force == pytest.approx(75.0, abs=2.0)


def test_stuck_strain_is_found_where_it_must_move_and_left_by_enable(graph, bundle):
    """With strain_stuck_time it vents; readings that are otherwise good can be enabled again."""
    ramp = Points('ramp', 'force', (0.0, 0.5, 2.0), (30.0, 30.0, 75.0))
    rig, node = bundle(ramp, sensors__strain_noise=0.0, strain_stuck_time=0.5)
    graph.advance(rig, lambda: node._guard.word == 'FROZEN', 'the watch')
    assert 'strain has shown exactly 0.1' in node._guard.now.reason
    graph.advance(rig, 0.5)
    graph.enable()
    graph.advance(rig, lambda: rig.rig.truth.force > 60.0, 'force', 1.0)


@pytest.mark.parametrize('stamps', ['ahead', 'frozen', 'zero'])
def test_dead_force_is_seen_whatever_the_stamps(graph, stamps):
    """In wall time neither a dead channel's clock nor stamps that stand still stop the watches."""
    node = graph.add(RecruitmentNode(context=graph.context, overrides={
        'start_enabled': True, 'sensor_timeout': 0.3, 'clocks_synchronised': False,
        # A computer that is busy for less does not skip the hold.
        'hold_time': 0.4, 'e_stop_required': False}))
    loops = [LoopState(graph.probe, unit) for unit in (1, 2)]
    streams = [graph.probe.create_publisher(kind, topic, 10) for kind, topic in (
        (WrenchStamped, 'force'), (JointState, 'strain'), (FluidPressure, 'mu1/pressure'),
        (FluidPressure, 'mu2/pressure'), (WrenchStamped, 'reference/force'))]
    start = graph.probe.now_ns()
    dead = []

    def feed():
        stamp = {'ahead': graph.probe.now_ns(), 'frozen': start, 'zero': 0}[stamps]
        noise = graph.probe.now_ns() % 97
        # Ahead by more than the test lasts.
        ahead = 3_600_000_000_000 if stamps == 'ahead' else 0
        messages = (interface.force_message(stamp + ahead, 1.0 + noise * 1e-3),
                    interface.strain_message(stamp, 0.1 + noise * 1e-6, 0.0, 0.127),
                    interface.pressure_message(stamp, 3e3 + noise, 101325.0),
                    interface.pressure_message(stamp, 1e3 + noise, 101325.0),
                    interface.force_message(stamp, 40.0))
        for loop in loops:
            loop.say(Change(0.0, State.ACTIVE, '', ''))
        for stream, message in list(zip(streams, messages))[len(dead):]:
            stream.publish(message)
    # Fast enough that the node never finds nothing new.
    graph.probe.every(0.002, feed)
    graph.until(lambda: node._guard.word == 'ACTIVE' and node.setpoints[0] > 20e3, 'pressure')
    dead.append('force')
    graph.until(lambda: node._guard.word == 'SENSOR' and not any(node.setpoints), 'vent')
    assert [change.state for change in node._guard.history][-3:] == [
        State.ACTIVE, State.HOLD, State.VENT]
    assert 'force: no reading for' in node._oversight.watches[0].reason


def test_burst_muscle_is_latched_by_all(graph, bundle):
    """What leaves is more than the valve lets in: the loop latches, and the bundle with it."""
    rig, node = bundle(hold(60.0))
    graph.advance(rig, 0.6)
    graph.set('plant_simulator', faults__leak='mu1=0.01')
    graph.advance(rig, lambda: node._guard.latched, 'the latch', 0.2)
    assert node._guard.word == 'NO_RESPONSE'
    graph.advance(rig, 0.3)
    assert not rig._permission.given
    assert rig.rig.truth.pressure.max() < 5e3
    graph.set('plant_simulator', faults__leak='')
    graph.advance(rig, 0.6)
    assert rig.rig.truth.pressure.max() < 5e3
    assert graph.enable().success
    graph.advance(rig, 1.2)
    assert rig.rig.truth.force == pytest.approx(60.0, abs=2.0)


@pytest.mark.parametrize(('radius', 'given', 'limits'), [
    (6.35e-3, {}, (-200.0, 5000.0)), (40e-3, {}, None),
    (40e-3, RIG_YAML, None),
    (40e-3, {'force_low': -50.0, 'force_high': 900.0}, (-50.0, 900.0))])
def test_the_force_of_a_strong_bundle_is_no_broken_load_cell(graph, tmp_path, radius, given,
                                                                 limits):
    """Two muscles of 80 mm pull 13 kN: the limits follow the model, unless the user sets them."""
    geometry = Geometry(radius, 0.5, math.radians(33.0), 0.25 * radius)
    bundle = Bundle('strong', [MotorUnit(f'mu{k + 1}', 1, geometry, 344.7e3) for k in range(2)],
                    [catalogue.get('mesh')()])
    save_model(bundle, tmp_path / 'strong.yaml')
    node = graph.add(RecruitmentNode(context=graph.context, overrides={
        'model': str(tmp_path / 'strong.yaml'), **given}))
    config = node._oversight.watches[0].config
    largest = float(bundle.blocked_force(bundle.max_pressure))
    assert (config.low, config.high) == pytest.approx(limits or (-0.5 * largest, 2.0 * largest))
    told = [text for text in node._said if text.startswith('force_high is 900 N')]
    assert bool(told) == (config.high < largest), node._said
