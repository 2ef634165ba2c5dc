# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What cells of a column are: numbers, clocks, dates, labels, and what stands for no reading."""

from datetime import datetime, timedelta
import re

import numpy as np
import pytest

from fam_bundle_ros.data.cells import (
    _day_first,
    blank,
    labels,
    looks_like_time,
    no_reading,
    numbers,
    seconds,
)
from fam_bundle_ros.data.formats.stamps import oldest_first, with_stamps
from fam_bundle_ros.data.formats.table import Table
from fam_bundle_ros.data.formats.text import labelled
from fam_bundle_ros.errors import InputError

START = datetime(2026, 5, 3, 23, 59, 50)
#: s after the start, over midnight.
AFTER = (0.0, 7.25, 9.5, 12.0, 75.125)


def read(cells):
    """Return a column of text as seconds."""
    return seconds('log.csv', 'clock', np.array(cells, object), np.arange(10, 10 + len(cells)))


def written(form, digits=3, mark='.'):
    """Return the times in a form of `strftime`, with so many digits of a second."""
    moments = [START + timedelta(seconds=after) for after in AFTER]
    return [re.sub('FRACTION', mark + f'{moment.microsecond:06d}'[:digits],
                   moment.strftime(form)) for moment in moments]


@pytest.mark.parametrize('cells', [
    written('%Y-%m-%dT%H:%M:%SFRACTION'), written('%Y-%m-%d %H:%M:%SFRACTIONZ'),
    written('%d.%m.%Y %H:%M:%SFRACTION', mark=','), written('%m/%d/%Y %I:%M:%SFRACTION %p'),
    written('%d %b %Y %H:%M:%SFRACTION'), written('%Y/%m/%d %H:%M:%SFRACTION', mark=':'),
    written('%H:%M:%SFRACTION'), written('%H:%M:%SFRACTION', mark=','),
    written('%H:%M:%SFRACTION', mark=':'), written('%I:%M:%SFRACTION %p')])
def test_dates_and_times_of_day_are_seconds_also_over_midnight(cells):
    """In the forms that loggers write; from the first date, or from midnight on a clock."""
    found = read(cells)
    assert found - found[0] == pytest.approx(AFTER)
    if len(cells[0]) < 16:
        assert found[0] == pytest.approx(86390.0)


def test_a_clock_that_is_put_back_at_the_end_of_summer_time_runs_on():
    """From 2:59:59 at two hours before UTC to 2:00:00 at one hour it is a second."""
    found = read(['2026-10-25T02:59:59+02:00', '2026-10-25T02:00:00+01:00',
                  '2026-10-25T02:00:01+01:00'])
    assert found - found[0] == pytest.approx([0.0, 1.0, 2.0])


@pytest.mark.parametrize(('cell', 'value'), [
    ('0 days 00:00:01.5', 1.5), ('2 days, 01:02:03', 176523.0), ('1 day 00:00:00', 86400.0),
    ('05:07', 307.0), ('75:30.5', 4530.5), ('12:00:01 AM', 1.0), ('12:00:01 PM', 43201.0),
    ('1:00:00 pm', 46800.0), ('11:59:59 am', 43199.0)])
def test_a_clock_is_its_days_hours_minutes_and_seconds(cell, value):
    """12 AM is hour zero, 12 PM is noon."""
    assert read([cell])[0] == pytest.approx(value)
    assert looks_like_time(np.array(['', cell], object))


def test_blank_cells_have_no_time_and_a_word_is_refused_with_its_row():
    """Other cells keep their times."""
    found = read(['00:00:01', '', '00:00:03', None])
    assert found[[0, 2]].tolist() == [1.0, 3.0]
    assert np.isnan(found[[1, 3]]).all()
    with pytest.raises(InputError, match="log.csv, row 12: clock is 'soon'; expected a number"):
        read(['00:00:01', '', 'soon'])
    assert blank(None)
    assert blank(np.nan)
    assert not blank('0')


def test_times_of_numpy_are_seconds_from_the_first():
    """Dates are seconds from the first date; durations are kept."""
    dates = np.array(['NaT', '2026-05-03T12:00:00', '2026-05-03T12:00:02.5'], 'datetime64[ms]')
    found = seconds('log', 'clock', dates, np.arange(3))
    assert np.isnan(found[0])
    assert found[1:].tolist() == [0.0, 2.5]
    assert looks_like_time(dates)
    spans = np.array([1500, 2500], 'timedelta64[ms]')
    assert seconds('log', 'clock', spans, np.arange(2)).tolist() == [1.5, 2.5]
    assert not looks_like_time(np.array([1.0]))


@pytest.mark.parametrize(('cells', 'day_first'), [
    (['3.5.26', '4.5.26'], True), (['13/5/26'], True), (['5/13/26'], False),
    (['3/5/26', '4/5/26'], True), (['5/3/26', '5/4/26'], False), (['2026-'], False)])
def test_the_day_is_the_number_that_is_above_twelve_or_changes(cells, day_first):
    """In dates with dots the day is the first number."""
    assert _day_first(cells) == day_first


def test_numbers_are_read_with_thousands_and_exponents_of_fortran():
    """Words are distinguished from blanks."""
    values, words = numbers(np.array(['1,234.5', '1.5D+02', '-2', '', 'n/a', 'high', 3.5], object))
    assert values[[0, 1, 2, 6]].tolist() == [1234.5, 150.0, -2.0, 3.5]
    assert np.isnan(values[3:6]).all()
    assert words[5]
    assert not words[[0, 1, 2, 3, 6]].any()


@pytest.mark.parametrize(('values', 'code'), [
    ([-999.0, 20.0, 35.0, -999.0], -999.0), ([20.0, 9999.0, 35.0, 9999.0, 30.0], 9999.0),
    ([20.0, -99.99, 35.0, -99.99], -99.99), ([20.0, 35.0, -999.0], -999.0),
    ([20.0, 200.0, -999.0], None),  # once, and not so far
    ([-999.0, -998.0, -500.0, -999.0], None),  # near others
    ([-99.0, 20.0, 35.0, -99.0], None), ([-989.0, 20.0, 35.0, -989.0], None),
    ([-999.0, -999.0], None), ([-999.0, 20.0, 20.0, -999.0], None), ([], None),
    ([1.0, 9.9e37, 2.0], 9.9e37), ([1.0, 9.91e37], 9.91e37), ([np.nan, np.nan], None),
    ([999.0, 20.0, 500.0, 999.0, 90.0], 999.0), ([999.0, 20.0, 600.0, 999.0], None),
    ([0.1, 0.2, 99.9, 99.9] * 9, None),  # on and off
    ([0.1, 0.2, 0.3, 99.9] * 9, 99.9), ([0.1, 0.2, -999.0, -999.0] * 9, -999.0)])
def test_nines_that_stand_apart_are_no_reading(values, code):
    """
    A code is farther from the readings than they are from each other; one alone ten times.

    A positive number in half of the rows is a level.
    """
    assert no_reading(np.array(values)) == code


def test_rows_with_a_name_beside_each_value_are_called_as_the_lines_of_the_file():
    """A message about one leads to it in an editor, which counts from 1."""
    lines = ['boot ok', *(f'p:{k}.5bar F:{k}' for k in range(3)), 'reset', 'p:9.5bar F:9']
    table = labelled('log', lines)
    assert table.rows.tolist() == [2, 3, 4, 6]
    assert table.notes == (
        "1 line between the rows without a value for each of p, F, not read (the first is line 5: "
        "'reset')",)
    assert not labelled('log', lines[:4]).notes  # what stands above the rows is no lost reading


def test_a_blank_label_is_of_the_trial_above_it():
    """Whole numbers are written without a point, dates as they are."""
    assert labels(np.array(['a ', '', None, 'b', np.nan], object)).tolist() == [
        'a', 'a', 'a', 'b', 'b']
    assert labels(np.array([np.nan, 2.0, np.nan])).tolist() == ['', '2', '2']
    assert labels(np.array(['2026-05-03'], 'datetime64[D]')).tolist() == ['2026-05-03']


def table(**columns):
    """Return a table of columns; two underscores stand for a blank."""
    columns = {name.replace('__', ' '): np.asarray(each) for name, each in columns.items()}
    count = len(next(iter(columns.values())))
    return Table('log.csv', 'CSV', columns, {}, np.arange(count))


@pytest.mark.parametrize(('names', 'worth'), [
    (('stamp.sec', 'stamp.nanosec'), 1e-9), (('header_secs', 'header_nsecs'), 1e-9),
    (('tv_sec', 'tv_usec'), 1e-6), (('t seconds', 't microseconds'), 1e-6),
    (('column 1', 'column 2'), 1e-9)])
def test_seconds_and_their_fraction_are_one_clock(names, worth):
    """Its origin and the other columns are unchanged."""
    whole = 1.7e9 + np.repeat([0.0, 1.0, 2.0], 4)
    part = np.round(np.tile([0.0, 0.25, 0.5, 0.75], 3) / worth)
    found = with_stamps(table(**{names[0]: whole, names[1]: part, 'force': np.arange(12.0)}))
    clock = next(column for name, column in found.columns.items() if found.units.get(name) == 's')
    assert clock - 1.7e9 == pytest.approx(0.25 * np.arange(12), abs=1e-6)
    assert found.columns['force'].tolist() == list(range(12))
    assert len(found.columns) == 3


def test_columns_that_are_no_fraction_stay_as_they_are():
    """Columns of other names, or without names and with values that are not of a clock."""
    whole = 1.7e9 + np.arange(4.0)
    for names, part in ((('stamp.sec', 'force'), np.arange(4.0)),
                        (('column 1', 'column 2'), np.arange(4.0)),
                        (('column 1', 'column 2'), 1e8 + 0.5 + np.arange(4.0))):
        given = table(**{names[0]: whole, names[1]: part})
        assert with_stamps(given) is given


def test_milliseconds_beside_a_time_of_day_belong_to_it():
    """Only if the time has whole seconds."""
    day = np.array(['10:00:00', '10:00:00', '10:00:01'], object)
    part = np.array([0.0, 500.0, 250.0])
    found = with_stamps(table(Time=day, ms=part))
    assert next(iter(found.columns.values())) - 36000.0 == pytest.approx([0.0, 0.5, 1.25])
    finer = table(Time=np.array(['10:00:00.1', '10:00:00.2', '10:00:01.0'], object), ms=part)
    assert with_stamps(finer) is finer
    assert with_stamps(given := table(Time=day, ms=2.0 * part + 1.0)) is given


def test_a_log_whose_newest_row_is_first_is_turned_round():
    """All columns are reversed, with a note; a table in order, or a short one, is unchanged."""
    clock, force = np.arange(60.0), np.arange(60.0) ** 2
    found = oldest_first(table(time=clock[::-1], force=force))
    assert found.columns['time'].tolist() == clock.tolist()
    assert found.columns['force'].tolist() == force[::-1].tolist()
    assert found.rows.tolist() == list(range(60))[::-1]
    assert "by 'time'" in found.notes[-1]
    for given in (table(time=clock, force=force), table(time=clock[:49][::-1], force=force[:49]),
                  table(time=0.0 * clock, force=force), table(force=force[::-1], strain=clock)):
        assert oldest_first(given) is given
