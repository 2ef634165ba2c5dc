# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Held-out folds: whole trials, isobars or strain levels left out in turn.

Neighbouring samples are alike, so a fold is a block of what was measured together; a random
split would test nothing. The splitter stands apart from the estimator, as in scikit-learn and
verde:

    folds = Folds('isobar')
    for train, test in folds.split(data):
        ...
    residual = held_out(estimator, data, folds)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fam_bundle_ros.data.grouping import merge, pressure_levels, strain_bins, varying_unit
from fam_bundle_ros.data.measurement import Measurement
from fam_bundle_ros.errors import InputError

#: Kinds of folds in the order in which they are to be preferred, and what one of them is called.
KINDS = {'trial': 'trials', 'isobar': 'isobars', 'strain': 'inner strain levels'}
#: A strain level is inner where others are on either side: interpolation, as users do.
_STRAIN_BINS = 8


class Estimator(Protocol):
    """What `held_out` fits: as in scikit-learn, but on a `Measurement`."""

    def fit(self, data: Measurement) -> Any:
        """Return the fitted estimator."""

    def predict(self, data: Measurement) -> np.ndarray:
        """Return the force, (T,), N."""


@dataclass(frozen=True)
class Folds:
    """
    Splitter of a measurement into rows to train on and rows to test on.

    Parameters
    ----------
    by : str
        'trial': whole trials; 'isobar': whole pressure levels; 'strain': inner strain levels,
        never the lowest or the highest.
    most : int
        Largest number of folds; neighbouring groups are taken together, balanced by number.
    """

    by: str = 'trial'
    most: int = 8

    def __post_init__(self) -> None:
        if self.by not in KINDS:
            raise InputError(f"folds by '{self.by}'; expected one of {', '.join(KINDS)}")
        if self.most < 2:
            raise InputError(f'at most {self.most} folds; expected at least 2')

    def labels(self, data: Measurement) -> np.ndarray:
        """Return the fold that each row is left out in, (T,) int, -1 for never."""
        if self.by == 'trial':
            return merge(data.trial, self.most)
        if self.by == 'isobar':
            level, _ = pressure_levels(data.pressure[:, varying_unit(data)])
            return merge(level, self.most)
        # a map has strain levels, a log is cut into as many bins
        level, means = pressure_levels(data.strain, 60)
        if len(means) > 30 or np.ptp(data.strain) < 1e-4:
            level, _ = strain_bins(data.strain, _STRAIN_BINS)
        inner = (level > 0) & (level < level.max())
        label = np.full(len(data), -1)
        if inner.any():
            label[inner] = merge(level[inner], self.most)
        return label

    def n_splits(self, data: Measurement) -> int:
        """Return how many folds the data offer."""
        return int(self.labels(data).max()) + 1

    def split(self, data: Measurement) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """
        Yield rows to train on and rows to test on, index arrays.

        Raises
        ------
        InputError
            Where the data offer fewer than two folds.
        """
        label = self.labels(data)
        if label.max() < 1:
            raise InputError(f'{data.name}: fewer than two {KINDS[self.by]} to leave out in turn; '
                             f'expected folds by one of {", ".join(offered(data)) or "none"}')
        for k in range(label.max() + 1):
            yield np.flatnonzero(label != k), np.flatnonzero(label == k)


def offered(data: Measurement, least: int = 2) -> list[str]:
    """Return the kinds of folds of which the data offer at least so many, best first."""
    return [by for by in KINDS if Folds(by).n_splits(data) >= least]


def held_out(estimator: Estimator, data: Measurement, folds: Folds) -> np.ndarray:
    """
    Return measured minus predicted force of rows that the fit did not see, (T,), N.

    nan for rows that are never left out (outer strain levels).
    """
    residual = np.full(len(data), np.nan)
    for train, test in folds.split(data):
        fitted = estimator.fit(data.select(train))
        unseen = data.select(test)
        residual[test] = unseen.force - fitted.predict(unseen)
    return residual
