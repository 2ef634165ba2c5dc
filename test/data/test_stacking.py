# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Trials that lie side by side or on several sheets, as spreadsheets have them."""

from dataclasses import replace

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.data.formats.stacking import one_below_the_other, unstacked
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.errors import InputError

LEVELS = (100e3, 250e3, 400e3)


@pytest.fixture
def trials(muscle):
    """Return one trial per level: time, strain, pressure, force, SI."""
    time = 0.05 * np.arange(60)
    strain = 0.1 - 0.1 * np.cos(2 * np.pi * time / 3.0)
    return [(time, strain, np.full(60, level), muscle(strain, level)) for level in LEVELS]


def same(data, trials):
    """Raise where a measurement is not these trials, one below the other."""
    _, strain, pressure, force = (np.concatenate(parts) for parts in zip(*trials))
    assert np.allclose(data.strain, strain, atol=1e-6)
    assert np.allclose(data.pressure[:, 0], pressure)
    assert np.allclose(data.force, force, atol=1e-3)


def test_runs_side_by_side_are_trials_one_below_the_other(trials, tmp_path):
    """The same columns again and again, with a blank column between, and one run shorter."""
    trials[1] = tuple(values[:40] for values in trials[1])
    lines = ['Run 1,,,,,Run 2,,,,,Run 3,,,', ',,'.join(3 * ['time [s],strain,p [bar],F [N]'])]
    for k in range(60):
        lines.append(',,'.join(f'{t[k]:.3f},{e[k]:.7f},{p[k] / 1e5:.4f},{f[k]:.4f}'
                               if k < len(t) else ',,,' for t, e, p, f in trials))
    path = tmp_path / 'runs.csv'
    path.write_text('\n'.join(lines) + '\n')
    data = read_measurement(path)
    same(data, trials)
    assert np.bincount(data.trial).tolist() == [60, 40, 60]
    assert '3 trials side by side: read one below the other' in data.notes


@pytest.mark.parametrize('name', ['{} bar', '{}bar', 'F at {} bar [N]', 'p = {} bar',
                                  'Kraft bei {} bar (N)', 'F at p={} bar [N]',
                                  'Force @ {} bar', 'F_{}bar_N'])
def test_a_column_of_force_per_pressure_is_a_static_map(trials, name):
    """The way in which data sheets and papers print isobars."""
    table = {'contraction [%]': 100 * trials[0][1],
             **{name.format(f'{p[0] / 1e5:g}'): f for _, _, p, f in trials}}
    data = read_measurement(table)
    same(data, trials)
    assert data.is_static
    assert len(data.trial_names) == 3


def test_rows_that_are_moved_keep_unit_and_number():
    """A message names the row of the file; the unit is that of the row of units."""
    table = Table('log', 'CSV', {'up': np.arange(3.0), 'down': np.arange(3.0, 6.0)},
                  {'up': 'lbf', 'down': 'lbf'}, np.array([5, 6, 8]))
    whole = table.stacked([{'F': 'up'}, {'F': 'down'}], [np.array([0, 2]), np.array([1])])
    assert whole.columns['F'].tolist() == [0.0, 2.0, 4.0]
    assert whole.rows.tolist() == [5, 8, 6]
    assert whole.units == {'F': 'lbf'}


def test_a_zero_beside_a_word_is_a_reading(tmp_path):
    """A word in the column of another level makes it text; 0 N at free strain is kept."""
    path = tmp_path / 'map.csv'
    path.write_text('strain,1 bar [N],2 bar [N]\n' + ''.join(
        f'{0.02 * k:.2f},{max(60 - 6 * k, 0)},{"broken" if k == 11 else 120 - 6 * k}\n'
        for k in range(12)))
    data = read_measurement(path, drop_bad=True)
    assert data.force[10:12].tolist() == [0.0, 0.0]
    assert (len(data), data.dropped) == (23, {'without a number in force': 1})


@pytest.mark.parametrize('name', ['Run {}: {}', '{1} Run #{0}', 'Trial {} {}'])
def test_runs_that_stand_in_each_name_are_trials(trials, tmp_path, name):
    """As programs for schools export them: 'Run 1: Time (s)', 'Run 1: Force (N)', ..."""
    names = ('Time (s)', 'strain', 'Pressure (kPa)', 'Force (N)')
    path = tmp_path / 'runs.csv'
    path.write_text('\n'.join([
        ','.join(name.format(k, each) for k in (1, 2, 3) for each in names),
        *(','.join(f'{t[k]:.3f},{e[k]:.7f},{p[k] / 1e3:.4f},{f[k]:.4f}' for t, e, p, f in trials)
          for k in range(60))]))
    data = read_measurement(path)
    same(data, trials)
    assert len(data.trial_names) == 3


@pytest.mark.parametrize('ending', ['csv', 'xlsx'])
def test_levels_below_a_merged_head_are_names_not_data(trials, tmp_path, ending):
    """'Force [N]' merged over '1 bar', '2.5 bar', ...: the second row is no row of readings."""
    rows = [['Strain [%]', 'Force [N] at gauge pressure', None, None],
            [None, *(f'{p[0] / 1e5:g} bar' for _, _, p, _ in trials)],
            *([100 * trials[0][1][k], *(f[k] for _, _, _, f in trials)] for k in range(60))]
    path = tmp_path / f'map.{ending}'
    if ending == 'csv':
        path.write_text('\n'.join(','.join('' if cell is None else str(cell) for cell in row)
                                  for row in rows))
    else:
        book = pytest.importorskip('openpyxl').Workbook()
        for row in rows:
            book.active.append(row)
        book.save(path)
    data = read_measurement(path)
    same(data, trials)
    assert len(data) == 180


def test_a_constant_pressure_is_not_that_of_columns_of_several(trials):
    """'1 bar' and '4 bar' are not both at 3 bar: the force is asked for."""
    table = {'contraction [%]': 100 * trials[0][1],
             **{f'{p[0] / 1e5:g} bar': f for _, _, p, f in trials}}
    with pytest.raises(InputError, match="column 'force' is missing"):
        read_measurement(table, columns={'pressure': '300 kPa'})
    data = read_measurement(table, columns={'pressure': '250 kPa', 'force': '2.5 bar [N]'})
    assert np.allclose(data.force, trials[1][3])


def test_a_column_of_force_per_strain_is_a_static_map(muscle):
    """The same the other way round; cells that were not measured are no rows."""
    pressure = np.linspace(50e3, 500e3, 20)
    table = {'p [kPa]': pressure / 1e3}
    for percent in (0, 5, 10, 20):
        table[f'{percent} %'] = muscle(percent / 100, pressure)
    table['20 %'][:8] = np.nan
    data = read_measurement(table)
    assert len(data) == 72
    assert not data.dropped
    assert sorted(set(data.strain.round(4))) == [0.0, 0.05, 0.1, 0.2]
    assert np.allclose(data.force, muscle(data.strain, data.pressure[:, 0]))


@pytest.mark.parametrize('names', [('1 bar', '2.5 bar', '4 bar'),
                                   ('100 kPa', '250 kPa', '400 kPa')])
def test_a_pressure_that_only_the_sheets_tell_is_that_of_their_rows(trials, names, tmp_path):
    """One sheet per isobar, none with a column of pressure."""
    pandas = pytest.importorskip('pandas')
    pytest.importorskip('openpyxl')
    path = tmp_path / 'isobars.xlsx'
    with pandas.ExcelWriter(path) as writer:
        for name, (time, strain, _, force) in zip(names, trials):
            pandas.DataFrame({'t (s)': time, 'strain': strain, 'Kraft (N)': force}).to_excel(
                writer, sheet_name=name, index=False)
    data = read_measurement(path)
    same(data, trials)
    assert data.trial_names == names


@pytest.mark.parametrize(('last', 'taken'), [('p = 4 bar', True), ('', False)])
def test_the_pressures_in_titles_of_sheets_are_those_of_their_rows(trials, last, taken, tmp_path):
    """Where a sheet has none, the first one's is not said to be that of all rows."""
    import openpyxl
    book = openpyxl.Workbook()
    for k, ((t, e, _, f), title) in enumerate(zip(trials, ('p = 1 bar', 'p = 2.5 bar', last))):
        sheet = book.create_sheet(f'Run {k}')
        for row in ([title or 'spare'], ['time [s]', 'strain', 'force [N]'], *zip(t, e, f)):
            sheet.append(list(row))
    book.save(tmp_path / 'runs.xlsx')
    if taken:
        same(read_measurement(tmp_path / 'runs.xlsx'), trials)
    else:
        with pytest.raises(InputError, match='titles tell several'):
            read_measurement(tmp_path / 'runs.xlsx')


@pytest.mark.parametrize('extra', ['F filtered 2 bar', 'temperature at 2 bar'])
def test_levels_in_other_names_change_nothing(trials, extra):
    """A file that has a pressure and a force of its own is read as it is."""
    time, strain, pressure, force = trials[0]
    table = {'time [s]': time, 'strain': strain, 'pressure [kPa]': pressure / 1e3,
             'force [N]': force, '1 bar': 0 * force, extra: 0 * force}
    same(read_measurement(table), trials[:1])


def test_columns_that_are_told_are_those_of_the_file(trials):
    """The second of two runs can be asked for."""
    (time, strain, pressure, force), other = trials[0], trials[2]
    names = ('time [s]', 'strain', 'p [kPa]', 'F [N]')
    table = {**dict(zip(names, (time, strain, pressure / 1e3, force))),
             **{f'{name} (2)': values for name, values in zip(
                 names, (other[0], other[1], other[2] / 1e3, other[3]))}}
    told = {key: f'{name} (2)'
            for key, name in zip(('time', 'strain', 'pressure', 'force'), names)}
    same(read_measurement(table), [trials[0], other])
    same(read_measurement(table, columns=told), [other])


def test_what_is_told_of_the_column_beside_leaves_the_levels_as_they_are(trials):
    """A position with its zero beside one column of force per pressure."""
    table = {'position [mm]': 12.0 + 250.0 * trials[0][1],
             **{f'{p[0] / 1e5:g} bar': f for _, _, p, f in trials}}
    same(read_measurement(table, columns={'contraction': 'position - 12 mm'}, rest_length=0.25),
         trials)


def test_a_pressure_that_was_measured_twice_has_two_columns(trials):
    """Up and down under one name: the second is counted by whoever reads the file."""
    (_, strain, _, force), other = trials[0], trials[2]
    data = read_measurement({'strain': strain, '1 bar': force, '1 bar (2)': force,
                             '4 bar': other[3]})
    same(data, [trials[0], trials[0], other])


@pytest.mark.parametrize('names', [('1 bar',), ('1 bar', '20 psi'), ('1 bar', '5 %')])
def test_one_level_or_levels_of_several_kinds_are_left_as_they_are(names):
    """A map has two levels or more, all of one quantity in one unit."""
    table = Table('a', 'arrays', {'strain': np.arange(3.0), 'pressure': np.arange(3.0), **{
        f'F at {name} [N]': np.arange(3.0) for name in names}}, {})
    assert unstacked(table) is table


def test_columns_that_repeat_without_a_force_are_left_as_they_are():
    """Thermocouples with two columns each are no trials of a muscle."""
    ones = np.ones(20)
    table = Table('log', 'arrays', {'T': ones, 'U': ones, 'T (2)': ones, 'U (2)': ones})
    assert unstacked(table) is table


@pytest.mark.parametrize(('second', 'units'), [
    ('Run 2', {'F': 'lbf'}), ('filtered', {'F': 'N'}), ('1 bar', {'F': 'N'}),
    ('Run 2', {'F': 'N', 'G': 'N'})])
def test_sheets_that_differ_are_no_trials_of_one_kind(second, units):
    """In units, columns, or more than a number in the name; two muscles are no trials either."""
    def sheet(units):
        return Table('log', 'sheet', {header: np.ones(20) for header in units}, units)
    tables = {'Run 1': sheet({'F': 'N'}), second: sheet(units)}
    assert one_below_the_other(tables) is None
    same_columns = [sheet({'F': 'N'}), sheet({'F': 'N'})]
    assert one_below_the_other(dict(zip(('Muscle 1', 'Muscle 2'), same_columns))) is None
    assert one_below_the_other(dict(zip(('Run 1', 'Run 2'), same_columns)))


def test_a_pressure_in_a_column_counts_more_than_the_names_of_sheets(trials):
    """'1 bar' is what was set, the column what was measured."""
    tables = {f'{p[0] / 1e5:g} bar': Table('log', 'sheet', {
        'strain': e, 'p [bar]': p / 1e5 + 0.03, 'F [N]': f}) for _, e, p, f in trials}
    whole = one_below_the_other(tables)
    assert list(whole.columns) == ['strain', 'p [bar]', 'F [N]', 'trial']
    assert np.allclose(read_measurement(whole).pressure[:, 0], np.repeat(LEVELS, 60) + 3e3)


@pytest.mark.parametrize(('names', 'units'), [
    (('time', 'force'), {}), (('time', 'strain'), {}),
    (('strain', 'force'), {'force': 'N', 'force (2)': 'lbf'})])
def test_blocks_that_are_no_trials_stay_side_by_side(names, units):
    """Without a force, without a strain, or in other units from block to block."""
    columns = {f'{name}{again}': np.arange(12.0) for again in ('', ' (2)') for name in names}
    given = Table('log.csv', 'CSV', columns, units, np.arange(12))
    assert unstacked(given) is given
    whole = {f'{name}{again}': np.arange(12.0) for again in ('', ' (2)')
             for name in ('strain', 'force')}
    assert len(unstacked(replace(given, columns=whole, units={})).rows) == 24


SERIES = ('1 bar,,2.5 bar,,4 bar,', 'p=100 kPa,,p=250 kPa,,p=400 kPa,',
          '"0,1 MPa";;"0,25 MPa";;"0,4 MPa";')


@pytest.mark.parametrize('series', SERIES)
@pytest.mark.parametrize('names', [('Contraction [%]', 'Force [N]'), ('X', 'Y')])
def test_pairs_of_columns_have_the_pressure_above_them(trials, tmp_path, series, names):
    """As programs that digitise figures write them: curves of different numbers of points."""
    trials = [tuple(values[:60 - 9 * k] for values in trial) for k, trial in enumerate(trials)]
    sign = ';' if ';' in series else ','
    rows = [[cell for _, e, _, f in trials for cell in (
        (f'{100 * e[k]:.5f}', f'{f[k]:.5f}') if k < len(e) else ('', ''))] for k in range(60)]
    path = tmp_path / 'figure.csv'
    path.write_text('\n'.join([series, sign.join(3 * names), *map(sign.join, rows)]) + '\n')
    told = {'contraction': 'X [%]', 'force': 'Y [N]'} if names[0] == 'X' else {}
    data = read_measurement(path, columns=told)
    same(data, trials)
    assert np.bincount(data.trial).tolist() == [60, 51, 42]
    assert ('3 trials side by side: read one below the other, each at the pressure above it'
            in data.notes)
    one = read_measurement(path, columns={**told, 'pressure': '3 bar'})
    assert np.unique(one.pressure).tolist() == [300e3]


@pytest.mark.parametrize('above', ['Supply 6 bar', '1 bar,,2 bar,,300 kPa,', '1 bar,,2 bar,,,,',
                                   '5 %,,10 %,,15 %,'])
def test_a_line_that_has_not_one_pressure_for_each_pair_tells_none(trials, tmp_path, above):
    """A setting, two units, a gap and strains."""
    path = tmp_path / 'figure.csv'
    path.write_text('\n'.join([above, ','.join(3 * ['Contraction [%],Force [N]']), *(
        ','.join(f'{100 * e[k]:.5f},{f[k]:.5f}' for _, e, _, f in trials) for k in range(60))]))
    with pytest.raises(InputError, match="column 'pressure' is missing"):
        read_measurement(path)


@pytest.mark.parametrize(('name', 'level'), [
    ('{:g} mm', lambda e: 250 * (1 - e)), ('F at L={:g} mm [N]', lambda e: 250 * (1 - e)),
    ('{:g} mm', lambda e: 250 * e), ('\u03b5 = {:g}', lambda e: e), ('eps = {:g}', lambda e: e)])
def test_a_column_of_force_per_length_is_a_static_map(muscle, name, level):
    """As lengths, as contractions from zero on, and as ratios without a unit."""
    strains, pressure = np.array([0.0, 0.08, 0.16]), np.linspace(50e3, 400e3, 20)
    data = read_measurement({'p [bar]': pressure / 1e5, **{
        name.format(level(e)): muscle(e, pressure) for e in strains}}, rest_length='250 mm')
    assert np.allclose(data.strain, np.repeat(strains, 20))
    assert np.allclose(data.force, np.concatenate([muscle(e, pressure) for e in strains]))


def test_a_column_beside_levels_may_be_known_by_its_unit_alone(trials):
    """'dL / mm' beside a force at each pressure."""
    table = {'dL / mm': 250.0 * trials[0][1],
             **{f'F(N) at {p[0] / 1e5:g} bar': f for _, _, p, f in trials}}
    same(read_measurement(table, rest_length='250 mm'), trials)


@pytest.mark.parametrize('name', ['{:g} bar', 'p = {:g} bar', '{:g}bar_up'])
def test_the_names_of_trials_may_tell_the_pressure(trials, name):
    """A tidy table with a name for each series; what the user tells counts more."""
    _, strain, pressure, force = (np.concatenate(parts) for parts in zip(*trials))
    table = {'series': np.array([name.format(p / 1e5) for p in pressure], object),
             'x': 100.0 * strain, 'y': force}
    told = {'contraction': 'x [%]', 'force': 'y [N]'}
    data = read_measurement(table, columns=told)
    same(data, trials)
    assert "pressure as the names in 'series' tell" in data.notes
    one = read_measurement(table, columns={**told, 'pressure': '2 bar'})
    assert np.unique(one.pressure).tolist() == [200e3]
    table['series'] = np.where(pressure > 3e5, 'last', table['series'])
    with pytest.raises(InputError, match="'pressure' is missing"):
        read_measurement(table, columns=told)


@pytest.mark.parametrize('name', ['{:g} bar', '{:g}bar', 'p = {:g} bar'])
def test_the_names_of_trials_in_a_csv_may_tell_the_pressure(trials, tmp_path, name):
    """A name that is a number with a unit is read as such; it is the pressure all the same."""
    path = tmp_path / 'tidy.csv'
    path.write_text('\n'.join(['strain,force [N],series', *(
        f'{e:.7f},{f:.4f},{name.format(p / 1e5)}'
        for trial in trials for e, p, f in zip(*trial[1:]))]) + '\n')
    data = read_measurement(path)
    same(data, trials)
    assert len(data.trial_names) == 3
