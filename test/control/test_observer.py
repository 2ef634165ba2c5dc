# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The observer of the force that the model leaves out."""

import pytest

from fam_bundle_ros.control.observer import begin_at, hand_over, ObserverState


@pytest.mark.parametrize(('corrected', 'error', 'jump', 'left'), [
    (-9.0, 0.0, -9.0, 0.0),    # the model is late: all of it was corrected already
    (-4.0, 0.0, -9.0, 0.0),    # some of it was
    (0.0, 0.0, -9.0, 0.0),     # in time: there is nothing to hand over
    (0.0, 9.0, -9.0, 0.0),     # early: the force still has to jump
    (3.0, 3.0, -9.0, 3.0),     # what the model lacks besides stays
    (-6.0, 3.0, -9.0, 0.0),    # no more than was corrected
])
def test_what_the_model_explains_late_is_handed_over(corrected, error, jump, left):
    """When friction that feedback has made up for is believed at last, it is not there twice."""
    state = ObserverState()
    begin_at(state, corrected)
    share = hand_over(state, error, jump)
    assert state.quick == pytest.approx(left)
    assert share * jump == pytest.approx(corrected - left)
