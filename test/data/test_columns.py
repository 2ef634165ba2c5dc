# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a column is taken for, and when it is asked instead of guessed."""

import re

import numpy as np
import pandas as pd
import pytest

from fam_bundle_ros.data import (
    checks,
    preview,
    read_measurement,
    taken_words,
    unit_names,
)
from fam_bundle_ros.data.column_names import recognise
from fam_bundle_ros.data.formats.dialect import split
from fam_bundle_ros.data.formats.layout import find_data
from fam_bundle_ros.data.grouping import pressure_levels
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.units import si_factor

ROWS = 240  # of the log of conftest.py


def table(log, **renamed):
    """Return the log as a dict of columns; a keyword renames one, or takes it away."""
    time, strain, pressure, force = log
    columns = {'time': ('time [s]', time), 'strain': ('strain', strain),
               'pressure': ('pressure [kPa]', pressure / 1e3), 'force': ('force [N]', force)}
    columns.update({key: value for key, value in renamed.items() if value is not None})
    return {header: values for key, (header, values) in columns.items()
            if renamed.get(key, True) is not None}


@pytest.mark.parametrize(('header', 'quantity', 'unit', 'factor'), [
    ('Muskeldruck in bar', 'pressure', 'bar', 1e5), ('p/psi', 'pressure', 'psi', 6894.757),
    ('Pressure (cmH2O)', 'pressure', 'cmH2O', 98.0665), ('Load [g]', 'force', 'g', 9.80665e-3),
    ('Load [kgf]', 'force', 'kgf', 9.80665), ('Load [kg-f]', 'force', 'kg-f', 9.80665),
    ('force [lbs.]', 'force', 'lbs.', 4.4482216), ('force [oz]', 'force', 'oz', 0.27801385),
    ('F_lbf', 'force', 'lbf', 4.4482216),
    ('Zugkraft [kN]', 'force', 'kN', 1e3), ('Force [MN]', 'force', 'MN', 1e6),
    ('Force [mN]', 'force', 'mN', 1e-3), ('L\u00e4nge [mm]', 'length', 'mm', 1e-3),
    ('\u03b5 [%]', 'strain', '%', 1e-2), ('t_ms', 'time', 'ms', 1e-3), ('ms', 'time', 'ms', 1e-3),
    ('millis()', 'time', 'millis', 1e-3), ('epoch_ns', 'time', 'ns', 1e-9),
    ('PRESSURE_KPA', 'pressure', 'KPA', 1e3), ('Weg [\u00b5m]', 'shift', '\u00b5m', 1e-6),
    ('Verk\u00fcrzung [%]', 'contraction', '%', 1e-2),
    ('p_N_mm2', 'pressure', 'N_mm2', 1e6), ('p_atm', 'pressure', 'atm', 101325.0),
    ('Pressure_kPa_', 'pressure', 'kPa', 1e3), ('p_mess [bar]', 'pressure', 'bar', 1e5),
])
def test_names_and_units_are_recognised(header, quantity, unit, factor):
    """English and German, brackets or not, whatever the case."""
    found = recognise(header)
    assert (found.quantity, found.unit.text, found.score > 1) == (quantity, unit, True)
    assert found.unit.factor == pytest.approx(factor)


@pytest.mark.parametrize('header', [
    'Solldruck [bar]', 'pressure setpoint [kPa]', 'supply pressure [bar]', 'p_ref [kPa]',
    'Luftdruck [hPa]', 'ambient pressure [kPa]', 'model force [N]', 'residual [N]',
    'force error [N]', 'torque [Nm]', 'velocity [mm/s]', 'Temperature [K]', 'valve voltage [V]',
    'target length [mm]', 'radial displacement [mm]', 'estimated force [N]', 'p_des [kPa]',
    'p_des_1 [bar]', '/cell/wrench/torque/x', 'p_atm [hPa]', 'strain gauge',
    'Strain gage 2'])
def test_what_is_no_reading_of_the_muscle_is_not_taken(header):
    """Setpoints, supplies, models and other sensors are left alone."""
    assert recognise(header).quantity == ''


def test_both_ends_of_a_line_may_be_the_pressure_of_the_muscle(log):
    """Neither is preferred for its name, nor is either taken for that of a motor unit untold."""
    data = table(log, pressure=('p_in [bar]', log[2] / 1e5))
    match = r"'p_in \[bar\]' and 'p_out \[bar\]' both may be"
    with pytest.raises(InputError, match=match) as told:
        read_measurement({**data, 'p_out [bar]': 0.9 * log[2] / 1e5})
    assert str(told.value).endswith('one for each motor unit, --columns "pressure.mu1=p_in [bar]" '
                                    '--columns "pressure.mu2=p_out [bar]"')


def test_counts_are_to_be_told_with_what_one_is_worth(log):
    """A force in counts of a converter that is told as N would be read as N."""
    data = table(log, force=('adc', np.round(10.0 * log[3])))
    with pytest.raises(InputError, match=r'"force=adc \* 0.5 N"'):
        read_measurement(data)


@pytest.mark.parametrize(('unit', 'factor', 'absolute'), [
    ('kPa', 1e3, False), ('psi', 6894.757, False), ('psia', 6894.757, True),
    ('MPa[abs]', 1e6, True), ('bar abs', 1e5, True), ('bar(a)', 1e5, True), ('barg', 1e5, False),
    ('kPa rel', 1e3, False), ('bar \u00fc', 1e5, False),
    ('MPa', 1e6, False), ('mmHg', 133.32237, False)])
def test_pressures_arrive_as_gauge(log, unit, factor, absolute):
    """Absolute or gauge is read from the unit."""
    given = (log[2] + (101325.0 if absolute else 0.0)) / factor
    data = read_measurement(table(log, pressure=(f'p [{unit}]', given)))
    assert np.allclose(data.pressure[:, 0], log[2])


def test_absolute_pressures_can_be_told(log):
    """The option overrides the header; another ambient pressure may be given."""
    absolute = table(log, pressure=('p [kPa]', (log[2] + 101325.0) / 1e3))
    assert np.allclose(read_measurement(absolute, gauge=False).pressure[:, 0], log[2])
    up_high = read_measurement(absolute, gauge=False, ambient_pressure=80e3)
    assert np.allclose(up_high.pressure[:, 0], log[2] + 21325.0)
    gauge = table(log, pressure=('p [kPa abs]', log[2] / 1e3))
    assert np.allclose(read_measurement(gauge, gauge=True).pressure[:, 0], log[2])


@pytest.mark.parametrize(('values', 'unit'), [
    (lambda p: p / 1e3, 'kPa'), (lambda p: p / 1e6, 'MPa'), (lambda p: p, 'Pa')])
def test_a_pressure_without_a_unit_gets_the_only_one_that_fits(log, values, unit):
    """410 can only be in kPa: this is assumed and noted."""
    data = read_measurement(table(log, pressure=('pressure', values(log[2]))))
    assert np.allclose(data.pressure[:, 0], log[2])
    assert f'{unit} guessed' in taken_words(data)


@pytest.mark.parametrize(('share', 'unit'), [(1.0, None), (100.0, '%')])
def test_a_contraction_without_a_unit_is_a_ratio_or_percent(log, share, unit):
    """Up to 25 it can only be percent as long as no length is told that millimetres refer to."""
    data = read_measurement(table(log, strain=('contraction', share * log[1])))
    assert np.allclose(data.strain, log[1])
    assert ('% guessed' in taken_words(data)) is (unit == '%')


@pytest.mark.parametrize(('top', 'words'), [(90.0, 'kPa or psi'), (7.5, 'bar or psi')])
def test_a_pressure_that_may_be_two_units_is_asked_for(log, top, words):
    """90 may be kPa or psi: the message says both and what to write."""
    data = table(log, pressure=('pressure', log[2] * top / log[2].max()))
    with pytest.raises(InputError, match=words) as caught:
        read_measurement(data)
    assert f'--columns "pressure=pressure [{words.partition(" ")[0]}]"' in str(caught.value)


def test_percent_without_a_unit_is_taken_and_said(log):
    """A strain up to 20 can only be percent; one slip of 90 among ratios changes nothing."""
    data = read_measurement(table(log, strain=('strain', 100.0 * log[1])))
    assert np.allclose(data.strain, log[1])
    assert '% guessed' in taken_words(data)
    slip = log[1].copy()
    slip[7] = 90.0
    with pytest.raises(InputError, match='row 8: strain is 90'):
        read_measurement(table(log, strain=('strain', slip)))


@pytest.mark.parametrize(('header', 'size', 'asked'), [
    ('strain [%]', 1.0, True), ('strain [%]', 100.0, False), ('strain [1]', 0.025, False)])
def test_percent_that_are_ratios_are_noticed(log, header, size, asked):
    """0.2 under a header of percent is 0.002: a note asks. A small strain in its unit is none."""
    data = read_measurement(table(log, strain=(header, size * log[1])))
    assert any('ratio, not %' in note for note in data.notes) == asked


def test_a_column_that_counts_rows_is_no_trial(log):
    """A column with as many values as rows is not used, with a note; one with few has trials."""
    counting = {**table(log), 'test': np.arange(ROWS)}
    data = read_measurement(counting)
    assert data.trial_names == ('0',)
    assert f'{ROWS} different values in {ROWS} rows' in taken_words(data)
    few = read_measurement({**table(log), 'Versuch': np.repeat(['a', 'b', 'c'], 80)})
    assert few.trial_names == ('a', 'b', 'c')


def test_a_blank_trial_belongs_to_the_one_above(log):
    """Merged cells of a spreadsheet name the trial once."""
    names = np.full(ROWS, None, object)
    names[[0, 80, 160]] = ['a', 'b', 'c']
    data = read_measurement({**table(log), 'run': names})
    assert np.array_equal(np.bincount(data.trial), [80, 80, 80])
    numbers = np.full(ROWS, np.nan)
    numbers[[0, 80, 160]] = [1.0, 2.0, 3.5]
    assert read_measurement({**table(log), 'run': numbers}).trial_names == ('1', '2', '3.5')


def test_the_best_of_two_columns_is_taken_and_a_tie_is_asked(log):
    """'force' beats 'force filtered'; two equal names are an error that shows both."""
    better = {**table(log), 'force filtered [N]': np.zeros(ROWS)}
    assert np.allclose(read_measurement(better).force, log[3])
    with pytest.raises(InputError, match=r"'force \[N\]' and 'Kraft \[N\]' both may be force"):
        read_measurement({**table(log), 'Kraft [N]': np.ones(ROWS)})


def test_two_pressures_are_two_motor_units(log):
    """p1 and p2, pressure.left and pressure.right, in the order of the file."""
    data = read_measurement({**table(log, pressure=('p1 [kPa]', log[2] / 1e3)),
                             'p2 [bar]': log[2] / 2e5})
    assert data.motor_units == ('mu1', 'mu2')
    assert np.allclose(data.pressure, np.stack([log[2], log[2] / 2], -1))
    named = read_measurement({**table(log, pressure=('pressure.left [kPa]', log[2] / 1e3)),
                              'pressure.right [kPa]': log[2] / 2e3})
    assert named.motor_units == ('left', 'right')


def test_a_pressure_that_is_told_as_a_number_comes_after_those_of_the_file(log):
    """However it is told: the motor units stand as their columns do."""
    data = read_measurement(table(log), columns={
        'pressure.hand': '100 kPa', 'pressure.gauge': 'pressure [kPa]'})
    assert data.motor_units == ('gauge', 'hand')
    assert np.allclose(data.pressure, np.stack([log[2], np.full(ROWS, 1e5)], -1))


@pytest.mark.parametrize(('apart', 'same'), [(1e-4, True), (0.02, False)])
@pytest.mark.parametrize(('first', 'second'), [('N', 'kN'), ('kN', 'N')])
def test_a_force_in_two_units_is_one_force_unless_the_readings_differ(
        log, first, second, apart, same):
    """Rounded or not, in N and in kN; two cells that differ by a fiftieth are asked for."""
    size = {'N': 1.0, 'kN': 1e3}
    data = {**table(log, force=(f'force [{first}]', log[3] / size[first])),
            f'Kraft [{second}]': (1.0 + apart) * log[3] / size[second]}
    if same:
        assert np.allclose(read_measurement(data).force, log[3], rtol=2e-4)
    else:
        with pytest.raises(InputError, match='both may be force'):
            read_measurement(data)


def test_two_equal_forces_are_asked_for(log):
    """Forces of two cells add up, be they equal; a clock beside each channel is one clock."""
    data = {**table(log, force=('force 1 [N]', log[3] / 2)), 'force 2 [N]': log[3] / 2}
    with pytest.raises(InputError, match=r'their sum, "force=force 1 \[N\] \+ force 2 \[N\]"'):
        read_measurement(data)


def test_a_clock_without_a_unit_that_may_count_milliseconds_is_asked_for(log):
    """0, 50, 100 may be s or ms; a count in ones is taken for seconds, and that is said."""
    counted = table(log, time=('time', np.round(1e3 * log[0])))
    with pytest.raises(InputError, match=r'steps of 50 may be s, ms or us.*"time=time \[ms\]"'):
        read_measurement(counted)
    told = read_measurement(counted, columns={'time': 'time [ms]'})
    assert np.allclose(np.diff(told.time), np.diff(log[0]))
    said = taken_words(read_measurement(table(log, time=('time', np.arange(ROWS)))))
    assert "time 'time' (s guessed, no unit given)" in said
    assert taken_words(read_measurement(table(log, time=('time', log[0])))) == ''


def test_seconds_since_1970_need_no_unit(log):
    """A logger of ten seconds a row writes 1710152142, 1710152152: no other unit has that size."""
    data = read_measurement(table(log, time=('time', 1710152142 + 10.0 * np.arange(ROWS))))
    assert np.allclose(np.diff(data.time), 10.0)


@pytest.mark.parametrize('header', [
    'Absolutdruck (bar)', 'Pression absolue (bar)', 'Pressione assoluta (bar)',
    'Pressione ass. (bar)', 'Presi\u00f3n absoluta (bar)', 'Absolute druk (bar)',
    'Ci\u015bnienie bezwzgl\u0119dne (bar)', '\u7d76\u5bfe\u5727(bar)',
    '\u7edd\u5bf9\u538b\u529b(bar)', 'P abs (bar)'])
def test_a_pressure_that_is_called_absolute_is_read_as_such(log, header):
    """In languages of which nothing else is understood too."""
    data = read_measurement(table(log, pressure=(header, log[2] / 1e5 + 1.01325)))
    assert np.allclose(data.pressure[:, 0], log[2])
    assert 'absolute' in taken_words(data)


@pytest.mark.parametrize('header', ['Druck in bar (\u00dcberdruck)', 'Pression relative (bar)',
                                    'Presi\u00f3n manom\u00e9trica (bar)', 'p rel (bar)'])
def test_a_gauge_pressure_is_taken_beside_the_absolute_one(log, header):
    """No note asks for gauge or absolute if the name tells."""
    data = read_measurement({**table(log, pressure=(header, log[2] / 1e5)),
                             'Pression absolue (bar)': log[2] / 1e5 + 1.01325})
    assert np.allclose(data.pressure[:, 0], log[2])


def test_a_pressure_known_by_its_unit_alone_is_said_to_be_gauge(log):
    """The name does not tell whether it is absolute."""
    renamed = table(log, pressure=('Ci\u015bnienie (bar)', log[2] / 1e5))
    assert '(by its unit alone, as gauge)' in taken_words(read_measurement(renamed))


def test_fields_of_topics_are_recognised_by_their_last_names(log):
    """As PlotJuggler writes them; units are those of the messages."""
    data = read_measurement({
        '__time': 1.71e9 + log[0], '/cell/wrench/force/z': log[3],
        '/cell/wrench/torque/z': 0 * log[0],
        '/slide/strain': log[1], '/mu1/pressure/fluid_pressure': log[2] + 101325.0,
        '/mu2/pressure/fluid_pressure': log[2] / 2 + 101325.0})
    assert np.allclose(data.pressure, np.stack([log[2], log[2] / 2], -1))
    assert np.allclose(data.force, log[3])


def test_a_name_among_other_words_needs_a_unit(log):
    """'left spring load' may be anything; with N it is a force."""
    with pytest.raises(InputError, match='may be force, but not all its words or its unit'):
        read_measurement(table(log, force=('left spring load', log[3])))
    assert np.allclose(read_measurement(table(log, force=('left spring load [N]', log[3]))).force,
                       log[3])


def test_constants_can_be_told(log):
    """One pressure that was never logged, and the rate of a log without a clock."""
    held = read_measurement(table(log, pressure=None, time=None),
                            columns={'pressure': '300 kPa', 'time': '20 Hz'})
    assert np.allclose(held.pressure, 300e3)
    assert np.allclose(held.time, log[0])


@pytest.mark.parametrize(('columns', 'words'), [
    ({'forse': 'force'}, "'forse' is not a quantity"), ({'force': 'nix'}, "no column 'nix'"),
    ({'force': 'strain [mm]'}, "unit 'mm' does not fit"), ({'pressure': '300'}, 'no column')])
def test_what_is_told_wrongly_fails(log, columns, words):
    """An unknown quantity, column or unit is named."""
    with pytest.raises(InputError, match=words):
        read_measurement(table(log), columns=columns)


def test_the_unit_in_the_header_of_a_told_column_must_fit(log):
    """A lever in mm is no force, however surely it is told."""
    data = table(log, force=('lever [mm]', log[3]))
    with pytest.raises(InputError, match=r"'lever \[mm\]'.*'mm' does not fit"):
        read_measurement(data, columns={'force': 'lever [mm]'})


def test_the_unit_told_counts_more_than_the_header(log):
    """A header that says kPa over readings in bar is put right by the option."""
    data = read_measurement(table(log, pressure=('pressure [kPa]', log[2] / 1e5)),
                            columns={'pressure': 'pressure [bar]'})
    assert np.allclose(data.pressure[:, 0], log[2])


@pytest.mark.parametrize(('stamps', 'step'), [
    (lambda t: 1.777e12 + 1e3 * t, 0.05), (lambda t: 1.777e9 + t, 0.05),
    (lambda t: 45000 + t / 86400, 0.05)])
def test_clocks_of_computers_and_spreadsheets_become_seconds(log, stamps, step):
    """Milliseconds since 1970, seconds since 1970, days since 1900."""
    data = read_measurement(table(log, time=('timestamp', stamps(log[0]))))
    assert np.allclose(np.diff(data.time), step, atol=1e-4)


def test_a_file_as_we_write_it_needs_no_words(log):
    """Nothing is reported for plain names and units; an unused column is."""
    assert taken_words(read_measurement(table(log))) == ''
    said = taken_words(read_measurement({**table(log), 'T [K]': log[0]}))
    assert "not used: 'T [K]'" in said


def test_a_preview_shows_what_reading_would_do(log):
    """Columns with their meaning and the first cells; the problem is the reader's own error."""
    shown = preview(table(log, strain=('length [mm]', 250 * (1 - log[1]))))
    assert [taken.quantity for taken in shown.taken] == ['time', 'length', 'pressure', 'force']
    assert 'rest length' in shown.problem
    assert shown.measurement is None
    assert [float(cell) for cell in shown.cells['force [N]']] == pytest.approx(log[3][:20], 1e-5)
    state = np.array(['up', None, 'down', 'a' * 99] * (ROWS // 4), object)
    odd = preview({**table(log), 'state': state, 'gauge 2': np.append(np.nan, log[3][1:])})
    assert odd.cells['state'][:4] == ['up', '', 'down', 'a' * 60]
    assert odd.cells['gauge 2'][0] == ''
    fine = preview(table(log))
    assert fine.problem == ''
    assert len(fine.measurement) == fine.rows == ROWS


@pytest.mark.parametrize('like', ['N', 'Pa', 'm', 's', '1', '1/s'])
def test_a_unit_that_pint_knows_too_is_the_same(like):
    """Where the table of spellings and pint both know a unit, they agree."""
    both = 0
    for text in unit_names._UNITS[like]:
        try:
            # Upper and lower case are told apart by pint: mn is no unit of force there.
            expected = si_factor(text, like)
        except InputError:
            continue
        if like != 'N' or not text.endswith(('g', 'lb', 'lbs', 'pound', 'pounds')):
            assert unit_names._UNITS[like][text] == pytest.approx(expected, rel=1e-5), text
            both += 1
    assert both >= 2


def test_a_strain_out_of_range_is_told_in_the_unit_of_its_column(log):
    """The message shows 160 %, as in the file, not 1.6."""
    time, strain, _, _ = log
    with pytest.raises(InputError, match=r'strain is 160 %'):
        read_measurement(table(log, strain=('strain [%]', 800.0 * strain)))


def test_signs_do_not_depend_on_where_zero_is(log):
    """A correlation at equal pressure is that of the changes."""
    _, strain, pressure, force = log
    found = checks.partial_correlations(strain, pressure, force)
    assert found[0] < -0.9
    assert found[1] > 0.9
    assert checks.partial_correlations(strain + 3.0, pressure + 1e6, force - 500.0
                                       ) == pytest.approx(found)


@pytest.mark.parametrize('name', ['/mu1/pressure/fluid_pressure [Pa]', 'fluid_pressure [Pa]',
                                  'fluid_pressure', 'mu1.pressure.fluid_pressure'])
def test_the_pressure_of_a_ros_message_is_absolute(log, name):
    """`fluid_pressure`, as tools export sensor_msgs/FluidPressure: Pa where no unit is given."""
    _, _, pressure, _ = log
    data = read_measurement(table(log, pressure=(name, pressure + 101325.0)))
    np.testing.assert_allclose(data.pressure[:, 0], pressure, atol=1.0)


def test_one_column_is_not_told_for_two_quantities(log):
    """Force and pressure from one column would be one of them without a word."""
    with pytest.raises(InputError, match='told for force and for pressure'):
        read_measurement(table(log, force=('5 bar', log[3])),
                         columns={'force': '5 bar [N]', 'pressure': '5 bar'})


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_muscle_on_a_spring_shortens_with_its_pressure(log, sign):
    """Force, strain and pressure rise together there: the pressure tells the sign, no warning."""
    time, _, pressure, _ = log
    swing = 0.5 - 0.5 * np.cos(np.linspace(0.0, 12.0 * np.pi, len(time)))
    noise = 0.002 * np.random.default_rng(0).standard_normal(len(time))
    shift = 50.0 * swing ** 1.3 + noise
    data = read_measurement(
        table((time, 0.0 * time, 4e5 * swing, 4.0 * shift),
              strain=('Weg [mm]', sign * shift)), rest_length='250 mm')
    assert data.strain.max() == pytest.approx(0.2, abs=0.01)
    word = 'positive when shorter' if sign > 0 else 'positive when longer'
    assert f'{word}, as the pressure tells' in taken_words(data)
    assert not any('sign' in note for note in data.notes)


def test_a_pressure_that_never_changes_is_one_level():
    """One isobar, its value as it was read."""
    index, level = pressure_levels(np.full(7, 2e5))
    assert index.tolist() == [0] * 7
    assert level.tolist() == [2e5]


def test_quoted_cells_keep_their_separators():
    """Also after a blank cell."""
    assert split('1, "2,5", x', ',') == ['1', '2,5', 'x']


def test_a_page_of_words_has_no_data():
    """One row of numbers among words is no table."""
    words = [['one', 'two', 'three']] * 6
    assert find_data(words) == (-1, 0)
    assert find_data([*words, ['1', '2', '3'], *words[:3]]) == (-1, 0)


def test_the_pressure_of_the_line_is_taken_where_no_other_is_there(log):
    """Without one of the muscle it is that of the muscle; beside one it is not read."""
    alone = read_measurement(table(log, pressure=('line pressure [bar]', log[2] / 1e5)))
    assert np.allclose(alone.pressure[:, 0], log[2])
    beside = read_measurement({**table(log), 'line pressure [bar]': np.full(ROWS, 7.0)})
    assert np.allclose(beside.pressure[:, 0], log[2])


def test_a_column_without_a_name_is_said(tmp_path, log):
    """Names may be those of the first columns or of the last: which was taken stands in a note."""
    for which in ('first', 'last'):
        path = tmp_path / f'{which}.csv'
        rows = [f'{t:.2f},{e:.5f},{p / 1e3:.2f},{f:.3f}' for t, e, p, f in zip(*log)]
        path.write_text('time [s],strain,pressure [kPa],force [N]\n' + ''.join(
            f'{k},{row}\n' if which == 'first' else f'{row},1\n'
            for k, row in enumerate(rows, 1)))
        data = read_measurement(path)
        assert np.allclose(data.force, log[3], atol=1e-3)
        assert any(f'5 columns below 4 names: the {which} has none' in note
                   for note in data.notes)


@pytest.mark.parametrize('seed', range(4))
def test_partial_correlations_are_those_of_what_the_third_leaves(seed):
    """Residuals of straight lines, in any units, of any sign; one that is still has none."""
    rng = np.random.default_rng(seed)
    e, p, f = rng.normal(size=(3, 3)) @ rng.normal(size=(3, 60)) + [[1.0], [5.0], [-20.0]]

    def left(of, given):
        return of - np.polyval(np.polyfit(given, of, 1), given)
    found = checks.partial_correlations(1e-3 * e, 1e5 * p, f)
    if found.follows:
        assert np.corrcoef(e, p)[0, 1] ** 2 > 0.8
        assert found == pytest.approx((0.0, np.corrcoef(p, f)[0, 1], np.corrcoef(e, p)[0, 1]))
    else:
        assert found == pytest.approx((np.corrcoef(left(e, p), left(f, p))[0, 1],
                                       np.corrcoef(left(p, e), left(f, e))[0, 1], 0.0))
    still = checks.partial_correlations(e, np.full(60, 3e5), f)
    assert still == pytest.approx((np.corrcoef(e, f)[0, 1], 0.0, 0.0))


@pytest.mark.parametrize(('header', 'unit'), [
    ('p2 [kPa]', 'mu1'), ('pressure 2 [kPa]', 'mu1'), ('pressure.mu2 [kPa]', 'mu2'),
    ('pressure.left [kPa]', 'left')])
def test_a_lone_pressure_has_the_name_that_the_file_gives_a_motor_unit(header, unit):
    """A number alone names none: it may count the channels of a logger."""
    e, p = np.tile(np.linspace(0.0, 0.2, 8), 5), np.repeat(np.linspace(100.0, 400.0, 5), 8)
    data = read_measurement({'strain': e, header: p, 'force [N]': 0.1 * p * (1.0 - 3.0 * e)})
    assert data.motor_units == (unit,)


def points(**columns):
    """Return strain and force of five isobars, and further columns; `_` stands for a blank."""
    e, p = np.tile(np.linspace(0.0, 0.2, 8), 5), np.repeat(np.linspace(100.0, 400.0, 5), 8)
    found = {'strain': e, 'force [N]': 0.1 * p * (1.0 - 3.0 * e)}
    more = {'p': p, 'back': p[::-1], 'blank': np.full(40, np.nan), 'same': np.full(40, 7.0),
            'rows': np.arange(40.0), 'words': np.array(['on'] * 40, object),
            'runs': np.repeat([1.0, 2.0], 20), 'pairs': np.repeat(np.arange(20.0), 2)}
    return {**found, **{name: more[kind] for name, kind in columns.items()}}


@pytest.mark.parametrize('other', ['pressure [kPa]', 'p [kPa]'])
def test_a_pressure_beside_those_of_motor_units_is_one_too_many(other):
    """One without a motor unit is refused; that of a supply is ignored."""
    units = {'pressure.mu1 [kPa]': 'p', 'pressure.mu2 [kPa]': 'back'}
    with pytest.raises(InputError, match=r"beside 'pressure.mu1 \[kPa\]'; expected one name per"):
        read_measurement(points(**{other: 'p'}, **units))
    data = read_measurement(points(**{'pressure supply [kPa]': 'p'}, **units))
    assert data.motor_units == ('mu1', 'mu2')
    assert data.pressure[:, 1] == pytest.approx(data.pressure[::-1, 0])


@pytest.mark.parametrize(('name', 'kind', 'why'), [
    ('trial', 'rows', '40 different values in 40 rows: no trials'), ('trial', 'runs', ''),
    ('trial', 'pairs', ''), ('trial', 'same', ''), ('time [s]', 'blank', 'blank'),
    ('state', 'words', 'text'),
    ('contraction [mm]', 'same', 'strain is there'), ('mood', 'same', 'not known')])
def test_a_column_that_is_not_taken_says_why(name, kind, why):
    """What is blank, is text, counts rows, or has another in its place."""
    data = read_measurement(points(**{'pressure [kPa]': 'p', name: kind}))
    entry = next(each for each in data.taken if each.header == name)
    assert entry.why == why
    assert bool(entry.quantity) == (why == '')


def test_a_column_that_is_called_data_has_no_unit_by_that(log):
    """A topic of a number ends in '/data': its pressures here are in psi, by their size."""
    time, strain, pressure, force = log
    read = read_measurement({'time_data': time, 'contraction_data': strain,
                             'pressure_data [psi]': pressure / 6894.757, 'force_data [N]': force})
    assert np.allclose(read.pressure[:, 0], pressure, rtol=1e-5)
    with pytest.raises(InputError, match="'pressure_data' has no unit"):
        read_measurement({'time_data': time, 'contraction_data': strain,
                          'pressure_data': pressure / 6894.757, 'force_data': force})
    with pytest.raises(InputError, match='or what one px is worth'):
        read_measurement({'t [s]': time, 'displacement [px]': 1e3 * strain,
                          'p [kPa]': pressure / 1e3, 'F [N]': force}, rest_length='250 mm')


def test_a_load_cell_on_the_first_channel_is_still_the_one_force(log):
    """What is suggested for its volts is taken as it stands."""
    time, strain, pressure, force = log
    table = {'t [s]': time, 'strain': strain, 'p [kPa]': pressure / 1e3,
             'AI1 load [mV]': (force + 2.0) / 50.0}
    with pytest.raises(InputError, match='what one mV is worth') as error:
        read_measurement(table)
    told = 'AI1 load * 50 N - 2 N'
    assert f'--columns "force={told}"' in str(error.value)
    assert np.allclose(read_measurement(table, columns={'force': told}).force, force)


def test_the_atmosphere_of_a_column_may_be_taken_off(log):
    """A difference of two absolute pressures is gauge; the column of the atmosphere is named."""
    time, strain, pressure, force = log
    table = {'t [s]': time, 'strain': strain, 'p_abs [kPa]': pressure / 1e3 + 81.0,
             'p_atm [kPa]': np.full(len(time), 81.0), 'F [N]': force}
    usual = read_measurement(table)
    assert np.allclose(usual.pressure[:, 0], pressure - 20.325e3)
    told = 'p_abs [kPa] - p_atm [kPa]'
    assert any(f'"pressure={told}"' in note for note in usual.notes)
    read = read_measurement(table, columns={'pressure': told})
    assert np.allclose(read.pressure[:, 0], pressure)
    assert not any('p_atm' in note for note in read.notes)


@pytest.mark.parametrize(('header', 'absolute'), [
    ('Pressure / bar(g)', False), ('Pressure / bar (a)', True), ('p [bar] (abs)', True),
    ('Pressure (bar) (g)', False), ('Druck in bar(rel)', False), ('p_bar(a)', True)])
def test_what_a_pressure_is_relative_to_may_stand_behind_its_unit(log, header, absolute):
    """The (g) of bar(g) is no gram: as ISO writes quantities, and as tables are typed."""
    time, strain, pressure, force = log
    data = read_measurement({'t / s': time, 'contraction / %': 100.0 * strain, 'F / N': force,
                             header: pressure / 1e5 + (1.01325 if absolute else 0.0)})
    assert np.allclose(data.pressure[:, 0], pressure)


@pytest.mark.parametrize('header', ['force (N) x10', 'Force x10 [N]', 'F [N] \u00d7 0.1',
                                    'force (N) *10^-1'])
def test_a_factor_in_a_header_is_asked(log, header):
    """Ten times the force was read: whether 'x10' is of the readings or of N is not known."""
    columns = table(log, force=(header, 10 * log[3]))
    with pytest.raises(InputError, match='in its name: tell what one is worth') as error:
        read_measurement(columns)
    told = re.search('"force=(.*)"', str(error.value))[1]
    assert np.abs(read_measurement(columns, columns={'force': told}).force - log[3]).max() < 1e-9
    assert len(read_measurement(table(log, force=('Force x [N]', log[3])))) == ROWS


@pytest.mark.parametrize('names', [
    [('clock', 't [s]'), ('muscle', 'strain'), ('muscle', 'pressure [kPa]'), ('cell', 'F [N]')],
    [('t', 's'), ('strain', ''), ('pressure', 'kPa'), ('F', 'N')]])
def test_frames_of_several_levels(tmp_path, log, names):
    """Parquet keeps the levels of a frame as the text of a tuple, which was no name."""
    frame = pd.DataFrame(np.stack([log[0], log[1], log[2] / 1e3, log[3]], axis=-1))
    frame.columns = pd.MultiIndex.from_tuples(names)
    frame.to_parquet(tmp_path / 'log.parquet')
    for source in (frame, tmp_path / 'log.parquet'):
        data = read_measurement(source)
        assert np.allclose(data.force, log[3])
        assert np.allclose(data.pressure[:, 0], log[2])
        assert data.time is not None


def test_spelt_units_and_uncertainties(log):
    """'Millibar' with a capital is a unit; a column '\u00b1F' is no second force."""
    columns = table(log, pressure=('Druck in Millibar', log[2] / 100))
    data = read_measurement({**columns, '\u00b1force [N]': 0.1 + 0 * log[0]})
    assert np.allclose(data.pressure[:, 0], log[2])
    assert np.allclose(data.force, log[3])


@pytest.mark.parametrize(('header', 'values'), [
    ('specimen', ['A', 'B']), ('Muscle ID', [1.0, 2.0]), ('motor_unit', [1.0, 2.0]),
    ('Pr\u00fcfling', ['7', '8', '9', '10'])])
def test_rows_of_several_muscles_are_told(log, header, values):
    """Two specimens in one table were diagnosed as one without a word."""
    cells = np.resize(np.array(values, object if isinstance(values[0], str) else float), ROWS)
    note, = read_measurement({**table(log), header: cells}).notes
    assert note.startswith(f"'{header}' is {values[0]:g}, " if isinstance(values[0], float) else
                           f"'{header}' is {values[0]}, ")
    assert 'all rows are read as one muscle' in note
    assert not read_measurement({**table(log), header: np.full(ROWS, values[0], object)}).notes


@pytest.mark.parametrize('name', ['p_amb [kPa]', 'baro [kPa]', 'p_atm [kPa]'])
def test_the_atmosphere_beside_an_absolute_pressure_is_told(log, name):
    """The standard atmosphere was taken off beside a column with that of the day."""
    columns = table(log, pressure=('p_abs [kPa]', log[2] / 1e3 + 96.0))
    columns[name] = np.full(ROWS, 96.0)
    note, = read_measurement(columns).notes
    assert f'"pressure=p_abs [kPa] - {name}"' in note
