# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Which simple shapes of the error that is left are shown."""

from types import SimpleNamespace

import numpy as np

from fam_bundle_ros.discovery.templates import Template
from fam_bundle_ros.report import shapes


def shape(explained, size_N):
    """Return a shape with a share and a size."""
    return Template('constant', 1.0, 'N', explained, 1.0, (), None, 'smooth0', size_N)


def diagnosis(verdict, *left, noise=1.0):
    """Return a diagnosis with shapes, of forces up to 100 N with a noise of 1 N."""
    return SimpleNamespace(verdict=verdict, shapes_left=left, noise=SimpleNamespace(value=noise),
                           measurement=SimpleNamespace(force=np.array([-100.0, 50.0])))


def test_a_shape_that_explains_nothing_is_not_shown():
    """A share that is printed as 0 %, or a force below half the noise of a row."""
    clear, no_share, in_noise = shape(0.3, 2.0), shape(0.004, 2.0), shape(1.0, 0.4)
    assert shapes.visible(diagnosis('partial', clear, no_share, in_noise)) == [clear]


def test_a_shape_of_no_size_is_not_shown_where_there_is_no_noise():
    """A force that is held, such as a weight: what is left of it is rounding."""
    clear, rounding = shape(0.3, 0.5), shape(1.0, 0.0016)
    assert shapes.visible(diagnosis('partial', clear, rounding, noise=0.0)) == [clear]


def test_no_shape_is_shown_where_nothing_is_left():
    """A model that is adequate leaves noise."""
    assert shapes.visible(diagnosis('adequate', shape(0.3, 2.0))) == []
