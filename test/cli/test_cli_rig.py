# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands that speak ROS 2, over real rclpy."""

from dataclasses import replace
from functools import partial
import json
import os
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy')

from fam_bundle_ros import discovery
from fam_bundle_ros.cli.demo import stories
from fam_bundle_ros.nodes import rig_check, session

LIFT = """
format: fam-bundle-trajectory/1
name: up and down
quantity: strain
points: [[0 s, 4 %], [1 s, 8 %], [2 s, 4 %]]
"""


@pytest.fixture(scope='module')
def running_bundle(repository, domain_id, prior, tmp_path_factory):
    """Yield ``fam_bundle run`` as a process that simulates and moves; the last test ends it."""
    folder = tmp_path_factory.mktemp('run')
    (folder / 'lift.yaml').write_text(LIFT)
    with prior():
        process = subprocess.Popen(
            [sys.executable, '-m', 'fam_bundle_ros', 'run', '--model', 'spie2021',
             '--trajectory', 'lift.yaml'],
            cwd=folder, stderr=subprocess.PIPE, text=True,
            env={**os.environ, 'PYTHONPATH': str(repository), 'ROS_DOMAIN_ID': str(domain_id)})
    yield process
    process.kill()
    process.wait()


def test_run_tells_the_controller_of_the_mass_it_hangs_up(running_bundle, ros_context):
    """5 kg on 127 mm with 5 N s/m: weight, inertia and damping in the controller's own units."""
    from rcl_interfaces.srv import GetParameters
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    names = ['force', 'stiffness', 'inertia', 'damping']
    node = rclpy.create_node('asker', context=ros_context)
    client = node.create_client(GetParameters, '/bundle/recruitment_controller/get_parameters')
    executor = SingleThreadedExecutor(context=ros_context)
    executor.add_node(node)
    assert client.wait_for_service(20.0)
    future = client.call_async(GetParameters.Request(names=[f'load_model.{n}' for n in names]))
    executor.spin_until_future_complete(future, timeout_sec=10.0)
    told = [value.double_value for value in future.result().values]
    executor.shutdown()
    node.destroy_node()
    assert told == pytest.approx([5.0 * 9.80665, 0.0, 5.0 * 0.127, 5.0 * 0.127], abs=1e-3)


def test_call_stops_a_running_bundle_and_starts_it_again(fam_bundle, running_bundle):
    """The answer of the service is printed; 1 where it refuses, 2 where it was not called."""
    for _ in range(10):  # the first start compiles before it offers its services
        if fam_bundle('call', 'tare').returncode != 2:
            break
    for *words, status, told in (
            ('e_stop_trigger', 0, 'stopped'), ('enable', 'true', 1, 'emergency stop'),
            ('e_stop_reset', 0, 'running'), ('enable', 'true', 0, 'on, from'),
            ('enable', 2, '/bundle/enable needs true or false'),
            ('tare', 'true', 2, '/bundle/tare takes no value'),
            ('enabel', 2, 'no service /bundle/enabel; expected one of adaptation/reset')):
        result = fam_bundle('call', *words)
        assert result.returncode == status, (words, result)
        assert told in (result.stderr if status == 2 else result.stdout), (words, result)
        assert len((result.stdout + result.stderr).splitlines()) == 1, (words, result)


def test_a_running_bundle_is_checked_recorded_and_read(fam_bundle, running_bundle, tmp_path):
    """`run` speaks the interface; `record` makes a bag that `convert` reads; Ctrl-C ends well."""
    for _ in range(10):  # the first start compiles before it publishes
        checked = fam_bundle('check-rig', '--seconds', '1', '--json', 'check.json')
        if checked.returncode == 0:
            break
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert json.loads((tmp_path / 'check.json').read_text())['ok']
    recorded = fam_bundle('record', 'bag', '--seconds', '3', '--json', 'record.json')
    assert recorded.returncode == 0, recorded.stderr
    messages = json.loads((tmp_path / 'record.json').read_text())['messages']
    assert messages > 1000
    converted = fam_bundle('convert', 'bag', 'log.csv')
    assert converted.returncode == 0, converted.stderr
    rows = (tmp_path / 'log.csv').read_text().splitlines()
    assert rows[0].startswith('time [s],trial,strain,pressure.mu1 [kPa],pressure.mu2 [kPa]')
    # two pressures, their setpoints and states, force, strain, ...: 13 messages a sample
    assert messages / 20 < len(rows) < messages / 10
    again = fam_bundle('record', 'bag', '--seconds', '1')
    assert again.returncode == 2
    assert 'bag' in again.stderr
    running_bundle.send_signal(signal.SIGINT)
    _, stderr = running_bundle.communicate(timeout=60)
    assert running_bundle.returncode == 0, stderr
    # A strain was asked for: the rig has a load that moves.
    strain = [float(row.split(',')[2]) for row in rows[1:]]
    assert max(strain) - min(strain) > 0.005, recorded.stderr + stderr


def test_run_refuses_what_it_does_not_know(fam_bundle, domain_id):
    """A model or a parameter that is not there: one line, status 2, nothing started."""
    for arguments, word in ((['--model', 'absent'], 'absent'),
                            (['--params-file', 'absent.yaml'], 'absent.yaml'),
                            (['--ros-args', '-p', 'rate:=-3.0'], 'rate'),
                            (['--ros-args', '-p', 'load_model.mass:=5.0'], 'load_model.mass'),
                            (['--policy', 'brave'], 'brave')):
        result = fam_bundle('run', *arguments)
        assert result.returncode == 2, arguments
        assert word in result.stderr
        assert len(result.stderr.splitlines()) == 1, result.stderr


def test_a_parameter_on_the_command_line_of_run_wins_over_the_file(fam_bundle, domain_id,
                                                                   tmp_path):
    """`run --rig --params-file my_rig.yaml --ros-args -p rate:=...`: the rate is that of -p."""
    (tmp_path / 'my_rig.yaml').write_text('/**: {ros__parameters: {rate: -1.0}}')
    result = fam_bundle('run', '--rig', '--params-file', 'my_rig.yaml', '--ros-args', '-p',
                        'rate:=-3.0')
    assert 'rate is -3.0' in result.stderr


def test_call_fails_where_there_is_no_bundle(fam_bundle, domain_id, monkeypatch):
    """One line with the name of the service that was looked for."""
    monkeypatch.setattr('fam_bundle_ros.nodes.calling._PATIENCE', 0.5)
    result = fam_bundle('call', 'enable', 'true', '--namespace', '/nobody')
    assert (result.returncode, result.stderr) == (
        2, 'fam_bundle: no service /nobody/enable; is the bundle running, in this ROS domain?\n')


def test_check_rig_fails_where_there_is_no_rig(fam_bundle, domain_id, monkeypatch):
    """Without a rig in the domain `check-rig` says what it misses, stops, and exits with 1."""
    # nothing comes, however long it waits
    monkeypatch.setattr(rig_check, 'check_rig', partial(rig_check.check_rig, patience=0.5))
    result = fam_bundle('check-rig', '--seconds', '0.5', '--namespace', '/nobody', '--active',
                        '--model', 'spie2021', '--yes')
    assert result.returncode == 1
    assert 'FAIL' in result.stdout
    assert 'air test not started, my_rig.yaml not written: first correct force,' in result.stdout


#: How many times as fast the stories are told; more, and the force has no time to come to rest.
PACE = {'force': 1.5, 'strain': 2.5}


def quicker(bundle):
    """Return the stories of `demo` in less time; `test_demo` has them whole."""
    return tuple((name, replace(
        task, duration=task.duration / pace, prepare=1.0,
        value=lambda t, task=task, pace=pace: task.value(pace * t),
        rate=lambda t, task=task, pace=pace: pace * task.rate(pace * t)), words)
        for (name, task, words), pace in ((story, PACE[story[0]]) for story in stories(bundle)))


def test_demo_tells_the_whole_story(fam_bundle, domain_id, tmp_path, monkeypatch, diagnose_map):
    """`demo`: RS1 to RS2 to RS1 twice over ROS, the model's error by step, report/ whole."""
    monkeypatch.setattr('fam_bundle_ros.cli.demo.stories', quicker)
    # half as many samples, half the work
    monkeypatch.setattr(session, 'run_trajectory', partial(session.run_trajectory, rate=100.0))
    monkeypatch.setattr(discovery, 'diagnose', diagnose_map)
    result = fam_bundle('demo')
    assert result.returncode == 0, result.stderr
    assert sorted(p.name for p in (tmp_path / 'report').iterdir()) == [
        'bag', 'index.html', 'metrics.json']
    found = json.loads((tmp_path / 'report' / 'metrics.json').read_text())
    for kind, rms, largest in (('force', 0.5, 3.0), ('strain', 0.004, 0.02)):
        run = found['runs'][kind]
        assert run['states'] == ['RS1', 'RS2', 'RS1']
        assert run['orderly']['tracking_rms'] < rms
        assert run['orderly']['largest_error'] < largest
        assert not run['orderly']['chatter']
    errors = [step['error_N'] for step in found['model']['steps']]
    assert 140.0 < errors[0] < 160.0
    assert errors == sorted(errors, reverse=True)
    assert found['model']['steps'][-1]['held_out_N'] < 0.1 * errors[0]
    page = (tmp_path / 'report' / 'index.html').read_text()
    for figure in ('force-run', 'force-track', 'strain-run', 'strain-track', 'before', 'after',
                   'ladder', 'candidates', 'isobars', 'space', 'free_strain'):
        assert f'<figure id="{figure}">' in page
    bag = fam_bundle('convert', 'report/bag/force', 'force.csv')
    assert bag.returncode == 0, bag.stderr
    # a second run takes the place of the report, but never of anything else
    (tmp_path / 'report' / 'thesis.tex').write_text('years of work')
    refused = fam_bundle('demo')
    assert refused.returncode == 2
    assert 'thesis.tex' in refused.stderr


def test_ctrl_c_leaves_nothing_half_done(repository, domain_id, tmp_path):
    """Ctrl-C in the middle of `demo` vents, says so in one line, and leaves no half report."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'fam_bundle_ros', 'demo'], cwd=tmp_path, text=True,
        stderr=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': str(repository), 'ROS_DOMAIN_ID': str(domain_id)})
    for _ in range(600):
        if list(tmp_path.glob('.report-*/bag/force/*')):
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 1
    assert stderr.splitlines()[-1] == 'fam_bundle: stopped'
    assert list(tmp_path.iterdir()) == []


def test_a_real_rig_is_never_run_with_the_settings_of_the_simulation(fam_bundle, monkeypatch):
    """`run --rig` asks for the rig's own parameters; without them nothing starts by itself."""
    result = fam_bundle('run', '--rig')
    assert result.returncode == 2
    assert '--rig needs --params-file' in result.stderr
    given = []
    monkeypatch.setattr('fam_bundle_ros.nodes.bundle_bringup.run',
                        lambda make, usage, argv: given.append(argv) or 0)
    from fam_bundle_ros.nodes.bundle_bringup import main
    main(['bundle_bringup', '--ros-args', '-p', 'simulate:=false'])
    main(['bundle_bringup'])
    assert 'simulation.yaml' not in ' '.join(given[0])
    assert 'simulation.yaml' in ' '.join(given[1])
