# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Real processes: clean ends, bad input, lost nodes, launch files."""

import ast
from importlib import import_module
import inspect
import os
import signal
import subprocess
import sys

import pytest
from rclpy.context import Context
from sensor_msgs.msg import FluidPressure, JointState

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.resources import config_path


@pytest.fixture
def main(capfd):
    """Return a function that runs an executable in this process; status, stdout and stderr."""
    # `run` ignores signals from its end on, as a process that is about to exit should
    handlers = {number: signal.getsignal(number) for number in (
        signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def run(node, *arguments):
        capfd.readouterr()
        try:
            status = import_module(f'fam_bundle_ros.nodes.{node}').main([node, *arguments])
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        return status, *capfd.readouterr()
    return run


@pytest.fixture
def heard():
    """Let processes hear SIGHUP, where the tests themselves run under nohup too."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_vents_and_exits_0(graph, number, start, heard):
    """The last command of a PID that is asked to end is to exhaust, and its status is 0."""
    # messages of a busy machine may be late: that is another test's
    process = start('pressure_pid', '--ros-args', '-p', 'motor_unit:=1', '-p',
                    'clocks_synchronised:=false')
    commands = graph.listen('mu1/valve_command', JointState)
    pressure = graph.probe.create_publisher(FluidPressure, 'mu1/pressure', 10)
    setpoint = graph.probe.create_publisher(FluidPressure, 'mu1/pressure_setpoint', 10)

    def feed():
        stamp = graph.probe.now_ns()
        pressure.publish(interface.pressure_message(stamp, 100e3 + stamp % 97, 101325.0))
        setpoint.publish(interface.pressure_message(stamp, 150e3, 101325.0))
        return commands and commands[-1].effort[0] > 0.0
    graph.until(feed, 'filling')
    process.send_signal(number)
    # Ctrl-C under launch arrives twice.
    process.send_signal(number)
    graph.until(lambda: (feed(), process.poll() is not None)[1], 'the end')
    graph.until(lambda: commands[-1].effort[0] == -1.0, 'the vent')
    _, errors = process.communicate()
    assert (process.returncode, errors) == (0, '')


def test_a_node_that_hangs_while_it_ends_is_ended(domain_id):
    """As a destroyed participant of Fast DDS may, with Python's lock held, for an hour."""
    process = subprocess.Popen([sys.executable, '-c', """
import ctypes, sys, time
from fam_bundle_ros.nodes import process
from fam_bundle_ros.nodes.pressure_pid import main
process.END = 1.0
def close(spinner):
    print('ends', flush=True)
    ctypes.PyDLL(None).sleep(3600)
process.Spinner.close = close
process.Spinner.spin = lambda spinner: print('spins', flush=True) or time.sleep(0.1)
sys.exit(main())
""", '--ros-args', '-p', 'motor_unit:=1'], stdout=subprocess.PIPE, text=True)
    while process.stdout.readline().strip() != 'spins':
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 1
    assert 'ends' in process.stdout.read()


def test_killed_controller_leaves_no_pressure(graph, start):
    """SIGKILL of the whole controller: the simulator times out on its own."""
    from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
    rig = graph.add(PlantSimulator(context=graph.context, overrides={
        'start_stopped': False, 'load.kind': 'dynamometer'}))
    process = start('bundle_bringup', '--ros-args', '--params-file',
                    str(config_path('simulation.yaml')), '-p', 'simulate:=false')
    graph.until(lambda: rig.rig.truth.pressure[0] > 50e3, 'pressure')
    process.kill()
    process.wait()
    graph.until(lambda: rig.rig.truth.pressure.max() < 5e3, 'vented')


def test_no_timer_runs_before_everything_is_imported(domain_id):
    """The timers of a node that is made before a long import are silent for as long after it."""
    program = """
import sys
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.nodes.process import run
def make(context):
    known = 'fam_bundle_ros.nodes.bundle_bringup' in sys.modules
    raise InputError('known' if known else 'unknown')
sys.exit(run(make, '', ['node']))
"""
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, check=False)
    assert (done.returncode, done.stderr) == (2, 'node: known\n')


def test_a_node_does_not_stop_to_search_all_for_garbage(domain_id):
    """Nearly all that a process holds is there before it spins, and not looked through again."""
    program = """
import gc, os, signal, sys
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.process import run
class Node(BundleNode):
    def __init__(self, context):
        super().__init__('node', (), context=context)
        self.every(0.01, self.count)
    def count(self):
        print(len(gc.get_objects()) < 0.1 * gc.get_freeze_count())
        os.kill(os.getpid(), signal.SIGINT)
sys.exit(run(lambda context: [Node(context)], '', ['node']))
"""
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          env={**os.environ, 'ROS_DOMAIN_ID': str(domain_id)}, check=False)
    assert (done.returncode, done.stdout.split()[:1]) == (0, ['True']), done.stderr


def test_node_that_cannot_stop_leaves_the_others_vented(ros_context):
    """An exception in one farewell reaches neither the other nodes nor the caller."""
    from fam_bundle_ros.nodes.base import BundleNode
    from fam_bundle_ros.nodes.process import Spinner
    ended = []

    class Node(BundleNode):
        def stop(self):
            ended.append(self.get_name())
            if self.get_name() == 'first':
                raise ValueError('no')

        def flush(self, deadline):
            ended.append('flush')
            raise RuntimeError('gone')
    nodes = [Node(name, (), context=ros_context) for name in ('first', 'second')]
    Spinner(ros_context, nodes).close()
    assert ended == ['first', 'second', 'flush', 'flush']


def test_a_quiet_context_leaves_the_log_as_it_was():
    """After a benchmark in a notebook the nodes of the next cell still warn."""
    levels = subprocess.run([sys.executable, '-c', """
from rclpy.logging import get_logger_effective_level
from fam_bundle_ros.nodes.process import ros_context
with ros_context(log_level='fatal'):
    print(int(get_logger_effective_level('')))
print(int(get_logger_effective_level('')))
"""], stdout=subprocess.PIPE, text=True).stdout
    assert levels.split() == ['50', '20']


@pytest.mark.parametrize(('node', 'argument', 'text'), [
    ('plant_simulator', 'rate:=1.0e9', 'parameter rate is 1000000000.0; expected a number'),
    ('pressure_pid', 'gains.p:=3', 'parameter gains.p is 3; expected a number with a decimal '
     'point (3.0, not 3)'),
    ('model_monitor', 'model:=nowhere.yaml', 'nowhere.yaml: no such file ships'),
    ('recruitment_controller', 'over_presure_factor:=1.1', "did you mean 'over_pressure_factor'?"),
    ('reference_generator', 'repeet:=true', "did you mean 'repeat'?"),
    ('bundle_bringup', 'load.kind:=crane', "load.kind is 'crane'; expected one of dynamometer"),
])
def test_bad_parameter_is_one_line_and_status_2(domain_id, node, argument, text, main):
    """What was given, what is expected, nothing else; for every executable."""
    status, said, errors = main(node, '--ros-args', '-p', argument)
    assert (status, said) == (2, '')
    assert len(errors.strip().splitlines()) == 1
    assert errors.startswith(f'{node}: ')
    assert text in errors


@pytest.mark.parametrize(('section', 'right'), [
    ('recruitment_controller', False), ('/left/recruitment_controller', False), ('/**', True),
    ('/bundle/recruitment_controller', True), ('/**/recruitment_controller', True),
    ('/*/model_monitor', True), ('/*', False), ('bundle', True)])
def test_a_parameter_file_for_other_nodes_does_not_run_a_rig_on_defaults(
        tmp_path, ros_context, section, right):
    """ROS ignores sections that match no node: a name alone is of the root namespace."""
    path = tmp_path / 'rig.yaml'
    body = '  ros__parameters:\n    outer:\n      delay: 0.02\n'
    if section == 'bundle':
        body = '  recruitment_controller:\n' + body.replace('  ', '    ')
    path.write_text(f'{section}:\n{body}', encoding='utf-8')
    context = Context()
    context.init(args=['--ros-args', '--params-file', str(path), '-p', 'outer.delay:=0.02'])
    try:
        if right:
            for node in make_nodes(context, files=[str(path)]):
                node.destroy_node()
        else:
            with pytest.raises(InputError, match=r'rig.yaml: section /\S+ is for no node .*'
                               '/bundle/recruitment_controller'):
                make_nodes(context, files=[str(path)])
    finally:
        context.try_shutdown()


def test_a_plant_with_other_motor_units_than_the_model_is_refused(tmp_path, ros_context):
    """Else the pressure loop of a unit that the plant lacks waits for ever, and all with it."""
    both = load_model('spie2021')
    path = tmp_path / 'one.yaml'
    save_model(Bundle('one', both.motor_units[:1], both.effects), path)
    with pytest.raises(InputError, match='plant_model has 1 motor unit, the model of the '
                                         'controller 2; expected as many'):
        make_nodes(ros_context, overrides={'plant_model': str(path)})


def test_bad_parameter_file_is_one_line_and_status_2(domain_id, tmp_path, start):
    """A file that is not there, or no YAML; of a process too nothing else is heard."""
    process = start('pressure_pid', '--ros-args', '--params-file', str(tmp_path / 'none.yaml'))
    said, errors = process.communicate(timeout=60)
    assert (process.returncode, said) == (2, '')
    assert 'none.yaml' in errors
    assert len(errors.strip().splitlines()) == 1
    assert 'Traceback' not in errors


def test_unknown_argument_is_refused(main):
    """A parameter without --ros-args would be ignored in silence."""
    status, _, errors = main('pressure_pid', 'motor_unit:=2')
    assert (status, 'given as --ros-args' in errors) == (2, True)


def test_help_lists_the_parameters(main):
    """--help says what the node is for, and every parameter with its range."""
    status, text, _ = main('pressure_pid', '--help')
    assert status == 0
    assert 'gains.p = 54.0 [0..1000] (changes while running)' in text


@pytest.mark.parametrize(('name', 'more'), [('bundle.launch.py', set()),
                                            ('controller.launch.py', {'monitor'})])
def test_launch_file_declares_what_users_expect(repository, name, more):
    """Launch files compile and take namespace, params_file, use_sim_time, log_level, model."""
    source = (repository / 'launch' / name).read_text()
    tree = ast.parse(compile(source, name, 'exec', ast.PyCF_ONLY_AST) and source)
    declared = {node.args[0].value for node in ast.walk(tree) if isinstance(node, ast.Call)
                and getattr(node.func, 'id', '') == 'DeclareLaunchArgument'}
    assert declared == {'namespace', 'params_file', 'use_sim_time', 'log_level', 'model'} | more


def test_the_first_line_of_a_log_is_as_quick_as_the_next(graph, monkeypatch):
    """The look through all modules for the caller is done when the node starts."""
    monkeypatch.setattr(inspect, 'modulesbyfile', {})
    monkeypatch.setattr(inspect, '_filesbymodname', {})
    node = graph.add(BundleNode('talker', (), context=graph.context))
    looked, look = [], inspect.getabsfile
    monkeypatch.setattr(inspect, 'getabsfile', lambda *file: looked.append(file) or look(*file))
    node.get_logger().error('OVER_PRESSURE')
    assert len(looked) < 0.1 * len(sys.modules)
