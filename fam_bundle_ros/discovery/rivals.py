# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a model must be better than: the mean force, a plane, a six-parameter empirical form.

And a curve of the strain alone, where the pressure should matter.

Each is a function of the training cells that returns a function of strain and pressure. At a
constant force it is the strain that is predicted: its mean, a line and a cubic in the pressure.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from fam_bundle_ros.discovery.cells import Cells

Prediction = Callable[[np.ndarray, np.ndarray], np.ndarray]
#: Exponents from the best of which the form is fitted, 1 per strain.
_EXPONENTS = np.linspace(-60.0, 20.0, 33)


def mean(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
         ) -> Prediction:
    """Return the mean force everywhere."""
    level = float(np.average(force, weights=weight))
    return lambda e, p: np.full(len(e), level)


def plane(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
          ) -> Prediction:
    """Return the plane in strain and pressures that fits best."""
    def columns(e: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([np.ones((len(e), 1)), e[:, None], p], axis=1)
    return _linear(columns, strain, pressure, force, weight)


def empirical(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
              ) -> Prediction:
    """
    Return F = (a P + b) exp(c e) + d e P + f P + g, never below the lowest force measured.

    The six-parameter form of Sarosi et al. (2015, J. Theor. Appl. Mech. 53); with several motor
    units each has its own a, d and f. Linear but for c and the floor.
    """
    floor, scale = float(force.min()), max(float(np.abs(pressure).max()), 1.0)
    root, above, units = np.sqrt(weight), force > floor, pressure.shape[1]

    def columns(c: float, e: np.ndarray, p: np.ndarray) -> np.ndarray:
        bent, p, e1 = np.exp(c * e)[:, None], p / scale, e[:, None]
        return np.concatenate([bent * p, bent, e1 * p, p, np.ones((len(e), 1))], axis=1)

    def off(x: np.ndarray) -> np.ndarray:
        return root * (np.maximum(columns(x[-1], strain, pressure) @ x[:-1], floor) - force)

    def slopes(x: np.ndarray) -> np.ndarray:
        a = columns(x[-1], strain, pressure)
        bent = a[:, :units + 1] @ x[:units + 1] * strain
        return np.where(a @ x[:-1] > floor, root, 0.0)[:, None] * np.column_stack([a, bent])

    def started(c: float) -> np.ndarray:
        # Rows at the floor say only that the form is not above it.
        a = columns(c, strain[above], pressure[above])
        x = np.linalg.lstsq(a * root[above, None], (force * root)[above], rcond=1e-10)[0]
        return np.append(x, c)

    start = min(map(started, _EXPONENTS), key=lambda x: float(np.sum(off(x) ** 2)))
    x = least_squares(off, start, slopes, x_scale=np.abs(start) + 1e-3, max_nfev=200).x
    return lambda e, p: np.maximum(columns(x[-1], e, p) @ x[:-1], floor)


def strain_alone(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
                 weight: np.ndarray) -> Prediction:
    """Return the polynomial in the strain that fits best, of degree 5, whatever the pressure."""
    scale = max(float(np.abs(strain).max()), 1e-9)

    def columns(e: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.vander(e / scale, 6)
    return _linear(columns, strain, pressure, force, weight)


def missed(rival: str, cells: Cells, train: np.ndarray, test: np.ndarray) -> np.ndarray:
    """Return the error of a rival on some cells after a fit to others, N."""
    weight, pressure = cells.count[train], cells.pressure
    if cells.stiffness is None:
        form = RIVALS.get(rival, strain_alone)
        predict = form(cells.strain[train], pressure[train], cells.force[train], weight)
        return cells.force[test] - predict(cells.strain[test], pressure[test])
    degree = {'mean': 0, 'plane': 1, 'empirical': 3, BLIND: 0}[rival]
    scale = np.maximum(np.abs(pressure).max(axis=0), 1.0)

    def columns(_: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([np.ones((len(p), 1)), *((p / scale) ** (k + 1)
                                                       for k in range(degree))], axis=1)
    predict = _linear(columns, cells.strain[train], pressure[train], cells.strain[train], weight)
    return cells.stiffness[test] * (predict(cells.strain[test], pressure[test])
                                    - cells.strain[test])


def _linear(columns: Callable[[np.ndarray, np.ndarray], np.ndarray], strain: np.ndarray,
            pressure: np.ndarray, force: np.ndarray, weight: np.ndarray) -> Prediction:
    root = np.sqrt(weight)[:, None]
    x = np.linalg.lstsq(columns(strain, pressure) * root, force * root[:, 0], rcond=None)[0]
    return lambda e, p: columns(e, p) @ x


#: The name of `strain_alone`, which is shown only where it is as good.
BLIND = 'strain_alone'
#: Name of each rival.
RIVALS = {'mean': mean, 'plane': plane, 'empirical': empirical}
