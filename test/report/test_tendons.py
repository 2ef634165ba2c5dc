# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Fixed ends against tendons in one packaging length: what the physics says of both."""

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import Bundle, load_model
from fam_bundle_ros.report.paper import readings
from fam_bundle_ros.report.tendon_plots import tendon_pictures
from fam_bundle_ros.report.tendons import compare_ends, with_tendons

TENDON, LENGTH = 20e-3, 127e-3
SHARE = 1.0 - TENDON / LENGTH
STRAIN = np.linspace(0.0, 0.25, 51)


@pytest.fixture(scope='module')
def bundle():
    """Return the paper's bundle, with nothing in it that has a length of its own."""
    paper = load_model('spie2021')
    return Bundle('paper', paper.motor_units, [
        e for e in paper.effects
        if e.name in ('mesh', 'bladder_elasticity', 'resistive_buckling')])


@pytest.fixture(scope='module')
def ends(bundle):
    """Return both configurations."""
    return compare_ends(bundle, TENDON)


def test_free_strain_is_that_of_the_muscle_times_its_share_of_the_length(bundle, ends):
    """The tendon does not shorten: e = e_muscle (L0 - Lt)/L0, at every pressure of MU2."""
    alone = readings(bundle)['neglected'].free_strain(bundle.state_pressures(2, ends.pressure))
    assert ends.free_strain['tendons'] == pytest.approx(SHARE * alone, abs=1e-6)


def test_force_is_that_of_the_same_muscle_at_a_larger_strain(bundle, ends):
    """A contraction of the packaging length is a larger strain of the shorter muscle."""
    model = readings(bundle)['neglected']
    at = ends.space.strain
    assert ends.space.high['tendons'][1] == pytest.approx(
        model.force(at / SHARE, bundle.max_pressure), abs=1e-6)
    assert ends.space.high['fixed'][1][at < 0.2] == pytest.approx(
        bundle.force(at[at < 0.2], bundle.max_pressure), abs=1e-6)


def test_blocked_force_does_not_depend_on_the_tendon(bundle, ends):
    """At rest length a shorter muscle pulls as hard."""
    for state in (0, 1):
        assert ends.space.high['tendons'][state][0] == pytest.approx(
            ends.space.high['fixed'][state][0])


def test_no_unit_on_a_tendon_pushes_back(bundle):
    """Compressed past its free strain each muscle goes slack by itself."""
    pressure = np.array([344.7e3, 60e3])
    assert bundle.unit_forces(STRAIN, pressure).min() < -3.0
    assert with_tendons(bundle, TENDON).unit_forces(STRAIN, pressure).min() == 0.0


def test_tendons_of_no_length_are_the_bundle_with_push_back_neglected(bundle):
    """Then only the slack is left of them."""
    pressure = bundle.state_pressures(2, np.linspace(0.0, 344.7e3, 9))
    assert np.array_equal(
        with_tendons(bundle, 0.0).force(STRAIN, pressure[:, None]),
        readings(bundle)['neglected'].force(STRAIN, pressure[:, None]))


def test_only_fixed_ends_show_the_reversal(ends):
    """What goes slack shortens nobody's reach, and no two states overlap."""
    assert np.ptp(ends.free_strain['tendons']) < 1e-6
    assert ends.free_strain['fixed'].min() < ends.free_strain['fixed'][0] - 0.01
    assert ends.space.overlap('tendons', 1).max() == pytest.approx(0.0, abs=1e-9)
    assert ends.space.overlap('fixed', 1).max() > 5.0


def test_the_even_tendon_costs_as_much_reach_as_the_push_back(bundle, ends):
    """Lt = L0 (1 - e_dip/e_free) where no effect has a length; a longer one reaches less far."""
    free, dip = float(bundle.free_strain(bundle.max_pressure)), ends.free_strain['fixed'].min()
    assert ends.even_tendon == pytest.approx(LENGTH * (1.0 - dip / free), rel=1e-3)
    assert compare_ends(bundle, 0.9 * ends.even_tendon).free_strain['tendons'].min() > dip
    assert compare_ends(bundle, 1.1 * ends.even_tendon).free_strain['tendons'].min() < dip


def test_dead_ends_are_a_larger_share_of_a_shorter_muscle(bundle):
    """A dead length does not shrink with the muscle: contraction (L0 - Lt - Le) e_active."""
    caps = bundle.with_effect('end_caps', dead_length=8e-3)
    free = float(bundle.free_strain(bundle.max_pressure))
    ends = compare_ends(caps, TENDON)
    assert ends.free_strain['tendons'][-1] == pytest.approx(
        free * (LENGTH - TENDON - 8e-3) / LENGTH, abs=1e-5)


def test_radius_and_braid_angle_stay(bundle):
    """A shorter muscle of the same braid; the model that was given is not changed."""
    shorter = with_tendons(bundle, TENDON).motor_units[1].geometry
    own = bundle.motor_units[1].geometry
    assert shorter.length == pytest.approx(LENGTH - TENDON)
    assert (shorter.radius, shorter.braid_angle, shorter.wall_thickness) == (
        own.radius, own.braid_angle, own.wall_thickness)
    assert own.length == LENGTH


def test_one_motor_unit_is_compared_over_its_own_pressure():
    """A single unit has no neighbour that compresses it: tendons only cost contraction."""
    ends = compare_ends(load_model('dmsp20_static_map'), TENDON)
    share = 1.0 - TENDON / ends.packaging_length
    assert ends.unit == 1
    assert ends.free_strain['tendons'][-1] == pytest.approx(
        share * ends.free_strain['fixed'][-1], abs=1e-6)
    assert ends.even_tendon == pytest.approx(0.0, abs=1e-6)
    assert len(tendon_pictures(ends)) == 2


@pytest.mark.parametrize(('tendon', 'said'), [
    (127e-3, 'tendon is 127 mm and the packaging length 127 mm .* no muscle is left'),
    (300e-3, 'no muscle is left'), (-1e-3, 'tendon is -1 mm; expected zero or more'),
    (120e-3, '7 mm of muscle are too short for the radius of mu1, 6.35 mm'),
    (float('nan'), 'expected zero or more')])
def test_tendon_that_leaves_no_muscle_fails(bundle, tendon, said):
    """The error names both lengths and what is left."""
    with pytest.raises(InputError, match=said):
        with_tendons(bundle, tendon)


def test_captions_say_whose_the_question_and_whose_the_numbers_are(ends):
    """The study is named, the assumptions are ours, and figures are those of the comparison."""
    space, reach = tendon_pictures(ends)
    for picture in (space, reach):
        assert 'SPIE 11374' in picture.caption
        assert 'Our own' in picture.caption
    assert '107 mm long' in space.caption
    assert f'{ends.free_strain["tendons"][-1]:.4f} with tendons' in reach.caption
    assert f'{1e3 * ends.even_tendon:.3g} mm gives the same free strain' in reach.caption
    assert {trace.name for trace in reach.drawing.data} == {'fixed ends', 'tendons of 20 mm'}
