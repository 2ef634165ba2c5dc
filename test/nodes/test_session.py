# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Whole runs: the same twice, one process or six, side by side, recorded, checked."""

from dataclasses import replace
import hashlib
import subprocess
import sys

from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.control import LoadModel
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.process import Spinner
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.recording import record
from fam_bundle_ros.nodes.recruitment_parameters import force_limits
from fam_bundle_ros.nodes.reference_generator import ReferenceGenerator
from fam_bundle_ros.nodes.rig_check import (
    _judge_channel,
    _judge_latency,
    _judge_values,
    check_rig,
)
from fam_bundle_ros.nodes.rig_parameters import LOAD, pressure_parameters, RIG, rig_config
from fam_bundle_ros.nodes.session import _parameters, run_trajectory
from fam_bundle_ros.plant import Dynamometer, MassSpring, Rig, rig_for, SensorConfig
from fam_bundle_ros.plant.rig import RigConfig
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.simulation import ClosedLoop, Trajectory

#: Wall-time runs share the machine with other tests: being held up is not what they are about.
PATIENT = {'sensor_timeout': 5.0, 'setpoint_timeout': 5.0, 'command_timeout': 5.0,
           'supply_timeout': 5.0, 'clocks_synchronised': False}
RAMP = Points('ramp', 'force', (0.0, 0.3, 1.3), (40.0, 40.0, 100.0))
#: Recruits the second motor unit too.
STEEP = Points('steep', 'force', (0.0, 0.1, 0.6), (40.0, 40.0, 100.0))


def digest(log):
    """Return a hash over everything that happened."""
    data = (log.time, log.force, log.strain, log.pressure, log.setpoint, log.command, log.state)
    return hashlib.sha256(b''.join(np.ascontiguousarray(x).tobytes() for x in data)).hexdigest()


def test_same_hash_twice_in_lock_step(domain_id):
    """A run in lock-step over real DDS is the same to the last bit, with noise."""
    first, second, other = (run_trajectory('spie2021', STEEP, domain=domain_id, seed=seed)
                            for seed in (0, 0, 1))
    assert len(first.time) == 120
    assert first.state.max() == 2
    assert digest(first) == digest(second)
    assert digest(other) != digest(first)


@pytest.mark.parametrize('named', [True, False])
def test_a_simulated_run_is_heard_only_in_a_domain_that_is_named(domain_id, named):
    """A rig under the same names must not get its valve commands."""
    context = Context()
    context.init(domain_id=domain_id)
    node = BundleNode('rig', (), context=context)
    executor, heard = SingleThreadedExecutor(context=context), []
    node.create_subscription(JointState, interface.valve_topic(1), heard.append, 10)
    executor.add_node(node)
    run_trajectory('spie2021', STEEP, domain=domain_id if named else None,
                   watch=lambda *_: executor.spin_once(0.002))
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()
    assert bool(heard) == named


def test_ros_agrees_with_the_loop_without_ros(domain_id):
    """The nodes do what the library does: the same tracking to well below the noise."""
    bundle = load_model(config_path('models/spie2021.yaml'))
    plan = Trajectory('ramp', 'force', RAMP.duration, RAMP.value, RAMP.rate, Dynamometer(0.1))
    ros = run_trajectory(bundle, plan, domain=domain_id, rig=RigConfig(
        sensors=SensorConfig.ideal()), overrides={'stuck_time': 0.0})
    library = ClosedLoop(bundle, rig=RigConfig(sensors=SensorConfig.ideal()), period=5e-3,
                         pid_period=5e-3).run(plan)
    assert ros.time == pytest.approx(library.time)
    assert ros.reference == pytest.approx(library.reference)
    known = np.isfinite(library.overlap).all(axis=1) & (ros.state == library.state)
    # No time has passed before the first sample of a node: its first switch is a tick apart.
    known[:2] = False
    assert known.sum() > 100
    assert ros.overlap[known] == pytest.approx(library.overlap[known], abs=2.0)
    settled = ros.time > 0.3
    assert np.sqrt(np.mean((ros.force - library.force)[settled] ** 2)) < 0.5
    assert abs(len(ros.switches) - len(library.switches)) <= 1


def test_controller_is_told_of_the_load():
    """The load's holding force reaches the node parameters as force and stiffness."""
    rig = Rig(load_model(config_path('models/spie2021.yaml')),
              RigConfig(load=MassSpring(mass=5.0, stiffness_against=800.0)))
    told = _parameters(RigConfig(), rig)
    line = LoadModel(told['load_model.force'], told['load_model.stiffness'])
    assert line.holding_force(0.1) == pytest.approx(rig.load.holding_force(0.1, rig.length))
    assert line.stiffness == pytest.approx(800.0 * rig.length)


def test_bag_holds_every_sample(domain_id, tmp_path):
    """Each topic of the interface is in the bag, byte for byte, stamped in simulated time."""
    rosbags = pytest.importorskip('rosbags.highlevel')
    run_trajectory('spie2021', STEEP, domain=domain_id, bag=tmp_path / 'deep' / 'bag')
    from rosbags.typesys import get_typestore, Stores
    with rosbags.AnyReader([tmp_path / 'deep' / 'bag'],
                           default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        count = {c.topic: c.msgcount for c in reader.connections}
        for topic in ('force', 'strain', 'supply/pressure', 'mu1/pressure', 'mu2/valve_command',
                      'mu1/pressure_setpoint', 'reference/force', 'model/residual'):
            assert count[f'/bundle/{topic}'] >= 120
        assert count['/bundle/recruitment_state'] >= 2
        connection = next(c for c in reader.connections if c.topic == '/bundle/force')
        _, stamp, raw = next(reader.messages([connection]))
        message = reader.deserialize(raw, connection.msgtype)
        assert (stamp, message.header.frame_id) == (5_000_000, 'load_cell')


def test_bag_that_is_there_is_not_overwritten(domain_id, tmp_path):
    """An old recording is never lost."""
    pytest.importorskip('rosbags')
    with pytest.raises(InputError, match='is there already'):
        run_trajectory('spie2021', RAMP, domain=domain_id, bag=tmp_path)


def test_wall_time_tracks_too(domain_id):
    """Without lock-step: the same nodes at their rate, force on the reference."""
    log = run_trajectory('spie2021', RAMP, domain=domain_id, lock_step=False)
    end = log.time > 0.5
    assert np.sqrt(np.mean(log.error[end] ** 2)) < 3.0
    assert log.state.max() == 2


def strong_bundle():
    """Return the bundle of the paper with muscles that take 600 kPa."""
    paper = load_model(config_path('models/spie2021.yaml'))
    return type(paper)('strong', [replace(unit, max_pressure=600e3)
                                  for unit in paper.motor_units], paper.effects)


def test_muscles_for_600_kpa_are_driven_to_their_limit(domain_id):
    """The simulated rig's supply and trip go with the model."""
    bundle = strong_bundle()
    force = bundle.force(0.1, [580e3, 580e3])
    log = run_trajectory(bundle, Points('high', 'force', (0.0, 1.5, 2.0), (40.0, force, force)),
                         domain=domain_id)
    assert log.pressure.max() > 550e3
    assert np.abs(log.error[-20:]).max() < 3.0


def test_parameters_for_strong_muscles_describe_such_a_rig():
    """What `measure` and `run` give the simulator; the usual rig needs none."""
    strong = strong_bundle()
    assert pressure_parameters(load_model(config_path('models/spie2021.yaml'))) == {}
    values = {spec.name: spec.default for spec in (*RIG, *LOAD)}
    made = rig_config({**values, 'ambient_pressure': 101325.0, **pressure_parameters(strong)})
    wanted = rig_for(strong)
    assert (made.supply, made.trip_pressure) == (wanted.supply, wanted.trip_pressure)
    assert made.chamber.relief_pressure == wanted.chamber.relief_pressure


def test_two_bundles_side_by_side(ros_context):
    """Two namespaces in one process do not hear each other."""
    values = {'start_stopped': False, 'start_enabled': True, 'monitor': False,
              'load.kind': 'dynamometer', **PATIENT}
    rigs, nodes = [], []
    for name, force in (('left', 30.0), ('right', 70.0)):
        mine = make_nodes(ros_context, name, overrides=values,
                          generator={'profile': Points(name, 'force', (0.0,), (force,))})
        rigs.append(mine[-1])
        nodes += mine
    spinner = Spinner(ros_context, nodes)
    for _ in range(40):
        spinner.spin(0.5)
        forces = [rig.rig.truth.force for rig in rigs]
        if forces == pytest.approx([30.0, 70.0], abs=4.0):
            break
    spinner.close()
    assert forces == pytest.approx([30.0, 70.0], abs=4.0)


class Hasher(BundleNode):
    """
    Collects what goes round in the loop from a stamp on up to another.

    A publisher in another process may send its first messages before it has discovered this node;
    what comes later depends on them.
    """

    TOPICS = ('force', 'mu1/valve_command', 'mu2/pressure')

    def __init__(self, context, begin, end):
        super().__init__('hasher', (), context=context)
        self.rows = {}
        self.end = end
        for topic, kind, read in (
                ('force', WrenchStamped, interface.read_force),
                ('mu1/valve_command', JointState, lambda m: m.effort[0]),
                ('mu2/pressure', FluidPressure, lambda m: m.fluid_pressure)):
            def take(message, topic=topic, read=read):
                stamp = interface.stamp_ns(message.header.stamp)
                if begin <= stamp <= end:
                    self.rows[topic, stamp] = read(message)
            self.create_subscription(kind, topic, take, interface.LOCK_STEP)

    def done(self):
        return all((topic, self.end) in self.rows for topic in self.TOPICS)


def test_one_process_gives_what_six_give(domain_id):
    """Lock-step is deterministic whatever order messages arrive in."""
    profile = Points('ramp', 'force', (0.0, 0.1, 0.4), (40.0, 40.0, 80.0))
    parameters = {'lock_step': True, 'wait_for_reference': True, 'start_enabled': True,
                  'start_stopped': False, 'load.kind': 'dynamometer', 'generate': False,
                  'lock_step_timeout': 30.0}
    flags = [part for name, value in parameters.items()
             for part in ('-p', f'{name}:={str(value).lower()}')]
    hashes = []
    for processes in (1, 6):
        context = Context()
        context.init(domain_id=domain_id)
        hasher = Hasher(context, 20 * 5_000_000, 100 * 5_000_000)
        nodes = [hasher]
        running = []
        if processes == 1:
            nodes += make_nodes(context, overrides=parameters)
        else:
            for node, more in (('plant_simulator', []), ('recruitment_controller', []),
                               ('model_monitor', []),
                               ('pressure_pid', ['-p', 'motor_unit:=1', '-r', '__node:=pid1']),
                               ('pressure_pid', ['-p', 'motor_unit:=2', '-r', '__node:=pid2'])):
                running.append(subprocess.Popen(
                    [sys.executable, '-c', f'import sys; from fam_bundle_ros.nodes.{node} '
                     'import main; sys.exit(main())', '--ros-args', *flags, *more]))
        spinner = Spinner(context, nodes)
        for _ in range(300):
            spinner.spin(0.1)
            if all(hasher.count_publishers(topic) for topic in Hasher.TOPICS):
                break
        missing = [t for t in Hasher.TOPICS if not hasher.count_publishers(t)]
        # Nothing moves without a reference: this begins the run.
        generator = ReferenceGenerator(context=context, profile=profile, overrides=parameters)
        spinner.nodes.append(generator)
        spinner.executor.add_node(generator)
        for _ in range(300):
            spinner.spin(0.1)
            if hasher.done():
                break
        for process in running:
            process.terminate()
        statuses = [process.wait(60) for process in running]
        spinner.close()
        context.try_shutdown()
        assert hasher.done(), f'{processes} processes, not found {missing}, {len(hasher.rows)}'
        assert not any(statuses)
        hashes.append(hashlib.sha256(repr(sorted(hasher.rows.items())).encode()).hexdigest())
    assert hashes[0] == hashes[1]


@pytest.fixture
def running_bundle(domain_id, repository):
    """Yield a bundle in a process of its own, in wall time."""
    process = subprocess.Popen([
        sys.executable, '-c', 'import sys; from fam_bundle_ros.nodes.bundle_bringup import main; '
        'sys.exit(main())'])
    yield process
    process.terminate()
    assert process.wait(60) == 0


def test_check_rig_finds_all_right_and_record_hears_it(running_bundle, domain_id, tmp_path):
    """The simulator passes the check that a rig has to pass; its topics are recorded."""
    pytest.importorskip('rosbags')
    findings = check_rig(seconds=1.0, forces=FORCES, domain=domain_id, patience=15.0)
    assert [str(f) for f in findings if not f.ok] == []
    text = '\n'.join(map(str, findings))
    # The reference of the trajectory at that moment: absolute, hence 101 kPa or more.
    assert float(text.partition('mu2/pressure unit: ')[2].partition(' kPa')[0]) > 100.0
    assert ' N, noise ' in text
    assert 'motor units: 2, but 1 in the model' in text
    assert record(tmp_path / 'bag', 1.5, domain=domain_id) > 500
    assert (tmp_path / 'bag' / 'metadata.yaml').is_file()


#: Limits of the force for a bundle of the usual size, N.
FORCES = force_limits(0.0)
#: A driver in a process of its own: force, strain, stamp of force, pressure as it is sent.
DRIVER = """
import sys, time
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.process import run
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import FluidPressure, JointState
class Bad(BundleNode):
    def __init__(self, context):
        super().__init__('bad', (), context=context, namespace='driver')
        self.a = self.publisher('force', WrenchStamped)
        self.b = self.publisher('strain', JointState)
        self.c = self.publisher('mu1/pressure', FluidPressure)
        self.every(0.01, self.tick)
        print('up', flush=True)
    def tick(self):
        force, strain, stamp, pressure = eval(sys.argv[1])
        self.a.publish(interface.force_message(stamp and self.now_ns(), force))
        self.b.publish(interface.strain_message(self.now_ns(), strain, 0.0, 0.127))
        self.c.publish(interface.pressure_message(self.now_ns(), pressure, 0.0))
sys.exit(run(lambda context: [Bad(context)], '', ['driver']))
"""


def check_driver(domain_id, force, strain, stamp, pressure, **options):
    """Return what check_rig finds of a driver that sends these numbers."""
    process = subprocess.Popen([sys.executable, '-c', DRIVER,
                                repr((force, strain, stamp, pressure))], stdout=subprocess.PIPE)
    try:
        process.stdout.readline()   # it is up
        return check_rig('driver', 1.0, domain=domain_id,
                         **{'patience': 15.0, 'forces': FORCES, **options})
    finally:
        process.terminate()
        process.wait(60)


def test_check_rig_says_what_is_wrong(domain_id):
    """Gauge pressure, strain in %, no stamps, nobody at the valves, no MU2: one finding each."""
    findings = check_driver(domain_id, -80.0, 12.0, 0, 20e3, units=2, patience=5.0,
                            forces=(-60.0, 900.0))
    wrong = {f.what: f.detail for f in findings if not f.ok}
    assert 'zero or go backwards' in wrong['force stamps']
    assert 'expected -60 to 900 N, tension positive' in wrong['force unit and sign']
    assert 'not % or mm' in wrong['strain unit and sign']
    assert 'pressure_is_gauge' in wrong['mu1/pressure unit']
    assert 'no subscriber' in wrong['mu1/valve_command']
    assert 'no publisher' in wrong['mu2/pressure']
    assert 'e_stop' in wrong
    latency = next(f for f in findings if f.what == 'mu1/pressure latency')
    assert ' ms, jitter ' in latency.detail


@pytest.mark.parametrize(('largest', 'force', 'verdict'), [
    (130.0, -62.0, 'note'), (130.0, -250.0, 'FAIL'), (1885.0, -250.0, 'note'),
    (1885.0, -1000.0, 'FAIL'), (13e3, 7e3, 'note'), (1885.0, 7e3, 'FAIL')])
def test_check_rig_judges_a_force_by_the_limits_of_the_controller(largest, force, verdict):
    """A vented bundle that is pressed together pushes back; a strong one more than a small one."""
    finding = _judge_values('force', np.full(50, force), False, force_limits(largest))
    assert finding.verdict == verdict, finding
    assert ('pressed together' in finding.detail) == (verdict == 'note' and force < 0.0)


@pytest.mark.parametrize(('latency', 'verdict', 'text'), [
    (2e-3, 'ok', '2.0 ms, jitter 0.5 ms; the clocks agree'),
    (20e-3, 'note', 'more than three samples (15 ms) are refused'),
    (-3600.0, 'note', 'the clocks of rig and this machine disagree')])
def test_check_rig_shows_latency_and_whether_the_clocks_agree(latency, verdict, text):
    """Stamps against the clock of the machine that will control."""
    late = np.append(np.full(197, latency), np.full(3, latency + 0.5e-3))
    finding = _judge_latency('force', late, 200.0)
    assert (finding.verdict, text in finding.detail) == (verdict, True), finding.detail


@pytest.mark.parametrize(('pressure', 'gauge', 'verdict', 'text'), [
    (101.3, False, 'FAIL', 'looks like kPa, expected Pa'),
    (1.013, False, 'FAIL', 'looks like bar, expected Pa'),
    (14.7, True, 'FAIL', 'looks like psi, expected Pa'),
    (180.0, False, 'FAIL', 'pressure_is_gauge'),
    (180.0, True, 'note', 'cannot be determined at rest'),
    (150e3, True, 'ok', '150.0 kPa, noise 0.00 kPa gauge'),
    (101.4e3, True, 'FAIL', 'looks absolute'),
    (101.4e3, False, 'ok', '101.4 kPa absolute'),
])
def test_check_rig_tells_gauge_from_absolute_and_from_kpa(pressure, gauge, verdict, text):
    """A gauge driver that is set up as one passes; what rest does not show is left to you."""
    found = _judge_values('mu1/pressure', np.full(50, pressure), gauge, FORCES)
    assert found.verdict == verdict
    assert text in found.detail
    assert ('pressure_is_gauge' in found.detail) == (text in ('pressure_is_gauge',
                                                              'looks absolute'))


def test_check_rig_leaves_a_force_and_a_strain_at_rest_to_you():
    """Near zero neither unit nor sign can be told; further off both can."""
    for name, rest, work, wrong in (('force', 2.0, 80.0, -800.0), ('strain', 0.0, 0.1, 12.0)):
        verdicts = [_judge_values(name, np.full(50, value), False, FORCES).verdict
                    for value in (rest, work, wrong)]
        assert verdicts == ['note', 'note' if name == 'force' else 'ok', 'FAIL']


def test_check_rig_notes_a_strain_below_zero():
    """That of an encoder with the wrong sign, or of a bundle that a load stretches."""
    finding = _judge_values('strain', np.full(50, -0.05), False, FORCES)
    assert (finding.verdict, 'only if the bundle is stretched' in finding.detail) == ('note', True)


@pytest.mark.parametrize(('rate', 'verdict'), [(49.97, 'ok'), (45.0, 'FAIL')])
def test_check_rig_takes_fifty_readings_a_second_as_they_are_counted(rate, verdict):
    """A timer of 20 ms is late rather than early."""
    rows = [(k / rate, int(1e9 * k / rate) + 10**9, 1e-3, 50.0 + k % 3) for k in range(100)]
    found = {each.what: each for each in _judge_channel(
        'force', rows, None, 2.0, False, FORCES)}
    assert found['force rate'].verdict == verdict, found['force rate'].detail


@pytest.mark.parametrize('gap', [0.0, 0.2])
def test_check_rig_notes_readings_that_drop_out(gap):
    """At such a rate on average, but lost for the controllers now and then."""
    times = 5e-3 * np.arange(400) + gap * (np.arange(400) > 200)
    rows = [(time, int(1e9 * time) + 10**9, 1e-3, 50.0 + k % 3) for k, time in enumerate(times)]
    gaps = [str(each) for each in _judge_channel('force', rows, None, 2.0, False, FORCES)
            if each.what == 'force gaps']
    assert len(gaps) == (gap > 0.0)
    assert all(text.startswith('note force gaps: none for 0.2') for text in gaps)


def test_record_without_a_bundle_fails(domain_id, tmp_path, monkeypatch):
    """Nothing there: one sentence, no waiting forever, and nothing in the way of a next try."""
    pytest.importorskip('rosbags')
    monkeypatch.setattr('fam_bundle_ros.nodes.recording._PATIENCE', 0.5)
    with pytest.raises(InputError, match='no topics of a bundle under /bundle'):
        record(tmp_path / 'bag', 5.0, domain=domain_id)
    assert not (tmp_path / 'bag').exists()
