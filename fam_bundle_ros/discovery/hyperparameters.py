# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Search of the hyperparameters of highest evidence on their grid, by coordinate ascent."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fam_bundle_ros.discovery.covariance import GRID, Hyper

#: Log units below which two places on the grid count as equal.
_EQUAL = 1e-3
#: Most grid places of an amplitude per place of a length: 2^(5/2) in quarter decades.
_RIDGE = 3
#: Step from an amplitude of zero: the first places on the grid hardly change the evidence.
_LEAP = 4

#: Log evidence of hyperparameters.
Value = Callable[[Hyper], float]


def ascend(h: Hyper, value: Value, axes: Sequence[str], reach: int = 99) -> Hyper:
    """
    Return the hyperparameters of the highest value near h.

    Parameters
    ----------
    h : Hyper
        Start.
    value : callable
    axes : sequence of str
        Hyperparameters that may move.
    reach : int
        Most places on the grid by which each may move.
    """
    first = h
    for _ in range(6):
        before = h
        for axis in axes:
            if axis in ('strain', 'pressure') and not h.fits_a_table:
                continue
            if axis == 'tau' and not h.slow:
                continue
            for step in (-1, 1, *((_LEAP,) if not getattr(h, axis) else ())):
                while True:
                    place = getattr(h, axis) + step
                    if not 0 <= place < getattr(GRID, axis) or (
                            abs(place - getattr(first, axis)) > reach):
                        break
                    q = h._replace(**{axis: place})
                    if value(q) <= value(h) + _EQUAL:
                        break
                    h = q
        if h == before:
            break
    return h


def along_ridge(h: Hyper, value: Value, reach: int = 99) -> Hyper:
    """
    Return the hyperparameters of the highest value with another length, or h itself.

    For a Matern 5/2 covariance the data determine only amplitude / length^(5/2) (Zhang 2004,
    J. Am. Stat. Assoc. 99, 250), so coordinate ascent stops on this ridge: move both at once.
    Twice the length means 5.7 times the amplitude, three places of a quarter decade, or
    fewer where the other length stays. Parameters as in `ascend`.
    """
    parts = [part for part in ('even', 'odd', 'speed') if getattr(h, part)]
    moved = [parts] if len(parts) < 2 else [parts, *([part] for part in parts)]
    places = [h._replace(**{axis: getattr(h, axis) + step},
                         **{part: getattr(h, part) - step * more for part in some})
              for axis in ('strain', 'pressure') for step in (-1, 1)
              for more in range(1, min(_RIDGE, reach) + 1) for some in moved if some]
    places = [h, *(q for q in places if all(0 <= place < size for place, size in zip(q, GRID)))]
    values = [value(q) for q in places]
    # the first of equal places, so that the choice does not depend on rounding
    return next(q for q, each in zip(places, values) if each >= max(values) - _EQUAL)
