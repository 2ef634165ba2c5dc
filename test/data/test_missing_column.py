# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What a message says where a column is missing: what was found, and what to tell."""

import numpy as np
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError

from .test_columns import ROWS, table


def test_what_is_missing_lists_every_column(log):
    """The message has each column, what it was taken for or why not, and what to write."""
    data = {**table(log, force=('Kanal 3', log[3])), 'note': np.full(ROWS, 'x', object)}
    with pytest.raises(InputError) as caught:
        read_measurement(data, name='log.csv')
    message = str(caught.value)
    assert message.startswith("log.csv: column 'force' is missing")
    for words in ("'time [s]' time", "'strain' strain", "'pressure [kPa]' pressure",
                  "'Kanal 3' not known (", "'note' text", '--columns "force=Kanal 3 [N]"'):
        assert words in message
    assert '\n' not in message


@pytest.mark.parametrize(('key', 'header', 'told'), [
    ('force', 'Mass [kg]', '--columns "force=Mass [kg]"'),
    ('force', 'force [V]', '--columns "force=... [N]"'),
    ('pressure', 'pressure setpoint [bar]', '--columns "pressure=pressure setpoint [bar]"'),
    ('strain', 'Stauchung [\u2030]', '--columns "strain=Stauchung [\u2030]"')])
def test_an_example_keeps_the_unit_of_the_column(log, key, header, told):
    """What a message says to write would read kg as kg; volts are never an example of N."""
    with pytest.raises(InputError) as caught:
        read_measurement(table(log, **{key: (header, log[0])}))
    assert told in str(caught.value)


@pytest.mark.parametrize(('header', 'size', 'told'), [
    ('engineering strain', -1.0, 'elongation=engineering strain'),
    ('engineering strain', 1.0, 'strain=engineering strain'),
    ('elongation at constant pressure [mm]', -250.0,
     'elongation=elongation at constant pressure [mm]')])
def test_an_example_of_a_strain_has_its_sign_and_size(log, header, size, told):
    """One that is never positive is an elongation; what is below 1 is no percentage."""
    data = table(log, strain=(header, size * log[1]))
    with pytest.raises(InputError) as caught:
        read_measurement(data)
    assert f'--columns "{told}"' in str(caught.value)
    read = read_measurement(data, columns=dict([told.split('=')]), rest_length=0.25)
    assert np.allclose(read.strain, log[1])


@pytest.mark.parametrize('header', ['column 4', 'zero offset', 'force raw'])
def test_no_column_of_another_quantity_is_an_example(log, header):
    """One that is too large for a strain, one that is ruled out, and one that may be a force."""
    data = table(log, strain=(header, (5.0 if header == 'column 4' else 0.1) * log[3]))
    with pytest.raises(InputError, match=r'--columns "strain=\.\.\. \[%\]"'):
        read_measurement(data)


@pytest.mark.parametrize(('key', 'header', 'told'), [
    ('pressure', 'pressure [N]', 'pressure=pressure [kPa]'),
    ('pressure', 'p mu1 [furlong]', 'pressure.mu1=p mu1 [kPa]'),
    ('strain', 'contraction [N]', 'contraction=contraction [mm]')])
def test_a_unit_of_another_quantity_is_told_with_how_to_give_the_right_one(log, key, header, told):
    """The column is there: it is not called missing, and what the message says to write works."""
    data = table(log, **{key: (header, log[2] / 1e3 if key == 'pressure' else 250.0 * log[1])})
    with pytest.raises(InputError) as caught:
        read_measurement(data)
    message = str(caught.value)
    unit = header.split()[-1].strip('[]')
    assert f"column '{header}': '{unit}' is not a unit of {key}" in message
    assert f'--columns "{told}"' in message
    assert 'is missing' not in message
    assert '300 kPa' not in message
    quantity, column = told.split('=')
    read = read_measurement(data, columns={quantity: column}, rest_length=0.25)
    assert np.allclose(read.strain, log[1])
    assert np.allclose(read.pressure[:, 0], log[2])


def test_an_example_of_two_pressures_names_the_motor_units(log):
    """Columns of unknown names in kPa may be one pressure or those of a bundle: both are shown."""
    data = {**table(log, pressure=('MU_A [kPa]', log[2] / 1e3)), 'MU_B [kPa]': log[2] / 2e3}
    with pytest.raises(InputError, match=r'--columns "pressure=MU_A \[kPa\]", or of motor units '
                       r'--columns "pressure.mu1=MU_A \[kPa\]" --columns "pressure.mu2=MU_B'):
        read_measurement(data)


@pytest.mark.parametrize(('key', 'header'), [
    ('pressure', 'Stress [MPa]'), ('pressure', 'vacuum [kPa]'), ('force', 'Preload [N]')])
def test_another_quantity_is_not_taken_for_its_unit(log, key, header):
    """A stress has the unit of a pressure and is none: what is missing is asked for."""
    with pytest.raises(InputError, match=f"column '{key}' is missing"):
        read_measurement(table(log, **{key: (header, log[0])}))


@pytest.mark.parametrize('header', ['Date', 'Datum'])
def test_a_date_with_the_time_of_day_is_the_clock(log, header):
    """The day alone is not: a map may be measured over several."""
    dates = np.datetime64('2026-01-01T08:00') + (1e3 * log[0]).astype('timedelta64[ms]')
    for dated in (dates, dates.astype(str).astype(object)):
        data = read_measurement(table(log, time=(header, dated)))
        np.testing.assert_allclose(data.time, log[0] - log[0][0], atol=1e-3)
    days = np.array([f'2026-01-{1 + k % 28:02d}' for k in range(len(dates))], object)
    assert read_measurement(table(log, time=(header, days))).is_static
    same = np.full(len(dates), '2026-01-01 08:00:00', object)
    assert read_measurement(table(log, time=(header, same))).is_static


def test_a_log_without_a_known_clock_says_which_column_may_be_one(log, tmp_path):
    """It is read as a static map; a column that rises evenly is named, a count of rows as that,
    dates, and a sample rate above the table.
    """
    data = read_measurement(table(log, time=('Name', np.round(1e3 * log[0]))))
    assert data.is_static
    assert any('"time=Name [ms]"' in note for note in data.notes)
    data = read_measurement(table(log, time=('Scan', np.arange(ROWS))))
    assert any('"time=100 Hz"' in note for note in data.notes)
    dates = np.datetime64('2026-01-01T08:00') + (1e3 * log[0]).astype('timedelta64[ms]')
    for dated in (dates, dates.astype(str).astype(object)):
        data = read_measurement(table(log, time=('Entry', dated)))
        assert any('"time=Entry"' in note for note in data.notes)
    path = tmp_path / 'log.csv'
    path.write_text('Sample rate: 20 Hz\nstrain,pressure [kPa],force [N]\n' + '\n'.join(
        f'{e:.5f},{p / 1e3:.2f},{f:.3f}' for _, e, p, f in zip(*log)))
    assert any("'Sample rate: 20 Hz'" in note for note in read_measurement(path).notes)
    silent = read_measurement(table(log, time=('Name', np.round(1e3 * log[0]))),
                              columns={'time': 'none'})
    assert not any('clock' in note for note in silent.notes)


def test_a_message_offers_the_column_that_is_most_like_what_is_missing(log):
    """The example is not simply the first unused column."""
    with pytest.raises(InputError) as caught:
        read_measurement(table(log, force=('MAIN.load_1', log[3]), time=('counter', log[0])))
    assert 'for example --columns "force=MAIN.load_1 [N]"' in str(caught.value)


@pytest.mark.parametrize(('name', 'told'), [
    ('isometric_L237.5mm.csv', 'length=237.5 mm'), ('eps_5%.csv', 'strain=5 %'),
    ('contraction 12.5 mm.csv', 'contraction=12.5 mm'), ('muscle_20mm.csv', 'length=285 mm')])
def test_a_strain_in_the_name_of_a_file_is_offered(log, tmp_path, name, told):
    """Of an isometric test, whose table has no strain; a number of something else is not taken."""
    path = tmp_path / name
    path.write_text('t [s],p [kPa],F [N]\n' + ''.join(
        f'{t:.2f},{p / 1e3:.2f},{f:.3f}\n' for t, _, p, f in zip(*log)))
    with pytest.raises(InputError, match=f'--columns "{told}"') as caught:
        read_measurement(path)
    assert ('in the name of the file' in str(caught.value)) == ('muscle' not in name)
    if 'muscle' not in name:
        read = read_measurement(path, columns=dict([told.split('=')]), rest_length='250 mm')
        assert np.allclose(read.strain, 0.05)


def test_numbers_in_place_of_names_are_told(log, tmp_path):
    """A table of a thesis whose pressures have their unit in the caption."""
    path = tmp_path / 'table.txt'
    path.write_text('Force in N by pressure (kPa)\ndL [mm]\t100\t200\t300\n' + ''.join(
        f'{k}\t{900 - k}\t{1900 - k}\t{2900 - k}\n' for k in range(20)))
    with pytest.raises(InputError, match="stands 'dL .mm. 100 200 300': .*'100 kPa' in place of"):
        read_measurement(path)
    path.write_text(path.read_text().replace('100\t200\t300', '100 kPa\t200 kPa\t300 kPa'))
    assert len(read_measurement(path, rest_length='250 mm')) == 60


def test_numbers_above_trials_side_by_side_are_no_pressure_of_all(tmp_path):
    """Curves of a figure at 1 to 3 bar, without the word: a constant would be wrong for two."""
    path = tmp_path / 'figure.csv'
    path.write_text('1,,2,,3,\n' + ','.join(['strain,force (N)'] * 3) + '\n'
                    + ''.join(f'{x},{90 - x},' * 3 + '\n' for x in range(9)))
    with pytest.raises(InputError, match="stands '1 2 3': .* '2 kPa' in place of '2'$"):
        read_measurement(path)
