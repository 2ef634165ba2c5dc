# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The explorer teaches the paper: states, overlap, onset pressure, the dip of the free strain."""

import json

import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path
from fam_bundle_ros.workbench.cases import load_example
from fam_bundle_ros.workbench.explorer import Explorer


@pytest.fixture
def explorer():
    """Return the explorer of the paper's bundle."""
    return Explorer(load_model(config_path('models/spie2021.yaml')))


def test_it_starts_where_the_overlap_is(explorer):
    """At the first look the next unit pushes back, and the words say by how much."""
    overlap = explorer.overlap()
    assert overlap.dip > 3.0
    said = ' '.join(explorer.sentences())
    assert f'{overlap.dip:.1f} N' in said
    assert f'{overlap.onset_pressure / 1e3:.0f} kPa, its onset pressure' in said


def test_at_small_strain_nothing_pushes_back(explorer):
    """At zero strain the second unit helps at once: no dip."""
    explorer.strain = 0.0
    assert 'no dip' in ' '.join(explorer.sentences())


def test_pressing_the_second_unit_makes_rs2(explorer):
    """The state follows the sliders."""
    assert explorer.state == 1
    explorer.pressure[1] = 200e3
    assert explorer.state == 2
    explorer.pressure[:] = 0.0
    assert explorer.state == 0
    assert explorer.sentences()[0].startswith('RS0: 0 of 2')


def test_the_free_strain_dips(explorer):
    """The reversal of the paper is drawn and told."""
    assert 'gradient reversal' in explorer.free_strain_sentence()
    included = explorer.free_strain_figure()['data'][1]['y']
    assert min(included) < included[0] - 0.01
    assert included[-1] == pytest.approx(
        float(explorer.bundle.free_strain(explorer.bundle.max_pressure)), abs=1e-6)


def test_a_model_without_resistive_force_has_no_dip():
    """The words follow the model, not the paper."""
    model = load_example('bundle_push_back').model
    assert 'does not dip' in Explorer(model).free_strain_sentence()


def test_the_point_follows_the_slider(explorer):
    """The figure of the force-strain space is drawn anew where the slider is, as JSON."""
    for strain in (0.05, 0.12):
        explorer.strain = strain
        assert json.loads(json.dumps(explorer.space_figure()))['data'][-1]['x'] == [strain]


def test_tendons_are_drawn_beside_and_told(explorer):
    """A tendon length adds its edges, its free strain and a sentence; empty takes them away."""
    before = len(explorer.space_figure()['data']), len(explorer.free_strain_figure()['data'])
    explorer.set_tendon('20mm')
    space, reach = explorer.space_figure()['data'], explorer.free_strain_figure()['data']
    assert (len(space), len(reach)) == (before[0] + 2, before[1] + 1)
    assert space[-1]['name'] == 'this bundle, here'
    edges = [trace for trace in space if 'tendons of 20 mm' in trace.get('name', '')]
    assert max(edges[1]['x']) < max(explorer.ends.free_strain['fixed'])
    free = explorer.ends.free_strain['tendons'][-1]
    assert f'free strain is {free:.4f}' in explorer.tendon_sentence()
    assert '107 mm long' in explorer.tendon_sentence()
    explorer.set_tendon(' ')
    assert explorer.tendon_sentence() == ''
    assert len(explorer.space_figure()['data']) == before[0]


@pytest.mark.parametrize(('told', 'said'), [('127 mm', 'no muscle is left'), ('20', 'no unit'),
                                            ('5 kPa', 'does not fit'), ('-1 mm', 'zero or more')])
def test_a_tendon_that_cannot_be_fails(explorer, told, said):
    """What is typed wrong is told, and no tendons are drawn."""
    explorer.set_tendon('20 mm')
    with pytest.raises(InputError, match=said):
        explorer.set_tendon(told)
    assert explorer.ends is None
