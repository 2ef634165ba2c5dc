# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressures that are asked for by themselves."""

import math

import numpy as np
import pytest

from fam_bundle_ros.control import Measurement, Reference
from fam_bundle_ros.control.direct import DirectPressures
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model import load_model
from fam_bundle_ros.resources import config_path

ASKED = Reference('pressure', pressure=(100e3, 40e3))
GOOD = Measurement(10.0, 0.1, 0.0, np.array([0.0, 0.0]))
BAD = Measurement(math.nan, 0.1, 0.0, np.array([0.0, 0.0]))


@pytest.fixture
def direct():
    """Return the pass-through of the paper's bundle, with a hold of 0.2 s."""
    return DirectPressures(load_model(config_path('models/spie2021.yaml')), hold_time=0.2)


def test_what_is_asked_goes_out_as_it_is(direct):
    """From a vented start at once; the state is how many units are on."""
    command = direct.update(5e-3, GOOD, ASKED)
    assert command.pressure.tolist() == [100e3, 40e3]
    assert (command.state, command.active.tolist()) == (2, [True, True])


def test_lost_readings_hold_then_vent_then_come_back(direct):
    """0.2 s of nan keep the pressures, then none is asked for; a reading brings them back."""
    direct.update(5e-3, GOOD, ASKED)
    other = Reference('pressure', pressure=(200e3, 40e3))
    assert direct.update(0.1, BAD, other).pressure[0] == 100e3
    assert direct.update(0.15, BAD, other).pressure.tolist() == [0.0, 0.0]
    assert direct.update(5e-3, GOOD, other).pressure[0] == 200e3


def test_limits_are_the_model_s_and_rounding_is_not_held_against_them(direct):
    """50 psi are 344.74 kPa; the model says 344.7 kPa. 350 kPa and less than nothing do not go."""
    rounded = Reference('pressure', pressure=(344738.0, 0.0))
    assert direct.update(5e-3, GOOD, rounded).pressure[0] == pytest.approx(344.7e3)
    for pressure, words in (((350e3, 0.0), 'mu1 is 350 kPa; expected 0 to 344.7 kPa'),
                            ((0.0, -1e3), 'mu2 is -1 kPa'), ((math.nan, 0.0), 'mu1 is nan'),
                            ((1e3,), '1 pressures; expected 2')):
        with pytest.raises(InputError, match=words):
            direct.update(5e-3, GOOD, Reference('pressure', pressure=pressure))
    with pytest.raises(InputError, match="kind is 'force'; expected pressure"):
        direct.update(5e-3, GOOD, Reference('force', 30.0))
