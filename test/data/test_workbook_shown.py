# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What Excel shows and a cell does not hold: percents, units in number formats, formulas."""

import numpy as np
import openpyxl
import pytest

from fam_bundle_ros.data import read_measurement
from fam_bundle_ros.errors import InputError


def workbook(path, heads, columns, formats=(), formula=''):
    """Write a workbook of columns, with a number format each, and a column of formulas."""
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append([*heads, 'Force [N]'] if formula else heads)
    for at, row in enumerate(zip(*columns), 2):
        sheet.append([*map(float, row), formula.format(at)] if formula else [*map(float, row)])
        for column, form in enumerate(formats, 1):
            sheet.cell(at, column).number_format = form
    book.save(path)
    return path


def test_units_in_number_formats(tmp_path, log):
    """A format that shows lbf behind each number is a unit; so is the % of a column in %."""
    time, strain, pressure, force = log
    data = read_measurement(workbook(
        tmp_path / 'log.xlsx', ['Time', 'Contraction [%]', 'Pressure', 'Force'],
        (time, strain, pressure / 6894.757, force / 4.4482216),
        ('0.000" s"', '0.0%', '0.0" psi"', '0.00\\ "lbf"')))
    assert np.abs(data.strain - strain).max() < 1e-9
    assert np.abs(data.pressure[:, 0] - pressure).max() < 1.0
    assert np.abs(data.force - force).max() < 1e-3


def test_percents_that_are_numbers_stay(tmp_path, log):
    """A column in % that holds 20 for 20 % is not a ratio, whatever its format."""
    time, strain, pressure, force = log
    data = read_measurement(workbook(
        tmp_path / 'log.xlsx', ['Time [s]', 'Contraction [%]', 'Pressure [kPa]', 'Force [N]'],
        (time, 100 * strain, pressure / 1e3, force), ('0.00', '0.0%', '0.0', '0.0')))
    assert np.abs(data.strain - strain).max() < 1e-9


def test_formulas_without_values_are_named(tmp_path, log):
    """The message names the column of formulas whose values were not saved."""
    time, strain, pressure, force = log
    path = workbook(tmp_path / 'log.xlsx', ['Time [s]', 'Strain', 'Pressure [kPa]', 'Raw [V]'],
                    (time, strain, pressure / 1e3, force / 50), formula='=D{}*50')
    with pytest.raises(InputError, match=r"'Force \[N\]' of sheet Sheet, which has no values"):
        read_measurement(path)
