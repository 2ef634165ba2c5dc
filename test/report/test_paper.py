# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures show what the paper found, at the reference values of the model."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.report.map_page import muscle_pictures
from fam_bundle_ros.report.paper import paper_figures, PSI, readings
from fam_bundle_ros.report.paper_plots import map_pictures
from fam_bundle_ros.resources import config_path


@pytest.fixture(scope='module')
def bundle():
    """Return the paper's bundle."""
    return load_model(config_path('models/spie2021.yaml'))


@pytest.fixture(scope='module')
def figures(bundle):
    """Return the numbers of its figures."""
    return paper_figures(bundle)


def test_free_strain_falls_first_and_then_returns(figures):
    """Figure 4: the free strain starts near that of MU1 alone, dips, and is back at its end."""
    f = figures.free_strain
    reach = f.strain['included']
    assert reach[0] == pytest.approx(f.strain['neglected'][0], abs=2e-3)
    assert reach[-1] == pytest.approx(f.strain['neglected'][-1], abs=1e-5)
    assert f.dip_strain < reach[0] - 0.01
    assert 100e3 < f.dip_pressure < 210e3
    lowest = int(np.argmin(reach))
    assert np.all(np.diff(reach[:lowest + 1]) <= 1e-9)
    assert np.all(np.diff(reach[lowest:]) >= -1e-9)


def test_ideal_and_klute_hannaford_lines_are_constant(figures):
    """Figure 4: both neglect resistive forces, so MU2 changes nothing before it pulls."""
    strain = figures.free_strain.strain
    assert strain['ideal'] == pytest.approx(0.31159, abs=1e-5)
    assert strain['klute_hannaford'] == pytest.approx(0.2365, abs=1e-4)
    assert np.ptp(strain['klute_hannaford']) == pytest.approx(0.0, abs=1e-9)


def test_klute_hannaford_is_braid_and_rubber_and_nothing_else(bundle):
    """Whatever a model has besides, the reading is the muscle of Klute and Hannaford (2000)."""
    more = bundle.with_effect('end_caps').with_effect('threshold_pressure')
    known = Bundle('known', bundle.motor_units,
                   [bundle.effect('mesh'), bundle.effect('bladder_elasticity')])
    pressure = np.array([150e3, 20e3])
    assert np.array_equal(readings(more)['klute_hannaford'].force(0.2, pressure),
                          known.force(0.2, pressure))
    assert readings(more)['neglected'].force(0.0, pressure) < known.force(0.0, pressure)
    assert set(paper_figures(more, 21).beyond) >= {'end_caps', 'threshold_pressure'}


def test_klute_hannaford_over_predicts_as_the_text_says(figures):
    """Blocked force, free strain and, further on, the size of the resistive force; ideal more."""
    found = figures.summary()
    for name in ('blocked_force_10_psi_N', 'free_strain_10_psi'):
        assert found[name]['included'] < 0.97 * found[name]['klute_hannaford']
        assert found[name]['klute_hannaford'] <= found[name]['ideal'] + 1e-9
    assert figures.free_strain.strain['included'].max() < 0.95 * 0.2365
    strain, forces = figures.isobars.strain, figures.isobars.forces
    for strained in (0.15, 0.20, 0.25):
        assert np.interp(strained, strain, forces['klute_hannaford'][1]) < 1.5 * np.interp(
            strained, strain, forces['included'][1])


def test_isobars_of_one_muscle_are_those_of_the_paper(bundle, figures):
    """Figure 2a: 0 to 60 psi in steps of 10 psi, up to the largest free strain."""
    muscle = figures.muscle
    assert muscle.pressure / PSI == pytest.approx(np.arange(0.0, 61.0, 10.0))
    force = muscle.forces['included']
    one = Bundle('one', bundle.motor_units[:1], bundle.effects)
    assert force[3] == pytest.approx(one.force(muscle.strain, muscle.pressure[3:4]))
    assert force[-1][-1] == pytest.approx(0.0, abs=1e-3)
    assert np.all(force[:-1, -1] < 0.0)


def test_isobars_of_another_muscle_end_at_its_own_pressure(bundle):
    """A bundle that works up to 200 kPa is not drawn at 60 psi; one muscle of three is drawn."""
    low = Bundle('low', [replace(unit, max_pressure=200e3, muscles=3)
                         for unit in bundle.motor_units], bundle.effects)
    figures = paper_figures(low, 21)
    assert figures.muscle.pressure[-1] == figures.space.pressure[-1] == pytest.approx(200e3)
    alone = Bundle('alone', bundle.motor_units[:1], bundle.effects)
    assert figures.muscle.forces['included'][-1] == pytest.approx(
        alone.force(figures.muscle.strain, [200e3]))


def test_raising_mu2_lowers_the_force_near_the_strain_of_the_text(figures):
    """Figure 3d: near a strain of 0.195 the isobars of MU2 first fall below that of 0 kPa."""
    space = figures.space
    assert space.pressure / PSI == pytest.approx(np.arange(0.0, 51.0, 10.0), rel=2e-4)
    force = [np.interp(0.195, space.strain, each) for each in space.isobars['included']]
    assert min(force) < force[0] - 5.0
    assert force[-1] > force[0]
    plain = [np.interp(0.195, space.strain, each) for each in space.isobars['neglected']]
    assert np.all(np.diff(plain) >= -1e-9)


def test_isobars_of_mu2_lie_in_their_state(figures):
    """Figure 3: RS2 is what MU2 gives between no and full pressure, MU1 at its largest."""
    space = figures.space
    for reading in ('neglected', 'included'):
        assert np.all(space.isobars[reading] >= space.low[reading][1] - 5e-3)
        assert np.all(space.isobars[reading] <= space.high[reading][1] + 1e-6)
        empty, most = space.isobars[reading][0], space.high[reading][0]
        assert empty[most > 0.0] == pytest.approx(most[most > 0.0])


def test_states_overlap_only_with_resistive_forces(figures):
    """Figure 3: neglected, RS2 begins where RS1 ends; included, they overlap, most at large e."""
    space = figures.space
    assert space.overlap('neglected', 1).max() == pytest.approx(0.0, abs=1e-9)
    width = space.overlap('included', 1)
    assert width.max() > 5.0
    assert space.strain[np.argmax(width)] > 0.15
    assert np.all(space.high['included'][0] <= space.high['neglected'][0] + 1e-9)


def test_resistive_force_peaks_and_then_drops(figures):
    """Figure 2b: past free strain the force levels off and falls; Klute-Hannaford goes on."""
    strain, forces = figures.isobars.strain, figures.isobars.forces
    known = forces['klute_hannaford']
    assert np.interp(0.10, strain, known[0]) == pytest.approx(-21.35, abs=0.05)
    assert np.all(np.diff(known, axis=1) < 0.0)
    assert np.all(known.min(axis=1) < 3.0 * forces['included'].min(axis=1))
    assert forces['ideal'][1][0] == pytest.approx(32.7, abs=0.05)
    for force, collapse in zip(forces['included'], (0.05, 0.20), strict=True):
        hardest = float(force.min())
        assert hardest < 0.0
        assert hardest == pytest.approx(np.interp(collapse, strain, force), abs=0.1)
        assert force[-1] > 0.5 * hardest


def test_the_dip_is_the_gradient_reversal_of_a_fine_search(bundle, figures):
    """The dip that is marked is the least free strain over MU2 pressure, found anew."""
    pressure = np.linspace(0.0, bundle.max_pressure[1], 2001)
    reach = bundle.free_strain(bundle.state_pressures(2, pressure))
    assert figures.free_strain.dip_strain == pytest.approx(reach.min(), abs=1e-4)


def test_every_picture_says_what_is_the_papers_and_what_is_ours(figures):
    """Each caption names the paper, what its text states, and that the resistive form is ours."""
    pictures = map_pictures(figures)
    assert [picture.key for picture in pictures] == ['muscle', 'isobars', 'space', 'free_strain']
    for picture in pictures:
        assert 'Proc. SPIE 11586' in picture.caption
        assert 'From the text' in picture.caption
        assert 'Our own' in picture.caption
    assert '68.95' in pictures[1].caption
    assert f'{figures.free_strain.dip_strain:.4f}' in pictures[3].caption


def test_numbers_in_a_caption_are_those_of_the_model(bundle):
    """Another model, other words: what it has beyond the paper, and no reversal where none is."""
    slack = bundle.without_effect('resistive_buckling').with_effect(
        'tendon_slack').with_effect('threshold_pressure')
    pictures = {each.key: each.caption for each in map_pictures(paper_figures(slack, 101))}
    assert 'threshold_pressure' in pictures['isobars']
    assert 'no resistive effect' in pictures['muscle']
    assert 'no reversal' in pictures['free_strain']
    assert ' N there at 0 kPa' not in pictures['space']


def test_the_map_of_one_motor_unit_draws_its_isobars_and_ends():
    """No recruitment states: curves of seven pressures that differ, beside the braid alone."""
    model = load_model('dmsp20_static_map').with_effect('bladder_elasticity')
    isobars, ends = (picture.drawing for picture in muscle_pictures(model))
    own = [trace for trace in isobars.data if trace.line.dash == 'solid']
    assert len(own) == len(isobars.data) / 2 == 7
    top = [trace.y[0] for trace in own]
    assert top == sorted(top)
    assert own[-1].y[0] == pytest.approx(float(model.force(0.0, model.max_pressure)))
    free = ends.data[1]
    assert free.y[-1] == pytest.approx(float(model.free_strain(model.max_pressure)))
    assert abs(np.interp(free.y[-1], own[-1].x, own[-1].y)) < 1e-2 * top[-1]
    bare = muscle_pictures(load_model('dmsp20_static_map'))[0].drawing
    assert all(trace.line.dash == 'solid' for trace in bare.data)
