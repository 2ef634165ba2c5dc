# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units at the edges: what needs no pint says the same as pint does."""

import subprocess
import sys

import pytest

from fam_bundle_ros import units
from fam_bundle_ros.errors import InputError


@pytest.mark.parametrize('text', [
    '1', 'm', 'mm', 's', '1/s', 'N', 'N*m', 'Pa', 'kPa', 'MPa', 'N/kPa', 'N*s/m', 'kPa*s/g',
    'N*mm', 'kg/m^3', 'psi', 'inch', 'bar'])
def test_the_size_of_a_unit_is_that_of_pint(text):
    """Whether pint is asked or not, a unit is as large as pint's registry says."""
    quantity = units.registry().Quantity(1.0, 'dimensionless' if text == '1' else text)
    assert units.si_factor(text, text) == pytest.approx(
        quantity.to_base_units().magnitude, rel=1e-14)


@pytest.mark.parametrize(('text', 'like', 'value'), [
    ('33 deg', 'deg', 0.5759586531581288), ('5 %', '1', 0.05), ('0.5', '1', 0.5),
    ('50 psi', 'kPa', 344737.864658), ('2 inch', 'mm', 0.0508), ('3 kPa', 'psi', 3000.0),
    ('300 N*s/m', 'N*s/m', 300.0)])
def test_quantities_come_out_in_si(text, like, value):
    """Angles are radians, percent are shares, and pint knows the units that are less common."""
    assert units.parse(text, like) == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize(('text', 'like', 'words'), [
    ('3 mm', 'kPa', "'mm' does not fit"), ('3 N/', 'N', "'N/' is not known"),
    ('3', 'kPa', 'has no unit'), ('3', 'deg', 'has no unit'), ('3 furlongg', 'm', 'not known')])
def test_a_unit_that_does_not_fit_is_refused(text, like, words):
    """Whether pint looks or not, a unit of another dimension or of none is one clear error."""
    with pytest.raises(InputError, match=words):
        units.parse(text, like)


def test_a_model_that_ships_loads_without_pint():
    """A node must be up fast: pint takes longer than the node itself."""
    code = ('import sys; from fam_bundle_ros.model import load_model; '
            'from fam_bundle_ros.resources import config_path; '
            'load_model(config_path("models/spie2021_damped.yaml")); print("pint" in sys.modules)')
    run = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == 'False'
