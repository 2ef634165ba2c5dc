# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Detect readings that a sensor lost and the logger filled in: with the last value, or a constant.

They are reported and not removed: a diagnosis could explain them as an effect.
"""

from collections.abc import Mapping
import math

import numpy as np

from fam_bundle_ros.data.rates import BY_CHANCE, FALSE_ALARM, REST_PRESSURE

#: Where a smooth force turns, readings in the last step of a converter over those in the step
#: before: sqrt(1) to sqrt(2) - sqrt(1).
_TURN = 1.0 / (math.sqrt(2.0) - 1.0)
#: Readings that differ by less, as a share of their range, are equal but for the last digits.
_EQUAL = 1e-9
#: Range of the strain of a muscle that is held, and moves by a weak frame or noise.
_HELD = 0.01


def dropped_out(values: np.ndarray, others: Mapping[str, np.ndarray], within: np.ndarray,
                ) -> np.ndarray:
    """
    Return the rows, (T,) bool, with a value that a channel jumps to and returns from.

    Each of these jumps is larger than all other steps of the channel, by more than its readings
    are rounded to, while the steps of the other channels are usual ones: when a muscle is vented,
    its force falls as well. All channels are (T,); ``within`` (T - 1,) are the steps between rows
    of one trial.

    Examples
    --------
    >>> dropped_out(np.array([8.0, 9.0, 0.0, 0.0, 9.0, 8.0]), {'strain': np.arange(6.0)},
    ...             np.ones(5, bool)).nonzero()[0].tolist()
    [2, 3]
    """
    step = np.where(within, np.abs(np.diff(values)), 0.0)
    largest = int(np.argmax(step))
    apart = np.diff(np.unique(values))
    rounding = apart[apart > _EQUAL * np.ptp(values)].min(initial=np.inf)

    def jumps(code: float) -> np.ndarray:
        """Return the steps to or from a value, (T - 1,) bool."""
        held = values == code
        return within & (held[1:] != held[:-1])

    def moves_too(channel: np.ndarray, jump: np.ndarray) -> bool:
        """Return whether a channel's steps at the jumps are larger than those of chosen rows."""
        moved, drawn = np.abs(np.diff(channel)), np.arange(jump.sum())
        larger = (moved[within] >= moved[jump].min()).sum()
        chance = np.prod((larger - drawn) / (within.sum() - drawn))
        # in a short log only the largest steps of all can tell
        return bool(chance <= BY_CHANCE or larger == len(drawn))

    # either end of the largest step, that with the larger jumps first
    for code in sorted((values[largest], values[largest + 1]),
                       key=lambda code: -float(step[jumps(code)].min(initial=np.inf))):
        held, jump = values == code, jumps(code)
        rest = within & ~jump
        beside = np.where(held[1:], values[:-1], values[1:])[jump]
        passes = beside.min(initial=np.inf) < code < beside.max(initial=-np.inf)
        if (not passes and 1 < held.sum() < 0.5 * len(held) and jump.sum() > 1 and rest.any()
                and step[jump].min() > step[rest].max() + rounding
                and not any(moves_too(each, jump) for each in others.values())):
            return held
    return np.zeros(len(values), bool)


def constant_force(force: np.ndarray, strain: np.ndarray, pressure: np.ndarray,
                   within: np.ndarray) -> slice | None:
    """
    Return the rows in which the force is constant while the muscle moves, or None.

    The muscle moves in the faster half of the steps of the log, and in those of a stretch over
    which its strain changes. The share of equal forces in steps as fast elsewhere gives the
    probability of such a stretch: with a coarse converter it is high. A whole trial at one force
    is not reported, which is a weight, nor is a vented muscle, which is slack.

    The pressure (T,), Pa, is of all motor units together, ``within`` as for `dropped_out`.
    """
    moved = np.where(within, np.abs(np.diff(strain)), 0.0)
    filled = within & (pressure[1:] > REST_PRESSURE * pressure.max())
    same = within & (np.diff(force) == 0)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    begin, end = edge[::2], edge[1::2]
    inside = np.concatenate([[False], within, [False]])
    part_of_trial = inside[begin] | inside[end + 1]
    begin, end = begin[part_of_trial], end[part_of_trial]
    if not len(begin):
        return None
    pieces = np.array([begin, end + 1]).T.ravel()
    travel = (np.maximum.reduceat(np.append(strain, -np.inf), pieces)
              - np.minimum.reduceat(np.append(strain, np.inf), pieces))[::2]

    def longest(fast: np.ndarray) -> int:
        count = np.concatenate([[0], np.cumsum(fast & same)])
        return int(np.argmax(count[end] - count[begin]))

    def by_chance(stretch: slice, fast: np.ndarray) -> bool:
        elsewhere = fast & (force[1:] != force[stretch.start])
        # Laplace's rule of succession
        share = ((elsewhere & same).sum() + 1) / (elsewhere.sum() + 2)
        number = int(fast[stretch.start:stretch.stop - 1].sum())
        return bool(max(fast.sum(), 1) * share ** number >= FALSE_ALARM)

    usual = filled & (moved > np.median(moved[within]))
    at = longest(usual)
    stretch = slice(int(begin[at]), int(end[at]) + 1)
    if not by_chance(stretch, usual):
        return stretch
    begin, end = begin[travel > _HELD], end[travel > _HELD]
    if not len(begin):
        return None
    at = longest(filled)
    stretch = slice(int(begin[at]), int(end[at]) + 1)
    own = moved[stretch.start:stretch.stop - 1]
    alike = filled & (moved > np.median(own)) & (moved <= own.max())
    return None if by_chance(stretch, alike) else stretch


def clipped(force: np.ndarray, strain: np.ndarray, within: np.ndarray) -> np.ndarray:
    """
    Return the rows, (T,) bool, in which the force is at the end of the range of its sensor.

    It is the same largest force at several visits and several strains, in more rows than any other
    force is, by three standard deviations of the count at a turn of the force: of a coarse
    converter, or of levels that are held, all forces repeat. A force in most rows is held.
    ``within`` is as for `dropped_out`.

    Examples
    --------
    >>> strain, force = np.arange(20) % 10 / 50, 90.0 - np.arange(20) % 10 - np.arange(20) / 99
    >>> within = np.ones(19, bool)
    >>> [clipped(np.minimum(force, most), strain, within).sum().tolist() for most in (85, 99)]
    [10, 0]
    """
    at = force == force[np.argmax(np.abs(force))]
    visits = 0.5 * (within & (at[1:] != at[:-1])).sum()  # without a whole trial: a weight
    between = (force > force.min()) & (force < force.max())  # a slack muscle may show one force
    often = np.unique(force[between], return_counts=True)[1].max(initial=1)
    moved = np.ptp(strain[at]) > _HELD
    held = 2 * at.sum() > len(at)
    usual = _TURN * often
    found = visits > 1 and moved and not held and at.sum() > usual + 3.0 * math.sqrt(usual)
    return at if found else np.zeros_like(at)


def what_was_lost(strain: np.ndarray, pressure: Mapping[str, np.ndarray], force: np.ndarray,
                  trial: np.ndarray, rows: np.ndarray) -> list[str]:
    """
    Return notes on readings of a log that its sensors have probably lost.

    All are (T,), SI; pressures by the name of their channel. ``rows`` are those of the file.
    """
    within = np.diff(trial) == 0
    channels = {'strain': strain, 'force': force, **pressure}
    notes = []
    for label, values in channels.items():
        held = dropped_out(values, {key: each for key, each in channels.items() if key != label},
                           within)
        if held.any():
            at = int(np.argmax(held))
            notes.append(f'{label} jumps to {_shown(label, values[at])} and back in '
                         f'{int(held.sum())} rows (first row {rows[at]}) while the other '
                         'channels continue: lost readings? They are used')
    still = constant_force(force, strain, np.sum([*pressure.values()], axis=0), within)
    ends = clipped(force, strain, within)
    if ends.any():
        notes.append(f'the force is exactly {force[ends][0]:.6g} N, its largest, in '
                     f'{int(ends.sum())} rows (first row {rows[np.argmax(ends)]}): is its sensor '
                     'out of range?')
    if still is not None and not ends[still.start]:
        notes.append(f'the force is constant at {force[still.start]:.4g} N from row '
                     f'{rows[still.start]} to {rows[still.stop - 1]} while the muscle moves: is '
                     'its sensor stuck, or out of range?')
    return notes


def _shown(label: str, value: float) -> str:
    return (f'{value:.4g}' if label == 'strain' else f'{value:.4g} N' if label == 'force' else
            f'{value / 1e3:.4g} kPa')
