# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The two recurrences that carry memory, against a plain loop."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
from numpy.testing import assert_allclose

from fam_bundle_ros.model.scan import affine_scan, clamp_scan

numbers = st.floats(-2.0, 2.0, width=32)
records = st.integers(1, 60).flatmap(lambda n: arrays(float, (2, n, 2), elements=numbers))


@given(records, st.integers(1, 59))
def test_affine_scan_is_the_loop_and_can_be_cut_anywhere(record, cut):
    """y[k] = a y[k-1] + b, in one call or in two with the state handed over."""
    gain, offset = 0.5 * record
    value, expected = np.array([0.3, -1.0]), []
    for a, b in zip(gain, offset, strict=True):
        value = a * value + b
        expected.append(value)
    start = np.array([0.3, -1.0])
    whole = affine_scan(start, gain, offset)
    assert_allclose(whole, expected, atol=1e-12)
    if cut < len(gain):
        rest = affine_scan(whole[cut - 1], gain[cut:], offset[cut:])
        assert_allclose(rest, whole[cut:], atol=1e-12)


def test_a_reset_forgets_what_is_not_a_number():
    """One bad row of a trial does not reach the next one, in a long record or step by step."""
    whole = np.ones(40)
    for reset in range(1, 40):
        gain = np.where(np.arange(40) == reset, 0.0, 0.5)
        offset = np.where(np.arange(40) == max(reset - 17, 0), np.nan, whole)
        result = affine_scan(0.0, gain, offset)
        assert np.all(np.isnan(result[max(reset - 17, 0):reset]))
        assert_allclose(result[reset:], affine_scan(np.nan, gain[reset:], whole[reset:]))
        assert_allclose(result[reset:], 2.0 - 0.5 ** np.arange(40 - reset))


@given(records)
def test_clamp_scan_is_the_loop(record):
    """y[k] = clip(y[k-1], lower, upper): a play operator, exactly."""
    lower, upper = np.minimum(*record), np.maximum(*record)
    value, expected = np.zeros(2), []
    for low, high in zip(lower, upper, strict=True):
        value = np.clip(value, low, high)
        expected.append(value)
    assert np.array_equal(clamp_scan(np.zeros(2), lower, upper), expected)
