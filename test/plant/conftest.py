# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""A bundle for the rigs of these tests."""

import math

import pytest

from fam_bundle_ros.model import Bundle, Geometry, MotorUnit
from fam_bundle_ros.model.catalogue import get


@pytest.fixture(scope='session')
def bundle():
    """Return two motor units of one muscle each, not read from a shipped file."""
    geometry = Geometry(6.35e-3, 0.127, math.radians(33.0), 1.59e-3)
    return Bundle('paper', [MotorUnit(f'mu{k}', 1, geometry, 344.7e3) for k in (1, 2)],
                  [get(name)() for name in ('mesh', 'bladder_elasticity', 'resistive_buckling')])
