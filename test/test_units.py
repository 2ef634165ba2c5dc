# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Units that are known without pint, which takes long to load."""

import subprocess
import sys

import pytest

from fam_bundle_ros import units


@pytest.mark.parametrize('unit', units._KNOWN)
def test_a_known_unit_is_what_pint_says(unit):
    """Its SI value is pint's, and two units share a dimension only where they do there."""
    def base(name):
        return units.registry().Quantity(1.0, units._SPELLINGS.get(name, name)).to_base_units()

    assert units.si_factor(unit, unit) == pytest.approx(base(unit).magnitude, rel=1e-12)
    for other, (_, dimension) in units._KNOWN.items():
        if dimension == units._KNOWN[unit][1]:
            assert base(other).dimensionality == base(unit).dimensionality
        elif 'deg' not in (unit, other):
            assert base(other).dimensionality != base(unit).dimensionality


def test_a_shipped_model_loads_without_pint_and_numba(repository):
    """A node is up sooner: neither is imported before it is needed."""
    code = ('import sys; from fam_bundle_ros.model import load_model; '
            f'b = load_model({str(repository / "config/models/spie2021.yaml")!r}); '
            'b.force(0.1, [1e5] * b.n); b.step(b.start_state(), 0.1, 0.1, [1e5] * b.n); '
            'b.model(compiled=False); sys.exit("pint" in sys.modules or "numba" in sys.modules)')
    done = subprocess.run([sys.executable, '-c', code], cwd=repository, check=False)
    assert done.returncode == 0
