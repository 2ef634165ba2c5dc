# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A muscle of one's own: dimensions or a part become a model file that says its sources."""

import numpy as np
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model, loads_model, own_muscle
from fam_bundle_ros.resources import config_path

OWN = {'radius': '6.35 mm', 'length': '127 mm', 'braid_angle': '33 deg',
       'wall_thickness': '1.59 mm', 'muscles': '1, 2', 'max_pressure': '4 bar'}


def test_the_file_says_what_was_typed():
    """Dimensions, counts and limit come back from the file as they were told, unit by unit."""
    bundle = own_muscle.new_bundle('my: muscle', OWN, ['mesh', 'bladder_elasticity'])
    again = loads_model(own_muscle.model_text(bundle, OWN, {}))
    assert again.name == 'my: muscle'
    assert [unit.muscles for unit in again.motor_units] == [1, 2]
    for unit in again.motor_units:
        own = unit.geometry
        assert np.allclose([own.radius, own.length, own.braid_angle, own.wall_thickness,
                            unit.max_pressure],
                           [6.35e-3, 0.127, np.radians(33.0), 1.59e-3, 4e5], rtol=1e-9)
    assert [effect.name for effect in again.effects] == ['mesh', 'bladder_elasticity']


@pytest.mark.parametrize('part', own_muscle.PARTS, ids=lambda part: part.name)
def test_every_value_of_a_part_has_a_source_in_the_file(part):
    """Radius, angle, wall and limit of a part carry a source; the length is the user's own."""
    values = {**part.values, 'length': '300 mm', 'muscles': '1'}
    text = own_muscle.model_text(own_muscle.new_bundle('p', values), values, part.sources)
    assert set(part.values) == set(part.sources) == {'radius', 'braid_angle', 'wall_thickness',
                                                     'max_pressure'}
    flat = ' '.join(text.replace('#', '').split())
    assert all(source in flat for source in part.sources.values())
    assert loads_model(text).max_pressure[0] == pytest.approx(
        8e5 if part.name == 'dmsp-10' else 6e5)
    size = float(part.name.removeprefix('dmsp-'))
    assert float(loads_model(text).geometry.radius[0]) == pytest.approx(size / 2e3)


def test_the_part_of_the_measured_muscle_is_the_model_that_ships():
    """The DMSP-20 of the catalogue and of the measured map do not disagree."""
    shipped = own_muscle.dimensions_of(
        load_model(config_path('data/dmsp20_static_map.model.yaml')))
    part = own_muscle.find_part('Festo DMSP-20')
    assert all(part.values[key] == shipped[key] for key in ('radius', 'braid_angle',
                                                            'wall_thickness'))


@pytest.mark.parametrize(('key', 'value', 'words'), [
    ('radius', '6.35', 'no unit'), ('radius', 'thick mm', 'not a quantity'),
    ('radius', '80 mm', 'is it the diameter'), ('length', '-3 mm', 'above zero'),
    ('braid_angle', '70 deg', 'between 5 and 54.7 deg'), ('wall_thickness', '9 mm', 'below the'),
    ('max_pressure', '90 MPa', 'between 0 and 20 MPa'), ('max_pressure', '3 mm', 'does not fit'),
    ('muscles', '1, none', 'whole number'), ('length', '', 'active length')])
def test_a_value_that_cannot_be_fails_by_its_name(key, value, words):
    """The message begins with what the user sees, here the option, and says what was expected."""
    with pytest.raises(InputError, match=words) as caught:
        own_muscle.new_bundle('m', {**OWN, key: value}, named=lambda entry: entry.option)
    assert f'--{key.replace("_thickness", "").replace("_", "-")}' in str(caught.value)


def test_other_dimensions_keep_the_effects():
    """A muscle is edited: its effects with their values stay, the force follows the radius."""
    bundle = own_muscle.new_bundle('m', OWN).with_effect('coulomb_friction', force=7.0)
    typed = own_muscle.dimensions_of(bundle)
    same = own_muscle.fitted_bundle('m', typed, bundle.effects)
    assert same.force(0.1, [2e5, 2e5]) == pytest.approx(bundle.force(0.1, [2e5, 2e5]))
    wide = own_muscle.fitted_bundle('m', {**typed, 'radius': '12,7 mm'}, bundle.effects)
    assert wide.effect('coulomb_friction').force == 7.0
    assert wide.force(0.1, [2e5, 2e5]) == pytest.approx(4.0 * bundle.force(0.1, [2e5, 2e5]))


def test_the_header_tells_name_and_geometry_of_every_unit():
    """Units that are alike are told once, others apart."""
    words = own_muscle.muscle_words(own_muscle.new_bundle('m', OWN))
    assert words.startswith('m: mu1 of 1 muscle, radius 6.35 mm, length 127 mm, braid angle 33')
    assert '; mu2 of 2 muscles' in words
    alike = own_muscle.muscle_words(load_model(config_path('models/spie2021.yaml')))
    assert alike.startswith('spie2021: mu1, mu2 of 1 muscle, radius 6.35 mm')


def test_the_file_says_what_each_value_means():
    """In whole, but without what only helps to fill in a form: counts that stand in one line."""
    text = own_muscle.model_text(own_muscle.new_bundle('m', OWN), OWN, {})
    flat = ' '.join(text.replace('#', '').split())
    assert 'equal muscles on one valve. Source: the user.' in flat
    assert 'gauge; the controller never asks for more. Source: the user.' in flat


@pytest.mark.parametrize('part', own_muscle.PARTS, ids=lambda part: part.name)
def test_a_part_is_a_muscle_at_every_length_that_is_sold(part):
    """The shortest and the longest are muscles: longer than thick."""
    assert part.lengths[0] < part.lengths[1]
    for length in part.lengths:
        values = {**part.values, 'length': f'{length} m', 'muscles': '1'}
        assert own_muscle.new_bundle('p', values).blocked_force([4e5]) > 0.0


@pytest.mark.parametrize(('angle', 'taken'), [
    ('5 deg', False), ('5.1 deg', True), ('54.6 deg', True), ('54.7 deg', False)])
def test_any_braid_angle_of_a_muscle_that_contracts_is_taken(angle, taken):
    """Between 5 and 54.7 deg, where cos^2 is a third and a braid neither pulls nor pushes."""
    if taken:
        own_muscle.new_bundle('m', {**OWN, 'braid_angle': angle})
    else:
        with pytest.raises(InputError, match='between 5 and 54.7 deg'):
            own_muscle.new_bundle('m', {**OWN, 'braid_angle': angle})


def test_what_a_muscle_cannot_be_made_of_is_refused():
    """A part that is not sold, an effect that needs a file: what there is instead."""
    with pytest.raises(InputError, match="--part: 'dmsp-30' is not in the catalogue; expected one "
                                         'of dmsp-10, dmsp-20, dmsp-40, or the dimensions'):
        own_muscle.find_part('dmsp-30', '--part')
    with pytest.raises(InputError, match='measured_surface needs a table'):
        own_muscle.new_bundle('m', OWN, ['mesh', 'measured_surface'])
