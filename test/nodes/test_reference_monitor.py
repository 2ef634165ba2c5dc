# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Reference generator and model monitor."""

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.live_model import noise_floor
from fam_bundle_ros.nodes.model_monitor import ModelMonitor
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.reference_generator import ReferenceGenerator
from fam_bundle_ros.resources import config_path


def test_trajectory_topic_is_sampled_with_its_rate(graph, quiet):
    """A trajectory of strain on the topic becomes strain references with velocity."""
    graph.add(ReferenceGenerator(context=graph.context),
              PlantSimulator(context=graph.context, overrides=quiet))
    # until then whoever streams references is the only publisher
    assert not graph.probe.publisher_count('reference/strain')
    seen = graph.listen('reference/strain', JointState)
    publisher = graph.probe.create_publisher(JointTrajectory, 'reference/trajectory', 10)
    graph.until(lambda: publisher.get_subscription_count() > 0, 'the generator')
    publisher.publish(JointTrajectory(joint_names=['strain'], points=[
        JointTrajectoryPoint(positions=[0.0]),
        JointTrajectoryPoint(positions=[0.1], time_from_start=Duration(sec=1))]))
    graph.until(lambda: seen and seen[-1].position[0] > 0.02, 'the ramp')
    moving = seen[-1]
    assert moving.velocity[0] == pytest.approx(0.1)
    graph.until(lambda: seen[-1].position[0] == 0.1, 'the end')


def test_bad_trajectory_leaves_the_old_one(graph, quiet):
    """Points that go back in time are refused."""
    node = graph.add(ReferenceGenerator(context=graph.context,
                                        profile=Points('p', 'force', (0.0,), (5.0,))),
                     PlantSimulator(context=graph.context, overrides=quiet))[0]
    publisher = graph.probe.create_publisher(JointTrajectory, 'reference/trajectory', 10)
    graph.until(lambda: publisher.get_subscription_count() > 0, 'the generator')
    publisher.publish(JointTrajectory(joint_names=['force'], points=[
        JointTrajectoryPoint(positions=[1.0], time_from_start=Duration(sec=2)),
        JointTrajectoryPoint(positions=[2.0], time_from_start=Duration(sec=1))]))
    graph.spin(0.2)
    assert node._profile.name == 'p'


def test_a_contraction_that_is_too_large_is_refused_as_a_strain(graph):
    """20 was meant as mm; the refusal has to explain the 157 that it shows."""
    node = graph.add(ReferenceGenerator(context=graph.context))
    with pytest.raises(InputError, match=r'157.*expected.*a strain \(contraction over length\)'):
        node._on_trajectory(JointTrajectory(joint_names=['contraction'], points=[
            JointTrajectoryPoint(positions=[20.0])]))


def test_the_next_bad_trajectory_is_logged_too(graph):
    """One that was corrected in the wrong place within seconds must not be refused silently."""
    node = graph.add(ReferenceGenerator(context=graph.context))
    publisher = graph.probe.create_publisher(JointTrajectory, 'reference/trajectory', 10)

    def refused(value):
        publisher.publish(JointTrajectory(joint_names=['force'], points=[
            JointTrajectoryPoint(positions=[value])]))
        return any(f'point 1 is {value:g} at 0 s' in key for key in node._said)
    for value in (1e6, 2e6):
        graph.until(lambda value=value: refused(value), f'the refusal of {value:g} N')


def force_over(seconds, **keywords):
    """Return a trajectory of force that is held for a time, s."""
    return JointTrajectory(joint_names=['force'], points=[
        JointTrajectoryPoint(positions=[30.0]),
        JointTrajectoryPoint(positions=[30.0], time_from_start=Duration(sec=seconds))], **keywords)


@pytest.mark.parametrize('how', ['empty message', 'emergency stop'])
def test_a_trajectory_by_message_can_be_cancelled_and_ends_at_an_emergency_stop(graph, quiet, how):
    """`enable` alone must not resume it; the trajectory of a file goes on after a stop."""
    node = graph.add(ReferenceGenerator(context=graph.context),
                     PlantSimulator(context=graph.context, overrides=quiet))[0]
    seen = graph.listen('reference/force', WrenchStamped)
    node._on_trajectory(force_over(1))
    graph.until(lambda: seen, 'the reference')
    if how == 'emergency stop':
        assert graph.call(Trigger, 'e_stop_trigger').success
    else:
        node._on_trajectory(JointTrajectory())
    graph.until(lambda: node._profile is None, 'the end of the trajectory')
    graph.until(lambda: graph.probe.count_publishers('reference/force') == 0,
                'the topic to be free for references of another node')
    graph.spin(0.2)
    seen.clear()
    graph.spin(0.3)
    assert not seen
    node._on_trajectory(force_over(1))
    graph.until(lambda: seen, 'the new reference')
    node._on_e_stop(Bool(data=False))
    assert node._profile
    node._profile, node._by_message = Points('file', 'force', (0.0,), (5.0,)), False
    node._on_e_stop(Bool(data=True))
    assert node._profile.name == 'file'
    node._on_trajectory(JointTrajectory(joint_names=['strain'], points=[
        JointTrajectoryPoint(positions=[0.1])]))
    graph.until(lambda: graph.probe.count_publishers('reference/strain') == 1
                and graph.probe.count_publishers('reference/force') == 0, 'strains only')
    node._on_trajectory(JointTrajectory())
    node.flush(0.0)  # as at the end of the process: nothing is left to wait for


def test_a_trajectory_that_is_over_by_its_stamp_is_refused(graph):
    """One that has begun is followed from where it would be now."""
    node = graph.add(ReferenceGenerator(context=graph.context))
    node._on_sample('force', interface.force_message(100_000_000_000, 0.0))
    with pytest.raises(InputError, match='began 40 s ago and is over'):
        node._on_trajectory(force_over(30, header=Header(stamp=Time(sec=60))))
    assert node._profile is None
    node._on_trajectory(force_over(50, header=Header(stamp=Time(sec=60))))
    assert node.run_time == pytest.approx(40.0)


def test_trajectory_starts_when_somebody_takes_it(graph, quiet):
    """In wall time the file's trajectory waits for rig and controller."""
    node = graph.add(ReferenceGenerator(context=graph.context,
                                        profile=Points('p', 'force', (0.0, 1.0), (5.0, 9.0))),
                     PlantSimulator(context=graph.context, overrides=quiet))[0]
    graph.spin(0.4)
    assert node.start is None
    seen = graph.listen('reference/force', WrenchStamped)
    graph.until(lambda: seen, 'the reference')
    assert seen[0].wrench.force.x < 5.5


def test_generator_gives_way_to_pressures_where_it_shall(graph):
    """Silent while pressures come and a second more, then on where it would be; else never."""
    sent = {}
    for shall in (True, False):
        node = graph.add(ReferenceGenerator(
            context=graph.context, profile=Points('p', 'force', (0.0, 10.0), (0.0, 10.0)),
            overrides={'give_way': shall, 'lock_step': True}))
        out = sent[shall] = {}
        publisher, write = node._outputs['force']
        node._outputs['force'] = publisher, lambda stamp, value, rate, out=out, write=write: (
            out.update({stamp // 10_000_000: value}), write(stamp, value, rate))[1]
        for k in range(100, 700):
            if 200 <= k < 300:
                node._on_pressures(interface.reference_pressures_writer(2)(0, [0.0, 0.0]))
            node._on_sample('force', interface.force_message(k * 10_000_000, 0.0))
    assert sorted(sent[False]) == list(range(100, 700))
    assert sorted(set(sent[False]) - set(sent[True])) == list(range(200, 398))
    assert sent[True][699] == sent[False][699] == pytest.approx(5.99)


def test_sensors_with_stamps_apart_give_one_reference_per_sample(graph):
    """Force 2 ms after strain: no reference goes back in time; a clock that was set does."""
    node = graph.add(ReferenceGenerator(context=graph.context,
                                        profile=Points('p', 'force', (0.0,), (5.0,))))
    sent = []
    node._send = sent.append
    start = 10_000_000_000
    for k in range(100):
        stamp = start + k * 5_000_000
        node._on_sample('strain', interface.strain_message(stamp + 2_000_000, 0.1, 0.0, 0.127))
        node._on_sample('force', interface.force_message(stamp, 30.0))
    assert len(sent) == 100
    assert sent == sorted(sent)
    node._on_sample('force', interface.force_message(1_000_000_000, 30.0))
    assert sent[-1] == 1_000_000_000


def test_monitor_refuses_a_model_of_other_motor_units(graph, tmp_path):
    """As recruitment does: the readings that it listens to would not fit."""
    node = graph.add(ModelMonitor(context=graph.context))
    model = load_model(config_path('models/spie2021.yaml'))
    other = tmp_path / 'one.yaml'
    save_model(Bundle('one', model.motor_units[:1], model.effects), other)
    with pytest.raises(InputError, match='has 1 motor units; this bundle has 2'):
        node._check({'model': str(other)})


def test_no_diagnosis_begins_that_could_not_be_written(graph, quiet, tmp_path):
    """It takes minutes, and its result would be lost at the end."""
    occupied = tmp_path / 'occupied'
    occupied.write_text('')
    node = graph.add(ModelMonitor(context=graph.context, overrides={
                         **quiet, 'diagnosis_folder': str(occupied / 'here')}),
                     PlantSimulator(context=graph.context, overrides={
                         **quiet, 'load.kind': 'dynamometer', 'load.repeat': True,
                         'load.profile': 'trajectories/live_strain.yaml'}))[0]
    graph.until(lambda: f'{occupied}/here: cannot be made' in graph.call(
        Trigger, 'diagnose').message, 'the refusal, once there are rows', 20.0)
    assert node._diagnosing._worker is None


def test_monitor_sees_a_hidden_effect(graph, quiet, tmp_path):
    """With hidden friction the residual is well above the noise; the true model's is a third."""
    hidden = tmp_path / 'hidden.yaml'
    save_model(load_model(config_path('models/spie2021.yaml')).with_effect(
        'coulomb_friction', force=6.0).named('hidden'), hidden)
    profile = Points('p', 'force', tuple(range(41)), (30.0, *(70.0, 30.0) * 20))
    nodes = make_nodes(graph.context, overrides={
        **quiet, 'sensors.force_noise': 0.5, 'lock_step': True, 'wait_for_reference': True,
        'start_enabled': True, 'plant_model': str(hidden), 'window': 2.0,
        'diagnosis_folder': str(tmp_path),
        'load.kind': 'mass_spring', 'load.stiffness_against': 2000.0, 'load.mass': 1.0},
        simulator={'script': graph.pacer}, generator={'profile': profile})
    graph.add(*nodes)
    rig = nodes[-1]
    residuals = graph.listen('model/residual', WrenchStamped)
    states = graph.diagnostics('model_monitor')
    monitor = next(n for n in nodes if isinstance(n, ModelMonitor))
    graph.advance(rig, lambda: not monitor.watch.holding.holds, 'an alarm', 40.0)
    values = np.array([m.wrench.force.x for m in residuals[100:]])
    floor = noise_floor(values)
    assert floor == pytest.approx(0.5, rel=0.3)
    without = np.sqrt(np.mean(values ** 2))
    assert without > 4 * floor
    graph.until(lambda: states and 'no longer holds' in states[-1].message, 'the warning')
    # up and down once: of what came since the model failed only two averages are in the memory
    graph.advance(rig, 2.0)
    assert graph.call(Trigger, 'diagnose').success
    assert 'at work already' in graph.call(Trigger, 'diagnose').message
    worker = monitor._diagnosing._worker
    assert graph.set('model_monitor', model=str(hidden))[0].successful
    count = len(residuals)
    # up and down once
    graph.advance(rig, 2.0)
    values = np.array([m.wrench.force.x for m in residuals[count + 20:]])
    assert np.sqrt(np.mean(values ** 2)) < without / 3
    assert monitor.watch.bundle.name == 'hidden'
    assert monitor.watch.holding.holds
    monitor.stop()
    assert worker._process.poll() is not None


def test_model_force_plus_residual_is_the_measured_force(graph, quiet):
    """Both topics carry the stamp of the reading they belong to."""
    graph.add(ModelMonitor(context=graph.context),
              PlantSimulator(context=graph.context, overrides=quiet))
    force = graph.listen('force', WrenchStamped)
    model = graph.listen('model/force', WrenchStamped)
    residual = graph.listen('model/residual', WrenchStamped)
    graph.until(lambda: len(residual) > 20, 'residuals')

    def by_stamp(messages):
        return {interface.stamp_ns(m.header.stamp): m.wrench.force.x for m in messages}
    measured, predicted, error = map(by_stamp, (force, model, residual))
    common = set(measured) & set(predicted) & set(error)
    assert len(common) > 10
    for stamp in common:
        assert measured[stamp] == pytest.approx(predicted[stamp] + error[stamp])
