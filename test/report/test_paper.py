# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures show what the paper found, at the reference values of the model."""

import numpy as np
import pytest

from fam_bundle_ros.model import load_model
from fam_bundle_ros.report.muscle_plots import muscle_pictures
from fam_bundle_ros.report.paper import paper_figures
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
    """Figure 4: the free strain starts near that of MU1 alone, dips, and is back."""
    f = figures.free_strain
    reach = f.strain['included']
    assert reach[0] == pytest.approx(0.2356, abs=2e-3)
    assert reach[-1] == pytest.approx(0.2365, abs=1e-4)
    assert 0.215 < f.dip_strain < 0.222
    assert 100e3 < f.dip_pressure < 210e3
    lowest = int(np.argmin(reach))
    assert np.all(np.diff(reach[:lowest + 1]) <= 1e-9)
    assert np.all(np.diff(reach[lowest:]) >= -1e-9)


def test_other_readings_show_no_reversal(figures):
    """Figure 4: Klute-Hannaford only rises, from 0.1870; ideal and neglected stay put."""
    strain = figures.free_strain.strain
    assert strain['continued'][0] == pytest.approx(0.1870, abs=1e-4)
    assert np.all(np.diff(strain['continued']) > 0.0)
    assert strain['ideal'] == pytest.approx(0.31159, abs=1e-5)
    assert strain['neglected'] == pytest.approx(0.2365, abs=1e-4)


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
    assert np.interp(0.10, strain, forces['continued'][0]) == pytest.approx(-21.35, abs=0.05)
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


def test_every_picture_says_what_is_our_own(figures):
    """Each caption names the paper and says that the resistive form is derived here."""
    pictures = map_pictures(figures)
    assert [picture.key for picture in pictures] == ['isobars', 'space', 'free_strain']
    for picture in pictures:
        assert 'Proc. SPIE 11586' in picture.caption
        assert 'our own' in picture.caption
    assert '68.95' in pictures[0].caption


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
    with pytest.raises(ValueError, match='2 motor units; expected 1'):
        muscle_pictures(load_model('spie2021'))
