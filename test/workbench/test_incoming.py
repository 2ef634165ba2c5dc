# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A file on its way in: what the user says of its columns counts, and is read again each time."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.data.formats.arrays import of_arrays
from fam_bundle_ros.workbench.incoming import Incoming
from fam_bundle_ros.workbench.muscle import MuscleForm

ROWS = 40
WAVE = np.sin(np.linspace(0.0, 9.0, ROWS))
COLUMNS = {'t [s]': 0.1 * np.arange(ROWS), 'L [mm]': 120.0 + 5.0 * WAVE,
           'p1 [bar]': 2.0 + np.cos(np.linspace(0.0, 4.0, ROWS)), 'p2 [bar]': 1.0 + 0.5 * WAVE,
           'A [N]': 50.0 + 20.0 * WAVE, 'B [N]': 3.0 + WAVE}


@pytest.fixture
def incoming():
    """Return a file of two pressures and two forces, with a muscle of 127 mm."""
    made = Incoming('lab.csv', 'your own file', of_arrays('lab.csv', 'text', COLUMNS))
    made.muscle.type('length', '127')
    return made


def column(incoming, header):
    """Return a column as the page lists it, and all of them."""
    columns = incoming.columns(incoming.look())
    return next(one for one in columns if one.header == header), columns


def test_a_doubtful_column_is_told_and_the_file_is_then_read(incoming):
    """Of two unknown columns in N none is the force until one is told."""
    assert "column 'force' is missing" in incoming.look().problem
    incoming.change(*column(incoming, 'B [N]'), quantity='force')
    assert np.allclose(incoming.measurement().force, COLUMNS['B [N]'])
    incoming.change(*column(incoming, 'A [N]'), quantity='force')
    assert np.allclose(incoming.measurement().force, COLUMNS['A [N]'])
    assert column(incoming, 'B [N]')[0].quantity == ''


def test_unit_and_sign_are_told(incoming):
    """Another unit and a turned sign change the numbers as they should, and stay."""
    incoming.change(*column(incoming, 'A [N]'), quantity='force')
    incoming.change(*column(incoming, 'A [N]'), unit='kgf')
    incoming.change(*column(incoming, 'A [N]'), turned=True)
    one = column(incoming, 'A [N]')[0]
    assert (one.unit, one.turned) == ('kgf', True)
    assert np.allclose(incoming.measurement().force, -9.80665 * COLUMNS['A [N]'])
    incoming.change(*column(incoming, 'p1 [bar]'), unit='bar abs')
    pressure = incoming.measurement().pressure
    assert np.allclose(pressure[:, 0], 1e5 * COLUMNS['p1 [bar]'] - 101325.0)
    # the other motor unit is still there, and still gauge
    assert np.allclose(pressure[:, 1], 1e5 * COLUMNS['p2 [bar]'])


def test_what_is_not_used_is_not_read(incoming):
    """A clock that is told to be none makes a static map; a quantity moves between columns."""
    incoming.change(*column(incoming, 'A [N]'), quantity='force')
    incoming.change(*column(incoming, 't [s]'), quantity='')
    assert incoming.measurement().time is None
    incoming.change(*column(incoming, 'L [mm]'), quantity='')
    assert "column 'strain' is missing" in incoming.look().problem
    incoming.change(*column(incoming, 'B [N]'), quantity='contraction', unit='mm')
    assert np.allclose(incoming.measurement().strain, COLUMNS['B [N]'] / 127.0)


def test_the_length_of_the_muscle_is_the_rest_length(incoming):
    """Lengths are strains by the muscle's own length, whenever that is changed."""
    incoming.change(*column(incoming, 'A [N]'), quantity='force')
    for length in (127.0, 130.0):
        incoming.muscle.type('length', f'{length} mm')
        assert np.allclose(incoming.measurement().strain, 1.0 - COLUMNS['L [mm]'] / length)
    incoming.muscle.type('length', '')
    assert 'Length of your muscle' in incoming.said(incoming.look().problem)


def test_a_constant_stands_for_a_column_that_is_missing():
    """An isobar without its pressure, a log without a clock."""
    columns = {'x [mm]': 125.0 - COLUMNS['L [mm]'], 'F [N]': COLUMNS['A [N]']}
    made = Incoming('lab.csv', '', of_arrays('lab.csv', 'text', columns))
    made.muscle.type('length', '127')
    made.constant('pressure', '3 bar')
    made.constant('time', '10 Hz')
    data = made.measurement()
    assert np.allclose(data.pressure, 3e5)
    assert np.allclose(np.diff(data.time), 0.1)


def test_a_direction_of_a_position_is_chosen_in_the_table():
    """Where the muscle never would be shorter than at rest."""
    columns = {'x [mm]': COLUMNS['L [mm]'] - 115.0, 'F [N]': COLUMNS['A [N]'],
               'p [bar]': COLUMNS['p1 [bar]']}
    made = Incoming('lab.csv', '', of_arrays('lab.csv', 'text', columns))
    made.muscle.type('length', '127')
    assert made.said(made.look().problem).endswith('choose in the table what it is, contraction '
                                                   'or elongation, and its sign')
    made.change(*column(made, 'x [mm]'), quantity='contraction', turned=False)
    assert made.measurement().strain.min() >= 0.0


def test_what_is_told_is_a_recipe(incoming, tmp_path):
    """The page and `--columns` mean the same: a file reads alike by what was told on the page."""
    incoming.change(*column(incoming, 'A [N]'), quantity='force', turned=True)
    incoming.change(*column(incoming, 'p2 [bar]'), unit='psi')
    again = read_measurement(COLUMNS, columns=incoming.told, rest_length='127 mm')
    assert np.array_equal(again.force, incoming.measurement().force)
    assert np.array_equal(again.pressure, incoming.measurement().pressure)


def test_bad_rows_are_left_out_when_the_user_says_so():
    """The problem names the row in words of the page; then the row is counted as dropped."""
    force = COLUMNS['A [N]'].astype(object)
    force[5] = 'err'
    made = Incoming('lab.csv', '', of_arrays('lab.csv', 'text', {
        'strain': 0.1 + 0.05 * WAVE, 'p [bar]': COLUMNS['p1 [bar]'], 'F [N]': force}))
    assert made.said(made.look().problem) == (
        "lab.csv, row 6: F [N] is 'err'; expected a number, or a blank or a word for one (nan, "
        'n/a, overflow, ...: docs/how_to/data.md lists them), which leaves the row out')
    made.drop_bad = True
    assert made.measurement().dropped == {'without a number in force': 1}


def test_as_many_muscles_as_pressures_are_suggested(incoming):
    """Two pressures are two motor units; a part fills in what it knows, and says from where."""
    assert incoming.muscle.values['muscles'] == '1, 1'
    form = MuscleForm()
    form.choose('dmsp-20')
    form.type('length', '296')
    assert form.bundle().length == pytest.approx(0.296)
    assert 'not in the data sheet' in form.sources['wall_thickness']
    assert 'not in the data sheet' in form.text()
    form.type('wall_thickness', '2 mm')
    assert 'wall_thickness' not in form.sources


VOLTS = {'t_ms': 100.0 * np.arange(ROWS), 'U_Kraft [V]': COLUMNS['A [N]'] / 50.0 + 0.5,
         'U_p1 [V]': COLUMNS['p1 [bar]'] + 0.5, 'U_Weg [V]': (127.0 - COLUMNS['L [mm]']) / 40.0}


@pytest.fixture
def volts():
    """Return a file of voltages with a muscle of 127 mm."""
    made = Incoming('volts.csv', 'your own file', of_arrays('volts.csv', 'text', VOLTS))
    made.muscle.type('length', '127')
    return made


def test_voltages_are_read_by_what_one_volt_is_worth(volts):
    """The same words as those of `--columns`: a factor with its unit, and an offset."""
    assert volts.said(volts.look().problem).endswith(
        'choose its column in the table, with a unit or what one V is worth')
    for header, quantity, scale in (('U_Kraft [V]', 'force', '* 50 N - 25 N'),
                                    ('U_p1 [V]', 'pressure', '* 1 bar - 0.5 bar'),
                                    ('U_Weg [V]', 'contraction', '* 40 mm')):
        volts.change(*column(volts, header), quantity=quantity)
        volts.change(*column(volts, header), scale=scale)
    data = volts.measurement()
    assert np.allclose(data.force, COLUMNS['A [N]'])
    assert np.allclose(data.pressure[:, 0], 1e5 * COLUMNS['p1 [bar]'])
    assert np.allclose(data.strain, 1.0 - COLUMNS['L [mm]'] / 127.0)
    again = read_measurement(VOLTS, columns=volts.told, rest_length='127 mm')
    assert np.array_equal(again.force, data.force)


def test_an_error_of_one_column_leaves_the_others_as_they_were(volts):
    """It stands beside its column; a choice for another stays too."""
    volts.change(*column(volts, 'U_Weg [V]'), quantity='contraction')
    volts.change(*column(volts, 'U_Weg [V]'), scale='* 40 mm')
    volts.change(*column(volts, 'U_Kraft [V]'), quantity='force')
    seen = {each.header: each for each in volts.columns(volts.look())}
    assert (seen['U_Kraft [V]'].quantity, seen['U_Kraft [V]'].wrong) == ('force', True)
    assert seen['U_Kraft [V]'].why == "unit 'V' does not fit; expected a unit like N"
    assert (seen['t_ms'].quantity, seen['U_Weg [V]'].quantity) == ('time', 'contraction')
    assert seen['U_Weg [V]'].scale == '* 40 mm'


@pytest.mark.parametrize(('typed', 'told'), [
    ('50 N/V', 'U_Kraft [V] * 50 N/V'), ('* 50 N', 'U_Kraft [V] * 50 N'),
    ('force=U_Kraft * 50 N - 25 N', 'U_Kraft [V] * 50 N - 25 N'), ('', 'U_Kraft [V]')])
def test_a_calibration_may_be_pasted_from_an_advice(volts, typed, told):
    """Or be only the worth of a volt."""
    volts.change(*column(volts, 'U_Kraft [V]'), quantity='force')
    volts.change(*column(volts, 'U_Kraft [V]'), scale=typed)
    assert volts.told['force'] == told


def test_an_offset_alone_keeps_the_unit_of_the_column(incoming):
    """A length from another zero, in another unit, turned round."""
    incoming.change(*column(incoming, 'A [N]'), quantity='force')
    incoming.change(*column(incoming, 'A [N]'), scale='- 3 N')
    incoming.change(*column(incoming, 'A [N]'), turned=True)
    assert np.allclose(incoming.measurement().force, -COLUMNS['A [N]'] - 3.0)


def test_words_that_are_no_calibration_are_told_with_an_example(volts):
    """Beside the column, not as a column that is not there."""
    volts.change(*column(volts, 'U_Kraft [V]'), quantity='force')
    volts.change(*column(volts, 'U_Kraft [V]'), scale='a lot')
    assert volts.look().problem == (
        "volts.csv: column 'U_Kraft [V]': 'a lot' is no calibration; expected one like "
        "'* 50 N - 2 N'")
