# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws put together: by place, in any order, in text that can be read."""

from dataclasses import replace
import traceback

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros import kernels, model
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import (
    Bundle,
    catalogue,
    law,
    loads_model,
    Motion,
    MotorUnit,
    Parameter,
    Place,
)
from fam_bundle_ros.model.compose import composition
from fam_bundle_ros.model.laws.base import KINDS
from fam_bundle_ros.model.laws.bladder import bladder_elasticity
from fam_bundle_ros.model.laws.mesh import mesh

from .conftest import effect_from, HEAD, PAPER, units

FACTS = {'family': 'user', 'summary': 's', 'source': 's', 'signature': 's'}


@law('force', **FACTS, memory=('last',), size=Parameter(2.0, 'N', 0.0, 9.0, 'size'))
def two_parts(strain, size):
    """F = k e, and a loss."""
    return size * strain


@two_parts.also('loss')
def _odd(strain, start, last, size):
    return -size * np.where(start, 0.0, strain - last), strain


def test_a_law_may_have_parts_at_several_places():
    """Its loss escapes the floor that catches its force; both share parameter and memory."""
    bundle = Bundle('b', units(1), [mesh(), two_parts(size=2.0), catalogue.get('tendon_slack')()])
    motion = Motion(np.array([0.1, 0.3]), np.zeros((2, 1)), np.zeros(2), np.arange(2.0))
    assert_allclose(bundle.simulate(motion)[:, 0], [0.2, 0.6 - 0.4])
    assert two_parts.place is Place.FORCE  # that of the first part
    assert_allclose(bundle.with_parameters({'two_parts.size': 1.0}).simulate(motion)[:, 0],
                    [0.1, 0.1])


def test_places_are_composed_in_their_order():
    """Pressure, geometry, force, limit, loss: each feels what those before it have made."""
    bundle = Bundle('b', units(1), [
        catalogue.get('viscous_damping')(coefficient=10.0), catalogue.get('tendon_slack')(),
        mesh(), catalogue.get('end_caps')(dead_length=0.027),
        catalogue.get('threshold_pressure')(pressure=5e4)])
    plain = Bundle('p', units(1), [mesh()])
    assert_allclose(bundle.force(0.1, [2e5], 0.5),
                    plain.force(0.127, [1.5e5]) - 10.0 * 0.127 * 0.5)
    assert_allclose(bundle.force(0.35, [2e5], 0.5), -10.0 * 0.127 * 0.5)


def test_the_text_of_a_composition_reads_as_the_model():
    """One call for each law, by its name; nothing of laws that the model does not have."""
    text = composition((catalogue.get('mesh'), catalogue.get('coulomb_friction'))).text
    assert 'by_mesh = mesh(pressure, stretch, braid, area, cot2, sin2)' in text
    assert 'force = force + by_coulomb_friction' in text
    assert 'memory[0]' not in text
    assert 'wall_area = shape' not in text.partition('def volume')[0]


def test_a_traceback_shows_the_line_of_the_generated_text():
    """What fails in a law is found from the model's function down to the law's file."""
    @law('force', **FACTS)
    def broken(strain):
        return strain.no_such_thing

    with pytest.raises(AttributeError) as caught:
        Bundle('b', units(1), [broken()]).force(0.1, [1e5])
    told = ''.join(traceback.format_exception(caught.value))
    assert 'by_broken = broken(strain)' in told
    assert 'return strain.no_such_thing' in told


def test_an_argument_that_no_law_gets_is_refused():
    """The law and the argument are named, and what may stand there."""
    with pytest.raises(InputError, match="law drag: argument 'speed' is neither .* strain_rate"):
        @law('loss', **FACTS)
        def drag(speed):
            return -speed


@pytest.mark.parametrize(('place', 'felt', 'known'), [
    ('geometry', 'force', 'limit, loss'), ('force', 'force', 'limit, loss'),
    ('pressure', 'bladder', 'force, limit, loss'), ('residual', 'braid', 'force, limit, loss')])
def test_what_is_not_known_yet_at_a_place_is_refused(place, felt, known):
    """It was zero there, and the law did nothing without a word."""
    function = {'force': lambda force: force, 'bladder': lambda bladder: bladder,
                'braid': lambda braid: braid}[felt]
    told = f"argument '{felt}' is not known at place {place}, only at {known}$"
    with pytest.raises(InputError, match=told):
        law(place, **FACTS, changes='strain' if place == 'geometry' else '')(function)


def test_a_place_that_there_is_not_is_refused():
    """With those that there are."""
    with pytest.raises(InputError, match="place 'lose' is not known; expected one of .*loss"):
        two_parts.also('lose')(lambda strain: strain)


def test_a_parameter_must_not_hide_what_a_law_feels():
    """`pressure` is felt; a parameter of that name is given under another argument."""
    with pytest.raises(InputError, match="pressure has the name of an input of a law.*name='"):
        @law('pressure', **FACTS, pressure=Parameter(1.0, 'Pa', 0.0, 2.0, 'lost'))
        def lost(pressure):
            return -pressure


@pytest.mark.parametrize(('field', 'message'), [
    ({'leaves': ('speed', 'velocity')}, "leaves 'velocity'; expected .* smooth0, .*, speed, "),
    ({'leaves': 'speed'}, "leaves 'speed'; expected a tuple of"),
    ({'variantof': 'mesh'}, "'variantof' is 'mesh'; expected a Parameter, .*, variant_of, "),
    ({'off': {'weight': 0.0}}, "off 'weight'; expected one of its parameters"),
    ({'memory': 'last'}, "memory 'last'; expected a tuple"),
    ({'needs': '3 strains'}, "needs '3 strains'; expected one of .*'three strains'"),
    ({'delay': 'size'}, "delay 'size'; expected one of its parameters in s"),
    ({'per_unit': 'all'}, "per_unit 'all'; expected one of '', 'later', 'each'"),
    ({'size': Parameter(3.0, 'N', 0.0, 2.0, 'too large')}, 'default of size is 3 N; expected'),
    ({'source': ''}, 'needs source=')])
def test_what_is_told_of_a_law_is_checked(field, message):
    """A misspelt field or kind of shape is named, and what may stand there."""
    with pytest.raises(InputError, match=f'law drag: {message}'):
        @law('loss', **{**FACTS, 'size': Parameter(1.0, 'N', 0.0, 2.0, 'drag'), **field})
        def drag(strain_rate, size):
            return -size * strain_rate


def test_dry_friction_alone_remembers_the_path():
    """Memory of time (relaxation, creep), of the pressure or of all strains is another."""
    assert {law.name for law in catalogue.available().values() if law.remembers_path} == {
        'presliding_hysteresis', 'presliding_dahl'}
    assert {law.name for law in catalogue.available().values() if law.remembers_pressure} == {
        'pressure_hysteresis', 'pressure_dahl', 'pressure_friction'}
    bundle = model.load_model('spie2021').with_effect('viscoelastic_relaxation').with_effect(
        'presliding_dahl')
    assert bundle.path_memory == (2, 3)


def test_two_laws_of_the_package_cannot_have_one_name(monkeypatch):
    """The later file does not replace the earlier one unseen."""
    twice = [catalogue.get('mesh')]
    monkeypatch.setattr(catalogue, '_laws_in', lambda module: twice)
    with pytest.raises(InputError, match='bladder.py: another file has a law mesh'):
        catalogue.built_in.__wrapped__()


def test_every_kind_of_shape_is_left_by_a_law():
    """A kind that none leaves would be one that nothing looks up."""
    assert {kind for each in catalogue.built_in().values() for kind in each.leaves} == set(KINDS)


def test_a_law_says_what_it_changes():
    """A geometry law without it could mean strain, threads or cross-section."""
    with pytest.raises(InputError, match="expected one of 'strain', 'braid', 'area'"):
        @law('geometry', **FACTS)
        def shorter(strain):
            return 0.1 * strain


def test_values_change_without_a_new_composition():
    """A fit of thousands of steps makes the text once."""
    bundle = Bundle('b', units(2), [mesh(), catalogue.get('bladder_elasticity')()])
    other = bundle.with_parameters({'bladder_elasticity.c10': 1e5, 'geometry.radius': 7e-3})
    assert composition(tuple(e.law for e in bundle.effects)) is composition(
        tuple(e.law for e in other.effects))
    assert other.force(0.1, [2e5, 2e5]) != bundle.force(0.1, [2e5, 2e5])


@pytest.mark.skipif(kernels.numba() is None, reason='numba is not installed')
def test_what_numba_cannot_compile_runs_plain():
    """The compiled model is refused with a reason, the plain one gives the force of arrays."""
    books = {'a': 3.0}

    @law('force', **FACTS)
    def by_the_book(strain):
        return strain * books['a']

    bundle = Bundle('b', units(1), [by_the_book()])
    with pytest.raises(kernels.NotCompiled, match='unit_force'):
        bundle.model(compiled=True)
    m = bundle.model(compiled=False)
    assert m.force(0, 0.1, 0.0, [1e5], 0.0, 0.0, True, *m[3:]) == pytest.approx(0.3)


def test_an_unknown_value_is_refused_by_replace():
    """`replace` and `with_parameters` name the parameters that there are."""
    effect = catalogue.get('coulomb_friction')()
    with pytest.raises(InputError, match="coulomb_friction has no parameter 'size'"):
        effect.replace(size=3.0)
    with pytest.raises(InputError, match="coulomb_friction has no parameter 'size'"):
        Bundle('b', units(1), [effect]).with_parameters({'coulomb_friction.size': 3.0})


def test_what_other_rooms_need_to_know_stands_in_the_law():
    """No room asks for a law by its name to know what it is about."""
    laws = catalogue.available().values()
    assert {law.family for law in laws if law.pushes_back} == {'resistive'}
    bundle = Bundle('b', units(1), [mesh()]).with_effect('leak', time_constant=200.0).with_effect(
        'supply_droop', resistance=4e7)
    assert bundle.pneumatics.leak_rate == pytest.approx(1 / 200.0)
    assert bundle.pneumatics.supply_resistance == pytest.approx(4e7)
    assert {law.name for law in laws if not law.candidate} == {
        'mesh', 'measured_surface', 'discrepancy_surface', 'leak', 'supply_droop'}


def test_a_first_sample_begins_afresh_whatever_is_in_the_memory():
    """Also where the memory holds what is not a number, as after a broken reading."""
    effects = [mesh(), *(catalogue.get(name)() for name in catalogue.names()
                         if catalogue.get(name).memory and catalogue.get(name).load is None)]
    m = Bundle('b', units(1), effects).model()
    fresh = m.force(0, 0.1, 0.0, [2e5], 0.0, 0.0, True, *m[3:])
    m.memory[0][:] = [float('nan')] * len(m.memory[0])
    assert m.force(0, 0.1, 0.0, [2e5], 0.0, 0.0, True, *m[3:]) == fresh
    assert np.isfinite(m.after[0]).all()


def test_a_reading_that_is_not_a_number_gives_none():
    """Not a maximum of it and something else, on arrays and plain numbers alike."""
    bundle = Bundle('b', units(1), [mesh(), catalogue.get('threshold_pressure')(),
                                    catalogue.get('tendon_slack')()])
    for strain, pressure in ((np.nan, 1e5), (0.1, np.nan)):
        assert np.isnan(bundle.force(strain, [pressure]))
        assert np.isnan(bundle.step(bundle.start_state(), 0.0, strain, [pressure])[0])


def test_memory_advances_where_a_value_is_infinite():
    """A formula that overflows in one tick does not hold the memory of other laws back."""
    bundle = loads_model(HEAD + """\
  - mesh
  - wall: {expression: "k * exp(1e4 * max(strain - 0.2, 0))", place: pressure,
           parameters: {k: 1 kPa}}
  - pressure_line_lag""")
    m = bundle.model()
    assert np.isinf(m.force(0, 0.3, 0.0, [2e5], 0.0, 0.0, True, *m[3:]))
    assert m.after[0] == [2e5, 2e5]


def test_a_parameter_may_have_the_name_of_what_a_law_knows():
    """`place` is where the law acts, the parameter of that name is among the values."""
    effect = effect_from('own: {expression: "place * strain", parameters: {place: 3 N}}')
    assert effect.place is Place.FORCE
    assert effect.values['place'] == 3.0


def test_unequal_units_have_a_parameter_for_each_but_the_first():
    """Three units: mu2 and mu3, each the cross-section of its own unit."""
    law_of = catalogue.get('motor_unit_mismatch')
    assert [p.name for p in law_of.active(3)] == ['mu2', 'mu3']
    equal = Bundle('b', units(7), [mesh()]).unit_forces(0.1, np.full(7, 1e5))
    values = {f'mu{i}': 0.01 * i for i in range(2, 7)}
    unequal = Bundle('b', units(7), [mesh(), law_of(**values)]).unit_forces(0.1, np.full(7, 1e5))
    assert_allclose(unequal / equal, [1.0, 1.02, 1.03, 1.04, 1.05, 1.06, 1.0])


def test_a_larger_section_is_a_larger_muscle_of_the_same_length():
    """Its force by every law, and its gas: those of radius and wall larger by the root."""
    effects = [catalogue.get(name)() for name, law in catalogue.available().items()
               if law.place in (Place.FORCE, Place.LIMIT, Place.LOSS) and law.load is None]
    large = replace(PAPER, radius=np.sqrt(1.3) * PAPER.radius,
                    wall_thickness=np.sqrt(1.3) * PAPER.wall_thickness)
    mixed = Bundle('mixed', [units(1)[0], MotorUnit('mu2', 1, large)], effects)
    told = Bundle('told', units(2), [*effects, catalogue.get('motor_unit_mismatch')(mu2=0.3)])
    strain, pressure = np.linspace(0.0, 0.3, 7), np.full((7, 2), 1e5)
    assert_allclose(told.unit_forces(strain, pressure, 0.1),
                    mixed.unit_forces(strain, pressure, 0.1), rtol=1e-12)
    assert_allclose(told.gas_volume(strain), mixed.gas_volume(strain), rtol=1e-12)


@pytest.mark.parametrize('longer', [3e-3, -3e-3])
def test_unit_length_mismatch_is_a_muscle_of_that_length_between_the_same_ends(longer):
    """Its force at the strain of its own length; the first unit is unchanged, and so the rest."""
    length = PAPER.length + longer
    unequal = Bundle('b', units(3), [
        mesh(), bladder_elasticity(), catalogue.get('unit_length_mismatch')(mu2=longer)])
    strain, pressure = np.linspace(0.0, 0.25, 6), np.full((6, 3), 2e5)
    equal = Bundle('e', units(1), [mesh(), bladder_elasticity()])
    own = 1.0 - PAPER.length * (1.0 - strain) / length
    forces = unequal.unit_forces(strain, pressure)
    assert_allclose(forces[:, 1], equal.force(own, pressure[:, :1]), rtol=1e-12)
    assert_allclose(forces[:, [0, 2]].T, [equal.force(strain, pressure[:, :1])] * 2, rtol=1e-12)


def test_gauges_of_a_bundle_have_errors_of_their_own():
    """Readings of three units with b = 1, 2, 3 kPa and g = 0.01, 0.02, 0.03; none for one."""
    bias, gain = (catalogue.get(f'unit_pressure_{kind}') for kind in ('bias', 'gain'))
    assert [p.name for p in bias.active(3)] == ['mu1', 'mu2', 'mu3']
    assert bias.active(1) == gain.active(1) == ()
    bundle = Bundle('b', units(3), [mesh(), bias(mu1=1e3, mu2=2e3, mu3=3e3),
                                    gain(mu1=0.01, mu2=0.02, mu3=0.03)])
    true = np.array([1e5, 2e5, 3e5])
    shown = bundle.readings(0.0, 0.1, true)[2]
    assert_allclose(shown, [102e3, 206e3, 312e3])
    assert_allclose(bundle.felt(0.1, shown)[1], true)
    motion = Motion(np.full(2, 0.1), np.tile(shown, (2, 1)), np.zeros(2))
    assert_allclose(bundle.predict(motion), bundle.force(0.1, true))


def test_an_entry_point_adds_a_law_and_replaces_none(monkeypatch):
    """A package's law is listed last; one with the name of ours is not taken."""
    from importlib import metadata

    class Point:
        name = 'point'

        def __init__(self, law):
            self.load = lambda: law

    @law('force', **FACTS)
    def mesh(strain):
        return 0.0 * strain

    @law('force', **FACTS, variant_of='mehs')
    def other(strain):
        return 0.0 * strain

    def listed(*laws):
        monkeypatch.setattr(metadata, 'entry_points', lambda group: [Point(x) for x in laws])
        catalogue.available.cache_clear()
        return catalogue.available()

    try:
        laws = listed(two_parts, mesh)
        assert list(laws)[-1] == 'two_parts'
        assert laws['mesh'].source.startswith('Chou')
        with pytest.raises(InputError, match='entry point point: .* is not a law'):
            listed(object())
        with pytest.raises(InputError, match="law other: variant_of 'mehs' is not known; did you "
                           'mean mesh'):
            listed(other)
    finally:
        monkeypatch.undo()
        catalogue.available.cache_clear()


def test_what_a_model_is_made_of_cannot_be_changed(not_frozen):
    """Bundles share it."""
    assert not_frozen(model) == set()
