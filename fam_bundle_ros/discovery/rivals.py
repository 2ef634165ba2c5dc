# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Simple rival models: the mean force, a plane, a six-parameter empirical form, a curve of strain.

Each is a function of the training cells, strain (k,), pressure (k, m), Pa, force (k,), N, and
weight (k,), that returns the prediction as a function of strain and pressure. At constant force
the strain is predicted instead: by its mean, and by a line and a cubic in the pressure.
Predictions are limited to the range of the data: where a fold leaves one isobar only, a slope over
the pressure is determined by the noise of the gauge.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from fam_bundle_ros.discovery.cells import Cells

Prediction = Callable[[np.ndarray, np.ndarray], np.ndarray]
#: Start values of the exponent c of the empirical form; the fit begins at the best one.
_EXPONENTS = np.linspace(-60.0, 20.0, 33)


def mean(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
         ) -> Prediction:
    """Return the mean force everywhere."""
    level = float(np.average(force, weights=weight))
    return lambda e, p: np.full(len(e), level)


def plane(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
          ) -> Prediction:
    """Return the least-squares plane in strain and pressures."""
    def columns(e: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([np.ones((len(e), 1)), e[:, None], p], axis=1)
    return _linear(columns, strain, pressure, force, weight)


def empirical(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray, weight: np.ndarray,
              ) -> Prediction:
    """
    Return F = (a P + b) exp(c e) + d e P + f P + g, limited below to the lowest measured force.

    The six-parameter form of Sarosi et al. (2015, J. Theor. Appl. Mech. 53); with several motor
    units each has its own a, d and f. It is linear except for c and the lower limit.
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
        # rows at the lower limit only say that the form is not above it
        a = columns(c, strain[above], pressure[above])
        x = np.linalg.lstsq(a * root[above, None], (force * root)[above], rcond=1e-10)[0]
        return np.append(x, c)

    start = min(map(started, _EXPONENTS), key=lambda x: float(np.sum(off(x) ** 2)))
    # an exponent that was tried and is too large is not taken
    with np.errstate(over='ignore'):
        x = least_squares(off, start, slopes, x_scale=np.abs(start) + 1e-3, max_nfev=200).x
    return lambda e, p: np.maximum(columns(x[-1], e, p) @ x[:-1], floor)


def strain_alone(strain: np.ndarray, pressure: np.ndarray, force: np.ndarray,
                 weight: np.ndarray) -> Prediction:
    """Return the least-squares polynomial of degree 5 in the strain, for all pressures."""
    scale = max(float(np.abs(strain).max()), 1e-9)

    def columns(e: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.vander(e / scale, 6)
    return _linear(columns, strain, pressure, force, weight)


def rival_error(rival: str, cells: Cells, train: np.ndarray, test: np.ndarray) -> np.ndarray:
    """
    Return measured minus predicted force of a rival on test cells, N.

    Parameters
    ----------
    rival : str
        Key of `RIVALS`, or `BLIND`.
    train, test : ndarray of bool, shape (n,)
        Cells for the fit, and cells to predict.
    """
    weight, pressure = cells.count[train], cells.pressure
    if not cells.one_force:
        return cells.force[test] - fitted(rival, cells, train)(cells.strain[test], pressure[test])
    assert cells.stiffness is not None
    degree = {'mean': 0, 'plane': 1, 'empirical': 3, BLIND: 0}[rival]
    scale = np.maximum(np.abs(pressure).max(axis=0), 1.0)

    def columns(_: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([np.ones((len(p), 1)), *((p / scale) ** (k + 1)
                                                       for k in range(degree))], axis=1)
    predict = _linear(columns, cells.strain[train], pressure[train], cells.strain[train], weight)
    found = _within(cells.strain, predict(cells.strain[test], pressure[test]))
    return cells.stiffness[test] * (found - cells.strain[test])


def fitted(rival: str, cells: Cells, train: np.ndarray) -> Prediction:
    """Return a rival, a key of `RIVALS` or `BLIND`, of training cells: within measured forces."""
    form = RIVALS.get(rival, strain_alone)(cells.strain[train], cells.pressure[train],
                                           cells.force[train], cells.count[train])
    return lambda e, p: _within(cells.force, form(e, p))


def _within(data: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.clip(values, data.min(), data.max())


def _linear(columns: Callable[[np.ndarray, np.ndarray], np.ndarray], strain: np.ndarray,
            pressure: np.ndarray, force: np.ndarray, weight: np.ndarray) -> Prediction:
    root = np.sqrt(weight)[:, None]
    x = np.linalg.lstsq(columns(strain, pressure) * root, force * root[:, 0], rcond=None)[0]
    return lambda e, p: columns(e, p) @ x


#: Name of `strain_alone`, which is reported only if the effects do not predict better.
BLIND = 'strain_alone'
#: Name of each rival.
RIVALS = {'mean': mean, 'plane': plane, 'empirical': empirical}
