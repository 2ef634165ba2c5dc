# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What files of laboratories were read wrong by, and what is asked or said of it now."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement, taken_words
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.errors import InputError

from .test_columns import ROWS, table


def test_a_column_that_is_called_by_a_unit_alone_is_taken_by_it(log):
    """PSIG is a gauge pressure; a column 'min' is no time."""
    data = read_measurement({**table(log, pressure=('PSIG', log[2] / 6894.757)), 'min': log[1]})
    assert np.allclose(data.pressure[:, 0], log[2])
    assert np.allclose(data.time, log[0])


@pytest.mark.parametrize(('changed', 'words'), [
    ({'pressure': ('p [kPa]', np.linspace(101.4, 400.0, ROWS)),
      'force': ('force [N]', np.linspace(0.0, 200.0, ROWS))}, 'hardly a force at the lowest pres'),
    ({'pressure': ('p [kPa]', np.linspace(101.4, 400.0, ROWS)), 'strain': (
        'strain', np.linspace(0.0, 0.2, ROWS)), 'force': ('force [N]', np.linspace(
            50.0, 51.0, ROWS))}, 'under a weight is 101.4 kPa'),
    ({'strain': ('strain', np.linspace(-0.1, 0.1, ROWS))}, 'is stretched by 10 %'),
    ({'further': ('p2 [kPa]', np.linspace(600.0, 590.0, ROWS))}, 'pressure 2 of 2 never is below'),
    ({'further': ('p2 [kPa]', np.linspace(0.1, 0.3, ROWS))}, 'pressure 2 of 2 is 0.2 kPa through'),
    ({'force': ('force [N]', np.linspace(-300.0, -20.0, ROWS)),
      'strain': ('strain', np.linspace(0.0, 0.2, ROWS)),
      'pressure': ('p [kPa]', np.full(ROWS, 2e2))}, 'the force is negative')])
def test_what_may_be_misread_is_asked(log, changed, words):
    """Absolute pressure, a strain of the wrong sign or zero, a supply, a cell that pushes."""
    names = table(log, **changed)
    if 'further' in changed:
        names['p1 [kPa]'] = names.pop('pressure [kPa]')
    notes = ' '.join(read_measurement(names).notes)
    assert words in notes
    assert words not in ' '.join(read_measurement(table(log)).notes)


@pytest.mark.parametrize(('header', 'asked'), [
    ('p2 [kPa]', True), ('accumulator pressure 2 [kPa]', True), ('pressure.mu2 [kPa]', False),
    ('Druck Muskel 2 [kPa]', False)])
def test_a_pressure_that_stays_high_may_be_a_supply_unless_its_name_is_a_muscles(
        log, header, asked):
    """Orderly recruitment keeps the first motor unit near its limit; `record` names it."""
    names = {**table(log), header: np.linspace(600.0, 590.0, ROWS)}
    names[header.replace('2', '1')] = names.pop('pressure [kPa]')
    assert any('is it a supply?' in note for note in read_measurement(names).notes) is asked


def test_two_columns_may_be_told_as_their_sum_or_difference(log):
    """A length between two markers, the force of two cells; not of two units."""
    data = {**table(log, strain=('top [mm]', 300 + 0 * log[1]), force=('a [N]', log[3] - 5.0)),
            'low [mm]': 50 + 250 * log[1], 'b [N]': np.full(ROWS, 5.0)}
    told = {'length': 'top - low [mm]', 'force': 'a [N] + b'}
    read = read_measurement(data, columns=told, rest_length=0.25)
    assert np.allclose(read.strain, log[1])
    assert np.allclose(read.force, log[3])
    with pytest.raises(InputError, match=r"'top \[mm\]' is in mm, 'a \[N\]' in N; expected one"):
        read_measurement(data, columns={'length': 'top - a'})


def test_the_axes_of_a_load_cell_that_feel_nothing_are_passed_over(log):
    """Fx is zero throughout, Fz is the force."""
    data = read_measurement({**table(log, force=('Fz [N]', log[3])), 'Fx [N]': np.zeros(ROWS)})
    assert np.allclose(data.force, log[3])
    assert "'Fx [N]' (zero in all rows)" in taken_words(data)


def test_one_reading_of_nines_far_from_all_others_is_none(log):
    """-9999 N once among forces up to 200 N; 999 among readings up to 900 stays."""
    force = log[3].copy()
    force[7] = -9999.0
    assert len(read_measurement(table(log, force=('force [N]', force)))) == ROWS - 1
    force[7] = 999.0
    assert len(read_measurement(table(log, force=('force [N]', force)))) == ROWS


def test_the_same_readings_in_two_units_are_one(log):
    """A display writes kPa and psi: the first is taken. Two sensors in two units are two."""
    data = {**table(log), 'strain [%]': 100 * log[1], 'pressure [psi]': log[2] / 6894.757}
    read = read_measurement(data)
    assert np.allclose(read.pressure[:, 0], log[2])
    assert "'pressure [psi]' (the same as 'pressure [kPa]')" in taken_words(read)
    with pytest.raises(InputError, match='both may be pressure'):
        read_measurement({**data, 'pressure [psi]': log[2] / 6800.0})


def test_microstrain_is_of_a_strain_gauge(log):
    """A muscle shortens by a tenth; the bridge of a load cell is in µε."""
    data = {**table(log, strain=('L [mm]', 250 * (1 - log[1]))), 'strain [µε]': log[3]}
    assert np.allclose(read_measurement(data, rest_length=0.25).strain, log[1])


def test_a_force_of_millinewtons_is_asked(log):
    """Readings in kN under a header of N pass every range."""
    notes = read_measurement(table(log, force=('force [N]', log[3] / 1e3))).notes
    assert any('reaches only 0.194 N: is it in another unit?' in note for note in notes)


def test_a_column_of_the_loop_s_duration_is_no_clock(log):
    """It does not rise; without another clock a note says what to tell."""
    data = {**table(log, time=None), 'dt_ms': np.full(ROWS, 50.0)}
    assert any("'dt_ms' in ms is no clock" in note for note in read_measurement(data).notes)
    assert read_measurement({**data, 't_us': 1e6 * log[0]}).time[-1] == pytest.approx(log[0][-1])


@pytest.mark.parametrize('line', ['Muscle length: 200 mm', 'slack length [mm];200,0',
                                  'Uninflated length = 20 cm', 'Gauge length,200,mm',
                                  'Muskell\u00e4nge;200;mm'])
def test_a_rest_length_above_the_table_may_have_other_names(line, log, tmp_path):
    """Of the muscle, slack, uninflated."""
    rows = ['time [s],contraction [mm],p [Pa],F [N]', *(
        f'{t:.2f},{200 * e:.4f},{p:.3f},{f:.3f}' for t, e, p, f in zip(*log))]
    (tmp_path / 'a.csv').write_text('\n'.join([line, *rows]))
    assert np.allclose(read_measurement(tmp_path / 'a.csv').strain, log[1], atol=1e-6)


def test_beside_psi_a_force_without_a_unit_is_asked(log):
    """It may be in lbf; beside kPa it is taken as N."""
    data = table(log, pressure=('p [psi]', log[2] / 6894.757), force=('force', log[3]))
    with pytest.raises(InputError, match=r'another is in psi; .* "force=force \[lbf\]", or \[N\]'):
        read_measurement(data)
    read_measurement(table(log, force=('force', log[3])))


@pytest.mark.parametrize('other', ['Force corrected [N]', 'Force tared [N]'])
def test_a_corrected_column_is_as_good_as_the_plain_one(log, other):
    """The error names both, and does not suggest their sum."""
    with pytest.raises(InputError, match=r'both may be force.*"force=force \[N\]"$'):
        read_measurement({**table(log), other: log[3] + 5.0})
    assert np.allclose(read_measurement(table(log, force=(other, log[3]))).force, log[3])


def test_of_three_axes_none_is_chosen_by_its_letter(log):
    """A camera's x, y and z."""
    data = table(log, strain=('x [mm]', 250 * log[1]))
    assert np.allclose(read_measurement(data, rest_length=0.25).strain, log[1])
    with pytest.raises(InputError, match=r"'x \[mm\]' and 'z \[mm\]' both may be contraction"):
        read_measurement({**data, 'z [mm]': 250 * log[1] + 1.0}, rest_length=0.25)


def test_what_stands_above_of_absolute_pressure_is_asked(log, tmp_path):
    """A remark does not make a pressure absolute: a note shows it."""
    rows = [f'{t:.2f},{e:.5f},{p / 1e3:.2f},{f:.2f}' for t, e, p, f in zip(*log)]
    (tmp_path / 'a.csv').write_text('\n'.join([
        '# all pressures are absolute', 'time [s],strain,pressure [kPa],force [N]', *rows]))
    notes = read_measurement(tmp_path / 'a.csv').notes
    assert any("'# all pressures are absolute': 'pressure [kPa]' is taken as gauge" in note
               for note in notes)
    assert not read_measurement(tmp_path / 'a.csv', gauge=True).notes


def test_a_clock_with_steps_too_short_for_seconds_is_asked(log):
    """Fractions of a day; steps of a millisecond may be of minutes, which is said."""
    with pytest.raises(InputError, match=r'are short for s; .*time \[d\]'):
        read_measurement(table(log, time=('time', log[0] / 86400)))
    assert 's guessed' in taken_words(read_measurement(table(log, time=('time', log[0] / 60))))
    assert not taken_words(read_measurement(table(log, time=('time', log[0]))))


@pytest.mark.parametrize('sign', [1, -1])
def test_a_level_of_one_bar_is_not_taken_for_the_atmosphere(log, muscle, sign):
    """The muscle pulls at 1 bar, if only where it is long, so its pressure is not absolute."""
    pressure = log[2] - 50.5e3
    strain = np.where((np.arange(ROWS) > 9) & (pressure < 1e5), 0.29, log[1])
    force = sign * muscle(strain, pressure)
    assert np.median(np.abs(force[:80])) < 0.1 * np.abs(force).max()
    data = table(log, pressure=('p [kPa]', pressure / 1e3), strain=('strain', strain),
                 force=('force [N]', force))
    assert 'absolute' not in ' '.join(read_measurement(data).notes)


def test_a_vented_muscle_pushes_where_it_is_short(log):
    """Its rubber does, and does not pull: 1 bar is absolute."""
    data = table(log, pressure=('p [kPa]', log[2] / 1e3 - 50.0), force=('force [N]', np.where(
        log[2] < 200e3, -100.0 * log[1] / 0.2, log[3])))
    assert 'is it absolute' in ' '.join(read_measurement(data).notes)


def test_a_length_and_a_contraction_beside_it_tell_the_rest_length(log):
    """Their sum; where the model has another, a note says so."""
    data = table(log, strain=('contraction [mm]', 300 * log[1]))
    data['length [cm]'] = 30 * (1 - log[1])
    assert np.allclose(read_measurement(data).strain, log[1])
    assert any('the file says 300 mm' in note for note in
               read_measurement(data, rest_length=0.25).notes)


def test_an_unknown_name_above_a_footer_is_taken_by_its_unit(log, tmp_path):
    """The word of the footer stands in the column of the laser."""
    rows = [f'{250 * e:.4f},{t:.2f},{p / 1e3:.2f},{f:.2f}' for t, e, p, f in zip(*log)]
    (tmp_path / 'a.csv').write_text('\n'.join([
        'Laser [mm],t [s],p [kPa],F [N]', *rows, 'Mean,1,2,3']))
    data = read_measurement(tmp_path / 'a.csv', rest_length=0.25)
    assert len(data) == ROWS
    assert np.allclose(data.strain, log[1], atol=1e-5)


def test_the_unit_of_another_column_above_is_not_that_of_the_pressure(log, tmp_path):
    """'Ambient pressure [hPa]' beside 'Pressure': the latter is in kPa by its size."""
    rows = [f'{t:.2f},{e:.4f},{p / 1e3:.2f},{f:.2f},1013' for t, e, p, f in zip(*log)]
    (tmp_path / 'a.csv').write_text('\n'.join([
        't [s],strain,Pressure,F [N],Ambient pressure [hPa]', *rows]))
    assert np.allclose(read_measurement(tmp_path / 'a.csv').pressure[:, 0], log[2])


def test_a_number_before_a_unit_is_that_of_the_sensor():
    """'P 2, kPa' is a second pressure, not one in 2 kPa; what MATLAB leaves of 'in -' no inch."""
    found = recognise('P 2, kPa')
    assert (found.part, found.unit.text, found.unit.factor) == ('mu2', 'kPa', 1e3)
    assert recognise('Contraction_ratio_in__').unit is None
