# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""What is said of a measurement beside the answer."""

import numpy as np
import pytest

from fam_bundle_ros.data.measurement import build
from fam_bundle_ros.discovery.words import ascends

TIME = np.arange(0.0, 20.0, 0.1)
STRAIN = 0.1 + 0.1 * np.sin(TIME)


def log(*isobars):
    """Return a log of some isobars, Pa, one after the other."""
    count = len(isobars)
    trial = np.repeat(np.arange(count), len(TIME))
    return build('log', np.tile(STRAIN, count), np.repeat(isobars, len(TIME))[:, None],
                 np.tile(50.0 - 100.0 * STRAIN, count), trial,
                 np.tile(TIME, count) + 30.0 * trial)


@pytest.mark.parametrize(('isobars', 'told'), [
    ((1e5, 2e5, 3e5, 4e5), True),
    ((1e5, 3e5, 2e5, 4e5), False),
    ((1e5, 2e5), False),
])
def test_isobars_that_only_rise_are_told_of(isobars, told):
    """Then pressure and time go together; two isobars are no order."""
    assert ascends(log(*isobars)) == told


def test_a_trial_that_was_taken_out_breaks_no_order():
    """Rows of one isobar left out, as a held-out test does: the others rise still."""
    data = log(1e5, 2e5, 3e5, 4e5)
    assert ascends(data.select(data.trial != 1))
    assert not ascends(data.select(data.trial < 2))
