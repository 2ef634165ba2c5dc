# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
The empirical form with a smooth surface of its residual: predicts a static map without physics.

Effects that fit the measured strains may be wrong between them, where one of them is missing or
has another form. Held-out folds show it; `add.recommend` then corrects the model to this force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fam_bundle_ros.discovery.cells import Cells
from fam_bundle_ros.discovery.covariance import GRID, Hyper
from fam_bundle_ros.discovery.fitter import Fitter
from fam_bundle_ros.discovery.rivals import fitted, Prediction
from fam_bundle_ros.discovery.surface import Surface
from fam_bundle_ros.model import Motion

#: Its name among the rivals of a model.
NAME = 'empirical_surface'


@dataclass(frozen=True)
class EmpiricalSurface:
    """
    Force of a static map of one motor unit as a function of strain and pressure.

    Attributes
    ----------
    form : callable
        `rivals.empirical`, within the measured forces.
    surface : Surface
        Of its residual.
    """

    form: Prediction
    surface: Surface

    @classmethod
    def of(cls, fitter: Fitter, hyper: Hyper | None = None, used: np.ndarray | None = None,
           ) -> EmpiricalSurface:
        """
        Return the fit to some cells.

        Parameters
        ----------
        hyper : Hyper, optional
            Of the surface; by default the most probable.
        used : ndarray of bool, shape (n,), optional
            All cells by default.
        """
        cells = fitter.cells
        form = fitted('empirical', cells, np.ones(len(cells), bool) if used is None else used)
        residual = _Residual(form)
        if hyper is None:
            first = fitter.first_hyper()._replace(odd=0)
            hyper = Surface.best(fitter, residual, first, *(
                first._replace(strain=place) for place in range(GRID.strain))).hyper
        return cls(form, Surface.of(fitter, residual, hyper, used))

    def force(self, strain: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Return the force, (k,), N, at strain (k,) and pressure (k, 1), Pa."""
        return self.form(strain, pressure) + self.surface.parts(strain, pressure)[0]


@dataclass(frozen=True)
class _Residual:
    """Predicts a motion by a form of strain and pressure, as a `Bundle` does."""

    form: Prediction

    def predict(self, motion: Motion) -> np.ndarray:
        return self.form(motion.strain, motion.pressure)


def applies_to(cells: Cells) -> bool:
    """Return whether cells are of a static map of one motor unit, with measured forces."""
    return cells.data.is_static and cells.pressure.shape[1] == 1 and cells.stiffness is None


def errors(fitter: Fitter, folds: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """
    Return measured minus predicted force of the test cells of each fold, N.

    Length scales and amplitude of the surface, and the range of forces, are those of all cells.
    """
    cells, hyper = fitter.cells, EmpiricalSurface.of(fitter).surface.hyper
    return [cells.force[test] - EmpiricalSurface.of(fitter, hyper, train).force(
        cells.strain[test], cells.pressure[test]) for train, test in folds]
