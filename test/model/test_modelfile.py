# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The model file: read, written, and refused with file, line and key."""

import pickle

import numpy as np
from numpy.testing import assert_allclose
import pytest

from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import dumps_model, load_model, loads_model, Motion, save_model

GOOD = """\
format: fam-bundle-model/1
name: small
error: 0.6 N
notes: {data: rig.csv}
motor_units:
  - name: a
    muscles: 2
    geometry: {radius: 0.25 in, length: 12.7 cm, braid_angle: 33 deg, wall_thickness: 1.59 mm}
    max_pressure: 50 psi
effects:
  - mesh
  - bladder_elasticity: {c10: 0.1184 MPa}
  - coulomb_friction:
      force: {value: 4.1 N, lower: 0 N, upper: 20 N, interval: [3.9 N, 4.3 N]}
  - drag: {expression: "-k * strain_rate", parameters: {k: {value: 5 N*s, lower: 0 N*s,
           upper: 100 N*s}}}
"""


def test_units_of_any_kind_are_read():
    """Inches, centimetres, psi and MPa come out as SI."""
    bundle = loads_model(GOOD)
    unit = bundle.motor_units[0]
    assert_allclose([unit.geometry.radius, unit.geometry.length, unit.max_pressure],
                    [6.35e-3, 0.127, 344737.9], rtol=1e-6)
    assert_allclose(unit.geometry.braid_angle, np.radians(33.0))
    assert_allclose(bundle.effect('bladder_elasticity').c10, 118.4e3)
    assert bundle.error == 0.6
    assert bundle.effect('coulomb_friction').intervals['force'] == (3.9, 4.3)


def test_a_model_survives_being_written_and_read(tmp_path):
    """Values, bounds, intervals, expressions and notes come back; so does every force."""
    first = loads_model(GOOD)
    save_model(first, tmp_path / 'm.yaml')
    again = load_model(tmp_path / 'm.yaml')
    assert dumps_model(again) == dumps_model(first)
    assert_allclose(again.force(0.1, [2e5], 0.3), first.force(0.1, [2e5], 0.3), rtol=1e-9)
    assert_allclose(first.force(0.1, [2e5]) - first.force(0.1, [2e5], 0.3),
                    2 * (4.1 + 5 * 0.3), rtol=1e-6)


def test_a_model_reaches_worker_processes():
    """Expressions too, whose class is made at run time."""
    first = loads_model(GOOD)
    again = pickle.loads(pickle.dumps(first))
    assert again.force(0.1, [2e5], 0.3) == first.force(0.1, [2e5], 0.3)


def test_a_model_is_written_whole_or_not_at_all(tmp_path):
    """No folder, no file: the error names the path."""
    with pytest.raises(InputError, match='nowhere/m.yaml: cannot be written'):
        save_model(loads_model(GOOD), tmp_path / 'nowhere' / 'm.yaml')


@pytest.mark.parametrize(('old', 'new', 'message'), [
    ('mesh', 'mehs', "line 11: effect 'mehs' is not known; did you mean mesh"),
    ('0.25 in', '0.25 kPa', "line 8: radius: unit 'kPa' does not fit; expected a unit like mm"),
    ('0.25 in', '0.25', "line 8: radius: '0.25' has no unit; expected a unit like mm"),
    ('0.25 in', 'wide', "line 8: radius: 'wide' is not a quantity"),
    ('0.25 in', '.nan mm', "line 8: radius: '.nan mm' is not a quantity"),
    ('0.25 in', 'nan mm', "line 8: radius: 'nan mm' is not finite"),
    ('0.25 in', '-1 mm', 'line 8: radius must be above zero'),
    ('0.25 in', '2.5 in', 'line 8: radius must be below 0.4 of the length'),
    ('1.59 mm', '8 mm', 'line 8: wall_thickness must be below the radius'),
    ('33 deg', '60 deg', 'line 8: braid_angle must lie between 5 and 54.7 deg'),
    ('muscles: 2', 'muscles: two', "line 7: muscles is 'two'; expected a whole number"),
    ('50 psi', '50 MPa', 'line 9: max_pressure must lie between 0 and 20 MPa'),
    ('c10: 0.1184 MPa', 'c10: 118 MPa', 'line 12: bladder_elasticity: c10 is 118000 kPa; '
     'expected between 0 and 1500 kPa'),
    ('{c10: 0.1184 MPa}', '\n      c10: -5 kPa\n      c01: 4 kPa',
     'line 13: bladder_elasticity: c10 is -5 kPa'),
    ('{value: 4.1 N, lower: 0 N, upper: 20 N, interval: [3.9 N, 4.3 N]}',
     '{value: 30 N, upper: 20 N}\n      smoothing: 0.01 1/s',
     'line 14: coulomb_friction: force is 30 N; expected between 0 N and 20 N'),
    ('c10:', 'c11:', "line 12: bladder_elasticity has no parameter 'c11'; it has c10, c01"),
    ('4.1 N', '40 N', 'force is 40 N; expected between 0 N and 20 N'),
    ('name: a', 'nmae: a', "line 6: motor unit 1 has no key 'nmae'"),
    ('model/1', 'model/9', "line 1: format is 'fam-bundle-model/9'"),
    ('5 N*s', '5 N', r'drag.k: .*lower|drag'),
    ('upper: 20 N', 'upper: 9 kN', 'force: a model file may narrow the bounds'),
    ('{data: rig.csv}', 'hello', 'line 4: notes must be a mapping'),
    ('{k: {value: 5 N*s, lower: 0 N*s,\n           upper: 100 N*s}}', '[k]',
     'line 15: parameters of drag must be a mapping'),
    ('- mesh', '- mesh\n  - mesh', 'line 12: effect mesh is named twice'),
    ('name: small', 'name: small\nname: big', "line 3: 'name' is given twice"),
    ('name: small', 'name: [a', 'line 3: is not YAML|line 4: is not YAML'),
    ('name: small', '[name]: small', 'line 2: a key must be a word'),
    ('effects:\n', 'effects: mesh\ndescription:\n', 'line 10: effects must be a list'),
    ('name: small', 'effect_files: mine.py', 'line 2: effect_files must be a list'),
    ('  - mesh', '  - [mesh]', 'an effect must be a name'),
    ('  - mesh', '  - {mesh: , end_caps: }', 'line 11: an effect must be one name with its par'),
    ('{c10: 0.1184 MPa}', '[118 kPa]', 'line 12: bladder_elasticity: parameters must be a map'),
    (', wall_thickness: 1.59 mm', '', 'line 8: geometry of motor unit 1 has no wall_thickness'),
    ('    geometry: {', '    max_pressure: 50 psi\n  - name: b\n    geometry: {',
     'line 6: motor unit 1 has no geometry'),
])
def test_a_bad_file_is_refused_with_line_and_key(old, new, message):
    """One sentence says where and what was expected."""
    assert old in GOOD
    with pytest.raises(InputError, match='model, .*' + message.replace('(', r'\(')):
        loads_model(GOOD.replace(old, new, 1))


def test_aliases_are_refused():
    """Ten lines of aliases can stand for a billion entries."""
    bomb = 'a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n'
    with pytest.raises(InputError, match=r'line 2: aliases \(\*name\) are not allowed'):
        loads_model(bomb)


@pytest.mark.parametrize(('content', 'said'), [
    (b'', ''), (b'\x00\x01\xff\xfe', ''), (b'- 1\n- 2\n', ''), (b'[' * 9, 'is not YAML'),
    (b'[' * 500 + b']' * 500, 'is nested too deeply')])
def test_what_is_no_model_file_is_refused(tmp_path, content, said):
    """Empty, binary, a list, or nested without end: one sentence each, and the file's name."""
    path = tmp_path / 'm.yaml'
    path.write_bytes(content)
    with pytest.raises(InputError, match=f'm.yaml.*{said}'):
        load_model(path)


GLUE = """
import numpy as np
from fam_bundle_ros.model import law, Parameter
@law('force', family='user', summary='s', source='s', signature='s', memory=('last',),
     size=Parameter(3.0, 'N', 0.0, 9.0, 'd'))
def glue(strain, start, last, size):
    last = np.where(start, strain, last)  # used as it is: computed sample by sample
    return size + 100.0 * (strain - last), 0.5 * (strain + last)
"""
CLASS = """
from fam_bundle_ros.model import Effect, Parameter, Place
class Glue(Effect):
    name, summary, source, family = 'glue', 's', 's', 'user'
    place, signature = Place.FORCE, 's'
    parameters = (Parameter('size', 'N', 3.0, 0.0, 9.0, 'd'),)
    def contribution(self, x):
        return self.size + 0.0 * x.strain
"""


@pytest.mark.parametrize('text', [
    CLASS, CLASS.replace('model import', 'model.effects.base import'), 'x = 1'])
def test_an_effect_written_as_a_class_is_told_how_to_become_a_function(tmp_path, text):
    """One sentence that names the file, the decorator and the page."""
    (tmp_path / 'mine.py').write_text(text)
    path = tmp_path / 'm.yaml'
    path.write_text(GOOD.replace('effects:', 'effect_files: [mine.py]\neffects:\n  - glue'))
    with pytest.raises(InputError, match=r'mine.py: .*@law\(...\).*docs/how_to/own_effect.md'):
        load_model(path, allow_python=True)


@pytest.mark.parametrize(('first', 'message'), [
    ('viscos_damping', "'viscos_damping' is not known; did you mean viscous_damping"),
    ('stribeck_friction', "'stribeck_friction' is itself a variant of 'coulomb_friction'")])
def test_a_users_law_is_a_variant_of_one_that_there_is(tmp_path, first, message):
    """Of a built-in law or of its own file; a misspelt name would make it a thing of its own."""
    path = tmp_path / 'm.yaml'
    path.write_text(GOOD.replace('effects:', 'effect_files: [mine.py]\neffects:\n  - glue'))
    for name in ('viscous_damping', first):
        (tmp_path / 'mine.py').write_text(
            GLUE.replace("family='user'", f"family='user', variant_of='{name}'"))
        if name == first:
            with pytest.raises(InputError, match=f'mine.py: law glue: variant_of {message}'):
                load_model(path, allow_python=True)
        else:
            assert load_model(path, allow_python=True).effect('glue').variant_of == name


@pytest.mark.parametrize(('was', 'is_now', 'message'), [
    ('return size +', 'return 0.0 if strain > 0.1 else size +', 'run on arrays of rows .*where'),
    (', 0.5 * (strain + last)', '', 'returns .*; expected its value, then last after the sample')])
def test_a_users_law_is_tried_when_it_is_read(tmp_path, was, is_now, message):
    """An `if` over rows, a memory that is not returned: told at once, with file and law."""
    (tmp_path / 'mine.py').write_text(GLUE.replace(was, is_now))
    path = tmp_path / 'm.yaml'
    path.write_text(GOOD.replace('effects:', 'effect_files: [mine.py]\neffects:\n  - glue'))
    with pytest.raises(InputError, match=f'mine.py: law glue .*{message}'):
        load_model(path, allow_python=True)


def test_a_users_law_with_a_memory_of_its_own_kind_runs_over_a_record(tmp_path):
    """Without the recurrences of the vocabulary it is computed sample by sample, to the same."""
    (tmp_path / 'mine.py').write_text(GLUE)
    path = tmp_path / 'm.yaml'
    path.write_text(GOOD.replace('effects:', 'effect_files: [mine.py]\neffects:\n  - glue'))
    bundle = pickle.loads(pickle.dumps(load_model(path, allow_python=True)))
    strain, time = np.linspace(0.0, 0.1, 7), np.arange(7.0)
    motion = Motion(strain, np.full((7, 1), 2e5), np.zeros(7), time, time == 4)
    state, forces = bundle.start_state(), []
    for k in range(4):
        force, state = bundle.step(state, 1.0, strain[k], [2e5])
        forces.append(force)
    whole = bundle.simulate(motion)
    assert_allclose(whole[:4], forces, rtol=1e-12)
    at_rest = bundle.unit_forces(strain, np.full((7, 1), 2e5))
    assert_allclose((whole - at_rest)[[0, 4]], 0.0, atol=1e-9)
    assert np.all((whole - at_rest)[[1, 2, 3, 5, 6]] > 1.0)


def test_python_files_are_run_only_with_leave(tmp_path):
    """A model file from a stranger executes nothing."""
    (tmp_path / 'mine.py').write_text(GLUE)
    path = tmp_path / 'm.yaml'
    path.write_text(GOOD.replace('effects:', 'effect_files: [mine.py]\neffects:\n  - glue'))
    with pytest.raises(InputError, match='line 10: names Python files.*--allow-python'):
        load_model(path)
    glued = load_model(path, allow_python=True)
    assert glued.effect('glue').size == 3.0
    elsewhere = tmp_path / 'sub'
    elsewhere.mkdir()
    save_model(glued, elsewhere / 'copy.yaml')
    again = load_model(elsewhere / 'copy.yaml', allow_python=True)
    assert again.force(0.1, [2e5]) == glued.force(0.1, [2e5])


@pytest.mark.parametrize(('formula', 'message'), [
    ("__import__('os').system('touch owned')", 'only arithmetic is allowed'),
    ("open('x')", "function 'open' is not one of"),
    ('().__class__', 'only arithmetic is allowed'),
    ('strain.real', 'only arithmetic is allowed'),
    ('[k for k in (1,)]', 'only arithmetic is allowed'),
    ('k * pressure', 'gives .* but a force effect must give N'),
    ('k * wobble', "'wobble' is not known"),
    ('k * 9 ** 9 ** 9', 'a power must be a number of at most 12'),
    ('k * 10 ** 400', 'a power must be a number of at most 12'),
    ('k *', 'cannot be read'),
    ('k * exp(strain, strain)', r"function 'exp' takes 1 argument\(s\)"),
    ('k + strain', 'units do not fit'),
    ('k' + '+k' * 400, 'at most 500 characters'),
])
def test_an_expression_may_only_calculate(formula, message):
    """No imports, no attributes, no calls but the listed functions, units that fit."""
    text = GOOD.replace('-k * strain_rate', formula).replace('N*s', 'N')
    with pytest.raises(InputError, match=message):
        loads_model(text)


def test_an_expression_acts_at_the_place_that_it_names():
    """A formula for the pressure is felt by the braid."""
    text = GOOD.replace('"-k * strain_rate"', '"-min(pressure, k)", place: pressure').replace(
        'N*s', 'kPa')
    felt = loads_model(text).without_effect('coulomb_friction')
    plain = felt.without_effect('drag')
    assert_allclose(felt.force(0.1, [2e5]), plain.force(0.1, [1.95e5]))
