# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Held-out folds: whole trials, isobars or strain levels left out in turn.

Neighbouring samples are alike, so a fold is a block of what was measured together; a random
split would test nothing.
"""

import numpy as np

from fam_bundle_ros.data.grouping import merge, pressure_levels, strain_bins, varying_unit
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import InputError

#: Kinds of folds in order of preference, and what their groups are called.
KINDS = {'trial': 'trials', 'isobar': 'isobars', 'strain': 'inner strain levels'}
#: Strain bins of a log; only bins with others on both sides are held out (interpolation).
_STRAIN_BINS = 8


def fold_labels(data: Measurement, by: str, most: int = 8) -> np.ndarray:
    """
    Return the fold that each row is left out in, (T,) int, -1 for never.

    Parameters
    ----------
    by : str
        'trial': whole trials; 'isobar': whole pressure levels; 'strain': inner strain levels,
        never the lowest or the highest.
    most : int
        Largest number of folds; neighbouring groups are taken together, balanced by number.

    Raises
    ------
    InputError
        For another kind of folds.
    """
    if by not in KINDS:
        raise InputError(f"folds by '{by}'; expected one of {', '.join(KINDS)}")
    if by == 'trial':
        return merge(data.trial, most)
    if by == 'isobar':
        level, _ = pressure_levels(data.pressure[:, varying_unit(data)])
        return merge(level, most)
    # a map has strain levels; the strains of a log are binned
    level, means = pressure_levels(data.strain, 60)
    if len(means) > 30 or np.ptp(data.strain) < 1e-4:
        level, _ = strain_bins(data.strain, _STRAIN_BINS)
    inner = (level > 0) & (level < level.max())
    label = np.full(len(data), -1)
    if inner.any():
        label[inner] = merge(level[inner], most)
    return label
