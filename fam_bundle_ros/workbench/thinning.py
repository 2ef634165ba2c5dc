# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Fewer points for drawing (not for fitting); extremes are kept."""

import numpy as np


def thin(values: np.ndarray, most: int) -> np.ndarray:
    """
    Return sorted indices of at most ``most`` (4 or more) points of a series, shape (T,).

    The first point, the last one and the extremes of each interval are kept.
    """
    count = len(values)
    if count <= most:
        return np.arange(count)
    stretches = max((most - 2) // 2, 1)
    edges = np.linspace(0, count, stretches + 1).astype(int)
    starts = edges[:-1]
    # the extremes of each stretch, on a rectangle padded with the stretch's last index
    width = int(np.diff(edges).max())
    at = np.minimum(starts[:, None] + np.arange(width), edges[1:, None] - 1)
    block = values[at]
    rows = np.arange(stretches)
    lowest, highest = at[rows, block.argmin(1)], at[rows, block.argmax(1)]
    return np.unique(np.r_[0, lowest, highest, count - 1])


def thin_groups(group: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
    """
    Return indices of about ``most`` points, each group with its share and its extremes.

    Parameters
    ----------
    group : ndarray of int, shape (T,)
        Number of the group, such as an isobar, of each point.
    values : ndarray, shape (T,)

    Returns
    -------
    ndarray of int
        Group after group, in the order of the rows within each.
    """
    order = np.argsort(group, kind='stable')
    names, starts = np.unique(group[order], return_index=True)
    share = max(most // max(len(names), 1), 4)
    pieces = np.split(order, starts[1:])
    return np.concatenate([piece[thin(values[piece], share)] for piece in pieces])
