# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Readings that a sensor lost and the logger wrote all the same: the last one again, or a zero.

They are said and not left out: a diagnosis would name effects for them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

#: So rarely does a stretch stand still by chance, per log, that it is spoken of.
_CHANCE = 1e-6
#: The share of a channel's steps that are usual ones.
_USUAL = 0.9


def dropped_out(values: np.ndarray, others: Mapping[str, np.ndarray], within: np.ndarray,
                ) -> np.ndarray:
    """
    Return the rows, (T,) bool, that hold one number which a channel jumps to and comes back from.

    All these jumps are larger than each other step of the channel, while the steps of the other
    channels are usual ones: a muscle that is vented loses its force.

    Parameters
    ----------
    values : ndarray, shape (T,)
    others : dict of str to ndarray, shape (T,)
        The other channels.
    within : ndarray of bool, shape (T - 1,)
        Steps between rows of one trial.

    Examples
    --------
    >>> dropped_out(np.array([8.0, 9.0, 0.0, 0.0, 9.0, 8.0]), {'strain': np.arange(6.0)},
    ...             np.ones(5, bool)).nonzero()[0].tolist()
    [2, 3]
    """
    step = np.where(within, np.abs(np.diff(values)), 0.0)
    at = int(np.argmax(step))
    for code in (values[at], values[at + 1]):
        held = values == code
        jump = within & (held[1:] != held[:-1])
        other, beside = within & ~jump, np.where(held[1:], values[:-1], values[1:])[jump]
        if not (beside > code).all() and not (beside < code).all():
            continue  # it passes there
        if 1 < held.sum() < 0.5 * len(held) and jump.sum() > 1 and other.any() and (
                step[jump].min() > step[other].max()) and all(
                    np.median((moved := np.abs(np.diff(each)))[jump]) <= np.quantile(
                        moved[other], _USUAL) for each in others.values()):
            return held
    return np.zeros(len(values), bool)


def stood_still(force: np.ndarray, strain: np.ndarray, within: np.ndarray) -> slice | None:
    """
    Return the rows in which the force stands still while the muscle moves; None for none.

    Moving are the faster half of the steps. How often two forces of such a step are equal at
    other forces says whether it is chance: a coarse converter repeats itself all the time. A
    whole trial at one force is a weight.

    Parameters
    ----------
    force, strain : ndarray, shape (T,)
    within : ndarray of bool, shape (T - 1,)
        Steps between rows of one trial.
    """
    moved = np.where(within, np.abs(np.diff(strain)), 0.0)
    fast = within & (moved > np.median(moved[within])) if within.any() else within
    same = within & (np.diff(force) == 0)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    begin, end = edge[::2], edge[1::2]
    inside = np.concatenate([[False], within, [False]])
    part = inside[begin] | inside[end + 1]
    begin, end = begin[part], end[part]
    if not len(begin):
        return None
    count = np.concatenate([[0], np.cumsum(fast & same)])
    lengths = count[end] - count[begin]
    at = int(np.argmax(lengths))
    elsewhere = fast & (force[1:] != force[begin[at]])
    share = ((elsewhere & same).sum() + 1) / (elsewhere.sum() + 2)
    if max(fast.sum(), 1) * share ** int(lengths[at]) >= _CHANCE:
        return None
    return slice(int(begin[at]), int(end[at]) + 1)


def what_was_lost(strain: np.ndarray, pressure: Mapping[str, np.ndarray], force: np.ndarray,
                  trial: np.ndarray, rows: np.ndarray) -> list[str]:
    """Return in words which readings of a log, SI units, its sensors may have lost."""
    within = np.diff(trial) == 0
    channels = {'strain': strain, 'force': force, **pressure}
    notes = []
    for label, values in channels.items():
        held = dropped_out(values, {key: each for key, each in channels.items() if key != label},
                           within)
        if held.any():
            at = int(np.argmax(held))
            notes.append(f'{label} jumps to {_shown(label, values[at])} and back in '
                         f'{int(held.sum())} rows (first row {rows[at]}) while the others run '
                         'on: lost readings? They are used')
    still = stood_still(force, strain, within)
    if still is not None:
        notes.append(f'the force stands still at {force[still.start]:.4g} N from row '
                     f'{rows[still.start]} to {rows[still.stop - 1]} while the muscle moves: is '
                     'its sensor stuck, or beyond its range?')
    return notes


def _shown(label: str, value: float) -> str:
    return (f'{value:.4g}' if label == 'strain' else f'{value:.4g} N' if label == 'force' else
            f'{value / 1e3:.4g} kPa')
