# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Lengths, contractions and displacements become strains by a rest length."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, Recipe, taken_words
from fam_bundle_ros.errors import InputError

from .test_columns import table


@pytest.mark.parametrize(('header', 'values'), [
    ('length [mm]', lambda e: 250 * (1 - e)), ('L [cm]', lambda e: 25 * (1 - e)),
    ('length', lambda e: 250 * (1 - e)), ('contraction [mm]', lambda e: 250 * e),
    ('strain [mm]', lambda e: 250 * e), ('shortening [in]', lambda e: 250 * e / 25.4),
    ('elongation [mm]', lambda e: -250 * e), ('Verl\u00e4ngerung [%]', lambda e: -100 * e),
    ('position [mm]', lambda e: 250 * e), ('position [mm]', lambda e: -250 * e),
    ('Weg [mm]', lambda e: 250 * e), ('Dehnung [%]', lambda e: -100 * e)])
def test_lengths_and_displacements_become_strain_positive_when_shorter(log, header, values):
    """Lengths by the rest length; a displacement's direction by the force, which falls."""
    data = read_measurement(table(log, strain=(header, values(log[1]))), rest_length='250 mm')
    assert np.allclose(data.strain, log[1])


@pytest.mark.parametrize(('quantity', 'sign'), [
    ('elongation', -1), ('contraction', 1), ('length', 0)])
def test_told_lengths_mean_what_they_say(log, quantity, sign):
    """An elongation that is told lengthens; a contraction shortens."""
    values = 250 * (1 - log[1]) if quantity == 'length' else sign * 250 * log[1]
    data = read_measurement(table(log, strain=('b', values)), columns={quantity: 'b [mm]'},
                            rest_length=0.25)
    assert np.allclose(data.strain, log[1])


def test_the_direction_of_a_displacement_is_said(log):
    """The line of columns says which sign the force showed."""
    data = read_measurement(table(log, strain=('position [mm]', -250 * log[1])),
                            rest_length=0.25)
    assert 'positive when longer, as the force tells' in taken_words(data)
    assert 'rest length 250 mm' in taken_words(data)


def test_a_column_that_repeats_the_rest_length_tells_it(log):
    """A specimen's length beside each reading or the first; one that changes is no rest length."""
    data = table(log, strain=('length [mm]', 250 * (1 - log[1])))
    for further in (250.0, np.nan):
        data['L0 [mm]'] = np.append(250.0, np.full(len(log[1]) - 1, further))
        read = read_measurement(data)
        assert np.allclose(read.strain, log[1])
        assert "not used: 'L0 [mm]' (the rest length)" in taken_words(read)
    data['L0 [mm]'][-1] = 300.0
    for length in (None, 0.25):  # of the model
        with pytest.raises(InputError, match='rest lengths of 250 mm, 300 mm in one table'):
            read_measurement(data, recipe=Recipe(muscle_length=length))
    assert np.allclose(read_measurement(data, rest_length=0.25).strain, log[1])


@pytest.mark.parametrize('rounded', [
    lambda values: np.round(values, 2), lambda values: values,
    lambda values: values.astype(np.float32).astype(float)])
def test_a_length_and_a_contraction_add_up_to_the_rest_length(log, rounded):
    """To the last digit that they are written with, or to single precision."""
    data = table(log, strain=('length [mm]', rounded(250 * (1 - log[1]))))
    data['contraction [cm]'] = rounded(25 * log[1])
    assert read_measurement(data).rest_length == pytest.approx(0.25, abs=1e-4)


def test_a_sum_of_lengths_that_varies_is_no_rest_length(log):
    """The zero of the contraction has moved by half a millimetre."""
    data = table(log, strain=('length [mm]', np.round(250 * (1 - log[1]), 2)))
    data['contraction [mm]'] = np.round(250 * log[1] + np.linspace(0.0, 0.5, len(log[1])), 2)
    with pytest.raises(InputError, match='expected a strain, or the rest length'):
        read_measurement(data)


def test_a_rest_length_without_a_unit_is_not_used_and_said(log, tmp_path):
    """The muscle's length is used, which may be another."""
    rows = np.stack([log[0], 250 * (1 - log[1]), log[2] / 1e3, log[3]], axis=1)
    np.savetxt(tmp_path / 'a.csv', rows, '%.6f', ',', comments='', header='# L0 = 250\n'
               'time [s],length [mm],pressure [kPa],force [N]')
    data = read_measurement(tmp_path / 'a.csv', recipe=Recipe(muscle_length=0.26))
    assert np.allclose(data.strain, 1 - 250 / 260 * (1 - log[1]))
    assert "in the file stands '# L0 = 250', without a unit: not used" in ' '.join(data.notes)


def test_several_rest_lengths_in_a_file_are_said(log, tmp_path):
    """Two specimens in one file have a length each."""
    rows = np.stack([log[0], 250 * log[1], log[2] / 1e3, log[3]], axis=1)
    with open(tmp_path / 'a.csv', 'w') as file:
        file.write('time [s],contraction [mm],pressure [kPa],force [N]\n')
        for length, part in ((250, rows[:90]), (240, rows[90:])):
            file.write(f'# L0 = {length} mm\n')
            np.savetxt(file, part, '%.6f', ',')
    data = read_measurement(tmp_path / 'a.csv')
    assert 'several rest lengths in the file: 250 mm, 240 mm' in ' '.join(data.notes)


@pytest.mark.parametrize(('model', 'said'), [(0.25001, False), (0.2512, True)])
def test_a_model_of_another_length_is_said_where_the_lengths_differ_as_shown(log, model, said):
    """The file's length is used; a difference that is not shown is none."""
    data = table(log, strain=('length [mm]', 250 * (1 - log[1])))
    data['L0 [mm]'] = np.full(len(log[1]), 250.0)
    notes = read_measurement(data, recipe=Recipe(muscle_length=model)).notes
    assert ('the model has' in ' '.join(notes)) == said


def test_lengths_need_a_rest_length_that_fits(log):
    """None, or that of another muscle, is an error that shows the lengths."""
    data = table(log, strain=('length [mm]', 250 * (1 - log[1])))
    with pytest.raises(InputError, match='longest here is 250 mm'):
        read_measurement(data)
    with pytest.raises(InputError, match='250 mm beside a rest length of 127 mm'):
        read_measurement(data, rest_length='127 mm')


@pytest.mark.parametrize(('fittings', 'said'), [(-40.0, 'never longer than 0.84'), (0.0, ''),
                                                (45.0, 'up to 1.18')])
def test_a_length_that_is_another_than_the_muscle_s_is_told(log, fittings, said):
    """With its fittings, or between its clamps: the strain is off by as much."""
    data = read_measurement(table(log, strain=('length [mm]', 250 * (1 - log[1]) + fittings)),
                            rest_length=0.25)
    assert said in ' '.join(data.notes)
    assert bool(said) == ('of the rest length' in ' '.join(data.notes))


@pytest.mark.parametrize(('header', 'offset', 'said'), [
    ('contraction [mm]', 40, True), ('contraction [mm]', 20, False), ('position [mm]', 20, True),
    ('position [mm]', 0, False)])
def test_a_displacement_with_an_offset_is_noticed(log, header, offset, said):
    """A position that never is near zero is no contraction from the rest length."""
    data = read_measurement(table(log, strain=(header, offset + 250 * log[1])), rest_length=0.25)
    assert any('never is near zero' in note for note in data.notes) == said


@pytest.mark.parametrize(('least', 'said'), [(0.0, False), (-0.03, False), (-0.08, True)])
def test_a_contraction_that_begins_far_below_zero_is_noticed(log, least, said):
    """A muscle is stretched a little by its load; by 8 % the zero is elsewhere. It is read."""
    strain = least + 0.1 * log[1] / log[1].max()
    data = read_measurement(table(log, strain=('contraction strain [%]', 100.0 * strain)))
    assert np.allclose(data.strain, strain)
    assert any('stretched by 8 %' in note for note in data.notes) == said
    assert any('stretched' in note for note in data.notes) == said


@pytest.mark.parametrize(('most', 'said'), [(0.004, True), (0.03, False)])
def test_percents_that_never_reach_one_are_asked_about(log, most, said):
    """0.4 % in all is no experiment, but 40 % as a ratio is; 3 % may be all there is."""
    strain = most * log[1] / log[1].max()
    data = read_measurement(table(log, strain=('contraction strain [%]', 100.0 * strain)))
    assert any('is it a ratio' in note for note in data.notes) == said


@pytest.mark.parametrize(('header', 'factor'), [('contraction [mm]', 250.0),
                                                ('contraction strain', 1.0)])
def test_only_percents_are_asked_whether_they_are_ratios(log, header, factor):
    """A small contraction in mm, or without a unit, may be small."""
    strain = 0.004 * log[1] / log[1].max() / (250.0 if factor > 1.0 else 1.0)
    data = read_measurement(table(log, strain=(header, factor * strain)), rest_length='250 mm')
    assert np.allclose(data.strain, strain)
    assert not any('is it a ratio' in note for note in data.notes)


@pytest.mark.parametrize(('header', 'values', 'told', 'strain'), [
    ('position [mm]', lambda e: 30 - 100 * e, 'elongation=position [mm] - 30 mm',
     lambda e: 0.4 * e),
    ('strain', lambda e: -e, 'elongation=strain [1]', lambda e: e),
    ('strain', lambda e: -e, 'contraction=strain [1]', lambda e: -e)])
def test_a_muscle_that_is_never_shorter_than_at_rest_is_asked(log, header, values, told, strain):
    """Each choice of the message is read as it says: another direction, another zero, neither."""
    data = table(log, strain=(header, values(log[1])))
    with pytest.raises(InputError, match='never is shorter than at rest') as error:
        read_measurement(data, rest_length=0.25)
    assert f'--columns "{told}"' in str(error.value)
    read = read_measurement(data, rest_length=0.25, columns=dict([told.split('=')]))
    assert np.allclose(read.strain, strain(log[1]))


@pytest.mark.parametrize('header', ['Strain [Exten.] Extension', 'Tensile strain (Displacement)',
                                    'Elongation strain', 'Tensile extension'])
def test_a_strain_of_a_testing_machine_is_positive_when_longer(log, header):
    """By its name; it is preferred to a displacement."""
    data = {**table(log, strain=(f'{header} [mm/mm]', -log[1])), 'Position [mm]': -200 * log[1]}
    assert np.allclose(read_measurement(data, rest_length=0.25).strain, log[1])


@pytest.mark.parametrize(('header', 'size'), [('position [mm]', 250.0), ('position', 250.0),
                                              ('/joint_states/slider/position', 0.25)])
def test_a_position_whose_largest_is_the_rest_length_is_a_length(log, header, size):
    """On a topic it is in m, and not a ratio."""
    data = read_measurement(table(log, strain=(header, size * (1 - log[1]))), rest_length=0.25)
    assert np.allclose(data.strain, log[1])
    assert 'a length: its largest is the rest length' in taken_words(data)


@pytest.mark.parametrize('size', [265.0, 240.0])
def test_a_position_whose_largest_is_another_is_no_length(log, size):
    """Its zero is anywhere."""
    with pytest.raises(InputError, match=f'"elongation=position .mm. - {size:.0f} mm" moves its'):
        read_measurement(table(log, strain=('position [mm]', size - 100 * log[1])),
                         rest_length=0.25)


@pytest.mark.parametrize('header', ['stretch', '\u03bb', 'L/L0', 'length [%]'])
def test_a_length_may_be_a_ratio_to_that_at_rest(log, header):
    """No rest length is needed then."""
    scale = 100.0 if '%' in header else 1.0
    data = read_measurement(table(log, strain=(header, scale * (1.0 - log[1]))))
    assert np.allclose(data.strain, log[1])


@pytest.mark.parametrize('header', [
    'contraction strain (extensometer)', 'Contraction strain (tensile tester)',
    'Strain (tensile tester)', 'Kontraktion, strain (extension)'])
def test_a_strain_of_contraction_is_positive_when_shorter(log, header):
    """Whatever measured it; also where it begins stretched."""
    data = table(log, strain=(f'{header} [%]', 100.0 * (log[1] - 0.03)))
    assert np.allclose(read_measurement(data).strain, log[1] - 0.03)


@pytest.mark.parametrize(('header', 'fittings'), [
    ('length [mm]', 30.0), ('plate distance [mm]', 42.0), ('length incl. fittings [mm]', 18.0)])
def test_a_length_beyond_the_rest_length_is_read_and_the_fittings_offered(log, header, fittings):
    """Its sign is known: nothing is turned round, and the note's command is read as it says."""
    data = table(log, strain=(header, 250 * (1 - 0.3 * log[1]) + fittings))
    read = read_measurement(data, rest_length=0.25)
    assert np.allclose(read.strain, 0.3 * log[1] - fittings / 250)
    told = f'length={header} - {fittings:.0f} mm'
    assert any(f'--columns "{told}"' in note for note in read.notes)
    read = read_measurement(data, rest_length=0.25, columns=dict([told.split('=')]))
    assert np.allclose(read.strain, 0.3 * log[1])


def test_a_position_of_an_unknown_name_may_count_from_anywhere(log):
    """A marker 1.2 m above the floor is no length of a muscle of 250 mm: its zero is asked for."""
    time, strain, pressure, force = log
    table = {'t [s]': time, 'mark [m]': 1.2 + 0.25 * strain, 'p [bar]': pressure / 1e5,
             'F [N]': force}
    with pytest.raises(InputError) as caught:
        read_measurement(table, rest_length='250 mm')
    told = str(caught.value).partition('--columns "contraction=')[2].partition('"')[0]
    assert told == 'mark [m] - 1200 mm'
    read = read_measurement(table, rest_length='250 mm',
                            columns={'contraction': told})
    assert np.allclose(read.strain, strain)


def test_a_second_column_of_the_strain_that_disagrees_is_told(log):
    """Of a length and the travel of the crosshead, which began elsewhere, one is wrong."""
    time, strain, pressure, force = log
    table = {'time [s]': time, 'crosshead [mm]': 127 * strain + 3.0,
             'length [mm]': 127 * (1 - strain), 'p [Pa]': pressure, 'F [N]': force}
    note, = read_measurement(table, rest_length='127 mm').notes
    assert "'length [mm]' tells another strain, by up to 0.024" in note
    table['crosshead [mm]'] -= 3.0
    assert not read_measurement(table, rest_length='127 mm').notes


def blocks(log, title):
    """Return a log in two blocks, each with a title and a head, as testing machines write it."""
    head = '"Time","Contraction","Load","Air pressure"\n"(s)","(mm)","(N)","(Pa)"'
    text = ''
    for at in range(2):
        text += title(at) + '\n\n' + head + '\n' + ''.join(
            f'"{t:.3f}","{127 * e:.5f}","{f:.4f}","{p:.1f}"\n'
            for t, e, p, f in zip(*(each[at::2] for each in log))) + '\n'
    return text


@pytest.mark.parametrize('title', [
    '"Specimen {}"\n"Rest length","{}.00","mm"', 'Run {}: L0 = {} mm'])
def test_blocks_tell_their_rest_lengths(tmp_path, log, title):
    """One that is the same in all is taken; of several the first was, without a word."""
    path = tmp_path / 'log.csv'
    path.write_text(blocks(log, lambda at: title.format(at + 1, 127)))
    strain = np.r_[log[1][::2], log[1][1::2]]
    assert np.abs(read_measurement(path).strain - strain).max() < 1e-4
    path.write_text(blocks(log, lambda at: title.format(at + 1, 127 + 5 * at)))
    with pytest.raises(InputError, match='rest lengths of 127 mm, 132 mm in one table'):
        read_measurement(path)
    assert np.abs(read_measurement(path, rest_length='127 mm').strain - strain).max() < 1e-4
