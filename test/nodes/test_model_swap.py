# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Another model while the controller runs: apply_model and restore_model."""

import json

import numpy as np
import pytest
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.nodes import interface
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.model_monitor import ModelMonitor
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.resources import config_path

FRICTION = 'coulomb_friction: {force: 4 N}'


@pytest.fixture
def rig(graph, quiet):
    """Return a bundle under a force that moves, on a dynamometer; friction is hidden in it."""
    nodes = make_nodes(graph.context, overrides={
        **quiet, 'sensors.force_noise': 0.5, 'lock_step': True, 'wait_for_reference': True,
        'start_enabled': True, 'monitor': False, 'hidden_effect': FRICTION, 'repeat': True,
        'trajectory': 'trajectories/live_force.yaml', 'load.repeat': True,
        'load.profile': 'trajectories/live_strain.yaml'}, simulator={'script': graph.pacer})
    graph.add(*nodes)
    return nodes[-1]


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


def test_a_better_model_comes_in_without_a_bump_and_goes_again(graph, rig, tmp_path):
    """Setpoints go on where they were, the tracking error falls, and restore brings it back."""
    model = load_model(config_path('models/spie2021.yaml'))
    better = tmp_path / 'better.yaml'
    save_model(model.with_effect('coulomb_friction', force=4.0).named('better'), better)
    node = next(n for n in graph._nodes if isinstance(n, RecruitmentNode))
    graph.advance(rig, 0.2)
    assert not graph.call(Trigger, 'restore_model').success
    assert 'call diagnose first' in graph.call(Trigger, 'apply_model').message
    offer(graph, node, better, 'worse')
    answer = graph.call(Trigger, 'apply_model')
    assert (answer.success, answer.message) == (False, 'worse')
    offer(graph, node, better)
    rows = []
    wanted, took = graph.pacer.after, []

    def after(rig, time, commands):
        rows.append((time, *node.setpoints, node._reference.at(node._now()).value
                     - rig.truth.force))
        return wanted(rig, time, commands)
    graph.pacer.after = after
    times, errors = [0.0], []
    for service, name in (('apply_model', 'better'), ('restore_model', 'spie2021')):
        graph.advance(rig, 7.3)
        answer = graph.call(Trigger, service)
        assert answer.success, answer.message
        assert node.bundle.name == name
        times.append(graph.pacer.time)
    graph.advance(rig, 0.5)
    assert took == []
    time, table = np.array([row[0] for row in rows]), np.array([row[1:] for row in rows])
    step = np.abs(np.diff(table[:, :2], axis=0)).max(axis=1)
    for at in times[1:]:
        usual = step[(time[1:] > at - 6.0) & (time[1:] < at)]
        print('BUMP', at, step[(time[1:] >= at-1e-9) & (time[1:] < at + 0.5)].max(), np.sort(usual)[-5:])
    for begin, end in zip(times, [*times[1:]]):
        inside = (time > begin + 1.3) & (time <= end)
        errors.append(float(np.sqrt(np.mean(table[inside, 2] ** 2))))
    print('ERR', errors)
    assert errors[1] < 0.6 * errors[0]
