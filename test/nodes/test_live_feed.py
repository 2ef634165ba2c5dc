# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A running bundle as records, and orders to it."""

import pytest

from fam_bundle_ros.nodes.live_feed import LiveFeed
from fam_bundle_ros.nodes.model_monitor import ModelMonitor
from fam_bundle_ros.nodes.plant_simulator import PlantSimulator
from fam_bundle_ros.nodes.profile import Points
from fam_bundle_ros.nodes.recruitment_controller import RecruitmentNode
from fam_bundle_ros.nodes.reference_generator import ReferenceGenerator


def test_topics_become_records_and_orders_are_answered(graph, quiet, tmp_path):
    """Newest values with the tracking error; parameters are set and services called by line."""
    told = []
    feed = graph.add(LiveFeed(told.append, context=graph.context), ModelMonitor(
        context=graph.context, overrides={'diagnosis_folder': str(tmp_path)}), PlantSimulator(
            context=graph.context, overrides=quiet), ReferenceGenerator(
                context=graph.context, profile=Points('p', 'force', (0.0,), (5.0,))),
                RecruitmentNode(context=graph.context))[0]

    def of(kind):
        return [record for record in told if record['kind'] == kind]
    graph.until(lambda: of('sample') and len(of('sample')[-1]['pressure']) == 2
                and of('sample')[-1].get('reference') == 5.0 and of('sample')[-1]['count'],
                'samples')
    graph.until(lambda: of('graph') and 'plant_simulator' in of('graph')[-1]['nodes'], 'the nodes')
    graph.until(lambda: of('state'), 'the state')
    newest = of('sample')[-1]
    assert newest['strain'] == pytest.approx(0.1, abs=1e-3)
    assert newest['model'] + newest['residual'] == pytest.approx(newest['force'], abs=0.2)
    assert newest['squares'] / newest['count'] == pytest.approx(
        (newest['force'] - 5.0) ** 2, rel=0.05)

    def answer(**order):
        begun = len(of('answer'))
        feed.orders.put(order)
        graph.until(lambda: len(of('answer')) > begun, f'the answer to {order}')
        return of('answer')[-1]
    friction = {'set': 'hidden_effect', 'of': 'plant_simulator', 'value': 'coulomb_friction'}
    assert answer(**friction)['success']
    assert graph._nodes[2].rig.bundle.effect('coulomb_friction')
    refused = answer(**{**friction, 'value': 'mesh'})
    assert (refused['name'], refused['success']) == ('hidden_effect', False)
    assert 'has mesh already' in refused['message']
    assert 'is not an order' in answer(call='vent')['message']
    assert 'the pressure loop of mu1 is silent' in answer(call='enable')['message']
    # a dynamometer at rest, vented: neither strain nor pressure has changed
    assert not answer(call='diagnose')['success']
