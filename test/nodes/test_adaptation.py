# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The services that keep and forget what the controller has learnt."""

from dataclasses import replace
import math

import pytest
from std_srvs.srv import Trigger

from fam_bundle_ros.model import Bundle, load_model, save_model
from fam_bundle_ros.nodes.bundle_bringup import make_nodes
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.resources import config_path

from .conftest import added


@pytest.fixture
def learnt(graph, quiet, tmp_path, monkeypatch):
    """Return a function: a controller in an empty folder, its rig 10 % stronger than its model."""
    monkeypatch.chdir(tmp_path)
    bundle = load_model(config_path('models/spie2021.yaml'))
    units = [replace(unit, geometry=replace(unit.geometry, radius=unit.geometry.radius
                                            * math.sqrt(1.1))) for unit in bundle.motor_units]
    save_model(Bundle('strong', units, bundle.effects), tmp_path / 'strong.yaml')

    def start(**overrides):
        ramps = Points('ramps', 'force', (0.0, 1.0, 2.0, 3.0), (20.0, 70.0, 20.0, 70.0))
        nodes = make_nodes(
            graph.context, overrides={
                **quiet, 'plant_model': str(tmp_path / 'strong.yaml'), 'lock_step': True,
                'wait_for_reference': True, 'start_enabled': True, 'monitor': False, **overrides},
            simulator={'script': graph.pacer}, generator={'profile': ramps})
        rig, node = added(graph, nodes)
        graph.advance(rig, 3.0)
        return node
    return start


def test_save_writes_what_was_learnt_to_the_working_directory(graph, learnt, tmp_path):
    """A shipped model may lie where nobody can write: the adapted one is written here."""
    node = learnt()
    answer = graph.call(Trigger, 'adaptation/save')
    assert answer.success, answer.message
    path = tmp_path / 'spie2021_adapted.yaml'
    assert answer.message.startswith(f'{path}: MU1 pulls')
    saved, before = load_model(path), node.bundle
    error = node.controller.memory.adaptation.error[0]
    assert error > 0.03
    ratio = saved.motor_units[0].geometry.radius / before.motor_units[0].geometry.radius
    assert ratio == pytest.approx(math.sqrt(1.0 + error), rel=1e-6)


def test_save_writes_where_the_parameter_says(graph, learnt, tmp_path):
    """adaptation_file names the file; nothing else is written."""
    learnt(adaptation_file=str(tmp_path / 'deep' / 'mine.yaml'))
    refused = graph.call(Trigger, 'adaptation/save')
    assert not refused.success
    assert 'mine.yaml: cannot be written' in refused.message
    (tmp_path / 'deep').mkdir()
    assert graph.call(Trigger, 'adaptation/save').success
    assert load_model(tmp_path / 'deep' / 'mine.yaml').n == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ['deep', 'strong.yaml']


def test_reset_forgets_and_says_what(graph, learnt):
    """After the service the model is believed again as it stands in its file."""
    node = learnt()
    answer = graph.call(Trigger, 'adaptation/reset')
    assert answer.success
    assert answer.message.startswith('forgotten: MU1 pulls')
    assert max(map(abs, node.controller.memory.adaptation.error)) == 0.0
    assert graph.call(Trigger, 'adaptation/reset').message == 'forgotten: the model fits'
    saved = graph.call(Trigger, 'adaptation/save')  # would overwrite what was saved before
    assert (saved.success, 'nothing was learnt' in saved.message) == (False, True)
