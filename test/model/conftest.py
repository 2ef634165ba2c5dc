# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's muscle, written out in numbers and not read from a shipped file."""

import numpy as np
import pytest

from fam_bundle_ros.model import Bundle, Geometry, loads_model, MotorUnit
from fam_bundle_ros.model.laws.bladder import bladder_elasticity
from fam_bundle_ros.model.laws.mesh import mesh
from fam_bundle_ros.model.laws.resistive import resistive_buckling

#: Beginning of a model file, up to its effects.
HEAD = """\
format: fam-bundle-model/1
motor_units:
  - geometry: {radius: 6.35 mm, length: 127 mm, braid_angle: 33 deg, wall_thickness: 1.59 mm}
effects:
"""
PAPER = Geometry(6.35e-3, 0.127, np.radians(33.0), 1.59e-3)


def effect_from(text):
    """Return the effect of a formula as a model file has it."""
    return loads_model(f'{HEAD}  - {text}').effects[0]


def units(count, max_pressure=344.7e3):
    """Return motor units of one muscle each."""
    return [MotorUnit(f'mu{i + 1}', 1, PAPER, max_pressure) for i in range(count)]


@pytest.fixture
def muscle():
    """One muscle of the paper: mesh and bladder."""
    return Bundle('muscle', units(1, 413.7e3), [mesh(), bladder_elasticity()])


@pytest.fixture
def paper_bundle():
    """Two muscles of the paper, resistive forces included."""
    return Bundle('paper', units(2), [mesh(), bladder_elasticity(), resistive_buckling()])
