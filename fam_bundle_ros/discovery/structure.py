# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""Is there a structure in a residual? A smooth surface, judged on blocks it has not seen."""

import numpy as np

from fam_bundle_ros.data.grouping import blocks
from fam_bundle_ros.discovery.fit import Fit, Problem


def surface_share(problem: Problem, fit: Fit) -> float:
    """
    Return how much of a residual a smooth surface foretells on blocks that it has not seen.

    The surface is a ridge regression on polynomials of strain, pressure and direction of motion;
    the blocks are trials or stretches of the log. 0 for noise, coloured or not, near 1 for an
    error that comes back with the state. Beyond noise: the white part is taken off.
    """
    from numpy.polynomial.chebyshev import chebvander
    data = problem.data
    kept = problem.weight

    def unit(values: np.ndarray) -> np.ndarray:
        low, high = float(values.min()), float(values.max())
        return 2.0 * (values - low) / max(high - low, 1e-12) - 1.0

    strain = chebvander(unit(data.strain), 7)
    columns = [np.ones((len(data), 1))]
    for pressure in data.pressure.T:
        if np.ptp(pressure) > 0.05 * max(float(np.abs(data.pressure).max()), 1.0):
            columns.append(chebvander(unit(pressure), 3)[:, 1:])
    across = np.concatenate(columns, axis=1)
    basis = (strain[:, :, None] * across[:, None, :]).reshape(len(data), -1)
    if not data.is_static:
        way = data.direction[:, None].astype(float)
        basis = np.concatenate([basis, basis[:, :8] * way], axis=1)
    schemes = blocks(data)
    schemes.pop('direction', None)
    label = schemes.get('time', schemes.get('trial', schemes.get('isobar')))
    if label is None:
        return 0.0
    r = np.where(kept, fit.residual, 0.0)
    basis = np.where(kept[:, None], basis, 0.0)
    left = 0.0
    for block in np.unique(label):
        rows = label == block
        a, b = basis[~rows], r[~rows]
        weight = np.linalg.solve(a.T @ a + 1e-3 * len(a) * np.eye(a.shape[1]), a.T @ b)
        missed = r[rows] - basis[rows] @ weight
        # a block beyond the range of the others cannot speak against the surface
        left += min(float(missed @ missed), float(r[rows] @ r[rows]))
    total = float(r @ r) - problem.samples * problem.noise ** 2
    return float((float(r @ r) - left) / max(total, 1e-30)) if total > 0 else 0.0
