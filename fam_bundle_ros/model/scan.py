# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Recurrences over time, vectorised: the memory of friction, relaxation and line lag.

Each step of a recurrence is a map, and the composition of two such maps is again one of the same
form. So a long record is split into blocks of about sqrt(T) samples that are computed in
parallel: cost linear in T, exact for any sampling, also for one control tick (T = 1).
"""

import numpy as np


def affine_scan(start, gain, offset):
    """
    Return y with y[k] = gain[k] y[k-1] + offset[k] and y[-1] = start.

    Parameters
    ----------
    start : array, shape (...)
    gain, offset : array, shape (T, ...)

    Returns
    -------
    array, shape (T, ...)

    Examples
    --------
    >>> affine_scan(0.0, np.full(3, 0.5), np.ones(3))
    array([1.  , 1.5 , 1.75])
    """
    gain, offset = np.broadcast_arrays(gain, offset)
    if len(offset) == 1:
        return np.where(gain == 0.0, 0.0, gain * start) + offset
    gains, offsets = _blocks(gain, 1.0), _blocks(offset, 0.0)
    for k in range(1, len(gains)):
        # a reset (gain 0) clears the memory, even if it is nan
        offsets[k] += np.where(gains[k] == 0.0, 0.0, gains[k] * offsets[k - 1])
        gains[k] *= gains[k - 1]
    forgets = gains == 0.0
    carry = np.empty_like(offsets[0])
    value = start
    for block in range(len(carry)):
        carry[block] = value
        value = np.where(forgets[-1, block], 0.0, gains[-1, block] * value) + offsets[-1, block]
    return _record(np.where(forgets, 0.0, gains * carry) + offsets, len(offset))


def clamp_scan(start, lower, upper):
    """
    Return y with y[k] = clip(y[k-1], lower[k], upper[k]) and y[-1] = start: a play operator.

    Shapes as in `affine_scan`. Where ``lower`` equals ``upper`` the value is set (a reset).

    Examples
    --------
    >>> clamp_scan(0.0, np.array([1., -1., -1.]), np.array([2., 3., 0.5]))
    array([1. , 1. , 0.5])
    """
    lower, upper = np.broadcast_arrays(lower, upper)
    if len(lower) == 1:
        return np.minimum(np.maximum(start, lower), upper)
    lowers, uppers = _blocks(lower, -np.inf), _blocks(upper, np.inf)
    for k in range(1, len(lowers)):
        low, high = lowers[k].copy(), uppers[k].copy()
        lowers[k] = np.minimum(np.maximum(lowers[k - 1], low), high)
        uppers[k] = np.minimum(np.maximum(uppers[k - 1], low), high)
    carry = np.empty_like(lowers[0])
    value = start
    for block in range(len(carry)):
        carry[block] = value
        value = np.minimum(np.maximum(value, lowers[-1, block]), uppers[-1, block])
    return _record(np.minimum(np.maximum(carry, lowers), uppers), len(lower))


def before_scan(start, signal):
    """Return y with y[k] = signal[k-1] and y[0] = start; the signal itself if it is constant."""
    signal = np.asarray(signal, float)
    if not signal.ndim:
        return signal
    return np.concatenate([[start], signal[:-1]])


def _blocks(values, identity):
    """Return a copy as (samples in a block, blocks, ...), padded with the identity map."""
    length = len(values)
    size = max(int(np.sqrt(length)), 1)
    count = -(-length // size)
    padded = np.full((count * size,) + values.shape[1:], identity, dtype=float)
    padded[:length] = values
    return np.ascontiguousarray(padded.reshape((count, size) + values.shape[1:]).swapaxes(0, 1))


def _record(blocks, length):
    """Undo `_blocks`."""
    return blocks.swapaxes(0, 1).reshape((-1,) + blocks.shape[2:])[:length]
