# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Another model while the controller runs: apply_model and restore_model."""

import json

import numpy as np
import pytest
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.resources import config_path

from .conftest import added

PLAIN = 'models/spie2021_plain.yaml'
#: N: friction of the rig that its model does not have.
HIDDEN = 8.0
FRICTION = f'coulomb_friction: {{force: {HIDDEN} N}}'


@pytest.fixture
def moving(graph, quiet):
    """Return rig and controller, under a force that moves, on a dynamometer with friction."""
    nodes = make_nodes(graph.context, overrides={
        **quiet, 'model': PLAIN, 'sensors.force_noise': 0.5, 'lock_step': True,
        'wait_for_reference': True, 'start_enabled': True, 'monitor': False,
        'hidden_effect': FRICTION, 'repeat': True, 'trajectory': 'trajectories/live_force.yaml',
        'load.repeat': True, 'load.profile': 'trajectories/live_strain.yaml'},
        simulator={'script': graph.pacer})
    return added(graph, nodes)


def offer(graph, node, file, refusal=''):
    """Say on model/state that a file is the candidate, and wait until the controller has it."""
    publisher = graph.probe.create_publisher(String, interface.MODEL_STATE, interface.LATCHED)
    publisher.publish(String(data=json.dumps(
        {'candidate': {'file': str(file), 'refusal': refusal}})))

    def ready():
        prepared = node._swap._prepared.get(str(file))
        return (node._swap._candidate == str(file) and node._swap._refusal == refusal
                and prepared and (prepared.bundle or prepared.refusal))
    graph.until(ready, 'the candidate')
    graph.probe.destroy_publisher(publisher)


def test_a_better_model_comes_in_without_a_bump_and_goes_again(graph, moving, tmp_path):
    """Setpoints go on where they were, the tracking error falls, and restore brings it back."""
    rig, node = moving
    model = load_model(config_path(PLAIN))
    better = tmp_path / 'better.yaml'
    save_model(model.with_effect('coulomb_friction', force=HIDDEN).named('better'), better)
    graph.advance(rig, 0.2)
    assert not graph.call(Trigger, 'restore_model').success
    assert 'call diagnose first' in graph.call(Trigger, 'apply_model').message
    node._swap._on_state(String(data='{"diagnosing": {"share": 0.42}}'))
    assert 'at work (42 %)' in graph.call(Trigger, 'apply_model').message
    offer(graph, node, better, 'worse')
    answer = graph.call(Trigger, 'apply_model')
    assert (answer.success, answer.message) == (False, 'worse')
    offer(graph, node, better)
    rows, applied = [], graph.listen('model/applied', String, interface.LATCHED)
    wanted = graph.pacer.after

    def look(rig, time, commands):
        rows.append((time, *node.setpoints,
                     node._reference.at(node._now()).value - rig.truth.force))
        return wanted(rig, time, commands)
    graph.pacer.after = look
    changed = []
    for service, name in (('apply_model', 'better'), ('restore_model', 'spie2021_plain')):
        graph.advance(rig, 7.3)
        answer = graph.call(Trigger, service)
        assert answer.success, answer.message
        assert f'{name} is in use now' in answer.message
        assert (node.bundle.name, applied[-1].data) == (name, node.p['model'])
        changed.append(graph.pacer.time)
    graph.advance(rig, 0.5)
    time, *setpoints, error = np.array(rows).T
    step = np.abs(np.diff(setpoints)).max(axis=0)
    # Pa of a unit: what the models differ by
    apart = HIDDEN / float(np.diff(model.unit_forces(0.1, [[100e3, 0.0], [200e3, 0.0]])[:, 0])[0]
                           ) * 100e3
    for at in changed:
        after = step[(time[1:] > at + 1e-9) & (time[1:] < at + 0.2)]
        assert after[0] == pytest.approx(0.0, abs=1.0)
        assert after.max() < 0.5 * apart
    first, second = changed

    def tracking(begin, end):
        return float(np.sqrt(np.mean(error[(time > begin) & (time <= end)] ** 2)))
    # one to and fro of the force each; what the change itself stirs up has gone by then
    before, after = tracking(first - 6.0, first), tracking(first + 1.3, second)
    assert after < 0.8 * before
    assert after < HIDDEN / 3.0
    assert not graph.call(Trigger, 'restore_model').success


def test_a_model_that_cannot_be_used_is_refused_and_the_old_one_stays(graph, moving, tmp_path):
    """Another number of motor units, a file that is not there, the model of now."""
    rig, node = moving
    model = load_model(config_path(PLAIN))
    one = tmp_path / 'one.yaml'
    save_model(Bundle('one', model.motor_units[:1], model.effects), one)
    graph.advance(rig, 0.2)
    for file, reason in ((one, 'motor units 1, here 2'), (tmp_path / 'no.yaml', 'no such file'),
                         (node.p['model'], 'in use already')):
        offer(graph, node, file)
        answer = graph.call(Trigger, 'apply_model')
        assert not answer.success
        assert reason in answer.message
    (result,) = graph.set('recruitment_controller', model='models/spie2021_damped.yaml')
    assert 'only while the controller is off, or by apply_model' in result.reason
    assert node.bundle.name == 'spie2021_plain'


def test_a_model_applied_while_it_is_off_is_used_from_the_pressures_as_they_are(graph, moving,
                                                                             tmp_path):
    """Setpoints of before, when it was on, do not come back when it is enabled."""
    rig, node = moving
    model = load_model(config_path(PLAIN))
    better = tmp_path / 'better.yaml'
    save_model(model.with_effect('coulomb_friction', force=HIDDEN).named('better'), better)
    graph.advance(rig, 2.0)
    assert max(node.setpoints) > 1e5
    offer(graph, node, better)
    assert graph.call(Trigger, 'apply_model').success
    # before its next tick: what is to fade is that of a controller that was on
    assert graph.enable(False).success
    graph.advance(rig, 2.0)
    assert max(node.setpoints) == 0.0
    assert graph.enable().success
    seen = graph.listen('mu1/pressure_setpoint', FluidPressure)
    graph.advance(rig, lambda: seen and node.command is not None, 'the first command')
    assert seen[-1].fluid_pressure - 101325.0 < 5e4
