# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Simple shapes of the error that the best model leaves: which are shown, and in which words."""

import numpy as np

from fam_bundle_ros.discovery import settings
from fam_bundle_ros.discovery.result import Diagnosis
from fam_bundle_ros.discovery.templates import Template
from fam_bundle_ros.report.numbers import shown

#: Least share that is not printed as 0 %.
_LEAST = 0.005
#: Share of the largest force below which a shape is rounding; data of a weight have no noise.
_ROUNDING = 1e-3
#: To what the shares refer.
SHARE = 'of the mean square error that the best model leaves'


def visible(result: Diagnosis) -> list[Template]:
    """
    Return the shapes of a diagnosis to be shown.

    Without those whose share is 0 %, and those below half the noise of a row or a thousandth of
    the largest force; none for a verdict that leaves no error.
    """
    if result.verdict not in ('unexplained', 'partial'):
        return []
    least = max(settings.VISIBLE * result.noise.value,
                _ROUNDING * float(np.abs(result.measurement.force).max()))
    return [shape for shape in result.shapes_left
            if shape.explained >= _LEAST and shape.size_N >= least]


def described(shape: Template) -> str:
    """
    Return a shape in words, with its share in %.

    Examples
    --------
    >>> described(Template('constant', 1300.0, 'N', 0.41, 9.0, (), None, 'smooth0', 8.6))
    'constant: 8.6 N rms (k = 1300 N), 41 %'
    """
    k = f'{shown(shape.coefficient)} {shape.unit}'.rstrip()
    return (f'{shape.words}: {shown(shape.size_N)} N rms (k = {k}), '
            f'{100 * shape.explained:.0f} %')
