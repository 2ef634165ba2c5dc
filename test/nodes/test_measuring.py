# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Experiments driven over ROS, on a simulated rig and on a bundle that runs already."""

import os
import signal
import subprocess
import sys
import threading
import time

from geometry_msgs.msg import WrenchStamped
import numpy as np
import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure

from fam_bundle_ros.data import join, read_measurement
from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.data.protocol import (
    dumps_protocol,
    Limits,
    Protocol,
    read_protocol,
    save_protocol,
    segments,
    Sweep,
)
from fam_bundle_ros.discovery import Choices, compare, diagnose
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Motion
from fam_bundle_ros.nodes import interface, measuring
from fam_bundle_ros.nodes.base import BundleNode
from fam_bundle_ros.nodes.measuring import measure, Measuring, Stopped, with_room
from fam_bundle_ros.nodes.process import Spinner
from fam_bundle_ros.nodes.protocol_run import ProtocolRun
from fam_bundle_ros.nodes.sensing import Sample

ISOBARS = Sweep((0.05, 0.15), 0.2, ((100e3, 0.0), (300e3, 0.0), (300e3, 150e3)))
SHORT = Protocol('short', 2, (ISOBARS,), settle=0.3, travel=0.5)


def one_muscle(bundle, effect=None):
    """Return the first motor unit as an ideal braid, perhaps with another effect."""
    alone = type(bundle)('one', bundle.motor_units[:1], bundle.effects[:1])
    return alone.with_effect(effect) if effect else alone


def test_a_killed_experiment_goes_on_where_it_was(repository, domain_id, tmp_path, paper_bundle,
                                                  monkeypatch):
    """SIGKILL after the first isobar: it stays as it was, the others follow, the model fits."""
    save_protocol(SHORT, tmp_path / 'short.yaml')
    command = [sys.executable, '-m', 'fam_bundle_ros', 'measure', 'short.yaml', '--out',
               'log.csv']
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True,
                               stderr=subprocess.PIPE, env={
                                   **os.environ, 'PYTHONPATH': str(repository)})
    first = tmp_path / 'log.csv.parts' / '00001.csv'
    for _ in range(3000):
        if first.exists() or process.poll() is not None:
            break
        time.sleep(0.01)
    process.kill()
    said, _ = process.communicate()
    assert 'short: 3 segments, 7 s' in said
    before = first.read_bytes()
    assert not (tmp_path / 'log.csv').exists()
    with pytest.raises(InputError, match='expected --resume'):
        measure(SHORT, tmp_path / 'log.csv', paper_bundle, domain=domain_id)
    # the simulated rig runs as fast as it can: a sweep may end between two usual reports
    monkeypatch.setattr(measuring, '_SLICE', 0.01)
    told = []
    measure(SHORT, tmp_path / 'log.csv', paper_bundle, resume=True, domain=domain_id,
            progress=lambda share, words: told.append((share, words)))
    assert [share for share, _ in told] == sorted(share for share, _ in told)
    assert 'segment 3: sweep' in ' '.join(words for _, words in told)
    assert before in (tmp_path / 'log.csv').read_bytes()
    data = read_measurement(tmp_path / 'log.csv')
    assert data.trial_names == ('1', '2', '3')
    for trial, wanted in enumerate(ISOBARS.pressure):
        mine = data.select(data.trial == trial)
        assert len(mine) == pytest.approx(201, abs=3)
        assert mine.pressure.mean(axis=0) == pytest.approx(wanted, abs=500.0)
        assert (mine.strain.min(), mine.strain.max()) == pytest.approx((0.05, 0.15), abs=1e-3)
    assert np.median(np.abs(data.strain_rate)) == pytest.approx(0.2, rel=0.05)
    # the load cell's own noise, and nothing else
    assert compare(paper_bundle, data).error_N == pytest.approx(0.9, rel=0.15)


def test_what_latches_ends_the_experiment_and_keeps_what_is_complete(domain_id, tmp_path,
                                                                     paper_bundle):
    """A force beyond the limit of the protocol; a load cell that no pressure explains."""
    limited = Protocol('limited', 2, (ISOBARS,), Limits(force=60.0), settle=0.3)
    with pytest.raises(Stopped, match='force is .* beyond the limit of 60 N'):
        measure(limited, tmp_path / 'a.csv', paper_bundle, domain=domain_id)
    assert [path.name for path in (tmp_path / 'a.csv.parts').glob('0*')] == ['00001.csv']
    with pytest.raises(Stopped, match='the controller has cut the supply: FORCE force is .* N; '
                       'pressures shown give .* N at most'):
        measure(SHORT, tmp_path / 'b.csv', paper_bundle, domain=domain_id,
                overrides={'faults.gain': 'force=1.9'})
    assert not (tmp_path / 'b.csv').exists()


def test_a_protocol_that_does_not_fit_is_refused_before_anything_moves(tmp_path, paper_bundle):
    """Other motor units, or pressures beyond the model; a simulation may be given room."""
    with pytest.raises(InputError, match='is for 2 motor units; one has 1; protocols '
                       'for 1 that ship: first_look_one'):
        measure(SHORT, tmp_path / 'a.csv', one_muscle(paper_bundle))
    paper = read_protocol('spie2021')
    with pytest.raises(InputError, match='mu1 goes up to 413.7 kPa; spie2021 allows 344.7 kPa'):
        measure(paper, tmp_path / 'a.csv', paper_bundle)
    assert with_room(paper, paper_bundle).max_pressure == pytest.approx([413.7e3] * 2, rel=1e-3)
    assert paper_bundle.max_pressure == pytest.approx([344.7e3] * 2)


def test_the_next_experiment_breaks_the_tie_it_was_written_for(domain_id, tmp_path, paper_bundle):
    """Is the gauge off, or does the muscle need a threshold? Low isobars on the rig tell."""
    model = one_muscle(paper_bundle)
    hidden = one_muscle(paper_bundle, 'threshold_pressure')
    way = np.concatenate([np.linspace(0, 1, 20), np.linspace(1, 0, 20)])
    strain, pressure = np.tile(0.15 * way, 3), np.repeat([100e3, 200e3, 300e3], 40)[:, None]
    rate, trial = np.tile(np.repeat([0.05, -0.05], 20), 3), np.repeat(range(3), 40)
    clock = np.concatenate([9.0 * k + np.linspace(0.0, 6.0, 40) for k in range(3)])
    motion = Motion(strain, pressure, rate, clock, np.diff(trial, prepend=-1) != 0)
    force = hidden.predict(motion) + 0.9 * np.random.default_rng(0).standard_normal(120)
    old = build('old', strain, pressure, force, trial, clock)
    first = diagnose(model, old, choices=Choices(most=1))
    assert first.tied == (('threshold_pressure', 'pressure_sensor_bias'),)
    save_protocol(first.next_protocol, tmp_path / 'next.yaml')
    proposed = read_protocol(tmp_path / 'next.yaml')
    assert dumps_protocol(proposed) == dumps_protocol(first.next_protocol)
    measure(proposed, tmp_path / 'next.csv', model, plant_model=hidden, rate=100.0,
            domain=domain_id)
    new = read_measurement(tmp_path / 'next.csv')
    both = diagnose(model, join([old, new.select(np.arange(0, len(new), 4))]),
                    choices=Choices(most=1))
    assert (both.effects, both.tied) == (('threshold_pressure',), ())


def test_a_sample_that_comes_twice_is_answered_twice_and_kept_once(ros_context, paper_bundle):
    """In lock-step the simulator repeats what was not answered; time must not stand still."""
    run = ProtocolRun(SHORT, segments(SHORT), lambda segment, rows: None)
    steps, sent = [], []
    step = run.step
    run.step = lambda seen: steps.append(seen) or step(seen)
    node = Measuring(paper_bundle, run, 3.0, context=ros_context)
    node.started = True
    node._ask_pressures = lambda stamp, pressure: sent.append(stamp)
    for stamp in (5, 5, 10):
        node._on_sample(Sample(stamp * 10**6, 1.0, 0.05, 0.0, [0.0, 0.0]))
    node.destroy_node()
    assert [seen.time for seen in steps] == pytest.approx([3.0, 3.005])
    assert [stamp // 10**6 for stamp in sent] == [5, 5, 10]


@pytest.fixture
def rig(repository, domain_id, tmp_path):
    """Yield a bundle that runs by itself in wall time, with a dynamometer, not enabled."""
    # Being held up by other tests is not what it is about.
    values = {'load.kind': 'dynamometer', 'generate': 'false', 'start_enabled': 'false',
              'monitor': 'false', 'reference_timeout': '10.0', 'sensor_timeout': '5.0',
              'setpoint_timeout': '5.0', 'command_timeout': '5.0', 'supply_timeout': '5.0',
              'clocks_synchronised': 'false'}
    process = subprocess.Popen(
        [sys.executable, '-m', 'fam_bundle_ros', 'run', '--ros-args',
         *(part for name, value in values.items() for part in ('-p', f'{name}:={value}'))],
        cwd=tmp_path, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        env={**os.environ, 'PYTHONPATH': str(repository)})
    yield process
    process.send_signal(signal.SIGINT)
    process.wait(timeout=60)


def test_a_running_rig_is_enabled_measured_and_left_vented(rig, domain_id, tmp_path, paper_bundle):
    """In wall time; a fault in the second isobar ends it, with the reason that the rig gives."""
    context = Context()
    context.init(domain_id=domain_id)
    probe = BundleNode('probe', (), context=context)
    shown = {}
    for unit in (1, 2):
        probe.create_subscription(
            FluidPressure, interface.pressure_topic(unit),
            lambda message, unit=unit: shown.update({unit: interface.read_pressure(
                message, 101325.0)}), interface.NEWEST)
    from rcl_interfaces.srv import SetParameters
    client = probe.create_client(SetParameters, 'plant_simulator/set_parameters')
    controller = probe.create_client(SetParameters, 'recruitment_controller/set_parameters')
    spinner = Spinner(context, [probe])

    def patience(seconds):
        # a killed `measure` would leave the muscles filled where references count for ever
        controller.wait_for_service(20.0)
        answer = controller.call_async(SetParameters.Request(parameters=[
            Parameter('reference_timeout', value=seconds).to_parameter_msg()]))
        while not answer.done():
            spinner.spin(0.02)

    def look(share, words):
        if 'segment 2: sweep' in words and client.service_is_ready() and not shown.get('broken'):
            shown['broken'] = client.call_async(SetParameters.Request(parameters=[
                Parameter('faults.gain', value='force=1.9').to_parameter_msg()]))
        spinner.spin(0.01)
    try:
        patience(0.0)
        with pytest.raises(InputError, match='reference_timeout .* is 0; expected more'):
            measure(SHORT, tmp_path / 'log.csv', paper_bundle, rig=True, domain=domain_id)
        patience(10.0)
        sender = probe.create_publisher(WrenchStamped, interface.REFERENCE_FORCE, 10)
        over = threading.Event()

        def send():
            while not over.wait(0.02):
                sender.publish(interface.reference_force_writer()(0, 5.0, 0.0))
        other = threading.Thread(target=send)
        other.start()
        try:
            # A sender that is not detected before the experiment stops it when detected.
            with pytest.raises((InputError, Stopped), match='other node sends .*reference/force'):
                measure(SHORT, tmp_path / 'no.csv', paper_bundle, rig=True, domain=domain_id)
        finally:
            over.set()
            other.join()
        probe.destroy_publisher(sender)
        with pytest.raises(Stopped, match='cut the supply: FORCE force is'):
            measure(SHORT, tmp_path / 'log.csv', paper_bundle, rig=True, domain=domain_id,
                    progress=look)
        for _ in range(50):
            spinner.spin(0.1)
            if max(shown[1], shown[2]) < 5e3:
                break
        assert max(shown[1], shown[2]) < 5e3
    finally:
        spinner.close()
        context.try_shutdown()
    kept = (tmp_path / 'log.csv.parts' / '00001.csv').read_text().splitlines()
    assert len(kept) > 150
    pressure = np.array([float(line.split(',')[3]) for line in kept])
    assert np.median(pressure) == pytest.approx(100.0, abs=1.5)
