# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units at the edges: what needs no pint says the same as pint."""

import subprocess
import sys

import pytest

from fam_bundle_ros import units
from fam_bundle_ros.errors import InputError

COMMON = [name for name in units._COMMON if name not in ('', '1', '%', 'deg')]


@pytest.mark.parametrize('text', [
    *COMMON, 'N*s/m', 'kPa*s/g', '1/s', 'N/kPa', 'N*mm', 'kg/m/m/m', 'm/s*kg'])
def test_common_units_are_those_of_pint(text):
    """Size and dimension of a product of common units agree with pint's registry."""
    factor, powers = units._common(text)
    quantity = units.registry().Quantity(1.0, text).to_base_units()
    assert factor == pytest.approx(quantity.magnitude, rel=1e-14)
    names = ('[length]', '[mass]', '[time]')
    assert powers == tuple(quantity.dimensionality.get(name, 0) for name in names)


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
